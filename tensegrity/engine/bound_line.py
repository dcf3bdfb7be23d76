"""A chain, or chains side by side, bound to a compiled loop."""

from __future__ import annotations

import numpy as np

from tensegrity.engine.bonds import BLOCK, by_spring
from tensegrity.engine.bound import Bound, rows_of
from tensegrity.engine.compiled import structure_of

_LINE = structure_of(  # as in line.h
    "_Line",
    "u v w shared own kicks drifts range first law own_at range_at",
    "runs stages closing",
)


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
        self._kept, self._low, self._high, self._apart, size, fixed_arrays, count = laid
        weights, shared, own, *where = fixed_arrays
        self._range = np.empty(size, dtype=loop.dtype)
        self._travel = np.zeros(1, dtype=loop.dtype)
        self.springs = len(bonds.law)
        self._kicks, self._drifts, *counts = rows_of(method, loop.dtype)
        arrays = [
            u, v, weights, shared, own, self._kicks, self._drifts, self._range, *where,
        ]  # fmt: skip
        structure = _LINE(*(x.ctypes.data for x in arrays), count, *counts)
        self._set_steps(loop, structure, arrays, bonds, method, dt, u.size)
        self.forget_range()

    def _lay(self, loop, bonds, seen):
        """What does not depend on the motion and the method: kept for the next time."""
        runs = self._runs
        seen = np.ones(len(runs.law), dtype=bool) if seen is None else seen
        shared, own, own_at = loop.parameters(bonds, runs)
        entries = loop.lanes * np.diff(runs.first)
        sizes = 2 * np.where(runs.own, entries, np.minimum(entries, BLOCK))
        range_at = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
        weights = np.asarray(bonds.inverse_mass)
        if loop.lanes > 1 and weights.ndim == 1:
            weights = np.repeat(weights, loop.lanes)
        order = self._order(range_at, seen)
        apart = np.array_equal(order[0], np.arange(len(bonds.law)))
        arrays = [
            loop.numbers(weights), shared, own, (runs.first - runs.first[0]).astype(np.int64),
            (2 * runs.law + runs.own).astype(np.int64), own_at, range_at,
        ]  # fmt: skip
        return *order, apart, range_at[-1], arrays, len(runs.law)

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
        shared, own, _ = self._loop.parameters(bonds, self._runs)
        for array, values in zip(self._arrays[2:5], (bonds.inverse_mass, shared, own), strict=True):
            array[:] = values

    def forget_range(self):
        """Start anew to record elongations."""
        self._range[self._low], self._range[self._high] = np.inf, -np.inf

    @property
    def range(self):
        found = self._range[self._low], self._range[self._high]
        if self._apart:
            return np.stack(found, axis=1)
        return by_spring(self._kept, self.springs, *found)
