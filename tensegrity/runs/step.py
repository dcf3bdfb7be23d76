"""The step of a run: given, or expected from the stiffness in reach."""

from __future__ import annotations

import math

from tensegrity.errors import ContactError, LockingError, RangeError, StabilityError
from tensegrity.runs.judge import exponents_met
from tensegrity.runs.march import march
from tensegrity.runs.problem import count
from tensegrity.runs.run import changed
from tensegrity.scenes.forcing import functions_of_time
from tensegrity.scenes.signals import quickest

MARGIN = 2.0  # a default step may be this much larger, at the stiffness met, than meant
REFINEMENTS, MOST_REFINEMENTS = 8, 14  # how often a step chosen here is refined
DRIVEN, MOST_DRIVEN = 3, 6  # as often, of scenes whose energy is no bound on what springs reach
CHECKPOINTS = 17  # least number of steps that are chosen here


def fixed_step(problem, dt):
    """Run with a given step."""
    return march(problem, count(problem, dt)).run()


def default_step(problem):
    """Run with a step from the expected frequencies.

    What the state at the start cannot tell, the run does: whether contacts opened, and how far
    loads drove them.  Where that asks for a finer step, it is run again.
    """
    fraction = _fraction(problem, problem.dynamics.present_ranges(problem.state.u))
    alone = changed(problem, observe=(), rows=not problem.observe)
    found = settled(alone, refined(alone, expected_steps(problem, fraction), MARGIN * fraction))
    if problem.observe and found.complete:
        return march(problem, found.steps).run()
    return found.run()


def _fraction(problem, met):
    """What a default step is of the natural one where springs meet these elongations."""
    return problem.method.fraction(exponents_met(problem.dynamics, met))


def settled(problem, found):
    """A march with an expected step, or another where it met what asks for a finer one."""
    of = problem.dynamics
    if not (found.complete and found.steps):
        return found
    if not (of.is_loaded or exponents_met(of, found.met)):
        return found
    fraction = _fraction(problem, found.met)
    omega = found.fastest if of.follows else of.frequency(found.met)
    steps = count(problem, fraction * problem.natural_step(omega))
    return found if steps <= found.steps else refined(problem, steps, MARGIN * fraction)


def expected_steps(problem, fraction):
    """Steps that keep dt below a fraction of the stability limit, were all the energy of the scene
    to meet in one bond."""
    if not problem.t_end:
        return 0
    return steps_at(problem, fraction, problem.outlook.expected.frequency, CHECKPOINTS)


def steps_at(problem, fraction, omega, least):
    """Steps that are a fraction of the natural one at an angular frequency [rad/s], or at that of
    what drives the scene; at least so many."""
    if problem.dynamics.is_driven:
        omega = max(omega, quickest(functions_of_time(problem.scene), problem.t_end))
    return max(count(problem, fraction * problem.natural_step(omega)), least)


def resumed(problem, steps, allowed, start):
    """Go on with a run that was broken off, from a `book.Start`."""
    if problem.choice == "dt":
        return march(problem, steps, allowed, start=start).run()
    found = refined(problem, steps, allowed, start=start)
    return (settled(problem, found) if problem.choice == "default" else found).run()


def refined(problem, steps, allowed, instants=0, start=None):
    """March with a step chosen here: refine it where the run met a larger stiffness than expected.

    Returns what `march` returns; a spring that still reaches the end of its domain after
    `REFINEMENTS` refinements does so whatever the step; a step that is too coarse is refined on.
    """
    least, most = (REFINEMENTS, MOST_REFINEMENTS)
    if problem.dynamics.is_driven:
        least, most = DRIVEN, MOST_DRIVEN
    for number in range(most):
        try:
            return march(problem, steps, allowed, instants, start)
        except (ContactError, LockingError, StabilityError) as error:
            ranged = problem.surrogate is not None and isinstance(error, RangeError)
            if (
                ranged
                or isinstance(error, ContactError)
                or (number >= least and isinstance(error, LockingError))
            ):  # another range helps, or nothing: another step does not
                if ranged or problem.rows:
                    raise
                break
            known = getattr(error, "largest", math.inf)
            steps, start = max(2 * steps, count(problem, known)), None
    return march(changed(problem, rows=True), steps, 1.0, instants)
