"""Waves that decay from cell to cell: the complex band structure of a lattice.

With phases fixed along the other lattice vectors, waves u lambda^n along one of them obey
(P lambda + D + P^H/lambda) u = 0, D = K - w^2 M of the cells of one layer, P the stiffness that
joins a layer to the next.  P is singular as a rule: with P = L R^H of its rank r, a = R^H u and
b = L^H u/lambda the pencil has 2r eigenvalues besides infinite ones, and needs no inverse.
Source: Laude, Achaoui, Benchabane & Khelif 2009, Evanescent Bloch waves and the complex band
structure of phononic crystals.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.lattices.bands import angular_frequencies, bloch_matrix
from tensegrity.lattices.lattice import Lattice

RANK = 1e-12  # singular values of the coupling that count as zero, over the largest
SPLIT = 1e-7  # decay that counts as zero: double roots at edges of bands split by so much
NEAREST = 1e-13  # of a pencil's eigenvalues: lambda that counts as zero


def decay(
    lattice: Lattice, frequencies: ArrayLike, axis: int = 0, wavenumbers: ArrayLike = 0.0
) -> Any:
    """Complex phases per cell of all waves of given frequencies along one lattice vector.

    Parameters
    ----------
    lattice : Lattice
        With its nodes in equilibrium; it may be unstable.
    frequencies : array_like, (frequencies,)
        Angular frequencies [rad/s].
    axis : int, optional
        Number of the lattice vector along which the phases are complex.
    wavenumbers : array_like, (d - 1,), optional
        Real phases per cell along the other lattice vectors [rad]; one number serves all.

    Returns
    -------
    complex ndarray, (frequencies, count)
        Phases kappa [rad], displacements ~ exp(i n kappa) in cell n, ascending in abs(Im kappa),
        the decay per cell; propagating waves have 0.  Waves come in pairs of kappa and its
        conjugate.  An infinite imaginary part belongs to a wave that ends within its cell.

    Raises
    ------
    TensegrityError
        Bad input, or no member leads along the axis.
    EquilibriumError
        The nodes are not in equilibrium.

    Examples
    --------
    Above its highest frequency 2 a chain of unit masses and springs has 2 cosh(decay) = w^2 - 2:

    >>> import numpy as np
    >>> from tensegrity import Lattice, decay
    >>> chain = Lattice([(0, 0)], [(1, 0)], bars=[(0, 0, 1)], k_bar=1)
    >>> abs(decay(chain, [1, 3]).imag).round(6).tolist()
    [[0.0, 0.0], [1.924847, 1.924847]]
    """
    check.kind("lattice", lattice, Lattice)
    w = angular_frequencies(frequencies)
    d = len(lattice.vectors)
    axis = check.whole("axis", axis, least=0, below=d)
    across = check.floats("wavenumbers", wavenumbers)
    across = check.vector("wavenumbers", across, across.shape if across.ndim == 0 else (d - 1,))
    across = np.broadcast_to(across, d - 1)
    lattice.refuse_unbalanced()
    layers = int(np.abs(lattice.offsets[:, axis]).max())
    if not layers:
        raise TensegrityError(f"no member leads along lattice vector {axis}")
    counts = np.ones(d, dtype=int)
    counts[axis] = layers
    matrix = bloch_matrix(lattice if layers == 1 else lattice.repeated(counts.tolist()))
    weights = np.exp(1j * (np.delete(matrix.offsets, axis, axis=1) @ across))
    own, next_one = (
        matrix.at(np.where(matrix.offsets[:, axis] == step, weights, 0)) for step in (0, 1)
    )
    left, sizes, right = np.linalg.svd(next_one)
    rank = int(np.sum(sizes > RANK * sizes[0]))
    pair = left[:, :rank] * sizes[:rank], right[:rank].conj().T
    found = [_phases(own - x**2 * np.eye(len(own)), pair, layers) for x in w]
    return np.array(found).reshape(len(w), 2 * rank)


def _phases(own: Any, pair: Any, layers: int) -> Any:
    """Phases per cell of the waves of one frequency, by a supercell of `layers` cells."""
    from scipy.linalg import eig

    (left, right), (size, rank) = pair, pair[0].shape
    scale = float(np.abs(own).max())
    a, b = np.zeros((2, size + 2 * rank, size + 2 * rank), dtype=complex)
    first, second = slice(size, size + rank), slice(size + rank, None)
    a[:size, :size], a[:size, second], b[:size, first] = own, right, -left
    a[first, :size], a[first, first] = scale * right.conj().T, -scale * np.eye(rank)
    a[second, :size], b[second, second] = left.conj().T, np.eye(rank)
    values, vectors = eig(a, b, homogeneous_eigvals=True)
    values = values / np.hypot(*np.abs(values))
    number = np.argsort(-np.abs(values[1]))[: 2 * rank]  # the others are infinite
    ratio = np.maximum(np.abs(values[:, number]), np.finfo(float).tiny)
    kappa = -1j * np.log(ratio[0] / ratio[1]) / layers
    turned = values[0, number] * values[1, number].conj()
    if layers > 1:  # the phase of a cell, which is that of the supercell but for whole turns
        cells = vectors[:size, number].reshape(layers, -1, 2 * rank)
        turned = np.sum(cells[:-1].conj() * cells[1:], axis=(0, 1))
    kappa = np.angle(turned) + kappa
    ends = ratio.min(axis=0) < NEAREST
    kappa.real[ends], kappa.imag[ends] = 0, np.inf * np.sign(kappa.imag[ends])
    kappa[np.abs(kappa.imag) < SPLIT] = kappa[np.abs(kappa.imag) < SPLIT].real
    return kappa[np.argsort(np.abs(kappa.imag), kind="stable")]
