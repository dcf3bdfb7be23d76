"""The march: one function that advances any scene by attempts and notifies its observers.

An attempt is a number of steps in one call of the compiled loop.  If it is rejected, it is repeated
with half as many steps, down to the single step in which the error occurs.
"""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Sequence
from contextlib import nullcontext
from contextvars import ContextVar
from typing import Any, NamedTuple

import numpy as np

from tensegrity.errors import ContactError, LockingError, RecordError, StabilityError
from tensegrity.notebook import progress
from tensegrity.runs.batch import motion_of
from tensegrity.runs.motion import MotionState
from tensegrity.runs.observers import UserObserver
from tensegrity.runs.problem import Problem
from tensegrity.runs.record import ComparisonSamples
from tensegrity.runs.recorder import Recorder
from tensegrity.runs.run import Run
from tensegrity.typing import Array, Observer

BLOCK = 8_000_000  # bonds x stages x steps of an attempt: about 20 ms, the delay of an interrupt
FIRST = 4  # times as many in the first attempt, so that a short run is a single call
ROOM = 8_000_000  # most numbers in u that a record or an observer of a user takes from an attempt
MOST_COMPARED = 2_000_000  # most numbers in u that are stored for comparison
RUN_ERRORS = ContactError, LockingError, StabilityError
FEWEST = 100  # least steps of an attempt: copies of the state before and after take as long as some
COUNTED: ContextVar[list[int] | None] = ContextVar("counted", default=None)
"""Where attempts add their evaluations of all forces, rejected ones included."""


class Start(NamedTuple):
    """Where an interrupted run continues: the state it had reached, its number of rows, and the
    checksum of the last one."""

    point: MotionState
    count: int  # type: ignore[assignment]
    last_row: int


class Stop(NamedTuple):
    """Time, step and state (u, v, impulse, sums) where an observer ended a run, and the reason."""

    t: float
    step: int
    state: tuple[Any, ...]
    words: str | None
    failed: bool = False  # whether the observer raised an exception


class MarchResult:
    """Result of a march.

    Attributes
    ----------
    problem : Problem
    samples : ndarray, (2, instants + 1, *shape)
        u [m] and v [m/s] at evenly spaced instants.
    complete : bool
        Whether all steps were done.
    stop : Stop or None
        Where the run ends, if this is not the last step that was done.
    """

    def __init__(
        self, problem: Problem, motion: Any, recorder: Any, samples: Sequence[ComparisonSamples]
    ) -> None:
        self.problem, self.motion, self.recorder = problem, motion, recorder
        self._samples, self.complete = samples, False
        self.stop: Stop | None = None

    @property
    def samples(self) -> Array:
        return self._samples[0].rows

    @property
    def steps(self) -> int:
        """Number of steps done."""
        return self.motion.done

    @property
    def elongation_range(self) -> Array:
        """Smallest and largest elongation of each spring [m], 0 included; (springs, 2)."""
        return self.motion.point.elongation_range

    @property
    def fastest(self) -> float:
        """Bound on the largest angular frequency within that range [rad/s]."""
        return self.motion.fastest

    @property
    def has_rows(self) -> bool:
        """Whether rows were recorded."""
        return self.recorder is not None

    def run(self) -> Run:
        """The run as a user receives it; a march without rows gives its last state alone."""
        try:
            return self._run()
        except KeyboardInterrupt:  # the computation is complete
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
        return self.recorder.run(self.steps, self.state()[:2], self.complete)

    def state(self) -> tuple[Any, ...]:
        """u, v, impulse and sums at the end."""
        dyn, (u, v, *sums) = self.problem.dynamics, self.motion.point.output
        sites, walls = dyn.sites, dyn.wall_count
        impulse = v[sites : sites + walls] if walls else None
        u, v = np.ascontiguousarray(u[:sites]), np.ascontiguousarray(v[:sites])
        return u, v, impulse, sums[0] if sums else None

    def end_at_last_row(self, last: Any) -> None:
        """Let the run end with its last row, given as time, step and state, or None."""
        self.stop = Stop(*last, words=None) if last else None

    def end(self) -> None:
        """Record the state in which the run ends."""
        if self.stop is not None:
            self.recorder.end(self.stop.t, self.stop.state)
        else:
            self.recorder.end(self.steps * self.motion.dt, self.state())


