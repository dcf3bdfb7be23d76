"""The step of a run: given, or expected from the stiffness in reach; what differences of runs with
different steps say of their errors; and scenes at rest, whose motion is round-off."""

from __future__ import annotations

import math
import sys
from functools import cached_property

import numpy as np

from tensegrity import check
from tensegrity.engine.methods import Corrected
from tensegrity.engine.openings import TREATED, is_treated
from tensegrity.errors import (
    ContactError,
    LockingError,
    RangeError,
    StabilityError,
    TensegrityError,
)
from tensegrity.runs.march import march
from tensegrity.runs.problem import count
from tensegrity.runs.run import unchecked_replace
from tensegrity.scenes.forcing import time_signals
from tensegrity.scenes.signals import largest_frequency
from tensegrity.springs.kinks import TAUT
from tensegrity.springs.potential import Potential, PowerLaw

EPSILON = sys.float_info.epsilon
COARSE = 1e-4  # usual error of the first run
SLOWER = 0.5  # order that is trusted less than a method has
LEAST_ORDER = 0.5  # that is reckoned with
FIRST_ORDER = 4.0  # least by which errors of the two coarsest runs are taken to fall from there
TIGHT = 1e-10  # tolerances so far below the errors of first runs that these have to be told apart
LEAST_FACTOR, FASTEST = 1.25, 8.0  # of the steps from one run to the next
SURE, DOUBT = 2.0, 3.0  # a run so many times finer than the one before it has an error that the
# order foretells less well where contacts open: estimates are so many times larger
GROWN, UNEQUAL = 250.0, 1 / 3  # times which round-off was seen to grow in rows of 20 to 40 like
# masses, and by which power of their ratio more
FAR, NEARER = 0.4, 0.45  # share of the steps below which a run tells of an error so uncertainly
# that another is done, with at least so much


class ErrorEstimator:
    """How far the order of a method is trusted.

    On smooth scenes to half less than it has, once it was seen.  Where contacts open, the errors
    of an event vary with its place within a step, and may by luck be small in one run: the worst
    of two runs counts, and no more than the order that openings leave.

    Parameters
    ----------
    problem : Problem
    met : ndarray, (springs, 2)
        Elongations that a run met [m].
    tol : float
    """

    def __init__(self, problem, elongation_range, tol):
        self._problem, self._tol = problem, tol
        self._look(elongation_range)

    def see(self, elongation_range):
        """Contacts may open in this run that did not in the coarser ones."""
        if may_open(self._problem.dynamics):
            self._look(elongation_range)

    def _look(self, elongation_range):
        refuse_jumps(self._problem, elongation_range, self._tol)
        left, order = order_left(self._problem, elongation_range), self._problem.method.order
        self.opens, self.order = left < math.inf, min(left, order - SLOWER)
        self.accept, self._aim = (0.45, 0.2) if self.opens else (0.8, 0.25)
        self.first = first_factor(self._tol, self.opens)

    def estimate(self, gaps):
        """Estimated error of the finest run.

        Parameters
        ----------
        gaps : list of (share of its steps, difference from it), the coarsest first
        """
        if len(gaps) == 1:
            share, gap = gaps[0]
            return gap / max(share ** (-self.order / 2) - 1, 1.0) if not self.opens else gap
        order = self._estimated(gaps)
        errors = [gap / (1 - share**order) * share**order for share, gap in gaps[-2:]]
        return max(errors) * _doubt(1 / gaps[-1][0]) if self.opens else errors[-1]

    def rounded(self, run, gap):
        """What round-off adds: a walk at random of the last digits in all stages of the finest run.

        Where contacts open it grows as neighbouring motions part, more so beside light masses: a
        run of so many steps that it may pass the tolerance then has to agree with the one before.
        """
        walk = EPSILON * math.sqrt(run.steps * self._problem.method.stages)
        return gap / 2 if self.opens and self._grown * walk > self._tol else walk

    @cached_property
    def _grown(self):
        """Times which round-off grows where contacts open."""
        mobility = np.asarray(self._problem.dynamics.inverse_mass)
        mobility = mobility[mobility > 0]  # held sites have none
        unequal = float(mobility.max() / mobility.min()) if mobility.size else 1.0
        return GROWN * unequal**UNEQUAL

    def _estimated(self, gaps):
        """Order by which errors fell, not more than what is trusted."""
        (wide, above), (narrow, below) = gaps[-2:]
        if not below:
            return self.order
        fell = math.log(max(above, below) / below) / math.log(narrow / wide)
        least = self.order - SLOWER if self.opens else LEAST_ORDER
        return min(max(fell - SLOWER, least), self.order)

    def factor(self, gaps):
        """By how much finer the next run should be, or, where that is below 1, how much coarser
        than the finest."""
        order = max(self.order if self.opens else self._problem.method.order, FIRST_ORDER)
        share, gap = gaps[-1]
        estimate = gap / (share**-order - 1)
        if len(gaps) > 1:
            order, estimate = self._estimated(gaps), self.estimate(gaps)
        needed = (estimate / (self._aim * self._tol)) ** (1 / order)
        if self.opens:
            return min(max(needed * _doubt(needed) ** (1 / order), LEAST_FACTOR), FASTEST)
        if len(gaps) > 1 and share < FAR:  # errors may have fallen faster
            return max(math.sqrt(share), NEARER)
        return min(max(needed, LEAST_FACTOR), FASTEST)


def _doubt(factor):
    """By what to multiply the estimate of a run where contacts open, so many times finer than the
    one before it."""
    return DOUBT if factor > SURE else 1.0


def first_factor(tol, opens):
    """By how much finer the second run is than the first."""
    if opens and tol < COARSE:
        return 2.0
    return 2.5 if tol < TIGHT else 1.5


