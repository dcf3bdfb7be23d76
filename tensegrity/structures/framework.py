"""What finite structures and periodic lattices have in common: nodes, members, prestress.

Nodes are joined by straight bars and strings; a member may lead to the image of a node in another
cell, at a constant shift.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.engine.inertia import mass_matrix
from tensegrity.errors import TensegrityError
from tensegrity.readonly import ReadOnly, fixed
from tensegrity.structures import statics
from tensegrity.structures.members import NO_LENGTH, Members, positive_for_each
from tensegrity.structures.statics import SelfStress
from tensegrity.typing import Array, Flags, Indices


class Framework(ReadOnly):
    """Nodes joined by bars and strings; see `Structure` and `Lattice`."""

    positions: Array
    ends: Indices
    is_string: Flags
    stiffnesses: Array
    natural_lengths: Array
    mass: Array
    member_mass: Array
    shift: Array | float  # from the second end of each member to its image [m]
    _may_coincide = False  # whether springs of natural length 0 join nodes at one place

    def _set_positions(self, positions: ArrayLike) -> None:
        places = check.floats("positions", positions)
        if places.ndim != 2 or places.shape[1] not in (2, 3) or not len(places):
            raise TensegrityError(f"positions have shape {places.shape}, must be (nodes, 2) or 3")
        self.positions = check.vector("positions", places, places.shape)

    def _set_members(
        self,
        pairs: Sequence[Indices],
        k_bar: ArrayLike,
        k_string: ArrayLike,
        natural_lengths: ArrayLike | None,
        size: float,
    ) -> None:
        """Set the members, checked; `pairs` are the ends of bars and of strings."""
        self.ends = np.concatenate(pairs)
        self.is_string = np.arange(len(self.ends)) >= len(pairs[0])
        if not len(self.ends):
            raise TensegrityError("0 bars and strings, must be at least 1")
        alone = sorted(set(range(self.nodes)) - set(self.ends.ravel().tolist()))
        if alone:
            raise TensegrityError(f"node {alone[0]} is in no member")
        self.stiffnesses = np.concatenate(
            [
                positive_for_each("k_bar", k_bar, len(pairs[0]), "N/m"),
                positive_for_each("k_string", k_string, len(pairs[1]), "N/m"),
            ]
        )
        lengths = natural = self.lengths
        long_enough = lengths > 1e-12 * size
        if natural_lengths is not None:
            count, zero = len(lengths), self._may_coincide
            natural = positive_for_each("natural length", natural_lengths, count, "m", zero)
            long_enough |= (natural == 0) & (lengths == 0)
        bad = np.flatnonzero(~(long_enough & (lengths < np.inf)))
        if bad.size:
            i, j = self.ends[bad[0]].tolist()
            apart = "place nodes apart along the axis of their motion"
            hint = "a spring at one place has natural length 0" if self._may_coincide else apart
            raise TensegrityError(
                f"{self.name_of(int(bad[0]))} between nodes {i} and {j} has length "
                f"{lengths[bad[0]]:g} m, must be above 0 and finite: {hint}"
            )
        self.natural_lengths = natural

    def _set_masses(self, mass: Any, bar_mass: Any, string_mass: Any) -> None:
        """Set the masses of nodes and members, checked."""
        each = [
            positive_for_each(name, 0.0 if given is None else given, count, "kg", zero=True)
            for name, given, count in (
                ("bar_mass", bar_mass, self.bars), ("string_mass", string_mass, self.strings)
            )
        ]  # fmt: skip
        self.member_mass = np.concatenate(each)
        if mass is None:
            mass = 0.0 if self.has_heavy_members else 1.0
        self.mass = positive_for_each("mass", mass, self.nodes, "kg", zero=self.has_heavy_members)

    def _refuse_massless(self, moving: ArrayLike) -> None:
        """Refuse nodes without mass among those that move."""
        moving = np.asarray(moving)
        bare = moving[self.weighing_mass[moving] == 0]
        if bare.size:
            raise TensegrityError(
                f"node {bare[0]} moves and has mass 0 kg, as the members there have none, must be "
                "above 0: give mass= of the nodes too, or bar_mass= and string_mass= of all members"
            )

    @property
    def has_heavy_members(self) -> bool:
        """Whether some member has mass.  If none has, masses are lumped at the nodes."""
        return bool(self.member_mass.any())

    @cached_property
    def weighing_mass(self) -> Array:
        """Mass of each node with half of each of its members', on which gravity acts [kg],
        (nodes,): the row sums of the mass matrix."""
        total = self.mass.copy()
        np.add.at(total, self.ends, self.member_mass[:, None] / 2)
        return fixed(total)

    def mass_matrix(self) -> Any:
        """Consistent mass matrix [kg], a SciPy sparse array (nodes dim, nodes dim).

        It is exact for straight uniform members, and does not depend on the positions; of a lattice
        that of motions which are the same in all cells.
        """
        from scipy.sparse import eye_array, kron

        one = mass_matrix(self.mass, self.ends, self.member_mass)
        return kron(one, eye_array(self.dim), format="csr")

    def _inertia(self, freedom: Any) -> Any:
        """The mass matrix, or its diagonal (nodes dim,) where no member has mass; refuses nodes
        without mass that supports permit to move."""
        self._refuse_massless(np.unique(freedom.motions.tocoo().row) // self.dim)
        return self.mass_matrix() if self.has_heavy_members else np.repeat(self.mass, self.dim)

    def _masses(self, of_all: str = "") -> dict[str, Any]:
        """The masses as arguments, those of members as two or as one of another name."""
        given, bars = {"mass": self.mass}, self.bars
        if self.has_heavy_members and of_all:
            given[of_all] = self.member_mass
        elif self.has_heavy_members:
            given |= {"bar_mass": self.member_mass[:bars], "string_mass": self.member_mass[bars:]}
        return given

    def _masses_line(self) -> str:
        """What a print says of the masses."""
        nodes = f"{self.mass.sum():.6g} kg at the nodes"
        if not self.has_heavy_members:
            words = "a bar turns as two point masses, with 3 times the inertia of a rod"
            return f"  mass: {nodes}, members have none: {words}"
        each = [self.member_mass[~self.is_string], self.member_mass[self.is_string]]
        bars, strings = (f"{x.sum():.6g} kg" for x in each)
        return f"  mass: {nodes}, {bars} along bars, {strings} along strings"

    def at(self, positions: ArrayLike, **other: Any) -> Self:
        """A copy at other positions, with other arguments replaced by name."""
        raise NotImplementedError

    def at_mass(self, mass: ArrayLike) -> Self:
        """A copy with other masses of the nodes [kg]."""
        return self.at(self.positions, mass=mass)

    def self_stress(self) -> SelfStress:
        """States of self-stress of the shape; they do not depend on the stiffnesses."""
        return statics.self_stress(self.positions, self.ends, self.is_string, self.shift)

    def name_of(self, member: int) -> str:
        """The name of a member in messages, such as "string 4"."""
        bars = self.bars
        return f"string {member}" if member >= bars else f"bar {member}"

    @property
    def nodes(self) -> int:
        """Number of nodes."""
        return len(self.positions)

    @property
    def dim(self) -> int:
        """Dimension of space, 2 or 3."""
        return int(self.positions.shape[1])

    @property
    def bars(self) -> int:
        """Number of bars."""
        return int(np.sum(~self.is_string))

    @property
    def strings(self) -> int:
        """Number of strings."""
        return int(np.sum(self.is_string))

    @cached_property
    def members(self) -> Members:
        """The members as arrays, which compute forces and energy."""
        own = self.ends, self.stiffnesses, self.natural_lengths, self.is_string
        return Members(self.positions.shape, *own, self.shift)

    @cached_property
    def lengths(self) -> Array:
        """Lengths of the members at the positions [m], (members,)."""
        d = self.positions[self.ends[:, 1]] - self.positions[self.ends[:, 0]] + self.shift
        return fixed(np.sqrt(np.einsum("ij,ij->i", d, d)))

    @cached_property
    def tensions(self) -> Array:
        """Tensions of the members at the positions [N], (members,); 0 for slack strings."""
        return fixed(self.members.tensions(self.positions))

    @property
    def densities(self) -> Array:
        """Force densities, tension over length [N/m], (members,)."""
        return self.tensions / np.maximum(self.lengths, NO_LENGTH)

    @property
    def slack(self) -> Flags:
        """Which members are slack strings, (members,): strings shorter than their natural length
        by more than 1e-10 of it."""
        return ~self.members.taut(self.lengths)

    def prestressed(
        self,
        force_densities: ArrayLike | None = None,
        prestrain: Mapping[int, float] | None = None,
    ) -> Self:
        """The same shape with natural lengths for which this shape is a prestressed equilibrium.

        Parameters
        ----------
        force_densities : array_like, (members,), optional
            A state of self-stress, tension over length [N/m], tension > 0.
        prestrain : dict, optional
            {member: (length - natural length)/natural length} for as many strings as there are
            independent states of self-stress; members are numbered bars first.

        Returns
        -------
        Structure or Lattice

        Raises
        ------
        TensegrityError
            If not exactly one of the two is given, or a value is outside its bounds.
        EquilibriumError
            If the shape has no self-stress, the force densities are not in equilibrium, or a
            string would be compressed.
        """
        if (force_densities is None) == (prestrain is None):
            raise TensegrityError("give force_densities or prestrain, one of them")
        if prestrain is None:
            q = statics.checked(self, force_densities)
        else:
            q = statics.of_prestrain(self, prestrain)
        statics.refuse_pushing(self, q)
        natural = self.lengths * (1 - q / self.stiffnesses)
        bad = np.flatnonzero(~((natural > 0) | (self.lengths == 0)))
        if bad.size:
            raise TensegrityError(
                f"force density {q[bad[0]]:.6g} N/m of {self.name_of(int(bad[0]))} must be below "
                f"its stiffness {self.stiffnesses[bad[0]]:g} N/m"
            )
        return self.at(self.positions, natural_lengths=natural)

    def member_number(self, member: object) -> int:
        """The number of a member, checked to be one."""
        return check.whole("member", member, least=0, below=len(self.ends))
