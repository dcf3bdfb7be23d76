"""What finite structures and periodic lattices have in common: nodes, members, prestress.

Nodes are joined by straight bars and strings; a member may lead to the image of a node in another
cell, at a constant shift.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.readonly import ReadOnly, fixed
from tensegrity.structures.members import NO_LENGTH, Members, positive_for_each
from tensegrity.typing import Array, Flags, Indices


class Framework(ReadOnly):
    """Nodes joined by bars and strings; see `Structure` and `Lattice`."""

    positions: Array
    ends: Indices
    is_string: Flags
    stiffnesses: Array
    natural_lengths: Array
    mass: Array
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
        mass: ArrayLike,
        natural_lengths: ArrayLike | None,
        size: float,
    ) -> None:
        """Set the members and masses, checked; `pairs` are the ends of bars and of strings."""
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
        self.mass = positive_for_each("mass", mass, self.nodes, "kg")
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

    def at(self, positions: ArrayLike, **other: Any) -> Self:
        """A copy at other positions, with other arguments replaced by name."""
        raise NotImplementedError

    def at_mass(self, mass: ArrayLike) -> Self:
        """A copy with other masses of the nodes [kg]."""
        return self.at(self.positions, mass=mass)

    def _rates(self, motions: Array) -> Array:
        """Differences of motions (count, nodes, dim) of the ends of members, (count, members,
        dim)."""
        return np.asarray(motions[:, self.ends[:, 1]] - motions[:, self.ends[:, 0]])

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

    def member_number(self, member: object) -> int:
        """The number of a member, checked to be one."""
        return check.whole("member", member, least=0, below=len(self.ends))
