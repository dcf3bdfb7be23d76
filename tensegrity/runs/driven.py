"""Runs in which time counts: driven, damped and tuned scenes, as `march` runs the others.

The loop does not close its steps where a run is looked at: a copy gets the closing kick, and is
led out of the method's variables where it has others.  A block of steps starts from a kept copy;
where it left a domain, or what the step allows, it is done again in halves, down to the step in
which that happened.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.engine import driven
from tensegrity.engine.methods import Splitting
from tensegrity.errors import ContactError, LockingError, StabilityError, TensegrityError
from tensegrity.progress import progress
from tensegrity.runs.march import BLOCK
from tensegrity.runs.march import march as march_on
from tensegrity.runs.run import Run
from tensegrity.scenes.forcing import check_start, forcing_of
from tensegrity.scenes.scene import State
from tensegrity.springs.tuned import Tuned

if TYPE_CHECKING:
    from typing import Any

    from tensegrity.typing import Array

NUMBERS = 100_000  # that time gives steps, computed at a time
GRID = np.linspace(0, 1, 9)  # of the elongations met, where stiffness is looked at
INSTANTS = 8  # of a block of steps, where springs change


def march(
    problem: Any, steps: int, allowed: float, checkpoints: int = 0, start: Any = None
) -> tuple[Run, tuple[Array, ...]]:
    """As `march.march`, which it calls for scenes that keep their energy."""
    if not problem.scene.is_driven:
        return march_on(problem, steps, allowed, checkpoints, start)
    _check(problem)
    return March(problem, steps, allowed, checkpoints).run()


def _check(problem: Any) -> None:
    """Refuse what driven scenes cannot be run with, before any work."""
    method, record = problem.method, problem.record
    if not isinstance(method, Splitting):
        raise TensegrityError(
            f"method {method.name!r} is no splitting of kicks and drifts, which driven, damped and "
            "tuned scenes need: verlet, rkn6, processed6"
        )
    if record.path is not None:
        raise TensegrityError(
            f"record path {record.path}: driven, damped and tuned scenes are recorded in memory"
        )
    check_start(problem.scene, problem.state.u)


@dataclass
class _Point:
    """Copies of what a run has reached: before the closing kick, and as it is looked at."""

    done: int
    u: Array
    v: Array
    sums: Array
    seen: tuple[Array, Array, Array]


class March:
    """One run with one step.

    Parameters
    ----------
    problem : Problem
    steps : int
    allowed : float
        Of the stability limit.
    checkpoints : int
        Evenly spaced instants at which u and v are kept besides.
    tuning : object, optional
        Springs in time, where `scene.tune` does not say them.
    """

    def __init__(
        self, problem: Any, steps: int, allowed: float, checkpoints: int = 0, tuning: Any = None
    ) -> None:
        self._problem, self._steps, self._allowed = problem, steps, allowed
        scene, t_end = problem.scene, problem.t_end
        self._scene, self.dt = scene, t_end / steps if steps else 0.0
        if tuning is None and scene.tune:
            known = scene.remembered.tuned
            if t_end not in known:
                known[t_end] = Tuned(scene.spring_table.different[0], scene.tune, t_end)
            tuning = known[t_end]
        self.tuning = tuning
        self.forcing = forcing_of(scene, t_end, tuning)
        self._limit_damping()
        self._domains = scene.spring_table.reach
        self.met = np.zeros((len(scene.spring_table), 2))
        self._fastest, self._known = 0.0, np.zeros_like(self.met)
        self._plan = problem.record.plan(steps, t_end)
        self._columns = problem.record.columns(scene.sites)
        apart = steps // checkpoints if checkpoints else 0
        self._checks = apart * np.arange(checkpoints + 1) if checkpoints else np.zeros(0, int)
        shape = scene.shape
        sites = np.arange(scene.sites)[self._columns]
        self._sites = tuple(sites.tolist())
        self._count, self._checked = 0, 0
        self._rows = problem.record.rows(
            len(self._plan) + 1, (len(sites), *shape[1:]), (scene.wall_count, *shape[1:])
        )
        self._sums = np.zeros((len(self._plan) + 1, 2))
        self._seen = np.empty((2, len(self._checks), *shape))
        self._begin()
        near = scene.clearance
        self._tracker = near and near.tracker(self._u[: scene.sites])

    def _limit_damping(self) -> None:
        """Refuse a step in a drift of which velocities would decay, or grow back, too much."""
        method, rate = self._problem.method, self.forcing.decay
        rows = [method, *(method.processor or ())]
        longest = max(abs(b) for one in rows for b in one.drifts)
        largest = driven.LARGEST_DAMPING / longest / rate if rate else math.inf
        if self.dt > largest:
            raise StabilityError(
                f"dt {self.dt:.6g} s is beyond {largest:.6g} s for dashpots whose velocities decay "
                f"at {rate:.6g} 1/s: {method.name} drifts by up to {longest:.3g} dt at a time, "
                f"which must be at most {driven.LARGEST_DAMPING:g} of that rate"
            )

    def _begin(self) -> None:
        scene, method = self._scene, self._problem.method
        self._u, self._v = scene.arrays(self._problem.state)
        v = self._v.reshape(-1)
        self._first_v = self.forcing.motion(np.zeros(1), 1)[0] if len(self.forcing.moved) else 0.0
        v[self.forcing.moved] = 0.0
        self._first_force = self._pulled(0.0, self._u)
        enter, leave = method.processor or (None, None)
        self._loop = driven.bind(self.forcing, self._u, self._v, method, self.dt)
        self._out = np.empty_like(self._u), np.empty_like(self._v)
        self._close = driven.bind(self.forcing, *self._out, method, self.dt)
        self._leave = leave and driven.bind(self.forcing, *self._out, leave, self.dt)
        seen = self._u.copy(), self._v.copy(), np.zeros(2)
        self._tell(seen[0][None, : scene.sites], seen[1][None, : scene.sites], seen[2][None],
                   np.zeros(1))  # fmt: skip
        self.point = _Point(0, self._u.copy(), self._v.copy(), self._loop.sums.copy(), seen)
        if enter is not None and self._steps:
            first = driven.bind(self.forcing, self._u, self._v, enter, self.dt)
            first.advance(0, 1, False, True)
            self._loop.sums[:] = first.sums
            self._loop.forget()
            self.point = _Point(0, self._u.copy(), self._v.copy(), self._loop.sums.copy(), seen)

    def _pulled(self, t: float, u: Array) -> float:
        """Sum of prescribed forces times displacements [J]."""
        forced = self.forcing.forced
        if not len(forced):
            return 0.0
        return float(np.sum(self.forcing.force(np.array([t]), 0)[0] * u.reshape(-1)[forced]))

    def _look(self, done: int) -> tuple[Array, Array, Array]:
        """u, v and (work, loss) after so many steps, on copies with the closing kick."""
        u, v = self._out
        u[:], v[:] = self._u, self._v
        t = done * self.dt
        self._close.sums[:2] = self._loop.sums[:2]
        self._close.forget()
        if done:
            self._close.advance(done, 0, True, True)
        sums = self._close.sums[:2]
        if self._leave is not None:
            self._leave.sums[:2] = sums
            self._leave.forget()
            self._leave.advance(0, 1, False, True, t)
            sums = self._leave.sums[:2]
        return self._told(u.copy(), v.copy(), sums, t)

    def _told(self, u: Array, v: Array, sums: Array, t: float) -> tuple[Array, Array, Array]:
        sites, sums = self._scene.sites, sums[None, :2].copy()
        self._tell(u[None, :sites], v[None, :sites], sums, np.array([t]))
        return u, v, sums[0]

    # blocks of steps

    def run(self) -> tuple[Run, tuple[Array, ...]]:
        """Do all steps; the run, and u and v at the checkpoints."""
        failure = None
        self._refuse_start()
        stages = self._problem.method.stages
        most = (
            BLOCK // (self._scene.cost * stages), NUMBERS // self._loop.schedule.width()
        )  # fmt: skip
        largest = max(1, min(most))
        try:
            with progress(self._steps, "step") as bar:
                while True:
                    done = self.point.done
                    bar.update(done - bar.n)
                    self._catch_up()
                    if done == self._steps:
                        break
                    if not self._stride(min(self._steps - done, largest)):
                        self._advance(min(self._next() - done, largest))
            return self._finished(True), tuple(self._seen[:, : self._checked])
        except KeyboardInterrupt:
            pass
        except (ContactError, LockingError, StabilityError) as error:
            failure = error
        self._keep_last()
        run = self._finished(False)
        if failure is None:
            return run, tuple(self._seen[:, : self._checked])
        failure.run = run
        raise failure

    def _stride(self, steps: int) -> bool:
        """Do steps with their rows in one call; whether that was possible, and all is sound."""
        if self._leave is not None or not isinstance(self._loop, driven.BoundDriven) or steps < 2:
            return False
        point, end, scene = self.point, self.point.done + steps, self._scene
        t, stop = point.done * self.dt, self._plan.step.searchsorted(end, side="right")
        here = slice(self._count, int(stop))
        checks = self._checks[self._checked :]
        checks = checks[checks <= end]
        rows = self._plan.step[here]
        late = self.tuning is not None and t + steps * self.dt > self.tuning.until
        if late or self._plan.part[here].any():
            return False
        at = np.unique(np.concatenate([rows, checks, [end]]))
        self._loop.forget()
        self._close.forget()
        try:
            u, v, impulse, sums = self._loop.go(
                self._close,
                point.done,
                at - point.done,
                point.done > 0,
                scene.sites,
                scene.wall_count,
            )
        except driven.Locked:
            self._restore()
            return False
        met = self._widened()
        times = at * self.dt
        self._tell(u, v, sums, times)
        if self._wrong(met, (u[-1], v), t, steps) is not None or not self._is_clear(end, steps):
            self._restore()
            return False
        self._take(here, rows, at, u, v, impulse, sums)
        kept = np.searchsorted(at, checks)
        many = slice(self._checked, self._checked + len(checks))
        self._seen[0, many], self._seen[1, many] = u[kept], v[kept]
        self._checked += len(checks)
        self.met = met
        seen_u, seen_v = self._u.copy(), self._close.v.copy()
        seen_v[: scene.sites] = v[-1]
        seen = seen_u, seen_v, sums[-1].copy()
        self.point = _Point(end, self._u.copy(), self._v.copy(), self._loop.sums.copy(), seen)
        return True

    def _is_clear(self, end: int, steps: int) -> bool:
        """Whether no contact that is not listed can have formed.

        Raises
        ------
        ContactError
            One did, in a single step.
        """
        if self._tracker is None:
            return True
        u, travel = self._u[: self._scene.sites], self._loop.travel
        if self._tracker.share(travel) < 1:
            self._tracker.accept(u, travel)
            return True
        if steps == 1:
            self._tracker.judge(u, end * self.dt)
        return steps == 1

    def _widened(self) -> Array:
        """The elongations met so far, with those of the last steps."""
        found = [self.met, self._loop.range, self._close.range]
        low, high = (np.array([x[:, k] for x in found]) for k in (0, 1))
        return np.stack([np.fmin.reduce(low), np.fmax.reduce(high)], axis=1)

    def _tell(self, u: Array, v: Array, sums: Array, t: Array) -> None:
        """Give rows the motion that is prescribed, and all of the work; in place."""
        forcing, count = self.forcing, len(t)
        rows_u, rows_v = u.reshape(count, -1), v.reshape(count, -1)
        moved, forced = forcing.moved, forcing.forced
        if len(moved):
            rows_u[:, moved], rows_v[:, moved] = forcing.motion(t, 0), forcing.motion(t, 1)
            sums[:, 0] += (rows_v[:, moved] ** 2 - self._first_v**2) @ forcing.heavy / 2
        if len(forced):
            sums[:, 0] += np.sum(forcing.force(t, 0) * rows_u[:, forced], axis=1)
            sums[:, 0] -= self._first_force

    def _take(
        self, here: slice, rows: Array, at: Array, u: Array, v: Array, impulse: Array, sums: Array
    ) -> None:
        """Record rows of a stride."""
        if not len(rows):
            return
        kept, arrays = np.searchsorted(at, rows), self._rows.arrays
        t = self._plan.t[here]
        u, v = u[kept], v[kept]
        arrays["t"][here], arrays["energy"][here] = t, self._energies(t, u, v)
        arrays["u"][here], arrays["v"][here] = u[:, self._columns], v[:, self._columns]
        if self._scene.wall_count:
            arrays["impulse"][here] = impulse[kept]
        self._sums[here] = sums[kept]
        self._count = self._rows.count = here.stop

    def _next(self) -> int:
        """The step at which to stop next."""
        done, stops = self.point.done, [self._steps]
        if self._count < len(self._plan):
            stops.append(self._plan.stop(self._count, done))
        if self._checked < len(self._checks):
            stops.append(int(self._checks[self._checked]))
        return min(stop for stop in stops if stop > done)

    def _advance(self, steps: int) -> None:
        """Do at most so many steps, all of them sound."""
        while True:
            error = self._tried(steps)
            if error is None:
                return
            self._restore()
            if steps == 1:
                raise error
            steps = steps // 2

    def _restore(self) -> None:
        self._u[:], self._v[:] = self.point.u, self.point.v
        self._loop.sums[:] = self.point.sums

    def _tried(self, steps: int) -> TensegrityError | None:
        """Do steps; what went wrong, or None."""
        done, t = self.point.done, self.point.done * self.dt
        if self.tuning is not None and t + steps * self.dt > self.tuning.until:
            return LockingError(
                f"{self.tuning.reason}: the springs were driven there at t = "
                f"{self.tuning.until:.6g} s"
            )
        self._loop.forget()
        try:
            self._loop.advance(done, steps, done > 0, False)
            seen = self._look(done + steps)
        except driven.Locked as locked:
            return self._locked(locked)
        met = self._widened()
        error = self._wrong(met, seen, t, steps)
        if error is None and not self._is_clear(done + steps, steps):
            error = StabilityError(f"a step of {self.dt:.6g} s goes too far to look for contacts")
        if error is not None:
            return error
        self.met, self._previous = met, (*self.point.seen,)
        self.point = _Point(
            done + steps, self._u.copy(), self._v.copy(), self._loop.sums.copy(), seen
        )
        return None

    def _locked(self, locked: driven.Locked) -> TensegrityError:
        if not np.isfinite(locked.range).all():
            return StabilityError(
                f"the motion is no longer finite at t = {locked.t:.6g} s: dt too large"
            )
        low = self.tuning.domain(np.array([locked.t]))[0, 0]
        r = np.diff(self._u.reshape(-1))
        bond = int(r.argmin() if locked.range[0] <= low else r.argmax())
        where = locked.range[0] if locked.range[0] <= low else locked.range[1]
        error = self.tuning.beyond(locked.t, float(where))
        return type(error)(
            f"{error}: the spring between sites {bond} and {bond + 1} got there at "
            f"t = {locked.t:.6g} s"
        )

    def _wrong(self, met: Array, seen: Any, t: float, steps: int) -> TensegrityError | None:
        """Why the steps cannot stand, or None."""
        end = t + steps * self.dt
        u, v = seen[0][: self._scene.sites], seen[1]
        if self.tuning is None:
            low, high = self._domains.T
            for row, side in np.argwhere(np.stack([met[:, 0] <= low, met[:, 1] >= high], axis=1)):
                spring = self._scene.spring_table.different[row]
                error = spring.beyond(met[row, side])
                where = self._scene.extreme(int(row), u, side)
                return type(error)(f"{error}: the spring {where} got there at t = {end:.6g} s")
        if not (np.isfinite(u).all() and np.isfinite(v).all() and np.isfinite(met).all()):
            return StabilityError(
                f"the motion is no longer finite at t = {end:.6g} s: dt too large"
            )
        omega = self._omega(met, t, end)
        if self.dt > self._allowed * self._problem.largest_step(omega):
            limit = self._problem.largest_step(omega)
            return StabilityError(
                f"dt {self.dt:.6g} s is beyond {self._allowed * limit:.6g} s, {self._allowed:g} of "
                f"the stability limit of {self._problem.method.name} at the stiffness met at "
                f"t = {end:.6g} s {self._scene.stiffest(u, met)}"
            )
        return None

    def _refuse_start(self) -> None:
        """Refuse a step that is beyond what the initial state allows."""
        u = self.point.seen[0][: self._scene.sites]
        if self.tuning is None:
            omega = self._scene.frequency(self._scene.present_ranges(u))
        else:
            r = np.diff(u)
            omega = self._omega_tuned(float(r.min()), float(r.max()), np.zeros(1))
        limit = self._problem.largest_step(omega)
        if self.dt > self._allowed * limit:
            raise StabilityError(
                f"dt {self.dt:.6g} s is beyond {self._allowed * limit:.6g} s, {self._allowed:g} of "
                f"the stability limit of {self._problem.method.name} in the initial state"
            )

    def _omega(self, met: Array, t: float, end: float) -> float:
        """Bound on the angular frequency at the elongations met [rad/s]."""
        scene = self._scene
        if self.tuning is None:
            if np.all(met[:, 0] >= self._known[:, 0]) and np.all(met[:, 1] <= self._known[:, 1]):
                return self._fastest
            room = 0.05 * (met[:, 1] - met[:, 0])  # so as not to ask again soon
            wide = np.stack([met[:, 0] - room, met[:, 1] + room], axis=1)
            inside = np.all(wide > self._domains[:, :1], 1) & np.all(wide < self._domains[:, 1:], 1)
            wide = np.where(inside[:, None], wide, met)
            omega = scene.frequency(wide)
            if self.dt > self._allowed * self._problem.largest_step(omega):
                return scene.frequency(met)
            self._known, self._fastest = wide, omega
            return omega
        low, high = self._loop.range[0].tolist()
        return self._omega_tuned(low, high, np.linspace(t, end, INSTANTS + 1))

    def _omega_tuned(self, low: float, high: float, at: Array) -> float:
        """The same within a range of elongations, in the springs of some instants."""
        r = np.append(low + (high - low) * GRID, 0.0)
        p = np.repeat(self.tuning.at(at), len(r), axis=0).T
        k = self.tuning.stiffness(np.ascontiguousarray(p), np.tile(r, len(at)))
        largest = float(np.max(k))
        if not math.isfinite(largest):
            return math.inf
        stiffness = np.full(len(self._scene.springs), max(largest, 0.0))
        return self._scene.frequency_of(stiffness)

    # rows

    def _catch_up(self) -> None:
        """Record what is due."""
        point = self.point
        while self._plan.is_due(self._count, point.done):
            part = self._plan.part[self._count]
            t = self._plan.t[self._count]
            self._add(t, *(point.seen if part == 0 else self._before(part)))
        due = self._checked < len(self._checks) and self._checks[self._checked] == point.done
        if due:
            sites = self._scene.sites
            self._seen[0, self._checked] = point.seen[0][:sites]
            self._seen[1, self._checked] = point.seen[1][:sites]
            self._checked += 1

    def _before(self, part: float) -> tuple[Array, Array, Array]:
        """The motion a time `part` after the step before the last one, by a shorter step."""
        u, v, sums = (x.copy() for x in self._previous)
        t, method = (self.point.done - 1) * self.dt, self._problem.method
        work = self._inner(t, u, v, sums)
        v.reshape(-1)[self.forcing.moved] = 0.0
        enter, leave = method.processor or (None, None)
        at = t
        for rows in (enter, method, leave):
            if rows is None:
                continue
            loop = driven.bind(self.forcing, u, v, rows, part)
            loop.sums[:2] = work
            loop.advance(0, 1, False, True, at)
            work, at = loop.sums[:2], t + part if rows is method else at
        return self._told(u, v, work, t + part)

    def _inner(self, t: float, u: Array, v: Array, sums: Array) -> Array:
        """Work and loss as the loop sums them, from what is told of them."""
        _, _, told = self._told(u.copy(), v.copy(), np.zeros(2), t)
        return sums - told

    def _add(self, t: float, u: Array, v: Array, sums: Array) -> None:
        scene = self._scene
        state = u[: scene.sites], v[: scene.sites]
        walls = v[scene.sites : scene.sites + scene.wall_count]
        energy = self._energies(np.array([t]), state[0][None], state[1][None])[0]
        self._rows.add(t, energy, state[0][self._columns], state[1][self._columns], walls)
        self._sums[self._count] = sums
        self._count += 1

    def _energies(self, t: Array, u: Array, v: Array) -> Array:
        """Total energies of rows [J], in the springs of their instants."""
        if self.tuning is None:
            return self._scene.energies(u, v)
        stored = self.tuning.energies(t, np.diff(u))
        return 0.5 * np.sum(self._scene.mass * v**2, axis=-1) + np.sum(stored, axis=-1)

    def _keep_last(self) -> None:
        self._restore()
        row = self._count - 1
        if row >= 0 and self._plan.step[row] == self.point.done and not self._plan.part[row]:
            return
        self._add(self.point.done * self.dt, *self.point.seen)

    def _finished(self, complete: bool) -> Run:
        table, scene, problem = self._rows.finished(), self._scene, self._problem
        u, v, _ = self.point.seen
        work, loss = self._sums[: self._count].T
        return Run(
            scene, table["t"], table["u"], table["v"], table["energy"],
            State(u[: scene.sites], v[: scene.sites]), problem.method.name, self.dt,
            self.point.done, self._sites, complete, met=self.met, force=problem.force,
            impulse=table["impulse"] if scene.wall_count else None, work=work, loss=loss,
        )  # fmt: skip
