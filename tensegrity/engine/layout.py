"""Bonds laid out as compiled loops take them: of a chain in runs, of a network in slices.

In a network `GROUP` sites stand side by side in a slice, and their contacts with sites of higher
numbers, or with walls, one below the other in its groups.  What a contact does to its other site is
added to that one's row at once, group by group and in a group lane by lane.

Contacts that are listed but do not touch add nothing, and change no order either: which sites
share a slice is said by the scene (`Contacts.crowding`) where lists may come and go, and of the
contacts with one other site those of higher lanes do not come before those of lower ones.  A place
where a lane has to wait, or has no contact left, repeats another one of its site's, or of the
slice's; it does not count.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from tensegrity.engine.bonds import BLOCK, GROUP, PAIR, WALL, Runs, integers, parameters

TILE = 256  # sites, as in scene.h
GUESSES = 3


class Laid(NamedTuple):
    """What a loop takes that depends neither on the motion nor on the method.

    Attributes
    ----------
    runs : Runs
        Places for which the loop has parameters.
    springs : ndarray of int
        The spring of each place where it notes elongations.
    fields : dict of str
        Of the structure `scene` of the loop.
    slices : Slices or None
        Of a network.
    """

    runs: Runs
    springs: np.ndarray
    fields: dict[str, Any]
    slices: Any = None


def laid(loop, bonds, pieces=1, runs=None):
    """Bonds as a loop takes them, on some threads, or some runs of a chain: made once, if not of
    other runs than theirs."""
    if runs is not None:
        return _line(loop, bonds, runs)
    if (loop, pieces) not in bonds.laid:
        found = _net(loop, bonds, pieces) if loop.dim else _line(loop, bonds, bonds.runs)
        bonds.laid[loop, pieces] = found
    return bonds.laid[loop, pieces]


def _line(loop, bonds, runs):
    weights = np.asarray(bonds.inverse_mass)
    if loop.lanes > 1 and weights.ndim == 1:
        weights = np.repeat(weights, loop.lanes)
    where = {"first": runs.first - runs.first[0], "law": 2 * runs.law + runs.own}
    return _laid(loop, bonds, runs, {"w": weights} | where)


def _laid(loop, bonds, runs, fields, pieces=1, slices=None, **more):
    """With parameters of the places of runs, and where elongations are noted."""
    met_at, springs = elongations(bonds, runs, loop.lanes, pieces)
    fields |= parameters(bonds, runs, loop.own, loop.lanes) | {"met_at": met_at}
    for name, values in fields.items():
        is_real = np.asarray(values).dtype.kind == "f"
        more[name] = loop.numbers(values) if is_real else integers(values)
    return Laid(runs, springs, more | {"runs": len(runs.law)}, slices)


def elongations(bonds, runs, lanes=1, pieces=1):
    """Where a loop notes the elongations that it meets.

    For each bond of runs with parameters of their own; of other runs in as many places as are done
    side by side, of a network those of each piece.

    Returns
    -------
    met_at : ndarray of int64, (runs + 1,)
        Where those of a run begin.
    springs : ndarray of int, (places,)
        The spring of each.
    """
    at, springs = [0], [np.zeros(0, dtype=int)]
    most = pieces * GROUP if bonds.contacts is not None else BLOCK
    for k, own in enumerate(runs.own):
        group = bonds.group[runs.members(k)]
        if lanes > 1 and group.ndim == 1:
            group = np.repeat(group[:, None], lanes, axis=1)
        count = most if bonds.contacts is not None else min(most, lanes * len(group))
        springs.append(group.ravel() if own else np.full(count, group.flat[0]))
        at.append(at[-1] + springs[-1].size)
    return np.array(at, dtype=np.int64), np.concatenate(springs)


def _net(loop, bonds, pieces):
    runs, contacts, found = bonds.runs, bonds.contacts, slices(bonds)
    place = contacts.geometry[:, runs.source]
    entries = replace(runs, source=runs.source[found.contact], first=found.first)
    dim, sites = bonds.dim, len(contacts.load)
    places, w, load = np.zeros((3, contacts.rows + 1, dim))
    places[:sites], w[:sites] = contacts.positions, bonds.inverse_mass[:, None]
    load[:sites], w[sites : contacts.rows - 1] = contacts.load, 1  # velocities of walls: impulses
    fields = {
        "w": w,
        "load": load,
        "geometry": place,
        "places": places,
        "from": dim * contacts.first[runs.source],
        "to": dim * contacts.second[runs.source],
        "first": runs.first,
        "law": 4 * runs.law + 2 * runs.kind + runs.own,
        "slice": found.slice,
        "begin": found.begin,
        "entry": found.first,
    }
    fields |= _varying("gap", place[dim, found.contact], found.first)
    fields |= _varying("length", place[-1, found.contact], found.first)
    fields |= _by_wall(bonds, found, place[:dim])
    more = {
        "site": found.site.astype(np.int32),
        "other": found.other.astype(np.int32),
        "counts": np.packbits(found.counts, bitorder="little"),
        "contacts": len(runs.source),
        "sites": sites,
        "rows": contacts.rows,
        "tiles": found.tiles,
        "loaded": bool(contacts.load.any()),
    }
    return _laid(loop, bonds, entries, fields, pieces, found, **more)


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
    normal = {"normal": np.concatenate(kept), "normal_at": np.array(at, dtype=int)}
    return normal | {"pressing": places[order], "pressed": begin}


def _varying(name, values, first):
    """Values of the entries of each run, or `GROUP` equal ones; where these begin, and which."""
    kept, at, each = [np.zeros(0)], [], []
    for start, stop in pairwise(first):
        part = values[start:stop]
        each.append(bool(np.any(part != part[0])))
        at.append(sum(map(len, kept)))
        kept.append(part if each[-1] else part[:GROUP])
    found = {"": np.concatenate(kept), "_at": np.array(at, int), "_each": np.array(each, int)}
    return {name + ending: x for ending, x in found.items()}


@dataclass(frozen=True, eq=False)
class Slices:
    """All runs of a network; an entry is a place in a group.

    Attributes
    ----------
    slice : ndarray of int, (runs, tiles + 1)
        First slice of a run in each tile.
    site : ndarray of int, (slices, GROUP)
        Sites.
    begin : ndarray of int, (slices + 1,)
        First group of each slice.
    contact, other : ndarray of int, (groups * GROUP,)
        Place of the contact of each entry in the list, and the row that it joins the site to.
    counts : ndarray of bool, (groups * GROUP,)
        Whether it is one, and no repetition.
    first : ndarray of int, (runs + 1,)
        First entry of each run.
    needed, reach : ndarray of int, (tiles + 1,)
        The first tile with a contact of a site in this tile or behind it; behind the last tile
        with a contact of a site before this tile.
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

    @property
    def tiles(self):
        return len(self.needed) - 1

    def shares(self, pieces):
        """Tiles at which so many pieces of about equal work begin and end; (pieces + 1,)."""
        groups = np.append(0, np.cumsum(np.diff(self.begin[self.slice], axis=1).sum(axis=0)))
        done = groups + TILE / GROUP * np.arange(self.tiles + 1)
        cuts = np.zeros(pieces, dtype=int)
        for _ in range(GUESSES):  # of what is done twice
            twice = np.cumsum(groups[cuts] - groups[self.needed[cuts]])
            share = (done[-1] + twice[-1]) * np.arange(pieces) / pieces
            wanted = np.maximum.accumulate(share[1:] - twice[:-1])
            cuts[1:] = np.searchsorted(done[:-1], wanted)
        return np.append(cuts, self.tiles)


