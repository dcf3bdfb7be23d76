"""Equilibria as minima of an energy, and their lowest modes of vibration, dense or sparse.

Equilibria are found by Newton's method, with a shift of the tangent (Levenberg 1944) where it is
not positive definite or the step raises the energy.  Modes are computed from the full matrix, or by
inverse iteration about a lower bound of the eigenvalues.  Rigid motions are excluded from both.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from tensegrity.errors import EquilibriumError, TensegrityError
from tensegrity.typing import Array

DENSE = 450  # most unknowns for which matrices are dense
STEPS, TRIES = 1000, 60
CALM = 5  # successive steps without progress at which to stop: lower energy, or half the forces
GROWN = 1.05  # factor by which forces grow in a step away from a saddle
NOISE = 1e-14  # round-off of an energy, over forces times lengths
ROUND_OFF = 1e-14  # residual over the largest force at which to stop
FIRST = 1e-6  # the least shift
FACTOR = 10.0  # by which shifts grow and shrink
SINGULAR = 1e-13  # least pivot over the largest of a positive definite matrix
ZERO = 64 * float(np.finfo(float).eps)  # round-off over the largest stiffness over mass
LOWER = 30.0  # factor by which a bound of the eigenvalues is lowered


class Energy(Protocol):
    """An energy to be minimised; positions or displacements x are arrays (sites, dim)."""

    @property
    def longest(self) -> Any:
        """Largest displacement of a site in one step [m], or of each site, (sites,)."""

    def energy(self, x: Array) -> tuple[float, float]:
        """Energy less the work of the loads [J], and the forces times lengths that it is made of:
        the fraction `NOISE` of them is its round-off."""

    def forces(self, x: Array) -> Array:
        """Forces on the sites, loads included, in the free directions [N]."""

    def largest(self, x: Array) -> float:
        """The largest of all forces that balance one another [N]."""

    def allowed(self, x: Array) -> float:
        """Unbalanced forces that are left over in an equilibrium [N]."""

    def newton(self, x: Array, f: Array) -> Callable[[float], Array | None]:
        """Newton's step under forces f as a function of the shift, relative to a stiffness of the
        problem; None where the energy does not decrease along it."""

    def refuse(self, x: Array, f: Array) -> None:
        """Raise an error where x is out of range."""


def settle(
    of: Energy, x: Array, steps: int = STEPS, shift: float = 0.0, within: float = ROUND_OFF
) -> tuple[Array, Array]:
    """Find a minimum of the energy below x, where the forces vanish to round-off.

    Parameters
    ----------
    of : Energy
    x : ndarray, (sites, dim)
        Initial positions or displacements [m].
    steps : int, optional
        Largest number of steps.
    shift : float, optional
        Shift of the first step.
    within : float, optional
        Residual over the largest force at which to stop.

    Returns
    -------
    x, forces : ndarray, (sites, dim)
        The minimum [m] and the residual forces [N], which the caller has to check.
    """
    f, (energy, _), calm = of.forces(x), of.energy(x), 0
    least = most = np.linalg.norm(f)
    best = x, f
    for _ in range(steps):
        of.refuse(x, f)
        if calm == CALM or np.abs(f).max(initial=0.0) <= within * of.largest(x):
            break
        newton, first = of.newton(x, f), shift
        for _ in range(TRIES):
            step = newton(shift)
            if step is not None:
                far = np.max(np.sqrt(np.sum(step**2, axis=1)) / of.longest)
                new = x + step / max(far, 1.0)
                after, size = of.energy(new)
                if after <= energy + NOISE * size:
                    break
            shift = max(FACTOR * shift, FIRST)
        else:
            break
        falls, x, f, energy = after < energy - NOISE * size, new, of.forces(new), after
        left = np.linalg.norm(f)
        # near a saddle the fall is below round-off, but the forces grow
        leaves = shift > 0 and left > GROWN * most and least > of.allowed(x)
        calm, most = 0 if falls or leaves or left < 0.5 * least else calm + 1, max(most, left)
        if shift == first:
            shift = shift / FACTOR if shift > FIRST else 0.0
        if falls or left < least:
            best, least = (x, f), left
    return best


def refuse_unbalanced(of: Energy, x: Array, f: Array) -> None:
    """Refuse a state where the forces that are left over exceed those allowed.

    Parameters
    ----------
    of : Energy
    x, f : ndarray
        The state, and the forces [N].

    Raises
    ------
    EquilibriumError
    """
    left, allowed = float(np.abs(f).max(initial=0.0)), of.allowed(x)
    if not left <= allowed:
        raise EquilibriumError(
            f"no equilibrium found: {left:.3g} N of {of.largest(x):.3g} N are unbalanced, must be "
            f"at most {allowed:.3g} N"
        )


def downhill(matrix: Any, rigid: Array, f: Array) -> Array | None:
    """Newton's step without rigid motions.

    Parameters
    ----------
    matrix : ndarray or sparse, (free, free)
        Symmetric tangent stiffness [N/m].
    rigid : ndarray, (free, count)
        Orthonormal rigid motions.
    f : ndarray, (free,)
        Forces [N].

    Returns
    -------
    ndarray, (free,), or None
        Displacements [m]; None where the matrix is not positive definite, or the energy does not
        decrease.
    """
    from scipy.linalg import LinAlgError, cho_factor, cho_solve
    from scipy.sparse import block_array, csc_array
    from scipy.sparse.linalg import splu

    free, count = rigid.shape
    if free <= DENSE:
        inner = complement(rigid)
        whole = _dense(matrix)
        try:
            factor = cho_factor(inner.T @ whole @ inner if count else whole)
        except LinAlgError:
            return None
        pivots = np.diag(factor[0]) ** 2
        if pivots.min(initial=np.inf) < SINGULAR * pivots.max(initial=0.0):
            return None
        return np.asarray(inner @ cho_solve(factor, inner.T @ f))
    border = csc_array(float(np.abs(matrix.diagonal()).max()) * rigid)
    whole = block_array([[matrix, border], [border.T, None]]) if count else matrix
    try:
        factors = splu(
            whole.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.01,
            options={"SymmetricMode": True},
        )  # fmt: skip
    except RuntimeError:  # exactly singular
        return None
    below = np.count_nonzero(factors.U.diagonal() < 0)  # the border alone makes `count` of them
    if below != count and np.array_equal(factors.perm_r, factors.perm_c):
        return None
    move: Array = factors.solve(np.concatenate([f, np.zeros(count)]))[:free]
    return move if np.isfinite(move).all() and move @ f > 0 else None


def _dense(matrix: Any) -> Array:
    return matrix if isinstance(matrix, np.ndarray) else np.asarray(matrix.toarray())


def complement(rigid: Array) -> Array:
    """Orthonormal basis, (free, free - count), of the complement of motions, (free, count)."""
    free, count = rigid.shape
    if not count:
        return np.eye(free)
    return np.asarray(np.linalg.svd(rigid.T)[2][count:].T)


def least_part(matrix: Array) -> float:
    """The smallest singular value over the largest; NaN where a number is not finite."""
    if not np.isfinite(matrix).all():
        return np.nan
    sizes = np.linalg.svd(matrix, compute_uv=False)
    return float(sizes[-1] / sizes[0]) if sizes[0] else 0.0


def lowest(matrix: Any, mass: Any, rigid: Array, count: int, bound: float) -> tuple[Array, Array]:
    """The lowest eigenvalues of K x = w^2 M x without rigid motions, and their eigenvectors.

    Parameters
    ----------
    matrix : ndarray or sparse, (free, free)
        K, symmetric, or sparse and Hermitian.
    mass : ndarray, (free,), or sparse, (free, free)
        Diagonal of M, > 0, or M itself, positive definite.
    rigid : ndarray, (free, motions)
        Motions of zero stiffness that are excluded.
    count : int
        Number of eigenvalues.
    bound : float
        Distance of the shift below 0 over the largest stiffness over mass: a small one needs fewer
        iterations for slow modes, and costs digits where K is singular.

    Returns
    -------
    tuple of two ndarrays, (count,), (free, count)
        Eigenvalues in ascending order, 0 where they are round-off; eigenvectors of unit modal mass
        as columns.

    Raises
    ------
    TensegrityError
        If a number is not finite, or the iteration does not converge.
    """
    from scipy.linalg import lapack, solve_triangular

    free = matrix.shape[0]
    count = min(count, free - rigid.shape[1])
    if not count:
        return np.zeros(0), np.zeros((free, 0))
    least = round_off(matrix, mass)
    if free <= DENSE or count >= free // 4:
        skipped, diagonal = rigid.shape[1], mass.ndim == 1
        root = np.sqrt(mass) if diagonal else np.linalg.cholesky(_dense(mass))  # M = root root'
        if diagonal:
            of, q = _dense(matrix) / (root * root[:, None]), root[:, None] * rigid
        else:
            half, q = solve_triangular(root, _dense(matrix), lower=True), root.T @ rigid
            of = solve_triangular(root, half.T, lower=True)
        q, tau, *_ = lapack.dgeqrf(q)

        def turned(side: str, trans: str, x: Array) -> Any:
            """By Q, a product of Householder's reflections; rigid motions are its first columns."""
            return lapack.dormqr(side, trans, q, tau, x, free)[0] if skipped else x

        inner = turned("R", "N", turned("L", "T", of))[skipped:, skipped:]
        values, own, _, _, failed = lapack.dsyevr(inner, range="I", iu=count)
        if failed:
            raise TensegrityError(f"{count} modes of {free} unknowns do not converge")
        values, vectors = values[:count], np.zeros((free, count))
        vectors[skipped:] = own
        vectors = turned("L", "N", vectors)
        vectors = vectors / root[:, None] if diagonal else solve_triangular(root.T, vectors)
    else:
        from scipy.sparse import diags_array
        from scipy.sparse.linalg import LinearOperator, eigsh

        start = np.cos(np.arange(free) ** 1.5)
        weights = diags_array(mass) if mass.ndim == 1 else mass
        rigid = np.linalg.qr(mass[:, None] * rigid if mass.ndim == 1 else mass @ rigid)[0]

        def above(bound: float, count: int, tolerance: float) -> tuple[float, Any]:
            solve, bound = _inverse_above(matrix, weights, rigid, bound)
            inverse = LinearOperator(matrix.shape, matvec=solve, dtype=matrix.dtype)
            return bound, eigsh(
                matrix, count, weights, sigma=bound, OPinv=inverse, v0=start, tol=tolerance
            )

        bound, (rough, _) = above(-bound * (least / ZERO or 1.0), 1, 1e-3)
        _, (values, vectors) = above(min(bound, -float(rough[0])), count, 1e-13)
        order = np.argsort(values)
        values, vectors = values[order], vectors[:, order]
    return np.where(np.abs(values) <= least, 0.0, values), vectors


