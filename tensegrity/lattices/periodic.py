"""What repeats along lattice vectors: its matrices, and what macroscopic gradients do to a cell.

A lattice, with a matrix around it or without, is asked for the entries of its stiffness and inertia
by the offsets of the cells that they join, from which `bloch` makes matrices of waves, and for the
forces of a macroscopic gradient on its coordinates, of which `moduli` are made.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from tensegrity.typing import Array, Indices

ALONG = 1e-9  # largest part of a direction outside the lattice, over its length


@dataclass(frozen=True, eq=False)
class Entries:
    """Entries of the matrices S_o, which add up where they coincide.

    Attributes
    ----------
    offsets : ndarray of int, (offsets, d)
    number, row, column : ndarray of int, (entries,)
        Number of the offset o; the coordinates of a cell, and of the one at o, that are joined.
    values : ndarray, (entries,)
    """

    offsets: Indices
    number: Indices
    row: Indices
    column: Indices
    values: Array

    @classmethod
    def of_bonds(cls, ends: Indices, offsets: Indices, blocks: Array) -> Entries:
        """Those of bonds.

        Parameters
        ----------
        ends : ndarray of int, (bonds, 2)
            Nodes of a cell.
        offsets : ndarray of int, (bonds, d)
            Offset of the cell of the second end from that of the first.
        blocks : ndarray, (bonds, 2 dim, 2 dim)
            By both ends.

        Returns
        -------
        Entries
        """
        (i, j), dim = ends.T, blocks.shape[-1] // 2
        first, second = slice(dim), slice(dim, None)
        whole = [
            (np.zeros_like(offsets), i, i, blocks[:, first, first]),
            (np.zeros_like(offsets), j, j, blocks[:, second, second]),
            (offsets, i, j, blocks[:, first, second]),
            (-offsets, j, i, blocks[:, second, first]),
        ]
        offset, row, column, each = (np.concatenate([one[k] for one in whole]) for k in range(4))
        distinct, number = np.unique(offset, axis=0, return_inverse=True)
        number, row, column = (k.reshape(-1, 1, 1) for k in (number, dim * row, dim * column))
        places = number, row + np.arange(dim)[:, None], column + np.arange(dim)
        number, row, column = (np.broadcast_to(k, each.shape).ravel() for k in places)
        return cls(distinct, number, row, column, each.ravel())

    @classmethod
    def diagonal(cls, values: Array, d: int) -> Entries:
        """Those of a diagonal within the cell."""
        each = np.arange(len(values))
        return cls(np.zeros((1, d), dtype=np.int64), 0 * each, each, each, values)


Assembly = tuple[list[Entries], Array, list[Entries]]  # of K, masses of the coordinates, rest of M


class Periodic(ABC):
    """What repeats along lattice vectors, and carries waves."""

    vectors: Array

    @property
    @abstractmethod
    def _unknowns(self) -> tuple[int, int]:
        """Nodes of a cell, and coordinates of a node."""

    @abstractmethod
    def _assembly(self) -> Assembly:
        """Stiffness, masses of the coordinates, and further inertia."""

    @abstractmethod
    def refuse_unbalanced(self) -> None:
        """Refuse positions at which the nodes are not in equilibrium."""

    @property
    def _lossy(self) -> bool:
        """Whether waves lose energy."""
        return False

    def _loss_factors(self, q: Array, squares: Array, shapes: Any) -> Array:
        """Loss factors (branches,) of waves at phases (d,), of squared frequencies (branches,) and
        shapes (size, branches) of unit modal mass."""
        return np.zeros(len(squares))


class UnderGradients(NamedTuple):
    """What macroscopic gradients h_kl of 1 do to a cell, then a twist of a column.

    Attributes
    ----------
    forces, largest : ndarray, (size, gradients)
        On the coordinates of a cell [N], reversed, and the sums of the sizes of their parts.
    whole : ndarray, (gradients, gradients)
        Second derivatives of the energy of a cell with the coordinates held [J].
    sizes : ndarray, (gradients,)
        Sums of the sizes of the parts of its diagonal.
    arms : ndarray, (nodes, dim), or None
        Displacements of the nodes of a column that turns by 1 rad [m].
    """

    forces: Array
    largest: Array
    whole: Array
    sizes: Array
    arms: Array | None = None


class Medium(Periodic):
    """What repeats along lattice vectors, and has moduli."""

    _affine = False  # whether there are no waves but long ones

    @property
    @abstractmethod
    def stress(self) -> Array:
        """Macroscopic stress, (dim, dim)."""

    @property
    def cell(self) -> Any:
        """The lattice, a `Cell`."""
        return self

    @property
    def components(self) -> int:
        """Components of a displacement, as many as dimensions, or 1 out of the plane."""
        return int(self.cell.dim)

    @property
    def density(self) -> float:
        """Mass over the size of a cell [kg/m^d]."""
        return float(self.cell.weighing_mass.sum()) / float(self.cell.size)

    @abstractmethod
    def _under_gradients(self) -> UnderGradients:
        """What macroscopic gradients do to a cell."""

    @abstractmethod
    def _at_rest(self) -> tuple[Array, Array]:
        """Stiffness [N/m] and inertia [kg] of motions that are the same in all cells: (size, size),
        and (size,) where it is diagonal."""

    @abstractmethod
    def _coordinates(self) -> tuple[Indices, Indices]:
        """The node of each coordinate of a cell, or -1, and its axis, or -1 of rotations,
        (size,)."""


def members_under_gradients(cell: Any, blocks: Array) -> UnderGradients:
    """What macroscopic gradients do to the members of a cell.

    Parameters
    ----------
    cell : Cell
    blocks : ndarray, (members, components, components)
        Tangent stiffness of each member [N/m].

    Returns
    -------
    UnderGradients
    """
    moved, arms = _moved_ends(cell, blocks.shape[1])
    forces, largest = np.zeros((2, cell.nodes, blocks.shape[1], moved[0].shape[2]))
    for sign, end, other in zip((-1, 1), cell.ends.T, moved, strict=True):
        np.add.at(forces, end, sign * blocks @ other)
        np.add.at(largest, end, np.abs(blocks) @ np.abs(other))
    (second, first), count = moved, moved[0].shape[2]
    whole = np.tensordot(first, blocks @ second, ([0, 1], [0, 1]))
    sizes = np.sum(np.abs(first) * (np.abs(blocks) @ np.abs(second)), axis=(0, 1))
    shape = forces.size // count, count
    return UnderGradients(forces.reshape(shape), largest.reshape(shape), whole, sizes, arms)


def _moved_ends(cell: Any, components: int) -> tuple[tuple[Array, Array], Array | None]:
    """How gradients of 1 move second ends as seen from the first, and first ends as seen from the
    second, reversed, (members, components, gradients) each; and the arms of a twist."""
    x, dim, vectors = cell.positions, cell.dim, cell.vectors
    d = cell.members.separations(x)[0] @ np.linalg.pinv(vectors) @ vectors
    shifts = np.einsum("ik,ml->mikl", np.eye(components), d).reshape(len(d), components, -1)
    if dim == 3 and len(vectors) == 1:
        axis = vectors[0] / cell.size
        arms = np.cross(axis, x - np.average(x, axis=0, weights=cell.weighing_mass))
        if np.abs(arms).max() > ALONG * cell.span:
            turns = ((d @ axis)[:, None] * arms[end] for end in cell.ends.T)
            first, second = (np.dstack([shifts, turn]) for turn in turns)
            return (second, first), arms
    return (shifts, shifts), None
