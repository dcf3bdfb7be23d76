"""Checks of what describes a lattice: vectors, members and the offsets of their cells."""

from __future__ import annotations

from typing import Any

import numpy as np

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.typing import Array, Indices

DEPENDENT = 1e-10  # least singular value of the lattice vectors over the largest


def independent_vectors(given: Any, dim: int) -> Array:
    """Lattice vectors (d, dim) [m], checked.

    Parameters
    ----------
    given : array_like
    dim : int

    Returns
    -------
    ndarray, (d, dim)

    Raises
    ------
    TensegrityError
    """
    vectors = check.floats("vectors", given)
    if vectors.ndim != 2 or vectors.shape[1] != dim or not 1 <= len(vectors) <= dim:
        raise TensegrityError(
            f"vectors have shape {vectors.shape}, must be (d, {dim}) with d from 1 to {dim}"
        )
    check.finite("vectors", vectors)
    sizes = np.linalg.svd(vectors, compute_uv=False)
    if not sizes[-1] > DEPENDENT * sizes[0]:
        raise TensegrityError(
            f"vectors are dependent: their least singular value {sizes[-1]:.3g} m must be above "
            f"{DEPENDENT:g} of the largest {sizes[0]:.3g} m"
        )
    return vectors


def ends_and_offsets(name: str, given: Any, nodes: int, d: int) -> tuple[Indices, Indices]:
    """The nodes and offsets of the bars or strings, checked.

    Parameters
    ----------
    name : str
        "bar" or "string", for messages.
    given : sequence of (int, int, offset)
    nodes, d : int
        Numbers of nodes and of lattice vectors.

    Returns
    -------
    tuple of two ndarrays of int, (members, 2) and (members, d)

    Raises
    ------
    TensegrityError
    """
    try:
        listed = [tuple(entry) for entry in given]
    except TypeError:
        raise TensegrityError(
            f"{name}s {check.shown(given)} must be (node, node, offset) each"
        ) from None
    pairs, offsets = [], []
    for entry in listed:
        if len(entry) not in (2, 3):
            raise TensegrityError(f"{name} {check.shown(entry)} must be (node, node, offset)")
        offset = entry[2] if len(entry) == 3 else (0,) * d
        if d == 1 and np.ndim(offset) == 0:
            offset = (offset,)
        words = check.sequence(f"offset of a {name}", offset, f"{d} integers")
        if len(words) != d:
            raise TensegrityError(
                f"offset {check.shown(offset)} of a {name} must be {d} integers, one per vector"
            )
        numbers = [check.whole(f"offset of a {name}", n, least=-(2**31)) for n in words]
        ends = [check.whole(f"node of a {name}", n, least=0, below=nodes) for n in entry[:2]]
        if ends[0] == ends[1] and not any(numbers):
            raise TensegrityError(f"{name} joins node {ends[0]} to itself: its length is 0 m")
        pairs.append(ends)
        offsets.append(numbers)
    return (
        np.array(pairs, dtype=np.int64).reshape(-1, 2),
        np.array(offsets, dtype=np.int64).reshape(-1, d),
    )


def refuse_repeated(ends: Indices, offsets: Indices, bars: int) -> None:
    """Refuse a member that is given twice, possibly with its ends exchanged.

    Parameters
    ----------
    ends, offsets : ndarray of int, (members, 2) and (members, d)
    bars : int
        Number of bars, which come first.

    Raises
    ------
    TensegrityError
    """
    first: dict[tuple[Any, ...], int] = {}
    for number, ((i, j), offset) in enumerate(zip(ends.tolist(), offsets.tolist(), strict=True)):
        back = [-n for n in offset]
        key = min((i, j, *offset), (j, i, *back))
        if key in first:
            words = [f"{'bar' if m < bars else 'string'} {m}" for m in (first[key], number)]
            raise TensegrityError(
                f"{words[0]} and {words[1]} both join nodes {i} and {j} at offset {tuple(offset)}"
            )
        first[key] = number
