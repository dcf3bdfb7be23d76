"""One run with one step: the compiled loop, block by block, under watch.

Each block starts from a kept copy of the state, and the smallest and largest elongation it met
are known at no cost; so a spring that reached the end of its domain, or a stiffness beyond the
stability limit, is noticed before a wrong number is recorded, and the block is repeated step by
step to say where and when.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tensegrity.clearance import CAUTION
from tensegrity.errors import ContactError, LockingError, StabilityError
from tensegrity.methods import Method, Nystrom
from tensegrity.record import Record
from tensegrity.run import Run
from tensegrity.scene import State

BLOCK = 2_000_000  # bonds x stages x steps in one call of the loop: about 5 ms
FEWEST = 100  # steps in one call: the pieces of a long chain work apart for some tens
MOST_STEPS = 10**12


@dataclass(frozen=True, eq=False)
class Problem:
    """What is to be run, the step apart.

    `surrogate` is the scene with springs that are fitted to those of `scene`: it is moved, while
    checks and recorded energies are those of `scene`.
    """

    scene: object
    state: State
    t_end: float
    method: Method
    record: Record
    surrogate: object = None

    @property
    def moved(self):
        """The scene that the loop advances."""
        return self.scene if self.surrogate is None else self.surrogate

    @property
    def force(self):
        """What the tensions of the springs are computed by."""
        different = dict.fromkeys(spring.force for spring in self.moved.spring_table.different)
        return ", ".join(different)

    def largest_step(self, ranges):
        """Stability limit [s] for elongations within `ranges`; inf where all V'' vanish."""
        omega = self.scene.frequency(ranges)
        return self.method.stability_limit / omega if omega > 0 else math.inf

    def natural_step(self, ranges):
        """The step [s] that fractions are taken of, for elongations within `ranges`."""
        omega = self.scene.frequency(ranges)
        return self.method.scale / omega if omega > 0 else math.inf


def count(problem, dt):
    """Number of steps, the largest not above dt; refused where no run could end."""
    steps = problem.t_end / dt * (1 - 1e-12) if dt > 0 else math.inf
    if steps > MOST_STEPS:
        raise StabilityError(
            f"t_end {problem.t_end:g} s takes {steps:.3g} steps of {dt:.3g} s, more than "
            f"{MOST_STEPS:.0e}"
        )
    return math.ceil(steps)


def march(problem, steps, allowed, checkpoints=0):
    """Run with one step, watching that it stays below `allowed` of the stability limit.

    Returns
    -------
    run : Run
    checks : structured ndarray
        All sites at `checkpoints` + 1 evenly spaced instants, which `steps` is a multiple of.
    """
    scene, shape = problem.scene, problem.scene.shape
    dt = problem.t_end / steps if steps else 0.0
    watch = _Watch(problem, dt, allowed)
    recorded = problem.record.steps(steps)
    checked = np.arange(checkpoints + 1 if checkpoints else 0) * (steps // (checkpoints or 1))
    stops = np.union1d(recorded, checked) if checkpoints else recorded
    columns = problem.record.columns(scene.sites)
    kept = tuple(np.arange(scene.sites)[columns].tolist())
    walls = watch.impulse().shape
    rows = problem.record.rows(len(recorded) + 1, (len(kept), *shape[1:]), walls)
    checks = Record().rows(len(checked), shape, walls)
    largest = max(FEWEST, BLOCK // (scene.cost * problem.method.stages))

    def keep():
        state = watch.state()
        u, v = state.u[columns], state.v[columns]
        rows.add(watch.sound[2] * dt, scene.energy(state), u, v, watch.impulse())

    def keep_last():
        done = watch.sound[2]
        if recorded[np.searchsorted(recorded, done)] != done:
            keep()

    def result(complete):
        table = rows.finished()
        return Run(
            scene, table["t"], table["u"], table["v"], table["energy"], watch.state(),
            problem.method.name, dt, watch.sound[2], kept, complete,
            impulse=table["impulse"] if walls[0] else None, force=problem.force, met=watch.met,
        )  # fmt: skip

    with _progress(steps) as bar:
        try:
            to_record, to_check = np.isin(stops, recorded), np.isin(stops, checked)
            for stop, wanted, compared in zip(stops, to_record, to_check, strict=True):
                while (done := watch.sound[2]) < stop:
                    watch.advance(min(int(stop) - done, largest))
                    bar.update(watch.sound[2] - done)
                if wanted:
                    keep()
                if compared:
                    state = watch.state()
                    checks.add(stop * dt, 0.0, state.u, state.v, watch.impulse())
        except KeyboardInterrupt:
            keep_last()
            return result(complete=False), checks.finished()
        except (ContactError, LockingError, StabilityError) as error:
            keep_last()
            error.run = result(complete=False)
            raise
    return result(complete=True), checks.finished()


def _progress(steps):
    from tqdm import tqdm

    return tqdm(total=steps, unit="step", unit_scale=True, delay=1.0, leave=False, disable=None)


class _Watch:
    """Advances block by block and refuses a block that left what the step allows."""

    def __init__(self, problem, dt, allowed):
        scene = problem.moved
        self._problem, self._dt, self._allowed = problem, dt, allowed
        self._energy = problem.scene.available_energy(problem.state)
        self._u, self._v = scene.arrays(problem.state)
        self._springs, self._domains = scene.spring_table.different, scene.spring_table.reach
        self._safe = np.zeros_like(self._domains)  # ranges of elongation known to be allowed
        self._limit = math.inf  # stability limit within them [s]
        self.met = np.zeros_like(self._domains)  # smallest and largest elongation, 0 included
        self._tracker = scene.clearance and scene.clearance.tracker(problem.state.u)
        self._most = math.inf  # steps that can be done without a look for new contacts
        self._seen = self._u.copy(), self._v.copy()  # what the last sound arrays stand for
        self.sound = *self._seen, 0  # last sound arrays, and the steps by then
        self._loop = None

    def _begin(self):
        """Enter the variables of the method's steps."""
        scene, dt, method = self._problem.moved, self._dt, self._problem.method
        self._out, self._leave = None, None
        if method.processor is not None:
            enter, leave = method.processor
            loop = scene.bind(self._u, self._v, enter, dt)
            loop.advance(1)
            self._check_processor(loop, self._u, self._v, 0.0)
            self.sound = self._u.copy(), self._v.copy(), 0
            self._out = np.empty_like(self._u), np.empty_like(self._v)
            self._leave = scene.bind(*self._out, leave, dt)
        self._loop = scene.bind(self._u, self._v, method, dt)

    def _check_processor(self, loop, u, v, t):
        if not self._is_sound(loop, u, v):
            error = self._error(t, loop, u)
            if isinstance(error, LockingError):
                raise error
            raise StabilityError(
                f"dt {self._dt:.6g} s is too coarse for the processor of "
                f"{self._problem.method.name} at t = {t:.6g} s"
            )
        self._see(loop)

    def state(self):
        """The last sound state."""
        sites = self._problem.scene.sites
        return State(self._seen[0][:sites], self._seen[1][:sites])

    def impulse(self):
        """Impulse given to each wall so far, (walls[, dim]); the rows behind the sites."""
        scene = self._problem.scene
        return self._seen[1][scene.sites : scene.sites + scene.wall_count]

    def advance(self, steps):
        """Advance, perhaps by fewer steps.

        Or go back to the last sound state and raise what went wrong, where, when.
        """
        if self._loop is None:
            self._begin()
        before_u, before_v, done = self.sound
        steps = min(steps, self._most)
        self._loop.forget_range()
        self._loop.advance(steps)
        if self._is_sound(self._loop, self._u, self._v):
            if self._tracker is None or self._is_clear(done, steps):
                self._keep(done + steps)
            else:
                self._u[:], self._v[:] = before_u, before_v
            return
        self._u[:], self._v[:] = before_u, before_v
        for k in range(done, done + steps):
            self._loop.forget_range()
            self._loop.advance(1)
            if not self._is_sound(self._loop, self._u, self._v):
                raise self._error((k + 1) * self._dt, self._loop, self._u)
            if self._tracker is not None:
                self._is_clear(k, 1)
            self._keep(k + 1)
        raise StabilityError(f"a block of {steps} steps went wrong, but not step by step")

    def _keep(self, done):
        u, v = self._u.copy(), self._v.copy()
        seen = u, v
        if self._leave is not None:
            self._out[0][:], self._out[1][:] = u, v
            self._leave.forget_range()
            self._leave.advance(1)
            self._check_processor(self._leave, *self._out, done * self._dt)
            seen = self._out[0].copy(), self._out[1].copy()
        self.sound, self._seen = (u, v, done), seen
        self._see(self._loop)

    def _see(self, loop):
        self.met[:, 0] = np.minimum(self.met[:, 0], loop.range[:, 0])
        self.met[:, 1] = np.maximum(self.met[:, 1], loop.range[:, 1])

    def _is_clear(self, done, steps):
        """Whether no unlisted contact can have formed; says how many steps to take next."""
        u, travel = self._u[: self._problem.scene.sites], self._loop.travel
        share = self._tracker.share(travel)
        if share >= 1 and steps > 1:
            self._most = max(1, min(steps // 2, int(CAUTION * steps / share)))
            return False
        if share >= 1:
            self._tracker.judge(u, (done + 1) * self._dt)
        else:
            self._tracker.accept(u, travel)
        share = self._tracker.share(travel)
        self._most = max(1, int(min(CAUTION * steps / share, MOST_STEPS))) if share else MOST_STEPS
        return True

    def _met(self, loop, u):
        """Elongations met; a method that evaluates forces elsewhere ends at others."""
        if not isinstance(self._problem.method, Nystrom) or not np.isfinite(u).all():
            return loop.range
        here = self._problem.moved.present_ranges(u[: self._problem.scene.sites])
        low, high = np.minimum(loop.range[:, 0], here[:, 0]), np.maximum(loop.range, here)[:, 1]
        return np.stack([low, high], axis=1)

    def _is_sound(self, loop, u, v):
        met = self._met(loop, u)
        low, high = self._domains.T
        if np.any(met[:, 0] <= low) or np.any(met[:, 1] >= high):
            return False
        if not (np.isfinite(u).all() and np.isfinite(v).all()):
            return False
        below, above = met[:, 0] < self._safe[:, 0], met[:, 1] > self._safe[:, 1]
        if not (below.any() or above.any()):
            return True
        for margin in (0.1, 0.01, 0.0):  # wider than met, so as not to ask again soon
            wider = self._safe.copy()
            wider[below, 0] = _towards(low[below], met[below, 0], margin)
            wider[above, 1] = _towards(high[above], met[above, 1], margin)
            self._limit = self._problem.largest_step(wider)
            if self._dt <= self._allowed * self._limit:
                self._safe = wider
                return True
        return False

    def _error(self, t, loop, after):
        """What went wrong in the step that ended at t with displacements `after`."""
        scene, u = self._problem.moved, after[: self._problem.scene.sites]
        if not np.isfinite(u).all():
            before = self.state()
            u = before.u + self._dt * before.v
        met, (low, high) = self._met(loop, after), self._domains.T
        for row, side in np.argwhere(np.stack([met[:, 0] <= low, met[:, 1] >= high], axis=1)):
            spring, where = self._springs[row], scene.extreme(int(row), u, side)
            barrier = float(spring.energy(spring.reach[side]))
            if self._energy < barrier:
                return StabilityError(
                    f"dt {self._dt:.6g} s is too coarse: the spring {where} passed the end of "
                    f"its domain at t = {t:.6g} s, which takes {barrier:.6g} J, with "
                    f"{self._energy:.6g} J in the whole scene"
                )
            error = spring.beyond(met[row, side])
            return type(error)(f"{error}: the spring {where} got there at t = {t:.6g} s")
        return StabilityError(
            f"dt {self._dt:.6g} s is beyond {self._allowed * self._limit:.6g} s, "
            f"{self._allowed:g} of the stability limit of {self._problem.method.name} at the "
            f"stiffness met at t = {t:.6g} s {scene.stiffest(u, met)}"
        )


def _towards(end, met, margin):
    """An elongation beyond the one met by a margin, short of the end of the domain."""
    room = np.where(np.isfinite(end), end - met, 10 * met)
    return met + margin * room
