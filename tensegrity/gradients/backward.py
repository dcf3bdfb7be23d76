"""The pass backwards through a run that was done: from its last state to its first.

What a pass returns to is compared with the states kept of the run.  Where round-off has grown, as
it does in chaos, a part is done again from states nearer to each other, computed anew.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.engine.reverse import Back, Layout, Seeds, Totals
from tensegrity.notebook import progress
from tensegrity.scenes.dynamics import dynamics

if TYPE_CHECKING:
    from tensegrity.gradients.forward import Forward
    from tensegrity.typing import Array

LIMIT = 1e-9  # of the largest |u| and |v|: how far off a state may be that is returned to
WORK = 4_000_000  # bonds x stages x steps in one call: some 20 ms


class Backward:
    """Derivatives of objectives, from the end of a run to its start.

    Parameters
    ----------
    forward : Forward
        That was run.
    rows : ndarray, (objectives, steps of the window, places)
        Derivatives by the samples.
    apart : int or None
        Most steps between two states that the pass goes through exactly.

    Attributes
    ----------
    u, v : ndarray, (objectives, sites[, dim])
        Derivatives by the state at the start.
    totals : Totals
    reversal : float
        Largest difference of a state returned to from that of the run [m, m/s].
    """

    def __init__(self, forward: Forward, rows: Array, apart: int | None) -> None:
        self._forward, self._apart = forward, apart
        self._layout: Layout = forward.layout
        self.totals = Totals(self._layout, len(rows))
        self.reversal = 0.0
        kept = list(forward.states.values())
        self._scales = [max(float(np.abs(x[k]).max()) for x in kept) for k in (0, 1)]
        self._seeds = Seeds(rows, forward.view.places, forward.view.of_u, forward._begin)
        grid = forward._grid or (0.0, 0.0)
        self._main = Back(self._layout, forward.method, forward.dt, self.totals, grid)
        self._go()
        sites = self._layout.sites
        self.u, self.v = self._main.ub[:, :sites], self._main.vb[:, :sites]

    def _go(self) -> None:
        forward, main = self._forward, self._main
        last = forward.steps
        main.set(*forward.states[last])
        main.sow(self._seeds, last)
        self._most = max(1, WORK // (dynamics(forward.scene).cost * forward.method.stages))
        with progress(last, "step") as self._bar:
            stops = sorted(forward.states, reverse=True)
            for b, a in pairwise(stops):
                self._carry(a, b)

    def _carry(self, a: int, b: int) -> None:
        """From the state after step b to that after step a, both known."""
        forward, main = self._forward, self._main
        if self._apart is not None and b - a > self._apart:
            stops = [*range(a, b, self._apart), b]
            for before, after in pairwise(stops[:-1]):
                forward.states[after] = forward.again(before, after - before)
            for before, after in zip(stops[-2::-1], stops[:0:-1], strict=True):
                self._steps(before, after)
                self._judge(main, *forward.states[before])
                main.set(*forward.states[before])
            for stop in stops[1:-1]:
                del forward.states[stop]
            return
        kept = [x.copy() for x in self._moving()]
        self._steps(a, b)
        miss = self._miss(main, *forward.states[a])
        if miss <= LIMIT or b - a == 1 or forward._grid is not None:
            self._judge(main, *forward.states[a])
            main.set(*forward.states[a])
            return
        for array, before in zip(self._moving(), kept, strict=True):
            array[:] = before
        middle = (a + b) // 2
        forward.states[middle] = forward.again(a, middle - a)
        main.set(*forward.states[b])
        self._carry(middle, b)
        self._carry(a, middle)
        del forward.states[middle]

    def _moving(self) -> list[Array]:
        return [self._main.ub, self._main.vb, *self.totals.arrays]

    def _steps(self, a: int, b: int) -> None:
        """Undo the steps from b to a."""
        k, main = b, self._main
        while k > a:
            many = min(k - a, self._most)
            main.reverse(many, k, self._seeds, opened=k - many > 0)
            k -= many
            self._bar.update(min(many, self._bar.total - self._bar.n))

    def _miss(self, back: Back, u: Array, v: Array) -> float:
        """Distance from a state of the run, in its largest displacement and velocity."""
        off = zip(back.state(), (u, v), self._scales, strict=True)
        found = max(float(np.abs(x - y).max()) / (scale or 1.0) for x, y, scale in off)
        return found if math.isfinite(found) else math.inf

    def _judge(self, back: Back, u: Array, v: Array) -> None:
        for x, y in zip(back.state(), (u, v), strict=True):
            self.reversal = max(self.reversal, float(np.abs(x - y).max()))
