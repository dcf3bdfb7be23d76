"""A network: point masses on a line, in the plane or in space, joined by bonds in any pattern.

Model: bonds, and contacts with plane walls, whose force acts along the line of contact and depends
on their elongation only; constant loads.  The list of contacts is either fixed, and for sites with
a radius the run verifies that no other contact forms (`tensegrity.scenes.clearance`), or it is
updated as contacts form and open (`tensegrity.scenes.neighbour_list`).
Source: the paper, eqs. (1)-(6).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.printing import page
from tensegrity.readonly import fixed
from tensegrity.scenes.clearance import Clearance
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.forcing import start_driven_sites
from tensegrity.scenes.neighbour_list import NeighbourList, new_contact_law
from tensegrity.scenes.network_dynamics import FollowingDynamics, NetworkDynamics
from tensegrity.scenes.network_input import (
    checked_bonds,
    checked_wall_contacts,
    contact_ends,
    contact_geometry,
    held_sites,
    masses,
    numbers,
    per_site,
    plane_walls,
    pressing,
    refuse_too_many,
    site_number,
    springs_of,
    whole_pairs,
)
from tensegrity.scenes.pair_dynamics import (
    PairDynamics,
    inertias,
    is_pair_law,
    pair_laws,
    refuse_beside_pair_laws,
)
from tensegrity.scenes.picture import Picture, forces
from tensegrity.scenes.scene import Scene, State, momenta, velocities
from tensegrity.scenes.walls import Wall
from tensegrity.springs.potential import Potential

if TYPE_CHECKING:
    from typing import Any, Self

    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike

    from tensegrity.scenes.force import Force
    from tensegrity.scenes.forcing import Damping, Drive
    from tensegrity.typing import Array, Motion


class Network(Scene):
    """Point masses, bonds and walls.

    Parameters
    ----------
    positions : array_like, (sites, dim)
        Reference positions [m], from which displacements are measured; dim is 1, 2 or 3.
    bonds : array_like of int, (bonds, 2)
        The two sites of each bond; several bonds may join the same two.
    spring : Potential or sequence of Potential
        One spring for all bonds, or one for each bond.  Some may change with time, with "fixed"
        contacts only; see `Potential.over_time`.
    lengths : float or array_like (bonds,), optional
        Distance [m] at which a bond's elongation is 0; by default its distance in `positions`.
    mass : float or array_like (sites,), optional
        Mass of each site [kg], > 0; by default 1 kg.  With `bond_mass` >= 0, by default 0.
    walls : sequence of Wall, optional
        Walls that sites can touch.
    wall_contacts : array_like of int, (wall contacts, 2), optional
        Site and wall of each contact with a wall; requires `radius`.
    wall_spring : Potential or sequence of Potential, optional
        Force law of these contacts as a function of the gap: the distance of the site from the
        wall minus the radius.
    wall_gaps : array_like (wall contacts,), optional
        The gaps at the reference positions [m], if they are known more accurately than the
        positions give them; they may differ from those by at most a tenth of the radius.
    radius : float or array_like (sites,), optional
        Radius of each site [m].  The run then verifies that no unlisted contact forms, and that no
        site passes behind a wall that it touches or is pressed on it beyond its edge.
    loads : array_like (sites, dim), optional
        Constant forces [N].
    held : sequence of int, optional
        Sites that are fixed at u = 0.
    contacts : {"fixed", "follow", "walls"}, optional
        "fixed": the bonds and wall contacts given.  "follow": in addition to the bonds, sites that
        approach each other or a wall get a contact before they touch, which is removed when they
        separate; requires `radius` and `law`.  "walls": every site may press every wall, by
        `wall_spring` as a function of its distance from the wall less its radius, which is 0 unless
        given; sites never touch each other, and walls are unbounded.
    law : Potential or callable (site, other) -> Potential, optional
        Force law of the contacts that form, as a function of the gap between the surfaces; `other`
        is a site or a Wall.  Return the same object for equal contacts.
    drive : dict of int to Drive, optional
        {site: Drive}: prescribed motions, and forces that depend on time.
    damping : Damping, optional
        Dashpots in the bonds and to the ground; in the bonds with "fixed" contacts only.
    bond_mass : float or array_like (bonds,), optional
        Mass of each bond [kg], >= 0, which is distributed uniformly along the straight line between
        its sites: a consistent mass matrix.  By default bonds have no mass.
    cables : sequence of sequence of int, optional
        The bonds that are segments of each cable, which runs over sites without friction: one
        tension.  The elongation of each of n segments is the mean of theirs, so that they are
        springs of 1/n of its natural length, with its EA.
    forces : sequence of Force, optional
        Forces of time, displacement and velocity on sites, in bonds, or at walls; on all bonds or
        walls of a network that follows its contacts they act in those that form, too, and must be 0
        where these are open.

    Raises
    ------
    TensegrityError
        Any argument that is not as described above, or a spring that the compiled loop cannot
        evaluate.
    ContactError
        Sites that overlap at the reference positions without a listed contact.

    Examples
    --------
    Three disks in a row, of which the first strikes the second:

    >>> from tensegrity import Network, PowerLaw, simulate
    >>> contact = PowerLaw(1e6, 1.5)
    >>> disks = Network(
    ...     [[0, 0], [0.02, 0], [0.04, 0]], [[0, 1], [1, 2]], contact, mass=0.01, radius=0.01
    ... )
    >>> run = simulate(disks, disks.at_rest({0: [1.0, 0.0]}), t_end=0.01, tol=1e-8)
    >>> run.final.v[:, 0].round(3)
    array([-0.071,  0.076,  0.995])
    """

    def __init__(
        self,
        positions: ArrayLike,
        bonds: ArrayLike,
        spring: Potential | Sequence[Potential],
        lengths: ArrayLike | None = None,
        mass: ArrayLike | None = None,
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
        forces: Sequence[Force] = (),
        bond_mass: ArrayLike | None = None,
        cables: Sequence[Sequence[int]] = (),
    ) -> None:
        if isinstance(positions, np.ndarray) and positions.ndim:
            refuse_too_many(len(positions))
        self.positions = numbers("positions", positions)
        if self.positions.ndim != 2 or self.positions.shape[1] not in (1, 2, 3):
            raise TensegrityError(
                f"positions have shape {self.positions.shape}, must be (sites, 1), 2 or 3"
            )
        self.sites, self.dim = self.positions.shape
        check.whole("sites", self.sites, least=1)
        pairs = checked_bonds(bonds, self.sites)
        self._cables = checked_cables(cables, len(pairs))
        of_ends = is_pair_law(spring)
        if bond_mass is not None:
            moving = np.setdiff1d(np.arange(self.sites), held_sites(held, self.sites))
            self.mass, of_bonds = masses(mass, bond_mass, pairs, self.sites, moving)
            self.__dict__.update(bond_mass=fixed(of_bonds))
        else:
            mass = 1.0 if mass is None else mass
            self.mass = (
                inertias(mass, self.shape) if of_ends else per_site("mass", mass, "kg", self.sites)
            )
        self.radius = None if radius is None else per_site("radius", radius, "m", self.sites)
        self.walls = plane_walls(walls, self.dim)
        touching = whole_pairs("wall_contacts", wall_contacts)
        self._law = new_contact_law(contacts, law, self.radius)
        self._walls_alone = contacts == "walls"
        if self._walls_alone:
            given = {"wall_contacts": len(touching), "wall_gaps": wall_gaps is not None}
            touching = pressing(self.positions, self.radius, self.walls, given)
        elif len(touching) and self.radius is None:
            raise TensegrityError(f"{len(touching)} wall contacts need the radius of the sites")
        self.wall_contacts = checked_wall_contacts(touching, self.walls, self.positions)
        self._ends, self.bonds = contact_ends(pairs, self.wall_contacts, self.sites)
        springs = springs_of(spring, len(self.bonds), "bond")
        if of_ends:
            springs = pair_laws(springs, self)
        if len(self.wall_contacts) or wall_spring is not None:
            springs += springs_of(wall_spring, len(self.wall_contacts), "wall contact")
        self.springs = springs
        none = np.broadcast_to(0.0, self.shape)
        self.loads = none if loads is None else numbers("loads", loads, self.shape)
        self.held = held_sites(held, self.sites)
        self._lengths, self._gaps = contact_geometry(
            self.positions, self.bonds, lengths, self.walls, self.wall_contacts, self.radius,
            wall_gaps,
        )  # fmt: skip
        self.lengths = self._lengths[: len(self.bonds)]
        self._set_forcing(drive, damping, forces)
        of = dynamics(self)
        _ = of.loop_bonds  # refuses springs that the compiled loop cannot take
        of.refuse_unlisted(none)
        if of_ends:
            refuse_beside_pair_laws(of)
        if of.follows:
            self._refuse_changing()
        self._refuse_beside_cables()

    def _refuse_beside_cables(self) -> None:
        """Refuse what would act on each segment of a cable."""
        segments, damping = {b for cable in self._cables for b in cable}, self.damping
        each = [one.at for one in self._forces if one.on == "bonds"]
        hit = {b for at in each for b in (segments if at is None else segments & {*at})}
        if damping is not None:
            hit |= {b for b in segments if damping.each("bond", len(self.bonds))[b]}
        if hit:
            raise TensegrityError(
                f"bond {min(hit)} is a segment of a cable: forces and dashpots act in bonds of two "
                "sites"
            )

    def _refuse_changing(self) -> None:
        """Refuse forcing that depends on which open contacts are listed."""
        changing = dynamics(self).springs.changing
        if changing or (self.damping and self.damping.bond.any()):
            what = "springs that change in time" if changing else "dashpots in bonds"
            raise TensegrityError(f"{what} act in open contacts too: contacts must be 'fixed'")
        for force in self._forces:
            force.refuse_open(dynamics(self).clearance.skin)

    def _forces_between(self, bonds: Array, wall_contacts: Array) -> dict[str, Any]:
        """Attributes with the forces of this network when it has these contacts."""
        return {}

    def _clearance(self, follows: bool) -> Clearance | None:
        """Detector of unlisted contacts; None if sites have no radius, or press walls alone."""
        if self.radius is None or self._walls_alone:
            return None
        kind = NeighbourList if follows else Clearance
        return kind(self.positions, self.radius, self.bonds, self.walls, self.wall_contacts)

    def _dynamics(self) -> NetworkDynamics:
        if self._law is not None:
            return FollowingDynamics(self)
        return (PairDynamics if self._of_ends else NetworkDynamics)(self)

    @property
    def _of_ends(self) -> bool:
        """Whether the energy of a bond is a function of all coordinates of both ends."""
        return self.mass.ndim > 1

    @property
    def _shape_text(self) -> str:
        return f"network has {self.shape} (sites, dim)"

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the displacements of a state."""
        return self.positions.shape

    def listed(self, u: Array) -> Self:
        """This network with a fixed list of the contacts that can act near displacements u.

        Parameters
        ----------
        u : ndarray, (..., sites, dim)
            Displacements [m], such as those of a run.

        Returns
        -------
        Network
            For contacts="follow": the bonds, followed by all pairs, sorted by site, that can touch
            before a site has moved by an eighth of the mean radius; otherwise this network.
        """
        return dynamics(self).listed(u).scene

    # states

    def at_rest(self, velocity: Mapping[int, Sequence[float]] | None = None) -> State:
        """The undisplaced state, in which the given sites have a velocity and all others rest.

        Parameters
        ----------
        velocity : dict of int to sequence of float, optional
            {site: velocity}, each of shape (dim,) [m/s].

        Returns
        -------
        State
            u and v of shape (sites, dim); a site whose motion is prescribed has the displacement
            and the velocity of its drive at t = 0.

        Raises
        ------
        TensegrityError
            A site that does not exist or is held, or a velocity that is not finite.
        """
        u, v = np.zeros(self.shape), np.zeros(self.shape)
        for site, value in velocities(velocity):
            site = site_number("site", site, self.sites)
            v[site] = numbers(f"velocity of site {site}", value, (self.dim,))
        start_driven_sites(self, u, v)
        state = State(u, v)
        self.check(state)
        return state

    def _check_sites(self, state: State) -> None:
        """Refuse a state of another shape, one in which a held site moves, or one with unlisted
        contacts."""
        self._refuse_other(state)
        for site in self.held:
            if state.u[site].any() or state.v[site].any():
                raise TensegrityError(
                    f"site {site} is held, but has displacement {state.u[site]} m and velocity "
                    f"{state.v[site]} m/s"
                )
        dynamics(self).refuse_unlisted(state.u)

    # functions of displacements u (..., sites, dim)

    def wall_load(self, u: ArrayLike) -> Array:
        """Force of each wall contact [N], compression > 0; (..., wall contacts)."""
        return -dynamics(self).evaluate("tension", u)[..., len(self.bonds) :]

    def site_energy(self, state: Motion) -> Array:
        """Energy of each site [J], of a state or of the rows of a run; (..., sites): its kinetic
        energy (with bonds of mass the part v.(M v)/2, which may be below 0 at a site), half the
        energy of its bonds, the energy of its wall contacts, and the potential of
        its load."""
        u, v = self._checked_rows(state)
        result = np.sum(dynamics(self).kinetic(v) - self.loads * u, axis=-1)
        bonds, walls = np.split(dynamics(self).evaluate("energy", u), [len(self.bonds)], axis=-1)
        bonds = bonds / 2
        result += np.sum(dynamics(self).acting.stored(0, u), axis=-1)
        rows = np.moveaxis(result, -1, 0)  # a view: sites first
        for sites, energy in (
            (self.bonds[:, 0], bonds),
            (self.bonds[:, 1], bonds),
            (self.wall_contacts[:, 0], walls),
        ):
            np.add.at(rows, sites, np.moveaxis(energy, -1, 0))
        return result

    def momentum(self, state: State) -> Array:
        """Total momentum [kg m/s]; (dim,), with a `PairLaw` of its free coordinates."""
        self._refuse_other(state)
        (total,) = momenta(self, state.v[None])
        return np.asarray(total)

    def plot(self, ax: Axes | None = None, u: ArrayLike | None = None) -> Axes:
        """Sites, walls, and forces of bonds and contacts as lines: compression red, tension blue.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Of the plane; by default of a new figure.  What is in space is seen along its second
            axis.
        u : array_like, (sites, dim), optional
            Displacements [m]; by default those at rest.

        Returns
        -------
        matplotlib.axes.Axes
            The width of a line is proportional to the force; the title states the largest one.
            Forces count as those of `bond_tension`, from the state at rest of preloaded springs.

        Raises
        ------
        TensegrityError
            `ax` is not a Matplotlib axes, or `u` not of this network's shape.
        """
        at = self.at_rest().u if u is None else check.vector("displacement", u, self.shape)
        picture = Picture(self, ax)
        picture.show(at)
        ends, tension = forces(self, at)
        widest = float(np.abs(tension).max(initial=0.0))
        picture.push(ends, tension, widest)
        if widest:
            picture.ax.set_title(f"widest line {widest:.3g} N", fontsize=9)
        return picture.ax

    def _repr_html_(self) -> str:
        lines = str(self), f"mass: {dynamics(self).row_mass.sum():.6g} kg"
        return page(lines, lambda figure: self.plot(figure.subplots()), size=(3.4, 3.4))

    def __repr__(self) -> str:
        where = f"of {self.dim} coordinates" if self._of_ends else f"in {self.dim} dimensions"
        walls = len(self.walls)
        return (
            f"Network({self.sites} sites {where}, {len(self.bonds)} bonds, "
            f"{walls} wall{'s' * (walls != 1)} with {len(self.wall_contacts)} contacts)"
        )


def checked_cables(cables: object, bonds: int) -> tuple[tuple[int, ...], ...]:
    """The bonds that are segments of each cable, checked to exist and to be of one cable."""
    each = [
        check.sequence("bonds of a cable", x, "numbers")
        for x in check.sequence("cables", cables, "sequences of bonds")
    ]
    known = [check.whole("bond of a cable", b, least=0, below=bonds) for x in each for b in x]
    if not all(each) or len(set(known)) < len(known):
        raise TensegrityError(f"cables {check.shown(cables)} must have bonds that differ")
    return tuple(tuple(int(b) for b in x) for x in each)
