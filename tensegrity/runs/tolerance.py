"""The step of a run refined until a tolerance is met."""

from __future__ import annotations

import math

from tensegrity.errors import RangeError, TensegrityError
from tensegrity.runs.fitted import may_fit, with_polynomials
from tensegrity.runs.judge import Judge, may_jump, refuse_jumps
from tensegrity.runs.march import march
from tensegrity.runs.rest import resting, rests
from tensegrity.runs.run import changed
from tensegrity.runs.step import CHECKPOINTS, steps_at
from tensegrity.runs.trial import Trial, trial_of

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
        refuse_jumps(problem, problem.dynamics.present_ranges(problem.state.u), tol)
    apart, fewest = (DENSE, AT_FIRST) if problem.dynamics.smooth else (1, CHECKPOINTS)
    least = steps_at(problem, TRIAL, problem.outlook.first_frequency, fewest)
    instants = min(math.ceil(least / apart), max(FEWEST, MOST_KEPT // problem.state.u.size))
    fineness = math.ceil(least / instants)
    problem.record.check_room(fineness * instants, problem.t_end, problem.scene.shape)
    first = Trial.of(trial_of(problem), fineness, instants)
    if first.complete and (length := rests(problem, first.samples[0])):
        return resting(problem, length, tol)
    if first.complete and may_fit(problem, fineness * instants, tol):
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
    by the order that errors of coarser runs fall with, as far as it is to be trusted: `Judge`.
    Where that of far coarser ones tells too little, another one between them and it tells more.
    """
    judge = Judge(problem, first.met, tol)
    trials, stuck = [first], 0
    factor, smallest = judge.first, math.inf
    while trials[-1].complete:
        found = next_trial(problem, trials, factor, tol)
        if not found.complete:
            return found.run()
        judge.see(found.met)
        if found.fineness in [r.fineness for r in trials]:  # what is between had to be finer
            factor = judge.first
            continue
        trials = sorted([*trials, found], key=lambda r: r.fineness)[-KEPT:]
        gaps = [(r.fineness / trials[-1].fineness, r.gap(trials[-1])) for r in trials[:-1]]
        estimate = judge.estimate(gaps) + judge.rounded(trials[-1], gaps[-1][1])
        if estimate <= judge.accept * tol or gaps[-1][1] < ROUND_OFF:
            return answer(problem, trials[-1], estimate + error)
        stuck = stuck + 1 if gaps[-1][1] > smallest / 2 else 0
        smallest = min(smallest, gaps[-1][1])
        if stuck == STUCK:
            raise TensegrityError(
                f"tol {tol:g} is below {max(smallest, tol):.1e}, the difference of two runs that "
                f"{trials[-1].steps} steps, and fewer, do not make smaller"
            )
        factor = judge.factor(gaps)
        factor = min(factor, 2.0) if stuck else factor
    return trials[-1].run()  # interrupted


def next_trial(problem, trials, factor, tol):
    """One that is finer than the finest by a factor."""
    finest = trials[-1].fineness
    fineness = max(math.ceil(finest * factor), int(finest) + 1 if factor > 1 else 1)
    likely = factor > 1 and (len(trials) > 1 or tol > SECOND)
    return Trial.of(trial_of(problem, likely), fineness, trials[0].instants)


def answer(problem, trial, estimate):
    """The run that meets a tolerance, with the rows that were asked for."""
    found = trial.march
    if not (problem.record.is_plain and found.has_rows and not problem.observe):
        found = march(problem, trial.steps)
    return changed(found.run(), error_estimate=estimate if found.complete else None)
