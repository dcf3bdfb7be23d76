"""A chain, or chains side by side, bound to a compiled loop."""

from __future__ import annotations

import numpy as np

from tensegrity.engine.bonds import BLOCK, by_spring
from tensegrity.engine.bound import Bound, integers, stages
from tensegrity.engine.structs import structure

LINE = structure("line.h", "scene")


class BoundLine(Bound):
    """A chain, or lanes of chains, advanced in place.

    Parameters
    ----------
    loop : Compiled
    u, v : ndarray, (sites,) or (sites, lanes)
    bonds : Bonds
    method : Method
    dt : float
        [s]
    runs : Runs, optional
        Those of `bonds`, or a part of them.
    seen : ndarray of bool, (runs,), optional
        Those whose elongations count; by default all.
    """

    def __init__(self, loop, u, v, bonds, method, dt, runs=None, seen=None):
        self._group, self._lanes, self._loop = bonds.group, loop.lanes, loop
        self._runs = bonds.runs if runs is None else runs
        laid = None if runs is not None else bonds.laid.get(loop)
        if laid is None:
            laid = self._lay(loop, bonds, seen)
            if runs is None:
                bonds.laid[loop] = laid
        self._kept, self._low, self._high, self._apart, fixed = laid
        self._range = np.empty(fixed["range_at"][-1], dtype=loop.dtype)
        self._travel = np.zeros(1, dtype=loop.dtype)
        self.springs = len(bonds.law)
        line = LINE(u=u, v=v, range=self._range, **fixed, **stages(method, 1.0, loop.dtype))
        self._set_steps(loop, line, bonds, method, dt, u.size)
        self.forget_range()

    def _lay(self, loop, bonds, seen):
        """What does not depend on the motion and the method: kept for the next time."""
        runs = self._runs
        seen = np.ones(len(runs.law), dtype=bool) if seen is None else seen
        entries = loop.lanes * np.diff(runs.first)
        sizes = 2 * np.where(runs.own, entries, np.minimum(entries, BLOCK))
        range_at = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
        weights = np.asarray(bonds.inverse_mass)
        if loop.lanes > 1 and weights.ndim == 1:
            weights = np.repeat(weights, loop.lanes)
        order = self._order(range_at, seen)
        apart = np.array_equal(order[0], np.arange(len(bonds.law)))
        fixed = loop.parameters(bonds, runs) | {
            "w": loop.numbers(weights),
            "range_at": range_at,
            "first": integers(runs.first - runs.first[0]),
            "law": integers(2 * runs.law + runs.own),
            "runs": len(runs.law),
        }
        return *order, apart, fixed

    def _order(self, range_at, seen):
        """The spring that each kept range belongs to, and where its two numbers are."""
        springs, low, high = [], [], []
        for k in np.flatnonzero(seen):
            start, stop = range_at[k : k + 2]
            here, middle = self._group[self._runs.members(k)], (start + stop) // 2
            if not self._runs.own[k]:
                here = np.repeat(here.flat[0], middle - start)
            elif self._lanes > 1 and here.ndim == 1:
                here = np.repeat(here, self._lanes)
            springs.append(np.ravel(here))
            low.append(np.arange(start, middle))
            high.append(np.arange(middle, stop))
        return np.concatenate(springs), np.concatenate(low), np.concatenate(high)

    def retune(self, bonds):
        """Go on with the masses and parameters of other bonds, of the same laws and in the same
        runs.  What it was made of changes with it."""
        fields = self._loop.parameters(bonds, self._runs) | {"w": bonds.inverse_mass}
        for name, values in fields.items():
            self._scene.filled[name][:] = values

    def forget_range(self):
        """Start anew to record elongations."""
        self._range[self._low], self._range[self._high] = np.inf, -np.inf

    @property
    def range(self):
        found = self._range[self._low], self._range[self._high]
        if self._apart:
            return np.stack(found, axis=1)
        return by_spring(self._kept, self.springs, *found)
