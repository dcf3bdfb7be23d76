"""Output of a run: the instants of a `Record`, and observers, which receive the states there.

Before each attempt an observer requests states and provides arrays for them; it takes these once
the attempt is accepted.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import numpy as np

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.engine.march import Wanted
from tensegrity.errors import TensegrityError
from tensegrity.printing import printed
from tensegrity.typing import Count, Duration

if TYPE_CHECKING:
    from typing import Any

    from numpy.typing import NDArray

    from tensegrity.typing import Array, Indices


INSTANTS = 500  # recorded by default
FEW = 20  # instants, each of which may take a step of its own
SMALL = 4_000_000  # bytes for which free memory is not checked
PER_INSTANT = 48  # most bytes of memory for the numbers of one recorded instant
ROUND_OFF = 16 * np.finfo(float).eps  # relative: an instant this close to the end of a step is it


@checked
@dataclass(frozen=True)
class Record:
    """What to record during a run.

    At most one of `every`, `times` and `interval` is given; by default about 500 instants are
    recorded, whatever the number of steps.  The record changes no bit of the run itself.

    Parameters
    ----------
    every : int, optional
        Record every k-th step; the first and the last are always recorded.
    times : sequence of float, optional
        Record these instants [s], increasing, from 0 to the end of the run.  For an instant inside
        a step, a copy of the state before it is advanced by a shorter step of the same method:
        the values are of the method's order, like those at its steps.
    interval : float, optional
        Record at 0, at the multiples of this interval [s] and at the end of the run; as `times`.
    sites : sequence of int, optional
        Sites to record, in this order; by default all.
    path : str or path, optional
        A new .npy file for the rows, which then take no memory except 48 bytes per instant; valid
        after every row, even if the process is killed.  numpy.load(path, mmap_mode="r") gives a
        structured array with fields t, energy, u, v, and work, loss of scenes that are driven,
        damped or change.  Another run with the same path is refused before it writes.
    checkpoint : float, optional
        With a path: interval of computing time [s] after which the whole state is saved for
        `resume`, in a file with .state.npz added; also when the run ends, be it by an error or by
        Ctrl-C.  0 saves it after every block of steps.  With a `tol`, no forces are fitted then.

    Raises
    ------
    TensegrityError
        More than one of `every`, `times` and `interval`; a number, time or path that is invalid.
        Sites that the scene does not have and times after the end are refused when a run begins.

    Examples
    --------
    >>> from tensegrity import Chain, PowerLaw, Record, simulate
    >>> chain = Chain(PowerLaw(1.0, 1.5), sites=5)
    >>> record = Record(interval=2.0, sites=[0, 4])
    >>> run = simulate(chain, chain.at_rest({0: 1.0}), 6.0, record=record)
    >>> print(run.t, run.u.shape)
    [0. 2. 4. 6.] (4, 2)
    """

    every: Count | None = None
    sites: Sequence[int] | None = None
    path: str | os.PathLike[str] | None = None
    times: Sequence[float] | None = None
    interval: Duration | None = None
    checkpoint: Annotated[float, ">= 0", "s"] | None = None

    __str__ = printed(times="s", interval="s", checkpoint="s")

    def __post_init__(self) -> None:
        ways = {name: getattr(self, name) for name in ("every", "times", "interval")}
        given = [name for name, value in ways.items() if value is not None]
        if len(given) > 1:
            raise TensegrityError(f"{' and '.join(given)} exclude each other: give one")
        if self.times is not None:
            object.__setattr__(self, "times", _increasing(self.times))
        if self.sites is not None:
            sites = check.sequence("sites", self.sites, "site numbers")
            numbers = tuple(check.whole("site", s, least=0) for s in sites)
            if not numbers:
                raise TensegrityError("sites is empty: nothing to record")
            object.__setattr__(self, "sites", numbers)
        if self.path is not None:
            object.__setattr__(self, "path", check.path("path", self.path))
        if self.checkpoint is not None and self.path is None:
            raise TensegrityError(f"checkpoint {self.checkpoint:g} s needs a path for the rows")

    @property
    def is_plain(self) -> bool:
        """Whether rows are taken at steps only, and held in memory."""
        return self.path is None and self.times is None and self.interval is None

    @property
    def instants(self) -> Record:
        """A record of all sites in memory at the same instants."""
        return Record(every=self.every, times=self.times, interval=self.interval)

    @property
    def checkpoint_path(self) -> Path | None:
        """Path of the checkpoint file, or None where no checkpoint is requested."""
        return None if self.checkpoint is None else checkpoint_path(self.path)  # type: ignore[arg-type]

    def check(self, sites: int, t_end: float = math.inf) -> None:
        """Refuse sites that a scene does not have, times after the end of the run, and a path where
        no new file can be made."""
        self.columns(sites)
        if self.times is not None and self.times[-1] > t_end * (1 + ROUND_OFF):
            late = next(t for t in self.times if t > t_end * (1 + ROUND_OFF))
            raise TensegrityError(f"time {late:.17g} s to record is after the end, {t_end:.17g} s")
        for path in (self.path, self.checkpoint_path):
            if path is not None and path.exists():
                raise TensegrityError(f"record path {path} exists; delete it or choose another")
        if self.path is not None and not self.path.parent.is_dir():
            raise TensegrityError(f"record path {self.path}: there is no folder {self.path.parent}")

    def columns(self, sites: int) -> Any:
        """Indices of the recorded sites, or a slice of all; refuses sites that do not exist."""
        if self.sites is None:
            return slice(None)
        if max(self.sites) >= sites:
            raise TensegrityError(f"recorded site {max(self.sites)} must be below {sites}")
        return list(self.sites)

    def check_room(self, total: int, t_end: float, shape: tuple[int, ...]) -> None:
        """Refuse a record that does not fit into memory.

        Parameters
        ----------
        total : int
            Least number of steps of the run.
        t_end : float
            Duration [s].
        shape : tuple of int
            Of u, (sites,) or (sites, dim).

        Raises
        ------
        TensegrityError
        """
        if self.path is not None:
            return
        count: float = total // (self.every or max(1, -(-total // INSTANTS)))
        if self.times is not None:
            count = len(self.times)
        elif self.interval is not None:
            count = t_end / self.interval
        sites = shape[0] if self.sites is None else len(self.sites)
        require_memory(8 * count * (2 + 2 * sites * math.prod(shape[1:])))

    def plan(self, total: int, t_end: float) -> OutputTimes:
        """The output times of a run of `total` steps to `t_end` [s]."""
        if self.times is None and self.interval is None:
            return _evenly(self.every or max(1, -(-total // INSTANTS)), total, t_end)
        t = np.array([]) if self.times is None else np.array(self.times)
        if self.interval is not None:
            count = t_end / self.interval * (1 + ROUND_OFF)
            require_memory(PER_INSTANT * (count + 2))
            t = self.interval * np.arange(math.floor(count) + 1)
            t[-1] = t_end if t_end - t[-1] <= ROUND_OFF * t_end else t[-1]
            t = t if t[-1] == t_end else np.append(t, t_end)
        if not total:
            return OutputTimes(
                np.zeros(len(t), dtype=int), np.zeros(len(t)), t, np.zeros(len(t), dtype=int)
            )
        dt = t_end / total
        nearest = np.rint(t / dt)
        there = np.abs(t - nearest * dt) <= ROUND_OFF * t
        whole = np.where(there, nearest, np.floor(t / dt))
        part = np.where(there, 0.0, t - whole * dt)
        return OutputTimes(whole.astype(int), part, t, whole.astype(int) + (part > 0))


PLAIN = Record()


class OutputTimes(NamedTuple):
    """The instants to record, in terms of the steps of a run.

    Attributes
    ----------
    step : ndarray of int, (instants,)
        Number of whole steps up to each instant.
    part : ndarray, (instants,), or None
        Time from the end of that step to the instant [s]; None where each is the end of one.
    t : ndarray, (instants,)
        Instants [s].
    due : ndarray of int, (instants,)
        Number of steps after which each can be recorded.
    """

    step: Indices
    part: Array | None
    t: NDArray[Any]
    due: Indices


def is_light(record: Record, t_end: float) -> bool:
    """Whether the rows of a run to `t_end` [s] take negligible time: they are held in memory,
    and few of them lie inside steps."""
    inside = t_end / record.interval if record.interval else len(record.times or ())
    return record.path is None and inside <= FEW


def _evenly(every: int, total: int, t_end: float) -> OutputTimes:
    """Output after every so many steps, and after the last one."""
    require_memory(PER_INSTANT * (total // every + 2))
    step = np.arange(0, total + every, every) if total else np.zeros(1, dtype=int)
    step[-1] = total
    return OutputTimes(step, None, step * (t_end / (total or 1)), step)


def require_all_sites(run: Any, what: str = "") -> None:
    """Refuse a run in which some sites were not recorded, or in another order."""
    sites = run.scene.sites
    if run.sites != tuple(range(sites)):
        raise TensegrityError(f"{len(run.sites)} of {sites} sites recorded: record all{what}")


def require_memory(size):
    """Refuse a record of more bytes than there is free memory."""
    if size > SMALL:
        refuse_oversize(size, check.free_memory(), "memory")


def refuse_oversize(size, room, what):
    """Refuse a record of more than the free memory or disk space.

    Parameters
    ----------
    size, room : float
        Of the record, and free [bytes].
    what : {"memory", "disk space"}

    Raises
    ------
    TensegrityError
    """
    if size > room:
        raise TensegrityError(
            f"record of {size / 1e9:.3g} GB exceeds the {room / 1e9:.3g} GB of {what}: keep fewer "
            "steps or sites" + (", or give a path" if what == "memory" else "")
        )


def checkpoint_path(path: str | os.PathLike[str]) -> Path:
    """Path of the checkpoint file that belongs to a file of rows."""
    path = Path(path)
    return path.with_name(path.name + ".state.npz")


def _increasing(times):
    """Instants as a tuple of increasing floats, not below 0."""
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


class OutputStates:
    """Observer that receives the states at the instants of a record.

    Parameters
    ----------
    record : Record
    problem : Problem
    motion : Motion
    steps : int
        Number of steps of the whole run.

    Attributes
    ----------
    count : int
        Number of instants taken so far.
    """

    count: int = 0

    def __init__(self, record: Record, problem: Any, motion: Any, steps: int) -> None:
        self._plan, self._dynamics = record.plan(steps, problem.t_end), problem.dynamics
        self._is_dense = self._plan.part is not None

    def wanted(self, end: int) -> Sequence[Wanted]:
        """States that are due in an attempt to advance to step `end`."""
        first = self._first = self.count
        stop = int(self._plan.due.searchsorted(end, side="right"))
        at, here = self._plan.step[first:stop], slice(first, stop)
        if self._is_dense:  # several instants within a step need one state
            at = np.unique(at)
            here = slice(0, len(at))
        self._states = Wanted(at, *self._room(here))
        return [self._states] if stop > first else ()

    def _room(self, here: slice) -> tuple[Any, ...]:
        """Empty arrays u, v, impulse and sums for the states of some instants."""
        dyn, count = self._dynamics, here.stop - here.start
        walls, shape = dyn.wall_count, dyn.shape
        u, v = np.empty((2, count, *shape))
        return u, v, np.empty((count, walls, *shape[1:])) if walls else None, self._sums(count)

    def _sums(self, count: int) -> Array | None:
        """An empty array for work and loss at some instants, where there are any."""
        return np.empty((count, 2, *self._dynamics.batch)) if self._dynamics.sums else None

    def last_step(self, count: int) -> int | float:
        """The last step up to which no more than so many of the next instants are due."""
        following = self.count + count
        return self._plan.due[following] - 1 if following < len(self._plan.due) else math.inf

    def due(self, motion: Any) -> range:
        """Numbers of the instants whose states are accepted and not yet taken."""
        return range(self.count, int(self._plan.due.searchsorted(motion.done, side="right")))

    def time(self, k: int) -> float:
        """Time of the instant number k [s]."""
        return float(self._plan.t[k])

    def state(self, motion: Any, k: int) -> tuple[Any, ...]:
        """Copies of u, v, impulse and sums at the instant number k."""
        here = int(self._states.at.searchsorted(self._plan.step[k]))
        arrays = tuple(None if x is None else x[here].copy() for x in self._states[1:5])
        if self._plan.part is not None and self._plan.part[k] > 0:
            motion.between(int(self._plan.step[k]), self._plan.part[k], *arrays)
        return arrays


class ComparisonSamples:
    """Observer that stores u and v at evenly spaced instants, to compare trial runs.

    `rows`, (2, instants so far, *shape of the scene), are u [m] and v [m/s].

    Parameters
    ----------
    shape : tuple of int
        Of u.
    steps : int
        Number of steps of the run, a multiple of `instants`.
    instants : int
        Number of instants after the first.
    most : int, optional
        Take as many times more of them as end with a step and do not exceed so many numbers in u.
    """

    def __init__(self, shape: tuple[int, ...], steps: int, instants: int, most: int = 0) -> None:
        every = steps // instants  # steps from one instant to the next
        least = -(-steps * math.prod(shape) // most) if most else every
        every = next((k for k in range(max(least, 1), every) if every % k == 0), every)
        self._at = every * np.arange(steps // every + 1)
        self._all, self._count, self._stop = np.empty((2, len(self._at), *shape)), 0, 0

    @property
    def rows(self) -> Array:
        return self._all[:, : self._count]

    def wanted(self, end: int) -> Sequence[Wanted]:
        """States that are due in an attempt to advance to step `end`."""
        self._stop = int(self._at.searchsorted(end, side="right"))
        here = slice(self._count, self._stop)
        return [Wanted(self._at[here], *self._all[:, here])] if here.stop > here.start else ()

    def take(self, motion: Any) -> None:
        """Accept the states of the last attempt."""
        self._count = self._stop
