"""Branched guides of beads between plane walls, two coordinates each: a `tensegrity.Network`.

Model: seeds/001, eqs. (1)-(6): frictionless contacts without rotation or loss, walls that stand
still.  Beads touch their neighbours and, up to a gap, their walls at time zero.  The list of
contacts is that of the layout; the run makes sure that no other contact formed and that no bead
slid off its wall.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from granular import sensitivity
from granular.beads import Bead, Striker
from granular.contact import checked_law, contact_of, hertz
from granular.crystal import Crystal
from granular.layout import TOUCH, Layout, diamond_layout, y_layout
from granular.materials import Material, materials
from tensegrity import Network, State, TensegrityError, Wall, check
from tensegrity.scenes.clearance import Clearance

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from numpy.typing import ArrayLike

    from granular.contact import Contact, ContactLaw
    from granular.layout import Piece
    from tensegrity.springs.potential import PowerLaw
    from tensegrity.typing import Array, Indices


class Guide(Crystal, Network):
    """Beads in a layout, with a striker before the first.

    Parameters
    ----------
    layout : Layout
    beads : dict of str to Bead
        The bead that fills each part.
    wall : Material
        Of the side walls.
    striker : Striker, optional
        Site 0 then, in contact with the first bead of the first part.
    end : Material, optional
        Of plane walls behind the last beads of the last parts; by default these are free.
    law : callable (Bead, Bead or Material) -> Contact, optional
        `hertz`, or `power(constant, exponent)`.

    Attributes
    ----------
    layout : Layout
    beads : tuple of Bead, (sites,)
    parts : dict of str to tuple of int
    striker : Striker or None
    """

    def __init__(
        self,
        layout: Layout,
        beads: Mapping[str, Bead],
        wall: Material,
        striker: Striker | None = None,
        end: Material | None = None,
        law: ContactLaw = hertz,
    ) -> None:
        check.kind("layout", layout, Layout)
        sides = len(layout.walls)
        for name, material in (("wall", wall), *((("end", end),) if end is not None else ())):
            if not isinstance(material, Material):
                raise TensegrityError(f"{name} {check.shown(material)} is not a Material")
        if striker is not None and not isinstance(striker, Striker):
            raise TensegrityError(f"striker {check.shown(striker)} is not a Striker")
        _fill(layout, beads)
        parts = {"layout": layout, "beads": beads, "wall": wall, "striker": striker, "end": end}
        self._made_of = parts
        if end is not None:
            layout = layout.stopped([p for p in layout.parts if p in _last_parts(layout)])
        layout.check()
        self.layout, self.striker = layout, striker
        first = 0 if striker is None else 1
        parts = {p: tuple(b + first for b in sites) for p, sites in layout.parts.items()}
        filled = [beads[part] for part, sites in layout.parts.items() for _ in sites]
        positions, bonds = layout.positions, layout.contacts() + first
        if striker is not None:
            parts = {"striker": (0,), **parts}
            filled = [striker.bead, *filled]
            before = positions[0] - [striker.bead.radius + filled[1].radius, 0.0]
            positions = np.concatenate([[before], positions])
            bonds = np.concatenate([[[0, 1]], bonds])
        self.parts, self.beads = parts, tuple(filled)
        touched = np.add(layout.wall_contacts(), (first, 0))
        solids: list[Any] = [wall if number < sides else end for _, number in touched]
        springs, walls = _Springs(checked_law(law)), tuple(_wall(piece) for piece in layout.walls)
        super().__init__(
            positions,
            bonds,
            [springs(self.beads[i], self.beads[j]) for i, j in bonds],
            mass=[bead.mass for bead in self.beads],
            walls=walls,
            wall_contacts=touched,
            wall_spring=[
                springs(self.beads[b], solid) for (b, _), solid in zip(touched, solids, strict=True)
            ],
            wall_gaps=layout.wall_gaps(),
            radius=None if layout.blind else [bead.radius for bead in self.beads],
        )
        self._contacts = springs.contacts
        on_walls = [(int(b), solid) for (b, _), solid in zip(touched, solids, strict=True)]
        self._pairs: Any = [*map(tuple, bonds.tolist()), *on_walls]

    bead_arguments = sensitivity.NAMES

    def by_beads(
        self, name: str, by_mass: Array, by_spring: Callable[[str], Array], by_gap: Array
    ) -> Array:
        """Derivatives by an argument of every bead at its place; see `granular.sensitivity`."""
        by_constant = by_spring("stiffness")
        return sensitivity.by_beads(
            name, self.beads, self._pairs, self.springs, by_constant, by_mass, by_gap
        )

    @cached_property
    def clearance(self) -> Clearance | None:
        """What watches over the contacts that are not listed; None where beads are blind."""
        return None if self.radius is None else _Clearance(self)

    def start(self) -> State:
        """The striker in contact and moving along the axis, all else at rest."""
        u, v = np.zeros(self.shape), np.zeros(self.shape)
        if self.striker is not None:
            v[0, 0] = self.striker.speed
        return State(u, v)

    def contact_forces(self, u: Array) -> Array:
        """Compressive force in each contact [N], those with walls last; (..., contacts)."""
        return np.concatenate([-self.bond_tension(u), self.wall_load(u)], axis=-1)

    def overlaps(self, u: ArrayLike) -> Array:
        """Overlap of each contact of two beads [m], < 0 for a gap; (..., bonds)."""
        return -self.elongation(u)

    def contacts_at(self, site: int) -> list[int]:
        """Numbers of the contacts of a bead, those with walls last."""
        walls = len(self.bonds) + np.flatnonzero(self.wall_contacts[:, 0] == site)
        return [*np.flatnonzero((self.bonds == site).any(axis=1)).tolist(), *walls.tolist()]

    def contacts_within(self, part: str | None = None) -> list[int]:
        """Numbers of the contacts between beads of a part, or between any."""
        sites = range(self.sites) if part is None else self.members(part)
        return np.flatnonzero(np.isin(self.bonds, list(sites)).all(axis=1)).tolist()

    def needed(self, site: int) -> list[int]:
        """Sites on which the contacts of a bead depend."""
        return sorted({site, *self.bonds[(self.bonds == site).any(axis=1)].ravel().tolist()})

    def cosines(self, u: Array, site: int) -> Array:
        """|n . k| of each contact of a bead, k along its displacement; (..., contacts).

        0 for a bead that has not moved.
        """
        size = np.linalg.norm(u[..., site, :], axis=-1, keepdims=True)
        k = u[..., site, :] / np.where(size > 0, size, 1.0)
        numbers = np.array(self.contacts_at(site))
        bonds, walls = numbers[numbers < len(self.bonds)], numbers[numbers >= len(self.bonds)]
        normals = [self.walls[w].normal for w in self.wall_contacts[walls - len(self.bonds), 1]]
        along = np.einsum("...bk,...k->...b", self.direction(u)[..., bonds, :], k)
        across = k @ np.array(normals).reshape(-1, 2).T
        return np.abs(np.concatenate([along, across], axis=-1))

    def bead_energies(self, u: Array, v: Array) -> Array:
        """Energy of each site [J], contacts with walls apart; (..., sites)."""
        energies = self.site_energy(u, v)
        held = self.wall_energy(u)
        for contact, (site, _) in enumerate(self.wall_contacts):
            energies[..., site] -= held[..., contact]
        return energies

    def walls_hold(self, u: Array) -> Array:
        """Energy of all contacts with walls [J]; (...)."""
        return self.wall_energy(u).sum(axis=-1)


class _Clearance(Clearance):
    """Knows that a bead which may touch a bevel does not touch the two walls at their edge.

    Such a bead meets these walls only when its foot comes to stand on them.
    """

    def __init__(self, guide: Guide) -> None:
        listed = guide.wall_contacts
        radius: Any = guide.radius  # the beads of a guide that is watched have one
        super().__init__(guide.positions, radius, guide.bonds, guide.walls, listed)
        pieces = guide.layout.walls
        self._behind = {
            (bead, number)
            for bead, bevel in listed.tolist()
            if pieces[bevel].is_bevel
            for number in (bevel - 1, bevel - 2)
        }

    def wall_gaps(self, x: Array, pairs: Indices) -> Array:
        """Gap of each (site, wall) [m], or the way to it where a bevel is before it."""
        gaps = super().wall_gaps(x, pairs)
        for row, (site, number) in enumerate(pairs.tolist()):
            if (site, number) in self._behind:
                gaps[row] = max(gaps[row], float(self.walls[number].overhang(x[site])))
        return gaps


class _Springs:
    """One spring object for all contacts of the same kind of partners."""

    def __init__(self, law: ContactLaw) -> None:
        self._law = law
        self._known: dict[tuple[Bead, Bead | Material], PowerLaw] = {}
        self.contacts: list[Contact] = []

    def __call__(self, bead: Bead, other: Bead | Material) -> PowerLaw:
        pair = bead, other
        if pair not in self._known:
            self.contacts.append(contact_of(self._law, bead, other))
            self._known[pair] = self.contacts[-1].spring()
        return self._known[pair]


def _fill(layout: Layout, beads: Mapping[str, Bead]) -> None:
    """Refuse beads that do not fit the layout."""
    if not isinstance(beads, Mapping):
        raise TensegrityError(f"beads {check.shown(beads)} must be a dict of parts and Beads")
    for part in layout.parts:
        bead = beads.get(part)
        if not isinstance(bead, Bead):
            raise TensegrityError(f"bead {check.shown(bead)} of {part} is not a Bead")
        if abs(bead.diameter - layout.diameter) > TOUCH * layout.diameter:
            raise TensegrityError(
                f"beads of {part} have diameter {bead.diameter:.6g} m, must be that of the guide, "
                f"{layout.diameter:.6g} m: others would overlap, or leave gaps, by up to "
                f"{abs(bead.diameter - layout.diameter):.3g} m"
            )


def _last_parts(layout: Layout) -> tuple[str, ...]:
    return ("stem 2",) if "stem 2" in layout.parts else ("branch 1", "branch 2")


def _wall(piece: Piece) -> Wall:
    middle = np.add(piece.start, piece.end) / 2
    return Wall(middle, piece.normal, piece.along * piece.length / 2)


def y_guide(
    stem: int = 19,
    branch: int = 23,
    half_angle: float = math.pi / 6,
    *,
    bead: Bead,
    branches: tuple[Bead, Bead] | None = None,
    wall: Material = materials["ptfe"],
    striker: Striker | None = None,
    end: Material | None = None,
    gap: float = 0.0,
    through: float = 0.0,
    law: ContactLaw = hertz,
) -> Guide:
    """The first half of the guide of seeds/001: a stem that splits into two branches.

    Parameters
    ----------
    stem, branch : int
        Beads in the stem and in each branch.
    half_angle : float
        Of each branch from the axis [rad].  Below pi/6 the first beads of the branches stand at
        pi/6, touching, and the branches go on from there.
    bead : Bead
        Of the stem.
    branches : (Bead, Bead), optional
        Of the upper and the lower branch, "branch 1" and "branch 2"; by default as the stem.
    wall : Material, optional
        Of the side walls.
    striker : Striker, optional
    end : Material, optional
        Of walls behind the last beads; by default these are free.
    gap : float, optional
        Between beads and side walls [m].
    through : float, optional
        How far the outer walls run on past the junction [m]; see `y_layout`.
    law : callable, optional
        `hertz`, or `power(constant, exponent)`.

    Returns
    -------
    Guide
        With parts "striker", "stem 1", "branch 1", "branch 2".

    Raises
    ------
    TensegrityError
        Beads of another diameter than the guide's, which would overlap or leave gaps; half angles,
        counts and gaps out of range.  `simulate` raises ContactError where a contact forms that
        the guide does not list.
    """
    layout = y_layout(stem, branch, half_angle, _diameter(bead), gap, through)
    return Guide(layout, _filling(bead, branches), wall, striker, end, law)


def diamond_guide(
    stem: int = 19,
    branch: int = 47,
    half_angle: float = math.pi / 6,
    *,
    bead: Bead,
    branches: tuple[Bead, Bead] | None = None,
    wall: Material = materials["ptfe"],
    striker: Striker | None = None,
    end: Material | None = None,
    gap: float = 0.0,
    through: float = 0.0,
    law: ContactLaw = hertz,
) -> Guide:
    """The full guide of seeds/001: the branches meet again in a second stem.

    Parameters, result and errors as for `y_guide`, with the further part "stem 2", whose first
    bead is the junction.  `branch` counts the beads between the junctions, the corner in their
    middle; `half_angle` is pi/6 or more.  `end` stops stem 2.
    """
    layout = diamond_layout(stem, branch, half_angle, _diameter(bead), gap, through)
    beads = {**_filling(bead, branches), "stem 2": bead}
    return Guide(layout, beads, wall, striker, end, law)


def _diameter(bead: Bead) -> float:
    if not isinstance(bead, Bead):
        raise TensegrityError(f"bead {check.shown(bead)} is not a Bead")
    return bead.diameter


def _filling(bead: Bead, branches: tuple[Bead, Bead] | None) -> dict[str, Bead]:
    branches = (bead, bead) if branches is None else branches
    if not isinstance(branches, (tuple, list)) or len(branches) != 2:
        raise TensegrityError(f"branches {check.shown(branches)} must be two beads")
    return {"stem 1": bead, "branch 1": branches[0], "branch 2": branches[1]}
