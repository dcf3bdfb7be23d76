"""Scenes of beads: parts, bead numbers, recorded rows; contacts, their energies, forces on walls.

`Crystal` is the common base of chains, guides and packs.  `contacts_of` returns the contacts of
one.  Those of guides and packs are listed by the scene or, if contacts may form and break, near
given displacements; see `Network.listed`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from granular.beads import Bead, Striker
from tensegrity import Force, Run, TensegrityError, check
from tensegrity.engine import forces
from tensegrity.measure.observables import directions
from tensegrity.printing import concise
from tensegrity.scenes.dynamics import dynamics
from tensegrity.typing import Array, Indices

MANY = 6  # parts that are not all named in print


class Crystal:
    """A scene of beads in named parts.

    Attributes
    ----------
    beads : sequence of Bead
        One for each site that is a bead, the striker first where there is one.
    parts : dict of str to sequence of int
        Sites of each part, in the paper's counting order.
    striker : Striker or None
    """

    beads: Sequence[Bead]
    parts: Mapping[str, Sequence[int]]
    striker: Striker | None
    wall_names: tuple[str, ...]
    _arguments: dict[str, Any]
    _losses: Sequence[Force]  # of contacts that dissipate
    _carried: Any  # by each contact at elongation 0 [N]
    _pressed: Any  # overlap of each contact there [m]
    if TYPE_CHECKING:
        sites: int
        bonds: Indices

        shape: tuple[int, ...]

        def _with_walls(self) -> WithWalls: ...

    __str__ = concise

    def __repr__(self) -> str:
        counts = [f"{name}: {len(sites)}" for name, sites in self.parts.items()]
        parts = ", ".join(counts if len(counts) < MANY else [*counts[:2], "...", counts[-1]])
        struck = "" if self.striker is None else f", struck at {self.striker.speed:g} m/s"
        return f"{type(self).__name__}({parts}{struck}) on {super().__repr__()}"

    def contact_forces(self, u: ArrayLike, v: ArrayLike | None = None) -> Array:
        """Compressive force in each contact [N], (..., contacts): those of `bonds`, and behind them
        those with the walls of a guide or a pack.

        Contacts that may form are those of `listed(u)`.  Contacts that dissipate need the
        velocities v [m/s] too, of the shape of u.
        """
        u, of = check.rows("displacements", u, self.shape), dynamics(self)
        loads = self._carried - of.evaluate("tension", u)
        if not self._losses:
            return loads
        r, rate = of.elongations(u), forces.rates(of.contact_bonds, u, needed_velocities(self, v))
        for loss in self._losses:
            sign, first = (1, len(self.bonds)) if loss.on == "walls" else (-1, 0)
            at = np.asarray(loss.at, dtype=int) + first
            if len(at):
                loads[..., at] += sign * loss.values(r[..., at], rate[..., at])
        return loads

    def overlaps(self, u: ArrayLike) -> Array:
        """Overlap of each contact of `bonds`, as in `contact_forces` [m], < 0 for a gap."""
        u = check.rows("displacements", u, self.shape)
        return self._pressed - dynamics(self).listed(u).scene.elongation(u)

    def site(self, part: str, number: int) -> int:
        """Site of the bead with that number, from 1, in a part.

        Raises
        ------
        TensegrityError
            An unknown part, or a number that it does not have.
        """
        sites = members(self, part)
        number = check.whole(f"bead of {part}", number, least=1)
        if number > len(sites):
            raise TensegrityError(f"bead {number} of {part} must be at most {len(sites)}")
        return sites[number - 1]

    def distance(self, part: str, numbers: tuple[int, int]) -> float:
        """Length of the path through touching beads of a part between two numbers [m], > 0."""
        if not isinstance(numbers, (tuple, list)) or len(numbers) != 2:
            raise TensegrityError(f"numbers {numbers!r} of {part} must be two different beads")
        first, second = sorted(self.site(part, n) for n in numbers)
        if first == second:
            raise TensegrityError(f"numbers {numbers!r} of {part} must be two different beads")
        beads = beads_by_site(self)
        diameters = [beads[s].diameter for s in range(first, second + 1)]
        return sum(diameters) - (diameters[0] + diameters[-1]) / 2


class WithWalls(NamedTuple):
    """The contacts of beads with walls.

    Attributes
    ----------
    contacts : ndarray of int
        Their numbers among all contacts.
    sites, walls : ndarray of int
        The bead of each, and the wall, an index into `wall_names`.
    """

    contacts: Indices
    sites: Indices
    walls: Indices


def members(scene: Crystal, part: str) -> Sequence[int]:
    """Sites of a part; TensegrityError if there is no such part."""
    if not isinstance(part, str) or part not in scene.parts:
        raise TensegrityError(f"part {check.shown(part)} is not one of {', '.join(scene.parts)}")
    return scene.parts[part]


def site_name(scene: Crystal, site: int) -> str:
    """Words for a site: its part and its number in it, from 1."""
    for part, sites in scene.parts.items():
        if site in sites:
            known = f"bead {sites.index(site) + 1} of {part}"
            return "the striker" if part == "striker" else known
    return f"site {site}"


def beads_by_site(scene: Crystal) -> dict[int, Bead]:
    """The bead of each site that is one; the others stand for the walls of a chain."""
    return dict(enumerate(scene.beads, start=int("start wall" in scene.parts)))


def crystal_of(run: Any) -> Crystal:
    """The scene of a run, if it is one of beads."""
    if not isinstance(run, Run):
        raise TensegrityError(f"run is {type(run).__name__}, not a Run")
    if not isinstance(run.scene, Crystal):
        raise TensegrityError(
            f"the scene of the run is {type(run.scene).__name__}, not a chain, a guide or a "
            "pack of beads"
        )
    return run.scene


def rows(run: Run, sites: Iterable[int], name: str = "u") -> Array:
    """Displacements of all sites, or their velocities "v"; those named must have been recorded.

    Parameters
    ----------
    run : Run
    sites : iterable of int
    name : {"u", "v"}, optional

    Returns
    -------
    ndarray, (T, sites[, dim])
        0 where nothing was recorded.

    Raises
    ------
    TensegrityError
        One of `sites` was not recorded.
    """
    missing = sorted(set(sites) - set(run.sites))
    if missing:
        raise TensegrityError(f"site {missing[0]} is needed and was not recorded")
    if run.sites == tuple(range(run.scene.sites)):
        return getattr(run, name)
    table = np.zeros((len(run.t), run.scene.sites, *run.u.shape[2:]))
    table[:, list(run.sites)] = getattr(run, name)
    return table


def whole(run: Run) -> tuple[Array, Array]:
    """Displacements and velocities of all sites in their order, whatever the record's; (T, sites[,
    dim]) each.

    Raises
    ------
    TensegrityError
        A site was not recorded.
    """
    u = rows(run, range(run.scene.sites))
    return u, run.v[:, np.argsort(run.sites)]


def needed_velocities(scene: Any, v: ArrayLike | None) -> Array:
    """The velocities on which the forces of contacts that dissipate depend, checked."""
    if v is None:
        raise TensegrityError("the forces of contacts that dissipate depend on v: give v")
    return check.rows("velocities", v, scene.shape)


def contacts_of(scene: Any) -> Contacts:
    """The contacts of a scene of beads."""
    return Contacts(scene)


def wall_sites(scene: Crystal, name: str) -> list[int]:
    """Sites that must be recorded for `granular.wall_force` on the walls of a name.

    All sites if contacts may form and break.
    """
    check.kind("scene", scene, Crystal)
    return Contacts(scene).of_wall(name)


def wall_forces(scene: Crystal, u: ArrayLike, name: str, v: ArrayLike | None = None) -> Array:
    """Contact force of each site on the walls of a name at displacements u.

    Parameters
    ----------
    scene : BeadChain, Guide or Pack
    u : array_like, (..., sites[, dim])
        [m]
    name : str
        As for `granular.wall_force`.
    v : array_like, shape of u, optional
        Velocities [m/s], for contacts that dissipate.

    Returns
    -------
    ndarray, (..., sites)
        [N], compression > 0.
    """
    check.kind("scene", scene, Crystal)
    return Contacts(scene).wall_forces(u, name, v)


def kinetic(scene: Any, v: Array) -> Array:
    """Kinetic energy of each site [J]; v (..., *shape of the scene) gives (..., sites)."""
    return 0.5 * scene.mass * _by_site(scene, v**2)


class Contacts:
    """The contacts of a scene, numbered as its `contact_forces`."""

    def __init__(self, scene: Any) -> None:
        self.scene, self._bonds, self._at_walls = scene, scene.bonds, scene._with_walls()

    def of_site(self, site: int) -> list[int]:
        """Numbers of the contacts of a bead, those with the walls of guides and packs last."""
        pairs = np.nonzero(self._bonds == site)[0].tolist()
        walls = self._at_walls.contacts[self._at_walls.sites == site].tolist()
        return sorted({*pairs, *walls})

    def within(self, part: str | None) -> list[int]:
        """Numbers of the contacts between sites of a part, or between any."""
        sites = range(self.scene.sites) if part is None else members(self.scene, part)
        return np.flatnonzero(np.isin(self._bonds, list(sites)).all(axis=1)).tolist()

    def neighbours(self, site: int) -> list[int]:
        """Sites on which the contacts of a bead depend: all where contacts come."""
        bonds = self._bonds
        if dynamics(self.scene).follows:
            return list(range(self.scene.sites))
        return sorted({site, *bonds[(bonds == site).any(axis=1)].ravel().tolist()})

    def sensed(self, u: Array, v: Array, sites: Sequence[int]) -> Array:
        """Forces across the middle planes of beads; see `sensor_force`.

        Parameters
        ----------
        u, v : ndarray, (..., *shape of the scene)
            [m], [m/s]
        sites : sequence of int

        Returns
        -------
        ndarray, (..., sites)
            [N]
        """

        def forces(scene: Any, rows: Array, rates: Array) -> Array:
            of, load = Contacts(scene), scene.contact_forces(rows, rates)
            parts = [load[..., of.of_site(s)] for s in sites]
            if len(scene.shape) > 1:
                parts = [one * of.cosines(rows, s) for one, s in zip(parts, sites, strict=True)]
            return np.stack([one.sum(axis=-1) / 2 for one in parts], axis=-1)

        return self._each(u, forces, v)

    def cosines(self, u: Array, site: int) -> Array:
        """|n . k| of each contact of a bead, k along its displacement; (..., contacts).

        0 for a bead that has not moved; not of a chain, where all are 1.
        """
        scene, count = self.scene, len(self._bonds)
        size = np.linalg.norm(u[..., site, :], axis=-1, keepdims=True)
        k = u[..., site, :] / np.where(size > 0, size, 1.0)
        numbers = np.array(self.of_site(site), dtype=int)
        bonds, walls = numbers[numbers < count], numbers[numbers >= count] - count
        normals = [scene.walls[w].normal for w in scene.wall_contacts[walls, 1]]
        along = np.einsum("...bk,...k->...b", directions(scene, u)[..., bonds, :], k)
        across = k @ np.array(normals).reshape(-1, scene.dim).T
        return np.abs(np.concatenate([along, across], axis=-1))

    def bead_energies(self, u: Array, v: Array) -> Array:
        """Energy of each site [J], without the contacts with walls; (..., sites)."""
        scene = self.scene
        held = kinetic(scene, v) + self._each(u, _of_pairs)
        stored = dynamics(scene).acting.stored(0, u)
        return held - _by_site(scene, scene.loads * u) + _by_site(scene, stored)

    def wall_energy(self, u: Array) -> Array:
        """Energy of all contacts with walls [J]; (...)."""
        return self._each(u, lambda scene, rows: _at_walls(scene, rows).sum(axis=-1))

    def stored(self, u: Array) -> Array:
        """Half the energy of each bead's contacts with others, and all of those with walls [J].

        What the contacts store by themselves, without the potential of the loads; (..., sites).
        """
        return self._each(u, lambda scene, rows: _shared(scene, scene._stored_energies(rows)))

    def of_wall(self, name: str) -> list[int]:
        """Sites on which the forces on the walls of a name depend: all if contacts may form."""
        numbers, at_walls = self._walls(name), self._at_walls
        if dynamics(self.scene).follows:
            return list(range(self.scene.sites))
        return sorted(set(at_walls.sites[np.isin(at_walls.walls, numbers)].tolist()))

    def wall_forces(self, u: ArrayLike, name: str, v: ArrayLike | None) -> Array:
        """Contact force of each site on the walls of a name.

        Parameters
        ----------
        u, v, name
            As of `wall_forces`.

        Returns
        -------
        ndarray, (..., sites)
            [N], compression > 0.
        """
        numbers = self._walls(name)

        def forces(scene: Any, rows: Array, rates: Any = None) -> Array:
            at_walls = scene._with_walls()
            chosen = np.isin(at_walls.walls, numbers)
            loads = scene.contact_forces(rows, rates)[..., at_walls.contacts[chosen]]
            by_site = np.zeros((*loads.shape[:-1], scene.sites))
            return _added(by_site, at_walls.sites[chosen], loads)

        u = check.rows("displacements", u, self.scene.shape)
        if not self.scene._losses:
            return self._each(u, forces)
        return self._each(u, forces, needed_velocities(self.scene, v))

    def _walls(self, name: str) -> list[int]:
        """Numbers of the walls of that name."""
        names = self.scene.wall_names
        if not isinstance(name, str) or name not in names:
            listed = ", ".join(dict.fromkeys(names)) or "none"
            raise TensegrityError(f"wall {check.shown(name)} is not one of this scene's: {listed}")
        return [k for k, given in enumerate(names) if given == name]

    def _each(self, u: Array, function: Callable[..., Array], *more: Array) -> Array:
        """`function(scene, rows, ..)` of all rows, by the contacts that are listed there."""
        shape = self.scene.shape
        flat, others = u.reshape(-1, *shape), [one.reshape(-1, *shape) for one in more]
        listings = dynamics(self.scene).listings(flat)
        parts = [
            function(listed.scene, flat[rows], *(one[rows] for one in others))
            for rows, listed in listings
        ]
        values = (
            parts[0] if len(parts) == 1 else np.concatenate(parts or [np.zeros((0, *shape[:1]))])
        )
        return values.reshape((*u.shape[: u.ndim - len(shape)], *values.shape[1:]))


def _by_site(scene: Any, values: Array) -> Array:
    """Sums over the coordinates of each site; (..., *shape of the scene) gives (..., sites)."""
    return values if len(scene.shape) == 1 else np.sum(values, axis=-1)


def _of_pairs(scene: Any, u: Array) -> Array:
    """Half the energy of each bead's contacts with others, with the potential of loads [J]."""
    energies = dynamics(scene).evaluate("energy", u)
    energies[..., scene._with_walls().contacts] = 0.0
    return _shared(scene, energies)


