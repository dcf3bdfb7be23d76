"""All members of a structure at once: lengths, tensions, energy, gradient and tangent.

The forms are those of `derivations.member`.  Members are rows.  A string pulls where it is longer
than its natural length, to the last bit; its stiffness jumps there, so that round-off would decide
on it: one that is shorter by less than `TAUT` of its natural length counts as taut, with the
stiffness that it has as soon as it lengthens.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.once import once
from tensegrity.springs.kinks import TAUT

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

    def taut(self, lengths: Array, within: float = TAUT) -> Flags:
        """Which members count with their stiffness: bars, and strings not shorter than their
        natural length by more than a part of it."""
        return ~self.pulls_only | (lengths >= (1 - within) * self.natural)

    def elongations(self, lengths: Array) -> Array:
        """By which members have a force [m], (members,); 0 of strings not beyond their natural
        length."""
        return np.maximum(lengths - self.natural, np.where(self.pulls_only, 0.0, -np.inf))

    def tensions(self, positions: Array) -> Array:
        """[N], (members,); 0 of slack strings."""
        return self.stiffness * self.elongations(self.apart(positions)[1])

    def energy(self, positions: Array) -> float:
        """Stored in all [J]."""
        elongations = self.elongations(self.apart(positions)[1])
        return float(0.5 * np.sum(self.stiffness * elongations**2))

    def gradient(self, positions: Array) -> Array:
        """Of the energy in the positions [N], (nodes, dim): minus the force on the nodes."""
        d, lengths = self.apart(positions)
        pull = (self.stiffness * self.elongations(lengths) / lengths)[:, None] * d
        result = np.zeros_like(positions)
        np.add.at(result, self.ends[:, 1], pull)
        np.subtract.at(result, self.ends[:, 0], pull)
        return result

    def tangent(self, positions: Array, within: float = TAUT) -> Any:
        """Hessian of the energy [N/m], sparse (nodes dim, nodes dim); `within` as of `taut`."""
        import scipy.sparse as sparse

        nodes, dim = positions.shape
        d, lengths = self.apart(positions)
        density = self.stiffness * self.elongations(lengths) / lengths
        blocks = member_blocks(d, lengths, density, self.stiffness, self.taut(lengths, within))
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
