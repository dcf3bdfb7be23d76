"""Runs to a tolerance: trials with different steps, compared at the same instants, until their
differences say that it is met; and springs fitted to what a tolerance allows."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Self

import numpy as np

from tensegrity.engine.codegen import cost
from tensegrity.errors import LockingError, RangeError, StabilityError, TensegrityError
from tensegrity.runs.march import Marched, march
from tensegrity.runs.problem import Problem
from tensegrity.runs.record import Record
from tensegrity.runs.run import unchecked_replace
from tensegrity.runs.step import (
    CHECKPOINTS,
    COARSE,
    ErrorEstimator,
    may_jump,
    refined,
    refuse_jumps,
    resting,
    rests,
    steps_at,
)
from tensegrity.springs.polynomial import DEGREES, Polynomial, PolynomialLaw
from tensegrity.typing import Array


class Trial:
    """One of the runs that are compared.

    Attributes
    ----------
    march : Marched
    instants : int
        Evenly spaced ones, besides the first, which all trials have in common.
    steps : int
        That were done.
    complete : bool
        Whether it was not interrupted.
    met : ndarray, (springs, 2)
        Smallest and largest elongation of each spring [m].
    samples : ndarray, (2, instants + 1, *shape)
        u and v at the instants.
    fineness : float
        Steps from one instant to the next.
    """

    def __init__(self, march: Marched, instants: int) -> None:
        self.march, self.instants, self.run = march, instants, march.run
        self.steps, self.complete, self.elongation_range = (
            march.steps,
            march.complete,
            march.elongation_range,
        )
        self.samples, self.refinement = march.samples, march.steps / instants

    @classmethod
    def of(cls, problem: Problem, steps: int, instants: int) -> Self:
        """With so many steps from one instant to the next, or more where those are too coarse."""
        return cls(refined(problem, steps * instants, 1.0, instants), instants)

    @cached_property
    def _sizes(self) -> Array:
        return _largest(self.samples)

    def gap(self, finer: Trial) -> float:
        """Largest difference from a finer one in u and in v, over the largest value there."""
        gaps = _largest(self.samples - finer.samples)
        return float(np.divide(gaps, finer._sizes, out=gaps, where=finer._sizes > 0).max())


def trial_of(problem: Problem, rows: bool = False) -> Problem:
    """A problem whose run is a trial, with rows only where they cost nothing more: it may turn out
    to be the answer."""
    record = problem.record
    if not record.is_plain:
        record = Record(sites=record.sites)
    rows = rows and problem.record.is_plain and not problem.observe
    return unchecked_replace(problem, record=record, rows=rows, observe=())


def _largest(samples: Array) -> Array:
    """Largest sizes of u and of v."""
    return np.abs(samples).reshape(2, -1).max(axis=1)


FORCE_SHARE = 0.1  # of a tolerance that fitted forces may take up
FIRST_ERROR, LEAST_ERROR = 1e-3, 1e-13  # of a fit over the tolerance, and of any fit
FITS = 4  # attempts
WORTH = 0.005  # seconds that fitted forces must save
PER_FIT = 0.004  # seconds


def with_polynomials(problem, coarse, tol, margin):
    """The problem with fitted forces, where they are good enough.

    Parameters
    ----------
    problem : Problem
    coarse : Trial
        With the exact forces.
    tol, margin : float

    Returns
    -------
    None, or problem, the same coarse run with fitted forces, and the largest difference that they
    make there

    Raises
    ------
    RangeError
        If that run leaves the range.
    """
    of = problem.dynamics
    springs = of.springs.different
    ranges = [
        _widened(spring, *elongation_range, margin)
        for spring, elongation_range in zip(springs, coarse.elongation_range, strict=True)
    ]
    error, least = max(FIRST_ERROR * tol, LEAST_ERROR), 0.0
    for _ in range(FITS):
        try:
            fits = [Polynomial(s, *r, error) for s, r in zip(springs, ranges, strict=True)]
            fitted = unchecked_replace(problem, surrogate=of.with_springs(fits))
            there = march(trial_of(fitted), coarse.steps, 1.0, coarse.instants)
        except RangeError:
            raise
        except (LockingError, StabilityError):
            return None
        except TensegrityError:  # not that good: see whether a worse one is good enough
            least = error
            error *= 10
            continue
        found = Trial(there, coarse.instants)
        if not there.complete:
            return fitted, found, 0.0
        gap = coarse.gap(found)
        if gap <= FORCE_SHARE * tol:
            return fitted, found, gap
        error *= FORCE_SHARE * tol / gap / 3
        if error <= least:
            return None
    return None


def may_fit(problem, steps, tol):
    """Whether fitted forces are worth a try, after a first run with so many steps."""
    if problem.record.checkpoint is not None:
        return False  # a state that is kept has to say what the forces are
    if problem.dynamics.follows or problem.dynamics.is_driven:
        return False
    return saved(problem, steps, tol) >= WORTH


def saved(problem, steps, tol):
    """Seconds that fitted forces save, roughly, in all runs that a tolerance takes."""
    of, order = problem.dynamics, problem.method.order
    if of.saving is None:
        springs, group = of.springs.different, of.springs.group
        fitted = cost(PolynomialLaw(DEGREES[len(DEGREES) // 2]))
        gains = [max(cost(spring.law) - fitted, 0.0) for spring in springs]
        often = math.prod(of.batch) if group.ndim == 1 else 1  # of scenes that have them in common
        of.saving = often * float(np.dot(gains, np.bincount(group.ravel())))
    steps *= max((COARSE / tol) ** (1 / order), 1.0)  # to those of the last run, as a rule
    calls = steps * problem.method.stages
    return calls * of.saving - PER_FIT * len(of.springs)


def _widened(spring, low, high, margin):
    """A range somewhat wider than the one met, inside the spring's reach."""
    room = margin * (high - low)
    low, high = low - room, high + room
    return max(low, spring.reach[0]), min(high, spring.reach[1])


