"""The march: one function that advances any scene by attempts, and serves those who observe it.

An attempt is so many steps in one call of the compiled loop.  Where it cannot stand, it is made
again with half as many, down to the step in which something went wrong.
"""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Sequence
from contextlib import nullcontext
from typing import Any, NamedTuple

import numpy as np

from tensegrity.errors import ContactError, LockingError, RecordError, StabilityError
from tensegrity.notebook import progress
from tensegrity.runs.batch import motion_of
from tensegrity.runs.motion import Point
from tensegrity.runs.problem import Problem
from tensegrity.runs.record import Samples, Watched
from tensegrity.runs.recorder import Recorder
from tensegrity.runs.run import Run
from tensegrity.typing import Array, Observer

BLOCK = 8_000_000  # bonds x stages x steps of an attempt, some 20 ms: an interrupt waits no longer
FIRST = 4  # times as many in the first attempt, which all of a short run is
ROOM = 8_000_000  # numbers in u at all steps of an attempt, which somebody may want
WRONG = ContactError, LockingError, StabilityError
FEWEST = 400  # steps of an attempt: the pieces of a long chain work apart for some tens


class Start(NamedTuple):
    """Where a run goes on that was broken off: what it had reached, and the rows it had."""

    point: Point
    count: int  # type: ignore[assignment]


class Stop(NamedTuple):
    """Where a run ended before its last step, and which observer wanted that; its u, v, impulse
    and sums."""

    t: float
    step: int
    state: tuple[Any, ...]
    words: str | None
    failed: bool = False  # by an exception


class Marched:
    """What a march reached.

    Attributes
    ----------
    problem : Problem
    samples : ndarray, (2, instants + 1, *shape)
        u and v at evenly spaced instants.
    complete : bool
    stop : Stop or None
        Where it ended, if not behind the last step that was done.
    """

    def __init__(self, problem: Problem, motion: Any, recorder: Any, samples: Samples) -> None:
        self.problem, self.motion, self.recorder = problem, motion, recorder
        self._samples, self.complete = samples, False
        self.stop: Stop | None = None

    @property
    def samples(self) -> Array:
        return self._samples.rows

    @property
    def steps(self) -> int:
        """That were done."""
        return self.motion.done

    @property
    def elongation_range(self) -> Array:
        """Smallest and largest elongation of each spring [m], 0 included; (springs, 2)."""
        return self.motion.point.elongation_range

    @property
    def fastest(self) -> float:
        """Bound on the largest angular frequency over these [rad/s]."""
        return self.motion.fastest

    @property
    def has_rows(self) -> bool:
        """Whether rows were kept."""
        return self.recorder is not None

    def run(self) -> Run:
        """The run; of a march without rows where it ended."""
        try:
            return self._run()
        except KeyboardInterrupt:  # all is done
            return self._run()

    def _run(self) -> Run:
        if self.recorder is None:
            self.recorder = Recorder(self.problem, self.motion, self.steps)
            self.end()
        if self.stop is not None:
            _, step, state, words, failed = self.stop
            run = self.recorder.run(step, [x.copy() for x in state[:2]], False, words)
            if failed:
                warnings.warn(str(words), RuntimeWarning, stacklevel=2)
            return run
        return self.recorder.run(self.steps, self._state()[:2], self.complete)

    def _state(self) -> tuple[Any, ...]:
        """u, v, impulse and sums at the end."""
        of, (u, v, *sums) = self.problem.dynamics, self.motion.point.shown
        sites, walls = of.sites, of.wall_count
        impulse = v[sites : sites + walls] if walls else None
        return *(np.ascontiguousarray(x[:sites]) for x in (u, v)), impulse, *(sums or [None])

    def back(self, last: Any) -> None:
        """Let it end with its last row: time, step and state, if known."""
        self.stop = Stop(*last, words=None) if last else None

    def end(self) -> None:
        """Record where it ended."""
        if self.stop is not None:
            self.recorder.end(self.stop.t, self.stop.state)
        else:
            self.recorder.end(self.steps * self.motion.dt, self._state())


