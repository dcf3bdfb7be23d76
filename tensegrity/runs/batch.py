"""The motion of an ensemble: scenes advanced as a batch by one loop where this is possible, one
after the other otherwise.  Several loops run on several threads."""

from __future__ import annotations

from typing import Any

import numpy as np

from tensegrity.engine.threaded import each
from tensegrity.errors import ContactError, LockingError, StabilityError
from tensegrity.runs.forced import ForcedMotion
from tensegrity.runs.motion import Motion, MotionState
from tensegrity.runs.problem import AprioriBounds, Problem
from tensegrity.runs.run import unchecked_replace
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.scene import State
from tensegrity.typing import Array


def motion_of(problem: Problem, dt: float, allowed: float, start: Any = None) -> Any:
    """The motion of a scene, or of the scenes of an ensemble.

    Parameters
    ----------
    problem : Problem
    dt : float
        Step [s].
    allowed : float
        Admissible fraction of the stability limit.
    start : MotionState, optional
        State from which an interrupted run continues.

    Returns
    -------
    Motion, ForcedMotion or BatchMotion
    """
    parts = problem.dynamics.parts(problem.method)
    if len(parts) > 1 or any(part.scene is not problem.scene for part in parts):
        return BatchMotion(problem, dt, allowed, start)
    return _kind(problem)(problem, dt, allowed, start)


def _kind(problem: Problem) -> type[Motion]:
    """The motion of single scenes: forced where it takes sums."""
    return ForcedMotion if problem.dynamics.sums else Motion


