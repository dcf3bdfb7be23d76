"""Effective mass: the inertia of a frame of nodes that move together, with the others attached.

With the modes phi_s and frequencies w_s of the other nodes, the frame held, and their modal masses
p_s = phi_s^T M T over the translations T, m(w) = m_frame + sum of p_s p_s^T w_s^2/(w_s^2 - w^2).
Source: Milton & Willis 2007, On modifications of Newton's second law and linear continuum
elastodynamics.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.errors import EquilibriumError, TensegrityError
from tensegrity.lattices.bands import angular_frequencies, bloch_matrix
from tensegrity.lattices.lattice import Lattice
from tensegrity.minimum import ZERO
from tensegrity.typing import Array

POLE = 1e-12  # distance of a frequency from a resonance, over it, at which the mass is infinite


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
    check.kind("lattice", lattice, Lattice)
    w = angular_frequencies(frequencies)
    nodes = check.sequence("frame", frame, "numbers of nodes")
    numbers = [check.whole("node", n, least=0, below=lattice.nodes) for n in nodes]
    if not numbers or len(set(numbers)) < len(numbers):
        raise TensegrityError(f"frame {check.shown(numbers)} must be distinct nodes, at least 1")
    lattice.refuse_unbalanced()
    dim, free = lattice.dim, np.ones(lattice.nodes, dtype=bool)
    free[numbers] = False
    matrix = bloch_matrix(lattice)
    whole = matrix.at(np.ones(len(matrix.offsets), dtype=complex)).real
    inner = np.flatnonzero(np.repeat(free, dim))
    squares, modes = np.linalg.eigh(whole[np.ix_(inner, inner)])
    least = ZERO * matrix.bound
    if squares.size and squares[0] < -least:
        raise EquilibriumError(
            f"with the frame held the other nodes are unstable: they grow at "
            f"{np.sqrt(-squares[0]):.6g} 1/s"
        )
    modal = modes.T @ np.kron(np.sqrt(lattice.mass[free])[:, None], np.eye(dim))
    carried = squares > least
    squares, modal = squares[carried], modal[carried]
    near = np.abs(w[:, None] ** 2 - squares) <= 2 * POLE * squares
    near &= np.abs(modal).max(axis=1) > POLE * np.sqrt(lattice.mass.max())
    if near.any():
        point, mode = np.argwhere(near)[0]
        raise TensegrityError(
            f"frequency {w[point]:.12g} rad/s is the resonance {np.sqrt(squares[mode]):.12g} rad/s "
            "of the nodes outside the frame: the effective mass is infinite there"
        )
    gain = squares / np.where(near, 1.0, squares - w[:, None] ** 2)
    own = float(lattice.mass[~free].sum()) * np.eye(dim)
    return np.asarray(own + np.einsum("ws,si,sj->wij", gain, modal, modal))
