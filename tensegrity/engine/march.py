"""Steps of bound loops, with the states that somebody wants on the way: see `march.c`."""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from tensegrity.engine.codegen import joined
from tensegrity.engine.native import address, library
from tensegrity.once import once

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from tensegrity.typing import Array, Indices

_ADDRESS, _NUMBER = ctypes.c_void_p, ctypes.c_longlong
STEPS = ctypes.CFUNCTYPE(_NUMBER, _ADDRESS, _ADDRESS, _NUMBER, _NUMBER)  # as `advance` there


class Loop(ctypes.Structure):
    """A bound loop, as `march.c` takes it."""

    _fields_ = [
        *((name, _ADDRESS) for name in "advance show scene method u v shown_u shown_v sums".split()),
        *((name, _NUMBER) for name in ("size", "sum_count")),
    ]


class _Wanted(ctypes.Structure):
    _fields_ = [
        *((name, _ADDRESS) for name in "at places u v impulse sums".split()),
        *((name, _NUMBER) for name in "count raw size behind walls entries of_u".split()),
    ]


class Wanted(NamedTuple):
    """States of a run that somebody wants, and room for them.

    Attributes
    ----------
    at : ndarray of int64, (count,)
        Numbers of steps, increasing.
    u, v : ndarray, C-contiguous, (count, sites[, dim][, lanes])
        For the states after these.
    impulse : ndarray, (count, walls[, dim][, lanes]), or None
        For what walls got.
    sums : ndarray, (count, 2), or None
        For work and loss [J], where time counts.
    raw : bool
        Whether states are wanted as the loop has them, before the closing kick.
    places : ndarray of int64, or None
        If given: which entries of u, `of_u` of them, and then of v are wanted, as the loop has
        them, in the rows of `u` alone, (count, places).
    of_u : int
    """

    at: Indices
    u: Array
    v: Any = None
    impulse: Any = None
    sums: Any = None
    raw: bool = False
    places: Any = None
    of_u: int = 0

    @property
    def rows(self) -> list[Array]:
        """All arrays that states go to."""
        return [x for x in self[1:5] if x is not None]

    def like(self, lanes: tuple[int, ...]) -> Wanted:
        """Room for the same, of other lanes."""
        room = (None if x is None else np.empty((*x.shape[:-1], *lanes)) for x in self[1:5])
        return Wanted(self.at, *room, *self[5:])

    def after(self, skipped: int) -> Wanted:
        """Without the first ones."""
        rows = (None if x is None else x[skipped:] for x in self[:5])
        return Wanted(*rows, *self[5:])


@once
def _compiled() -> Any:
    found = library(joined(["march.c"])).go
    found.argtypes = [_ADDRESS, _NUMBER, _NUMBER, _ADDRESS, _NUMBER]
    found.restype = _NUMBER
    return found


def go(loop: Loop, done: int, end: int, wanted: Sequence[Wanted], sites: int, walls: int) -> bool:
    """Advance from step `done` to `end`, and take what is wanted after `done`.

    Parameters
    ----------
    loop : Loop
    done, end : int
    wanted : sequence of Wanted
        With numbers of steps above `done` and at most `end`.
    sites, walls : int
        Numbers of u that sites have, and walls behind them.

    Returns
    -------
    bool
        Whether the loop had to stop before.
    """
    each = (_Wanted * len(wanted))()
    for told, one in zip(each, wanted, strict=True):
        told.at, told.count, told.raw = address(one.at), len(one.at), one.raw or one.v is None
        told.u = address(one.u)
        if one.places is not None:
            told.places, told.entries, told.of_u = address(one.places), len(one.places), one.of_u
            continue
        told.v, told.size, told.behind = address(one.v), one.u[:1].size, sites
        if one.impulse is not None:
            told.impulse, told.walls = address(one.impulse), walls
        if one.sums is not None:
            told.sums = address(one.sums)
    found = _compiled()(
        ctypes.addressof(loop), done, end, ctypes.addressof(each), len(wanted)
    )
    return bool(found)


def pointer(function: Any) -> Any:
    """The address of a function of a library, or of one of Python that C may call."""
    return ctypes.cast(function, _ADDRESS).value
