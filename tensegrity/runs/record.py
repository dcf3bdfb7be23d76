"""What a run keeps: which sites, at which instants, and where."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.runs.rows import FileRows, Rows, need_memory

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from numpy.typing import NDArray

    from tensegrity.typing import Array, Indices

INSTANTS = 500  # kept by default
PER_INSTANT = 48  # bytes of memory for the numbers of the recorded steps, at most
ROUND_OFF = 16 * np.finfo(float).eps  # relative: an instant so near to a step's end is that


@dataclass(frozen=True)
class Record:
    """What to record during a run.

    Of `every`, `times` and `interval` at most one is given; by default about 500 instants are
    kept, whatever the number of steps.  What is recorded changes no bit of the run itself.

    Parameters
    ----------
    every : int, optional
        Keep every k-th step; the first and the last are always kept.
    times : sequence of float, optional
        Keep these instants [s], increasing, from 0 to the end of the run.  Where one falls inside
        a step, a copy of the state before does a shorter step of the same method to it: the
        values are of the method's order, like those at its steps.
    interval : float, optional
        Keep 0, this [s], twice this and so on, and the end of the run; as `times`.
    sites : sequence of int, optional
        Sites to keep, in that order; by default all.
    path : str or path, optional
        A new .npy file for the rows, which then need no memory but 48 bytes each for their
        numbers.  It is whole after every row, also if the process is killed:
        numpy.load(path, mmap_mode="r") gives a structured array with fields t, energy, u, v; and
        work, loss of scenes that are driven, damped or tuned.  Another run of the same path is
        refused before it writes.
    checkpoint : float, optional
        With a path: after so many seconds of computing, and when a run ends, also by an error or
        by Ctrl-C, its whole state is kept in a file beside the rows, named as they with
        .state.npz added, for `resume`.  0 keeps it after every block of steps.  With a `tol`
        forces are exact then.

    Raises
    ------
    TensegrityError
        Two ways to say when; no whole number, no increasing times, no path; what a scene does not
        have or a run does not reach is refused when it begins.
    """

    every: int | None = None
    sites: Sequence[int] | None = None
    path: str | os.PathLike[str] | None = None
    times: Sequence[float] | None = None
    interval: float | None = None
    checkpoint: float | None = None

    def __post_init__(self) -> None:
        ways = {name: getattr(self, name) for name in ("every", "times", "interval")}
        given = [name for name, value in ways.items() if value is not None]
        if len(given) > 1:
            raise TensegrityError(f"{' and '.join(given)} exclude each other: give one")
        if self.every is not None:
            check.whole("every", self.every, least=1)
        if self.times is not None:
            object.__setattr__(self, "times", _increasing(self.times))
        if self.interval is not None:
            interval = check.number("interval", self.interval, above=0, unit="s")
            object.__setattr__(self, "interval", interval)
        if self.sites is not None:
            sites = check.sequence("sites", self.sites, "site numbers")
            kept = tuple(check.whole("site", s, least=0) for s in sites)
            if not kept:
                raise TensegrityError("sites is empty: nothing to record")
            object.__setattr__(self, "sites", kept)
        if self.path is not None:
            object.__setattr__(self, "path", check.path("path", self.path))
        if self.checkpoint is not None:
            seconds = check.number("checkpoint", self.checkpoint, least=0, unit="s")
            object.__setattr__(self, "checkpoint", seconds)
            if self.path is None:
                raise TensegrityError(f"checkpoint {seconds:g} s needs a path for the rows")

    @property
    def is_plain(self) -> bool:
        """Whether rows are at steps, and in memory."""
        return self.path is None and self.times is None and self.interval is None

    @property
    def instants(self) -> Record:
        """The same instants of all sites, in memory."""
        return Record(every=self.every, times=self.times, interval=self.interval)

    @property
    def state_path(self) -> Path | None:
        """The file of the whole state, or None."""
        return None if self.checkpoint is None else beside(self.path)  # type: ignore[arg-type]

    def check(self, sites: int, t_end: float = math.inf) -> None:
        """Refuse sites that a scene does not have, instants that a run does not reach, and a path
        that cannot be a new file."""
        self.columns(sites)
        if self.times is not None and self.times[-1] > t_end * (1 + ROUND_OFF):
            late = next(t for t in self.times if t > t_end * (1 + ROUND_OFF))
            raise TensegrityError(f"time {late:.17g} s to record is after the end, {t_end:.17g} s")
        for path in (self.path, self.state_path):
            if path is not None and path.exists():
                raise TensegrityError(f"record path {path} exists; delete it or choose another")
        if self.path is not None and not self.path.parent.is_dir():
            raise TensegrityError(f"record path {self.path}: there is no folder {self.path.parent}")

    def rows(
        self, instants: int, shapes: Mapping[str, tuple[int, ...]], count: int | None = None
    ) -> Rows | FileRows:
        """Room for that many rows, in memory or in the file.

        `shapes` are those of the numbers in a row, by name; `count` is that of the rows which the
        file has already, where a run goes on.
        """
        if self.path is None:
            return Rows(instants, shapes)
        kind = np.dtype([(name, float, shape) for name, shape in shapes.items()])
        return FileRows(self.path, instants, kind, count, self.state_path)

    def columns(self, sites: int) -> Any:
        """Numbers of the recorded sites of a scene, or a slice of all."""
        if self.sites is None:
            return slice(None)
        if max(self.sites) >= sites:
            raise TensegrityError(f"recorded site {max(self.sites)} must be below {sites}")
        return list(self.sites)

    def steps(self, total: int) -> Indices:
        """Numbers of the recorded steps of a run of `total` steps."""
        for name in ("times", "interval", "checkpoint"):
            if getattr(self, name) is not None:
                raise TensegrityError(f"{name} of a record is for `simulate` only: give every")
        return self.plan(total, 0.0).step

    def check_room(self, total: int, t_end: float, shape: tuple[int, ...]) -> None:
        """Refuse rows in memory, of a run of at least `total` steps of a scene of that shape, for
        which there is no room."""
        if self.path is not None:
            return
        count: float = total // (self.every or max(1, -(-total // INSTANTS)))
        if self.times is not None:
            count = len(self.times)
        elif self.interval is not None:
            count = t_end / self.interval
        sites = shape[0] if self.sites is None else len(self.sites)
        need_memory(8 * count * (2 + 2 * sites * math.prod(shape[1:])))

    def plan(self, total: int, t_end: float) -> Plan:
        """The instants of a run of `total` steps to `t_end`."""
        if self.times is None and self.interval is None:
            return _evenly(self.every or max(1, -(-total // INSTANTS)), total, t_end)
        t = np.array([]) if self.times is None else np.array(self.times)
        if self.interval is not None:
            count = t_end / self.interval * (1 + ROUND_OFF)
            need_memory(PER_INSTANT * (count + 2))
            t = self.interval * np.arange(math.floor(count) + 1)
            t[-1] = t_end if t_end - t[-1] <= ROUND_OFF * t_end else t[-1]
            t = t if t[-1] == t_end else np.append(t, t_end)
        if not total:
            return Plan(
                np.zeros(len(t), dtype=int), np.zeros(len(t)), t, np.zeros(len(t), dtype=int)
            )
        dt = t_end / total
        nearest = np.rint(t / dt)
        there = np.abs(t - nearest * dt) <= ROUND_OFF * t
        whole = np.where(there, nearest, np.floor(t / dt))
        part = np.where(there, 0.0, t - whole * dt)
        return Plan(whole.astype(int), part, t, whole.astype(int) + (part > 0))


class Plan(NamedTuple):
    """The instants to record, in the steps of a run.

    Attributes
    ----------
    step : ndarray of int, (instants,)
        Steps done at each, or before it.
    part : ndarray, (instants,)
        Time from there to the instant [s].
    t : ndarray, (instants,)
        [s]
    due : ndarray of int, (instants,)
        Steps that have to be done for each.
    """

    step: Indices
    part: Array
    t: NDArray[Any]
    due: Indices


@lru_cache(maxsize=64)  # of runs that are compared with each other, and again
def _evenly(every: int, total: int, t_end: float) -> Plan:
    """Every so many steps, and the last one."""
    need_memory(PER_INSTANT * (total // every + 2))
    step = np.arange(0, total + every, every) if total else np.zeros(1, dtype=int)
    step[-1] = total
    return Plan(step, np.zeros(len(step)), step * (t_end / (total or 1)), step)


def beside(path: str | os.PathLike[str]) -> Path:
    """The file of the whole state beside that of the rows."""
    path = Path(path)
    return path.with_name(path.name + ".state.npz")


def _increasing(times):
    """Instants as a tuple of floats, from 0 on."""
    times = check.sequence("times", times, "instants")
    times = tuple(check.number("time to record", t, least=0, unit="s") for t in times)
    if not times:
        raise TensegrityError("times is empty: nothing to record")
    for before, after in pairwise(times):
        if not before < after:
            raise TensegrityError(
                f"time {after:.17g} s to record follows {before:.17g} s: times must increase"
            )
    return times
