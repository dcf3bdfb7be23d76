"""How much model does the scene need?  The prism with six free nodes, along its symmetric path.

The symmetric equilibria of `tensegrity.prisms.path` solve the 18-coordinate model too; here its
tangent decides whether they are stable against motions that base, twist and height cannot
describe.  The load is dead (axial, a third on each upper node) and stays out of the tangent.  The
lower nodes lie on a smooth plate; how the upper ones are held is a `SUPPORTS` entry.
Source: seeds/000, part III.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check
from tensegrity.branches.table import Table
from tensegrity.engine.codegen import to_casadi
from tensegrity.errors import TensegrityError
from tensegrity.once import once
from tensegrity.prisms.path import equilibrium_path
from tensegrity.prisms.prism import Prism
from tensegrity.root import root

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from numpy.typing import ArrayLike

    from tensegrity.prisms.path import EquilibriumPath
    from tensegrity.typing import Array, Flags

HORIZONTAL = np.eye(18)[:, [3 * node + axis for node in range(6) for axis in (0, 1)]]
UPRIGHT = np.eye(18)[:, [11, 14, 17]]

SUPPORTS = {
    "plates": np.column_stack([HORIZONTAL, UPRIGHT.sum(axis=1)]),
    "tilting": np.column_stack([HORIZONTAL, UPRIGHT]),
}
"""Free motions: upper nodes at one height (a guided plate), or each at its own (free to tilt)."""


@dataclass(frozen=True)
class Loss:
    """Where the symmetric path first loses stability under dead load, for a support.

    Attributes
    ----------
    height, load : float
        [m], [N]; nan where it keeps stability up to the end of the path.
    symmetric : bool
        Whether the mode that is lost keeps the threefold symmetry.
    """

    height: float
    load: float
    symmetric: bool


@once
def _tangent() -> tuple[Callable[..., Any], Callable[..., Any]]:
    import casadi as ca

    from derivations import nodes, prism

    shape = ca.SX.sym("shape", 3)  # base, twist, height
    c, x = ca.SX.sym("c", 6), ca.SX.sym("x", 18)
    energy = to_casadi(nodes.energy(), (*nodes.POSITIONS, *nodes.CONSTANTS))
    hessian = ca.hessian(energy(*ca.vertsplit(x), *ca.vertsplit(c)), x)[0]
    symbols = (prism.base, prism.twist, prism.height)
    place = ca.vertcat(*to_casadi(nodes.symmetric_positions(), symbols)(*ca.vertsplit(shape)))
    return (
        ca.Function("place", [shape], [place]),
        ca.Function("tangent", [shape, c], [ca.densify(ca.substitute(hessian, x, place))]),
    )


def tangents(prism: Prism, base: ArrayLike, twist: ArrayLike, height: ArrayLike) -> Array:
    """Tangent stiffness of the 18-coordinate prism at symmetric states.

    Parameters
    ----------
    prism : Prism
        With finite `k_base` and `k_bar`.
    base, twist, height : array_like, (rows,)
        [m], [rad], [m].

    Returns
    -------
    ndarray, (rows, 18, 18)
        [N/m], in the order of `derivations.nodes.POSITIONS`.
    """
    check.kind("prism", prism, Prism)
    if math.isinf(prism.k_base) or math.isinf(prism.k_bar):
        raise TensegrityError(
            f"k_base {prism.k_base:g} N/m and k_bar {prism.k_bar:g} N/m must be finite for the "
            "18-coordinate model"
        )
    shape = np.array([base, twist, height], dtype=float).reshape(3, -1)
    constants = [prism.k_cross, prism.k_base, prism.k_bar, *prism.natural_lengths()]
    matrices = np.array(_tangent()[1](shape, constants))
    return matrices.reshape(18, -1, 18).transpose(1, 0, 2)


def _motions(support: str, place: Array) -> Array:
    """Orthonormal motions that a support leaves free, less sliding and turning as a whole."""
    x, y = place[0::3], place[1::3]
    whole = np.zeros((18, 3))
    whole[0::3, 0] = whole[1::3, 1] = 1
    whole[0::3, 2], whole[1::3, 2] = -y, x
    free = np.linalg.qr(SUPPORTS[support])[0]
    held = np.linalg.qr(free.T @ whole)[0]
    return free @ np.linalg.svd(held.T)[2][3:].T


def lowest(
    prism: Prism, path: Table, support: str = "plates", count: int = 4
) -> tuple[Array, Flags]:
    """Lowest eigenvalues of the tangent over the motions that a support leaves free.

    Parameters
    ----------
    prism : Prism
    path : table with base, twist and height, (rows,)
        For instance an `EquilibriumPath`.
    support : str
        One of `SUPPORTS`.
    count : int

    Returns
    -------
    tuple of two ndarrays, (rows, count)
        Eigenvalues in ascending order [N/m], and whether each mode keeps the threefold symmetry.
    """
    _refuse_support(support)
    check.kind("path", path, Table)
    count = check.whole("count", count, least=1)
    matrices = tangents(prism, path.base, path.twist, path.height)
    values, symmetric = [], []
    for row, matrix in enumerate(matrices):
        shape = [path.base[row], path.twist[row], path.height[row]]
        motions = _motions(support, np.array(_tangent()[0](shape)).ravel())
        found, modes = np.linalg.eigh(motions.T @ matrix @ motions)
        values.append(found[:count])
        symmetric.append([_keeps_symmetry(mode) for mode in (motions @ modes[:, :count]).T])
    return np.array(values), np.array(symmetric)


def _refuse_support(support: str) -> None:
    if not isinstance(support, str) or support not in SUPPORTS:
        raise TensegrityError(
            f"support {check.shown(support)} must be one of {', '.join(SUPPORTS)}"
        )


def _keeps_symmetry(mode: Array) -> bool:
    """Whether a mode is its own image under a third of a turn, nodes renumbered."""
    turn = 2 * math.pi / 3
    rotation = np.array(
        [[math.cos(turn), -math.sin(turn), 0], [math.sin(turn), math.cos(turn), 0], [0, 0, 1]]
    )
    nodes = mode.reshape(6, 3)[[2, 0, 1, 5, 3, 4]] @ rotation.T
    return bool(np.dot(nodes.ravel(), mode) > 0.9)


def first_loss(prism: Prism, support: str = "plates") -> Loss:
    """First loss of stability under dead load along the compressive path, located in height.

    Returns
    -------
    Loss
    """
    _refuse_support(support)
    path = equilibrium_path(prism)
    values, symmetric = lowest(prism, path, support, 1)
    lost = np.flatnonzero(values[1:, 0] < 0)
    if lost.size == 0:
        return Loss(math.nan, math.nan, False)
    row = int(lost[0]) + 1

    def lowest_at(height: float) -> float:
        return lowest(prism, _state(prism, height), support, 1)[0][0, 0]

    height = path.height[row]
    if values[row - 1, 0] > 0:
        height = root(lowest_at, path.height[row], path.height[row - 1], relative=1e-13)
    load = -float(prism.potential().tension(height - prism.height))
    return Loss(float(height), load, bool(symmetric[row, 0]))


def _state(prism: Prism, height: float) -> EquilibriumPath:
    """The symmetric state at a height, by a path that ends there."""
    if height == prism.height:
        return equilibrium_path(prism)[:1]
    return equilibrium_path(prism, min_height=float(height))[-1:]
