"""Response of a lattice at a frequency: waves that decay from cell to cell, and effective mass.

With phases fixed along the other lattice vectors, waves u lambda^n along one of them obey
(P lambda + D + P^H/lambda) u = 0, D = K - w^2 M of the cells of one layer, P the stiffness that
joins a layer to the next.  Rows and columns are scaled by the roots of their stiffness plus
inertia.  P is singular as a rule: with P = L R^H of its rank r, a = R^H u and b = L^H u/lambda the
pencil has 2r eigenvalues besides infinite ones, and requires no inverse.
Eigenvalues of waves confined to their cell are 0 or infinite, and are removed first.

Effective mass is the inertia of a frame of nodes that move together, with the others attached.
A translation T of the frame pulls the other nodes by f = -K_if T = K_ii T, and these follow by
(K_ii - w^2 M_i)^-1 f.  Their momentum gives m(w) = m_frame + (M_i T)^T (K_ii - w^2 M_i)^-1 f, where
nothing cancels.
Source: Laude, Achaoui, Benchabane & Khelif 2009, Evanescent Bloch waves and the complex band
structure of phononic crystals; Milton & Willis 2007, On modifications of Newton's second law and
linear continuum elastodynamics.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.errors import EquilibriumError, TensegrityError
from tensegrity.lattices.bands import angular_frequencies, bloch_matrix
from tensegrity.lattices.bloch import BlochMatrix, chunks
from tensegrity.lattices.moduli import internal_motions
from tensegrity.lattices.periodic import Medium
from tensegrity.minimum import lowest
from tensegrity.typing import Array

RANK = 1e-12  # singular values that count as zero, over the largest stiffness
SPLIT = 1e-7  # decay that counts as zero: double roots at band edges split by this much


@checked
def decay(
    lattice: Medium, frequencies: ArrayLike, axis: int = 0, wavenumbers: ArrayLike = 0.0
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
        the decay per cell, which is 0 for propagating waves, then in Re kappa.  Waves come in
        pairs of kappa and its conjugate.  An infinite imaginary part belongs to a wave confined to
        its cell, or one that decays by more than about 1e12 from cell to cell.

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
    w = angular_frequencies(frequencies, 2 * math.prod(lattice._unknowns))
    d = len(lattice.vectors)
    axis = check.whole("axis", axis, least=0, below=d)
    across = check.floats("wavenumbers", wavenumbers)
    across = check.vector("wavenumbers", across, across.shape if across.ndim == 0 else (d - 1,))
    across = np.broadcast_to(across, d - 1)
    lattice.refuse_unbalanced()
    matrix = bloch_matrix(lattice, weighted=False)
    if not matrix.offsets[:, axis].any():
        raise TensegrityError(f"no member crosses from cell to cell along lattice vector {axis}")
    layers = int(matrix.offsets[:, axis].max())
    own, next_one = _layer(matrix, matrix.parts, axis, across)
    stiff = _sizes(own, next_one)
    if matrix.inertia is not None:
        heavy = _layer(matrix, matrix.inertia, axis, across)
        return _with_heavy_members((own, next_one), heavy, w, layers)
    left, sizes, right = _joined(next_one, stiff)
    found = np.empty((len(w), 2 * len(sizes)), dtype=complex)
    mass = np.tile(lattice._at_rest()[1], layers)
    for row, inertia in zip(found, np.multiply.outer(w**2, mass), strict=True):
        root = 1 / np.sqrt(1 + inertia / stiff)[:, None]
        pair = root * left * sizes, root * right
        scaled = root / np.sqrt(stiff[:, None])
        row[:] = _phases(scaled * (own - np.diag(inertia)) * scaled.T, pair, layers)
    return found


def _layer(matrix: BlochMatrix, parts: Array, axis: int, across: Array) -> tuple[Any, Any]:
    """The matrices of a layer of cells, as many as offsets reach, and those that join it to the
    next one."""
    turns = np.exp(1j * (np.delete(matrix.offsets, axis, axis=1) @ across))
    step = matrix.offsets[:, axis]
    layers, zero = int(step.max()), np.zeros_like(parts[0])
    to = {n: matrix.at(np.where(step == n, turns, 0), parts) for n in range(-layers, layers + 1)}
    own, next_one = (
        np.block([[to.get(k + b - a, zero) for b in range(layers)] for a in range(layers)])
        for k in (0, layers)
    )
    return own, next_one


def _sizes(own: Any, next_one: Any) -> Array:
    """Sums of the sizes of a row of the whole matrix; 1 for rows of zeros."""
    size = np.abs(own).sum(axis=1) + np.abs(next_one).sum(axis=0) + np.abs(next_one).sum(axis=1)
    size[size == 0] = 1
    return np.asarray(size)


def _joined(next_one: Any, stiff: Array) -> tuple[Any, Array, Any]:
    """L, S and R of the scaled stiffness L S R^H from a layer to the next, (size, rank)."""
    left, sizes, right = np.linalg.svd(next_one / np.sqrt(stiff * stiff[:, None]))
    rank = int(np.sum(sizes > RANK * sizes[0]))
    return left[:, :rank], sizes[:rank], right[:rank].conj().T


def _with_heavy_members(stiff: Any, heavy: Any, w: Array, layers: int) -> Any:
    """Phases where the mass of members joins layers too: P depends on the frequency, and so may
    its rank."""
    rows = []
    for square in (w**2).tolist():
        scale = _sizes(*(np.abs(k) + square * np.abs(m) for k, m in zip(stiff, heavy, strict=True)))
        own, next_one = (k - square * m for k, m in zip(stiff, heavy, strict=True))
        left, sizes, right = _joined(next_one, scale)
        scaled = own / np.sqrt(scale * scale[:, None])
        rows.append(_phases(scaled, (left * sizes, right), layers))
    most = max((len(row) for row in rows), default=0)
    return np.array([np.concatenate([row, _confined(most - len(row))]) for row in rows])


def _confined(count: int) -> Any:
    """Phases of waves confined to their cell."""
    ends = np.zeros(count, dtype=complex)
    ends.imag = np.where(np.arange(count) % 2, -np.inf, np.inf)
    return ends


def _phases(own: Any, pair: Any, layers: int) -> Any:
    """Phases per cell of the waves of one frequency, by a supercell of `layers` cells."""
    from scipy.linalg import eigvals

    _, sizes, basis = np.linalg.svd(np.vstack([own, *(one.conj().T for one in pair)]))
    moved = basis[: len(sizes)][sizes > RANK].conj().T  # the others are without stiffness
    own, left, right = moved.conj().T @ own @ moved, *(moved.conj().T @ one for one in pair)
    size, rank = left.shape
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
        next_one = left @ right.conj().T
        kappa += [_turn(own, next_one, value, moved, layers) for value in values]
    kappa[np.abs(kappa.imag) < SPLIT] = kappa[np.abs(kappa.imag) < SPLIT].real
    ends = _confined(2 * rank - len(kappa))
    decays = np.abs(kappa.imag).round(9)  # alike for both waves of a pair, whatever round-off
    return np.concatenate([kappa[np.lexsort((kappa.imag, kappa.real.round(9), decays))], ends])


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


def _turn(own: Any, next_one: Any, value: complex, moved: Any, layers: int) -> float:
    """The phase [rad] of a wave from cell to cell in a supercell."""
    whole = own + next_one * value + next_one.conj().T / value
    cells = (moved @ np.linalg.svd(whole)[2][-1].conj()).reshape(layers, -1)
    return float(np.angle(np.sum(cells[:-1].conj() * cells[1:])))


@checked
def effective_mass(lattice: Medium, frame: Sequence[int], frequencies: ArrayLike) -> Array:
    """Dynamic effective mass of a cell whose frame moves equally in all cells.

    Parameters
    ----------
    lattice : Lattice
        With its nodes in equilibrium; with the frame held the other nodes must be stable.
    frame : sequence of int
        The nodes of the cell that undergo the same displacement u in all cells.
    frequencies : array_like, (frequencies,)
        Angular frequencies of u [rad/s].

    Returns
    -------
    ndarray, (frequencies, dim, dim)
        m [kg]: the force on the frame of each cell is -w^2 m u.  At w = 0 it is the mass of the
        frame and of all nodes attached to it.

    Raises
    ------
    TensegrityError
        Bad input, or a frequency at which a node outside the frame resonates.
    EquilibriumError
        The nodes are not in equilibrium, or not stable with the frame held.

    Examples
    --------
    A mass of 2 kg on springs in a frame of 1 kg resonates at 1 rad/s:

    >>> from tensegrity import Lattice, effective_mass
    >>> members = [(0, 0, 1), (0, 1), (1, 0, 1)]
    >>> chain = Lattice([(0, 0), (0.5, 0)], [(1, 0)], members, k_bar=[3, 1, 1], mass=[1, 2])
    >>> effective_mass(chain, [0], [0, 0.5, 1.2])[:, 0, 0].round(4).tolist()
    [3.0, 3.6667, -3.5455]
    """
    w = angular_frequencies(frequencies, lattice.components**2)
    nodes = check.sequence("frame", frame, "numbers of nodes")
    numbers = [check.whole("node", n, least=0, below=lattice.cell.nodes) for n in nodes]
    if not numbers or len(set(numbers)) < len(numbers):
        raise TensegrityError(f"frame {check.shown(numbers)} must be distinct nodes, at least 1")
    lattice.refuse_unbalanced()
    (node, along), dim = lattice._coordinates(), lattice.components
    inner, moved = ~np.isin(node, numbers), (along[:, None] == np.arange(dim)).astype(float)
    whole, of_all = (k if isinstance(k, np.ndarray) else k.toarray() for k in lattice._at_rest())
    mass = of_all[np.ix_(inner, inner)] if of_all.ndim > 1 else of_all[inner]
    held, joined = whole[np.ix_(inner, inner)], whole[np.ix_(inner, ~inner)]
    pull = -joined @ moved[~inner], np.abs(joined) @ moved[~inner]
    if (internal_motions(held, mass, np.zeros(()), *pull)[2] < 0).any():
        growth = lowest(held, mass, np.zeros((len(held), 0)), 1, 0.0)[0][0]
        raise EquilibriumError(
            f"with the frame held the other nodes are unstable: they grow at "
            f"{np.sqrt(-growth):.6g} 1/s"
        )
    if mass.ndim == 1:
        own = moved[~inner].T @ (of_all[~inner, None] * moved[~inner])
        momenta = (mass[:, None] * moved[inner]).T
    else:  # the frame and other nodes share inertia
        shared = of_all[np.ix_(inner, ~inner)] @ moved[~inner]
        own = moved[~inner].T @ of_all[~inner] @ moved
        momenta = (mass @ moved[inner] + shared).T
    masses = np.empty((len(w), dim, dim))
    for of in chunks(len(w), len(mass)):
        if mass.ndim > 1:
            more = w[of, None, None] ** 2 * shared
            pull = -joined @ moved[~inner] + more, np.abs(joined) @ moved[~inner] + np.abs(more)
        motions, unbounded, _ = internal_motions(held, mass, w[of], *pull)
        if unbounded.any():
            raise TensegrityError(
                f"frequency {w[of][unbounded][0]:.12g} rad/s is a resonance of the nodes outside "
                "the frame: the effective mass is infinite there"
            )
        masses[of] = momenta @ motions
    return own + masses
