"""The common base of guides and packs of beads: a `tensegrity.Network` of contacts and walls.

The contacts are a fixed list or, if contacts may form and break, those that the network finds near
given displacements: see `granular.contact_network`.
"""

from __future__ import annotations

import itertools
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from granular import sensitivity
from granular.contact import contact_of
from granular.crystal import Crystal, WithWalls
from granular.damped_contact import forces_of
from tensegrity import Network, PowerLaw, State, TensegrityError, check
from tensegrity.readonly import Repeated
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.forcing import start_driven_sites
from tensegrity.springs.collection import numbered
from tensegrity.springs.pressed import rest_overlaps

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from typing import Any

    from numpy.typing import ArrayLike

    from granular.beads import Bead
    from granular.contact import Contact, ContactLaw
    from granular.materials import Material
    from tensegrity import Force, Potential
    from tensegrity.typing import Array


GAPS = np.logspace(-12, 0, 13)  # m: where a contact must not act


class Assembly(Crystal, Network):
    """Beads in the plane or in space (or on a line), between plane walls.

    Attributes
    ----------
    wall_names : tuple of str
        Name of each wall; the forces on walls of the same name are added.
    """

    _arguments_of_sites = sensitivity.NAMES
    _wall_materials: tuple[Material, ...]
    _rest: Array  # displacements [m] in equilibrium under the loads
    _carried = _pressed = 0.0
    _hertzian: bool  # of a pack: whether the law is Hertz's

    def at_rest(self, velocity: Mapping[int, Sequence[float]] | None = None) -> State:
        """Equilibrium under the loads, with velocities [m/s] of some sites: {site: (dim,)}.

        A site whose motion is prescribed is where its drive begins.
        """
        u, state = self._rest.copy(), super().at_rest(velocity)
        if u.any():
            start_driven_sites(self, u, state.v.copy())
            state = State(u, state.v)
            self.check(state)
        return state

    def contact_forces(self, u: ArrayLike, v: ArrayLike | None = None) -> Array:
        if not dynamics(self).follows:
            return super().contact_forces(u, v)
        u = check.rows("displacements", u, self.shape)
        fixed = self.listed(u)
        forces, walls = fixed.contact_forces(u, v), fixed.wall_contacts
        forces[..., len(fixed.bonds) :] *= dynamics(self).clearance.faces(self.positions + u, walls)
        return forces

    def _by_argument(
        self, name: str, by_mass: Array, by_spring: Callable[[str], Array], by_gap: Any
    ) -> Array:
        """Derivatives with respect to an argument of every bead; see `granular.sensitivity`.

        Loads depend on the diameters too: they are refused.
        """
        if np.any(self.loads):
            raise TensegrityError("no derivatives by beads under loads, which depend on them too")
        walls = [(int(k), self._wall_materials[wall]) for k, wall in self.wall_contacts.tolist()]
        pairs = [*map(tuple, self.bonds.tolist()), *walls]
        return sensitivity.by_beads(
            name, self.beads, pairs, self.springs, by_spring("stiffness"), by_mass, by_gap
        )

    def _hidden_energy(self, state: State) -> float:
        """The potential of the loads [J], which may be negative, measured from the initial
        positions, and what contacts could store by attraction."""
        return float(np.sum(self.loads * state.u)) + self._attraction

    @cached_property
    def _attraction(self) -> float:
        """Energy [J] below 0 that all contacts could store by attraction."""
        springs = dynamics(self).springs
        rest = rest_overlaps(springs)
        return -float(springs.evaluate("energy", -rest).sum()) if rest.any() else 0.0

    def _with_walls(self) -> WithWalls:
        """The listed contacts with walls."""
        first = len(self.bonds)
        return WithWalls(first + np.arange(len(self.wall_contacts)), *self.wall_contacts.T)

    def _stored_energies(self, u: Array) -> Array:
        """Energy that each listed contact stores [J]; (..., contacts)."""
        return dynamics(self).evaluate("energy", u)


def _acting_in_touch(contact: Contact) -> Potential:
    """The potential of a contact, if it vanishes apart: contacts are listed from the touch on."""
    law = contact.potential
    gaps = GAPS[law.domain[1] > GAPS]
    if not isinstance(law, PowerLaw) and (law.energy(gaps).any() or law.tension(gaps).any()):
        raise TensegrityError(f"a contact acts on partners that are apart: {law!r}")
    return law


class SharedSprings:
    """Springs of contacts, one object for all contacts between equal partners."""

    def __init__(self, law: ContactLaw) -> None:
        self._law = law
        self._known: dict[tuple[Bead, Bead | Material], tuple[Contact, Potential]] = {}
        self._quick: dict[tuple[int, int], tuple[Bead, Bead | Material, Potential]] = {}

    @property
    def contacts(self) -> list[Contact]:
        """The contacts, in the order in which the law was first evaluated for them."""
        return [contact for contact, _ in self._known.values()]

    def contact(self, bead: Bead, other: Bead | Material) -> Contact:
        """The contact of two partners; the law is evaluated once for each pair."""
        if (bead, other) not in self._known:
            contact = contact_of(self._law, bead, other)
            self._known[bead, other] = contact, _acting_in_touch(contact)
        return self._known[bead, other][0]

    @property
    def attract(self) -> bool:
        """Whether partners of any contact so far attract each other."""
        return any(contact.attracts for contact in self.contacts)

    @property
    def dissipate(self) -> bool:
        """Whether any contact so far dissipates."""
        return any(one.dissipation and one.dissipation.constant for one in self.contacts)

    def try_all(self, beads: Repeated, solids: Sequence[Material]) -> None:
        """Evaluate the law for one bead of each material with each other, and with the walls."""
        one = {bead.material: bead for bead in reversed(beads.different)}
        for bead, other in itertools.product(one.values(), (*one.values(), *solids)):
            self.contact(bead, other)

    def losses(
        self,
        beads: Sequence[Bead],
        bonds: Any,
        solids: Sequence[Material],
        touched: Any,
        changing: bool = False,
    ) -> list[Force]:
        """What contacts add to their elastic forces.

        Parameters
        ----------
        beads : sequence of Bead, (sites,)
        bonds : ndarray of int, (bonds, 2)
        solids : sequence of Material, (walls,)
        touched : ndarray of int, (wall contacts, 2)
            Site and wall.
        changing : bool, optional
            Whether contacts of other kinds may form.

        Returns
        -------
        list of Force
        """
        if not self.dissipate:
            return []
        of_bonds = [self.contact(beads[i], beads[j]) for i, j in bonds.tolist()]
        of_walls = [self.contact(beads[i], solids[wall]) for i, wall in touched.tolist()]
        others = self.contacts if changing else []
        of_pairs = forces_of(of_bonds, [0.0] * len(of_bonds), "bonds", others)
        others = others if solids else []
        return [*of_pairs, *forces_of(of_walls, [0.0] * len(of_walls), "walls", others)]

    def between(self, beads: Repeated, others: Repeated) -> Repeated:
        """The springs of many pairs of partners, evaluated in the order of their first places."""
        count = len(others.different)
        distinct, number = numbered(beads.number * np.int64(count) + others.number)
        pairs = (divmod(key, count) for key in distinct.tolist())
        return Repeated([self(beads.different[i], others.different[j]) for i, j in pairs], number)

    def __call__(self, bead: Bead, other: Bead | Material) -> Potential:
        same = id(bead), id(other)
        if same not in self._quick:  # references to both are stored, so that their ids stay unique
            self.contact(bead, other)
            self._quick[same] = bead, other, self._known[bead, other][1]
        return self._quick[same][-1]
