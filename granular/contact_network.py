"""The contacts of beads by site and part, their energies, and the forces on walls.

`contacts_of` returns the contacts of a chain, a guide or a pack.  Those of guides and packs are
listed by the scene or, if contacts may form and break, near given displacements; see
`Network.listed`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from granular.crystal import Crystal, members, needed_velocities
from tensegrity import TensegrityError, check
from tensegrity.measure.observables import directions
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.on_site import on_site
from tensegrity.typing import Array, Indices


def contacts_of(scene: Any) -> Contacts:
    """The contacts of a scene of beads."""
    return Contacts(scene)


def wall_sites(scene: Crystal, name: str) -> list[int]:
    """Sites that must be recorded for `granular.wall_force` on the walls of a name.

    All sites if contacts may form and break.
    """
    check.kind("scene", scene, Crystal)
    return Contacts(scene).of_wall(name)


def wall_forces(scene: Crystal, u: ArrayLike, name: str, v: ArrayLike | None = None) -> Array:
    """Contact force of each site on the walls of a name at displacements u.

    Parameters
    ----------
    scene : BeadChain, Guide or Pack
    u : array_like, (..., sites[, dim])
        [m]
    name : str
        As for `granular.wall_force`.
    v : array_like, shape of u, optional
        Velocities [m/s], for contacts that dissipate.

    Returns
    -------
    ndarray, (..., sites)
        [N], compression > 0.
    """
    check.kind("scene", scene, Crystal)
    return Contacts(scene).wall_forces(u, name, v)


def kinetic(scene: Any, v: Array) -> Array:
    """Kinetic energy of each site [J]; v (..., *shape of the scene) gives (..., sites)."""
    return 0.5 * scene.mass * _by_site(scene, v**2)


class Contacts:
    """The contacts of a scene, numbered as its `contact_forces`."""

    def __init__(self, scene: Any) -> None:
        self.scene = scene

    def of_site(self, site: int) -> list[int]:
        """Numbers of the contacts of a bead, those with the walls of guides and packs last."""
        at_walls = self.scene._with_walls()
        pairs = np.flatnonzero((self.scene.bonds == site).any(axis=1)).tolist()
        return sorted({*pairs, *at_walls.contacts[at_walls.sites == site].tolist()})

    def within(self, part: str | None) -> list[int]:
        """Numbers of the contacts between sites of a part, or between any."""
        sites = range(self.scene.sites) if part is None else members(self.scene, part)
        return np.flatnonzero(np.isin(self.scene.bonds, list(sites)).all(axis=1)).tolist()

    def neighbours(self, site: int) -> list[int]:
        """Sites on which the contacts of a bead depend: all where contacts come."""
        bonds = self.scene.bonds
        if dynamics(self.scene).follows:
            return list(range(self.scene.sites))
        return sorted({site, *bonds[(bonds == site).any(axis=1)].ravel().tolist()})

    def sensed(self, u: Array, v: Array, sites: Sequence[int]) -> Array:
        """Forces across the middle planes of beads; see `sensor_force`.

        Parameters
        ----------
        u, v : ndarray, (..., *shape of the scene)
            [m], [m/s]
        sites : sequence of int

        Returns
        -------
        ndarray, (..., sites)
            [N]
        """

        def forces(scene: Any, rows: Array, rates: Array) -> Array:
            of, load = Contacts(scene), scene.contact_forces(rows, rates)
            parts = [load[..., of.of_site(s)] * of.cosines(rows, s) for s in sites]
            return np.stack([one.sum(axis=-1) / 2 for one in parts], axis=-1)

        return self._each(u, forces, v)

    def cosines(self, u: Array, site: int) -> Array:
        """|n . k| of each contact of a bead, k along its displacement; (..., contacts).

        0 for a bead that has not moved; 1 in a chain.
        """
        scene, count = self.scene, len(self.scene.bonds)
        if len(scene.shape) == 1:
            return np.ones(len(self.of_site(site)))
        size = np.linalg.norm(u[..., site, :], axis=-1, keepdims=True)
        k = u[..., site, :] / np.where(size > 0, size, 1.0)
        numbers = np.array(self.of_site(site), dtype=int)
        bonds, walls = numbers[numbers < count], numbers[numbers >= count] - count
        normals = [scene.walls[w].normal for w in scene.wall_contacts[walls, 1]]
        along = np.einsum("...bk,...k->...b", directions(scene, u)[..., bonds, :], k)
        across = k @ np.array(normals).reshape(-1, scene.dim).T
        return np.abs(np.concatenate([along, across], axis=-1))

    def bead_energies(self, u: Array, v: Array) -> Array:
        """Energy of each site [J], without the contacts with walls; (..., sites)."""
        scene = self.scene
        held = kinetic(scene, v) + self._each(u, _of_pairs)
        return held - _by_site(scene, scene.loads * u) + _by_site(scene, on_site(scene, 0, u))

    def wall_energy(self, u: Array) -> Array:
        """Energy of all contacts with walls [J]; (...)."""
        return self._each(u, lambda scene, rows: _at_walls(scene, rows).sum(axis=-1))

    def stored(self, u: Array) -> Array:
        """Half the energy of each bead's contacts with others, and all of those with walls [J].

        What the contacts store by themselves, without the potential of the loads; (..., sites).
        """
        return self._each(u, lambda scene, rows: _shared(scene, scene._stored_energies(rows)))

    def of_wall(self, name: str) -> list[int]:
        """Sites on which the forces on the walls of a name depend: all if contacts may form."""
        numbers, at_walls = self._walls(name), self.scene._with_walls()
        if dynamics(self.scene).follows:
            return list(range(self.scene.sites))
        return sorted(set(at_walls.sites[np.isin(at_walls.walls, numbers)].tolist()))

    def wall_forces(self, u: ArrayLike, name: str, v: ArrayLike | None) -> Array:
        """Contact force of each site on the walls of a name.

        Parameters
        ----------
        u, v, name
            As of `wall_forces`.

        Returns
        -------
        ndarray, (..., sites)
            [N], compression > 0.
        """
        numbers = self._walls(name)

        def forces(scene: Any, rows: Array, rates: Any = None) -> Array:
            at_walls = scene._with_walls()
            chosen = np.isin(at_walls.walls, numbers)
            loads = scene.contact_forces(rows, rates)[..., at_walls.contacts[chosen]]
            by_site = np.zeros((*loads.shape[:-1], scene.sites))
            return _added(by_site, at_walls.sites[chosen], loads)

        if not self.scene._losses:
            return self._each(u, forces)
        return self._each(u, forces, needed_velocities(self.scene, v))

    def _walls(self, name: str) -> list[int]:
        """Numbers of the walls of that name."""
        names = self.scene.wall_names
        if not isinstance(name, str) or name not in names:
            listed = ", ".join(dict.fromkeys(names)) or "none"
            raise TensegrityError(f"wall {check.shown(name)} is not one of this scene's: {listed}")
        return [k for k, given in enumerate(names) if given == name]

    def _each(self, u: ArrayLike, function: Callable[..., Array], *more: Array) -> Array:
        """`function(scene, rows, ..)` of all rows, by the contacts that are listed there."""
        shape = self.scene.shape
        u = check.rows("displacements", u, shape)
        flat, others = u.reshape(-1, *shape), [one.reshape(-1, *shape) for one in more]
        listings = dynamics(self.scene).listings(flat)
        parts = [
            function(listed.scene, flat[rows], *(one[rows] for one in others))
            for rows, listed in listings
        ]
        values = np.concatenate(parts) if parts else np.zeros((0, *shape[:1]))
        return values.reshape((*u.shape[: u.ndim - len(shape)], *values.shape[1:]))


def _by_site(scene: Any, values: Array) -> Array:
    """Sums over the coordinates of each site; (..., *shape of the scene) gives (..., sites)."""
    return values if len(scene.shape) == 1 else np.sum(values, axis=-1)


def _of_pairs(scene: Any, u: Array) -> Array:
    """Half the energy of each bead's contacts with others, with the potential of loads [J]."""
    energies = dynamics(scene).evaluate("energy", u)
    energies[..., scene._with_walls().contacts] = 0.0
    return _shared(scene, energies)


