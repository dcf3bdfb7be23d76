"""A run whose derivatives are wanted, and the pass backwards through it, to its first state.

The run is a march, of which samples and some states are observed.  What the pass returns to is
compared with these states.  Where round-off has grown, as it does in chaos, a part is done again
from states nearer to each other, computed anew.
"""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from functools import cache, partial
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.engine import kernel
from tensegrity.engine.march import Wanted
from tensegrity.engine.reverse import Back, Layout, OutputCotangents, Totals
from tensegrity.notebook import progress
from tensegrity.runs.march import march
from tensegrity.scenes.scene import State

if TYPE_CHECKING:
    from typing import Any

    from tensegrity.engine.bonds import Bonds
    from tensegrity.engine.methods import Splitting
    from tensegrity.gradients.samples import Samples
    from tensegrity.runs.problem import Problem
    from tensegrity.runs.run import Run
    from tensegrity.typing import Array

    Pair = tuple[Array, Array]
    Grid = tuple[float, float]

LIMIT = 1e-9  # of the largest |u| and |v|: how far off a state may be that is returned to
WORK = 4_000_000  # bonds x stages x steps in one call: some 20 ms


class Forward:
    """A run, its samples, and some of its states: an observer of its march.

    Parameters
    ----------
    problem : Problem
        If it binds a loop of its own, then one whose moves are rounded to a grid.
    steps : int
    samples : Samples
        What is sampled.
    window : (int, int)
        After which steps, from and to.
    stride : int
        Steps between two states that are kept, beside the first and the last.

    Attributes
    ----------
    rows : ndarray, (steps of the window, places)
    closing : ndarray, (steps of the window,)
        Times that velocities in the rows lack a kick for [s].
    states : dict of int to (ndarray, ndarray)
        u and v of the sites, as the loop had them after that number of steps.
    """

    def __init__(
        self, problem: Problem, steps: int, samples: Samples, window: tuple[int, int], stride: int
    ) -> None:
        method: Any = problem.method
        self._problem, self._steps, self._dt = problem, steps, problem.t_end / max(steps, 1)
        at = np.arange(window[0], window[1] + 1)
        self.rows = np.empty((len(at), len(samples.places)))
        self.closing = np.where(at > 0, method.kicks[-1] * self._dt, 0.0)
        stops = np.unique(np.append(np.arange(0, steps + 1, stride), steps))
        u, v = np.empty((2, len(stops), *problem.scene.shape))
        self.states = {k: (u[i], v[i]) for i, k in enumerate(stops.tolist())}
        sampled = Wanted(at, self.rows, places=samples.places, of_u=samples.of_u)
        self._wanted = sampled, Wanted(stops, u, v, raw=True)
        self._begun = self._ended = [0, 0]

    def run(self) -> Run:
        """Do it."""
        run = march(self._problem, self._steps, observers=[self]).run()
        return run if self._problem.bind is None else replace(run, impulse=None)

    def wanted(self, end: int) -> list[Wanted]:
        """Samples of the window and states, as the loop has them; see `runs.record.Samples`."""
        self._ended = [int(one.at.searchsorted(end, side="right")) for one in self._wanted]
        parts = zip(self._wanted, map(slice, self._begun, self._ended), strict=True)
        each = (
            Wanted(x.at[here], x.u[here], None if x.v is None else x.v[here], *x[3:])
            for x, here in parts
        )
        return [one for one in each if len(one.at)]

    def take(self, motion: Any) -> None:
        """Count what was got."""
        self._begun = self._ended

    def again(self, k: int, steps: int) -> Pair:
        """u and v of the sites some steps after a state that was kept, by the same loop."""
        of, bind = self._problem.dynamics, self._problem.bind
        u, v = of.arrays(State(*self.states[k]))
        (bind or of.bind)(u, v, self._problem.method, self._dt).advance_open(steps, k > 0)
        return u[: of.sites].copy(), v[: of.sites].copy()


