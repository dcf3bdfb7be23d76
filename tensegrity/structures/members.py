"""The members of a structure as arrays: tensions, energy and tangent stiffness.

The forms are those of `derivations.member`; arrays have one row per member.  A string has tension
where it is longer than its natural length, without any margin.  Its stiffness jumps there, and
would depend on round-off: a string that is shorter by less than the fraction `TAUT` of its natural
length therefore counts as taut, with the stiffness that it has when lengthened.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from tensegrity.engine import forces
from tensegrity.minimum import DENSE, ROUND_OFF
from tensegrity.springs.kinks import TAUT
from tensegrity.structures.laws import Kinks, Laws
from tensegrity.structures.segments import WHOLE, Segments
from tensegrity.typing import Array, Flags, Indices

SETTLED = 1e-10  # unbalanced force of an equilibrium, over the forces of members and loads
NO_LENGTH = 1e-300  # of a spring between nodes at one place, to divide by [m]


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
