"""The common base of guides and packs of beads: a `tensegrity.Network` of contacts and walls.

The contacts are a fixed list or, if contacts may form and break, those that the network finds near
given displacements: see `granular.contact_network`.

In static equilibrium under gravity and other constant loads the set of loaded contacts is unknown:
it is found from the forces and the stiffness of the scene, by `tensegrity.minimum`.  Where Newton's
step does not lower the energy, a fraction of the secant stiffness, force over overlap, is added to
each contact (contacts that only touch, or are open, have no tangent stiffness), and its
destabilising geometric stiffness is reduced.  Steps are short compared with a radius, and a
displacement above a tenth of a radius is an error: the equilibrium sought is that next to the
initial configuration, not that of a collapsed heap.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from granular.beads import Bead, Material
from granular.contact import BY_BEADS, Contact, ContactLaw, by_beads, contact_of
from granular.contact_network import Crystal, WithWalls, site_name
from granular.damped_contact import forces_of
from tensegrity import (
    EquilibriumError,
    Force,
    Network,
    Potential,
    PowerLaw,
    State,
    TensegrityError,
    check,
    minimum,
)
from tensegrity.engine import forces
from tensegrity.printing import Lines, Printed
from tensegrity.readonly import ReadOnly, Repeated, fixed
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.forcing import start_driven_sites
from tensegrity.springs.collection import numbered
from tensegrity.springs.pressed import rest_overlaps
from tensegrity.typing import Array

GUESS = 1e-6  # overlap of a contact that only touches, in radii, where its spring is evaluated
FLOOR = 1e-3  # of the stiffest such spring: a contact that is open
LONGEST, FARTHEST = 0.02, 0.1  # radii: of one step, and of all
BARE = 1e-12  # stiffness of motions without any, over the largest
CARRIED = 1e-11  # of the sum of all loads: what may be left over


@dataclass(frozen=True, eq=False, repr=False)
class Equilibrium(Printed, ReadOnly):
    """Beads at rest under their loads.

    Attributes
    ----------
    u : ndarray, (sites, dim)
        Displacements from the initial places [m].
    residual : float
        Sum over all beads of the unbalanced force [N].
    contacts : int
        Number of loaded contacts, including those with walls.
    """

    u: Array
    residual: float
    contacts: int

    def _lines(self) -> Lines:
        way = np.linalg.norm(self.u, axis=-1)
        yield (
            f"{len(self.u)} beads at rest under their loads: {self.contacts} contacts carry, "
            f"{self.residual:.1e} N are unbalanced"
        )
        yield f"  displacements up to {way.max():.6g} m, of site {int(way.argmax())}"

    def __post_init__(self) -> None:
        object.__setattr__(self, "u", fixed(self.u))


def rest_of(scene: Assembly, attract: bool, **unstruck: Any) -> Equilibrium | None:
    """Static equilibrium of a scene without its striker; None without loads or attraction.

    A scene with a striker is rebuilt without it, with `unstruck` in place of its arguments.
    """
    if not (attract or np.any(scene.loads)):
        return None
    if scene.striker is None:
        return settle(scene)
    made: Any = type(scene)(**scene._arguments | unstruck)
    return made.equilibrium


def settle(scene: Assembly) -> Equilibrium:
    """Static equilibrium of the beads of a scene under its loads.

    Raises
    ------
    EquilibriumError
        A bead has no support, or moves by more than a tenth of its radius.
    """
    of = _Listed(scene)
    u, pulled = of.drawn_together()
    total = np.abs(scene.loads).sum() + pulled
    u, f = minimum.settle(of, u, shift=1.0)
    left = float(np.abs(f).sum())
    if not left <= CARRIED * total:
        worst = int(np.argmax(np.abs(f).max(axis=1)))
        raise EquilibriumError(
            f"{site_name(scene, worst)} finds no equilibrium under the loads: {left:.3g} N are "
            f"unbalanced, must be at most {CARRIED * total:.3g} N, {CARRIED:g} of the loads"
        )
    return Equilibrium(u, left, of.carrying(u))


class _Listed:
    """A scene with the contacts that it lists near given displacements: a
    `minimum.Energy`."""

    def __init__(self, scene: Assembly) -> None:
        self._whole = scene
        self._radius = np.array([bead.radius for bead in scene.beads])
        self.longest = LONGEST * self._radius
        self._last: tuple[Any, Any] = None, None
        of = dynamics(scene)
        self._list(np.zeros(scene.shape))
        self._room = of.clearance.skin / 4 if of.follows else np.inf

    def _list(self, u: Array) -> None:
        """List the contacts near displacements, with the overlap at rest [m] and the stiffness
        there [N/m] of those that attract."""
        of: Any = dynamics(self._whole).listed(u)
        self._listed, self._at, self._rest = of, u, rest_overlaps(of.springs)
        if self._rest.any():
            stiffness = of.springs.evaluate("stiffness", -self._rest)
            self._firm = np.where(self._rest > 0, stiffness, 0.0)

    def _forces_at(self, u: Array) -> tuple[Any, Array, Array, Array]:
        """Dynamics with the contacts there, their elongations and directions, and tensions; those
        of the last array asked about are kept, as Newton's method asks for them five times."""
        if u is not self._last[0]:
            if np.abs(u - self._at).max() > self._room:
                self._list(u)
            of = self._listed
            r, along = forces.elongations(of.contact_bonds, u)
            self._last = u, (of, r, along, of.springs.evaluate("tension", r))
        return self._last[1]

    def drawn_together(self) -> tuple[Array, float]:
        """Displacements at which contacts that attract have, to first order, their overlap at rest,
        and the sum of the forces that this takes [N]."""
        from scipy.sparse import eye_array

        u = np.zeros(self._whole.shape)
        of, r, along, _ = self._forces_at(u)
        if not self._rest.any():
            return u, 0.0
        rest, k = self._rest, self._firm
        f = forces.scattered_forces(of.contact_bonds, k * rest, along)[: of.sites]
        matrix = forces.tangent(of.contact_bonds, r, along, 0 * r, k).tocsc()[: f.size, : f.size]
        bare = BARE * np.abs(matrix.diagonal()).max() * eye_array(f.size)
        move = minimum.downhill(matrix + bare, np.zeros((f.size, 0)), f.ravel())
        return u if move is None else move.reshape(f.shape), float((k * rest).sum())

    def forces(self, u: Array) -> Array:
        of, _, along, tension = self._forces_at(u)
        pull: Array = forces.scattered_forces(of.contact_bonds, tension, along)[: of.sites]
        return pull + self._whole.loads

    def energy(self, u: Array) -> tuple[float, float]:
        of, r, _, _ = self._forces_at(u)
        stored = of.springs.evaluate("energy", r)
        work = float(np.sum(self._whole.loads * u))
        return float(stored.sum()) - work, float(np.abs(stored).sum()) + abs(work)

    def largest(self, u: Array) -> float:
        return max(np.abs(self._forces_at(u)[-1]).max(initial=0.0), np.abs(self._whole.loads).max())

    def allowed(self, u: Array) -> float:
        return float(CARRIED * np.abs(self._whole.loads).sum())

    def carrying(self, u: Array) -> int:
        """Number of contacts that carry."""
        return int(np.count_nonzero(self._forces_at(u)[-1]))

    def newton(self, u: Array, f: Array) -> Callable[[float], Array | None]:
        from scipy.sparse import eye_array

        of, r, along, tension = self._forces_at(u)
        bonds, table, rigid = of.contact_bonds, of.springs, np.zeros((f.size, 0))
        least = GUESS * self._radius.min()
        pressed = np.minimum(r, -least)
        secant = table.evaluate("tension", pressed) / pressed
        secant = np.where(r > least * GUESS, FLOOR * secant.max(initial=0.0), secant)
        if self._rest.any():
            secant = np.where(self._rest > 0, self._firm, secant)
        own = forces.tangent(bonds, r, along, tension, table.evaluate("stiffness", r))
        added = forces.tangent(bonds, r, along, -tension, secant)

        def step(shift: float) -> Array | None:
            matrix = (own + shift * added).tocsc()[: f.size, : f.size]
            bare = BARE * (np.abs(matrix.diagonal()).max(initial=0.0) or 1.0)  # no stiffness
            move = minimum.downhill(matrix + bare * eye_array(f.size), rigid, f.ravel())
            return None if move is None else move.reshape(f.shape)

        return step

    def refuse(self, u: Array, f: Array) -> None:
        way = np.sqrt(np.sum(u**2, axis=1)) / (FARTHEST * self._radius)
        if not np.all(way < 1):
            site = int(np.argmax(np.nan_to_num(way, nan=np.inf)))
            raise EquilibriumError(
                f"{site_name(self._whole, site)} finds no equilibrium under the loads: it moved "
                f"{np.linalg.norm(u[site]):.3g} m, must be below "
                f"{FARTHEST * self._radius[site]:.3g} m, a tenth of its radius, and "
                f"{np.linalg.norm(f[site]):.3g} N on it are unbalanced"
            )


GAPS = np.logspace(-12, 0, 13)  # m: where a contact must not act


class Assembly(Crystal, Network):
    """Beads in the plane or in space (or on a line), between plane walls.

    Attributes
    ----------
    wall_names : tuple of str
        Name of each wall; the forces on walls of the same name are added.
    """

    _arguments_of_sites = BY_BEADS
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
        """Derivatives with respect to an argument of every bead; see `granular.contact`.

        Loads depend on the diameters too: they are refused.
        """
        if np.any(self.loads):
            raise TensegrityError("no derivatives by beads under loads, which depend on them too")
        walls = [(int(k), self._wall_materials[wall]) for k, wall in self.wall_contacts.tolist()]
        pairs = [*map(tuple, self.bonds.tolist()), *walls]
        return by_beads(
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
