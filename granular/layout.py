"""Places of beads and walls in the branched guides of the paper, as plain arrays.

Our reading of the paper's Fig. 1, which gives its counts: the axis of stem 1 is x, its last bead
is the origin, and the branches leave from the centre of that bead at plus and minus the half
angle.  At 30 degrees the first beads of both branches touch each other.  Below, they cannot be on
the axes without overlap: they stand at 30 degrees, and the branches go on from there at their own
angle.  In the diamond, the 24th bead of a branch is the corner, and 23 more lead to the junction
bead that opens stem 2.  Walls are planes one radius (and a gap) off the axes of the channels,
each ending where it meets the next.  Where two outer walls meet at a junction their edge reaches
into the channel, 84 um (at 30 degrees) from the junction bead, which comes to touch it in scenes
without symmetry; the edge is bevelled: a short piece of plane across it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Annotated, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import TensegrityError, check
from tensegrity.checked import checked
from tensegrity.readonly import ReadOnly, fixed
from tensegrity.typing import Array, Distance, Indices, Length

TOUCH = 1e-9  # of a diameter: closer than this, beads that should touch do
NEAR = 0.2  # diameters: a bead this close to a bevel may touch it during a run
PER_PAIR = 40  # bytes: all pairs of beads are examined
SIDE = math.pi / 6  # direction of two first branch beads that touch each other
BEVEL = 0.25  # half length of a bevel, in diameters
OPEN = 1.0  # diameters by which a channel extends behind its last bead
ENTRY = 0.25  # and before its first, short enough for a striker of any size

Several: TypeAlias = Annotated[int, ">= 2"]  # beads
Angle: TypeAlias = Annotated[float, "> 0", f"< {math.pi / 2}", "rad"]


@dataclass(frozen=True)
class Piece:
    """A flat piece of wall.

    Attributes
    ----------
    start, end : tuple of float, (2,)
        Its edges [m]; beads are on its left, seen from `start` to `end`.
    name : str
    """

    start: tuple[float, float]
    end: tuple[float, float]
    name: str

    @classmethod
    def between(cls, start: Array, end: Array, name: str) -> Piece:
        """The piece of wall between two points.

        Parameters
        ----------
        start, end : ndarray, (2,)
            Its edges [m].
        name : str

        Returns
        -------
        Piece
        """
        (a, b), (c, d) = start.tolist(), end.tolist()
        return cls((a, b), (c, d), name)

    @property
    def is_bevel(self) -> bool:
        """Whether it stands across the edge between two others."""
        return self.name.endswith("bevel")

    @property
    def length(self) -> float:
        """[m]."""
        return math.dist(self.start, self.end)

    @property
    def along(self) -> Array:
        """Unit vector from `start` to `end`, (2,)."""
        return np.subtract(self.end, self.start) / self.length

    @property
    def normal(self) -> Array:
        """Unit vector towards the beads, (2,)."""
        x, y = self.along
        return np.array([-y, x])

    def place(self, position: ArrayLike) -> tuple[Array, Array]:
        """Distance from the plane and place along it, from `start` [m]; (..., 2) -> two (...)."""
        away = np.asarray(position) - self.start
        return away @ self.normal, away @ self.along


@dataclass(frozen=True, eq=False)
class Layout(ReadOnly):
    """Where beads and walls are.

    Attributes
    ----------
    diameter : float
        Of all beads [m].
    positions : ndarray, (beads, 2)
        Centres at rest [m].
    parts : dict of str to tuple of int
        Beads of each part, in the paper's counting order.
    gap : float
        Of all beads to their side walls at rest [m].
    walls : tuple of Piece
    """

    diameter: float
    positions: Array
    parts: dict[str, tuple[int, ...]]
    gap: float = 0.0
    walls: tuple[Piece, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "positions", fixed(self.positions))
        object.__setattr__(self, "parts", fixed(self.parts))

    def contacts(self) -> Indices:
        """Pairs of beads that touch, each once and the lower first; (contacts, 2)."""
        pairs, distance = self._pairs()
        return pairs[distance <= self.diameter * (1 + TOUCH)]

    def _pairs(self) -> tuple[Indices, Array]:
        """All pairs of beads, and their distances."""
        x = self.positions
        i, j = np.triu_indices(len(x), 1)
        return np.stack([i, j], axis=1), np.linalg.norm(x[i] - x[j], axis=1)

    def wall_contacts(self) -> Indices:
        """(bead, wall) that touch, would without the gap, or may; (contacts, 2)."""
        contacts = []
        for number, wall in enumerate(self.walls):
            room = NEAR if wall.is_bevel else TOUCH
            reach = self.diameter * (0.5 + room) + self.gap
            distance, along = wall.place(self.positions)
            beside = (along >= 0) & (along <= wall.length) & (abs(distance) <= reach)
            contacts += [(int(bead), number) for bead in np.flatnonzero(beside)]
        return np.array(sorted(contacts), dtype=int).reshape(-1, 2)

    def wall_gaps(self) -> Array:
        """Gap of each wall contact at rest [m]; (contacts,)."""

        def gap(bead: int, wall: Piece) -> Any:
            if wall.is_bevel:
                return wall.place(self.positions[bead])[0] - self.diameter / 2
            return self.gap if wall.name.endswith("wall") else 0.0

        return np.array([gap(bead, self.walls[wall]) for bead, wall in self.wall_contacts()])

    def check(self) -> None:
        """Refuse overlapping beads, and beads that reach through a wall."""
        pairs, distance = self._pairs()
        closest = int(np.argmin(distance))
        if distance[closest] < self.diameter * (1 - TOUCH):
            one, other = (self.name(b) for b in pairs[closest])
            raise TensegrityError(
                f"{one} and {other} overlap by {self.diameter - distance[closest]:.3g} m at rest, "
                f"with a distance of {distance[closest]:.6g} m and diameters of "
                f"{self.diameter:.6g} m"
            )
        for wall in self.walls:
            away, along = wall.place(self.positions)
            beside = (along >= 0) & (along <= wall.length) & (abs(away) < self.diameter / 2)
            depth = np.where(beside, self.diameter / 2 - away, 0.0)
            worst = int(np.argmax(depth))
            if depth[worst] > TOUCH * self.diameter:
                raise TensegrityError(
                    f"{self.name(worst)} is outside its guide: {depth[worst]:.3g} m beyond "
                    f"the {wall.name}, at most {TOUCH * self.diameter:.1g} m is allowed"
                )

    def name(self, bead: int) -> str:
        """Words for a bead: its part and its number in it, from 1."""
        for part, beads in self.parts.items():
            if bead in beads:
                return f"bead {beads.index(bead) + 1} of {part}"
        raise TensegrityError(f"bead {bead} must be below {len(self.positions)}")

    def stopped(self, parts: Iterable[str]) -> Layout:
        """The same with a plane wall behind the last bead of each of these parts."""
        ends = []
        for part in parts:
            before, last = self.positions[list(self.parts[part][-2:])]
            ahead = (last - before) / self.diameter
            centre, side = last + ahead * self.diameter / 2, np.array([-ahead[1], ahead[0]])
            edges = centre - side * self.diameter, centre + side * self.diameter
            ends.append(Piece.between(*edges, f"end of {part}"))
        return replace(self, walls=(*self.walls, *ends))


@checked
def y_layout(
    stem: Several,
    branch: Several,
    half_angle: Angle,
    diameter: Length,
    gap: Distance = 0.0,
    through: Distance = 0.0,
) -> Layout:
    """The first half of the guide: a stem of beads and two branches.

    Parameters
    ----------
    stem, branch : int
        Beads in the stem and in each branch, at least 2.
    half_angle : float
        Between the axis and a branch [rad], between 0 and pi/2.
    diameter : float
        Of all beads [m].
    gap : float
        Between beads and side walls [m], >= 0.
    through : float
        How far the outer walls go on behind the line where they meet at a junction [m], >= 0;
        above 0.27 radii (at 30 degrees) they touch the junction bead.  Only without this the
        edges between them are bevelled.

    Returns
    -------
    Layout
    """
    _refuse_too_many(stem, branch)
    pieces = _arms(stem, branch, half_angle, max(half_angle, SIDE), diameter)
    first, (bend, *_, last), ahead = pieces["stem 1"][0], pieces["branch 1"], _direction(half_angle)
    far = last + OPEN * diameter * ahead
    near = first - ENTRY * diameter * np.array([1.0, 0.0])
    origin = np.zeros(2)
    knees = [bend] if half_angle < SIDE else []
    inside = [_mirror(far), *(_mirror(knee) for knee in knees), origin, *knees, far]
    return _walled(pieces, diameter, gap, through, [near, origin, *knees, far], (1,), inside)


@checked
def diamond_layout(
    stem: Several,
    branch: Several,
    half_angle: Angle,
    diameter: Length,
    gap: Distance = 0.0,
    through: Distance = 0.0,
) -> Layout:
    """The full guide: stem 1, two branches with a corner each, and stem 2.

    Parameters
    ----------
    stem : int
        Beads in each stem; the first of stem 2 is the junction bead.
    branch : int
        Beads in each branch, odd: the middle one is the corner.
    half_angle : float
        [rad], at least pi/6, below pi/2.
    diameter, gap, through
        As for `y_layout`.

    Returns
    -------
    Layout

    Raises
    ------
    TensegrityError
        An even `branch`, or a half angle out of its range.
    """
    _refuse_too_many(stem, branch)
    if branch % 2 == 0:
        raise TensegrityError(
            f"branch of {branch} beads must have an odd number: one is the corner"
        )
    if half_angle < SIDE * (1 - TOUCH):
        raise TensegrityError(
            f"half angle {half_angle:.6g} must be at least {SIDE:.6g} (30 degrees): the first "
            "beads of the branches of a diamond would overlap"
        )
    up = (branch + 1) // 2
    pieces = _arms(stem, up, half_angle, half_angle, diameter)
    corner = diameter * up * _direction(half_angle)
    down = corner + diameter * np.outer(np.arange(1, up), _direction(-half_angle))
    exit = np.array([2 * corner[0], 0.0]) + diameter * np.outer(np.arange(stem), [1.0, 0.0])
    for name, beads in (("branch 1", down), ("branch 2", _mirror(down))):
        pieces[name] = np.concatenate([pieces[name], beads])
    pieces["stem 2"] = exit
    near = pieces["stem 1"][0] - [ENTRY * diameter, 0.0]
    far = exit[-1] + [OPEN * diameter, 0.0]
    origin, opening = np.zeros(2), exit[0]
    line, ring = [near, origin, corner, opening, far], [origin, corner, opening, _mirror(corner)]
    return _walled(pieces, diameter, gap, through, line, (1, 3), ring * 3, slice(4, 8))


def _refuse_too_many(stem: int, branch: int) -> None:
    words = f"a guide with a stem of {stem} and branches of {branch} beads"
    check.memory(words, PER_PAIR * (stem + 2 * branch) ** 2)


def _arms(
    stem: int, branch: int, half_angle: float, first: float, diameter: float
) -> dict[str, Array]:
    """Beads of the stem and of branches whose first beads stand in the direction `first`."""
    beads = diameter * np.outer(np.arange(branch), _direction(half_angle))
    beads += diameter * _direction(first)
    axis = diameter * np.outer(np.arange(1 - stem, 1), [1.0, 0.0])
    return {"stem 1": axis, "branch 1": beads, "branch 2": _mirror(beads)}


def _walled(
    pieces: Mapping[str, Array],
    diameter: float,
    gap: float,
    through: float,
    line: Sequence[Array],
    bends: tuple[int, ...],
    inside: Sequence[Array],
    chosen: slice = slice(None),
) -> Layout:
    """Beads with walls along the line of the upper and the lower channel, which `_outer` makes, and
    the chosen ones along a line of points inside."""
    ends, width = np.cumsum([0, *map(len, pieces.values())]).tolist(), diameter / 2 + gap
    between = zip(pieces, pairwise(ends), strict=True)
    parts = {name: tuple(range(*numbers)) for name, numbers in between}
    walls = []
    for side in (1, -1):
        walls += _outer(line, side, width, through, bends, BEVEL * diameter)
    walls += [Piece.between(a, b, "inner wall") for a, b in _offset(inside, width)[chosen]]
    return Layout(diameter, np.concatenate(list(pieces.values())), parts, gap, tuple(walls))


def _direction(angle: float) -> Array:
    return np.array([math.cos(angle), math.sin(angle)])


def _mirror(points: Array) -> Array:
    return points * np.array([1.0, -1.0])


def _outer(
    line: Sequence[Array],
    side: int,
    width: float,
    through: float,
    bends: tuple[int, ...],
    bevel: float,
) -> list[Piece]:
    """Walls on the outer side of the upper (side 1) or lower branch, along a line of points.

    At the `bends`, numbers of points of the line, walls run on past the edge that they share, or
    a bevel of that half length stands across it.
    """
    name = "upper" if side > 0 else "lower"
    flip: Callable[[Array], Array] = np.array if side > 0 else _mirror
    pieces = []

    def add(one: Array, other: Array, kind: str) -> None:
        first, second = map(flip, (one, other) if side > 0 else (other, one))
        pieces.append(Piece.between(first, second, f"{name} {kind}"))

    for number, (far, near) in enumerate(_offset(line[::-1], width)[::-1]):
        along = (far - near) / np.linalg.norm(far - near)
        start = near - (through * along if number in bends else 0.0)
        end = far + (through * along if number + 1 in bends else 0.0)
        add(end, start, "wall")
        if number in bends and not through:
            x, y = (line[number] - near) / np.linalg.norm(line[number] - near)
            along = bevel * np.array([y, -x])
            add(near - along, near + along, "bevel")
    return pieces


def _offset(line: Sequence[Array], width: float) -> list[tuple[Array, Array]]:
    """Edges of the walls on the right of a line of points, beads on their left; mitred."""
    line = np.asarray(line)
    along = np.diff(line, axis=0)
    along /= np.linalg.norm(along, axis=1)[:, None]
    right = np.stack([along[:, 1], -along[:, 0]], axis=1)
    bisector = right[:-1] + right[1:]
    bends = bisector / (bisector * right[1:]).sum(axis=1)[:, None]
    corners = line + width * np.concatenate([right[:1], bends, right[-1:]])
    return list(pairwise(corners))
