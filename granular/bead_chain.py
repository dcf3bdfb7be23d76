"""Beads in a straight line, one coordinate each: a `tensegrity.Chain` of power-law contacts.

Beads touch at rest, or are separated by gaps, which are initial displacements: contacts close and
open during any motion.  Gravity and precompression are constant loads W_i on the beads;
elongations count from the equilibrium under all loads, so that the energy of the contacts includes
the potential of the loads.  A striker that falls on a loaded chain starts in contact without
overlap.
Source: the talk, part II, "Discrete element modeling" (the potentials W_i).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

from granular.beads import Bead, Material, Striker, beads_of
from granular.contact import BY_BEADS, Contact, ContactLaw, by_beads, contact_of
from granular.contact_network import Crystal, WithWalls
from granular.damped_contact import forces_of
from granular.surroundings import OfChain, Surroundings, accepted, surrounded
from tensegrity import Chain, Damping, Drive, Force, State, TensegrityError, check
from tensegrity.springs.collection import Springs
from tensegrity.typing import Array

PER_BEAD = 2000  # bytes: each contact has its own spring
WALL_MASS = 1.0  # kg: of the site that represents a wall, which is held: any value


class BeadChain(Crystal, Chain):
    """A chain of beads, optionally with a striker or a wall before it and a wall behind it.

    Attributes
    ----------
    beads : tuple of Bead
        One for each site that is not a wall.
    parts : dict of str to tuple of int
        Sites of "striker" or "start wall", "chain" and "wall", in the order of a wave's passage.
    striker : Striker or None
    bodies : tuple of Bead or Material
        One for each site: a Material stands for a wall.
    """

    _arguments_of_sites = BY_BEADS

    def __init__(
        self,
        beads: tuple[Bead, ...],
        striker: Striker | None,
        loads: Sequence[float],
        end: Material | None,
        law: ContactLaw,
        start_wall: Material | None = None,
        drive: Mapping[int, Drive] | None = None,
        damping: Damping | None = None,
        gaps: Sequence[float] = (),
        forces: Sequence[Force] = (),
    ) -> None:
        forces = check.sequence("forces", forces, "forces")
        self._arguments: dict[str, Any] = {
            "beads": beads, "striker": striker, "loads": tuple(loads), "end": end,
            "start_wall": start_wall, "gaps": tuple(gaps), "forces": forces,
        }  # fmt: skip
        self.striker = striker
        self.beads: tuple[Bead, ...] = (striker.bead, *beads) if striker else tuple(beads)
        walls = (start_wall is not None, end is not None)
        bodies: list[Any] = [start_wall] * walls[0] + [*self.beads] + [end] * walls[1]
        sites, first = len(bodies), len(bodies) - len(beads) - walls[1]
        parts: dict[str, tuple[int, ...]] = {"striker": (0,)} if striker else {}
        if walls[0]:
            parts["start wall"] = (0,)
        parts["chain"] = tuple(range(first, first + len(beads)))
        if walls[1]:
            parts["wall"] = (sites - 1,)
        self.parts, self.bodies = parts, tuple(bodies)
        self.wall_names = ("start",) * walls[0] + ("end",) * walls[1]
        pairs = list(pairwise(bodies))
        self._contacts = [
            contact_of(law, *((a, b) if isinstance(a, Bead) else (b, a))) for a, b in pairs
        ]
        loads = [0.0] * walls[0] + list(loads)
        self._carried = np.cumsum(loads)[: sites - 1]  # by each contact in equilibrium [N]
        self._unstruck = np.cumsum([0.0, *loads[1:]] if striker else loads)[: sites - 1]
        springs = [
            contact.spring(preload, sum(x.radius for x in pair if isinstance(x, Bead)))
            for contact, preload, pair in zip(self._contacts, self._carried, pairs, strict=True)
        ]
        masses = [x.mass if isinstance(x, Bead) else WALL_MASS for x in bodies]
        ends = tuple("fixed" if wall else "free" for wall in walls)
        carried = zip(self._contacts, self._carried, strict=True)
        self._pressed = np.array([c.overlap(force) for c, force in carried])
        self._losses = losses = forces_of(self._contacts, self._pressed)
        forcing: dict[str, Any] = {"drive": drive, "damping": damping}
        super().__init__(springs, sites, masses, ends, forces=(*losses, *forces), **forcing)  # type: ignore[arg-type]
        away = _away(self._contacts, gaps) if len(gaps) else np.zeros(sites)
        self._separated = away - away[-1] if walls[1] else away  # a wall stays where it is
        self._refuse_displaced_drives()

    def _refuse_displaced_drives(self) -> None:
        """Refuse gaps that displace a site whose motion is prescribed."""
        for site, one in self.drive.items():
            if one.prescribes and self._separated[site]:
                raise TensegrityError(
                    f"gaps displace site {site} by {self._separated[site]:g} m, but its motion is "
                    "prescribed: let its drive begin there, and leave out the gaps"
                )

    def at_rest(self, velocity: Mapping[int, float] | None = None) -> State:
        """The initial separations, with velocities [m/s] of some sites; see `tensegrity.Chain`."""
        state = super().at_rest(velocity)
        return State(state.u + self._separated, state.v)

    def start(self) -> State:
        """Initial state: the striker moving, all else at rest under its loads, or at its gap."""
        u, v = self._separated.copy(), np.zeros(self.sites)
        if self.striker:
            v[0] = self.striker.speed
            relief = [
                c.overlap(with_striker) - c.overlap(without)
                for c, with_striker, without in zip(
                    self._contacts, self._carried, self._unstruck, strict=True
                )
            ]
            u[:-1] -= np.cumsum(relief[::-1])[::-1]
        return State(u, v)

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """The law of each contact."""
        return tuple(self._contacts)

    def _by_argument(
        self, name: str, by_mass: Array, by_spring: Callable[[str], Array], by_gap: Any
    ) -> Array:
        """Derivatives with respect to an argument of every bead; see `granular.contact`.

        The weight of a bead depends on its mass, and with it the preloads of the contacts.
        """
        end = self._arguments["end"]
        if self._arguments["start_wall"] is not None:
            raise TensegrityError("no derivatives by beads of a chain with a start wall")
        neighbours = [*range(1, len(self.beads)), *([] if end is None else [end])]
        pairs = list(zip(range(len(self.beads)), neighbours, strict=False))
        if name == "diameter" and self._carried.any():
            by_mass = by_mass.copy()
            pulled = np.cumsum(by_spring("preload")[::-1])[::-1]  # by the weight of each bead
            gravity = _gravity(self)
            by_mass[: len(pulled)] += gravity * pulled if gravity else 0.0
        by_constant = by_spring("stiffness")
        return by_beads(name, self.beads, pairs, self.springs, by_constant, by_mass, None)

    def _with_walls(self) -> WithWalls:
        """The contacts with walls, which stand for sites."""
        last = self.sites - 2
        ends = [(0, 1)] * ("start wall" in self.parts) + [(last, last)] * ("wall" in self.parts)
        contacts, sites = np.reshape(ends, (-1, 2)).astype(int).T
        return WithWalls(contacts, sites, np.arange(len(ends)))

    def _stored_energies(self, u: Array) -> Array:
        """Energy that each contact stores, without the potential of the loads [J]; (..., sites - 1)
        of u (..., sites)."""
        laws = Springs([contact.potential for contact in self._contacts])
        return laws.evaluate("energy", -self.overlaps(u))


def _away(contacts: Sequence[Contact], gaps: Sequence[float]) -> Array:
    """Displacement of each site from rest to its gaps [m]: partners that attract overlap there."""
    pairs = zip(contacts, gaps, strict=True)
    return np.cumsum([0.0, *(gap + c.overlap(0.0) if gap else 0.0 for c, gap in pairs)])


def _gravity(chain: BeadChain) -> float:
    """Gravity [m/s^2], from the weight of a bead that carries no other load."""
    loads = chain._arguments["loads"]
    if chain.striker is None and len(chain.beads) == 1:
        raise TensegrityError(
            "the load of a single bead does not determine its weight: no derivative by its diameter"
        )
    site = 0 if chain.striker else -1
    return loads[site] / chain.beads[site].mass


@surrounded(OfChain)
def chain(
    beads: Sequence[Bead],
    *,
    striker: Striker | None = None,
    start_wall: Material | None = None,
    end: Material | None = None,
    **surroundings: Unpack[OfChain],
) -> BeadChain:
    """A straight chain of beads that touch, or that gaps separate.

    With a striker, gravity requires an `end`: no constant force balances the last bead both before
    and after the striker's weight arrives.

    Parameters
    ----------
    beads : sequence of Bead
        In the order of the axis; with striker and walls at least two sites.
    striker : Striker, optional
        Becomes site 0, in contact with the first bead.
    start_wall : Material, optional
        Material of a plane wall before the first bead, which becomes site 0 and is held.  It
        excludes a striker.
    end : Material, optional
        Material of a plane wall behind the last bead.  By default that bead is free and, under
        loads, supported by a constant force.
    **surroundings
        See `Surroundings`.

    Returns
    -------
    BeadChain

    Raises
    ------
    TensegrityError
        An argument that is not the Bead, Striker or Material required; a chain without a contact;
        negative gravity, preload or gaps; gravity with a striker and without an end; gaps under
        loads, between two walls, or of another number than the contacts.

    Examples
    --------
    >>> from granular import Bead, Striker, chain, materials
    >>> steel = materials["steel"]
    >>> bead = Bead(diameter=10e-3, material=steel)
    >>> print(chain([bead] * 20, striker=Striker(bead, speed=0.5), end=steel))
    BeadChain(striker: 1, chain: 20, wall: 1, struck at 0.5 m/s) on Chain(22 sites,
        2 kinds of springs, ends ('free', 'fixed'))
    """
    if isinstance(beads, Sequence):
        check.memory(f"a chain of {len(beads)} beads", PER_BEAD * len(beads))
    beads = beads_of(beads)
    if striker is not None:
        check.kind("striker", striker, Striker)
    for name, wall in (("end", end), ("start_wall", start_wall)):
        if wall is not None and not isinstance(wall, Material):
            raise TensegrityError(f"{name} {check.shown(wall)} is not the Material of a wall")
    if striker is not None and start_wall is not None:
        raise TensegrityError("a striker and a start_wall exclude each other: give one")
    others = sum(x is not None for x in (striker, start_wall, end))
    if not beads or len(beads) + others < 2:
        raise TensegrityError(f"a chain of {len(beads)} beads has no contact: give more beads")
    around = Surroundings(**accepted(chain, surroundings))
    gravity = around.gravity
    if striker is not None and gravity > 0 and end is None:
        raise TensegrityError(
            f"gravity {gravity:g} m/s^2 with a striker needs an end: without a wall the chain "
            "is not at rest until the striker's weight reaches the last bead"
        )
    weights = [gravity * bead.mass for bead in ((striker.bead,) if striker else ()) + beads]
    weights[1 if striker else 0] += around.push
    contacts = len(beads) + others - 1
    separations = initial_gaps(around.gaps, contacts, any(weights), start_wall and end)
    return BeadChain(
        beads, striker, weights, end, around.law, start_wall, around.drive, around.damping,
        separations, around.forces,
    )  # fmt: skip


def initial_gaps(
    gaps: ArrayLike, contacts: int, is_loaded: bool, walls: object
) -> tuple[float, ...]:
    """The initial separations in all contacts.

    Parameters
    ----------
    gaps : float or array_like, (contacts,)
        [m], >= 0.
    contacts : int
    is_loaded, walls : object
        Whether there are loads, and walls at both ends, which gaps exclude.

    Returns
    -------
    tuple of float
        [m]; empty where all beads touch.

    Raises
    ------
    TensegrityError
        Gaps of another shape, below 0, or excluded.
    """
    given = check.floats("gaps", gaps)
    if given.ndim and given.shape != (contacts,):
        raise TensegrityError(f"gaps have shape {given.shape}, must be ({contacts},), a contact")
    for number, gap in enumerate(given.ravel()):
        check.number(f"gap {number}", gap, least=0, unit="m")
    if not given.any():
        return ()
    gaps = tuple(np.broadcast_to(given, contacts).tolist())
    check.number("sum of the gaps", sum(gaps), unit="m")
    for excluded, words in ((is_loaded, "gravity and preload 0"), (walls, "one wall at most")):
        if excluded:
            raise TensegrityError(f"gaps up to {given.max():g} m require {words}")
    return gaps
