"""Bloch waves of bonds that repeat from cell to cell: their matrices and frequencies.

Node j of the cell at offset o moves by u_j exp(i o.kappa), with the phases kappa per cell.  The
stiffness matrix K(kappa) is then a sum over the distinct offsets of the bonds, each of which is
assembled once; many wave vectors are computed together.  An eigenvalue w^2 carries the round-off
of the largest one, so that frequencies below about 1e-8 of the highest are lost.  Where every
bond's stiffness has a real square root, they are computed as singular values of these roots, to
full relative precision.  Bonds may be pair laws of sites of several coordinates (`PairLattice`).
Where members have mass, M(kappa) is a sum of the same kind, and its
Cholesky factor takes the place of the roots of the masses.
Source: L. Brillouin, Wave Propagation in Periodic Structures (1946), chapters III and IV; Phani,
Woodhouse & Fleck 2006, Wave propagation in two-dimensional periodic lattices.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.engine.forces import of_both_ends
from tensegrity.engine.inertia import ACROSS, END
from tensegrity.errors import TensegrityError
from tensegrity.minimum import lowest
from tensegrity.scenes.pair_dynamics import inertias
from tensegrity.springs.pair_law import PairLaw
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
    inertia : ndarray, (offsets, nodes dim, nodes dim), or None
        The parts of M where members have mass; else the `parts` are weighted with it.
    """

    offsets: Indices
    parts: Array
    inertia: Array | None = None

    @classmethod
    def of(
        cls, ends: Indices, offsets: Indices, blocks: Array, mass: Array,
        member_mass: Array | None = None,
    ) -> BlochMatrix:  # fmt: skip
        """Assemble M^-1/2 K M^-1/2, or K and M.

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
        member_mass : ndarray, (bonds,), optional
            [kg]

        Returns
        -------
        BlochMatrix
        """
        of_ends = blocks if mass.ndim > 1 else of_both_ends(blocks)
        distinct, parts = cls._assembled(ends, offsets, of_ends, len(mass))
        if member_mass is None:
            dim = parts.shape[1] // len(mass)
            root = np.sqrt(np.repeat(mass, dim) if mass.ndim == 1 else mass.ravel())
            return cls(distinct, parts / (root[:, None] * root))
        each = np.kron([[END, ACROSS], [ACROSS, END]], np.eye(blocks.shape[-1]))
        of_members = member_mass[:, None, None] * each
        _, inertia = cls._assembled(ends, offsets, of_members, len(mass))
        inertia[_here(distinct)] += np.diag(np.repeat(mass, blocks.shape[-1]))
        return cls(distinct, parts, inertia)

    @staticmethod
    def _assembled(
        ends: Indices, offsets: Indices, of_ends: Array, nodes: int
    ) -> tuple[Indices, Array]:
        """Distinct offsets, and the sums of blocks by both ends of the bonds at each."""
        (i, j), dim = ends.T, of_ends.shape[-1] // 2
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
        check.memory(f"waves of {nodes} nodes", 24.0 * len(distinct) * (dim * nodes) ** 2)
        parts = np.zeros((len(distinct), nodes, nodes, dim, dim))
        np.add.at(parts, (number.ravel(), row, column), each)
        size = dim * nodes
        return distinct, parts.swapaxes(2, 3).reshape(-1, size, size)

    @property
    def bound(self) -> float:
        """An upper bound on the squares of the frequencies at all phases."""
        largest = np.abs(self.parts).sum(axis=(0, 2))
        if self.inertia is not None:  # M is diagonally dominant
            sums = np.abs(self.inertia).sum(axis=(0, 2))
            largest = largest / (2 * self.inertia[_here(self.offsets)].diagonal() - sums)
        return float(largest.max())

    def scaled(self, weights: Any) -> tuple[Any, Any]:
        """The matrices whose eigenvalues are squares of frequencies, (..., size, size), and with
        mass of members the Cholesky factors of M, by which they are scaled; else None."""
        whole = self.at(weights)
        if self.inertia is None:
            return whole, None
        root = self.factor(weights)
        half = np.linalg.solve(root, whole)
        return np.linalg.solve(root, _adjoint(half)), root

    def factor(self, weights: Any) -> Any:
        """Cholesky factors of M at complex weights, (..., size, size)."""
        return np.linalg.cholesky(self.at(weights, self.inertia))

    def at(self, weights: Any, parts: Array | None = None) -> Any:
        """The sums of the parts, or of others, with complex weights (..., offsets):
        (..., size, size)."""
        parts = self.parts if parts is None else parts
        matrices = np.empty((*weights.shape[:-1], *parts.shape[1:]), dtype=complex)
        flat = parts.reshape(len(parts), -1)
        matrices.real = (weights.real @ flat).reshape(matrices.shape)
        matrices.imag = (weights.imag @ flat).reshape(matrices.shape)
        return matrices

    def weights(self, phases: Array) -> Any:
        """exp(i o.kappa) at phases (..., d): (..., offsets)."""
        return np.exp(1j * (phases @ self.offsets.T))


