"""The text of LAMMPS files: beads in space, their types, walls and loads."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import singledispatch
from itertools import pairwise
from typing import Any

import numpy as np

from granular.assembly import Assembly
from granular.bead_chain import BeadChain
from granular.beads import Bead, Material, volume
from granular.contact import Contact, hertz, is_hertz
from granular.contact_network import beads_by_site
from granular.dissipation import ELASTIC, Dissipation
from granular.packing import Pack
from tensegrity import Potential, State, TensegrityError, check
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.forcing import refuse_driven
from tensegrity.typing import Array

GROUPS = 31  # of LAMMPS, besides "all"
SKIN = 0.3  # of the smallest radius: room of the neighbour lists


@dataclass(frozen=True)
class Plane:
    """A wall, the sites that it pushes (None: all), and a name."""

    name: str
    point: Array
    normal: Array
    material: Material
    sites: tuple[int, ...] | None


@dataclass(frozen=True)
class Laid:
    """Beads in space, as LAMMPS takes them.

    Attributes
    ----------
    sites : list of int
        Of each bead.
    places, u, v, loads : ndarray, (beads, 3)
        Where displacements count from, displacement, velocity, constant force.
    axes : int
        Coordinates that the scene has.
    """

    sites: list[int]
    beads: list[Bead]
    places: Array
    u: Array
    v: Array
    loads: Array
    walls: list[Plane]
    axes: int
    contact: Callable[[Bead, Bead | Material], Contact | None] | None

    def types(self) -> tuple[list[int], list[Bead]]:
        """The type of each bead from 1, and a bead of each: one for each material and its radii.

        Where all contacts take the beads' own radii, as LAMMPS does, one for each material; where
        they dissipate, one for each different bead.
        """
        own = all(math.isclose(b.contact_radius, b.radius, rel_tol=1e-12) for b in self.beads)
        radii: list[tuple[Any, ...]]
        radii = [() if own else (bead.contact_radius, bead.radius) for bead in self.beads]
        radii = radii if self.contact is None else [(bead,) for bead in self.beads]
        keys = [(bead.material, *x) for bead, x in zip(self.beads, radii, strict=True)]
        kinds = dict(zip(keys[::-1], self.beads[::-1], strict=True))
        numbers = {key: number for number, key in enumerate(dict.fromkeys(keys), 1)}
        return [numbers[key] for key in keys], [kinds[key] for key in numbers]

    def data(self) -> str:
        """The data file: beads, velocities, loads."""
        types, kinds = self.types()
        x = self.places + self.u
        room = max(bead.diameter for bead in self.beads)
        lines = [f"{len(x)} beads", "", f"{len(x)} atoms", f"{len(kinds)} atom types", ""]
        for axis, low, high in zip("xyz", x.min(axis=0) - room, x.max(axis=0) + room, strict=True):
            lines.append(f"{low:.17g} {high:.17g} {axis}lo {axis}hi")
        lines += ["", "Atoms # sphere", ""]
        for k, (kind, bead) in enumerate(zip(types, self.beads, strict=True)):
            density = bead.mass / volume(bead.diameter)
            lines.append(f"{k + 1} {kind} {bead.diameter:.17g} {density:.17g} {_numbers(x[k])}")
        lines += ["", "Velocities", ""]
        lines += [f"{k + 1} {_numbers(row)} 0 0 0" for k, row in enumerate(self.v)]
        if self.loads.any():
            lines += ["", "Loads", ""]
            lines += [f"{k + 1} {_numbers(row)}" for k, row in enumerate(self.loads)]
        return "\n".join([*lines, ""])

    def input(self, name: str, steps: int, dt: float, every: int) -> str:
        """The text of the input script.

        Parameters
        ----------
        name : str
            Of the file of the script.
        steps : int
        dt : float
            [s].
        every : int
            Number of steps between recorded rows.

        Returns
        -------
        str
        """
        types, kinds = self.types()
        push = bool(self.loads.any())
        sides = " ".join("m" * self.axes + "f" * (3 - self.axes))
        lines = [
            f"# {len(self.beads)} beads with Hertz contacts, velocity Verlet",
            "units si", "atom_style sphere", f"boundary {sides}", "comm_modify vel yes",
            f"neighbor {SKIN * min(b.radius for b in self.beads):.17g} bin",
            "neigh_modify every 1 delay 0 check yes",
            *["fix loads all property/atom d_lx d_ly d_lz"] * push,
            f"read_data {_file(name, 'data')}" + " fix loads NULL Loads" * push,
            "pair_style granular",
        ]  # fmt: skip
        for i, one in enumerate(kinds, 1):
            for j, other in enumerate(kinds[i - 1 :], i):
                meet = i != j or types.count(i) > 1
                lines.append(f"pair_coeff {i} {j} {self._law(one, other, meet)}")
        lines += ["fix motion all nve", f"timestep {dt:.17g}"]
        if push:
            lines += [f"variable l{axis} atom d_l{axis}" for axis in "xyz"]
            lines.append("fix push all addforce v_lx v_ly v_lz")
        lines += self._walls(types, kinds, name, every)
        dump = "custom {} id x y z vx vy vz modify sort id format float %.17g"
        last = dump.format(_file(name, "last"))
        return "\n".join(
            [
                *lines,
                f"dump rows all custom {every} {_file(name, 'dump')} id x y z vx vy vz",
                "dump_modify rows sort id format float %.17g",
                "thermo_style custom step", f"thermo {max(1, steps // 100)}",
                f"run {steps}", f"write_dump all {last}", "",
            ]
        )  # fmt: skip

    def _law(self, one: Bead, other: Bead | Material, meet: bool = True) -> str:
        """The law of two partners that may meet: Hertz's, with the damping of those that
        dissipate."""
        radius, mass = one.radius, one.mass
        if isinstance(other, Bead):
            radius = radius * other.radius / (radius + other.radius)
            mass = mass * other.mass / (mass + other.mass)
        elastic = hertz(one, other).constant
        contact = self.contact(one, other) if meet and self.contact else None
        if contact:
            _refuse_other_law(contact.potential, one, other)
        loss = (contact and contact.dissipation) or ELASTIC
        eta, kind = loss.constant, "velocity"
        own = "" if type(loss) is Dissipation else f", as {type(loss).__name__} gives them,"
        if loss.constant and (own or loss.model not in ("Kuwabara-Kono", "viscous")):
            raise TensegrityError(
                f"contacts of {loss.model}{own} dissipate: LAMMPS has Kuwabara-Kono and viscous of "
                "these"
            )
        if loss.constant and loss.model == "Kuwabara-Kono":
            eta, kind = 1.5 * elastic * loss.constant / (math.sqrt(radius) * mass), "viscoelastic"
        damping = f" damping {kind} limit_damping" if eta else ""
        k = elastic / math.sqrt(radius)
        return f"hertz {k:.17g} {eta:.17g} tangential linear_nohistory 0 0{damping}"

    def _walls(self, types: list[int], kinds: list[Bead], name: str, every: int) -> list[str]:
        """Lines of the walls: a fix for each wall and type of bead, and their sums in a file."""
        lines: list[str] = []
        groups: dict[tuple[str, ...], str] = {}
        for w, wall in enumerate(self.walls):
            lines.append(f"region plane{w} plane {_numbers(wall.point)} {_numbers(wall.normal)}")
            parts = []
            for kind, bead in enumerate(kinds, 1):
                members = self._pushed(wall, types, kind)
                if not members:
                    continue
                if members not in groups:
                    groups[members] = f"touch{len(groups)}"
                    lines += [f"group {groups[members]} {some}" for some in members]
                who, part = groups[members], f"{w}x{kind}"
                sums = " ".join(f"f_wall{part}[{axis}]" for axis in (2, 3, 4))
                lines += [
                    f"fix wall{part} {who} wall/gran/region granular "
                    f"{self._law(bead, wall.material)} region plane{w} contacts",
                    f"compute sum{part} {who} reduce sum {sums}",
                ]
                parts.append(f"c_sum{part}")
            along = [(axis, n) for axis, n in enumerate(wall.normal, 1) if n]
            pull = ("+".join(f"{part}[{axis}]*({-n:.17g})" for part in parts) for axis, n in along)
            total = "+".join(f"({x})" for x in pull) if parts else "0"
            lines.append(f"variable wall{w} equal -({total})")
        if self.walls:
            title = " ".join(json.dumps(wall.name) for wall in self.walls).replace("'", "\\u0027")
            every_wall = " ".join(f"v_wall{w}" for w in range(len(self.walls)))
            lines.append(
                f"fix sums all ave/time {every} 1 {every} {every_wall} "
                f"file {_file(name, 'walls')} format \" %.17g\" title1 '# step {title}'"
            )
        if len(groups) > GROUPS:
            raise TensegrityError(
                f"{len(groups)} sets of beads of one type at a wall are more than the {GROUPS} "
                "groups that LAMMPS has"
            )
        return lines

    def _pushed(self, wall: Plane, types: list[int], kind: int) -> tuple[str, ...]:
        """The beads of a type that a wall pushes, as groups take them."""
        if wall.sites is None:
            return (f"type {kind}",)
        index = {site: k for k, site in enumerate(self.sites)}
        held = map(index.__getitem__, wall.sites)
        ids = [str(k + 1) for k in held if types[k] == kind]
        return tuple(f"id {' '.join(ids[k : k + 50])}" for k in range(0, len(ids), 50))


def _file(name: str, ending: str) -> str:
    """A file in the folder of the input as one word for LAMMPS, quoted if necessary."""
    marks = [mark for mark in ('"', "'", '"""') if mark not in name]
    if name == "none" or not marks or not re.fullmatch("[ -~]+", name) or set("*%") & set(name):
        raise TensegrityError(
            f"{check.shown(name)} cannot be the name of an input of LAMMPS, which must be "
            "printable ASCII without * and %, other than none, and not with both kinds of quotes"
        )
    mark = "" if re.fullmatch(r"[\w.-]+", name) else marks[0]
    return f"{mark}{name}.{ending}{mark}"


