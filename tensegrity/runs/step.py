"""The step of a run, given or chosen from a bound of the stiffness; and the error estimator, which
compares runs with different steps."""

from __future__ import annotations

import math
import sys
import warnings
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
from tensegrity.runs.problem import step_count
from tensegrity.runs.run import unchecked_replace
from tensegrity.scenes.forcing import frequency_of_drives, time_signals

EPSILON = sys.float_info.epsilon
COARSE = 1e-4  # usual error of the first run
SLOWER = 0.5  # by how much less than the order of a method is trusted
LEAST_ORDER = 0.5  # least order that is assumed
FIRST_ORDER = 4.0  # least order assumed between the two coarsest runs
TIGHT = 1e-10  # tolerances this far below the error of the first run take a finer second one
LEAST_FACTOR, LARGEST_FACTOR = 1.25, 8.0  # of the number of steps from one run to the next
# Where contacts are lost, the order predicts the error of a run less well that is more than
# WIDE_FACTOR times finer than the one before it: its estimate is multiplied by SAFETY_FACTOR, and
# always where forces of velocity have kinks.
WIDE_FACTOR, SAFETY_FACTOR = 2.0, 3.0
# Growth of round-off observed in rows of 20 to 40 equal masses, and the power of the mass ratio by
# which it is larger for unequal ones.
GROWN, UNEQUAL = 250.0, 1 / 3
# Where losses of contact are corrected, the error of the second run was at most 0.6 times its
# difference from the first one in 2,900 random scenes: the difference counts by this factor, of
# which a fraction of less than a half of the tolerance is accepted.
CORRECTED = 0.3
# Safety factor where motion is damped or driven, whose transients may be faster than the bonds: the
# error was at most 1.8 times the estimate with 3 in 3,000 random scenes.
FORCED = 5.0
# Differences of runs with forces of velocity or of time above which the steps of the coarser one
# do not resolve a transient: half of the order is trusted.
UNRESOLVED = 1e-2
# A run with fewer than the first fraction of the finest run's steps gives an uncertain estimate:
# another run follows, with at least the second fraction; where contacts are lost, only if the
# tolerance is met but for the safety factor.
COARSE_FRACTION, CLOSER_FRACTION = 0.4, 0.45
# Order up to which kinks limit a method, and number of steps above which a warning is given then.
KINKED, MANY = 2.0, 500_000


