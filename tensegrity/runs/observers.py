"""What observes a march: states at given instants, for rows, for comparison, for a user.

Before each attempt an observer says which states it wants of it and gives room for them; it takes
them once the attempt stands.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check
from tensegrity.engine.march import Wanted
from tensegrity.errors import TensegrityError
from tensegrity.runs.record import Record

if TYPE_CHECKING:
    from typing import Any

    from tensegrity.typing import Array

    Watching = Callable[[float, Array, Array], Any]
    Observe = Watching | tuple[Watching, Record] | Sequence[Watching | tuple[Watching, Record]]


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
