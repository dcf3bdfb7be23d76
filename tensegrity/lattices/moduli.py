"""Moduli of a lattice about its state: macroscopic stiffness, stress, and speeds of long waves.

A macroscopic gradient h moves nodes and lattice vectors together, by h x, and the nodes follow by
internal motions u of their own: h x + u.  The stiffness is H_hh - H_hu (K - w^2 M)^-1 H_uh: only
the internal motions have inertia here, that of h x is the density.  A member adds to H by its own
separation d, as h d, so that nothing depends on the choice of the cell.  In a column a gradient is
also a twist about the axis: the end at r_j then moves by d_z e x r_j as seen from the other one, in
the cylindrical coordinates in which the twisted column is still periodic.
Under stress the acoustic tensor is not symmetrised.
Source: D. C. Wallace, Thermodynamics of Crystals (1972), chapter 1; Milton & Willis 2007, On
modifications of Newton's second law and linear continuum elastodynamics, for the frequency.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.errors import EquilibriumError, TensegrityError
from tensegrity.lattices.bands import FASTEST
from tensegrity.lattices.cell import Cell
from tensegrity.lattices.internal import internal_motions
from tensegrity.printing import Lines, Printed, span
from tensegrity.typing import Array

NOISE = 1e-13  # of the unrelaxed stiffness: round-off of the square of a speed
ALONG = 1e-9  # largest part of a direction outside the lattice, over its length


@dataclass(frozen=True, eq=False, repr=False)
class Moduli(Printed):
    """Moduli of a lattice.

    Attributes
    ----------
    tangent : ndarray, (dim, dim, dim, dim)
        A_ijkl = dP_ij/dF_kl about the state, nodes relaxed [N/m^(d - 1)]: i and k are components
        of force and motion, j and l of normal and gradient.
    stress : ndarray, (dim, dim)
        Macroscopic stress [N/m^(d - 1)], tension > 0; see `Lattice.stress`.
    stiffness : ndarray, (dim, dim, dim, dim)
        c_ijkl = A_ijkl - delta_ik stress_jl, symmetric in ij, in kl and in the pairs.
    density : float
        Mass per length, area or volume of the lattice [kg/m^d].
    axial, coupling, torsional : float
        For columns: force per strain with the twist fixed [N], force per twist per length [N m],
        moment per twist per length [N m^2]; for strips the first one; NaN otherwise.
    """

    tangent: Array
    stress: Array
    stiffness: Array
    density: float
    axial: float
    coupling: float
    torsional: float
    lattice: Cell = field(repr=False)
    frequency: float = 0.0

    def _lines(self) -> Lines:
        d = len(self.lattice.vectors)
        stress, per = ("N/m^2" if d == 3 else "N/m" if d == 2 else "N"), "kg/m" + f"^{d}" * (d > 1)
        tangent, pulled = span(self.tangent, stress), np.abs(self.tangent).max()
        yield f"moduli at {self.frequency:.6g} rad/s, density {self.density:.6g} {per}"
        yield f"  tangent {tangent}, stress {span(self.stress, stress, pulled)}"
        mixed = np.sqrt(np.abs(self.axial * self.torsional))  # N m
        units = {"axial": ("N", 0), "coupling": ("N m", mixed), "torsional": ("N m^2", 0)}
        for name, of in units.items():
            if np.isfinite(getattr(self, name)):
                yield f"  {name} {span(getattr(self, name), *of)}"

    def speeds(self, direction: Sequence[float] | Array) -> Array:
        """Speeds of long waves [m/s].

        Parameters
        ----------
        direction : array_like, (dim,)
            In the span of the lattice vectors; of any length.

        Returns
        -------
        ndarray, (dim,), of columns (4,) with the rotation about the axis
            Ascending.  A growing motion, whose squared speed is negative, has minus the root of
            its modulus.

        Raises
        ------
        TensegrityError
            If the direction is 0 or outside the span of the lattice vectors.
        """
        n = check.vector("direction", direction, (self.lattice.dim,))
        if not n.any():
            raise TensegrityError("direction has length 0, must be above 0")
        n = n / np.abs(n).max()  # its square is then representable
        n = n / np.linalg.norm(n)
        off = n - np.linalg.pinv(self.lattice.vectors) @ (self.lattice.vectors @ n)
        if np.abs(off).max() > ALONG:
            raise TensegrityError(f"direction {check.shown(direction)} leaves the vectors' span")
        stiff, sizes, arms = _gradients(self.lattice, self.frequency)
        along, inertia = np.kron(np.eye(len(n)), n[:, None]), np.full(len(n), self.density)
        if arms is not None:  # a twist of 1 rad
            turned = float(self.lattice.mass @ np.sum(arms**2, axis=1)) / self.lattice.size
            along, inertia = np.pad(along, (0, 1)), np.append(inertia, turned)
            along[-1, -1] = 1
        root = 1 / np.sqrt(inertia)
        squares = np.linalg.eigvalsh(root[:, None] * (along.T @ stiff @ along) * root)
        squares[np.abs(squares) <= NOISE * np.max(sizes @ along**2 * root**2)] = 0
        return np.asarray(np.sign(squares) * np.sqrt(np.abs(squares)))


@checked
def moduli(
    lattice: Cell, frequency: Annotated[float, ">= 0", f"< {FASTEST}", "rad/s"] = 0.0
) -> Moduli:
    """Moduli of a lattice about its own state.

    Parameters
    ----------
    lattice : Lattice
        With its nodes in equilibrium; a macroscopic stress is allowed.
    frequency : float, optional
        Angular frequency of a uniform strain [rad/s], which the nodes of a cell follow with their
        inertia.  That of the strain itself, which moves nodes and lattice vectors together, is the
        density.  Moduli do not depend on which cell describes the lattice.

    Returns
    -------
    Moduli

    Raises
    ------
    TensegrityError
        Bad input, or a frequency at which the nodes within a cell resonate.
    EquilibriumError
        The nodes are not in equilibrium, or strain does work on a motion without stiffness, as in
        a mechanism under load.

    Examples
    --------
    The triangular lattice of springs is isotropic with equal Lame constants:

    >>> from tensegrity import Lattice, moduli
    >>> pairs = [(0, 0, (1, 0)), (0, 0, (0, 1)), (0, 0, (1, -1))]
    >>> tri = Lattice([(0, 0)], [(1, 0), (0.5, 0.75**0.5)], bars=pairs, k_bar=1)
    >>> m = moduli(tri)
    >>> (m.speeds([1, 2])**2).round(4).tolist(), float(m.stiffness[0, 0, 1, 1].round(4))
    ([0.375, 1.125], 0.433)
    """
    lattice.refuse_unbalanced()
    dim, stress = lattice.dim, lattice.stress
    stiff, _, arms = _gradients(lattice, frequency)
    tangent = stiff[: dim**2, : dim**2].reshape(dim, dim, dim, dim)
    stiffness = tangent - np.einsum("ik,jl->ijkl", np.eye(dim), stress)
    axial = coupling = torsional = np.nan
    if len(lattice.vectors) == 1:
        n = lattice.vectors[0] / lattice.size
        stretch = np.outer(n, n).ravel()
        axial = float(stretch @ stiff[: dim**2, : dim**2] @ stretch)
        if arms is not None:
            coupling, torsional = float(stretch @ stiff[:-1, -1]), float(stiff[-1, -1])
    density = float(lattice.mass.sum()) / lattice.size
    return Moduli(
        tangent, stress, stiffness, density, axial, coupling, torsional, lattice, frequency
    )


def _gradients(lattice: Cell, frequency: float) -> tuple[Array, Array, Array | None]:
    """Stiffness against macroscopic gradients h_kl, then the twist of a column, per size of a cell;
    the sums of the sizes of the parts of its diagonal; and the arms of the twist."""
    size, ends = lattice.positions.size, lattice.ends.T
    moved, arms = _moved_ends(lattice)
    blocks = lattice.members.blocks(lattice.positions)
    forces, largest = np.zeros((2, lattice.nodes, lattice.dim, moved[0].shape[2]))
    for sign, end, other in zip((-1, 1), ends, moved, strict=True):
        np.add.at(forces, end, sign * blocks @ other)
        np.add.at(largest, end, np.abs(blocks) @ np.abs(other))
    forces, largest = forces.reshape(size, -1), largest.reshape(size, -1)
    inner, mass = lattice.hessian()[:size, :size], np.repeat(lattice.mass, lattice.dim)
    motions, unbounded, _ = internal_motions(inner, mass, np.array(frequency), forces, largest)
    if unbounded and frequency:
        raise TensegrityError(
            f"frequency {frequency:.12g} rad/s is a resonance of the nodes within a cell: moduli "
            "are infinite there"
        )
    if unbounded:
        raise EquilibriumError(
            "no moduli: strain does work on a motion without stiffness; prestress may stiffen it"
        )
    second, first = moved
    whole = np.tensordot(first, blocks @ second, ([0, 1], [0, 1]))
    sizes = np.sum(np.abs(first) * (np.abs(blocks) @ np.abs(second)), axis=(0, 1))
    relaxed = (whole + whole.T) / 2 - forces.T @ motions
    return relaxed / lattice.size, sizes / lattice.size, arms


def _moved_ends(lattice: Cell) -> tuple[tuple[Array, Array], Array | None]:
    """How gradients of 1 move second ends as seen from the first, and first ends as seen from the
    second, reversed, (members, dim, gradients) each; and the arms of a twist, (nodes, dim)."""
    x, dim, vectors = lattice.positions, lattice.dim, lattice.vectors
    d = lattice.members.separations(x)[0] @ np.linalg.pinv(vectors) @ vectors
    shifts = np.einsum("ik,ml->mikl", np.eye(dim), d).reshape(len(d), dim, -1)
    if dim == 3 and len(vectors) == 1:
        axis = vectors[0] / lattice.size
        arms = np.cross(axis, x - np.average(x, axis=0, weights=lattice.mass))
        if np.abs(arms).max() > ALONG * lattice.span:
            turns = ((d @ axis)[:, None] * arms[end] for end in lattice.ends.T)
            first, second = (np.dstack([shifts, turn]) for turn in turns)
            return (second, first), arms
    return (shifts, shifts), None
