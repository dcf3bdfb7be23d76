"""The contacts of beads by site and part, their energies, and the forces on walls.

`contacts_of` returns the contacts of a chain, a guide or a pack.  Those of guides and packs are
listed by the scene or, if contacts may form and break, near given displacements; see
`Network.listed`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from granular.crystal import Crystal, members, needed_velocities
from tensegrity import Chain, TensegrityError, check
from tensegrity.measure.observables import directions
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.scene import unchecked_state
from tensegrity.springs.collection import Springs
from tensegrity.typing import Array, Indices


def contacts_of(scene: Any) -> ChainContacts | AssemblyContacts:
    """The contacts of a scene of beads."""
    return ChainContacts(scene) if isinstance(scene, Chain) else AssemblyContacts(scene)


def wall_sites(scene: Crystal, name: str) -> list[int]:
    """Sites that must be recorded for `granular.wall_force` on the walls of a name.

    All sites if contacts may form and break.
    """
    check.kind("scene", scene, Crystal)
    return contacts_of(scene).of_wall(name)


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
    return contacts_of(scene).wall_forces(u, name, v)


class ChainContacts:
    """Of a `BeadChain`: contact j joins sites j and j + 1."""

    def __init__(self, scene: Any) -> None:
        self.scene, last = scene, scene.sites - 1
        self.wall_sites = {"start": (0, 1)} if "start wall" in scene.parts else {}
        self.wall_sites |= {"end": (last, last - 1)} if "wall" in scene.parts else {}

    def of_site(self, site: int) -> list[int]:
        """Numbers of the contacts of a site."""
        return [j for j in (site - 1, site) if 0 <= j < self.scene.sites - 1]

    def within(self, part: str | None) -> list[int]:
        """Numbers of the contacts between beads of a part, or of all."""
        inside = set(range(self.scene.sites) if part is None else members(self.scene, part))
        return [j for j in range(self.scene.sites - 1) if {j, j + 1} <= inside]

    def neighbours(self, site: int) -> list[int]:
        """Sites on which the contacts of a site depend."""
        return [s for s in (site - 1, site, site + 1) if 0 <= s < self.scene.sites]

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
        forces = self.scene.contact_forces(u, v)
        return np.stack([forces[..., self.of_site(s)].sum(axis=-1) / 2 for s in sites], axis=-1)

    def bead_energies(self, u: Array, v: Array) -> Array:
        """Energy of each site [J], without the contacts with walls; (..., sites)."""
        energies = self.scene.site_energy(unchecked_state(u, v))
        for wall, bead in self.wall_sites.values():
            energies[..., bead] -= energies[..., wall]
            energies[..., wall] = 0
        return energies

    def wall_energy(self, u: Array) -> Array:
        """Energy of the contacts with walls [J]; (...)."""
        stored = self.scene.site_energy(unchecked_state(u, np.zeros_like(u)))
        return sum((2 * stored[..., wall] for wall, _ in self.wall_sites.values()),
                   start=np.zeros(u.shape[:-1]))  # fmt: skip

    def stored(self, u: Array) -> Array:
        """Half the energy of each bead's contacts with others, and all of those with walls [J].

        What the contacts store by themselves, without the potential of the loads; (..., sites).
        """
        laws = Springs([contact.potential for contact in self.scene.contacts])
        energy = laws.evaluate("energy", -self.scene.overlaps(u))
        by_bead = np.zeros(u.shape)
        by_bead[..., :-1] += energy / 2
        by_bead[..., 1:] += energy / 2
        for wall, bead in self.wall_sites.values():
            by_bead[..., bead] += by_bead[..., wall]
            by_bead[..., wall] = 0
        return by_bead

    def of_wall(self, name: str) -> list[int]:
        """Sites on which the force on a wall depends: its own and the bead's before it."""
        if not isinstance(name, str) or name not in self.wall_sites:
            raise unknown_wall(name, self.wall_sites)
        return list(self.wall_sites[name])

    def wall_forces(self, u: ArrayLike, name: str, v: ArrayLike | None) -> Array:
        """Contact force of each site on the wall of that name.

        Parameters
        ----------
        u, v, name
            As of `wall_forces`.

        Returns
        -------
        ndarray, (..., sites)
            [N], compression > 0.
        """
        bead = self.of_wall(name)[-1]
        forces = self.scene.contact_forces(u, v)
        by_site = np.zeros((*forces.shape[:-1], self.scene.sites))
        by_site[..., bead] = forces[..., 0 if name == "start" else -1]
        return by_site


