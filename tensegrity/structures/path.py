"""Equilibria of structures: under given loads, under loads that grow, and as lengths change.

Model: as `Structure`; bars and strings are lines.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check
from tensegrity.errors import EquilibriumError, TensegrityError
from tensegrity.readonly import fixed
from tensegrity.structures.equations import Loading
from tensegrity.structures.members import settle
from tensegrity.structures.path_follower import PathFollower
from tensegrity.structures.structure import Structure
from tensegrity.structures.structure_path import StructurePath
from tensegrity.structures.supports import Supports

if TYPE_CHECKING:
    from typing import Any

    from tensegrity.structures.equations import Plates
    from tensegrity.typing import Array, Flags


@dataclass(frozen=True)
class Equilibrium:
    """A state of equilibrium under loads.

    Attributes
    ----------
    structure : Structure
        At the new positions.
    loads : ndarray, (nodes, dim)
        [N].
    supports : Supports or None
    """

    structure: Structure
    loads: Array
    supports: Supports | None

    @property
    def positions(self) -> Array:
        """[m], (nodes, dim)."""
        return self.structure.positions

    @property
    def tensions(self) -> Array:
        """Of the members [N], (members,)."""
        return self.structure.tensions

    @property
    def slack(self) -> Flags:
        """Which members are slack strings, (members,); see `Structure`."""
        return self.structure.slack

    @cached_property
    def stable(self) -> bool:
        """Whether it is a minimum of the energy under these loads and supports."""
        return self.structure.is_stable(self.supports)

    @cached_property
    def reactions(self) -> Array:
        """Forces that supports exert on the nodes [N], (nodes, dim)."""
        return self.structure.members.gradient(self.positions) - self.loads


def equilibrium(
    structure: Structure,
    loads: Mapping[int, Sequence[float]] | None = None,
    supports: Supports | None = None,
) -> Equilibrium:
    """The equilibrium under constant loads, found downhill in energy from the positions.

    Parameters
    ----------
    structure : Structure
    loads : dict, optional
        {node: force (dim,) [N]}.
    supports : Supports, optional
        By default none: the loads must then be in equilibrium themselves.

    Returns
    -------
    Equilibrium

    Raises
    ------
    EquilibriumError
        If the supports leave rigid motions on which the loads do work, or nothing carries them.
    """
    check.kind("structure", structure, Structure)
    forces = nodal(structure, loads)
    freedom = structure.freedom(supports)
    x = settle(structure.members, freedom, structure.positions, forces)
    return Equilibrium(structure.at(x), fixed(forces), supports)


def nodal(structure: Structure, loads: Any) -> Array:
    """Loads as an array (nodes, dim)."""
    result = np.zeros(structure.positions.shape)
    if loads is None:
        return result
    if not isinstance(loads, Mapping):
        raise TensegrityError(f"loads {check.shown(loads)} must be a dict {{node: force}}")
    for node, force in loads.items():
        number = check.whole("loaded node", node, least=0, below=structure.nodes)
        result[number] = check.vector(f"load of node {number}", force, (structure.dim,))
    return result


def structure_path(
    structure: Structure,
    *,
    supports: Supports,
    max_load: float = math.inf,
    branch: str = "stable",
    loads: Mapping[int, Sequence[float]] | None = None,
    max_shortening: float = math.inf,
) -> StructurePath:
    """See `tensegrity.equilibrium_path`: the part of it for structures."""
    check.kind("structure", structure, Structure)
    check.kind("supports", supports, Supports, ": made by held(...) or plates(...)")
    max_load = check.number("max_load", max_load, above=0, finite=False, unit="N")
    max_shortening = check.number("max_shortening", max_shortening, above=0, finite=False, unit="m")
    _refuse_unknown(branch)
    normal = supports.direction(structure.dim)
    pattern = nodal(structure, loads)
    if loads is None:
        if not supports.upper:
            raise TensegrityError("give loads, or plates of which one moves")
        pattern[list(supports.upper)] = -normal / len(supports.upper)
    size = np.linalg.norm(pattern, axis=1).sum()
    if not size > 0:
        raise TensegrityError("loads of 0 N are no direction to follow")
    pattern = pattern / size
    motions = _motions(structure, supports, pattern)
    work = float(np.abs(motions.T @ pattern.ravel()).max(initial=0.0))
    if not work > 1e-12:
        raise EquilibriumError("the loads do no work in any motion that the supports leave")
    loading = Loading(
        structure.members, structure.positions, motions, pattern, 0 * structure.lengths,
        _plate(structure, supports), (max_load, max_shortening), 0 * pattern,
    )  # fmt: skip
    return PathFollower(structure, supports, loading, branch).path()


def control_path(
    structure: Structure,
    natural_lengths: Mapping[int, float],
    supports: Supports | None = None,
    branch: str = "stable",
    loads: Mapping[int, Sequence[float]] | None = None,
) -> StructurePath:
    """Equilibria as natural lengths of some members go from theirs to given values.

    Parameters
    ----------
    structure : Structure
        In equilibrium under the loads: see `equilibrium` and `Structure.relaxed`.
    natural_lengths : dict
        {member: natural length at the end [m]}; all change in proportion.
    supports : Supports, optional
    branch : {"stable", "symmetric"}, optional
        As of `equilibrium_path`.
    loads : dict, optional
        {node: force (dim,) [N]}, held while lengths change.

    Returns
    -------
    StructurePath
        With a column `control` from 0 to 1, and "work" [J] that the change has done: the gain of
        stored energy, less the work of the loads.  A fold is where the structure snaps.

    Raises
    ------
    EquilibriumError
        If the structure is not in equilibrium, or a motion has no stiffness there.
    """
    check.kind("structure", structure, Structure)
    _refuse_unknown(branch)
    if not isinstance(natural_lengths, Mapping) or not natural_lengths:
        raise TensegrityError(
            f"natural_lengths {check.shown(natural_lengths)} must be a dict {{member: length}}"
        )
    change = np.zeros(len(structure.ends))
    for member, value in natural_lengths.items():
        number = structure.member_number(member)
        length = check.number(f"natural length of member {number}", value, above=0, unit="m")
        change[number] = length - structure.natural_lengths[number]
    if not change.any():
        raise TensegrityError("natural_lengths are those that the structure has: no path")
    dead = nodal(structure, loads)
    motions = _motions(structure, supports, dead)
    if not motions.shape[1]:
        raise EquilibriumError("the supports leave no motion that could follow natural lengths")
    loading = Loading(
        structure.members, structure.positions, motions, None, change,
        _plate(structure, supports), (math.inf, 1.0), dead,
    )  # fmt: skip
    gradient = structure.members.gradient(structure.positions) - dead
    left = np.abs(motions.T @ gradient.ravel()).max()
    size = np.abs(structure.tensions).max() + 1e-9 * np.max(
        structure.stiffnesses * structure.lengths
    )
    if left > 1e-6 * size:
        raise EquilibriumError(
            f"the structure is not in equilibrium: {left:.3g} N are left, beside {size:.3g} N; "
            "see equilibrium and Structure.relaxed"
        )
    return PathFollower(structure, supports, loading, branch).path()


def _refuse_unknown(branch: str) -> None:
    if not isinstance(branch, str) or branch not in ("stable", "symmetric"):
        raise TensegrityError(f"branch {check.shown(branch)} must be 'stable' or 'symmetric'")


def _plate(structure: Structure, supports: Supports | None) -> Plates | None:
    if supports is None or not (supports.lower or supports.upper):
        return None
    return supports.direction(structure.dim), supports.lower, supports.upper


def _motions(structure: Structure, supports: Supports | None, pattern: Array) -> Array:
    freedom = structure.freedom(supports)
    freedom.refuse_driven(structure.positions, pattern)
    return np.asarray(freedom.motions @ freedom.complement())
