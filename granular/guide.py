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

from granular.assembly import Assembly, AssemblyDynamics, SharedSprings
from granular.beads import Bead, Striker
from granular.contact import checked_law, hertz
from granular.layout import diamond_layout, y_layout
from granular.materials import Material, materials
from granular.places import TOUCH, Layout
from granular.statics import settle
from tensegrity import State, TensegrityError, Wall, check
from tensegrity.scenes.clearance import Clearance

if TYPE_CHECKING:
    from typing import Any

    from granular.contact import ContactLaw
    from granular.places import Piece
    from granular.statics import Equilibrium
    from tensegrity import Damping, Drive
    from tensegrity.typing import Array, Indices


class Guide(Assembly):
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
    gravity : float, optional
        [m/s^2], >= 0, along the axis of the first part, away from the striker.
    preload : float, optional
        Constant force along that axis on its first bead [N], >= 0.

    Attributes
    ----------
    layout : Layout
    beads : tuple of Bead, (sites,)
    parts : dict of str to tuple of int
    striker : Striker or None
    equilibrium : Equilibrium or None
        How the beads rest under their loads, the striker apart; None without loads.
    """

    equilibrium: Equilibrium | None

    def __init__(
        self,
        layout: Layout,
        beads: Mapping[str, Bead],
        wall: Material,
        striker: Striker | None = None,
        end: Material | None = None,
        law: ContactLaw = hertz,
        gravity: float = 0.0,
        preload: float = 0.0,
        drive: Mapping[int, Drive] | None = None,
        damping: Damping | None = None,
    ) -> None:
        check.kind("layout", layout, Layout)
        sides = len(layout.walls)
        check.kind("wall", wall, Material)
        if end is not None:
            check.kind("end", end, Material)
        if striker is not None:
            check.kind("striker", striker, Striker)
        _fill(layout, beads)
        gravity = check.number("gravity", gravity, least=0, unit="m/s^2")
        preload = check.number("preload", preload, least=0, unit="N")
        self._made_of = {
            "layout": layout, "beads": beads, "wall": wall, "striker": striker, "end": end,
            "gravity": gravity, "preload": preload,
        }  # fmt: skip
        loaded = gravity > 0 or preload > 0
        if loaded and end is None:
            raise TensegrityError(
                f"gravity {gravity:g} m/s^2 and preload {preload:g} N need an end: without walls "
                "behind the last beads nothing carries them"
            )
        found = None
        if striker is not None and loaded:
            found = Guide(**self._made_of | {"striker": None, "law": law}).equilibrium
        if end is not None:
            layout = layout.stopped([p for p in layout.parts if p in _last_parts(layout)])
        layout.check()
        self.layout, self.striker = layout, striker
        self.wall_names = tuple(piece.name for piece in layout.walls)
        stops = () if end is None else (end,) * (len(layout.walls) - sides)
        self._wall_materials = (wall,) * sides + stops
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
        solids: Any = [self._wall_materials[number] for _, number in touched]
        springs = SharedSprings(checked_law(law))
        super().__init__(
            positions,
            bonds,
            [springs(self.beads[i], self.beads[j]) for i, j in bonds],
            mass=[bead.mass for bead in self.beads],
            walls=[_wall(piece) for piece in layout.walls],
            wall_contacts=touched,
            wall_spring=[
                springs(self.beads[b], solid) for (b, _), solid in zip(touched, solids, strict=True)
            ],
            wall_gaps=layout.wall_gaps(),
            radius=None if layout.blind else [bead.radius for bead in self.beads],
            loads=_loads(self.beads, first, gravity, preload),
            drive=drive,
            damping=damping,
        )
        self._contacts = springs.contacts
        if striker is None and loaded:
            found = settle(self)
        self.equilibrium = found
        rest = np.zeros(self.shape)
        if found is not None:  # a striker is taken along by the bead before which it stands
            rest = found.u if striker is None else np.concatenate([found.u[:1], found.u])
        self._rest = rest

    def _dynamics(self) -> _Dynamics:
        return _Dynamics(self)

    def start(self) -> State:
        """The striker in contact and moving along the axis, all else at rest."""
        return self.at_rest({} if self.striker is None else {0: (self.striker.speed, 0.0)})


class _Dynamics(AssemblyDynamics):
    @cached_property
    def clearance(self) -> Clearance | None:
        """What watches over the contacts that are not listed; None where beads are blind."""
        return None if self.scene.radius is None else _Clearance(self.scene)


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
        behind = np.array([tuple(pair) in self._behind for pair in pairs.tolist()], dtype=bool)
        beside = self._by_wall("overhang", x, pairs[behind])
        gaps[..., behind] = np.maximum(gaps[..., behind], beside)
        return gaps


def _loads(beads: tuple[Bead, ...], first: int, gravity: float, preload: float) -> Array:
    """Constant force on each bead along the axis [N], the preload on the first of the stem."""
    loads = np.zeros((len(beads), 2))
    loads[:, 0] = gravity * np.array([bead.mass for bead in beads])
    loads[first, 0] += preload
    return loads


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
    gravity: float = 0.0,
    preload: float = 0.0,
    drive: Mapping[int, Drive] | None = None,
    damping: Damping | None = None,
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
    gravity : float, optional
        [m/s^2], >= 0, along the stem towards the branches.  The state at the start is the static
        equilibrium then; it needs an `end`.
    preload : float, optional
        Constant force on the first bead of stem 1 along it [N], >= 0; likewise.
    drive : dict of int to Drive, optional
        {site: Drive}: motions that are prescribed, and forces that depend on time.
    damping : Damping, optional
        Dashpots in the contacts of beads, which resist while they are open too, and to the ground.

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
    beads = _filling(bead, branches)
    layout = y_layout(stem, branch, half_angle, bead.diameter, gap, through)
    return Guide(layout, beads, wall, striker, end, law, gravity, preload, drive, damping)


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
    gravity: float = 0.0,
    preload: float = 0.0,
    drive: Mapping[int, Drive] | None = None,
    damping: Damping | None = None,
) -> Guide:
    """The full guide of seeds/001: the branches meet again in a second stem.

    Parameters, result and errors as for `y_guide`, with the further part "stem 2", whose first
    bead is the junction.  `branch` counts the beads between the junctions, the corner in their
    middle; `half_angle` is pi/6 or more.  `end` stops stem 2.
    """
    beads = {**_filling(bead, branches), "stem 2": bead}
    layout = diamond_layout(stem, branch, half_angle, bead.diameter, gap, through)
    return Guide(layout, beads, wall, striker, end, law, gravity, preload, drive, damping)


def _filling(bead: Bead, branches: tuple[Bead, Bead] | None) -> dict[str, Bead]:
    check.kind("bead", bead, Bead)
    branches = (bead, bead) if branches is None else branches
    if not isinstance(branches, (tuple, list)) or len(branches) != 2:
        raise TensegrityError(f"branches {check.shown(branches)} must be two beads")
    return {"stem 1": bead, "branch 1": branches[0], "branch 2": branches[1]}
