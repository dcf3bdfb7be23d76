"""A scene on its way, by attempts: so many steps in one call of its compiled loop.

The smallest and largest elongation that an attempt met are known at no cost.  So a spring that
reached an end of its domain, a stiffness beyond the stability limit, or a site that may have
touched what no list says, is noticed before a wrong number is seen; what was reached before still
stands then, and the attempt is made again with fewer steps, at last with the one that says where
and when.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from tensegrity.engine.march import STOPPED, Wanted
from tensegrity.engine.methods import Corrected, Splitting
from tensegrity.errors import LockingError, StabilityError
from tensegrity.runs.problem import MOST_STEPS, Guard
from tensegrity.scenes.clearance import SAFETY_FACTOR
from tensegrity.typing import Array

SPARE = 4  # prepared loops that a scene keeps for each method: one for each thread at work
LOOKS = 16  # states of an attempt by which contacts are looked for
ROOM = 1_000_000  # numbers in u of these, at most
LOOKED = 4_000_000  # numbers in u at all steps of an attempt that is looked at after each
LARGEST = 200_000  # numbers in u of a scene that keeps them


class Point(NamedTuple):
    """What a motion has reached, in arrays that are never changed; lanes stand last.

    Attributes
    ----------
    done : int
        Steps.
    u, v : ndarray
        Rows of the loop, before the closing kick.
    shown : tuple of ndarray
        Rows of u and v as the state there; and, where time counts, work and loss [J], (2,).
    met : ndarray, (springs, 2)
        Smallest and largest elongation so far [m], 0 included.
    sums : ndarray, or None
        Of the loop, where time counts; see `engine.driven`.
    """

    done: int
    u: Array
    v: Array
    shown: tuple[Array, ...]
    elongation_range: Array
    sums: Any = None


class Motion:
    """Of one scene with one step.

    Parameters
    ----------
    problem : Problem
    dt : float
        [s]
    allowed : float
        Of the stability limit.
    start : Point, optional
        Where a run that was broken off goes on.

    Attributes
    ----------
    point : Point
        What was reached.
    reached : Point
        By the last attempt, to be accepted.
    """

    _at_once = MOST_STEPS

    def __init__(self, problem: Any, dt: float, allowed: float, start: Any = None) -> None:
        self.problem, self.dt, self.allowed = problem, dt, allowed
        self.dynamics, self._fastest, self._most = problem.dynamics, 0.0, MOST_STEPS
        self._found = 0  # what the loop said of the last attempt
        self._unseen = 0  # steps since contacts were looked for
        self._sites = problem.dynamics.sites
        u = problem.state.u if start is None else start.shown[0][: self._sites]
        self._listed, self._guard, self._bound = self._prepared(problem.moved.listed(u))
        self._short: Any = None
        self.point = self._beginning()
        if start is not None:
            known = start.elongation_range.shape == self.point.elongation_range.shape
            elongation_range = start.elongation_range if known else self.point.elongation_range
            self.point = (start if start.done else self.point)._replace(
                elongation_range=elongation_range
            )
        near = problem.moved.clearance
        self._monitor = near and near.monitor(self.point.shown[0][: self._sites])
        self._samples_do = not problem.moved.follows or near.may_stay_valid(
            problem.state.v, problem.t_end
        )
        self.restore()

    def _prepared(self, listed: Any) -> tuple[Any, Guard, Any]:
        """The contacts that are listed, with no range of theirs known to be allowed, and a loop
        of them."""
        return listed, Guard(self.problem, listed, self.dt, self.allowed), self._bind(listed)

    def _bind(self, listed: Any) -> Any:
        """A loop of these contacts: one that was prepared before, if nobody uses it."""
        method, bind = self.problem.method, self.problem.bind
        try:
            bound = listed.prepared[method].pop() if bind is None else None
        except (KeyError, IndexError):
            bound = None
        if bound is None:
            u, v = listed.arrays(self.problem.state)
            return (bind or listed.bind)(u, v, method, self.dt)
        bound.set_step(self.dt)
        return bound

    def release(self) -> None:
        """Leave the loop to the next run."""
        bound, self._bound = self._bound, None
        if bound is None or self.problem.bind is not None or bound.u.size > LARGEST:
            return
        spare = self._listed.prepared.setdefault(self.problem.method, [])
        if len(spare) < SPARE:
            spare.append(bound)

    def _beginning(self) -> Point:
        u, v = self._listed.arrays(self.problem.state)
        return Point(0, u, v, (u, v), np.zeros((len(self._listed.springs), 2)))

    def restore(self) -> None:
        """Go back to what was reached."""
        if self._bound is not None:
            self._bound.u[...], self._bound.v[...] = self.point.u, self.point.v

    def refuse_start(self) -> None:
        """Refuse a step that is not stable as the run begins."""
        limit = self.problem.largest_step(self.first_frequency())
        if self.dt > limit:
            raise StabilityError(
                f"{self.problem.step_words(self.dt)} is beyond {limit:.6g} s, the stability limit "
                f"of {self.problem.method.name} in the initial state"
            )

    def first_frequency(self) -> float:
        """Bound on the angular frequency at the start [rad/s]; 0 where a step like this one is
        known to be stable."""
        present = self._listed.ranges_at(self.point.shown[0][: self._sites])
        return 0.0 if self._guard.is_known(present) else self._listed.frequency(present)

    # attempts

    def attempt(self, end: int, wanted: Any) -> bool:
        """Go on to step `end` with the states that are `Wanted`; whether all is sound, to be
        accepted.

        Raises
        ------
        ContactError
            Something unlisted touches in a single step.
        """
        if end == self.point.done:
            self.reached = self.point
            self._go(end, wanted)
            return True
        self._list_anew()
        steps, bound = end - self.point.done, self._bound
        bound.forget_range()
        if self._monitor is not None:
            wanted = [one.with_travel() for one in self._with_looks(end, wanted)]
        finite = self._go(end, wanted)
        elongation_range = bound.range
        self._range_met = self._range(elongation_range, finite)
        if not (finite and self._allows(self._range_met, end)):
            return False
        if self._monitor is not None and not self._is_clear(steps, end, wanted):
            return False
        self.reached = self._point(end, widened(self.point.elongation_range, elongation_range))
        return True

    def accept(self) -> None:
        """Go on from what the last attempt reached."""
        self._unseen = self.reached.done - self.point.done
        self.point = self.reached

    @property
    def most(self) -> int:
        """Steps that an attempt should do at most."""
        if self._monitor is not None and self._unseen:
            steps, travel, u = self._unseen, self._bound.travel, self.point.u[: self._sites]
            self._unseen = 0
            if self._monitor.fraction_used(travel) < 1:
                self._monitor.accept(u, travel)
            elif steps > 1:
                self._monitor.update(u)
            share = self._monitor.fraction_used(travel)
            clear = SAFETY_FACTOR * steps / share if share else math.inf
            self._most = max(1, int(min(clear, MOST_STEPS)))
        return min(self._most, self._at_once)

    def _go(self, end: int, wanted: Any) -> bool:
        """Advance the loop; whether that is finite."""
        self._found = self._bound.go(self.point.done, end, wanted)
        return not self._found

    def _point(self, end: int, elongation_range: Array) -> Point:
        bound = self._bound
        return Point(
            end,
            bound.u.copy(),
            bound.v.copy(),
            tuple(x.copy() for x in bound.shown),
            elongation_range,
        )

    def _range(self, elongation_range: Array, finite: bool) -> Array:
        """Elongations to be allowed: a method that evaluates forces elsewhere ends at others."""
        if not finite or isinstance(self.problem.method, (Splitting, Corrected)):
            return elongation_range
        return widened(
            elongation_range, self._listed.ranges_at(self._bound.shown[0][: self._sites])
        )

    def _allows(self, elongation_range: Array, end: int) -> bool:
        return self._guard.is_inside(elongation_range) and self._guard.allows(elongation_range)

    def _is_clear(self, steps: int, end: int, wanted: Any) -> bool:
        """Whether no unlisted contact can have formed, as the way travelled says, or states on the
        way, or at last those after all steps."""
        share = self._monitor.fraction_used(self._bound.travel)
        if share < 1:
            return True
        if steps == 1:
            self._monitor.verify(self._bound.u[: self._sites], end * self.dt)
            return True
        if self._samples_do and (self._keeps(end, wanted) or self._keeps_each(end)):
            return True
        self._most = max(1, min(steps // 2, int(SAFETY_FACTOR * steps / share)))
        return False

    def _keeps(self, end: int, wanted: Any, each: bool = False) -> bool:
        """Whether that which has most states on the way says that nothing unlisted touched."""
        found = max(
            (one for one in wanted if one.travel is not None),
            key=lambda one: len(one.at),
            default=None,
        )
        if found is None or not len(found.at):
            return False
        first, last = (x.shown[0][None, : self._sites] for x in (self.point, self._bound))
        rows, travel = [first, found.u], found.travel
        if found.at[-1] < end:
            rows, travel = [*rows, last], np.append(travel, self._bound.travel)
        return self._monitor.excludes_contact(
            np.concatenate(rows), np.diff(travel, prepend=0.0), each
        )

    def _with_looks(self, end: int, wanted: Any) -> Any:
        """What is wanted, and some states on the way where nobody else wants as many."""
        done, states = self.point.done, [len(one.at) for one in wanted if one.v is not None]
        large = LOOKS * math.prod(self._listed.shape) > ROOM
        if large or not self._samples_do or end - done <= LOOKS or max(states, default=0) >= LOOKS:
            return wanted
        at = done + (end - done) * np.arange(1, LOOKS + 1) // LOOKS
        return [*wanted, Wanted(at, *np.empty((2, LOOKS, *self._listed.shape)))]

    def _keeps_each(self, end: int) -> bool:
        """The same by all states on the way, once more, which is not taken apart."""
        done, shape = self.point.done, self._listed.shape
        if (end - done) * math.prod(shape) > LOOKED:
            return False
        rows = np.empty((2, end - done, *shape))
        every = Wanted(done + 1 + np.arange(end - done), *rows).with_travel()
        self.restore()
        self._bound.forget_range()
        self._go(end, [every])
        return self._keeps(end, [every], each=True)

    def _list_anew(self) -> None:
        """Go on with the contacts that may form from here on."""
        if self._monitor is None or not self._monitor.needs_new_list():
            return
        listed = self.problem.moved.listed(self._monitor.at)
        if listed is self._listed:
            return
        elongation_range, fastest = np.zeros((len(listed.springs), 2)), self.fastest
        known = dict(zip(self._listed.springs.kinds, self.point.elongation_range, strict=True))
        for row, kind in enumerate(listed.springs.kinds):
            elongation_range[row] = known.get(kind, 0.0)
        now, point = self._prepared(listed), self.point._replace(elongation_range=elongation_range)
        (self._listed, self._guard, self._bound), self.point, self._fastest = now, point, fastest
        self._short = None
        self.restore()

    # what was reached

    @property
    def fastest(self) -> float:
        """Bound on the largest angular frequency over all elongations met [rad/s]."""
        within = self._listed.stiffness_bounds(self.point.elongation_range)
        return max(self._fastest, self._listed.spring_frequency_bound(within))

    @property
    def done(self) -> int:
        """Steps."""
        return self.point.done

    def energies(self, t: Array, u: Array, v: Array) -> Array:
        """Total energies of rows [J]."""
        return self.dynamics.energies(u, v)

    def between(self, step: int, part: float, u: Array, v: Array, impulse: Any, sums: Any) -> None:
        """From the state after some steps go on by `part` [s], a shorter step of the method, in
        place; see `Wanted` for the arrays."""
        bound, sites = self._shorter(part), self._sites
        walls = slice(sites, sites + self.dynamics.wall_count)
        for array, rows in ((bound.u, u), (bound.v, v)):
            array[...] = 0
            array[:sites] = rows
        if impulse is not None:
            bound.v[walls] = impulse
        bound.forget_range()
        bound.advance(1)
        elongation_range = bound.range
        if not (np.isfinite(bound.u).all() and self._guard.is_inside(elongation_range)):
            self._range_met, shown = elongation_range, (bound.u, bound.v)
            raise self._explained(step * self.dt + part, elongation_range, shown)
        u[...], v[...] = bound.u[:sites], bound.v[:sites]
        if impulse is not None:
            impulse[...] = bound.v[walls]

    def _shorter(self, part: float) -> Any:
        if self._short is None:
            arrays = self._listed.arrays(self.problem.state)
            self._short = (self.problem.bind or self._listed.bind)(
                *arrays, self.problem.method, part
            )
            self._short.stand_alone()
        self._short.set_step(part)
        return self._short

    # what went wrong

    def error(self) -> LockingError | StabilityError:
        """Why an attempt at a single step failed."""
        if self._found == STOPPED:
            return self._bound.why_stopped()
        t = (self.point.done + 1) * self.dt
        return self._explained(t, self._range_met, self._bound.shown)

    def _explained(
        self, t: float, elongation_range: Array, shown: Any
    ) -> LockingError | StabilityError:
        """What went wrong in the step that ended at t, with these rows."""
        listed, u = self._listed, shown[0][: self._sites]
        if not np.isfinite(u).all():
            u, v = (x[: self._sites] for x in self.point.shown[:2])
            u = u + self.dt * v
        low, high = self._guard.domains.T
        for row, side in np.argwhere(
            np.stack([elongation_range[:, 0] <= low, elongation_range[:, 1] >= high], axis=1)
        ):
            spring, where = listed.springs.different[row], listed.where_extreme(int(row), u, side)
            barrier = self._barrier(spring, side)
            if barrier is not None:
                barrier, given = barrier
                return StabilityError(
                    f"{self.problem.step_words(self.dt)} is too coarse: the spring {where} "
                    f"passed the end of its domain at t = {t:.6g} s, which takes {barrier:.6g} J, "
                    f"with {given:.6g} J in the whole scene"
                )
            error = spring.beyond(elongation_range[row, side])
            return type(error)(f"{error}: the spring {where} got there at t = {t:.6g} s")
        return self._too_coarse(t, u, elongation_range)

    def _barrier(self, spring: Any, side: int) -> Any:
        """The energy at the end of a spring's domain, if the scene has less, and what it has."""
        barrier = float(spring.derivative(0, spring.reach[side], closed=True))
        given = self.dynamics.available_energy(self.problem.state)
        return (barrier, given) if given < barrier else None

    def _too_coarse(self, t: float, u: Array, elongation_range: Array) -> StabilityError:
        return StabilityError(
            f"{self.problem.step_words(self.dt)} is beyond "
            f"{self.allowed * self._guard.limit:.6g} s, {self.allowed:g} of the stability limit of "
            f"{self.problem.method.name} at the stiffness met at t = {t:.6g} s "
            f"{self._listed.where_stiffest(u, elongation_range)}"
        )


def widened(ranges: Array, others: Array) -> Array:
    """The least ranges (springs, 2) that hold both."""
    found = np.empty(ranges.shape)
    np.minimum(ranges[:, 0], others[:, 0], out=found[:, 0])
    np.maximum(ranges[:, 1], others[:, 1], out=found[:, 1])
    return found
