"""What a run keeps: which sites, how often, and the rows themselves."""

from __future__ import annotations

import io
import os
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check
from tensegrity.errors import TensegrityError

if TYPE_CHECKING:
    from typing import Any

    from numpy.typing import ArrayLike, NDArray

    from tensegrity.typing import Array, Indices

INSTANTS = 500  # kept by default
PER_INSTANT = 48  # bytes of memory for the numbers of the recorded steps, at most


@dataclass(frozen=True)
class Record:
    """What to record during a run.

    Parameters
    ----------
    every : int, optional
        Keep every k-th step; the first and the last are always kept.  By default about 500
        instants are kept, whatever the number of steps.
    sites : sequence of int, optional
        Sites to keep, in that order; by default all.
    path : str or path, optional
        A new .npy file for the rows, which then need no memory but 48 bytes each for their
        numbers.  It is whole after every row, also if the process is killed:
        numpy.load(path, mmap_mode="r") gives a structured array with fields t, energy, u, v.
    """

    every: int | None = None
    sites: Sequence[int] | None = None
    path: str | os.PathLike | None = None

    def __post_init__(self) -> None:
        if self.every is not None:
            check.whole("every", self.every, least=1)
        if self.sites is not None:
            if isinstance(self.sites, str) or not hasattr(self.sites, "__iter__"):
                raise TensegrityError(f"sites {self.sites!r} must be a sequence of site numbers")
            kept = tuple(check.whole("site", s, least=0) for s in self.sites)
            if not kept:
                raise TensegrityError("sites is empty: nothing to record")
            object.__setattr__(self, "sites", kept)
        if self.path is not None:
            if not isinstance(self.path, (str, os.PathLike)):
                raise TensegrityError(f"path {self.path!r} is not a path")
            object.__setattr__(self, "path", Path(self.path))

    def check(self, sites: int) -> None:
        """Refuse sites that a scene does not have, and a path that cannot be a new file."""
        self.columns(sites)
        if self.path is None:
            return
        if self.path.exists():
            raise TensegrityError(f"record path {self.path} exists; delete it or choose another")
        if not self.path.parent.is_dir():
            raise TensegrityError(f"record path {self.path}: there is no folder {self.path.parent}")

    def rows(
        self, instants: int, shape: int | tuple[int, ...], walls: tuple[int, ...] = (0,)
    ) -> Rows | FileRows:
        """Room for that many rows, in memory or in the file.

        `shape` is that of u: (sites[, dim]); `walls` that of the impulses: (walls[, dim]).
        """
        kind = [("t", float), ("energy", float), ("u", float, shape), ("v", float, shape)]
        kind = np.dtype(kind + [("impulse", float, walls)] * bool(walls[0]))
        if self.path is None:
            return Rows(instants, kind)
        return FileRows(self.path, instants, kind)

    def columns(self, sites: int) -> Any:
        """Numbers of the recorded sites of a scene, or a slice of all."""
        if self.sites is None:
            return slice(None)
        if max(self.sites) >= sites:
            raise TensegrityError(f"recorded site {max(self.sites)} must be below {sites}")
        return list(self.sites)

    def steps(self, total: int) -> Indices:
        """Numbers of the recorded steps of a run of `total` steps."""
        every = self.every or max(1, -(-total // INSTANTS))
        _refuse_more(PER_INSTANT * (total // every + 2), _free_memory(), "memory")
        kept = np.arange(0, total + 1, every)
        return kept if kept[-1] == total else np.append(kept, total)


def _refuse_more(size, room, what):
    if size > room:
        raise TensegrityError(
            f"record of {size / 1e9:.3g} GB exceeds the {room / 1e9:.3g} GB of {what}: keep fewer "
            "steps or sites" + (", or give a path" if what == "memory" else "")
        )


def _free_memory():
    """Memory that can be had without swapping [bytes]."""
    try:
        lines = Path("/proc/meminfo").read_text().splitlines()
        return next(int(x.split()[1]) * 1024 for x in lines if x.startswith("MemAvailable"))
    except (OSError, StopIteration):
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")


def _row(kind, *fields):
    """The fields that rows of this kind have: impulses where there are walls."""
    return fields[: len(kind.names)]


class Rows:
    """Rows in memory: time, energy, and u and v of the kept sites."""

    def __init__(self, instants: int, kind: np.dtype[Any]) -> None:
        _refuse_more(instants * kind.itemsize, _free_memory(), "memory")
        self._rows = np.zeros(instants, dtype=kind)
        self._count = 0

    def add(self, t: float, energy: float, u: Array, v: Array, impulse: ArrayLike = ()) -> None:
        """Append a row."""
        self._rows[self._count] = _row(self._rows.dtype, t, energy, u, v, impulse)
        self._count += 1

    def finished(self) -> NDArray[Any]:
        """The rows written so far, as a structured array with fields t, energy, u, v."""
        return self._rows[: self._count]


class FileRows:
    """Rows in a .npy file whose header counts only rows that are written in full."""

    def __init__(self, path: Any, instants: int, kind: np.dtype[Any]) -> None:
        _refuse_more(instants * kind.itemsize, shutil.disk_usage(path.parent).free, "disk space")
        self._path, self._kind, self._count = path, kind, 0
        self._row = np.zeros(1, dtype=kind)
        self._file = open(path, "wb", buffering=0)  # noqa: SIM115, closed by finished()
        self._write_header()

    def _write_header(self):
        """NumPy pads the header so that a growing count always fits its place."""
        header = io.BytesIO()
        descr = np.lib.format.dtype_to_descr(self._kind)
        shape = {"descr": descr, "fortran_order": False, "shape": (self._count,)}
        np.lib.format.write_array_header_2_0(header, shape)
        self._file.seek(0)
        self._file.write(header.getvalue())
        self._file.seek(0, os.SEEK_END)

    def add(self, t: float, energy: float, u: Array, v: Array, impulse: ArrayLike = ()) -> None:
        """Append a row: first its bytes, then the count that makes it visible."""
        self._row[0] = _row(self._kind, t, energy, u, v, impulse)
        self._file.write(self._row.tobytes())
        self._count += 1
        self._write_header()

    def finished(self) -> NDArray[Any]:
        """The rows written so far, mapped from the file."""
        self._file.close()
        if self._count == 0:
            return np.zeros(0, dtype=self._kind)
        return np.load(self._path, mmap_mode="r")
