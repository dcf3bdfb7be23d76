"""The motion of a scene, advanced by attempts: a number of steps in one call of the compiled loop.

The loop notes the smallest and largest elongation of an attempt at no cost.  A spring that reached
an end of its domain, a stiffness beyond the stability limit, or a contact that may have formed
outside the list is thus detected before a state is used.  The attempt is then rejected and repeated
with fewer steps, finally with the single one that shows where and when the error occurs.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from tensegrity.engine.march import STOPPED, Wanted
from tensegrity.engine.methods import Corrected, Splitting
from tensegrity.errors import LockingError, StabilityError
from tensegrity.runs.problem import MOST_STEPS, StabilityGuard
from tensegrity.scenes.clearance import SAFETY_FACTOR
from tensegrity.springs.provenance import range_error
from tensegrity.typing import Array

SPARE = 4  # prepared loops cached with a scene for each method: one for each thread
SAMPLES = 16  # states of an attempt in which contacts are searched
ROOM = 1_000_000  # most numbers in u of these
MOST_RESAMPLED = 4_000_000  # most numbers in u of an attempt whose every step is examined
LARGEST = 200_000  # most numbers in u of a scene whose loops are cached


class MotionState(NamedTuple):
    """A state that a motion has reached; a batch is the last axis.

    Attributes
    ----------
    done : int
        Number of steps done.
    u, v : ndarray
        Rows of the loop [m, m/s], v before the closing kick.
    output : tuple of ndarray
        Rows of u and v of the output state; for driven scenes also work and loss [J], (2,).
    elongation_range : ndarray, (springs, 2)
        Smallest and largest elongation so far [m], 0 included.
    sums : ndarray, or None
        Sums of the loop of a driven scene; see `engine.driven`.
    """

    done: int
    u: Array
    v: Array
    output: tuple[Array, ...]
    elongation_range: Array
    sums: Any = None


class Motion:
    """The motion of one scene with a constant step.

    Parameters
    ----------
    problem : Problem
    dt : float
        Step [s].
    allowed : float
        Admissible fraction of the stability limit.
    start : MotionState, optional
        State from which an interrupted run continues.

    Attributes
    ----------
    point : MotionState
        The accepted state; in the arrays of the loop until `keep`.
    reached : MotionState
        The result of the last attempt, to be accepted.
    """

    _at_once = MOST_STEPS

    def __init__(self, problem: Any, dt: float, allowed: float, start: Any = None) -> None:
        self.problem, self.dt, self.allowed = problem, dt, allowed
        self.dynamics, self._fastest, self._most = problem.dynamics, 0.0, MOST_STEPS
        self._loop_status = 0  # returned by the loop in the last attempt
        self._unchecked = 0  # steps since contacts were searched
        self._sites = problem.dynamics.sites
        u = problem.state.u if start is None else start.output[0][: self._sites]
        self._listed, self._guard, self._bound = self._prepared(problem.loop_dynamics.listed(u))
        self._short: Any = None
        self.point = self._initial_state()
        if start is not None:
            known = start.elongation_range.shape == self.point.elongation_range.shape
            elongation_range = start.elongation_range if known else self.point.elongation_range
            self.point = (start if start.done else self.point)._replace(
                elongation_range=elongation_range
            )
        near = problem.loop_dynamics.clearance
        self._monitor = near and near.monitor(self.point.output[0][: self._sites])
        self._samples_do = not problem.loop_dynamics.follows or near.may_stay_valid(
            problem.state.v, problem.t_end
        )
        self.restore()

    def _prepared(self, listed: Any) -> tuple[Any, StabilityGuard, Any]:
        """Listed contacts, a stability guard without admissible ranges, and a loop for them."""
        return (
            listed,
            StabilityGuard(self.problem, listed, self.dt, self.allowed),
            self._bind(listed),
        )

    def _bind(self, listed: Any) -> Any:
        """A loop for these contacts: a cached one, if no other run uses it."""
        method, bind = self.problem.method, self.problem.bind
        self._spare = listed.prepared.setdefault(method, []) if bind is None else []
        if not self._spare:
            u, v = listed.arrays(self.problem.state)
            return (bind or listed.bind)(u, v, method, self.dt)
        bound = self._spare.pop()
        bound.set_step(self.dt)
        return bound

    def release(self) -> None:
        """Return the loop to the cache for the next run."""
        bound = self._bound
        if bound is not None and self.problem.bind is None and bound.u.size <= LARGEST:
            self.keep()
            if len(self._spare) < SPARE:
                self._spare.append(bound)
        self._bound = None

    def _initial_state(self) -> MotionState:
        u, v = self._listed.rows(self.problem.state)
        return MotionState(0, u, v, (u, v), np.zeros((self._listed.loop_bonds.noted, 2)))

    def restore(self) -> None:
        """Return to the accepted state."""
        if self._bound is not None:
            self._bound.restore(self.point.u, self.point.v)

    def refuse_start(self) -> None:
        """Refuse a step that is unstable in the initial state."""
        limit = self.problem.largest_step(self.first_frequency())
        if self.dt > limit:
            where = self._listed.where_fastest(self.point.elongation_range)
            raise StabilityError(
                f"{self.problem.step_words(self.dt)} is beyond {limit:.6g} s, the stability limit "
                f"of {self.problem.method.name} in the initial state{where}"
            )

    def first_frequency(self) -> float:
        """Bound on the angular frequency at the start [rad/s]; 0 where a step like this one is
        known to be stable."""
        present = self._listed.ranges_at(self.point.output[0][: self._sites])
        return 0.0 if self._guard.is_known(present) else self._listed.frequency(present)

    # attempts

    def keep(self) -> None:
        """Copy the accepted state from the arrays of the loop, before an attempt changes these."""
        done, u, v, (output_u, output_v, *work), *rest = self.point
        if u is self._bound.u:
            output = output_u.copy(), output_v.copy(), *work
            self.point = MotionState(done, u.copy(), v.copy(), output, *rest)

    def attempt(self, end: int, wanted: Any) -> bool:
        """Advance to step `end` and store the requested states.

        Parameters
        ----------
        end : int
        wanted : sequence of Wanted

        Returns
        -------
        bool
            Whether the attempt may be accepted.

        Raises
        ------
        ContactError
            A contact outside the list forms in a single step.
        """
        if end == self.point.done:
            self.reached = self.point
            self._go(end, wanted)
            return True
        self._list_anew()
        steps, bound = end - self.point.done, self._bound
        if self._monitor is not None:
            wanted = [one.with_travel() for one in self._with_contact_samples(end, wanted)]
        finite = self._go(end, wanted)
        self._attempt_range = self._range(bound.range, finite)
        if not (finite and self._allows(self._attempt_range, end)):
            return False
        if self._monitor is not None and not self._is_clear(steps, end, wanted):
            return False
        self.reached = self._point(end, bound.widen(self.point.elongation_range.copy()))
        return True

    def accept(self) -> None:
        """Accept the result of the last attempt."""
        self._unchecked = self.reached.done - self.point.done
        self.point = self.reached

    @property
    def most(self) -> int:
        """Largest number of steps of the next attempt."""
        if self._monitor is not None and self._unchecked:
            steps, travel, u = self._unchecked, self._bound.travel, self.point.u[: self._sites]
            self._unchecked = 0
            if self._monitor.fraction_used(travel) < 1:
                self._monitor.accept(u, travel)
            elif steps > 1:
                self._monitor.update(u)
            fraction = self._monitor.fraction_used(travel)
            clear = SAFETY_FACTOR * steps / fraction if fraction else math.inf
            self._most = max(1, int(min(clear, MOST_STEPS)))
        return min(self._most, self._at_once)

    def _go(self, end: int, wanted: Any) -> bool:
        """Advance the loop; whether the result is finite."""
        self._loop_status = self._bound.go(self.point.done, end, wanted)
        return not self._loop_status

    def _point(self, end: int, elongation_range: Array) -> MotionState:
        bound = self._bound
        return MotionState(end, bound.u, bound.v, bound.output, elongation_range)

    def _range(self, elongation_range: Array, finite: bool) -> Array:
        """Range to be checked; methods that evaluate forces elsewhere add that of the end state."""
        if not finite or isinstance(self.problem.method, (Splitting, Corrected)):
            return elongation_range
        return union_of(
            elongation_range, self._listed.ranges_at(self._bound.output[0][: self._sites])
        )

    def _allows(self, elongation_range: Array, end: int) -> bool:
        return self._guard.allows(elongation_range)

    def _is_clear(self, steps: int, end: int, wanted: Any) -> bool:
        """Whether no contact outside the list can have formed, by the distance travelled, or by the
        states sampled, or by those after every step."""
        fraction = self._monitor.fraction_used(self._bound.travel)
        if fraction < 1:
            return True
        if steps == 1:
            self._monitor.verify(self._bound.u[: self._sites], end * self.dt)
            return True
        if self._samples_do and (self._samples_clear(end, wanted) or self._each_step_clear(end)):
            return True
        self._most = max(1, min(steps // 2, int(SAFETY_FACTOR * steps / fraction)))
        return False

    def _samples_clear(self, end: int, wanted: Any, each: bool = False) -> bool:
        """Whether the longest list of sampled states excludes contacts outside the list."""
        longest = max(
            (one for one in wanted if one.travel is not None),
            key=lambda one: len(one.at),
            default=None,
        )
        if longest is None or not len(longest.at):
            return False
        first, last = (x.output[0][None, : self._sites] for x in (self.point, self._bound))
        rows, travel = [first, longest.u], longest.travel
        if longest.at[-1] < end:
            rows, travel = [*rows, last], np.append(travel, self._bound.travel)
        return self._monitor.excludes_contact(
            np.concatenate(rows), np.diff(travel, prepend=0.0), each
        )

    def _with_contact_samples(self, end: int, wanted: Any) -> Any:
        """The requested states, and samples to search for contacts unless as many are requested."""
        done, states = self.point.done, [len(one.at) for one in wanted if one.v is not None]
        large = SAMPLES * math.prod(self._listed.shape) > ROOM
        enough = end - done <= SAMPLES or max(states, default=0) >= SAMPLES
        if large or enough or not self._samples_do:
            return wanted
        at = done + (end - done) * np.arange(1, SAMPLES + 1) // SAMPLES
        return [*wanted, Wanted(at, *np.empty((2, SAMPLES, *self._listed.shape)))]

    def _each_step_clear(self, end: int) -> bool:
        """The same by the states after every step, for which the attempt is repeated."""
        done, shape = self.point.done, self._listed.shape
        if (end - done) * math.prod(shape) > MOST_RESAMPLED:
            return False
        rows = np.empty((2, end - done, *shape))
        every = Wanted(done + 1 + np.arange(end - done), *rows).with_travel()
        self.restore()
        self._go(end, [every])
        return self._samples_clear(end, [every], each=True)

    def _list_anew(self) -> None:
        """Renew the list of contacts that may form."""
        if self._monitor is None or not self._monitor.needs_new_list():
            return
        listed = self.problem.loop_dynamics.listed(self._monitor.at)
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

    # accepted state

    @property
    def fastest(self) -> float:
        """Bound on the largest angular frequency over all elongations reached [rad/s]."""
        within = self._listed.stiffness_bounds(self.point.elongation_range)
        return max(self._fastest, self._listed.spring_frequency_bound(within))

    @property
    def done(self) -> int:
        """Number of steps done."""
        return self.point.done

    def energies(self, t: Array, u: Array, v: Array) -> Array:
        """Total energies of states.

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
        return self.dynamics.energies(u, v)

    def between(self, step: int, part: float, u: Array, v: Array, impulse: Any, sums: Any) -> None:
        """Advance an output state in place by one shorter step of the method.

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
        sums : ndarray, (2,), or None
            Work and loss [J].

        Raises
        ------
        LockingError, StabilityError
            The shorter step fails.
        """
        bound, sites = self._shorter(part), self._sites
        walls = slice(sites, sites + self.dynamics.wall_count)
        for array, rows in ((bound.u, u), (bound.v, v)):
            array[...] = 0
            array[:sites] = rows
        if impulse is not None:
            bound.v[walls] = impulse
        bound.forget()
        bound.advance(1)
        elongation_range = bound.range
        if not (np.isfinite(bound.u).all() and self._guard.is_inside(elongation_range)):
            self._attempt_range, output = elongation_range, (bound.u, bound.v)
            raise self._diagnosed(step * self.dt + part, elongation_range, output)
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

    # errors

    def error(self) -> LockingError | StabilityError:
        """The error by which an attempt of a single step failed."""
        if self._loop_status == STOPPED:
            return self._bound.why_stopped()
        t = (self.point.done + 1) * self.dt
        return self._diagnosed(t, self._attempt_range, self._bound.output)

    def _diagnosed(
        self, t: float, elongation_range: Array, output: Any
    ) -> LockingError | StabilityError:
        """The error of the step that ended at t [s] in a state with these rows."""
        listed, u = self._listed, output[0][: self._sites]
        if not np.isfinite(u).all():
            u, v = (x[: self._sites] for x in self.point.output[:2])
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
            error = range_error(spring, elongation_range[row, side])
            return type(error)(f"{error}: the spring {where} got there at t = {t:.6g} s")
        return self._too_coarse(t, u, elongation_range)

    def _barrier(self, spring: Any, side: int) -> Any:
        """Energy at the end of a spring's domain and that of the scene [J], if the latter is less;
        otherwise None."""
        barrier = float(spring.derivative(0, spring.computable_domain[side], closed=True))
        given = self.dynamics.available_energy(self.problem.state)
        return (barrier, given) if given < barrier else None

    def _too_coarse(self, t: float, u: Array, elongation_range: Array) -> StabilityError:
        part = "" if self.allowed == 1 else f"{self.allowed:g} of "
        return StabilityError(
            f"{self.problem.step_words(self.dt)} is beyond "
            f"{self.allowed * self._guard.limit:.6g} s, {part}the stability limit of "
            f"{self.problem.method.name} at the stiffness reached at t = {t:.6g} s "
            f"{self._listed.where_stiffest(u, elongation_range)}"
        )


def union_of(ranges: Array, others: Array) -> Array:
    """The smallest ranges, (springs, 2), that contain both."""
    union = np.empty(ranges.shape)
    np.minimum(ranges[:, 0], others[:, 0], out=union[:, 0])
    np.maximum(ranges[:, 1], others[:, 1], out=union[:, 1])
    return union