def march(
    problem: Problem, steps: int, allowed: float = 1.0, instants: int = 0, start: Any = None,
    observers: Sequence[Observer] = (),
) -> MarchResult:  # fmt: skip
    """Advance a scene with a constant step below a fraction of the stability limit.

    Parameters
    ----------
    problem : Problem
    steps : int
        Number of steps of the whole run.
    allowed : float, optional
        Admissible fraction of the stability limit.
    instants : int, optional
        Number of evenly spaced instants, a divisor of `steps`, at which u and v are stored for
        comparison; of a driven scene, whose motion may be faster than its bonds, after every step
        where these are not too many.
    start : Start, optional
        Where an interrupted run continues.
    observers : sequence of Observer, optional
        Further observers of the states.

    Returns
    -------
    MarchResult
        Incomplete after Ctrl-C, or where an observer of `problem.observe` ended the run.

    Raises
    ------
    LockingError, StabilityError, ContactError, RecordError
        The march cannot continue; `.run` is the part that was done, where rows are recorded.
    """
    dt = problem.t_end / steps if steps else 0.0
    motion = motion_of(problem, dt, allowed, start and start.point)
    if start is None and steps and problem.choice == "dt" and problem.record.path is not None:
        motion.refuse_start()  # before there is a file
    rows = () if start is None else start[1:]
    recorder = Recorder(problem, motion, steps, *rows) if problem.rows else None
    most = MOST_COMPARED if problem.dynamics.is_driven else 0
    samples = [ComparisonSamples(problem.scene.shape, steps, instants, most)] if instants else []
    users = [UserObserver(*pair, problem, motion, steps) for pair in problem.observe]
    reached = MarchResult(problem, motion, recorder, samples)
    failure: Any = None
    try:
        _go(reached, steps, users, [*samples, *observers])
        motion.release()
        return reached
    except KeyboardInterrupt:
        if reached.complete and problem.choice == "dt":
            return reached  # the computation is complete
        reached.complete = False
    except (*RUN_ERRORS, RecordError) as error:
        failure = error
    if recorder is not None:
        failure = _close_incomplete(reached, failure)
    motion.release()
    if failure is None:
        return reached
    if recorder is not None:
        failure.run = reached.run()
    raise failure


def _go(reached: MarchResult, steps: int, users: Any, others: Any) -> None:
    """Do all steps, or those until an observer ends the run."""
    problem, motion, recorder = reached.problem, reached.motion, reached.recorder
    block = BLOCK // (problem.dynamics.cost * problem.method.stages)
    most, is_given = max(FEWEST, FIRST * block), problem.choice == "dt"
    takers = users if recorder is None else [*users, recorder]
    observers, room = [*others, *takers], max(1, ROOM // problem.state.u.size)
    seconds, since = recorder and problem.record.checkpoint, time.monotonic()
    if seconds is not None:
        recorder.save_checkpoint(motion)
    with progress(steps, "step", motion.done) if steps > most else nullcontext() as bar:
        while not reached.complete and reached.stop is None:
            done, end = motion.done, steps
            for one in takers:
                end = min(end, one.last_step(room))
            end = min(done + most, max(end, done + 1), steps)
            _attempt(motion, end - done, observers, is_given)
            motion.accept()
            _notify_observers(reached, users, others)
            done, most = motion.done, max(FEWEST, block)
            if bar is not None:
                bar.update(done - bar.n)
            reached.complete = reached.stop is None and done == steps
            if seconds is None or reached.stop is not None:
                continue
            if reached.complete or time.monotonic() - since > seconds:
                recorder.save_checkpoint(motion)
                since = time.monotonic()


def _attempt(motion: Any, steps: int, observers: Any, is_given: bool) -> None:
    """Do at most so many steps that are accepted; `is_given`: the user gave the step length."""
    steps = min(steps, motion.most)
    motion.keep()
    counted = COUNTED.get()
    while True:
        end = motion.done + steps
        if counted is not None:
            counted.append(steps * motion.problem.method.stages)
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


def _notify_observers(reached: MarchResult, users: Any, others: Any) -> None:
    """Let the observers take the accepted states."""
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


def _close_incomplete(reached: MarchResult, failure: Any) -> Any:
    """Record what an incomplete march has reached; returns the error it failed by, or None."""
    motion, recorder = reached.motion, reached.recorder
    try:
        if isinstance(failure, RecordError):
            raise failure
        motion.restore()
        if reached.stop is None:
            _record_due(motion, recorder)
            recorder.save_checkpoint(motion)
        else:
            recorder.take(motion, reached.stop.t)
        reached.end()
    except RUN_ERRORS:  # the state that is due cannot be computed
        reached.end_at_last_row(recorder.last())
    except RecordError as error:
        reached.end_at_last_row(recorder.last())
        return error
    return failure


def _record_due(motion: Any, recorder: Recorder) -> None:
    """Record the accepted states that are due."""
    if motion.done == 0:  # no attempt was accepted yet
        motion.attempt(motion.done, recorder.wanted(motion.done))
    recorder.take(motion)
