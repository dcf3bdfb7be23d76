"""What is kept of a run while it goes: rows at planned instants, and its whole state."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tensegrity.errors import LockingError, RecordError, StabilityError
from tensegrity.runs import archive
from tensegrity.runs.rows import Rows
from tensegrity.runs.run import Run


class Kept(NamedTuple):
    """u, v of all sites and impulses of all walls after the steps `at`, increasing numbers."""

    at: np.ndarray
    u: np.ndarray
    v: np.ndarray
    impulse: np.ndarray

    def among(self, wanted):
        """Those after some of the steps; views where they are all."""
        if len(wanted) == len(self.at):
            return self
        places = np.searchsorted(self.at, wanted)
        return Kept(wanted, *(x[places] for x in self[1:]))


class Sound(NamedTuple):
    """Arrays of the loop after so many steps, known to be right; never changed.

    `seen` is them with closing kicks; `before` is that of the step before, where the last block
    was one step; `kept` what was kept on the way.
    """

    u: np.ndarray
    v: np.ndarray
    done: int
    seen: tuple[np.ndarray, np.ndarray]
    before: tuple[np.ndarray, np.ndarray] | None = None
    kept: Kept | None = None


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
        shape, room = (len(self._kept), *scene.shape[1:]), len(self._plan) + 1
        self._rows = record.rows(room, shape, self._walls, count)

    @property
    def _later(self):
        """Whether energies are left to whoever takes the run: what they need is in its rows."""
        if not isinstance(self._columns, slice):
            return False
        follows = self._problem.scene.follows and isinstance(self._rows, Rows)
        return self._problem.trial or follows

    def stop(self):
        """The step at which to stop next."""
        done, row = self._watch.sound.done, self._rows.count
        return self._plan.stop(row, done) if row < len(self._plan) else self._steps

    def catch_up(self):
        """Record what is due."""
        done, kept = self._watch.sound.done, self._watch.sound.kept
        if kept is not None:
            self._take(kept)
        while self._plan.is_due(row := self._rows.count, done):
            part = self._plan.part[row]
            state, impulse = self._watch.look() if part == 0 else self._watch.look_back(part)
            self._add(self._plan.t[row], state, impulse)

    def can_wait(self):
        """Whether rows may come several at a time: in a file each is whole before the next."""
        return isinstance(self._rows, Rows)

    def ahead(self, end):
        """Numbers of the steps of the next rows, up to step `end`; None where one lies within."""
        row = self._rows.count
        last = np.searchsorted(self._plan.step, end, side="right")
        return None if self._plan.part[row:last].any() else self._plan.step[row:last]

    def room(self, at):
        """Room for the next rows, which are after the steps `at`: where they belong, if may be."""
        arrays, here = self._rows.arrays, slice(self._rows.count, self._rows.count + len(at))
        impulse = arrays["impulse"][here] if self._walls[0] else np.empty((len(at), 0))
        if isinstance(self._columns, slice):
            return Kept(at, arrays["u"][here], arrays["v"][here], impulse)
        shape = len(at), *self._problem.scene.shape
        return Kept(at, np.empty(shape), np.empty(shape), impulse)

    def _take(self, kept):
        """Count rows that were put into `room`, or take them from among others."""
        row = self._rows.count
        last = np.searchsorted(self._plan.step, kept.at[-1] if len(kept.at) else -1, side="right")
        if last <= row:
            return
        rows, arrays, here = (
            kept.among(self._plan.step[row:last]),
            self._rows.arrays,
            slice(row, last),
        )
        arrays["t"][here] = self._plan.t[here]
        if self._later:
            arrays["energy"][here] = np.nan
        else:
            arrays["energy"][here] = self._problem.scene.energies(rows.u, rows.v)
        if not np.shares_memory(rows.u, arrays["u"]):
            arrays["u"][here], arrays["v"][here] = (
                rows.u[:, self._columns],
                rows.v[:, self._columns],
            )
            if self._walls[0]:
                arrays["impulse"][here] = rows.impulse
        self._rows.count = int(last)

    def keep_last(self):
        """Record where the run ended, if that is not the last row."""
        done, row = self._watch.sound.done, self._rows.count - 1
        if row >= 0 and self._plan.step[row] == done and self._plan.part[row] == 0:
            return
        self._add(done * self._watch.dt, *self._watch.look())

    def _add(self, t, state, impulse):
        energy = np.nan if self._later else self._problem.scene.energy(state)
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
        scene, energy = problem.scene, table["energy"]
        if self._later and not problem.trial:  # of rows side by side: one list of contacts for many
            energy = scene.energies(table["u"], table["v"])
        return Run(
            scene, table["t"], table["u"], table["v"], energy, watch.look()[0],
            problem.method.name, watch.dt, watch.sound.done, self._kept, complete,
            impulse=table["impulse"] if self._walls[0] else None, force=problem.force,
            met=watch.met, fastest=watch.fastest if problem.scene.follows else None,
        )  # fmt: skip


class Checks:
    """u and v at evenly spaced instants of a run, for comparison with others.

    Parameters
    ----------
    shape : tuple of int
    steps : int
        Of the run.
    count : int
        Instants besides the first; 0 for none.
    """

    def __init__(self, shape, steps, count):
        self._steps, self._apart = steps, steps // count if count else 0
        self._rows = np.empty((2, count + 1 if count else 0, *shape))
        self._count = 0

    @property
    def rows(self):
        """u and v so far."""
        return tuple(self._rows[:, : self._count])

    def ahead(self, end):
        """Numbers of the steps that are compared, up to step `end`."""
        left = self._rows.shape[1] - self._count
        count = min(end // self._apart + 1 - self._count, left) if self._apart else 0
        return (self._count + np.arange(max(count, 0))) * self._apart

    def stop(self):
        """The step at which to stop next."""
        return self._count * self._apart if self._count < self._rows.shape[1] else self._steps

    def catch_up(self, watch):
        """Take what is due."""
        kept, done = watch.sound.kept, watch.sound.done
        at = self.ahead(done)
        if kept is not None and len(at) and len(kept.at):
            found = kept.among(at)
            here = slice(self._count, self._count + len(at))
            self._rows[0, here], self._rows[1, here] = found.u, found.v
            self._count += len(at)
        elif len(at):
            state = watch.state()
            self._rows[0, self._count], self._rows[1, self._count] = state.u, state.v
            self._count += 1
