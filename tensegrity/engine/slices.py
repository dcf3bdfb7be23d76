"""The list of contacts as the loop of a network takes it.

`GROUP` sites stand side by side in a slice, and their contacts with sites of higher numbers, or
with walls, one below the other in its groups.  What a contact does to its other site is added to
that one's row at once, group by group and in a group lane by lane.

Contacts that are listed but do not touch add nothing, and change no order either: which sites
share a slice is said by the scene (`Contacts.crowding`) where lists may come and go, and of the
contacts with one other site those of higher lanes do not come before those of lower ones.  A place
where a lane has to wait, or has no contact left, repeats another one of its site's, or of the
slice's; it does not count.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tensegrity.engine.bonds import GROUP, PAIR

TILE = 256  # sites, as in net.h
GUESSES = 3


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
        places = places[runs.source[places] >= 0]
        part = _run(contacts, runs.source[places], places, runs.kind[k] == PAIR, tiles)
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
    of_lane = _apart(at) - count
    slot = np.maximum.accumulate(of_lane) - of_lane
    if other is None:
        return slot
    key = at // GROUP * rows + other
    together = np.argsort(key, kind="stable")
    of_other = _apart(key[together])
    while True:
        before = slot
        slot = np.empty_like(before)
        slot[together] = np.maximum.accumulate(of_other + before[together]) - of_other
        slot = np.maximum.accumulate(of_lane + slot) - of_lane
        if np.array_equal(slot, before):
            return slot


def _apart(key):
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
