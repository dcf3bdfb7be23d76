"""Contacts that come and go: which a network lists at a moment, and when to list anew.

Listed are all pairs of sites, and of sites and walls, whose gap is below the skin.  As long as no
site moved farther than half the skin since, nothing unlisted can have touched: the list is exact,
not sampled.
"""

from __future__ import annotations

import math

import numpy as np

from tensegrity.errors import ContactError, StabilityError
from tensegrity.scenes.clearance import Clearance, Tracker

SKIN = 0.25  # of the mean radius
NEAREST = 6  # sites that one may well touch in a run


class Following(Clearance):
    """Spheres and walls whose contacts are listed as they come near; as `Clearance`."""

    def __init__(self, positions, radius, bonds, walls, wall_contacts):
        super().__init__(positions, radius, bonds, walls, wall_contacts)
        self.skin *= SKIN

    def near(self, u):
        """Pairs of sites, and of sites and walls they are beside, that may soon touch; sorted."""
        x = self.positions + u
        pairs, walls = self.pairs(x), self.wall_pairs(x)
        beside = self._by_wall(x, walls, lambda wall, at: wall.overhang(at)) < 0
        before = self._by_wall(x, walls, lambda wall, at: wall.height(at)) > 0
        return _sorted(pairs), _sorted(walls[beside & before])

    def likely(self, u):
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

    def tracker(self, u):
        """A watch that starts at displacements u."""
        return Follower(self, u)


def _sorted(pairs):
    return pairs[np.lexsort(pairs.T[::-1])]


class Follower(Tracker):
    """Follows one run, and says where the list has to be made anew.

    Attributes
    ----------
    at : ndarray
        Displacements at which the list is to be made.
    """

    def is_new(self):
        """Whether contacts have to be listed anew since this was asked."""
        new, self._new = self._new, False
        return new

    def _list(self, u):
        self._new, self.at = hasattr(self, "at"), u.copy()  # the first list is the scene's own
        x = self._of.positions + u
        _, listed = self._of.near(u)
        every = self._of.wall_pairs(x)
        known = {tuple(pair) for pair in listed.tolist()}
        edges = [pair for pair in every.tolist() if tuple(pair) not in known]
        self._edges, self._walls = np.array(edges, dtype=int).reshape(-1, 2), listed

    def _look(self, u):
        of, x = self._of, self._of.positions + u
        moved = np.sqrt(np.max(np.sum((u - self.at) ** 2, axis=1), initial=0.0))
        if moved > of.skin / 4:
            self._list(u)
            moved = 0.0
        self._left = self._room = min(
            of.skin / 2 - moved,
            np.min(of.wall_gaps(x, self._edges), initial=math.inf),
            np.min(of.hold(x), initial=math.inf),
            np.min(self._beside(x), initial=math.inf),
        )

    def _beside(self, x):
        """Way of listed sites to the end of their wall [m]."""
        return -self._of._by_wall(x, self._walls, lambda wall, at: wall.overhang(at))

    def judge(self, u, t):
        """Look again after one step that may have gone too far; raise if it did."""
        of, x = self._of, self._of.positions + u
        moved = float(np.sqrt(np.max(np.sum((u - self.at) ** 2, axis=1), initial=0.0)))
        if moved >= of.skin / 2:
            raise StabilityError(
                f"a site moved {moved:.3g} m in one step before t = {t:.6g} s, contacts are "
                f"followed over {of.skin / 2:.3g} m: take a smaller step"
            )
        gaps = of.wall_gaps(x, self._edges)
        if len(gaps) and gaps.min() <= 0:
            site, wall = self._edges[int(np.argmin(gaps))].tolist()
            raise ContactError(f"site {site} touches the end of wall {wall} at t = {t:.6g} s")
        self._list(u)
        self._look(u)
