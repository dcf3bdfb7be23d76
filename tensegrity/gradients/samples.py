"""Traces of a run from samples of a few of its entries, and derivatives back to these.

What is sampled after each step are displacements, and velocities as the loop keeps them: without
the closing kick of the step, which is one with the first of the next.  A trace of velocities adds
that kick, from the forces on its sites.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tensegrity.engine.bonds import PAIR
from tensegrity.engine.pulled import Pulled
from tensegrity.engine.reverse_text import energy_function
from tensegrity.errors import TensegrityError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from tensegrity.engine.reverse_layout import Layout
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
            bonds, sites = self.parts(trace)
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

    def parts(self, trace: Trace) -> tuple[Indices, list[int]]:
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

    @property
    def most(self) -> int:
        """Steps whose samples traces are computed from at once."""
        return max(1, AT_ONCE // max(1, len(self.places) * (4 + self.layout.most)))


class Samples:
    """All samples of a run, of which so many steps are looked at at once as have room.

    Parameters
    ----------
    view : View
    rows : ndarray, (steps, places)
    closing : ndarray, (steps,)
        Times that velocities lack a kick for [s].
    """

    def __init__(self, view: View, rows: Array, closing: Array) -> None:
        self._view, self._rows, self._closing = view, rows, closing
        self._slices = [slice(k, k + view.most) for k in range(0, len(rows), view.most)]
        self._whole = Part(view, rows, closing) if len(self._slices) == 1 else None

    def _part(self, inside: Any) -> Part:
        return Part(self._view, self._rows[inside], self._closing[inside])

    def values(self, trace: Trace) -> Array:
        """A trace, (steps,)."""
        parts = (self._whole or self._part(inside) for inside in self._slices)
        return np.concatenate([part.value(trace) for part in parts])

    def back(self, traces: Sequence[Trace], slopes: Array) -> tuple[Array, Any]:
        """Derivatives by the samples, and by parameters, elongations, masses and their inverses.

        Parameters
        ----------
        traces : sequence of Trace
        slopes : ndarray, (traces, steps)
            By these.  Only steps that count are looked at: of a peak there are three.
        """
        rows, rest = np.zeros(self._rows.shape), None
        used, most = np.flatnonzero(slopes.any(axis=0)), self._view.most
        few = 0 < len(used) < len(rows) / 2
        slices = np.array_split(used, -(-len(used) // most)) if few else self._slices
        for inside in slices:
            part = self._part(inside) if few or self._whole is None else self._whole
            rows[inside], *found = part.back(traces, slopes[:, inside])
            rest = found if rest is None else [a + b for a, b in zip(rest, found, strict=True)]
        return rows, rest


class Part:
    """Some steps of a run: traces, and derivatives by their samples and what else they depend on.

    Parameters
    ----------
    view, rows, closing
        As of `Samples`.
    """

    def __init__(self, view: View, rows: Array, closing: Array) -> None:
        self._view, self._closing = view, closing
        count, axes = len(rows), view.axes
        self._u = rows[:, : view.of_u].reshape(count, -1, axes)
        self._v = rows[:, view.of_u :].reshape(count, -1, axes)
        if view.walls:
            self._u = np.concatenate([self._u, np.zeros((count, 1, axes))], axis=1)
        self._rows_u = [*view.rows_u, *[view.layout.sites] * view.walls]
        self._forces: dict[Any, Pulled] = {}

    def back(self, traces: Sequence[Trace], slopes: Array) -> tuple[Array, ...]:
        """Derivatives (steps, places) by the samples; (wanted, bonds) by the parameters, (bonds,)
        by elongations, (sites,) by masses and by their inverses, from those by traces."""
        layout, count = self._view.layout, len(self._u)
        bonds = len(layout.bonds.group)
        self._ub, self._vb = np.zeros(self._u.shape), np.zeros(self._v.shape)
        self._p, self._g = np.zeros((layout.most, bonds)), np.zeros(bonds)
        self._m, self._w = np.zeros((2, layout.sites))
        for trace, slope in zip(traces, slopes, strict=True):
            if slope.any():
                self._add(trace, slope)
        by_u = self._ub[:, : len(self._view.rows_u)].reshape(count, -1)
        by_samples = np.concatenate([by_u, self._vb.reshape(count, -1)], axis=1)
        return by_samples, self._p, self._g, self._m, self._w

    def _pulled(self, members: Indices) -> Pulled:
        key = members.tobytes()
        if key not in self._forces:
            pulled = Pulled(self._view.layout, members, self._rows_u)
            pulled.at(self._u if self._view.layout.dim else self._u[..., 0])
            self._forces[key] = pulled
        return self._forces[key]

    def _add_pulled(self, bonds: Indices, **slopes: Array) -> None:
        """Derivatives by forces, tensions or elongations of bonds; see `Pulled.back`."""
        by_u, by_p, by_g = self._pulled(bonds).back(**slopes)
        self._ub += by_u if self._view.layout.dim else by_u[..., None]
        self._p[:, bonds] += by_p.sum(axis=1)
        self._g[bonds] += by_g.sum(axis=0)

    def value(self, trace: Trace) -> Array:
        """A trace; (steps,)."""
        bonds, sites = self._view.parts(trace)
        if trace.kind in ("bond", "wall"):
            return -self._pulled(bonds).f.sum(axis=1)
        if trace.kind == "displacement":
            return self._u[:, self._rows(sites)[0], trace.axis]
        v = self._velocity(bonds, sites)[0]
        if trace.kind == "velocity":
            return v[:, 0, trace.axis]
        kinetic = 0.5 * np.sum(self._view.scene.mass[sites] * np.sum(v**2, axis=-1), axis=-1)
        stored = self._stored(bonds)[0] @ self._shares(bonds, sites)
        pushed = np.sum(self._loads(sites) * self._u[:, self._rows(sites)], axis=(1, 2))
        return kinetic + stored - pushed

    def _add(self, trace: Trace, slope: Array) -> None:
        """Carry back the derivatives (steps,) by a trace."""
        bonds, sites = self._view.parts(trace)
        if trace.kind in ("bond", "wall"):
            by_tension = np.repeat(-slope[:, None], len(bonds), axis=1)
            self._add_pulled(bonds, by_tension=by_tension)
        elif trace.kind == "displacement":
            self._ub[:, self._rows(sites)[0], trace.axis] += slope
        elif trace.kind == "velocity":
            by_v = np.zeros((len(slope), 1, self._view.axes))
            by_v[:, 0, trace.axis] = slope
            self._add_velocity(bonds, sites, by_v)
        else:
            v, mass = self._velocity(bonds, sites)[0], self._view.scene.mass[sites]
            self._add_velocity(bonds, sites, slope[:, None, None] * mass[:, None] * v)
            self._m[sites] += 0.5 * slope @ np.sum(v**2, axis=-1)
            self._ub[:, self._rows(sites)] -= slope[:, None, None] * self._loads(sites)
            stored, weight = self._stored(bonds), slope[:, None] * self._shares(bonds, sites)
            self._add_pulled(bonds, by_elongation=weight * stored[1])
            self._p[:, bonds] += np.sum(weight * stored[2:], axis=1)

    def _rows(self, sites: list[int]) -> list[int]:
        """Of some sites among the displacements."""
        return [self._view.rows_u.index(s) for s in sites]

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

    def _velocity(self, bonds: Indices, sites: list[int]) -> tuple[Array, Array]:
        """Velocities with the closing kick, and the forces that gave it; (steps, sites, axes)."""
        view = self._view
        force = self._pulled(bonds).forces().reshape(*self._u.shape)
        force = force[:, self._rows(sites)] + self._loads(sites)
        v = self._v[:, [view.rows_v.index(s) for s in sites]]
        kick = self._closing[:, None] * view.scene.inverse_mass[sites]
        return v + kick[..., None] * force, force

    def _add_velocity(self, bonds: Indices, sites: list[int], by_v: Array) -> None:
        view = self._view
        self._vb[:, [view.rows_v.index(s) for s in sites]] += by_v
        force = self._velocity(bonds, sites)[1]
        kick = self._closing[:, None] * view.scene.inverse_mass[sites]
        by_force = np.zeros(self._u.shape)
        by_force[:, self._rows(sites)] = kick[..., None] * by_v
        self._add_pulled(bonds, by_force=by_force if view.layout.dim else by_force[..., 0])
        self._w[sites] += np.sum(self._closing[:, None, None] * by_v * force, axis=(0, 2))
