"""Branched guides of beads between plane walls, two coordinates each: a `tensegrity.Network`.

Model of the paper, eqs. (1)-(6): contacts without rotation, rigid walls at rest; by default without
friction and dissipation.  Initially beads touch their neighbours and, up to a gap, their walls.
The list of contacts is that of the layout; a run verifies that no other contact forms and that no
bead slides off its wall.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Unpack

import numpy as np

from granular.assembly import Assembly, Equilibrium, SharedSprings, rest_of
from granular.bead_chain import initial_gaps
from granular.beads import Bead, Material, Striker, materials
from granular.damped_contact import friction_of
from granular.layout import TOUCH, Layout, Piece, diamond_layout, y_layout
from granular.surroundings import OfGuide, Surroundings, accepted, surrounded
from tensegrity import State, TensegrityError, Wall, check
from tensegrity.checked import checked
from tensegrity.scenes.clearance import Clearance
from tensegrity.typing import Array, Distance, Indices


class Guide(Assembly):
    """Beads in a layout, optionally with a striker before the first one.

    Parameters
    ----------
    layout : Layout
    beads : dict of str to Bead
        The bead of which each part is made.
    wall : Material
        Material of the side walls.
    striker : Striker, optional
        Becomes site 0, in contact with the first bead of the first part.
    end : Material, optional
        Material of plane walls behind the last beads of the last parts; by default these beads
        are free.  Gravity and preload require it.
    **surroundings
        See `Surroundings`.

    Attributes
    ----------
    layout : Layout
    beads : tuple of Bead, (sites,)
    parts : dict of str to tuple of int
    striker : Striker or None
    equilibrium : Equilibrium or None
        Static equilibrium of the beads without the striker; None without loads.
    """

    equilibrium: Equilibrium | None
    parts: dict[str, tuple[int, ...]]

    @surrounded(OfGuide)
    @checked
    def __init__(
        self,
        layout: Layout,
        beads: Mapping[str, Bead],
        wall: Material,
        striker: Striker | None = None,
        *,
        end: Material | None = None,
        **surroundings: Unpack[OfGuide],
    ) -> None:
        around = Surroundings(**accepted(Guide.__init__, surroundings))
        gravity, preload, friction = around.gravity, around.push, around.friction
        _check(layout, beads, end, gravity, preload)
        sides, first, given = len(layout.walls), int(striker is not None), layout
        if end is not None:
            last = ("stem 2",) if "stem 2" in layout.parts else ("branch 1", "branch 2")
            layout = layout.stopped(last)
        layout.check()
        self.layout, self.striker = layout, striker
        self.wall_names = tuple(piece.name for piece in layout.walls)
        solids: Any = (wall,) * sides + (end,) * (len(layout.walls) - sides)
        self._wall_materials = solids
        positions, bonds, self.parts, self.beads = _filled(layout, beads, striker)
        touched = np.add(layout.wall_contacts(), (first, 0))
        lengths, wall_gaps = None, layout.wall_gaps()
        behind = np.flatnonzero(touched[:, 1] >= sides)
        separations = initial_gaps(
            around.gaps, len(bonds) + len(behind), bool(gravity or preload), None
        )
        self._arguments = {
            "layout": given, "beads": beads, "wall": wall, "striker": striker, "end": end,
            "gravity": gravity, "preload": preload, "friction": friction,
            "gaps": separations or 0.0, "forces": around.forces,
        }  # fmt: skip
        if separations:
            wall_gaps[behind] = separations[len(bonds) :]
            lengths = np.linalg.norm(positions[bonds[:, 1]] - positions[bonds[:, 0]], axis=1)
            lengths -= separations[: len(bonds)]
        springs = SharedSprings(around.law)
        in_bonds = [springs(self.beads[i], self.beads[j]) for i, j in bonds]
        sides_of = [(self.beads[b], solids[wall]) for b, wall in touched]
        at_walls = [springs(*pair) for pair in sides_of]
        self._losses = springs.losses(self.beads, bonds, solids, touched)
        of_walls = [springs.contact(*pair) for pair in sides_of]
        rubbing = friction_of(of_walls, *friction) if friction is not None else []
        super().__init__(
            positions,
            bonds,
            in_bonds,
            lengths,
            mass=[bead.mass for bead in self.beads],
            walls=[_wall(piece) for piece in layout.walls],
            wall_contacts=touched,
            wall_spring=at_walls,
            wall_gaps=wall_gaps,
            radius=[bead.radius for bead in self.beads],
            loads=_loads(self.beads, first, gravity, preload),
            drive=around.drive,
            damping=around.damping,
            forces=(*self._losses, *rubbing, *around.forces),
        )
        self._contacts = springs.contacts
        self.equilibrium = settled = rest_of(
            self, springs.attract, striker=None, law=springs.contact, friction=None, forces=()
        )
        rest = np.zeros(self.shape)
        if settled is not None:  # a striker is displaced with the bead that it touches
            rest = settled.u if striker is None else np.concatenate([settled.u[:1], settled.u])
        self._rest = rest

    def _clearance(self, follows: bool) -> Clearance:
        return _Clearance(self)

    def start(self) -> State:
        """Initial state: the striker in contact and moving along the axis, all else at rest."""
        return self.at_rest({} if self.striker is None else {0: (self.striker.speed, 0.0)})


class _Clearance(Clearance):
    """Clearance of beads at a bevel, which covers the edge between two walls.

    A bead that may touch the bevel touches these walls only once its foot lies on them.
    """

    def __init__(self, guide: Guide) -> None:
        listed = guide.wall_contacts
        radius: Any = guide.radius  # of all beads, never None
        super().__init__(guide.positions, radius, guide.bonds, guide.walls, listed)
        pieces = guide.layout.walls
        self._behind = {
            (bead, number)
            for bead, bevel in listed.tolist()
            if pieces[bevel].is_bevel
            for number in (bevel - 1, bevel - 2)
        }

    def wall_gaps(self, x: Array, pairs: Indices) -> Array:
        """Gap of each (site, wall) [m]; at a bevel at least the distance to the wall's edge."""
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


