"""Waves that decay from cell to cell: the complex band structure of a lattice.

With phases fixed along the other lattice vectors, waves u lambda^n along one of them obey
(P lambda + D + P^H/lambda) u = 0, D = K - w^2 M of the cells of one layer, P the stiffness that
joins a layer to the next.  P is singular as a rule: with P = L R^H of its rank r, a = R^H u and
b = L^H u/lambda the pencil has 2r eigenvalues besides infinite ones, and requires no inverse.
Eigenvalues of waves confined to their cell are 0 or infinite, and are removed first.
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

RANK = 1e-12  # singular values that count as zero, over the largest stiffness
SPLIT = 1e-7  # decay that counts as zero: double roots at band edges split by this much


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
        Real phases per cell along the other lattice vectors [rad], or one number for all.

    Returns
    -------
    complex ndarray, (frequencies, count)
        Phases kappa [rad], displacements ~ exp(i n kappa) in cell n, ascending in abs(Im kappa),
        the decay per cell, which is 0 for propagating waves.  Waves come in pairs of kappa and its
        conjugate.  An infinite imaginary part belongs to a wave confined to its cell.

    Raises
    ------
    TensegrityError
        Bad input, or no member crosses from cell to cell along the axis.
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
        raise TensegrityError(f"no member crosses from cell to cell along lattice vector {axis}")
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
    numbers = [_phases(own - x**2 * np.eye(len(own)), pair, layers) for x in w]
    return np.array(numbers).reshape(len(w), 2 * rank)


def _phases(own: Any, pair: Any, layers: int) -> Any:
    """Phases per cell of the waves of one frequency, by a supercell of `layers` cells."""
    from scipy.linalg import eigvals

    left, right = pair
    scale = max(float(np.abs(own).max()), float(np.abs(left).max()))
    own, left, (size, rank) = own / scale, left / scale, left.shape
    a, b = np.zeros((2, size + 2 * rank, size + 2 * rank), dtype=complex)
    first, second = slice(size, size + rank), slice(size + rank, None)
    a[:size, :size], a[:size, second], b[:size, first] = own, right, -left
    a[first, :size], a[first, first] = right.conj().T, -np.eye(rank)
    a[second, :size], b[second, second] = left.conj().T, np.eye(rank)
    b, a = _without_zero(*_without_zero(a, b)[::-1])
    values = eigvals(a, b)
    kappa = -1j * np.log(np.abs(values)) / layers
    if layers == 1:
        kappa += np.angle(values)
    else:  # the phase of a cell, which is that of the supercell up to multiples of 2 pi
        kappa += [_turn(own, left @ right.conj().T, value, layers) for value in values]
    kappa[np.abs(kappa.imag) < SPLIT] = kappa[np.abs(kappa.imag) < SPLIT].real
    ends = np.zeros(2 * rank - len(kappa), dtype=complex)
    ends.imag = np.where(np.arange(len(ends)) % 2, -np.inf, np.inf)
    return np.concatenate([kappa[np.argsort(np.abs(kappa.imag), kind="stable")], ends])


def _without_zero(a: Any, b: Any) -> tuple[Any, Any]:
    """The pencil a x = lambda b x without its eigenvalue 0: where this is defective, it would be
    computed with an error of some root of round-off (Van Dooren 1979).  Entries are of
    order 1."""
    while len(a):
        _, sizes, vectors = np.linalg.svd(a)
        rank = int(np.sum(sizes > RANK))
        if rank == len(a):
            break
        rest, null = vectors[:rank].conj().T, vectors[rank:].conj().T
        rows = np.linalg.qr(b @ null, mode="complete")[0][:, len(a) - rank :].conj().T
        a, b = rows @ a @ rest, rows @ b @ rest
    return a, b


def _turn(own: Any, next_one: Any, value: complex, layers: int) -> float:
    """The phase [rad] of a wave from cell to cell in a supercell."""
    whole = own + next_one * value + next_one.conj().T / value
    cells = np.linalg.svd(whole)[2][-1].conj().reshape(layers, -1)
    return float(np.angle(np.sum(cells[:-1].conj() * cells[1:])))
