"""The step of a run: given, expected from the stiffness in reach, or refined to a tolerance.

With a tolerance the force may be a polynomial too.  A first coarse run is exact and tells which
elongations are met; the same run with polynomials fitted to that range shows what their error
does to the motion.  They stay if that is a small part of the tolerance and they save time.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from tensegrity.engine.codegen import cost
from tensegrity.errors import LockingError, RangeError, StabilityError, TensegrityError
from tensegrity.runs import stepping
from tensegrity.runs.march import count, march
from tensegrity.runs.record import Record
from tensegrity.springs.polynomial import DEGREES, Polynomial, PolynomialLaw

MARGIN = 2.0  # a default step may be this much larger, at the stiffness met, than meant
TRIAL = 0.5  # first step over the stability limit where a tolerance decides
SHARE = 0.25  # of the energy, in one bond, for that first step
REFINEMENTS, MOST_REFINEMENTS = 8, 14  # how often a step chosen here is refined
CHECKPOINTS = 17  # instants at which two runs are compared to estimate an error
SAFETY = 0.5  # aim at this part of a tolerance
FASTEST = 16.0  # largest refinement at once
ROUND_OFF = 1e-14  # differences below this say nothing
FORCE_SHARE = 0.1  # of a tolerance that fitted forces may take up
FIRST_ERROR, LEAST_ERROR = 1e-3, 1e-13  # of a fit over the tolerance, and of any fit
FITS = 4  # attempts
MARGINS = (0.05, 0.5)  # over the range met, on either side, by which a fit is wider
WORTH = 0.3  # seconds that fitted forces must save
PER_FIT = 0.05  # seconds
STUCK = 3  # refinements in a row that bring nothing: round-off is reached


def fixed_step(problem, dt):
    """Run with a given step."""
    scene = problem.scene.listed(problem.state.u)
    limit = problem.largest_step(scene.frequency(scene.present_ranges(problem.state.u)))
    steps = count(problem, dt)
    used = problem.t_end / steps if steps else 0.0
    if used > limit:
        raise StabilityError(
            f"dt {used:.6g} s is beyond {limit:.6g} s, the stability limit of "
            f"{problem.method.name} in the initial state"
        )
    return march(problem, steps, allowed=1.0)[0]


def default_step(problem):
    """Run with a step from the expected frequencies.

    What the energy at the start cannot tell, the run does: whether contacts opened, and how far
    loads drove them.  Where that asks for a finer step, it is run again.
    """
    fraction = problem.fraction(problem.scene.step_share)
    return settled(
        problem, refined(problem, expected_steps(problem, fraction), MARGIN * fraction)[0]
    )


def settled(problem, run):
    """A run with an expected step, or another where it met what asks for a finer one."""
    scene = problem.scene
    share = scene.finer_share(run.met) if run.complete and run.steps else None
    if share is None:
        return run
    fraction = problem.fraction(share)
    omega = scene.frequency(run.met) if run.fastest is None else run.fastest
    steps = count(problem, fraction * problem.natural_step(omega))
    return run if steps <= run.steps else refined(problem, steps, MARGIN * fraction)[0]


def expected_steps(problem, fraction, share=1.0):
    """Steps that keep dt below a fraction of the stability limit, were `share` of the energy
    of the scene to meet in one bond."""
    if not problem.t_end:
        return 0
    scene = problem.scene.likely(problem.state.u)
    if scene is problem.scene and share == 1.0:
        omega = scene.fastest(problem.expected[1])
    else:
        omega = scene.frequency(stepping.expected_ranges(scene, problem.state, share))
    step = problem.natural_step(omega)
    return max(count(problem, fraction * step), CHECKPOINTS)


def resumed(problem, steps, allowed, start):
    """Go on with a run that was broken off, from a `march.Start`."""
    if problem.choice == "dt":
        return march(problem, steps, allowed, start=start)[0]
    run = refined(problem, steps, allowed, start=start)[0]
    return settled(problem, run) if problem.choice == "default" else run


def refined(problem, steps, allowed, checkpoints=0, start=None):
    """March with a step chosen here: refine it where the run met a larger stiffness than expected.

    Returns what `march` returns; a spring that still reaches the end of its domain after
    `REFINEMENTS` refinements does so whatever the step; a step that is too coarse is refined on.
    """
    for number in range(MOST_REFINEMENTS):
        try:
            return march(problem, steps, allowed, checkpoints, start)
        except (StabilityError, LockingError) as error:
            if problem.surrogate is not None and isinstance(error, RangeError):
                raise  # another range helps, another step does not
            if number >= REFINEMENTS and isinstance(error, LockingError):
                raise
            steps, start = 2 * steps, None
    return march(problem, steps, 1.0, checkpoints)


def to_tolerance(problem, tol):
    """Refine the step until a run and one with half its step agree well enough."""
    steps = CHECKPOINTS * math.ceil(expected_steps(problem, TRIAL, SHARE) / CHECKPOINTS)
    if steps == 0:
        return march(problem, 0, 1.0)[0]
    exact = refined(_trial(problem), steps, 1.0, CHECKPOINTS)
    if exact[0].complete:
        for margin in MARGINS:
            try:
                fitted = with_polynomials(problem, *exact, tol, margin)
                if fitted is None:
                    break
                return converged(*fitted, tol)
            except RangeError:  # finer runs reach farther than the coarse one
                continue
    return converged(problem, *exact, 0.0, tol)


def _trial(problem):
    return replace(problem, record=Record(sites=problem.record.sites))


def converged(problem, coarse_run, coarse, error, tol):
    """Refine from a first run on.

    The largest difference of two runs at common instants, over 2^order - 1, estimates the error
    of the finer one, once it was seen to shrink about as fast as the order promises.  Before
    that, and where it does not (contacts that open), less is trusted: see `gain`.  `error` is what
    the fitted forces add.
    """
    order, trial = problem.method.order, _trial(problem)
    steps, last, stuck = coarse_run.steps, None, 0
    run = coarse_run
    while run.complete and coarse_run.complete:
        run, fine = refined(problem, 2 * steps, 1.0, CHECKPOINTS)
        if not run.complete:
            break
        difference = largest_gap(coarse, fine, run)
        estimate = difference / gain(order, last, 2 * steps, difference)
        if estimate <= SAFETY * tol or difference < ROUND_OFF:
            return replace(run, error_estimate=estimate + error)
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


def with_polynomials(problem, run, checks, tol, margin):
    """The problem with fitted forces, where they are good enough and save time.

    Parameters
    ----------
    problem : Problem
    run, checks
        A coarse run with the exact forces.
    tol, margin : float

    Returns
    -------
    None, or problem, the same coarse run and its checks with fitted forces, and the largest
    difference that they make there

    Raises
    ------
    RangeError
        If that run leaves the range.
    """
    scene = problem.scene
    if problem.record.checkpoint is not None:
        return None  # a state that is kept has to say what the forces are
    if scene.follows or saved(problem, run, tol) < WORTH:
        return None
    springs = scene.spring_table.different
    ranges = [_widened(spring, *met, margin) for spring, met in zip(springs, run.met, strict=True)]
    error, least = max(FIRST_ERROR * tol, LEAST_ERROR), 0.0
    for _ in range(FITS):
        try:
            fits = [Polynomial(s, *r, error) for s, r in zip(springs, ranges, strict=True)]
            fitted = replace(problem, surrogate=scene.with_springs(fits))
            there, found = march(_trial(fitted), run.steps, 1.0, CHECKPOINTS)
        except RangeError:
            raise
        except (LockingError, StabilityError):
            return None
        except TensegrityError:  # not that good: see whether a worse one is good enough
            least = error
            error *= 10
            continue
        if not there.complete:
            return fitted, there, found, 0.0
        gap = largest_gap(checks, found, run)
        if gap <= FORCE_SHARE * tol:
            return fitted, there, found, gap
        error *= FORCE_SHARE * tol / gap / 3
        if error <= least:
            return None
    return None


def saved(problem, run, tol):
    """Seconds that fitted forces save, roughly, in all runs that a tolerance takes."""
    scene, order = problem.scene, problem.method.order
    springs, count = scene.spring_table.different, np.bincount(scene.spring_table.group.ravel())
    fitted = cost(PolynomialLaw(DEGREES[len(DEGREES) // 2]))
    gains = [max(cost(spring.law) - fitted, 0.0) for spring in springs]
    steps = run.steps * max(tol ** (-1 / order), 1.0)
    calls = steps * problem.method.stages * count
    return float(np.dot(gains, calls)) - PER_FIT * len(springs)


def _widened(spring, low, high, margin):
    """A range somewhat wider than the one met, inside the spring's reach."""
    room = margin * (high - low)
    low, high = low - room, high + room
    return max(low, spring.reach[0]), min(high, spring.reach[1])


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