class ErrorEstimator:
    """Richardson extrapolation of the error from runs with different steps.

    On smooth scenes the observed order is trusted up to 1/2 below that of the method.  Where
    contacts are lost, the error of an event varies with its place within a step and may be small
    by chance in one run: the larger of two estimates counts, with no more than the order that is
    attainable at kinks.

    Parameters
    ----------
    problem : Problem
    elongation_range : ndarray, (springs, 2)
        Smallest and largest elongations in a run [m].
    tol : float
    """

    def __init__(self, problem, elongation_range, tol):
        self._problem, self._tol, self._most = problem, tol, MANY
        forces = problem.dynamics.further_forces
        rough = any(one.law.continuity < math.inf for one in forces)
        self._forced, self._unresolved = problem.dynamics.is_driven, 0
        self._safety = SAFETY_FACTOR if rough else FORCED if self._forced else 1.0
        self._set_order(elongation_range)

    def update(self, elongation_range):
        """Take account of contacts that were lost in this run and not in the coarser ones."""
        if self._problem.dynamics.kinked.has_kinks:
            self._set_order(elongation_range)

    def _set_order(self, elongation_range):
        refuse_jumps(self._problem, elongation_range, self._tol)
        left, order = attainable_order(self._problem, elongation_range), self._problem.method.order
        self.opens, self.order = left < math.inf, min(left, order - SLOWER)
        self.accept, self._aim = (0.45, 0.2) if self.opens else (0.8, 0.25)
        self.first = first_factor(self._tol, self.opens)

    def estimate(self, gaps):
        """Estimated error of the finest run.

        Parameters
        ----------
        gaps : list of (fraction of its number of steps, difference from it), the coarsest first
        """
        if len(gaps) == 1:
            fraction, gap = gaps[0]
            if self.opens or self._forced:
                corrected = self.opens and self.order > TREATED
                return gap * self._safety * (CORRECTED if corrected else 1.0)
            return gap / max(fraction ** (-self.order / 2) - 1, 1.0)
        order = self._estimated(gaps)
        left = [(self._left(fraction, order), gap) for fraction, gap in gaps[-2:]]
        errors = [gap / (1 - part) * part for part, gap in left]
        if self.opens or self._forced:
            return max(errors) * max(_safety_factor(1 / gaps[-1][0]), self._safety)
        return errors[-1]

    def _left(self, fraction, order):
        """Error of a run over that of one with a fraction of its steps."""
        if self._unresolved > 1 and fraction < 1 / 2:  # half the order beyond a factor of 2
            return (fraction / 2) ** (order / 2)
        return fraction**order

    def announce(self, steps):
        """Warn, once, before a run of so many steps that is long because of kinks."""
        if self.order <= KINKED and steps > self._most:
            self._most = math.inf
            words = f"forces that are not smooth limit {self._problem.method.name} to order"
            words = f"a trial run of {steps:.0f} steps follows: {words} {self.order:g}"
            warnings.warn(f"{words}, and tol is {self._tol:g}", RuntimeWarning, stacklevel=2)

    def admit(self, estimate, steps):
        """Warn where the runs agree to round-off, and the estimate of it is above the tolerance."""
        if estimate > self._tol:
            words = f"error estimate {estimate:.2g} is above tol {self._tol:g}"
            words = f"{words}: round-off of {steps} steps, as the trial runs agree"
            warnings.warn(words, RuntimeWarning, stacklevel=2)

    def round_off(self, run, gap):
        """Contribution of round-off: a random walk of the last digit over all stages of the run.

        Where contacts are lost it grows as neighbouring motions diverge, more so for light masses.
        If it may then exceed the tolerance, the difference from the run before counts instead.
        """
        walk = EPSILON * math.sqrt(run.steps * self._problem.method.stages)
        return gap / 2 if self.opens and self._grown * walk > self._tol else walk

    @cached_property
    def _grown(self):
        """Factor by which round-off grows where contacts are lost."""
        mobility = np.asarray(self._problem.dynamics.inverse_mass)
        mobility = mobility[mobility > 0]  # held sites have none
        unequal = float(mobility.max() / mobility.min()) if mobility.size else 1.0
        return GROWN * unequal**UNEQUAL

    def _estimated(self, gaps):
        """Observed order of convergence, limited to what is trusted."""
        (wide, above), (narrow, below) = gaps[-2:]
        if not below:
            return self.order
        fell = math.log(max(above, below) / below) / math.log(narrow / wide)
        least = self.order - SLOWER if self.opens else LEAST_ORDER
        order = min(max(fell - SLOWER, least), self.order)
        return order / 2 if self._forced and above > UNRESOLVED else order

    def factor(self, gaps):
        """Number of steps of the next run over that of the finest; below 1 for a coarser run."""
        order = max(self.order if self.opens else self._problem.method.order, FIRST_ORDER)
        fraction, gap = gaps[-1]
        self._unresolved += self._forced and gap > UNRESOLVED
        estimate = gap / (fraction**-order - 1)
        if len(gaps) > 1:
            order, estimate = self._estimated(gaps), self.estimate(gaps)
        needed = (estimate / (self._aim * self._tol)) ** (1 / order)
        near = not self.opens or estimate <= SAFETY_FACTOR * self.accept * self._tol
        if len(gaps) > 1 and fraction < COARSE_FRACTION and near:
            return max(math.sqrt(fraction), CLOSER_FRACTION)  # errors may have fallen faster
        if self.opens:
            return min(
                max(needed * _safety_factor(needed) ** (1 / order), LEAST_FACTOR), LARGEST_FACTOR
            )
        return min(max(needed, LEAST_FACTOR), LARGEST_FACTOR)


