"""Supports of a structure, fixed nodes and smooth plates, and the motions that they permit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tensegrity import check
from tensegrity.errors import EquilibriumError, TensegrityError
from tensegrity.minimum import complement, lowest
from tensegrity.printing import concise
from tensegrity.typing import Array, Flags

REMAINING = 1e-9  # largest constrained fraction of a rigid motion that counts as permitted
NEGLIGIBLE = 1e-13  # of the largest stiffness or singular value: zero up to round-off
WORK = 1e-9  # work of loads on rigid motions that counts as zero, over their magnitude


@dataclass(frozen=True)
class Supports:
    """Fixed nodes and smooth plates, made by `held` and `plates` and combined by +.

    Attributes
    ----------
    holds : tuple of (node, axes)
        The axes along which each of some nodes is fixed; None for all axes.
    lower, upper : tuple of int
        Nodes on a smooth plate at rest, and on one that is guided along the normal.
    normal : tuple of float, optional
        Normal of the plates; None for the last axis.
    """

    holds: tuple[tuple[int, tuple[int, ...] | None], ...] = ()
    lower: tuple[int, ...] = ()
    upper: tuple[int, ...] = ()
    normal: tuple[float, ...] | None = None
    _given_by = ": made by held(...) or plates(...)"

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
        """Orthonormal basis of the permitted motions; that of the upper plate comes last.  Where
        every motion is permitted, it is the identity.

        Parameters
        ----------
        nodes, dim : int
            Number of nodes, and dimension of space.
        platforms : sequence of sequences of int, optional
            Groups of nodes that move along the last axis together.

        Returns
        -------
        sparse array, (nodes dim, motions)

        Raises
        ------
        TensegrityError
            If a node or an axis does not exist, or a node is supported twice.
        """
        from scipy.sparse import csc_array, eye_array

        held, on_platforms = self._fixed_coordinates(nodes, dim), self._platform_nodes(platforms)
        own = {node: self._in_plane_directions(node, held[node])
               for node in (*self.lower, *self.upper)}  # fmt: skip
        own |= {node: list(np.eye(dim)[:-1]) for node in on_platforms}
        free, normal = ~held, self.direction(dim)
        count = free.sum(axis=1)
        for node, along in own.items():
            free[node], count[node] = False, len(along)
        first, total = np.cumsum(count) - count, int(count.sum())
        groups = (*platforms, *([self.upper] if self.upper else []))
        if total + len(groups) == nodes * dim:
            return eye_array(nodes * dim, format="csc")
        node, axis = np.nonzero(free)
        rows = [dim * node + axis]
        columns = [first[node] + np.cumsum(free, axis=1)[node, axis] - 1]
        values = [np.ones(len(node))]
        moving = [((node,), one, first[node] + k)
                  for node, along in own.items() for k, one in enumerate(along)]  # fmt: skip
        moving += [
            (group, normal / np.sqrt(len(group)), total + k) for k, group in enumerate(groups)
        ]
        for group, along, column in moving:
            rows.append((dim * np.array(group)[:, None] + np.arange(dim)).ravel())
            columns.append(np.full(dim * len(group), column))
            values.append(np.tile(along, len(group)))
        entries = np.concatenate(rows), np.concatenate(columns)
        matrix = csc_array(
            (np.concatenate(values), entries), shape=(nodes * dim, total + len(groups))
        )
        matrix.eliminate_zeros()
        return matrix

    def _fixed_coordinates(self, nodes: int, dim: int) -> Flags:
        """Which coordinates are fixed, (nodes, dim); refuses nodes and axes that do not exist."""
        for node in (*(n for n, _ in self.holds), *self.lower, *self.upper):
            if node >= nodes:
                raise TensegrityError(f"node {node} must be below {nodes}, the number of nodes")
        coordinates = np.zeros((nodes, dim), dtype=bool)
        for node, axes in self.holds:
            for axis in range(dim) if axes is None else axes:
                if axis >= dim:
                    raise TensegrityError(f"axis {axis} must be below {dim}, the dimension")
                coordinates[node, axis] = True
        return coordinates

    def _platform_nodes(self, platforms: Any) -> set[int]:
        """Nodes on platforms; refuses those that are supported as well."""
        nodes = {node for group in platforms for node in group}
        both = sorted(nodes & {*self.lower, *self.upper, *(node for node, _ in self.holds)})
        if both:
            raise TensegrityError(f"node {both[0]} is on a platform and supported as well")
        if nodes and self.normal is not None:
            raise TensegrityError(
                "platforms move along the last axis, which must be the normal of the plates too"
            )
        return nodes

    def _in_plane_directions(self, node: int, held: Flags) -> list[Array]:
        """Directions in the plane of the plates along which a node is free."""
        if self.normal is None:
            across = np.eye(len(held))[:-1]
        else:
            across = np.linalg.svd(self.direction(len(held))[None, :])[2][1:]
            if held.any() and not held.all():
                raise TensegrityError(f"node {node} is both held along axes and on a plate")
        return [along for along in across if not along[held].any()]

    __str__ = concise

    def __repr__(self) -> str:
        parts = [f"held({[n for n, _ in self.holds]})"] if self.holds else []
        if self.lower + self.upper:
            parts.append(f"plates({list(self.lower)}, {list(self.upper)})")
        return " + ".join(parts) or "Supports()"


def held(nodes: Sequence[int], axes: Sequence[int] | None = None) -> Supports:
    """Supports that fix nodes, along all axes or some of them.

    Parameters
    ----------
    nodes : sequence of int
        The nodes to fix.
    axes : sequence of int, optional
        The axes along which they are fixed; by default all.

    Returns
    -------
    Supports

    Raises
    ------
    TensegrityError
        If a node or an axis is not a whole number, is negative or is given twice.

    Examples
    --------
    >>> from tensegrity import held
    >>> held([0]) + held([1], axes=[1])
    held([0, 1])
    """
    numbers = _distinct_numbers("held node", nodes)
    fixed_axes = None if axes is None else _distinct_numbers("axis", axes)
    return Supports(tuple((node, fixed_axes) for node in numbers))


def plates(
    lower: Sequence[int], upper: Sequence[int] = (), normal: Sequence[float] | None = None
) -> Supports:
    """Two smooth parallel plates: the lower at rest, the upper guided along their normal.

    Parameters
    ----------
    lower, upper : sequence of int
        The nodes on each plate; they slide on it and do not leave it.
    normal : array_like, (dim,), optional
        Direction from the lower to the upper plate; by default the last axis.

    Returns
    -------
    Supports

    Raises
    ------
    TensegrityError
        If a node is on both plates or given twice, or the normal is no vector other than 0.

    Examples
    --------
    >>> from tensegrity import held, plates
    >>> held([0]) + plates([0, 1, 2], [3, 4, 5])
    held([0]) + plates([0, 1, 2], [3, 4, 5])
    """
    low, up = (
        _distinct_numbers("node of the lower plate", lower),
        _distinct_numbers("node of the upper plate", upper),
    )
    both = sorted({*low} & {*up})
    if both:
        raise TensegrityError(f"node {both[0]} is on both plates")
    if normal is None:
        return Supports((), low, up)
    across = check.floats("normal", normal)
    if across.ndim != 1 or not np.isfinite(across).all() or not across.any():
        raise TensegrityError(f"normal {check.shown(normal)} must be a vector other than 0")
    return Supports((), low, up, tuple(across.tolist()))


def _distinct_numbers(name: str, given: Sequence[int]) -> tuple[int, ...]:
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


def remaining_rigid_motions(motions: Any, positions: Array, parts: Any) -> Array:
    """Orthonormal basis of the rigid motions of the parts that lie in the span of `motions`.

    Parameters
    ----------
    motions : sparse, (nodes dim, free)
        Orthonormal permitted motions.
    positions : ndarray, (nodes, dim)
        Positions of the nodes [m].
    parts : sequence of ndarray of int
        Nodes of each connected component.

    Returns
    -------
    ndarray, (free, count)
        Coefficients with respect to `motions`.
    """
    columns = []
    for nodes in parts:
        own = orthonormal(rigid_motions(positions[nodes]))
        whole = np.zeros((*positions.shape, own.shape[1]))
        whole[nodes] = own.reshape(len(nodes), positions.shape[1], -1)
        columns.append(whole.reshape(positions.size, -1))
    rigid = np.concatenate(columns, axis=1)
    if motions.shape[1] == positions.size:
        return rigid
    inside = motions.T @ rigid
    _, sizes, right = np.linalg.svd(rigid - motions @ inside, full_matrices=False)
    return np.asarray(inside @ right[sizes < REMAINING].T)


def orthonormal(columns: Array) -> Array:
    """An orthonormal basis of the span of the columns."""
    left, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    return left[:, sizes > REMAINING * sizes[:1]]


@dataclass(frozen=True)
class Freedom:
    """The motions permitted to a structure at given positions.

    Attributes
    ----------
    motions : sparse array, (nodes dim, free)
        Orthonormal basis of the permitted motions.
    rigid : ndarray, (free, count)
        Rigid motions of the parts among them, as coefficients with respect to `motions`.
    parts : sequence of ndarray of int
        Nodes of each connected component.
    """

    motions: Any
    rigid: Array
    parts: Any

    @classmethod
    def of(cls, supports: Supports | None, positions: Array, platforms: Any, parts: Any) -> Freedom:
        """The motions that supports and platforms permit.

        Parameters
        ----------
        supports : Supports or None
        positions : ndarray, (nodes, dim)
            Positions of the nodes [m].
        platforms : sequence of sequences of int
            Nodes of each platform.
        parts : sequence of ndarray of int
            Nodes of each connected component.

        Returns
        -------
        Freedom
        """
        motions = (supports or Supports()).motions(len(positions), positions.shape[1], platforms)
        return cls(motions, remaining_rigid_motions(motions, positions, parts), parts)

    def at(self, positions: Array) -> Freedom:
        """The permitted motions at other positions, where other ones are rigid."""
        return Freedom(
            self.motions, remaining_rigid_motions(self.motions, positions, self.parts), self.parts
        )

    def _driven(self, loads: Array) -> Array | None:
        """Work of loads on the rigid motions, (count,); None where it is round-off."""
        work = self.rigid.T @ (self.motions.T @ loads.ravel())
        return work if np.linalg.norm(work) > WORK * np.abs(loads).sum() else None

    def under(self, loads: Array) -> Freedom:
        """The same without the rigid motion on which loads (nodes, dim) [N] do work."""
        work = self._driven(loads)
        if work is None:
            return self
        others = complement(work[:, None] / np.linalg.norm(work))
        return Freedom(self.motions, self.rigid @ others, self.parts)

    def reduced(self, tangent: Any) -> Any:
        """A tangent stiffness projected onto the permitted motions, (free, free)."""
        return self.motions.T @ (self.motions.T @ tangent).T

    def complement(self) -> Array:
        """Orthonormal basis of the motions orthogonal to the rigid ones, (free, free - count)."""
        return complement(self.rigid)

    def lowest(self, tangent: Any, mass: Any, count: int) -> tuple[Array, Array]:
        """The lowest eigenvalues of M^-1 K without rigid motions, and the modes.

        Parameters
        ----------
        tangent : ndarray or sparse array, (nodes dim, nodes dim)
            Tangent stiffness K [N/m].
        mass : ndarray, (nodes dim,), or sparse array, (nodes dim, nodes dim)
            Diagonal of M, of each node the same in all directions, or M [kg].
        count : int

        Returns
        -------
        tuple of ndarray, (count,) and (nodes dim, count)
            Eigenvalues in ascending order [1/s^2], and vectors of unit modal mass.
        """
        motions = self.motions
        if motions.shape[1] == mass.shape[0]:  # the identity
            return lowest(tangent, mass, self.rigid, count, NEGLIGIBLE)
        if mass.ndim > 1:
            own = self.reduced(mass)
        else:  # as a node has the same mass in all directions, M stays diagonal
            own = np.add.reduceat(motions.data**2 * mass[motions.indices], motions.indptr[:-1])
        values, vectors = lowest(self.reduced(tangent), own, self.rigid, count, NEGLIGIBLE)
        return values, motions @ vectors

    def refuse_unbalanced(self, positions: Array, loads: Array) -> None:
        """Refuse loads that do work on rigid motions that the supports permit."""
        driven = self._driven(loads)
        if driven is None:
            return
        turns = (positions - positions.mean(axis=0)).T @ loads
        turns = turns - turns.T
        moment = turns[0, 1] if len(turns) == 2 else turns[(1, 2, 0), (2, 0, 1)]
        motion = (self.motions @ (self.rigid @ driven)).reshape(positions.shape)
        shift = motion.mean(axis=0)
        turning = np.linalg.norm(motion - shift) > np.linalg.norm(shift) * np.sqrt(len(motion))
        word = "rotation" if turning else "translation"
        raise EquilibriumError(
            f"the supports permit a rigid motion ({word}) on which the loads do work: net force "
            f"{_vector(loads.sum(axis=0))} N, net moment about the centre {_vector(moment)} N m"
        )


def _vector(value: Any) -> str:
    numbers = np.atleast_1d(value) + 0.0
    return "(" + ", ".join(f"{x:.4g}" for x in numbers.tolist()) + ")"
