"""What finite structures and periodic lattices have in common: nodes, members, prestress.

Nodes are joined by straight bars and strings; a member may lead to the image of a node in another
cell, at a constant shift.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import pairwise
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.readonly import FixedDict, fixed
from tensegrity.springs.potential import Potential
from tensegrity.structures import laws
from tensegrity.structures.masses import Masses, positive_for_each
from tensegrity.structures.members import NO_LENGTH, Members
from tensegrity.structures.segments import Segments
from tensegrity.typing import Array, Flags, Indices

PLAIN = {"bar": 100.0, "string": 1.0}  # spring constants where none are given [N/m]


class Framework(Masses):
    """Nodes joined by bars and strings; see `Structure` and `Lattice`."""

    positions: Array
    ends: Indices
    segments: Indices  # ends of the segments, of which cables over nodes have several
    cables: tuple[tuple[int, ...], ...]
    is_string: Flags
    stiffnesses: Array
    keeps_EA: Flags
    natural_lengths: Array
    shift: Array | float  # from the second end of each member to its image [m]
    buckling: Array | None
    plateau: float
    law: Mapping[int, Potential]
    _may_coincide = False  # whether springs of natural length 0 join nodes at one place

    def _set_positions(self, positions: ArrayLike) -> None:
        places = check.floats("positions", positions)
        if places.ndim != 2 or places.shape[1] not in (2, 3) or not len(places):
            raise TensegrityError(f"positions have shape {places.shape}, must be (nodes, 2) or 3")
        self.positions = check.vector("positions", places, places.shape)

    def _set_members(
        self,
        pairs: Sequence[Indices],
        stiff: Mapping[str, tuple[ArrayLike | None, ArrayLike | None]],
        masses: Sequence[ArrayLike | None],
        natural_lengths: ArrayLike | None,
        size: float,
        law: Any = None,
        buckling: ArrayLike | None = None,
        plateau: float = 0.0,
        cables: Sequence[tuple[int, ...]] = (),
    ) -> None:
        """Set the members and masses, checked; `pairs` are the ends of bars and of strings, `stiff`
        has for each of the two k and EA, one of which is given; `masses` those of `_set_masses`."""
        self.cables = tuple(cables)
        self.ends, self.segments = with_cables(np.concatenate(pairs), cables)
        self.is_string = np.arange(len(self.ends)) >= len(pairs[0])
        if not len(self.ends):
            raise TensegrityError("0 bars and strings, must be at least 1")
        alone = sorted(set(range(self.nodes)) - set(self.segments.ravel().tolist()))
        if alone:
            raise TensegrityError(f"node {alone[0]} is in no member")
        counts = len(pairs[0]), len(pairs[1]) + len(cables)
        numbers = [_stiffness(*of, n) for of, n in zip(stiff.items(), counts, strict=True)]
        self._set_masses(*masses)
        if cables:
            parts = self._segment_lengths()
            self.cable_segments.refuse_together(parts, self.segments, 1e-12 * size)
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
        self.law = FixedDict(laws.laws_of({} if law is None else law, self.is_string, self.name_of))
        keeps = np.concatenate([of for of, _ in numbers])
        keeps[[*self.law]] = False
        self.keeps_EA = keeps
        values = np.concatenate([of for _, of in numbers])
        with np.errstate(divide="ignore"):  # EA over a natural length of 0, refused below
            stiffnesses = values / np.where(keeps, natural, 1.0)
        if self.law:
            of = laws.Laws(self.law, natural, self.is_string)
            laws.checked(of, self.name_of).refuse_beyond(lengths - natural, self.name_of)
            stiffnesses[of.member] = of.stiffness
        self.stiffnesses = stiffnesses
        bad = np.flatnonzero(~((self.stiffnesses > 0) & (self.stiffnesses < np.inf)))
        if bad.size:
            raise TensegrityError(
                f"{self.name_of(int(bad[0]))} has EA {values[bad[0]]:g} N over natural length "
                f"{natural[bad[0]]:g} m, which must be finite and above 0"
            )
        self.EA = np.where(keeps, values, stiffnesses * natural)
        if buckling is not None:
            buckling = positive_for_each("buckling", buckling, self.bars, "N")
            for member in [m for m in self.law if m < self.bars]:
                raise TensegrityError(f"bar {member} has a law and a buckling load: give one")
        self.buckling, self.plateau = buckling, plateau

    def _stiff_unless(self, other: Mapping[str, Any]) -> dict[str, Array]:
        """The arguments that gave the stiffnesses, without those that `other` replaces."""
        kinds, given = {"bar": slice(self.bars), "string": slice(self.bars, None)}, {}
        for name, some in kinds.items():
            replaced = name == "string" and isinstance(other.get("law"), Potential)
            if not replaced and not {f"k_{name}", f"EA_{name}"} & {*other}:
                kept = self.keeps_EA[some].any()
                which = f"EA_{name}" if kept else f"k_{name}"
                given[which] = (self.EA if kept else self.stiffnesses)[some]
        return given

    def at(self, positions: ArrayLike, **other: Any) -> Self:
        """A copy at other positions, with other arguments replaced by name."""
        raise NotImplementedError

    def at_mass(self, mass: ArrayLike) -> Self:
        """A copy with other masses of the nodes [kg]."""
        return self.at(self.positions, mass=mass)

    def _rates(self, motions: Array) -> Array:
        """Differences of motions (count, nodes, dim) of the ends of segments, (count, segments,
        dim)."""
        first, second = self.segments.T
        return np.asarray(motions[:, second] - motions[:, first])

    def _stiffening(self, densities: Array, motions: Array) -> Array:
        """Stiffness [N/m] that force densities [N/m] give motions that change no length of a
        member, (count, count)."""
        rates, of = self._rates(motions), self.cable_segments
        if len(of.cables):  # their segments do change lengths, which the tension does not resist
            d, lengths = self.members.separations(self.positions)
            along, densities = d / lengths[:, None], of.each(densities * self.lengths) / lengths
            rates = rates - np.einsum("amk,mk->am", rates, along)[..., None] * along
        return np.einsum("m,amk,bmk->ab", densities, rates, rates)

    def name_of(self, member: int) -> str:
        """The name of a member in messages, such as "string 4"."""
        cable = member >= len(self.ends) - len(self.cables)
        kind = "cable" if cable else "string" if member >= self.bars else "bar"
        return f"{kind} {member}"

    @cached_property
    def members(self) -> Members:
        """The members as arrays, which compute forces and energy."""
        own = self.segments, self.stiffnesses, self.natural_lengths, self.is_string
        shape, of = self.positions.shape, self.cable_segments
        members = Members(shape, *own, self.shift, segments=of)
        if self.law:
            of = laws.Laws(self.law, self.natural_lengths, self.is_string)
            members = replace(members, laws=of)
        if self.buckling is None:
            return members
        least = np.zeros(len(self.ends))
        least[: self.bars] = -self.buckling / self.stiffnesses[: self.bars]
        plateau = np.where(self.is_string, 0.0, self.plateau)
        return replace(members, least=least, plateau=plateau)

    @cached_property
    def lengths(self) -> Array:
        """Lengths of the members at the positions [m], (members,)."""
        return fixed(self.cable_segments.over(self._segment_lengths()))

    def _segment_lengths(self) -> Array:
        first, second = self.segments.T
        d = self.positions[second] - self.positions[first] + self.shift
        return np.asarray(np.sqrt(np.einsum("ij,ij->i", d, d)))

    @cached_property
    def cable_segments(self) -> Segments:
        """Which member each segment belongs to."""
        counts = [len(c) - 1 for c in self.cables]
        if max(counts, default=1) == 1:
            return Segments()
        direct = len(self.ends) - len(counts)
        return Segments(np.repeat(np.arange(len(self.ends)), [1] * direct + counts))

    @cached_property
    def tensions(self) -> Array:
        """Tensions of the members at the positions [N], (members,); 0 for slack strings."""
        return fixed(self.members.tensions(self.positions))

    @property
    def densities(self) -> Array:
        """Force densities, tension over (whole) length [N/m], (members,)."""
        return self.tensions / np.maximum(self.lengths, NO_LENGTH)

    @property
    def slack(self) -> Flags:
        """Which members are slack strings, (members,): strings shorter than their natural length
        by more than 1e-10 of it."""
        return ~self.members.taut(self.lengths) & self.is_string

    @property
    def buckled(self) -> Flags:
        """Which bars are buckled, (members,), by more than 1e-10 of their natural length."""
        return ~self.members.taut(self.lengths) & ~self.is_string

    def member_number(self, member: object) -> int:
        """The number of a member, checked to be one."""
        return check.whole("member", member, least=0, below=len(self.ends))


def rigid_plates(given: Any, nodes: int) -> tuple[tuple[int, ...], ...]:
    """The nodes of each rigid plate, checked that none is on two."""
    try:
        groups = tuple(tuple(group) for group in given)
    except TypeError:
        raise TensegrityError(f"platforms {check.shown(given)} must list nodes of each") from None
    if () in groups:
        raise TensegrityError(f"platform {groups.index(())} has 0 nodes, must have at least 1")
    numbers = [check.whole("node of a platform", n, least=0) for group in groups for n in group]
    for number in numbers:
        if number >= nodes or numbers.count(number) > 1:
            raise TensegrityError(
                f"node {number} of a platform must be below {nodes} and on one platform only"
            )
    return groups


def member_ends(name: str, given: Any, nodes: int) -> Indices:
    """The nodes of each bar or string as an array, checked to exist and to differ.

    Parameters
    ----------
    name : str
        "bar" or "string", for messages.
    given : sequence of (int, int)
    nodes : int
        Number of nodes.

    Returns
    -------
    ndarray of int, (members, 2)

    Raises
    ------
    TensegrityError
        If an entry is no pair of two different nodes.
    """
    try:
        listed = [tuple(pair) for pair in given]
    except TypeError:
        raise TensegrityError(f"{name}s {check.shown(given)} must be pairs of nodes") from None
    for pair in listed:
        if len(pair) != 2:
            raise TensegrityError(f"{name} {check.shown(pair)} must join two nodes")
        for node in pair:
            if check.whole(f"node of a {name}", node, least=0) >= nodes:
                raise TensegrityError(f"node {node} of a {name} must be below {nodes}")
        if pair[0] == pair[1]:
            raise TensegrityError(f"{name} joins node {pair[0]} to itself: its length is 0 m")
    return np.array(listed, dtype=np.int64).reshape(-1, 2)


def with_cables(ends: Indices, cables: Sequence[tuple[int, ...]]) -> tuple[Indices, Indices]:
    """Ends of all members, and those of all segments, from the ends of bars and strings."""
    if not cables:
        return ends, ends
    whole = [(path[0], path[-1]) for path in cables]
    parts = [pair for path in cables for pair in pairwise(path)]
    return np.concatenate([ends, whole]), np.concatenate([ends, parts])


def _stiffness(kind: str, given: tuple[Any, Any], count: int) -> tuple[Flags, Array]:
    """Whether EA is given, and EA [N] or else spring constants [N/m], of bars or strings."""
    k, axial = given
    if k is not None and axial is not None:
        raise TensegrityError(f"k_{kind} and EA_{kind} are both given: give one of them")
    name, unit = ("EA", "N") if k is None and axial is not None else ("k", "N/m")
    value = axial if name == "EA" else PLAIN[kind] if k is None else k
    return np.full(count, name == "EA"), positive_for_each(f"{name}_{kind}", value, count, unit)
