"""Equilibria and modes over the motions that supports leave, dense or sparse.

Energy is minimised by Newton's method with a shift of the tangent (Levenberg) where the tangent
is not positive definite; strings that go slack or taut on the way only change which members
count.  Rigid motions that supports leave are kept out: they are no unknowns.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.errors import EquilibriumError
from tensegrity.springs.kinks import TAUT
from tensegrity.structures.supports import Supports, left_over

if TYPE_CHECKING:
    from typing import Any

    from tensegrity.structures.members import Members
    from tensegrity.typing import Array

DENSE = 450  # unknowns up to which matrices are dense
ITERATIONS = 300
SETTLED = 1e-13  # forces left, over the forces there are
NEUTRAL = 1e-10  # eigenvalues below this part of the stiffness are zero
NOTHING = 1e-13  # of the largest stiffness: where bounds of eigenvalues below 0 start
ZERO = 64 * float(np.finfo(float).eps)  # of the largest stiffness over mass: round-off
LOWER = 30.0  # factor of such bounds
WORK = 1e-9  # of loads in rigid motions, over their size


@dataclass(frozen=True)
class Freedom:
    """Motions that are left to a structure at given positions.

    Attributes
    ----------
    motions : sparse matrix, (nodes dim, free)
    rigid : ndarray, (free, count)
        Rigid motions of the parts among them, in their coordinates.
    parts : sequence of ndarray of int
        Nodes of each part that no member joins to another.
    """

    motions: Any
    rigid: Array
    parts: Any

    @classmethod
    def of(cls, supports: Supports | None, positions: Array, platforms: Any, parts: Any) -> Freedom:
        """Motions that supports and platforms leave."""
        motions = (supports or Supports()).motions(len(positions), positions.shape[1], platforms)
        return cls(motions, left_over(motions, positions, parts), parts)

    def at(self, positions: Array) -> Freedom:
        """The same at other positions."""
        return Freedom(self.motions, left_over(self.motions, positions, self.parts), self.parts)

    def reduced(self, tangent: Any) -> Any:
        """A tangent over these motions, (free, free)."""
        return self.motions.T @ tangent @ self.motions

    def complement(self) -> Array:
        """Orthonormal motions without the rigid ones, (free, free - count)."""
        free, count = self.rigid.shape
        if not count:
            return np.eye(free)
        return np.linalg.svd(self.rigid.T)[2][count:].T


def refuse_driven(freedom: Freedom, positions: Array, loads: Array) -> None:
    """Refuse loads that do work on rigid motions that supports leave."""
    force = freedom.motions.T @ loads.ravel()
    driven = freedom.rigid.T @ force
    size = np.abs(loads).sum()
    if np.linalg.norm(driven) <= WORK * size:
        return
    net = loads.sum(axis=0)
    arms = positions - positions.mean(axis=0)
    turns = arms.T @ loads
    moment = (turns - turns.T)[(0,), (1,)] if arms.shape[1] == 2 else (
        (turns - turns.T)[(1, 2, 0), (2, 0, 1)]
    )  # fmt: skip
    motion = (freedom.motions @ (freedom.rigid @ driven)).reshape(positions.shape)
    shift = motion.mean(axis=0)
    turning = np.linalg.norm(motion - shift) > np.linalg.norm(shift) * np.sqrt(len(motion))
    word = "turning" if turning else "sliding"
    raise EquilibriumError(
        f"the supports leave a rigid motion ({word}) on which the loads do work: net force "
        f"{_vector(net)} N, net moment about the centre {_vector(moment)} N m"
    )


def _vector(value: Any) -> str:
    numbers = np.atleast_1d(value) + 0.0
    return "(" + ", ".join(f"{x:.4g}" for x in numbers.tolist()) + ")"


def settle(members: Members, freedom: Freedom, positions: Array, loads: Array) -> Array:
    """Positions of an equilibrium under constant loads, downhill in energy from given ones.

    Raises
    ------
    EquilibriumError
        If there is none nearby: loads drive a rigid motion, or the energy falls without end.
    """
    x, shape = positions, positions.shape
    refuse_driven(freedom, x, loads)
    span = float(np.ptp(positions, axis=0).max())
    softest = float(members.stiffness.min())
    shift = 0.0
    energy = members.energy(x)
    for _ in range(ITERATIONS):
        gradient = freedom.motions.T @ (members.gradient(x) - loads).ravel()
        pulls = members.tensions(x)
        size = max(np.abs(pulls).max(), np.abs(loads).max(), 1e-12 * softest * span)
        if np.linalg.norm(gradient, np.inf) <= SETTLED * size:
            return x
        # from rest the same way in any frame, then what the energy has: else it converges slowly
        within = TAUT if x is positions else 0.0
        tangent = freedom.reduced(members.tangent(x, within))
        for _ in range(60):
            move, downhill = _newton(tangent, freedom, gradient, shift, softest)
            length = np.abs(move).max()
            if not downhill:
                shift = max(4 * shift, 1e-6 * softest)
                continue
            move *= min(1.0, 0.2 * span / max(length, 1e-300))
            new = x + (freedom.motions @ move).reshape(shape)
            work = float(np.sum(loads * (new - x)))
            after = members.energy(new)
            noise = 1e-14 * (abs(energy) + abs(after) + abs(work))
            if after - work <= energy + noise and np.isfinite(after):
                break
            shift = max(4 * shift, 1e-6 * softest)
        else:
            break
        shift = 0.0 if shift < 1e-7 * softest else shift / 8
        if length <= 1e-15 * span:
            return x
        x, energy = new, after
        if np.ptp(x, axis=0).max() > 100 * span:
            raise EquilibriumError(
                f"no equilibrium: under these loads the structure grows beyond {100 * span:g} m"
            )
        freedom = freedom.at(x)
    left = np.abs(freedom.motions.T @ (members.gradient(x) - loads).ravel()).max()
    if left <= 1e3 * SETTLED * size:
        return x
    raise EquilibriumError(
        f"no equilibrium found: {left:.3g} N are left of {size:.3g} N after {ITERATIONS} iterations"
    )


def _newton(
    tangent: Any, freedom: Freedom, gradient: Array, shift: float, softest: float
) -> tuple[Array, bool]:
    """The move to where the gradient vanishes, and whether it leads downhill."""
    free = len(gradient)
    if free <= DENSE:
        inner = freedom.complement()
        matrix = inner.T @ (tangent.toarray() + shift * np.eye(free)) @ inner
        try:
            factor = np.linalg.cholesky(matrix)
            if np.diag(factor).min() ** 2 < 1e-13 * np.diag(factor).max() ** 2:
                return np.zeros(free), False
            half = np.linalg.solve(factor, -inner.T @ gradient)
            return inner @ np.linalg.solve(factor.T, half), True
        except np.linalg.LinAlgError:
            return np.zeros(free), False
    try:
        move = bordered(tangent, freedom.rigid, shift)(-gradient)
    except RuntimeError:  # exactly singular
        return np.zeros(free), False
    good = bool(np.isfinite(move).all() and move @ gradient < 0)
    return (move, good) if good else (np.zeros(free), False)


def least_part(matrix: Array) -> float:
    """The smallest singular value over the largest; nan where a number is not finite."""
    if not np.isfinite(matrix).all():
        return np.nan
    sizes = np.linalg.svd(matrix, compute_uv=False)
    return float(sizes[-1] / sizes[0]) if sizes[0] else 0.0


def bordered(matrix: Any, rigid: Array, shift: float = 0.0) -> Any:
    """Solver of (matrix + shift) x = b among x orthogonal to rigid motions; sparse."""
    import scipy.sparse as sparse
    from scipy.sparse.linalg import splu

    free, count = rigid.shape
    matrix = matrix + shift * sparse.eye(free)
    scale = float(np.abs(matrix.diagonal()).max())
    border = sparse.csc_matrix(scale * rigid)
    whole = sparse.bmat([[matrix, border], [border.T, None]]) if count else matrix
    factors = splu(whole.tocsc())
    return lambda b: factors.solve(np.concatenate([b, np.zeros(count)]))[:free]


def lowest_eigenvalues(
    tangent: Any, freedom: Freedom, mass: Array | None, count: int, floor: float
) -> tuple[Array, Array]:
    """The lowest eigenvalues over the free motions, rigid ones out, and vectors as columns.

    Parameters
    ----------
    tangent : sparse, (nodes dim, nodes dim)
    freedom : Freedom
    mass : ndarray, (nodes dim,), optional
        With it those of M^-1 K, vectors of unit modal mass.
    count : int
    floor : float
        None of the eigenvalues of the tangent is below it [N/m].

    Returns
    -------
    tuple of two ndarrays, (count,), (nodes dim, count)
    """
    import scipy.sparse as sparse
    from scipy.linalg import eigh
    from scipy.sparse.linalg import LinearOperator, eigsh

    matrix, motions = freedom.reduced(tangent), freedom.motions
    weight = sparse.diags(np.ones(motions.shape[0]) if mass is None else mass)
    weights = motions.T @ weight @ motions
    free = matrix.shape[0]
    rigid = np.linalg.qr(weights @ freedom.rigid)[0]
    count = min(count, free - rigid.shape[1])
    nothing = ZERO * float((matrix.diagonal() / weights.diagonal()).max(initial=0.0))
    if free <= DENSE or count >= free // 4:
        inner = np.linalg.svd(rigid.T)[2][rigid.shape[1] :].T if rigid.size else np.eye(free)
        small, masses = inner.T @ matrix.toarray() @ inner, inner.T @ weights.toarray() @ inner
        values, vectors = eigh((small + small.T) / 2, masses, subset_by_index=[0, count - 1])
        return np.where(np.abs(values) <= nothing, 0.0, values), motions @ (inner @ vectors)
    least = (1.01 * floor - 1e-6 * float(matrix.diagonal().max())) / float(weights.diagonal().min())
    bound = -NOTHING * float(matrix.diagonal().max()) / float(weights.diagonal().max())
    start = np.cos(np.arange(free) ** 1.5)

    def above(bound: float, count: int, tolerance: float) -> tuple[float, Any]:
        solve, bound = _inverse_above(matrix, weights, rigid, bound, least)
        inverse = LinearOperator((free, free), matvec=solve, dtype=float)
        return bound, eigsh(
            matrix, count, weights, sigma=bound, OPinv=inverse, v0=start, tol=tolerance
        )

    bound, (rough, _) = above(bound, 1, 1e-3)
    _, (values, vectors) = above(min(bound, -float(rough[0])), count, 1e-13)
    return np.where(np.abs(values) <= nothing, 0.0, values), motions @ vectors


def _inverse_above(
    matrix: Any, weights: Any, rigid: Array, bound: float, least: float
) -> tuple[Any, float]:
    """The inverse of matrix - bound weights among x orthogonal to `rigid`, and that bound.

    The bound goes down until all pivots are positive, so that no eigenvalue lies below it; at the
    latest to `least`.  The nearer it then is to the lowest eigenvalue, the fewer iterations follow;
    one that is much smaller costs digits where there are rigid motions.
    """
    from scipy.sparse.linalg import splu

    while True:
        bound = max(bound, least)
        factors = splu(
            (matrix - bound * weights).tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )  # fmt: skip
        definite = (factors.perm_r == factors.perm_c).all() and (factors.U.diagonal() > 0).all()
        if definite or bound == least:
            break
        bound *= LOWER
    held = factors.solve(rigid) if rigid.size else rigid
    gap = np.linalg.inv(rigid.T @ held) if rigid.size else np.zeros((0, 0))

    def solve(b: Array) -> Array:
        x = factors.solve(b)
        return np.asarray(x - held @ (gap @ (rigid.T @ x)))

    return solve, bound
