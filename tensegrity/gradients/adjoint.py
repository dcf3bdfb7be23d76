"""The forward run of a gradient, and the reverse pass through it to its initial state.

The forward run is a march that is observed at samples and at some states.  The states recomputed by
the reverse pass are compared with these.  Where round-off has grown, as in chaotic motion, a part
of the pass is repeated from more closely spaced states, which are computed again.
"""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from functools import cache, partial
from itertools import pairwise
from typing import Any

import numpy as np

from tensegrity.engine import kernel
from tensegrity.engine.bonds import Bonds
from tensegrity.engine.march import Wanted
from tensegrity.engine.methods import Splitting
from tensegrity.engine.reverse import Layout, OutputCotangents, ReverseLoop, Totals
from tensegrity.gradients.samples import TraceSamples
from tensegrity.notebook import progress
from tensegrity.runs.march import march
from tensegrity.runs.problem import Problem
from tensegrity.runs.run import Run
from tensegrity.scenes.scene import State
from tensegrity.typing import Array

Pair = tuple[Array, Array]

LIMIT = 1e-9  # largest error of a recomputed state over the largest |u| and |v|
WORK = 4_000_000  # bonds x stages x steps of one call: about 20 ms


class Forward:
    """The forward run: an observer of its march that stores samples and some states.

    Parameters
    ----------
    problem : Problem
        With a loop of its own (`bind`) if the scene is driven.
    steps : int
        Number of steps of the run.
    samples : TraceSamples
        The entries to sample.
    window : (int, int)
        First and last step after which they are sampled.
    stride : int
        Steps between two stored states; the first and the last state are stored too.

    Attributes
    ----------
    rows : ndarray, (steps of the window, places)
        Samples.
    closing : ndarray, (steps of the window,)
        Duration of the closing kick that velocities in the rows lack [s].
    states : dict of int to (ndarray, ndarray)
        u and v of the sites in the loop after that number of steps, before the closing kick.
    """

    def __init__(
        self,
        problem: Problem,
        steps: int,
        samples: TraceSamples,
        window: tuple[int, int],
        stride: int,
    ) -> None:
        method: Any = problem.method
        self._problem, self._steps, self._dt = problem, steps, problem.t_end / max(steps, 1)
        at = np.arange(window[0], window[1] + 1)
        self.rows = np.empty((len(at), len(samples.places)))
        last = method.kicks[-1] if isinstance(method, Splitting) else 0.0
        self.closing = np.where(at > 0, last * self._dt, 0.0)
        stops = np.unique(np.append(np.arange(0, steps + 1, stride), steps))
        u, v = np.empty((2, len(stops), *problem.scene.shape))
        self.states = {k: (u[i], v[i]) for i, k in enumerate(stops.tolist())}
        sampled = Wanted(at, self.rows, places=samples.places, u_count=samples.u_count)
        self._wanted = sampled, Wanted(stops, u, v, raw=True)
        self._begun = self._ended = [0, 0]

    def run(self) -> Run:
        """Do the run."""
        run = march(self._problem, self._steps, observers=[self]).run()
        return run if self._problem.bind is None else replace(run, impulse=None)

    def wanted(self, end: int) -> list[Wanted]:
        """Samples within the window and stored states, before the closing kick; an `Observer`."""
        self._ended = [int(one.at.searchsorted(end, side="right")) for one in self._wanted]
        parts = zip(self._wanted, map(slice, self._begun, self._ended), strict=True)
        each = (
            Wanted(x.at[here], x.u[here], None if x.v is None else x.v[here], *x[3:])
            for x, here in parts
        )
        return [one for one in each if len(one.at)]

    def take(self, motion: Any) -> None:
        """Accept the states of the last attempt."""
        self._begun = self._ended

    def recompute(self, k: int, steps: int) -> Pair:
        """u and v of the sites some steps after the stored state number k, by the same loop."""
        of, bind = self._problem.dynamics, self._problem.bind
        u, v = of.arrays(State(*self.states[k]))
        (bind or of.bind)(u, v, self._problem.method, self._dt).advance_open(steps, k > 0)
        return u[: of.sites].copy(), v[: of.sites].copy()


