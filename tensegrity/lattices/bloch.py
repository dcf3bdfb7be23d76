"""Bloch waves of bonds that repeat from cell to cell: their matrices and frequencies.

Node j of the cell at offset o moves by u_j exp(i o.kappa), with the phases kappa per cell.  The
stiffness matrix K(kappa) is then a sum over the distinct offsets of the bonds, each of which is
assembled once; many wave vectors are computed together.  An eigenvalue w^2 carries the round-off
of the largest one, so that frequencies below about 1e-8 of the highest are lost.  Where every
bond's stiffness has a real square root, they are computed as singular values of these roots, to
full relative precision.
Source: L. Brillouin, Wave Propagation in Periodic Structures (1946), chapters III and IV; Phani,
Woodhouse & Fleck 2006, Wave propagation in two-dimensional periodic lattices.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from tensegrity import check
from tensegrity.engine.forces import of_both_ends
from tensegrity.minimum import lowest
from tensegrity.typing import Array, Indices

SHIFT = 1e-6  # below 0 of sparse eigenvalues, over the largest stiffness over mass
CHUNK, NUMBERS = 64, 2**23  # matrices that are computed together, and their numbers


@dataclass(frozen=True, eq=False)
class BlochMatrix:
    """The sum of S_o exp(i o.kappa) over offsets o, where S_-o is the transpose of S_o.

    Attributes
    ----------
    offsets : ndarray of int, (offsets, d)
        All distinct ones, with their opposites and 0.
    parts : ndarray, (offsets, nodes dim, nodes dim)
    """

    offsets: Indices
    parts: Array

    @classmethod
    def of(cls, ends: Indices, offsets: Indices, blocks: Array, mass: Array) -> BlochMatrix:
        """Assemble M^-1/2 K M^-1/2.

        Parameters
        ----------
        ends : ndarray of int, (bonds, 2)
            Nodes of a cell.
        offsets : ndarray of int, (bonds, d)
            Offset of the cell of the second end from that of the first.
        blocks : ndarray, (bonds, dim, dim) or (bonds, 2 dim, 2 dim)
            Tangent stiffness of each bond [N/m]: by the difference of its ends; or, where there
            are inertias of all coordinates, by both ends.
        mass : ndarray, (nodes,) or (nodes, dim)
            [kg]; ones give K itself.

        Returns
        -------
        BlochMatrix
        """
        (i, j), root = ends.T, np.sqrt(mass.reshape(len(mass), -1))
        of_ends = blocks if mass.ndim > 1 else of_both_ends(blocks)
        dim = of_ends.shape[-1] // 2
        first, second = slice(dim), slice(dim, None)
        entries = [
            (np.zeros_like(offsets), i, i, of_ends[:, first, first]),
            (np.zeros_like(offsets), j, j, of_ends[:, second, second]),
            (offsets, i, j, of_ends[:, first, second]),
            (-offsets, j, i, of_ends[:, second, first]),
        ]
        distinct, number = np.unique(
            np.concatenate([entry[0] for entry in entries]), axis=0, return_inverse=True
        )
        row, column, each = (np.concatenate([entry[k] for entry in entries]) for k in (1, 2, 3))
        check.memory(f"waves of {len(mass)} nodes", 24.0 * len(distinct) * (dim * len(mass)) ** 2)
        parts = np.zeros((len(distinct), len(mass), len(mass), dim, dim))
        np.add.at(parts, (number.ravel(), row, column), each)
        parts /= root[:, None, :, None] * root[:, None, :]
        size = dim * len(mass)
        return cls(distinct, parts.swapaxes(2, 3).reshape(-1, size, size))

    @property
    def bound(self) -> float:
        """An upper bound on the eigenvalues at all phases."""
        return float(np.abs(self.parts).sum(axis=(0, 2)).max())

    def at(self, weights: Any) -> Any:
        """The sums of the parts with complex weights (..., offsets): (..., size, size)."""
        matrices = np.empty((*weights.shape[:-1], *self.parts.shape[1:]), dtype=complex)
        flat = self.parts.reshape(len(self.parts), -1)
        matrices.real = (weights.real @ flat).reshape(matrices.shape)
        matrices.imag = (weights.imag @ flat).reshape(matrices.shape)
        return matrices

    def weights(self, phases: Array) -> Any:
        """exp(i o.kappa) at phases (..., d): (..., offsets)."""
        return np.exp(1j * (phases @ self.offsets.T))


@dataclass(frozen=True, eq=False)
class PeriodicBonds:
    """Bonds that repeat from cell to cell: the part of a lattice that `bands` requires.

    Attributes
    ----------
    positions : ndarray, (nodes, dim)
        [m]
    vectors : ndarray, (d, dim)
        Lattice vectors [m].
    ends, offsets, blocks, mass
        As of `BlochMatrix.of`; blocks by differences are positive definite.
    """

    positions: Array
    vectors: Array
    ends: Indices
    offsets: Indices
    blocks: Array
    mass: Array

    @property
    def nodes(self) -> int:
        """Number of nodes of a cell."""
        return len(self.mass)

    def refuse_unbalanced(self) -> None:
        """Refuse nothing: bonds are measured from their equilibrium."""


def chunks(count: int, size: int) -> Iterator[slice]:
    """Slices of `count` matrices of some rows that are computed together."""
    step = min(CHUNK, max(NUMBERS // max(size, 1) ** 2, 1))
    return (slice(start, start + step) for start in range(0, count, step))


def lowest_waves(
    ends: Indices, offsets: Indices, blocks: Array, mass: Array, phases: Array, count: int
) -> tuple[Array, Any]:
    """The lowest waves at one wave vector, from sparse matrices.

    A Hermitian matrix A + iB acts on real and imaginary parts as a symmetric one of twice the size,
    which has each eigenvalue twice.

    Parameters
    ----------
    ends, offsets, blocks, mass
        As of `BlochMatrix.of`.
    phases : ndarray, (d,)
        Phases per cell [rad].
    count : int

    Returns
    -------
    ndarray, (count,), and complex ndarray, (nodes dim, count)
        Squares of the frequencies [1/s^2], ascending, and shapes of unit modal mass.
    """
    from scipy.sparse import block_array, coo_array

    (i, j), dim, turn = ends.T, blocks.shape[-1], np.exp(1j * (offsets @ phases))[:, None, None]
    size = dim * len(mass)
    entries = [(i, i, blocks), (j, j, blocks), (i, j, -blocks * turn), (j, i, -blocks / turn)]
    row, column, each = (np.concatenate([entry[k] for entry in entries]) for k in range(3))
    rows = np.broadcast_to(dim * row[:, None, None] + np.arange(dim)[:, None], each.shape)
    columns = np.broadcast_to(dim * column[:, None, None] + np.arange(dim), each.shape)
    whole = coo_array((each.ravel(), (rows.ravel(), columns.ravel())), shape=(size, size)).tocsr()
    pair = block_array([[whole.real, -whole.imag], [whole.imag, whole.real]]).tocsr()
    weights = np.repeat(mass, dim)
    _, vectors = lowest(pair, np.tile(weights, 2), np.zeros((2 * size, 0)), 2 * count, SHIFT)
    root = np.sqrt(weights)[:, None]
    basis = np.linalg.svd(root * (vectors[:size] + 1j * vectors[size:]), full_matrices=False)[0]
    shapes = basis[:, :count] / root
    squares, mixed = np.linalg.eigh(shapes.conj().T @ (whole @ shapes))
    return squares, shapes @ mixed


def singular_frequencies(
    ends: Indices, offsets: Indices, roots: Array, mass: Array, phases: Array
) -> Array:
    """Frequencies as singular values of the square roots of the bonds' stiffnesses.

    Parameters
    ----------
    ends, offsets, mass
        As of `BlochMatrix.of`.
    roots : ndarray, shape of the blocks
        Symmetric square roots of the bonds' tangent stiffnesses.
    phases : ndarray, (points, d)
        Phases per cell [rad].

    Returns
    -------
    ndarray, (points, min(bonds, nodes) dim)
        [rad/s], ascending; frequencies beyond these are 0.
    """
    bonds, rows = roots.shape[:2]
    dim = mass.shape[1] if mass.ndim > 1 else rows
    frequencies = np.empty((len(phases), min(bonds * rows, len(mass) * dim)))
    each = np.arange(bonds)
    for of in chunks(len(phases), bonds * rows):
        turns = np.exp(1j * (phases[of] @ offsets.T))
        if mass.ndim > 1:
            scaled = np.zeros((len(turns), bonds, len(mass), rows, dim), dtype=complex)
            scaled[:, each, ends[:, 0]] = roots[..., :dim]
            scaled[:, each, ends[:, 1]] += roots[..., dim:] * turns[..., None, None]
            scaled = scaled.swapaxes(2, 3) / np.sqrt(mass)
        else:
            moves = np.zeros((len(turns), bonds, len(mass)), dtype=complex)
            moves[:, each, ends[:, 0]] = -1
            moves[:, each, ends[:, 1]] += turns
            scaled = roots[:, :, None, :] * moves[:, :, None, :, None] / np.sqrt(mass)[:, None]
        whole = scaled.reshape(len(turns), bonds * rows, len(mass) * dim)
        frequencies[of] = np.linalg.svd(whole, compute_uv=False)[:, ::-1]
    return frequencies
