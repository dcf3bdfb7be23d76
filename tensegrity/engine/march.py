"""Steps of bound loops, with the states that somebody wants on the way: see `march.c`."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from tensegrity.engine.native import address, joined, library, structure
from tensegrity.once import once
from tensegrity.typing import Array, Indices

_ADDRESS, _NUMBER = ctypes.c_void_p, ctypes.c_longlong
STOPPED, ENDLESS = 1, 2  # what `go` returns, if not 0
STEPS = ctypes.CFUNCTYPE(_NUMBER, _ADDRESS, _ADDRESS, _NUMBER, _NUMBER)  # as `advance` there


LOOP = structure("march.c", "loop")  # a bound loop
_WANTED = structure("march.c", "wanted")


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
    travel : ndarray, (count,), or None
        For bounds on how far any coordinate of a site moved by then [m]; of networks.
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
    travel: Any = None
    raw: bool = False
    places: Any = None
    of_u: int = 0

    @property
    def rows(self) -> list[Array]:
        """All arrays that states go to."""
        return [x for x in self[1:5] if x is not None]

    def with_travel(self) -> Wanted:
        """The same, and the way travelled by each state."""
        if self.raw or self.places is not None:
            return self
        return self._replace(travel=np.empty(len(self.at)))

    def like(self, lanes: tuple[int, ...]) -> Wanted:
        """Room for the same, of other lanes."""

        def room(x: Any) -> Any:
            return None if x is None else np.empty((*x.shape[:-1], *lanes))

        states = {name: room(getattr(self, name)) for name in ("u", "v", "impulse", "sums")}
        return self._replace(**states)


@once
def _compiled() -> Any:
    return library(joined(["prelude.c", "march.c"])).go


def go(loop: Any, done: int, end: int, wanted: Sequence[Wanted], sites: int, walls: int) -> int:
    """Advance from step `done` to `end`, and take what is wanted after `done`.

    Parameters
    ----------
    loop : LOOP
    done, end : int
    wanted : sequence of Wanted
        With numbers of steps above `done`, or from 0 on, and at most `end`.
    sites, walls : int
        Numbers of u that sites have, and walls behind them.

    Returns
    -------
    int
        0, or `STOPPED` where the loop had to stop before, `ENDLESS` where it is not finite.
    """
    each = (_WANTED * len(wanted))(*(_output_buffers(one, sites, walls) for one in wanted))
    return _compiled()(
        ctypes.addressof(loop), done, end, ctypes.addressof(each), len(wanted), sites
    )


def _output_buffers(one: Wanted, sites: int, walls: int) -> Any:
    """As `march.c` takes it."""
    at, u, v, impulse, sums, travel, raw, places, of_u = one
    filled = _WANTED.of(at=address(at), u=address(u), count=len(at), raw=raw, size=u[:1].size)
    if places is not None:
        filled.places, filled.entries, filled.of_u, filled.raw = (
            address(places),
            len(places),
            of_u,
            1,
        )
        return filled
    filled.v, filled.behind = address(v), sites
    if impulse is not None:
        filled.impulse, filled.walls = address(impulse), walls
    if sums is not None:
        filled.sums = address(sums)
    if travel is not None:
        filled.travel = address(travel)
    return filled
