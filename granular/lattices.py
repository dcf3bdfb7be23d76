"""Packs on regular lattices: cubic layers in space, hexagonal rows in the plane.

All beads are equal spheres in contact; a striker touches a bead of the top layer or row, or starts
at a distance from it.
Source: the talk, part II, "3D granular crystals/systems" (833 beads of 9.53 mm: 17 layers of 7 x
7), "2D granular crystals/systems"; layers and rows as such are our reading of its pictures.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike

from granular.beads import Bead, Material, Striker
from granular.layout import TOUCH
from granular.packing import PER_BEAD, Pack, per_place
from granular.surroundings import OfLattice, Surroundings, accepted, surrounded
from tensegrity import TensegrityError, Wall, check
from tensegrity.checked import checked
from tensegrity.readonly import Repeated, as_fixed
from tensegrity.scenes.network_input import refuse_too_many
from tensegrity.typing import Array, Count, Distance

Plane = tuple[tuple[float, ...], tuple[float, ...]]  # a point and a normal


@surrounded(OfLattice)
@checked
def fcc_pack(
    layers: Count = 17,
    side: Count = 7,
    *,
    bead: Bead | Sequence[Bead],
    floor: Material | None = None,
    sides: Material | None = None,
    striker: Striker | None = None,
    struck: tuple[int, int] | None = None,
    contacts: str | None = None,
    **surroundings: Unpack[OfLattice],
) -> Pack:
    """Layers of side x side touching beads, the (001) planes of a face-centred cubic lattice.

    Layer 1 lies on the floor z = 0.  Layers 1, 3, 5, ... touch the walls at x = 0 and y = 0, the
    others are shifted by half a diameter in x and y and touch the opposite ones: the box is
    side + 1/2 diameters wide, and open above.  The distance between layers is d/sqrt(2).

    Parameters
    ----------
    layers, side : int, optional
        At least 1.
    bead : Bead or sequence of Bead
        One for all, or one for each of `places`: layer by layer from the floor, x fastest, then y.
        Diameters must be equal.
    floor, sides : Material, optional
        Materials of the wall "floor", and of the walls "left" (x = 0), "right", "front" (y = 0)
        and "back", all of infinite extent; None: no such wall.
    striker : Striker, optional
        The last site, in contact with the struck bead from above and moving downward.
    struck : (int, int), optional
        ix and iy of that bead of the top layer, from 0; by default the middle, (side - 1)//2.
    contacts : {"fixed", "follow"}, optional
        "fixed": the pairs that touch initially; a run in which another contact forms raises
        ContactError.  "follow": contacts that form are found before they act.  By default "fixed",
        which is exact and cheapest: second neighbours have a gap of 0.41 diameters, and with the
        default step a run that follows contacts takes three times as many steps.
    **surroundings
        See `Surroundings`.

    Returns
    -------
    Pack
        With parts "striker", "layer 1" (on the floor) and so on.

    Raises
    ------
    TensegrityError
        Counts below 1, a struck bead outside the layer, unequal diameters, a name in place of a
        Material; a striker that overlaps another bead or a wall.

    Examples
    --------
    >>> from granular import Bead, Striker, fcc_pack, materials
    >>> bead = Bead(diameter=10e-3, material=materials["steel"])
    >>> walls = {"floor": materials["steel"], "sides": materials["ptfe"]}
    >>> print(fcc_pack(layers=3, side=3, bead=bead, striker=Striker(bead, speed=0.5), **walls))
    Pack(striker: 1, layer 1: 9, layer 2: 9, layer 3: 9, struck at 0.5 m/s) on
        Network(28 sites in 3 dimensions, 87 bonds, 5 walls with 27 contacts)
    """
    refuse_too_many(layers * side**2)
    check.memory(f"a pack of {layers} layers of {side} x {side} beads", PER_BEAD * layers * side**2)
    beads, d = _equal(bead, layers * side**2, lambda k: f"bead {k % side**2 + 1} of layer "
                      f"{k // side**2 + 1}")  # fmt: skip
    layer, along = np.arange(layers)[:, None, None], np.arange(side) * d
    shift, grid = d / 2 + d / 2 * (layer % 2), np.empty((layers, side, side, 3))
    grid[..., 0], grid[..., 1] = shift + along, shift + along[:, None]
    grid[..., 2] = d / 2 + layer * (d / math.sqrt(2))
    places = as_fixed(grid.reshape(-1, 3))
    width = (side + 0.5) * d
    walls = _box(
        floor, sides,
        {"left": ((0, 0, 0), (1, 0, 0)), "right": ((width, 0, 0), (-1, 0, 0)),
         "front": ((0, 0, 0), (0, 1, 0)), "back": ((0, width, 0), (0, -1, 0))}, 3,
    )  # fmt: skip
    parts = {f"layer {k + 1}": range(k * side**2, (k + 1) * side**2) for k in range(layers)}
    middle = (side - 1) // 2
    column, row = (
        check.whole("struck", value, least=0, below=side)
        for value in ((middle, middle) if struck is None else _pair("struck", struck))
    )
    hit = (layers - 1) * side**2 + row * side + column
    approach = _approach(striker, places[hit], beads[hit], (0, 0, 1), (0, 0, -1), 0.0)
    around = _pressed(accepted(fcc_pack, surroundings), parts[f"layer {layers}"], 3)
    return Pack(
        places,
        beads,
        walls,
        _kind(contacts, 0.0),
        parts=parts,
        striker=striker,
        approach=approach,
        **around,
    )


@surrounded(OfLattice)
@checked
def hexagonal_pack(
    rows: Count = 12,
    columns: Count = 21,
    *,
    bead: Bead | Sequence[Bead],
    floor: Material | None = None,
    sides: Material | None = None,
    striker: Striker | None = None,
    struck: int | None = None,
    offset: ArrayLike = (0, 1),
    direction: ArrayLike = (0, -1),
    gap: Distance = 0.0,
    contacts: str | None = None,
    **surroundings: Unpack[OfLattice],
) -> Pack:
    """Rows of touching beads in the plane, each bead between two of the next row.

    x runs along the rows, z up.  Row 1 is the top one, with `columns` beads at x = d/2 + i d; rows
    2, 4, ... have one bead fewer and are shifted by half a diameter.  The last row lies on the
    floor z = 0; rows 1, 3, ... touch the walls x = 0 and x = columns d.

    Parameters
    ----------
    rows, columns : int, optional
        At least 1; 2 columns where there are 2 rows.
    bead : Bead or sequence of Bead
        One for all, or one for each of `places`: row by row from the top, x increasing.  Diameters
        must be equal.
    floor, sides : Material, optional
        Materials of the wall "floor", and of the walls "left" and "right", all of infinite extent;
        None: no such wall.
    striker : Striker, optional
        The last site.
    struck : int, optional
        Number of the struck bead in row 1, from 0; by default the middle, (columns - 1)//2.
    offset : (2,), optional
        Direction from the struck bead to the striker, of any length; it may touch two beads.
    direction : (2,), optional
        Of the striker's velocity, of any length.
    gap : float, optional
        Initial gap between the striker and the struck bead [m], >= 0; a gap above 0 requires
        contacts "follow".
    contacts : {"fixed", "follow"}, optional
        As for `fcc_pack`; by default "follow" where there is a gap, else "fixed".
    **surroundings
        See `Surroundings`.

    Returns
    -------
    Pack
        With parts "striker", "row 1" (the top one) and so on.

    Raises
    ------
    TensegrityError
        As `fcc_pack`; a gap with fixed contacts; directions without length.

    Examples
    --------
    >>> from granular import Bead, hexagonal_pack, materials
    >>> bead = Bead(diameter=10e-3, material=materials["steel"])
    >>> walls = {"floor": materials["steel"], "sides": materials["ptfe"]}
    >>> print(hexagonal_pack(rows=3, columns=4, bead=bead, **walls))
    Pack(row 1: 4, row 2: 3, row 3: 4) on Network(11 sites in 2 dimensions,
        20 bonds, 3 walls with 8 contacts)
    """
    if rows > 1 and columns < 2:
        raise TensegrityError(f"columns {columns} must be at least 2: row 2 has one bead fewer")
    refuse_too_many(rows * columns)
    check.memory(f"a pack of {rows} rows of {columns} beads", PER_BEAD * rows * columns)
    counts = [columns - k % 2 for k in range(rows)]
    first = np.cumsum([0, *counts]).tolist()
    parts = {f"row {k + 1}": range(first[k], first[k + 1]) for k in range(rows)}

    def named(k: int) -> str:
        row = int(np.searchsorted(first, k, side="right"))
        return f"bead {k - first[row - 1] + 1} of row {row}"

    beads, d = _equal(bead, first[-1], named)
    row, column = np.repeat(range(rows), counts), np.concatenate([*map(np.arange, counts)])
    x = d / 2 + d / 2 * (row % 2) + column * d
    places = np.stack([x, d / 2 + (rows - 1 - row) * (d * math.sqrt(3) / 2)], axis=1)
    pieces = {"left": ((0, 0), (1, 0)), "right": ((columns * d, 0), (-1, 0))}
    walls = _box(floor, sides, pieces, 2)
    struck = (columns - 1) // 2 if struck is None else struck
    hit = check.whole("struck", struck, least=0, below=columns)
    approach = _approach(striker, places[hit], beads[hit], offset, direction, gap)
    around = _pressed(accepted(hexagonal_pack, surroundings), parts["row 1"], 2)
    return Pack(
        places,
        beads,
        walls,
        _kind(contacts, gap),
        parts=parts,
        striker=striker,
        approach=approach,
        **around,
    )


def _kind(contacts: str | None, gap: float) -> str:
    """The treatment of contacts, by default that which a gap requires."""
    if contacts is None:
        return "follow" if gap else "fixed"
    if isinstance(contacts, str) and contacts == "fixed" and gap:
        raise TensegrityError(
            f"gap {gap:g} m needs contacts that follow: with fixed ones it must be 0"
        )
    return contacts


def _pressed(surroundings: OfLattice, sites: range, dim: int) -> dict[str, Any]:
    """The surroundings, with the preload [N] on each of these sites, downward."""
    push = Surroundings(**surroundings).push
    preload = dict.fromkeys(sites, (0.0,) * (dim - 1) + (-push,)) if push else {}
    return {**surroundings, "preload": preload}


def _equal(
    bead: Bead | Sequence[Bead], count: int, name: Callable[[int], str]
) -> tuple[Repeated, float]:
    """One bead for each place, and the diameter of them all."""
    beads = per_place(bead, count)
    d = beads[0].diameter
    for number, one in enumerate(beads.different):
        if abs(one.diameter - d) > TOUCH * d:
            k = int(np.argmax(beads.number == number))
            raise TensegrityError(
                f"{name(k)} has diameter {one.diameter:.9g} m, must be that of the first, "
                f"{d:.9g} m: a lattice takes equal ones; give other places to `pack`"
            )
    return beads, d


def _box(
    floor: Material | None, sides: Material | None, pieces: Mapping[str, Plane], dim: int
) -> dict[str, tuple[Wall, Material]]:
    """The walls of a box that is open above."""
    up = (0,) * (dim - 1) + (1,)
    walls: dict[str, tuple[Wall, Material]] = {}
    for material, planes in ((floor, {"floor": ((0,) * dim, up)}), (sides, pieces)):
        if material is None:
            continue
        walls |= {k: (Wall(point, normal), material) for k, (point, normal) in planes.items()}
    return walls


def _approach(
    striker: Striker | None,
    place: Array,
    bead: Bead,
    offset: ArrayLike,
    direction: ArrayLike,
    gap: float,
) -> tuple[Array, Array] | None:
    """Where the striker starts, and its direction."""
    offset = _unit("offset", offset, len(place))
    direction = _unit("direction", direction, len(place))
    if striker is None:
        return None
    return place + (bead.radius + striker.bead.radius + gap) * offset, direction


def _unit(name: str, given: ArrayLike, dim: int) -> Array:
    """A direction of length 1."""
    vector = check.vector(name, check.floats(name, given), (dim,))
    length = np.linalg.norm(vector / max(np.abs(vector).max(), 1e-300))
    if not length > 0:
        raise TensegrityError(f"{name} {check.shown(given)} has no direction: its length is 0")
    vector = vector / np.abs(vector).max()
    return vector / np.linalg.norm(vector)


def _pair(name: str, given: object) -> tuple[object, object]:
    if not isinstance(given, (tuple, list)) or len(given) != 2:
        raise TensegrityError(f"{name} {check.shown(given)} must be two numbers, (ix, iy)")
    return given[0], given[1]
