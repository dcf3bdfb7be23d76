"""Runs of compiled loops with their rows, in one call from step to step: see `walk.c`."""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from tensegrity.engine.codegen import joined
from tensegrity.engine.native import address, library
from tensegrity.engine.structs import structure
from tensegrity.once import once

if TYPE_CHECKING:
    from typing import Any

    from tensegrity.typing import Array, Indices

_ADDRESS, _NUMBER = ctypes.c_void_p, ctypes.c_longlong


TASK, WALK = structure("walk.c", "task"), structure("walk.c", "walk")
TOLD, PLAN = structure("walk.c", "told"), structure("walk.c", "plan")

_GO = (_ADDRESS, _NUMBER, _ADDRESS, *[_NUMBER] * 3, _ADDRESS, _ADDRESS, *[_NUMBER] * 2, _ADDRESS)
_COURSE = (
    ctypes.c_double, *[_NUMBER] * 2, *[_ADDRESS] * 4, _NUMBER, *[_ADDRESS] * 3
)  # fmt: skip
_RUN = *[_ADDRESS] * 4, *_COURSE
_COMPARE = (_ADDRESS, _ADDRESS, _NUMBER, _ADDRESS)


@once
def _compiled() -> Any:
    """The functions go, run, twice and compare."""
    found = library(joined(["subnormal.c", "walk.c"]))
    for function, arguments, result in (
        (found.go, _GO, None),
        (found.run, _RUN, _NUMBER),
        (found.twice, (*_RUN, *_COURSE), _NUMBER),
        (found.compare, _COMPARE, None),
    ):
        function.argtypes, function.restype = arguments, result
    return found.go, found.run, found.twice, found.compare


