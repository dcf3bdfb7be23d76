"""Runs whose forces are polynomials, where a tolerance allows it.

A first coarse run is exact and tells which elongations are met; the same run with polynomials
fitted to that range shows what their error does to the motion.  They stay if that is a small part
of the tolerance and they save time.
"""

from __future__ import annotations

import math

import numpy as np

from tensegrity.engine.codegen import cost
from tensegrity.errors import LockingError, RangeError, StabilityError, TensegrityError
from tensegrity.runs.judge import COARSE
from tensegrity.runs.march import march
from tensegrity.runs.run import changed
from tensegrity.runs.trial import Trial, trial_of
from tensegrity.springs.polynomial import DEGREES, Polynomial, PolynomialLaw

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
        _widened(spring, *met, margin) for spring, met in zip(springs, coarse.met, strict=True)
    ]
    error, least = max(FIRST_ERROR * tol, LEAST_ERROR), 0.0
    for _ in range(FITS):
        try:
            fits = [Polynomial(s, *r, error) for s, r in zip(springs, ranges, strict=True)]
            fitted = changed(problem, surrogate=of.with_springs(fits))
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
