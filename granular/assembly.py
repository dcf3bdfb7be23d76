"""What guides and packs of beads have in common: a `tensegrity.Network` of contacts and walls.

Contacts are those of the network's list, or, where they come and go, those that the network lists
near given displacements: see `Assembly.listings`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from granular import sensitivity
from granular.contact import contact_of
from granular.crystal import Crystal
from tensegrity import Network, State, TensegrityError, check
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.network_dynamics import NetworkDynamics

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from typing import Any

    from numpy.typing import ArrayLike

    from granular.beads import Bead
    from granular.contact import Contact, ContactLaw
    from granular.materials import Material
    from tensegrity.springs.power_law import PowerLaw
    from tensegrity.typing import Array


class Assembly(Crystal, Network):
    """Beads in the plane or in space (or on a line), between plane walls.

    Attributes
    ----------
    wall_names : tuple of str
        Of each wall; walls of one name count together.
    wall_materials : tuple of Material
    rest : ndarray, (sites, dim)
        Displacements [m] in equilibrium under the loads, 0 where there are none.
    """

    wall_names: tuple[str, ...]
    wall_materials: tuple[Material, ...]
    rest: Array

    def at_rest(self, velocity: Mapping[int, Sequence[float]] | None = None) -> State:
        """All at rest under the loads, some sites given a velocity [m/s]: {site: (dim,)}."""
        state = State(self.rest, super().at_rest(velocity).v)
        self.check(state)
        return state

    def _dynamics(self) -> AssemblyDynamics:
        return AssemblyDynamics(self)

    bead_arguments = sensitivity.NAMES

    def by_beads(
        self, name: str, by_mass: Array, by_spring: Callable[[str], Array], by_gap: Array
    ) -> Array:
        """Derivatives by an argument of every bead at its place; see `granular.sensitivity`."""
        if np.any(self.loads):
            raise TensegrityError("no derivatives by beads under loads, which depend on them too")
        walls = [(int(k), self.wall_materials[wall]) for k, wall in self.wall_contacts.tolist()]
        pairs = [*map(tuple, self.bonds.tolist()), *walls]
        by_constant = by_spring("stiffness")
        return sensitivity.by_beads(
            name, self.beads, pairs, self.springs, by_constant, by_mass, by_gap
        )

    def name(self, site: int) -> str:
        """Words for a site: its part and its number in it, from 1."""
        for part, sites in self.parts.items():
            if site in sites:
                known = f"bead {sites.index(site) + 1} of {part}"
                return "the striker" if part == "striker" else known
        return f"site {site}"

    def contact_forces(self, u: ArrayLike) -> Array:
        """Compressive force in each listed contact [N], those with walls last; (..., contacts)."""
        self._refuse_followed("contact forces")
        return np.concatenate([-self.bond_tension(u), self.wall_load(u)], axis=-1)

    def overlaps(self, u: ArrayLike) -> Array:
        """Overlap of each listed contact of two beads [m], < 0 for a gap; (..., bonds)."""
        self._refuse_followed("overlaps")
        return -self.elongation(u)

    def contacts_at(self, site: int) -> list[int]:
        """Numbers of the contacts of a bead, those with walls last."""
        walls = len(self.bonds) + np.flatnonzero(self.wall_contacts[:, 0] == site)
        return [*np.flatnonzero((self.bonds == site).any(axis=1)).tolist(), *walls.tolist()]

    def contacts_within(self, part: str | None = None) -> list[int]:
        """Numbers of the contacts between beads of a part, or between any."""
        sites = range(self.sites) if part is None else self.members(part)
        return np.flatnonzero(np.isin(self.bonds, list(sites)).all(axis=1)).tolist()

    def needed(self, site: int) -> list[int]:
        """Sites on which the contacts of a bead depend."""
        return sorted({site, *self.bonds[(self.bonds == site).any(axis=1)].ravel().tolist()})

    def cosines(self, u: Array, site: int) -> Array:
        """|n . k| of each contact of a bead, k along its displacement; (..., contacts).

        0 for a bead that has not moved.
        """
        size = np.linalg.norm(u[..., site, :], axis=-1, keepdims=True)
        k = u[..., site, :] / np.where(size > 0, size, 1.0)
        numbers = np.array(self.contacts_at(site), dtype=int)
        bonds, walls = numbers[numbers < len(self.bonds)], numbers[numbers >= len(self.bonds)]
        normals = [self.walls[w].normal for w in self.wall_contacts[walls - len(self.bonds), 1]]
        along = np.einsum("...bk,...k->...b", self.direction(u)[..., bonds, :], k)
        across = k @ np.array(normals).reshape(-1, self.dim).T
        return np.abs(np.concatenate([along, across], axis=-1))

    def bead_energies(self, u: Array, v: Array) -> Array:
        """Energy of each site [J], contacts with walls apart; (..., sites)."""
        u, v = self._rows(u, v)
        held = self._each(u, lambda scene, rows: scene.stored_by_site(rows, walls=False))
        motion = 0.5 * self.mass * np.sum(v**2, axis=-1)
        return motion + held - np.sum(self.loads * u, axis=-1)

    def walls_hold(self, u: Array) -> Array:
        """Energy of all contacts with walls [J]; (...)."""
        return self._each(u, lambda scene, rows: scene._wall_energy(rows).sum(axis=-1))

    def held_by_beads(self, u: Array) -> Array:
        """Half the energy of each bead's contacts with others, and all of those with walls [J]."""
        return self._each(u, lambda scene, rows: scene.stored_by_site(rows, walls=True))

    def stored_by_site(self, u: Array, walls: bool) -> Array:
        """The same from the listed contacts, without those with walls or with them."""
        result = np.zeros(u.shape[:-1])
        by_site = np.moveaxis(result, -1, 0)  # a view
        half = np.moveaxis(self.bond_energy(u), -1, 0) / 2
        for end in self.bonds.T:
            np.add.at(by_site, end, half)
        if walls:
            np.add.at(by_site, self.wall_contacts[:, 0], np.moveaxis(self._wall_energy(u), -1, 0))
        return result

    def _wall_energy(self, u: Array) -> Array:
        """Energy of each contact with a wall [J]; (..., wall contacts)."""
        return dynamics(self).each("energy", u)[..., len(self.bonds) :]

    def walls_named(self, name: str) -> list[int]:
        """Numbers of the walls of that name; TensegrityError if there is none."""
        if not isinstance(name, str) or name not in self.wall_names:
            known = ", ".join(dict.fromkeys(self.wall_names)) or "none"
            raise TensegrityError(f"wall {check.shown(name)} is not one of this scene's: {known}")
        return [k for k, given in enumerate(self.wall_names) if given == name]

    def wall_forces(self, u: ArrayLike, name: str) -> Array:
        """Contact force of each site on the walls of a name [N], compression > 0; (..., sites)."""
        numbers = self.walls_named(name)

        def forces(scene: Assembly, rows: Array) -> Array:
            result = np.zeros(rows.shape[:-1])
            chosen = np.isin(scene.wall_contacts[:, 1], numbers)
            load = np.moveaxis(scene.wall_load(rows)[..., chosen], -1, 0)
            np.add.at(np.moveaxis(result, -1, 0), scene.wall_contacts[chosen, 0], load)
            return result

        return self._each(u, forces)

    def touches_wall(self, name: str) -> list[int]:
        """Sites on which the forces on the walls of a name depend: all where contacts come."""
        numbers = self.walls_named(name)
        if dynamics(self).follows:
            return list(range(self.sites))
        listed = np.isin(self.wall_contacts[:, 1], numbers)
        return sorted(set(self.wall_contacts[listed, 0].tolist()))

    def _each(self, u: ArrayLike, function: Callable[[Any, Array], Array]) -> Array:
        """`function(scene, rows)` of all rows, by the contacts that are listed there."""
        u = check.rows("displacements", u, self.shape)
        flat = u.reshape(-1, *self.shape)
        listings = dynamics(self).listings(flat)
        parts = [function(listed.scene, flat[rows]) for rows, listed in listings]
        found = np.concatenate(parts) if parts else np.zeros((0, *self.shape[:1]))
        return found.reshape((*u.shape[:-2], *found.shape[1:]))

    def _refuse_followed(self, what: str) -> None:
        if dynamics(self).follows:
            raise TensegrityError(
                f"{what} of contacts that come and go: ask those of one instant, listed(u)"
            )


class AssemblyDynamics(NetworkDynamics):
    """Of beads; see `tensegrity.scenes.dynamics`."""

    def available_energy(self, state: State, energy: float | None = None) -> float:
        """Energy of motion and contacts [J], which any contact could get.

        That of the loads counts from the places as laid, where it could be below 0.
        """
        loaded = float(np.sum(self.scene.loads * state.u))
        return super().available_energy(state, energy) + loaded


class SharedSprings:
    """One spring object for all contacts of the same kind of partners."""

    def __init__(self, law: ContactLaw) -> None:
        self._law = law
        self._known: dict[tuple[Bead, Bead | Material], PowerLaw] = {}
        self._quick: dict[tuple[int, int], tuple[Bead, Bead | Material, PowerLaw]] = {}
        self.contacts: list[Contact] = []

    def __call__(self, bead: Bead, other: Bead | Material) -> PowerLaw:
        same = id(bead), id(other)
        if same not in self._quick:
            pair = bead, other
            if pair not in self._known:
                self.contacts.append(contact_of(self._law, bead, other))
                self._known[pair] = self.contacts[-1].spring()
            self._quick[same] = bead, other, self._known[pair]  # the two are kept: ids stay theirs
        return self._quick[same][-1]
