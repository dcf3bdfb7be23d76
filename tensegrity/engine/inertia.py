"""Inertia of straight uniform members: their mass matrix, and its inverse as operations on rows.

The velocity of a member is linear between its ends, so that its kinetic energy is exact:
m (v.v + v.w + w.w)/6 for velocities v, w of the ends, `derivations.member`.  The mass matrix is
that of the nodes on the diagonal, and of each member m/6 [[2, 1], [1, 2]] in each direction,
whatever the positions.

With M = L D L' the accelerations M^-1 f follow from f by operations of the form row -= factor other
row, forwards with L, backwards with D L' D^-1, and a division by D.  Where every node is in at most
one member with mass, these are two operations for each member.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tensegrity.typing import Array, Flags, Indices

END, ACROSS = 1 / 3, 1 / 6  # of a member's mass, for both ends, and between them


def mass_matrix(mass: Array, ends: Indices, member_mass: Array) -> Any:
    """The mass matrix of one direction.

    Parameters
    ----------
    mass : ndarray, (nodes,)
        At the nodes [kg].
    ends : ndarray of int, (members, 2)
    member_mass : ndarray, (members,)
        [kg]

    Returns
    -------
    scipy.sparse.csr_array, (nodes, nodes)
        [kg]
    """
    from scipy.sparse import coo_array

    (i, j), each = ends[member_mass > 0].T, member_mass[member_mass > 0]
    nodes = np.arange(len(mass))
    values = np.concatenate([mass, END * each, END * each, ACROSS * each, ACROSS * each])
    at = np.concatenate([nodes, i, j, i, j]), np.concatenate([nodes, i, j, j, i])
    return coo_array((values, at), shape=(len(mass), len(mass))).tocsr()


@dataclass(frozen=True, eq=False)
class RowOperations:
    """row[target] -= factor row[source], one after the other, for each direction.

    Attributes
    ----------
    target, source : ndarray of int, (operations,)
    factor : ndarray, (operations, dim)
    mobility : ndarray, (nodes,)
        Such that M^-1 is at most the diagonal matrix of these [1/kg].
    """

    target: Indices
    source: Indices
    factor: Array
    mobility: Array

    def applied(self, rows: Array) -> Array:
        """The operations on a copy of rows (nodes, dim)."""
        rows = rows.copy()
        for to, of, factor in zip(self.target, self.source, self.factor, strict=True):
            rows[to] -= factor * rows[of]
        return rows


@dataclass(frozen=True, eq=False)
class Ties:
    """Mass of members between coordinates whose motion is prescribed, and others.

    Attributes
    ----------
    free : ndarray of int, (ties, 2)
        The number of a prescribed coordinate among these, and the index of a free one.
    mass : ndarray, (ties,)
        Entries of the mass matrix [kg].
    among : scipy.sparse.csr_array, (prescribed, prescribed)
        Those between prescribed coordinates, without its diagonal [kg].
    """

    free: Indices
    mass: Array
    among: Any

    @classmethod
    def of(cls, matrix: Any, moved: Indices, still: Indices, dim: int) -> Ties:
        """The ties of some coordinates.

        Parameters
        ----------
        matrix : scipy.sparse.csr_array, (nodes, nodes)
            As of `mass_matrix`.
        moved, still : ndarray of int
            Numbers of the coordinates whose motion is prescribed, and of those at rest.
        dim : int
            Coordinates of a node.

        Returns
        -------
        Ties
        """
        from scipy.sparse import eye_array, kron, tril, triu

        whole = kron(matrix, eye_array(dim), format="csr")
        rows = whole[moved].tocoo()
        free = ~np.isin(rows.col, np.concatenate([moved, still]))
        square = whole[moved][:, moved]
        among = (tril(square, -1) + triu(square, 1)).tocsr()
        ends = np.stack([rows.row[free], rows.col[free]], axis=1)
        return cls(ends.astype(np.int64), rows.data[free], among)


def inverse(matrix: Any, free: Flags) -> tuple[Array, RowOperations]:
    """The inverse of the mass matrix of what is free to move.

    Parameters
    ----------
    matrix : scipy.sparse.csr_array, (nodes, nodes)
        As of `mass_matrix`; nodes without mass are not free.
    free : ndarray of bool, (nodes, dim)
        Which coordinates follow forces; the motion of others is prescribed.

    Returns
    -------
    weights : ndarray, (nodes, dim)
        By which to multiply after the operations [1/kg]; of others 1 over the diagonal, or 0.
    operations : RowOperations
    """
    diagonal = matrix.diagonal()
    mobility = np.divide(1, diagonal, out=np.zeros(len(diagonal)), where=diagonal > 0)
    weights = np.repeat(mobility[:, None], free.shape[1], axis=1)
    targets, sources, factors = [], [], []
    patterns, number = np.unique(free, axis=1, return_inverse=True)
    for k, pattern in enumerate(patterns.T):
        nodes, axes = np.flatnonzero(pattern), number.ravel() == k
        part = matrix[nodes][:, nodes]
        lower, upper, pivots, order = _factored(part)
        dominant = 2 * diagonal[nodes] - abs(part).sum(axis=1)  # of a diagonally dominant matrix
        mobility[nodes] = np.maximum(mobility[nodes], 1 / dominant)
        weights[np.ix_(nodes[order], axes)] = 1 / pivots[:, None]
        forwards = np.lexsort((lower.row, lower.col))
        backwards = np.lexsort((upper.col, upper.row))[::-1]
        for half, turn in ((lower, forwards), (upper, backwards)):
            targets.append(nodes[order[half.row[turn]]])
            sources.append(nodes[order[half.col[turn]]])
            factors.append(half.data[turn, None] * axes)
    target, source, factor = map(np.concatenate, (targets, sources, factors))
    return weights, RowOperations(target, source, factor, mobility)


def _factored(matrix: Any) -> tuple[Any, Any, Array, Indices]:
    """L without its diagonal, D L' D^-1 without its diagonal, D, and the node of each row."""
    from scipy.sparse import diags_array, tril, triu
    from scipy.sparse.linalg import splu

    if not matrix.shape[0]:
        none = tril(matrix.tocoo(), -1).tocoo()
        return none, none, np.zeros(0), np.zeros(0, dtype=int)
    factors = splu(
        matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
        options={"SymmetricMode": True, "Equil": False},
    )  # fmt: skip
    pivots = factors.U.diagonal()
    scaled = (triu(factors.U, 1) @ diags_array(1 / pivots)).tocoo()
    return tril(factors.L, -1).tocoo(), scaled, pivots, np.argsort(factors.perm_c)
