"""Layout of bonds for compiled loops: of a chain in runs, of a network in slices.

In a network a slice holds `GROUP` sites, one for each SIMD lane, and groups of their contacts with
sites of higher numbers, or with walls: each group has at most one contact for each lane.  The force
of a contact on its other site is added to the row of that site immediately, group by group and
within a group lane by lane.

Listed contacts without overlap add nothing, and do not change the order of any sum: where the list
changes during a run, `Contacts.crowding` decides which sites form a slice, and among the contacts
with one other site, those of higher lanes do not precede those of lower ones.  Where a lane has to
wait, or has no contact left, its place repeats another contact of its site, or of the slice, which
does not count.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from tensegrity.engine import geometry
from tensegrity.engine.bonds import (
    BLOCK,
    GROUP,
    PAIR,
    WALL,
    Runs,
    integers,
    of_cables,
    parameters,
    segments,
    springs_of_places,
)
from tensegrity.engine.native import aligned_copy

TILE = 256  # sites, as in scene.h
TILES = 64  # whose layout is computed at once
PART = 2**16  # contacts whose tiles are found at once
GUESSES = 3


class LoopLayout(NamedTuple):
    """The data of a loop that depend neither on the state nor on the method.

    Attributes
    ----------
    runs : Runs
        Places for which the loop has parameters.
    springs : ndarray of int
        The spring of each place where the loop notes elongations.
    fields : dict of str
        Fields of the structure `scene` of the loop.
    slices : Slices or None
        Slices of a network.
    """

    runs: Runs
    springs: np.ndarray
    fields: dict[str, Any]
    slices: Any = None


def loop_layout(loop, bonds, pieces=1, runs=None):
    """The layout of bonds for a loop, cached unless it is made for other runs.

    Parameters
    ----------
    loop : Compiled
    bonds : Bonds
    pieces : int, optional
        Number of threads of a network.
    runs : Runs, optional
        Part of the runs of a chain.

    Returns
    -------
    LoopLayout
    """
    if runs is not None:
        return _line(loop, bonds, runs)
    if (loop, pieces) not in bonds.layouts:
        prepared = _net(loop, bonds, pieces) if loop.dim else _line(loop, bonds, bonds.runs)
        bonds.layouts[loop, pieces] = prepared
    return bonds.layouts[loop, pieces]


def _line(loop, bonds, runs):
    weights = np.asarray(bonds.inverse_mass)
    if bonds.stretch is not None:
        weights = np.append(weights, 0.0)  # of the image of the first site
    if loop.batch > 1 and weights.ndim == 1:
        weights = np.repeat(weights, loop.batch)
    where = {"first": runs.first - runs.first[0], "law": 2 * runs.law + runs.own}
    stretch = None if bonds.stretch is None else loop.numbers([bonds.stretch])
    return _with_parameters(loop, bonds, runs, {"w": weights} | where, stretch=stretch)


def _with_parameters(loop, bonds, runs, fields, pieces=1, slices=None, **more):
    """The layout with the parameters of runs, and the places where elongations are noted."""
    range_at, springs = elongations(bonds, runs, loop.batch, pieces)
    fields |= parameters(bonds, runs, loop.own, loop.batch) | {"range_at": range_at}
    for name, values in fields.items():
        is_real = np.asarray(values).dtype.kind == "f"
        more[name] = loop.numbers(values) if is_real else integers(values)
        if is_real and loop.batch > 1:
            more[name] = aligned_copy(more[name])
    return LoopLayout(runs, springs, more | {"runs": len(runs.law)}, slices)


def elongations(bonds, runs, batch=1, pieces=1):
    """Places at which a loop notes elongation ranges, or those of coordinates; see `Bonds.noted`.

    There is one for each bond with parameters of its own, see `springs_of_places`; a run of other
    bonds has one for each place of a block, or in a network for each SIMD lane of each thread.

    Parameters
    ----------
    bonds : Bonds
    runs : Runs
    batch : int, optional
        Number of scenes.
    pieces : int, optional
        Number of threads of a network.

    Returns
    -------
    range_at : ndarray of int64, (runs + 1,)
        First place of each run.
    springs : ndarray of int, (places,)
        The spring or the coordinate of each place.
    """
    at, springs = [0], [np.zeros(0, dtype=int)]
    if geometry.own(bonds.laws):
        each = np.tile(np.repeat(np.arange(bonds.dim), GROUP), pieces)
        return len(each) * np.arange(len(runs.own) + 1), np.tile(each, len(runs.own))
    most = pieces * GROUP if bonds.contacts is not None else BLOCK
    for k, own in enumerate(runs.own):
        group = springs_of_places(bonds, runs, k, batch)
        count = most if bonds.contacts is not None else min(most, len(group))
        springs.append(group if own else np.full(count, group[0]))
        at.append(at[-1] + springs[-1].size)
    return np.array(at, dtype=np.int64), np.concatenate(springs)


def _net(loop, bonds, pieces):
    runs, contacts, sliced = bonds.runs, bonds.contacts, slices(bonds)
    listed = runs.source[sliced.contact]
    entries = replace(runs, source=listed.astype(np.int32), first=sliced.first)
    dim, sites = bonds.dim, len(contacts.load)
    w = np.zeros((contacts.rows + 1, dim))
    w[:sites] = bonds.inverse_mass.reshape(sites, -1)
    w[sites : contacts.rows - 1] = 1  # velocities of walls: impulses
    loaded = bool(contacts.load.any())
    fields = {
        "w": w,
        "load": contacts.load if loaded else np.zeros(0),
        "places": contacts.places,
        "first": runs.first,
        "law": 4 * runs.law + 2 * runs.kind + runs.own,
        "slice": sliced.slice,
        "begin": sliced.begin,
        "entry": sliced.first,
        "beside": sliced.beside,
        "beside_at": sliced.beside_at,
    } | coupling(bonds)
    fields |= of_cables(bonds, listed)
    fields |= _varying("gap", contacts.gap[listed], sliced.first)
    fields |= _varying("length", contacts.length[listed], sliced.first)
    fields |= _by_wall(bonds, sliced)
    more = {
        "site": sliced.site.astype(np.int32),
        "other": sliced.other.astype(np.int32),
        "counts": np.packbits(sliced.counts, bitorder="little"),
        "contacts": len(runs.source),
        "sites": sites,
        "rows": contacts.rows,
        "tiles": sliced.tiles,
        "loaded": loaded,
        "couplings": 0 if bonds.coupling is None else len(bonds.coupling.target),
        "cables": 0 if bonds.cable is None else int(bonds.cable.max()) + 1,
        "strand": contacts.ends_of(segments(bonds)).astype(np.int32),
        **dict.fromkeys(("geometry", "from", "to")),  # see `of_contacts`
        "stretch": None,
    }
    sliced = replace(sliced, contact=None, other=None, counts=None)
    made = _with_parameters(loop, bonds, entries, fields, pieces, sliced, **more)
    return made._replace(runs=runs)


def coupling(bonds):
    """Fields with the row operations of bonds with mass; see `inertia.RowOperations`."""
    of = bonds.coupling
    if of is None:
        return {"coupled": np.zeros(0, dtype=int), "coupling": np.zeros(0)}
    return {"coupled": np.stack([of.target, of.source], axis=1), "coupling": of.factor}


def of_contacts(loop, bonds):
    """Fields of a network that only some methods need: geometry and ends of all contacts, and a
    group of zeros."""
    contacts, source, none = bonds.contacts, bonds.runs.source, np.zeros(GROUP, np.int32)
    return {
        "geometry": loop.numbers(np.append(contacts.geometry_of(source), none)),
        "from": np.append(contacts.first[source] * bonds.dim, none),
        "to": np.append(contacts.second[source] * bonds.dim, none),
    }


def _by_wall(bonds, sliced):
    """Fields for contacts with walls.

    Normals of the groups of each run with walls, and where these begin; the place of each contact
    among them, sorted by wall and then in the order of the list, and the first one of each wall.
    """
    runs, contacts = bonds.runs, bonds.contacts
    dim, blocks, at, places, walls = bonds.dim, [np.zeros(0)], [], [], []
    for k, kind in enumerate(runs.kind):
        at.append(sum(map(len, blocks)))
        if kind == WALL:
            part = slice(*sliced.first[k : k + 2])
            entries, counting = sliced.contact[part], np.flatnonzero(sliced.counts[part])
            normal = contacts.places[contacts.first[runs.source[entries]]].T
            groups = normal.reshape(dim, -1, GROUP)
            blocks.append(groups.swapaxes(0, 1).ravel())
            order = counting[np.argsort(entries[counting])]
            places.append(at[-1] + order // GROUP * GROUP * dim + order % GROUP)
            walls.append(sliced.other[part][order])
    places, walls = (np.concatenate([np.zeros(0, dtype=int), *x]) for x in (places, walls))
    order = np.argsort(walls, kind="stable")
    begin = np.searchsorted(walls[order], np.arange(len(contacts.load), contacts.rows + 1))
    normal = {"normal": np.concatenate(blocks), "normal_at": np.array(at, dtype=int)}
    return normal | {"pressing": places[order], "pressed": begin}


def _varying(name, values, first):
    """Values of the entries of each run, or `GROUP` equal ones; where these begin, and which of
    the two they are."""
    blocks, at, each = [np.zeros(0)], [], []
    for start, stop in pairwise(first):
        part = values[start:stop]
        each.append(bool(np.any(part != part[0])))
        at.append(sum(map(len, blocks)))
        blocks.append(part if each[-1] else part[:GROUP])
    arrays = {"": np.concatenate(blocks), "_at": np.array(at, int), "_each": np.array(each, int)}
    return {name + ending: x for ending, x in arrays.items()}


@dataclass(frozen=True, eq=False)
class Slices:
    """The slices of all runs of a network; an entry is a place in a group.

    Attributes
    ----------
    slice : ndarray of int, (runs, tiles + 1)
        First slice of a run in each tile.
    site : ndarray of int, (slices, GROUP)
        Sites of each slice.
    begin : ndarray of int, (slices + 1,)
        First group of each slice.
    contact, other : ndarray of int, (groups * GROUP,)
        Place of the contact of each entry in the list, and the row of the other site.
    counts : ndarray of bool, (groups * GROUP,)
        False for repetitions, which do not count.
    first : ndarray of int, (runs + 1,)
        First entry of each run.
    needed, reach : ndarray of int, (tiles + 1,)
        The first tile with a contact of a site in this tile or a later one; the tile after the last
        one with a contact of a site before this tile.
    beside, beside_at : ndarray of int, (pairs,), (tiles + 1,)
        For each tile the tiles with contacts with it, itself included, and where these begin.
    """

    slice: np.ndarray
    site: np.ndarray
    begin: np.ndarray
    contact: np.ndarray
    other: np.ndarray
    counts: np.ndarray
    first: np.ndarray
    needed: np.ndarray
    reach: np.ndarray
    beside: np.ndarray
    beside_at: np.ndarray

    @property
    def tiles(self):
        return len(self.needed) - 1

    def balanced_cuts(self, pieces):
        """Tiles at which so many parts of about equal work begin and end; (pieces + 1,)."""
        groups = np.append(0, np.cumsum(np.diff(self.begin[self.slice], axis=1).sum(axis=0)))
        done = groups + TILE / GROUP * np.arange(self.tiles + 1)
        cuts = np.zeros(pieces, dtype=int)
        for _ in range(GUESSES):  # of the work that two parts do
            twice = np.cumsum(groups[cuts] - groups[self.needed[cuts]])
            even = (done[-1] + twice[-1]) * np.arange(pieces) / pieces
            wanted = np.maximum.accumulate(even[1:] - twice[:-1])
            cuts[1:] = np.searchsorted(done[:-1], wanted)
        return np.append(cuts, self.tiles)


def slices(bonds):
    """The slices of the bonds of a network."""
    runs, contacts = bonds.runs, bonds.contacts
    tiles, parts, first_of, begun, groups = -(-len(contacts.load) // TILE), [], [], 0, 0
    empty = [(np.zeros(0, dtype=int),) * 2 + (False,)]  # for arrays of the right kinds
    for members, places, pairs in [
        (runs.members(k), np.arange(*runs.first[k : k + 2], dtype=np.int32), runs.kind[k] == PAIR)
        for k in range(len(runs.law))
    ] or empty:
        first = []
        for some, tile, count in _parts(contacts, members, pairs, tiles):
            part = _part(contacts, members[some], places[some], pairs, tile, count)
            first.append(part["slice"][: count + (tile + count == tiles)] + begun)
            part["begin"] += groups
            parts.append(part)
            begun, groups = begun + len(part["site"]), part["begin"][-1]
        first_of.append(np.concatenate(first))
    joined = {
        name: np.concatenate([part[name] for part in parts])
        for name in ("site", "contact", "other", "counts")
    }
    begin = np.concatenate([*(part["begin"][:-1] for part in parts), [groups]])
    table = np.array(first_of)
    first = GROUP * begin[np.append(table[: len(runs.law), 0], begun)]
    return Slices(slice=table, begin=begin, first=first, **joined, **_ends(contacts, tiles))


def _own_and_other(contacts, members, pairs):
    """The site of each contact by which it is sorted, and the row of its other end."""
    ends = contacts.first[members], contacts.second[members]
    return (np.minimum(*ends), np.maximum(*ends)) if pairs else ends[::-1]


def _parts(contacts, members, pairs, tiles):
    """Contacts `members` of a run in parts, which bound the memory of the layout: the contacts of
    some tiles, the first of these, and their number."""
    part = _own_and_other(contacts, members, pairs)[0] // (TILE * TILES)
    order = None
    if np.any(part[1:] < part[:-1]):
        order = np.argsort(part, kind="stable")
        part = part[order]
    for k in range(0, max(tiles, 1), TILES):
        some = slice(*np.searchsorted(part, [k // TILES, k // TILES + 1]))
        yield some if order is None else order[some], k, min(TILES, tiles - k)


def _part(contacts, members, places, pairs, tile, tiles):
    """Some tiles of a run, numbered from 0: contacts `members` at `places` of the list."""
    own, other = _own_and_other(contacts, members, pairs)
    begin = TILE * tile
    crowding = contacts.crowding if pairs else None
    if crowding is not None:
        crowding = crowding[begin : begin + TILE * tiles]
    first, at = _slice_places(own - begin, crowding, tiles)
    order = np.argsort(at * contacts.rows - other, kind="stable")
    own, other, places, at = own[order], other[order], places[order], at[order]
    slot = _slots(at, other if pairs else None, contacts.rows)
    row, column = np.divmod(at, GROUP)
    depth = np.zeros(first[-1], dtype=int)
    np.maximum.at(depth, row, slot + 1)
    begin = np.concatenate([[0], np.cumsum(depth)])
    repeated = np.full((len(depth), GROUP), -1)
    repeated[row[::-1], column[::-1]] = np.arange(len(row))[::-1]
    spare = repeated.max(axis=1, keepdims=True)
    repeated = np.where(repeated < 0, spare, repeated)
    entry = np.repeat(repeated, depth, axis=0)
    counts = np.zeros(entry.shape, dtype=bool)
    at = begin[row] + slot, column
    entry[at], counts[at] = np.arange(len(row)), True
    entry = entry.ravel()
    return {
        "slice": first, "site": own[repeated], "begin": begin,
        "contact": places[entry], "other": other[entry], "counts": counts.ravel(),
    }  # fmt: skip


def _slice_places(own, crowding, tiles):
    """First slice of each tile, and the place (slice and lane) of each contact's own site.

    Within a tile, sites are sorted by their number of contacts.
    """
    sites, which, count = np.unique(own, return_inverse=True, return_counts=True)
    if crowding is not None:
        sites, which, count = np.arange(len(crowding)), own, crowding
    order = np.lexsort((-count, sites // TILE))
    per_tile = np.bincount(sites // TILE, minlength=tiles)
    starts = np.cumsum(per_tile) - per_tile
    first = np.concatenate([[0], np.cumsum(-(-per_tile // GROUP))])
    tile = sites[order] // TILE
    within = np.arange(len(sites)) - starts[tile]
    place = np.empty(len(sites), dtype=int)
    place[order] = GROUP * first[tile] + within
    at = place[which]
    used = np.zeros(first[-1] + 1, dtype=int)
    used[at // GROUP + 1] = 1
    slices_before = np.cumsum(used)
    return slices_before[first], GROUP * slices_before[at // GROUP] + at % GROUP


def _slots(at, other, rows):
    """The group of its slice for each contact; contacts are sorted by lane."""
    count = np.arange(len(at))
    by_column = _offsets_by_key(at) - count
    slot = np.maximum.accumulate(by_column) - by_column
    if other is None:
        return slot
    key = at // GROUP * rows + other
    together = np.argsort(key, kind="stable")
    of_other = _offsets_by_key(key[together])
    while True:
        before = slot
        slot = np.empty_like(before)
        slot[together] = np.maximum.accumulate(of_other + before[together]) - of_other
        slot = np.maximum.accumulate(by_column + slot) - by_column
        if np.array_equal(slot, before):
            return slot


def _offsets_by_key(key):
    """Offsets that separate the entries of different keys; they exceed all counts."""
    return 2 * len(key) * np.cumsum(np.diff(key, prepend=-1) != 0)


def _ends(contacts, tiles):
    """The tiles before and after each tile to which it has contacts; see `Slices`."""
    found = [np.arange(tiles) * (tiles + 1)]
    for k in range(0, len(contacts.kind), PART):
        pairs = np.flatnonzero(contacts.kind[k : k + PART] == PAIR) + k
        one, other = contacts.first[pairs] // TILE, contacts.second[pairs] // TILE
        found.append(np.unique(np.minimum(one, other) * np.int64(tiles) + np.maximum(one, other)))
    low, high = np.divmod(np.unique(np.concatenate(found)), tiles)
    lowest, highest = np.arange(tiles + 1), np.arange(tiles + 1)
    np.minimum.at(lowest, high, low)
    np.maximum.at(highest[1:], low, high + 1)
    both = np.concatenate([low * tiles + high, high * tiles + low])
    tile, beside = np.divmod(np.unique(both), tiles)
    return {
        "needed": np.minimum.accumulate(lowest[::-1])[::-1],
        "reach": np.maximum.accumulate(highest),
        "beside": beside,
        "beside_at": np.searchsorted(tile, np.arange(tiles + 1)),
    }