def _safety_factor(factor):
    """Safety factor of an estimate where contacts are lost, for a run `factor` times finer than the
    one before it."""
    return SAFETY_FACTOR if factor > WIDE_FACTOR else 1.0


def first_factor(tol, opens):
    """Number of steps of the second run over that of the first."""
    if opens and tol < COARSE:
        return 2.0
    return 2.5 if tol < TIGHT else 1.5


def attainable_order(problem, elongation_range):
    """Order that a method attains in spite of kinks of the forces, within a range of elongations,
    and of the drives.

    A force that grows like overlap^n from a kink limits the order to n + 1, or to n + 3 where the
    method corrects it; one of velocity that changes like the power n of something, to n + 1, but
    for the onset of contacts, which is corrected.
    """
    dyn = problem.dynamics
    driven = time_signals(problem.scene) if dyn.is_driven else ()
    limits = [signal.order_limit for signal in driven]
    limits += [1 + one.law.continuity for one in dyn.further_forces]
    order = min(limits, default=math.inf)
    corrects = isinstance(problem.method, Corrected)
    for exponent in dyn.kinked.exponents_within(elongation_range):
        treated = corrects and is_treated(exponent)
        order = min(order, exponent + (TREATED if treated else 1))
    return order


def refuse_jumps(problem, elongation_range, tol):
    """Refuse a tolerance where a force or an energy jumps within a range of elongations.

    Parameters
    ----------
    problem : Problem
    elongation_range : ndarray, (springs, 2)
        [m]
    tol : float

    Raises
    ------
    TensegrityError
    """
    kinked = problem.dynamics.kinked
    kinks = kinked.kinks_within(elongation_range) if kinked.jumps else ()
    for spring, (place, jump, exponent, _) in kinks:
        if exponent > 0:
            continue
        strain = f" (strain {place / spring.length:g})" if spring.length else ""
        what = f"tension of {check.shown(spring)} jumps by {jump:g} N"
        why = "the error of fixed steps is of first order there: give dt=, or spread the jump"
        if exponent < 0:
            what = f"energy of {check.shown(spring)} jumps by {jump:g} J"
            why = "steps cannot resolve an unbounded force: spread the jump"
        raise TensegrityError(
            f"tol {tol:g}: the {what} at the elongation {place:g} m{strain}; {why} over a range"
        )


MARGIN = 2.0  # a default step may exceed the intended fraction, at the stiffness reached, by this
REFINEMENTS, MOST_REFINEMENTS = 8, 14  # how often a step chosen here is refined
DRIVEN, MOST_DRIVEN = 3, 6  # the same for scenes whose energy does not bound the elongations
CHECKPOINTS = 17  # least number of steps that are chosen here


def fixed_step(problem, dt):
    """Run with a given step."""
    return march(problem, step_count(problem, dt)).run()


def default_step(problem):
    """Run with a step chosen from the expected frequencies.

    Only the run itself shows whether contacts were lost and how far loads drove the springs.  Where
    this requires a finer step, the run is repeated.
    """
    dyn = problem.dynamics
    fraction = _fraction(problem, dyn.ranges_at(problem.state.u) if dyn.kinked.has_kinks else None)
    alone = unchecked_replace(problem, observe=(), rows=not problem.observe)
    result = with_adequate_step(
        alone, refined(alone, expected_steps(problem, fraction), MARGIN * fraction)
    )
    if problem.observe and result.complete:
        return march(problem, result.steps).run()
    return result.run()


def _fraction(problem, elongation_range):
    """The default step as a fraction of the natural one, for springs within these elongations."""
    return problem.method.fraction(problem.dynamics.kinked.exponents_within(elongation_range))