class AssemblyContacts:
    """Of a `Guide` or a `Pack`: those of the bonds, behind them those with walls."""

    def __init__(self, scene: Any) -> None:
        self.scene = scene

    def of_site(self, site: int) -> list[int]:
        """Numbers of the contacts of a bead, those with walls last."""
        bonds, walls = self.scene.bonds, self.scene.wall_contacts
        pairs = np.flatnonzero((bonds == site).any(axis=1)).tolist()
        return [*pairs, *(len(bonds) + np.flatnonzero(walls[:, 0] == site)).tolist()]

    def within(self, part: str | None) -> list[int]:
        """Numbers of the contacts between beads of a part, or between any."""
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
            of, load = AssemblyContacts(scene), scene.contact_forces(rows, rates)
            parts = [load[..., of.of_site(s)] * of.cosines(rows, s) for s in sites]
            return np.stack([one.sum(axis=-1) / 2 for one in parts], axis=-1)

        return self._each(u, forces, v)

    def cosines(self, u: Array, site: int) -> Array:
        """|n . k| of each contact of a bead, k along its displacement; (..., contacts).

        0 for a bead that has not moved.
        """
        scene, count = self.scene, len(self.scene.bonds)
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
        motion = 0.5 * self.scene.mass * np.sum(v**2, axis=-1)
        return motion + self._each(u, _by_beads) - np.sum(self.scene.loads * u, axis=-1)

    def wall_energy(self, u: Array) -> Array:
        """Energy of all contacts with walls [J]; (...)."""
        return self._each(u, lambda scene, rows: _wall_energies(scene, rows).sum(axis=-1))

    def stored(self, u: Array) -> Array:
        """Half the energy of each bead's contacts with others, and all of those with walls [J]."""

        def stored(scene: Any, rows: Array) -> Array:
            by_site = _by_beads(scene, rows)
            return _added(by_site, scene.wall_contacts[:, 0], _wall_energies(scene, rows))

        return self._each(u, stored)

    def of_wall(self, name: str) -> list[int]:
        """Sites on which the forces on the walls of a name depend: all if contacts may form."""
        numbers = self._walls(name)
        if dynamics(self.scene).follows:
            return list(range(self.scene.sites))
        contacts = self.scene.wall_contacts
        return sorted(set(contacts[np.isin(contacts[:, 1], numbers), 0].tolist()))

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
            chosen = np.isin(scene.wall_contacts[:, 1], numbers)
            load = scene.wall_load(rows)
            if scene._losses:
                load = scene.contact_forces(rows, rates)[..., len(scene.bonds) :]
            sites = scene.wall_contacts[chosen, 0]
            return _added(np.zeros(rows.shape[:-1]), sites, load[..., chosen])

        if not self.scene._losses:
            return self._each(u, forces)
        return self._each(u, forces, needed_velocities(self.scene, v))

    def _walls(self, name: str) -> list[int]:
        """Numbers of the walls of that name."""
        if not isinstance(name, str) or name not in self.scene.wall_names:
            raise unknown_wall(name, dict.fromkeys(self.scene.wall_names))
        return [k for k, given in enumerate(self.scene.wall_names) if given == name]

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
        return values.reshape((*u.shape[:-2], *values.shape[1:]))


def _by_beads(scene: Any, u: Array) -> Array:
    """Half the energy of each bead's listed contacts with others [J]; (..., sites)."""
    half, by_bead = scene.bond_energy(u) / 2, np.zeros(u.shape[:-1])
    for end in scene.bonds.T:
        _added(by_bead, end, half)
    return by_bead


def _wall_energies(scene: Any, u: Array) -> Array:
    """Energy of each listed contact with a wall [J]; (..., wall contacts)."""
    return dynamics(scene).evaluate("energy", u)[..., len(scene.bonds) :]


def _added(total: Array, sites: Indices, values: Array) -> Array:
    """`total` (..., sites) with values (..., contacts) added at their sites, in place."""
    np.add.at(np.moveaxis(total, -1, 0), sites, np.moveaxis(values, -1, 0))
    return total


def unknown_wall(name: object, known: Iterable[str]) -> TensegrityError:
    """The error for a wall that the scene does not have."""
    listed = ", ".join(known) or "none"
    return TensegrityError(f"wall {check.shown(name)} is not one of this scene's: {listed}")
