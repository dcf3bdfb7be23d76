"""The list of contacts as the loop of a network takes it.

`GROUP` sites stand side by side in a slice, and their k-th contacts with sites of higher numbers,
or with walls, in its k-th group; sites with as many contacts as each other come together where
their tile allows.  A site with fewer contacts than its slice repeats its last one, a place
without a site repeats the first; these do not count.  What a contact does to its other site waits
in a store until the tile of that one comes; the place is used again afterwards.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tensegrity.engine.bonds import GROUP, PAIR

TILE = 256  # sites, as in net.h


@dataclass(frozen=True, eq=False)
class Slices:
    """All runs of a network; an entry is a place in a group.

    Attributes
    ----------
    slice : ndarray of int, (runs, tiles + 1)
        First slice of a run in each tile.
    site, depth : ndarray of int, (slices, GROUP)
        Sites, and how many contacts of each count.
    begin : ndarray of int, (slices + 1,)
        First group of each slice.
    contact, other : ndarray of int, (groups * GROUP,)
        Place of the contact of each entry in the list, and the row that it joins the site to.
    first : ndarray of int, (runs + 1,)
        First entry of each run.
    held : ndarray of int, (runs, tiles)
        Where the groups of a run and a tile begin in the store.
    taker : ndarray of int, (takers, GROUP)
        Sites in the order in which they take from the store, `GROUP` side by side: in each tile by
        how often they do.  The last one stands for those that are not there.
    taken, taken_at : ndarray of int, (takings, GROUP), (takers + 1,)
        Entries of the store that these take, and where those of each group begin; one of nothing
        where a site takes less often than others beside it.
    store : int
        Groups that the store has room for, the last one of nothing.
    needed : ndarray of int, (tiles + 1,)
        The first tile whose contacts this tile or one behind it takes from.
    """

    slice: np.ndarray
    site: np.ndarray
    depth: np.ndarray
    begin: np.ndarray
    contact: np.ndarray
    other: np.ndarray
    first: np.ndarray
    held: np.ndarray
    taker: np.ndarray
    taken: np.ndarray
    taken_at: np.ndarray
    store: int
    needed: np.ndarray

    @property
    def tiles(self):
        return len(self.needed) - 1

    def shares(self, pieces):
        """Tiles at which so many pieces of about equal work begin and end; (pieces + 1,)."""
        done = np.cumsum(self._work + TILE / GROUP)
        cuts = np.searchsorted(done, done[-1:] * np.arange(1, pieces) / pieces)
        return np.concatenate([[0], cuts, [self.tiles]]).astype(int)

    @property
    def _work(self):
        return np.diff(self.begin[self.slice], axis=1).sum(axis=0)


def slices(bonds):
    """The `Slices` of a network's `Bonds`."""
    runs, contacts = bonds.runs, bonds.contacts
    sites = len(contacts.load)
    tiles = -(-sites // TILE)
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
        parts = [_run(contacts, *np.zeros((2, 0), dtype=int), True, tiles)]
    joined = {
        name: np.concatenate([part[name] for part in parts])
        for name in ("slice", "site", "depth", "contact", "other")
    }
    begin = np.concatenate([*(part["begin"][:-1] for part in parts), [groups]])
    first = GROUP * begin[np.append(joined["slice"][: len(runs.law), 0], begun)]
    return Slices(begin=begin, first=first, **joined, **_store(parts, sites, tiles))


def _run(contacts, members, places, pairs, tiles):
    """One run, numbered from 0: contacts `members` at `places` of the list."""
    ends = contacts.first[members], contacts.second[members]
    own, other = (np.minimum(*ends), np.maximum(*ends)) if pairs else ends[::-1]
    order = np.lexsort((places, own))
    own, other, places = own[order], other[order], places[order]
    sites, start, count = np.unique(own, return_index=True, return_counts=True)
    deepest = np.lexsort((-count, sites // TILE))
    sites, start, count = sites[deepest], start[deepest], count[deepest]
    per_tile = np.bincount(sites // TILE, minlength=tiles)
    first = np.concatenate([[0], np.cumsum(-(-per_tile // GROUP))])
    within = np.arange(len(sites)) - (np.cumsum(per_tile) - per_tile)[sites // TILE]
    row, lane = first[sites // TILE] + within // GROUP, within % GROUP
    site, depth, at = np.zeros((3, first[-1], GROUP), dtype=int)
    site[row, lane], depth[row, lane], at[row, lane] = sites, count, start
    empty = depth == 0
    site, at = (np.where(empty, x[:, :1], x) for x in (site, at))
    slots = depth[:, 0]
    begin = np.concatenate([[0], np.cumsum(slots)])
    of = np.repeat(np.arange(len(slots)), slots)
    slot = np.arange(begin[-1]) - begin[of]
    last = np.where(empty, depth[:, :1], depth) - 1
    entry = (at[of] + np.minimum(slot[:, None], last[of])).ravel()
    counts = (slot[:, None] < depth[of]).ravel()
    return {
        "slice": first[None].copy(), "site": site, "depth": depth, "begin": begin,
        "contact": places[entry], "other": other[entry], "pairs": pairs, "counts": counts,
    }  # fmt: skip


def _store(parts, sites, tiles):
    """Where contacts wait for their other sites, and where these find them."""
    start = np.array([part["begin"][part["slice"][0] - part["slice"][0, 0]] for part in parts])
    size = np.diff(start, axis=1) * np.array([[part["pairs"]] for part in parts])
    whole = size.sum(axis=0)
    found = []  # (site, tile of the contact, run, its group from the tile's first on, lane)
    for k, part in enumerate(parts):
        if part["pairs"]:
            group, lane = np.divmod(np.flatnonzero(part["counts"]), GROUP)
            tile = np.searchsorted(start[k] - start[k, 0], group, side="right") - 1
            within = group - (start[k] - start[k, 0])[tile]
            site = part["other"][part["counts"]]
            order = np.argsort(part["contact"][part["counts"]], kind="stable")
            found.append(np.stack([site, tile, np.full(len(site), k), within, lane])[:, order])
    site, tile, run, within, lane = np.concatenate([np.zeros((5, 0), int), *found], axis=1)
    lowest = np.append(np.arange(tiles), tiles)
    np.minimum.at(lowest, site // TILE, tile)
    needed = np.minimum.accumulate(lowest[::-1])[::-1]
    done = np.concatenate([[0], np.cumsum(whole)])
    room = int(np.max(done[1:] - done[needed[:-1]], initial=0) + 2 * np.max(whole, initial=0))
    held, at = np.zeros(size.shape, dtype=int), 0
    for t in range(tiles):
        if at + whole[t] > room:
            at = 0
        held[:, t] = at + np.cumsum(size[:, t]) - size[:, t]
        at += whole[t]
    entry = (held[run, tile] + within) * GROUP + lane
    return {
        "held": held, "store": room + 1, "needed": needed,
        **_takers(site, entry, sites, room * GROUP),
    }  # fmt: skip


def _takers(site, entry, sites, nothing):
    """Who takes which entries of the store; `site` is that of each entry."""
    often, every = np.bincount(site, minlength=sites), np.arange(sites)
    order = np.lexsort((every, often, every // TILE))
    turn = np.empty(sites, dtype=int)
    turn[order] = every
    sorted_entry = np.append(entry[np.argsort(turn[site], kind="stable")], nothing)
    count = often[order]
    start = np.cumsum(count) - count
    lanes = np.minimum(np.arange(-(-sites // GROUP) * GROUP), sites - 1).reshape(-1, GROUP)
    begin = np.concatenate([[0], np.cumsum(count[lanes].max(axis=1))])
    of = np.repeat(np.arange(len(lanes)), np.diff(begin))
    time = (np.arange(begin[-1]) - begin[of])[:, None]
    place = np.where(time < count[lanes[of]], start[lanes[of]] + time, -1)
    return {"taker": order[lanes], "taken": sorted_entry[place], "taken_at": begin}
