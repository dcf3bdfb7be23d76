"""The reverse pass through a run of a scene with drives, dashpots or forces of velocity.

Their steps, of a Runge-Kutta method, cannot be inverted: the stages between two stored states are
computed again and recorded, and the adjoint is applied to them in reverse order.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from tensegrity.engine import driven
from tensegrity.engine.force_law import BOND, SITE
from tensegrity.engine.forced import Stages, pull_back, tangent_springs
from tensegrity.engine.reverse import Layout, OutputCotangents, ReverseLoop, Totals
from tensegrity.errors import TensegrityError
from tensegrity.gradients.samples import TraceSamples
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.force import place_counts
from tensegrity.scenes.forcing import driven_entries, forcing_of
from tensegrity.springs.signals import in_columns
from tensegrity.typing import Array

Pair = tuple[Array, Array]

NUMBERS = 4_000_000  # most numbers of the stages that are recorded together
SAME = 1e-12  # relative difference of a parameter of a spring and of the same one in a force
DRIVE = "DRIVE"  # what parameters of drives act on, besides SITE and BOND


class ForcedBackward:
    """The reverse pass from the end of a run to its start, with the attributes of `Backward`.

    Parameters
    ----------
    scene : Scene
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
    by_drives : ndarray, (objectives, parameters of all drives)
        Derivatives by these; of drives of several sites each on its own.
    """

    def __init__(self, scene: Any, wanted: Any, method: Any, steps: int, dt: float) -> None:
        self._forcing = forcing_of(scene, steps * dt, as_forces=True)
        self._scene, self._entries = scene, scene.sites * scene.dim
        self._of_drives = [(s, name) for s, one in scene.drive.items() for name in one.parameters]
        self.layout = Layout(self._forcing.bonds, wanted)
        self._method, self._dt, self._shape = method, dt, (2, *scene.shape)
        count = sum(len(one.places) for one in self._forcing.applied) * scene.dim**2
        self.stride = max(1, NUMBERS // (method.stages * 4 * (self._entries + count)))
        u, v = dynamics(scene).arrays(scene.at_rest())
        self._loop = driven.bind(self._forcing, u, v, method, dt)
        self._stages = Stages(self._forcing, method, dt)
        self.reversal = 0.0

    def complete(self, samples: TraceSamples, t: Array, rows: Array) -> None:
        """Insert the velocities of prescribed entries into samples.

        Parameters
        ----------
        samples : TraceSamples
        t : ndarray, (rows,)
            Instants [s].
        rows : ndarray, (rows, columns)
            Displacements, then velocities, of the sites of the samples; changed.
        """
        moved, count = self._forcing.moved.tolist(), samples.u_count
        self._t = t
        self._given = [(column, int(column >= count), moved.index(place))
                       for column, place in enumerate(samples.places.tolist())
                       if place in moved]  # fmt: skip
        for column, order, number in self._given:
            if order:
                rows[:, column] = self._forcing.motion(t, 1)[:, number]

    def withdraw(self, by_rows: Array) -> None:
        """Turn derivatives by prescribed entries of samples (objectives, rows, columns), which
        become 0, into those by the parameters of drives."""
        self.by_drives = np.zeros((len(by_rows), len(self._of_drives)))
        for column, order, number in self._given:
            by = self._drives_by(True, self._t, order)[:, number]
            self.by_drives += by_rows[..., column] @ by
            by_rows[..., column] = 0.0

    def _drives_by(self, prescribed: bool, t: Array, order: int = 0) -> Array:
        """Derivatives of prescribed motions or forces by the parameters of all drives, (times,
        entries, parameters)."""
        entries, signals = driven_entries(self._scene, prescribed)
        columns = np.zeros((len(t), len(entries), len(self._of_drives)))
        for k, (site, name) in enumerate(self._of_drives):
            of_site = entries // self._scene.dim == site
            columns[..., k] = in_columns(signals, name)(t, order) * of_site
        return columns

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
        applied, bonds = forcing.applied, layout.bonds
        self.totals = totals = Totals(layout, objectives)
        back = ReverseLoop(layout, self._method, self._dt, totals)
        self.largest = tuple(
            max(float(np.abs(x[k]).max()) for x in states.values()) for k in (0, 1)
        )
        self.by_parameters: list[Array] = [np.zeros((objectives, *one.values.shape))
                                           for one in applied]  # fmt: skip
        stops = sorted(states)
        back.add_cotangents(cotangents, stops[-1])
        for a, b in [*pairwise(stops)][::-1]:
            t, path = self._recorded(a, b, states)
            here = applied, bonds, t, path[:, 0], path[:, 1]
            ends, stiff, loss = tangent_springs(*here)
            given: dict[str, Any] = {"moved": forcing.moved, "pulled": forcing.forced}
            given |= {f"{x}_by": self._drives_by(True, t, k) for k, x in enumerate("uv")}
            slopes = np.zeros((len(t), objectives, layout.rows, max(layout.dim, 1)))
            self.by_drives += back.reverse_stages(
                self._method, self._dt, path, ends, b, cotangents, stiff=stiff, loss=loss,
                slopes=slopes, pull_by=self._drives_by(False, t), **given,
            )  # fmt: skip
            by_parameter, by_gap, by_weight = pull_back(*here, slopes)
            for total, part in zip(self.by_parameters, by_parameter, strict=True):
                total += part
            if layout.dim:
                for one, part in zip(applied, by_gap, strict=True):
                    if one.law.on == BOND:
                        totals.arrays[2][:, layout.place[one.places]] += part
            by_entry = by_weight.reshape(objectives, -1)
            if len(forcing.forced):
                of_entries = slopes.reshape(len(t), objectives, -1)[..., forcing.forced]
                pulls = forcing.force(t, 0)
                by_entry[:, forcing.forced] += np.einsum("toe,te->oe", of_entries, pulls)
            totals.w[:] += by_weight[:, :sites].reshape(totals.w.shape)
        self.u, self.v = (x[:, :sites] for x in (back.ub, back.vb))

    def _recorded(self, a: int, b: int, states: dict[int, Pair]) -> tuple[Array, Array]:
        """Instants and states of the stages from step a to step b."""
        path = np.empty(((b - a) * self._method.stages, 2, self._entries))
        self._loop.record_stages(path)
        sites = self._shape[1]
        for row, given in zip((self._loop.u, self._loop.v), states[a], strict=True):
            row[:sites] = given
        self._loop.go(a, b)
        for row, given in zip((self._loop.u, self._loop.v), states[b], strict=True):
            self.reversal = max(self.reversal, float(np.abs(row[:sites] - given).max()))
        return self._stages.times(a, b - a)[:-1], path

    def named(self, k: int) -> dict[str, Array]:
        """Derivatives of objective k by each parameter of the forces and drives, (springs,) or
        (sites,)."""
        totals: dict[str, Array] = {}
        counts = {SITE: self._shape[1], BOND: len(self.layout.bonds.group)}
        for one, by in zip(self._forcing.applied, self.by_parameters, strict=True):
            for name, values in zip(one.law.names, by[k], strict=False):
                totals.setdefault(name, np.zeros(counts[one.law.on]))[one.places] += values
        for (site, name), value in zip(self._of_drives, self.by_drives[k], strict=True):
            totals.setdefault(name, np.zeros(counts[SITE]))[site] += value
        return totals


def check_forced(scene: Any, traces: Sequence[Any]) -> None:
    """Refuse driven scenes whose gradient is not available.

    Parameters
    ----------
    scene : Scene
    traces : sequence of Trace
        Of the objectives.

    Raises
    ------
    TensegrityError
    """
    if dynamics(scene).springs.changing:
        raise TensegrityError("springs that change in time has no gradient")
    counts, bonds = place_counts(scene), set()
    for one in dynamics(scene).further_forces:
        if one.on != "sites":
            first = counts["bonds"] * (one.on == "walls")
            at = range(counts[one.on]) if one.at is None else one.at
            bonds |= {first + k for k in at}
    stored = any(one.stores for one in dynamics(scene).further_forces)
    for trace in traces:
        if bonds & {*_bonds_of(scene, trace)}:
            raise TensegrityError(
                f"{trace!r} is the load of a bond in which a further force acts: no gradient"
            )
        if trace.kind == "energy" and stored:
            raise TensegrityError(f"{trace!r} leaves out springs to the ground: no gradient")


def _bonds_of(scene: Any, trace: Any) -> Sequence[int]:
    """Numbers of the springs whose loads a trace reads."""
    if trace.kind == "bond":
        return [trace.where]
    if trace.kind != "wall":
        return []
    if hasattr(scene, "wall_contacts"):
        first = place_counts(scene)["bonds"]
        contacts: list[int] = np.flatnonzero(scene.wall_contacts[:, 1] == trace.where).tolist()
        return [first + k for k in contacts]
    return [0, scene.sites - 2]


def parameters_of(scene: Any) -> dict[str, str]:
    """Names of the parameters of the forces and drives of a scene, and what they act on.

    Raises
    ------
    TensegrityError
        A parameter acts on sites and in bonds, or has different values in a spring and a force.
    """
    of = dynamics(scene)
    symbols = {str(s) for law in of.springs.table[0] for s in law.parameters}
    given: list[tuple[str, str, Any]] = [
        (str(name), DRIVE, None) for one in scene.drive.values() for name in one.parameters
    ]
    for one in of.acting.applied(as_forces=True):
        for name, values in zip(one.law.names, one.values, strict=False):
            shared = one.law.on == BOND and name in symbols
            given.append((name, one.law.on, (one.places, values) if shared else None))
    kinds: dict[str, str] = {}
    for name, on, shared in given:
        clash = kinds.setdefault(name, on) != on or (name in symbols and shared is None)
        if shared is not None:
            at, values = shared
            differ = np.abs(_of_springs(of, name)[at] - values)
            clash = clash or bool(np.any(differ > SAME * np.abs(values)))
        if clash:
            raise TensegrityError(
                f"{name} names parameters of different things in the springs, forces and drives of "
                "this scene: rename one"
            )
    return kinds


def _of_springs(of: Any, name: str) -> Array:
    """Values of a symbol of the springs' laws, (bonds,); NaN where they have none."""
    laws, law, parameters = of.springs.table
    values = np.full(len(law), np.nan)
    for number, one in enumerate(laws):
        for k, symbol in enumerate(one.parameters):
            if str(symbol) == name:
                values[law == number] = parameters[law == number, k]
    return values[of.springs.group]