def _numbers(row: Array) -> str:
    return " ".join(f"{x:.17g}" for x in row)


def laid(scene: Any, state: State) -> Laid:
    """A scene and a state of it in space."""
    places, loads, walls = _placed(scene)
    losses = dynamics(scene).further_forces if scene._losses else ()
    if scene.drive or scene.damping or len(losses) > len(scene._losses):
        raise TensegrityError(
            "a hand-off to LAMMPS: not with drives, dashpots or forces besides those of contacts"
        )
    if not losses:
        refuse_driven(scene, "a hand-off to LAMMPS")
    scene.check(state)
    by_site = beads_by_site(scene)
    sites = list(by_site)
    beads = list(by_site.values())
    u, v = (np.reshape(x, (scene.sites, -1))[sites] for x in (state.u, state.v))
    axes = u.shape[1]
    places, u, v, loads = (_in_space(x) for x in (places, u, v, loads))
    return Laid(sites, beads, places, u, v, loads, walls, axes, _law_of(scene))


def _law_of(scene: Any) -> Any:
    """The contact of two partners, None of two that never touch; None of a scene in which all
    contacts are Hertz's without losses."""
    if isinstance(scene, Pack):
        if scene._hertzian:
            return None
        if dynamics(scene).follows:
            return scene._law.given.springs.contact
    elif not scene._losses:
        return None
    if isinstance(scene, BeadChain):
        pairs, contacts = list(pairwise(scene.bodies)), scene.contacts
    else:  # one contact for all equal pairs, in the order of the first of them
        partners = dict.fromkeys(_partners(scene))
        pairs, contacts = list(partners), scene._contacts
    known = dict(zip(pairs, contacts, strict=True))
    known = {pair[::-1]: contact for pair, contact in known.items()} | known

    def contact(one: Bead, other: Bead | Material) -> Contact | None:
        kind, of = ("bead", other.material) if isinstance(other, Bead) else ("wall", other)
        if isinstance(scene, Pack) and (one, other) not in known:
            raise TensegrityError(
                f"a bead of {one.material.name} touches no {kind} of {of.name}: "
                "a pack of fixed contacts does not "
                "say by which law they would meet in LAMMPS: take contacts='follow', or hertz"
            )
        return known.get((one, other))

    return contact


