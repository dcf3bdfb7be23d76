"""Masses of structures and lattices: at the nodes, and along their members."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.engine.inertia import mass_matrix
from tensegrity.errors import TensegrityError
from tensegrity.readonly import ReadOnly, fixed
from tensegrity.typing import Array, Flags, Indices


class Masses(ReadOnly):
    """Nodes and members with their masses; see `Structure` and `Lattice`.  Cables have no mass."""

    positions: Array
    ends: Indices
    cables: tuple[tuple[int, ...], ...]
    is_string: Flags
    mass: Array
    member_mass: Array

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
        """Number of strings, without cables."""
        return int(np.sum(self.is_string)) - len(self.cables)

    def _set_masses(self, mass: Any, bar_mass: Any, string_mass: Any) -> None:
        """Set the masses of nodes and members, checked."""
        for name, given, count, kind in (
            ("bar_mass", bar_mass, self.bars, "bars"),
            ("string_mass", string_mass, self.strings, "strings"),
        ):
            if given is not None and not count and np.any(given):
                cables = ": cables over nodes have no mass" * bool(len(self.cables))
                raise TensegrityError(f"{name} {check.shown(given)}: there are no {kind}{cables}")
        each = [
            positive_for_each(name, 0.0 if given is None else given, count, "kg", zero=True)
            for name, given, count in (
                ("bar_mass", bar_mass, self.bars), ("string_mass", string_mass, self.strings)
            )
        ]  # fmt: skip
        self.member_mass = np.concatenate([*each, np.zeros(len(self.cables))])
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

    def _masses(self) -> dict[str, Any]:
        """The masses as arguments."""
        given, (bars, end) = {"mass": self.mass}, np.cumsum([self.bars, self.strings])
        if self.has_heavy_members:
            given |= {"bar_mass": self.member_mass[:bars]}
            given |= {"string_mass": self.member_mass[bars:end]}
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
