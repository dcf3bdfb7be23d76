"""The equilibrium of a structure under constant loads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.readonly import fixed
from tensegrity.structures.members import settle
from tensegrity.structures.structure import Structure

if TYPE_CHECKING:
    from typing import Any

    from tensegrity.structures.supports import Supports
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