def _check(
    layout: Layout,
    beads: Mapping[str, Bead],
    end: Material | None,
    gravity: float,
    preload: float,
) -> None:
    """Refuse other beads than those of a guide, and loads that nothing carries."""
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
    if end is None and (gravity > 0 or preload > 0):
        raise TensegrityError(
            f"gravity {gravity:g} m/s^2 and preload {preload:g} N need an end: without walls "
            "behind the last beads nothing carries them"
        )


def _filled(
    layout: Layout, beads: Mapping[str, Bead], striker: Striker | None
) -> tuple[Array, Indices, dict[str, tuple[int, ...]], tuple[Bead, ...]]:
    """Positions, bonds, parts and beads of a layout, the striker before the first bead."""
    filled = [beads[part] for part, sites in layout.parts.items() for _ in sites]
    positions, bonds = layout.positions, layout.contacts()
    if striker is None:
        return positions, bonds, dict(layout.parts), tuple(filled)
    before = positions[0] - [striker.bead.radius + filled[0].radius, 0.0]
    parts = {part: tuple(b + 1 for b in sites) for part, sites in layout.parts.items()}
    return (
        np.concatenate([[before], positions]), np.concatenate([[[0, 1]], bonds + 1]),
        {"striker": (0,), **parts}, (striker.bead, *filled),
    )  # fmt: skip


def _wall(piece: Piece) -> Wall:
    middle = np.add(piece.start, piece.end) / 2
    return Wall(middle, piece.normal, piece.along * piece.length / 2)


