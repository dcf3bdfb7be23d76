"""Motion in which time counts, step by step: a scene that is driven, damped or tuned.

The loop does not close its steps where a run is looked at: a copy gets the closing kick, and is
led out of the method's variables where it has others.  An attempt at a block of steps starts from
what was reached; where it left a domain, or what the step allows, nothing of it stands.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from tensegrity.engine import driven
from tensegrity.engine.timed import LARGEST_DAMPING, Locked
from tensegrity.errors import LockingError, StabilityError
from tensegrity.scenes.forcing import check_start, forcing_of
from tensegrity.springs.tuned import Tuned

if TYPE_CHECKING:
    from typing import Any

    from tensegrity.typing import Array, Indices

GRID = np.linspace(0, 1, 9)  # of the elongations met, where stiffness is looked at
INSTANTS = 8  # of a block of steps, where springs change


class Reached(NamedTuple):
    """Copies of what a motion has reached: as the loop left it, and as it is looked at.

    Lanes stand last in all arrays.

    Attributes
    ----------
    done : int
        Steps.
    u, v : ndarray
        Rows of the loop, before the closing kick.
    sums : ndarray, (4,)
        Of the loop; see `engine.driven`.
    seen : (ndarray, ndarray, ndarray)
        u and v with the closing kick; work and loss [J], (2,).
    met : ndarray, (springs, 2)
        Smallest and largest elongation so far [m].
    before : (ndarray, ndarray, ndarray), or None
        What was seen before the last steps.
    """

    done: int
    u: Array
    v: Array
    sums: Array
    seen: tuple[Array, Array, Array]
    met: Array
    before: tuple[Array, Array, Array] | None = None


class Rows(NamedTuple):
    """u, v, impulses of walls, and (work, loss), after some steps; lanes last."""

    u: Array
    v: Array
    impulse: Array
    sums: Array


class Motion:
    """Of one scene."""

    def __init__(
        self, problem: Any, dt: float, allowed: float, start: Any = None, tuning: Any = None
    ) -> None:
        self._problem, self._allowed, self.dt = problem, allowed, dt
        self._scene = scene = problem.scene
        check_start(scene, problem.state.u)
        self.tuning = self._springs() if tuning is None and scene.tune else tuning
        self.forcing = forcing_of(scene, problem.t_end, self.tuning)
        self._limit_damping()
        self._domains = scene.spring_table.reach
        self._fastest, self._known = 0.0, np.zeros((len(scene.spring_table), 2))
        self._begin()
        if start is not None and start.done:
            self.point = start
            self.restore()
        near = scene.clearance
        self._tracker = near and near.tracker(self.point.seen[0][: scene.sites])

    def _springs(self) -> Tuned:
        """Those that change, prepared once for all runs of one length."""
        scene, t_end, rows = self._scene, self._problem.t_end, self._problem.method.processor or ()
        longest = max((np.abs(np.cumsum(one.drifts)).max() for one in rows), default=0.0)
        known, key = scene.remembered.tuned, (t_end, self.dt * longest)
        if key not in known:
            known[key] = Tuned(scene.spring_table.different[0], scene.tune, *key)
        return known[key]

    def _limit_damping(self) -> None:
        """Refuse a step in a drift of which velocities would decay, or grow back, too much."""
        method, rate = self._problem.method, self.forcing.decay
        rows = [method, *(method.processor or ())]
        longest = max(abs(b) for one in rows for b in one.drifts)
        largest = LARGEST_DAMPING / longest / rate if rate else math.inf
        if self.dt > largest:
            error = StabilityError(
                f"{self._problem.step_words(self.dt)} is beyond {largest:.6g} s for dashpots whose "
                f"velocities decay at {rate:.6g} 1/s: {method.name} drifts by up to {longest:.3g} "
                f"dt at a time, which must be at most {LARGEST_DAMPING:g} of that rate"
            )
            error.largest = largest
            raise error

    def _begin(self) -> None:
        scene, method = self._scene, self._problem.method
        self._u, self._v = scene.arrays(self._problem.state)
        v = self._v.reshape(-1)
        self._first_v = self.forcing.motion(np.zeros(1), 1)[0] if len(self.forcing.moved) else 0.0
        v[self.forcing.moved] = 0.0
        self._first_force = self._pulled(self._u)
        enter, leave = method.processor or (None, None)
        self._loop = driven.bind(self.forcing, self._u, self._v, method, self.dt)
        self.width = self._loop.schedule.width()
        self._out = np.empty_like(self._u), np.empty_like(self._v)
        self._close = driven.bind(self.forcing, *self._out, method, self.dt)
        self._leave = leave and driven.bind(self.forcing, *self._out, leave, self.dt)
        seen = self._told(self._u.copy(), self._v.copy(), np.zeros(2), 0.0)
        if enter is not None and self.dt:
            first = driven.bind(self.forcing, self._u, self._v, enter, self.dt)
            first.advance(0, 1, False, True)
            self._loop.sums[:] = first.sums
            self._loop.forget()
        self.point = self._reached(0, seen, np.zeros((len(scene.spring_table), 2)))

    def _reached(self, done: int, seen: Any, met: Array, before: Any = None) -> Reached:
        loop = self._u.copy(), self._v.copy(), self._loop.sums.copy()
        return Reached(done, *loop, seen, met, before)

    def _pulled(self, u: Array) -> float:
        """Sum of prescribed forces times displacements at t = 0 [J]."""
        forced = self.forcing.forced
        if not len(forced):
            return 0.0
        return float(np.sum(self.forcing.force(np.zeros(1), 0)[0] * u.reshape(-1)[forced]))

    # what is looked at

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

    def energies(self, t: Array, u: Array, v: Array) -> Array:
        """Total energies of rows [J], in the springs of their instants."""
        scene = self._scene
        if self.tuning is None:
            return scene.energies(u, v)
        stored = self.tuning.energies(t, scene.stretch(u))
        mass = scene.mass.reshape(-1, *[1] * (v.ndim - 2))
        motion = (mass * v**2 / 2 - scene.loads * u).reshape(len(u), -1)
        return np.sum(motion, axis=1) + np.sum(stored, axis=-1)

    def look_back(self, part: float) -> tuple[Array, Array, Array]:
        """What is seen a time `part` after the step before the last one, by a shorter step."""
        before: Any = self.point.before
        u, v, sums = (x.copy() for x in before)
        t, method = (self.point.done - 1) * self.dt, self._problem.method
        _, _, told = self._told(u.copy(), v.copy(), np.zeros(2), t)
        work = sums - told  # as the loop sums them
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

    # steps

    @property
    def strides(self) -> bool:
        """Whether steps can be done with their rows in one call."""
        return self._leave is None

    def restore(self) -> None:
        """Go back to what was reached."""
        self._u[:], self._v[:] = self.point.u, self.point.v
        self._loop.sums[:] = self.point.sums

    def accept(self, point: Reached) -> None:
        """Go on from what an attempt reached."""
        if self._tracker is not None and self._tracker.share(self._loop.travel) < 1:
            self._tracker.accept(point.u[: self._scene.sites], self._loop.travel)
        self.point = point

    def attempt(self, steps: int) -> Reached:
        """What so many steps more lead to, to be accepted or restored.

        Raises
        ------
        LockingError, StabilityError, ContactError
            Why they cannot stand.
        """
        done = self.point.done
        self._refuse_late(done + steps)
        self._loop.forget()
        try:
            self._loop.advance(done, steps, done > 0, False)
            seen = self._look(done + steps)
        except Locked as locked:
            raise self._locked(locked) from None
        return self._judged(steps, seen, self.point.seen)

    def attempt_rows(self, at: Indices) -> tuple[Reached, Rows]:
        """The same with rows after each of so many steps more, in one call.

        Raises
        ------
        LockingError, StabilityError, ContactError
        """
        done, scene = self.point.done, self._scene
        steps = int(at[-1])
        self._refuse_late(done + steps)
        self._loop.forget()
        self._close.forget()
        try:
            u, v, impulse, sums = self._loop.go(
                self._close, done, at, done > 0, scene.sites, scene.wall_count
            )
        except Locked as locked:
            raise self._locked(locked) from None
        self._tell(u, v, sums, (done + at) * self.dt)
        seen_u, seen_v = self._u.copy(), self._close.v.copy()
        seen_u[: scene.sites], seen_v[: scene.sites] = u[-1], v[-1]
        point = self._judged(steps, (seen_u, seen_v, sums[-1].copy()))
        return point, Rows(u, v, impulse, sums)

    def _refuse_late(self, end: int) -> None:
        """Refuse steps up to an instant from which on there are no springs."""
        if self.tuning is not None and end * self.dt > self.tuning.until:
            raise LockingError(
                f"{self.tuning.reason}: the springs were driven there at t = "
                f"{self.tuning.until:.6g} s"
            )

    def _judged(self, steps: int, seen: Any, before: Any = None) -> Reached:
        """What was reached, if it is sound."""
        met, end = self._widened(), self.point.done + steps
        self._refuse_wrong(met, seen, steps)
        if self._tracker is not None and self._tracker.share(self._loop.travel) >= 1:
            if steps > 1:
                raise StabilityError(f"a step of {self.dt:.6g} s goes too far to look for contacts")
            self._tracker.judge(self._u[: self._scene.sites], end * self.dt)
        return self._reached(end, seen, met, before)

    def _widened(self) -> Array:
        """The elongations met so far, with those of the last steps."""
        shape = self.point.met.shape
        found = [self.point.met, *(np.broadcast_to(x.range, shape) for x in self._loops)]
        low, high = (np.array([x[:, k] for x in found]) for k in (0, 1))
        return np.stack([np.fmin.reduce(low), np.fmax.reduce(high)], axis=1)

    @property
    def _loops(self) -> Any:
        return self._loop, self._close

    def _locked(self, locked: Locked) -> LockingError | StabilityError:
        if not np.isfinite(locked.range).all():
            return StabilityError(
                f"the motion is no longer finite at t = {locked.t:.6g} s: dt too large"
            )
        low = self.tuning.domain(np.array([locked.t]))[0, 0]
        side = int(locked.range[0] > low)
        error = self.tuning.beyond(locked.t, float(locked.range[side]))
        where = self._scene.extreme(0, self._u[: self._scene.sites], side)
        return type(error)(f"{error}: the spring {where} got there at t = {locked.t:.6g} s")

    def _refuse_wrong(self, met: Array, seen: Any, steps: int) -> None:
        """Say why steps cannot stand."""
        t = self.point.done * self.dt
        end = t + steps * self.dt
        u, v = seen[0][: self._scene.sites], seen[1]
        if self.tuning is None:
            low, high = self._domains.T
            for row, side in np.argwhere(np.stack([met[:, 0] <= low, met[:, 1] >= high], axis=1)):
                spring = self._scene.spring_table.different[row]
                error = spring.beyond(met[row, side])
                where = self._scene.extreme(int(row), u, side)
                raise type(error)(f"{error}: the spring {where} got there at t = {end:.6g} s")
        if not (np.isfinite(u).all() and np.isfinite(v).all() and np.isfinite(met).all()):
            raise StabilityError(f"the motion is no longer finite at t = {end:.6g} s: dt too large")
        limit = self._problem.largest_step(self._omega(met, t, end))
        if self.dt > self._allowed * limit:
            raise StabilityError(
                f"{self._problem.step_words(self.dt)} is beyond {self._allowed * limit:.6g} s, "
                f"{self._allowed:g} of the stability limit of {self._problem.method.name} at the "
                f"stiffness met at "
                f"t = {end:.6g} s {self._scene.stiffest(u, met)}"
            )

    def refuse_start(self) -> None:
        """Refuse a step that is beyond what the state allows."""
        u = self.point.seen[0][: self._scene.sites]
        if self.tuning is None:
            omega = self._scene.frequency(self._scene.present_ranges(u))
        else:
            r = self._scene.stretch(u)
            at = np.array([self.point.done * self.dt])
            omega = self._omega_tuned(float(r.min()), float(r.max()), at)
        limit = self._problem.largest_step(omega)
        if self.dt > self._allowed * limit:
            raise StabilityError(
                f"{self._problem.step_words(self.dt)} is beyond {self._allowed * limit:.6g} s, "
                f"{self._allowed:g} of the stability limit of {self._problem.method.name} in the "
                f"initial state"
            )

    def _omega(self, met: Array, t: float, end: float) -> float:
        """Bound on the angular frequency at the elongations met [rad/s]."""
        scene = self._scene
        if self.tuning is not None:
            low, high = self._loop.range[0].tolist()
            return self._omega_tuned(low, high, np.linspace(t, end, INSTANTS + 1))
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

    def _omega_tuned(self, low: float, high: float, at: Array) -> float:
        """The same within a range of elongations, in the springs of some instants."""
        scene, r = self._scene, np.append(low + (high - low) * GRID, 0.0)
        p = np.ascontiguousarray(np.repeat(self.tuning.at(at), len(r), axis=0).T)
        r = np.tile(r, len(at))
        largest = float(np.max(self.tuning.evaluate(2, p, r)))
        if scene.turns:  # tension resists motion across a bond
            shortest = min(low, 0.0) - float(np.max(scene.closing))
            across = float(np.max(self.tuning.evaluate(1, p, r)))
            largest = max(largest, across / shortest if shortest > 0 else math.inf)
        if not math.isfinite(largest):
            return math.inf
        return scene.frequency_of(np.full(len(scene.springs), max(largest, 0.0)))
