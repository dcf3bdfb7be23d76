"""What is kept of a run: rows at the instants of its record, and its whole state.

Rows are in memory, or in a file that is whole after every row.  A row counts once it is written in
full: an interrupt, a full disk or a killed process in the midst of one leaves the rows before it,
and the next attempt writes it anew.  A file that is written to is locked by its open handle, so
that the lock of a killed process goes with it.
"""

from __future__ import annotations

import io
import math
import os
import shutil
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tensegrity.errors import RecordError, TensegrityError
from tensegrity.once import once
from tensegrity.runs import archive
from tensegrity.runs.record import Instants, need_memory, refuse_more
from tensegrity.runs.run import Run, RunBatch, unchecked
from tensegrity.scenes.scene import unchecked_state
from tensegrity.typing import Array

try:
    import fcntl
except ImportError:  # Windows, where a second run is refused only once the file of rows is there
    fcntl = None  # type: ignore[assignment]


BEGUN: set[tuple[int, int]] = set()  # files of this process, which its later trials begin anew


class Rows:
    """Rows in memory: time, energy, and u and v of the kept sites, each in an array of its own."""

    def __init__(self, instants: int, shapes: Mapping[str, tuple[int, ...]]) -> None:
        need_memory(8 * instants * sum(map(math.prod, shapes.values())))
        self.arrays = {name: np.empty((instants, *shape)) for name, shape in shapes.items()}
        self.count = 0

    def extend(self, *columns: ArrayLike | None) -> None:
        """Append rows, each of the numbers in a column; None for those that are there already."""
        stop = self.count + len(columns[0])  # type: ignore[arg-type]
        for rows, values in zip(self.arrays.values(), columns, strict=True):
            if values is not None:
                rows[self.count : stop] = values
        self.count = stop

    def finished(self) -> Mapping[str, NDArray[Any]]:
        """The rows written so far: arrays t, energy, u, v."""
        return {name: rows[: self.count] for name, rows in self.arrays.items()}


class FileRows:
    """Rows in a .npy file whose header counts only rows that are written in full.

    Parameters
    ----------
    path : Path
    instants : int
        Rows that will be needed.
    kind : numpy.dtype
    count : int, optional
        Rows to go on after; the file has them, and what it has beyond stays readable until it
        is written over.  By default the file is begun.
    state_path : Path, optional
        Of the whole state of a trial, which goes when the file is begun.

    Raises
    ------
    RecordError
        Another run writes to the file, or has begun it, or it cannot be written.
    """

    def __init__(
        self,
        path: Any,
        instants: int,
        kind: np.dtype[Any],
        count: int | None = None,
        state_path: Any = None,
    ) -> None:
        self._path, self._kind, self.count = path, kind, count or 0
        missing = instants - self.count
        refuse_more(missing * kind.itemsize, shutil.disk_usage(path.parent).free, "disk space")
        self._row, self._shown = np.zeros(1, dtype=kind), 0
        if count is not None:
            self._shown = len(_mapped(path, kind, count))
        self._size = len(self._header(0))
        try:
            if count is None:
                self._begin(state_path)
            else:
                self._open(path)
        except OSError as error:
            raise self._refused(error) from error
        BEGUN.add(_identity(os.fstat(self._file.fileno())))

    def _begin(self, state_path):
        """A file of no rows, in its place once it is whole: nobody sees an empty one."""
        self._refuse_begun()
        new = self._path.with_name(self._path.name + ".new")
        self._open(new)
        try:
            self._refuse_begun()  # since, by a run that gave the lock free
            if state_path is not None:
                state_path.unlink(missing_ok=True)
            self._file.truncate(0)
            _write(self._file, self._header(0), 0)
            os.replace(new, self._path)
        except BaseException:
            new.unlink(missing_ok=True)
            self.close()
            raise

    def _refuse_begun(self):
        if self._path.exists() and _identity(os.stat(self._path)) not in BEGUN:
            raise RecordError(f"record path {self._path} exists: another run began it")

    def _open(self, path):
        """Open a file, if no other run has it open to write."""
        flags = os.O_RDWR | os.O_CREAT | getattr(os, "O_BINARY", 0)
        self._file = io.FileIO(os.open(path, flags, 0o666), "r+")  # which closes itself if lost
        try:
            if fcntl is not None:
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self.close()
            raise RecordError(f"record path {self._path} is being written by another run") from None
        except OSError:  # a file system without locks
            pass

    def close(self):
        """Close the file, and give it free: a process that was forked may have it open too."""
        if fcntl is not None and not self._file.closed:
            with suppress(OSError):
                fcntl.flock(self._file, fcntl.LOCK_UN)
        self._file.close()

    def _header(self, count):
        """NumPy pads the header so that a growing count always fits its place."""
        header = io.BytesIO()
        descr = np.lib.format.dtype_to_descr(self._kind)
        shape = {"descr": descr, "fortran_order": False, "shape": (count,)}
        np.lib.format.write_array_header_2_0(header, shape)
        return header.getvalue()

    def _refused(self, error):
        return RecordError(f"record path {self._path}: {error.strerror} after {self.count} rows")

    def add(self, t: float, energy: float, u: Array, v: Array, *more: ArrayLike) -> None:
        """Append a row: first its bytes, then the count that makes it visible.

        Raises
        ------
        RecordError
            If either cannot be written; the rows before stay as they are.
        """
        self._row[0] = t, energy, u, v, *more
        try:
            place = self._size + self.count * self._kind.itemsize
            _write(self._file, self._row.tobytes(), place)
            if self.count >= self._shown:
                self._show(self.count + 1)
        except OSError as error:
            raise self._refused(error) from error
        self.count += 1

    def extend(self, *columns: Array) -> None:
        """Append rows, each whole before the next; as `add`."""
        for row in zip(*columns, strict=True):
            self.add(*row)

    def _show(self, count):
        try:
            _write(self._file, self._header(count), 0)
        except OSError:  # half a header may stand there: the one before again
            _write(self._file, self._header(self._shown), 0)
            raise
        self._shown = count

    def flush(self):
        """Wait until the disk has what was written."""
        os.fsync(self._file.fileno())

    def finished(self) -> NDArray[Any]:
        """The rows written so far, mapped from the file; others that it had are gone then."""
        if self.count < self._shown and not self._file.closed:
            self._show(self.count)
        self.close()
        return _mapped(self._path, self._kind, self.count)[: self.count]


