"""All members of a structure at once: lengths, tensions, energy, gradient and tangent.

The forms are those of `derivations.member`.  Members are rows; a flag says which are taut, that
is, which have any force at all.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.once import once

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from tensegrity.typing import Array, Flags, Indices


@once
def _tangent(dim: int) -> Callable[..., Any]:
    """Upper entries of the tangent of members in (d, length, density, stiffness)."""
    import sympy as sp

    from derivations import member

    matrix = member.tangent(dim)
    upper = [matrix[i, j] for i in range(dim) for j in range(i, dim)]
    symbols = (*member.separation(dim), member.length, member.density, member.stiffness)
    return sp.lambdify(symbols, upper, "numpy", cse=True)


def member_blocks(d: Array, lengths: Array, density: Array, stiffness: Array, taut: Flags) -> Array:
    """Tangent of each member in its own separation [N/m], (members, dim, dim)."""
    members, dim = d.shape
    upper = _tangent(dim)(*d.T, lengths, density, stiffness)
    result = np.empty((members, dim, dim))
    places = [(i, j) for i in range(dim) for j in range(i, dim)]
    for (i, j), entry in zip(places, upper, strict=True):
        result[:, i, j] = result[:, j, i] = np.where(taut, entry, 0.0)
    return result


@dataclass(frozen=True)
class Members:
    """Members as arrays.

    Attributes
    ----------
    ends : ndarray of int, (members, 2)
    stiffness, natural : ndarray, (members,)
        [N/m], [m].
    pulls_only : ndarray of bool, (members,)
        Strings.
    """

    ends: Indices
    stiffness: Array
    natural: Array
    pulls_only: Flags

    def apart(self, positions: Array) -> tuple[Array, Array]:
        """Vectors (members, dim) from first to second ends, and their lengths."""
        d = positions[self.ends[:, 1]] - positions[self.ends[:, 0]]
        return d, np.sqrt(np.einsum("ij,ij->i", d, d))

    def taut(self, lengths: Array) -> Flags:
        """Which members have a force: bars, and strings not shorter than their natural length."""
        return ~self.pulls_only | (lengths >= self.natural)

    def tensions(self, positions: Array, taut: Flags | None = None) -> Array:
        """[N], (members,); 0 of slack strings."""
        _, lengths = self.apart(positions)
        taut = self.taut(lengths) if taut is None else taut
        return np.where(taut, self.stiffness * (lengths - self.natural), 0.0)

    def energy(self, positions: Array) -> float:
        """Stored in all [J]."""
        _, lengths = self.apart(positions)
        stretched = np.where(self.taut(lengths), lengths - self.natural, 0.0)
        return float(0.5 * np.sum(self.stiffness * stretched**2))

    def gradient(self, positions: Array, taut: Flags | None = None) -> Array:
        """Of the energy in the positions [N], (nodes, dim): minus the force on the nodes."""
        d, lengths = self.apart(positions)
        taut = self.taut(lengths) if taut is None else taut
        density = np.where(taut, self.stiffness * (lengths - self.natural) / lengths, 0.0)
        pull = density[:, None] * d
        result = np.zeros_like(positions)
        np.add.at(result, self.ends[:, 1], pull)
        np.subtract.at(result, self.ends[:, 0], pull)
        return result

    def blocks(self, positions: Array, taut: Flags | None = None) -> Array:
        """Tangent of each member in its own separation [N/m], (members, dim, dim)."""
        d, lengths = self.apart(positions)
        taut = self.taut(lengths) if taut is None else taut
        density = self.stiffness * (lengths - self.natural) / lengths
        return member_blocks(d, lengths, density, self.stiffness, taut)

    def tangent(self, positions: Array, taut: Flags | None = None) -> Any:
        """Hessian of the energy [N/m], sparse (nodes dim, nodes dim)."""
        import scipy.sparse as sparse

        nodes, dim = positions.shape
        blocks = self.blocks(positions, taut)
        axes = np.arange(dim)
        first, second = (dim * self.ends[:, i, None] + axes for i in (0, 1))
        rows, columns, values = [], [], []
        for left, right, sign in (
            (first, first, 1), (second, second, 1), (first, second, -1), (second, first, -1),
        ):  # fmt: skip
            rows.append(np.broadcast_to(left[:, :, None], blocks.shape).ravel())
            columns.append(np.broadcast_to(right[:, None, :], blocks.shape).ravel())
            values.append(sign * blocks.ravel())
        size = nodes * dim
        triplets = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
        return sparse.coo_matrix(triplets, shape=(size, size)).tocsr()

    def dense_tangent(self, positions: Array, taut: Flags | None = None) -> Array:
        """The same as a dense array."""
        nodes, dim = positions.shape
        blocks = self.blocks(positions, taut)
        result = np.zeros((nodes, dim, nodes, dim))
        i, j = self.ends.T
        rows = result.transpose(0, 2, 1, 3)  # a view: pairs of nodes first
        for left, right, sign in ((i, i, 1), (j, j, 1), (i, j, -1), (j, i, -1)):
            np.add.at(rows, (left, right), sign * blocks)
        return result.reshape(nodes * dim, nodes * dim)
