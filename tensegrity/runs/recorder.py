"""The recorder of a run: rows at the instants of its record, and checkpoints.

Rows are held in memory, or in a file that is valid after every row.  A row counts once it is
written completely: an interrupt, a full disk or a killed process leaves the rows before it, and the
next attempt writes it again.  A file being written is locked through its open handle, so that the
lock of a killed process is released.
"""

from __future__ import annotations

import io
import math
import os
import shutil
from collections.abc import Mapping
from contextlib import suppress
from typing import Any
from zlib import crc32

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tensegrity.errors import RecordError, TensegrityError
from tensegrity.runs import archive
from tensegrity.runs.record import OutputStates, refuse_oversize, require_memory
from tensegrity.runs.run import Run, RunBatch, unchecked
from tensegrity.scenes.scene import unchecked_state
from tensegrity.typing import Array

try:
    import fcntl
except ImportError:  # then a second run is refused only once the file of rows is there
    fcntl = None  # type: ignore[assignment]


BEGUN: set[tuple[int, int]] = set()  # files of this process, which its later trials overwrite


class Rows:
    """Rows in memory, in one array for each column; what is in place already only counts.

    u and v share one block: the system keeps its pages for the next run of a process, but takes
    back those of two blocks of half the size.
    """

    def __init__(self, instants: int, shapes: Mapping[str, tuple[int, ...]]) -> None:
        require_memory(8 * instants * sum(map(math.prod, shapes.values())))
        self.arrays = {x: np.empty((instants, *shapes[x])) for x in shapes.keys() - {"u", "v"}}
        self.arrays["u"], self.arrays["v"] = np.empty((2, instants, *shapes["u"]))
        self.count = 0

    def extend(self, columns: Mapping[str, Array]) -> None:
        """Append rows given as columns, by their names."""
        stop = self.count + len(columns["t"])
        for name, values in columns.items():
            self.arrays[name][self.count : stop] = values
        self.count = stop

    def finished(self) -> Mapping[str, NDArray[Any]]:
        """Arrays t, u, v, ... of the rows written so far."""
        return {name: rows[: self.count] for name, rows in self.arrays.items()}


