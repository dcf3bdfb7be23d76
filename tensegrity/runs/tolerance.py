"""The step of a run: given, expected from the stiffness in reach, or refined to a tolerance.

With a tolerance the force may be a polynomial too.  A first coarse run is exact and tells which
elongations are met; the same run with polynomials fitted to that range shows what their error
does to the motion.  They stay if that is a small part of the tolerance and they save time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tensegrity import check
from tensegrity.engine import walk
from tensegrity.engine.codegen import cost
from tensegrity.engine.methods import Corrected
from tensegrity.engine.openings import is_treated
from tensegrity.errors import LockingError, RangeError, StabilityError, TensegrityError
from tensegrity.runs.driven import march
from tensegrity.runs.march import count
from tensegrity.runs.record import Record
from tensegrity.runs.run import Run, changed
from tensegrity.runs.whole import Whole
from tensegrity.scenes.forcing import functions_of_time
from tensegrity.scenes.signals import quickest
from tensegrity.springs.polynomial import DEGREES, Polynomial, PolynomialLaw
from tensegrity.springs.potential import Potential
from tensegrity.springs.power_law import PowerLaw

MARGIN = 2.0  # a default step may be this much larger, at the stiffness met, than meant
TRIAL = 0.85  # first step over the stability limit where a tolerance decides
REFINEMENTS, MOST_REFINEMENTS = 8, 14  # how often a step chosen here is refined
DRIVEN, MOST_DRIVEN = 3, 6  # as often, of scenes whose energy is no bound on what springs reach
CHECKPOINTS = 17  # least number of steps that are chosen here
AT_FIRST = 13  # of a smooth run that is compared with others, at 7 instants then
DENSE = 2  # first steps between two instants at which runs are compared, where nothing opens
FEWEST, MOST_KEPT = 16, 2_000_000  # instants; numbers in each of u and v of a run at them
KEPT = 3  # runs that are compared with the last one, and it
SLOWER = 0.5  # order that is trusted less than a method has
LEAST_ORDER = 0.5  # that is reckoned with
FIRST_ORDER = 4.0  # least by which errors of the two coarsest runs are taken to fall from there
TIGHT = 1e-10  # tolerances so far below the errors of first runs that these have to be told apart
CORRECTED = 3  # order over the exponent that methods which correct openings have
LEAST_FACTOR, FASTEST = 1.25, 6.0  # of the steps from one run to the next
COARSE, SHORT = 1e-4, 2000  # usual error of the first run; steps of what counts as a short one
SECOND = 1e-6  # tolerances that the second run does not meet, as a rule
FAR, NEARER = 0.4, 0.45  # share of the steps below which a run tells of an error so uncertainly
# that another is done, with at least so much
EPSILON = float(np.finfo(float).eps)
ROUND_OFF = 1e-14  # differences below this say nothing
REST = 64 * EPSILON  # of a length, by which a place may be off its equilibrium
FORCE_SHARE = 0.1  # of a tolerance that fitted forces may take up
FIRST_ERROR, LEAST_ERROR = 1e-3, 1e-13  # of a fit over the tolerance, and of any fit
FITS = 4  # attempts
MARGINS = (0.05, 0.5)  # over the range met, on either side, by which a fit is wider
WORTH = 0.005  # seconds that fitted forces must save
PER_FIT = 0.004  # seconds
STUCK = 4  # refinements in a row that bring nothing: round-off is reached


def fixed_step(problem, dt):
    """Run with a given step."""
    return march(problem, count(problem, dt), allowed=1.0)[0]


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


def expected_steps(problem, fraction):
    """Steps that keep dt below a fraction of the stability limit, were all the energy of the scene
    to meet in one bond."""
    if not problem.t_end:
        return 0
    return _steps(problem, fraction, problem.outlook.expected.frequency, CHECKPOINTS)


def _steps(problem, fraction, omega, least):
    if problem.scene.is_driven:
        omega = max(omega, quickest(functions_of_time(problem.scene), problem.t_end))
    return max(count(problem, fraction * problem.natural_step(omega)), least)


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
    least, most = (REFINEMENTS, MOST_REFINEMENTS)
    if problem.scene.is_driven:
        least, most = DRIVEN, MOST_DRIVEN
    for number in range(most):
        try:
            return march(problem, steps, allowed, checkpoints, start)
        except (StabilityError, LockingError) as error:
            if problem.surrogate is not None and isinstance(error, RangeError):
                raise  # another range helps, another step does not
            if number >= least and isinstance(error, LockingError):
                raise
            known = getattr(error, "largest", math.inf)
            steps, start = max(2 * steps, count(problem, known)), None
    return march(problem, steps, 1.0, checkpoints)


def to_tolerance(problem, tol, short=None):
    """As `_to_tolerance`; what goes wrong in a trial tells of the energies that it had."""
    try:
        return _to_tolerance(problem, tol, short)
    except TensegrityError as error:
        if getattr(error, "run", None) is not None:
            error.run = with_energies(error.run)
        raise


def _to_tolerance(problem, tol, short):
    """Refine the step until runs with different steps say that the tolerance is met.

    All runs have steps of which a whole number goes between the same instants, at which they are
    compared: those of the first run's steps, at the stability limit, or every second.  A `short`
    run is done by the method given so.
    """
    if not problem.t_end:
        return march(problem, 0, 1.0)[0]
    refuse_jumps(problem, problem.scene.present_ranges(problem.state.u), tol)
    if not problem.state.v.any() and (length := rests(problem)):
        return resting(problem, length, tol)
    apart, fewest = (DENSE, AT_FIRST) if problem.scene.smooth else (1, CHECKPOINTS)
    least = _steps(problem, TRIAL, problem.outlook.first_frequency, fewest)
    if short is not None and least * (COARSE / tol) ** (1 / short.order) < SHORT:
        problem = changed(problem, method=short)
        least = _steps(problem, TRIAL, problem.outlook.first_frequency, fewest)
    instants = min(math.ceil(least / apart), max(FEWEST, MOST_KEPT // problem.state.u.size))
    first = Rung.of(_trial(problem), math.ceil(least / instants), instants)
    if first.run.complete:
        for margin in MARGINS:
            try:
                fitted = with_polynomials(problem, first, tol, margin)
                if fitted is None:
                    break
                return converged(*fitted, tol)
            except RangeError:  # finer runs reach farther than the coarse one
                continue
    return converged(problem, first, 0.0, tol)


def rests(problem):
    """The length [m] beside which a scene without velocities is in equilibrium to round-off: the
    shortest bond; None where forces, or time, will move it."""
    scene, u = problem.scene.listed(problem.state.u), problem.state.u
    if scene.is_driven:
        return None
    given = scene.spring_lengths
    lengths = [s.length or 0.0 for s in scene.springs] if given is None else np.ravel(given)
    length = min((x for x in lengths if x > 0), default=0.0)
    stiffness = scene.stiffness_within(scene.present_ranges(u))
    pull = np.max(np.abs(scene.forces(u)), initial=0.0)
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
    return changed(run, error_estimate=moved if run.complete else None)


def _trial(problem, rows=False):
    """The same with rows that cost nothing; their energies come when it turns out to be it."""
    record = problem.record
    if not record.is_plain:
        record = Record(sites=record.sites)
    return changed(problem, record=record, trial=True, rows=rows and problem.record.is_plain)


@dataclass(frozen=True)
class Rung:
    """One of the runs that are compared.

    Attributes
    ----------
    run : Run or Whole
    instants : int
    seen : tuple of ndarray, (instants + 1, *shape)
        u and v at evenly spaced instants, which all rungs have in common.
    """

    run: object
    instants: int
    seen: tuple

    @classmethod
    def of(cls, problem, steps, instants):
        """With so many steps from one instant to the next, or more where those are too coarse."""
        run, seen = refined(problem, steps * instants, 1.0, instants)
        return cls(run, instants, seen)

    @property
    def fineness(self):
        """Steps from one instant to the next."""
        return self.run.steps / self.instants

    def gap(self, finer):
        """Largest difference from a finer one in u and in v, over the largest value there."""
        at_once = isinstance(self.run, Whole) and isinstance(finer.run, Whole)
        of = walk.largest_gap if at_once else largest_gap
        return of(self.seen, finer.seen)


def converged(problem, rung, error, tol):
    """Refine from a first run on; `error` is what fitted forces add.

    The error of a run is its largest difference from a finer one.  That of the finest follows
    by the order that errors of coarser runs fall with, as far as it is to be trusted: `Judge`.
    Where that of far coarser ones tells too little, another one between them and it tells more.
    """
    judge = Judge(problem, rung.run.met, tol)
    rungs, stuck = [rung], 0
    factor, smallest = judge.first, math.inf
    while rungs[-1].run.complete:
        finest = rungs[-1].fineness
        fineness = max(math.ceil(finest * factor), int(finest) + 1 if factor > 1 else 1)
        likely = factor > 1 and (len(rungs) > 1 or tol > SECOND)
        found = Rung.of(_trial(problem, likely), fineness, rung.instants)
        if not found.run.complete:
            return with_energies(found.run)
        judge.see(found.run.met)
        if found.fineness in [r.fineness for r in rungs]:  # what is between had to be finer
            factor = judge.first
            continue
        rungs = sorted([*rungs, found], key=lambda r: r.fineness)[-KEPT:]
        gaps = [(r.fineness / rungs[-1].fineness, r.gap(rungs[-1])) for r in rungs[:-1]]
        estimate = judge.estimate(gaps) + rounded(problem, rungs[-1].run)
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


def rounded(problem, run):
    """What a walk at random of the last digits comes to in all stages of a run."""
    return EPSILON * math.sqrt(run.steps * problem.method.stages)


def answer(problem, run, estimate):
    """The run that meets a tolerance, with the rows that were asked for."""
    if problem.record.is_plain and (isinstance(run, Run) or run.has_rows):
        return changed(with_energies(run), error_estimate=estimate)
    run = march(problem, run.steps, 1.0)[0]
    return changed(run, error_estimate=estimate if run.complete else None)


class Judge:
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

    def __init__(self, problem, met, tol):
        self._problem, self._tol = problem, tol
        self.see(met)

    def see(self, met):
        """Contacts may open in this run that did not in the coarser ones."""
        refuse_jumps(self._problem, met, self._tol)
        left, order = order_left(self._problem, met), self._problem.method.order
        self.opens, self.order = left < math.inf, min(left, order - SLOWER)
        self.accept, self._aim = (0.45, 0.2) if self.opens else (0.8, 0.25)
        self.first = 1.5
        if self.opens and self._tol < COARSE:
            self.first = 2.0
        elif self._tol < TIGHT:
            self.first = 2.5

    def estimate(self, gaps):
        """Estimated error of the finest run.

        Parameters
        ----------
        gaps : list of (share of its steps, difference from it), the coarsest first
        """
        if len(gaps) == 1:
            share, gap = gaps[0]
            return gap / max(share ** (-self.order / 2) - 1, 1.0) if not self.opens else gap
        order = self._seen(gaps)
        errors = [gap / (1 - share**order) * share**order for share, gap in gaps[-2:]]
        return max(errors) if self.opens else errors[-1]

    def _seen(self, gaps):
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
            order, estimate = self._seen(gaps), self.estimate(gaps)
        needed = (estimate / (self._aim * self._tol)) ** (1 / order)
        if len(gaps) > 1 and share < FAR and not self.opens:  # errors may have fallen faster
            return max(math.sqrt(share), NEARER)
        return min(max(needed, LEAST_FACTOR), FASTEST)


def order_left(problem, met):
    """Order that contacts which opened leave to a method, by the springs that it met them with,
    and corners of drives.

    A force that grows like overlap^n leaves n + 1, or n + 3 where that is corrected.
    """
    scene = problem.scene
    order = min((signal.leaves for signal in functions_of_time(scene)), default=math.inf)
    corrects = isinstance(problem.method, Corrected)
    for exponent in {corner[2] for _, corner in corners_met(scene, met)}:
        treated = corrects and is_treated(exponent)
        order = min(order, exponent + (CORRECTED if treated else 1))
    return order


def corners_met(scene, met):
    """Springs, and corners of their forces between elongations met."""
    if not scene.follows:
        return scene.spring_table.corners_within(met)
    given = scene.law.given
    spring = given if isinstance(given, Potential) else PowerLaw(1.0, 1.0)
    return [(spring, corner) for corner in spring.openings]


def refuse_jumps(problem, met, tol):
    """Refuse a tolerance where a force, or an energy, jumps between elongations met."""
    for spring, (place, jump, exponent, _) in corners_met(problem.scene, met):
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


def with_energies(run):
    """A trial with the energies of its rows."""
    if isinstance(run, Whole):
        return run.run()
    if not np.isnan(run.energy).any():  # some may be known, others not
        return run
    return changed(run, energy=run.scene.energies(run.u, run.v))


def with_polynomials(problem, coarse, tol, margin):
    """The problem with fitted forces, where they are good enough and save time.

    Parameters
    ----------
    problem : Problem
    coarse : Rung
        With the exact forces.
    tol, margin : float

    Returns
    -------
    None, or problem, the same coarse run with fitted forces, and the largest difference that
    they make there

    Raises
    ------
    RangeError
        If that run leaves the range.
    """
    scene, run = problem.scene, coarse.run
    if problem.record.checkpoint is not None:
        return None  # a state that is kept has to say what the forces are
    if scene.follows or scene.is_driven or saved(problem, run, tol) < WORTH:
        return None
    springs = scene.spring_table.different
    ranges = [_widened(spring, *met, margin) for spring, met in zip(springs, run.met, strict=True)]
    error, least = max(FIRST_ERROR * tol, LEAST_ERROR), 0.0
    for _ in range(FITS):
        try:
            fits = [Polynomial(s, *r, error) for s, r in zip(springs, ranges, strict=True)]
            fitted = changed(problem, surrogate=scene.with_springs(fits))
            there, seen = march(_trial(fitted), run.steps, 1.0, coarse.instants)
        except RangeError:
            raise
        except (LockingError, StabilityError):
            return None
        except TensegrityError:  # not that good: see whether a worse one is good enough
            least = error
            error *= 10
            continue
        found = Rung(there, coarse.instants, seen)
        if not there.complete:
            return fitted, found, 0.0
        gap = coarse.gap(found)
        if gap <= FORCE_SHARE * tol:
            return fitted, found, gap
        error *= FORCE_SHARE * tol / gap / 3
        if error <= least:
            return None
    return None


def saved(problem, run, tol):
    """Seconds that fitted forces save, roughly, in all runs that a tolerance takes."""
    scene, order = problem.scene, problem.method.order
    if scene.remembered.gain is None:
        springs, group = scene.spring_table.different, scene.spring_table.group
        fitted = cost(PolynomialLaw(DEGREES[len(DEGREES) // 2]))
        gains = [max(cost(spring.law) - fitted, 0.0) for spring in springs]
        lanes = math.prod(scene.shape) // (scene.sites * scene.dim)
        often = lanes if group.ndim == 1 else 1  # lanes may have them in common
        scene.remembered.gain = often * float(np.dot(gains, np.bincount(group.ravel())))
    steps = run.steps * max((COARSE / tol) ** (1 / order), 1.0)  # of the last run, as a rule
    calls = steps * problem.method.stages
    return calls * scene.remembered.gain - PER_FIT * len(scene.spring_table)


def _widened(spring, low, high, margin):
    """A range somewhat wider than the one met, inside the spring's reach."""
    room = margin * (high - low)
    low, high = low - room, high + room
    return max(low, spring.reach[0]), min(high, spring.reach[1])


def largest_gap(coarse, fine):
    """Largest difference of two runs in u and in v, each over its own largest value in the run."""
    parts = []
    for one, other in zip(coarse, fine, strict=True):
        largest, gap = np.max(np.abs(other)), np.max(np.abs(one - other))
        parts.append(gap / largest if largest else gap)
    return float(max(parts))