class BatchMotion:
    """The motion of an ensemble, whose parts have a loop each, with the interface of `Motion`."""

    def __init__(self, problem: Any, dt: float, allowed: float, start: Any = None) -> None:
        self.problem, self.dynamics, self._failed = problem, problem.dynamics, 0
        self.dt, self.allowed = dt, allowed
        self._parts, self._springs = [], len(problem.loop_dynamics.springs)
        each = problem.dynamics.parts(problem.method), problem.loop_dynamics.parts(problem.method)
        kind = _kind(problem)
        self._numbers = [part.numbers for part in each[0]]
        self._places = [part.places for part in each[1]]
        for number, (part, moved) in enumerate(zip(*each, strict=True)):
            state = State(part.of(problem.state.u), part.of(problem.state.v))
            of = dynamics(part.scene)
            mine = unchecked_replace(
                problem, scene=part.scene, state=state, dynamics=of,
                loop_dynamics=dynamics(moved.scene), a_priori=AprioriBounds(of, state),
            )  # fmt: skip
            begins = start and MotionState(
                start.done, part.of(start.u), part.of(start.v), tuple(map(part.of, start.output)),
                start.elongation_range[moved.places],
                None if start.sums is None else part.of(start.sums),
            )  # fmt: skip
            self._parts.append(self._naming_scene(number, kind, mine, dt, allowed, begins))
        self._points = [motion.point for motion in self._parts]

    def _naming_scene(self, number: int, do: Any, *given: Any) -> Any:
        """Result of a function; its error names the scene."""
        try:
            return do(*given)
        except (ContactError, LockingError, StabilityError) as error:
            raise self._of_scene(number, error) from error

    def _of_scene(self, number: int, error: Any) -> Any:
        numbers = self._numbers[number]  # the error of a batch names the scene itself
        return type(error)(f"scene {numbers[0]}: {error}") if len(numbers) == 1 else error

    def _stacked(self, arrays: Any) -> Array:
        """Arrays of the parts joined along the last axis, without padding."""
        return np.concatenate(
            [x[..., None] if len(numbers) == 1 else x[..., : len(numbers)]
             for x, numbers in zip(arrays, self._numbers, strict=True)], axis=-1,
        )  # fmt: skip

    @property
    def point(self) -> MotionState:
        """The accepted state of all scenes; see `Motion.point`."""
        points, elongation_range = self._points, np.zeros((self._springs, 2))
        for places, point in zip(self._places, points, strict=True):
            np.minimum.at(elongation_range[:, 0], places, point.elongation_range[:, 0])
            np.maximum.at(elongation_range[:, 1], places, point.elongation_range[:, 1])
        output = tuple(self._stacked(x) for x in zip(*(p.output for p in points), strict=True))
        u, v = (self._stacked([p[k] for p in points]) for k in (1, 2))
        sums = None if points[0].sums is None else self._stacked([p.sums for p in points])
        return MotionState(points[0].done, u, v, output, elongation_range, sums)

    @property
    def done(self) -> int:
        """Number of steps done."""
        return self._points[0].done

    @property
    def most(self) -> int:
        """Largest number of steps of the next attempt."""
        return min(motion.most for motion in self._parts)

    @property
    def fastest(self) -> float:
        """Bound on the largest angular frequency in all scenes [rad/s]."""
        return max(motion.fastest for motion in self._parts)

    def release(self) -> None:
        """Return the loops to the cache for the next run, and keep copies of what they reached."""
        for motion, point in zip(self._parts, self._points, strict=True):
            motion.point = point
            motion.release()
        self._points = [motion.point for motion in self._parts]

    def refuse_start(self) -> None:
        """Refuse a step that is unstable in the initial state."""
        for number, motion in enumerate(self._parts):
            self._naming_scene(number, motion.refuse_start)

    def restore(self) -> None:
        """Return to the accepted state."""
        for motion, point in zip(self._parts, self._points, strict=True):
            motion.point = point
            motion.restore()

    def keep(self) -> None:
        """Copy the accepted states; see `Motion.keep`."""
        for motion in self._parts:
            motion.keep()
        self._points = [motion.point for motion in self._parts]

    def accept(self) -> None:
        """Accept the result of the last attempt."""
        self._points = [motion.reached for motion in self._parts]
        for motion in self._parts:
            motion.accept()

    def attempt(self, end: int, wanted: Any) -> bool:
        """Advance all scenes to step `end`, on several threads; whether every attempt may be
        accepted."""

        def part(number: int) -> bool:
            motion, numbers = self._parts[number], self._numbers[number]
            here, width = int(numbers[0]), 1
            if len(numbers) > 1:
                here, width = slice(here, int(numbers[-1]) + 1), motion.dynamics.batch[0]
            mine = [one.part(here, width) for one in wanted]
            return self._naming_scene(number, motion.attempt, end, mine)

        work = (end - self.done) * self.problem.method.stages * self.dynamics.cost
        for number, accepted in enumerate(each(part, range(len(self._parts)), work)):
            if not accepted:
                self._failed = number
                return False
        return True

    def error(self) -> Any:
        """The error by which an attempt of a single step failed."""
        return self._of_scene(self._failed, self._parts[self._failed].error())

    def energies(self, t: Array, u: Array, v: Array) -> Array:
        """Total energies of states, for each scene.

        Parameters
        ----------
        t : ndarray, (rows,)
            Instants [s].
        u, v : ndarray, (rows, *shape)
            [m], [m/s]; the last axis counts scenes.

        Returns
        -------
        ndarray, (rows, scenes)
            [J]
        """
        if not self.dynamics.sums:
            return self.dynamics.energies(u, v)
        each = [
            motion.energies(t, *(np.ascontiguousarray(x[..., numbers[0]]) for x in (u, v)))
            for motion, numbers in zip(self._parts, self._numbers, strict=True)
        ]
        return np.stack(each, axis=-1)

    def between(self, step: int, part: float, *arrays: Any) -> None:
        """Advance the output states in place by one shorter step; see `Motion.between`."""
        for number, (motion, numbers) in enumerate(zip(self._parts, self._numbers, strict=True)):
            width = motion.dynamics.batch[0] if len(numbers) > 1 else 1
            places = np.minimum(numbers[0] + np.arange(width), numbers[-1])
            at = places if len(numbers) > 1 else places[0]
            mine = [None if x is None else np.ascontiguousarray(x[..., at]) for x in arrays]
            self._naming_scene(number, motion.between, step, part, *mine)
            for array, own in zip(arrays, mine, strict=True):
                if array is not None:
                    array[..., at] = own
