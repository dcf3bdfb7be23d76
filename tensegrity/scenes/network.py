"""Masses in the plane or in space, joined by bonds in any pattern: a scene for `simulate`.

Model: point masses with two or three coordinates each; bonds, and contacts with plane walls,
whose force along the line of contact depends on their elongation only; constant loads.  The
list of contacts is fixed; where sites have a radius, the run makes sure that no other contact
formed (see `tensegrity.scenes.clearance`).  Source: seeds/001, eqs. (1)-(6).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check
from tensegrity.engine import forces
from tensegrity.engine.bonds import PAIR, WALL, Bonds, Contacts
from tensegrity.errors import TensegrityError
from tensegrity.notebook import page, wires
from tensegrity.readonly import fixed
from tensegrity.scenes.clearance import Clearance, crowding
from tensegrity.scenes.contact_geometry import contact_geometry
from tensegrity.scenes.following import Following, Listings, followed_law
from tensegrity.scenes.forcing import begun
from tensegrity.scenes.network_input import (
    held_sites,
    joined_pairs,
    numbers,
    per_site,
    plane_walls,
    site_number,
    springs_of,
    touching,
    whole_pairs,
)
from tensegrity.scenes.scene import Scene, State, velocities
from tensegrity.scenes.walls import Wall
from tensegrity.springs.potential import Potential

if TYPE_CHECKING:
    from typing import Any, Self

    import sympy as sp
    from numpy.typing import ArrayLike

    from tensegrity.engine.energies import Energies
    from tensegrity.scenes.forcing import Damping, Drive
    from tensegrity.typing import Array, Indices

AT_ONCE = 2_000_000  # contacts times rows of one list: some tens of megabytes
LISTS, FEW = 2, 10_000  # lists of contacts that are kept of a scene, and sites up to which
IN_CACHE = 20_000  # contacts times rows whose energies are computed together


class Network(Scene):
    """Point masses, bonds and walls.

    Parameters
    ----------
    positions : array_like, (sites, dim)
        Reference places [m], dim 2 or 3; displacements count from them.
    bonds : array_like of int, (bonds, 2)
        The two sites of each bond.
    spring : Potential or sequence of Potential
        One for all bonds or one for each.
    lengths : float or array_like (bonds,), optional
        Distance [m] at which a bond's elongation is 0; by default that of the positions.
    mass : float or array_like (sites,), optional
        [kg], > 0.
    walls : sequence of Wall, optional
    wall_contacts : array_like of int, (wall contacts, 2), optional
        Site and wall of each contact with a wall; needs `radius`.
    wall_spring : Potential or sequence of Potential, optional
        Their law, in the distance from the wall less the radius.
    wall_gaps : array_like (wall contacts,), optional
        That distance at the positions [m], where it is known better than from the positions; at
        most a tenth of the radius off what they give.
    radius : float or array_like (sites,), optional
        [m]; with it the run checks that no contact forms that is not listed, and that no site
        comes behind a wall of its own or presses on it beyond its end.
    loads : array_like (sites, dim), optional
        Constant forces [N].
    held : sequence of int, optional
        Sites that stay at u = 0.
    contacts : {"fixed", "follow"}, optional
        "follow": beside the bonds, sites that come near each other or a wall get a contact before
        they touch and lose it when they are apart again; needs `radius` and `law`.
    law : Potential or callable (site, other) -> Potential, optional
        Of the contacts that are followed, in the gap between the surfaces; `other` is a site or a
        Wall.  Give the same object for like contacts.
    drive : dict of int to Drive, optional
        {site: Drive}: motions that are prescribed, and forces that depend on time.
    damping : Damping, optional
        Dashpots in the bonds and to the ground.
    tune : dict of str to sympy.Expr, optional
        {name: expression of t}: arguments of the spring that depend on time; one spring for all
        bonds then, with the values at t = 0, and no contacts with walls.
    """

    def __init__(
        self,
        positions: ArrayLike,
        bonds: ArrayLike,
        spring: Potential | Sequence[Potential],
        lengths: ArrayLike | None = None,
        mass: ArrayLike = 1.0,
        walls: Sequence[Wall] = (),
        *,
        wall_contacts: ArrayLike = (),
        wall_spring: Potential | Sequence[Potential] | None = None,
        wall_gaps: ArrayLike | None = None,
        radius: ArrayLike | None = None,
        loads: ArrayLike | None = None,
        held: Sequence[int] = (),
        contacts: str = "fixed",
        law: Potential | Callable[[int, int | Wall], Potential] | None = None,
        drive: Mapping[int, Drive] | None = None,
        damping: Damping | None = None,
        tune: Mapping[str, sp.Expr | float] | None = None,
    ) -> None:
        self.positions = numbers("positions", positions)
        if self.positions.ndim != 2 or self.positions.shape[1] not in (1, 2, 3):
            raise TensegrityError(
                f"positions have shape {self.positions.shape}, must be (sites, 1), 2 or 3"
            )
        self.sites, self.dim = self.positions.shape
        check.whole("sites", self.sites, least=1)
        self.bonds = joined_pairs(bonds, self.sites)
        self.mass = per_site("mass", mass, "kg", self.sites)
        self.radius = None if radius is None else per_site("radius", radius, "m", self.sites)
        self.walls = plane_walls(walls, self.dim)
        pairs = whole_pairs("wall_contacts", wall_contacts)
        if len(pairs) and self.radius is None:
            raise TensegrityError(f"{len(pairs)} wall contacts need the radius of the sites")
        self.wall_contacts = touching(pairs, self.walls, self.positions)
        springs = springs_of(spring, len(self.bonds), "bond")
        if len(self.wall_contacts) or wall_spring is not None:
            springs += springs_of(wall_spring, len(self.wall_contacts), "wall contact")
        self.springs = springs
        self.loads = np.zeros(self.shape) if loads is None else numbers("loads", loads, self.shape)
        self.held = held_sites(held, self.sites)
        self.lengths, self.geometry = contact_geometry(
            self.positions, self.bonds, lengths, self.walls, self.wall_contacts, self.radius,
            wall_gaps,
        )  # fmt: skip
        self.law = followed_law(contacts, law, self.radius)
        _ = self.loop_bonds  # refuses springs that the compiled loop cannot take
        self._refuse_unlisted(np.zeros(self.shape))
        self._set_forcing(drive, damping, tune)
        if self.is_driven and self.follows:
            raise TensegrityError("a driven or damped network has 'fixed' contacts only")

    def _refuse_unlisted(self, u: Array) -> None:
        if self.clearance is not None:
            self.clearance.check(u)

    # the engine's view

    @cached_property
    def contact_bonds(self) -> Bonds:
        """Bonds and wall contacts with their geometry."""
        kind = np.full(len(self.springs), WALL)
        kind[: len(self.bonds)] = PAIR
        first = np.concatenate([self.bonds[:, 0], self.sites + self.wall_contacts[:, 1]])
        second = np.concatenate([self.bonds[:, 1], self.wall_contacts[:, 0]])
        arrays = (fixed(x) for x in (kind, first, second))
        places = self.geometry, self.positions
        behind = self.loads, len(self.walls), self.crowding
        contacts = Contacts(*arrays, *places, *behind)  # type: ignore[call-arg]
        springs = self.spring_table
        return Bonds(*springs.table, springs.group, self.inverse_mass, contacts, springs.openings)

    @cached_property
    def crowding(self) -> Indices | None:
        """How many sites of higher numbers each one about touches at the reference places; None
        where sites have no radius, so that one list of contacts is all there is."""
        return None if self.radius is None else fixed(crowding(self.positions, self.radius))

    @cached_property
    def clearance(self) -> Clearance | None:
        """What watches over the contacts that are not listed; None where sites have no radius."""
        if self.radius is None:
            return None
        kind = Clearance if self.law is None else Following
        return kind(self.positions, self.radius, self.bonds, self.walls, self.wall_contacts)

    def listed(self, u: Array) -> Self:
        """This network with contacts of its list only, for displacements near u (sites, dim).

        Where contacts are followed these are the bonds, and behind them, sorted by their sites, all
        pairs that may touch before any site moved by an eighth of its radius; else all it has.
        """
        if not self.follows:
            return self
        return self._listings(*self.clearance.near(np.asarray(u, dtype=float)))

    @cached_property
    def _listings(self) -> Listings:
        return Listings(self, LISTS if self.sites <= FEW else 1)

    def listings(self, u: Array) -> Iterator[tuple[slice, Self]]:
        """Rows of displacements (T, sites, dim) in turn, each with this scene as it lists all
        contacts that can act there.

        Where contacts are followed the list is made anew once a site moved half the distance
        below which it has all pairs.
        """
        row = 0
        while row < len(u):
            scene = self.listed(u[row])
            most = max(1, AT_ONCE // (len(scene.springs) + 1))
            last = min(len(u), row + most)
            if self.follows:
                watch: Any = self.clearance
                last = row + watch.lasting(u[row:last])
            yield slice(row, last), scene
            row = last

    def likely(self, u: Array) -> Self:
        """This network with contacts of sites nearest each other, and of all with walls."""
        return self._listings.new(*self.clearance.likely(u)) if self.follows else self

    @property
    def follows(self) -> bool:
        """Whether contacts come and go, so that only those near are listed."""
        return self.law is not None

    def _with(self, **changed: Any) -> Self:
        """This network with other springs or contacts; what is computed from them is dropped."""
        other = copy(self)
        other.__dict__.update(changed, crowding=self.crowding)
        return other

    @property
    def _words(self) -> str:
        return f"network has {self.shape} (sites, dim)"

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the displacements of a state."""
        return self.positions.shape

    @property
    def wall_count(self) -> int:
        """Number of walls."""
        return len(self.walls)

    @property
    def cost(self) -> int:
        """Work of one evaluation of all forces, in bonds of a chain."""
        return 3 * len(self.springs) + self.sites

    @property
    def spring_lengths(self) -> Array | None:
        """Length of each bond, 0 for wall contacts [m]; (springs,)."""
        return self.geometry[-1]

    @cached_property
    def loop_bonds(self) -> Bonds:
        """Bonds as the loop takes them: those of a chain where that is what they are."""
        bonds, count = self.contact_bonds, np.arange(len(self.bonds))
        row = [count, count + 1]
        if (
            self.dim == 1 and self.sites == len(count) + 1 and self.radius is None
            and np.array_equal(self.bonds.T, row) and not self.walls and not self.loads.any()
            and np.all(self.geometry[0] > 0) and not self.geometry[1].any()
        ):  # fmt: skip
            return replace(bonds, contacts=None)
        return bonds

    def with_springs(self, springs: Sequence[Potential]) -> Self:
        """The same network with other springs, one for each different spring of `spring_table`."""
        return self._with(springs=tuple(springs[k] for k in self.spring_table.group))

    def arrays(self, state: State) -> tuple[Array, Array]:
        """u and v as the loop advances them: sites, and behind them walls and a spare row."""
        if self.loop_bonds.contacts is None:
            return super().arrays(state)
        u, v = np.zeros((2, self.loop_bonds.contacts.rows, self.dim))
        u[: self.sites], v[: self.sites] = state.u, state.v
        return u, v

    def frequency_of(self, stiffness: Array) -> float:
        """Bound on the largest angular frequency [rad/s] for stiffnesses of the contacts [N/m].

        Gershgorin's circles of M^-1 K: a bond's block stands twice in the rows of a site, a
        wall's once.
        """
        k, contacts = stiffness.copy(), self.contact_bonds.contacts
        k[: len(self.bonds)] *= 2
        total = np.zeros(contacts.rows)
        np.add.at(total, contacts.first, k)
        np.add.at(total, contacts.second, k)
        return float(np.sqrt(np.max(total[: self.sites] * self.inverse_mass)))

    @property
    def turns(self) -> bool:
        """Whether bonds may turn: not on a line."""
        return self.dim > 1

    @cached_property
    def closing(self) -> Array:
        """Elongation [m] at which the ends of each different spring's shortest bond meet."""
        found, pairs = np.full(len(self.spring_table), -np.inf), len(self.bonds)
        np.maximum.at(found, self.spring_table.group[:pairs], -self.lengths)
        return fixed(found)

    def extreme(self, spring: int, u: Array, side: int) -> str:
        """Where a contact of that spring is shortest (side 0) or longest (1), in words."""
        contacts = np.flatnonzero(self.spring_table.group == spring)
        r = self.stretch(u)[contacts]
        return self._where(int(contacts[np.argmax(r) if side else np.argmin(r)]))

    def _where(self, contact: int) -> str:
        if contact < len(self.bonds):
            i, j = self.bonds[contact].tolist()
            return f"between sites {i} and {j}"
        site, wall = self.wall_contacts[contact - len(self.bonds)].tolist()
        return f"between site {site} and wall {wall}"

    def stiffest(self, u: Array, ranges: Array) -> str:
        """Where the contact is that was stretched most, or whose ends met, in words."""
        if not len(self.springs):
            return ""
        apart = ranges[:, 0] - self.closing
        if np.any(apart <= 0):
            return f"{self.extreme(int(np.argmin(apart)), u, 0)}, which came to the same place"
        spring = int(np.nanargmax(np.max(np.abs(ranges), axis=1)))
        return self.extreme(spring, u, int(ranges[spring, 1] > -ranges[spring, 0]))

    # states

    def at_rest(self, velocity: Mapping[int, Sequence[float]] | None = None) -> State:
        """The undisplaced state, some sites given a velocity [m/s]: {site: (dim,)}.

        Sites whose motion is prescribed are where their drive begins.
        """
        u, v = np.zeros((2, *self.shape))
        for site, value in velocities(velocity):
            site = site_number("site", site, self.sites)
            v[site] = numbers(f"velocity of site {site}", value, (self.dim,))
        begun(self, u, v)
        state = State(u, v)
        self.check(state)
        return state

    def check(self, state: State) -> float:
        """Refuse a state of another shape, one that moves a held site, or one out of domain.

        Returns its energy [J].
        """
        self._refuse_other(state)
        for site in self.held:
            if state.u[site].any() or state.v[site].any():
                raise TensegrityError(
                    f"site {site} is held, but has displacement {state.u[site]} m and velocity "
                    f"{state.v[site]} m/s"
                )
        self._refuse_unlisted(state.u)
        energy = self.energy(state)  # refuses elongations out of domain
        if not np.isfinite(energy):
            raise TensegrityError(f"energy {energy} J of the state must be finite")
        return energy

    # what is computed from displacements u (..., sites, dim)

    def elongation(self, u: ArrayLike) -> Array:
        """Elongation of each bond [m]; (..., bonds)."""
        return check.finite("elongation", self.stretch(u)[..., : len(self.bonds)])

    def direction(self, u: Array) -> Array:
        """Unit vector of each bond, from its first site to its second; (..., bonds, dim)."""
        u = check.rows("displacements", u, self.shape)
        along = forces.elongations(self.contact_bonds, u)[1][..., : len(self.bonds), :]
        return check.finite("direction", along)

    def wall_gap(self, u: ArrayLike) -> Array:
        """Gap of each wall contact [m]: distance from the wall's plane less the radius."""
        return check.finite("gap", self.stretch(u)[..., len(self.bonds) :])

    def stretch(self, u: ArrayLike) -> Array:
        """Elongation of each bond [m], and gap of each wall contact; (..., springs)."""
        u = check.rows("displacements", u, self.shape, are_finite=False)
        return forces.stretch(self.contact_bonds, u)

    def bond_energy(self, u: ArrayLike) -> Array:
        """Energy of each bond [J]; (..., bonds)."""
        return self._per_contact("energy", u)[..., : len(self.bonds)]

    def bond_tension(self, u: ArrayLike) -> Array:
        """Tension of each bond [N]; (..., bonds)."""
        return self._per_contact("tension", u)[..., : len(self.bonds)]

    def wall_energy(self, u: ArrayLike) -> Array:
        """Energy of each wall contact [J]; (..., wall contacts)."""
        return self._per_contact("energy", u)[..., len(self.bonds) :]

    def wall_load(self, u: ArrayLike) -> Array:
        """Contact force of each wall contact [N], compression > 0; (..., wall contacts)."""
        return -self._per_contact("tension", u)[..., len(self.bonds) :]

    def _per_contact(self, name: str, u: ArrayLike) -> Array:
        return self.spring_table.evaluate(name, check.finite("elongation", self.stretch(u)))

    def energy(self, state: State) -> float:
        """Total energy [J], the potential of the loads included."""
        self._refuse_other(state)
        scene = self.listed(state.u)
        return float(scene.energies(state.u[None], state.v[None])[0])

    def energies(self, u: Array, v: Array) -> Array:
        """Total energy [J] of each of many states; u and v (states, sites, dim)."""
        if self.follows:
            parts = [scene.energies(u[rows], v[rows]) for rows, scene in self.listings(u)]
            return np.concatenate(parts) if parts else np.zeros(0)
        compiled = self.energies_at_once
        found = None if compiled is None else compiled(u, v)
        if found is not None:
            return found
        rows = len(u), -1
        with np.errstate(over="ignore"):  # to inf, which `check` refuses
            kinetic = 0.5 * np.sum((self.mass[:, None] * v**2).reshape(rows), axis=-1)
        some = max(IN_CACHE // max(len(self.bonds) + len(self.wall_contacts), 1), 1)
        parts = [np.sum(self._per_contact("energy", u[k : k + some]), axis=-1)
                 for k in range(0, len(u), some)]  # fmt: skip
        stored = np.concatenate(parts) if parts else np.zeros(0)
        return kinetic + stored - np.sum((self.loads * u).reshape(rows), axis=-1)

    @cached_property
    def energies_at_once(self) -> Energies | None:
        mass = np.repeat(self.mass[:, None], self.dim, axis=1)
        return self.spring_table.energies(mass, self.contact_bonds.contacts)

    def site_energy(self, u: Array, v: Array) -> Array:
        """Energy of each site [J]: motion, half its bonds, walls, load; (..., sites)."""
        u, v = self._rows(u, v)
        result = 0.5 * self.mass * np.sum(v**2, axis=-1) - np.sum(self.loads * u, axis=-1)
        bonds, walls = np.split(self._per_contact("energy", u), [len(self.bonds)], axis=-1)
        bonds = bonds / 2
        rows = np.moveaxis(result, -1, 0)  # a view: sites first
        for sites, energy in (
            (self.bonds[:, 0], bonds),
            (self.bonds[:, 1], bonds),
            (self.wall_contacts[:, 0], walls),
        ):
            np.add.at(rows, sites, np.moveaxis(energy, -1, 0))
        return result

    def momentum(self, state: State) -> Array:
        """Total momentum [kg m/s]; (dim,)."""
        self._refuse_other(state)
        return self.mass @ state.v

    def angular_momentum(self, state: State) -> float | Array:
        """Total angular momentum about the origin [kg m^2/s]; a float, in space (3,)."""
        self._refuse_other(state)
        x, p = self.positions + state.u, self.mass[:, None] * state.v
        if self.dim == 1:
            return 0.0
        if self.dim == 2:
            return float(np.sum(x[:, 0] * p[:, 1] - x[:, 1] * p[:, 0]))
        return np.cross(x, p).sum(axis=0)

    def _repr_html_(self) -> str:
        rows = {
            "sites": f"{self.sites} in {self.dim} dimensions",
            "bonds": len(self.bonds),
            "walls": f"{len(self.walls)} with {len(self.wall_contacts)} contacts",
            "mass": f"{self.mass.sum():.6g} kg",
        }
        return page(
            "Network",
            rows,
            lambda figure: wires(figure.subplots(), self.positions, self.bonds),
            size=(3.4, 3.4),
        )

    def __repr__(self) -> str:
        return (
            f"Network({self.sites} sites in {self.dim} dimensions, {len(self.bonds)} bonds, "
            f"{len(self.walls)} walls with {len(self.wall_contacts)} contacts)"
        )
