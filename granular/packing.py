"""Packs of beads in the plane or in space, between plane walls: a `tensegrity.Network`.

Model: as for the guides, frictionless contacts without rotation, by default Hertz's, and rigid
walls at rest.  Pairs of beads, and beads and walls, with an initial gap below 1e-9 diameters touch:
their contacts are listed with a gap of exactly 0.  Any other contact that forms ends a run with an
error (contacts "fixed") or is found before it acts ("follow").
Source: the talk, part II, "2D granular crystals/systems", "3D granular crystals/systems".
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

from granular.assembly import Assembly, Equilibrium, SharedSprings, rest_of
from granular.beads import Bead, Material, Striker, beads_of
from granular.contact import hertz
from granular.contact_network import site_name
from granular.layout import TOUCH
from granular.surroundings import OfPlaces, Surroundings, accepted, surrounded
from tensegrity import State, TensegrityError, Wall, check
from tensegrity.readonly import Repeated, as_fixed, fixed
from tensegrity.scenes.near_pairs import near_pairs
from tensegrity.typing import Array, Indices

Walls = Mapping[str, tuple[Wall, Material]]

PER_BEAD = 550  # bytes while a pack is built: places, contacts, and their search

FARTHEST = 1e6  # radii: there the round-off of a place is still well below what counts as touching


class Pack(Assembly):
    """Beads at given places, optionally with a striker, which is then the last site.

    Parameters
    ----------
    places : array_like, (beads, dim)
        Initial centres of the beads without the striker [m]; dim 1 to 3, the last axis points up.
    beads : Bead or sequence of Bead, (beads,)
    walls : dict of str to (Wall, Material), optional
    contacts : {"fixed", "follow"}
    parts : dict of str to sequence of int, optional
        Sites of each part, without the striker; by default all are "beads".
    striker : Striker, optional
    approach : tuple of two (dim,), optional
        Place [m] and direction of motion of the striker.
    **surroundings
        See `Surroundings`.

    Attributes
    ----------
    places : ndarray, (beads, dim)
        As given: the places of all sites but the striker.
    beads : sequence of Bead, (sites,)
    parts : dict of str to range or tuple of int
    striker : Striker or None
    named_walls : dict of str to (Wall, Material)
        As `pack` takes them.
    equilibrium : Equilibrium or None
        Static equilibrium of the beads without the striker; None without loads.
    """

    equilibrium: Equilibrium | None
    places: Array
    parts: dict[str, Sequence[int]]

    @surrounded(OfPlaces, preload=None)
    def __init__(
        self,
        places: ArrayLike,
        beads: Bead | Sequence[Bead],
        walls: Walls | None = None,
        contacts: str = "fixed",
        *,
        parts: Mapping[str, Sequence[int]] | None = None,
        striker: Striker | None = None,
        approach: tuple[ArrayLike, ArrayLike] | None = None,
        **surroundings: Unpack[OfPlaces],
    ) -> None:
        surroundings.setdefault("preload", None)
        around = Surroundings(**accepted(Pack.__init__, surroundings))
        places = check.floats("places", places)
        if places.ndim != 2 or places.shape[1] not in (1, 2, 3) or not len(places):
            raise TensegrityError(
                f"places have shape {places.shape}, must be (beads, 1), 2 or 3, of one bead or more"
            )
        places = check.vector("places", places, places.shape)
        if not isinstance(contacts, str) or contacts not in ("fixed", "follow"):
            raise TensegrityError(f"contacts {check.shown(contacts)} must be 'fixed' or 'follow'")
        filled, count = per_place(beads, len(places)), len(places)
        if striker is None:
            sites = places = fixed(places)
        else:
            start, self._heading = (np.asarray(x, dtype=float) for x in approach)  # type: ignore[union-attr]
            sites = as_fixed(np.concatenate([places, start[None]]))
            places = sites[:-1]
        named = _named_walls(walls)
        parts = {"beads": range(len(places))} if parts is None else parts
        given = {name: _range(sites) for name, sites in parts.items()}
        self._arguments = {
            "places": places, "beads": filled, "walls": named, "contacts": contacts,
            "parts": given, "striker": striker, "approach": approach,
            "gravity": around.gravity, "preload": around.preload, "forces": around.forces,
        }  # fmt: skip
        self.places, self.striker = places, striker
        if striker is not None:
            filled = filled + Repeated.of([striker.bead])
            given = {"striker": range(count, count + 1), **given}
        self.parts, self.beads = given, filled
        self.named_walls, self.wall_names = dict(named), tuple(named)
        solids = tuple(material for _, material in named.values())
        self._wall_materials, self._hertzian = solids, around.law is hertz
        springs = SharedSprings(around.law)
        self._join(sites, filled, contacts, springs, around)
        self._contacts = springs.contacts
        self.equilibrium = rest_of(
            self, springs.attract, striker=None, approach=None, law=springs.contact, forces=()
        )
        self._rest = self._at_rest(filled.each(lambda bead: bead.radius))

    def _join(
        self,
        places: Array,
        filled: Repeated,
        contacts: str,
        springs: SharedSprings,
        around: Surroundings,
    ) -> None:
        """The network of the beads that touch."""
        solids = self._wall_materials
        radius = filled.each(lambda bead: bead.radius)
        planes = [wall for wall, _ in self.named_walls.values()]
        bonds, touched = self._touching(places, radius, planes)
        followed = None
        if contacts == "follow":  # a bounded wall holds a bead only within its extent
            endless = np.array([wall.extent is None for wall in planes], dtype=bool)
            touched = touched[endless[touched[:, 1]]]
            followed = _Law(filled, planes, solids, springs)
        loads = _loads(filled, places.shape, around.gravity, around.preload)
        in_bonds = springs.between(filled[bonds[:, 0]], filled[bonds[:, 1]])
        at_walls = springs.between(filled[touched[:, 0]], Repeated.of(solids)[touched[:, 1]])
        if followed is not None and not self._hertzian:
            springs.try_all(filled, solids)
        self._losses = springs.losses(filled, bonds, solids, touched, followed is not None)
        super().__init__(
            places,
            bonds,
            in_bonds,
            mass=filled.each(lambda bead: bead.mass),
            walls=planes,
            wall_contacts=touched,
            wall_spring=at_walls,
            wall_gaps=np.zeros(len(touched)),
            radius=radius,
            loads=loads,
            contacts=contacts,
            law=followed,
            forces=(*self._losses, *around.forces),
            drive=around.drive,
            damping=around.damping,
        )

    def _forces_between(self, bonds: Array, wall_contacts: Array) -> dict[str, Any]:
        """The forces of these contacts, and those of the user."""
        if self._hertzian:
            return {}
        springs = self._law.given.springs
        losses = springs.losses(self.beads, bonds, self._wall_materials, wall_contacts, True)
        if losses and not self._losses:
            raise TensegrityError(
                "a contact that formed dissipates, others of the same materials do not"
            )
        return {"_losses": losses, "_forces": (*losses, *self._arguments["forces"])}

    def _touching(
        self, places: Array, radius: Array, walls: Sequence[Wall]
    ) -> tuple[Indices, Indices]:
        """Pairs of beads and (bead, wall) that touch; refuses those that overlap."""
        far = np.abs(places).max(axis=1)
        if np.any(far > FARTHEST * radius.min()):
            k = int(np.argmax(far))
            raise TensegrityError(
                f"{site_name(self, k)} is {far[k]:.3g} m off the origin, must be at most "
                f"{FARTHEST * radius.min():.3g} m, {FARTHEST:.0e} radii: gaps are lost in round-off"
            )
        ends, gap = near_pairs(places, radius, 3 * TOUCH * radius.max())
        room = TOUCH * (radius[ends[:, 0]] + radius[ends[:, 1]])
        if np.any(gap < -room):
            k = int(np.argmin(gap))
            one, other = (site_name(self, int(end)) for end in ends[k])
            both = float(radius[ends[k]].sum())
            raise TensegrityError(
                f"{one} and {other} overlap by {-gap[k]:.6g} m at the start, must be at most "
                f"{room[k]:.1g} m: the distance of their centres is {both + gap[k]:.6g} m, the sum "
                f"of their radii {both:.6g} m"
            )
        touched = [np.zeros((0, 2), dtype=int)]
        for number, (wall, name) in enumerate(zip(walls, self.wall_names, strict=True)):
            if wall.point.size != places.shape[1]:
                raise TensegrityError(
                    f"wall {name!r} has {wall.point.size} coordinates, the places have "
                    f"{places.shape[1]}"
                )
            near = np.flatnonzero(wall.height(places) < 2 * radius)  # all others are clear of it
            x, r = places[near], radius[near]
            height, beside = wall.height(x), wall.overhang(x) <= 0
            depth = np.where(beside, r - height, r - wall.distance(x))
            if np.any(depth > 2 * TOUCH * r):
                worst = int(np.argmax(depth / r))
                where = "behind" if height[worst] < 0 and beside[worst] else "through"
                raise TensegrityError(
                    f"{site_name(self, int(near[worst]))} reaches {depth[worst]:.6g} m {where} the "
                    f"wall {name!r} at the start: its centre is {height[worst]:.6g} m before it, "
                    f"must be at least its radius, {r[worst]:.6g} m"
                )
            close = near[beside & (np.abs(height - r) <= 2 * TOUCH * r)]
            touched.append(np.stack([close, np.full(len(close), number)], axis=1))
        joined = np.concatenate(touched)
        order = np.argsort(joined[:, 0], kind="stable")
        return ends.T.compress(gap <= room, axis=1).T, joined[order]

    def _at_rest(self, radius: Array) -> Array:
        """Displacements at rest; the striker is taken along by the bead that it is nearest to, and
        moved back as far as it would overlap others."""
        if self.equilibrium is None:
            return np.broadcast_to(0.0, self.shape)
        u = np.zeros(self.shape)
        beads = slice(len(self.places))
        u[beads] = self.equilibrium.u
        if self.striker is not None:
            first, radii = self.positions[-1], radius[beads] + radius[-1]
            gaps = np.linalg.norm(self.positions[beads] - first, axis=1) - radii
            u[-1] = u[int(np.argmin(gaps))]
            apart = first + u[-1] - self.positions[beads] - u[beads]
            along = apart @ self._heading
            within = radii**2 - np.sum(apart**2, axis=1)
            back = along + np.sqrt(np.maximum(along**2 + within, 0.0))
            close = within > 2e-12 * radii**2
            u[-1] -= np.max(back[close], initial=0.0) * self._heading
        return u

    def start(self) -> State:
        """Initial state: the striker moving, all else at rest.

        Raises
        ------
        TensegrityError
            A pack without a striker: give velocities to `at_rest`.
        """
        if self.striker is None:
            raise TensegrityError(
                "this pack has no striker to start: give velocities to at_rest, {site: velocity}"
            )
        velocity = (self.striker.speed * self._heading).tolist()
        return self.at_rest({self.sites - 1: velocity})

    def distance(self, part: str, numbers: tuple[int, int]) -> float:
        """Initial distance between the centres of two different beads of a part [m]."""
        super().distance(part, numbers)  # refuses what are no two different beads of it
        first, second = (self.positions[self.site(part, number)] for number in numbers)
        return float(np.linalg.norm(second - first))


def _loads(
    beads: Repeated,
    shape: tuple[int, ...],
    gravity: float,
    preload: Mapping[int, ArrayLike] | None,
) -> Array | None:
    """Constant force on each site [N]; None without any."""
    preload = {} if preload is None else preload
    if not isinstance(preload, Mapping):
        raise TensegrityError(f"preload {check.shown(preload)} must be a dict {{site: force}}")
    if not gravity and not preload:
        return None
    loads = np.zeros(shape)
    loads[:, -1] -= gravity * beads.each(lambda bead: bead.mass)
    for site, force in preload.items():
        number = check.whole("site of a preload", site, least=0)
        if number >= shape[0]:
            raise TensegrityError(f"site {number} of a preload must be below {shape[0]}")
        given = check.floats(f"preload of site {number}", force)
        loads[number] += check.vector(f"preload of site {number}", given, shape[1:])
    return loads


@dataclass(frozen=True)
class _Law:
    """The springs of contacts that form, by sites and walls."""

    beads: Sequence[Bead]
    walls: Sequence[Wall]
    solids: Sequence[Material]
    springs: SharedSprings

    def __call__(self, site: int, other: int | Wall) -> Any:
        if isinstance(other, Wall):
            number = next(k for k, wall in enumerate(self.walls) if wall is other)
            return self.springs(self.beads[site], self.solids[number])
        return self.springs(self.beads[site], self.beads[other])


@surrounded(OfPlaces, preload=None)
def pack(
    places: ArrayLike,
    beads: Bead | Sequence[Bead],
    walls: Walls | None = None,
    contacts: str = "follow",
    **surroundings: Unpack[OfPlaces],
) -> Pack:
    """Beads at arbitrary positions on a line, in the plane or in space.

    Parameters
    ----------
    places : array_like, (beads, dim)
        Centres [m], dim 1 to 3; the last axis points up.  Beads must not overlap: pairs, and beads
        and walls, with a gap of at most 1e-9 diameters, of either sign, touch.
    beads : Bead or sequence of Bead
        One for all, or one for each place.
    walls : dict of str to (Wall, Material), optional
        By name; walls with an `extent` end there, others do not.
    contacts : {"follow", "fixed"}, optional
        "follow": contacts that form are found before they act, and a bead that leaves through an
        open side, or flies past the end of a wall, is followed; one that touches the end of a wall,
        for which there is no law, ends the run with ContactError.  "fixed": so does any contact
        that is not there at the start.
    **surroundings
        See `Surroundings`.

    Returns
    -------
    Pack
        With the part "beads"; `at_rest({site: velocity})` makes states of it.

    Raises
    ------
    TensegrityError
        Beads that overlap each other or a wall, or stand behind one; arguments of another type or
        shape.
    EquilibriumError
        No equilibrium under the loads within a tenth of the radius of a bead.

    Examples
    --------
    A bead flies into another one, from a distance of one diameter:

    >>> from granular import Bead, materials, pack, simulate
    >>> bead = Bead(diameter=10e-3, material=materials["steel"])
    >>> pair = pack([(0.0, 0.0), (0.02, 0.0)], bead)
    >>> run = simulate(pair, pair.at_rest({0: (1.0, 0.0)}), t_end=0.03)
    >>> run.final.v[:, 0].round(6) + 0.0
    array([0., 1.])
    """
    return Pack(places, beads, walls, contacts, **accepted(pack, surroundings))


def _range(sites: Sequence[int]) -> Sequence[int]:
    """The sites of a part, as a range if they are consecutive."""
    if isinstance(sites, range) or not len(sites):
        return sites
    consecutive = range(sites[0], sites[0] + len(sites))
    return consecutive if list(consecutive) == list(sites) else tuple(sites)


def per_place(beads: Bead | Sequence[Bead], count: int) -> Repeated:
    """One Bead for each of `count` places, from one for all or a sequence."""
    if isinstance(beads, Bead):
        return Repeated((beads,), np.zeros(count, dtype=int))
    if not isinstance(beads, Iterable) or isinstance(beads, (str, bytes, Mapping)):
        raise TensegrityError(f"beads {check.shown(beads)} are not a Bead or a sequence of Beads")
    of_each = beads if isinstance(beads, Repeated) else check.sequence("beads", beads, "Beads")
    repeated = Repeated.of(of_each)
    if not all(isinstance(bead, Bead) for bead in repeated.different):
        beads_of(repeated)  # refuses the first that is none
    if len(repeated) != count:
        raise TensegrityError(f"{len(repeated)} beads for {count} places: give one for each")
    return repeated


def _named_walls(walls: Walls | None) -> dict[str, tuple[Wall, Material]]:
    """Walls by name as given, if they are."""
    if walls is None:
        return {}
    if not isinstance(walls, Mapping):
        raise TensegrityError(f"walls {check.shown(walls)} must be a dict of names and pairs")
    named = {}
    for name, pair in walls.items():
        check.kind("name of a wall", name, str)
        if not isinstance(pair, (tuple, list)) or len(pair) != 2:
            raise TensegrityError(
                f"wall {name!r} is {check.shown(pair)}, must be a pair (Wall, Material)"
            )
        check.kind(f"wall {name!r}", pair[0], Wall)
        check.kind(f"material of the wall {name!r}", pair[1], Material)
        named[name] = (pair[0], pair[1])
    return named