class Backward:
    """The pass from the end of a run to its start, bound once for runs of one layout.

    Parameters
    ----------
    layout : Layout
    method : Splitting
    dt : float
        [s]
    objectives : int
    grid : (float, float), or None
        What rounded moves of u and v.

    Attributes
    ----------
    u, v : ndarray, (objectives, sites[, dim])
        Derivatives by the state at the start.
    totals : Totals
    reversal : float
        Largest difference of a state returned to from that of the run [m, m/s].
    largest : (float, float)
        |u| and |v| in the states known of the last run.
    """

    def __init__(
        self,
        layout: Layout,
        method: Splitting,
        dt: float,
        objectives: int,
        grid: Grid | None = None,
    ) -> None:
        self.totals = totals = Totals(layout, objectives)
        self.reversal, self._exact = 0.0, grid is not None
        self._main = Back(layout, method, dt, totals, grid or (0.0, 0.0))
        self._sums = [self._main.ub, self._main.vb, *totals.arrays]
        self._most = max(1, WORK // (max(1, len(layout.bonds.group)) * method.stages))
        self.u, self.v = (x[:, : layout.sites] for x in (self._main.ub, self._main.vb))

    def retune(self, bonds: Bonds) -> None:
        """Begin anew for a run with other masses and parameters; see `engine.reverse.Back`."""
        self._main.retune(bonds)

    def go(
        self,
        states: dict[int, Pair],
        cotangents: OutputCotangents,
        again: Any = None,
        stride: int | None = None,
    ) -> None:
        """Carry derivatives to the start.

        Parameters
        ----------
        states : dict of int to (ndarray, ndarray)
            Known of the run, by numbers of steps: the last, and those that it returns to.
        cotangents : Seeds
            What objectives have to do with states.
        again : callable (k, steps) -> (u, v), optional
            Computes the state some steps after one that is known; needed where others are known
            than the last.
        stride : int, optional
            Most steps between two states that are returned to.
        """
        self._states, self._cotangents, self._again = states, cotangents, again
        u, v = (max(float(np.abs(x[k]).max()) for x in states.values()) for k in (0, 1))
        self.largest = u, v
        stops = sorted(states)
        last, main = stops[-1], self._main
        main.set(*states[last])
        main.add_cotangents(cotangents, last)
        with progress(last, "step") if last > self._most else nullcontext() as self._bar:
            for a, b in [*pairwise(stops)][::-1]:
                self._through([*range(a, b, stride or b - a), b])
            self._undo(0, stops[0])  # to nothing that is known

    def _through(self, stops: list[int]) -> None:
        """From the state after the last of these steps to that after the first, both known; a part
        where it strays is gone through again in two."""
        parts = list(pairwise(stops))
        for a, b in parts[:-1]:
            self._states[b] = self._again(a, b - a)
        for a, b in parts[::-1]:
            before = [x.copy() for x in self._sums]
            self._undo(a, b)
            states = zip(self._main.state(), self._states[a], strict=True)
            off = [float(np.abs(x - y).max()) for x, y in states]
            is_near = np.max(np.divide(off, [x or 1.0 for x in self.largest])) <= LIMIT
            if is_near or b - a == 1 or self._exact:
                self.reversal = max(self.reversal, *off)
                self._main.set(*self._states[a])
                continue
            for array, values in zip(self._sums, before, strict=True):
                array[:] = values
            self._main.set(*self._states[b])
            self._through([a, (a + b) // 2, b])
        for stop in stops[1:-1]:
            del self._states[stop]

    def _undo(self, a: int, b: int) -> None:
        """The steps from b to a."""
        while b > a:
            many = min(b - a, self._most)
            self._main.reverse(many, b, self._cotangents, opened=b - many > 0)
            b -= many
            if self._bar is not None:
                self._bar.update(min(many, self._bar.total - self._bar.n))


class Repeated:
    """A run of a line of one law that is done over and over, with other masses and parameters, and
    its passes backwards: all is bound once, and nothing is looked after.

    Parameters
    ----------
    bonds : Bonds
        Others are in the same runs.
    method : Splitting
    dt : float
        [s]
    steps : int
    place : int
        Site whose displacement is sampled.
    wanted : tuple of int
        Numbers of the law's parameters by which there are derivatives.
    """

    def __init__(
        self, bonds: Bonds, method: Splitting, dt: float, steps: int, place: int, wanted: Any
    ) -> None:
        self._bonds, self._places, self._steps = bonds, np.array([place]), steps
        self._u, self._v = np.zeros((2, len(bonds.inverse_mass)))
        self._loop = kernel.bind(self._u, self._v, bonds, method, dt)
        self._rows = np.empty((steps, 1))
        self._samples = Wanted(np.arange(1, steps + 1), self._rows, places=self._places, of_u=1)
        layout = Layout(bonds, (wanted,))
        self._backward = cache(partial(Backward, layout, method, dt, grid=None))

    def run(self, bonds: Bonds, u: Any, v: Any) -> Array:
        """Displacement of the place after each step of a run from u and v; (steps,), until the
        next."""
        self._bonds, self._u[:], self._v[:] = bonds, u, v
        self._loop.retune(bonds)
        self._loop.go(0, self._steps, [self._samples])
        return self._rows[:, 0]

    def back(self, by_rows: Array) -> Totals:
        """Derivatives of objectives by what the last run depends on, until the next; of those by
        the displacements that `run` gave, (objectives, steps)."""
        found = self._backward(objectives=len(by_rows))
        found.retune(self._bonds)
        states = {self._steps: (self._u, self._v)}
        found.go(states, OutputCotangents(by_rows[..., None], self._places, 1, 1))
        return found.totals
