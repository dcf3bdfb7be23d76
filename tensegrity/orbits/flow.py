"""The flow of a scene over a given time, and its tangents, by compiled loops.

After a run of a splitting, the reverse loop of `tensegrity.engine.reverse` propagates one objective
for each entry of the final state to the start, which gives the rows of the tangent map.  The
stiffnesses of a stage are computed once for all rows.  Dashpots and forces that depend on velocity
cannot be inverted stage by stage: a driven or damped scene is integrated by a Runge-Kutta method,
whose recorded stages the same loop takes in reverse order.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from tensegrity.engine import driven, kernel, methods
from tensegrity.engine.bound import stages
from tensegrity.engine.force_law import largest_decay
from tensegrity.engine.forced import Stages, tangent_springs
from tensegrity.engine.reverse import Layout, ReverseLoop, Totals
from tensegrity.engine.schemes import Splitting
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.forcing import driven_entries, forcing_of
from tensegrity.scenes.scene import Scene
from tensegrity.springs.signals import in_columns
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
    """The map of a scene's state over a given time, in steps of equal length.

    States are flattened; `entries` counts the coordinates of all sites.

    Parameters
    ----------
    scene : Scene
        Neither driven nor damped, with a fixed list of contacts.
    steps : int

    Attributes
    ----------
    steps : int
        May be changed between two runs.
    """

    def __init__(self, scene: Scene, steps: int) -> None:
        of, self.steps, self._shape = dynamics(scene), steps, scene.shape
        self._bonds = of.loop_bonds
        self._u, self._v = of.arrays(scene.at_rest())
        self._loop = kernel.bind(self._u, self._v, self._bonds, METHOD, 1.0, divided=False)
        self._layout = Layout(self._bonds, ((),) * len(self._bonds.laws))
        self._loops: dict[int, ReverseLoop] = {}

    def end(self, u: Array, v: Array, duration: float) -> tuple[Array, Array]:
        """The state after a time.

        Parameters
        ----------
        u, v : ndarray, (entries,)
            Initial state [m], [m/s].
        duration : float
            [s]

        Returns
        -------
        u, v : ndarray, (entries,)
        """
        arrays, sites = (self._u, self._v), self._shape[0]
        for array, values in zip(arrays, (u, v), strict=True):
            array[:sites] = values.reshape(self._shape)
        self._loop.set_step(duration / self.steps)
        self._loop.forget()
        self._loop.advance_open(self.steps, False)
        ends = [array[:sites].reshape(-1).copy() for array in arrays]
        return ends[0], ends[1]

    def tangents(
        self, u: Array, v: Array, duration: float, of_u: bool = True
    ) -> tuple[Array, Array, Array]:
        """u and v after a time [s], and the derivatives of their entries.

        Parameters
        ----------
        u, v : ndarray, (entries,)
            Initial state [m], [m/s].
        duration : float
            [s]
        of_u : bool, optional
            Whether derivatives of the displacements are wanted, besides those of the velocities.

        Returns
        -------
        u, v : ndarray, (entries,)
            Final state.
        tangent : ndarray, (2 entries, 2 entries), or (entries, 2 entries) of velocities alone
            Derivatives of final u, then v, with respect to initial u, then v.
        """
        final, entries = self.end(u, v, duration), len(u)
        rows = entries * (1 + of_u)
        if rows not in self._loops:
            totals = Totals(self._layout, rows)
            self._loops[rows] = ReverseLoop(self._layout, METHOD, 1.0, totals)
        loop, each = self._loops[rows], np.arange(entries)
        for name in ("kicks", "drifts"):
            loop.scene.filled[name][:] = stages(METHOD, duration / self.steps)[name]
        by_u, by_v = (array.reshape(rows, -1) for array in (loop.ub, loop.vb))  # views
        by_u[:], by_v[:] = 0.0, 0.0
        if of_u:
            by_u[each, each] = 1.0
        by_v[rows - entries + each, each] = 1.0
        loop.set(*(x.reshape(loop.u[: self._shape[0]].shape) for x in final))
        loop.reverse(self.steps, self.steps, opened=False)
        return *final, np.hstack([by_u[:, :entries], by_v[:, :entries]])

    @property
    def ranges(self) -> Array:
        """Smallest and largest elongation of each distinct spring in the last run, (springs, 2)."""
        return np.asarray(self._loop.range)


ANGLE = 0.5  # first dt times the bound on the frequency


class DrivenFlow:
    """The map of a driven or damped scene's state from t = 0 over a given time, in equal steps.

    States are flattened; `entries` counts the coordinates of all sites.

    Parameters
    ----------
    scene : Scene
        Its list of contacts fixed.
    steps : int
    duration : float
        Time for which the drives are checked [s].

    Attributes
    ----------
    steps : int
    """

    def __init__(self, scene: Scene, steps: int, duration: float) -> None:
        self.steps, self._of = steps, dynamics(scene)
        self._forcing = forcing_of(scene, duration, as_forces=True)
        self._signals = [driven_entries(scene, prescribed)[1] for prescribed in (True, False)]
        self._u, self._v = self._of.arrays(scene.at_rest())
        self._here = tuple(x[: scene.sites] for x in (self._u, self._v))  # without walls
        self._loop = driven.bind(self._forcing, self._u, self._v, methods.RK8, 1.0)
        self._path = np.zeros((0, 2, scene.sites * scene.dim))

    def first_steps(self, u: Array, v: Array, duration: float) -> int:
        """A first number of steps, within the stability limits at the start.

        Parameters
        ----------
        u, v, duration
            As of `end`.

        Returns
        -------
        int
        """
        u, v = (x.reshape(self._here[0].shape) for x in (u, v))
        frequency = self._of.frequency(self._of.ranges_at(u)) / ANGLE
        decay = largest_decay(self._forcing.applied, self._forcing.bonds, 0.0, u, v)
        return math.ceil(duration * max(frequency, decay / methods.RK8.decay_limit))

    @cached_property
    def _back(self) -> ReverseLoop:
        bonds = self._forcing.bonds
        layout = Layout(bonds, ((),) * len(bonds.laws))
        totals = Totals(layout, 2 * self._path.shape[2])
        loop = ReverseLoop(layout, methods.RK8, 1.0, totals)
        loop.scene.filled["w"].reshape(-1)[self._forcing.moved] = 0.0  # a view
        return loop

    def end(
        self, u: Array, v: Array, duration: float, values: Mapping[str, float] | None = None
    ) -> tuple[Array, Array]:
        """The state after a time.

        Parameters
        ----------
        u, v : ndarray, (entries,)
            Initial state [m], [m/s].
        duration : float
            [s]
        values : dict of str to float, optional
            Other values of parameters of the drives.

        Returns
        -------
        u, v : ndarray, (entries,)
            Velocities of sites whose motion is prescribed are 0.
        """
        motions, forces = ([x.varied(values or {}) for x in some] for some in self._signals)
        varied = replace(self._forcing, motion=in_columns(motions), force=in_columns(forces))
        dt, count = duration / self.steps, self.steps * methods.RK8.stages
        if len(self._path) != count:
            self._path = np.zeros((count, *self._path.shape[1:]))
            self._loop.record_stages(self._path)
        for array, given in zip(self._here, (u, v), strict=True):
            array[:] = given.reshape(array.shape)
        self._loop.set_step(dt)
        self._loop.schedule = Stages(varied, methods.RK8, dt)
        self._loop.go(0, self.steps)
        ends = [array.reshape(-1).copy() for array in self._here]
        return ends[0], ends[1]

    def tangents(
        self,
        u: Array,
        v: Array,
        duration: float,
        values: Mapping[str, float] | None = None,
        by: str | None = None,
    ) -> tuple[Array, Array, Array, Array]:
        """u and v after a time, and the derivatives of their entries.

        Parameters
        ----------
        u, v, duration, values
            As of `end`.
        by : str, optional
            A parameter of the drives.

        Returns
        -------
        u, v : ndarray, (entries,)
            Final state.
        tangent : ndarray, (2 entries, 2 entries)
            Derivatives of final u, then v, with respect to initial u, then v.
        column : ndarray, (2 entries,)
            Derivatives with respect to the parameter, or 0.
        """
        final, entries, dt = self.end(u, v, duration, values), len(u), duration / self.steps
        stages = Stages(self._forcing, methods.RK8, dt)
        at, forcing, loop = stages.times(0, self.steps)[:-1], self._forcing, self._back
        given: dict[str, Any] = {"moved": forcing.moved, "pulled": forcing.forced}
        motions, forces = (
            in_columns([x.varied(values or {}) for x in some], by or "") for some in self._signals
        )
        given |= {"u_by": motions(at, 0), "v_by": motions(at, 1), "pull_by": forces(at, 0)}
        at_u, at_v = self._path[:, 0], self._path[:, 1]
        ends, given["stiff"], given["loss"] = tangent_springs(
            forcing.applied, forcing.bonds, at, at_u, at_v
        )
        by_u, by_v = (array.reshape(2 * entries, -1) for array in (loop.ub, loop.vb))  # views
        by_u[:], by_v[:] = 0.0, 0.0
        each = np.arange(entries)
        by_u[each, each] = by_v[entries + each, each] = 1.0
        column = loop.reverse_stages(methods.RK8, dt, self._path, ends, **given)
        return *final, np.hstack([by_u[:, :entries], by_v[:, :entries]]), column

    @property
    def ranges(self) -> Array:
        """Smallest and largest elongation of each distinct spring in the last run, (springs, 2)."""
        return np.asarray(self._loop.range)

    def rates_at_start(self, duration: float) -> tuple[Array, Array]:
        """Velocities and accelerations at the start of the last run, of the given duration [s]."""
        stages, dt = self._path, duration / self.steps
        gained = stages[1, 1] - stages[0, 1]
        return stages[0, 1].copy(), gained / (dt * methods.RK8.rates[1][0])

    @property
    def displacements(self) -> Array:
        """Displacements at the beginnings of the steps of the last run [m], (steps, entries)."""
        return self._path[:: methods.RK8.stages, 0]
