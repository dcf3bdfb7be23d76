"""Nodes and members of a column of prisms, for `column` and `Prism.structure`.

Members have no thickness.  Source: the talk, part III, chains of prisms.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.errors import TensegrityError
from tensegrity.lattices.bloch import PeriodicBonds
from tensegrity.lattices.lattice import Lattice
from tensegrity.prisms.plates import plate_column
from tensegrity.scenes.network import Network
from tensegrity.structures.structure import Structure
from tensegrity.typing import Array

Chirality: TypeAlias = Annotated[str, ("alternate", "same")]  # of neighbouring units
PER_SIDE = 1400  # bytes of memory per side of each prism of a column


@checked
def stacked(
    prism: Any, count: int | None, chirality: Chirality, plates: Any, periodic: bool
) -> Structure | Lattice | Network | PeriodicBonds:
    """The structure or lattice of a column; `Prism.column` documents the arguments.

    Parameters
    ----------
    prism : Prism
        With finite `k_base` and `k_bar`.
    count : int or None
    chirality : {"alternate", "same"}
    plates : bool or (float, float)
    periodic : bool

    Returns
    -------
    Structure, Lattice, Network or PeriodicBonds

    Raises
    ------
    TensegrityError
        If an argument is outside its bounds, the column exceeds the memory, members are rigid, or
        the units do not repeat.
    """
    heavy = isinstance(plates, (tuple, list))
    plates = (
        check.sequence("plates", plates, "2 numbers") if heavy else check.truth("plates", plates)
    )
    count = _checked(prism, count, chirality, plates, periodic)
    if heavy:
        return plate_column(prism, count, chirality, plates, periodic)
    n, rest = prism.sides, prism.natural_lengths()
    nodes, bars, cross, angle = _levels(prism, count, chirality, plates)
    shared = np.full(len(nodes), 1.0 if plates else 2.0)
    if periodic:  # the last polygon is the first one of the next cell
        nodes, shared = nodes[:-1], shared[:-1]
    else:
        shared[[0, -1]] = 1.0
    bases = [(n * k + i, n * k + (i + 1) % n) for k in range(len(nodes)) for i in range(n)]
    numbers = [len(cross), *[n] * len(nodes)]
    members: dict[str, Any] = {
        "k_bar": prism.k_bar,
        "k_string": np.repeat([prism.k_cross, *(prism.k_base * shared)], numbers),
        "natural_lengths": np.repeat([rest.bar, rest.cross, rest.base],
                                     [len(bars), len(cross), len(bases)]),
    }  # fmt: skip
    if not periodic:
        between = range(1, len(nodes) - 1, 2) if plates else ()
        platforms = [range(n * k, n * (k + 2)) for k in between]
        return Structure(np.concatenate(nodes), bars, cross + bases, platforms=platforms, **members)
    top, turned = n * count, round(angle * n / (2 * np.pi))
    pushing, pulling = (
        [(i, j) if j < top else (i, (j - top + turned) % n, 1) for i, j in pairs]
        for pairs in (bars, cross + bases)
    )
    vectors = [(0, 0, count * prism.height)]
    return Lattice(np.concatenate(nodes), vectors, pushing, pulling, **members)


def _checked(prism: Any, count: int | None, chirality: str, plates: Any, periodic: bool) -> int:
    """The number of units, after all arguments are checked."""
    heavy = not isinstance(plates, bool)
    repeat = 2 if chirality == "alternate" else 1 if heavy else 4 // math.gcd(4, prism.sides + 2)
    count = check.whole("count", (repeat if periodic else 5) if count is None else count, least=1)
    check.memory(f"a column of {count} prisms", PER_SIDE * prism.sides * count)
    if not heavy and (math.isinf(prism.k_base) or math.isinf(prism.k_bar)):
        raise TensegrityError(
            f"k_base {prism.k_base:g} N/m and k_bar {prism.k_bar:g} N/m must be finite: rigid "
            "bases or bars have no structure"
        )
    if periodic and plates and not heavy:
        raise TensegrityError("a periodic column has no plates without mass")
    if periodic and count % repeat:
        raise TensegrityError(
            f"count {count} must be a multiple of {repeat}, after which the units repeat"
        )
    return count


def _levels(
    prism: Any, count: int, chirality: str, plates: Any
) -> tuple[list[Array], list[tuple[int, int]], list[tuple[int, int]], float]:
    """Polygons from below, bars and cross strings unit by unit, and the angle of the last polygon
    to the first [rad]."""
    from derivations import prism as derived

    n, nodes, angle = prism.sides, [polygon(prism.sides, prism.base, 0.0, 0.0)], 0.0
    bars: list[tuple[int, int]] = []
    cross: list[tuple[int, int]] = []
    for unit in range(count):
        sense = -1 if chirality == "alternate" and unit % 2 else 1
        if plates and unit:
            nodes.append(polygon(n, prism.base, angle, unit * prism.height))
        angle += sense * prism.reference_twist
        nodes.append(polygon(n, prism.base, angle, (unit + 1) * prism.height))
        start = n * (len(nodes) - 2)
        for member, listed in ((derived.BAR, bars), (derived.CROSS, cross)):
            listed += [(start + i, start + n + (i + sense * member.step) % n) for i in range(n)]
    return nodes, bars, cross, angle


def polygon(sides: int, base: ArrayLike, angle: ArrayLike, height: ArrayLike) -> Array:
    """Corners of regular polygons normal to the z axis.

    Parameters
    ----------
    sides : int
    base, angle, height : array_like, broadcast to (...)
        Length of a side [m], rotation about the z axis [rad], and position along it [m].

    Returns
    -------
    ndarray, (..., sides, 3)
        [m].
    """
    each = (np.asarray(x, dtype=float)[..., None] for x in (base, angle, height))
    side, first, z = np.broadcast_arrays(*each)
    angles = first + 2 * np.pi / sides * np.arange(sides)
    radius = side / (2 * np.sin(np.pi / sides))
    return np.stack([radius * np.cos(angles), radius * np.sin(angles), z + 0 * angles], axis=-1)


def symmetric_nodes(sides: int, base: Array, twist: Array, height: Array) -> Array:
    """Nodes of a prism in symmetric states.

    Parameters
    ----------
    sides : int
    base, twist, height : ndarray, (rows,)
        [m], [rad], [m].

    Returns
    -------
    ndarray, (rows, 2 sides, 3)
        Positions [m], lower nodes first.
    """
    lower = polygon(sides, base, 0.0, 0.0)
    return np.concatenate([lower, polygon(sides, base, twist, height)], axis=1)
