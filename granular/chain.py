"""Beads in a straight line, one coordinate each: a `tensegrity.Chain` of power-law contacts.

Beads touch at rest.  Gravity and precompression are constant loads W_i on the beads; each contact
is measured from the equilibrium under all loads, so that its energy holds the loads' too.  A
striker that falls on a loaded chain starts in contact without overlap.
Source: seeds/000, part II, "Discrete element modeling" (the potentials W_i).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence, Sized
from typing import TYPE_CHECKING

import numpy as np

from granular import sensitivity
from granular.beads import Bead, Striker
from granular.contact import checked_law, contact_of, hertz
from granular.crystal import Crystal
from granular.materials import Material
from tensegrity import Chain, State, TensegrityError, check

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from numpy.typing import ArrayLike

    from granular.contact import ContactLaw
    from tensegrity.typing import Array

PER_BEAD = 2000  # bytes: each contact is a spring of its own
WALL_MASS = 1.0  # kg: of the site that stands for a wall; it is held, any number will do


class BeadChain(Crystal, Chain):
    """A chain of beads, perhaps with a striker before it and a wall behind it.

    Attributes
    ----------
    beads : tuple of Bead
        One for each site, the wall apart.
    parts : dict of str to tuple of int
        Sites of "striker", "chain" and "wall", in the order in which a wave meets them.
    striker : Striker or None
    """

    def __init__(
        self,
        beads: tuple[Bead, ...],
        striker: Striker | None,
        loads: Sequence[float],
        end: Material | None,
        law: ContactLaw,
    ) -> None:
        self._made_of: dict[str, Any] = {
            "beads": beads,
            "striker": striker,
            "loads": loads,
            "end": end,
        }
        self.striker = striker
        self.beads: tuple[Bead, ...] = (striker.bead, *beads) if striker else tuple(beads)
        first = len(self.beads) - len(beads)
        sites = len(self.beads) + (end is not None)
        parts: dict[str, tuple[int, ...]] = {"striker": (0,)} if striker else {}
        parts["chain"] = tuple(range(first, len(self.beads)))
        if end is not None:
            parts["wall"] = (len(self.beads),)
        self.parts = parts
        neighbours = (*self.beads[1:], *(() if end is None else (end,)))
        pairs = zip(self.beads, neighbours, strict=False)
        self._contacts = [contact_of(law, a, b) for a, b in pairs]
        self._carried = np.cumsum(loads)[: sites - 1]  # by each contact in equilibrium [N]
        self._unstruck = np.cumsum([0.0, *loads[1:]] if striker else loads)[: sites - 1]
        springs = [
            contact.spring(preload, a.radius + (b.radius if isinstance(b, Bead) else 0.0))
            for contact, preload, a, b in zip(
                self._contacts, self._carried, self.beads, neighbours, strict=False
            )
        ]
        masses = [*(bead.mass for bead in self.beads), *([] if end is None else [WALL_MASS])]
        super().__init__(springs, sites, masses, ("free", "free" if end is None else "fixed"))

    def start(self) -> State:
        """The striker in contact and moving, all else at rest under its loads."""
        u, v = np.zeros(self.sites), np.zeros(self.sites)
        if self.striker:
            v[0] = self.striker.speed
            relief = [
                c.overlap(with_striker) - c.overlap(without)
                for c, with_striker, without in zip(
                    self._contacts, self._carried, self._unstruck, strict=True
                )
            ]
            u[:-1] = -np.cumsum(relief[::-1])[::-1]
        return State(u, v)

    bead_arguments = sensitivity.NAMES

    def by_beads(
        self, name: str, by_mass: Array, by_spring: Callable[[str], Array], by_gap: Array
    ) -> Array:
        """Derivatives by an argument of every bead; see `granular.sensitivity`.

        Weights change with masses, and with them the preloads of contacts.
        """
        end = self._made_of["end"]
        neighbours = [*range(1, len(self.beads)), *([] if end is None else [end])]
        pairs = list(zip(range(len(self.beads)), neighbours, strict=False))
        if name == "diameter" and self._carried.any():
            by_mass = by_mass.copy()
            pulled = np.cumsum(by_spring("preload")[::-1])[::-1]  # by the weight of each bead
            gravity = self._gravity
            by_mass[: len(pulled)] += gravity * pulled if gravity else 0.0
        by_constant = by_spring("stiffness")
        return sensitivity.by_beads(
            name, self.beads, pairs, self.springs, by_constant, by_mass, None
        )

    @property
    def _gravity(self) -> float:
        """From the weight of a bead that carries no other load."""
        loads = self._made_of["loads"]
        if self.striker is None and len(self.beads) == 1:
            raise TensegrityError(
                "the load of a single bead does not say what of it is weight: no derivative by its "
                "diameter"
            )
        site = 0 if self.striker else -1
        return loads[site] / self.beads[site].mass

    def contact_forces(self, u: ArrayLike) -> Array:
        """Compressive force in each contact [N]; u of shape (..., sites) gives (..., sites - 1)."""
        return self._carried - self.bond_tension(u)

    def overlaps(self, u: ArrayLike) -> Array:
        """Overlap of each contact [m], < 0 for a gap; shapes as for `contact_forces`."""
        at_rest = [c.overlap(f) for c, f in zip(self._contacts, self._carried, strict=True)]
        return at_rest - self.elongation(u)

    def contacts_at(self, site: int) -> list[int]:
        """Numbers of the contacts of a site."""
        return [j for j in (site - 1, site) if 0 <= j < self.sites - 1]

    def contacts_within(self, part: str | None = None) -> list[int]:
        """Numbers of the contacts between beads of a part, or of all."""
        inside = set(range(self.sites) if part is None else self.members(part))
        return [j for j in range(self.sites - 1) if {j, j + 1} <= inside]

    def needed(self, site: int) -> list[int]:
        """Sites on which the contacts of a site depend."""
        return [s for s in (site - 1, site, site + 1) if 0 <= s < self.sites]

    def cosines(self, u: Array, site: int) -> Array:
        """Share of each contact's force along the bead's displacement: all of it."""
        return np.ones(len(self.contacts_at(site)))

    def bead_energies(self, u: Array, v: Array) -> Array:
        """Energy of each site [J], the contact with the wall apart; (..., sites)."""
        energies = self.site_energy(u, v)
        if "wall" in self.parts:
            energies[..., -2] -= energies[..., -1]
            energies[..., -1] = 0
        return energies

    def walls_hold(self, u: Array) -> Array:
        """Energy of the contact with the wall [J]; (...)."""
        return self.bond_energy(u)[..., -1] if "wall" in self.parts else np.zeros(u.shape[:-1])


def chain(
    beads: Sequence[Bead],
    *,
    striker: Striker | None = None,
    gravity: float = 0.0,
    preload: float = 0.0,
    end: Material | None = None,
    law: ContactLaw = hertz,
) -> BeadChain:
    """A straight chain of touching beads.

    Parameters
    ----------
    beads : sequence of Bead
        In the order of the axis, two or more sites with striker and wall.
    striker : Striker, optional
        Site 0 then, in contact with the first bead.
    gravity : float, optional
        [m/s^2], >= 0, along the axis towards the far end.  With a striker it needs an end: no
        constant force holds the last bead both before the striker's weight came and after.
    preload : float, optional
        Constant force on the first bead (not on the striker) towards the far end [N], >= 0.
    end : Material, optional
        Of a plane wall behind the last bead.  Without, that bead is free and, where there are
        loads, held back by a constant force.
    law : callable (Bead, Bead or Material) -> Contact, optional
        `hertz`, or `power(constant, exponent)`.

    Returns
    -------
    BeadChain

    Raises
    ------
    TensegrityError
        Anything that is not a Bead, a Striker or a Material where one is asked for; no contact;
        negative gravity or preload; gravity with a striker and without an end.
    """
    beads = _beads(beads)
    if striker is not None and not isinstance(striker, Striker):
        raise TensegrityError(f"striker {check.shown(striker)} is not a Striker")
    if end is not None and not isinstance(end, Material):
        raise TensegrityError(f"end {check.shown(end)} is not the Material of a wall")
    if not beads or len(beads) + (striker is not None) + (end is not None) < 2:
        raise TensegrityError(f"a chain of {len(beads)} beads has no contact: give more beads")
    gravity = check.number("gravity", gravity, least=0, unit="m/s^2")
    preload = check.number("preload", preload, least=0, unit="N")
    if striker is not None and gravity > 0 and end is None:
        raise TensegrityError(
            f"gravity {gravity:g} m/s^2 with a striker needs an end: without a wall the chain "
            "is not at rest until the striker's weight reaches the last bead"
        )
    weights = [gravity * bead.mass for bead in ((striker.bead,) if striker else ()) + beads]
    weights[1 if striker else 0] += preload
    return BeadChain(beads, striker, weights, end, checked_law(law))


def _beads(beads: Sequence[Bead]) -> tuple[Bead, ...]:
    """A sequence of beads as a tuple."""
    if isinstance(beads, Bead) or not isinstance(beads, Iterable):
        raise TensegrityError(f"beads {check.shown(beads)} are not a sequence of Beads")
    if isinstance(beads, Sized):
        check.room(f"a chain of {len(beads)} beads", PER_BEAD * len(beads))
    beads = tuple(beads)
    for number, bead in enumerate(beads):
        if not isinstance(bead, Bead):
            raise TensegrityError(f"bead {number} is {check.shown(bead)}, not a Bead")
    return beads
