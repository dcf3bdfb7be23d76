"""Quantities derived from a network whose bonds have energies of both ends, V(q_i, q_j).

A run notes the ranges of the differences of free coordinates and of the values of others.  With
lambda_b the largest eigenvalue of M^-1/2 V'' M^-1/2 of bond b in that box, the squares of the
angular frequencies are at most the largest sum of lambda_b over the bonds of a site, since
x' K x = sum x_b' V''_b x_b.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from tensegrity.scenes.network_dynamics import NetworkDynamics
from tensegrity.springs.collection import Springs
from tensegrity.typing import Array, Flags, Indices


class PairLaws(Springs):
    """The distinct pair laws of a network, of one form."""

    def reachable(self, energy: float) -> tuple[Array, Flags]:
        """Ranges that bonds can reach with an energy [J], (dim, 2), which have no ends."""
        each = np.array([spring.reachable(energy) for spring in self.different])
        ranges = np.stack([each[..., 0].min(axis=0), each[..., 1].max(axis=0)], axis=1)
        return ranges, np.zeros(len(ranges), dtype=bool)


class PairDynamics(NetworkDynamics):
    """Quantities derived from a network of one `PairLaw`, with any values of its parameters."""

    turns = False
    zero_length_elongation: Any = -np.inf

    @cached_property
    def springs(self) -> PairLaws:
        """The distinct pair laws, and the index of the one of each bond."""
        return PairLaws(self.scene.springs)

    @cached_property
    def free(self) -> Array:
        """Whether each coordinate is free; (dim,)."""
        return np.array(self.springs.different[0].free)

    @property
    def domains(self) -> Array:
        """Lowest and highest of each range, which have no ends; (dim, 2)."""
        return np.tile([-np.inf, np.inf], (self.dim, 1))

    def ranges_at(self, u: Array) -> Array:
        """Smallest and largest difference of each free coordinate, and value of others, 0 included;
        (dim, 2)."""
        first, second = (u[..., end, :] for end in self.scene.bonds.T)
        ends = np.where(self.free, second - first, first), np.where(self.free, 0.0, second)
        both = np.concatenate([x.reshape(-1, self.dim) for x in ends] + [np.zeros((1, self.dim))])
        return np.stack([both.min(axis=0), both.max(axis=0)], axis=1)

    def stiffness_bounds(self, ranges: Array, numbers: Indices | None = None) -> Array:
        """Bound on the stiffness over all ranges together [N/m], for each of them, (dim,), or those
        with such numbers: that of the frequencies, times the least inertia."""
        weights = self.inverse_mass.max(axis=0)
        each = [one.largest_stiffness(ranges, weights) for one in self.springs.different]
        total = np.zeros(self.sites)
        for end in self.scene.bonds.T:
            np.add.at(total, end, np.array(each)[self.springs.group])
        bound = total.max() / self._largest
        return np.full(self.dim if numbers is None else len(numbers), bound)

    def spring_frequency_bound(self, stiffness: Array) -> float:
        """Bound on the largest angular frequency [rad/s]; see `stiffness_bounds`."""
        return float(np.sqrt(stiffness.max() * self._largest))

    @cached_property
    def _largest(self) -> Any:
        """Largest inverse inertia."""
        return self.inverse_mass.max() or 1.0

    def where_extreme(self, spring: int, u: Array, side: int) -> str:
        """Describe the bond of most energy."""
        return self._where(int(np.argmax(self.elongations(u))))

    def where_stiffest(self, u: Array, ranges: Array) -> str:
        """Describe the bond of most energy."""
        return self.where_extreme(0, u, 1)
