"""Scenes of an ensemble on their way: as many side by side as one loop takes, in turn else."""

from __future__ import annotations

from typing import Any

import numpy as np

from tensegrity.errors import ContactError, LockingError, StabilityError
from tensegrity.runs.forced import ForcedMotion
from tensegrity.runs.motion import Motion, Point
from tensegrity.runs.problem import AprioriBounds, Problem
from tensegrity.runs.run import unchecked_replace
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.scene import State
from tensegrity.typing import Array


def motion_of(problem: Problem, dt: float, allowed: float, start: Any = None) -> Any:
    """The motion of a scene, or of the scenes of an ensemble; see `Motion`."""
    if problem.dynamics.batch:
        parts = problem.dynamics.parts(problem.method)
        if len(parts) > 1 or parts[0].scene is not problem.scene:
            return BatchMotion(problem, dt, allowed, start)
    return (ForcedMotion if problem.is_forced else Motion)(problem, dt, allowed, start)


class BatchMotion:
    """Of the scenes of an ensemble, in its parts, as if they were one; see `Motion`."""

    def __init__(self, problem: Any, dt: float, allowed: float, start: Any = None) -> None:
        self.problem, self.dynamics, self._failed = problem, problem.dynamics, 0
        self.dt, self.allowed = dt, allowed
        self._parts, self._springs = [], len(problem.moved.springs)
        each = problem.dynamics.parts(problem.method), problem.moved.parts(problem.method)
        kind = ForcedMotion if problem.is_forced else Motion
        self._lanes = [part.numbers for part in each[0]]
        self._places = [part.places for part in each[1]]
        for number, (part, moved) in enumerate(zip(*each, strict=True)):
            state = State(part.of(problem.state.u), part.of(problem.state.v))
            mine = unchecked_replace(
                problem, scene=part.scene, state=state,
                a_priori=AprioriBounds(dynamics(part.scene), state),
                surrogate=problem.surrogate and moved.scene,
            )  # fmt: skip
            begins = start and Point(
                start.done, part.of(start.u), part.of(start.v), tuple(map(part.of, start.shown)),
                start.elongation_range[moved.places],
                None if start.sums is None else part.of(start.sums),
            )  # fmt: skip
            self._parts.append(self._said(number, kind, mine, dt, allowed, begins))
        self._points = [motion.point for motion in self._parts]

    def _said(self, number: int, do: Any, *given: Any) -> Any:
        """What a function gives; an error of it tells the lane."""
        try:
            return do(*given)
        except (ContactError, LockingError, StabilityError) as error:
            raise self._of_scene(number, error) from error

    def _of_scene(self, number: int, error: Any) -> Any:
        lanes = self._lanes[number]  # several tell themselves
        return type(error)(f"lane {lanes[0]}: {error}") if len(lanes) == 1 else error

    def _stacked(self, arrays: Any) -> Array:
        """Arrays of the parts in one, without idle lanes."""
        return np.concatenate(
            [x[..., None] if len(lanes) == 1 else x[..., : len(lanes)]
             for x, lanes in zip(arrays, self._lanes, strict=True)], axis=-1,
        )  # fmt: skip

    @property
    def point(self) -> Point:
        """What all lanes reached, in one."""
        points, elongation_range = self._points, np.zeros((self._springs, 2))
        for places, point in zip(self._places, points, strict=True):
            np.minimum.at(elongation_range[:, 0], places, point.elongation_range[:, 0])
            np.maximum.at(elongation_range[:, 1], places, point.elongation_range[:, 1])
        shown = tuple(self._stacked(x) for x in zip(*(p.shown for p in points), strict=True))
        u, v = (self._stacked([p[k] for p in points]) for k in (1, 2))
        sums = None if points[0].sums is None else self._stacked([p.sums for p in points])
        return Point(points[0].done, u, v, shown, elongation_range, sums)

    @property
    def done(self) -> int:
        """Steps."""
        return self._points[0].done

    @property
    def most(self) -> int:
        """Steps that an attempt should do at most."""
        return min(motion.most for motion in self._parts)

    @property
    def fastest(self) -> float:
        """As of `Motion`, of all lanes."""
        return max(motion.fastest for motion in self._parts)

    def release(self) -> None:
        """Leave the loops to the next run."""
        for motion in self._parts:
            motion.release()

    def refuse_start(self) -> None:
        """Refuse a step that is not stable as the run begins."""
        for number, motion in enumerate(self._parts):
            self._said(number, motion.refuse_start)

    def restore(self) -> None:
        """Go back to what was reached."""
        for motion, point in zip(self._parts, self._points, strict=True):
            motion.point = point
            motion.restore()

    def accept(self) -> None:
        """Go on from what the last attempt reached."""
        self._points = [motion.reached for motion in self._parts]
        for motion in self._parts:
            motion.accept()

    def attempt(self, end: int, wanted: Any) -> bool:
        """As of `Motion`, which all lanes have to do."""
        for number, (motion, lanes) in enumerate(zip(self._parts, self._lanes, strict=True)):
            shape = motion.dynamics.batch
            mine = [one.like(shape) for one in wanted]
            if not self._said(number, motion.attempt, end, mine):
                self._failed = number
                return False
            here = lanes[0] if len(lanes) == 1 else slice(lanes[0], lanes[-1] + 1)
            for one, own in zip(wanted, mine, strict=True):
                for array, part in zip(one.rows, own.rows, strict=True):
                    array[..., here] = part if len(lanes) == 1 else part[..., : len(lanes)]
        return True

    def error(self) -> Any:
        """Why an attempt at a single step failed."""
        return self._of_scene(self._failed, self._parts[self._failed].error())

    def energies(self, t: Array, u: Array, v: Array) -> Array:
        """Total energies [J]; (rows, lanes)."""
        if not self.dynamics.is_driven:
            return self.dynamics.energies(u, v)
        each = [
            motion.energies(t, *(np.ascontiguousarray(x[..., lanes[0]]) for x in (u, v)))
            for motion, lanes in zip(self._parts, self._lanes, strict=True)
        ]
        return np.stack(each, axis=-1)

    def between(self, step: int, part: float, *arrays: Any) -> None:
        """As of `Motion`."""
        for number, (motion, lanes) in enumerate(zip(self._parts, self._lanes, strict=True)):
            width = motion.dynamics.batch[0] if len(lanes) > 1 else 1
            places = np.minimum(lanes[0] + np.arange(width), lanes[-1])
            at = places if len(lanes) > 1 else places[0]
            mine = [None if x is None else np.ascontiguousarray(x[..., at]) for x in arrays]
            self._said(number, motion.between, step, part, *mine)
            for array, own in zip(arrays, mine, strict=True):
                if array is not None:
                    array[..., at] = own
