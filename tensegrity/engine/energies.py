"""Energies of many states of a chain or a network in one call: see `energies.c`."""

from __future__ import annotations

import ctypes
import math
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.engine import geometry
from tensegrity.engine.bonds import KINDS
from tensegrity.engine.compiled import Compiled
from tensegrity.engine.kept import kept
from tensegrity.engine.native import address, joined, library, pointer
from tensegrity.engine.structs import structure
from tensegrity.once import once

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from typing import Any

    from tensegrity.engine.bonds import Contacts
    from tensegrity.typing import Array, Indices

    Set = tuple[Compiled, Array, Array, Indices]

EXACT = ("-ffp-contract=off",)
PART = 1024  # contacts of a network in a set: what lies between stays in the nearest cache

ALIKE = structure("energies.c", "alike")
PLACES = structure("elongations.c", "places")


@once
def _energies() -> Any:
    return library(joined(["prelude.c", "energies.c"]), EXACT).energies


@once
def _elongations(dim: int) -> list[int | None]:
    """Addresses of the functions of each kind of contact; they stay where they are."""
    text = kept(("elongations", dim), lambda: geometry.text(dim, "elongations.c"))
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

    Attributes
    ----------
    told : dict of str
        Fields of `told` in walk.c: the compiled function, and the first of what it takes.
    room : int
        Numbers that it needs to work in.
    """

    def __init__(self, mass: Array, sets: Sequence[Set], contacts: Contacts | None = None) -> None:
        self._shape, self._function = mass.shape, _energies()
        self._bonds = sum(len(columns) for *_, columns in sets)
        self._rows = [_alike(*part, contacts) for part in _parts(sets, contacts)]
        self._sets = (ALIKE * len(self._rows))(*self._rows)
        self._mass, self._loads = np.ascontiguousarray(mass), None
        if contacts is not None and contacts.load.any():
            self._loads = np.ascontiguousarray(contacts.load)
        self.told = {
            "function": pointer(self._function),
            "sets": ctypes.addressof(self._sets),
            "count": len(self._rows),
            "all": self._bonds,
            "mass": self._mass,
            "loads": self._loads,
            "entries": mass.size,
        }
        given = ctypes.addressof(self._sets), len(self._rows), self._bonds
        loads = None if self._loads is None else address(self._loads)
        self._given = *given, address(self._mass), loads, mass.size
        self.room = self._bonds + max(mass.size, *(row.count for row in self._rows), 0)

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


def _alike(
    loop: Compiled, parameters: Array, domain: Array, columns: Indices, contacts: Contacts | None
) -> Any:
    """A set as C takes it."""
    own, found = parameters.ndim == 2, _in_a_row(columns)
    low, high = np.ascontiguousarray(domain)
    elongations = places = None
    if contacts is not None:
        elongations = _elongations(contacts.load.shape[1])[contacts.kind[columns][0]]
        places = _places(contacts, found)
    return ALIKE(
        function=pointer(loop.library.energies_own if own else loop.library.energies),
        elongations=elongations,
        parameters=loop.numbers(loop.padded(parameters)),
        low=low,
        high=high,
        members=None if isinstance(found, slice) else np.ascontiguousarray(columns, np.int64),
        places=places,
        own=own,
        count=len(columns),
        start=columns[0] if len(columns) else 0,
    )


def _places(contacts: Contacts, columns: slice | Indices) -> Any:
    """Where the contacts of a set are: views of the network's own arrays where may be."""
    geometry = contacts.geometry[:, columns]
    if not isinstance(columns, slice):
        geometry = np.ascontiguousarray(geometry)
    return PLACES(
        first=np.ascontiguousarray(contacts.first[columns], dtype=np.int64),
        second=np.ascontiguousarray(contacts.second[columns], dtype=np.int64),
        geometry=geometry,
        apart=geometry.strides[0] // geometry.itemsize,
    )


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
