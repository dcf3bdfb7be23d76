"""Stability of the symmetric path of a prism against all motions of its nodes.

The symmetric equilibria of `tensegrity.prisms.path` are equilibria of `Prism.structure` as well.
The tangent stiffness of that structure decides on their stability against motions that base, twist
and height do not describe.  The axial load is dead and equal on the upper nodes.  The lower nodes
lie on a smooth plate; `SUPPORTS` lists the supports of the upper ones.  Source: the talk, part
III.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from tensegrity.branches.problem import trace
from tensegrity.branches.table import Table
from tensegrity.checked import checked
from tensegrity.prisms.prism import Prism
from tensegrity.prisms.stack import symmetric_nodes
from tensegrity.structures.supports import Supports, plates
from tensegrity.typing import Array, Count, Flags

SUPPORTS = ("plates", "tilting")
"""Upper nodes on a guided plate, at a common height; or free to tilt, each at its own height."""


@dataclass(frozen=True)
class StabilityLoss:
    """The point where the symmetric path first loses stability under dead load.

    Attributes
    ----------
    height, load : float
        Height [m] and axial load [N], compression > 0; nan if the whole path is stable.
    symmetric : bool
        Whether the point is a limit point, whose mode has the symmetry of the polygons.
    """

    height: float
    load: float
    symmetric: bool


@checked
def lowest(
    prism: Prism, path: Table, support: Annotated[str, SUPPORTS] = "plates", count: Count = 4
) -> tuple[Array, Flags]:
    """Lowest eigenvalues of the tangent stiffness along a symmetric path.

    Parameters
    ----------
    prism : Prism
        `k_base` and `k_bar` must be finite.
    path : Table
        With columns base, twist and height, (rows,); for instance an `EquilibriumPath`.
    support : str, optional
        One of `SUPPORTS`.
    count : int, optional
        Number of eigenvalues.

    Returns
    -------
    tuple of two ndarrays, (rows, count)
        Eigenvalues in ascending order [N/m], and whether each mode has the symmetry of the
        polygons.  Slack strings contribute nothing, strings at their natural length do.

    Raises
    ------
    TensegrityError
        If an argument is outside its bounds, or the prism has rigid members.
    """
    supports, s = _held(support, prism.sides), prism.structure()
    modes = [
        s.at(x).modes(count, supports)
        for x in symmetric_nodes(prism.sides, path.base, path.twist, path.height)
    ]
    return (
        np.array([one.eigenvalues for one in modes]),
        np.array([[_keeps_symmetry(shape) for shape in one.shapes] for one in modes]),
    )


@checked
def first_loss(prism: Prism, support: Annotated[str, SUPPORTS] = "plates") -> StabilityLoss:
    """First loss of stability under dead load along the compressive path.

    Parameters
    ----------
    prism : Prism
        With finite `k_base` and `k_bar`.
    support : str
        One of `SUPPORTS`.

    Returns
    -------
    Loss

    Raises
    ------
    EquilibriumError
        If the prism has no prestrain, so that a motion has no stiffness at rest.
    """
    n, supports = prism.sides, _held(support, prism.sides)
    loads = {node: (0.0, 0.0, -1 / n) for node in range(n, 2 * n)}
    path = trace(prism.structure().problem(supports, loads, branch="symmetric"))
    for event in path.events:
        if event.kind in ("fold", "bifurcation"):
            return StabilityLoss(prism.height - event.shortening, event.load, event.kind == "fold")
    return StabilityLoss(math.nan, math.nan, False)


def _held(support: str, sides: int) -> Supports:
    return plates(range(sides), range(sides, 2 * sides) if support == "plates" else ())


def _keeps_symmetry(shape: Array) -> bool:
    """Whether a motion is invariant under the rotation by one side of the polygons."""
    sides = len(shape) // 2
    angle = 2 * math.pi / sides
    rotation = np.array(
        [[math.cos(angle), -math.sin(angle), 0], [math.sin(angle), math.cos(angle), 0], [0, 0, 1]]
    )
    turned = np.roll(shape.reshape(2, sides, 3), 1, axis=1).reshape(-1, 3) @ rotation.T
    return bool(np.sum(turned * shape) > 0.9 * np.sum(shape * shape))
