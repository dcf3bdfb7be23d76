"""What is given along a path of a structure: loads or natural lengths, motions, and its events."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.typing import Array, Flags, Indices

if TYPE_CHECKING:
    from tensegrity.structures.members import Members

Plates = tuple[Array, tuple[int, ...], tuple[int, ...]]

INSIDE = 1e-9  # fraction of a bar next to its ends within which it is not crossed
PLANE = 1e-9  # volume over lengths below which two bars are coplanar
NEXT, LAST = np.array([1, 2, 0]), np.array([2, 0, 1])  # axes of a vector product


@dataclass(frozen=True, eq=False)
class Loading:
    """The load or control of a path, and the motions of the structure.

    Attributes
    ----------
    members : Members
    positions : ndarray, (nodes, dim)
        Positions at the start [m].
    motions : ndarray, (nodes dim, free)
        Orthonormal basis of the permitted motions.
    pattern : ndarray, (nodes, dim), optional
        Nodal forces per unit load; None if natural lengths are controlled.
    change : ndarray, (members,)
        Change of the natural lengths from control 0 to 1 [m].
    plate : tuple, optional
        Unit normal, nodes of the lower and the upper plate.
    limits : tuple of two float
        Load [N] at which the path ends, and shortening [m] (or control) in either sense.
    dead : ndarray, (nodes, dim)
        Constant loads [N].
    kept : ndarray of bool, (members,)
        Members that keep EA as their natural lengths change; the others keep k.
    """

    members: Members
    positions: Array
    motions: Array
    pattern: Array | None
    change: Array
    plate: Plates | None
    limits: tuple[float, float]
    dead: Array
    kept: Flags

    @property
    def free(self) -> int:
        """Number of motions."""
        return int(self.motions.shape[1])

    @cached_property
    def along(self) -> Array:
        """Work of the unit load on each motion, (free,)."""
        if self.pattern is None:
            return np.zeros(self.free)
        return np.asarray(self.motions.T @ self.pattern.ravel())

    @cached_property
    def basis(self) -> Array:
        """Basis of the motions, (free, free): those on which the load does no work, then that of
        unit shortening; the identity if natural lengths are controlled."""
        if self.pattern is None:
            return np.eye(self.free)
        size = float(self.along @ self.along)
        across = np.linalg.svd(self.along[None, :])[2][1:].T
        return np.column_stack([across, self.along / size])

    @cached_property
    def unit(self) -> Array:
        """Work of the unit load on each motion of the basis, (free,)."""
        return np.asarray(self.basis.T @ self.along)

    @cached_property
    def weight(self) -> Array:
        """Work of the constant loads on each motion of the basis, (free,)."""
        return np.asarray(self.basis.T @ (self.motions.T @ self.dead.ravel()))

    @cached_property
    def moves(self) -> Indices:
        """Numbers of the unknowns that are motions of the basis, (free,)."""
        numbers = np.arange(self.free)
        if self.pattern is not None:
            numbers[-1] += 1
        return numbers

    @cached_property
    def by_node(self) -> Array:
        """Displacement of each node with each unknown, (nodes, dim, free + 1)."""
        by_node = np.zeros((*self.positions.shape, self.free + 1))
        by_node[..., self.moves] = (self.motions @ self.basis).reshape(*self.positions.shape, -1)
        return by_node

    @cached_property
    def gain(self) -> Array:
        """Change of each separation with each unknown, (segments, dim, free + 1)."""
        i, j = self.members.ends.T
        return np.asarray(self.by_node[j] - self.by_node[i])

    @cached_property
    def start(self) -> Array:
        """Separations at the start, (segments, dim)."""
        return self.members.separations(self.positions)[0]

    @cached_property
    def span(self) -> float:
        """Size of the structure [m]."""
        return float(np.ptp(self.positions, axis=0).max())

    @cached_property
    def force(self) -> float:
        """Scale of loads [N]."""
        return float(np.median(self.members.stiffness)) * self.span

    @cached_property
    def pairs(self) -> Indices:
        """Pairs of bars that may come into contact, (pairs, 2): without a common node, and not
        coplanar at the start; none if the structure is planar."""
        bars = np.flatnonzero(~self.members.tension_only)
        ends = self.members.ends
        touching = [
            (a, b)
            for a, b in combinations(bars.tolist(), 2)
            if not {*ends[a].tolist()} & {*ends[b].tolist()}
        ]
        if self.positions.shape[1] == 2:
            touching = []
        pairs = np.array(touching, dtype=np.int64).reshape(-1, 2)
        return pairs[np.abs(self.crossing(self.positions, pairs)[0]) > PLANE]

    def positions_at(self, u: Array) -> Array:
        """Positions at unknowns u (..., free + 1) [m], (..., nodes, dim)."""
        moved = u @ self.by_node.reshape(-1, self.free + 1).T
        return np.asarray(self.positions + moved.reshape(*u.shape[:-1], *self.positions.shape))

    def crossing(self, x: Array, pairs: Indices | None = None) -> tuple[Array, Flags]:
        """Signed volume spanned by pairs of bars over the product of lengths and the size, and
        whether the common perpendicular meets both bars between their ends; (pairs,) each."""
        ends = self.members.ends
        pairs = self.pairs if pairs is None else pairs
        if not len(pairs):
            return np.zeros(0), np.zeros(0, dtype=bool)
        (a, b), (c, d) = (x[ends[pairs[:, k]].T] for k in (0, 1))
        first, second, separations = b - a, d - c, c - a
        normal = _cross(first, second)
        size = np.einsum("ij,ij->i", normal, normal) + 1e-300
        s = np.einsum("ij,ij->i", _cross(separations, second), normal) / size
        t = np.einsum("ij,ij->i", _cross(separations, first), normal) / size
        within = (s > INSIDE) & (s < 1 - INSIDE) & (t > INSIDE) & (t < 1 - INSIDE)
        squares = np.einsum("ij,ij->i", first, first) * np.einsum("ij,ij->i", second, second)
        return self._volumes(separations, normal, np.sqrt(squares)), within

    def _volumes(self, separations: Array, normal: Array, products: Array) -> Array:
        return np.einsum("ij,ij->i", separations, normal) / (products * self.span)

    def natural(self, control: Array | float) -> Array:
        """Natural lengths of the members [m], (..., members)."""
        return np.asarray(self.members.natural + control * self.change)

    def members_at(self, control: float) -> Members:
        """The members at a value of the control."""
        members, natural = self.members, self.natural(control)
        longer = np.where(self.kept, natural / members.natural, 1.0)
        least = None if members.least is None else members.least * longer
        stiffness = members.stiffness / longer
        return replace(members, natural=natural, stiffness=stiffness, least=least)

    @cached_property
    def whole(self) -> Flags:
        """Which kinks members are above when no string is slack; (kinks,)."""
        return np.asarray(self.members.kinks.kind == 0)

    @cached_property
    def between(self) -> tuple[Array, Array]:
        """Separations of the first ends of the bars of each pair at the start, (pairs, 3), and
        their change with each unknown, (pairs, 3, free + 1)."""
        i, j = self.members.ends[self.pairs, 0].T
        return self.positions[j] - self.positions[i], self.by_node[j] - self.by_node[i]

    @cached_property
    def volumes_at_start(self) -> Array:
        """Volumes of `crossing` at the start."""
        return self.crossing(self.positions)[0]

    def volumes(self, u: Array, d: Array, lengths: Array) -> Array:
        """Volumes of `crossing`.

        Parameters
        ----------
        u : ndarray, (free + 1,)
            Unknowns.
        d, lengths : ndarray, (members, dim) and (members,)
            Separations and lengths of the members there [m].

        Returns
        -------
        ndarray, (pairs,)
        """
        if not len(self.pairs):
            return np.zeros(0)
        (start, change), (one, other) = self.between, self.pairs.T
        products = lengths[one] * lengths[other]
        return self._volumes(start + change @ u, _cross(d[one], d[other]), products)

    @cached_property
    def at_plates(self) -> tuple[list[str], Array, Array]:
        """Names of the events at plates, their functions at the start, (events,), and gradients,
        (events, free + 1): distances over the size."""
        if not self.plate:
            return [], np.zeros(0), np.zeros((0, self.free + 1))
        normal, low, up = self.plate
        others = sorted(set(range(len(self.positions))) - {*low, *up})
        heights = self.positions @ normal, np.einsum("i,nif->nf", normal, self.by_node)
        bottom = [x[low[0]] for x in heights] if low else [-np.inf, 0.0]
        names = [f"plate {node} lower" for node in others]
        overlaps = [[x[others] - below for x, below in zip(heights, bottom, strict=True)]]
        if up:
            names += [*(f"plate {node} upper" for node in others), "flat"]
            overlaps.append([x[up[0]] - x[others] for x in heights])
            overlaps.append([x[up[:1],] - below for x, below in zip(heights, bottom, strict=True)])
        start, rows = (np.concatenate(x) / self.span for x in zip(*overlaps, strict=True))
        return names, start, rows

    @cached_property
    def roots(self) -> tuple[str, ...]:
        """Names of the event functions of all pieces."""
        names = [f"kink {k}" for k in range(len(self.members.kinks.member))]
        names += [f"contact {a} {b}" for a, b in self.pairs.tolist()]
        names += self.at_plates[0]
        last = "shortening" if self.pattern is not None else "control"
        names += [f"end {name}" for name, end in zip(("load", last), self.limits, strict=True)
                  if np.isfinite(end)]  # fmt: skip
        return (*names, *(["end back"] if self.pattern is None else []))


def _cross(a: Array, b: Array) -> Array:
    """Vector products, (n, 3); `numpy.cross` takes several times as long."""
    return np.asarray(a[:, NEXT] * b[:, LAST] - a[:, LAST] * b[:, NEXT])
