"""Contacts that are not in a network's list: none may form during a run.

Not sampled but bounded: the loop counts how far any site can have moved, and as long as that is
less than the smallest distance kept at the last look, nothing unlisted can have touched, and no
site passed the plane of a wall that it may touch, or pressed on it beyond its end.  Where
the distances are small, looks come often, at last after every step.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from tensegrity.errors import ContactError, TensegrityError
from tensegrity.scenes.walls import Wall, WallArrays
from tensegrity.typing import Array, Indices

FARTHEST = 1e100  # of a site [m]: its square is still a number
TOUCH = 1e-9  # gap over the radius up to which spheres count as touching
DISTANCES_AT_ONCE = 1_000_000  # distances of sites from walls that are computed at once
NEIGHBOUR_GAP = 0.1  # gap over the mean radius up to which spheres crowd each other
SAFETY_FACTOR = 0.8  # part of the way to the next possible contact that is gone without a look


class Clearance:
    """Spheres and walls, and the contacts between them that are listed.

    Parameters
    ----------
    positions : ndarray, (sites, dim)
    radius : ndarray, (sites,)
    bonds : ndarray of int, (bonds, 2)
    walls : sequence of Wall
    wall_contacts : ndarray of int, (wall contacts, 2)
        Site and wall.
    """

    def __init__(
        self,
        positions: Array,
        radius: Array,
        bonds: Indices,
        walls: Sequence[Wall],
        wall_contacts: Indices,
    ) -> None:
        self.positions, self.radius, self.walls = positions, radius, walls
        self.sites, self.dim = positions.shape
        self.skin = float(radius.mean())
        low, high = np.sort(bonds, axis=1).T
        self._listed = np.unique(low * self.sites + high)
        self.wall_contacts, self._wall_arrays = wall_contacts, WallArrays(walls, self.dim)
        self._last_near: tuple[Array, tuple[Indices, Indices]] | None = None
        self._last_free_travel: tuple[tuple[Indices, Indices], float] | None = None

    def pairs(self, x: Array) -> Indices:
        """Unlisted pairs of sites at places x with a gap below the skin; (n, 2)."""
        from scipy.spatial import cKDTree

        if not np.abs(x).max(initial=0.0) < FARTHEST:
            far = np.abs(x).max()
            raise TensegrityError(f"a site is {far:g} m away, must be below {FARTHEST:g} m")
        reach = 2 * self.radius.max() + self.skin
        found = cKDTree(x).query_pairs(reach, output_type="ndarray").reshape(-1, 2)
        found = np.sort(found, axis=1)
        if len(self._listed):
            found = found[~np.isin(found[:, 0] * self.sites + found[:, 1], self._listed)]
        return found[self.pair_gaps(x, found) < self.skin]

    def wall_pairs(self, x: Array) -> Indices:
        """Unlisted (site, wall) with a gap below the skin; (n, 2)."""
        near = [np.zeros((0, 2), dtype=int)]
        some = max(DISTANCES_AT_ONCE // self.sites, 1)  # walls
        for k in range(0, len(self.walls), some):
            numbers = np.arange(k, min(k + some, len(self.walls)))
            gaps = self._wall_arrays.distance(x[:, None], numbers) - self.radius[:, None]
            near.append(np.argwhere(gaps < self.skin) + np.array([0, k]))
        found = np.concatenate(near)
        if not len(self.wall_contacts):
            return found
        listed, new = (pairs @ (len(self.walls), 1) for pairs in (self.wall_contacts, found))
        return found[~np.isin(new, listed)]

    def pair_gaps(self, x: Array, pairs: Indices) -> Array:
        """Gap of each pair [m], overlap < 0, at places x (..., sites, dim)."""
        i, j = pairs.T
        apart = np.linalg.norm(x[..., j, :] - x[..., i, :], axis=-1)
        return apart - self.radius[i] - self.radius[j]

    def wall_gaps(self, x: Array, pairs: Indices) -> Array:
        """Gap of each (site, wall) [m], to the nearest point of the wall."""
        return self._by_wall("distance", x, pairs) - self.radius[pairs[:, 0]]

    def law_margin(self, x: Array) -> Array:
        """For each listed wall contact, the way to a place where its law does not hold [m].

        Beside the wall the site is before its plane; beyond its end the plane may be near, but not
        touched.
        """
        inside, height = self._end_and_height(x)
        free = height - self.radius[self.wall_contacts[:, 0]]
        return np.maximum(np.minimum(inside, height), free)

    def _end_and_height(self, x: Array) -> tuple[Array, Array]:
        """Way to the end and distance from the plane of each listed wall contact [m]."""
        inside = -self._by_wall("overhang", x, self.wall_contacts)
        return inside, self._by_wall("height", x, self.wall_contacts)

    def penetration(self, site: int, wall: int, x: Array) -> str:
        """Where a site is that passed through a wall, in words."""
        beyond = abs(float(self.walls[wall].height(x[site])))
        return f"site {site} is behind wall {wall}, {beyond:.3g} m beyond its plane"

    def _by_wall(self, what: str, x: Array, pairs: Indices) -> Array:
        """Of each (site, wall) what `WallArrays` say."""
        return getattr(self._wall_arrays, what)(x[..., pairs[:, 0], :], pairs[:, 1])

    def near_contacts(self, u: Array) -> tuple[Indices, Indices]:
        """What has to be looked at from displacements u on: unlisted `pairs`, and `wall_pairs`.

        The last answer is kept: a state is checked, and then run from.
        """
        known = self._last_near
        if known is None or not np.array_equal(known[0], u):
            x = self.positions + u
            known = self._last_near = u.copy(), (self.pairs(x), self.wall_pairs(x))
        return known[1]

    def free_travel(self, x: Array, moved: Array | float, pairs: Indices, walls: Indices) -> Array:
        """How far every site may move until something could be wrong [m].

        Parameters
        ----------
        x : ndarray, (..., sites, dim)
        moved : ndarray, (...)
            How far any site went since `pairs` and `walls` were what is `near_contacts` [m].
        """
        found = np.asarray(self.skin / 2 - moved)  # what is not in the lists
        for ways in (self.pair_gaps(x, pairs) / 2, self.wall_gaps(x, walls), self.law_margin(x)):
            found = np.asarray(np.minimum(found, np.min(ways, axis=-1, initial=math.inf)))
        return found

    def free_travel_at(self, u: Array, near: tuple[Indices, Indices]) -> float:
        """The room at displacements where so much is `near_contacts`; the last answer is kept."""
        known = self._last_free_travel
        if known is None or known[0] is not near:
            known = self._last_free_travel = (
                near,
                float(self.free_travel(self.positions + u, 0.0, *near)),
            )
        return known[1]

    def check(self, u: Array) -> None:
        """Refuse displacements at which something unlisted touches."""
        near, touch = self.near_contacts(u), TOUCH * self.skin
        if self.free_travel_at(u, near) > touch:
            return
        violation = self.violation(self.positions + u, *near, touch)
        if violation:
            raise ContactError(f"{violation} at the start")

    def violation(
        self, x: Array, pairs: Indices, wall_pairs: Indices, touch: float = 0.0
    ) -> str | None:
        """What is wrong at places x, in words, or None."""
        for gaps, members, words in (
            (self.pair_gaps(x, pairs), pairs, "sites {} and {}"),
            (self.wall_gaps(x, wall_pairs), wall_pairs, "site {} and wall {}"),
        ):
            if len(gaps) and gaps.min() <= touch:
                worst = int(np.argmin(gaps))
                who = words.format(*members[worst].tolist())
                return f"{who}, whose contact is not listed, overlap by {-gaps[worst]:.3g} m"
        inside, height = self._end_and_height(x)
        behind = (inside >= 0) & (height <= 0)
        if behind.any():
            worst = int(np.argmin(np.where(behind, height, math.inf)))
            site, wall = self.wall_contacts[worst].tolist()
            return self.penetration(site, wall, x)
        law_margin = self.law_margin(x)
        if len(law_margin) and law_margin.min() < 0:
            worst = int(np.argmin(law_margin))
            site, wall = self.wall_contacts[worst].tolist()
            beyond = float(self.walls[wall].overhang(x[site]))
            return f"site {site} is pressed against wall {wall} {beyond:.3g} m beyond its end"
        return None

    def monitor(self, u: Array) -> ClearanceMonitor:
        """A watch that starts at displacements u."""
        return ClearanceMonitor(self, u)


def neighbour_counts(positions: Array, radius: Array) -> Indices:
    """How many spheres of higher numbers each one has about touching it; (sites,)."""
    none = np.zeros((0, 2), dtype=int)
    spheres = Clearance(positions, radius, none, (), none)
    spheres.skin *= NEIGHBOUR_GAP
    return np.bincount(spheres.pairs(positions)[:, 0], minlength=len(positions))


class ClearanceMonitor:
    """Follows one run from look to look."""

    def __init__(self, clearance: Clearance, u: Array) -> None:
        self._clearance = clearance
        self._list(u)
        self._remaining = self._free_travel = clearance.free_travel_at(u, self._near)

    def _list(self, u: Array) -> None:
        self._listed_at = u.copy()
        self._near = self._pairs, self._walls = self._clearance.near_contacts(u)

    def update(self, u: Array) -> None:
        """Find how far every site may move until something could be wrong."""
        of, moved = self._clearance, self._moved(u)
        if moved > of.skin / 4:
            self._list(u)
            moved = 0.0
        self._remaining = self._free_travel = float(
            of.free_travel(of.positions + u, moved, self._pairs, self._walls)
        )

    def _moved(self, u: Array) -> Any:
        """How far any site went since the list was made [m]."""
        return np.sqrt(np.max(np.sum((u - self._listed_at) ** 2, axis=-1), axis=-1, initial=0.0))

    def excludes_contact(self, u: Array, travel: Array, each: bool = False) -> bool:
        """Whether nothing unlisted can have touched between instants of a run.

        Parameters
        ----------
        u : ndarray, (instants + 1, sites, dim)
            The first where it was looked last.
        travel : ndarray, (instants,)
            Bound on how far any coordinate of a site moved from each to the next [m].
        each : bool, optional
            Whether the instants are all steps: then nothing touches in one at whose end nothing
            does, as `verify` has it.
        """
        of, ways = self._clearance, math.sqrt(self._clearance.dim) * travel
        moved = np.sqrt(np.max(np.sum((u - u[0]) ** 2, axis=-1), axis=-1))
        if np.all(ways + moved[:-1] < self._remaining):  # no room shrinks faster
            return True
        free_travel = of.free_travel(of.positions + u, self._moved(u), self._pairs, self._walls)
        kept = ways < free_travel[:-1]
        return bool(np.all(kept | (free_travel[1:] > 0) if each else kept))

    def fraction_used(self, travel: float) -> float:
        """The way that sites went, over the way they may go; `travel` bounds each coordinate."""
        way = math.sqrt(self._clearance.dim) * travel
        return way / self._remaining if self._remaining > 0 else math.inf if way > 0 else 0.0

    def accept(self, u: Array, travel: float) -> None:
        """Go on from displacements that are known to be sound; look again if it is time to."""
        self._remaining -= math.sqrt(self._clearance.dim) * travel
        if self._remaining < self._free_travel / 2:
            self.update(u)

    def needs_new_list(self) -> bool:
        """Whether contacts have to be listed anew since this was asked: they never are here."""
        return False

    def verify(self, u: Array, t: float) -> None:
        """Look again after one step that may have gone too far; raise if it did."""
        violation = self._clearance.violation(
            self._clearance.positions + u, self._pairs, self._walls
        )
        if violation:
            raise ContactError(f"{violation} at t = {t:.6g} s")
        self.update(u)
