"""Pairs of points within a distance of each other.

The points are searched in slabs along their longest extent, so that the memory of a search is that
of its result and of one slab.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np

from tensegrity.typing import Array, Indices

SLAB, SLABS = 2**17, 8  # least number of points in a slab, and largest number of slabs
FEW = 128  # points that are compared with each other, before SciPy is imported
PART = 2**16  # pairs that are computed at once
MARGIN = 1e-3  # of the distance, by which round-off is exceeded

_thread = threading.local()


class NearPairs(NamedTuple):
    """Pairs of points, sorted.

    Attributes
    ----------
    ends : ndarray of int, (pairs, 2)
        The lower and the higher number of the two points.
    distance : ndarray, (pairs,)
        [m]
    """

    ends: Indices
    distance: Array


def near_pairs(x: Array, reach: float) -> NearPairs:
    """All pairs of points x (points, dim) whose distance is at most `reach` [m]; within
    `searched_once`, possibly of larger distance."""
    known = getattr(_thread, "known", None)
    if known is None:
        return _searched(x, reach)
    for at, within, found in known:
        if within >= reach and np.array_equal(at, x):
            return found
    known[:] = [(x, reach, _searched(x, reach))]
    return known[0][-1]


@contextmanager
def searched_once() -> Iterator[None]:
    """A context in which `near_pairs` answers a search of the same points by the one before it, if
    that reached as far."""
    _thread.known = []
    try:
        yield
    finally:
        _thread.known = None


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


def sorted_keys(ends: Indices, sites: int) -> Indices:
    """The `keys` of pairs, in increasing order."""
    found = keys(ends, sites)
    if np.any(found[1:] < found[:-1]):
        found.sort()
    return found


def _searched(x: Array, reach: float) -> NearPairs:
    count = len(x)
    found = np.concatenate([np.zeros(0, np.int64), *_keys_of_slabs(x, reach)])
    found.sort()
    ends = np.empty((len(found), 2), np.int32 if count <= np.iinfo(np.int32).max else np.int64)
    distance = np.empty(len(found))
    for some in blocks(len(found)):
        ends[some, 0], ends[some, 1] = i, j = divmod(found[some], count)
        distance[some] = distances(x, i, j)
    return NearPairs(ends, distance)


def _keys_of_slabs(x: Array, reach: float) -> Iterator[Indices]:
    """The keys of the pairs of which one point is in a slab, and the other there or beyond it."""
    if len(x) <= FEW:
        ends = np.stack(np.triu_indices(len(x), 1), axis=1)
        yield keys(ends[total((x[ends[:, 0]] - x[ends[:, 1]]) ** 2) <= reach**2], len(x))
        return
    from scipy.spatial import cKDTree

    axis = int(np.argmax(np.ptp(x, axis=0)))
    order = np.argsort(x[:, axis], kind="stable")
    line, most = x[order, axis], max(SLAB, -(-len(x) // SLABS))
    for first in range(0, len(x), most):
        inside = min(most, len(x) - first)
        beyond = line[first + inside - 1] + (1 + MARGIN) * reach
        points = order[first : np.searchsorted(line, beyond, side="right")]
        tree = cKDTree(x[points], balanced_tree=False, compact_nodes=False)
        pairs = tree.query_pairs(reach, output_type="ndarray").reshape(-1, 2)
        yield keys(points[pairs[pairs[:, 0] < inside]], len(x))
