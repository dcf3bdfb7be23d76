"""Diameters of a chain moved downhill, so that the wall behind it feels least.

The force on the wall and its derivatives by all diameters come from one run and one pass backwards
through it, with velocity Verlet.  The chain, its loop and the pass are made once; from design to
design only masses and contact constants change.

The largest force has edges where one maximum in time overtakes another.  p-norms of the force have
none, and come nearer to it as p grows: sequential quadratic programming (SciPy's SLSQP) goes down
on these in turn.  Then the highest maxima themselves are pressed down together, by linear programs
within a distance that is shortened where they did not keep what their slopes promised.

The programs are small: threads of BLAS make them slower.  With OPENBLAS_NUM_THREADS=1 in the
environment a search takes a third of the time.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from granular.design import objective
from granular.design.spaces import SLACK
from tensegrity import PowerLaw, TensegrityError
from tensegrity.engine import kernel, reverse
from tensegrity.engine.bonds import Bonds
from tensegrity.engine.march import Wanted
from tensegrity.engine.methods import METHODS
from tensegrity.engine.reverse import Layout

if TYPE_CHECKING:
    from typing import Any

    from granular.beads import Striker
    from granular.design.spaces import Sizes
    from granular.materials import Material
    from tensegrity.typing import Array, Indices

PARTS = 12  # steps of velocity Verlet in one of a search's
TINY = 1e-30  # step of a derivative through the complex plane, relative
NORMS = (32.0, 128.0)  # a lower one leads away from a low place near which a way starts
ITERATIONS = 120  # of each norm
PEAKS = 8  # the highest maxima, whose slopes are computed
PROGRAMS = 40  # linear ones
REACH, NEAR = 0.02, 1e-5  # of the largest diameter: how far the first goes, and the last


class NotArrived(TensegrityError):
    """No force at the wall until the end of the run."""


class Pass:
    """Forces on the wall behind a struck chain, and their derivatives by the diameters.

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
        self._space, self._striker, self._wall = space, striker, wall
        self._steps, self._dt = steps, t_end / steps
        self._method = METHODS["verlet"]
        count = space.count + 1
        law = PowerLaw(1.0, objective.EXPONENT).law
        self._rows = np.empty((steps, 1))  # displacement of the last bead after each step
        self._place = np.array([count - 1])
        self._table = np.zeros((count, len(law.parameters)))
        self._table[:, 0] = np.arange(1, count + 1)  # such that each bond has its own
        self._law, self._weights = law, np.zeros(count + 1)
        bonds = self._bonds()
        self._u, self._v = np.zeros((2, len(self._weights)))
        self._loop = kernel.bind(self._u, self._v, bonds, self._method, self._dt)
        self._layout = Layout(bonds, ((0,),))
        self._back: dict[int, Any] = {}

    def _bonds(self) -> Bonds:
        numbers = np.arange(len(self._table))
        return Bonds(
            (self._law,), np.zeros_like(numbers), self._table.copy(), numbers, self._weights.copy()
        )

    def _backward(self, objectives: int) -> tuple[Any, Any]:
        """A pass backwards for so many objectives, and what it adds up."""
        if objectives not in self._back:
            totals = reverse.Totals(self._layout, objectives)
            made = reverse.Back(self._layout, self._method, self._dt, totals)
            self._back[objectives] = made, totals
        return self._back[objectives]

    def force(self, sizes: Array) -> Array:
        """On the wall after each step [N]; (steps,)."""
        all_ = self._space.designs(sizes[None]).behind(self._striker.bead)
        self._table[:, 0], self._weights[:-1] = all_.contacts(self._wall)[0], 1 / all_.mass[0]
        self._sizes, self._designs = sizes, all_
        self._now = self._bonds()
        self._loop.retune(self._now)
        self._u[:], self._v[:] = 0, 0
        self._v[0] = self._striker.speed
        at = np.arange(self._steps) + 1
        self._loop.go(0, self._steps, [Wanted(at, self._rows, places=self._place, of_u=1)])
        force = self._table[-1, 0] * np.maximum(self._rows[:, 0], 0) ** objective.EXPONENT
        if not force.any():
            raise NotArrived(
                f"no wave reaches the wall before t_end {self._dt * self._steps:g} s through beads "
                f"of {', '.join(f'{1e3 * d:.4g}' for d in sizes)} mm"
            )
        return force

    def slopes(self, force: Array, by_force: Array) -> Array:
        """Derivatives by the diameters; (objectives, count).

        Parameters
        ----------
        force : ndarray, (steps,)
            That was computed last.
        by_force : ndarray, (objectives, steps)
            Derivatives of objectives by it.
        """
        back, totals = self._backward(len(by_force))
        back.retune(self._now)
        stiff = objective.EXPONENT * np.divide(
            force, self._rows[:, 0], out=np.zeros_like(force), where=force > 0
        )
        seeds = reverse.Seeds((by_force * stiff)[..., None], self._place, 1, 1)
        back.set(self._u, self._v)
        back.sow(seeds, self._steps)
        back.reverse(self._steps, self._steps, seeds)
        by_constant = totals.p[:, 0].copy()
        by_constant[:, -1] += by_force @ force / self._table[-1, 0]
        moved: Any = self._sizes[None] * (1 + 1j * TINY)
        all_ = self._space.designs(moved)
        weight = (1 / all_.mass[0]).imag / (TINY * self._sizes)
        radius = all_.radius[0].imag / (TINY * self._sizes)
        before, behind = (x[0] for x in self._designs.contact_slopes(self._wall))
        by_radius = (by_constant * before)[:, 1:] + (by_constant * behind)[:, :-1]
        return by_radius * radius + totals.w[:, 1:-1] * weight

    def norm(self, sizes: Array, p: float) -> tuple[float, float, Array]:
        """Largest force [N]; the p-norm of the force over that of 1 N all the time [N]; and its
        slopes [N/m], (count,)."""
        force = self.force(sizes)
        top = force.max()
        powers = (force / top) ** (p - 1)
        mean = float(np.mean(powers * force / top))
        value = top * mean ** (1 / p)
        by_force = value / top * powers / (mean * len(force))
        steps, shares = _maxima(force)
        largest = float((shares * force[steps]).sum(axis=1).max())
        return largest, value, self.slopes(force, by_force[None])[0]

    def peaks(self, sizes: Array) -> tuple[Array, Array]:
        """The highest maxima of the force [N], the first the largest; (PEAKS,), 0 where there are
        fewer.  Their slopes [N/m]; (PEAKS, count)."""
        force = self.force(sizes)
        steps, shares = _maxima(force)
        values = np.zeros(PEAKS)
        by_force = np.zeros((PEAKS, len(force)))
        heights = (shares * force[steps]).sum(axis=1)
        for k, number in enumerate(np.argsort(-heights, kind="stable")[:PEAKS]):
            values[k] = heights[number]
            by_force[k, steps[number]] = shares[number]
        return values, self.slopes(force, by_force)