def _adjoint(matrices: Any) -> Any:
    return matrices.conj().swapaxes(-1, -2)


def _here(offsets: Indices) -> int:
    """The place of offset 0."""
    return int(np.flatnonzero(~offsets.any(axis=1))[0])


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


class PairLattice(PeriodicBonds):
    """A periodic lattice of sites joined by pair laws, at rest.

    Parameters
    ----------
    vectors : array_like, (d, space)
        Lattice vectors [m].
    positions : array_like, (sites, space)
        Of the sites of a cell [m].
    bonds : sequence of (int, int, offset, PairLaw)
        Each joins the first site of a cell, the `first` of the law, to the second one of the cell
        at an offset, d whole numbers (or one number, where d is 1).  The laws may differ.
    mass : float or array_like, (dim,) or (sites, dim), optional
        Inertias of one site or of all, > 0.

    Raises
    ------
    TensegrityError
        Arguments that are not as described.

    Examples
    --------
    Rotating units in a row, of elongation and bending, at two phases:

    >>> import sympy as sp
    >>> from tensegrity import PairLattice, PairLaw, bands
    >>> (u, a), (U, A) = sp.symbols("u a"), sp.symbols("U A")
    >>> pair = PairLaw((U - u) ** 2 / 2 + (A + a) ** 2 / 4, (u, a), (U, A))
    >>> row = PairLattice([[1.0]], [[0.0]], [(0, 0, 1, pair)], mass=(1.0, 0.5))
    >>> bands(row, [[0.0], [3.0]]).frequencies.round(4)
    array([[0.    , 2.    ],
           [0.1415, 1.995 ]])
    """

    def __init__(
        self,
        vectors: ArrayLike,
        positions: ArrayLike,
        bonds: Sequence[tuple[int, int, Any, PairLaw]],
        mass: ArrayLike = 1.0,
    ) -> None:
        rows, places = check.floats("vectors", vectors), check.floats("positions", positions)
        if rows.ndim != 2 or places.ndim != 2 or rows.shape[1:] != places.shape[1:]:
            raise TensegrityError(
                f"vectors {rows.shape} and positions {places.shape} must be (d, space) and "
                "(sites, space)"
            )
        rows = check.vector("vectors", rows, rows.shape)
        places = check.vector("positions", places, places.shape)
        ends, offsets, laws = _joined(bonds, len(places), len(rows))
        dim = laws[0].law.dim
        for number, law in enumerate(laws):
            if law.law.dim != dim:
                raise TensegrityError(
                    f"pair law of bond {number} has {law.law.dim} coordinates, that of bond 0 {dim}"
                )
        fraction = 1 / np.maximum(np.bincount(ends.ravel(), minlength=len(places)), 1)
        rest = np.zeros((2, 1, dim))
        blocks = np.concatenate(
            [
                law.shared(*fraction[pair].tolist()).tangent(*rest)
                for law, pair in zip(laws, ends, strict=True)
            ]
        )
        weights = inertias(mass, (len(places), dim))
        super().__init__(places, rows, ends, offsets, blocks, weights)

    def __repr__(self) -> str:
        sites, dim = self.mass.shape
        return f"PairLattice({sites} sites of {dim} coordinates a cell, {len(self.ends)} bonds)"