class Backward:
    """The reverse pass from the end of a run to its start, prepared once for runs of one layout.

    Parameters
    ----------
    layout : Layout
    method : Splitting
    dt : float
        Step [s].
    objectives : int
        Number of objectives.

    Attributes
    ----------
    u, v : ndarray, (objectives, sites[, dim])
        Derivatives with respect to the initial state.
    totals : Totals
        Derivatives with respect to masses, parameters and elongations.
    reversal : float
        Largest difference between a recomputed state and that of the run [m, m/s].
    largest : (float, float)
        Largest |u| and |v| in the stored states of the last run.
    """

    def __init__(self, layout: Layout, method: Splitting, dt: float, objectives: int) -> None:
        self.totals, self.reversal = (totals := Totals(layout, objectives)), 0.0
        self._main = ReverseLoop(layout, method, dt, totals)
        self._sums = [self._main.ub, self._main.vb, *totals.arrays]
        self._most = max(1, WORK // (max(1, len(layout.bonds.group)) * method.stages))
        self.u, self.v = (x[:, : layout.sites] for x in (self._main.ub, self._main.vb))

    def retune(self, bonds: Bonds) -> None:
        """Restart for a run with other masses and parameters; see `ReverseLoop.retune`."""
        self._main.retune(bonds)

    def go(
        self,
        states: dict[int, Pair],
        cotangents: OutputCotangents,
        recompute: Any = None,
        stride: int | None = None,
    ) -> None:
        """Propagate the derivatives to the start of the run.

        Parameters
        ----------
        states : dict of int to (ndarray, ndarray)
            Stored states of the run by number of steps: the last, and those for comparison.
        cotangents : OutputCotangents
            Derivatives of the objectives with respect to the states.
        recompute : callable (k, steps) -> (u, v), optional
            Computes the state some steps after a stored one; needed if there is more than the last.
        stride : int, optional
            Largest number of steps between two states of the run that the pass starts from.
        """
        self._states, self._cotangents, self._recompute = states, cotangents, recompute
        u, v = (max(float(np.abs(x[k]).max()) for x in states.values()) for k in (0, 1))
        self.largest = u, v
        stops = sorted(states)
        last, main = stops[-1], self._main
        main.set(*states[last])
        main.add_cotangents(cotangents, last)
        with progress(last, "step") if last > self._most else nullcontext() as self._bar:
            for a, b in [*pairwise(stops)][::-1]:
                self._reverse_between([*range(a, b, stride or b - a), b])
            self._reverse_steps(0, stops[0])  # there is no state to compare with

    def _reverse_between(self, stops: list[int]) -> None:
        """Reverse from the state after the last of these steps to that after the first, both known;
        a part where the pass deviates from the run is divided in two and repeated."""
        parts = list(pairwise(stops))
        for a, b in parts[:-1]:
            self._states[b] = self._recompute(a, b - a)
        for a, b in parts[::-1]:
            before = [x.copy() for x in self._sums]
            self._reverse_steps(a, b)
            states = zip(self._main.state(), self._states[a], strict=True)
            off = [float(np.abs(x - y).max()) for x, y in states]
            is_near = np.max(np.divide(off, [x or 1.0 for x in self.largest])) <= LIMIT
            if is_near or b - a == 1:
                self.reversal = max(self.reversal, *off)
                self._main.set(*self._states[a])
                continue
            for array, values in zip(self._sums, before, strict=True):
                array[:] = values
            self._main.set(*self._states[b])
            self._reverse_between([a, (a + b) // 2, b])
        for stop in stops[1:-1]:
            del self._states[stop]

    def _reverse_steps(self, a: int, b: int) -> None:
        """Reverse the steps from b to a."""
        while b > a:
            many = min(b - a, self._most)
            self._main.reverse(many, b, self._cotangents, opened=b - many > 0)
            b -= many
            if self._bar is not None:
                self._bar.update(min(many, self._bar.total - self._bar.n))


class RepeatedRun:
    """A run of a chain of one law, repeated with other masses and parameters, and its reverse
    passes; loops are prepared once, and neither stability nor domains are checked.

    Parameters
    ----------
    bonds : Bonds
        Those of later runs must have the same `runs`.
    method : Splitting
    dt : float
        Step [s].
    steps : int
        Number of steps.
    place : int
        Site whose displacement is sampled.
    wanted : tuple of int
        Indices of the parameters with respect to which derivatives are computed.
    """

    def __init__(
        self, bonds: Bonds, method: Splitting, dt: float, steps: int, place: int, wanted: Any
    ) -> None:
        self._bonds, self._places, self._steps = bonds, np.array([place]), steps
        self._u, self._v = np.zeros((2, len(bonds.inverse_mass)))
        self._loop = kernel.bind(self._u, self._v, bonds, method, dt)
        self._rows = np.empty((steps, 1))
        self._samples = Wanted(np.arange(1, steps + 1), self._rows, places=self._places, u_count=1)
        layout = Layout(bonds, (wanted,))
        self._backward = cache(partial(Backward, layout, method, dt))

    def run(self, bonds: Bonds, u: Any, v: Any) -> Array:
        """Do a run.

        Parameters
        ----------
        bonds : Bonds
        u, v : ndarray, (sites,)
            Initial state [m], [m/s].

        Returns
        -------
        ndarray, (steps,)
            Displacement of the sampled site after each step [m]; valid until the next run.
        """
        self._bonds, self._u[:], self._v[:] = bonds, u, v
        self._loop.retune(bonds)
        self._loop.go(0, self._steps, [self._samples])
        return self._rows[:, 0]

    def pullback(self, by_rows: Array) -> Totals:
        """Derivatives of objectives with respect to all the last run depends on, from those with
        respect to the displacements that `run` returned, (objectives, steps); valid until the next
        run."""
        backward = self._backward(objectives=len(by_rows))
        backward.retune(self._bonds)
        states = {self._steps: (self._u, self._v)}
        backward.go(states, OutputCotangents(by_rows[..., None], self._places, 1, 1))
        return backward.totals