TRIAL = 0.85  # first step over the stability limit where a tolerance decides
AT_FIRST = 13  # of a smooth run that is compared with others, at 7 instants then
DENSE = 2  # first steps between two instants at which runs are compared, where nothing opens
FEWEST, MOST_KEPT = 16, 2_000_000  # instants; numbers in each of u and v of a run at them
KEPT = 3  # runs that are compared with the last one, and it
SECOND = 1e-6  # tolerances that the second run does not meet, as a rule
ROUND_OFF = 1e-14  # differences below this say nothing
MARGINS = (0.05, 0.5)  # over the range met, on either side, by which a fit is wider
STUCK = 4  # refinements in a row that bring nothing: round-off is reached


def to_tolerance(problem, tol):
    """The run whose step is refined until runs with different steps say that a tolerance is met.

    All runs have steps of which a whole number goes between the same instants, at which they are
    compared: those of the first run's steps, at the stability limit, or every second.
    """
    if not problem.t_end:
        return march(problem, 0).run()
    if may_jump(problem.dynamics):
        refuse_jumps(problem, problem.dynamics.ranges_at(problem.state.u), tol)
    apart, fewest = (DENSE, AT_FIRST) if problem.dynamics.smooth else (1, CHECKPOINTS)
    least = steps_at(problem, TRIAL, problem.a_priori.first_frequency, fewest)
    instants = min(math.ceil(least / apart), max(FEWEST, MOST_KEPT // problem.state.u.size))
    refinement = math.ceil(least / instants)
    problem.record.check_room(refinement * instants, problem.t_end, problem.scene.shape)
    first = Trial.of(trial_of(problem), refinement, instants)
    if first.complete and (length := rests(problem, first.samples[0])):
        return resting(problem, length, tol)
    if first.complete and may_fit(problem, refinement * instants, tol):
        for margin in MARGINS:
            try:
                fitted = with_polynomials(problem, first, tol, margin)
                if fitted is None:
                    break
                return converged(*fitted, tol)
            except RangeError:  # finer runs reach farther than the coarse one
                continue
    return converged(problem, first, 0.0, tol)


def converged(problem, first, error, tol):
    """Refine from a first run on; `error` is what fitted forces add.

    The error of a run is its largest difference from a finer one.  That of the finest follows
    by the order that errors of coarser runs fall with, as far as it is to be trusted: see
    `ErrorEstimator`.  Where that of far coarser ones tells too little, another one between them and
    it tells more.
    """
    estimator = ErrorEstimator(problem, first.elongation_range, tol)
    trials, stuck = [first], 0
    factor, smallest = estimator.first, math.inf
    while trials[-1].complete:
        found = next_trial(problem, trials, factor, tol)
        if not found.complete:
            return found.run()
        estimator.see(found.elongation_range)
        if found.refinement in [r.refinement for r in trials]:  # what is between had to be finer
            factor = estimator.first
            continue
        trials = sorted([*trials, found], key=lambda r: r.refinement)[-KEPT:]
        gaps = [(r.refinement / trials[-1].refinement, r.gap(trials[-1])) for r in trials[:-1]]
        estimate = estimator.estimate(gaps) + estimator.rounded(trials[-1], gaps[-1][1])
        if estimate <= estimator.accept * tol or gaps[-1][1] < ROUND_OFF:
            return answer(problem, trials[-1], estimate + error)
        stuck = stuck + 1 if gaps[-1][1] > smallest / 2 else 0
        smallest = min(smallest, gaps[-1][1])
        if stuck == STUCK:
            raise TensegrityError(
                f"tol {tol:g} is below {max(smallest, tol):.1e}, the difference of two runs that "
                f"{trials[-1].steps} steps, and fewer, do not make smaller"
            )
        factor = estimator.factor(gaps)
        factor = min(factor, 2.0) if stuck else factor
    return trials[-1].run()  # interrupted


def next_trial(problem, trials, factor, tol):
    """One that is finer than the finest by a factor."""
    finest = trials[-1].refinement
    refinement = max(math.ceil(finest * factor), int(finest) + 1 if factor > 1 else 1)
    likely = factor > 1 and (len(trials) > 1 or tol > SECOND)
    return Trial.of(trial_of(problem, likely), refinement, trials[0].instants)


def answer(problem, trial, estimate):
    """The run that meets a tolerance, with the rows that were asked for."""
    found = trial.march
    if not (problem.record.is_plain and found.has_rows and not problem.observe):
        found = march(problem, trial.steps)
    return unchecked_replace(found.run(), error_estimate=estimate if found.complete else None)
