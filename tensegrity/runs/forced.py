"""The motion of a scene that is driven, damped or tuned; see `engine.driven`."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from tensegrity.engine import driven
from tensegrity.engine.driven import LARGEST_DAMPING, Locked
from tensegrity.engine.force_law import largest_decay
from tensegrity.engine.methods import Nystrom, Splitting
from tensegrity.errors import LockingError, StabilityError, TensegrityError
from tensegrity.runs.motion import Motion, MotionState
from tensegrity.scenes.dynamics import per_coordinate
from tensegrity.scenes.force import applied_forces
from tensegrity.scenes.forcing import check_start, forcing_of
from tensegrity.scenes.on_site import on_site
from tensegrity.springs.tuned import Tuned
from tensegrity.typing import Array

GRID = np.linspace(0, 1, 9)  # points of the range of elongations where stiffness is evaluated
INSTANTS = 8  # instants of an attempt where the stiffness of changing springs is evaluated
NUMBERS = 100_000  # most time-dependent numbers that are computed for an attempt


class ForcedMotion(Motion):
    """The motion of one driven, damped or tuned scene, with the interface of `Motion`."""

    def __init__(self, problem: Any, dt: float, allowed: float, start: Any = None) -> None:
        scene, method = problem.scene, problem.method
        as_forces = bool(getattr(method, "rates", ())) and not scene.tune
        if applied_forces(scene) and not as_forces:
            raise TensegrityError(
                f"method {method.name!r} admits no forces but those of springs, drives, dashpots "
                "and of time alone: take rk4 or rk8"
            )
        if not as_forces and not isinstance(method, Splitting):
            raise TensegrityError(
                f"method {method.name!r} is not a splitting into kicks and drifts, as driven, "
                "damped and tuned scenes require: take verlet or rkn6"
            )
        check_start(scene, problem.state.u)
        self.tuning: Any = None
        if scene.tune:
            known, key = problem.dynamics.tuned, problem.t_end
            if key not in known:
                known[key] = Tuned(problem.dynamics.springs.different[0], scene.tune, key)
            self.tuning = known[key]
        listed = problem.dynamics.listed(
            problem.state.u if start is None else start.output[0][: problem.dynamics.sites]
        )
        self.forcing = forcing_of(listed.scene, problem.t_end, self.tuning, as_forces)
        self.problem: Any = problem
        self._damped_out: StabilityError | None = None
        self._limit_damping(problem, dt)
        begin, forced, self._first_force = np.zeros(1), self.forcing.forced, 0.0
        self._first_v = self.forcing.motion(begin, 1)[0] if len(self.forcing.moved) else 0.0
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
        if listed.loop_bonds is not self.forcing.bonds and self.tuning is None:
            self.forcing = replace(
                self.forcing,
                bonds=listed.loop_bonds,
                bond=np.zeros(len(listed.scene.springs)),
                applied=applied_forces(listed.scene, bool(self.forcing.applied)),
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
        return MotionState(
            0, u, v, (*output, sums[0]), elongation_range, np.array([0.0, 0.0, np.inf, -np.inf])
        )

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
        self._sums = self._bound.output_sums[None, :2].copy()
        self._add_prescribed(t, u[None, :sites], v[None, :sites], self._sums)
        return not stopped

    def _is_past_end(self, end: int) -> bool:
        """Whether the springs cease to exist before step `end`."""
        return self.tuning is not None and end * self.dt > self.tuning.until

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
        if self.tuning is None:
            return super()._allows(elongation_range, end)
        self._limit = self.problem.largest_step(
            self._omega(float(elongation_range[0, 0]), float(elongation_range[0, 1]), end)
        )
        return self.dt <= self.allowed * self._limit

    def _omega(self, low: float, high: float, end: int) -> float:
        """Bound on the angular frequency [rad/s] between two elongations [m], for the springs
        during an attempt that ends with step `end`."""
        dyn, r = self.dynamics, np.append(low + (high - low) * GRID, 0.0)
        at = np.linspace(self.point.done * self.dt, end * self.dt, INSTANTS + 1)
        p = np.ascontiguousarray(np.repeat(self.tuning.at(at), len(r), axis=0).T)
        r = np.tile(r, len(at))
        largest = float(np.max(self.tuning.evaluate(2, p, r)))
        if dyn.turns:  # tension resists motion across a bond
            shortest = min(low, 0.0) - float(np.max(dyn.zero_length_elongation))
            across = float(np.max(self.tuning.evaluate(1, p, r)))
            largest = max(largest, across / shortest if shortest > 0 else math.inf)
        if not math.isfinite(largest):
            return math.inf
        return dyn.bond_frequency_bound(np.full(len(dyn.scene.springs), max(largest, 0.0)))

    def first_frequency(self) -> float:
        """Bound on the angular frequency at the start [rad/s]."""
        if self.tuning is None:
            return super().first_frequency()
        r = self.dynamics.elongations(self.point.output[0][: self._sites])
        return self._omega(float(r.min()), float(r.max()), self.point.done)

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
        if self.tuning is None:
            return dyn.energies(u, v)
        stored = self.tuning.energies(t, dyn.elongations(u))
        motion = (per_coordinate(scene, scene.mass) * v**2 / 2 - scene.loads * u).reshape(
            len(u), -1
        )
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
        bound.sums[:2] = sums - prescribed_sums[0]  # as the loop sums them
        bound.short(t)
        u[...], v[...] = rows[0][:sites], rows[1][:sites]
        if impulse is not None:
            impulse[...] = rows[1][walls]
        sums[:] = bound.sums[:2]
        self._add_prescribed(np.array([t + part]), u[None], v[None], sums[None])

    # errors

    def error(self) -> LockingError | StabilityError:
        """The error by which an attempt of a single step failed."""
        if self._is_past_end(self.point.done + 1):
            return LockingError(
                f"{self.tuning.reason}: the springs were driven there at t = "
                f"{self.tuning.until:.6g} s"
            )
        if self._damped_out is not None:
            return self._damped_out
        return super().error() if self._locked is None else self._of_lock(self._locked)

    def _of_lock(self, locked: Locked) -> LockingError | StabilityError:
        if not np.isfinite(locked.range).all():
            return self._diverged(locked.t)
        low = self.tuning.domain(np.array([locked.t]))[0, 0]
        side = int(locked.range[0] > low)
        error = self.tuning.range_error(locked.t, float(locked.range[side]))
        where = self.dynamics.where_extreme(0, self._bound.u[: self._sites], side)
        return type(error)(f"{error}: the spring {where} got there at t = {locked.t:.6g} s")

    def _diverged(self, t: float) -> LockingError | StabilityError:
        scene, point = self.problem.scene, self.point
        u, v = (x.reshape(-1)[: self._sites * max(scene.dim, 1)] for x in (point.u, point.v))
        try:  # where the sites are after two steps at the velocities of the last state
            on_site(scene, 0, (u + 2 * self.dt * v).reshape(scene.shape))
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
        if self.tuning is not None:
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
        if self.tuning is not None:
            self._guard.limit = self._limit
        return super()._too_coarse(t, u, elongation_range)
