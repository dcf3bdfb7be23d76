"""The step of a run refined until a tolerance is met."""

from __future__ import annotations

import math

import numpy as np

from tensegrity.errors import RangeError, TensegrityError
from tensegrity.runs.driven import march
from tensegrity.runs.fitted import may_fit, with_polynomials
from tensegrity.runs.judge import Judge, first_factor, may_jump, may_open, refuse_jumps
from tensegrity.runs.march import march_twice
from tensegrity.runs.rest import resting, rests
from tensegrity.runs.run import Run, changed
from tensegrity.runs.rung import Rung, trial_of
from tensegrity.runs.step import CHECKPOINTS, steps_at
from tensegrity.runs.whole import Whole

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
    """As `_to_tolerance`; what goes wrong in a trial tells of the energies that it had."""
    try:
        return _to_tolerance(problem, tol)
    except TensegrityError as error:
        if getattr(error, "run", None) is not None:
            error.run = with_energies(error.run)
        raise


def _to_tolerance(problem, tol):
    """Refine the step until runs with different steps say that the tolerance is met.

    All runs have steps of which a whole number goes between the same instants, at which they are
    compared: those of the first run's steps, at the stability limit, or every second.
    """
    if not problem.t_end:
        return march(problem, 0, 1.0)[0]
    if may_jump(problem.scene):
        refuse_jumps(problem, problem.scene.present_ranges(problem.state.u), tol)
    apart, fewest = (DENSE, AT_FIRST) if problem.scene.smooth else (1, CHECKPOINTS)
    least = steps_at(problem, TRIAL, problem.outlook.first_frequency, fewest)
    instants = min(math.ceil(least / apart), max(FEWEST, MOST_KEPT // problem.state.u.size))
    fineness = math.ceil(least / instants)
    fits = may_fit(problem, fineness * instants, tol)
    first, *others = first_rungs(problem, fineness, instants, tol, alone=fits)
    if first.run.complete and (length := rests(problem, first.seen[0])):
        return resting(problem, length, tol)
    if fits and first.run.complete:
        for margin in MARGINS:
            try:
                fitted = with_polynomials(problem, first, tol, margin)
                if fitted is None:
                    break
                return converged(*fitted, tol)
            except RangeError:  # finer runs reach farther than the coarse one
                continue
    return converged(problem, [first, *others], 0.0, tol)


def first_rungs(problem, fineness, instants, tol, alone):
    """The first rung, or two in one call: how fine the second one is to be is known before."""
    factor = first_factor(tol, may_open(problem.scene))
    steps = fineness * instants, math.ceil(fineness * factor) * instants
    found = None if alone else march_twice(trial_of(problem, tol > SECOND), steps, instants)
    if found is None:
        return [Rung.of(trial_of(problem), fineness, instants)]
    return [Rung(run, instants, seen) for run, seen in found]


def converged(problem, first, error, tol):
    """Refine from a first run on, or two; `error` is what fitted forces add.

    The error of a run is its largest difference from a finer one.  That of the finest follows
    by the order that errors of coarser runs fall with, as far as it is to be trusted: `Judge`.
    Where that of far coarser ones tells too little, another one between them and it tells more.
    """
    rung, *others = first
    judge = Judge(problem, rung.run.met, tol)
    rungs, stuck = [rung], 0
    factor, smallest = judge.first, math.inf
    while rungs[-1].run.complete:
        found = others.pop() if others else next_rung(problem, rungs, factor, tol)
        if not found.run.complete:
            return with_energies(found.run)
        judge.see(found.run.met)
        if found.fineness in [r.fineness for r in rungs]:  # what is between had to be finer
            factor = judge.first
            continue
        rungs = sorted([*rungs, found], key=lambda r: r.fineness)[-KEPT:]
        gaps = [(r.fineness / rungs[-1].fineness, r.gap(rungs[-1])) for r in rungs[:-1]]
        estimate = judge.estimate(gaps) + judge.rounded(rungs[-1].run, gaps[-1][1])
        if estimate <= judge.accept * tol or gaps[-1][1] < ROUND_OFF:
            return answer(problem, rungs[-1].run, estimate + error)
        stuck = stuck + 1 if gaps[-1][1] > smallest / 2 else 0
        smallest = min(smallest, gaps[-1][1])
        if stuck == STUCK:
            raise TensegrityError(
                f"tol {tol:g} is below {max(smallest, tol):.1e}, the difference of two runs that "
                f"{rungs[-1].run.steps} steps, and fewer, do not make smaller"
            )
        factor = judge.factor(gaps)
        factor = min(factor, 2.0) if stuck else factor
    return with_energies(rungs[-1].run)  # interrupted


def next_rung(problem, rungs, factor, tol):
    """One that is finer than the finest by a factor."""
    finest = rungs[-1].fineness
    fineness = max(math.ceil(finest * factor), int(finest) + 1 if factor > 1 else 1)
    likely = factor > 1 and (len(rungs) > 1 or tol > SECOND)
    return Rung.of(trial_of(problem, likely), fineness, rungs[0].instants)


def answer(problem, run, estimate):
    """The run that meets a tolerance, with the rows that were asked for."""
    if problem.record.is_plain and (isinstance(run, Run) or run.has_rows):
        return changed(with_energies(run), error_estimate=estimate)
    run = march(problem, run.steps, 1.0)[0]
    return changed(run, error_estimate=estimate if run.complete else None)


def with_energies(run):
    """A trial with the energies of its rows."""
    if isinstance(run, Whole):
        return run.run()
    if not np.isnan(run.energy).any():  # some may be known, others not
        return run
    return changed(run, energy=run.scene.energies(run.u, run.v))
