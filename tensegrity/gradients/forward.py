"""The run whose derivatives are wanted: `simulate`'s own, with samples taken after each step.

The scene is lent arrays one entry longer, in which the loop counts its steps: a run that goes back
to an earlier state goes back to its number too, and writes the samples from there on anew.
"""

from __future__ import annotations

from contextlib import contextmanager
from copy import copy
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.engine import reverse
from tensegrity.runs.integrate import simulate
from tensegrity.runs.loops import parts
from tensegrity.runs.record import Record
from tensegrity.scenes.scene import State

if TYPE_CHECKING:
    from collections.abc import Iterator
    from typing import Any

    from tensegrity.engine.methods import Splitting
    from tensegrity.engine.reverse_layout import Layout
    from tensegrity.gradients.samples import View
    from tensegrity.runs.run import Run
    from tensegrity.scenes.scene import Scene
    from tensegrity.typing import Array


ROWS = 4  # of the run that is given back, after the first: each is a stop that costs


class Forward:
    """A run, its samples, and some of its states.

    Parameters
    ----------
    scene : Scene
    state : State
    method : Splitting
    dt : float
        The step [s], exactly.
    steps : int
    view : View
        What is sampled.
    window : (int, int)
        After which steps, from and to.
    apart : int
        Steps between two states that are kept.
    layout : Layout
    grid : (float, float), optional
        What rounds moves of u and v; with it the loop of the layout runs.

    Attributes
    ----------
    rows : ndarray, (steps of the window, places)
    closing : ndarray, (steps of the window,)
        Times that velocities in the rows lack a kick for [s].
    states : dict of int to (ndarray, ndarray)
        u and v of the sites, as the loop had them after that number of steps.
    """

    def __init__(
        self,
        scene: Scene,
        state: State,
        method: Splitting,
        dt: float,
        steps: int,
        view: View,
        window: tuple[int, int],
        apart: int,
        layout: Layout,
        grid: tuple[float, float] | None = None,
    ) -> None:
        self.scene, self.method, self.dt, self.steps = scene, method, dt, steps
        self.view, self.layout, self._grid, self._apart = view, layout, grid, apart
        self._first, self._others, self._close = parts(method)
        self._begin, self._end = window
        self.rows = np.empty((self._end - self._begin + 1, len(view.places)))
        last = 0.0 if self._close is None else self._close.kicks[0] * dt
        self.closing = np.where(np.arange(self._begin, self._end + 1) > 0, last, 0.0)
        self.states: dict[int, tuple[Array, Array]] = {}
        self.start = state

    def run(self, t_end: float) -> Run:
        """Do it."""
        scene, state = self.scene, self.start
        lent = copy(scene)
        own = {"arrays": self._arrays, "bind": self._bind, "at_once": False}
        lent.__dict__.update({**scene.__dict__, **own})
        record = Record(every=max(1, -(-self.steps // ROWS)))
        dt = t_end / max(self.steps, 1) or self.dt
        run = simulate(lent, state, t_end, method=self.method, dt=dt, record=record)
        run = replace(run, scene=scene)
        if not self.steps:
            self.states[0] = state.u, state.v
        if self._grid is not None:
            run = replace(run, impulse=None)
        if self._begin == self.steps:
            self.rows[-1] = self._picked(*self.states[self.steps])
        return run

    def _picked(self, u: Array, v: Array) -> Array:
        """Samples of a state of all sites."""
        places, of_u = self.view.places, self.view.of_u
        return np.concatenate([u.ravel()[places[:of_u]], v.ravel()[places[of_u:]]])

    def _arrays(self, state: State) -> tuple[Array, Array]:
        u, v = self.scene.arrays(state)
        longer = np.zeros((1, *u.shape[1:]))
        return np.concatenate([u, longer]), np.concatenate([v, longer])

    def _bind(self, u: Array, v: Array, method: Any, dt: float) -> Any:
        counted = method in (self._first, self._others) and dt == self.dt
        inner = self.bound(u[:-1], v[:-1], method, dt)
        return _Sampling(self, inner, u, v) if counted else inner

    def bound(self, u: Array, v: Array, method: Any, dt: float) -> Any:
        """The scene's own loop, or that on a grid, for its rows u and v."""
        if self._grid is None:
            return self.scene.bind(u, v, method, dt)
        return _OnGrid(self.layout, u, v, method, dt, self._grid)

    def keep(self, k: int, u: Array, v: Array) -> None:
        """Keep the state after step number k, if it is one to be kept."""
        if k % self._apart == 0 or k == self.steps:
            sites = self.scene.sites
            self.states[k] = u[:sites].copy(), v[:sites].copy()

    def first_row(self, u: Array, v: Array) -> None:
        """Sample the state before the first step."""
        if self._begin == 0:
            self.rows[0] = self._picked(u, v)

    def advance(self, inner: Any, u: Array, v: Array, k: int, steps: int) -> int:
        """Do steps behind number k, with samples; the number reached."""
        stop = k + steps
        while k < stop:
            to = min(stop, (k // self._apart + 1) * self._apart)
            sampled = self._begin < self.steps and self._begin <= k + 1 and k < self._end
            if not sampled and k + 1 < self._begin < self.steps:
                to = min(to, self._begin - 1)
            if sampled:
                to = min(to, self._end)
                self._sample(inner, u, v, k, to - k)
            else:
                inner.advance(to - k)
            k = to
            self.keep(k, u, v)
        return k

    def _sample(self, inner: Any, u: Array, v: Array, k: int, steps: int) -> None:
        first = k + 1 - self._begin
        rows = self.rows[first : first + steps]
        places, of_u = self.view.places, self.view.of_u
        reverse.sampled(inner, steps, u, v, places, of_u, rows, self.layout.library)

    def again(self, k: int, steps: int) -> tuple[Array, Array]:
        """u and v of the sites some steps after a state that was kept, by the same loop."""
        state = State(*self.states[k])
        u, v = self.scene.arrays(state)
        for method, many in ((self._first, int(k == 0)), (self._others, steps - (k == 0))):
            if many:
                self.bound(u, v, method, self.dt).advance(many)
        return u[: self.scene.sites].copy(), v[: self.scene.sites].copy()


class _Around:
    """What a bound loop tells of the one inside it."""

    _inner: Any

    def forget_range(self) -> None:
        self._inner.forget_range()

    @property
    def range(self) -> Array:
        return self._inner.range

    @property
    def travel(self) -> float:
        return self._inner.travel


class _Sampling(_Around):
    """A bound loop that counts its steps and keeps samples."""

    def __init__(self, forward: Forward, inner: Any, u: Array, v: Array) -> None:
        self._forward, self._inner, self._u, self._v = forward, inner, u, v
        self._count = u.reshape(-1)[-1:]

    def advance(self, steps: int) -> None:
        k, u, v = int(self._count[0]), self._u[:-1], self._v[:-1]
        if k == 0:
            self._forward.keep(0, u, v)
            self._forward.first_row(u, v)
        self._count[0] = self._forward.advance(self._inner, u, v, k, steps)


class _OnGrid(_Around):
    """The loop of a layout on rows of a scene: sites, and behind them what it leaves alone."""

    def __init__(self, layout: Any, u: Array, v: Array, method: Any, dt: float, grid: Any) -> None:
        self._inner = reverse.Back(layout, method, dt, reverse.Totals(layout, 0), grid)
        self._u, self._v = u, v

    def advance(self, steps: int) -> None:
        with self._moved():
            self._inner.advance(steps)

    def sample(self, steps: int, places: Array, of_u: int, rows: Array) -> None:
        """Steps one by one, with samples."""
        with self._moved():
            self._inner.sample(steps, places, of_u, rows)

    @contextmanager
    def _moved(self) -> Iterator[None]:
        sites = self._inner.layout.sites
        self._inner.set(self._u[:sites], self._v[:sites])
        yield
        self._u[:sites], self._v[:sites] = self._inner.state()
