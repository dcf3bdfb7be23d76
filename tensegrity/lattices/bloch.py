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

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.engine.forces import of_both_ends
from tensegrity.errors import TensegrityError
from tensegrity.lattices.periodic import Assembly, Entries, Periodic
from tensegrity.minimum import lowest
from tensegrity.scenes.pair_dynamics import inertias
from tensegrity.springs.pair_law import PairLaw
from tensegrity.typing import Array, Flags, Indices

LEAST_INERTIA = 1 / 8  # of M over its diagonal: that of bricks, members and wedges have more
LEFT = 1e-7  # forces that motions without stiffness leave, over the largest one
SHIFT = 1e-6  # below 0 of sparse eigenvalues, over the largest stiffness over mass
CHUNK, NUMBERS = 64, 2**23  # matrices that are computed together, and their numbers


@dataclass(frozen=True, eq=False)
class BlochMatrix:
    """The sum of S_o exp(i o.kappa) over offsets o, where S_-o is the transpose of S_o.

    Attributes
    ----------
    offsets : ndarray of int, (offsets, d)
        All distinct ones, with their opposites and 0.
    parts : ndarray, (offsets, size, size), or of sparse ones (offsets, nonzeros)
    inertia : as `parts`, or None
        The parts of M where it is no diagonal; else the `parts` are weighted with it.
    nonzeros : tuple of two ndarrays of int, or None
        Of sparse matrices: the rows of the nonzeros, ascending, and their columns.
    root : ndarray, (size,), or 1
        The roots of the masses by which the `parts` are weighted.
    """

    offsets: Indices
    parts: Array
    inertia: Array | None = None
    nonzeros: tuple[Indices, Indices] | None = None
    root: Any = 1.0

    @classmethod
    def of(
        cls, stiffness: Sequence[Entries], mass: Array, inertia: Sequence[Entries] = (),
        sparse: bool = False,
    ) -> BlochMatrix:  # fmt: skip
        """Assemble M^-1/2 K M^-1/2, or K and M.

        Parameters
        ----------
        stiffness : sequence of Entries
            Of K [N/m].
        mass : ndarray, (size,)
            Diagonal of M [kg], or the part of it to which `inertia` is added; ones give K itself.
        inertia : sequence of Entries, optional
            Of M [kg], where it is no diagonal.
        sparse : bool, optional

        Returns
        -------
        BlochMatrix
        """
        whole, size = [*stiffness, *inertia], len(mass)
        if inertia:
            whole.append(Entries.diagonal(mass, stiffness[0].offsets.shape[1]))
        starts = np.cumsum([0, *(len(one.offsets) for one in whole)])
        distinct, numbers = np.unique(
            np.concatenate([one.offsets for one in whole]), axis=0, return_inverse=True
        )
        number = np.concatenate([numbers.ravel()[k + one.number]
                                 for k, one in zip(starts, whole, strict=False)])  # fmt: skip
        place = np.concatenate([one.row * size + one.column for one in whole])
        nonzeros, shape = None, (size, size)
        if sparse:
            used, place = np.unique(place, return_inverse=True)
            nonzeros, shape = (used // size, used % size), (len(used),)
        count = math.prod(shape)
        check.memory(f"waves of {size} coordinates", 24.0 * len(distinct) * count)
        first = sum(len(one.values) for one in stiffness)

        def parts(of: slice) -> Array:
            values = np.concatenate([one.values for one in whole])[of]
            at = number[of] * count + place[of]
            return np.asarray(
                np.bincount(at, values, len(distinct) * count).reshape(-1, *shape), float
            )

        stiff = parts(slice(first))
        if inertia:
            return cls(distinct, stiff, parts(slice(first, None)), nonzeros)
        root = np.sqrt(mass)
        weights = (
            root[:, None] * root if nonzeros is None else root[nonzeros[0]] * root[nonzeros[1]]
        )
        return cls(distinct, stiff / weights, None, nonzeros, root)

    @property
    def size(self) -> int:
        """Number of coordinates of a cell."""
        return len(self.parts[0]) if self.nonzeros is None else int(self.nonzeros[0][-1]) + 1

    @property
    def bound(self) -> float:
        """An estimate from above of the squares of the frequencies at all phases."""
        largest = self._sums(self.parts)
        if self.inertia is not None:
            own = self.at(np.ones(len(self.offsets)), self.inertia).diagonal().real
            largest = largest / (LEAST_INERTIA * own)
        return float(largest.max())

    def _sums(self, parts: Array) -> Array:
        """Sums of the sizes of the rows, (size,)."""
        if self.nonzeros is None:
            return np.asarray(np.abs(parts).sum(axis=(0, 2)))
        return np.asarray(
            np.bincount(self.nonzeros[0], np.abs(parts).sum(axis=0), self.size), float
        )

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
        (..., size, size), or a sparse matrix at weights (offsets,)."""
        parts = self.parts if parts is None else parts
        matrices = np.empty((*weights.shape[:-1], *parts.shape[1:]), dtype=complex)
        flat = parts.reshape(len(parts), -1)
        matrices.real = (weights.real @ flat).reshape(matrices.shape)
        matrices.imag = (weights.imag @ flat).reshape(matrices.shape)
        if self.nonzeros is None:
            return matrices
        from scipy.sparse import csr_array

        row, column = self.nonzeros
        starts = np.searchsorted(row, np.arange(self.size + 1))
        return csr_array((matrices, column, starts), shape=(self.size, self.size))

    def weights(self, phases: Array) -> Any:
        """exp(i o.kappa) at phases (..., d): (..., offsets)."""
        return np.exp(1j * (phases @ self.offsets.T))


def _adjoint(matrices: Any) -> Any:
    return matrices.conj().swapaxes(-1, -2)


@dataclass(frozen=True, eq=False)
class PeriodicBonds(Periodic):
    """Bonds that repeat from cell to cell: the part of a lattice that `bands` requires.

    Attributes
    ----------
    positions : ndarray, (nodes, dim)
        [m]
    vectors : ndarray, (d, dim)
        Lattice vectors [m].
    ends, offsets, blocks, mass
        Nodes that the bonds join, the offsets of the cells of their second ends, and their tangent
        stiffness by the difference of their ends, positive definite (bonds, dim, dim); or, where
        `mass` (nodes, dim) has the inertias of all coordinates, by both ends.
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

    @property
    def _unknowns(self) -> tuple[int, int]:
        """Nodes of a cell, and coordinates of a node."""
        return self.nodes, self.mass.shape[1] if self.mass.ndim > 1 else self.positions.shape[1]

    def _assembly(self) -> Assembly:
        """Stiffness, masses of the coordinates, and no further inertia."""
        blocks, mass = self.blocks, self.mass.ravel()
        if self.mass.ndim == 1:
            blocks, mass = of_both_ends(blocks), np.repeat(mass, self._unknowns[1])
        return [Entries.of_bonds(self.ends, self.offsets, blocks)], mass, []

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


def lowest_waves(matrix: BlochMatrix, phases: Array, count: int) -> tuple[Array, Any]:
    """The lowest waves at one wave vector, from sparse matrices.

    Parameters
    ----------
    matrix : BlochMatrix
        Sparse.
    phases : ndarray, (d,)
        Phases per cell [rad].
    count : int

    Returns
    -------
    ndarray, (count,), and complex ndarray, (size, count)
        Squares of the frequencies [1/s^2], ascending, and shapes of unit modal mass.
    """
    weights = matrix.weights(phases)
    whole = matrix.at(weights)
    mass = np.ones(matrix.size)
    if matrix.inertia is not None:
        mass = matrix.at(weights, matrix.inertia)
    _, vectors = lowest(whole, mass, np.zeros((matrix.size, 0)), count, SHIFT)
    heavy = vectors if mass.ndim == 1 else mass @ vectors
    sizes, mixed = np.linalg.eigh(_adjoint(vectors) @ heavy)  # equal ones are not orthogonal yet
    shapes = vectors @ (mixed / np.sqrt(sizes))
    squares, mixed = np.linalg.eigh(_adjoint(shapes) @ (whole @ shapes))
    return squares, shapes @ mixed


def _sparse_motions(dynamic: Any, forces: Array, rigid: Array) -> tuple[Array, Flags]:
    """Motions under forces, without some rigid ones, and whether they are unbounded."""
    from scipy.sparse import block_array, csc_array
    from scipy.sparse.linalg import splu

    border = csc_array(float(np.abs(dynamic.diagonal()).max()) * rigid)
    whole = block_array([[dynamic, border], [border.T, None]]) if rigid.size else dynamic
    try:
        factors = splu(whole.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.01)
        found = factors.solve(np.pad(forces, ((0, rigid.shape[1]), (0, 0))))
    except RuntimeError:  # exactly singular
        return forces, np.array(True)
    motions = found[: len(forces)]
    left = np.abs(dynamic @ motions - forces).max()
    return motions, np.array(not left <= LEFT * np.abs(forces).max())


def singular_frequencies(
    ends: Indices, offsets: Indices, roots: Array, mass: Array, phases: Array,
    heavy: BlochMatrix | None = None,
) -> Array:  # fmt: skip
    """Frequencies as singular values of the square roots of the bonds' stiffnesses.

    Parameters
    ----------
    ends, offsets, mass
        As of `PeriodicBonds`.
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