def with_adequate_step(problem, result):
    """Result of a march with the expected step, or of a finer one if it turned out too large."""
    dyn = problem.dynamics
    if not (result.complete and result.steps):
        return result
    if not (dyn.is_loaded or dyn.kinked.exponents_within(result.elongation_range)):
        return result
    fraction = _fraction(problem, result.elongation_range)
    omega = result.fastest if dyn.follows else dyn.frequency(result.elongation_range)
    steps = step_count(problem, fraction * problem.natural_step(omega))
    return result if steps <= result.steps else refined(problem, steps, MARGIN * fraction)


def expected_steps(problem, fraction):
    """Number of steps that keeps dt below a fraction of the stability limit even if all the energy
    of the scene were stored in one bond."""
    if not problem.t_end:
        return 0
    return steps_at(problem, fraction, problem.a_priori.expected.frequency, CHECKPOINTS)


def steps_at(problem, fraction, omega, least):
    """Number of steps for a given fraction of the natural step.

    Parameters
    ----------
    problem : Problem
    fraction : float
    omega : float
        Angular frequency [rad/s]; that of drives and forces counts where it is larger.
    least : int
        Least number of steps.

    Returns
    -------
    int
    """
    if problem.dynamics.is_driven:
        of_drives = frequency_of_drives(problem.scene, problem.state, problem.t_end)
        omega = max(omega, of_drives)
    return max(step_count(problem, fraction * problem.natural_step(omega)), least)


def resumed(problem, steps, allowed, start):
    """Continue an interrupted run.

    Parameters
    ----------
    problem : Problem
    steps : int
        Number of steps of the whole run.
    allowed : float
        Fraction of the stability limit.
    start : march.Start

    Returns
    -------
    Run
    """
    if problem.choice == "dt":
        return march(problem, steps, allowed, start=start).run()
    result = refined(problem, steps, allowed, start=start)
    return (with_adequate_step(problem, result) if problem.choice == "default" else result).run()


def refined(problem, steps, allowed, instants=0, start=None):
    """March, and refine the step where the stiffness turns out larger than expected.

    A spring that still reaches the end of its domain after `REFINEMENTS` refinements does so with
    any step; a step that is too large is refined further.

    Parameters
    ----------
    problem : Problem
    steps : int
    allowed : float
        Fraction of the stability limit.
    instants : int, optional
        Evenly spaced instants at which u and v are stored for comparison.
    start : march.Start, optional
        State from which an interrupted run continues.

    Returns
    -------
    MarchResult

    Raises
    ------
    LockingError, StabilityError, ContactError
        No refinement helps.
    """
    least, most = (REFINEMENTS, MOST_REFINEMENTS)
    if problem.dynamics.is_driven:
        least, most = DRIVEN, MOST_DRIVEN
    for number in range(most):
        try:
            return march(problem, steps, allowed, instants, start)
        except (ContactError, LockingError, StabilityError) as error:
            ranged = isinstance(error, RangeError) and problem.loop_dynamics is not problem.dynamics
            if (
                ranged
                or isinstance(error, ContactError)
                or (number >= least and isinstance(error, LockingError))
            ):  # another step does not help
                if ranged or problem.rows:
                    raise
                break
            known = getattr(error, "largest", math.inf)
            finer = max(2 * steps, step_count(problem, known))
            steps, start = -(-finer // steps) * steps if instants else finer, None
    return march(unchecked_replace(problem, rows=True), steps, 1.0, instants)


def run_at_rest(problem, length, tol):
    """The run of a scene at rest, whose motion is round-off and gives no error estimate.

    Parameters
    ----------
    problem : Problem
    length : float
        From `problem.length_at_rest` [m].
    tol : float

    Returns
    -------
    Run

    Raises
    ------
    TensegrityError
        Round-off moves the scene farther than the tolerance.
    """
    run = default_step(problem)
    moved = float(np.max(np.abs(run.u - run.u[0]))) / length
    if moved > tol:
        raise TensegrityError(
            f"tol {tol:g}: the scene is at rest and moves by round-off alone, by {moved:.1e} of "
            "its shortest bond"
        )
    return unchecked_replace(run, error_estimate=moved if run.complete else None)