def march(
    problem: Problem, steps: int, allowed: float = 1.0, instants: int = 0, start: Any = None,
    observers: Sequence[Observer] = (),
) -> Marched:  # fmt: skip
    """Advance a scene with one step, which stays below `allowed` of the stability limit.

    Parameters
    ----------
    problem : Problem
    steps : int
    allowed : float, optional
    instants : int, optional
        Evenly spaced ones, a divisor of the steps, at which u and v are kept for comparison.
    start : Start, optional
        Where a run that was broken off goes on.
    observers : sequence of Observer, optional
        Others that want states.

    Returns
    -------
    Marched
        Not complete after Ctrl-C, or where an observer of `problem.observe` ended it.

    Raises
    ------
    LockingError, StabilityError, ContactError, RecordError
        Why it could not go on; with `.run`, the part done, where rows are kept.
    """
    dt = problem.t_end / steps if steps else 0.0
    motion = motion_of(problem, dt, allowed, start and start.point)
    if start is None and steps and problem.choice == "dt" and problem.record.path is not None:
        motion.refuse_start()  # before there is a file
    recorder = Recorder(problem, motion, steps, start and start.count) if problem.rows else None
    samples = Samples(problem.scene.shape, steps, instants)
    users = [Watched(*pair, problem, motion, steps) for pair in problem.observe]
    reached = Marched(problem, motion, recorder, samples)
    failure: Any = None
    try:
        _go(reached, steps, users, [samples, *observers])
        motion.release()
        return reached
    except KeyboardInterrupt:
        if reached.complete and problem.choice == "dt":
            return reached  # all is done
        reached.complete = False
    except (*WRONG, RecordError) as error:
        failure = error
    if recorder is not None:
        failure = _break_off(reached, failure)
    motion.release()
    if failure is None:
        return reached
    if recorder is not None:
        failure.run = reached.run()
    raise failure


def _go(reached: Marched, steps: int, users: Any, others: Any) -> None:
    """Do all steps, or those up to where an observer ends the run."""
    problem, motion, recorder = reached.problem, reached.motion, reached.recorder
    largest = max(FEWEST, BLOCK // (problem.dynamics.cost * problem.method.stages))
    room = max(1, ROOM // math.prod(problem.scene.shape))
    most, is_given = min(FIRST * largest, room), problem.choice == "dt"
    observers = [*others, *users, *([recorder] if recorder else [])]
    seconds, since = recorder and problem.record.checkpoint, time.monotonic()
    if seconds is not None:
        recorder.keep_state(motion)
    with progress(steps, "step", motion.done) if steps > most else nullcontext() as bar:
        while not reached.complete and reached.stop is None:
            _attempt(motion, min(steps - motion.done, most), observers, is_given)
            motion.accept()
            _serve(reached, users, others)
            if bar is not None:
                bar.update(motion.done - bar.n)
            most = min(largest, room)
            reached.complete = reached.stop is None and motion.done == steps
            late = seconds is not None and time.monotonic() - since > seconds
            if reached.stop is None and (late or (seconds is not None and reached.complete)):
                recorder.keep_state(motion)
                since = time.monotonic()


def _attempt(motion: Any, steps: int, observers: Any, is_given: bool) -> None:
    """Do at most so many steps, which stand; `is_given` says whether a user gave their length."""
    steps = min(steps, motion.most)
    while True:
        end = motion.done + steps
        wanted = [one for observer in observers for one in observer.wanted(end)]
        if motion.attempt(end, wanted):
            return
        if motion.done == 0 and is_given:
            motion.refuse_start()
        if steps <= 1:
            error = motion.error()
            motion.restore()
            raise error
        motion.restore()
        steps = max(1, min(steps // 2, motion.most))


def _serve(reached: Marched, users: Any, others: Any) -> None:
    """Let observers take what stands."""
    motion, recorder = reached.motion, reached.recorder
    for one in others:
        one.take(motion)
    while users:
        due = [(one.time(one.count), k) for k, one in enumerate(users) if one.due(motion)]
        t, number = min(due, default=(math.inf, 0))
        if t == math.inf or (reached.stop is not None and t > reached.stop.t):
            break
        user, k = users[number], users[number].count
        words = user.ends(motion, k)
        if words and reached.stop is None:
            reached.stop = Stop(t, user.step(k), user.last, words, user.failed)
    if recorder is not None:
        recorder.take(motion, math.inf if reached.stop is None else reached.stop.t)
        if reached.stop is not None:
            reached.end()


def _break_off(reached: Marched, failure: Any) -> Any:
    """Keep what a march that did not end well has reached; what it failed by."""
    motion, recorder = reached.motion, reached.recorder
    try:
        if isinstance(failure, RecordError):
            raise failure
        motion.restore()
        if reached.stop is None:
            _catch_up(motion, recorder)
            recorder.keep_state(motion)
        else:
            recorder.take(motion, reached.stop.t)
        reached.end()
    except WRONG:  # what is due is what failed
        reached.back(recorder.last())
    except RecordError as error:
        reached.back(recorder.last())
        return error
    return failure


def _catch_up(motion: Any, recorder: Recorder) -> None:
    """Record what stands and is due."""
    if motion.done == 0:  # the first attempt may not have got so far
        motion.attempt(motion.done, recorder.wanted(motion.done))
    recorder.take(motion)
