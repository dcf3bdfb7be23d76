"""Compiled laws outside of loops: energies of many states of a chain or a network in one call, and
searches along the law of a spring; see `energies.c`."""

from __future__ import annotations

import ctypes
import math
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.engine import codegen, geometry
from tensegrity.engine.bonds import KINDS, integers
from tensegrity.engine.compiled import Compiled
from tensegrity.engine.disk_cache import cached
from tensegrity.engine.law import named
from tensegrity.engine.native import address, concatenated, library, pointer, structure
from tensegrity.once import once

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from typing import Any

    from tensegrity.engine.bonds import Contacts
    from tensegrity.typing import Array, Flags, Indices

    Set = tuple[Compiled, Array, Array, Indices, Indices]

FLOAT = np.dtype(float)
FINITE = 2  # what `largest` returns of finite numbers

BOND_SET = structure("energies.c", "bond_set")
SPRINGS = structure("energies.c", "springs")
SEARCH_GRID = structure("energies.c", "search_grid")
PART = 1024  # contacts of a network whose intermediate results stay in the cache
PLACES = structure("elongations.c", "places")


@once
def _compiled() -> Any:
    return library(concatenated(["prelude.c", "energies.c"]), ["-ffp-contract=off"])


@once
def _elongations(dim: int, law: Any) -> list[int | None]:
    """Addresses of the functions for each kind of contact; the library is never unloaded."""
    laws = (law,) * (law is not None)
    flags = ["#define ENDS"] * len(laws)
    given: tuple[Any, ...] = laws, (None,) * len(laws), (), dim, flags, {}, {}, ["elongations.c"]
    text = cached(named("elongations", laws, dim), lambda: codegen.whole(*given))
    functions = library(text, [f"-DDIM={dim}"])
    return [pointer(functions[f"{kind}_elongations"]) for kind in KINDS]


class Energies:
    """Total energies of states, with the bonds in sets that one compiled function evaluates; for
    one thread, as its work space is.

    Parameters
    ----------
    mass : ndarray, shape of a state, or of a network (sites,)
        [kg]
    sets : sequence of (Compiled, ndarray, ndarray, ndarray, ndarray)
        Loop of a law; parameters, (parameters, springs), and domain [m], (2, springs), of different
        springs; the spring of each bond, (bonds,), where there are several; numbers of the bonds,
        increasing.
    contacts : Contacts, optional
        For a network; the bonds of a chain join neighbours.
    """

    def __init__(self, mass: Array, sets: Sequence[Set], contacts: Contacts | None = None) -> None:
        self._shape = mass.shape if contacts is None else contacts.load.shape
        self._function, size = _compiled().energies, math.prod(self._shape)
        parts = sets if contacts is None else _of_contacts(sets, contacts)
        rows = [_bond_set(*part, contacts) for part in parts]
        each, bonds = (BOND_SET * len(rows))(*rows), sum(len(columns) for *_, columns in sets)
        most = max((row.most for row in rows), default=0)
        mass, loads = np.ascontiguousarray(mass), None
        if contacts is not None and contacts.load.any():
            loads = np.ascontiguousarray(contacts.load)
        self._held = rows, each, mass, loads  # referenced as long as C may read them
        given = ctypes.addressof(each), len(rows), bonds, address(mass), size // max(mass.size, 1)
        self._given = *given, None if loads is None else address(loads), size
        own = max((row.own for row in rows), default=0)  # parameters of each bond
        self._scratch = np.empty(bonds + max(size, most) + own * most)
        self._scratch_at = address(self._scratch)

    def __call__(self, u: Array, v: Array) -> Array | None:
        """Total energies [J] of states u and v, (..., *shape of a state), the potential of loads
        included; None where an elongation is outside its domain, or the arrays are not
        C-contiguous arrays of float64."""
        shape, own = u.shape, len(self._shape)
        fit = shape == v.shape and shape[-own:] == self._shape and u.dtype == v.dtype == FLOAT
        if not (fit and u.flags.c_contiguous and v.flags.c_contiguous):
            return None
        energies = np.empty(shape[:-own])
        pointers = address(u), address(v), self._scratch_at, address(energies)
        if not self._function(*self._given, energies.size, *pointers):
            return None
        return energies


def _bond_set(
    loop: Compiled, parameters: Array, domain: Array, springs: Indices, columns: Indices,
    contacts: Contacts | None,
) -> Any:  # fmt: skip
    """The structure `bond_set` of C for a set."""
    own, different = parameters.shape
    several, (low, high) = different > 1, np.ascontiguousarray(domain)
    if several and np.all(springs == springs[0]):  # of several springs, only one occurs here
        low, high, different = low[springs[:1]], high[springs[:1]], 1
        parameters = parameters[:, springs[:1]]
    first, last = (columns[0], columns[-1] + 1) if len(columns) else (0, 0)
    in_a_row = last - first == len(columns)
    elongations = places = None
    if contacts is not None:
        elongations = _elongations(contacts.load.shape[1], geometry.own(loop.laws))[
            contacts.kind[columns][0]
        ]
        places = _places(contacts, slice(first, last) if in_a_row else columns)
        if geometry.own(loop.laws):
            of_each = np.ascontiguousarray(springs, dtype=np.int32) if different > 1 else None
            places.fill(parameters=np.ascontiguousarray(parameters.T), spring=of_each)
    return BOND_SET(
        function=pointer(loop.evaluator.values_own if several else loop.evaluator.values),
        elongations=elongations,
        parameters=loop.numbers(parameters),
        low=low,
        high=high,
        members=None if in_a_row else integers(columns),
        places=places,
        spring=np.ascontiguousarray(springs, dtype=np.int32) if different > 1 else None,
        different=different,
        own=own if several else 0,
        most=len(columns) if contacts is None else min(PART, len(columns)),
        count=len(columns),
        start=first,
    )


