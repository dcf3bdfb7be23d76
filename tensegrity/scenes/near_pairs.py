"""Pairs of spheres whose gap is below a bound: compiled, see `near_pairs.c`, or without a compiler
from the distances of each sphere from all others."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from tensegrity.engine.native import concatenated, library, structure
from tensegrity.errors import CompilerError
from tensegrity.once import once
from tensegrity.typing import Array, Indices

PART = 2**16  # pairs that are computed at once
MARGIN = 1e-3  # of the edge of a cell, by which round-off is exceeded
FINEST = 1e-12  # least edge of a cell, over the largest coordinate: cells have whole numbers
CELLS = 128  # least number of cells
STRIDES = 0.0, 0.7549, 0.5698  # over the number of cells; lines and layers meet most of the cells

SPHERES = structure("near_pairs.c", "spheres")


@once
def _compiled() -> Any:
    return library(concatenated(["prelude.c", "near_pairs.c"]), ["-ffp-contract=off"])


class NearPairs(NamedTuple):
    """Pairs of spheres, sorted.

    Attributes
    ----------
    ends : ndarray of int, (pairs, 2)
        The lower and the higher number of the two spheres.
    gap : ndarray, (pairs,)
        [m], < 0 for an overlap.
    """

    ends: Indices
    gap: Array


def near_pairs(x: Array, radius: Array, skin: float, listed: Any = ()) -> NearPairs:
    """All pairs of spheres with a gap below `skin` [m], except those listed.

    Parameters
    ----------
    x : ndarray, (spheres, dim)
        Centres [m].
    radius : ndarray, (spheres,)
        [m].
    skin : float
    listed : ndarray of int, (listed, 2), optional

    Returns
    -------
    NearPairs
    """
    listed = np.reshape(np.asarray(listed, dtype=np.int32), (-1, 2))
    try:
        search = _compiled()
    except CompilerError:
        return _compared(x, radius, skin, listed)
    (count, dim), bonds = x.shape, len(listed)
    first, second = map(np.ascontiguousarray, listed.T)
    cells = max(CELLS, 1 << count.bit_length() - 1)
    widest = (1 + MARGIN) * (2 * radius.max() + skin)
    room = {"begin": cells + 1, "end": cells, "number": count, "last": count, "before": bonds}
    place = np.zeros(count + 1, np.int64)
    given = SPHERES(
        x=np.ascontiguousarray(x), at=np.empty((count, 3)), radius=radius, skin=skin,
        first=first, second=second, stride=strides(cells),
        edge=max(widest, FINEST * np.abs(x).max()), count=count, dim=dim, bonds=bonds, cells=cells,
        place=place[1:], low=None, high=None, gap=None,
        **{name: np.empty(size, np.int32) for name, size in room.items()},
    )  # fmt: skip
    search.near_cells(ctypes.addressof(given))
    search.near_sweep(ctypes.addressof(given))
    np.cumsum(place, out=place)
    ends, gap = np.empty((2, place[-1]), np.int32), np.empty(place[-1])
    given.fill(place=place, low=ends[0], high=ends[1], gap=gap)
    search.near_sweep(ctypes.addressof(given))
    return NearPairs(ends.T, gap)


def strides(cells: int) -> Indices:
    """Numbers of cells from one to the next along each axis, modulo a power of two."""
    return np.array([int(part * cells) | 1 for part in STRIDES])


def _compared(x: Array, radius: Array, skin: float, listed: Indices) -> NearPairs:
    """`near_pairs` without a compiler."""
    parts = []
    for i in range(len(x)):
        j = np.arange(i + 1, len(x))
        gap = distances(x, np.array([i]), j) - radius[i] - radius[j]
        near = gap < skin
        parts.append((np.full(near.sum(), i), j[near], gap[near]))
    low, high, gap = map(np.concatenate, zip(*parts, strict=True))
    ends = np.stack([low, high], axis=1)
    new = ~np.isin(keys(ends, len(x)), keys(listed, len(x)))
    return NearPairs(ends[new], gap[new])


def blocks(count: int) -> Iterator[slice]:
    """Slices of at most `PART` of so many pairs."""
    return (slice(k, k + PART) for k in range(0, count, PART))


def keys(ends: Indices, sites: int) -> Indices:
    """A number for each pair of sites (pairs, 2), whatever their order, by which pairs are
    sorted."""
    return np.minimum(*ends.T).astype(np.int64) * sites + np.maximum(*ends.T)


def distances(x: Array, i: Indices, j: Indices) -> Array:
    """Distances of pairs of points.

    Parameters
    ----------
    x : ndarray, (..., points, dim)
        [m]
    i, j : ndarray of int, (pairs,)

    Returns
    -------
    ndarray, (..., pairs)
        [m]
    """
    square = np.take(x, j, axis=-2)
    square -= np.take(x, i, axis=-2)
    square *= square
    return np.sqrt(total(square))


def total(parts: Array) -> Array:
    """Sum of parts (..., dim) in the order of `numpy.sum`, without its cost for a short axis."""
    first, *others = np.moveaxis(parts, -1, 0)
    return sum(others, start=first)
