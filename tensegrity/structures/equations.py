"""Equilibria of a structure as the equations of a branch, with given strings taut.

Unknowns are the motions that supports leave (rigid ones out), then either the load and the
shortening that belongs to it, or a control from 0 to 1 along which natural lengths change.  A
string that is slack has no force, and one that is taut pulls or pushes: the branch ends where
that becomes wrong.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.engine import forces

if TYPE_CHECKING:
    from tensegrity.structures.members import Members
    from tensegrity.typing import Array, Flags, Indices

    Plates = tuple[Array, tuple[int, ...], tuple[int, ...]]

ROUND_OFF = 1e-3  # of stiffness times length beside tension: what residuals are measured by
BACK = -0.01  # control at which a path that has turned back ends
INSIDE = 1e-9  # part of a bar at its ends within which a crossing is none
PLANE = 1e-9  # volume over lengths below which two bars lie in a plane


@dataclass(frozen=True, eq=False)
class Loading:
    """What changes along a path, and what a structure may do.

    Attributes
    ----------
    members : Members
    positions : ndarray, (nodes, dim)
        At the start.
    motions : ndarray, (nodes dim, free)
        Orthonormal.
    pattern : ndarray, (nodes, dim), optional
        Forces of the load 1 N; None in a path of control.
    change : ndarray, (members,)
        Change of natural lengths over the whole control [m].
    plate : tuple, optional
        Unit normal, nodes of the lower and the upper plate.
    limits : tuple of two float
        Load [N] at which to end, and shortening [m] (or control) in either sense.
    dead : ndarray, (nodes, dim)
        Loads that stay [N].
    """

    members: Members
    positions: Array
    motions: Array
    pattern: Array | None
    change: Array
    plate: Plates | None
    limits: tuple[float, float]
    dead: Array

    @property
    def free(self) -> int:
        """Number of motions."""
        return int(self.motions.shape[1])

    @cached_property
    def along(self) -> Array:
        """Work of the load 1 N in each motion, (free,)."""
        if self.pattern is None:
            return np.zeros(self.free)
        return np.asarray(self.motions.T @ self.pattern.ravel())

    @cached_property
    def basis(self) -> Array:
        """Motions as (across the load, along it), (free, free): the last column is of shortening
        1 m; in a path of control the identity."""
        if self.pattern is None:
            return np.eye(self.free)
        size = float(self.along @ self.along)
        across = np.linalg.svd(self.along[None, :])[2][1:].T
        return np.column_stack([across, self.along / size])

    @cached_property
    def weight(self) -> Array:
        """Work of the loads that stay in each motion of the basis, (free,)."""
        return np.asarray(self.basis.T @ (self.motions.T @ self.dead.ravel()))

    @cached_property
    def by_node(self) -> Array:
        """Displacement of each node with each motion of the basis, (nodes, dim, free)."""
        return np.asarray((self.motions @ self.basis).reshape(*self.positions.shape, -1))

    @cached_property
    def gain(self) -> Array:
        """Change of each separation with each motion of the basis, (members dim, free)."""
        i, j = self.members.ends.T
        return (self.by_node[j] - self.by_node[i]).reshape(-1, self.free)

    @cached_property
    def start(self) -> Array:
        """Separations at the start, (members, dim)."""
        return self.members.separations(self.positions)[0]

    @cached_property
    def span(self) -> float:
        """Size of the structure [m]."""
        return float(np.ptp(self.positions, axis=0).max())

    @cached_property
    def force(self) -> float:
        """Size of loads [N]."""
        return float(np.median(self.members.stiffness)) * self.span

    @cached_property
    def pairs(self) -> Indices:
        """Pairs of bars that may meet, (pairs, 2): without a common node, and not in one plane
        from the start, as parallel ones; none where the structure is plane."""
        bars = np.flatnonzero(~self.members.pulls_only)
        ends = self.members.ends
        found = [
            (a, b)
            for a, b in combinations(bars.tolist(), 2)
            if not {*ends[a].tolist()} & {*ends[b].tolist()}
        ]
        if self.positions.shape[1] == 2:
            found = []
        pairs = np.array(found, dtype=np.int64).reshape(-1, 2)
        return pairs[np.abs(self.crossing(self.positions, pairs)[0]) > PLANE]

    def at(self, u: Array) -> Array:
        """Positions, (nodes, dim)."""
        motion = self.motions @ (self.basis @ self.coordinates(u))
        return self.positions + motion.reshape(self.positions.shape)

    def coordinates(self, u: Array) -> Array:
        """Motions of the basis, (free,)."""
        if self.pattern is None:
            return u[:-1]
        return np.concatenate([u[:-2], u[-1:]])

    def crossing(self, x: Array, pairs: Indices | None = None) -> tuple[Array, Flags]:
        """Signed volume over lengths that two bars span, and whether they pass within both."""
        ends = self.members.ends
        pairs = self.pairs if pairs is None else pairs
        if not len(pairs):
            return np.zeros(0), np.zeros(0, dtype=bool)
        a, b = (x[ends[pairs[:, 0], k]] for k in (0, 1))
        c, d = (x[ends[pairs[:, 1], k]] for k in (0, 1))
        first, second, separations = b - a, d - c, c - a
        normal = np.cross(first, second)
        size = np.einsum("ij,ij->i", normal, normal) + 1e-300
        volume = np.einsum("ij,ij->i", separations, normal)
        s = np.einsum("ij,ij->i", np.cross(separations, second), normal) / size
        t = np.einsum("ij,ij->i", np.cross(separations, first), normal) / size
        within = (s > INSIDE) & (s < 1 - INSIDE) & (t > INSIDE) & (t < 1 - INSIDE)
        lengths = np.linalg.norm(first, axis=1) * np.linalg.norm(second, axis=1)
        return volume / (lengths * self.span), within


class Piece:
    """The smooth piece of a path with given strings taut: `branches.many.Equations`.

    Parameters
    ----------
    loading : Loading
    taut : ndarray of bool, (members,)
    corner : ndarray of int
        Strings at their natural length where the piece starts.
    stretch : ndarray, (members,)
        Stretch of the strings there, which is round-off for these.
    """

    def __init__(self, loading: Loading, taut: Flags, corner: Indices, stretch: Array) -> None:
        self.of, self.taut = loading, taut
        self.strings = np.flatnonzero(loading.members.pulls_only)
        self.offset = np.zeros(len(taut))
        self.offset[corner] = stretch[corner]
        self.leaving = np.searchsorted(self.strings, corner)
        loaded = loading.pattern is not None
        names = [f"w{i}" for i in range(loading.free - loaded)]
        self.names = (*names, *(("load", "shortening") if loaded else ("control",)))
        last = [loading.force, loading.span] if loaded else [1.0]
        self.scale = np.array([loading.span] * len(names) + last)
        self.folds = {"fold": -2, "turn": -1} if loaded else {"fold": -1}
        self.volume, _ = loading.crossing(loading.positions)
        roots = [f"string {s}" for s in self.strings.tolist()]
        roots += [f"contact {a} {b}" for a, b in loading.pairs.tolist()]
        self.plate_nodes: list[int] = []
        if loading.plate:
            _, low, up = loading.plate
            others = sorted(set(range(len(loading.positions))) - {*low, *up})
            self.plate_nodes = others
            roots += [f"plate {node} lower" for node in others]
            roots += [f"plate {node} upper" for node in others] if up else []
            roots += ["flat"] if up else []
        self.limits = [k for k in (0, 1) if np.isfinite(loading.limits[k])]
        roots += [("load", "height")[k] for k in self.limits]
        roots += [] if loaded else ["back"]
        self.roots = tuple(roots)

    def natural(self, u: Array) -> Array:
        """Natural lengths of the members [m]."""
        members = self.of.members
        return members.natural if self.of.pattern is not None else (
            members.natural + u[-1] * self.of.change
        )  # fmt: skip

    def separations(self, u: Array) -> tuple[Array, Array]:
        """Separations and lengths."""
        moved = self.of.gain @ self.of.coordinates(u)
        d = self.of.start + moved.reshape(self.of.start.shape)
        return d, np.sqrt(np.einsum("ij,ij->i", d, d))

    def tensions(self, u: Array) -> Array:
        """[N], (members,)."""
        return self._nodal_forces(u, self.separations(u)[1])

    def _nodal_forces(self, u: Array, lengths: Array) -> Array:
        """Tensions at known lengths of the members."""
        scattered_forces = self.of.members.stiffness * (lengths - self.natural(u))
        return np.where(self.taut, scattered_forces, 0.0)

    def stretch(self, u: Array) -> Array:
        """Length over natural length, less 1, (members,)."""
        return self.separations(u)[1] / self.natural(u) - 1

    def linearised(self, u: Array) -> tuple[Array, Array]:
        """Forces left in the motions over their size, and the Jacobian of that."""
        of, members = self.of, self.of.members
        d, lengths = self.separations(u)
        scattered_forces = self._nodal_forces(u, lengths)
        density = scattered_forces / lengths
        along = of.basis.T @ of.along
        left = of.gain.T @ (density[:, None] * d).ravel() - of.weight
        size = np.abs(scattered_forces).max() + ROUND_OFF * float(
            np.max(members.stiffness * lengths)
        )
        stiff = self.tangent_of(d, lengths, density)
        if of.pattern is None:
            rate = np.where(self.taut, -members.stiffness * of.change / lengths, 0.0)
            last = of.gain.T @ (rate[:, None] * d).ravel()
            return left / size, np.column_stack([stiff, last]) / size
        g = left - u[-2] * along
        return g / size, np.column_stack([stiff[:, :-1], -along, stiff[:, -1]]) / size

    def tangent_of(self, d: Array, lengths: Array, density: Array) -> Array:
        """Tangent over the motions of the basis, (free, free)."""
        stiffness = np.where(self.taut, self.of.members.stiffness, 0.0)
        blocks = forces.tangents(d / lengths[:, None], stiffness, density)
        turned = np.matmul(blocks, self.of.gain.reshape(*d.shape, -1))
        return np.asarray(self.of.gain.T @ turned.reshape(self.of.gain.shape))

    def tangent(self, u: Array) -> Array:
        """The same at a point."""
        d, lengths = self.separations(u)
        return self.tangent_of(d, lengths, self._nodal_forces(u, lengths) / lengths)

    def tests(self, u: Array) -> Array:
        """Functions that vanish at events, (roots,)."""
        of = self.of
        x = of.at(u)
        parts = [(self.stretch(u) - self.offset)[self.strings], of.crossing(x)[0]]
        if of.plate:
            normal, low, up = of.plate
            heights = x @ normal
            inner = heights[self.plate_nodes]
            parts.append((inner - heights[low[0]]) / of.span if low else np.ones(len(inner)))
            if up:
                parts.append((heights[up[0]] - inner) / of.span)
                bottom = heights[low[0]] if low else -np.inf
                parts.append(np.array([(heights[up[0]] - bottom) / of.span]))
        ends = (u[-2] - of.limits[0]) / of.force, (u[-1] / of.limits[1]) ** 2 - 1
        parts.append(np.array([ends[k] for k in self.limits]))
        parts.append(np.array([u[-1] - BACK] if of.pattern is None else []))
        return np.concatenate(parts)

    def test_gradient(self, u: Array, number: int) -> Array:
        """Gradient of one test where it vanishes, (m,)."""
        of, strings = self.of, len(self.strings)
        row = np.zeros(len(u))
        if number < strings:
            member = self.strings[number]
            d, lengths = self.separations(u)
            natural, dim = self.natural(u)[member], d.shape[1]
            gain = of.gain[dim * member : dim * (member + 1)]
            self._place(row, (d[member] / lengths[member]) @ gain / natural)
            if of.pattern is None:
                row[-1] = -lengths[member] * of.change[member] / natural**2
            return row
        name, *rest = self.roots[number].split()
        if name == "load":
            row[-2] = 1 / of.force
        elif name == "height":
            row[-1] = 2 * u[-1] / of.limits[1] ** 2
        elif name == "back":
            row[-1] = 1.0
        elif name == "contact":
            self._place(row, self._volume_gradient(of.at(u), *map(int, rest)))
        else:
            normal, low, up = of.plate  # type: ignore[misc]
            rise = np.einsum("i,nif->nf", normal, of.by_node)
            bottom = rise[low[0]] if low else 0.0
            if name == "flat":
                change = rise[up[0]] - bottom
            else:
                node = rise[int(rest[0])]
                change = node - bottom if rest[1] == "lower" else rise[up[0]] - node
            self._place(row, change / of.span)
        return row

    def _place(self, row: Array, by_motion: Array) -> None:
        """Rates by the motions of the basis, at the unknowns that they are."""
        if self.of.pattern is None:
            row[:-1] = by_motion
        else:
            row[:-2], row[-1] = by_motion[:-1], by_motion[-1]

    def _volume_gradient(self, x: Array, one: int, other: int) -> Array:
        """Of the volume that two bars span, over the lengths it is measured by."""
        of, ends = self.of, self.of.members.ends
        (a, b), (c, d) = ends[one], ends[other]
        first, second, separations = x[b] - x[a], x[d] - x[c], x[c] - x[a]
        rows = of.by_node
        change = (
            np.cross(first, second) @ (rows[c] - rows[a])
            + np.cross(second, separations) @ (rows[b] - rows[a])
            + np.cross(separations, first) @ (rows[d] - rows[c])
        )
        size = np.linalg.norm(first) * np.linalg.norm(second) * of.span
        return np.asarray(change / size)