def _places(contacts: Contacts, columns: slice | Indices) -> Any:
    """The structure `places` of C for the contacts of a set; views of the network's arrays where
    possible."""
    gap, length = contacts.gap[columns], contacts.length[columns]
    return PLACES(
        first=np.ascontiguousarray(contacts.first[columns], dtype=np.int32),
        second=np.ascontiguousarray(contacts.second[columns], dtype=np.int32),
        at=contacts.places,
        gap=gap,
        length=length,
        gap_step=gap.strides[0] // gap.itemsize,
        length_step=length.strides[0] // length.itemsize,
        parameters=None,
        spring=None,
    )


def _of_contacts(sets: Sequence[Set], contacts: Contacts) -> Iterator[Set]:
    """Sets of contacts of one kind."""
    for loop, parameters, domain, springs, columns in sets:
        for kind in range(len(KINDS)):
            mine = np.flatnonzero(contacts.kind[columns] == kind)
            if len(mine):
                yield loop, parameters, domain, springs[mine], columns[mine]


class SearchPoints:
    """Points at which a law is sampled in a search from elongation 0, as fractions of a range.

    Each pass samples the interval in which the pass before it located the result.

    Parameters
    ----------
    to_end : sequence of ndarray
        Fractions of the range up to an end of the domain, for each pass.
    sizes : ndarray
        Sizes of the elongation [m] where the domain is unbounded.
    to_size : sequence of ndarray
        Fractions of the range up to one of these, for each pass.
    """

    def __init__(self, to_end: Sequence[Array], sizes: Array, to_size: Sequence[Array]) -> None:
        self.to_end, self.sizes, self.to_size = to_end, sizes, to_size
        self._each = [_fraction_table(looks) for looks in (to_end, [sizes], to_size)]
        self._fraction_table = (SEARCH_GRID * 3)(*self._each)
        self.address = ctypes.addressof(self._fraction_table)


def _fraction_table(fractions: Sequence[Array]) -> Any:
    begins = np.cumsum([0, *map(len, fractions)], dtype=np.int64)
    return SEARCH_GRID(fractions=np.concatenate(fractions), begins=begins, count=len(fractions))


class Search:
    """Searches along the compiled laws of different springs.

    Parameters
    ----------
    loops : sequence of Compiled
        Loop of the law of each spring.
    parameters : ndarray, (springs, width)
        Parameters of each spring, padded to a common width.
    domains : ndarray, (springs, 2)
        Smallest and largest elongation [m].
    """

    def __init__(self, loops: Sequence[Compiled], parameters: Array, domains: Array) -> None:
        functions = [pointer(loop.evaluator.values) for loop in loops]
        self._springs = SPRINGS(
            functions=np.array(functions, dtype=np.uint64),
            parameters=np.ascontiguousarray(parameters),
            domains=np.ascontiguousarray(domains),
            width=parameters.shape[1],
        )
        self._address = ctypes.addressof(self._springs)
        self._library = _compiled()

    def reachable(self, energy: float, ways: SearchPoints) -> tuple[Array, Flags]:
        """Elongations that each spring can reach with an energy [J], (springs, 2) [m], and whether
        these include an end of its domain, (springs,)."""
        count = len(self._springs.filled["functions"])
        ranges, locks = np.empty((count, 2)), np.empty(count, dtype=bool)
        outputs = address(ranges), address(locks)
        self._library.reachable(self._address, energy, count, ways.address, *outputs)
        return ranges, locks

    def largest(
        self, order: int, ranges: Array, numbers: Indices | None, fractions: Array
    ) -> tuple[Array, bool] | None:
        """Largest absolute tension or largest stiffness of springs over ranges of elongation.

        Parameters
        ----------
        order : {1, 2}
            1 for the tension [N], 2 for the stiffness [N/m].
        ranges : ndarray, (numbers, 2)
            Smallest and largest elongation [m], on either side of 0.
        numbers : ndarray of int, or None
            Indices of the springs; all by default.
        fractions : ndarray
            Points at which each side of a range is sampled.

        Returns
        -------
        (ndarray, bool), or None
            Values of at least 0, (numbers,), NaN where a sample is NaN, and whether all are finite;
            None where a range is not inside the domain.
        """
        out, ranges, which = np.empty(len(ranges)), np.ascontiguousarray(ranges), None
        if numbers is not None:
            numbers = np.ascontiguousarray(numbers, dtype=np.int64)
            which = address(numbers)
        given = which, address(ranges), address(fractions), len(fractions), address(out)
        status = self._library.largest(self._address, order, len(ranges), *given)
        return (out, status == FINITE) if status else None