class Course(NamedTuple):
    """One run of a plan, and where it leaves what is kept of it.

    Attributes
    ----------
    dt : float
        [s]
    steps : int
    every, apart : int
        After so many steps the state is kept, in rows and in what is seen; 0 for never.
    rows : (ndarray, ndarray), or None
        For u and v of the rows, those at 0, every so many steps, the end, and impulses;
        (2, rows, *shape) and (rows, walls[, dim]), or None without walls.
    energy : ndarray, (rows,), or None
        For the energies of the rows [J], where a plan has them.
    seen : (ndarray, ndarray), or None
        Likewise u and v, (2, instants + 1, *shape), `apart` a divisor of the steps, and a bound on
        how far any coordinate of a site moved by each but the first, (instants,) [m]; that in
        networks only.
    """

    dt: float
    steps: int
    every: int
    rows: Any
    energy: Array | None
    apart: int
    seen: Any

    def told(self) -> tuple[Any, ...]:
        """What the compiled function takes."""
        dt, steps, every, rows, energy, apart, seen = self
        kept, looked = (None, None, None), (None, None, None)
        if rows is not None:
            kept = *_halves(rows[0]), None if rows[1] is None else address(rows[1])
        if seen is not None:
            looked = *_halves(seen[0]), address(seen[1])
        total = None if energy is None else address(energy)
        return dt, steps, every, *kept, total, apart, *looked


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
    begins : int, optional
        Address of a whole number that says whether the next step is the first of a run.
    """

    def __init__(
        self,
        place: Any,
        function: Any,
        addresses: tuple[int, ...],
        u: Array,
        v: Array,
        begins: int | None = None,
    ) -> None:
        self.place, self.call, self.u, self.v = place, (function, addresses), u, v
        self.begins = begins
        first, second = (*addresses, None)[:2]
        where = ctypes.cast(function, _ADDRESS).value
        self.task = TASK(function=where, first=first, second=second, u=u, v=v)


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
        self._u, self._v, (self._go, *_) = u, v, _compiled()
        loops = [loop and loop.parts() for loop in (begin, step, close, leave)]
        empty = [None] * len(loops[1])
        self._parts = list(zip(*(parts or empty for parts in loops), strict=True))
        self._walks = [_walk(*four) for four in self._parts]

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


def _walk(begin: Part | None, step: Part, close: Part | None, leave: Part | None) -> Any:
    """Parts of one loop as C takes them."""
    return WALK(
        begin=begin and begin.task,
        step=step.task,
        close=close and close.task,
        leave=leave and leave.task,
        begins=step.begins,
        size=step.u.size,
    )


class Plan:
    """Whole runs of one scene and method, each in one call: what is prepared serves all steps.

    Parameters
    ----------
    state, walls : int
        Numbers in u of a state, and behind it in that of walls.
    energies : Energies or None
        Of the scene.
    enter, begin, step, close, leave : BoundLine or BoundNet, or None
        As of `Walk`; bound with a step of 1, on arrays that nobody else takes.

    Attributes
    ----------
    has_energies : bool
    met, met_or_rest : tuple of ndarray, (springs, 2)
        Smallest and largest elongation of each spring in the first and in the second run of the
        last call, until the next; and the same with 0 included.
    """

    def __init__(
        self,
        state: int,
        walls: int,
        energies: Any,
        enter: Any,
        begin: Any,
        step: Any,
        close: Any,
        leave: Any,
    ) -> None:
        loops = [loop for loop in (step, enter, begin, close, leave) if loop is not None]
        taken = [(of, name, of.filled[name]) for loop in loops for of, name in loop.taken]
        coefficients = np.concatenate([array for *_, array in taken])
        steps, place = np.empty_like(coefficients), 0
        for of, name, array in taken:
            of.fill(**{name: steps[place : place + array.size]})
            place += array.size
        kept = [(name, of.filled[name]) for of, name in step.kept]
        for loop in loops[1:]:
            for (of, name), (_, array) in zip(loop.kept, kept, strict=True):
                of.fill(**{name: array})
        step.forget_range()
        met = [array for name, array in kept if name != "travel"]
        blank = np.concatenate(met)
        parts = [loop and loop.parts()[0] for loop in (begin, step, close, leave, enter)]
        (spring, low, high), self._ranges = step.places(), np.empty((2, 2, step.springs, 2))
        self.met, self.met_or_rest = tuple(self._ranges[:, 0]), tuple(self._ranges[:, 1])
        self._gaps = np.empty((2, 2))
        self._plan = PLAN(
            walk=_walk(*parts[:4]),
            enter=parts[4] and parts[4].task,
            coefficients=coefficients,
            steps=steps,
            blank=blank,
            met=met[0],
            travel=step.travel_at,
            spring=spring,
            low=low,
            high=high,
            ranges=self._ranges,
            gaps=self._gaps,
            taken=steps.size,
            kept=blank.size,
            state=state,
            more=walls,
            places=len(spring),
            springs=step.springs,
        )
        self.has_energies, self._told = energies is not None, None
        if energies is not None:
            self._told = TOLD(**energies.told, scratch=np.empty(energies.room))
        self._told_at = self._told and ctypes.addressof(self._told)
        self._kept, self._step = (loops, energies), step
        self._address = ctypes.addressof(self._plan)
        _, self._run, self._twice, _ = _compiled()

    def run(self, u: Array, v: Array, *courses: Course) -> int:
        """Go from a state to the end, once or twice.

        Returns 0 where that is not finite, 3 where the energies of the last rows are known, else 1.

        Parameters
        ----------
        u, v : ndarray, C-contiguous
        courses : Course
        """
        given = self._address, address(u), address(v), self._told_at
        if len(courses) == 1:
            return self._run(*given, *courses[0].told())
        first, second = courses
        return self._twice(*given, *first.told(), *second.told())

    @property
    def gap(self) -> float:
        """`largest_gap` of what was seen of the last two runs."""
        return _larger(self._gaps)

    @property
    def travel(self) -> float:
        """Bound on how far any coordinate of a site moved in it [m]; networks only."""
        return self._step.travel


def _halves(array: Array) -> tuple[int, int]:
    """Addresses of the halves of an array."""
    first = address(array)
    return first, first + array.nbytes // 2


def largest_gap(one: Array, other: Array) -> float:
    """Largest difference of u and v of two runs, each over its largest size in the other one.

    Parameters
    ----------
    one, other : ndarray, C-contiguous, (2, ...)
        u and v; a size of 0 counts as 1.
    """
    found = np.empty((2, 2))
    half, given = one.nbytes // 2, (address(one), address(other), address(found))
    *_, compare = _compiled()
    for k in range(2):
        compare(given[0] + k * half, given[1] + k * half, one.size // 2, given[2] + 16 * k)
    return _larger(found)


def _larger(found: Array) -> float:
    """The larger gap, of u or of v, over its size."""
    return max(gap / size if size else gap for size, gap in found.tolist())
