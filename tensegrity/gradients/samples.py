"""Traces of a run from samples of a few of its entries, and derivatives back to these.

What is sampled after each step are displacements, and velocities as the loop keeps them: without
the closing kick of the step, which is one with the first of the next.  A trace of velocities adds
that kick, from the forces on its sites.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tensegrity.engine.bonds import PAIR
from tensegrity.engine.codegen import energy_function
from tensegrity.engine.forces import Pulled
from tensegrity.errors import TensegrityError
from tensegrity.scenes.dynamics import dynamics

if TYPE_CHECKING:
    from typing import Any

    from tensegrity.engine.reverse import Layout
    from tensegrity.gradients.objective import Trace
    from tensegrity.scenes.scene import Scene
    from tensegrity.typing import Array, Indices

AT_ONCE = 4_000_000  # numbers that a trace is computed from at once


class View:
    """A scene as traces see it: which bonds and rows they are made of.

    Parameters
    ----------
    scene : Scene
    layout : Layout
    traces : sequence of Trace
    """

    def __init__(self, scene: Scene, layout: Layout, traces: tuple[Trace, ...]) -> None:
        self.scene, self.layout = scene, layout
        self.axes = max(layout.dim, 1)
        of_u: set[int] = set()
        of_v: set[int] = set()
        for trace in traces:
            bonds, sites = self._parts(trace)
            of_u.update(*(end[bonds].tolist() for end in layout.ends))
            of_v.update(sites if trace.kind in ("velocity", "energy") else ())
            of_u.update(sites)
        rows = sorted(of_u)
        self.rows_u = [r for r in rows if r < layout.sites]
        self.walls = len(self.rows_u) < len(rows)
        self.rows_v = sorted(of_v)
        self.places = np.array([
            row * self.axes + axis
            for part in (self.rows_u, self.rows_v) for row in part for axis in range(self.axes)
        ], dtype=np.int64)  # fmt: skip
        self.of_u = len(self.rows_u) * self.axes

    def _parts(self, trace: Trace) -> tuple[Indices, list[int]]:
        """Bonds and sites that a trace is made of."""
        kind, where, scene = trace.kind, trace.where, self.scene
        first, second = self.layout.ends
        if kind == "bond":
            if where >= len(first):
                raise TensegrityError(f"bond {where} must be below {len(first)}")
            return np.array([where]), []
        if kind == "wall":
            return self.wall_bonds(where), []
        sites = list(range(scene.sites)) if where is None else list(np.atleast_1d(where))
        if max(sites) >= scene.sites:
            raise TensegrityError(f"site {max(sites)} must be below {scene.sites}")
        if trace.axis >= self.axes:
            raise TensegrityError(f"axis {trace.axis} must be below {self.axes}")
        if kind == "displacement":
            return np.zeros(0, dtype=int), sites
        return np.flatnonzero(np.isin(first, sites) | np.isin(second, sites)), sites

    def wall_bonds(self, wall: int) -> Indices:
        """Bonds whose load is that of a wall, or of a held end of a chain."""
        contacts, scene = self.layout.bonds.contacts, self.scene
        if contacts is None:
            ends = [s for s in sorted(scene.held) if s in (0, scene.sites - 1)]
            if wall >= len(ends):
                raise TensegrityError(
                    f"wall {wall} must be below {len(ends)}: held ends of a chain"
                )
            return np.array([0 if ends[wall] == 0 else scene.sites - 2])
        if wall >= contacts.walls:
            raise TensegrityError(f"wall {wall} must be below {contacts.walls}")
        found = np.flatnonzero((contacts.kind != PAIR) & (contacts.first == scene.sites + wall))
        if not found.size:
            raise TensegrityError(f"wall {wall} has no contact in the scene's list")
        return found

    def part(self, rows: Array, closing: Array) -> Part:
        """Samples (steps, places) as arrays that traces are computed from."""
        return Part(self, rows, closing)

    @property
    def most(self) -> int:
        """Steps whose samples traces are computed from at once."""
        return max(1, AT_ONCE // max(1, len(self.places) * (4 + self.layout.most)))


class Part:
    """Some steps of a run, and derivatives by their samples and by what else traces depend on.

    Attributes
    ----------
    rows : ndarray, (steps, places)
        Derivatives by the samples.
    p : ndarray, (wanted, bonds)
    g, m : ndarray, (bonds,), (sites,)
        By the parameters, by the elongations of bonds, by the masses.
    w : ndarray, (sites,)
        By the inverse masses.
    """

    def __init__(self, view: View, rows: Array, closing: Array) -> None:
        self._view, self._closing = view, closing
        count, axes = len(rows), view.axes
        self._u = rows[:, : view.of_u].reshape(count, -1, axes)
        self._v = rows[:, view.of_u :].reshape(count, -1, axes)
        layout = view.layout
        if view.walls:
            self._u = np.concatenate([self._u, np.zeros((count, 1, axes))], axis=1)
        self._rows_u = [*view.rows_u, *[layout.sites] * view.walls]
        self._kept: dict[Any, Any] = {}
        self.forget()

    def forget(self) -> None:
        """Begin all derivatives anew."""
        layout = self._view.layout
        bonds = len(layout.bonds.group)
        self._ub, self._vb = np.zeros(self._u.shape), np.zeros(self._v.shape)
        self.p, self.g = np.zeros((layout.most, bonds)), np.zeros(bonds)
        self.m, self.w = np.zeros((2, layout.sites))

    @property
    def rows(self) -> Array:
        """Derivatives by the samples, (steps, places)."""
        count = len(self._ub)
        by_u = self._ub[:, : len(self._view.rows_u)].reshape(count, -1)
        return np.concatenate([by_u, self._vb.reshape(count, -1)], axis=1)

    def _pulled(self, members: Indices) -> Pulled:
        key = members.tobytes()
        if key not in self._kept:
            self._kept[key] = Pulled(self._view.layout, members, self._rows_u, self._u)
        return self._kept[key]

    def _add(self, pulled: Pulled, found: tuple[Array, Array, Array]) -> None:
        by_u, by_p, by_g = found
        self._ub += by_u
        self.p[:, pulled.members] += by_p.sum(axis=1)
        self.g[pulled.members] += by_g.sum(axis=0)

    def value(self, trace: Trace) -> Array:
        """A trace; (steps,)."""
        view = self._view
        bonds, sites = view._parts(trace)
        if trace.kind in ("bond", "wall"):
            return -self._pulled(bonds).f.sum(axis=1)
        if trace.kind == "displacement":
            return self._u[:, view.rows_u.index(trace.where), trace.axis]
        if trace.kind == "velocity":
            return self._velocity(sites)[0][:, 0, trace.axis]
        v = self._velocity(sites)[0]
        kinetic = 0.5 * np.sum(view.scene.mass[sites] * np.sum(v**2, axis=-1), axis=-1)
        stored, share = self._stored(bonds), self._shares(bonds, sites)
        at = [view.rows_u.index(s) for s in sites]
        return (
            kinetic + stored[0] @ share - np.sum(self._loads(sites) * self._u[:, at], axis=(1, 2))
        )

    def add(self, trace: Trace, slope: Array) -> None:
        """Carry back the derivatives (steps,) by a trace."""
        view = self._view
        bonds, sites = view._parts(trace)
        if trace.kind in ("bond", "wall"):
            pulled = self._pulled(bonds)
            by_tension = np.repeat(-slope[:, None], len(bonds), axis=1)
            self._add(pulled, pulled.back(by_tension=by_tension))
        elif trace.kind == "displacement":
            self._ub[:, view.rows_u.index(trace.where), trace.axis] += slope
        elif trace.kind == "velocity":
            by_v = np.zeros((len(slope), 1, view.axes))
            by_v[:, 0, trace.axis] = slope
            self._add_velocity(sites, by_v)
        else:
            v, mass = self._velocity(sites)[0], view.scene.mass[sites]
            self._add_velocity(sites, slope[:, None, None] * mass[:, None] * v)
            self.m[sites] += 0.5 * slope @ np.sum(v**2, axis=-1)
            at = [view.rows_u.index(s) for s in sites]
            self._ub[:, at] -= slope[:, None, None] * self._loads(sites)
            pulled, share = self._pulled(bonds), self._shares(bonds, sites)
            stored = self._stored(bonds)
            weight = slope[:, None] * share
            self._add(pulled, pulled.back(by_elongation=weight * stored[1]))
            self.p[:, bonds] += np.sum(weight * stored[2:], axis=1)

    def _loads(self, sites: list[int]) -> Array:
        loads = np.broadcast_to(self._view.scene.loads, self._view.scene.shape)
        return loads.reshape(self._view.scene.sites, -1)[sites]

    def _shares(self, bonds: Indices, sites: list[int]) -> Array:
        """Of the energy of each bond: half for each end, all of a wall contact."""
        layout = self._view.layout
        first, second = (np.isin(end[bonds], sites) for end in layout.ends)
        return np.where(layout.kind[bonds] == PAIR, (first + second.astype(float)) / 2, 1.0)

    def _stored(self, bonds: Indices) -> Array:
        """Energy, tension and derivatives of the energy by the parameters; (.., steps, bonds)."""
        layout, r = self._view.layout, self._pulled(bonds).r
        found = np.zeros((2 + layout.most, *r.shape))
        for column, group in enumerate(layout.bonds.group[bonds].tolist()):
            law = int(layout.bonds.law[group])
            function = energy_function(layout.bonds.laws[law], layout.wanted[law])
            p = layout.bonds.parameters[group][: function.size1_in(1)]
            answer = np.array(function(r[None, :, column], p))
            found[: len(answer), :, column] = answer
        return found

    def _velocity(self, sites: list[int]) -> tuple[Array, Any, Array]:
        """Velocities with the closing kick, and what gave it; (steps, sites, axes)."""
        view = self._view
        v = self._v[:, [view.rows_v.index(s) for s in sites]]
        if not self._closing.any():
            return v, None, np.zeros(0)
        first, second = view.layout.ends
        pulled = self._pulled(np.flatnonzero(np.isin(first, sites) | np.isin(second, sites)))
        at = [view.rows_u.index(s) for s in sites]
        force = pulled.forces()[:, at] + self._loads(sites)
        kick = self._closing[:, None] * dynamics(view.scene).inverse_mass[sites]
        return v + kick[..., None] * force, pulled, force

    def _add_velocity(self, sites: list[int], by_v: Array) -> None:
        view = self._view
        at = [view.rows_v.index(s) for s in sites]
        self._vb[:, at] += by_v
        _, pulled, force = self._velocity(sites)
        if pulled is None:
            return
        kick = self._closing[:, None] * dynamics(view.scene).inverse_mass[sites]
        by_force = np.zeros(self._u.shape)
        by_force[:, [view.rows_u.index(s) for s in sites]] = kick[..., None] * by_v
        self._add(pulled, pulled.back(by_force=by_force))
        self.w[sites] += np.sum(self._closing[:, None, None] * by_v * force, axis=(0, 2))