def _at_walls(scene: Any, u: Array) -> Array:
    """Energy of each contact with a wall [J]; (..., contacts with walls)."""
    return np.take(dynamics(scene).evaluate("energy", u), scene._with_walls().contacts, axis=-1)


def _shared(scene: Any, energies: Array) -> Array:
    """Energies of contacts, (..., contacts), in equal parts on two beads, or on that at a wall;
    (..., sites)."""
    by_site, at_walls = np.zeros((*energies.shape[:-1], scene.sites)), scene._with_walls()
    half, within = energies[..., : len(scene.bonds)] / 2, at_walls.contacts < len(scene.bonds)
    for end in scene.bonds.T:
        _added(by_site, end, half)
    standing, beads = at_walls.contacts[within], at_walls.sites[within]
    by_site[..., scene.bonds[standing].sum(axis=1) - beads] = 0.0  # sites that stand for walls
    _added(by_site, beads, half[..., standing])
    others = at_walls.contacts[~within]
    return _added(by_site, at_walls.sites[~within], np.take(energies, others, axis=-1))


def _added(total: Array, sites: Indices, values: Array) -> Array:
    """`total` (..., sites) with values (..., contacts) added at their sites, in place."""
    np.add.at(np.moveaxis(total, -1, 0), sites, np.moveaxis(values, -1, 0))
    return total
