"""Runs to a tolerance: trial runs with different steps, compared at the same instants until their
differences show that it is met; and polynomials fitted to the springs within the tolerance."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import Any, Self

import numpy as np

from tensegrity.engine.codegen import cost
from tensegrity.errors import LockingError, RangeError, StabilityError, TensegrityError
from tensegrity.notebook import one_bar
from tensegrity.once import once
from tensegrity.runs.march import MOST_COMPARED, MarchResult, march
from tensegrity.runs.problem import Problem, bounds_at_energy, length_at_rest, rounded
from tensegrity.runs.record import Record, is_light
from tensegrity.runs.run import unchecked_replace
from tensegrity.runs.step import (
    CHECKPOINTS,
    COARSE,
    UNRESOLVED,
    ErrorEstimator,
    refined,
    refuse_jumps,
    run_at_rest,
    steps_at,
)
from tensegrity.scenes.dynamics import dynamics
from tensegrity.springs.polynomial import DEGREES, Polynomial, PolynomialLaw
from tensegrity.springs.potential import Potential
from tensegrity.typing import Array


class Trial:
    """A trial run, one level of refinement.

    Attributes
    ----------
    march : MarchResult or None
        None where the run is complete and has no rows, which leaves the samples.
    instants : int
        Number of evenly spaced instants after the first; the same for all trial runs.
    steps : int
        Number of steps done.
    complete : bool
        Whether the run was not interrupted.
    elongation_range : ndarray, (springs, 2)
        Smallest and largest elongation of each spring [m].
    samples : ndarray, (2, count + 1, *shape)
        u [m] and v [m/s] at the instants, or at more of them; see `march`.
    refinement : int
        Number of steps from one instant to the next.
    """

    def __init__(self, march: MarchResult, instants: int) -> None:
        self.march: Any = march if march.has_rows or not march.complete else None
        self.instants = instants
        self.steps, self.complete, self.elongation_range = (
            march.steps,
            march.complete,
            march.elongation_range,
        )
        self.samples, self.refinement = march.samples, march.steps // instants

    @classmethod
    def of(cls, problem: Problem, steps: int, instants: int) -> Self:
        """Do a trial run.

        Parameters
        ----------
        problem : Problem
        steps : int
            Steps from one instant to the next; more are taken where the stability requires it.
        instants : int

        Returns
        -------
        Trial
        """
        return cls(refined(problem, steps * instants, 1.0, instants), instants)

    @cached_property
    def _sizes(self) -> Array:
        return _largest(self.samples)

    def gap(self, finer: Trial) -> float:
        """Largest difference from a finer trial run in u and in v, at all instants that both have,
        over the largest value there."""
        counts = self.samples.shape[1] - 1, finer.samples.shape[1] - 1
        common = math.gcd(*counts)
        both: Any = (
            one.samples[:, :: count // common]
            for one, count in zip((self, finer), counts, strict=True)
        )
        both = zip(_largest(*both).tolist(), finer._sizes.tolist(), strict=True)
        return max(gap / size if size > 0 else gap for gap, size in both)


def trial_of(problem: Problem, rows: bool = False) -> Problem:
    """The problem of a trial run; it records rows, at no extra cost, where it may turn out to be
    the final run."""
    record, light = problem.record, is_light(problem.record, problem.t_end)
    return unchecked_replace(
        problem,
        record=record if light else Record(sites=record.sites),
        rows=rows and light and not problem.observe,
        observe=(),
    )


def _largest(samples: Array, others: Array | None = None) -> Array:
    """Largest absolute values of u and of v, or of their differences from others, some instants at
    a time: of a large scene, their copies are as large as all else."""
    largest, count = np.zeros(2), max(1, AT_ONCE // samples[:, :1].size)
    for k in range(0, samples.shape[1], count):
        some = samples[:, k : k + count]
        some = some if others is None else some - others[:, k : k + count]
        largest = np.maximum(largest, np.abs(some).reshape(2, -1).max(axis=1))
    return largest


AT_ONCE = 50_000  # most numbers of samples that are compared at once, within a cache
FORCE_FRACTION = 0.1  # of a tolerance that the error of fitted forces may take
FIRST_ERROR, LEAST_ERROR = 1e-3, 1e-13  # of the first fit over the tolerance, and of any fit
FINER = 0.2  # error of the fit that shows the error of another one, over that
FITS = 4  # attempts to fit
RANGES, NARROWER = 4, 0.25  # ranges that are tried, and ratio of the energies that they allow
MODEST = 19  # degree of a fit above which a narrower range is tried first
WORTH = 0.001  # least time that fitted forces must save [s]
PER_FIT = 0.004  # time that the fits of a spring take [s]


@once
def _fit(spring: Potential, low: float, high: float, error: float) -> Polynomial | None:
    """A polynomial for a spring over a range, or None.  As ranges and errors are taken from fixed
    grids, runs with similar energies share it, and no result depends on earlier runs."""
    try:
        return Polynomial(spring, low, high, error)
    except TensegrityError:  # a range of no width, or an error that no degree attains
        return None


def _fitted(problem: Problem, ranges: Array, errors: Sequence[float]) -> Problem | None:
    """The problem with fits of each spring, over a range of elongation and with an error of its
    own; None if a spring has none."""
    fits, dyn = [], problem.dynamics
    for spring, (low, high), error in zip(
        dyn.springs.different, ranges.tolist(), errors, strict=True
    ):
        fits.append(_fit(spring, low, high, error))
        if fits[-1] is None:
            return None
    return unchecked_replace(problem, loop_dynamics=dynamics(dyn.surrogate(tuple(fits))))


def _fits(fitted: Problem) -> Sequence[Polynomial]:
    return fitted.loop_dynamics.springs.different


def ranges_of_fits(problem: Problem, tol: float) -> list[Array]:
    """Ranges of elongation over which to fit the forces, in the order in which to try them.

    The widest one takes a spring that receives all the energy.  Where this needs a high degree, a
    narrower one comes first, which the run may leave.
    """
    dyn, energy = problem.a_priori.nearest
    if dyn is not problem.dynamics:
        return []
    candidates = []
    for k in range(RANGES):
        ranges = bounds_at_energy(dyn, rounded(energy * NARROWER**k)).ranges
        fitted = _fitted(problem, ranges, [_first_error(tol)] * len(ranges))
        if fitted is None:
            candidates.clear()
            continue
        candidates.append(ranges)
        if max(fit.degree for fit in _fits(fitted)) <= MODEST:
            break
    return candidates[::-1]


def _first_error(tol: float) -> float:
    return max(10.0 ** math.floor(math.log10(FIRST_ERROR * tol)), LEAST_ERROR)


def with_polynomials(
    problem: Problem, ranges: Array, steps: int, instants: int, tol: float
) -> tuple[Problem, Trial, float] | None:
    """The problem with fitted forces, if they are accurate enough: a run with fits that are far
    more accurate, or with the exact forces, shows their error.

    Parameters
    ----------
    problem : Problem
    ranges : ndarray, (springs, 2)
        Of elongation [m].
    steps : int
        Steps of the first trial run from one instant to the next.
    instants : int
        At which runs are compared.
    tol : float

    Returns
    -------
    (Problem, Trial, float), or None
        The problem, its first trial run, and the largest relative difference that fitting makes.

    Raises
    ------
    RangeError
        A run leaves the range of a fit.
    """
    error = _first_error(tol)
    for _ in range(FITS):
        fitted = _fitted(problem, ranges, [error] * len(ranges))
        if fitted is None:
            return None
        errors = [FINER * fit.error_estimate for fit in _fits(fitted)]
        finer = _fitted(problem, ranges, errors) or problem
        try:
            first = Trial.of(trial_of(fitted), steps, instants)
            if not first.complete:
                return fitted, first, 0.0
            exact = Trial(march(trial_of(finer), first.steps, 1.0, instants), instants)
        except RangeError:
            raise
        except (LockingError, StabilityError):
            return None
        if not exact.complete:
            return finer, exact, 0.0
        if length_at_rest(problem, first.samples[0]):
            return None
        gap = first.gap(exact) / (1 - FINER)
        if gap <= FORCE_FRACTION * tol:
            return fitted, first, gap
        if error <= LEAST_ERROR:
            return None
        needed = error * FORCE_FRACTION * tol / gap / 3
        error = max(10.0 ** math.floor(math.log10(needed)), LEAST_ERROR)
    return None


def may_fit(problem, steps, tol):
    """Whether fitted forces are expected to save time.

    Parameters
    ----------
    problem : Problem
    steps : int
        Number of steps of the first run.
    tol : float

    Returns
    -------
    bool
    """
    if problem.record.checkpoint is not None:
        return False  # the fits are not part of a checkpoint
    if problem.dynamics.follows or problem.dynamics.is_driven:
        return False
    return seconds_saved(problem, steps, tol) >= WORTH


def seconds_saved(problem, steps, tol):
    """Estimate of the time that fitted forces save in all trial runs for a tolerance.

    Parameters
    ----------
    problem : Problem
    steps : int
        Number of steps of the first run.
    tol : float

    Returns
    -------
    float
        [s]
    """
    dyn, order = problem.dynamics, problem.method.order
    if dyn.saving is None:
        springs, group = dyn.springs.different, dyn.springs.group
        fitted = cost(PolynomialLaw(DEGREES[len(DEGREES) // 2]))
        gains = [max(cost(spring.law) - fitted, 0.0) for spring in springs]
        often = math.prod(dyn.batch) if group.ndim == 1 else 1  # scenes with common springs
        dyn.saving = often * float(np.dot(gains, np.bincount(group.ravel())))
    steps *= max((COARSE / tol) ** (1 / order), 1.0)  # usually those of the last run
    calls = steps * problem.method.stages
    return calls * dyn.saving - PER_FIT * len(dyn.springs)


TRIAL = 0.85  # first step over the stability limit where a tolerance decides
AT_FIRST = 13  # least steps of the first run where forces are smooth; compared at 7 instants
DENSE = 2  # first steps between two instants of comparison where forces are smooth
DIVISIBLE = 2  # the same of driven scenes, all of whose steps are compared
FEWEST = 4  # least instants
COMPARED = 3  # most runs that are compared, the finest included
SECOND = 1e-6  # tolerances below this are rarely attained by the second run
SHORT = 10_000  # steps times entries of u of a run whose rows cost less than a run for them alone
ROUND_OFF = 1e-14  # relative differences below this are round-off
# Successive refinements without gain after which round-off is reached: of a method of order 2 or
# more, and of less, where a run may be better than the next ones by chance.
STAGNANT, STAGNANT_BELOW_2 = 4, 12


@one_bar("step")
def to_tolerance(problem, tol):
    """Run, with a step refined until runs with different steps show that a tolerance is met.

    All trial runs have a whole number of steps between the same instants, at which they are
    compared: after every step of the first run, near the stability limit, or every second one.
    """
    if not problem.t_end:
        return march(problem, 0).run()
    if problem.dynamics.kinked.jumps:
        refuse_jumps(problem, problem.dynamics.ranges_at(problem.state.u), tol)
    steps_per_instant, fewest = (DENSE, AT_FIRST) if problem.dynamics.smooth else (1, CHECKPOINTS)
    if problem.dynamics.is_driven:
        steps_per_instant = DIVISIBLE
    least = steps_at(problem, TRIAL, problem.a_priori.first_frequency, fewest)
    instants = min(
        math.ceil(least / steps_per_instant), max(FEWEST, MOST_COMPARED // problem.state.u.size)
    )
    refinement = math.ceil(least / instants)
    problem.record.check_room(refinement * instants, problem.t_end, problem.scene.shape)
    if may_fit(problem, refinement * instants, tol):
        for ranges in ranges_of_fits(problem, tol):
            try:
                fitted = with_polynomials(problem, ranges, refinement, instants, tol)
                if fitted is None:
                    break
                return converged(*fitted, tol)
            except RangeError:  # a run leaves the range of the fits
                continue
    first = Trial.of(trial_of(problem), refinement, instants)
    if first.complete and (length := length_at_rest(problem, first.samples[0])):
        return run_at_rest(problem, length, tol)
    return converged(problem, first, 0.0, tol)


def converged(problem, first, error, tol):
    """Refine from a first trial run until the error estimate is within the tolerance.

    The error of a run is its largest difference from a finer one; that of the finest run follows
    by extrapolation, see `ErrorEstimator`.  Where much coarser runs leave it uncertain, a run
    between them and the finest is added.

    Parameters
    ----------
    problem : Problem
    first : Trial
    error : float
        Contribution of fitted forces to the error.
    tol : float

    Returns
    -------
    Run

    Raises
    ------
    TensegrityError
        Round-off is reached before the tolerance.
    """
    estimator = ErrorEstimator(problem, first.elongation_range, tol)
    trials, stagnant = [first], 0
    factor, smallest = estimator.first, math.inf
    while trials[-1].complete:
        latest = next_trial(problem, trials, factor, tol)
        if not latest.complete:
            return latest.march.run()
        estimator.update(latest.elongation_range)
        if latest.refinement in [r.refinement for r in trials]:  # stability required a finer step
            factor = estimator.first
            continue
        trials = sorted([*trials, latest], key=lambda r: r.refinement)[-COMPARED:]
        for coarser in trials[:-1]:
            coarser.march = None
        gaps = [(r.refinement / trials[-1].refinement, r.gap(trials[-1])) for r in trials[:-1]]
        estimate = estimator.estimate(gaps) + estimator.round_off(trials[-1], gaps[-1][1])
        if estimate <= estimator.accept * tol or max(gap for _, gap in gaps) < ROUND_OFF:
            for trial in (first, *trials):
                trial.samples = None
            estimator.admit(estimate + error, trials[-1].steps)
            return accepted_run(problem, trials[-1], estimate + error)
        stagnant = stagnant + 1 if gaps[-1][1] > smallest / 2 else 0
        smallest = min(smallest, gaps[-1][1])
        patient = estimator.order < 2 or (problem.dynamics.is_driven and smallest > UNRESOLVED)
        if stagnant >= (STAGNANT_BELOW_2 if patient else STAGNANT):
            raise TensegrityError(
                f"tol {tol:g} is below {max(smallest, tol):.1e}: with up to {trials[-1].steps} "
                "steps the difference of two runs is round-off and does not decrease"
            )
        factor = estimator.factor(gaps)
        factor = min(factor, 2.0) if stagnant else factor
        estimator.announce(factor * trials[-1].steps)
    return trials[-1].march.run()  # interrupted


def next_trial(problem, trials, factor, tol):
    """The next trial run.

    Parameters
    ----------
    problem : Problem
    trials : list of Trial
        The runs so far, the finest last.
    factor : float
        Number of steps over that of the finest.
    tol : float

    Returns
    -------
    Trial
    """
    finest = trials[-1].refinement
    refinement = max(math.ceil(finest * factor), finest + 1 if factor > 1 else 1)
    if problem.dynamics.is_driven:  # every step of the coarser run ends with one of the finer run
        refinement = finest * math.ceil(factor) if factor > 1 else finest // 2
    short = refinement * trials[0].instants * problem.state.u.size <= SHORT
    keeps_rows = factor > 1 and (len(trials) > 1 or tol > SECOND or short)
    return Trial.of(trial_of(problem, keeps_rows), refinement, trials[0].instants)


def accepted_run(problem, trial, estimate):
    """The run that meets the tolerance, with the requested rows.

    Parameters
    ----------
    problem : Problem
    trial : Trial
    estimate : float
        Its estimated error.

    Returns
    -------
    Run
    """
    result = trial.march
    if problem.observe or result is None:
        result = march(problem, trial.steps)
    return unchecked_replace(result.run(), error_estimate=estimate if result.complete else None)
