"""The equilibrium equations of a structure between kinks: of a fixed set of taut strings.

The unknowns are the motions that the supports permit, without rigid ones, followed by the load
and the conjugate shortening, or by a control from 0 to 1 along which natural lengths change.
Slack strings carry no force; taut ones obey their linear law also in compression, and the branch
ends where the length of a string contradicts its state.  It is the same with bars that buckle and
with kinks of laws: each member keeps the smooth law of one side of its kinks.
"""

from __future__ import annotations

import numpy as np

from tensegrity.structures.loading import Loading
from tensegrity.typing import Array, Flags, Indices

ROUND_OFF = 1e-3  # weight of stiffness times length in the scale of residuals
BACK = -0.01  # control at which a path that has reversed ends


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
        self.kinks, self.winds = kinks, bool(loading.kept.any())
        self.elsewhere = bool(kinks.place.any())  # than at the natural lengths
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
        if self.winds:
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
        lengths, loading = self.lengths(u), self.loading
        tensions, kept = self.pulls(u, lengths)[0], loading.kept
        if not self.winds:
            return tensions
        members = loading.members_at(u[-1])
        density = members.stored(lengths) / members.natural
        return np.where(kept, tensions * lengths / members.natural - density, tensions)

    def separations(self, u: Array) -> tuple[Array, Array]:
        """Separations (..., segments, dim) and lengths (..., segments) of the ends of segments [m]
        at unknowns u (..., m)."""
        start, gain = self.loading.start, self.loading.gain
        moved = u @ gain.reshape(-1, gain.shape[-1]).T
        d = start + moved.reshape(*u.shape[:-1], *start.shape)
        return d, np.sqrt(np.einsum("...j,...j->...", d, d))

    def lengths(self, u: Array) -> Array:
        """Lengths of the members [m], (..., members)."""
        return self.loading.members.segments.over(self.separations(u)[1])

    def tensions(self, u: Array) -> Array:
        """Tensions of the members [N], (..., members)."""
        return self.pulls(u, self.lengths(u))[0]

    def strains(self, u: Array) -> Array:
        """Strains of members beyond their kinks, length over natural length minus 1, less the
        strain at the kink, (kinks,)."""
        return self._strains(u, self.lengths(u))

    def _strains(self, u: Array, lengths: Array) -> Array:
        member, natural = self.kinks.member, self.natural(u)
        strains = (lengths / natural - 1)[member]
        if self.elsewhere:  # members that keep EA keep the strains of their kinks
            over = np.where(self.loading.kept, self.loading.members.natural, natural)
            strains = strains - self.kinks.place / over[member]
        return np.asarray(strains)

    def residual(self, u: Array) -> Array:
        """Unbalanced forces on the motions over their scale, (m - 1,)."""
        (d, parts), members = self.separations(u), self.loading.members
        lengths = members.segments.over(parts)
        tensions = self.pulls(u, lengths)[0]
        force = (members.segments.each(tensions) / parts)[:, None] * d
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
        d, parts = self.separations(u)
        lengths = loading.members.segments.over(parts)
        tensions, stiffness = self.pulls(u, lengths)
        along, stiff = self._tangent(d, parts, tensions, stiffness)
        along, moves = along[:, loading.moves], loading.moves
        g, size = self._scaled_residual(u, tensions @ along, lengths, tensions)
        jacobian = stiff[moves]
        if loading.pattern is None:
            change = loading.change
            if self.winds:  # dT/dl0 = -EA l/l0^2
                change = change * np.where(loading.kept, lengths / self.natural(u), 1.0)
            jacobian[:, -1] = (-stiffness * change) @ along
        else:
            jacobian[:, -2] = -loading.unit
        return g, jacobian / size

    def _tangent(
        self, d: Array, parts: Array, tensions: Array, stiffness: Array
    ) -> tuple[Array, Array]:
        """Elongation of each member with each unknown, (..., members, m), and the tangent stiffness
        over all unknowns, (..., m, m) [N/m]: the sum of k e^T e over members and of
        q (g^T g - e^T e) over segments, of lengths `parts`, with the gains g of their separations,
        e = n g and the force densities q.
        """
        gain, members = self.loading.gain, self.loading.members
        flat = gain.reshape(-1, gain.shape[-1])
        along = (d[..., None, :] @ gain)[..., 0, :] / parts[..., None]
        density = members.segments.each(tensions) / parts
        spread = np.repeat(density, d.shape[-1], axis=-1)
        pulled = (along * (members.segments.alone(stiffness) - density)[..., None]).swapaxes(-1, -2)
        stiff = pulled @ along + (flat.T * spread[..., None, :]) @ flat
        along, cables = members.segments.over(along, -2), members.segments.cables
        if len(cables):
            of_cables = along[..., cables, :]
            k = np.broadcast_to(stiffness, tensions.shape)[..., cables, None]
            stiff = stiff + (k * of_cables).swapaxes(-1, -2) @ of_cables
        return along, stiff

    def tangent(self, u: Array) -> Array:
        """Tangent stiffness over the motions of the basis at unknowns u (..., m) [N/m],
        (..., free, free)."""
        d, parts = self.separations(u)
        whole = self._tangent(d, parts, *self.pulls(u, self.loading.members.segments.over(parts)))[
            1
        ]
        moves = self.loading.moves
        return np.asarray(whole[..., moves[:, None], moves])

    def tests(self, u: Array) -> Array:
        """Event functions, each of which vanishes at its events, (roots,)."""
        loading = self.loading
        d, lengths = self.separations(u)  # bars are members of one segment, and come first
        strains = self._strains(u, loading.members.segments.over(lengths))
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
        d, parts = self.separations(u)
        lengths, natural = loading.members.segments.over(parts), self.natural(u)[member]
        mine = loading.members.segments.of(int(member))
        row = sum((d[s] / parts[s]) @ loading.gain[s] for s in mine) / natural
        if loading.pattern is None:
            beyond = lengths[member] - self.kinks.place[number] * (not loading.kept[member])
            row[-1] = -beyond * loading.change[member] / natural**2
        return np.asarray(row)
