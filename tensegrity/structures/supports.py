"""What holds a structure: nodes held, or smooth plates; and the rigid motions that are left."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check
from tensegrity.errors import TensegrityError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from tensegrity.typing import Array

LEFT = 1e-9  # part of a rigid motion that supports may take and still leave it


@dataclass(frozen=True)
class Supports:
    """Nodes that are held, and plates; made by `held` and `plates`, put together by +.

    Attributes
    ----------
    holds : tuple of (node, axes)
        Axes along which a node keeps its place; None for all.
    lower, upper : tuple of int
        Nodes on a smooth plate at rest, and on one that moves along the normal.
    normal : tuple of float, optional
        Across the plates; None for the last axis.
    """

    holds: tuple[tuple[int, tuple[int, ...] | None], ...] = ()
    lower: tuple[int, ...] = ()
    upper: tuple[int, ...] = ()
    normal: tuple[float, ...] | None = None

    def __add__(self, other: Supports) -> Supports:
        check.kind("supports", other, Supports)
        if self.lower + self.upper and other.lower + other.upper:
            raise TensegrityError("plates given twice: a structure has one pair of them")
        one = self if self.lower + self.upper else other
        return Supports(self.holds + other.holds, one.lower, one.upper, one.normal)

    def direction(self, dim: int) -> Array:
        """Unit normal of the plates, (dim,)."""
        if self.normal is None:
            return np.eye(dim)[-1]
        if len(self.normal) != dim:
            raise TensegrityError(f"normal has {len(self.normal)} components, must be {dim}")
        normal = np.array(self.normal) / np.abs(self.normal).max()  # squares neither 0 nor inf
        return normal / np.linalg.norm(normal)

    def motions(self, nodes: int, dim: int, platforms: Any = ()) -> Any:
        """Orthonormal motions that are left, sparse (nodes dim, motions); that of the plate last.

        Each of `platforms` is a sequence of nodes that move along the last axis as one.

        Raises
        ------
        TensegrityError
            If a node or an axis does not exist.
        """
        import scipy.sparse as sparse

        for node in (*(n for n, _ in self.holds), *self.lower, *self.upper):
            if node >= nodes:
                raise TensegrityError(f"node {node} must be below {nodes}, the number of nodes")
        held = np.zeros((nodes, dim), dtype=bool)
        for node, axes in self.holds:
            for axis in range(dim) if axes is None else axes:
                if axis >= dim:
                    raise TensegrityError(f"axis {axis} must be below {dim}, the dimension")
                held[node, axis] = True
        normal = self.direction(dim)
        across = np.linalg.svd(normal[None, :])[2][1:]  # in the plates
        if self.normal is None:
            across = np.eye(dim)[:-1]
        on_plates = {*self.lower, *self.upper}
        riding = {node for group in platforms for node in group}
        both = sorted(riding & (on_plates | {node for node, _ in self.holds}))
        if both or (riding and self.normal is not None):
            raise TensegrityError(
                f"node {both[0]} is on a platform and supported too"
                if both
                else "platforms move along the last axis: plates across another do not suit"
            )
        rows, columns, values, count = [], [], [], 0
        for node in range(nodes):
            if node in on_plates and held[node].any() and not held[node].all():
                if self.normal is not None:
                    raise TensegrityError(f"node {node} is both held along axes and on a plate")
                kept = [v for v in across if not v[held[node]].any()]
            elif node in riding:
                kept = list(np.eye(dim)[:-1])
            elif node in on_plates:
                kept = [] if held[node].all() else list(across)
            else:
                kept = [v for axis, v in enumerate(np.eye(dim)) if not held[node, axis]]
            for vector in kept:
                rows += [dim * node + axis for axis in range(dim)]
                columns += [count] * dim
                values += vector.tolist()
                count += 1
        for group in (*platforms, *([self.upper] if self.upper else [])):
            share = normal / np.sqrt(len(group))
            for node in group:
                rows += [dim * node + axis for axis in range(dim)]
                columns += [count] * dim
                values += share.tolist()
            count += 1
        matrix = sparse.csc_matrix((values, (rows, columns)), shape=(nodes * dim, count))
        matrix.eliminate_zeros()
        return matrix

    def __repr__(self) -> str:
        parts = [f"held({[n for n, _ in self.holds]})"] if self.holds else []
        if self.lower + self.upper:
            parts.append(f"plates({list(self.lower)}, {list(self.upper)})")
        return " + ".join(parts) or "Supports()"


def held(nodes: Sequence[int], axes: Sequence[int] | None = None) -> Supports:
    """Supports that keep nodes in their place.

    Parameters
    ----------
    nodes : sequence of int
    axes : sequence of int, optional
        Coordinates that are kept; by default all.

    Returns
    -------
    Supports
    """
    numbers = _numbers("held node", nodes)
    kept = None if axes is None else _numbers("axis", axes)
    return Supports(tuple((node, kept) for node in numbers))


def plates(
    lower: Sequence[int], upper: Sequence[int] = (), normal: Sequence[float] | None = None
) -> Supports:
    """Two smooth parallel plates: the first at rest, the second guided along the normal.

    Parameters
    ----------
    lower, upper : sequence of int
        Nodes on each; they slide in it and do not leave it.
    normal : (dim,), optional
        From the lower to the upper plate; by default the last axis.

    Returns
    -------
    Supports
    """
    low, up = _numbers("node of the lower plate", lower), _numbers("node of the upper plate", upper)
    both = sorted({*low} & {*up})
    if both:
        raise TensegrityError(f"node {both[0]} is on both plates")
    if normal is None:
        return Supports((), low, up)
    across = check.floats("normal", normal)
    if across.ndim != 1 or not np.isfinite(across).all() or not across.any():
        raise TensegrityError(f"normal {check.shown(normal)} must be a vector other than 0")
    return Supports((), low, up, tuple(across.tolist()))


def _numbers(name: str, given: Sequence[int]) -> tuple[int, ...]:
    given = check.sequence(name, given, "whole numbers")
    numbers = [check.whole(name, node, least=0) for node in given]
    twice = [n for n in numbers if numbers.count(n) > 1]
    if twice:
        raise TensegrityError(f"{name} {twice[0]} is given twice")
    return tuple(numbers)


def rigid_motions(positions: Array) -> Array:
    """Translations and infinitesimal rotations about the centre, (nodes dim, 3 or 6)."""
    nodes, dim = positions.shape
    arms = positions - positions.mean(axis=0)
    size = np.sqrt(np.mean(np.sum(arms**2, axis=1)))
    columns = [np.tile(axis, (nodes, 1)) for axis in np.eye(dim)]
    for i in range(dim):
        for j in range(i + 1, dim):
            turn = np.zeros((nodes, dim))
            turn[:, i], turn[:, j] = -arms[:, j] / size, arms[:, i] / size
            columns.append(turn)
    return np.column_stack([c.ravel() for c in columns])


def left_over(motions: Any, positions: Array, parts: Any) -> Array:
    """Orthonormal rigid motions of the parts among `motions`, in their coordinates.

    Parameters
    ----------
    motions : sparse, (nodes dim, free)
    positions : ndarray, (nodes, dim)
    parts : sequence of ndarray of int
        Nodes of each part.

    Returns
    -------
    ndarray, (free, count)
    """
    columns = []
    for nodes in parts:
        own = orthonormal(rigid_motions(positions[nodes]))
        whole = np.zeros((*positions.shape, own.shape[1]))
        whole[nodes] = own.reshape(len(nodes), positions.shape[1], -1)
        columns.append(whole.reshape(positions.size, -1))
    rigid = np.concatenate(columns, axis=1)
    inside = motions.T @ rigid
    _, sizes, right = np.linalg.svd(rigid - motions @ inside, full_matrices=False)
    return np.asarray(inside @ right[sizes < LEFT].T)


def orthonormal(columns: Array) -> Array:
    """A basis of what columns span."""
    left, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    return left[:, sizes > LEFT * sizes[0]]
