"""Time integration of a scene: `simulate`, and the run it returns.

The scene advances in blocks by the compiled loop.  Each block starts from a kept copy of the
state, and the smallest and largest elongation it met are known at no cost; so a spring that
reached the end of its domain, or a stiffness beyond the stability limit, is noticed before a
wrong number is recorded, and the block is repeated step by step to say where and when.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field, replace

import numpy as np

from tensegrity import check, methods, stepping
from tensegrity.errors import LockingError, StabilityError, TensegrityError
from tensegrity.lattice import State
from tensegrity.record import Record

MARGIN = 2.0  # a default step may be this much larger, at the stiffness met, than meant
TRIAL = 0.5  # first step over the stability limit where a tolerance decides
SHARE = 0.25  # of the energy, in one bond, for that first step
REFINEMENTS = 8  # how often a step chosen here is refined
BLOCK = 2_000_000  # bonds x stages x steps in one call of the loop: about 5 ms
CHECKPOINTS = 17  # instants at which two runs are compared to estimate an error
SAFETY = 0.5  # aim at this part of a tolerance
FASTEST = 16.0  # largest refinement at once
ROUND_OFF = 1e-14  # differences below this say nothing
MOST_STEPS = 10**12
STUCK = 3  # refinements in a row that bring nothing: round-off is reached


@dataclass(frozen=True, eq=False)
class Run:
    """A finished, interrupted or failed run.

    Attributes
    ----------
    t : ndarray, (T,)
        Recorded instants [s].
    u, v : ndarray, (T, sites)
        Displacement [m] and velocity [m/s] of the recorded sites.
    energy : ndarray, (T,)
        Total energy of the scene, all sites [J].
    final : State
        State at the last instant reached.
    method : str
    dt : float
        Step [s]: the largest not above the one asked for that divides the time evenly.
    steps : int
        Steps done.
    complete : bool
        False if the run was interrupted or failed; what it had recorded is kept.
    error_estimate : float or None
        Estimated max(|du|/max|u|, |dv|/max|v|), where a tolerance was asked for.
    wall_time : float
        [s], all trial runs included.
    """

    scene: object = field(repr=False)
    t: np.ndarray
    u: np.ndarray
    v: np.ndarray
    energy: np.ndarray
    final: State
    method: str
    dt: float
    steps: int
    sites: tuple[int, ...]
    complete: bool = True
    error_estimate: float | None = None
    wall_time: float = 0.0

    @property
    def energy_error(self):
        """Largest relative deviation of the total energy from its first value."""
        deviation = np.max(np.abs(self.energy - self.energy[0]))
        return float(deviation / abs(self.energy[0])) if self.energy[0] else float(deviation)

    def plot(self, axes=None):
        """Space-time density of energy; needs all sites recorded. Returns the axes."""
        from tensegrity.plotting import energy_density

        return energy_density(self, axes)

    def __str__(self):
        estimate = "" if self.error_estimate is None else f", estimated {self.error_estimate:.1e}"
        return (
            f"{self.method}, dt = {self.dt:.4g} s, {self.steps} steps to t = {self.t[-1]:.6g} s"
            f"{'' if self.complete else ' (incomplete)'}\n"
            f"{len(self.t)} instants of {len(self.sites)} sites recorded\n"
            f"error: energy {self.energy_error:.1e}{estimate}\n"
            f"wall time {self.wall_time:.3g} s"
        )

    __repr__ = __str__


def simulate(scene, state, t_end, *, method=None, dt=None, tol=None, record=None):
    """Advance a scene in time.

    Parameters
    ----------
    scene : Chain
    state : State
        Initial displacements [m] and velocities [m/s]; not changed.
    t_end : float
        Duration [s], >= 0.
    method : str, optional
        Name of a method, `tensegrity.methods.METHODS`.  By default "rkn6", or "verlet" where
        `dt` is given or a `tol` of 1e-3 or more.
    dt : float, optional
        Step [s]; the step used is the largest not above it that divides `t_end` evenly.  By
        default a small fraction of the stability limit, at the largest stiffness that any
        bond can meet with the initial energy, or does meet.
    tol : float, optional
        Wanted bound of max(|du|/max|u|, |dv|/max|v|), maxima over the run, instead of `dt`: the
        step is refined until two runs, one with half the step of the other, say it is met.
    record : Record, optional

    Returns
    -------
    Run
        Also after Ctrl-C, with `complete` False and what was recorded until then.

    Raises
    ------
    TensegrityError
        Bad input, before any work.
    StabilityError
        `dt` is beyond the method's stability limit; during a run with `.run`, the part done.
    LockingError
        A spring reached an end of its domain; with `.run`, the part done.
    """
    started = time.perf_counter()
    if not hasattr(scene, "check"):
        raise TensegrityError(f"scene {scene!r} is not a scene, such as a Chain")
    scene.check(state)
    t_end = check.number("t_end", t_end, least=0, unit="s")
    if dt is not None and tol is not None:
        raise TensegrityError(f"dt {dt!r} s and tol {tol!r} exclude each other: give one")
    method = methods.find(methods.default(dt, tol) if method is None else method)
    record = Record() if record is None else record
    if not isinstance(record, Record):
        raise TensegrityError(f"record {record!r} is not a Record")
    record.check(scene.sites)
    problem = _Problem(scene, state, t_end, method, record)
    if dt is not None:
        run = _fixed_step(problem, check.number("dt", dt, above=0, unit="s"))
    elif tol is not None:
        run = _to_tolerance(problem, check.number("tol", tol, least=ROUND_OFF))
    else:
        run = _default_step(problem)
    return replace(run, wall_time=time.perf_counter() - started)


@dataclass(frozen=True, eq=False)
class _Problem:
    scene: object
    state: State
    t_end: float
    method: methods.Method
    record: Record

    def largest_step(self, ranges):
        """Stability limit [s] for elongations within `ranges`; inf where all V'' vanish."""
        omega = stepping.frequency(self.scene, ranges)
        return self.method.stability_limit / omega if omega > 0 else math.inf


def _fixed_step(problem, dt):
    limit = problem.largest_step(stepping.present_ranges(problem.scene, problem.state))
    if dt > limit:
        raise StabilityError(
            f"dt {dt:.6g} s is beyond {limit:.6g} s, the stability limit of "
            f"{problem.method.name} in the initial state"
        )
    return _march(problem, _count(problem, dt), allowed=1.0)[0]


def _default_step(problem):
    """Run with a step from the expected frequencies."""
    fraction = problem.method.step
    return _refined(problem, _steps(problem, fraction), MARGIN * fraction)[0]


def _steps(problem, fraction, share=1.0):
    """Steps that keep dt below a fraction of the stability limit, were `share` of the energy
    of the scene to meet in one bond."""
    if not problem.t_end:
        return 0
    limit = problem.largest_step(stepping.expected_ranges(problem.scene, problem.state, share))
    return max(_count(problem, fraction * limit), CHECKPOINTS)


def _count(problem, dt):
    """Number of steps, the largest not above dt; refused where no run could end."""
    steps = problem.t_end / dt * (1 - 1e-12) if dt > 0 else math.inf
    if steps > MOST_STEPS:
        raise StabilityError(
            f"t_end {problem.t_end:g} s takes {steps:.3g} steps of {dt:.3g} s, more than "
            f"{MOST_STEPS:.0e}"
        )
    return math.ceil(steps)


def _refined(problem, steps, allowed, checkpoints=0):
    """March with a step chosen here: refine it where the run met a larger stiffness than expected.

    Returns what `_march` returns; a spring that still reaches the end of its domain after
    `REFINEMENTS` refinements does so whatever the step.
    """
    for _ in range(REFINEMENTS):
        try:
            return _march(problem, steps, allowed, checkpoints)
        except (StabilityError, LockingError):
            steps *= 2
    return _march(problem, steps, 1.0, checkpoints)


def _to_tolerance(problem, tol):
    """Refine the step until a run and one with half its step agree well enough.

    Their largest difference at common instants, over 2^order - 1, estimates the error of the
    finer one, once it was seen to shrink about as fast as the order promises.  Before that, and
    where it does not (contacts that open), less is trusted: see `_gain`.
    """
    order = problem.method.order
    steps = CHECKPOINTS * math.ceil(_steps(problem, TRIAL, SHARE) / CHECKPOINTS)
    if steps == 0:
        return _march(problem, 0, 1.0)[0]
    trial = replace(problem, record=Record(sites=problem.record.sites))
    coarse_run, coarse = _refined(trial, steps, 1.0, CHECKPOINTS)
    steps, last, stuck = coarse_run.steps, None, 0
    run = coarse_run
    while run.complete and coarse_run.complete:
        run, fine = _refined(problem, 2 * steps, 1.0, CHECKPOINTS)
        if not run.complete:
            break
        difference = _difference(coarse, fine, run)
        estimate = difference / _gain(order, last, 2 * steps, difference)
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
            coarse_run, coarse = _refined(trial, steps, 1.0, CHECKPOINTS)
    return run if coarse_run.complete else coarse_run


def _gain(order, last, steps, difference):
    """By how much the finer run may be taken to be better than its difference from the coarser.

    `last` holds steps and difference of the refinement before, or None.
    """
    if last is None:
        return 2 ** (order / 2)
    expected = last[1] * (last[0] / steps) ** order
    return 2**order - 1 if difference <= 2 * expected else 1


def _difference(coarse, fine, run):
    """Largest difference of two runs in u and in v, each over its own largest value in the run."""
    parts = []
    for name in ("u", "v"):
        largest = max(np.max(np.abs(fine[name])), np.max(np.abs(getattr(run, name))))
        gap = np.max(np.abs(coarse[name] - fine[name]))
        parts.append(gap / largest if largest else gap)
    return float(max(parts))


def _march(problem, steps, allowed, checkpoints=0):
    """Run with one step, watching that it stays below `allowed` of the stability limit.

    Returns
    -------
    run : Run
    checks : structured ndarray
        All sites at `checkpoints` + 1 evenly spaced instants, which `steps` is a multiple of.
    """
    scene = problem.scene
    dt = problem.t_end / steps if steps else 0.0
    u, v = problem.state.u.copy(), problem.state.v.copy()
    watch = _Watch(problem, u, v, dt, allowed)
    recorded = problem.record.steps(steps)
    checked = np.arange(checkpoints + 1) * (steps // checkpoints) if checkpoints else []
    to_record, to_check = set(recorded.tolist()), set(map(int, checked))
    columns = problem.record.columns(scene.sites)
    kept = tuple(np.arange(scene.sites)[columns].tolist())
    rows = problem.record.rows(len(recorded) + 1, len(kept))
    checks = Record().rows(len(checked), scene.sites)
    largest = max(1, BLOCK // ((scene.sites - 1) * problem.method.stages))

    def keep():
        u, v, done = watch.sound
        rows.add(done * dt, scene.energy(State(u, v)), u[columns], v[columns])

    def keep_last():
        if watch.sound[2] not in to_record:
            keep()

    def result(complete):
        u, v, done = watch.sound
        table = rows.finished()
        return Run(
            scene, table["t"], table["u"], table["v"], table["energy"], State(u, v),
            problem.method.name, dt, done, kept, complete,
        )  # fmt: skip

    with _progress(steps) as bar:
        try:
            for stop in sorted(to_record | to_check):
                while (done := watch.sound[2]) < stop:
                    watch.advance(min(stop - done, largest))
                    bar.update(watch.sound[2] - done)
                if stop in to_record:
                    keep()
                if stop in to_check:
                    checks.add(stop * dt, 0.0, *watch.sound[:2])
        except KeyboardInterrupt:
            keep_last()
            return result(complete=False), checks.finished()
        except (LockingError, StabilityError) as error:
            keep_last()
            error.run = result(complete=False)
            raise
    return result(complete=True), checks.finished()


def _progress(steps):
    from tqdm import tqdm

    return tqdm(total=steps, unit="step", unit_scale=True, delay=1.0, leave=False, disable=None)


class _Watch:
    """Advances block by block and refuses a block that left what the step allows."""

    def __init__(self, problem, u, v, dt, allowed):
        scene, method = problem.scene, problem.method
        self._problem, self._u, self._v = problem, u, v
        self._dt, self._allowed = dt, allowed
        self._energy = scene.energy(problem.state)
        self._loop = scene.bind(u, v, np.multiply(method.kicks, dt), np.multiply(method.drifts, dt))
        self._domains = np.array([s.domain for s in scene.segment_springs[0]])
        self._safe = np.zeros_like(self._domains)  # ranges of elongation known to be allowed
        self._limit = math.inf  # stability limit within them [s]
        self.sound = u.copy(), v.copy(), 0  # last sound state, and the steps done by then

    def advance(self, steps):
        """Advance; or go back to the last sound state and raise what went wrong, where, when."""
        before_u, before_v, done = self.sound
        self._loop.forget_range()
        self._loop.advance(steps)
        if self._is_sound():
            self.sound = self._u.copy(), self._v.copy(), done + steps
            return
        self._u[:], self._v[:] = before_u, before_v
        for k in range(done, done + steps):
            self._loop.forget_range()
            self._loop.advance(1)
            if not self._is_sound():
                raise self._error((k + 1) * self._dt)
            self.sound = self._u.copy(), self._v.copy(), k + 1
        raise StabilityError(f"a block of {steps} steps went wrong, but not step by step")

    def _is_sound(self):
        met = self._loop.range
        low, high = self._domains.T
        if np.any(met[:, 0] <= low) or np.any(met[:, 1] >= high):
            return False
        if not (np.isfinite(self._u).all() and np.isfinite(self._v).all()):
            return False
        if np.all(met[:, 0] >= self._safe[:, 0]) and np.all(met[:, 1] <= self._safe[:, 1]):
            return True
        for margin in (0.1, 0.01, 0.0):  # wider than met, so as not to ask again soon
            wider = self._safe.copy()
            wider[:, 0] = np.minimum(wider[:, 0], _towards(low, met[:, 0], margin))
            wider[:, 1] = np.maximum(wider[:, 1], _towards(high, met[:, 1], margin))
            self._limit = self._problem.largest_step(wider)
            if self._dt <= self._allowed * self._limit:
                self._safe = wider
                return True
        return False

    def _error(self, t):
        """What went wrong in the step that ended at t, told from the sound state before it."""
        scene = self._problem.scene
        springs, first = scene.segment_springs
        r = scene.elongation(self.sound[0])
        met, (low, high) = self._loop.range, self._domains.T
        for s, side in np.argwhere(np.stack([met[:, 0] <= low, met[:, 1] >= high], axis=1)):
            part = r[first[s] : first[s + 1]]
            bond = int(first[s] + (np.argmax(part) if side else np.argmin(part)))
            barrier = float(springs[s].energy(springs[s].domain[side]))
            if self._energy < barrier:
                return StabilityError(
                    f"dt {self._dt:.6g} s is too coarse: the spring between sites {bond} and "
                    f"{bond + 1} passed the end of its domain at t = {t:.6g} s, which takes "
                    f"{barrier:.6g} J, with {self._energy:.6g} J in the whole scene"
                )
            return LockingError(
                f"{springs[s].end_message(met[s, side])}: the spring between sites {bond} and "
                f"{bond + 1} got there at t = {t:.6g} s"
            )
        bond = int(np.argmax(np.abs(r)))
        return StabilityError(
            f"dt {self._dt:.6g} s is beyond {self._allowed * self._limit:.6g} s, "
            f"{self._allowed:g} of the stability limit of {self._problem.method.name} at the "
            f"stiffness met at t = {t:.6g} s between sites {bond} and {bond + 1}"
        )


def _towards(end, met, margin):
    """An elongation beyond the one met by a margin, short of the end of the domain."""
    room = np.where(np.isfinite(end), end - met, 10 * met)
    return met + margin * room
