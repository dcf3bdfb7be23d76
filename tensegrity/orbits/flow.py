"""The flow of a chain over a given time, and its tangents, by compiled loops.

A run of a splitting is followed by the reverse loop of `tensegrity.engine.reverse`, with one
objective for each entry of the final state: what it propagates to the start are the rows of the
tangent map.  The stiffnesses of a stage are computed once for all rows.
"""

from __future__ import annotations

import numpy as np

from tensegrity.engine import kernel, methods
from tensegrity.engine.bound import stages
from tensegrity.engine.reverse import Layout, ReverseLoop, Totals
from tensegrity.engine.schemes import Splitting
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.scene import Scene
from tensegrity.typing import Array

_BASE = methods.METHODS["rkn6"]
assert isinstance(_BASE, Splitting)
# The closing kick is a stage of its own, so that the state after a step is that of the loop.
METHOD = Splitting(
    "rkn6, closed",
    order=_BASE.order,
    default_fraction=_BASE.default_fraction,
    kicks=(*_BASE.kicks, 0.0),
    drifts=(*_BASE.drifts, 0.0),
)


class Flow:
    """The map of a chain's state over a given time, in steps of equal length.

    Parameters
    ----------
    scene : Chain
        Neither driven nor damped.
    steps : int

    Attributes
    ----------
    steps : int
        May be changed between two runs.
    """

    def __init__(self, scene: Scene, steps: int) -> None:
        self.steps, self._bonds = steps, dynamics(scene).loop_bonds
        self._u, self._v = np.zeros((2, scene.sites))
        self._loop = kernel.bind(self._u, self._v, self._bonds, METHOD, 1.0, divided=False)
        self._layout = Layout(self._bonds, ((),) * len(self._bonds.laws))
        self._loops: dict[int, ReverseLoop] = {}

    def end(self, u: Array, v: Array, duration: float) -> tuple[Array, Array]:
        """The state after a time.

        Parameters
        ----------
        u, v : ndarray, (sites,)
            Initial state [m], [m/s].
        duration : float
            [s]

        Returns
        -------
        u, v : ndarray, (sites,)
        """
        self._u[:], self._v[:] = u, v
        self._loop.set_step(duration / self.steps)
        self._loop.forget_range()
        self._loop.advance_open(self.steps, False)
        return self._u.copy(), self._v.copy()

    def tangents(
        self, u: Array, v: Array, duration: float, of_u: bool = True
    ) -> tuple[Array, Array, Array]:
        """u and v after a time [s], and the derivatives of the entries of both.

        Parameters
        ----------
        u, v : ndarray, (sites,)
            Initial state [m], [m/s].
        duration : float
            [s]
        of_u : bool, optional
            Whether derivatives of the displacements are wanted, besides those of the velocities.

        Returns
        -------
        u, v : ndarray, (sites,)
            Final state.
        tangent : ndarray, (2 sites, 2 sites), or (sites, 2 sites) of velocities alone
            Derivatives of final u, then v, with respect to initial u, then v.
        """
        final, sites = self.end(u, v, duration), len(u)
        rows = sites * (1 + of_u)
        if rows not in self._loops:
            totals = Totals(self._layout, rows)
            self._loops[rows] = ReverseLoop(self._layout, METHOD, 1.0, totals)
        loop, each = self._loops[rows], np.arange(sites)
        for name in ("kicks", "drifts"):
            loop.scene.filled[name][:] = stages(METHOD, duration / self.steps)[name]
        loop.ub[:], loop.vb[:] = 0.0, 0.0
        if of_u:
            loop.ub[each, each] = 1.0
        loop.vb[rows - sites + each, each] = 1.0
        loop.set(*final)
        loop.reverse(self.steps, self.steps, opened=False)
        return *final, np.hstack([loop.ub[:, :sites], loop.vb[:, :sites]])

    @property
    def ranges(self) -> Array:
        """Smallest and largest elongation of each distinct spring in the last run, (springs, 2)."""
        return np.asarray(self._loop.range)