def _mapped(path, kind, count):
    """Rows of a file that has at least `count` of that kind."""
    try:
        rows = np.lib.format.open_memmap(path, mode="r") if count else _read(path)
    except Exception as error:  # what a damaged header makes of NumPy, and of Python's tokens
        raise TensegrityError(f"record path {path} holds no rows: {error}") from error
    if rows.dtype != kind or rows.ndim != 1 or len(rows) < count:
        raise TensegrityError(
            f"record path {path} holds an array {rows.shape} of another run, or fewer than {count} "
            "rows"
        )
    return rows


def _read(path):
    return np.load(path, allow_pickle=False)  # no rows, perhaps, which cannot be mapped


def _identity(status):
    """What tells a file from others, whatever its name."""
    return status.st_dev, status.st_ino


def _write(file, data, place):
    """Write all of it: the system may take a part, and say why with the rest only."""
    view = memoryview(data)
    while view:
        done = os.pwrite(file.fileno(), view, place)
        view, place = view[done:], place + done


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
        instants = len(self._plan.t) + 1
        if record.path is None:
            self._rows = Rows(instants, shapes)
        else:
            kind = np.dtype([(name, float, shape) for name, shape in shapes.items()])
            self._rows = FileRows(record.path, instants, kind, count, record.state_path)

    @property
    def count(self) -> int:
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
                "elongation_range": point.elongation_range,
            })  # fmt: skip
        except OSError as error:
            raise RecordError(f"state path {path}: {error.strerror}") from error

    def run(self, done: int, final: Any, complete: bool, stopped: str | None = None) -> Run:
        """The run so far: steps done, and u and v of all sites at its end."""
        table, problem, motion = self._rows.finished(), self._problem, self._motion
        of, forced = problem.dynamics, problem.is_forced
        return unchecked(
            RunBatch if of.batch else Run,
            scene=problem.scene, t=table["t"], u=table["u"], v=table["v"],
            energy=self._energies(table) if self._in_place else table["energy"],
            final=unchecked_state(*final), method=problem.method.name, dt=motion.dt, steps=done,
            sites=self._sites, complete=complete, stopped=stopped, force_model=problem.force_model,
            impulse=table["impulse"] if of.wall_count else None,
            elongation_range=motion.point.elongation_range,
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
