"""Steps of a run under watch.

Each block starts from a kept copy of the state, and the smallest and largest elongation it met
are known at no cost; so a spring that reached the end of its domain, or a stiffness beyond the
stability limit, is noticed before a wrong number is recorded, and the block is repeated step by
step to say where and when.
"""

from __future__ import annotations

import math

import numpy as np

from tensegrity.engine.methods import Corrected, Nystrom
from tensegrity.errors import StabilityError
from tensegrity.runs.book import Sound
from tensegrity.runs.guard import Guard
from tensegrity.runs.loops import Loop
from tensegrity.runs.problem import MOST_STEPS
from tensegrity.scenes.clearance import CAUTION
from tensegrity.scenes.scene import known_state


class Watch:
    """Advances block by block and refuses a block that left what the step allows."""

    def __init__(self, problem, dt, allowed, start=None) -> None:
        scene = problem.moved
        self._problem, self.dt, self.allowed = problem, dt, allowed
        u = problem.state.u if start is None else start.sound.seen[0][: scene.sites]
        self._list(scene.listed(u))
        if start is None or not start.sound.done:
            self._u, self._v = scene.arrays(problem.state)
            seen = self._u.copy(), self._v.copy()
            self.sound = Sound(*seen, 0, seen)
        else:
            self.sound = start.sound
            if start.met.shape == self.met.shape:
                self.met[:] = start.met
            self._u, self._v = self.sound.u.copy(), self.sound.v.copy()
        self._tracker = scene.clearance and scene.clearance.tracker(self._u[: scene.sites])
        self._most = math.inf  # steps that can be done without a look for new contacts
        self._loop, self._walk, self._fastest = None, None, 0.0

    def _list(self, scene):
        """Take the contacts that a scene lists, with no range of theirs known to be allowed."""
        springs = scene.spring_table
        self._scene, self._springs = scene, springs.different
        self._guard = Guard(self._problem, scene, self.dt, self.allowed)
        self.met = np.zeros_like(self._guard.domains)  # smallest, largest elongation, 0 included

    def _list_anew(self):
        """Go on with the contacts that may form from here on."""
        listed = self._problem.moved.listed(self._tracker.at)
        if listed is self._scene:
            return
        met = dict(zip(self._scene.spring_table.kinds, self.met, strict=True))
        self._fastest = self.fastest
        self._list(listed)
        for row, kind in enumerate(self._scene.spring_table.kinds):
            self.met[row] = met.get(kind, 0.0)
        self._loop = self._walk = None

    @property
    def fastest(self):
        """Bound on the largest angular frequency over all elongations met [rad/s]."""
        within = self._scene.stiffness_within(self.met)
        return max(self._fastest, self._scene.fastest(within))

    def _begin(self):
        """Bind the contacts that are listed."""
        method, begun = self._problem.method, self.sound.done > 0
        self._loop = Loop(self._scene, self._u, self._v, method, self.dt, begun)

    def look(self):
        """The last sound state, and the impulse given to each wall by then."""
        return self._parted(*self.sound.seen)

    def look_back(self, part):
        """The same a time `part` [s] after the step before the last one, by a shorter step of the
        method on a copy."""
        u, v = (x.copy() for x in self.sound.before)
        loop = self._scene.bind(u, v, self._problem.method, part)
        if isinstance(self._problem.method, Corrected):
            loop.stand_alone()
        loop.advance(1)
        if not self._is_inside(self._met(loop, u), u, v):
            raise self._error((self.sound.done - 1) * self.dt + part, loop, u)
        return self._parted(u, v)

    def _parted(self, u, v):
        """Rows of the loop's arrays as a state, and the impulses behind them, (walls[, dim])."""
        scene = self._problem.scene
        walls = slice(scene.sites, scene.sites + scene.wall_count)
        return known_state(u[: scene.sites], v[: scene.sites]), v[walls]

    def state(self):
        """The last sound state."""
        return self.look()[0]

    def impulse(self):
        """Impulse given to each wall so far, (walls[, dim])."""
        return self.look()[1]

    def advance(self, steps):
        """Advance, perhaps by fewer steps.

        Or go back to the last sound state and raise what went wrong, where, when.
        """
        if self._loop is None:
            self._begin()
        before = self.sound
        steps = min(steps, self._most)
        if self._block(before.done, steps):
            if self._tracker is None or self._is_clear(before.done, steps):
                self._keep(steps)
                if self._tracker is not None and self._tracker.is_new():
                    self._list_anew()
            else:
                self._u[:], self._v[:] = before.u, before.v
            return
        self._u[:], self._v[:] = before.u, before.v
        for k in range(before.done, before.done + steps):
            if not self._block(k, 1):
                raise self._error((k + 1) * self.dt, self._loop, self._u)
            if self._tracker is not None:
                self._is_clear(k, 1)
            self._keep(1)
            if self._tracker is not None and self._tracker.is_new():
                self._list_anew()
                return
        raise StabilityError(f"a block of {steps} steps went wrong, but not step by step")

    def strides(self):
        """Whether steps and their rows can be done in one call."""
        if self._loop is None:
            self._begin()
        if self._walk is None:
            self._walk = self._loop.walk() or False
        return self._walk is not False

    def most(self):
        """Steps that can be done without a look for new contacts."""
        return self._most

    def stride(self, end, kept):
        """Advance to step `end`, with a row at each step that there is room for in `kept`.

        Returns whether all was sound; if not, nothing is done.
        """
        before, steps, at = self.sound, end - self.sound.done, kept.at
        if not len(at) or at[-1] < end:
            at = np.append(at, end)
        self._loop.forget_range()
        at, sites = np.ascontiguousarray(at, dtype=np.int64), self._problem.scene.sites
        self._walk.go(
            before.done, at, len(at) == len(kept.at), sites, kept.u, kept.v,
            self._problem.scene.wall_count, kept.impulse,
        )  # fmt: skip
        self._loop.walked(before.done > 0)
        seen = self._walk.seen()
        sound = self._is_sound(self._loop, *seen)
        if not (sound and (self._tracker is None or self._is_clear(before.done, steps))):
            self._u[:], self._v[:] = before.u, before.v
            return False
        at_step = None if steps > 1 else before.seen
        self.sound = Sound(self._u.copy(), self._v.copy(), end, seen, at_step, kept)
        self._see(self._loop)
        if self._tracker is not None and self._tracker.is_new():
            self._list_anew()
        return True

    def _block(self, done, steps):
        """Do steps, and look: whether all is sound."""
        self._loop.forget_range()
        self._loop.advance(steps, done > 0)
        self._looked = self._loop.look()
        return self._is_sound(self._loop, *self._looked)

    def _keep(self, steps):
        seen, done = self._looked, self.sound.done + steps
        before = self.sound.seen if steps == 1 else None
        self.sound = Sound(self._u.copy(), self._v.copy(), done, seen, before)
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
            self._tracker.judge(u, (done + 1) * self.dt)
        else:
            self._tracker.accept(u, travel)
        share = self._tracker.share(travel)
        self._most = max(1, int(min(CAUTION * steps / share, MOST_STEPS))) if share else MOST_STEPS
        return True

    def _met(self, loop, u):
        """Elongations met; a method that evaluates forces elsewhere ends at others."""
        if not isinstance(self._problem.method, Nystrom) or not np.isfinite(u).all():
            return loop.range
        here = self._scene.present_ranges(u[: self._scene.sites])
        low, high = np.minimum(loop.range[:, 0], here[:, 0]), np.maximum(loop.range, here)[:, 1]
        return np.stack([low, high], axis=1)

    def _is_inside(self, met, u, v):
        finite = np.isfinite(u).all() and np.isfinite(v).all()
        return bool(finite and self._guard.is_inside(met))

    def _is_sound(self, loop, u, v):
        met = self._met(loop, u)
        return self._is_inside(met, u, v) and self._guard.allows(met)

    def _error(self, t, loop, after):
        """What went wrong in the step that ended at t with displacements `after`."""
        scene, u = self._scene, after[: self._scene.sites]
        if not np.isfinite(u).all():
            before = self.state()
            u = before.u + self.dt * before.v
        met, (low, high) = self._met(loop, after), self._guard.domains.T
        for row, side in np.argwhere(np.stack([met[:, 0] <= low, met[:, 1] >= high], axis=1)):
            spring, where = self._springs[row], scene.extreme(int(row), u, side)
            barrier = float(spring.derivative(0, spring.reach[side], closed=True))
            given = self._problem.scene.available_energy(self._problem.state)
            if given < barrier:
                return StabilityError(
                    f"{self._problem.step_words(self.dt)} is too coarse: the spring {where} "
                    f"passed the end of its domain at t = {t:.6g} s, which takes {barrier:.6g} J, "
                    f"with {given:.6g} J in the whole scene"
                )
            error = spring.beyond(met[row, side])
            return type(error)(f"{error}: the spring {where} got there at t = {t:.6g} s")
        return StabilityError(
            f"{self._problem.step_words(self.dt)} is beyond "
            f"{self.allowed * self._guard.limit:.6g} s, {self.allowed:g} of the stability limit of "
            f"{self._problem.method.name} at the stiffness met at t = {t:.6g} s "
            f"{scene.stiffest(u, met)}"
        )