class FileRows:
    """Rows in a .npy file whose header counts only rows that are written completely.

    Parameters
    ----------
    path : Path
    instants : int
        Number of rows of the whole run.
    kind : numpy.dtype
        Type of a row.
    count : int, optional
        Number of rows in the file after which to continue; further rows stay readable until they
        are overwritten.  By default a new file is made.
    last_row : int, optional
        Checksum of the last of these rows.
    checkpoint_path : Path, optional
        Checkpoint of an earlier trial run, which is deleted when a new file is made.

    Raises
    ------
    RecordError
        Another run writes to the file or has made it, or it cannot be written.
    """

    def __init__(
        self,
        path: Any,
        instants: int,
        kind: np.dtype[Any],
        count: int | None = None,
        last_row: int | None = None,
        checkpoint_path: Any = None,
    ) -> None:
        self._path, self._kind, self.count = path, kind, count or 0
        missing = instants - self.count
        refuse_oversize(missing * kind.itemsize, shutil.disk_usage(path.parent).free, "disk space")
        self._row, self._visible = np.zeros(1, dtype=kind), 0
        if count is not None:
            rows = _mapped(path, kind, count)
            self._visible, self._row[:] = len(rows), rows[count - 1 : count] if count else 0
            if self.last_row != last_row:
                raise TensegrityError(
                    f"record path {path}: row {count - 1} is not that of the checkpoint, but of "
                    "another run"
                )
        self._size = len(self._header(0))
        try:
            if count is None:
                self._begin(checkpoint_path)
            else:
                self._open(path)
        except OSError as error:
            raise self._refused(error) from error
        BEGUN.add(_identity(os.fstat(self._file.fileno())))

    def _begin(self, checkpoint_path):
        """Make a file without rows, and rename it once it is valid."""
        self._refuse_begun()
        new = self._path.with_name(self._path.name + ".new")
        self._open(new)
        try:
            self._refuse_begun()  # a run that released the lock may have made it meanwhile
            if checkpoint_path is not None:
                checkpoint_path.unlink(missing_ok=True)
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
        """Open a file that no other run is writing."""
        flags = os.O_RDWR | os.O_CREAT | getattr(os, "O_BINARY", 0)
        self._file = io.FileIO(os.open(path, flags, 0o666), "r+")  # closes itself when collected
        try:
            if fcntl is not None:
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self.close()
            raise RecordError(f"record path {self._path} is being written by another run") from None
        except OSError:  # a file system without locks
            pass

    def close(self):
        """Close the file and release its lock, which a forked process may hold too."""
        if fcntl is not None and not self._file.closed:
            with suppress(OSError):
                fcntl.flock(self._file, fcntl.LOCK_UN)
        self._file.close()

    def _header(self, count):
        """Header for a number of rows; NumPy pads it so that any count takes the same space."""
        header = io.BytesIO()
        descr = np.lib.format.dtype_to_descr(self._kind)
        shape = {"descr": descr, "fortran_order": False, "shape": (count,)}
        np.lib.format.write_array_header_2_0(header, shape)
        return header.getvalue()

    def _refused(self, error):
        return RecordError(f"record path {self._path}: {error.strerror} after {self.count} rows")

    def add(self, t: float, energy: float, u: Array, v: Array, *more: ArrayLike) -> None:
        """Append a row: first its bytes, then the count in the header.

        Parameters
        ----------
        t : float
            Instant [s].
        energy : float
            [J]
        u, v : ndarray
            Of the recorded sites [m], [m/s].
        *more : array_like
            Impulse, work and loss, as far as the rows have them.

        Raises
        ------
        RecordError
            Either cannot be written; earlier rows are unaffected.
        """
        self._row[0] = t, energy, u, v, *more
        try:
            place = self._size + self.count * self._kind.itemsize
            _write(self._file, self._row.tobytes(), place)
            if self.count >= self._visible:
                self._set_visible(self.count + 1)
        except OSError as error:
            raise self._refused(error) from error
        self.count += 1

    def extend(self, columns: Mapping[str, Array]) -> None:
        """Append rows given as columns, by their names, one after the other; see `add`."""
        for row in zip(*columns.values(), strict=True):
            self.add(*row)

    @property
    def last_row(self) -> int:
        """Checksum of the last row that was added."""
        return crc32(self._row.tobytes())

    def _set_visible(self, count):
        try:
            _write(self._file, self._header(count), 0)
        except OSError:  # the header may be incomplete: write the previous one
            _write(self._file, self._header(self._visible), 0)
            raise
        self._visible = count

    def flush(self):
        """Wait until the rows are on the disk."""
        try:
            os.fsync(self._file.fileno())
        except OSError as error:
            raise self._refused(error) from error

    def finished(self) -> NDArray[Any]:
        """The rows written so far, mapped from the file; rows after them are dropped."""
        if self.count < self._visible and not self._file.closed:
            self._set_visible(self.count)
        self.close()
        return _mapped(self._path, self._kind, self.count)[: self.count]


def _mapped(path, kind, count):
    """Rows of a file that has at least `count` rows of that type."""
    try:
        rows = np.lib.format.open_memmap(path, mode="r") if count else _read(path)
    except Exception as error:  # a damaged header raises many kinds of errors
        raise TensegrityError(f"record path {path} holds no rows: {error}") from error
    if rows.dtype != kind or rows.ndim != 1 or len(rows) < count:
        raise TensegrityError(
            f"record path {path} holds an array {rows.shape} of another run, or fewer than {count} "
            "rows"
        )
    return rows


def _read(path):
    return np.load(path, allow_pickle=False)  # a file without rows cannot be mapped


