"""The segments of members: one of a bar or a string, several of a cable that runs over nodes.

There is no friction at the nodes, so that all segments of a cable have its tension, which follows
from the sum of their lengths: the elongation of a member has the gradient of that sum.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from tensegrity import check
from tensegrity.errors import EquilibriumError, TensegrityError
from tensegrity.typing import Array, Flags, Indices


@dataclass(frozen=True)
class Segments:
    """Which member each segment belongs to.

    Attributes
    ----------
    owner : ndarray of int, (segments,), or None
        In ascending order; None where each segment is a member.
    """

    owner: Indices | None = None

    @cached_property
    def _first(self) -> Indices:
        """Number of the first segment of each member, (members,)."""
        return np.flatnonzero(np.diff(np.asarray(self.owner), prepend=-1))

    @cached_property
    def shared(self) -> Flags:
        """Which segments are of a cable over nodes, (segments,)."""
        assert self.owner is not None
        return (np.bincount(self.owner) > 1)[self.owner]

    @cached_property
    def cables(self) -> Indices:
        """Numbers of the members that run over nodes."""
        if self.owner is None:
            return np.zeros(0, dtype=np.int64)
        return np.unique(self.owner[self.shared])

    def over(self, values: Array, axis: int = -1) -> Array:
        """Sums over the segments of each member, such as their lengths."""
        if self.owner is None:
            return values
        return np.asarray(np.add.reduceat(values, self._first, axis=axis))

    def each(self, values: Any) -> Any:
        """Values of members (..., members) for each of their segments."""
        return values if self.owner is None else values[..., self.owner]

    def of(self, member: int) -> Indices:
        """Numbers of the segments of a member."""
        return np.array([member]) if self.owner is None else np.flatnonzero(self.owner == member)

    def alone(self, stiffness: Array) -> Array:
        """Stiffnesses of segments that are a member, 0 of those of cables over nodes."""
        if self.owner is None:
            return stiffness
        return np.where(self.shared, 0.0, self.each(stiffness))

    def lengthwise(self, along: Array, ends: Indices, stiffness: Array, rows: int) -> Any:
        """The part k g g^T of cables over nodes in the tangent, g the gradient of the length.

        Parameters
        ----------
        along : ndarray, (segments, dim)
            Unit vectors of the segments.
        ends : ndarray of int, (segments, 2)
        stiffness : ndarray, (members,)
            k [N/m].
        rows : int
            Number of coordinates.

        Returns
        -------
        sparse array, (rows, rows)
            [N/m]
        """
        from scipy.sparse import coo_array

        mine, dim = self.shared, along.shape[1]
        root = np.sqrt(self.each(stiffness)[mine])[:, None] * along[mine]
        first, second = (dim * x[mine, None] + np.arange(dim) for x in ends.T)
        owner = np.repeat(np.asarray(self.owner)[mine], dim)
        at = np.append(first, second), np.append(owner, owner)
        values = np.append(-root, root)
        gradient = coo_array((values, at), shape=(rows, len(stiffness))).tocsr()
        return gradient @ gradient.T

    def refuse_together(self, lengths: Array, ends: Indices, least: float) -> None:
        """Refuse segments of cables over nodes without length.

        Parameters
        ----------
        lengths : ndarray, (segments,)
            [m]
        ends : ndarray of int, (segments, 2)
        least : float
            Length that counts as 0 [m].

        Raises
        ------
        EquilibriumError
        """
        if self.owner is not None:
            short = np.where(self.shared, lengths, np.inf)
            worst = int(short.argmin())
            if short[worst] <= least:
                i, j = ends[worst].tolist()
                raise EquilibriumError(
                    f"two pulleys run together: nodes {i} and {j} of cable {self.owner[worst]} are "
                    f"{short[worst]:.3g} m apart"
                )


WHOLE = Segments()  # of members that are straight from node to node


def paths(given: Any, nodes: int) -> tuple[tuple[int, ...], ...]:
    """The nodes along each cable, checked to exist and to differ from one to the next.

    Parameters
    ----------
    given : sequence of sequences of int
    nodes : int
        Number of nodes.

    Returns
    -------
    tuple of tuple of int

    Raises
    ------
    TensegrityError
    """
    try:
        listed: Sequence[tuple[Any, ...]] = [tuple(path) for path in given]
    except TypeError:
        raise TensegrityError(f"cables {check.shown(given)} must list the nodes of each") from None
    for path in listed:
        if len(path) < 2:
            raise TensegrityError(f"cable {check.shown(path)} must run from one node to another")
        numbers = [check.whole("node of a cable", n, least=0, below=nodes) for n in path]
        for one, other in pairwise(numbers):
            if one == other:
                raise TensegrityError(f"cable {check.shown(path)} has a segment of length 0 m")
    return tuple(tuple(int(n) for n in path) for path in listed)
