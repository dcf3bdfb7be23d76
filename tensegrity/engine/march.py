"""Steps of prepared loops, with output of requested states on the way: see `march.c`."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from tensegrity.engine.native import address, concatenated, library, structure
from tensegrity.once import once
from tensegrity.typing import Indices

_ADDRESS, _NUMBER = ctypes.c_void_p, ctypes.c_longlong
STOPPED, NOT_FINITE = 1, 2  # results of `go` other than 0
STEPS = ctypes.CFUNCTYPE(_NUMBER, _ADDRESS, _ADDRESS, _NUMBER, _NUMBER)  # as `advance` there


LOOP = structure("march.c", "loop")  # a prepared loop
_WANTED = structure("march.c", "wanted")


class Wanted(NamedTuple):
    """A request for states of a run, with the arrays that receive them.

    Attributes
    ----------
    at : ndarray of int64, (count,)
        Numbers of steps after which states are requested, increasing.
    u, v : ndarray, C-contiguous, (count, sites[, dim][, batch])
        Receive displacements [m] and velocities [m/s].
    impulse : ndarray, (count, walls[, dim][, batch]), or None
        Receives the impulses of the walls [N s].
    sums : ndarray, (count, 2), or None
        Receives work and loss [J] of driven scenes.
    travel : ndarray, (count,), or None
        Receives bounds on the distance that any coordinate of a site has moved [m]; in networks.
    raw : bool
        Whether states are requested as they are in the loop, before the closing kick.
    places : ndarray of int64, or None
        If given, the entries of u, `u_count` of them, and then of v that are requested instead of
        states, as they are in the loop; `u` receives them, (count, places).
    u_count : int
        Number of entries of u among the places.
    width : int
        Number of scenes in the loop where u, v, impulse and sums are views of arrays for more
        scenes, whose last axis counts them (`part`); 0 where they are contiguous.
    """

    at: Indices
    u: Any
    v: Any = None
    impulse: Any = None
    sums: Any = None
    travel: Any = None
    raw: bool = False
    places: Any = None
    u_count: int = 0
    width: int = 0

    def with_travel(self) -> Wanted:
        """The same request, also for the distance travelled up to each state."""
        if self.raw or self.places is not None:
            return self
        return self._replace(travel=np.empty(len(self.at)))

    def part(self, numbers: Any, width: int) -> Wanted:
        """The same request for some scenes of a batch, written to their places among the others.

        Parameters
        ----------
        numbers : slice or int
            Of the scenes, or of a single one.
        width : int
            Number of scenes in their loop, 1 for a single one.

        Returns
        -------
        Wanted
        """
        u, v, impulse, sums = (None if x is None else x[..., numbers] for x in self[1:5])
        return self._replace(u=u, v=v, impulse=impulse, sums=sums, width=width)


@once
def compiled() -> Any:
    """The functions of `march.c`."""
    return library(concatenated(["prelude.c", "march.c"]))


def requests(wanted: Sequence[Wanted], sites: int, walls: int) -> Any:
    """The structures `wanted` of `march.c`.

    Parameters
    ----------
    wanted : sequence of Wanted
    sites, walls : int
        Entries of u of all sites, and of the walls after them.

    Returns
    -------
    ctypes.Structure, or an array of them
    """
    each = [_request(one, sites, walls) for one in wanted]
    return each[0] if len(each) == 1 else (_WANTED * len(each))(*each)


def _request(one: Wanted, sites: int, walls: int) -> Any:
    at, u, v, impulse, sums, travel, raw, places, u_count, width = one
    filled = _WANTED.of(at=address(at), u=address(u), count=len(at), raw=raw, size=u[:1].size)
    if places is not None:
        filled.places, filled.entries, filled.u_count = address(places), len(places), u_count
        filled.raw = 1
        return filled
    if width:
        batch = u.strides[-2 if width > 1 else -1] // u.itemsize  # scenes of the whole array
        filled.used = u.shape[-1] if width > 1 else 1
        filled.width, filled.stride = width, batch
        filled.size = width * (u[:1].size // filled.used)
    filled.v = address(v)
    if impulse is not None:
        filled.impulse, filled.walls, filled.behind = address(impulse), walls, sites
    if sums is not None:
        filled.sums = address(sums)
    if travel is not None:
        filled.travel = address(travel)
    return filled
