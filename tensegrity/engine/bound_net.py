"""A network bound to a compiled loop: its contacts laid out as the loop takes them."""

from __future__ import annotations

import ctypes
from dataclasses import replace
from itertools import pairwise

import numpy as np

from tensegrity.engine.bonds import GROUP, WALL, by_spring
from tensegrity.engine.bound import Bound, integers, stages
from tensegrity.engine.slices import slices
from tensegrity.engine.structs import structure

NET = structure("net.h", "scene")
LINE = 8  # numbers in a line of a cache
ROW = 1, 1, 2, 4  # numbers in a site's row of forces, by coordinates: as in lanes.c


class BoundNet(Bound):
    """A network advanced in place; rows of u and v are sites, walls, and a spare one.

    Parameters
    ----------
    pieces : int, optional
        Parts of about equal work, each to be advanced by a thread of its own: see `part`.
    """

    def __init__(self, loop, u, v, bonds, method, dt, pieces=1):
        if loop not in bonds.laid:
            bonds.laid[loop] = self._lay(loop, bonds)
        self._loop = loop
        found, entries, fixed = bonds.laid[loop]
        contacts, dim, sites = bonds.contacts, loop.dim, fixed["sites"]
        self._set_ranges(bonds, entries, pieces, loop.dtype)
        self._travel = np.zeros(1, dtype=loop.dtype)
        scratch = {
            "near": np.zeros((2, u.size) if pieces > 1 else 0, dtype=loop.dtype),
            "pull": _pulls(contacts.load, pieces, loop),
            "press": np.zeros_like(fixed["normal"]),
            "force": np.zeros((contacts.rows - sites, dim), dtype=loop.dtype),
            "farthest": np.zeros(pieces, dtype=loop.dtype),
            "gate": np.zeros(16, dtype=np.int64),
        }
        met = {"low": self._low, "high": self._high, "met_at": self._met_at}
        fields = fixed | scratch | met | stages(method, 1.0, loop.dtype)

        def piece(a, b, number, of):
            cut = {"tile": a, "last_tile": b, "before": found.needed[a], "reach": found.reach[b]}
            return NET(u=u, v=v, travel=self._travel, piece=number, pieces=of, **cut, **fields)

        cuts = found.shares(pieces)
        self._pieces = [piece(a, b, k, pieces) for k, (a, b) in enumerate(pairwise(cuts))]
        whole = piece(0, found.tiles, 0, 1)
        walls = dim * (contacts.rows - 1 - sites)
        self._set_steps(loop, whole, bonds, method, dt, dim * sites, walls, bonds.runs.source)
        self.forget_range()

    def _lay(self, loop, bonds):
        """What does not depend on the motion and the method: kept for the next time."""
        runs, contacts, found = bonds.runs, bonds.contacts, slices(bonds)
        source, dim, sites = runs.source, loop.dim, len(contacts.load)
        real = source >= 0
        filled, spare = np.where(real, source, 0), contacts.rows - 1
        place = np.zeros((dim + 2, len(source)))
        place[0], place[-1] = 1, 1  # a bond of length 1 m at rest, between the spare row and itself
        place[:, real] = contacts.geometry[:, source[real]]
        entries = replace(runs, source=source[found.contact], first=found.first)
        places = np.zeros((contacts.rows + 1, dim))
        places[:sites] = contacts.positions
        gap, gap_at, gap_each = _varying(place[dim, found.contact], found.first)
        length, length_at, length_each = _varying(place[-1, found.contact], found.first)
        normal, normal_at, pressing, pressed = _by_wall(bonds, found, place[:dim])
        numbers = {
            "w": contacts.weights(bonds.inverse_mass),
            "load": contacts.loads(),
            "geometry": place,
            "places": places,
            "gap": gap,
            "length": length,
            "normal": normal,
        }
        where = {
            "from": dim * np.where(real, contacts.first[filled], spare),
            "to": dim * np.where(real, contacts.second[filled], spare),
            "first": runs.first,
            "law": 4 * runs.law + 2 * runs.kind + runs.own,
            "slice": found.slice,
            "begin": found.begin,
            "entry": found.first,
            "gap_at": gap_at,
            "gap_each": gap_each,
            "length_at": length_at,
            "length_each": length_each,
            "normal_at": normal_at,
            "pressing": pressing,
            "pressed": pressed,
        }
        fixed = {
            **loop.parameters(bonds, entries),
            **{name: loop.numbers(x) for name, x in numbers.items()},
            **{name: integers(x) for name, x in where.items()},
            "site": found.site.astype(np.int32),
            "other": found.other.astype(np.int32),
            "counts": np.packbits(found.counts, bitorder="little"),
            "runs": len(runs.law),
            "contacts": len(source),
            "sites": sites,
            "rows": contacts.rows,
            "tiles": found.tiles,
            "loaded": bool(contacts.load.any()),
        }
        return found, entries, fixed

    def part(self, number, steps, opened):
        """Advance one of the pieces, at the same time as all others; as `advance_open`."""
        self._loop.advance_together(ctypes.addressof(self._pieces[number]), steps, opened)

    def _set_ranges(self, bonds, entries, pieces, dtype):
        """Places of the elongations met: of the runs for each piece, then of entries told apart."""
        runs = len(entries.law)
        together = pieces * runs * GROUP
        sizes = np.where(entries.own, np.diff(entries.first), 0)
        apart = together + np.cumsum(sizes) - sizes
        self._met_at = integers(np.where(entries.own, apart, GROUP * np.arange(runs)))
        self._low, self._high = np.empty((2, together + sizes.sum()), dtype=dtype)
        first = bonds.group[entries.source[entries.first[:-1]]]
        told = [
            bonds.group[entries.source[slice(*entries.first[k : k + 2])]]
            for k in np.flatnonzero(entries.own)
        ]
        self._group = np.concatenate([np.tile(np.repeat(first, GROUP), pieces), *told])
        self.springs = len(bonds.law)

    def forget_range(self):
        """Start anew to record elongations and the way travelled."""
        self._low[:], self._high[:] = np.inf, -np.inf
        self._travel[:] = 0

    @property
    def range(self):
        return by_spring(self._group, self.springs, self._low, self._high)