def round_off(matrix: Any, mass: Any) -> float:
    """Absolute value below which eigenvalues of K x = w^2 M x are round-off."""
    # that of members is at least half of its diagonal
    least = mass if mass.ndim == 1 else mass.diagonal().real / 2
    largest = float((np.abs(matrix) @ np.ones(len(least)) / least).max(initial=0.0))
    if not np.isfinite(largest):
        raise TensegrityError(f"stiffness over mass {largest} 1/s^2 must be finite")
    return ZERO * largest


def _inverse_above(
    matrix: Any, weights: Any, rigid: Array, bound: float
) -> tuple[Callable[[Array], Array], float]:
    """The inverse of matrix - bound weights on x orthogonal to `rigid`, and that bound.

    The bound is lowered until all pivots are positive, so that no eigenvalue lies below it.  The
    closer it is to the lowest eigenvalue, the fewer iterations follow.
    """
    from scipy.sparse.linalg import splu

    while True:
        factors = splu(
            (matrix - bound * weights).tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )  # fmt: skip
        if (factors.perm_r == factors.perm_c).all() and (factors.U.diagonal().real > 0).all():
            break
        bound *= LOWER
    if not rigid.size:
        return factors.solve, bound
    held = factors.solve(rigid)
    gap = np.linalg.inv(rigid.T @ held)

    def solve(b: Array) -> Array:
        x = factors.solve(b)
        return np.asarray(x - held @ (gap @ (rigid.T @ x)))

    return solve, bound
