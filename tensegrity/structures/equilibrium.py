"""Equilibria of structures under given loads, and as natural lengths change.

The model is that of `Structure`; bars and strings have no thickness.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from tensegrity import check
from tensegrity.branches.problem import trace
from tensegrity.printing import Lines, Printed, listed, span
from tensegrity.readonly import fixed
from tensegrity.structures.path import controlled, nodal
from tensegrity.structures.settling import equilibrium_positions
from tensegrity.structures.structure import Structure
from tensegrity.structures.structure_path import StructurePath
from tensegrity.structures.supports import Supports
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
        if self.structure.buckled.any():
            yield f"  buckled bars: {listed(np.flatnonzero(self.structure.buckled))}"

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


def control_path(
    structure: Structure,
    natural_lengths: Mapping[int, float],
    supports: Supports | None = None,
    branch: str = "stable",
    loads: Mapping[int, Sequence[float]] | None = None,
    *,
    keep: str | None = None,
    until: Mapping[str, Any] | str | None = None,
    at: Mapping[str, Any] | None = None,
) -> StructurePath:
    """Equilibrium path as the natural lengths of some members change to given values.

    Members keep EA where EA was given, as a cable on a winch does: k = EA over natural length grows
    as it is wound up, and the work is that on what hangs outside the drum, -(T + T^2/(2 EA)) for
    each metre of natural length.  Others keep their spring constants.

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
    keep : {"EA", "k"}, optional
        What members keep whose natural lengths change; by default what they were given.  Members
        with a law keep that, as a function of the elongation.
    until, at : optional
        Values of columns, or the kind of event, at which the path ends, and values of columns of
        which the places become events; see `trace`.

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
    return trace(
        controlled(structure, natural_lengths, supports, branch, loads, keep), until=until, at=at
    )
