"""Lanes of scenes in which time counts, as if they were one; see `motion`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tensegrity.errors import LockingError, StabilityError
from tensegrity.runs.motion import Motion, Reached, Rows
from tensegrity.runs.run import changed
from tensegrity.scenes.ensemble import Ensemble
from tensegrity.scenes.scene import State

if TYPE_CHECKING:
    from typing import Any

    from tensegrity.typing import Array, Indices


def motion_of(
    problem: Any, dt: float, allowed: float, start: Any = None, tuning: Any = None
) -> Any:
    """The motion of a scene, or of the lanes of an ensemble.

    Parameters
    ----------
    problem : Problem
    dt : float
        [s]
    allowed : float
        Of the stability limit.
    start : Reached, optional
        Where a motion that was broken off goes on.
    tuning : object, optional
        Springs in time, where `scene.tune` does not say them.
    """
    if isinstance(problem.scene, Ensemble):
        return LanesInMotion(problem, dt, allowed, start)
    return Motion(problem, dt, allowed, start, tuning)


class LanesInMotion:
    """Of the scenes of an ensemble, in turn, as if they were one; see `Motion`."""

    def __init__(self, problem: Any, dt: float, allowed: float, start: Any = None) -> None:
        self._scene = scene = problem.scene
        self._each, self.dt = [], dt
        for lane, one in enumerate(scene.scenes):
            state = State(*(np.ascontiguousarray(x[..., lane]) for x in _of(problem.state)))
            mine = changed(problem, scene=one, state=state)
            self._each.append(_said(lane, Motion, mine, dt, allowed, start and _lane(start, lane)))
        self._places = [scene.places_of(lane) for lane in range(scene.lanes)]
        self.width = max(one.width for one in self._each)
        self.strides = all(one.strides for one in self._each)
        self._attempted: list[Reached] = []
        self.point = self._together([one.point for one in self._each])

    def _together(self, points: list[Reached]) -> Reached:
        """What all lanes reached, in one."""
        met = np.zeros((len(self._scene.spring_table), 2))
        for place, point in zip(self._places, points, strict=True):
            np.minimum.at(met[:, 0], place, point.met[:, 0])
            np.maximum.at(met[:, 1], place, point.met[:, 1])
        u, v, sums = (np.stack(x, axis=-1) for x in zip(*(p[1:4] for p in points), strict=True))
        seen: Any = tuple(np.stack(x, axis=-1) for x in zip(*(p.seen for p in points), strict=True))
        return Reached(points[0].done, u, v, sums, seen, met)

    def energies(self, t: Array, u: Array, v: Array) -> Array:
        """Total energies of all lanes [J]."""
        parts = ((np.ascontiguousarray(x[..., k]) for x in (u, v)) for k in range(len(self._each)))
        each = zip(self._each, parts, strict=True)
        return np.sum([one.energies(t, *part) for one, part in each], axis=0)

    def look_back(self, part: float) -> tuple[Array, ...]:
        """As of one scene, lanes last."""
        each = [one.look_back(part) for one in self._each]
        return tuple(np.stack(x, axis=-1) for x in zip(*each, strict=True))

    def restore(self) -> None:
        """Go back to what was reached, in all lanes."""
        for one in self._each:
            one.restore()

    def accept(self, point: Reached) -> None:
        """Go on from what the last attempt reached."""
        for one, mine in zip(self._each, self._attempted, strict=True):
            one.accept(mine)
        self.point = point

    def attempt(self, steps: int) -> Reached:
        """As of one scene."""
        self._attempted = [_said(k, one.attempt, steps) for k, one in enumerate(self._each)]
        return self._together(self._attempted)

    def attempt_rows(self, at: Indices) -> tuple[Reached, Rows]:
        """As of one scene."""
        each = [_said(k, one.attempt_rows, at) for k, one in enumerate(self._each)]
        self._attempted = [point for point, _ in each]
        rows = (np.stack(x, axis=-1) for x in zip(*(rows for _, rows in each), strict=True))
        return self._together(self._attempted), Rows(*rows)

    def refuse_start(self) -> None:
        """As of one scene."""
        for lane, one in enumerate(self._each):
            _said(lane, one.refuse_start)


def _of(state: State) -> tuple[Array, Array]:
    return state.u, state.v


def _lane(point: Reached, lane: int) -> Reached:
    """What one lane reached, of what a file tells of all."""
    u, v, sums = (np.ascontiguousarray(x[..., lane]) for x in point[1:4])
    seen: Any = tuple(np.ascontiguousarray(x[..., lane]) for x in point.seen)
    return Reached(point.done, u, v, sums, seen, point.met)


def _said(lane: int, do: Any, *given: Any) -> Any:
    """What a function gives; an error of it tells the lane."""
    try:
        return do(*given)
    except (LockingError, StabilityError) as error:
        raise type(error)(f"lane {lane}: {error}") from error
