"""Compiled laws outside of loops: energies of many states of a chain or a network in one call, and
springs looked at point by point; see `energies.c`."""

from __future__ import annotations

import ctypes
import math
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.engine import codegen
from tensegrity.engine.bonds import KINDS, integers
from tensegrity.engine.compiled import Compiled
from tensegrity.engine.disk_cache import cached
from tensegrity.engine.native import address, joined, library, pointer, structure
from tensegrity.once import once

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from typing import Any

    from tensegrity.engine.bonds import Contacts
    from tensegrity.typing import Array, Flags, Indices

    Set = tuple[Compiled, Array, Array, Indices]

PART = 1024  # contacts of a network in a set: what lies between stays in the nearest cache
FINITE = 2  # what `largest` returns of finite numbers

ALIKE = structure("energies.c", "alike")
SPRINGS = structure("energies.c", "springs")
LOOKS = structure("energies.c", "looks")
PLACES = structure("elongations.c", "places")


@once
def _compiled() -> Any:
    return library(joined(["prelude.c", "energies.c"]), ["-ffp-contract=off"])


@once
def _elongations(dim: int) -> list[int | None]:
    """Addresses of the functions of each kind of contact; they stay where they are."""
    given: tuple[Any, ...] = (), (), (), dim, (), {}, {}, ["elongations.c"]
    text = cached(("elongations", dim), lambda: codegen.whole(*given))
    found = library(text, [f"-DDIM={dim}"])
    return [pointer(found[f"{kind}_elongations"]) for kind in KINDS]


class Energies:
    """Bonds in sets, each of which one compiled function evaluates.

    Parameters
    ----------
    mass : ndarray, shape of a state
        [kg]
    sets : sequence of (Compiled, ndarray, ndarray, ndarray)
        The loop of a law; parameters, (parameters,) or of each bond (parameters, bonds); domain
        [m], (2, 1) or (2, bonds); numbers of the bonds, increasing.
    contacts : Contacts, optional
        Where the bonds do not just join neighbours on a line.
    """

    def __init__(self, mass: Array, sets: Sequence[Set], contacts: Contacts | None = None) -> None:
        self._shape, self._function = mass.shape, _compiled().energies
        parts = sets if contacts is None else _of_contacts(sets, contacts)
        rows = [_alike(*part, contacts) for part in parts]
        each, bonds = (ALIKE * len(rows))(*rows), sum(len(columns) for *_, columns in sets)
        mass, loads = np.ascontiguousarray(mass), None
        if contacts is not None and contacts.load.any():
            loads = np.ascontiguousarray(contacts.load)
        self._held = rows, each, mass, loads  # as long as C may look at them
        given = ctypes.addressof(each), len(rows), bonds, address(mass)
        self._given = *given, None if loads is None else address(loads), mass.size
        self._room = bonds + max(mass.size, *(row.count for row in rows), 0)

    def __call__(self, u: Array, v: Array) -> Array | None:
        """Total energies [J] of states u and v, (..., *shape of a state), the potential of loads
        included; None where an elongation is outside of its domain, or the arrays are not as a
        loop takes them."""
        states = u.shape[: u.ndim - len(self._shape)]
        fit = u.shape == v.shape == (*states, *self._shape)
        if not (fit and all(x.dtype == np.float64 and x.flags.c_contiguous for x in (u, v))):
            return None
        count = math.prod(states)
        room = np.empty(self._room + count)  # to work in, and for what is found
        found = room[self._room :]
        pointers = address(u), address(v), address(room), found.ctypes.data
        if not self._function(*self._given, count, *pointers):
            return None
        return found.reshape(states).copy() if states else found[0]


def _alike(
    loop: Compiled, parameters: Array, domain: Array, columns: Indices, contacts: Contacts | None
) -> Any:
    """A set as C takes it."""
    own, (low, high) = parameters.ndim == 2, np.ascontiguousarray(domain)
    first, last = (columns[0], columns[-1] + 1) if len(columns) else (0, 0)
    in_a_row = last - first == len(columns)
    elongations = places = None
    if contacts is not None:
        elongations = _elongations(contacts.load.shape[1])[contacts.kind[columns][0]]
        places = _places(contacts, slice(first, last) if in_a_row else columns)
    return ALIKE(
        function=pointer(loop.library.values_own if own else loop.library.values),
        elongations=elongations,
        parameters=loop.numbers(parameters),
        low=low,
        high=high,
        members=None if in_a_row else integers(columns),
        places=places,
        own=own,
        count=len(columns),
        start=first,
    )


