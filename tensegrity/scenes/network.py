"""Masses in the plane or in space, joined by bonds in any pattern: a scene for `simulate`.

Model: point masses with two or three coordinates each; bonds, and contacts with plane walls,
whose force along the line of contact depends on their elongation only; constant loads.  The
list of contacts is fixed; where sites have a radius, the run makes sure that no other contact
formed (see `tensegrity.scenes.clearance`).  Source: seeds/001, eqs. (1)-(6).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.notebook import page, wires
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.forcing import start_driven_sites
from tensegrity.scenes.neighbour_list import new_contact_law
from tensegrity.scenes.network_dynamics import NetworkDynamics
from tensegrity.scenes.network_input import (
    checked_bonds,
    checked_wall_contacts,
    contact_geometry,
    held_sites,
    numbers,
    per_site,
    plane_walls,
    site_number,
    springs_of,
    whole_pairs,
)
from tensegrity.scenes.scene import Scene, State, velocities
from tensegrity.scenes.walls import Wall
from tensegrity.springs.potential import Potential

if TYPE_CHECKING:
    from typing import Any, Self

    from numpy.typing import ArrayLike

    from tensegrity.scenes.forcing import Damping, Drive, Tune
    from tensegrity.typing import Array


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
    tune : dict of str to sympy.Expr, or callable t -> Potential, optional
        As of a `Chain`; no contacts with walls then.
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
        tune: Tune | None = None,
    ) -> None:
        self.positions = numbers("positions", positions)
        if self.positions.ndim != 2 or self.positions.shape[1] not in (1, 2, 3):
            raise TensegrityError(
                f"positions have shape {self.positions.shape}, must be (sites, 1), 2 or 3"
            )
        self.sites, self.dim = self.positions.shape
        check.whole("sites", self.sites, least=1)
        self.bonds = checked_bonds(bonds, self.sites)
        self.mass = per_site("mass", mass, "kg", self.sites)
        self.radius = None if radius is None else per_site("radius", radius, "m", self.sites)
        self.walls = plane_walls(walls, self.dim)
        pairs = whole_pairs("wall_contacts", wall_contacts)
        if len(pairs) and self.radius is None:
            raise TensegrityError(f"{len(pairs)} wall contacts need the radius of the sites")
        self.wall_contacts = checked_wall_contacts(pairs, self.walls, self.positions)
        springs = springs_of(spring, len(self.bonds), "bond")
        if len(self.wall_contacts) or wall_spring is not None:
            springs += springs_of(wall_spring, len(self.wall_contacts), "wall contact")
        self.springs = springs
        self.loads = np.zeros(self.shape) if loads is None else numbers("loads", loads, self.shape)
        self.held = held_sites(held, self.sites)
        self.lengths, self._geometry = contact_geometry(
            self.positions, self.bonds, lengths, self.walls, self.wall_contacts, self.radius,
            wall_gaps,
        )  # fmt: skip
        self._law = new_contact_law(contacts, law, self.radius)
        of = dynamics(self)
        _ = of.loop_bonds  # refuses springs that the compiled loop cannot take
        of.refuse_unlisted(np.zeros(self.shape))
        self._set_forcing(drive, damping, tune)
        if of.is_driven and of.follows:
            raise TensegrityError("a driven or damped network has 'fixed' contacts only")

    def _dynamics(self) -> NetworkDynamics:
        return NetworkDynamics(self)

    @property
    def _shape_text(self) -> str:
        return f"network has {self.shape} (sites, dim)"

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the displacements of a state."""
        return self.positions.shape

    def listed(self, u: Array) -> Self:
        """This network with contacts of its list only, for displacements near u (sites, dim).

        Where contacts are followed these are the bonds, and behind them, sorted by their sites, all
        pairs that may touch before any site moved by an eighth of its radius; else all it has.
        """
        return dynamics(self).listed(u).scene

    def _varied(self, **changed: Any) -> Self:
        """This network with other springs or contacts."""
        other = copy(self)
        other.__dict__.update(changed)
        return other

    # states

    def at_rest(self, velocity: Mapping[int, Sequence[float]] | None = None) -> State:
        """The undisplaced state, some sites given a velocity [m/s]: {site: (dim,)}.

        Sites whose motion is prescribed are where their drive begins.
        """
        u, v = np.zeros((2, *self.shape))
        for site, value in velocities(velocity):
            site = site_number("site", site, self.sites)
            v[site] = numbers(f"velocity of site {site}", value, (self.dim,))
        start_driven_sites(self, u, v)
        state = State(u, v)
        self.check(state)
        return state

    def _check_sites(self, state: State) -> None:
        """Refuse a state of another shape, one that moves a held site, or one with contacts that
        are not listed."""
        self._refuse_other(state)
        for site in self.held:
            if state.u[site].any() or state.v[site].any():
                raise TensegrityError(
                    f"site {site} is held, but has displacement {state.u[site]} m and velocity "
                    f"{state.v[site]} m/s"
                )
        dynamics(self).refuse_unlisted(state.u)

    # what is computed from displacements u (..., sites, dim)

    def elongation(self, u: ArrayLike) -> Array:
        """Elongation of each bond [m]; (..., bonds)."""
        return check.finite("elongation", dynamics(self).elongations(u)[..., : len(self.bonds)])

    def bond_energy(self, u: ArrayLike) -> Array:
        """Energy of each bond [J]; (..., bonds)."""
        return dynamics(self).evaluate("energy", u)[..., : len(self.bonds)]

    def bond_tension(self, u: ArrayLike) -> Array:
        """Tension of each bond [N]; (..., bonds)."""
        return dynamics(self).evaluate("tension", u)[..., : len(self.bonds)]

    def wall_load(self, u: ArrayLike) -> Array:
        """Contact force of each wall contact [N], compression > 0; (..., wall contacts)."""
        return -dynamics(self).evaluate("tension", u)[..., len(self.bonds) :]

    def site_energy(self, u: Array, v: Array) -> Array:
        """Energy of each site [J]: motion, half its bonds, walls, load; (..., sites)."""
        u, v = self._checked_rows(u, v)
        result = 0.5 * self.mass * np.sum(v**2, axis=-1) - np.sum(self.loads * u, axis=-1)
        bonds, walls = np.split(dynamics(self).evaluate("energy", u), [len(self.bonds)], axis=-1)
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
