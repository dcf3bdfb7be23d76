"""What is kept of a run while it goes: rows at planned instants, and its whole state."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tensegrity.errors import LockingError, RecordError, StabilityError
from tensegrity.runs import archive
from tensegrity.runs.rows import Rows
from tensegrity.runs.run import Run


class Sound(NamedTuple):
    """Arrays of the loop after so many steps, known to be right; never changed.

    `seen` stands for them in the scene's own variables, with closing kicks; `before` is that of
    the step before, where the last block was one step.
    """

    u: np.ndarray
    v: np.ndarray
    done: int
    seen: tuple[np.ndarray, np.ndarray]
    before: tuple[np.ndarray, np.ndarray] | None = None


class Start(NamedTuple):
    """Where a broken run goes on: what it had reached, its rows, the elongations it had met."""

    sound: Sound
    count: int  # type: ignore[assignment]
    met: np.ndarray


class Book:
    """What a march records: rows at the instants of a plan, and the whole state.

    The rows alone say how far it is, so that it can be interrupted anywhere.

    Parameters
    ----------
    problem : Problem
    watch : object
        What advances: its `sound`, `dt`, `allowed`, `met`, `look` and `look_back`.
    steps : int
    count : int, optional
        Rows that the file has already, where a run goes on.
    """

    def __init__(self, problem, watch, steps, count=None):
        self._problem, self._watch, self._steps = problem, watch, steps
        record, scene = problem.record, problem.scene
        self._plan = record.plan(steps, problem.t_end)
        self._columns = record.columns(scene.sites)
        self._kept = tuple(np.arange(scene.sites)[self._columns].tolist())
        self._walls = watch.look()[1].shape
        if record.state_path is not None and count is None:
            record.state_path.unlink(missing_ok=True)  # that of a trial
        shape, room = (len(self._kept), *scene.shape[1:]), len(self._plan) + 1
        self._rows = record.rows(room, shape, self._walls, count)

    def stop(self):
        """The step at which to stop next."""
        done, row = self._watch.sound.done, self._rows.count
        return self._plan.stop(row, done) if row < len(self._plan) else self._steps

    def catch_up(self):
        """Record what is due."""
        done = self._watch.sound.done
        while self._plan.is_due(row := self._rows.count, done):
            part = self._plan.part[row]
            state, impulse = self._watch.look() if part == 0 else self._watch.look_back(part)
            self._add(self._plan.t[row], state, impulse)

    def ahead(self, steps):
        """Numbers of the steps of the next rows, as far as `steps` steps from here; None where a
        row lies within a step, or has to be in its file before the next one is computed."""
        if not isinstance(self._rows, Rows):
            return None
        row, done = self._rows.count, self._watch.sound.done
        last = np.searchsorted(self._plan.step, done + steps, side="right")
        return None if self._plan.part[row:last].any() else self._plan.step[row:last]

    def room(self, count):
        """Where u, v and impulses of the next rows belong, all sites of them; what `take` takes."""
        arrays, row = self._rows.arrays, self._rows.count
        walls = arrays["impulse"][row : row + count] if self._walls[0] else None
        if isinstance(self._columns, slice):
            return arrays["u"][row : row + count], arrays["v"][row : row + count], walls
        shape = count, *self._problem.scene.shape
        return np.empty(shape), np.empty(shape), walls

    def take(self, u, v):
        """Count rows that were put into `room`."""
        arrays, row = self._rows.arrays, self._rows.count
        here = slice(row, row + len(u))
        arrays["energy"][here] = self._problem.scene.energies(u, v)
        arrays["t"][here] = self._plan.t[here]
        if not isinstance(self._columns, slice):
            arrays["u"][here], arrays["v"][here] = u[:, self._columns], v[:, self._columns]
        self._rows.count += len(u)

    def keep_last(self):
        """Record where the run ended, if that is not the last row."""
        done, row = self._watch.sound.done, self._rows.count - 1
        if row >= 0 and self._plan.step[row] == done and self._plan.part[row] == 0:
            return
        self._add(done * self._watch.dt, *self._watch.look())

    def _add(self, t, state, impulse):
        energy = self._problem.scene.energy(state)
        self._rows.add(t, energy, state.u[self._columns], state.v[self._columns], impulse)

    def keep_state(self):
        """Write the whole state beside the rows, where that is asked for; nothing is due then."""
        problem, path = self._problem, self._problem.record.state_path
        if path is None:
            return
        sound = self._watch.sound
        try:
            self._rows.flush()
            archive.write(path, "state", {
                "scene": problem.scene, "state": problem.state, "t_end": problem.t_end,
                "method": problem.method, "record": problem.record, "choice": problem.choice,
                "steps": self._steps, "allowed": self._watch.allowed, "done": sound.done,
                "u": sound.u, "v": sound.v, "seen": sound.seen, "count": self._rows.count,
                "met": self._watch.met,
            })  # fmt: skip
        except OSError as error:
            raise RecordError(f"state path {path}: {error.strerror}") from error

    def broken_off(self, failure):
        """The run up to its last sound state, which is the last row, and what it failed by."""
        try:
            if not isinstance(failure, RecordError):
                self._settle()
                self.keep_last()
        except RecordError as error:
            failure = error
        return self.run(complete=False), failure

    def _settle(self):
        """Record what is due and keep the state, unless what is due is what failed."""
        try:
            self.catch_up()
        except (LockingError, StabilityError):
            return
        self.keep_state()

    def run(self, complete):
        """The run so far."""
        watch, problem, table = self._watch, self._problem, self._rows.finished()
        return Run(
            problem.scene, table["t"], table["u"], table["v"], table["energy"], watch.look()[0],
            problem.method.name, watch.dt, watch.sound.done, self._kept, complete,
            impulse=table["impulse"] if self._walls[0] else None, force=problem.force,
            met=watch.met, fastest=watch.fastest if problem.scene.follows else None,
        )  # fmt: skip