@singledispatch
def _placed(scene: Any) -> tuple[Array, Array, list[Plane]]:
    """Places and loads of the beads of a scene, and its walls."""
    raise TensegrityError(f"scene {check.shown(scene)} is not a chain, a guide or a pack of beads")


@_placed.register
def _line(scene: BeadChain) -> tuple[Array, Array, list[Plane]]:
    """Along x."""
    bodies = scene.bodies
    for contact, (a, b) in zip(scene.contacts, pairwise(bodies), strict=True):
        _refuse_other_law(contact.potential, a, b)
    beads = beads_by_site(scene)
    radii = np.array([beads[s].radius if s in beads else 0.0 for s in range(scene.sites)])
    rest = scene.overlaps(np.zeros(scene.sites))
    x = np.concatenate([[0.0], np.cumsum(radii[:-1] + radii[1:] - rest)])
    carried = scene.contact_forces(*np.zeros((2, scene.sites)))
    loads = np.diff(np.concatenate([[0.0], carried, [0.0]]))
    walls = []
    for name, site, body, normal in (
        ("start", 0, bodies[0], 1.0), ("end", scene.sites - 1, bodies[-1], -1.0)
    ):  # fmt: skip
        if site not in beads:
            point, way = np.array([x[site], 0, 0]), np.array([normal, 0, 0])
            walls.append(Plane(name, point, way, body, None))
    sites = list(beads)
    return x[sites, None], loads[sites, None], walls


