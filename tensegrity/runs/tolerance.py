"""Runs to a tolerance: trial runs with different steps, compared at the same instants until their
differences show that it is met; and polynomials fitted to the springs within the tolerance."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Self

import numpy as np

from tensegrity.engine.codegen import cost
from tensegrity.errors import LockingError, RangeError, StabilityError, TensegrityError
from tensegrity.notebook import one_bar
from tensegrity.runs.march import MarchResult, march
from tensegrity.runs.problem import Problem
from tensegrity.runs.record import Record, is_light
from tensegrity.runs.run import unchecked_replace
from tensegrity.runs.step import (
    CHECKPOINTS,
    COARSE,
    ErrorEstimator,
    length_at_rest,
    may_jump,
    refined,
    refuse_jumps,
    run_at_rest,
    steps_at,
)
from tensegrity.springs.polynomial import DEGREES, Polynomial, PolynomialLaw
from tensegrity.typing import Array


class Trial:
    """A trial run, one level of refinement.

    Attributes
    ----------
    march : MarchResult
    instants : int
        Number of evenly spaced instants after the first; the same for all trial runs.
    steps : int
        Number of steps done.
    complete : bool
        Whether the run was not interrupted.
    elongation_range : ndarray, (springs, 2)
        Smallest and largest elongation of each spring [m].
    samples : ndarray, (2, instants + 1, *shape)
        u [m] and v [m/s] at the instants.
    refinement : float
        Number of steps from one instant to the next.
    """

    def __init__(self, march: MarchResult, instants: int) -> None:
        self.march, self.instants, self.run = march, instants, march.run
        self.steps, self.complete, self.elongation_range = (
            march.steps,
            march.complete,
            march.elongation_range,
        )
        self.samples, self.refinement = march.samples, march.steps / instants

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
        """Largest difference from a finer trial run in u and in v, over the largest value there."""
        gaps = _largest(self.samples - finer.samples)
        return float(np.divide(gaps, finer._sizes, out=gaps, where=finer._sizes > 0).max())


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


def _largest(samples: Array) -> Array:
    """Largest absolute values of u and of v."""
    return np.abs(samples).reshape(2, -1).max(axis=1)


FORCE_FRACTION = 0.1  # of a tolerance that the error of fitted forces may take
FIRST_ERROR, LEAST_ERROR = 1e-3, 1e-13  # of the first fit over the tolerance, and of any fit
FITS = 4  # attempts to fit
WORTH = 0.005  # least time that fitted forces must save [s]
PER_FIT = 0.004  # time that a fit takes [s]


def with_polynomials(problem, coarse, tol, margin):
    """The problem with fitted forces, if they are accurate enough.

    Parameters
    ----------
    problem : Problem
    coarse : Trial
        A trial run with the exact forces.
    tol : float
    margin : float
        By which fraction of the elongations reached the range of a fit is wider on either side.

    Returns
    -------
    (Problem, Trial, float), or None
        The problem, the coarse run with fitted forces, and its largest relative difference.

    Raises
    ------
    RangeError
        That run leaves the range of a fit.
    """
    dyn = problem.dynamics
    springs = dyn.springs.different
    ranges = [
        _with_margin(spring, *elongation_range, margin)
        for spring, elongation_range in zip(springs, coarse.elongation_range, strict=True)
    ]
    error, least = max(FIRST_ERROR * tol, LEAST_ERROR), 0.0
    for _ in range(FITS):
        try:
            fits = [Polynomial(s, *r, error) for s, r in zip(springs, ranges, strict=True)]
            fitted = unchecked_replace(problem, surrogate=dyn.with_springs(fits))
            there = march(trial_of(fitted), coarse.steps, 1.0, coarse.instants)
        except RangeError:
            raise
        except (LockingError, StabilityError):
            return None
        except TensegrityError:  # no fit is that accurate: try a larger error
            least = error
            error *= 10
            continue
        found = Trial(there, coarse.instants)
        if not there.complete:
            return fitted, found, 0.0
        gap = coarse.gap(found)
        if gap <= FORCE_FRACTION * tol:
            return fitted, found, gap
        error *= FORCE_FRACTION * tol / gap / 3
        if error <= least:
            return None
    return None


def may_fit(problem, steps, tol):
    """Whether fitted forces are likely to save time.

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


