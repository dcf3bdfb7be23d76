"""The reverse pass through a run of a chain with drives, dashpots or forces of velocity.

Their steps, of a Runge-Kutta method, cannot be inverted: the stages between two stored states are
computed again and recorded, and the adjoint is applied to them in reverse order.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.engine import driven
from tensegrity.engine.forced import BOND, SITE, Stages, pull_back, tangent_springs
from tensegrity.engine.reverse import Layout, OutputCotangents, ReverseLoop, Totals
from tensegrity.errors import TensegrityError
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.force import applied_forces
from tensegrity.scenes.forcing import forcing_of
from tensegrity.scenes.network import Network

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from tensegrity.gradients.samples import TraceSamples
    from tensegrity.typing import Array, Indices

    Pair = tuple[Array, Array]

NUMBERS = 4_000_000  # most numbers of the stages that are recorded together
SAME = 1e-12  # relative difference of a parameter of a spring and of the same one in a force


class ForcedBackward:
    """The reverse pass from the end of a run to its start, with the attributes of `Backward`.

    Parameters
    ----------
    scene : Chain
    wanted : tuple of tuple of int
        As of `Layout`.
    method : Nystrom
    steps : int
        Number of steps of the run.
    dt : float
        [s]

    Attributes
    ----------
    layout : Layout
    stride : int
        Most steps between two stored states.
    by_parameters : list of ndarray, (objectives, parameters, places)
        Derivatives by the parameters of each force.
    """

    def __init__(self, scene: Any, wanted: Any, method: Any, steps: int, dt: float) -> None:
        self._forcing = forcing_of(scene, steps * dt, as_forces=True)
        self._own = len(dynamics(scene).further_forces)
        free = self._forcing.bonds.inverse_mass.copy()
        free[self._forcing.moved] = 0.0
        self.layout = Layout(replace(self._forcing.bonds, inverse_mass=free), wanted)
        self._method, self._dt, self._shape = method, dt, (2, scene.sites)
        places = sum(len(one.places) for one in self._forcing.applied)
        self.stride = max(1, NUMBERS // (method.stages * 4 * (scene.sites + places)))
        u, v = np.zeros(self._shape)
        self._loop = driven.bind(self._forcing, u, v, method, dt)
        self._stages = Stages(self._forcing, method, dt)
        self.reversal = 0.0

    def complete(self, samples: TraceSamples, t: Array, rows: Array) -> Indices:
        """Insert the velocities of prescribed sites into samples.

        Parameters
        ----------
        samples : TraceSamples
        t : ndarray, (rows,)
            Instants [s].
        rows : ndarray, (rows, columns)
            Displacements, then velocities, of the sites of the samples; changed.

        Returns
        -------
        ndarray of int
            Columns of prescribed sites.
        """
        moved, count, places = self._forcing.moved, samples.u_count, samples.places
        if not len(moved):
            return np.zeros(0, dtype=int)
        speeds = dict(zip(moved.tolist(), self._forcing.motion(t, 1).T, strict=True))
        for column, place in enumerate(places[count:].tolist(), start=count):
            if place in speeds:
                rows[:, column] = speeds[place]
        return np.flatnonzero(np.isin(places, moved))

    def go(self, states: dict[int, Pair], cotangents: OutputCotangents, objectives: int) -> None:
        """Propagate the derivatives to the start of the run.

        Parameters
        ----------
        states : dict of int to (ndarray, ndarray)
            Stored states by number of steps, including the first and the last.
        cotangents : OutputCotangents
            Derivatives of the objectives with respect to the states.
        objectives : int
        """
        forcing, layout, sites = self._forcing, self.layout, self._shape[1]
        self.totals = totals = Totals(layout, objectives)
        back = ReverseLoop(layout, self._method, self._dt, totals)
        self.largest = tuple(
            max(float(np.abs(x[k]).max()) for x in states.values()) for k in (0, 1)
        )
        self.by_parameters: list[Array] = [np.zeros((objectives, *one.values.shape))
                                           for one in forcing.applied]  # fmt: skip
        stops = sorted(states)
        back.add_cotangents(cotangents, stops[-1])
        for a, b in [*pairwise(stops)][::-1]:
            t, path = self._recorded(a, b, states)
            ends, stiff, loss = tangent_springs(
                forcing.applied, layout.bonds, t, path[:, 0], path[:, 1]
            )
            given: dict[str, Any] = {"moved": forcing.moved, "pulled": forcing.forced}
            given |= {f"{x}_by": np.zeros((len(t), len(forcing.moved))) for x in "uv"}
            given["pull_by"] = np.zeros((len(t), len(forcing.forced)))
            slopes = np.zeros((len(t), *back.ub.shape))
            back.reverse_stages(
                self._method, self._dt, path, ends, b, cotangents,
                stiff=stiff, loss=loss, slopes=slopes, **given,
            )  # fmt: skip
            slopes = slopes[..., :sites]
            found, by_weight = pull_back(
                forcing.applied, layout.bonds, t, path[:, 0], path[:, 1], slopes
            )
            for total, part in zip(self.by_parameters, found, strict=True):
                total += part
            if len(forcing.forced):
                of_drives = np.einsum(
                    "toe,te->oe", slopes[..., forcing.forced], forcing.force(t, 0)
                )
                np.add.at(by_weight.T, forcing.forced, of_drives.T)
            totals.w[:] += by_weight
        self.u, self.v = (x[:, :sites] for x in (back.ub, back.vb))
        for array in (self.u, self.v, totals.w):
            array[:, forcing.moved] = 0.0

    def _recorded(self, a: int, b: int, states: dict[int, Pair]) -> tuple[Array, Array]:
        """Instants and states of the stages from step a to step b."""
        path = np.empty(((b - a) * self._method.stages, *self._shape))
        self._loop.record_stages(path)
        for row, given in zip((self._loop.u, self._loop.v), states[a], strict=True):
            row[:] = given
        self._loop.go(a, b)
        for row, given in zip((self._loop.u, self._loop.v), states[b], strict=True):
            self.reversal = max(self.reversal, float(np.abs(row - given).max()))
        return self._stages.times(a, b - a)[:-1], path

    def named(self, k: int) -> dict[str, Array]:
        """Derivatives of objective k by each parameter of the forces, (bonds,) or (sites,)."""
        found: dict[str, Array] = {}
        own = self._forcing.applied[: self._own]  # without those of dashpots
        for one, by in zip(own, self.by_parameters, strict=False):
            count = self._shape[1] - (one.law.on == BOND)
            for name, values in zip(map(str, one.law.parameters), by[k], strict=True):
                found.setdefault(name, np.zeros(count))[one.places] += values
        return found


def check_forced(scene: Any, exact: bool, traces: Sequence[Any]) -> None:
    """Refuse driven scenes whose gradient is not available.

    Parameters
    ----------
    scene : Scene
    exact : bool
        Whether exact increments are requested.
    traces : sequence of Trace
        Of the objectives.

    Raises
    ------
    TensegrityError
    """
    what = ""
    if isinstance(scene, Network):
        what = "a network that is driven or damped, or has further forces"
    elif scene.tune:
        what = "springs that change in time"
    elif exact:
        what = "exact increments of a scene whose stages cannot be inverted"
    if what:
        raise TensegrityError(f"{what} has no gradient")
    bonds = {k for one in dynamics(scene).further_forces if one.on != "sites"
             for k in (one.at if one.at is not None else range(scene.sites - 1))}  # fmt: skip
    stored = any(one.stores for one in dynamics(scene).further_forces)
    for trace in traces:
        ends = {0, scene.sites - 2} if trace.kind == "wall" else {trace.where}
        if trace.kind in ("bond", "wall") and ends & bonds:
            raise TensegrityError(
                f"{trace!r} is the load of a bond in which a further force acts: no gradient"
            )
        if trace.kind == "energy" and stored:
            raise TensegrityError(f"{trace!r} leaves out springs to the ground: no gradient")


def parameters_of(scene: Any) -> dict[str, str]:
    """Names of the parameters of the forces of a chain, and what they act on.

    Raises
    ------
    TensegrityError
        A parameter acts on sites and in bonds, or has different values in a spring and a force.
    """
    of = dynamics(scene)
    found: dict[str, str] = {}
    symbols = {str(s): s for law in of.springs.table[0] for s in law.parameters}
    for one, applied in zip(of.further_forces, applied_forces(scene), strict=False):
        for name, values in zip(one.parameters, applied.values, strict=True):
            on = found.setdefault(name, applied.law.on)
            shared = on == SITE and name in symbols
            if on == BOND and name in symbols:
                given = _of_springs(of, name)[applied.places]
                shared = bool(np.any(np.abs(given - values) > SAME * np.abs(values)))
            if on != applied.law.on or shared:
                raise TensegrityError(
                    f"{name} names parameters of different things in the springs and forces of "
                    "this chain: rename one"
                )
    return found


def _of_springs(of: Any, name: str) -> Array:
    """Values of a symbol of the springs' laws, (bonds,); NaN where they have none."""
    laws, law, parameters = of.springs.table
    values = np.full(len(law), np.nan)
    for number, one in enumerate(laws):
        for k, symbol in enumerate(one.parameters):
            if str(symbol) == name:
                values[law == number] = parameters[law == number, k]
    return values[of.springs.group]