def _at_walls(scene: Any, u: Array) -> Array:
    """Energy of each contact with a wall [J]; (..., contacts with walls)."""
    return np.take(dynamics(scene).evaluate("energy", u), scene._with_walls().contacts, axis=-1)


def _shared(scene: Any, energies: Array) -> Array:
    """Energies of contacts, (..., contacts), in equal parts on two beads, or on that at a wall;
    (..., sites)."""
    by_site, at_walls = np.zeros((*energies.shape[:-1], scene.sites)), scene._with_walls()
    half, within = energies[..., : len(scene.bonds)] / 2, at_walls.contacts < len(scene.bonds)
    for end in scene.bonds.T:
        _added(by_site, end, half)
    standing, beads = at_walls.contacts[within], at_walls.sites[within]
    by_site[..., scene.bonds[standing].sum(axis=1) - beads] = 0.0  # sites that stand for walls
    _added(by_site, beads, half[..., standing])
    others = at_walls.contacts[~within]
    return _added(by_site, at_walls.sites[~within], np.take(energies, others, axis=-1))


def _added(total: Array, sites: Indices, values: Array) -> Array:
    """`total` (..., sites) with values (..., contacts) added at their sites, in place."""
    np.add.at(np.moveaxis(total, -1, 0), sites, np.moveaxis(values, -1, 0))
    return total
