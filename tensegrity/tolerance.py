"""The step of a run: given, expected from the stiffness in reach, or refined to a tolerance."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from tensegrity import stepping
from tensegrity.errors import LockingError, StabilityError, TensegrityError
from tensegrity.march import count, march
from tensegrity.record import Record

MARGIN = 2.0  # a default step may be this much larger, at the stiffness met, than meant
TRIAL = 0.5  # first step over the stability limit where a tolerance decides
SHARE = 0.25  # of the energy, in one bond, for that first step
REFINEMENTS = 8  # how often a step chosen here is refined
CHECKPOINTS = 17  # instants at which two runs are compared to estimate an error
SAFETY = 0.5  # aim at this part of a tolerance
FASTEST = 16.0  # largest refinement at once
ROUND_OFF = 1e-14  # differences below this say nothing
STUCK = 3  # refinements in a row that bring nothing: round-off is reached


def fixed_step(problem, dt):
    """Run with a given step."""
    limit = problem.largest_step(stepping.present_ranges(problem.scene, problem.state))
    if dt > limit:
        raise StabilityError(
            f"dt {dt:.6g} s is beyond {limit:.6g} s, the stability limit of "
            f"{problem.method.name} in the initial state"
        )
    return march(problem, count(problem, dt), allowed=1.0)[0]


def default_step(problem):
    """Run with a step from the expected frequencies."""
    fraction = problem.method.step
    return refined(problem, expected_steps(problem, fraction), MARGIN * fraction)[0]


def expected_steps(problem, fraction, share=1.0):
    """Steps that keep dt below a fraction of the stability limit, were `share` of the energy
    of the scene to meet in one bond."""
    if not problem.t_end:
        return 0
    step = problem.natural_step(stepping.expected_ranges(problem.scene, problem.state, share))
    return max(count(problem, fraction * step), CHECKPOINTS)


def refined(problem, steps, allowed, checkpoints=0):
    """March with a step chosen here: refine it where the run met a larger stiffness than expected.

    Returns what `march` returns; a spring that still reaches the end of its domain after
    `REFINEMENTS` refinements does so whatever the step.
    """
    for _ in range(REFINEMENTS):
        try:
            return march(problem, steps, allowed, checkpoints)
        except (StabilityError, LockingError):
            steps *= 2
    return march(problem, steps, 1.0, checkpoints)


def to_tolerance(problem, tol):
    """Refine the step until a run and one with half its step agree well enough.

    Their largest difference at common instants, over 2^order - 1, estimates the error of the
    finer one, once it was seen to shrink about as fast as the order promises.  Before that, and
    where it does not (contacts that open), less is trusted: see `gain`.
    """
    order = problem.method.order
    steps = CHECKPOINTS * math.ceil(expected_steps(problem, TRIAL, SHARE) / CHECKPOINTS)
    if steps == 0:
        return march(problem, 0, 1.0)[0]
    trial = replace(problem, record=Record(sites=problem.record.sites))
    coarse_run, coarse = refined(trial, steps, 1.0, CHECKPOINTS)
    steps, last, stuck = coarse_run.steps, None, 0
    run = coarse_run
    while run.complete and coarse_run.complete:
        run, fine = refined(problem, 2 * steps, 1.0, CHECKPOINTS)
        if not run.complete:
            break
        difference = largest_gap(coarse, fine, run)
        estimate = difference / gain(order, last, 2 * steps, difference)
        if estimate <= SAFETY * tol or difference < ROUND_OFF:
            return replace(run, error_estimate=estimate)
        stuck = stuck + 1 if last and difference > last[1] / 2 else 0
        if stuck == STUCK:
            raise TensegrityError(
                f"tol {tol:g} is below {difference:.1e}, the difference of two runs that "
                f"{run.steps} steps, and fewer, do not make smaller"
            )
        factor = min((estimate / (SAFETY * tol)) ** (1 / order), 2.0 if stuck else FASTEST)
        last = 2 * steps, difference
        if factor <= 2:  # the run just made serves as the coarse one
            steps, coarse = run.steps, fine
        else:
            steps = CHECKPOINTS * math.ceil(run.steps * factor / 2 / CHECKPOINTS)
            coarse_run, coarse = refined(trial, steps, 1.0, CHECKPOINTS)
    return run if coarse_run.complete else coarse_run


def gain(order, last, steps, difference):
    """By how much the finer run may be taken to be better than its difference from the coarser.

    `last` holds steps and difference of the refinement before, or None.
    """
    if last is None:
        return 2 ** (order / 2)
    expected = last[1] * (last[0] / steps) ** order
    return 2**order - 1 if difference <= 2 * expected else 1


def largest_gap(coarse, fine, run):
    """Largest difference of two runs in u and in v, each over its own largest value in the run."""
    parts = []
    for name in ("u", "v"):
        largest = max(np.max(np.abs(fine[name])), np.max(np.abs(getattr(run, name))))
        gap = np.max(np.abs(coarse[name] - fine[name]))
        parts.append(gap / largest if largest else gap)
    return float(max(parts))
