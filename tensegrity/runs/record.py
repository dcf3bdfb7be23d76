"""What is wanted of a run: the instants of a `Record`, and observers, which get states at these.

Before each attempt an observer says which states it wants of it and gives room for them; it takes
them once the attempt stands.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from tensegrity import check
from tensegrity.engine.march import Wanted
from tensegrity.errors import TensegrityError
from tensegrity.printing import printed

if TYPE_CHECKING:
    from typing import Any, TypeAlias

    from numpy.typing import NDArray

    from tensegrity.typing import Array, Indices

    Watching: TypeAlias = Callable[[float, Array, Array], Any]
    Observe: TypeAlias = (
        Watching | tuple[Watching, "Record"] | Sequence[Watching | tuple[Watching, "Record"]]
    )


INSTANTS = 500  # kept by default
SMALL = 4_000_000  # bytes that are not asked for
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

    __str__ = printed(times="s", interval="s", checkpoint="s")

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

    def columns(self, sites: int) -> Any:
        """Numbers of the recorded sites of a scene, or a slice of all."""
        if self.sites is None:
            return slice(None)
        if max(self.sites) >= sites:
            raise TensegrityError(f"recorded site {max(self.sites)} must be below {sites}")
        return list(self.sites)

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


def need_memory(size):
    """Refuse a record of more bytes than there is memory for."""
    if size > SMALL:
        refuse_more(size, check.free_memory(), "memory")


def refuse_more(size, room, what):
    if size > room:
        raise TensegrityError(
            f"record of {size / 1e9:.3g} GB exceeds the {room / 1e9:.3g} GB of {what}: keep fewer "
            "steps or sites" + (", or give a path" if what == "memory" else "")
        )


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


class Instants:
    """States at the instants of a record.

    Parameters
    ----------
    record : Record
    problem : Problem
    motion : Motion
    steps : int
        Of the whole run.

    Attributes
    ----------
    count : int
        Instants that were taken.
    """

    count: int = 0

    def __init__(self, record: Record, problem: Any, motion: Any, steps: int) -> None:
        self._plan, self._of = record.plan(steps, problem.t_end), problem.dynamics
        self._shapes = [x.shape for x in motion.point.shown]
        self._is_dense = not record.is_plain and len(self._plan.step) > 1
        self._states = Wanted(self._plan.step[:0], np.empty(0))

    def wanted(self, end: int) -> Sequence[Wanted]:
        """States of an attempt to go on to step `end`."""
        first = self.count
        stop = int(self._plan.due.searchsorted(end, side="right"))
        at, here = self._plan.step[first:stop], slice(first, stop)
        if self._is_dense:  # several in a step take one state
            at = np.unique(at)
            here = slice(0, len(at))
        self._states = Wanted(at, *self._room(here))
        return [self._states] if stop > first else ()

    def _room(self, here: slice) -> tuple[Any, ...]:
        """Arrays u, v, impulse, sums for the states of some instants."""
        count, walls, sums = here.stop - here.start, self._of.wall_count, self._shapes[2:]
        shape = self._of.shape
        return (
            np.empty((count, *shape)), np.empty((count, *shape)),
            np.empty((count, walls, *shape[1:])) if walls else None,
            np.empty((count, *sums[0])) if sums else None,
        )  # fmt: skip

    def due(self, motion: Any) -> range:
        """Numbers of the instants whose states stand and were not taken."""
        return range(self.count, int(self._plan.due.searchsorted(motion.done, side="right")))

    def time(self, k: int) -> float:
        """Of an instant [s]."""
        return float(self._plan.t[k])

    def state(self, motion: Any, k: int) -> tuple[Any, ...]:
        """Copies of u, v, impulse and sums at an instant."""
        here = int(self._states.at.searchsorted(self._plan.step[k]))
        arrays = tuple(None if x is None else x[here].copy() for x in self._states[1:5])
        if self._plan.part[k] > 0:
            motion.between(int(self._plan.step[k]), self._plan.part[k], *arrays)
        return arrays


class Samples:
    """u and v at evenly spaced instants, for comparison with other runs.

    Attributes
    ----------
    rows : ndarray, (2, instants so far, *shape of the scene)
        u and v.
    """

    def __init__(self, shape: tuple[int, ...], steps: int, instants: int) -> None:
        self._at = steps // instants * np.arange(instants + 1) if instants else np.zeros(0, int)
        self._all, self._count, self._stop = np.empty((2, len(self._at), *shape)), 0, 0

    @property
    def rows(self) -> Array:
        return self._all[:, : self._count]

    def wanted(self, end: int) -> Sequence[Wanted]:
        """As of `Instants`."""
        self._stop = int(self._at.searchsorted(end, side="right"))
        here = slice(self._count, self._stop)
        return [Wanted(self._at[here], *self._all[:, here])] if here.stop > here.start else ()

    def take(self, motion: Any) -> None:
        """Count what was got."""
        self._count = self._stop


class Watched(Instants):
    """A function of a user that is called with the states at some instants.

    Parameters
    ----------
    function : callable (t, u, v)
    record : Record
        When.
    """

    def __init__(self, function: Watching, record: Record, *rest: Any) -> None:
        super().__init__(record, *rest)
        self.function = function

    def ends(self, motion: Any, k: int) -> str | None:
        """Tell the function of an instant; why the run ends there, if it does."""
        self.last = self.state(motion, k)
        for array in self.last[:2]:
            array.flags.writeable = False
        u, v = (array.view() for array in self.last[:2])  # which cannot be made writeable
        self.count, t, self.failed = k + 1, self.time(k), False
        name = getattr(self.function, "__name__", type(self.function).__name__)
        try:
            return f"{name} ended the run at t = {t:.6g} s" if self.function(t, u, v) else None
        except Exception as error:
            self.failed = True
            return f"{name} raised {check.shown(error)} at t = {t:.6g} s"

    def step(self, k: int) -> int:
        """Steps done before an instant."""
        return int(self._plan.step[k])


def watching(observe: Any, record: Record, scene: Any, t_end: float) -> list[Any]:
    """Pairs of a function and when it is called, of what a user gave as `observe`.

    Raises
    ------
    TensegrityError
        No function, no record, or one of more than instants.
    """
    if observe is None:
        return []
    one = callable(observe) or (
        isinstance(observe, tuple) and len(observe) == 2 and isinstance(observe[1], Record)
    )
    found = []
    for given in [observe] if one else check.sequence("observe", observe, "functions"):
        function, when = given if isinstance(given, tuple) and len(given) == 2 else (given, None)
        if not callable(function):
            raise TensegrityError(
                f"observe {check.shown(function)} is not a function (t, u, v), nor it and a Record"
            )
        if when is not None:
            check.kind("record of an observer", when, Record)
            for name in ("sites", "path", "checkpoint"):
                if getattr(when, name) is not None:
                    raise TensegrityError(
                        f"{name} of an observer's record: it says when, every site is observed"
                    )
            when.check(scene.sites, t_end)
        found.append((function, record.instants if when is None else when))
    return found
