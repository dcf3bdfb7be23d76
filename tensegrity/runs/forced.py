"""The motion of a scene that is driven or damped, or whose springs change; see `engine.driven`."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from tensegrity.engine import driven
from tensegrity.engine.bonds import by_spring
from tensegrity.engine.compiled import evaluated
from tensegrity.engine.driven import LARGEST_DAMPING, Locked
from tensegrity.engine.force_law import largest_decay
from tensegrity.engine.methods import Nystrom, Splitting
from tensegrity.errors import LockingError, StabilityError, TensegrityError
from tensegrity.runs.motion import Motion, MotionState
from tensegrity.scenes.forcing import check_start, forcing_of
from tensegrity.springs.over_time import TimedSprings
from tensegrity.typing import Array

GRID = np.linspace(0, 1, 9)  # points of the range of elongations where stiffness is evaluated
INSTANTS = 8  # instants of an attempt where the stiffness of changing springs is evaluated
NUMBERS = 100_000  # most time-dependent numbers that are computed for an attempt


class ForcedMotion(Motion):
    """The motion of one such scene, with the interface of `Motion`."""

    def __init__(self, problem: Any, dt: float, allowed: float, start: Any = None) -> None:
        scene, method = problem.scene, problem.method
        dyn = problem.dynamics
        as_forces = bool(getattr(method, "rates", ())) and not dyn.springs.changing
        heavy = scene.bond_mass is not None
        if heavy and not as_forces and (scene.drive or scene.damping or dyn.further_forces):
            raise TensegrityError(
                f"method {method.name!r}: bonds with mass besides drives, dashpots or forces need "
                "rk4 or rk8, which take no springs that change"
            )
        if dyn.needs_rates and not as_forces:
            raise TensegrityError(
                f"method {method.name!r} admits no forces but those of springs, drives, dashpots "
                "and of time alone: take rk4 or rk8"
            )
        if not as_forces and not isinstance(method, Splitting):
            raise TensegrityError(
                f"method {method.name!r} is not a splitting into kicks and drifts, as driven, "
                "damped and time-dependent scenes require: take verlet or rkn6"
            )
        check_start(scene, problem.state.u)
        self.timed: Any = None
        if dyn.springs.changing:
            known, key = dyn.timed, problem.t_end
            if key not in known:
                known[key] = TimedSprings(dyn.springs, key)
            self.timed = known[key]
        listed = dyn.listed(problem.state.u if start is None else start.output[0][: dyn.sites])
        self.forcing = forcing_of(listed.scene, problem.t_end, self.timed, as_forces)
        self.problem: Any = problem
        self._damped_out: StabilityError | None = None
        self._limit_damping(problem, dt)
        begin, forced, self._first_force = np.zeros(1), self.forcing.forced, 0.0
        self._first_v: Any = self.forcing.motion(begin, 1)[0] if len(self.forcing.moved) else 0.0
        if len(forced):  # sum of prescribed forces times displacements [J]
            pulls = self.forcing.force(begin, 0)[0] * problem.state.u.reshape(-1)[forced]
            self._first_force = float(np.sum(pulls))
        super().__init__(problem, dt, allowed, start)
        self._at_once = max(1, NUMBERS // self._bound.schedule.width())

    def _limit_damping(self, problem: Any, dt: float) -> None:
        """Refuse a step whose drifts change velocities too much by damping."""
        method = problem.method
        if isinstance(method, Nystrom):
            begin = 0.0, problem.state.u, problem.state.v
            if (largest := self._largest_step(*begin)) < dt:
                raise self._too_damped(dt, largest, 0.0)
            return
        rate, longest = self.forcing.decay, max(map(abs, method.drifts))
        largest = LARGEST_DAMPING / longest / rate if rate else math.inf
        if dt > largest:
            error = StabilityError(
                f"{problem.step_words(dt)} is beyond {largest:.6g} s for dashpots whose "
                f"velocities decay at {rate:.6g} 1/s: {method.name} drifts by up to {longest:.3g} "
                f"dt at a time, which must be at most {LARGEST_DAMPING:g} of that rate"
            )
            error.largest = largest
            raise error

    def _largest_step(self, t: float, u: Array, v: Array) -> float:
        """Largest stable step [s] for the rates at which forces change velocities in a state."""
        rate = largest_decay(self.forcing.applied, self.forcing.bonds, t, u, v)
        return self.problem.method.decay_limit / rate if rate else math.inf

    def _too_damped(self, dt: float, largest: float, t: float) -> StabilityError:
        error = StabilityError(
            f"{self.problem.step_words(dt)} is beyond {largest:.6g} s, the limit of "
            f"{self.problem.method.name} for the rate at which forces change velocities at "
            f"t = {t:.6g} s"
        )
        error.largest = largest
        return error

    def _bind(self, listed: Any) -> Any:
        u, v = listed.arrays(self.problem.state)
        if listed.loop_bonds is not self.forcing.bonds and self.timed is None:
            self.forcing = replace(
                self.forcing,
                bonds=listed.loop_bonds,
                bond=np.zeros(len(listed.scene.springs)),
                applied=listed.acting.applied(bool(self.forcing.applied)),
            )
        corrects = self.problem.bind is None
        return driven.bind(self.forcing, u, v, self.problem.method, self.dt, corrects)

    def release(self) -> None:
        """Nothing to return: the loop belongs to this run alone."""

    def _initial_state(self) -> MotionState:
        u, v = self._listed.arrays(self.problem.state)
        v.reshape(-1)[self.forcing.moved] = 0.0
        output, sums = (u.copy(), v.copy()), np.zeros((1, 2))
        sites = self._sites
        self._add_prescribed(np.zeros(1), output[0][None, :sites], output[1][None, :sites], sums)
        elongation_range = np.zeros((self._listed.loop_bonds.noted, 2))
        return MotionState(0, u, v, (*output, sums[0]), elongation_range, np.zeros(2))

    def restore(self) -> None:
        super().restore()
        if self._bound is not None:
            self._bound.sums[:] = self.point.sums

    # attempts

    def _go(self, end: int, wanted: Any) -> bool:
        self._locked = self._damped_out = None
        if self._is_past_end(end):
            return False
        try:
            stopped = self._bound.go(self.point.done, end, wanted)
        except Locked as locked:
            self._locked = locked
            return False
        for one in wanted:
            if len(one.at) and not one.raw and one.places is None:
                sums = np.zeros((len(one.at), 2)) if one.sums is None else one.sums
                self._add_prescribed(one.at * self.dt, one.u, one.v, sums)
        sites, t = self._sites, np.array([end * self.dt])
        u, v = self._bound.output
        self._sums = self._bound.output_sums[None].copy()
        self._add_prescribed(t, u[None, :sites], v[None, :sites], self._sums)
        return not stopped

    def _is_past_end(self, end: int) -> bool:
        """Whether the springs cease to exist before step `end`."""
        return self.timed is not None and end * self.dt > self.timed.until

    def _add_prescribed(self, t: Array, u: Array, v: Array, sums: Array) -> None:
        """Add the prescribed motion to rows, and to their sums the work that it stores; in place.

        Parameters
        ----------
        t : ndarray, (rows,)
            Instants [s].
        u, v : ndarray, (rows, *shape)
            [m], [m/s]
        sums : ndarray, (rows, 2)
            Work and loss [J].
        """
        forcing, count = self.forcing, len(t)
        moved, forced = forcing.moved, forcing.forced
        rows_u, rows_v = u.reshape(count, -1), v.reshape(count, -1)
        if len(moved):
            rows_u[:, moved], rows_v[:, moved] = forcing.motion(t, 0), forcing.motion(t, 1)
            sums[:, 0] += (rows_v[:, moved] ** 2 - self._first_v**2) @ forcing.prescribed_mass / 2
            if forcing.ties is not None:
                for v, sign in ((rows_v[:, moved], 1), (self._first_v[None], -1)):
                    sums[:, 0] += sign * np.sum(v * (v @ forcing.ties.among), axis=1) / 2
        if len(forced):
            sums[:, 0] += np.sum(forcing.force(t, 0) * rows_u[:, forced], axis=1)
            sums[:, 0] -= self._first_force

    def _point(self, end: int, elongation_range: Array) -> MotionState:
        point = super()._point(end, elongation_range)
        return point._replace(output=(*point.output, self._sums[0]), sums=self._bound.sums.copy())

    def _allows(self, elongation_range: Array, end: int) -> bool:
        self._damped_out = None
        if self.forcing.applied:
            u, v = (x[: self._sites] for x in self._bound.output)
            largest = self._largest_step(end * self.dt, u, v)
            if largest < self.dt:
                self._damped_out = self._too_damped(self.dt, largest, end * self.dt)
                return False
        if self.timed is None:
            return super()._allows(elongation_range, end)
        _, first = np.unique(self.timed.number, return_index=True)
        self._limit = self.problem.largest_step(self._omega(elongation_range[first], end))
        return self.dt <= self.allowed * self._limit

    def _omega(self, ranges: Array, end: int) -> float:
        """Bound on the angular frequency [rad/s] for the elongations (series, 2) [m] of springs
        that change, during an attempt that ends with step `end`."""
        at = np.linspace(self.point.done * self.dt, end * self.dt, INSTANTS + 1)
        each = zip(range(len(ranges)), ranges.tolist(), strict=True)
        stiffness = np.array([self._stiffest(k, low, high, at) for k, (low, high) in each])
        if not np.isfinite(stiffness).all():
            return math.inf
        return self.dynamics.spring_frequency_bound(stiffness[self.timed.number])

    def _stiffest(self, number: int, low: float, high: float, at: Array) -> float:
        """Largest stiffness [N/m] of the spring of a series between two elongations [m], at some
        instants [s]; at least 0."""
        one, dyn = self.timed.series[number], self.dynamics
        r = np.append(low + (high - low) * GRID, 0.0)
        p = np.ascontiguousarray(np.repeat(one.at(at), len(r), axis=0).T)
        r = np.tile(r, len(at))
        largest = float(np.max(evaluated(one.law, 2, p, r), initial=0.0))
        if dyn.turns:  # tension resists motion across a bond
            meets = dyn.zero_length_elongation[self.timed.number == number]
            shortest = min(low, 0.0) - float(np.max(meets))
            across = float(np.max(evaluated(one.law, 1, p, r)))
            largest = max(largest, across / shortest if shortest > 0 else math.inf)
        return largest

    def first_frequency(self) -> float:
        """Bound on the angular frequency at the start [rad/s]."""
        if self.timed is None:
            return super().first_frequency()
        r = self.dynamics.elongations(self.point.output[0][: self._sites])
        ranges = by_spring(self.timed.group, len(self.timed.series), r, r)
        return self._omega(ranges, self.point.done)

    # accepted state

    def energies(self, t: Array, u: Array, v: Array) -> Array:
        """Total energies of states, with the springs at their instants; see `Motion.energies`.

        Parameters
        ----------
        t : ndarray, (rows,)
            Instants [s].
        u, v : ndarray, (rows, *shape)
            [m], [m/s]

        Returns
        -------
        ndarray, (rows,)
            [J]
        """
        dyn, scene = self.dynamics, self.problem.scene
        if self.timed is None:
            return dyn.energies(u, v)
        stored = self.timed.energies(t, dyn.elongations(u))
        motion = (dyn.kinetic(v) - scene.loads * u).reshape(len(u), -1)
        return np.sum(motion, axis=1) + np.sum(stored, axis=-1)

    def between(self, step: int, part: float, u: Array, v: Array, impulse: Any, sums: Any) -> None:
        """Advance an output state in place by one shorter step; see `Motion.between`.

        Parameters
        ----------
        step : int
            Number of steps after which the state is reached.
        part : float
            Length of the shorter step [s].
        u, v : ndarray, shape of the scene
            State [m, m/s].
        impulse : ndarray, (walls, dim), or None
            Impulses received by walls [N s].
        sums : ndarray, (2,)
            Work and loss [J].
        """
        rows, t = self._listed.arrays(self.problem.state), step * self.dt
        prescribed_sums = np.zeros((1, 2))
        self._add_prescribed(np.array([t]), u[None].copy(), v[None].copy(), prescribed_sums)
        sites = self._sites
        walls = slice(sites, sites + self.dynamics.wall_count)
        for array, given in zip(rows, (u, v), strict=True):
            array[...] = 0
            array[:sites] = given
        if impulse is not None:
            rows[1][walls] = impulse
        rows[1].reshape(-1)[self.forcing.moved] = 0.0
        bound = driven.bind(
            self.forcing, rows[0], rows[1], self.problem.method, part, self.problem.bind is None
        )
        bound.sums[:] = sums - prescribed_sums[0]  # as the loop sums them
        bound.short(t)
        u[...], v[...] = rows[0][:sites], rows[1][:sites]
        if impulse is not None:
            impulse[...] = rows[1][walls]
        sums[:] = bound.sums
        self._add_prescribed(np.array([t + part]), u[None], v[None], sums[None])

    # errors

    def error(self) -> LockingError | StabilityError:
        """The error by which an attempt of a single step failed."""
        if self._is_past_end(self.point.done + 1):
            return LockingError(
                f"{self.timed.reason}: the springs were driven there at t = "
                f"{self.timed.until:.6g} s"
            )
        if self._damped_out is not None:
            return self._damped_out
        return super().error() if self._locked is None else self._of_lock(self._locked.t)

    def _of_lock(self, t: float) -> LockingError | StabilityError:
        u = self._bound.u[: self._sites]
        if not np.isfinite(u).all():
            return self._diverged(t)
        dyn, timed = self.dynamics, self.timed
        r = dyn.elongations(u)
        low, high = timed.numbers(np.array([t]))[1].reshape(-1, 2)[timed.group].T
        bond = int(np.argmax(np.maximum(low - r, r - high)))
        error = timed.series[timed.group[bond]].range_error(t, float(r[bond]))
        where = dyn.where_extreme(int(dyn.springs.group[bond]), u, int(r[bond] > low[bond]))
        return type(error)(f"{error}: the spring {where} got there at t = {t:.6g} s")

    def _diverged(self, t: float) -> LockingError | StabilityError:
        scene, point = self.problem.scene, self.point
        u, v = (x.reshape(-1)[: self._sites * max(scene.dim, 1)] for x in (point.u, point.v))
        try:  # where the sites are after two steps at the velocities of the last state
            self.dynamics.acting.stored(0, (u + 2 * self.dt * v).reshape(scene.shape))
        except LockingError as error:
            return LockingError(f"{error}: a spring to the ground got there at t = {t:.6g} s")
        return StabilityError(
            f"the motion is no longer finite at t = {t:.6g} s: "
            f"{self.problem.step_words(self.dt)} is too large, or a force not finite"
        )

    def _barrier(self, spring: Any, side: int) -> None:
        """None: the energy does not bound the elongations of a driven scene."""

    def _diagnosed(
        self, t: float, elongation_range: Array, output: Any
    ) -> LockingError | StabilityError:
        if self.timed is not None:
            finite = all(np.isfinite(x[: self._sites]).all() for x in output)
            return (
                self._too_coarse(t, output[0][: self._sites], elongation_range)
                if finite
                else self._diverged(t)
            )
        error = super()._diagnosed(t, elongation_range, output)
        if isinstance(error, LockingError) or all(
            np.isfinite(x).all() for x in (*output, elongation_range)
        ):
            return error
        return self._diverged(t)

    def _too_coarse(self, t: float, u: Array, elongation_range: Array) -> StabilityError:
        if self.timed is not None:
            self._guard.limit = self._limit
        return super()._too_coarse(t, u, elongation_range)
