"""Runs of compiled loops with their rows, in one call from step to step: see `walk.c`."""

from __future__ import annotations

import ctypes
from importlib.resources import files
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.engine.native import library
from tensegrity.once import once

if TYPE_CHECKING:
    from typing import Any

    from tensegrity.typing import Array, Indices

_ADDRESS, _NUMBER = ctypes.c_void_p, ctypes.c_longlong


class _Task(ctypes.Structure):
    _fields_ = [(name, _ADDRESS) for name in ("function", "first", "second", "u", "v")]


class _Walk(ctypes.Structure):
    _fields_ = [(name, _Task) for name in ("begin", "step", "close", "leave")]
    _fields_ += [("size", _NUMBER)]


@once
def _go() -> Any:
    text = files(__package__).joinpath("walk.c").read_text()
    function = library(text).go
    function.argtypes = [_ADDRESS, _NUMBER, _ADDRESS, _NUMBER, _NUMBER, _NUMBER]
    function.argtypes += [_ADDRESS, _ADDRESS, _NUMBER, _NUMBER, _ADDRESS]
    function.restype = None
    return function


class Part:
    """What one loop of a bound scene advances.

    Parameters
    ----------
    place : index
        Its part of the arrays of the scene.
    function : ctypes function
    addresses : tuple of int
    u, v : ndarray
        Its arrays: those of the scene, or copies of its part of them.
    """

    def __init__(
        self, place: Any, function: Any, addresses: tuple[int, ...], u: Array, v: Array
    ) -> None:
        self.place, self.call, self.u, self.v = place, (function, addresses), u, v
        first, second = (*addresses, None)[:2]
        where = ctypes.cast(function, _ADDRESS).value
        self.task = _Task(where, first, second, u.ctypes.data, v.ctypes.data)


class Walk:
    """Bound loops of one scene and method: those of a first step, of all others, of a closing
    kick and of the way out of a method's variables, where it has them.

    Parameters
    ----------
    u, v : ndarray
        What is advanced.
    begin, step, close, leave : bound scenes or None
    """

    def __init__(self, u: Array, v: Array, begin: Any, step: Any, close: Any, leave: Any) -> None:
        self._u, self._v, self._go = u, v, _go()
        loops = [loop and loop.parts() for loop in (begin, step, close, leave)]
        empty = [None] * len(loops[1])
        self._parts = list(zip(*(parts or empty for parts in loops), strict=True))
        self._walks = [
            _Walk(*(_Task() if part is None else part.task for part in four), four[1].u.size)
            for four in self._parts
        ]

    def go(
        self,
        done: int,
        at: Indices,
        last: bool,
        sites: int,
        rows_u: Array,
        rows_v: Array,
        walls: int = 0,
        impulse: Array | None = None,
    ) -> None:
        """Advance from step `done` to the last of `at`, keeping a row at each.

        Parameters
        ----------
        done : int
        at : ndarray of int, (count,)
        last : bool
            Whether the last one is a row.
        sites : int
            Rows of the arrays that are kept.
        rows_u, rows_v : ndarray, C-contiguous, (count, sites[, dim][, lanes])
        walls : int, optional
            Rows behind the sites.
        impulse : ndarray, (count, walls[, dim][, lanes]), optional
        """
        for four, walk in zip(self._parts, self._walks, strict=True):
            part = four[1]
            whole = part.u is self._u
            if not whole:
                part.u[...], part.v[...] = self._u[part.place], self._v[part.place]
            own: Any = (rows_u, rows_v, impulse)
            per_row = part.u.size // len(part.u)
            if not whole:
                shape = part.u.shape[1:]
                counts = (sites, sites, walls)
                own = [np.empty((len(at), count, *shape)) for count in counts]
            kept = [x.ctypes.data if x is not None else None for x in own]
            self._go(
                ctypes.addressof(walk), done, at.ctypes.data, len(at), last, sites * per_row,
                *kept[:2], sites * per_row, walls * per_row, kept[2],
            )  # fmt: skip
            if not whole:
                self._u[part.place], self._v[part.place] = part.u, part.v
                for mine, rows in zip(own, (rows_u, rows_v, impulse), strict=True):
                    if rows is not None and rows.size:
                        rows[(slice(None), *part.place)] = mine[: len(rows)]

    def seen(self) -> tuple[Array, Array]:
        """Copies of u and v as they are looked at, where the last call ended."""
        u, v = self._u.copy(), self._v.copy()
        for four in self._parts:
            part = next(one for one in four[::-1] if one is not None and one is not four[0])
            u[part.place], v[part.place] = part.u, part.v
        return u, v
