"""Neighbour lists: the contacts that a network lists at a given time, and when to rebuild the list.

The list contains all pairs of sites, and of a site and a wall, whose gap is below the skin.  As
long as no site has moved by more than half the skin since the list was built, no unlisted pair can
have touched: the list is complete by a bound, not by sampling.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from tensegrity import check
from tensegrity.errors import ContactError, StabilityError, TensegrityError
from tensegrity.readonly import fixed
from tensegrity.scenes.clearance import Clearance, ClearanceMonitor
from tensegrity.scenes.near_pairs import keys
from tensegrity.scenes.network_input import contact_ends, contact_geometry
from tensegrity.springs.potential import Potential
from tensegrity.springs.power_law import PowerLaw
from tensegrity.typing import Array

SKIN = 0.25  # gap over the mean radius up to which pairs are listed
ROWS = 64  # rows of displacements that are compared in one call
NEAREST = 6  # neighbours that a site is expected to touch in a run


class NeighbourList(Clearance):
    """Spheres and walls whose contacts are listed when they are near; the arguments are those of
    `Clearance`."""

    def __init__(self, positions, radius, bonds, walls, wall_contacts):
        super().__init__(positions, radius, bonds, walls, wall_contacts)
        self.skin *= SKIN
        self._last = None, None  # displacements, and the near contacts there

    def near(self, u):
        """Pairs of sites, and of a site and a wall that it faces, with a gap below the skin at
        displacements u (..., sites, dim) [m], in any of their rows; two sorted arrays (n, 2)."""
        if u.ndim == 2:
            return self._near(u)[:2]
        lists = zip(*map(self.near, u.reshape(-1, *u.shape[-2:])), strict=True)
        return tuple(np.unique(np.concatenate(pairs), axis=0) for pairs in lists)

    def _near(self, u):
        """The pairs of `near`, and the pairs of a site and a wall that it is near but does not
        face; cached, because the energies, the list and the monitor of a run all use them."""
        at, near = self._last
        if at is None or not np.array_equal(at, u):
            near = self._find(u)
            self._last = fixed(u), near
        return near

    def _find(self, u):
        x = self.positions + u
        pairs, walls = self.pairs(x), self.wall_pairs(x)
        facing = self.faces(x, walls)
        return _sorted(pairs), _sorted(walls[facing]), walls[~facing]

    def faces(self, x, walls):
        """Whether sites at positions x are in front of walls, pairs (n, 2); (..., n)."""
        return (self._by_wall("overhang", x, walls) < 0) & (self._by_wall("height", x, walls) > 0)

    def near_contacts(self, u):
        """Contacts with walls that need checks from displacements u on: pairs of a site and a wall
        that it does not face, and the listed pairs of a site and a wall."""
        _, listed, ends = self._near(u)
        return ends, listed

    @property
    def searched_at(self):
        """Displacements of the last `near_contacts` [m], (sites, dim)."""
        return self._last[0]

    def free_travel(self, x, moved, ends, listed):
        """Distance that every site may move before a contact could be missed.

        Parameters
        ----------
        x : ndarray, (..., sites, dim)
            Positions [m].
        moved : float or ndarray, (...)
            Largest displacement of a site since the list was built [m].
        ends, listed : ndarray of int, (n, 2)
            The pairs of `near_contacts`.

        Returns
        -------
        ndarray, (...)
            [m].
        """
        travel = np.asarray(self.skin / 2 - moved)  # pairs that are in no list
        inside = -self._by_wall("overhang", x, listed)
        for ways in (self.wall_gaps(x, ends), self.law_margin(x), inside):
            travel = np.asarray(np.minimum(travel, np.min(ways, axis=-1, initial=math.inf)))
        return travel

    def rows_valid(self, u):
        """Number of leading rows of displacements (rows, sites, dim) for which the list built at
        the first row is valid."""
        for k in range(1, len(u), ROWS):
            way = u[k : k + ROWS] - u[0]
            moved = np.max(np.einsum("...k,...k", way, way), axis=-1)
            far = np.flatnonzero(moved >= (self.skin / 2) ** 2)
            if len(far):
                return k + int(far[0])
        return len(u)

    def may_stay_valid(self, v, t):
        """Whether one list is valid for a time t [s] if the velocities v [m/s] stay constant."""
        return t * np.sqrt(np.max(np.sum(v**2, axis=-1), initial=0.0)) < self.skin / 2

    def with_near_contacts(self, u):
        """Pairs of each site with its nearest neighbours, and with all walls; sorted."""
        from scipy.spatial import cKDTree

        count = min(NEAREST + 1, self.sites)
        _, near = cKDTree(self.positions + u).query(self.positions + u, k=count)
        near = near.reshape(self.sites, -1)
        pairs = np.stack([np.repeat(np.arange(self.sites), count), near.ravel()], axis=1)
        pairs = np.unique(np.sort(pairs[pairs[:, 0] != pairs[:, 1]], axis=1), axis=0)
        listed = keys(self._bonds, self.sites)
        pairs = pairs[~np.isin(keys(pairs, self.sites), listed)]
        walls = np.indices((self.sites, len(self.walls))).reshape(2, -1).T
        known = {tuple(pair) for pair in self.wall_contacts.tolist()}
        walls = [pair for pair in walls.tolist() if tuple(pair) not in known]
        return pairs, np.array(walls, dtype=int).reshape(-1, 2)

    def check(self, u):
        """Accept all displacements, because every pair that touches is listed."""

    def monitor(self, u):
        """A monitor of one run that starts at displacements u."""
        return NeighbourListMonitor(self, u)


def _sorted(pairs):
    return pairs[np.lexsort(pairs.T[::-1])]


def contacts_with(scene, pairs, walls):
    """Attributes of a network with these contacts in addition to its own.

    Parameters
    ----------
    scene : Network
        A network with contacts="follow".
    pairs, walls : ndarray of int, (n, 2)
        Pairs of sites, and of a site and a wall, that get a contact.

    Returns
    -------
    dict
        Bonds, wall contacts, springs, lengths and gaps, by the names of the attributes.
    """
    count, law = len(scene.bonds), scene._law
    bonds = np.concatenate([scene.bonds, pairs])
    contacts = np.concatenate([scene.wall_contacts, walls])
    lengths = np.concatenate([scene.lengths, scene.radius[pairs].sum(axis=1)])
    lengths, gaps = contact_geometry(
        scene.positions, bonds, lengths, scene.walls, contacts, scene.radius
    )
    own = np.r_[:count, len(bonds) : len(bonds) + len(scene.wall_contacts)]
    gaps = gaps.copy()
    gaps[own] = scene._gaps  # more accurate than the rounded positions
    of_pairs = tuple(law(i, j) for i, j in pairs.tolist())
    of_walls = tuple(law(site, scene.walls[wall]) for site, wall in walls.tolist())
    springs = scene.springs[:count] + of_pairs + scene.springs[count:] + of_walls
    ends, bonds = contact_ends(bonds, contacts, scene.sites)
    return {
        "bonds": bonds, "wall_contacts": fixed(contacts), "springs": springs, "_ends": ends,
        "_lengths": fixed(lengths), "lengths": fixed(lengths[: len(bonds)]), "_gaps": fixed(gaps),
        **scene._forces_between(bonds, contacts),
    }  # fmt: skip


@dataclass(frozen=True)
class NewContactLaw:
    """The spring of a contact that forms: a potential, or a function of the two partners."""

    given: Potential | Callable[..., Any]
    has_kinks = jumps = True

    def __post_init__(self) -> None:
        if not (isinstance(self.given, Potential) or callable(self.given)):
            raise TensegrityError(
                f"law {self.given!r} is not a Potential or a function of two that touch"
                f"{check.made_by(self.given, Potential)}"
            )

    def __call__(self, site: int, other: Any) -> Potential:
        spring = self.given if isinstance(self.given, Potential) else self.given(site, other)
        check.kind(f"law of {site!r} and {other!r}", spring, Potential)
        return spring

    def kinks_within(self, ranges: Array) -> list[tuple[Potential, Any]]:
        """Pairs of a spring and a kink of its force, of contacts that open at any elongation."""
        spring = self.given if isinstance(self.given, Potential) else PowerLaw(1.0, 1.0)
        return [(spring, kink) for kink in spring.kinks]

    def exponents_within(self, ranges: Array) -> set[float]:
        """Exponents of these kinks."""
        return {kink[2] for _, kink in self.kinks_within(ranges)}


def new_contact_law(contacts: str, law: Any, radius: Array | None) -> Any:
    """The force law of contacts that form.

    Parameters
    ----------
    contacts : {"fixed", "follow", "walls"}
    law : Potential or callable (site, other) -> Potential, or None
    radius : ndarray, (sites,), or None
        [m]; required for "follow".

    Returns
    -------
    NewContactLaw or None
        None unless they follow.

    Raises
    ------
    TensegrityError
        Another word, "follow" without radius or law, or another with a law.
    """
    if not isinstance(contacts, str) or contacts not in ("fixed", "follow", "walls"):
        raise TensegrityError(f"contacts {contacts!r} must be 'fixed', 'follow' or 'walls'")
    if contacts == "follow" and radius is None:
        raise TensegrityError("contacts 'follow' need the radius of the sites")
    if contacts != "follow" and law is not None:
        raise TensegrityError(f"law given, but contacts are {contacts!r}")
    return NewContactLaw(law) if contacts == "follow" else None


class NeighbourListMonitor(ClearanceMonitor):
    """Monitors one run, and signals when the list of contacts has to be rebuilt.

    Attributes
    ----------
    at : ndarray, (sites, dim)
        Displacements at which the list was last built [m].
    """

    def needs_new_list(self):
        """Whether the list has to be rebuilt since the last call of this method."""
        new, self._new = self._new, False
        return new

    def _list(self, u):
        self._new = hasattr(self, "at")  # the first list is the scene's own
        super()._list(u)
        self.at = self._listed_at

    def verify(self, u, t):
        """Check displacements u after a step that may have gone too far, at time t [s].

        Raises
        ------
        StabilityError
            A site moved by more than half the skin in one step.
        ContactError
            A site touches the edge of a wall, or has passed through it.
        """
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