def order_left(problem, elongation_range):
    """Order that contacts which opened leave to a method, by the springs that it met them with,
    and corners of drives.

    A force that grows like overlap^n leaves n + 1, or n + 3 where that is corrected.
    """
    of = problem.dynamics
    driven = time_signals(problem.scene) if of.is_driven else ()
    order = min((signal.order_limit for signal in driven), default=math.inf)
    corrects = isinstance(problem.method, Corrected)
    for exponent in exponents_within(of, elongation_range):
        treated = corrects and is_treated(exponent)
        order = min(order, exponent + (TREATED if treated else 1))
    return order


def exponents_within(of, elongation_range):
    """Exponents of the corners of forces between elongations met, or as near as round-off is."""
    if of.follows:
        return {corner[2] for _, corner in kinks_met(of, elongation_range)}
    near = [TAUT * (spring.length or 0.0) for spring in of.springs.different]
    return of.springs.exponents_within(elongation_range + np.multiply.outer(near, (-1.0, 1.0)))


def may_open(of):
    """Whether the force of any contact has a corner."""
    return of.follows or of.springs.has_kinks


def may_jump(of):
    """Whether the force, or the energy, of any contact jumps."""
    return of.follows or of.springs.jumps


def kinks_met(of, elongation_range):
    """Springs, and corners of their forces between elongations met."""
    if not of.follows:
        return of.springs.kinks_within(elongation_range)
    given = of.law.given
    spring = given if isinstance(given, Potential) else PowerLaw(1.0, 1.0)
    return [(spring, corner) for corner in spring.openings]


def refuse_jumps(problem, elongation_range, tol):
    """Refuse a tolerance where a force, or an energy, jumps between elongations met."""
    corners = kinks_met(problem.dynamics, elongation_range) if may_jump(problem.dynamics) else ()
    for spring, (place, jump, exponent, _) in corners:
        if exponent > 0:
            continue
        strain = f" (strain {place / spring.length:g})" if spring.length else ""
        what = f"tension of {check.shown(spring)} jumps by {jump:g} N"
        why = "the error of fixed steps falls like the step there: give dt=, or a law that rises"
        if exponent < 0:
            what = f"energy of {check.shown(spring)} jumps by {jump:g} J"
            why = "no step meets a force without a bound: give a law that rises"
        raise TensegrityError(
            f"tol {tol:g}: the {what} at the elongation {place:g} m{strain}; {why} over a range"
        )


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
    fraction = _fraction(problem, problem.dynamics.ranges_at(problem.state.u))
    alone = unchecked_replace(problem, observe=(), rows=not problem.observe)
    found = settled(alone, refined(alone, expected_steps(problem, fraction), MARGIN * fraction))
    if problem.observe and found.complete:
        return march(problem, found.steps).run()
    return found.run()


def _fraction(problem, elongation_range):
    """What a default step is of the natural one where springs meet these elongations."""
    return problem.method.fraction(exponents_within(problem.dynamics, elongation_range))


def settled(problem, found):
    """A march with an expected step, or another where it met what asks for a finer one."""
    of = problem.dynamics
    if not (found.complete and found.steps):
        return found
    if not (of.is_loaded or exponents_within(of, found.elongation_range)):
        return found
    fraction = _fraction(problem, found.elongation_range)
    omega = found.fastest if of.follows else of.frequency(found.elongation_range)
    steps = count(problem, fraction * problem.natural_step(omega))
    return found if steps <= found.steps else refined(problem, steps, MARGIN * fraction)


def expected_steps(problem, fraction):
    """Steps that keep dt below a fraction of the stability limit, were all the energy of the scene
    to meet in one bond."""
    if not problem.t_end:
        return 0
    return steps_at(problem, fraction, problem.a_priori.expected.frequency, CHECKPOINTS)


def steps_at(problem, fraction, omega, least):
    """Steps that are a fraction of the natural one at an angular frequency [rad/s], or at that of
    what drives the scene; at least so many."""
    if problem.dynamics.is_driven:
        omega = max(omega, largest_frequency(time_signals(problem.scene), problem.t_end))
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
    return march(unchecked_replace(problem, rows=True), steps, 1.0, instants)


FAINT = 1e-6  # of a length: motion in the first steps of what may be at rest
REST = 64 * EPSILON  # of a length, by which a place may be off its equilibrium


def rests(problem, seen):
    """The length [m] beside which a scene is in equilibrium to round-off: the shortest bond; None
    where forces, or time, will move it.

    Parameters
    ----------
    problem : Problem
    seen : ndarray, (instants + 1, *shape)
        Displacements of a run [m], of which the first ones tell whether it is worth a look.
    """
    of, u = problem.dynamics.listed(problem.state.u), problem.state.u
    if of.is_driven or np.count_nonzero(problem.state.v):
        return None
    given = of.spring_lengths
    lengths = [s.length for s in of.springs.different] if given is None else np.ravel(given)
    length = min((x for x in lengths if x), default=0.0)
    if np.max(np.abs(seen[1] - u)) > FAINT * length:
        return None
    stiffness = of.stiffness_bounds(of.ranges_at(u))
    pull = np.max(np.abs(of.forces(u)), initial=0.0)
    return length if pull <= REST * np.max(stiffness, initial=0.0) * length else None


def resting(problem, length, tol):
    """The run of a scene at rest, whose motion is round-off, and tells nothing of an error."""
    run = default_step(problem)
    moved = float(np.max(np.abs(run.u - run.u[0]))) / length
    if moved > tol:
        raise TensegrityError(
            f"tol {tol:g}: the scene is at rest, and leaves it by round-off alone, as far as "
            f"{moved:.1e} of its shortest bond"
        )
    return unchecked_replace(run, error_estimate=moved if run.complete else None)
