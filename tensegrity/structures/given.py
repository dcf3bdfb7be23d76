"""What a user gives for a structure, checked and made arrays."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check
from tensegrity.errors import TensegrityError

if TYPE_CHECKING:
    from typing import Any

    from numpy.typing import ArrayLike

    from tensegrity.typing import Array, Indices


def platforms(given: Any, nodes: int) -> tuple[tuple[int, ...], ...]:
    """Nodes of each rigid plate, none on two."""
    try:
        groups = tuple(tuple(group) for group in given)
    except TypeError:
        raise TensegrityError(f"platforms {check.shown(given)} must list nodes of each") from None
    if () in groups:
        raise TensegrityError(f"platform {groups.index(())} has 0 nodes, must have at least 1")
    numbers = [check.whole("node of a platform", n, least=0) for group in groups for n in group]
    for number in numbers:
        if number >= nodes or numbers.count(number) > 1:
            raise TensegrityError(
                f"node {number} of a platform must be below {nodes} and on one platform only"
            )
    return groups


def pairs(name: str, given: Any, nodes: int) -> Indices:
    """The two different nodes of each bar or string; (members, 2)."""
    try:
        listed = [tuple(pair) for pair in given]
    except TypeError:
        raise TensegrityError(f"{name}s {check.shown(given)} must be pairs of nodes") from None
    for pair in listed:
        if len(pair) != 2:
            raise TensegrityError(f"{name} {check.shown(pair)} must join two nodes")
        for node in pair:
            if check.whole(f"node of a {name}", node, least=0) >= nodes:
                raise TensegrityError(f"node {node} of a {name} must be below {nodes}")
        if pair[0] == pair[1]:
            raise TensegrityError(f"{name} joins node {pair[0]} to itself: its length is 0 m")
    return np.array(listed, dtype=np.int64).reshape(-1, 2)


def refuse_double(ends: Indices, bars: int) -> None:
    """Refuse two members between the same nodes; the first ones are bars."""
    first: dict[tuple[int, int], int] = {}
    for number, (i, j) in enumerate(np.sort(ends, axis=1).tolist()):
        if (i, j) in first:
            words = [f"{'bar' if m < bars else 'string'} {m}" for m in (first[i, j], number)]
            raise TensegrityError(f"{words[0]} and {words[1]} both join nodes {i} and {j}")
        first[i, j] = number


def each(name: str, given: ArrayLike, count: int, unit: str) -> Array:
    """One positive number for each, from one for all or one for each; (count,)."""
    values = check.floats(name, given)
    if values.shape not in ((), (count,)):
        raise TensegrityError(f"{name} has shape {values.shape}, must be one or ({count},)")
    bad = np.flatnonzero(~((values > 0) & np.isfinite(values)))
    if bad.size:
        worst = values.ravel()[bad[0]]
        raise TensegrityError(f"{name} {worst:g} {unit} must be finite and above 0")
    return np.broadcast_to(values, (count,)).copy()
