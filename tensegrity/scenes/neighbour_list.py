"""Contacts that come and go: which a network lists at a moment, and when to list anew.

Listed are all pairs of sites, and of sites and walls, whose gap is below the skin.  As long as no
site moved farther than half the skin since, nothing unlisted can have touched: the list is exact,
not sampled.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from tensegrity.errors import ContactError, StabilityError, TensegrityError
from tensegrity.readonly import fixed
from tensegrity.scenes.clearance import Clearance, ClearanceMonitor
from tensegrity.scenes.network_input import contact_geometry
from tensegrity.springs.potential import Potential
from tensegrity.typing import Array

SKIN = 0.25  # of the mean radius
ROWS = 64  # of displacements that are compared at once
NEAREST = 6  # sites that one may well touch in a run


class NeighbourList(Clearance):
    """Spheres and walls whose contacts are listed as they come near; as `Clearance`."""

    def __init__(self, positions, radius, bonds, walls, wall_contacts):
        super().__init__(positions, radius, bonds, walls, wall_contacts)
        self.skin *= SKIN
        self._last = None, None  # displacements, and what is near there

    def near(self, u):
        """Pairs of sites, and of sites and walls they are beside, that may soon touch; sorted."""
        return self._near(u)[:2]

    def _near(self, u):
        """The same, and sites near a wall that they are not beside; found once where a run begins
        and its energies, its list and its watch ask for them."""
        at, found = self._last
        if at is None or not np.array_equal(at, u):
            found = self._find(u)
            self._last = u.copy(), found
        return found

    def _find(self, u):
        x = self.positions + u
        pairs, walls = self.pairs(x), self.wall_pairs(x)
        beside = self._by_wall("overhang", x, walls) < 0
        before = self._by_wall("height", x, walls) > 0
        return _sorted(pairs), _sorted(walls[beside & before]), walls[~(beside & before)]

    def near_contacts(self, u):
        """What has to be looked at from displacements u on: ends of walls, listed walls."""
        _, listed, ends = self._near(u)
        return ends, listed

    def free_travel(self, x, moved, ends, listed):
        """Distance [m] that every site may move before a contact could be missed."""
        found = np.asarray(self.skin / 2 - moved)  # what is not in the lists
        inside = -self._by_wall("overhang", x, listed)
        for ways in (self.wall_gaps(x, ends), self.law_margin(x), inside):
            found = np.asarray(np.minimum(found, np.min(ways, axis=-1, initial=math.inf)))
        return found

    def rows_valid(self, u):
        """How many of some rows of displacements (rows, sites, dim) the list at the first does
        for."""
        for k in range(1, len(u), ROWS):
            way = u[k : k + ROWS] - u[0]
            moved = np.max(np.einsum("...k,...k", way, way), axis=-1)
            far = np.flatnonzero(moved >= (self.skin / 2) ** 2)
            if len(far):
                return k + int(far[0])
        return len(u)

    def may_stay_valid(self, v, t):
        """Whether one list may do for a time t [s] from velocities v on, to go by these."""
        return t * np.sqrt(np.max(np.sum(v**2, axis=-1), initial=0.0)) < self.skin / 2

    def with_near_contacts(self, u):
        """Pairs of each site with its nearest ones, and with all walls; sorted."""
        from scipy.spatial import cKDTree

        count = min(NEAREST + 1, self.sites)
        _, near = cKDTree(self.positions + u).query(self.positions + u, k=count)
        near = near.reshape(self.sites, -1)
        pairs = np.stack([np.repeat(np.arange(self.sites), count), near.ravel()], axis=1)
        pairs = np.unique(np.sort(pairs[pairs[:, 0] != pairs[:, 1]], axis=1), axis=0)
        low, high = np.sort(pairs, axis=1).T
        pairs = pairs[~np.isin(low * self.sites + high, self._listed)]
        walls = np.indices((self.sites, len(self.walls))).reshape(2, -1).T
        known = {tuple(pair) for pair in self.wall_contacts.tolist()}
        walls = [pair for pair in walls.tolist() if tuple(pair) not in known]
        return pairs, np.array(walls, dtype=int).reshape(-1, 2)

    def check(self, u):
        """Nothing to refuse: what touches is listed."""

    def monitor(self, u):
        """A watch that starts at displacements u."""
        return NeighbourListMonitor(self, u)


def _sorted(pairs):
    return pairs[np.lexsort(pairs.T[::-1])]


def contacts_with(scene, geometry, pairs, walls):
    """What a network that follows contacts is made of with these contacts besides its own, by
    name."""
    count, law, own_geometry = len(scene.bonds), scene._law, geometry[scene.dim]
    bonds = np.concatenate([scene.bonds, pairs])
    contacts = np.concatenate([scene.wall_contacts, walls])
    lengths = np.concatenate([scene.lengths, scene.radius[pairs].sum(axis=1)])
    lengths, found = contact_geometry(
        scene.positions, bonds, lengths, scene.walls, contacts, scene.radius
    )
    own = np.r_[:count, len(bonds) : len(bonds) + len(scene.wall_contacts)]
    found[scene.dim, own] = own_geometry  # not as the positions round
    of_pairs = tuple(law(i, j) for i, j in pairs.tolist())
    of_walls = tuple(law(site, scene.walls[wall]) for site, wall in walls.tolist())
    springs = scene.springs[:count] + of_pairs + scene.springs[count:] + of_walls
    return {
        "bonds": fixed(bonds), "wall_contacts": fixed(contacts), "springs": springs,
        "lengths": fixed(lengths), "_geometry": fixed(found),
    }  # fmt: skip


@dataclass(frozen=True)
class NewContactLaw:
    """The spring of a contact that forms, from what a user gave."""

    given: Potential | Callable[..., Any]

    def __post_init__(self) -> None:
        if not (isinstance(self.given, Potential) or callable(self.given)):
            raise TensegrityError(
                f"law {self.given!r} is not a Potential or a function of two that touch"
            )

    def __call__(self, site: int, other: Any) -> Potential:
        spring = self.given if isinstance(self.given, Potential) else self.given(site, other)
        if not isinstance(spring, Potential):
            raise TensegrityError(f"law of {site!r} and {other!r} is {spring!r}, not a Potential")
        return spring


def new_contact_law(contacts: str, law: Any, radius: Array | None) -> Any:
    """The law of contacts that are followed; None where they are fixed."""
    if not isinstance(contacts, str) or contacts not in ("fixed", "follow"):
        raise TensegrityError(f"contacts {contacts!r} must be 'fixed' or 'follow'")
    if contacts == "follow" and radius is None:
        raise TensegrityError("contacts 'follow' need the radius of the sites")
    if contacts == "fixed" and law is not None:
        raise TensegrityError("law given, but contacts are 'fixed'")
    return NewContactLaw(law) if contacts == "follow" else None


class NeighbourListMonitor(ClearanceMonitor):
    """Follows one run, and says where the list has to be made anew.

    Attributes
    ----------
    at : ndarray
        Displacements at which the list is to be made.
    """

    def needs_new_list(self):
        """Whether contacts have to be listed anew since this was asked."""
        new, self._new = self._new, False
        return new

    def _list(self, u):
        self._new = hasattr(self, "at")  # the first list is the scene's own
        super()._list(u)
        self.at = self._listed_at

    def verify(self, u, t):
        """Look again after one step that may have gone too far; raise if it did."""
        of, x = self._clearance, self._clearance.positions + u
        moved = float(np.sqrt(np.max(np.sum((u - self.at) ** 2, axis=1), initial=0.0)))
        if moved >= of.skin / 2:
            raise StabilityError(
                f"a site moved {moved:.3g} m in one step before t = {t:.6g} s, contacts are "
                f"followed over {of.skin / 2:.3g} m: take a smaller step"
            )
        gaps = of.wall_gaps(x, self._pairs)
        if len(gaps) and gaps.min() <= 0:
            site, wall = self._pairs[int(np.argmin(gaps))].tolist()
            words = f"site {site} touches the end of wall {wall}"
            if of.walls[wall].overhang(x[site]) < 0:
                words = of.penetration(site, wall, x)
            raise ContactError(f"{words} at t = {t:.6g} s")
        self._list(u)
        self.update(u)
