"""Places of beads and walls in the branched guides of seeds/001, as plain arrays.

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
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from granular.places import TOUCH, Layout, Piece
from tensegrity import TensegrityError, check

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from tensegrity.typing import Array

PER_PAIR = 40  # bytes: all pairs of beads are looked at
SIDE = math.pi / 6  # direction of two first branch beads that touch each other
BEVEL = 0.25  # half length of a bevel, in diameters
OPEN = 1.0  # diameters by which a channel goes on behind its last bead
ENTRY = 0.25  # and before its first, short enough for a striker of any size


def y_layout(
    stem: int,
    branch: int,
    half_angle: float,
    diameter: float,
    gap: float = 0.0,
    through: float = 0.0,
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
    stem, branch, half_angle, diameter, gap, through = _checked(
        stem, branch, half_angle, diameter, gap, through
    )
    positions, parts = _y_positions(stem, branch, half_angle, max(half_angle, SIDE), diameter)
    first, last = positions[parts["stem 1"][0]], positions[parts["branch 1"][-1]]
    bend, ahead = positions[parts["branch 1"][0]], _direction(half_angle)
    far = last + OPEN * diameter * ahead
    near = first - ENTRY * diameter * np.array([1.0, 0.0])
    origin = np.zeros(2)
    knees = [bend] if half_angle < SIDE else []
    width = diameter / 2 + gap
    walls = []
    for side in (1, -1):
        line = [near, origin, *knees, far]
        walls += _outer(line, side, width, through, (1,), BEVEL * diameter)
    line = [_mirror(far), *(_mirror(knee) for knee in knees), origin, *knees, far]
    walls += [Piece.between(a, b, "inner wall") for a, b in _offset(line, width)]
    return Layout(diameter, positions, parts, gap, tuple(walls))


def crossed_layout(stem: int, branch: int, half_angle: float, diameter: float) -> Layout:
    """Idealised: branch beads stand on the axes at any angle and see only their own branch.

    Parameters and result as for `y_layout`; there are no walls.
    """
    stem, branch, half_angle, diameter, _, _ = _checked(stem, branch, half_angle, diameter, 0, 0)
    positions, parts = _y_positions(stem, branch, half_angle, half_angle, diameter)
    return Layout(diameter, positions, parts, blind=True)


def diamond_layout(
    stem: int,
    branch: int,
    half_angle: float,
    diameter: float,
    gap: float = 0.0,
    through: float = 0.0,
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
    """
    stem, branch, half_angle, diameter, gap, through = _checked(
        stem, branch, half_angle, diameter, gap, through
    )
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
    positions, parts = _y_positions(stem, up, half_angle, half_angle, diameter)
    corner = diameter * up * _direction(half_angle)
    down = corner + diameter * np.outer(np.arange(1, up), _direction(-half_angle))
    first, second = (positions[list(parts[name])] for name in ("branch 1", "branch 2"))
    exit = np.array([2 * corner[0], 0.0]) + diameter * np.outer(np.arange(stem), [1.0, 0.0])
    pieces = {
        "stem 1": positions[list(parts["stem 1"])],
        "branch 1": np.concatenate([first, down]),
        "branch 2": np.concatenate([second, _mirror(down)]),
        "stem 2": exit,
    }
    near = pieces["stem 1"][0] - [ENTRY * diameter, 0.0]
    far = exit[-1] + [OPEN * diameter, 0.0]
    origin, opening, width = np.zeros(2), exit[0], diameter / 2 + gap
    walls = []
    for side in (1, -1):
        line = [near, origin, corner, opening, far]
        walls += _outer(line, side, width, through, (1, 3), BEVEL * diameter)
    ring = [origin, corner, opening, _mirror(corner)]
    inside = _offset([*ring, *ring, *ring], width)[4:8]
    walls += [Piece.between(a, b, "inner wall") for a, b in inside]
    return _laid(diameter, pieces, gap, tuple(walls))


def _checked(
    stem: int, branch: int, half_angle: float, diameter: float, gap: float, through: float
) -> tuple[int, int, float, float, float, float]:
    half_angle = check.number("half angle", half_angle, above=0, below=math.pi / 2, unit="rad")
    stem, branch = check.whole("stem", stem, least=2), check.whole("branch", branch, least=2)
    beads = stem + 2 * branch
    check.room(f"a guide with a stem of {stem} and branches of {branch} beads", PER_PAIR * beads**2)
    return (
        stem,
        branch,
        half_angle,
        check.number("diameter", diameter, above=0, unit="m"),
        check.number("gap of the walls", gap, least=0, unit="m"),
        check.number("through", through, least=0, unit="m"),
    )


def _y_positions(
    stem: int, branch: int, half_angle: float, first: float, diameter: float
) -> tuple[Array, dict[str, tuple[int, ...]]]:
    """Beads of the stem and of branches whose first beads stand in the direction `first`."""
    beads = diameter * np.outer(np.arange(branch), _direction(half_angle))
    beads += diameter * _direction(first)
    pieces = {
        "stem 1": diameter * np.outer(np.arange(1 - stem, 1), [1.0, 0.0]),
        "branch 1": beads,
        "branch 2": _mirror(beads),
    }
    laid = _laid(diameter, pieces)
    return laid.positions, laid.parts


def _laid(
    diameter: float, pieces: Mapping[str, Array], gap: float = 0.0, walls: tuple[Piece, ...] = ()
) -> Layout:
    ends = np.cumsum([0, *map(len, pieces.values())]).tolist()
    parts = {
        name: tuple(range(a, b)) for name, a, b in zip(pieces, ends[:-1], ends[1:], strict=True)
    }
    return Layout(diameter, np.concatenate(list(pieces.values())), parts, gap, walls)


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
