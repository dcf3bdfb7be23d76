"""What time does to a scene, as loops take it: numbers of all kicks and drifts, from their times.

Drives, dashpots and springs that change are prepared here, in arrays of each stage's instant; what
advances by them is compiled: see `driven`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from tensegrity.engine.bonds import Bonds
    from tensegrity.engine.methods import Splitting
    from tensegrity.typing import Array, Indices

FREE, APART, JOINED, TURNING = range(4)  # as in driven.c
LEAST_TERMS = 12  # of the series of a drift
NODES = 8  # instants of a drift from which prescribed velocities are taken as polynomials
SMALL = 1e-17  # first term of the series that is left out, relative
ROWS = "moved_u", "moved_v", "force", "force_rate", "shared", "domain", "series", "rubbed"
LARGEST_DAMPING = 2.0  # of a drift: time times the largest rate of decay


@dataclass(frozen=True, eq=False)
class Forcing:
    """What time does to a scene, as its loop takes it.

    Entries are those of u, one after the other.

    Attributes
    ----------
    bonds : Bonds
        Of the scene.
    moved, forced : ndarray of int
        Entries whose motion is prescribed, and those that get a force.
    motion, force : callable (t, order) -> ndarray, (t.size, entries)
        Displacements [m], forces [N], and their rates for order 1.
    mass : ndarray, (entries,)
        [kg]; 0 where the motion is prescribed.
    heavy : ndarray, (moved,)
        Masses there [kg].
    ground : ndarray, (entries,)
        Dashpots to the ground [N s/m].
    bond : ndarray, (bonds,)
        Dashpots in the bonds [N s/m]; not in contacts with walls, which stand behind the bonds.
    tuning : object or None
        Springs that change: `law`, the numbers of parameters that are `moving`, `at(t)` and
        `numbers(t)`, rows for each of t.
    """

    bonds: Bonds
    moved: Indices
    forced: Indices
    motion: Callable[[Array, int], Array]
    force: Callable[[Array, int], Array]
    mass: Array
    heavy: Array
    ground: Array
    bond: Array
    tuning: Any

    @property
    def damped(self) -> int:
        """What dashpots there are, as `driven.c` counts."""
        if self.bond.any():
            return JOINED if self.bonds.contacts is None else TURNING
        return APART if self.ground.any() else FREE

    @property
    def contacts(self) -> Any:
        """Those of the bonds of a network."""
        return self.bonds.contacts

    @property
    def joined(self) -> Indices:
        """Numbers of the bonds of a network that have dashpots."""
        return np.flatnonzero(self.bond) if self.damped == TURNING else np.zeros(0, dtype=int)

    @property
    def decay(self) -> float:
        """Bound on the rates at which velocities decay by dashpots [1/s]."""
        total = self.ground.copy()
        if self.damped == JOINED:
            total[1:] += 2 * self.bond
            total[:-1] += 2 * self.bond
        elif self.damped == TURNING:
            by_site = total.reshape(len(self.contacts.load), -1)  # a view
            for ends in (self.contacts.first, self.contacts.second):
                np.add.at(by_site, ends[self.joined], 2 * self.bond[self.joined, None])
        weights = np.divide(1, self.mass, out=np.zeros_like(total), where=self.mass > 0)
        return float(np.max(total * weights, initial=0.0))


class Schedule:
    """Rows of numbers for all kicks and drifts of some steps, from their times alone.

    Parameters
    ----------
    forcing : Forcing
    method : Splitting
    dt : float
        [s]
    """

    def __init__(self, forcing: Forcing, method: Splitting, dt: float) -> None:
        self._forcing, self._dt = forcing, dt
        self.kicks, self.drifts = (np.multiply(x, dt) for x in (method.kicks, method.drifts))
        self._within = np.concatenate([[0.0], np.cumsum(self.drifts)[:-1]])
        self.degree, self.levels = self._terms(), -(-method.order // 2)
        nodes = (1 - np.cos(np.pi * (np.arange(NODES) + 0.5) / NODES)) / 2
        self._nodes, self._solve = nodes, np.linalg.inv(np.vander(nodes, increasing=True))
        self._gauss, self._weights = np.polynomial.legendre.leggauss(NODES)

    def _terms(self) -> int:
        """Terms of the series of a drift that count."""
        if self._forcing.damped != JOINED:
            return LEAST_TERMS
        size, term, count = float(np.abs(self.drifts).max()) * self._forcing.decay, 1.0, 0
        while term > SMALL or count < LEAST_TERMS:
            count += 1
            term *= size / count
        return count

    def times(self, first: int, steps: int, origin: float = 0.0) -> Array:
        """Instants of the kicks, and of the end [s]; (steps stages + 1,)."""
        starts = origin + self._dt * np.arange(first, first + steps + 1)
        return np.append((starts[:-1, None] + self._within).ravel(), starts[-1])

    def width(self) -> int:
        """Numbers that a step takes."""
        forcing, width = self._forcing, 1
        width += len(forcing.moved) * (2 + self.degree * (1 + (forcing.damped > 0)))
        width += 2 * len(forcing.forced)
        if forcing.tuning is not None:
            width += 4 * forcing.bonds.parameters.shape[1]
        return width * len(self.drifts)

    def rows(self, first: int, steps: int, origin: float = 0.0) -> dict[str, Array]:
        """The arrays of `driven.c` that depend on time, from step `first` after `origin` on."""
        forcing, at = self._forcing, self.times(first, steps, origin)
        found = {}
        if forcing.moved.size:
            found["moved_u"] = forcing.motion(at[1:], 0)
            found["moved_v"] = forcing.motion(at, 1)
            if forcing.damped:
                found |= self._between(at, steps)
        if forcing.forced.size:
            found["force"], found["force_rate"] = (forcing.force(at, k) for k in (0, 1))
        if forcing.tuning is not None:
            found["shared"], found["domain"] = forcing.tuning.numbers(at)
        return {name: np.ascontiguousarray(rows, dtype=float) for name, rows in found.items()}

    def _between(self, at: Array, steps: int) -> dict[str, Array]:
        """Prescribed velocities within drifts: as polynomials, or what they lose by rubbing."""
        starts, lengths = at[:-1], np.tile(self.drifts, steps)
        moved, ground = self._forcing.moved, self._forcing.ground
        if self._forcing.damped >= JOINED:
            nodes = starts[:, None] + lengths[:, None] * self._nodes
            values = self._forcing.motion(nodes.ravel(), 1).reshape(*nodes.shape, len(moved))
            series = np.zeros((len(starts), len(moved), self.degree))
            series[..., :NODES] = np.einsum("kx,sxm->smk", self._solve, values)
            return {"series": series}
        nodes = starts[:, None] + lengths[:, None] * (1 + self._gauss) / 2
        squares = self._forcing.motion(nodes.ravel(), 1).reshape(*nodes.shape, len(moved)) ** 2
        return {"rubbed": lengths * ((squares @ ground[moved]) @ self._weights) / 2}


class Locked(Exception):  # no error of a user's: which stage it was
    """A spring of a chain whose springs change reached an end of its domain.

    Parameters
    ----------
    t : float
        When [s].
    range : ndarray, (2,)
        Smallest and largest elongation of that stage and those before [m].
    """

    def __init__(self, t: float, range: Array) -> None:
        self.t, self.range = t, range