def _maxima(force: Array) -> tuple[Indices, Array]:
    """Three steps around each maximum, and the shares of their forces in the parabola's top.

    These are also the derivatives of the top: where it is highest, it does not move the height.  A
    force that still rises at the end has its maximum there.
    """
    top = np.flatnonzero((force[1:-1] > force[:-2]) & (force[1:-1] >= force[2:])) + 1
    before, at, after = force[top - 1], force[top], force[top + 1]
    s = (after - before) / (2 * (2 * at - before - after))
    shares = np.stack([s * (s - 1) / 2, 1 - s**2, s * (s + 1) / 2], axis=1)
    steps = top[:, None] + np.arange(-1, 2)
    if force[-1] > force[-2]:
        steps = np.concatenate([steps, [[len(force) - 3, len(force) - 2, len(force) - 1]]])
        shares = np.concatenate([shares, [[0.0, 0.0, 1.0]]])
    return steps, shares


class Way(NamedTuple):
    """What was computed on the way down from a start.

    Attributes
    ----------
    rows : ndarray, (passes, count)
        Diameters [m].
    forces : ndarray, (passes,)
        Largest on the wall [N].
    """

    rows: Array
    forces: Array


@dataclass(frozen=True)
class Descents:
    """Starts -> ways downhill; sent to workers.

    Attributes
    ----------
    space : Sizes
    striker : Striker
    wall : Material
    t_end, dt : float
        Time, and step of a search [s], of which `PARTS` are made.
    """

    space: Sizes
    striker: Striker
    wall: Material
    t_end: float
    dt: float

    def __call__(self, start: Array) -> Way:
        steps = PARTS * objective.step_count(self.dt, self.t_end, self.dt)
        one = Pass(self.space, self.striker, self.wall, self.t_end, steps)
        return downhill(one, self.space, start)


