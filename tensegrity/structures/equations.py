"""The equilibrium equations of a structure with a fixed set of taut strings.

The unknowns are the motions that the supports permit, without rigid ones, followed by the load
and the conjugate shortening, or by a control from 0 to 1 along which natural lengths change.
Slack strings carry no force; taut ones obey their linear law also in compression, and the branch
ends where the length of a string contradicts its state.
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

ROUND_OFF = 1e-3  # weight of stiffness times length in the scale of residuals
BACK = -0.01  # control at which a path that has reversed ends
INSIDE = 1e-9  # fraction of a bar next to its ends within which it is not crossed
PLANE = 1e-9  # volume over lengths below which two bars are coplanar


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
    def weight(self) -> Array:
        """Work of the constant loads on each motion of the basis, (free,)."""
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
        """Scale of loads [N]."""
        return float(np.median(self.members.stiffness)) * self.span

    @cached_property
    def pairs(self) -> Indices:
        """Pairs of bars that may come into contact, (pairs, 2): without a common node, and not
        coplanar at the start; none if the structure is planar."""
        bars = np.flatnonzero(~self.members.tension_only)
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

    def positions_at(self, u: Array) -> Array:
        """Positions at unknowns u [m], (nodes, dim)."""
        motion = self.motions @ (self.basis @ self.coordinates(u))
        return self.positions + motion.reshape(self.positions.shape)

    def coordinates(self, u: Array) -> Array:
        """Coefficients of the motions of the basis, (free,)."""
        if self.pattern is None:
            return u[:-1]
        return np.concatenate([u[:-2], u[-1:]])

    def crossing(self, x: Array, pairs: Indices | None = None) -> tuple[Array, Flags]:
        """Signed volume spanned by pairs of bars over the product of lengths and the size, and
        whether the common perpendicular meets both bars between their ends; (pairs,) each."""
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


class SmoothPiece:
    """The equations of a smooth piece of a path, as `branches.many.Equations`.

    Parameters
    ----------
    loading : Loading
    taut : ndarray of bool, (members,)
        Which members are taut; bars always are.
    critical : ndarray of int
        Strings at their natural length where the piece starts.
    strains : ndarray, (members,)
        Strains there, which for these strings are round-off.
    """

    def __init__(self, loading: Loading, taut: Flags, critical: Indices, strains: Array) -> None:
        self.loading, self.taut = loading, taut
        self.strings = np.flatnonzero(loading.members.tension_only)
        self.offset = np.zeros(len(taut))
        self.offset[critical] = strains[critical]
        self.leaving = np.searchsorted(self.strings, critical)
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
        members = self.loading.members
        return members.natural if self.loading.pattern is not None else (
            members.natural + u[-1] * self.loading.change
        )  # fmt: skip

    def separations(self, u: Array) -> tuple[Array, Array]:
        """Separations (members, dim) and lengths (members,) of the ends of members [m]."""
        moved = self.loading.gain @ self.loading.coordinates(u)
        d = self.loading.start + moved.reshape(self.loading.start.shape)
        return d, np.sqrt(np.einsum("ij,ij->i", d, d))

    def tensions(self, u: Array) -> Array:
        """Tensions of the members [N], (members,)."""
        return self._tensions_at(u, self.separations(u)[1])

    def _tensions_at(self, u: Array, lengths: Array) -> Array:
        """Tensions at given lengths of the members [N], (members,)."""
        tensions = self.loading.members.stiffness * (lengths - self.natural(u))
        return np.where(self.taut, tensions, 0.0)

    def strains(self, u: Array) -> Array:
        """Strains of the members, length over natural length minus 1, (members,)."""
        return self.separations(u)[1] / self.natural(u) - 1

    def linearised(self, u: Array) -> tuple[Array, Array]:
        """Unbalanced forces on the motions over their scale, and the Jacobian of this residual."""
        loading, members = self.loading, self.loading.members
        d, lengths = self.separations(u)
        tensions = self._tensions_at(u, lengths)
        density = tensions / lengths
        along = loading.basis.T @ loading.along
        left = loading.gain.T @ (density[:, None] * d).ravel() - loading.weight
        size = np.abs(tensions).max() + ROUND_OFF * float(np.max(members.stiffness * lengths))
        stiff = self.tangent_of(d, lengths, density)
        if loading.pattern is None:
            rate = np.where(self.taut, -members.stiffness * loading.change / lengths, 0.0)
            last = loading.gain.T @ (rate[:, None] * d).ravel()
            return left / size, np.column_stack([stiff, last]) / size
        g = left - u[-2] * along
        return g / size, np.column_stack([stiff[:, :-1], -along, stiff[:, -1]]) / size

    def tangent_of(self, d: Array, lengths: Array, density: Array) -> Array:
        """Tangent stiffness over the motions of the basis.

        Parameters
        ----------
        d : ndarray, (members, dim)
            Separations of the ends of members [m].
        lengths, density : ndarray, (members,)
            Lengths [m] and force densities, tension over length [N/m].

        Returns
        -------
        ndarray, (free, free)
            [N/m].
        """
        stiffness = np.where(self.taut, self.loading.members.stiffness, 0.0)
        blocks = forces.tangents(d / lengths[:, None], stiffness, density)
        turned = np.matmul(blocks, self.loading.gain.reshape(*d.shape, -1))
        return np.asarray(self.loading.gain.T @ turned.reshape(self.loading.gain.shape))

    def tangent(self, u: Array) -> Array:
        """Tangent stiffness over the motions of the basis at unknowns u, (free, free)."""
        d, lengths = self.separations(u)
        return self.tangent_of(d, lengths, self._tensions_at(u, lengths) / lengths)

    def tests(self, u: Array) -> Array:
        """Event functions, each of which vanishes at its events, (roots,)."""
        loading = self.loading
        x = loading.positions_at(u)
        parts = [(self.strains(u) - self.offset)[self.strings], loading.crossing(x)[0]]
        if loading.plate:
            normal, low, up = loading.plate
            heights = x @ normal
            inner = heights[self.plate_nodes]
            parts.append((inner - heights[low[0]]) / loading.span if low else np.ones(len(inner)))
            if up:
                parts.append((heights[up[0]] - inner) / loading.span)
                bottom = heights[low[0]] if low else -np.inf
                parts.append(np.array([(heights[up[0]] - bottom) / loading.span]))
        ends = (u[-2] - loading.limits[0]) / loading.force, (u[-1] / loading.limits[1]) ** 2 - 1
        parts.append(np.array([ends[k] for k in self.limits]))
        parts.append(np.array([u[-1] - BACK] if loading.pattern is None else []))
        return np.concatenate(parts)

    def test_gradient(self, u: Array, number: int) -> Array:
        """Gradient of one event function where it vanishes, (m,)."""
        loading, strings = self.loading, len(self.strings)
        row = np.zeros(len(u))
        if number < strings:
            member = self.strings[number]
            d, lengths = self.separations(u)
            natural, dim = self.natural(u)[member], d.shape[1]
            gain = loading.gain[dim * member : dim * (member + 1)]
            self._place(row, (d[member] / lengths[member]) @ gain / natural)
            if loading.pattern is None:
                row[-1] = -lengths[member] * loading.change[member] / natural**2
            return row
        name, *rest = self.roots[number].split()
        if name == "load":
            row[-2] = 1 / loading.force
        elif name == "height":
            row[-1] = 2 * u[-1] / loading.limits[1] ** 2
        elif name == "back":
            row[-1] = 1.0
        elif name == "contact":
            self._place(row, self._volume_gradient(loading.positions_at(u), *map(int, rest)))
        else:
            normal, low, up = loading.plate  # type: ignore[misc]
            rise = np.einsum("i,nif->nf", normal, loading.by_node)
            bottom = rise[low[0]] if low else 0.0
            if name == "flat":
                change = rise[up[0]] - bottom
            else:
                node = rise[int(rest[0])]
                change = node - bottom if rest[1] == "lower" else rise[up[0]] - node
            self._place(row, change / loading.span)
        return row

    def _place(self, row: Array, by_motion: Array) -> None:
        """Write derivatives in the motions of the basis to their places in a row."""
        if self.loading.pattern is None:
            row[:-1] = by_motion
        else:
            row[:-2], row[-1] = by_motion[:-1], by_motion[-1]

    def _volume_gradient(self, x: Array, one: int, other: int) -> Array:
        """Gradient of the scaled volume of `Loading.crossing` in these motions, (free,)."""
        loading, ends = self.loading, self.loading.members.ends
        (a, b), (c, d) = ends[one], ends[other]
        first, second, separations = x[b] - x[a], x[d] - x[c], x[c] - x[a]
        rows = loading.by_node
        change = (
            np.cross(first, second) @ (rows[c] - rows[a])
            + np.cross(second, separations) @ (rows[b] - rows[a])
            + np.cross(separations, first) @ (rows[d] - rows[c])
        )
        size = np.linalg.norm(first) * np.linalg.norm(second) * loading.span
        return np.asarray(change / size)
