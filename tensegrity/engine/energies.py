"""Energies of many states of a chain or a network in one call: see `energies.c`."""

from __future__ import annotations

import ctypes
import math
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.engine import geometry
from tensegrity.engine.bonds import KINDS
from tensegrity.engine.codegen import joined
from tensegrity.engine.compiled import Compiled, structure_of
from tensegrity.engine.kept import kept
from tensegrity.engine.native import address, library
from tensegrity.once import once

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from typing import Any

    from tensegrity.engine.bonds import Contacts
    from tensegrity.typing import Array, Indices

    Set = tuple[Compiled, Array, Array, Indices]

_ADDRESS, _NUMBER = ctypes.c_void_p, ctypes.c_longlong
EXACT = ("-ffp-contract=off",)
PART = 1024  # contacts of a network in a set: what lies between stays in the nearest cache

_Alike = structure_of(  # as in energies.c
    "_Alike",
    "function elongations parameters low high members places",
    "own count start",
)
_Places = structure_of("_Places", "first second geometry", "apart")  # as in elongations.c


@once
def _energies() -> Any:
    function = library(joined(["subnormal.c", "energies.c"]), EXACT).energies
    function.argtypes = [_ADDRESS, *[_NUMBER] * 2, *[_ADDRESS] * 2, *[_NUMBER] * 2, *[_ADDRESS] * 4]
    function.restype = _NUMBER
    return function


@once
def _elongations(dim: int) -> list[int | None]:
    """Addresses of the functions of each kind of contact; they stay where they are."""
    text = kept(("elongations", dim), lambda: geometry.text(dim, "elongations.c"))
    found = library(text, [f"-DDIM={dim}"])
    return [ctypes.cast(found[f"{kind}_elongations"], _ADDRESS).value for kind in KINDS]


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

    Attributes
    ----------
    task : tuple of int
        Address of the compiled function, and the first of what it takes.
    room : int
        Numbers that it needs to work in.
    """

    def __init__(self, mass: Array, sets: Sequence[Set], contacts: Contacts | None = None) -> None:
        self._shape, self._function = mass.shape, _energies()
        self._kept: list[Any] = []
        self._bonds = sum(len(columns) for *_, columns in sets)
        rows = list(_parts(sets, contacts))
        self._sets = (_Alike * len(rows))()
        for row, (loop, parameters, domain, columns) in zip(self._sets, rows, strict=True):
            self._fill(row, loop, parameters, domain, np.ascontiguousarray(columns, np.int64))
            if contacts is not None:
                self._place(row, contacts, _in_a_row(columns))
        self._numbers = [np.ascontiguousarray(mass)]
        if contacts is not None and contacts.load.any():
            self._numbers.append(np.ascontiguousarray(contacts.load))
        loads = self._numbers[1].ctypes.data if len(self._numbers) > 1 else None
        given = ctypes.addressof(self._sets), len(rows), self._bonds
        self._given = *given, self._numbers[0].ctypes.data, loads, mass.size
        self.task = ctypes.cast(self._function, _ADDRESS).value, *self._given
        self.room = self._bonds + max(mass.size, *(row.count for row in self._sets), 0)

    def _fill(
        self, row: Any, loop: Compiled, parameters: Array, domain: Array, columns: Indices
    ) -> None:
        own, apart = parameters.ndim == 2, not isinstance(_in_a_row(columns), slice)
        arrays = loop.numbers(loop.padded(parameters)), *np.ascontiguousarray(domain)
        self._kept += [loop, *arrays, columns if apart else None]
        row.function = ctypes.cast(loop.energies[own], _ADDRESS).value
        row.parameters, row.low, row.high = (x.ctypes.data for x in arrays)
        row.own, row.count, row.start = own, len(columns), columns[0] if len(columns) else 0
        row.members = columns.ctypes.data if apart else None

    def _place(self, row: Any, contacts: Contacts, columns: slice | Indices) -> None:
        """Where the contacts of a set are: views of the network's own arrays where may be."""
        first, second = (
            np.ascontiguousarray(x[columns], dtype=np.int64)
            for x in (contacts.first, contacts.second)
        )
        places = contacts.geometry[:, columns]
        if not isinstance(columns, slice):
            places = np.ascontiguousarray(places)
        where = first.ctypes.data, second.ctypes.data, places.ctypes.data
        found = _Places(*where, places.strides[0] // places.itemsize)
        self._kept += [first, second, places, found]
        kind = contacts.kind[columns][0]
        row.elongations = _elongations(contacts.load.shape[1])[kind]
        row.places = ctypes.addressof(found)

    def __call__(self, u: Array, v: Array) -> Array | None:
        """Total energies [J] of states u and v, (..., *shape of a state), the potential of loads
        included; None where an elongation is outside of its domain, or the arrays are not as a
        loop takes them."""
        axes = len(self._shape)
        fit = u.shape == v.shape and u.shape[u.ndim - axes :] == self._shape
        if not (fit and _fits(u) and _fits(v)):
            return None
        states = u.shape[: u.ndim - axes]
        count = math.prod(states)
        room = np.empty(self.room + count)  # to work in, and for what is found
        start = address(room)
        pointers = address(u), address(v), start, start + self.room * room.itemsize
        known = self._function(*self._given, count, *pointers)
        if not known:
            return None
        return room[self.room :].reshape(states).copy() if states else room[-1]


def _parts(sets: Sequence[Set], contacts: Contacts | None) -> Iterator[Set]:
    """Sets of contacts of one kind, few enough; those of a chain as they are."""
    for loop, parameters, domain, columns in sets:
        if contacts is None:
            yield loop, parameters, domain, columns
            continue
        for kind in range(len(KINDS)):
            mine = np.flatnonzero(contacts.kind[columns] == kind)
            for k in range(0, len(mine), PART):
                part = mine[k : k + PART]
                given = parameters, domain
                if parameters.ndim == 2:
                    given = parameters[:, part], domain[:, part]
                yield loop, *given, columns[part]


def _in_a_row(columns: Indices) -> slice | Indices:
    """Increasing numbers as a slice, where they are one."""
    first, last = (columns[0], columns[-1] + 1) if len(columns) else (0, 0)
    return slice(first, last) if last - first == len(columns) else columns


def _fits(x: Array) -> bool:
    return x.dtype == np.float64 and x.flags.c_contiguous