@_placed.register
def _net(scene: Assembly) -> tuple[Array, Array, list[Plane]]:
    """In the plane or in space."""
    if scene.radius is None:
        raise TensegrityError("beads that pass through each other have no equivalent in LAMMPS")
    if scene._arguments.get("gaps"):
        raise TensegrityError("gaps between the beads of a guide have no equivalent in LAMMPS")
    of = dynamics(scene)
    table, group = of.springs, of.springs.group
    known = set()
    solids = scene._wall_materials
    for number, (one, other) in zip(group.tolist(), _partners(scene), strict=True):
        key = number, id(one), id(other)
        if key not in known:
            _refuse_other_law(table.different[number], one, other)
            known.add(key)
    walls = []
    for number, (wall, name) in enumerate(zip(scene.walls, scene.wall_names, strict=True)):
        listed = scene.wall_contacts[scene.wall_contacts[:, 1] == number, 0].tolist()
        if wall.extent is not None and of.follows:
            raise TensegrityError(
                f"wall {name!r} has an end and contacts come and go: its edge "
                "cannot be expressed in LAMMPS; leave out its extent"
            )
        point, normal = (_in_space(x[None])[0] for x in (wall.point, wall.normal))
        members = None if wall.extent is None else tuple(listed)
        walls.append(Plane(name, point, normal, solids[number], members))
    return scene.positions, scene.loads, walls


def _partners(scene: Assembly) -> list[tuple[Bead, Bead | Material]]:
    """The two partners of each contact of a guide or a pack."""
    beads, solids = scene.beads, scene._wall_materials
    partners: list[Any] = [(beads[i], beads[j]) for i, j in scene.bonds.tolist()]
    return partners + [(beads[s], solids[w]) for s, w in scene.wall_contacts.tolist()]


def _refuse_other_law(law: Potential, one: Any, other: Any) -> None:
    if not is_hertz(law, one, other):
        expected = hertz(*((one, other) if isinstance(one, Bead) else (other, one)))
        raise TensegrityError(
            f"a contact of {law!r} is not Hertz's, of constant {expected.constant:.6g} and "
            f"exponent {expected.exponent:g}, which alone LAMMPS evaluates"
        )


def _in_space(x: Array) -> Array:
    """Rows of one to three coordinates as rows of three."""
    return np.pad(x, ((0, 0), (0, 3 - x.shape[1])))
