"""Nodes and members of a column of prisms, for `column` and `Prism.structure`.

Members have no thickness.  Source: seeds/000, part III, chains of prisms.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.structures.structure import Structure
from tensegrity.typing import Array

PER_SIDE = 1400  # bytes of memory per side of each prism of a column


def stacked(prism: Any, count: int, chirality: str, plates: bool) -> Structure:
    """The structure of a column; `Prism.column` documents the arguments.

    Parameters
    ----------
    prism : Prism
        With finite `k_base` and `k_bar`.
    count : int
    chirality : {"alternate", "same"}
    plates : bool

    Returns
    -------
    Structure

    Raises
    ------
    TensegrityError
        If an argument is outside its bounds, the column exceeds the memory, or members are rigid.
    """
    count = check.whole("count", count, least=1)
    check.room(f"a column of {count} prisms", PER_SIDE * prism.sides * count)
    plates = check.truth("plates", plates)
    if not isinstance(chirality, str) or chirality not in ("alternate", "same"):
        raise TensegrityError(f"chirality {check.shown(chirality)} must be 'alternate' or 'same'")
    if math.isinf(prism.k_base) or math.isinf(prism.k_bar):
        raise TensegrityError(
            f"k_base {prism.k_base:g} N/m and k_bar {prism.k_bar:g} N/m must be finite: rigid "
            "bases or bars have no structure"
        )
    from derivations import prism as derived

    n, rest = prism.sides, prism.natural_lengths()
    nodes: list[Array] = []
    bars: list[tuple[int, int]] = []
    cross: list[tuple[int, int]] = []
    bases, multiplicity = [], []
    angle, level = 0.0, 0
    for unit in range(count):
        sense = -1 if chirality == "alternate" and unit % 2 else 1
        if plates or unit == 0:
            nodes.append(polygon(n, prism.base, angle, unit * prism.height))
            multiplicity.append(1.0)
        else:
            multiplicity[-1] = 2.0
        angle += sense * prism.reference_twist
        nodes.append(polygon(n, prism.base, angle, (unit + 1) * prism.height))
        multiplicity.append(1.0)
        start = n * (len(nodes) - 2)
        for member, listed in ((derived.BAR, bars), (derived.CROSS, cross)):
            listed += [(start + i, start + n + (i + sense * member.step) % n) for i in range(n)]
    for level in range(len(nodes)):
        bases += [(n * level + i, n * level + (i + 1) % n) for i in range(n)]
    between = range(1, len(nodes) - 1, 2) if plates else ()
    return Structure(
        np.concatenate(nodes),
        bars=bars,
        strings=cross + bases,
        k_bar=prism.k_bar,
        k_string=np.repeat([prism.k_cross, *(prism.k_base * np.array(multiplicity))],
                           [len(cross), *[n] * len(nodes)]),
        natural_lengths=np.repeat([rest.bar, rest.cross, rest.base],
                                  [len(bars), len(cross), len(bases)]),
        platforms=[range(n * level, n * (level + 2)) for level in between],
    )  # fmt: skip


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
