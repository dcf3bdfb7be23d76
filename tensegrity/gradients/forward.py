"""The run whose derivatives are wanted: a march, of which samples and states are observed."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.engine.march import Wanted
from tensegrity.engine.reverse import OnGrid
from tensegrity.runs.march import march
from tensegrity.runs.problem import Problem
from tensegrity.runs.record import Record
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.scene import State

if TYPE_CHECKING:
    from collections.abc import Sequence
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
        self._begin, self._end = window
        self.rows = np.empty((self._end - self._begin + 1, len(view.places)))
        at = np.arange(self._begin, self._end + 1)
        self.closing = np.where(at > 0, method.kicks[-1] * dt, 0.0)
        self.states: dict[int, tuple[Array, Array]] = {}
        self.start = state

    def run(self, t_end: float) -> Run:
        """Do it."""
        record = Record(every=max(1, -(-self.steps // ROWS)))
        bind = None if self._grid is None else self._bind
        problem = Problem(self.scene, self.start, t_end, self.method, record, bind=bind)
        found = march(problem, self.steps, observers=(_Picks(self), _States(self)))
        run = found.run()
        return run if self._grid is None else replace(run, impulse=None)

    def _bind(self, u: Array, v: Array, method: Splitting, dt: float) -> OnGrid:
        assert self._grid is not None
        return OnGrid(self.layout, u, v, method, dt, self._grid)

    def again(self, k: int, steps: int) -> tuple[Array, Array]:
        """u and v of the sites some steps after a state that was kept, by the same loop."""
        of = dynamics(self.scene)
        u, v = of.arrays(State(*self.states[k]))
        bind = of.bind if self._grid is None else self._bind
        bind(u, v, self.method, self.dt).advance_open(steps, k > 0)
        return u[: self.scene.sites].copy(), v[: self.scene.sites].copy()


class _Picks:
    """What is sampled, after each step of the window."""

    def __init__(self, forward: Forward) -> None:
        self._forward, self._next, self._stop = forward, forward._begin, forward._begin

    def wanted(self, end: int) -> Sequence[Wanted]:
        """As of `runs.record.Samples`."""
        of, first = self._forward, self._next
        self._stop = max(first, min(end, of._end) + 1)
        rows = of.rows[first - of._begin : self._stop - of._begin]
        at, view = np.arange(first, self._stop), of.view
        return [Wanted(at, rows, places=view.places, of_u=view.of_u)] if len(at) else ()

    def take(self, motion: Any) -> None:
        """Count what was got."""
        self._next = self._stop


class _States:
    """Evenly spaced states as the loop has them, the first and the last among them."""

    def __init__(self, forward: Forward) -> None:
        self._forward, steps = forward, forward.steps
        self._at = np.unique(np.append(np.arange(0, steps + 1, forward._apart), steps))

    def wanted(self, end: int) -> Sequence[Wanted]:
        """As of `runs.record.Samples`."""
        at = self._at[len(self._forward.states) : np.searchsorted(self._at, end, side="right")]
        u, v = np.empty((2, len(at), *self._forward.scene.shape))
        self._got = Wanted(at, u, v, raw=True)
        return [self._got] if len(at) else ()

    def take(self, motion: Any) -> None:
        """Keep what was got."""
        states = zip(self._got.at.tolist(), self._got.u, self._got.v, strict=True)
        self._forward.states |= {k: (u, v) for k, u, v in states}