def chunks(count: int, size: int) -> Iterator[slice]:
    """Slices of `count` matrices of some rows that are computed together."""
    step = min(CHUNK, max(NUMBERS // max(size, 1) ** 2, 1))
    return (slice(start, start + step) for start in range(0, count, step))


def lowest_waves(
    ends: Indices, offsets: Indices, blocks: Array, mass: Array, phases: Array, count: int,
    member_mass: Array | None = None,
) -> tuple[Array, Any]:  # fmt: skip
    """The lowest waves at one wave vector, from sparse matrices.

    A Hermitian matrix A + iB acts on real and imaginary parts as a symmetric one of twice the size,
    which has each eigenvalue twice.

    Parameters
    ----------
    ends, offsets, blocks, mass, member_mass
        As of `BlochMatrix.of`.
    phases : ndarray, (d,)
        Phases per cell [rad].
    count : int

    Returns
    -------
    ndarray, (count,), and complex ndarray, (nodes dim, count)
        Squares of the frequencies [1/s^2], ascending, and shapes of unit modal mass.
    """
    from scipy.sparse import block_array, coo_array, diags_array

    (i, j), dim, turn = ends.T, blocks.shape[-1], np.exp(1j * (offsets @ phases))[:, None, None]
    size, weights = dim * len(mass), np.repeat(mass, dim)

    def assembled(own: Array, across: Array) -> Any:
        entries = [(i, i, own), (j, j, own), (i, j, across * turn), (j, i, across / turn)]
        row, column, each = (np.concatenate([entry[k] for entry in entries]) for k in range(3))
        rows = np.broadcast_to(dim * row[:, None, None] + np.arange(dim)[:, None], each.shape)
        columns = np.broadcast_to(dim * column[:, None, None] + np.arange(dim), each.shape)
        at = rows.ravel(), columns.ravel()
        return coo_array((each.ravel(), at), shape=(size, size)).tocsr()

    def twice(whole: Any) -> Any:
        return block_array([[whole.real, -whole.imag], [whole.imag, whole.real]]).tocsr()

    whole, heavy = assembled(blocks, -blocks), None
    if member_mass is not None:
        each = member_mass[:, None, None] * np.eye(dim)
        heavy = assembled(END * each, ACROSS * each) + diags_array(weights)
    mass_of_both = np.tile(weights, 2) if heavy is None else twice(heavy)
    _, vectors = lowest(twice(whole), mass_of_both, np.zeros((2 * size, 0)), 2 * count, SHIFT)
    both = vectors[:size] + 1j * vectors[size:]  # each wave twice, at some phase
    if heavy is None:
        root = np.sqrt(weights)[:, None]
        shapes = np.linalg.svd(root * both, full_matrices=False)[0][:, :count] / root
    else:
        sizes, mixed = np.linalg.eigh(both.conj().T @ (heavy @ both))
        shapes = both @ (mixed[:, -count:] / np.sqrt(sizes[-count:]))
    squares, mixed = np.linalg.eigh(shapes.conj().T @ (whole @ shapes))
    return squares, shapes @ mixed


def singular_frequencies(
    ends: Indices, offsets: Indices, roots: Array, mass: Array, phases: Array,
    heavy: BlochMatrix | None = None,
) -> Array:  # fmt: skip
    """Frequencies as singular values of the square roots of the bonds' stiffnesses.

    Parameters
    ----------
    ends, offsets, mass
        As of `BlochMatrix.of`.
    roots : ndarray, shape of the blocks
        Symmetric square roots of the bonds' tangent stiffnesses.
    phases : ndarray, (points, d)
        Phases per cell [rad].
    heavy : BlochMatrix, optional
        Whose M replaces the masses, where members have mass.

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
        if heavy is not None:
            factor = heavy.factor(heavy.weights(phases[of]))
            whole = _adjoint(np.linalg.solve(factor, _adjoint(whole)))
        frequencies[of] = np.linalg.svd(whole, compute_uv=False)[:, ::-1]
    return frequencies


def _joined(bonds: Any, sites: int, d: int) -> tuple[Any, Any, list[PairLaw]]:
    """Ends and offsets of bonds, and their laws."""
    ends, offsets, laws = [], [], []
    for number, bond in enumerate(check.sequence("bonds", bonds, "bonds")):
        if not isinstance(bond, (tuple, list)) or len(bond) != 4:
            raise TensegrityError(f"bond {number} must be (site, site, offset, PairLaw)")
        one, other, offset, law = bond
        name = f"bond {number}"
        ends.append([check.whole(f"site of {name}", x, least=0, below=sites) for x in (one, other)])
        each = [offset] if np.ndim(offset) == 0 else list(offset)
        if len(each) != d:
            raise TensegrityError(f"offset {check.shown(offset)} of {name} must be {d} numbers")
        offsets.append([check.whole(f"offset of {name}", x) for x in each])
        check.kind(f"pair law of {name}", law, PairLaw)
        laws.append(law)
        if one == other and not any(offsets[-1]):
            raise TensegrityError(f"{name} joins site {one} to itself")
    if not laws:
        raise TensegrityError("bonds of a lattice are empty, must be one or more")
    return np.array(ends), np.array(offsets), laws
