"""What guides and packs of beads have in common: a `tensegrity.Network` of contacts and walls.

Contacts are those of the network's list, or, where they come and go, those that the network lists
near given displacements: see `granular.contact_network`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from granular import sensitivity
from granular.contact import contact_of
from granular.crystal import Crystal
from tensegrity import Network, State, TensegrityError
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
    """

    wall_names: tuple[str, ...]
    _wall_materials: tuple[Material, ...]
    _rest: Array  # displacements [m] in equilibrium under the loads

    def at_rest(self, velocity: Mapping[int, Sequence[float]] | None = None) -> State:
        """All at rest under the loads, some sites given a velocity [m/s]: {site: (dim,)}."""
        state = State(self._rest, super().at_rest(velocity).v)
        self.check(state)
        return state

    def _dynamics(self) -> AssemblyDynamics:
        return AssemblyDynamics(self)

    def contact_forces(self, u: ArrayLike) -> Array:
        """Compressive force in each listed contact [N], those with walls last; (..., contacts)."""
        self._refuse_followed("contact forces")
        return np.concatenate([-self.bond_tension(u), self.wall_load(u)], axis=-1)

    def overlaps(self, u: ArrayLike) -> Array:
        """Overlap of each listed contact of two beads [m], < 0 for a gap; (..., bonds)."""
        self._refuse_followed("overlaps")
        return -self.elongation(u)

    def _refuse_followed(self, what: str) -> None:
        if dynamics(self).follows:
            raise TensegrityError(
                f"{what} of contacts that come and go: ask those of one instant, listed(u)"
            )


class AssemblyDynamics(NetworkDynamics):
    """Of beads; see `tensegrity.scenes.dynamics`."""

    arguments = sensitivity.NAMES

    def by_argument(
        self, name: str, by_mass: Array, by_spring: Callable[[str], Array], by_gap: Any
    ) -> Array:
        """Derivatives by an argument of every bead at its place; see `granular.sensitivity`."""
        scene = self.scene
        if np.any(scene.loads):
            raise TensegrityError("no derivatives by beads under loads, which depend on them too")
        walls = [(int(k), scene._wall_materials[wall]) for k, wall in scene.wall_contacts.tolist()]
        pairs = [*map(tuple, scene.bonds.tolist()), *walls]
        return sensitivity.by_beads(
            name, scene.beads, pairs, scene.springs, by_spring("stiffness"), by_mass, by_gap
        )

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
        self._known: dict[tuple[Bead, Bead | Material], tuple[Contact, PowerLaw]] = {}
        self._quick: dict[tuple[int, int], tuple[Bead, Bead | Material, PowerLaw]] = {}

    @property
    def contacts(self) -> list[Contact]:
        """In the order in which the law was asked for them."""
        return [contact for contact, _ in self._known.values()]

    def contact(self, bead: Bead, other: Bead | Material) -> Contact:
        """That of two partners, for which the law is asked once."""
        if (bead, other) not in self._known:
            contact = contact_of(self._law, bead, other)
            self._known[bead, other] = contact, contact.spring()
        return self._known[bead, other][0]

    def __call__(self, bead: Bead, other: Bead | Material) -> PowerLaw:
        same = id(bead), id(other)
        if same not in self._quick:  # the two are kept there: ids stay theirs
            self.contact(bead, other)
            self._quick[same] = bead, other, self._known[bead, other][1]
        return self._quick[same][-1]
