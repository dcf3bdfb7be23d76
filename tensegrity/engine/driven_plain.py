"""Steps in which time counts, where there is no compiler: slow, and a check of `driven`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tensegrity.engine import forces
from tensegrity.engine.timed import APART, FREE, JOINED, Bound, Forcing, Locked

if TYPE_CHECKING:
    from typing import Any

    from tensegrity.engine.methods import Splitting
    from tensegrity.typing import Array


class BoundPlain(Bound):
    """Advanced by NumPy."""

    def __init__(
        self, loop: Any, forcing: Forcing, u: Array, v: Array, method: Splitting, dt: float
    ) -> None:
        super().__init__(forcing, u, v, method, dt)
        self._loop, self.travel = loop, 0.0
        self._low, self._high = np.full((2, len(forcing.bonds.law)), np.inf)
        self.forget()

    def forget(self) -> None:
        super().forget()
        self._low[:], self._high[:], self.travel = np.inf, -np.inf, 0.0

    @property
    def range(self) -> Array:
        """As `BoundDriven.range`."""
        return np.stack([self._low, self._high], axis=1)

    def advance(
        self, first: int, steps: int, opened: bool, close: bool, origin: float = 0.0
    ) -> None:
        """As `BoundDriven.advance`."""
        schedule, given = self.schedule, (first, max(steps, 1), origin)
        rows, times = schedule.rows(*given), schedule.times(*given)
        (*kicks, closing), drifts = schedule.kicks, schedule.drifts
        s = 0
        for step in range(steps):
            for i, (kick, drift) in enumerate(zip(kicks, drifts, strict=True)):
                merged = closing if i == 0 and (step or opened) else 0.0
                self._stage(rows, times, s, i, kick + merged, drift)
                s += 1
        if close and closing:
            self._stage(rows, times, s, 0, closing, 0.0)

    def _stage(self, rows: Any, times: Any, s: int, i: int, a: float, b: float) -> None:
        forcing, sums = self._forcing, self.sums
        u, v = self._u.reshape(-1), self.v.reshape(-1)  # views
        moved, forced = forcing.moved, forcing.forced
        pull = self._pull(rows, times, s, a)
        weights = forcing.bonds.inverse_mass
        if forcing.bonds.contacts is not None:
            weights = forcing.bonds.contacts.weights(weights)
        weights = weights.reshape(-1)
        if forced.size:
            sums[0] -= a * np.sum(rows["force_rate"][s] * u[forced])
            pull[forced] += rows["force"][s]
        if moved.size:
            sums[0] -= a * np.sum(pull[moved] * rows["moved_v"][s])
        v += a * weights * pull
        v[moved] = 0
        count = len(forcing.mass)
        u, v = u[:count], v[:count]  # without walls, which stay
        if not b:
            return
        before, old = np.sum(forcing.mass * v**2) / 2, u.copy()
        if forcing.damped == FREE:
            u += b * v
        elif forcing.damped == APART:
            u += self._glide[i] * v
            v *= self._decay[i]
            if moved.size:
                sums[:2] += rows["rubbed"][s]
        else:
            drift = self._joined if forcing.damped == JOINED else self._turning
            sums[:2] += drift(rows["series"][s] if moved.size else None, u, v, b, weights)
        if forcing.damped:
            sums[1] += before - np.sum(forcing.mass * v**2) / 2
        if moved.size:
            u[moved] = rows["moved_u"][s]
        self.travel += float(np.max(np.abs(u - old)))

    def _pull(self, rows: Any, times: Any, s: int, a: float) -> Array:
        """Forces of the bonds on all entries, watched."""
        forcing, bonds = self._forcing, self._forcing.bonds
        parameters = bonds.parameters
        shape = self._u if bonds.contacts is not None else self._u.reshape(-1)
        r, along = forces.elongations(bonds, shape)
        if forcing.tuning is not None:
            parameters = rows["shared"][s][None]
            change = self._loop.evaluate(1, 0, parameters[0], np.ascontiguousarray(r))
            self.sums[0] += a * np.sum(change)
        np.minimum.at(self._low, bonds.group, r)
        np.maximum.at(self._high, bonds.group, r)
        if forcing.tuning is not None:
            self.sums[2:] = self._low[0], self._high[0]
            low, high = rows["domain"][s]
            if not (r.min() > low and r.max() < high):
                raise Locked(float(times[s]), np.array([r.min(), r.max()]))
        tension = np.zeros_like(r)
        for k in np.unique(bonds.group):
            mine = np.flatnonzero(bonds.group == k)
            part = np.ascontiguousarray(r[mine])
            tension[mine] = self._loop.evaluate(int(bonds.law[k]), 1, parameters[k], part)
        pull = forces.pulls(bonds, tension, along)
        if bonds.contacts is not None:
            pull[: len(bonds.contacts.load)] += bonds.contacts.load
        return pull.reshape(-1)

    def _joined(self, series: Any, u: Array, v: Array, b: float, weights: Array) -> float:
        """A drift with dashpots in bonds; returns what whoever moves sites pays."""
        forcing, y, total = self._forcing, v.copy(), 0.0
        v[:] = 0
        given = []
        for k in range(self.schedule.degree):
            if series is not None:
                y[forcing.moved] = series[:, k]
            pull = np.diff(forcing.bond * np.diff(y), prepend=0.0, append=0.0) - forcing.ground * y
            given.append(-pull[forcing.moved])
            v += y
            u += b / (k + 1) * y
            y = b / (k + 1) * weights * pull
        if series is not None:
            each = np.arange(self.schedule.degree)
            share = b / (each[:, None] + each + 1)
            total = float(np.einsum("mk,lm,kl->", series, np.array(given), share))
        return total

    def _turning(self, series: Any, u: Array, v: Array, b: float, weights: Array) -> float:
        """The same in a network, as `drift_turning` of `driven.c`."""
        forcing, bonds, moved = self._forcing, self._forcing.bonds, self._forcing.moved
        n = len(forcing.mass)
        shape = -1, bonds.dim
        weights = weights[:n].copy()
        weights[moved] = 0

        def rate(y: Array, tau: float) -> Array:
            if series is not None:
                y[n : 2 * n][moved] = np.polynomial.polynomial.polyval(tau, series.T)
            rows = y[n : 2 * n].reshape(shape)
            along = forces.elongations(bonds, y[:n].reshape(shape))[1][forcing.joined]
            ends = [x[forcing.joined] for x in (forcing.contacts.first, forcing.contacts.second)]
            apart = rows[ends[1]] - rows[ends[0]]
            speed = forcing.bond[forcing.joined] * np.sum(along * apart, axis=1)
            pull = -(forcing.ground.reshape(shape) * rows)
            np.add.at(pull, ends[0], speed[:, None] * along)
            np.subtract.at(pull, ends[1], speed[:, None] * along)
            paid = -np.sum(y[n : 2 * n][moved] * pull.ravel()[moved])
            return np.concatenate([y[n : 2 * n], weights * pull.ravel(), [paid]])

        table: list[Array] = []
        for level in range(self.schedule.levels):
            steps = 2 * (level + 1)
            h, old = b / steps, np.concatenate([u, v, [0.0]])
            now = old + h * rate(old, 0.0)
            for k in range(1, steps):
                old, now = now, old + 2 * h * rate(now, k / steps)
            now = (old + now + h * rate(now, 1.0)) / 2
            for k in range(level):
                share = 1 / (((level + 1) / (level - k)) ** 2 - 1)
                table[k], now = now, now + share * (now - table[k])
            table.append(now)
        u[:], v[:] = now[:n], now[n : 2 * n]
        v[moved] = 0
        return float(now[-1])
