"""Traces of a run from samples of a few entries of u and v, and derivatives with respect to these.

Displacements and velocities are sampled after each step as they are in the loop: velocities lack
the closing kick of the step, which is merged with the first kick of the next one.  A trace of
velocities adds that kick, from the forces on its sites.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from tensegrity.engine.bonds import PAIR
from tensegrity.engine.codegen import energy_function
from tensegrity.engine.forces import BondForces
from tensegrity.engine.geometry import own
from tensegrity.errors import TensegrityError
from tensegrity.typing import Array, Indices

if TYPE_CHECKING:
    from tensegrity.engine.reverse import Layout
    from tensegrity.gradients.objective import Trace
    from tensegrity.scenes.scene import Scene

AT_ONCE = 4_000_000  # most numbers from which traces are computed in one block


class TraceSamples:
    """Bonds and sites that the traces of a scene depend on, and the sampled entries of u and v.

    Parameters
    ----------
    scene : Scene
    layout : Layout
    traces : sequence of Trace

    Attributes
    ----------
    parts : dict of Trace to (ndarray of int, ndarray of int)
        Bonds and sites of each trace.
    places : ndarray of int
        Sampled entries of u, then of v.
    u_count : int
        How many of these are entries of u.
    """

    def __init__(self, scene: Scene, layout: Layout, traces: tuple[Trace, ...]) -> None:
        self.scene, self.layout = scene, layout
        self.axes = max(layout.dim, 1)
        self.parts = {trace: self._parts(trace) for trace in traces}
        u_count: set[int] = set()
        of_v: set[int] = set()
        for trace, (bonds, sites) in self.parts.items():
            u_count.update(sites.tolist(), *(end[bonds].tolist() for end in layout.ends))
            of_v.update(sites.tolist() if trace.kind in ("velocity", "energy") else ())
        self.walls = int(layout.dim > 0 and layout.sites in u_count)
        self.rows_u, self.rows_v = np.array(sorted(u_count), dtype=int), sorted(of_v)
        moving = [*self.rows_u[: len(u_count) - self.walls], *self.rows_v]
        axes = np.arange(self.axes)
        self.places = np.add.outer(np.array(moving, dtype=int) * self.axes, axes).ravel()
        self.u_count = len(self.places) - len(of_v) * self.axes
        self._most = max(1, AT_ONCE // max(1, len(self.places) * (4 + layout.most)))

    def _parts(self, trace: Trace) -> tuple[Indices, Indices]:
        kind, where, none = trace.kind, trace.where, np.zeros(0, dtype=int)
        first, second = self.layout.ends
        if kind == "bond":
            if own(self.layout.bonds.laws):
                raise TensegrityError(f"bond {where}: the bonds of a pair law have no tension")
            if where >= len(first):
                raise TensegrityError(f"bond {where} must be below {len(first)}")
            return np.array([where]), none
        if kind == "wall":
            return self._of_wall(where), none
        sites = np.arange(self.scene.sites) if where is None else np.atleast_1d(where)
        if sites.max() >= self.scene.sites:
            raise TensegrityError(f"site {sites.max()} must be below {self.scene.sites}")
        if trace.axis >= self.axes:
            raise TensegrityError(f"axis {trace.axis} must be below {self.axes}")
        if kind == "displacement":
            return none, sites
        return np.flatnonzero(np.isin(first, sites) | np.isin(second, sites)), sites

    def _of_wall(self, wall: int) -> Indices:
        """Bonds whose loads add up to that of a wall, or of a held end of a chain."""
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
        places = np.flatnonzero((contacts.kind != PAIR) & (contacts.first == scene.sites + wall))
        if not places.size:
            raise TensegrityError(f"wall {wall} has no contact in the scene's list")
        return places

    def values(self, rows: Array, closing: Array) -> Array:
        """All traces, (traces, steps).

        Parameters
        ----------
        rows : ndarray, (steps, places)
            Samples.
        closing : ndarray, (steps,)
            Duration of the closing kick that velocities in them lack [s].
        """
        parts = (slice(k, k + self._most) for k in range(0, len(rows), self._most))
        return np.concatenate([_Block(self, rows[x], closing[x]).values() for x in parts], axis=1)

    def pullback(self, slopes: Array, rows: Array, closing: Array) -> tuple[Array, ...]:
        """Derivatives with respect to the samples and to all else that the traces depend on.

        Only steps with derivatives that are not 0 are evaluated: three for a peak.

        Parameters
        ----------
        slopes : ndarray, (traces, steps)
            Derivatives with respect to the traces.
        rows, closing : ndarray
            See `values`.

        Returns
        -------
        ndarray, (steps, places)
            Derivatives with respect to the samples.
        p, g, m, w : ndarray, (wanted, bonds), (bonds,), shape of the masses twice
            With respect to parameters, elongations, masses and their inverses.
        """
        layout, by_rows = self.layout, np.zeros(rows.shape)
        bonds = len(layout.bonds.group)
        masses = np.zeros((2, *self.scene.mass.shape))
        totals = np.zeros((layout.most, bonds)), np.zeros(bonds), *masses
        used = np.flatnonzero(slopes.any(axis=0))
        for k in range(0, len(used), self._most):
            x = used[k : k + self._most]
            by_rows[x] = _Block(self, rows[x], closing[x]).pullback(slopes[:, x], totals)
        return by_rows, *totals


class _Block:
    """A block of steps of a run, from their samples."""

    def __init__(self, of: TraceSamples, rows: Array, closing: Array) -> None:
        self._of, self._closing, count = of, closing[:, None, None], len(rows)
        u, self._v = (x.reshape(count, -1, of.axes) for x in np.split(rows, [of.u_count], axis=1))
        self._u = np.append(u, np.zeros((count, of.walls, of.axes)), axis=1)  # walls stand still
        self._forces: dict[bytes, BondForces] = {}

    def values(self) -> Array:
        """All traces, (traces, steps)."""
        return np.array([self._value(trace) for trace in self._of.parts])

    def _value(self, trace: Trace) -> Array:
        bonds, sites = self._of.parts[trace]
        if trace.kind in ("bond", "wall"):
            return -self._bond_forces(bonds).f.sum(axis=1)
        u = self._u[:, self._rows(sites)]
        if trace.kind == "displacement":
            return u[:, 0, trace.axis]
        v, _ = self._velocity(bonds, sites)
        if trace.kind == "velocity":
            return v[:, 0, trace.axis]
        kinetic = 0.5 * np.sum(self._mass(sites) * v**2, axis=(-1, -2))
        stored = self._stored(bonds)[0] @ self._energy_fractions(bonds, sites)
        return kinetic + stored - np.sum(self._loads(sites) * u, axis=(1, 2))

    def pullback(self, slopes: Array, totals: tuple[Array, ...]) -> Array:
        """Derivatives with respect to the samples, (steps, places), from those with respect to all
        traces; the other derivatives are added to `totals`."""
        self._ub, self._vb = np.zeros(self._u.shape), np.zeros(self._v.shape)
        self._p, self._g, self._m, self._w = totals
        for trace, slope in zip(self._of.parts, slopes, strict=True):
            if slope.any():
                self._add(trace, slope[:, None, None])
        moving = self._ub.shape[1] - self._of.walls
        each = (x.reshape(len(x), -1) for x in (self._ub[:, :moving], self._vb))
        return np.concatenate([*each], axis=1)

    def _add(self, trace: Trace, slope: Array) -> None:
        """Propagate the derivatives with respect to a trace, (steps, 1, 1)."""
        bonds, sites = self._of.parts[trace]
        if trace.kind in ("bond", "wall"):
            self._add_bond_forces(bonds, by_tension=np.repeat(-slope[..., 0], len(bonds), axis=1))
        elif trace.kind == "displacement":
            self._ub[:, self._rows(sites), trace.axis] += slope[..., 0]
        elif trace.kind == "velocity":
            self._add_velocity(bonds, sites, slope * np.eye(self._of.axes)[trace.axis])
        else:
            v, _ = self._velocity(bonds, sites)
            self._add_velocity(bonds, sites, slope * self._mass(sites) * v)
            self._m[sites] += self._of_masses(0.5 * np.sum(slope * v**2, axis=0))
            self._ub[:, self._rows(sites)] -= slope * self._loads(sites)
            stored, weight = (
                self._stored(bonds),
                slope[..., 0] * self._energy_fractions(bonds, sites),
            )
            self._add_bond_forces(bonds, by_elongation=weight * stored[1])
            self._p[:, bonds] += np.sum(weight * stored[2:], axis=1)

    def _rows(self, sites: Indices) -> Indices:
        """Rows of some sites among the sampled displacements."""
        return np.searchsorted(self._of.rows_u, sites)

    def _loads(self, sites: Indices) -> Array:
        scene = self._of.scene
        return np.broadcast_to(scene.loads, scene.shape).reshape(scene.sites, -1)[sites]

    def _energy_fractions(self, bonds: Indices, sites: Indices) -> Array:
        """Fraction of the energy of each bond: 1/2 for each of its ends, 1 for a wall contact."""
        layout = self._of.layout
        first, second = (np.isin(end[bonds], sites) for end in layout.ends)
        return np.where(layout.kind[bonds] == PAIR, (first + second.astype(float)) / 2, 1.0)

    def _stored(self, bonds: Indices) -> Array:
        """Energy, tension, and derivatives of the energy with respect to the parameters;
        (.., steps, bonds)."""
        layout, r = self._of.layout, self._bond_forces(bonds).r
        stored = np.zeros((2 + layout.most, *r.shape))
        for column, group in enumerate(layout.bonds.group[bonds].tolist()):
            law = int(layout.bonds.law[group])
            function = energy_function(layout.bonds.laws[law], layout.wanted[law])
            p = layout.bonds.parameters[group][: function.size1_in(1)]
            answer = np.array(function(r[None, :, column], p))
            stored[: len(answer), :, column] = answer
        return stored

    def _bond_forces(self, bonds: Indices) -> BondForces:
        key, layout = bonds.tobytes(), self._of.layout
        if key not in self._forces:
            self._forces[key] = BondForces(layout, bonds, self._of.rows_u, self._u)
        return self._forces[key]

    def _add_bond_forces(self, bonds: Indices, **slopes: Array) -> None:
        """Propagate derivatives with respect to forces, tensions or elongations of bonds; see
        `BondForces.pullback`."""
        by_u, by_p, by_g = self._bond_forces(bonds).pullback(**slopes)
        self._ub += by_u
        self._p[:, bonds] += by_p.sum(axis=1)
        self._g[bonds] += by_g.sum(axis=0)

    def _velocity(self, bonds: Indices, sites: Indices) -> tuple[Array, Array]:
        """Velocities with the closing kick, and the forces that gave it; (steps, sites, axes)."""
        force = self._bond_forces(bonds).forces()
        force = force[:, self._rows(sites)] + self._loads(sites)
        v = self._v[:, np.searchsorted(self._of.rows_v, sites)]
        return v + self._kick(sites) * force, force

    def _kick(self, sites: Indices) -> Any:
        """Change of velocity by the closing kick per unit force on each site; (steps, sites, 1)."""
        weights = self._of.layout.bonds.inverse_mass[sites]
        return self._closing * weights.reshape(len(sites), -1)

    def _mass(self, sites: Indices) -> Array:
        """Masses of sites, (sites, 1), or of their coordinates, (sites, axes) [kg]."""
        return self._of.scene.mass[sites].reshape(len(sites), -1)

    def _of_masses(self, each: Array) -> Array:
        """Derivatives with respect to the masses from those by each coordinate's, (sites, axes)."""
        return each if self._of.scene.mass.ndim > 1 else each.sum(axis=1)

    def _add_velocity(self, bonds: Indices, sites: Indices, by_v: Array) -> None:
        self._vb[:, np.searchsorted(self._of.rows_v, sites)] += by_v
        force = self._velocity(bonds, sites)[1]
        by_force = np.zeros(self._u.shape)
        by_force[:, self._rows(sites)] = self._kick(sites) * by_v
        self._add_bond_forces(bonds, by_force=by_force)
        self._w[sites] += self._of_masses(np.sum(self._closing * by_v * force, axis=0))
