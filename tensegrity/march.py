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

from tensegrity import stepping
from tensegrity.errors import LockingError, StabilityError
from tensegrity.lattice import State
from tensegrity.methods import Method
from tensegrity.record import Record
from tensegrity.run import Run

BLOCK = 2_000_000  # bonds x stages x steps in one call of the loop: about 5 ms
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
        different = dict.fromkeys(spring.force for spring in self.moved.segment_springs[0])
        return ", ".join(different)

    def largest_step(self, ranges):
        """Stability limit [s] for elongations within `ranges`; inf where all V'' vanish."""
        omega = stepping.frequency(self.scene, ranges)
        return self.method.stability_limit / omega if omega > 0 else math.inf


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
            problem.method.name, dt, done, kept, complete, force=problem.force, met=watch.met,
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
        scene, method = problem.moved, problem.method
        self._problem, self._u, self._v = problem, u, v
        self._dt, self._allowed = dt, allowed
        self._energy = problem.scene.energy(problem.state)
        self._loop = scene.bind(u, v, np.multiply(method.kicks, dt), np.multiply(method.drifts, dt))
        self._domains = np.array([s.reach for s in scene.segment_springs[0]])
        self._safe = np.zeros_like(self._domains)  # ranges of elongation known to be allowed
        self._limit = math.inf  # stability limit within them [s]
        self.met = np.zeros_like(self._domains)  # smallest and largest elongation, 0 included
        self.sound = u.copy(), v.copy(), 0  # last sound state, and the steps done by then

    def advance(self, steps):
        """Advance; or go back to the last sound state and raise what went wrong, where, when."""
        before_u, before_v, done = self.sound
        self._loop.forget_range()
        self._loop.advance(steps)
        if self._is_sound():
            self._keep(done + steps)
            return
        self._u[:], self._v[:] = before_u, before_v
        for k in range(done, done + steps):
            self._loop.forget_range()
            self._loop.advance(1)
            if not self._is_sound():
                raise self._error((k + 1) * self._dt)
            self._keep(k + 1)
        raise StabilityError(f"a block of {steps} steps went wrong, but not step by step")

    def _keep(self, done):
        self.sound = self._u.copy(), self._v.copy(), done
        self.met[:, 0] = np.minimum(self.met[:, 0], self._loop.range[:, 0])
        self.met[:, 1] = np.maximum(self.met[:, 1], self._loop.range[:, 1])

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
        scene = self._problem.moved
        springs, first = scene.segment_springs
        r = scene.elongation(self.sound[0])
        met, (low, high) = self._loop.range, self._domains.T
        for s, side in np.argwhere(np.stack([met[:, 0] <= low, met[:, 1] >= high], axis=1)):
            part = r[first[s] : first[s + 1]]
            bond = int(first[s] + (np.argmax(part) if side else np.argmin(part)))
            barrier = float(springs[s].energy(springs[s].reach[side]))
            if self._energy < barrier:
                return StabilityError(
                    f"dt {self._dt:.6g} s is too coarse: the spring between sites {bond} and "
                    f"{bond + 1} passed the end of its domain at t = {t:.6g} s, which takes "
                    f"{barrier:.6g} J, with {self._energy:.6g} J in the whole scene"
                )
            error = springs[s].beyond(met[s, side])
            return type(error)(
                f"{error}: the spring between sites {bond} and {bond + 1} got there at "
                f"t = {t:.6g} s"
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
