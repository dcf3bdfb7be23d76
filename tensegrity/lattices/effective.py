"""Effective mass: the inertia of a frame of nodes that move together, with the others attached.

A translation T of the frame pulls the other nodes by f = -K_if T = K_ii T, and these follow by
(K_ii - w^2 M_i)^-1 f.  Their momentum gives m(w) = m_frame + (M_i T)^T (K_ii - w^2 M_i)^-1 f, where
nothing cancels.
Source: Milton & Willis 2007, On modifications of Newton's second law and linear continuum
elastodynamics.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.errors import EquilibriumError, TensegrityError
from tensegrity.lattices.bands import angular_frequencies
from tensegrity.lattices.bloch import chunks
from tensegrity.lattices.internal import internal_motions
from tensegrity.lattices.lattice import Lattice
from tensegrity.typing import Array


@checked
def effective_mass(lattice: Lattice, frame: Sequence[int], frequencies: ArrayLike) -> Array:
    """Dynamic effective mass of a cell whose frame moves equally in all cells.

    Parameters
    ----------
    lattice : Lattice
        With its nodes in equilibrium; with the frame held the other nodes must be stable.
    frame : sequence of int
        The nodes of the cell that undergo the same displacement u in all cells.
    frequencies : array_like, (frequencies,)
        Angular frequencies of u [rad/s].

    Returns
    -------
    ndarray, (frequencies, dim, dim)
        m [kg]: the force on the frame of each cell is -w^2 m u.  At w = 0 it is the mass of the
        frame and of all nodes attached to it.

    Raises
    ------
    TensegrityError
        Bad input, or a frequency at which a node outside the frame resonates.
    EquilibriumError
        The nodes are not in equilibrium, or not stable with the frame held.

    Examples
    --------
    A mass of 2 kg on springs in a frame of 1 kg resonates at 1 rad/s:

    >>> from tensegrity import Lattice, effective_mass
    >>> members = [(0, 0, 1), (0, 1), (1, 0, 1)]
    >>> chain = Lattice([(0, 0), (0.5, 0)], [(1, 0)], members, k_bar=[3, 1, 1], mass=[1, 2])
    >>> effective_mass(chain, [0], [0, 0.5, 1.2])[:, 0, 0].round(4).tolist()
    [3.0, 3.6667, -3.5455]
    """
    w = angular_frequencies(frequencies, lattice.dim**2)
    nodes = check.sequence("frame", frame, "numbers of nodes")
    numbers = [check.whole("node", n, least=0, below=lattice.nodes) for n in nodes]
    if not numbers or len(set(numbers)) < len(numbers):
        raise TensegrityError(f"frame {check.shown(numbers)} must be distinct nodes, at least 1")
    lattice.refuse_unbalanced()
    dim, size = lattice.dim, lattice.positions.size
    free = np.ones(lattice.nodes, dtype=bool)
    free[numbers] = False
    inner, mass = np.repeat(free, dim), np.repeat(lattice.mass[free], dim)
    moved = np.kron(np.ones((lattice.nodes, 1)), np.eye(dim))
    whole = lattice.hessian()[:size, :size]
    held, joined = whole[np.ix_(inner, inner)], whole[np.ix_(inner, ~inner)]
    pull = -joined @ moved[~inner], np.abs(joined) @ moved[~inner]
    if (internal_motions(held, mass, np.zeros(()), *pull)[2] < 0).any():
        growth = np.linalg.eigvalsh(held / np.sqrt(mass * mass[:, None]))[0]
        raise EquilibriumError(
            f"with the frame held the other nodes are unstable: they grow at "
            f"{np.sqrt(-growth):.6g} 1/s"
        )
    masses = np.empty((len(w), dim, dim))
    for of in chunks(len(w), len(mass)):
        motions, unbounded, _ = internal_motions(held, mass, w[of], *pull)
        if unbounded.any():
            raise TensegrityError(
                f"frequency {w[of][unbounded][0]:.12g} rad/s is a resonance of the nodes outside "
                "the frame: the effective mass is infinite there"
            )
        masses[of] = (mass[:, None] * moved[inner]).T @ motions
    return float(lattice.mass[~free].sum()) * np.eye(dim) + masses
