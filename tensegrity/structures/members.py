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
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.engine import forces
from tensegrity.errors import TensegrityError
from tensegrity.minimum import DENSE, ROUND_OFF
from tensegrity.springs.kinks import TAUT
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
    ends : ndarray of int, (members, 2)
    stiffness, natural : ndarray, (members,)
        Spring constants [N/m] and natural lengths [m].
    tension_only : ndarray of bool, (members,)
        Which members are strings.
    shift : ndarray, (members, dim), or 0
        From each second end to its image that the member is joined to [m], in lattices.
    least : ndarray, (members,), or None
        Elongations at which members give way [m], where bars do: at 0 strings slacken, at
        -load/stiffness bars buckle.
    plateau : ndarray, (members,), or 0
        Stiffness beyond, over that before; 0 for strings.
    """

    shape: tuple[int, ...]
    ends: Indices
    stiffness: Array
    natural: Array
    tension_only: Flags
    shift: Array | float = 0.0
    least: Array | None = None
    plateau: Array | float = 0.0

    def separations(self, positions: Array) -> tuple[Array, Array]:
        """Vectors (members, dim) from first to second ends, and their lengths."""
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
        return self.stiffness * self.elongations(self.separations(positions)[1])

    def energy(self, positions: Array) -> float:
        """Elastic energy of all members [J]."""
        lengths = self.separations(positions)[1]
        if self.least is None:
            return float(0.5 * np.sum(self.stiffness * self.elongations(lengths) ** 2))
        elongations = lengths - self.natural
        past = np.minimum(elongations - self.least, 0.0)
        before = 0.5 * (elongations - past) ** 2
        return float(
            np.sum(self.stiffness * (before + self.least * past + 0.5 * self.plateau * past**2))
        )

    def gradient(self, positions: Array) -> Array:
        """Gradient of the energy in the positions [N], (nodes, dim): minus the nodal forces."""
        d, lengths = self.separations(positions)
        force = (self.stiffness * self.elongations(lengths) / lengths)[:, None] * d
        first, second = self.ends.T
        result: Array = -forces.scattered(first, second, force, len(positions))
        return result

    def blocks(
        self, positions: Array, within: float = TAUT, tensions: Array | None = None
    ) -> Array:
        """Tangent stiffness of each member; see `tangent`.

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
        ndarray, (members, dim, dim)
            [N/m]
        """
        d, lengths = self.separations(positions)
        if tensions is None:
            taut, tensions = self.taut(lengths, within), self.stiffness * self.elongations(lengths)
        else:
            taut = ~self.tension_only | (tensions > 0)
        stiffness = np.where(taut, 1.0, self.plateau) * self.stiffness
        return np.asarray(forces.tangents(d / lengths[:, None], stiffness, tensions / lengths))

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
        if size <= DENSE:
            return np.bincount(row * size + column, values, size**2).reshape(size, size)
        from scipy.sparse import coo_array

        return coo_array((values, (row, column)), shape=(size, size)).tocsr()

    @cached_property
    def _entries(self) -> tuple[Array, Indices, Indices]:
        """Signs (4, 1), rows and columns of the numbers that the tangent sums; each quarter of
        them are the numbers of the blocks."""
        nodes, dim = self.shape
        ones = np.ones((len(self.ends), dim, dim))
        first, second = self.ends.T
        all_of = forces.assembled(first, second, forces.of_both_ends(ones), nodes)
        return all_of.data.reshape(4, -1)[:, :1], *all_of.coords


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


def refuse_duplicates(ends: Indices, bars: int) -> None:
    """Refuse two members between the same nodes; the first `bars` members are bars."""
    first: dict[tuple[int, int], int] = {}
    for number, (i, j) in enumerate(np.sort(ends, axis=1).tolist()):
        if (i, j) in first:
            words = [f"{'bar' if m < bars else 'string'} {m}" for m in (first[i, j], number)]
            raise TensegrityError(f"{words[0]} and {words[1]} both join nodes {i} and {j}")
        first[i, j] = number


def positive_for_each(
    name: str, given: ArrayLike, count: int, unit: str, zero: bool = False
) -> Array:
    """Positive numbers, one per item, from one number for all or an array.

    Parameters
    ----------
    name, unit : str
        Quantity and unit, for messages.
    given : array_like, () or (count,)
    count : int
    zero : bool, optional
        Whether 0 is allowed.

    Returns
    -------
    ndarray, (count,)

    Raises
    ------
    TensegrityError
        If a number is not finite and positive, or the shape does not fit.
    """
    values = check.floats(name, given)
    if values.shape not in ((), (count,)):
        raise TensegrityError(f"{name} has shape {values.shape}, must be one or ({count},)")
    bad = np.flatnonzero(~((values >= 0 if zero else values > 0) & np.isfinite(values)))
    if bad.size:
        worst = values.ravel()[bad[0]]
        bound = "at least" if zero else "above"
        raise TensegrityError(f"{name} {worst:g} {unit} must be finite and {bound} 0")
    return np.broadcast_to(values, (count,)).copy()
