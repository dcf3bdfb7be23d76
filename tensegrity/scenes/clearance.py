"""Detection of contacts that are not in a network's list: none may form during a run.

The check is a bound, not a sample: the loop sums the largest possible displacement of any site, and
as long as that sum is below the smallest admissible travel at the last update, no unlisted pair can
have touched, and no site can have passed the plane of a wall that it touches, or have been pressed
on it beyond its edge.  The smaller the distances, the more frequent the updates, at most one after
every step.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from tensegrity.errors import ContactError, TensegrityError
from tensegrity.readonly import fixed
from tensegrity.scenes.near_pairs import blocks, distances, near_pairs, total
from tensegrity.scenes.walls import Wall, WallArrays
from tensegrity.typing import Array, Indices

FARTHEST = 1e100  # m: largest coordinate of a site; its square is finite
TOUCH = 1e-9  # gap over the radius up to which spheres count as touching
DISTANCES_AT_ONCE = 1_000_000  # distances of sites from walls that are computed in one call
NEIGHBOUR_GAP = 0.1  # gap over the mean radius up to which spheres count as neighbours
SAFETY_FACTOR = 0.8  # fraction of the admissible travel that is used before an update


class Clearance:
    """Spheres and walls with the list of contacts between them.

    Parameters
    ----------
    positions : ndarray, (sites, dim)
        Reference positions [m].
    radius : ndarray, (sites,)
        [m].
    bonds : ndarray of int, (bonds, 2)
        The two sites of each listed pair.
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
        self._bonds = bonds
        self.wall_contacts, self._wall_arrays = wall_contacts, WallArrays(walls, self.dim)
        self._last_near: tuple[Array, tuple[Indices, Indices]] | None = None
        self._last_free_travel: tuple[tuple[Indices, Indices], float] | None = None

    def pairs(self, x: Array) -> Indices:
        """Unlisted pairs of sites whose gap at positions x is below the skin, sorted; (n, 2)."""
        if not np.abs(x).max(initial=0.0) < FARTHEST:
            far = np.abs(x).max()
            raise TensegrityError(f"a site is {far:g} m away, must be below {FARTHEST:g} m")
        return near_pairs(x, self.radius, self.skin, self._bonds).ends

    def wall_pairs(self, x: Array) -> Indices:
        """Unlisted pairs (site, wall) whose gap at positions x is below the skin; (n, 2)."""
        near = [np.zeros((0, 2), dtype=int)]
        some = max(DISTANCES_AT_ONCE // self.sites, 1)  # walls
        for k in range(0, len(self.walls), some):
            numbers = np.arange(k, min(k + some, len(self.walls)))
            gaps = self._wall_arrays.distance(x[:, None], numbers) - self.radius[:, None]
            near.append(np.argwhere(gaps < self.skin) + np.array([0, k]))
        close = np.concatenate(near)
        if not len(self.wall_contacts):
            return close
        listed, new = (pairs @ (len(self.walls), 1) for pairs in (self.wall_contacts, close))
        return close[~np.isin(new, listed)]

    def pair_gaps(self, x: Array, pairs: Indices) -> Array:
        """Gap of each pair [m] at positions x (..., sites, dim), < 0 for an overlap; (..., n)."""
        gaps = np.empty((*x.shape[:-2], len(pairs)))
        for some in blocks(len(pairs)):
            i, j = pairs[some].T
            gaps[..., some] = distances(x, i, j) - self.radius[i] - self.radius[j]
        return gaps

    def wall_gaps(self, x: Array, pairs: Indices) -> Array:
        """Gap of each pair (site, wall) [m], to the nearest point of the wall; (..., n)."""
        return self._by_wall("distance", x, pairs) - self.radius[pairs[:, 0]]

    def law_margin(self, x: Array) -> Array:
        """Distance of each listed wall contact from a position at which its law fails [m].

        The law holds if the site's projection is inside the wall and the site is in front of its
        plane, or if the projection is beyond the edge and the site does not touch the plane.
        """
        inside, height = self._end_and_height(x)
        free = height - self.radius[self.wall_contacts[:, 0]]
        return np.maximum(np.minimum(inside, height), free)

    def _end_and_height(self, x: Array) -> tuple[Array, Array]:
        """Distance to the edge and to the plane of the wall for each listed wall contact [m]."""
        inside = -self._by_wall("overhang", x, self.wall_contacts)
        return inside, self._by_wall("height", x, self.wall_contacts)

    def penetration(self, site: int, wall: int, x: Array) -> str:
        """Describe the position of a site that has passed through a wall.

        Parameters
        ----------
        site, wall : int
        x : ndarray, (sites, dim)
            Positions [m].

        Returns
        -------
        str
        """
        beyond = abs(float(self.walls[wall].height(x[site])))
        return f"site {site} is behind wall {wall}, {beyond:.3g} m beyond its plane"

    def _by_wall(self, what: str, x: Array, pairs: Indices) -> Array:
        """The named method of `WallArrays` for each pair (site, wall)."""
        return getattr(self._wall_arrays, what)(x[..., pairs[:, 0], :], pairs[:, 1])

    def near_contacts(self, u: Array) -> tuple[Indices, Indices]:
        """Contacts that could form from displacements u on: unlisted `pairs`, and `wall_pairs`.

        The last result is cached, since a state is first checked and then run from.
        """
        known = self._last_near
        if known is None or not np.array_equal(known[0], u):
            x = self.positions + u
            known = self._last_near = fixed(u), (self.pairs(x), self.wall_pairs(x))
        return known[1]

    @property
    def searched_at(self) -> Any:
        """Displacements of the last `near_contacts` [m], (sites, dim)."""
        return self._last_near and self._last_near[0]

    def free_travel(self, x: Array, moved: Array | float, pairs: Indices, walls: Indices) -> Array:
        """Distance that every site may move before an unlisted contact or a violation is possible.

        Parameters
        ----------
        x : ndarray, (..., sites, dim)
            Positions [m].
        moved : float or ndarray, (...)
            Largest displacement of a site since `near_contacts` returned `pairs`, `walls` [m].
        pairs, walls : ndarray of int, (n, 2)
            Unlisted pairs of sites, and of a site and a wall, that are near each other.

        Returns
        -------
        ndarray, (...)
            [m].
        """
        travel = np.asarray(self.skin / 2 - moved)  # pairs that are in no list
        for ways in (self.pair_gaps(x, pairs) / 2, self.wall_gaps(x, walls), self.law_margin(x)):
            travel = np.asarray(np.minimum(travel, np.min(ways, axis=-1, initial=math.inf)))
        return travel

    def free_travel_at(self, u: Array, near: tuple[Indices, Indices]) -> float:
        """`free_travel` [m] at displacements u with these `near_contacts`; the last is cached."""
        known = self._last_free_travel
        if known is None or known[0] is not near:
            known = self._last_free_travel = (
                near,
                float(self.free_travel(self.positions + u, 0.0, *near)),
            )
        return known[1]

    def check(self, u: Array) -> None:
        """Refuse displacements at which an unlisted pair touches, or a wall contact fails."""
        near, touch = self.near_contacts(u), TOUCH * self.skin
        if self.free_travel_at(u, near) > touch:
            return
        violation = self.violation(self.positions + u, *near, touch)
        if violation:
            raise ContactError(f"{violation} at the start")

    def violation(
        self, x: Array, pairs: Indices, wall_pairs: Indices, touch: float = 0.0
    ) -> str | None:
        """Describe the worst violation at positions x.

        Parameters
        ----------
        x : ndarray, (sites, dim)
            Positions [m].
        pairs, wall_pairs : ndarray of int, (n, 2)
            Unlisted pairs of sites, and of a site and a wall, that are near each other.
        touch : float, optional
            Gap [m] up to which they count as touching.

        Returns
        -------
        str or None
            None if there is no violation.
        """
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
        """A monitor of one run that starts at displacements u."""
        return ClearanceMonitor(self, u)


def neighbour_counts(positions: Array, radius: Array) -> Indices:
    """Number of neighbours of higher index that each sphere nearly touches; (sites,)."""
    none = np.zeros((0, 2), dtype=int)
    spheres = Clearance(positions, radius, none, (), none)
    spheres.skin *= NEIGHBOUR_GAP
    return np.bincount(spheres.pairs(positions)[:, 0], minlength=len(positions))


class ClearanceMonitor:
    """Monitors one run between updates of the admissible travel."""

    def __init__(self, clearance: Clearance, u: Array) -> None:
        self._clearance = clearance
        self._list(u)
        self._remaining = self._free_travel = clearance.free_travel_at(u, self._near)

    def _list(self, u: Array) -> None:
        self._near = self._pairs, self._walls = self._clearance.near_contacts(u)
        self._listed_at = self._clearance.searched_at

    def update(self, u: Array) -> None:
        """Recompute the distance that every site may move before a violation is possible."""
        of, moved = self._clearance, self._moved(u)
        if moved > of.skin / 4:
            self._list(u)
            moved = 0.0
        self._remaining = self._free_travel = float(
            of.free_travel(of.positions + u, moved, self._pairs, self._walls)
        )

    def _moved(self, u: Array) -> Any:
        """Largest displacement of a site since the list was made [m]."""
        return np.sqrt(np.max(total((u - self._listed_at) ** 2), axis=-1, initial=0.0))

    def excludes_contact(self, u: Array, travel: Array, each: bool = False) -> bool:
        """Whether no unlisted contact can have formed between the given times of a run.

        Parameters
        ----------
        u : ndarray, (n + 1, sites, dim)
            Displacements [m], first those of the last update.
        travel : ndarray, (n,)
            Bound on the displacement of any coordinate between successive rows of u [m].
        each : bool, optional
            Whether successive rows are single steps: a step without a violation at its end then
            passes, as in `verify`.

        Returns
        -------
        bool
        """
        of, ways = self._clearance, math.sqrt(self._clearance.dim) * travel
        moved = np.sqrt(np.max(total((u - u[0]) ** 2), axis=-1))
        if np.all(ways + moved[:-1] < self._remaining):  # no distance shrinks faster
            return True
        free_travel = of.free_travel(of.positions + u, self._moved(u), self._pairs, self._walls)
        within = ways < free_travel[:-1]
        return bool(np.all(within | (free_travel[1:] > 0) if each else within))

    def fraction_used(self, travel: float) -> float:
        """Fraction of the remaining travel that was used; `travel` bounds each coordinate [m]."""
        way = math.sqrt(self._clearance.dim) * travel
        return way / self._remaining if self._remaining > 0 else math.inf if way > 0 else 0.0

    def accept(self, u: Array, travel: float) -> None:
        """Continue from displacements u without violations; update if half the travel is used."""
        self._remaining -= math.sqrt(self._clearance.dim) * travel
        if self._remaining < self._free_travel / 2:
            self.update(u)

    def needs_new_list(self) -> bool:
        """Whether the list of contacts has to be rebuilt: never for a fixed list."""
        return False

    def verify(self, u: Array, t: float) -> None:
        """Check displacements u after a step that may have gone too far, at time t [s].

        Raises
        ------
        ContactError
            An unlisted pair overlaps, or a wall contact has failed.
        """
        violation = self._clearance.violation(
            self._clearance.positions + u, self._pairs, self._walls
        )
        if violation:
            raise ContactError(f"{violation} at t = {t:.6g} s")
        self.update(u)
