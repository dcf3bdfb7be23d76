"""Search methods, which propose rows of genes and receive their forces; descent in the diameters.

A method is a generator: it yields rows (n, count) and is sent the best design that each row led to
(for descents their best design, otherwise the row itself) and the forces of these, (n,), to be
minimised.  Its proposals depend only on the space, the random generator and the values sent, so
that an interrupted search is resumed by sending the stored values again.  A method may repeat a
proposal at no cost, and may end.

Orders and choices are searched by a genetic algorithm of our own; diameters by descents from many
starting points or, with a `build`, by the covariance matrix adaptation of `cmaes` (N. Hansen,
arXiv:1604.00772).

In a descent the force on the wall and its derivatives with respect to all diameters come from one
run and one adjoint (backward) pass, with velocity Verlet.  The chain, its compiled loop and the
pass are built once; from design to design only masses and contact constants change.  The peak force
is not differentiable where one maximum in time overtakes another.  p-norms of the force are smooth,
and tend to it as p grows: sequential quadratic programming (SciPy's SLSQP) minimises them in turn.
Then the highest maxima themselves are reduced together, by linear programs in a trust region that
shrinks where the linear prediction fails.  The programs are small: threads of BLAS make them
slower.  With OPENBLAS_NUM_THREADS=1 in the environment a search takes a third of the time.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple, cast

import numpy as np

from granular.beads import Material, Striker
from granular.design.objective import EXPONENT, Problem, step_count
from granular.design.spaces import SLACK, Choice, Order, Sizes, Space, moved
from tensegrity import METHODS as INTEGRATION
from tensegrity import PowerLaw, Splitting, TensegrityError, check, objective
from tensegrity.engine.bonds import Bonds
from tensegrity.gradients.adjoint import RepeatedRun
from tensegrity.root import peak_weights
from tensegrity.typing import Array, Indices

Proposals = Generator[Any, Any, None]

POPULATION = 64
PAIRS = 2  # individuals of a tournament, the best of which becomes a parent
MUTATIONS = 0.5  # probability that the mutation of a child ends
TRIES = 20  # times that a full population tries to produce new individuals
STALE = 15  # populations without a better design, after which a method restarts
STARTS = 8  # starting points of a batch
HOPS = 4  # of these, close to the lowest minima
LOWEST = 6  # number of these minima
JUMP = 0.15  # of the range of a diameter
LEAST_DISTANCE = 0.1  # of the range: least difference of two of them, in some diameter
SIGMA = 0.3  # of the range of a gene, at the start of an adaptation


def genetic(space: Order | Choice, rng: np.random.Generator) -> Proposals:
    """Parents and children compete, by rank; no design is proposed twice."""
    seen: set[bytes] = set()

    def new(make: Callable[[], Indices]) -> Indices:
        children: list[Indices] = []
        for _ in range(TRIES):
            for row in make():
                if len(children) < POPULATION and (key := row.tobytes()) not in seen:
                    seen.add(key)
                    children.append(row)
            if len(children) == POPULATION:
                break
        return np.array(children)

    while len(first := new(lambda: space.random(rng, POPULATION))):
        rows, forces = yield first
        stale = 0
        while stale < STALE:
            made = new(partial(_children, space, rng, _ranked(rows, forces)[0]))
            if not len(made):
                break
            made, values = yield made
            stale = 0 if values.min() < forces.min() else stale + 1
            rows, forces = _ranked(np.concatenate([rows, made]), np.append(forces, values))
            rows, forces = rows[:POPULATION], forces[:POPULATION]


def _ranked(rows: Indices, forces: Array) -> tuple[Indices, Array]:
    """Rows by their forces, the best first."""
    order = np.argsort(forces, kind="stable")
    return rows[order], forces[order]


def _children(space: Order | Choice, rng: np.random.Generator, rows: Indices) -> Indices:
    """Changed children of parents, the better of `PAIRS` each; the best rows come first."""
    picks = rng.integers(len(rows), size=(2, POPULATION, PAIRS)).min(axis=-1)
    made = space.children(rng, *rows[picks])
    changed = np.arange(len(made))
    while len(changed):
        made[changed] = space.mutants(rng, made[changed])
        changed = changed[rng.random(len(changed)) > MUTATIONS]
    return made


def adapting(space: Sizes, rng: np.random.Generator) -> Proposals:
    """A normal distribution of diameters, projected to the length."""
    from cmaes import CMA

    low, high = space.diameters
    bounds = np.tile([0.0, 1.0], (space.count, 1))
    while True:
        start, seed = rng.uniform(0.3, 0.7, space.count), int(rng.integers(2**31))
        optimizer = CMA(start, SIGMA, bounds, seed=seed, population_size=POPULATION)
        stale, best = 0, np.inf
        while stale < STALE and not optimizer.should_stop():
            asked = np.array([optimizer.ask() for _ in range(POPULATION)])
            rows, values = yield space.projected(low + (high - low) * asked)
            worst = 2 * values[np.isfinite(values)].max(initial=0.5)
            finite = np.where(np.isfinite(values), values, worst)  # nan and inf rank last
            genes = (rows - low) / (high - low)
            optimizer.tell(list(zip(genes, finite.tolist(), strict=True)))
            stale = 0 if values.min() < best else stale + 1
            best = min(best, values.min())


def starting(space: Sizes, rng: np.random.Generator) -> Proposals:
    """Starting points of descents: uniformly distributed, and close to the lowest minima found."""
    rows, forces = np.empty((0, space.count)), np.empty(0)
    while True:
        starts = space.random(rng, STARTS)
        if len(rows):
            near = rows[rng.integers(min(LOWEST, len(rows)), size=HOPS)]
            scale = JUMP * (space.diameters[1] - space.diameters[0])
            shaken = near + scale * rng.standard_normal(near.shape)
            other = rng.random((HOPS, 1)) < 0.5
            starts[:HOPS] = space.projected(np.where(other, shaken, moved(rng, near)))
        minima, values = yield starts
        rows, forces = _ranked(np.concatenate([rows, minima]), np.append(forces, values))
        kept = _distinct(rows, LEAST_DISTANCE * (space.diameters[1] - space.diameters[0]))[:LOWEST]
        rows, forces = rows[kept], forces[kept]


def _distinct(rows: Any, least: float) -> list[int]:
    """Numbers of rows that differ from all selected ones before by more than `least` in a gene."""
    kept: list[int] = []
    for k, row in enumerate(rows):
        if all(np.abs(row - rows[j]).max() > least for j in kept):
            kept.append(k)
    return kept


METHODS: dict[str, tuple[Callable[..., Proposals], tuple[type, ...]]] = {
    "ga": (genetic, (Order, Choice)),
    "gradient": (starting, (Sizes,)),
    "cma": (adapting, (Sizes,)),
}
"""What proposes, and for which spaces."""


def suits(
    method: str | None, space: Space, is_built: bool, is_scattered: bool = False
) -> tuple[str, Callable[..., Proposals]]:
    """Name and generator of the requested method, or of the most suitable one for a space.

    Parameters
    ----------
    method : str or None
    space : Space
    is_built : bool
        Whether a function builds the scenes, so that no gradients are available.
    is_scattered : bool
        Whether a quantile over deviations is minimised, whose gradients are not computed either.

    Returns
    -------
    name, generator : str, callable (space, rng) -> Proposals

    Raises
    ------
    TensegrityError
        An unknown method, or one that does not search such a space.
    """
    if method is None:
        method = "cma" if is_built or is_scattered else "gradient"
        method = method if isinstance(space, Sizes) else "ga"
    if not isinstance(method, str) or method not in METHODS:
        raise TensegrityError(f"method {check.shown(method)} is not one of {', '.join(METHODS)}")
    propose, spaces = METHODS[method]
    if not isinstance(space, spaces):
        fitting = [name for name, (_, kinds) in METHODS.items() if isinstance(space, kinds)]
        reason = ", whose genes are kinds and have no derivatives" if method == "gradient" else ""
        raise TensegrityError(
            f"method {method!r} does not search {type(space).__name__}{reason}: "
            f"take {' or '.join(fitting)}"
        )
    if method == "gradient" and is_built:
        raise TensegrityError(f"method {method!r} is for chains before a wall, not for a build")
    if method == "gradient" and is_scattered:
        raise TensegrityError(f"method {method!r} computes one chain at a time: no scatter")
    return method, propose


PARTS = 12  # steps of velocity Verlet in one of a search's
TINY = 1e-30  # step of a derivative through the complex plane, relative
NORMS = (32.0, 128.0)  # lower values lead away from a minimum near the start
ITERATIONS = 120  # of each norm
PEAKS = 8  # the highest maxima, whose slopes are computed
PROGRAMS = 40  # linear ones
REACH, NEAR = 0.02, 1e-5  # of the largest diameter: first and last radius of the trust region


class NotArrived(TensegrityError):
    """No force acts on the wall before the end of the run."""


class Pass:
    """Forces on the wall behind a struck chain, and their derivatives in the diameters.

    Parameters
    ----------
    space : Sizes
    striker : Striker
    wall : Material
    t_end : float
        [s]
    steps : int
    """

    def __init__(
        self, space: Sizes, striker: Striker, wall: Material, t_end: float, steps: int
    ) -> None:
        self._space, self._striker, self._wall, self._t_end = space, striker, wall, t_end
        count = space.count + 1
        self._law = PowerLaw(1.0, EXPONENT).law
        contacts = np.arange(1.0, count + 1)  # such that each bond has a constant of its own
        bonds = self._bonds(contacts, np.zeros(count))
        method = cast("Splitting", INTEGRATION["verlet"])
        self._repeated = RepeatedRun(bonds, method, t_end / steps, steps, count - 1, (0,))
        self._v = np.zeros(count + 1)
        self._v[0] = striker.speed

    def _bonds(self, contacts: Array, weights: Array) -> Bonds:
        """Bonds of given contact constants and inverse masses; the wall behind them is held."""
        numbers = np.arange(len(contacts))
        table = np.zeros((len(contacts), len(self._law.parameters)))
        table[:, 0] = contacts
        return Bonds((self._law,), 0 * numbers, table, numbers, np.append(weights, 0.0))

    def force(self, sizes: Array) -> Array:
        """Force on the wall after each step [N]; (steps,)."""
        self._sizes = sizes
        self._designs = self._space.designs(sizes[None]).behind(self._striker.bead)
        contacts = self._designs.contacts(self._wall)[0]
        bonds = self._bonds(contacts, 1 / self._designs.mass[0])
        self._moved = self._repeated.run(bonds, 0.0, self._v)
        self._constant = contacts[-1]
        force = self._constant * np.maximum(self._moved, 0) ** EXPONENT
        if not force.any():
            raise NotArrived(
                f"no wave reaches the wall before t_end {self._t_end:g} s through beads "
                f"of {', '.join(f'{1e3 * d:.4g}' for d in sizes)} mm"
            )
        return force

    def slopes(self, force: Array, by_force: Array) -> Array:
        """Derivatives with respect to the diameters; (objectives, count).

        Parameters
        ----------
        force : ndarray, (steps,)
            The force that was computed last.
        by_force : ndarray, (objectives, steps)
            Derivatives of objectives with respect to it.
        """
        stiff = EXPONENT * np.divide(force, self._moved, out=np.zeros_like(force), where=force > 0)
        totals = self._repeated.pullback(by_force * stiff)
        by_constant = totals.p[:, 0].copy()
        by_constant[:, -1] += by_force @ force / self._constant
        moved: Any = self._sizes[None] * (1 + 1j * TINY)
        all_ = self._space.designs(moved)
        weight = (1 / all_.mass[0]).imag / (TINY * self._sizes)
        radius = all_.radius[0].imag / (TINY * self._sizes)
        before, behind = (x[0] for x in self._designs.contact_slopes(self._wall))
        by_radius = (by_constant * before)[:, 1:] + (by_constant * behind)[:, :-1]
        return by_radius * radius + totals.w[:, 1:-1] * weight

    def norm(self, sizes: Array, p: float) -> tuple[float, float, Array]:
        """Largest force [N]; the p-norm of the force over that of a constant 1 N [N]; and its
        slopes [N/m], (count,)."""
        force = self.force(sizes)
        t: Any = self._t_end / len(force) * np.arange(1, len(force) + 1)
        value, by_force = objective.p_norm(objective.load(wall=0), p).rule(t, force[None])
        scale = self._t_end ** (-1 / p)
        return _maxima(force)[0].max(), value * scale, self.slopes(force, by_force * scale)[0]

    def peaks(self, sizes: Array) -> tuple[Array, Array]:
        """The highest maxima of the force [N], the first the largest; (PEAKS,), 0 where there are
        fewer.  Their slopes [N/m]; (PEAKS, count)."""
        force = self.force(sizes)
        heights, steps, weights = _maxima(force)
        values, by_force = np.zeros(PEAKS), np.zeros((PEAKS, len(force)))
        for k, number in enumerate(np.argsort(-heights, kind="stable")[:PEAKS]):
            values[k] = heights[number]
            by_force[k, steps[number]] = weights[number]
        return values, self.slopes(force, by_force)


def _maxima(force: Array) -> tuple[Array, Indices, Array]:
    """Height of each maximum, by a parabola, the three steps around it, and the weights of their
    forces.  A force that still increases at the end has its maximum there."""
    top = np.flatnonzero((force[1:-1] > force[:-2]) & (force[1:-1] >= force[2:])) + 1
    weights = peak_weights(force, top)
    if force[-1] > force[-2]:
        top, weights = np.append(top, len(force) - 2), np.append(weights, [[0.0, 0.0, 1.0]], axis=0)
    steps = top[:, None] + np.arange(-1, 2)
    return (weights * force[steps]).sum(axis=1), steps, weights


class Descent(NamedTuple):
    """The designs computed along a descent.

    Attributes
    ----------
    rows : ndarray, (passes, count)
        Diameters [m].
    forces : ndarray, (passes,)
        Largest force on the wall [N].
    """

    rows: Array
    forces: Array


@dataclass(frozen=True)
class Descents:
    """Maps starting points to descents; sent to workers.

    Attributes
    ----------
    problem : Problem
        A problem of chains; each of its steps is divided into `PARTS`.
    """

    problem: Problem
    unit = "start"
    part = 1  # starting points of one task of a worker

    def __call__(self, starts: Array) -> Descent:
        """The descent from one start, (1, count); empty where no wave arrives in time."""
        of, start = self.problem, starts[0]
        space = cast("Sizes", of.space)
        if not np.isfinite(of(starts)[0]):
            return Descent(starts[:0], np.empty(0))
        steps = PARTS * step_count(of.dt, of.t_end, of.dt)
        return downhill(Pass(space, of.striker, of.wall, of.t_end, steps), space, start)


def downhill(one: Pass, space: Sizes, start: Array) -> Descent:
    """The descent from a start to a minimum nearby; it ends where no wave arrives in time.

    Parameters
    ----------
    one : Pass
        The pass for chains of this space.
    space : Sizes
    start : ndarray, (count,)
        Diameters [m].

    Returns
    -------
    Descent
        All designs computed, in order.
    """
    from scipy.optimize import minimize

    low, high = space.diameters
    rows: list[Array] = []
    forces: list[float] = []

    def keep(x: Array, force: float) -> None:
        rows.append(x)
        forces.append(force)

    def norm(x: Array, p: float) -> tuple[float, Array]:
        sizes = x * high
        if not _fits(space, sizes):  # by round-off of the quadratic program
            sizes = space.projected(sizes)
        largest, value, slopes = one.norm(sizes, p)
        keep(sizes, largest)
        return float(np.log(value)), slopes * high / value

    x = space.projected(start) / high
    try:
        for p in NORMS:
            minimum = minimize(
                norm, x, args=(p,), jac=True, method="SLSQP", bounds=[(low / high, 1.0)] * x.size,
                options={"maxiter": ITERATIONS, "ftol": 1e-6},
                constraints={"type": "eq", "fun": lambda x: x.sum() - space.length / high,
                             "jac": lambda x: np.ones(x.size)},
            )  # fmt: skip
            x = space.projected(minimum.x * high) / high
        _pressed(one, space, rows[int(np.argmin(forces))], keep)
    except NotArrived:
        pass
    return Descent(np.array(rows).reshape(-1, x.size), np.array(forces))


def _fits(space: Sizes, sizes: Array) -> bool:
    """Whether diameters are within the limits, and their sum is the length up to round-off."""
    low, high = space.diameters
    inside = low <= sizes.min() and sizes.max() <= high
    return bool(inside and abs(sizes.sum() - space.length) <= SLACK * space.length)


def _pressed(one: Pass, space: Sizes, start: Array, keep: Callable[..., None]) -> None:
    """Continue from a start by reducing all of the highest maxima together."""
    from scipy.optimize import linprog

    low, high = space.diameters
    sizes, reach = space.projected(start), REACH
    values, slopes = one.peaks(sizes)
    keep(sizes, values[0])
    cost = np.append(np.zeros(space.count), 1.0)
    level = np.append(np.ones(space.count), 0.0)[None]
    for _ in range(PROGRAMS):
        if reach < NEAR:
            return
        some = values > 0
        heights = np.log(values[some] / values[0])
        lines = np.column_stack([slopes[some] * high / values[some, None], -np.ones(some.sum())])
        least, most = (np.clip((x - sizes) / high, -reach, reach) for x in (low, high))
        program = linprog(
            cost, A_ub=lines, b_ub=-heights, A_eq=level, b_eq=[0.0],
            bounds=[*zip(least, most, strict=True), (None, None)],
        )  # fmt: skip
        if program.x is None or program.x[-1] > -1e-7:
            return
        trial = space.projected(sizes + high * program.x[:-1])
        there = one.peaks(trial)
        keep(trial, there[0][0])
        gain = np.log(there[0][0] / values[0]) / program.x[-1]  # 1: as predicted by the slopes
        if gain > 0:
            sizes, (values, slopes) = trial, there
        reach *= 2 if gain > 0.75 else 0.25 if gain < 0.1 else 1 if gain > 0.4 else 0.5
