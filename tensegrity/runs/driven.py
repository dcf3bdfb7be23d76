"""Runs in which time counts: driven, damped and tuned scenes, as `march` runs the others.

A block of steps that cannot stand is done again in halves, down to the step in which something
went wrong.  Rows, work and loss are kept in memory, or in a file with the whole state beside it.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.engine.methods import Splitting
from tensegrity.errors import (
    ContactError,
    LockingError,
    RecordError,
    StabilityError,
    TensegrityError,
)
from tensegrity.progress import progress
from tensegrity.runs import archive
from tensegrity.runs.lanes import motion_of
from tensegrity.runs.march import BLOCK, refuse_start
from tensegrity.runs.march import march as march_on
from tensegrity.runs.motion import Reached
from tensegrity.runs.rows import Rows
from tensegrity.runs.run import Run
from tensegrity.scenes.scene import State

if TYPE_CHECKING:
    from typing import Any

    from tensegrity.typing import Array, Indices

NUMBERS = 100_000  # that time gives steps, computed at a time
WRONG = ContactError, LockingError, StabilityError


def march(
    problem: Any, steps: int, allowed: float, checkpoints: int = 0, start: Any = None
) -> tuple[Run, tuple[Array, ...]]:
    """As `march.march`, which it calls for scenes that keep their energy."""
    if not problem.scene.is_driven:
        return march_on(problem, steps, allowed, checkpoints, start)
    if start is None:
        refuse_start(problem, steps)
    method = problem.method
    if not isinstance(method, Splitting):
        raise TensegrityError(
            f"method {method.name!r} is no splitting of kicks and drifts, which driven, damped and "
            "tuned scenes need, such as verlet and rkn6"
        )
    return March(problem, steps, allowed, checkpoints, start).run()


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
    start : Start, optional
        Where a run that was broken off goes on.
    tuning : object, optional
        Springs in time, where `scene.tune` does not say them.
    """

    def __init__(
        self,
        problem: Any,
        steps: int,
        allowed: float,
        checkpoints: int = 0,
        start: Any = None,
        tuning: Any = None,
    ) -> None:
        self._problem, self._steps, self._allowed = problem, steps, allowed
        self._scene, record = problem.scene, problem.record
        scene, self.dt = self._scene, problem.t_end / steps if steps else 0.0
        self._motion = motion_of(problem, self.dt, allowed, start and _reached(start), tuning)
        self._plan = record.plan(steps, problem.t_end)
        self._columns = record.columns(scene.sites)
        apart = steps // checkpoints if checkpoints else 0
        self._checks = apart * np.arange(checkpoints + 1) if checkpoints else np.zeros(0, int)
        sites, rest = np.arange(scene.sites)[self._columns], scene.shape[1:]
        self._sites, self._checked = tuple(sites.tolist()), 0
        self._rows = record.rows(
            len(self._plan) + 1, (len(sites), *rest), (scene.wall_count, *rest),
            None if start is None else start.count, more=("work", "loss"),
        )  # fmt: skip
        self._seen = np.empty((2, len(self._checks), *scene.shape))

    def run(self) -> tuple[Run, tuple[Array, ...]]:
        """Do all steps; the run, and u and v at the checkpoints."""
        failure: Any = None
        self._motion.refuse_start()
        stages, seconds = self._problem.method.stages, self._problem.record.checkpoint
        block = BLOCK // (self._scene.cost * stages)
        largest = max(1, min(block, NUMBERS // self._motion.width))
        since = time.monotonic()
        self._keep_state()
        try:
            with progress(self._steps, "step") as bar:
                while True:
                    done = self._done
                    bar.update(done - bar.n)
                    self._catch_up()
                    if done == self._steps:
                        break
                    if seconds is not None and time.monotonic() - since > seconds:
                        self._keep_state()
                        since = time.monotonic()
                    if not self._stride(min(self._steps - done, largest)):
                        self._advance(min(self._next() - done, largest))
            self._keep_state()
            return self._finished(True), tuple(self._seen[:, : self._checked])
        except KeyboardInterrupt:
            pass
        except (*WRONG, RecordError) as error:
            failure = error
        self._motion.restore()
        if not isinstance(failure, RecordError):
            try:
                self._catch_up()
                self._keep_state()
                self._keep_last()
            except RecordError as error:
                failure = error
        run = self._finished(False)
        if failure is None:
            return run, tuple(self._seen[:, : self._checked])
        failure.run = run
        raise failure

    @property
    def _done(self) -> int:
        return self._motion.point.done

    # blocks of steps

    def _stride(self, steps: int) -> bool:
        """Do steps with their rows in one call; whether that was possible, and all is sound."""
        if not self._motion.strides or not isinstance(self._rows, Rows) or steps < 2:
            return False
        done, end, count = self._done, self._done + steps, self._rows.count
        here = slice(count, int(self._plan.step.searchsorted(end, side="right")))
        checks = self._checks[self._checked :]
        checks, rows = checks[checks <= end], self._plan.step[here]
        if self._plan.part[here].any():
            return False
        at = np.unique(np.concatenate([rows, checks, [end]]))
        try:
            point, found = self._motion.attempt_rows(at - done)
        except WRONG:
            self._motion.restore()
            return False
        self._take(here, np.searchsorted(at, rows), found)
        kept = np.searchsorted(at, checks)
        many = slice(self._checked, self._checked + len(checks))
        self._seen[0, many], self._seen[1, many] = found.u[kept], found.v[kept]
        self._checked += len(checks)
        self._motion.accept(point)
        return True

    def _take(self, here: slice, kept: Indices, rows: Any) -> None:
        """Record some rows of a stride."""
        if not len(kept):
            return
        arrays: Any = self._rows.arrays
        t, u, v = self._plan.t[here], rows.u[kept], rows.v[kept]
        arrays["t"][here], arrays["energy"][here] = t, self._motion.energies(t, u, v)
        arrays["u"][here], arrays["v"][here] = u[:, self._columns], v[:, self._columns]
        if self._scene.wall_count:
            arrays["impulse"][here] = rows.impulse[kept]
        sums = rows.sums[kept].reshape(len(kept), 2, -1).sum(axis=-1)  # of all lanes
        arrays["work"][here], arrays["loss"][here] = sums.T
        self._rows.count = here.stop

    def _next(self) -> int:
        """The step at which to stop next."""
        done, stops = self._done, [self._steps]
        if self._rows.count < len(self._plan):
            stops.append(self._plan.stop(self._rows.count, done))
        if self._checked < len(self._checks):
            stops.append(int(self._checks[self._checked]))
        return min(stop for stop in stops if stop > done)

    def _advance(self, steps: int) -> None:
        """Do at most so many steps, all of them sound."""
        while True:
            try:
                self._motion.accept(self._motion.attempt(steps))
                return
            except WRONG:
                self._motion.restore()
                if steps == 1:
                    raise
                steps = steps // 2

    # rows

    def _catch_up(self) -> None:
        """Record what is due."""
        point, plan = self._motion.point, self._plan
        while plan.is_due(row := self._rows.count, point.done):
            part = plan.part[row]
            self._add(plan.t[row], *(point.seen if part == 0 else self._motion.look_back(part)))
        due = self._checked < len(self._checks) and self._checks[self._checked] == point.done
        if due:
            sites = self._scene.sites
            self._seen[0, self._checked] = point.seen[0][:sites]
            self._seen[1, self._checked] = point.seen[1][:sites]
            self._checked += 1

    def _add(self, t: float, u: Array, v: Array, sums: Array) -> None:
        sites, walls = self._scene.sites, self._scene.wall_count
        state = u[:sites], v[:sites]
        energy = self._motion.energies(np.array([t]), state[0][None], state[1][None])[0]
        impulse = [v[sites : sites + walls]] * bool(walls)
        work, loss = sums.reshape(2, -1).sum(axis=1)  # of all lanes
        self._rows.add(t, energy, *(x[self._columns] for x in state), *impulse, work, loss)

    def _keep_last(self) -> None:
        row = self._rows.count - 1
        if row >= 0 and self._plan.step[row] == self._done and not self._plan.part[row]:
            return
        self._add(self._done * self.dt, *self._motion.point.seen)

    def _keep_state(self) -> None:
        """Write the whole state beside the rows, where that is asked for; nothing is due then."""
        problem, point = self._problem, self._motion.point
        path = problem.record.state_path
        if path is None:
            return
        try:
            self._rows.flush()
            archive.write(path, "state", {
                "scene": problem.scene, "state": problem.state, "t_end": problem.t_end,
                "method": problem.method, "record": problem.record, "choice": problem.choice,
                "steps": self._steps, "allowed": self._allowed, "done": point.done,
                "u": point.u, "v": point.v, "seen": (*point.seen, point.sums),
                "count": self._rows.count, "met": point.met,
            })  # fmt: skip
        except OSError as error:
            raise RecordError(f"state path {path}: {error.strerror}") from error

    def _finished(self, complete: bool) -> Run:
        table, scene, problem = self._rows.finished(), self._scene, self._problem
        point = self._motion.point
        u, v = (np.ascontiguousarray(x[: scene.sites]) for x in point.seen[:2])
        return Run(
            scene, table["t"], table["u"], table["v"], table["energy"], State(u, v),
            problem.method.name, self.dt, point.done, self._sites, complete, met=point.met,
            force=problem.force, impulse=table["impulse"] if scene.wall_count else None,
            work=table["work"], loss=table["loss"],
        )  # fmt: skip


def _reached(start: Any) -> Reached:
    """Where a file says that a motion goes on."""
    *seen, sums = start.sound.seen
    sound = start.sound
    return Reached(sound.done, sound.u, sound.v, sums, tuple(seen), start.met)
