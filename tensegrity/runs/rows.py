"""Rows of a run, in memory or in a file that is whole after every row.

A row counts once it is written in full: an interrupt, a full disk or a killed process in the
midst of one leaves the rows before it, and the next attempt writes it anew.  A file that is
written to is locked by its open handle, so that the lock of a killed process goes with it.
"""

from __future__ import annotations

import io
import math
import os
import shutil
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

try:
    import fcntl
except ImportError:  # Windows, where a second run is refused only once the file of rows is there
    fcntl = None  # type: ignore[assignment]

from tensegrity import check
from tensegrity.errors import RecordError, TensegrityError

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from numpy.typing import ArrayLike, NDArray

    from tensegrity.typing import Array


SMALL = 4_000_000  # bytes that are not asked for
BEGUN: set[tuple[int, int]] = set()  # files of this process, which its later trials begin anew


def need_memory(size):
    """Refuse a record of more bytes than there is memory for."""
    if size > SMALL:
        _refuse_more(size, check.free_memory(), "memory")


def _refuse_more(size, room, what):
    if size > room:
        raise TensegrityError(
            f"record of {size / 1e9:.3g} GB exceeds the {room / 1e9:.3g} GB of {what}: keep fewer "
            "steps or sites" + (", or give a path" if what == "memory" else "")
        )


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
        _refuse_more(missing * kind.itemsize, shutil.disk_usage(path.parent).free, "disk space")
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