def _with_margin(spring, low, high, margin):
    """A range of elongations wider by a margin, within the domain of the spring [m]."""
    room = margin * (high - low)
    low, high = low - room, high + room
    return max(low, spring.computable_domain[0]), min(high, spring.computable_domain[1])


TRIAL = 0.85  # first step over the stability limit where a tolerance decides
AT_FIRST = 13  # least steps of the first run where forces are smooth; compared at 7 instants
DENSE = 2  # first steps between two instants of comparison where forces are smooth
FEWEST, MOST_COMPARED = 16, 2_000_000  # least instants; most numbers in u of a run at them
COMPARED = 3  # most runs that are compared, the finest included
SECOND = 1e-6  # tolerances below this are rarely met by the second run
ROUND_OFF = 1e-14  # relative differences below this are round-off
MARGINS = (0.05, 0.5)  # fractions by which the range of a fit is wider on either side
STAGNANT = 4  # successive refinements without gain after which round-off is reached


@one_bar("step")
def to_tolerance(problem, tol):
    """Run, with a step refined until runs with different steps show that a tolerance is met.

    All trial runs have a whole number of steps between the same instants, at which they are
    compared: after every step of the first run, near the stability limit, or every second one.
    """
    if not problem.t_end:
        return march(problem, 0).run()
    if may_jump(problem.dynamics):
        refuse_jumps(problem, problem.dynamics.ranges_at(problem.state.u), tol)
    steps_per_instant, fewest = (DENSE, AT_FIRST) if problem.dynamics.smooth else (1, CHECKPOINTS)
    least = steps_at(problem, TRIAL, problem.a_priori.first_frequency, fewest)
    instants = min(
        math.ceil(least / steps_per_instant), max(FEWEST, MOST_COMPARED // problem.state.u.size)
    )
    refinement = math.ceil(least / instants)
    problem.record.check_room(refinement * instants, problem.t_end, problem.scene.shape)
    first = Trial.of(trial_of(problem), refinement, instants)
    if first.complete and (length := length_at_rest(problem, first.samples[0])):
        return run_at_rest(problem, length, tol)
    if first.complete and may_fit(problem, refinement * instants, tol):
        for margin in MARGINS:
            try:
                fitted = with_polynomials(problem, first, tol, margin)
                if fitted is None:
                    break
                return converged(*fitted, tol)
            except RangeError:  # a finer run leaves the range of the fit
                continue
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
        found = next_trial(problem, trials, factor, tol)
        if not found.complete:
            return found.run()
        estimator.update(found.elongation_range)
        if found.refinement in [r.refinement for r in trials]:  # stability required a finer step
            factor = estimator.first
            continue
        trials = sorted([*trials, found], key=lambda r: r.refinement)[-COMPARED:]
        gaps = [(r.refinement / trials[-1].refinement, r.gap(trials[-1])) for r in trials[:-1]]
        estimate = estimator.estimate(gaps) + estimator.round_off(trials[-1], gaps[-1][1])
        if estimate <= estimator.accept * tol or gaps[-1][1] < ROUND_OFF:
            return accepted_run(problem, trials[-1], estimate + error)
        stagnant = stagnant + 1 if gaps[-1][1] > smallest / 2 else 0
        smallest = min(smallest, gaps[-1][1])
        if stagnant == STAGNANT:
            raise TensegrityError(
                f"tol {tol:g} is below {max(smallest, tol):.1e}: up to {trials[-1].steps} steps do "
                "not make smaller the difference of two runs, which is round-off"
            )
        factor = estimator.factor(gaps)
        factor = min(factor, 2.0) if stagnant else factor
    return trials[-1].run()  # interrupted


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
    refinement = max(math.ceil(finest * factor), int(finest) + 1 if factor > 1 else 1)
    keeps_rows = factor > 1 and (len(trials) > 1 or tol > SECOND)
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
    found = trial.march
    if problem.observe or not found.has_rows:
        found = march(problem, trial.steps)
    return unchecked_replace(found.run(), error_estimate=estimate if found.complete else None)
