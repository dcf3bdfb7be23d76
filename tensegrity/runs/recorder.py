"""What is kept of a run: rows at the instants of its record, and its whole state."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.errors import RecordError
from tensegrity.once import once
from tensegrity.runs import archive
from tensegrity.runs.observers import Instants
from tensegrity.runs.run import Run, RunBatch, known
from tensegrity.scenes.scene import known_state

if TYPE_CHECKING:
    from typing import Any

    from tensegrity.typing import Array

AT_ONCE = 4_000_000  # numbers in u of rows whose energies are computed at once


@once
def _all(sites: int) -> tuple[int, ...]:
    return tuple(range(sites))


class Recorder(Instants):
    """Rows of a run, in memory or in a file.

    The rows alone say how far it is, so that it can be interrupted anywhere.

    Parameters
    ----------
    problem : Problem
    motion : Motion
    steps : int
    count : int, optional
        Rows that the file has already, where a run goes on.
    """

    def __init__(self, problem: Any, motion: Any, steps: int, count: int | None = None) -> None:
        record, of = problem.record, problem.dynamics
        self._problem, self._motion, self._steps = problem, motion, steps
        self._columns, rest = record.columns(of.sites), of.shape[1:]
        self._sites = _all(of.sites) if record.sites is None else tuple(record.sites)
        self._in_place = record.is_plain and record.sites is None
        self._rows: Any = None
        self._latest: Any = 0, None  # number of a row, and the states from there on
        super().__init__(record, problem, motion, steps)
        of_sites: Any = len(self._sites), *rest
        shapes = {"t": (), "energy": of.batch, "u": of_sites, "v": of_sites}
        if of.wall_count:
            shapes["impulse"] = of.wall_count, *rest
        if problem.is_forced:
            shapes |= {"work": of.batch, "loss": of.batch}
        self._rows = record.rows(len(self._plan.t) + 1, shapes, count)

    @property
    def count(self) -> int:  # type: ignore[override]
        """Rows that were written."""
        return 0 if self._rows is None else self._rows.count

    def _room(self, here: slice) -> tuple[Any, ...]:
        if not self._in_place:
            return super()._room(here)
        arrays, sums = self._rows.arrays, self._shapes[2:]
        return (
            arrays["u"][here],
            arrays["v"][here],
            arrays["impulse"][here] if self._of.wall_count else None,
            np.empty((here.stop - here.start, *sums[0])) if sums else None,
        )

    def take(self, motion: Any, last: float = math.inf) -> None:
        """Record what stands and is due, up to an instant [s]."""
        stop = self.due(motion).stop
        if last < math.inf:
            stop = int(self._plan.t[:stop].searchsorted(last, side="right"))
        while self.count < stop:
            first = self.count
            if self._plan.part[first] > 0:
                self._extend(self._plan.t[first : first + 1], *self._single(motion, first))
                continue
            between = self._plan.part[first:stop] > 0
            end = first + int(between.argmax()) if between.any() else stop
            row = int(self._states.at.searchsorted(self._plan.step[first]))
            here, states = slice(row, row + end - first), self._states[1:5]
            if self._in_place:
                states = *[None] * 3, states[3]
            states = (None if x is None else x[here] for x in states)
            self._extend(self._plan.t[first:end], *states)

    def _single(self, motion: Any, k: int) -> Any:
        return (None if x is None else x[None] for x in self.state(motion, k))

    def _extend(self, t: Array, u: Any, v: Any, impulse: Any, sums: Any) -> None:
        """Append rows; of those that are in their place already only the times, and sums."""
        self._latest, states = (self.count, u, v, impulse, sums), (u, v)
        more = [impulse] * bool(self._of.wall_count)
        if sums is not None:
            more += [sums[:, 0], sums[:, 1]]
        if u is not None:
            u, v = u[:, self._columns], v[:, self._columns]
        energy = None if self._in_place else self._motion.energies(t, *states)
        self._rows.extend(t, energy, u, v, *more)

    def end(self, t: float, shown: Any) -> None:
        """Record where the run ended, u, v, impulse and sums, if that is not the last row."""
        if not self.count or self._plan.t[self.count - 1] != t:
            self._extend(np.array([t]), *(None if x is None else x[None] for x in shown))

    def last(self) -> Any:
        """Time, step and state of the row that was written last, where it is known."""
        (first, *states), k = self._latest, self.count - 1
        if states[0] is None or not 0 <= k - first < len(states[0]):
            return None
        state = tuple(None if x is None else x[k - first] for x in states)
        return self.time(k), int(self._plan.step[k]), state

    def keep_state(self, motion: Any) -> None:
        """Write the whole state beside the rows, where that is asked for."""
        problem, path = self._problem, self._problem.record.state_path
        if path is None or (motion.done and self.due(motion)):
            return  # what is due is lost without its attempt
        point = motion.point
        sums = () if point.sums is None else (point.sums,)
        try:
            self._rows.flush()
            archive.write(path, "state", {
                "scene": problem.scene, "state": problem.state, "t_end": problem.t_end,
                "method": problem.method, "record": problem.record, "choice": problem.choice,
                "steps": self._steps, "allowed": motion.allowed, "done": point.done,
                "u": point.u, "v": point.v, "seen": (*point.shown, *sums), "count": self.count,
                "met": point.met,
            })  # fmt: skip
        except OSError as error:
            raise RecordError(f"state path {path}: {error.strerror}") from error

    def run(self, done: int, final: Any, complete: bool, stopped: str | None = None) -> Run:
        """The run so far: steps done, and u and v of all sites at its end."""
        table, problem, motion = self._rows.finished(), self._problem, self._motion
        of, forced = problem.dynamics, problem.is_forced
        return known(
            RunBatch if of.batch else Run,
            scene=problem.scene, t=table["t"], u=table["u"], v=table["v"],
            energy=self._energies(table) if self._in_place else table["energy"],
            final=known_state(*final), method=problem.method.name, dt=motion.dt, steps=done,
            sites=self._sites, complete=complete, stopped=stopped, force=problem.force,
            impulse=table["impulse"] if of.wall_count else None, met=motion.point.met,
            fastest=motion.fastest if of.follows else None,
            work=table["work"] if forced else None, loss=table["loss"] if forced else None,
        )  # fmt: skip

    def _energies(self, table: Any) -> Array:
        """Of rows that hold all sites."""
        t, u, v = (table[name] for name in ("t", "u", "v"))
        most = max(1, AT_ONCE // (u[:1].size or 1))
        if len(t) <= most or self._of.follows:  # one list of contacts for many rows
            return self._motion.energies(t, u, v)
        parts = (slice(k, k + most) for k in range(0, len(t), most))
        return np.concatenate([self._motion.energies(t[x], u[x], v[x]) for x in parts])
