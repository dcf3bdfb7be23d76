"""Waves of small amplitude in a prestressed lattice: frequencies, group velocities, band gaps.

The lattice is linearised about its own state, in which some strings may be slack.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.errors import TensegrityError
from tensegrity.lattices.bloch import (
    BlochMatrix,
    PeriodicBonds,
    chunks,
    lowest_waves,
    singular_frequencies,
)
from tensegrity.lattices.cell import Cell
from tensegrity.lattices.periodic import Periodic
from tensegrity.minimum import DENSE, ZERO
from tensegrity.printing import Lines, Printed, span
from tensegrity.typing import Array

SLOW = 1e-5  # lowest over highest frequency below which singular values are computed
EQUAL = 1e-9  # of the largest square of a frequency: closer ones are treated as degenerate
GENERIC = np.array([1.0, 0.618, 0.414])  # a direction of phases without symmetry
MOST = 10**8  # numbers of a result, which take minutes
FASTEST = 1e100  # bound of frequencies, whose squares are finite [rad/s]
TURNS = 1e9  # bound of phases, which keep 7 decimals there [rad]
OPEN = 1e-9  # of the highest frequency: the least gap
SHOWN = 4  # gaps that are printed
NEGATIVE = 1e-14  # eigenvalue of a bond over the largest that is round-off


@dataclass(frozen=True, eq=False, repr=False)
class Bands(Printed):
    """Frequencies of the waves of a lattice.

    Attributes
    ----------
    wavenumbers : ndarray, (points, d)
        Phases per cell [rad].
    frequencies : ndarray, (points, nodes dim)
        Angular frequencies [rad/s], ascending; below 0 the rate [1/s] at which an unstable wave
        grows.
    velocities : ndarray, (points, nodes dim, dim), or None
        Group velocities [m/s]; NaN where the frequency is not above 0.
    shapes : complex ndarray, (points, nodes dim, nodes, dim), or None
        Displacements of each wave in the cell at offset 0 [1/sqrt(kg)]: the sum of m |u|^2 is 1,
        or u^H M u where members have mass or a matrix.  Of lattices in a mesh they are coordinates,
        (points, branches, coordinates, 1): see `Embedded.displacements`.
    losses : ndarray, (points, branches), or None
        Loss factors in a matrix with losses, to first order in its own: the part of it that is
        the matrix' elastic energy over the whole.  Amplitudes decay at the rate losses w/2 [1/s].
    """

    wavenumbers: Array
    frequencies: Array
    velocities: Array | None = field(repr=False)
    shapes: Array | None = field(repr=False)
    losses: Array | None = field(default=None, repr=False)

    def _lines(self) -> Lines:
        points, branches = self.frequencies.shape
        of = f"{branches} branches at {points} wavenumbers: frequencies "
        yield of + span(self.frequencies, "rad/s")
        open_gaps = self.gaps if points > 1 else np.zeros((0, 2))
        widest = open_gaps[np.argsort(open_gaps[:, 0] - open_gaps[:, 1])[:SHOWN]]
        gaps = ", ".join(span(gap, "rad/s") for gap in np.sort(widest, axis=0)) or "none"
        more = f"{len(open_gaps)}, the widest " if len(open_gaps) > SHOWN else ""
        yield f"  gaps: {more}{gaps}"

    @property
    def gaps(self) -> Array:
        """Ranges of frequency between neighbouring branches without any wave at these wavenumbers
        [rad/s], (gaps, 2), ascending.

        Raises
        ------
        TensegrityError
            If there are fewer than 2 wave vectors.
        """
        w = self.frequencies
        if len(w) < 2:
            raise TensegrityError(f"gaps from {len(w)} wavenumbers, must be at least 2")
        edges = np.stack([w.max(axis=0)[:-1], w.min(axis=0)[1:]], axis=1)
        return np.asarray(edges[np.diff(edges, axis=1)[:, 0] > OPEN * w.max()])


@checked
def bands(
    lattice: Periodic,
    wavenumbers: ArrayLike,
    velocities: bool = False,
    shapes: bool = False,
    count: int | None = None,
) -> Bands:
    """The waves of small amplitude of a lattice.

    Parameters
    ----------
    lattice : Lattice, PeriodicBonds or Embedded
        With its nodes in equilibrium; a macroscopic stress is allowed.  The second are a
        `PairLattice`, and columns of plates, `Prism.column`; also an `Embedded` one, in a mesh.
    wavenumbers : array_like, (points, d)
        Phase differences between adjacent cells along each lattice vector [rad].
    velocities, shapes : bool, optional
        Whether to compute these.
    count : int, optional
        Number of branches to compute, the lowest ones, without velocities; by default all.  For
        cells of more than some hundred nodes sparse matrices are used.

    Returns
    -------
    Bands

    Raises
    ------
    TensegrityError
        Bad input.
    EquilibriumError
        The nodes are not in equilibrium.

    Notes
    -----
    Frequencies below about 1e-8 of the highest are round-off and are set to 0, unless all members
    are in tension or free of force: then they are computed as singular values, to full relative
    precision.  Otherwise long waves are better described by `moduli`.

    Examples
    --------
    A row of unit masses on strings of stiffness 1 and force density 0.1: transverse and axial.

    >>> import numpy as np
    >>> from tensegrity import Lattice, bands
    >>> row = Lattice([(0, 0)], [(1, 0)], strings=[(0, 0, 1)]).prestressed([0.1])
    >>> bands(row, [[np.pi], [np.pi / 3]]).frequencies.round(4)
    array([[0.6325, 2.    ],
           [0.3162, 1.    ]])
    """
    size, dim = math.prod(lattice._unknowns), lattice.vectors.shape[1]
    each = size if count is None else check.whole("count", count, least=1, below=size + 1)
    q = _phases(lattice, wavenumbers, each)
    numbers = 6 + 2 * velocities * (q.shape[1] + dim) + 6 * shapes * size
    check.memory(f"bands at {len(q)} wavenumbers", 8.0 * numbers * each * len(q))
    lattice.refuse_unbalanced()
    if count is not None:
        return _lowest(lattice, q, each, velocities, shapes)
    matrix = bloch_matrix(lattice)
    count = len(q)
    squares = np.empty((count, size))
    moved = np.empty((count, size, size), dtype=complex) if shapes else None
    rates = np.empty((count, size, len(lattice.vectors))) if velocities else None
    losses = np.empty((count, size)) if lattice._lossy else None
    for of in chunks(count, size):
        weights = matrix.weights(q[of])
        whole, root = matrix.scaled(weights)
        if rates is None and moved is None and losses is None:
            squares[of] = np.linalg.eigvalsh(whole)
            continue
        squares[of], vectors = np.linalg.eigh(whole)
        if root is not None:
            vectors = np.linalg.solve(root.conj().swapaxes(1, 2), vectors)
        if rates is not None:
            for point, (w, column) in enumerate(zip(weights, vectors, strict=True)):
                rates[of.start + point] = _rates(matrix, w, squares[of.start + point], column)
        if losses is not None:
            losses[of] = [*map(lattice._loss_factors, q[of], squares[of], vectors)]
        if moved is not None:
            moved[of] = vectors.swapaxes(1, 2)
    w = _frequencies(lattice, squares, q, matrix)
    group = None
    if rates is not None:
        with np.errstate(divide="ignore", invalid="ignore"):
            group = np.where(w > 0, 0.5 / w, np.nan)[..., None] * (rates @ lattice.vectors)
    return Bands(q, w, group, _unweighted(lattice, matrix, moved), losses)


def _lowest(lattice: Periodic, q: Array, count: int, velocities: bool, shapes: bool) -> Bands:
    """The lowest branches."""
    size = math.prod(lattice._unknowns)
    if velocities:
        raise TensegrityError(f"velocities require all branches, not the lowest {count}")
    if size <= DENSE or 2 * count >= size // 4:
        whole = bands(lattice, q, shapes=shapes)
        moved = None if whole.shapes is None else whole.shapes[:, :count]
        losses = None if whole.losses is None else whole.losses[:, :count]
        return Bands(q, whole.frequencies[:, :count], None, moved, losses)
    matrix = bloch_matrix(lattice, sparse=True)
    squares = np.empty((len(q), count))
    moved = np.empty((len(q), count, size), dtype=complex) if shapes else None
    losses = np.empty((len(q), count)) if lattice._lossy else None
    for point, phase in enumerate(q):
        squares[point], vectors = lowest_waves(matrix, phase, count)
        if losses is not None:
            losses[point] = lattice._loss_factors(phase, squares[point], vectors)
        if moved is not None:
            moved[point] = vectors.T
    squares[np.abs(squares) <= ZERO * matrix.bound] = 0
    w = np.sign(squares) * np.sqrt(np.abs(squares))
    return Bands(q, w, None, _unweighted(lattice, matrix, moved), losses)


def _unweighted(lattice: Periodic, matrix: BlochMatrix, moved: Any) -> Any:
    """Displacements of the nodes from eigenvectors (points, branches, size)."""
    if moved is None:
        return None
    return (moved / matrix.root).reshape(*moved.shape[:2], *lattice._unknowns)


def bloch_matrix(lattice: Periodic, weighted: bool = True, sparse: bool = False) -> BlochMatrix:
    """M^-1/2 K(kappa) M^-1/2 of a lattice, or K(kappa) itself; where M is no diagonal, that and
    M(kappa).

    Parameters
    ----------
    lattice : Lattice, PeriodicBonds or Embedded
    weighted, sparse : bool, optional
        Whether by the masses; whether for sparse matrices.

    Returns
    -------
    BlochMatrix
    """
    stiffness, mass, inertia = lattice._assembly()
    mass = mass if weighted or inertia else np.ones_like(mass)
    return BlochMatrix.of(stiffness, mass, inertia, sparse)


def _phases(lattice: Periodic, wavenumbers: ArrayLike, each: int) -> Array:
    """Phases per cell (points, d) [rad], checked, for `each` frequencies at each."""
    q, d = _not_many("wavenumbers", wavenumbers, each), len(lattice.vectors)
    if q.ndim != 2 or q.shape[1] != d or not len(q):
        raise TensegrityError(
            f"wavenumbers have shape {q.shape}, must be (points, {d}), at least 1 point"
        )
    q = check.vector("wavenumbers", q, q.shape)
    if np.abs(q).max() >= TURNS:
        raise TensegrityError(
            f"wavenumbers reach {np.abs(q).max():g} rad, must be below {TURNS:g} rad in size"
        )
    return q


def angular_frequencies(frequencies: ArrayLike, each: int) -> Array:
    """Angular frequencies (frequencies,) [rad/s], checked, for results of some numbers each."""
    w = _not_many("frequencies", frequencies, each)
    if w.ndim != 1:
        raise TensegrityError(f"frequencies have shape {w.shape}, must be (frequencies,)")
    w = check.vector("frequencies", w, w.shape)
    wrong = w[~((w >= 0) & (w < FASTEST))]
    if wrong.size:
        raise TensegrityError(f"frequency {wrong[0]:g} rad/s must be >= 0 and below {FASTEST:g}")
    return w


def _not_many(name: str, given: ArrayLike, each: int) -> Array:
    """Numbers as an array, refused if a result with `each` numbers a row has more than `MOST`."""
    given = given if isinstance(given, np.ndarray) else check.floats(name, given)
    count = len(given) if given.ndim else 1
    if count * each > MOST:
        raise TensegrityError(
            f"{count} {name} of {each} numbers each would take {8e-9 * count * each:.3g} GB of "
            f"memory, must be at most {8e-9 * MOST:g} GB: compute them in parts"
        )
    return check.floats(name, given)


def _frequencies(lattice: Periodic, squares: Array, q: Array, matrix: BlochMatrix) -> Array:
    """Frequencies of eigenvalues, 0 where they are round-off, or singular values there."""
    largest = matrix.bound
    least = ZERO * largest
    w = np.sign(squares) * np.sqrt(np.abs(np.where(np.abs(squares) <= least, 0.0, squares)))
    slow = np.flatnonzero(np.abs(squares).min(axis=1) < SLOW**2 * largest)
    bonds = lattice if slow.size else None
    if isinstance(bonds, PeriodicBonds) or (
        isinstance(bonds, Cell) and (bonds.tensions >= 0).all()
    ):
        values, vectors = np.linalg.eigh(bonds.blocks)
        if bonds.mass.ndim > 1:  # by both ends
            if values.min() < -NEGATIVE * values.max():
                return w
            values = np.where(values > NEGATIVE * values.max(), values, 0.0)
        root = (vectors * np.sqrt(np.maximum(values, 0))[:, None]) @ vectors.swapaxes(1, 2)
        mass, heavy = bonds.mass, None
        if matrix.inertia is not None:
            mass, heavy = np.ones_like(mass), matrix
        exact = singular_frequencies(bonds.ends, bonds.offsets, root, mass, q[slow], heavy)
        w[slow] = 0
        w[slow, w.shape[1] - exact.shape[1] :] = exact
        w[slow] = np.where(w[slow] > ZERO * np.sqrt(largest), w[slow], 0.0)
    return w


def _rates(matrix: BlochMatrix, weights: Array, squares: Array, vectors: Array) -> Array:
    """Derivatives of the eigenvalues with respect to the phases, (size, d).

    Where eigenvalues coincide they belong to the shapes that diagonalise the derivative along a
    direction without symmetry.
    """
    turns = 1j * matrix.offsets.T * weights
    turned = vectors.conj().T @ matrix.at(turns) @ vectors
    if matrix.inertia is not None:
        turned -= vectors.conj().T @ matrix.at(turns, matrix.inertia) @ vectors * squares
    rates = np.einsum("aii->ia", turned.real).copy()
    equal = np.diff(squares) <= EQUAL * np.abs(squares).max()
    edges = np.flatnonzero(np.diff(np.concatenate([[False], equal, [False]]).astype(int)))
    for first, last in edges.reshape(-1, 2):
        group = slice(first, last + 1)
        inner = turned[:, group, group]
        mixed = np.linalg.eigh(np.tensordot(GENERIC[: len(inner)], inner, 1))[1]
        rates[group] = np.einsum("ji,ajk,ki->ia", mixed.conj(), inner, mixed).real
    return rates