def slices(bonds):
    """The `Slices` of a network's `Bonds`."""
    runs, contacts = bonds.runs, bonds.contacts
    tiles = -(-len(contacts.load) // TILE)
    parts, begun, groups = [], 0, 0
    for k in range(len(runs.law)):
        places = np.arange(runs.first[k], runs.first[k + 1])
        part = _run(contacts, runs.members(k), places, runs.kind[k] == PAIR, tiles)
        part["slice"] += begun
        part["begin"] += groups
        parts.append(part)
        begun, groups = begun + len(part["site"]), part["begin"][-1]
    if not parts:  # as a run of nothing, which is none of the runs
        parts = [_run(contacts, *np.zeros((2, 0), dtype=int), False, tiles)]
    joined = {
        name: np.concatenate([part[name] for part in parts])
        for name in ("slice", "site", "contact", "other", "counts")
    }
    begin = np.concatenate([*(part["begin"][:-1] for part in parts), [groups]])
    first = GROUP * begin[np.append(joined["slice"][: len(runs.law), 0], begun)]
    return Slices(begin=begin, first=first, **joined, **_ends(contacts, tiles))


def _run(contacts, members, places, pairs, tiles):
    """One run, numbered from 0: contacts `members` at `places` of the list."""
    ends = contacts.first[members], contacts.second[members]
    own, other = (np.minimum(*ends), np.maximum(*ends)) if pairs else ends[::-1]
    first, at = _lanes(own, contacts.crowding if pairs else None, tiles)
    order = np.argsort(at * contacts.rows - other, kind="stable")
    own, other, places, at = own[order], other[order], places[order], at[order]
    slot = _slots(at, other if pairs else None, contacts.rows)
    row, lane = np.divmod(at, GROUP)
    depth = np.zeros(first[-1], dtype=int)
    np.maximum.at(depth, row, slot + 1)
    begin = np.concatenate([[0], np.cumsum(depth)])
    repeated = np.full((len(depth), GROUP), -1)
    repeated[row[::-1], lane[::-1]] = np.arange(len(row))[::-1]
    spare = repeated.max(axis=1, keepdims=True)
    repeated = np.where(repeated < 0, spare, repeated)
    entry = np.repeat(repeated, depth, axis=0)
    counts = np.zeros(entry.shape, dtype=bool)
    at = begin[row] + slot, lane
    entry[at], counts[at] = np.arange(len(row)), True
    entry = entry.ravel()
    return {
        "slice": first[None].copy(), "site": own[repeated], "begin": begin,
        "contact": places[entry], "other": other[entry], "counts": counts.ravel(),
    }  # fmt: skip


def _lanes(own, crowding, tiles):
    """First slice of each tile, and the lane of each contact's own site, counted through slices.

    Sites with about as many contacts as each other come together where their tile allows.
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
    """Which group of its slice each contact is in, those of a lane being in a row."""
    count = np.arange(len(at))
    of_lane = _offsets_by_key(at) - count
    slot = np.maximum.accumulate(of_lane) - of_lane
    if other is None:
        return slot
    key = at // GROUP * rows + other
    together = np.argsort(key, kind="stable")
    of_other = _offsets_by_key(key[together])
    while True:
        before = slot
        slot = np.empty_like(before)
        slot[together] = np.maximum.accumulate(of_other + before[together]) - of_other
        slot = np.maximum.accumulate(of_lane + slot) - of_lane
        if np.array_equal(slot, before):
            return slot


def _offsets_by_key(key):
    """Numbers that rise by more than anything counts wherever a sorted key changes."""
    return 2 * len(key) * np.cumsum(np.diff(key, prepend=-1) != 0)


def _ends(contacts, tiles):
    """How far back and forth the contacts of a tile go."""
    pairs = contacts.kind == PAIR
    ends = contacts.first[pairs] // TILE, contacts.second[pairs] // TILE
    low, high = np.minimum(*ends), np.maximum(*ends)
    lowest, highest = np.arange(tiles + 1), np.arange(tiles + 1)
    np.minimum.at(lowest, high, low)
    np.maximum.at(highest[1:], low, high + 1)
    return {
        "needed": np.minimum.accumulate(lowest[::-1])[::-1],
        "reach": np.maximum.accumulate(highest),
    }
