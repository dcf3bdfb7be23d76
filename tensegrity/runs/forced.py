"""Motion in which time counts: a scene that is driven, damped or tuned; see `engine.driven`."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from tensegrity.engine import driven
from tensegrity.engine.driven import LARGEST_DAMPING, Locked
from tensegrity.engine.methods import Splitting
from tensegrity.errors import LockingError, StabilityError, TensegrityError
from tensegrity.runs.motion import Motion, Point
from tensegrity.scenes.forcing import check_start, forcing_of
from tensegrity.springs.tuned import Tuned
from tensegrity.typing import Array

GRID = np.linspace(0, 1, 9)  # of the elongations met, where stiffness is looked at
INSTANTS = 8  # of an attempt, where springs change
NUMBERS = 100_000  # that time gives steps, computed at a time


class ForcedMotion(Motion):
    """Of one scene, as `Motion`."""

    def __init__(self, problem: Any, dt: float, allowed: float, start: Any = None) -> None:
        scene, method = problem.scene, problem.method
        if not isinstance(method, Splitting):
            raise TensegrityError(
                f"method {method.name!r} is no splitting of kicks and drifts, which driven, damped "
                "and tuned scenes need, such as verlet and rkn6"
            )
        check_start(scene, problem.state.u)
        self.tuning: Any = None
        if scene.tune:
            known, key = problem.dynamics.tuned, problem.t_end
            if key not in known:
                known[key] = Tuned(problem.dynamics.springs.different[0], scene.tune, key)
            self.tuning = known[key]
        self.forcing = forcing_of(scene, problem.t_end, self.tuning)
        self._limit_damping(problem, dt)
        begin, forced, self._first_force = np.zeros(1), self.forcing.forced, 0.0
        self._first_v = self.forcing.motion(begin, 1)[0] if len(self.forcing.moved) else 0.0
        if len(forced):  # sum of prescribed forces times displacements [J]
            pulls = self.forcing.force(begin, 0)[0] * problem.state.u.reshape(-1)[forced]
            self._first_force = float(np.sum(pulls))
        super().__init__(problem, dt, allowed, start)
        self._at_once = max(1, NUMBERS // self._bound.schedule.width())

    def _limit_damping(self, problem: Any, dt: float) -> None:
        """Refuse a step in a drift of which velocities would decay, or grow back, too much."""
        method, rate = problem.method, self.forcing.decay
        longest = max(map(abs, method.drifts))
        largest = LARGEST_DAMPING / longest / rate if rate else math.inf
        if dt > largest:
            error = StabilityError(
                f"{problem.step_words(dt)} is beyond {largest:.6g} s for dashpots whose "
                f"velocities decay at {rate:.6g} 1/s: {method.name} drifts by up to {longest:.3g} "
                f"dt at a time, which must be at most {LARGEST_DAMPING:g} of that rate"
            )
            error.largest = largest
            raise error

    def _bind(self, listed: Any) -> Any:
        u, v = listed.arrays(self.problem.state)
        return driven.bind(self.forcing, u, v, self.problem.method, self.dt)

    def release(self) -> None:
        """The loop is of this run alone."""

    def _beginning(self) -> Point:
        u, v = self._listed.arrays(self.problem.state)
        v.reshape(-1)[self.forcing.moved] = 0.0
        shown, sums = (u.copy(), v.copy()), np.zeros((1, 2))
        sites = self._sites
        self._tell(np.zeros(1), shown[0][None, :sites], shown[1][None, :sites], sums)
        elongation_range = np.zeros((len(self._listed.springs), 2))
        return Point(
            0, u, v, (*shown, sums[0]), elongation_range, np.array([0.0, 0.0, np.inf, -np.inf])
        )

    def restore(self) -> None:
        super().restore()
        if self._bound is not None:
            self._bound.sums[:] = self.point.sums

    # attempts

    def _go(self, end: int, wanted: Any) -> bool:
        self._locked = None
        if self._is_late(end):
            return False
        try:
            stopped = self._bound.go(self.point.done, end, wanted)
        except Locked as locked:
            self._locked = locked
            return False
        for one in wanted:
            if len(one.at) and not one.raw:
                sums = np.zeros((len(one.at), 2)) if one.sums is None else one.sums
                self._tell(one.at * self.dt, one.u, one.v, sums)
        sites, t = self._sites, np.array([end * self.dt])
        u, v = self._bound.shown
        self._sums = self._bound.shown_sums[None, :2].copy()
        self._tell(t, u[None, :sites], v[None, :sites], self._sums)
        return not stopped

    def _is_late(self, end: int) -> bool:
        """Whether there are no springs from some instant before on."""
        return self.tuning is not None and end * self.dt > self.tuning.until

    def _tell(self, t: Array, u: Array, v: Array, sums: Array) -> None:
        """Give rows the motion that is prescribed, and all of the work; in place."""
        forcing, count = self.forcing, len(t)
        moved, forced = forcing.moved, forcing.forced
        rows_u, rows_v = u.reshape(count, -1), v.reshape(count, -1)
        if len(moved):
            rows_u[:, moved], rows_v[:, moved] = forcing.motion(t, 0), forcing.motion(t, 1)
            sums[:, 0] += (rows_v[:, moved] ** 2 - self._first_v**2) @ forcing.heavy / 2
        if len(forced):
            sums[:, 0] += np.sum(forcing.force(t, 0) * rows_u[:, forced], axis=1)
            sums[:, 0] -= self._first_force

    def _point(self, end: int, elongation_range: Array) -> Point:
        point = super()._point(end, elongation_range)
        return point._replace(shown=(*point.shown, self._sums[0]), sums=self._bound.sums.copy())

    def _allows(self, elongation_range: Array, end: int) -> bool:
        if self.tuning is None:
            return super()._allows(elongation_range, end)
        self._limit = self.problem.largest_step(
            self._omega(float(elongation_range[0, 0]), float(elongation_range[0, 1]), end)
        )
        return self.dt <= self.allowed * self._limit

    def _omega(self, low: float, high: float, end: int) -> float:
        """Bound on the angular frequency within a range of elongations [rad/s], in the springs of
        some instants."""
        of, r = self.dynamics, np.append(low + (high - low) * GRID, 0.0)
        at = np.linspace(self.point.done * self.dt, end * self.dt, INSTANTS + 1)
        p = np.ascontiguousarray(np.repeat(self.tuning.at(at), len(r), axis=0).T)
        r = np.tile(r, len(at))
        largest = float(np.max(self.tuning.evaluate(2, p, r)))
        if of.turns:  # tension resists motion across a bond
            shortest = min(low, 0.0) - float(np.max(of.zero_length_elongation))
            across = float(np.max(self.tuning.evaluate(1, p, r)))
            largest = max(largest, across / shortest if shortest > 0 else math.inf)
        if not math.isfinite(largest):
            return math.inf
        return of.bond_frequency_bound(np.full(len(of.scene.springs), max(largest, 0.0)))

    def first_frequency(self) -> float:
        """As of `Motion`."""
        if self.tuning is None:
            return super().first_frequency()
        r = self.dynamics.elongations(self.point.shown[0][: self._sites])
        return self._omega(float(r.min()), float(r.max()), self.point.done)

    # what was reached

    def energies(self, t: Array, u: Array, v: Array) -> Array:
        """Total energies of rows [J], in the springs of their instants."""
        of, scene = self.dynamics, self.problem.scene
        if self.tuning is None:
            return of.energies(u, v)
        stored = self.tuning.energies(t, of.elongations(u))
        mass = scene.mass.reshape(-1, *[1] * (v.ndim - 2))
        motion = (mass * v**2 / 2 - scene.loads * u).reshape(len(u), -1)
        return np.sum(motion, axis=1) + np.sum(stored, axis=-1)

    def between(self, step: int, part: float, u: Array, v: Array, impulse: Any, sums: Any) -> None:
        """As of `Motion`."""
        rows, t = self._listed.arrays(self.problem.state), step * self.dt
        told = np.zeros((1, 2))
        self._tell(np.array([t]), u[None].copy(), v[None].copy(), told)
        sites = self._sites
        walls = slice(sites, sites + self.dynamics.wall_count)
        for array, given in zip(rows, (u, v), strict=True):
            array[...] = 0
            array[:sites] = given
        if impulse is not None:
            rows[1][walls] = impulse
        rows[1].reshape(-1)[self.forcing.moved] = 0.0
        bound = driven.bind(self.forcing, rows[0], rows[1], self.problem.method, part)
        bound.sums[:2] = sums - told[0]  # as the loop sums them
        bound.short(t)
        u[...], v[...] = rows[0][:sites], rows[1][:sites]
        if impulse is not None:
            impulse[...] = rows[1][walls]
        sums[:] = bound.sums[:2]
        self._tell(np.array([t + part]), u[None], v[None], sums[None])

    # what went wrong

    def error(self) -> LockingError | StabilityError:
        """Why an attempt at a single step failed."""
        if self._is_late(self.point.done + 1):
            return LockingError(
                f"{self.tuning.reason}: the springs were driven there at t = "
                f"{self.tuning.until:.6g} s"
            )
        return super().error() if self._locked is None else self._of_lock(self._locked)

    def _of_lock(self, locked: Locked) -> LockingError | StabilityError:
        if not np.isfinite(locked.range).all():
            return self._endless(locked.t)
        low = self.tuning.domain(np.array([locked.t]))[0, 0]
        side = int(locked.range[0] > low)
        error = self.tuning.beyond(locked.t, float(locked.range[side]))
        where = self.dynamics.where_extreme(0, self._bound.u[: self._sites], side)
        return type(error)(f"{error}: the spring {where} got there at t = {locked.t:.6g} s")

    def _endless(self, t: float) -> StabilityError:
        return StabilityError(f"the motion is no longer finite at t = {t:.6g} s: dt too large")

    def _barrier(self, spring: Any, side: int) -> None:
        """No energy is a bound on what springs reach."""

    def _explained(
        self, t: float, elongation_range: Array, shown: Any
    ) -> LockingError | StabilityError:
        if self.tuning is not None:
            finite = all(np.isfinite(x[: self._sites]).all() for x in shown)
            return (
                self._too_coarse(t, shown[0][: self._sites], elongation_range)
                if finite
                else self._endless(t)
            )
        error = super()._explained(t, elongation_range, shown)
        if isinstance(error, LockingError) or all(
            np.isfinite(x).all() for x in (*shown, elongation_range)
        ):
            return error
        return self._endless(t)

    def _too_coarse(self, t: float, u: Array, elongation_range: Array) -> StabilityError:
        if self.tuning is not None:
            self._guard.limit = self._limit
        return super()._too_coarse(t, u, elongation_range)