@surrounded(OfGuide)
@checked
def y_guide(
    stem: Annotated[int, ">= 2"] = 19,
    branch: Annotated[int, ">= 2"] = 23,
    half_angle: Annotated[float, "> 0", f"< {math.pi / 2}", "rad"] = math.pi / 6,
    *,
    bead: Bead,
    branches: tuple[Bead, Bead] | None = None,
    wall: Material = materials["ptfe"],
    striker: Striker | None = None,
    end: Material | None = None,
    gap: Distance = 0.0,
    through: Distance = 0.0,
    **surroundings: Unpack[OfGuide],
) -> Guide:
    """A Y-shaped guide, the first half of that of the paper: a stem that splits into two branches.

    Parameters
    ----------
    stem, branch : int
        Number of beads in the stem and in each branch.
    half_angle : float
        Angle between each branch and the axis [rad].  Below pi/6 the first beads of the branches
        are placed at pi/6, where they touch each other, and the branches continue from there.
    bead : Bead
        Bead of the stem.
    branches : (Bead, Bead), optional
        Beads of the upper and the lower branch, "branch 1" and "branch 2"; by default `bead`.
    wall : Material, optional
        Material of the side walls.
    striker : Striker, optional
        Becomes site 0, in contact with the first bead of the stem.
    end : Material, optional
        Material of walls behind the last beads; by default these beads are free.  Gravity and
        preload require it.
    gap : float, optional
        Gap between beads and side walls [m], >= 0.
    through : float, optional
        Length by which the outer walls extend past the junction [m], >= 0; see `y_layout`.
    **surroundings
        See `Surroundings`.

    Returns
    -------
    Guide
        With parts "striker", "stem 1", "branch 1", "branch 2".

    Raises
    ------
    TensegrityError
        Beads of another diameter than the guide's, which would overlap or leave gaps; half angles,
        counts and gaps out of range.  `simulate` raises ContactError if a contact forms that
        the guide does not list.

    Examples
    --------
    >>> from granular import Bead, Striker, materials, y_guide
    >>> bead = Bead(diameter=10e-3, material=materials["steel"])
    >>> print(y_guide(stem=10, branch=10, bead=bead, striker=Striker(bead, speed=0.5)))
    Guide(striker: 1, stem 1: 10, branch 1: 10, branch 2: 10, struck at 0.5 m/s) on
        Network(31 sites in 2 dimensions, 31 bonds, 8 walls with 60 contacts)
    """
    beads = _filling(bead, branches)
    layout = y_layout(stem, branch, half_angle, bead.diameter, gap, through)
    return Guide(layout, beads, wall, striker, end=end, **accepted(y_guide, surroundings))


@surrounded(OfGuide)
@checked
def diamond_guide(
    stem: Annotated[int, ">= 2"] = 19,
    branch: Annotated[int, ">= 2"] = 47,
    half_angle: Annotated[float, "> 0", f"< {math.pi / 2}", "rad"] = math.pi / 6,
    *,
    bead: Bead,
    branches: tuple[Bead, Bead] | None = None,
    wall: Material = materials["ptfe"],
    striker: Striker | None = None,
    end: Material | None = None,
    gap: Distance = 0.0,
    through: Distance = 0.0,
    **surroundings: Unpack[OfGuide],
) -> Guide:
    """The full guide of the paper: the branches rejoin in a second stem.

    Parameters
    ----------
    stem : int, optional
        Number of beads in each stem; the first bead of stem 2 is the junction.
    branch : int, optional
        Number of beads between the junctions, odd: the middle one is the corner.
    half_angle : float, optional
        Angle between each branch and the axis [rad], pi/6 or more.
    bead, branches, wall, striker, gap, through
        As for `y_guide`.
    end : Material, optional
        Material of a plane wall behind the last bead of stem 2; by default that bead is free.
    **surroundings
        See `Surroundings`.

    Returns
    -------
    Guide
        With parts "striker", "stem 1", "branch 1", "branch 2", "stem 2".

    Raises
    ------
    TensegrityError
        As for `y_guide`; an even `branch`, or a half angle below pi/6.
    """
    beads = {**_filling(bead, branches), "stem 2": bead}
    layout = diamond_layout(stem, branch, half_angle, bead.diameter, gap, through)
    return Guide(layout, beads, wall, striker, end=end, **accepted(diamond_guide, surroundings))


def _filling(bead: Bead, branches: tuple[Bead, Bead] | None) -> dict[str, Bead]:
    branches = (bead, bead) if branches is None else branches
    if not isinstance(branches, (tuple, list)) or len(branches) != 2:
        raise TensegrityError(f"branches {check.shown(branches)} must be two beads")
    return {"stem 1": bead, "branch 1": branches[0], "branch 2": branches[1]}
