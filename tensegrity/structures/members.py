"""The members of a structure as arrays: tensions, energy, tangent stiffness and equilibria.

The forms are those of `derivations.member`; arrays have one row per member.  A string has tension
where it is longer than its natural length, without any margin.  Its stiffness jumps there, and
would depend on round-off: a string that is shorter by less than the fraction `TAUT` of its natural
length therefore counts as taut, with the stiffness that it has when lengthened.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from tensegrity.engine import forces
from tensegrity.errors import EquilibriumError
from tensegrity.minimum import DENSE, ROUND_OFF, STEPS, downhill, refuse_unbalanced
from tensegrity.minimum import settle as minimised
from tensegrity.springs.kinks import TAUT
from tensegrity.structures.laws import Kinks, Laws
from tensegrity.structures.segments import WHOLE, Segments
from tensegrity.structures.supports import Freedom
from tensegrity.typing import Array, Flags, Indices

SETTLED = 1e-10  # unbalanced force of an equilibrium, over the forces of members and loads
NO_LENGTH = 1e-300  # of a spring between nodes at one place, to divide by [m]
QUICK = (
    400  # steps that are tried first where strings are slack: they stay on the side of the start
)
SOFTER = 3.0  # largest stiffness times natural length, over the loads, of softer members
TOGETHER = 1e-6  # of the size of the structure: length of a cable's segment that counts as 0
STEP, FARTHEST = 0.2, 100.0  # largest step and largest size, over the structure's own size


@dataclass(frozen=True)
class Members:
    """Members as arrays.

    Attributes
    ----------
    shape : tuple of int
        (nodes, dim).
    ends : ndarray of int, (segments, 2)
        One segment for each member, unless `segments` says otherwise.
    stiffness, natural : ndarray, (members,)
        Spring constants [N/m] and natural lengths [m].
    tension_only : ndarray of bool, (members,)
        Which members are strings.
    shift : ndarray, (segments, dim), or 0
        From each second end to its image that the member is joined to [m], in lattices.
    least : ndarray, (members,), or None
        Elongations at which members give way [m], where bars do: at 0 strings slacken, at
        -load/stiffness bars buckle.
    plateau : ndarray, (members,), or 0
        Stiffness beyond, over that before; 0 for strings.
    laws : Laws, optional
        Of the members whose tension is not proportional to their elongation.
    segments : Segments, optional
        Where cables run over nodes; lengths and tensions are those of whole members.
    """

    shape: tuple[int, ...]
    ends: Indices
    stiffness: Array
    natural: Array
    tension_only: Flags
    shift: Array | float = 0.0
    least: Array | None = None
    plateau: Array | float = 0.0
    laws: Laws | None = None
    segments: Segments = WHOLE

    def separations(self, positions: Array) -> tuple[Array, Array]:
        """Vectors (segments, dim) from first to second ends, and their lengths."""
        first, second = positions.take(self.ends.T, axis=0)
        d = second - first + self.shift
        return d, np.maximum(np.sqrt(np.einsum("ij,ij->i", d, d)), NO_LENGTH)

    def reach(self, positions: Array) -> float:
        """The largest coordinate or length [m], which round-off of the lengths is relative to."""
        return float(max(np.abs(positions).max(), self.separations(positions)[1].max()))

    def unbalanced(self, positions: Array, size: float) -> float:
        """Forces left over in an equilibrium of forces up to `size` [N]: small ones, or the
        round-off of the lengths times the stiffness."""
        return max(SETTLED * size, ROUND_OFF * float(self.stiffness.max()) * self.reach(positions))

    def taut(self, lengths: Array, within: float = TAUT) -> Flags:
        """Which members contribute stiffness, (members,): bars, and strings shorter than their
        natural length by at most a fraction `within` of it.  Bars that buckle do so up to the
        elongation at which they give way, with the same margin."""
        if self.least is not None:
            return lengths - self.natural >= self.least - within * self.natural
        return ~self.tension_only | (lengths >= (1 - within) * self.natural)

    def elongations(self, lengths: Array) -> Array:
        """Tensions over stiffnesses [m], (members,): elongations, but 0 for strings not longer
        than their natural length, and less than shortenings for bars that buckle."""
        if self.least is not None:
            elongations = lengths - self.natural
            return np.maximum(elongations, self.least + self.plateau * (elongations - self.least))
        return np.maximum(lengths - self.natural, self._smallest)

    @cached_property
    def _smallest(self) -> Array:
        """Of members that cannot buckle, the smallest elongations with tension, (members,)."""
        return np.where(self.tension_only, 0.0, -np.inf)

    def tensions(self, positions: Array) -> Array:
        """Tensions [N], (members,); 0 for slack strings."""
        return self.pulls(self.segments.over(self.separations(positions)[1]))

    def pulls(self, lengths: Array) -> Array:
        """Tensions [N] at lengths [m], (members,) each."""
        tensions: Array = self.stiffness * self.elongations(lengths)
        if self.laws:
            tensions[self.laws.member] = self._of_laws(lengths)[1]
        return tensions

    def _of_laws(self, lengths: Array) -> tuple[Array, Array, Array]:
        """Energies, tensions and stiffnesses of the members with laws: 0 for slack strings, but
        for the stiffness, which is that of taut ones."""
        laws: Any = self.laws
        elongations = lengths - self.natural
        energy, tension, stiffness = laws.values(elongations, *laws.domain)
        loose = (self.tension_only & (elongations <= 0))[laws.member]
        return np.where(loose, 0.0, energy), np.where(loose, 0.0, tension), stiffness

    @cached_property
    def kinks(self) -> Kinks:
        """Where the stiffness of a member jumps."""
        return Kinks.of(self.tension_only, self.least, self.laws)

    @property
    def linear(self) -> bool:
        """Whether tensions are proportional to elongations, but for slack strings."""
        return self.least is None and self.laws is None and not len(self.segments.cables)

    def energy(self, positions: Array) -> float:
        """Elastic energy of all members [J]."""
        return float(np.sum(self.stored(self.segments.over(self.separations(positions)[1]))))

    def stored(self, lengths: Array) -> Array:
        """Elastic energies at lengths [m], (members,) each [J]."""
        if self.least is None:
            each = 0.5 * (self.stiffness * self.elongations(lengths) ** 2)
        else:
            elongations = lengths - self.natural
            past = np.minimum(elongations - self.least, 0.0)
            before = 0.5 * (elongations - past) ** 2
            each = self.stiffness * (before + self.least * past + 0.5 * self.plateau * past**2)
        if self.laws:
            each[self.laws.member] = self._of_laws(lengths)[0]
        return np.asarray(each)

    def gradient(self, positions: Array) -> Array:
        """Gradient of the energy in the positions [N], (nodes, dim): minus the nodal forces."""
        d, lengths = self.separations(positions)
        force = (self.segments.each(self.pulls(self.segments.over(lengths))) / lengths)[:, None] * d
        first, second = self.ends.T
        result: Array = -forces.scattered(first, second, force, len(positions))
        return result

    def blocks(
        self, positions: Array, within: float = TAUT, tensions: Array | None = None
    ) -> Array:
        """Tangent stiffness of each segment, of cables over nodes by their tension alone; see
        `tangent`.

        Parameters
        ----------
        positions : ndarray, (nodes, dim)
            [m]
        within : float, optional
            As of `taut`.
        tensions : ndarray, (members,), optional
            Where they are not those of the elongations [N].

        Returns
        -------
        ndarray, (segments, dim, dim)
            [N/m]
        """
        d, lengths = self.separations(positions)
        stiffness, tensions = self._stiffness_and_pulls(
            self.segments.over(lengths), within, tensions
        )
        density = self.segments.each(tensions) / lengths
        return np.asarray(
            forces.tangents(d / lengths[:, None], self.segments.alone(stiffness), density)
        )

    def _stiffness_and_pulls(
        self, lengths: Array, within: float, tensions: Array | None
    ) -> tuple[Array, Array]:
        """Stiffnesses [N/m] and tensions [N] of members, (members,) each; as of `blocks`."""
        if tensions is None:
            taut, tensions = self.taut(lengths, within), self.pulls(lengths)
        else:
            taut = ~self.tension_only | (tensions > 0)
        stiffness = np.where(taut, 1.0, self.plateau) * self.stiffness
        if self.laws:
            mine = self.laws.member
            stiffness[mine] = np.where(taut[mine], self._of_laws(lengths)[2], 0.0)
        return stiffness, tensions

    def tangent(self, positions: Array, within: float = TAUT, tensions: Array | None = None) -> Any:
        """Hessian of the energy.

        Parameters
        ----------
        positions : ndarray, (nodes, dim)
            [m]
        within : float, optional
            As for `taut`.
        tensions : ndarray, (members,), optional
            Tensions [N] in place of those at the positions; strings with tension are taut.

        Returns
        -------
        ndarray, or sparse array of more than `DENSE` rows, (nodes dim, nodes dim)
            [N/m]
        """
        (sign, row, column), size = self._entries, positions.size
        values = (sign * self.blocks(positions, within, tensions).ravel()).ravel()
        whole: Any
        if size <= DENSE:
            whole = np.bincount(row * size + column, values, size**2).reshape(size, size)
        else:
            from scipy.sparse import coo_array

            whole = coo_array((values, (row, column)), shape=(size, size)).tocsr()
        if len(self.segments.cables):
            d, lengths = self.separations(positions)
            along, whole_lengths = d / lengths[:, None], self.segments.over(lengths)
            stiffness, _ = self._stiffness_and_pulls(whole_lengths, within, tensions)
            more = self.segments.lengthwise(along, self.ends, stiffness, size)
            return whole + (more.toarray() if size <= DENSE else more)
        return whole

    @cached_property
    def _entries(self) -> tuple[Array, Indices, Indices]:
        """Signs (4, 1), rows and columns of the numbers that the tangent sums; each quarter of
        them are the numbers of the blocks."""
        nodes, dim = self.shape
        ones = np.ones((len(self.ends), dim, dim))
        first, second = self.ends.T
        all_of = forces.assembled(first, second, forces.of_both_ends(ones), nodes)
        return all_of.data.reshape(4, -1)[:, :1], *all_of.coords


@dataclass
class _LoadedMembers:
    """Members under constant loads, over the permitted motions: a `minimum.Energy`."""

    members: Members
    freedom: Freedom
    start: Array
    loads: Array

    @property
    def span(self) -> float:
        """Size of the structure [m]."""
        return float(np.ptp(self.start, axis=0).max())

    @property
    def longest(self) -> float:
        return STEP * self.span

    def freedom_at(self, x: Array) -> Freedom:
        """The permitted motions; only those on which the loads do no work count as rigid.

        None does if there is none at the start: a cable that is straight between its ends may turn
        about them once it hangs.
        """
        return self.freedom.at(x).under(self.loads) if self.freedom.rigid.size else self.freedom

    def energy(self, x: Array) -> tuple[float, float]:
        stored, work = self.members.energy(x), float(np.sum(self.loads * (x - self.start)))
        pull = np.abs(self.members.tensions(x)).sum() + np.abs(self.loads).sum()
        return stored - work, float(pull * self.members.reach(x))

    def forces(self, x: Array) -> Array:
        motions, rigid = self.freedom.motions, self.freedom_at(x).rigid
        left = motions.T @ (self.loads - self.members.gradient(x)).ravel()
        return np.asarray(motions @ (left - rigid @ (rigid.T @ left))).reshape(x.shape)

    def largest(self, x: Array) -> float:
        return float(max(np.abs(self.members.tensions(x)).max(), np.abs(self.loads).max()))

    def allowed(self, x: Array) -> float:
        return self.members.unbalanced(x, self.largest(x))

    def newton(self, x: Array, f: Array) -> Callable[[float], Array | None]:
        # the margin makes the first step frame-independent; later it would slow convergence down
        within = TAUT if x is self.start else 0.0
        return self.newton_with(self.members.tangent(x, within), x, f)

    def newton_with(self, tangent: Any, x: Array, f: Array) -> Callable[[float], Array | None]:
        """As `newton`, with a given tangent (nodes dim, nodes dim) [N/m]."""
        from scipy.sparse import eye_array

        freedom = self.freedom_at(x)
        force = freedom.motions.T @ f.ravel()
        tangent = freedom.reduced(tangent)
        softest = float(self.members.stiffness.min()) * eye_array(len(force))

        def step(shift: float) -> Array | None:
            move = downhill(tangent + shift * softest, freedom.rigid, force)
            return None if move is None else (freedom.motions @ move).reshape(x.shape)

        return step

    def refuse(self, x: Array, f: Array) -> None:
        members = self.members
        if len(members.segments.cables):
            lengths = members.separations(x)[1]
            members.segments.refuse_together(lengths, members.ends, TOGETHER * self.span)
        if np.ptp(x, axis=0).max() > FARTHEST * self.span:
            raise EquilibriumError(
                "no equilibrium: under these loads the structure grows beyond "
                f"{FARTHEST * self.span:g} m"
            )


@dataclass
class _StiffMembers(_LoadedMembers):
    """The same for Newton's method in positions and tensions, for members that hardly stretch.

    Each step predicts the tensions after it, from the elongations to first order, and the next
    tangent contains these instead of those at the positions, which are k times an error of the
    lengths.  The energy rises in between, and no step is refused.
    """

    tensions: Array

    @classmethod
    def settled(cls, of: _LoadedMembers) -> Array:
        """The positions of a stable equilibrium, from that of softer members.

        Raises
        ------
        EquilibriumError
            If it is not found, or is not stable.
        """
        members = of.members
        softer = SOFTER * np.linalg.norm(of.loads, axis=1).sum() / members.natural
        soft = replace(members, stiffness=np.minimum(members.stiffness, softer))
        x, _ = minimised(replace(of, members=soft), of.start)
        x, f = minimised(cls(members, of.freedom, of.start, of.loads, soft.tensions(x)), x)
        refuse_unbalanced(of, x, f)
        if of.newton(x, f)(0.0) is None:
            raise EquilibriumError("no equilibrium found: that of softer members is not stable")
        return x

    def energy(self, x: Array) -> tuple[float, float]:
        return 0.0, 0.0

    def newton(self, x: Array, f: Array) -> Callable[[float], Array | None]:
        members, (first, second) = self.members, self.members.ends.T
        d, lengths = members.separations(x)
        along, over = d / lengths[:, None], members.stiffness * (lengths - members.natural)
        strings = members.tension_only
        pull = np.where(strings & (self.tensions <= 0), 0.0, over)[:, None] * along
        left = self.loads + forces.scattered(first, second, pull, len(x))
        newton = self.newton_with(members.tangent(x, tensions=self.tensions), x, left)

        def step(shift: float) -> Array | None:
            move = newton(shift)
            if move is not None:
                longer = np.einsum("ij,ij->i", along, move[second] - move[first])
                linear = over + members.stiffness * longer
                self.tensions = np.where(strings, np.maximum(linear, 0.0), linear)
            return move

        return step


def equilibrium_positions(
    members: Members, freedom: Freedom, positions: Array, loads: Array
) -> Array:
    """Equilibrium positions under constant loads, by minimising the energy from given positions.

    Parameters
    ----------
    members : Members
    freedom : Freedom
        The permitted motions.
    positions : ndarray, (nodes, dim)
        Initial positions [m].
    loads : ndarray, (nodes, dim)
        Forces on the nodes [N].

    Returns
    -------
    ndarray, (nodes, dim)
        Positions [m].

    Raises
    ------
    EquilibriumError
        If there is no equilibrium nearby: the loads do work on a rigid motion, or the energy has
        no lower bound.
    """
    freedom.refuse_unbalanced(positions, loads)
    of = _LoadedMembers(members, freedom, positions, loads)
    loose = members.tension_only & (members.tensions(positions) <= 0)
    x, f = minimised(of, positions, QUICK if loose.any() and loads.any() else STEPS)
    try:
        refuse_unbalanced(of, x, f)
    except EquilibriumError:
        if not (loads.any() and members.linear):
            raise
        with suppress(EquilibriumError):
            return _StiffMembers.settled(of)
        x, f = minimised(of, x)
        refuse_unbalanced(of, x, f)
    return x