def _places(contacts: Contacts, columns: slice | Indices) -> Any:
    """Where the contacts of a set are: views of the network's own arrays where may be."""
    geometry = contacts.geometry[:, columns]
    if not isinstance(columns, slice):
        geometry = np.ascontiguousarray(geometry)
    return PLACES(
        first=integers(contacts.first[columns]),
        second=integers(contacts.second[columns]),
        geometry=geometry,
        apart=geometry.strides[0] // geometry.itemsize,
    )


def _of_contacts(sets: Sequence[Set], contacts: Contacts) -> Iterator[Set]:
    """Sets of contacts of one kind, few enough."""
    for loop, parameters, domain, columns in sets:
        for kind in range(len(KINDS)):
            mine = np.flatnonzero(contacts.kind[columns] == kind)
            for k in range(0, len(mine), PART):
                part = mine[k : k + PART]
                given = parameters, domain
                if parameters.ndim == 2:
                    given = parameters[:, part], domain[:, part]
                yield loop, *given, columns[part]


class Ways:
    """Where a search looks: shares of ways from 0.

    Each look is on that part of the way on which the one before found what is searched.

    Parameters
    ----------
    to_end : sequence of ndarray
        Of the way to an end of the domain, of each look.
    sizes : ndarray
        Elongations [m] where there is none.
    to_size : sequence of ndarray
        Of the way to one of these.
    """

    def __init__(self, to_end: Sequence[Array], sizes: Array, to_size: Sequence[Array]) -> None:
        self.to_end, self.sizes, self.to_size = to_end, sizes, to_size
        self._each = [_looks(looks) for looks in (to_end, [sizes], to_size)]
        self._looks = (LOOKS * 3)(*self._each)
        self.address = ctypes.addressof(self._looks)


def _looks(shares: Sequence[Array]) -> Any:
    begins = np.cumsum([0, *map(len, shares)], dtype=np.int64)
    return LOOKS(shares=np.concatenate(shares), begins=begins, count=len(shares))


class Search:
    """Different springs whose laws are compiled.

    Parameters
    ----------
    loops : sequence of Compiled
        Of the law of each, alone.
    parameters : ndarray, (springs, width)
        Of each, and what fills the row.
    domains : ndarray, (springs, 2)
        Lowest and highest elongation [m].
    """

    def __init__(self, loops: Sequence[Compiled], parameters: Array, domains: Array) -> None:
        functions = [pointer(loop.library.values) for loop in loops]
        self._springs = SPRINGS(
            functions=np.array(functions, dtype=np.uint64),
            parameters=np.ascontiguousarray(parameters),
            domains=np.ascontiguousarray(domains),
            width=parameters.shape[1],
        )
        self._address = ctypes.addressof(self._springs)
        self._library = _compiled()

    def reachable(self, energy: float, ways: Ways) -> tuple[Array, Flags]:
        """Elongations that each spring reaches with an energy [J], (springs, 2) [m], and whether
        that is an end of its domain."""
        count = len(self._springs.filled["functions"])
        ranges, locks = np.empty((count, 2)), np.empty(count, dtype=bool)
        found = address(ranges), address(locks)
        self._library.reachable(self._address, energy, count, ways.address, *found)
        return ranges, locks

    def largest(
        self, order: int, ranges: Array, numbers: Indices | None, shares: Array
    ) -> tuple[Array, bool] | None:
        """Largest size of the tension (1) [N], or largest stiffness (2) [N/m], of springs, of all
        by default, at shares of their ranges (numbers, 2) [m], at least 0, NaN where one is NaN;
        and whether all are finite.  None where a range is not inside of a domain."""
        out, ranges, which = np.empty(len(ranges)), np.ascontiguousarray(ranges), None
        if numbers is not None:
            numbers = np.ascontiguousarray(numbers, dtype=np.int64)
            which = address(numbers)
        given = which, address(ranges), address(shares), len(shares), address(out)
        found = self._library.largest(self._address, order, len(ranges), *given)
        return (out, found == FINITE) if found else None