def _by_wall(bonds, found, normal):
    """Contacts with walls as the loop takes them.

    Normals of the groups of each run with walls, and where these begin; where among these the
    contacts are, wall by wall and else in the order of the list, and where those with each wall
    begin.
    """
    runs, contacts = bonds.runs, bonds.contacts
    dim, kept, at, places, walls = len(normal), [np.zeros(0)], [], [], []
    for k, kind in enumerate(runs.kind):
        at.append(sum(map(len, kept)))
        if kind == WALL:
            part = slice(*found.first[k : k + 2])
            entries, counting = found.contact[part], np.flatnonzero(found.counts[part])
            groups = normal[:, entries].reshape(dim, -1, GROUP)
            kept.append(groups.swapaxes(0, 1).ravel())
            order = counting[np.argsort(entries[counting])]
            places.append(at[-1] + order // GROUP * GROUP * dim + order % GROUP)
            walls.append(found.other[part][order])
    places, walls = (np.concatenate([np.zeros(0, dtype=int), *x]) for x in (places, walls))
    order = np.argsort(walls, kind="stable")
    begin = np.searchsorted(walls[order], np.arange(len(contacts.load), contacts.rows + 1))
    return np.concatenate(kept), at, places[order], begin


def _pulls(load, pieces, loop):
    """Rows of forces of each piece, which begin with the constant ones; none of them is in two
    lines of a cache."""
    size = pieces * len(load) * ROW[loop.dim]
    room = np.zeros(size + LINE, dtype=loop.dtype)
    found = room[-room.ctypes.data // room.itemsize % LINE :][:size]
    found.reshape(pieces, len(load), -1)[..., : loop.dim] = load
    return found


def _varying(values, first):
    """Values of the entries of each run, or `GROUP` equal ones; where these begin, and which."""
    kept, at, each = [np.zeros(0)], [], []
    for start, stop in pairwise(first):
        part = values[start:stop]
        each.append(bool(np.any(part != part[0])))
        at.append(sum(map(len, kept)))
        kept.append(part if each[-1] else part[:GROUP])
    return np.concatenate(kept), at, each
