"""Masses in the plane or in space, joined by bonds in any pattern: a scene for `simulate`.

Model: point masses with two or three coordinates each; bonds, and contacts with plane walls,
whose force along the line of contact depends on their elongation only; constant loads.  The
list of contacts is fixed; where sites have a radius, the run makes sure that no other contact
formed (see `tensegrity.clearance`).  Source: seeds/001, eqs. (1)-(6).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache, cached_property
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check, stepping
from tensegrity.clearance import Clearance
from tensegrity.errors import TensegrityError
from tensegrity.network_input import (
    held_sites,
    joined_pairs,
    near_positions,
    numbers,
    per_site,
    plane_walls,
    site_number,
    springs_of,
    touching,
)
from tensegrity.network_loop import Contacts, kernel
from tensegrity.potential import Potential
from tensegrity.scene import KINK_SHARE, Scene, State, law_table, velocities
from tensegrity.walls import Wall

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from numpy.typing import ArrayLike

    from tensegrity.methods import Method
    from tensegrity.typing import Array, Indices

PAIR, WALL = 0, 1  # as in network_loop.KINDS


class Network(Scene):
    """Point masses, bonds and walls.

    Parameters
    ----------
    positions : array_like, (sites, dim)
        Reference places [m], dim 2 or 3; displacements count from them.
    bonds : array_like of int, (bonds, 2)
        The two sites of each bond.  Forces at a site are summed in this order.
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
    """

    held: Sequence[int]

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
    ) -> None:
        self.positions = numbers("positions", positions)
        if self.positions.ndim != 2 or self.positions.shape[1] not in (2, 3):
            raise TensegrityError(
                f"positions have shape {self.positions.shape}, must be (sites, 2) or (sites, 3)"
            )
        self.sites, self.dim = self.positions.shape
        check.whole("sites", self.sites, least=1)
        self.bonds = joined_pairs(bonds, self.sites)
        self.mass = per_site("mass", mass, "kg", self.sites)
        self.radius = None if radius is None else per_site("radius", radius, "m", self.sites)
        self.walls = plane_walls(walls, self.dim)
        if np.size(wall_contacts) and self.radius is None:
            raise TensegrityError(
                f"{len(np.asarray(wall_contacts))} wall contacts need the radius of the sites"
            )
        self.wall_contacts = touching(wall_contacts, self.walls, self.positions)
        self.springs = springs_of(spring, len(self.bonds), "bond")
        if len(self.wall_contacts) or wall_spring is not None:
            count = len(self.wall_contacts)
            self.springs += springs_of(wall_spring, count, "wall contact")
        self.loads = np.zeros(self.shape) if loads is None else numbers("loads", loads, self.shape)
        self.held = held_sites(held, self.sites)
        self._set_geometry(lengths, wall_gaps)
        _ = self.contacts  # refuses springs that the compiled loop cannot take
        self._refuse_unlisted(np.zeros(self.shape))

    def _refuse_unlisted(self, u: Array) -> None:
        if self.clearance is not None:
            self.clearance.check(u)

    def _set_geometry(self, lengths: ArrayLike | None, wall_gaps: ArrayLike | None) -> None:
        i, j = self.bonds.T
        exact = self.positions.astype(np.longdouble)
        self._reference = (exact[j] - exact[i]).astype(float)
        distance = np.sqrt(np.sum((exact[j] - exact[i]) ** 2, axis=1))
        same = np.flatnonzero(distance == 0)
        if same.size:
            raise TensegrityError(
                f"bond {same[0]} joins sites {i[same[0]]} and {j[same[0]]} at the same place"
            )
        if lengths is None:
            lengths = distance.astype(float)
            opening = np.zeros(len(self.bonds))
        else:
            lengths = numbers("lengths", lengths)
            if lengths.shape not in ((), (len(self.bonds),)):
                raise TensegrityError(
                    f"lengths have shape {lengths.shape}, must be ({len(self.bonds)},)"
                )
            lengths = np.broadcast_to(lengths, (len(self.bonds),)).copy()
            opening = (distance - lengths).astype(float)
        bad = np.flatnonzero(~(lengths > 0))
        if bad.size:
            raise TensegrityError(f"length {lengths[bad[0]]:g} m of bond {bad[0]} must be above 0")
        self.lengths = lengths
        site, wall = self.wall_contacts.T
        normals = np.array([w.normal for w in self.walls]).reshape(-1, self.dim)[wall]
        heights = [self.walls[w].height(exact[s]) for s, w in self.wall_contacts.tolist()]
        radius = np.zeros(0) if self.radius is None else self.radius[site]
        gaps = (np.array(heights, dtype=np.longdouble) - radius).astype(float)
        if wall_gaps is not None:
            gaps = near_positions(wall_gaps, gaps, radius)
        self._geometry = np.zeros((self.dim + 2, len(self.springs)))
        self._geometry[: self.dim] = np.concatenate([self._reference, normals]).T
        self._geometry[self.dim] = np.concatenate([opening, gaps])
        self._geometry[-1, : len(self.bonds)] = lengths

    # the engine's view

    @cached_property
    def _groups(self) -> tuple[list[Potential], Indices]:
        """The different springs, and for each contact the number of its spring."""
        numbers: dict[Potential, int] = {}
        known: dict[int, int] = {}
        group = np.zeros(len(self.springs), dtype=int)
        for k, spring in enumerate(self.springs):
            if id(spring) not in known:
                known[id(spring)] = numbers.setdefault(spring, len(numbers))
            group[k] = known[id(spring)]
        return list(numbers), group

    @cached_property
    def contacts(self) -> Contacts:
        """Contacts as the loop takes them."""
        springs, group = self._groups
        laws, law, parameters = law_table(springs)
        kind = np.full(len(self.springs), WALL)
        kind[: len(self.bonds)] = PAIR
        return Contacts(
            laws, kind, law[group],
            np.concatenate([self.bonds[:, 0], self.sites + self.wall_contacts[:, 1]]),
            np.concatenate([self.bonds[:, 1], self.wall_contacts[:, 0]]),
            self._geometry, parameters[group], self.inverse_mass, self.loads, len(self.walls),
        )  # fmt: skip

    @cached_property
    def clearance(self) -> Clearance | None:
        """What watches over the contacts that are not listed; None where sites have no radius."""
        if self.radius is None:
            return None
        return Clearance(self.positions, self.radius, self.bonds, self.walls, self.wall_contacts)

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

    def arrays(self, state: State) -> tuple[Array, Array]:
        """u and v as the loop advances them: sites, walls, and a spare row."""
        u, v = np.zeros((2, self.contacts.rows, self.dim))
        u[: self.sites], v[: self.sites] = state.u, state.v
        return u, v

    def bind(self, u: Array, v: Array, method: Method, dt: float) -> Any:
        """This network in the loop, advancing the rows of `arrays` in place."""
        return kernel(self.contacts.laws, self.dim).bind(u, v, self.contacts, method, dt)

    def watched(self) -> tuple[list[Potential], Indices]:
        """The different springs, and for each contact the number of its spring."""
        return self._groups

    def present_ranges(self, u: Array) -> Array:
        """Smallest and largest elongation of each contact, 0 included; (contacts, 2)."""
        r = np.concatenate([self.elongation(u), self.wall_gap(u)])
        return np.stack([np.minimum(r, 0), np.maximum(r, 0)], axis=1)

    def frequency(self, ranges: Array) -> float:
        """Bound on the largest angular frequency [rad/s] over given ranges (contacts, 2).

        Gershgorin's circles of M^-1 K: a bond's block has the eigenvalues V'' along it and
        V'/distance across it, and stands twice in the rows of a site; a wall's stands once.
        """
        springs, group = self._groups
        low, high = np.full(len(springs), np.inf), np.full(len(springs), -np.inf)
        np.minimum.at(low, group, ranges[:, 0])
        np.maximum.at(high, group, ranges[:, 1])
        ends = list(zip(springs, low.tolist(), high.tolist(), strict=True))
        k = np.array([stepping.largest_stiffness(*end) for end in ends])[group]
        t = np.array([stepping.largest_tension(*end) for end in ends])[group]
        pairs = len(self.bonds)
        shortest = self.lengths + ranges[:pairs, 0]
        if np.any(shortest <= 0):
            return np.inf  # the two sites of a bond coincide
        k[:pairs] = 2 * np.maximum(k[:pairs], t[:pairs] / shortest)
        total = np.zeros(self.contacts.rows)
        np.add.at(total, self.contacts.first, k)
        np.add.at(total, self.contacts.second, k)
        return float(np.sqrt(np.max(total[: self.sites] * self.inverse_mass)))

    @property
    def closing(self) -> Array:  # type: ignore[override]
        """Elongation [m] at which the ends of each contact meet, -inf for walls; (contacts,)."""
        return np.append(-self.lengths, np.full(len(self.wall_contacts), -np.inf))

    def opened(self, ranges: Array) -> bool:
        """Whether a contact both pushes and is open within given ranges (contacts, 2)."""
        low, high = ranges.T
        pushes = self._per_contact("tension", low, 0) != 0
        slack = [self._per_contact(name, high, 0) == 0 for name in ("tension", "stiffness")]
        return bool(np.any(pushes & slack[0] & slack[1] & (low < 0) & (high > 0)))

    def finer_share(self, met: Array) -> float | None:
        """That of opening contacts; under loads, whose work was not known at first, the same."""
        if self.opened(met):
            return min(self.step_share, KINK_SHARE)
        return self.step_share if np.any(self.loads) else None

    def extreme(self, row: int, u: Array, side: int) -> str:
        """Where the contact of that row is, in words."""
        if row < len(self.bonds):
            i, j = self.bonds[row].tolist()
            return f"between sites {i} and {j}"
        site, wall = self.wall_contacts[row - len(self.bonds)].tolist()
        return f"between site {site} and wall {wall}"

    def stiffest(self, u: Array, ranges: Array) -> str:
        """Where the contact is that was stretched most, or whose ends met, in words."""
        apart = self.lengths + ranges[: len(self.bonds), 0]
        if np.any(apart <= 0):
            return f"{self.extreme(int(np.argmin(apart)), u, 0)}, which came to the same place"
        if not len(self.springs):
            return ""
        return self.extreme(int(np.nanargmax(np.max(np.abs(ranges), axis=1))), u, 0)

    # states

    def at_rest(self, velocity: Mapping[int, ArrayLike] | None = None) -> State:
        """The undisplaced state, some sites given a velocity [m/s]: {site: (dim,)}."""
        v = np.zeros(self.shape)
        for site, value in velocities(velocity):
            site = site_number("site", site, self.sites)
            v[site] = numbers(f"velocity of site {site}", value, (self.dim,))
        state = State(np.zeros(self.shape), v)
        self.check(state)
        return state

    def check(self, state: State) -> None:
        """Refuse a state of another shape, one that moves a held site, or one out of domain."""
        self._refuse_other(state, f"network has {self.shape} (sites, dim)")
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

    # what is computed from displacements u (..., sites, dim)

    def elongation(self, u: ArrayLike) -> Array:
        """Elongation of each bond [m]; (..., bonds)."""
        u = np.asarray(u, dtype=float)
        i, j = self.bonds.T
        place = self._geometry[:, : len(self.bonds)]
        w = np.moveaxis(u[..., j, :] - u[..., i, :], -1, 0)
        return _elongation(self.dim)(*place[: self.dim], *w, *place[self.dim :])

    def direction(self, u: Array) -> Array:
        """Unit vector of each bond, from its first site to its second; (..., bonds, dim)."""
        i, j = self.bonds.T
        apart = self._reference + u[..., j, :] - u[..., i, :]
        return apart / np.linalg.norm(apart, axis=-1, keepdims=True)

    def wall_gap(self, u: ArrayLike) -> Array:
        """Gap of each wall contact [m]: distance from the wall's plane less the radius."""
        u = np.asarray(u, dtype=float)
        place = self._geometry[:, len(self.bonds) :]
        return place[self.dim] + np.einsum("...bk,kb->...b", u[..., self.wall_contacts[:, 0], :],
                                           place[: self.dim])  # fmt: skip

    def bond_energy(self, u: ArrayLike) -> Array:
        """Energy of each bond [J]; (..., bonds)."""
        return self._per_contact("energy", self.elongation(u), 0)

    def bond_tension(self, u: ArrayLike) -> Array:
        """Tension of each bond [N]; (..., bonds)."""
        return self._per_contact("tension", self.elongation(u), 0)

    def wall_energy(self, u: ArrayLike) -> Array:
        """Energy of each wall contact [J]; (..., wall contacts)."""
        return self._per_contact("energy", self.wall_gap(u), len(self.bonds))

    def wall_load(self, u: ArrayLike) -> Array:
        """Contact force of each wall contact [N], compression > 0; (..., wall contacts)."""
        return -self._per_contact("tension", self.wall_gap(u), len(self.bonds))

    def _per_contact(self, name: str, r: Array, start: int) -> Array:
        springs, group = self._groups
        group = group[start : start + r.shape[-1]]
        values = np.empty_like(r)
        for number in np.unique(group):
            members = group == number
            values[..., members] = getattr(springs[number], name)(r[..., members])
        return values

    def energy(self, state: State) -> float:
        """Total energy [J], the potential of the loads included."""
        with np.errstate(over="ignore"):  # to inf, which `check` refuses
            kinetic = 0.5 * np.sum(self.mass[:, None] * state.v**2)
        stored = np.sum(self.bond_energy(state.u)) + np.sum(self.wall_energy(state.u))
        return float(kinetic + stored - np.sum(self.loads * state.u))

    def site_energy(self, u: Array, v: Array) -> Array:
        """Energy of each site [J]: motion, half its bonds, walls, load; (..., sites)."""
        result = 0.5 * self.mass * np.sum(v**2, axis=-1) - np.sum(self.loads * u, axis=-1)
        bonds, walls = self.bond_energy(u) / 2, self.wall_energy(u)
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
        return self.mass @ state.v

    def angular_momentum(self, state: State) -> float | Array:
        """Total angular momentum about the origin [kg m^2/s]; a float in the plane, else (3,)."""
        x, p = self.positions + state.u, self.mass[:, None] * state.v
        if self.dim == 2:
            return float(np.sum(x[:, 0] * p[:, 1] - x[:, 1] * p[:, 0]))
        return np.cross(x, p).sum(axis=0)

    def __repr__(self) -> str:
        return (
            f"Network({self.sites} sites in {self.dim} dimensions, {len(self.bonds)} bonds, "
            f"{len(self.walls)} walls with {len(self.wall_contacts)} contacts)"
        )


@cache
def _elongation(dim: int) -> Callable[..., Array]:
    """The elongation of `derivations.geometry` in NumPy: (D, w, g, L) -> r."""
    import sympy as sp

    from derivations import geometry

    symbols = (*(x for v in geometry.vectors(dim) for x in v), geometry.initial, geometry.length)
    return sp.lambdify(symbols, geometry.elongation(dim), "numpy", cse=True)
