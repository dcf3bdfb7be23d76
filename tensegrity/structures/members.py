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

from tensegrity.engine import forces
from tensegrity.springs.corners import TAUT

if TYPE_CHECKING:
    from typing import Any

    from tensegrity.typing import Array, Flags, Indices


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
        first, second = self.ends.T
        result: Array = -forces.scattered(first, second, pull, len(positions))
        return result

    def tangent(self, positions: Array, within: float = TAUT) -> Any:
        """Hessian of the energy [N/m], sparse (nodes dim, nodes dim); `within` as of `taut`."""
        d, lengths = self.apart(positions)
        density = self.stiffness * self.elongations(lengths) / lengths
        stiffness = np.where(self.taut(lengths, within), self.stiffness, 0.0)
        blocks = forces.tangents(d / lengths[:, None], stiffness, density)
        first, second = self.ends.T
        return forces.assembled(first, second, blocks, len(positions)).tocsr()
