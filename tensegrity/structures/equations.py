"""The equilibrium equations of a structure between kinks: of a fixed set of taut strings.

The unknowns are the motions that the supports permit, without rigid ones, followed by the load
and the conjugate shortening, or by a control from 0 to 1 along which natural lengths change.
Slack strings carry no force; taut ones obey their linear law also in compression, and the branch
ends where the length of a string contradicts its state.  It is the same with bars that buckle and
with kinks of laws: each member keeps the smooth law of one side of its kinks.
"""

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

ROUND_OFF = 1e-3  # weight of stiffness times length in the scale of residuals
BACK = -0.01  # control at which a path that has reversed ends
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
        """Change of each separation with each unknown, (members, dim, free + 1)."""
        i, j = self.members.ends.T
        return np.asarray(self.by_node[j] - self.by_node[i])

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


class SmoothPiece:
    """The equations of a smooth piece of a path, as `branches.many.Equations`.

    Parameters
    ----------
    loading : Loading
    above : ndarray of bool, (kinks,)
        Which kinks the members are above: taut strings are above their natural length.
    critical : ndarray of int
        Kinks at which members are where the piece starts.
    strains : ndarray, (kinks,)
        Strains beyond the kinks there, which for these are round-off.
    """

    def __init__(self, loading: Loading, above: Flags, critical: Indices, strains: Array) -> None:
        self.loading, self.above, self.leaving = loading, above, critical
        members, kinks = loading.members, loading.members.kinks
        self.kinks = kinks
        below = kinks.member[~above & (kinks.kind < 2)]
        part = np.ones(len(members.natural))
        part[below] = np.broadcast_to(members.plateau, part.shape)[below]
        self.stiffness = part * members.stiffness
        self.constant: Array | None = None
        if members.least is not None:  # of buckled bars [N]
            givers, self.constant = kinks.member[~above & (kinks.kind == 1)], np.zeros(len(part))
            self.constant[givers] = ((1 - part) * members.stiffness * members.least)[givers]
        if members.laws:
            self.ends_of_laws = members.laws.between(kinks, above)
            self.loose = np.isin(members.laws.member, kinks.member[~above & (kinks.kind == 0)])
        self.offset = np.zeros(len(above))
        self.offset[critical] = strains[critical]
        loaded = loading.pattern is not None
        names = [f"w{i}" for i in range(loading.free - loaded)]
        self.unknowns = (*names, *(("load", "shortening") if loaded else ("control",)))
        last = [loading.force, loading.span] if loaded else [1.0]
        self.scale = np.array([loading.span] * len(names) + last)
        self.folds = {"fold": -2, "turn": -1} if loaded else {"fold": -1}
        self.roots = loading.roots

    def natural(self, u: Array) -> Array:
        """Natural lengths of the members [m], (..., members)."""
        loading = self.loading
        if loading.pattern is not None:
            return loading.members.natural
        return loading.natural(u[..., -1:])

    def pulls(self, u: Array, lengths: Array) -> tuple[Array, Array]:
        """Tensions [N] and stiffnesses [N/m] of the members at lengths [m], (..., members) each."""
        loading, natural, stiffness = self.loading, self.natural(u), self.stiffness
        if loading.kept.any():
            stiffness = stiffness * np.where(loading.kept, loading.members.natural / natural, 1.0)
        tensions = stiffness * (lengths - natural)
        if self.constant is not None:
            tensions = tensions + self.constant
        if laws := loading.members.laws:
            values = laws.values(lengths - natural, *self.ends_of_laws)[1:]
            tensions, stiffness = tensions.copy(), np.broadcast_to(stiffness, lengths.shape).copy()
            for of, value in zip((tensions, stiffness), values, strict=True):
                of[..., laws.member] = np.where(self.loose, 0.0, value)
        return tensions, stiffness

    def winding(self, u: Array) -> Array:
        """Energy gained by each member per natural length that is wound up, at unknowns u (m,)
        and constant length [N], (members,): T, and T + T^2/(2 EA) where EA is kept."""
        lengths, loading = self.separations(u)[1], self.loading
        tensions, kept = self.pulls(u, lengths)[0], loading.kept
        if not kept.any():
            return tensions
        members = loading.members_at(u[-1])
        density = members.stored(lengths) / members.natural
        return np.where(kept, tensions * lengths / members.natural - density, tensions)

    def separations(self, u: Array) -> tuple[Array, Array]:
        """Separations (..., members, dim) and lengths (..., members) of the ends of members [m] at
        unknowns u (..., m)."""
        start, gain = self.loading.start, self.loading.gain
        moved = u @ gain.reshape(-1, gain.shape[-1]).T
        d = start + moved.reshape(*u.shape[:-1], *start.shape)
        return d, np.sqrt(np.einsum("...j,...j->...", d, d))

    def tensions(self, u: Array) -> Array:
        """Tensions of the members [N], (..., members)."""
        return self.pulls(u, self.separations(u)[1])[0]

    def strains(self, u: Array) -> Array:
        """Strains of members beyond their kinks, length over natural length minus 1, less the
        strain at the kink, (kinks,)."""
        return self._strains(u, self.separations(u)[1])

    def _strains(self, u: Array, lengths: Array) -> Array:
        member, natural = self.kinks.member, self.natural(u)
        places = self.kinks.place / self._over(natural)[member]
        return np.asarray((lengths / natural - 1)[member] - places)

    def _over(self, natural: Array) -> Array:
        """Lengths over which kinks are strains [m]: members that keep EA keep those strains."""
        return np.where(self.loading.kept, self.loading.members.natural, natural)

    def residual(self, u: Array) -> Array:
        """Unbalanced forces on the motions over their scale, (m - 1,)."""
        d, lengths = self.separations(u)
        tensions = self.pulls(u, lengths)[0]
        force = (tensions / lengths)[:, None] * d
        gain = self.loading.gain.reshape(force.size, -1)
        return self._scaled_residual(
            u, (force.ravel() @ gain)[self.loading.moves], lengths, tensions
        )[0]

    def _scaled_residual(
        self, u: Array, pulled: Array, lengths: Array, tensions: Array
    ) -> tuple[Array, float]:
        """The residual from forces of members on the motions, and its scale [N]."""
        loading = self.loading
        left = pulled - loading.weight
        if loading.pattern is not None:
            left = left - u[-2] * loading.unit
        stiffest = float((loading.members.stiffness * lengths).max())
        size = float(np.abs(tensions).max()) + ROUND_OFF * stiffest
        return left / size, size

    def linearised(self, u: Array) -> tuple[Array, Array]:
        """Unbalanced forces on the motions over their scale, and the Jacobian of this residual."""
        loading = self.loading
        d, lengths = self.separations(u)
        tensions, stiffness = self.pulls(u, lengths)
        along, stiff = self._tangent(d, lengths, tensions, stiffness)
        along, moves = along[:, loading.moves], loading.moves
        g, size = self._scaled_residual(u, tensions @ along, lengths, tensions)
        jacobian = stiff[moves]
        if loading.pattern is None:
            change = loading.change
            if loading.kept.any():  # dT/dl0 = -EA l/l0^2
                change = change * np.where(loading.kept, lengths / self.natural(u), 1.0)
            jacobian[:, -1] = (-stiffness * change) @ along
        else:
            jacobian[:, -2] = -loading.unit
        return g, jacobian / size

    def _tangent(
        self, d: Array, lengths: Array, tensions: Array, stiffness: Array
    ) -> tuple[Array, Array]:
        """Elongation of each member with each unknown, (..., members, m), and the tangent stiffness
        over all unknowns, (..., m, m) [N/m]: the sum of k e^T e + q (g^T g - e^T e) over members,
        with the gains g of their separations, e = n g and the force densities q.
        """
        gain = self.loading.gain
        flat = gain.reshape(-1, gain.shape[-1])
        along = (d[..., None, :] @ gain)[..., 0, :] / lengths[..., None]
        density = tensions / lengths
        spread = np.repeat(density, d.shape[-1], axis=-1)
        pulled = (along * (stiffness - density)[..., None]).swapaxes(-1, -2)
        return along, pulled @ along + (flat.T * spread[..., None, :]) @ flat

    def tangent(self, u: Array) -> Array:
        """Tangent stiffness over the motions of the basis at unknowns u (..., m) [N/m],
        (..., free, free)."""
        d, lengths = self.separations(u)
        whole = self._tangent(d, lengths, *self.pulls(u, lengths))[1]
        moves = self.loading.moves
        return np.asarray(whole[..., moves[:, None], moves])

    def tests(self, u: Array) -> Array:
        """Event functions, each of which vanishes at its events, (roots,)."""
        loading = self.loading
        d, lengths = self.separations(u)
        strains = self._strains(u, lengths)
        _, start, rows = loading.at_plates
        plates = start + rows @ u
        parts = [strains - self.offset, loading.volumes(u, d, lengths), plates]
        most, farthest = loading.limits
        ends = [(u[-2] - most) / loading.force] if np.isfinite(most) else []
        ends += [(u[-1] / farthest) ** 2 - 1] if np.isfinite(farthest) else []
        return np.concatenate([*parts, ends, [u[-1] - BACK] if loading.pattern is None else []])

    def strain_gradient(self, u: Array, number: int) -> Array:
        """Gradient of the strain beyond a kink, (m,)."""
        loading, member = self.loading, self.kinks.member[number]
        d, lengths = self.separations(u)
        natural = self.natural(u)[member]
        row = (d[member] / lengths[member]) @ loading.gain[member] / natural
        if loading.pattern is None:
            beyond = lengths[member] - self.kinks.place[number] * (not loading.kept[member])
            row[-1] = -beyond * loading.change[member] / natural**2
        return np.asarray(row)