def downhill(one: Pass, space: Sizes, start: Array) -> Way:
    """The way from a start to the nearest low place; it ends where no wave arrives in time.

    Parameters
    ----------
    one : Pass
        Of the same space.
    space : Sizes
    start : ndarray, (count,)
        Diameters [m].
    """
    from scipy.optimize import minimize

    low, high = space.diameters
    rows: list[Array] = []
    forces: list[float] = []

    def kept(x: Array, force: float) -> None:
        rows.append(x)
        forces.append(force)

    def norm(x: Array, p: float) -> tuple[float, Array]:
        sizes = x * high
        if not _fits(space, sizes):  # by round-off of the quadratic program
            sizes = space.projected(sizes)
        largest, value, slopes = one.norm(sizes, p)
        kept(sizes, largest)
        return float(np.log(value)), slopes * high / value

    x = space.projected(start) / high
    try:
        for p in NORMS:
            found = minimize(
                norm, x, args=(p,), jac=True, method="SLSQP", bounds=[(low / high, 1.0)] * x.size,
                options={"maxiter": ITERATIONS, "ftol": 1e-6},
                constraints={"type": "eq", "fun": lambda x: x.sum() - space.length / high,
                             "jac": lambda x: np.ones(x.size)},
            )  # fmt: skip
            x = space.projected(found.x * high) / high
        _pressed(one, space, rows[int(np.argmin(forces))], kept)
    except NotArrived:
        pass
    return Way(np.array(rows).reshape(-1, x.size), np.array(forces))


def _fits(space: Sizes, sizes: Array) -> bool:
    """Whether diameters are within the limits, and their sum is the length but for round-off."""
    low, high = space.diameters
    inside = low <= sizes.min() and sizes.max() <= high
    return bool(inside and abs(sizes.sum() - space.length) <= SLACK * space.length)


def _pressed(one: Pass, space: Sizes, start: Array, kept: Any) -> None:
    """Go on from a start with all of the highest maxima in view."""
    from scipy.optimize import linprog

    low, high = space.diameters
    sizes, reach = space.projected(start), REACH
    values, slopes = one.peaks(sizes)
    kept(sizes, values[0])
    cost = np.append(np.zeros(space.count), 1.0)
    level = np.append(np.ones(space.count), 0.0)[None]
    for _ in range(PROGRAMS):
        if reach < NEAR:
            return
        some = values > 0
        heights = np.log(values[some] / values[0])
        lines = np.column_stack([slopes[some] * high / values[some, None], -np.ones(some.sum())])
        least, most = (np.clip((x - sizes) / high, -reach, reach) for x in (low, high))
        found = linprog(
            cost, A_ub=lines, b_ub=-heights, A_eq=level, b_eq=[0.0],
            bounds=[*zip(least, most, strict=True), (None, None)],
        )  # fmt: skip
        if found.x is None or found.x[-1] > -1e-7:
            return
        trial = space.projected(sizes + high * found.x[:-1])
        there = one.peaks(trial)
        kept(trial, there[0][0])
        gain = np.log(there[0][0] / values[0]) / found.x[-1]  # 1: as the slopes promise
        if gain > 0:
            sizes, (values, slopes) = trial, there
        reach *= 2 if gain > 0.75 else 0.25 if gain < 0.1 else 1 if gain > 0.4 else 0.5