def _identity(status):
    """Device and inode number, which identify a file whatever its name."""
    return status.st_dev, status.st_ino


def _write(file, data, place):
    """Write all data: the system may write a part, and report an error for the rest only."""
    view = memoryview(data)
    while view:
        done = os.pwrite(file.fileno(), view, place)
        view, place = view[done:], place + done


AT_ONCE = 4_000_000  # most numbers in u of rows whose energies are computed in one call


class Recorder(OutputStates):
    """Observer that records the rows of a run, in memory or in a file.

    Its state is the number of rows alone, so that a run can be interrupted anywhere.

    Parameters
    ----------
    problem : Problem
    motion : Motion
    steps : int
        Number of steps of the whole run.
    count, last_row : int, optional
        Number of rows that the file of an interrupted run has, and checksum of the last one.
    """

    def __init__(
        self, problem: Any, motion: Any, steps: int, count: Any = None, last_row: Any = None
    ) -> None:
        record, dyn = problem.record, problem.dynamics
        self._problem, self._motion, self._steps = problem, motion, steps
        self._columns, rest = record.columns(dyn.sites), dyn.shape[1:]
        self._sites = range(dyn.sites) if record.sites is None else record.sites
        self._in_place = record.is_plain and record.sites is None
        self._latest: Any = 0, None  # number of a row, and the states from there on
        if record.checkpoint_path is not None:  # before any work, which may change what it holds
            self._scene = archive.storable(problem.scene)
        super().__init__(record, problem, motion, steps)
        of_sites: Any = len(self._sites), *rest
        shapes = {"t": ()} if self._in_place else {"t": (), "energy": dyn.batch}
        shapes |= {"u": of_sites, "v": of_sites}
        if dyn.wall_count:
            shapes["impulse"] = dyn.wall_count, *rest
        shapes |= dyn.sums
        instants = len(self._plan.t) + 1
        if record.path is None:
            self._rows: Any = Rows(instants, shapes)
            if self._in_place:
                self._rows.arrays["t"][:-1] = self._plan.t
                if dyn.sums:
                    arrays, sums = self._rows.arrays, np.empty((instants, 2, *dyn.batch))
                    arrays["sums"], arrays["work"], arrays["loss"] = sums, sums[:, 0], sums[:, 1]
        else:
            kind = np.dtype([(name, float, shape) for name, shape in shapes.items()])
            of = count, last_row, record.checkpoint_path
            self._rows = FileRows(record.path, instants, kind, *of)

    @property
    def count(self) -> int:
        """Number of rows written."""
        count: int = self._rows.count
        return count

    def _room(self, here: slice) -> tuple[Any, ...]:
        if not self._in_place:
            return super()._room(here)
        arrays = self._rows.arrays
        u, v, impulse, sums = arrays["u"][here], arrays["v"][here], None, None
        if "impulse" in arrays:
            impulse = arrays["impulse"][here]
        if "sums" in arrays:
            sums = arrays["sums"][here]
        return u, v, impulse, sums

    def take(self, motion: Any, last: float = math.inf) -> None:
        """Record the accepted states that are due, up to an instant [s]."""
        stop = self.due(motion).stop
        if last < math.inf:
            stop = int(self._plan.t[:stop].searchsorted(last, side="right"))
        while self.count < stop:
            if self._in_place:
                self._rows.count = stop
                return
            first, end, row = self.count, stop, self.count - self._first
            if self._is_dense and self._plan.part is not None:
                between = self._plan.part[first:stop] > 0
                if between[0]:
                    one = (None if x is None else x[None] for x in self.state(motion, first))
                    self._extend(self._plan.t[first : first + 1], *one)
                    continue
                end = first + int(between.argmax()) if between.any() else stop
                row = int(self._states.at.searchsorted(self._plan.step[first]))
            here = slice(row, row + end - first)
            states = (None if x is None else x[here] for x in self._states[1:5])
            self._extend(self._plan.t[first:end], *states)

    def _extend(self, t: Array, u: Any, v: Any, impulse: Any, sums: Any) -> None:
        """Append rows."""
        self._latest = self.count, u, v, impulse, sums
        columns = {"t": t}
        if not self._in_place:
            columns["energy"] = self._motion.energies(t, u, v)
        columns |= {"u": u[:, self._columns], "v": v[:, self._columns]}
        if self._dynamics.wall_count:
            columns["impulse"] = impulse
        if sums is not None:
            columns |= {"work": sums[:, 0], "loss": sums[:, 1]}
        self._rows.extend(columns)

    def end(self, t: float, output: Any) -> None:
        """Record the end of the run, u, v, impulse and sums, unless it is the last row already."""
        if not self.count or self._plan.t[self.count - 1] != t:
            self._extend(np.array([t]), *(None if x is None else x[None] for x in output))

    def last(self) -> Any:
        """Time, step and state of the last row, or None where it is not in memory."""
        (first, *states), k = self._latest, self.count - 1
        if states[0] is None or not 0 <= k - first < len(states[0]):
            return None
        state = tuple(None if x is None else x[k - first] for x in states)
        return self.time(k), int(self._plan.step[k]), state

    def save_checkpoint(self, motion: Any) -> None:
        """Write a checkpoint, where the record asks for one."""
        problem, path = self._problem, self._problem.record.checkpoint_path
        if path is None or (motion.done and self.due(motion)):
            return  # states that are due exist in this attempt only
        point = motion.point
        sums = () if point.sums is None else (point.sums,)
        self._rows.flush()
        try:
            archive.write(path, "state", {
                "scene": self._scene, "state": problem.state, "t_end": problem.t_end,
                "method": problem.method, "record": problem.record, "choice": problem.choice,
                "steps": self._steps, "allowed": motion.allowed, "done": point.done,
                "u": point.u, "v": point.v, "seen": (*point.output, *sums), "count": self.count,
                "last_row": self._rows.last_row, "elongation_range": point.elongation_range,
            })  # fmt: skip
        except TensegrityError as error:
            raise RecordError(f"state path {error}") from error

    def run(self, done: int, final: Any, complete: bool, stopped: str | None = None) -> Run:
        """The run as far as it is recorded.

        Parameters
        ----------
        done : int
            Number of steps done.
        final : sequence of two ndarrays
            u [m] and v [m/s] of all sites at the end.
        complete : bool
        stopped : str, optional
            Which observer ended the run, and when.

        Returns
        -------
        Run or RunBatch
        """
        table, problem, motion = self._rows.finished(), self._problem, self._motion
        dyn = self._dynamics
        return unchecked(
            RunBatch if dyn.batch else Run,
            scene=problem.scene, t=table["t"], u=table["u"], v=table["v"],
            energy=self._energies(table) if self._in_place else table["energy"],
            final=unchecked_state(*final), method=problem.method.name, dt=motion.dt, steps=done,
            sites=tuple(self._sites), complete=complete, stopped=stopped,
            force_model=problem.loop_dynamics.springs.force_model,
            impulse=table["impulse"] if dyn.wall_count else None,
            elongation_range=motion.point.elongation_range,
            fastest=motion.fastest if dyn.follows else None,
            **{name: table[name] for name in dyn.sums},
        )  # fmt: skip

    def _energies(self, table: Any) -> Array:
        """Total energies of rows that hold all sites [J]."""
        t, u, v = (table[name] for name in ("t", "u", "v"))
        most = max(1, AT_ONCE // (u[:1].size or 1))
        if len(t) <= most or self._dynamics.follows:  # many rows share a list of contacts
            return self._motion.energies(t, u, v)
        parts = (slice(k, k + most) for k in range(0, len(t), most))
        return np.concatenate([self._motion.energies(t[x], u[x], v[x]) for x in parts])
