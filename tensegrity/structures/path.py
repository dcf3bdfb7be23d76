"""Equilibria of structures under given loads, under growing loads, and as natural lengths change.

The model is that of `Structure`; bars and strings have no thickness.
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
from tensegrity.printing import Lines, Printed, listed, span
from tensegrity.readonly import fixed
from tensegrity.structures.equations import Loading
from tensegrity.structures.members import equilibrium_positions
from tensegrity.structures.path_follower import PathFollower
from tensegrity.structures.structure import Structure
from tensegrity.structures.structure_path import StructurePath
from tensegrity.structures.supports import Supports

if TYPE_CHECKING:
    from typing import Any

    from tensegrity.structures.equations import Plates
    from tensegrity.typing import Array, Flags


@dataclass(frozen=True, repr=False)
class Equilibrium(Printed):
    """A state of equilibrium under loads.

    Attributes
    ----------
    structure : Structure
        The structure at the equilibrium positions.
    loads : ndarray, (nodes, dim)
        Loads on the nodes [N].
    supports : Supports or None
    start : Structure
        From which it was found, without the loads.
    """

    structure: Structure
    loads: Array
    supports: Supports | None
    start: Structure

    def _lines(self) -> Lines:
        loads, moved = (np.linalg.norm(x, axis=1) for x in (self.loads, self.displacements))
        state = "stable" if self.stable else "not stable"
        yield (
            f"equilibrium of {self.structure.nodes} nodes under loads of {loads.sum():.6g} N at "
            f"{np.count_nonzero(loads)} of them, {self.supports or 'no supports'}: {state}"
        )
        yield f"  displacements up to {moved.max():.6g} m, of node {int(moved.argmax())}"
        yield f"  tensions {span(self.tensions, 'N')}"
        yield f"  slack strings: {listed(np.flatnonzero(self.slack))}"

    @property
    def displacements(self) -> Array:
        """Of the nodes from where they were without the loads [m], (nodes, dim)."""
        return self.positions - self.start.positions

    @property
    def positions(self) -> Array:
        """Positions of the nodes [m], (nodes, dim)."""
        return self.structure.positions

    @property
    def tensions(self) -> Array:
        """Tensions of the members [N], (members,)."""
        return self.structure.tensions

    @property
    def slack(self) -> Flags:
        """Which members are slack strings, (members,); see `Structure`."""
        return self.structure.slack

    @cached_property
    def stable(self) -> bool:
        """Whether the energy has a strict minimum there under these loads and supports."""
        return self.structure.is_stable(self.supports)

    @cached_property
    def reactions(self) -> Array:
        """Reaction forces of the supports on the nodes [N], (nodes, dim)."""
        return self.structure.members.gradient(self.positions) - self.loads


def equilibrium(
    structure: Structure,
    loads: Mapping[int, Sequence[float]] | None = None,
    supports: Supports | None = None,
) -> Equilibrium:
    """The equilibrium under constant loads, by minimising the energy from the given positions.

    Parameters
    ----------
    structure : Structure
    loads : dict, optional
        {node: force (dim,) [N]}; by default none.
    supports : Supports, optional
        By default none, in which case the loads must balance each other.

    Returns
    -------
    Equilibrium

    Raises
    ------
    TensegrityError
        If a load or support names no node, or is outside its bounds.
    EquilibriumError
        If the loads do work on a rigid motion that the supports permit, or the structure cannot
        carry them.

    Examples
    --------
    >>> from tensegrity import Structure, equilibrium, held
    >>> corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
    >>> sides = [(0, 1), (1, 2), (2, 3), (3, 0)]
    >>> cross = Structure(corners, bars=[(0, 2), (1, 3)], strings=sides)
    >>> stressed = cross.prestressed(prestrain={2: 0.05})
    >>> foot = held([0]) + held([1], axes=[1])
    >>> loaded = equilibrium(stressed, {2: (0.0, -0.05), 3: (0.0, -0.05)}, foot)
    >>> loaded.tensions.round(4).tolist()
    [-0.1019, -0.1019, 0.074, 0.0201, 0.074, 0.0201]
    >>> round(float(loaded.positions[2, 1]), 4), loaded.stable
    (0.9725, True)
    >>> loaded.reactions[:2, 1].round(4).tolist()
    [0.05, 0.05]
    """
    check.kind("structure", structure, Structure)
    forces = nodal(structure, loads)
    freedom = structure.freedom(supports)
    x = equilibrium_positions(structure.members, freedom, structure.positions, forces)
    return Equilibrium(structure.at(x), fixed(forces), supports, structure)


def nodal(structure: Structure, loads: Any) -> Array:
    """Loads {node: force} as an array (nodes, dim) [N]."""
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
    """Equilibrium path of a structure; `tensegrity.equilibrium_path` documents the arguments.

    Parameters
    ----------
    structure : Structure
    supports : Supports
    max_load, max_shortening : float, optional
        Load [N] and shortening [m] at which the path ends.
    branch : {"stable", "symmetric"}, optional
    loads : dict, optional
        {node: force (dim,)}.

    Returns
    -------
    StructurePath

    Raises
    ------
    TensegrityError
        If an argument is outside its bounds, or there are neither loads nor an upper plate.
    EquilibriumError
        If the loads do no work, do work on a rigid motion, or determine no path at the start.
    """
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
        raise TensegrityError("loads of 0 N give no direction to follow")
    pattern = pattern / size
    motions = _motions(structure, supports, pattern)
    work = float(np.abs(motions.T @ pattern.ravel()).max(initial=0.0))
    if not work > 1e-12:
        raise EquilibriumError("the loads do no work in any motion that the supports permit")
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
    """Equilibrium path as the natural lengths of some members change to given values.

    Spring constants k stay as they are.  A cable on a winch keeps EA instead, and k = EA over
    natural length grows as it is wound up: at the end of the path tensions are those of such a
    cable only if k is given for its final natural length, and the work is not.

    Parameters
    ----------
    structure : Structure
        A structure in equilibrium under the loads; see `equilibrium` and `Structure.relaxed`.
    natural_lengths : dict
        {member: final natural length [m]}; all of them change in proportion.
    supports : Supports, optional
        By default none.
    branch : {"stable", "symmetric"}, optional
        The branch to follow where several are possible, as for `equilibrium_path`.
    loads : dict, optional
        {node: force (dim,) [N]}, constant along the path.

    Returns
    -------
    StructurePath
        Its column `control` grows from 0 to 1; "work" [J] is the work done by the change, that
        is, the gain of stored energy minus the work of the loads.  The structure snaps at a fold.

    Raises
    ------
    TensegrityError
        If an argument is outside its bounds, or no natural length changes.
    EquilibriumError
        If the structure is not in equilibrium, or a motion has no stiffness there.

    Examples
    --------
    >>> from tensegrity import Structure, control_path
    >>> corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
    >>> sides = [(0, 1), (1, 2), (2, 3), (3, 0)]
    >>> cross = Structure(corners, bars=[(0, 2), (1, 3)], strings=sides)
    >>> stressed = cross.prestressed(prestrain={2: 0.05})
    >>> path = control_path(stressed, {2: 0.8})
    >>> round(float(path.work[-1]), 6), bool(path.slack.any())
    (0.010316, False)
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
        raise TensegrityError("natural_lengths equal those of the structure: there is no path")
    dead = nodal(structure, loads)
    motions = _motions(structure, supports, dead)
    if not motions.shape[1]:
        raise EquilibriumError("the supports permit no motion: natural lengths cannot change")
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
            f"the structure is not in equilibrium: {left:.3g} N are unbalanced, forces are "
            f"{size:.3g} N; "
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
    freedom.refuse_unbalanced(structure.positions, pattern)
    return np.asarray(freedom.motions @ freedom.complement())
