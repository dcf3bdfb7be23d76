"""Scenes of one shape that run at once, one in each lane of the last axis.

A processor works on several chains in the time of one where their sites stand side by side, so
an ensemble of short chains takes less time than one chain after the other.  All share the step.
Networks run in turn, and so do all lanes with an implicit method, or where the lanes' springs have
different laws.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check
from tensegrity.engine import kernel
from tensegrity.errors import TensegrityError
from tensegrity.readonly import fixed
from tensegrity.scenes.lanes import MOST, Part, filled, parts, side_by_side
from tensegrity.scenes.scene import PER_SITE, Scene, State, known_state, velocities
from tensegrity.springs.collection import Springs

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from typing import Any

    from numpy.typing import ArrayLike

    from tensegrity.engine.methods import Method
    from tensegrity.springs.potential import Potential
    from tensegrity.typing import Array, Indices


class Ensemble(Scene):
    """Several scenes of one shape: one scene for `simulate`.

    States have u [m] and v [m/s] of shape (sites[, dim], lanes), runs of shape (T, sites[, dim],
    lanes); the recorded energy is that of all lanes together, `lane_energy` tells them apart.

    Parameters
    ----------
    scenes : Scene, or sequence of Scene
        The scene of every lane, or one for each lane, with masses and springs of its own.
    lanes : int, optional
        Number of lanes, at least 1, where one scene is given.

    Examples
    --------
    >>> from tensegrity import Chain, Prism, simulate
    >>> chain = Chain(Prism(1.0, 0.7, 0.01, 1.0).potential(), 40)
    >>> blows = Ensemble(chain, 8)
    >>> run = simulate(blows, blows.at_rest({0: np.linspace(0.01, 0.03, 8)}), 10.0, tol=1e-8)
    >>> run.final.u.shape
    (40, 8)
    """

    _first = 0  # number of the first lane, of a part of another one

    def __init__(self, scenes: Scene | Sequence[Scene], lanes: int | None = None) -> None:
        if isinstance(scenes, Scene) and lanes is not None:
            lanes = check.whole("lanes", lanes, least=1)
            check.room(
                f"a run of {scenes.sites} sites in {lanes} lanes", PER_SITE * scenes.sites * lanes
            )
            scenes = (scenes,) * lanes
        elif lanes is not None or isinstance(scenes, Scene) or not isinstance(scenes, Sequence):
            raise TensegrityError(
                f"scenes {check.shown(scenes)}, lanes {check.shown(lanes)}: give a scene and "
                "lanes, or several scenes"
            )
        self.scenes = tuple(scenes)
        for number, scene in enumerate(self.scenes):
            if not isinstance(scene, Scene) or isinstance(scene, Ensemble) or scene.follows:
                raise TensegrityError(
                    f"scene {number} is {check.shown(scene)}, not a Chain or a Network of fixed "
                    "contacts"
                )
        if not self.scenes:
            raise TensegrityError("scenes is empty")
        one = self.scenes[0]
        for number, scene in enumerate(self.scenes):
            if not one.is_alike(scene):
                raise TensegrityError(f"scene {number}, {scene!r}, differs in shape from {one!r}")

    # what all have in common

    @property
    def lanes(self) -> int:
        """Number of scenes."""
        return len(self.scenes)

    @property
    def sites(self) -> int:
        """Number of sites of each scene."""
        return self.scenes[0].sites

    @property
    def dim(self) -> int:
        """Coordinates of a site."""
        return self.scenes[0].dim

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the displacements of a state."""
        return (*self.scenes[0].shape, self.lanes)

    @property
    def turns(self) -> bool:
        """Whether bonds may turn."""
        return self.scenes[0].turns

    @property
    def wall_count(self) -> int:
        """Number of walls of each scene."""
        return self.scenes[0].wall_count

    @property
    def loads(self) -> Array:
        """Constant forces on the sites of each [N], shape of u."""
        loads = [np.broadcast_to(scene.loads, scene.shape) for scene in self.scenes]
        return np.stack(loads, axis=-1)

    @cached_property
    def held(self) -> Sequence[int]:
        """Numbers of the sites that are held in some lane."""
        return tuple(sorted({site for scene in self.scenes for site in scene.held}))

    @cached_property
    def mass(self) -> Array:
        """[kg]; (sites, lanes)."""
        return fixed(np.stack([scene.mass for scene in self.scenes], axis=1))

    @cached_property
    def inverse_mass(self) -> Array:
        """1/m [1/kg], 0 for a held site; (sites, lanes)."""
        return fixed(np.stack([scene.inverse_mass for scene in self.scenes], axis=1))

    @cached_property
    def _same(self) -> bool:
        return all(scene is self.scenes[0] for scene in self.scenes)

    @property
    def is_driven(self) -> bool:
        """Whether some scene is."""
        return any(scene.is_driven for scene in self.scenes)

    # the engine's view

    @cached_property
    def springs(self) -> tuple[Potential, ...]:
        """One for each bond in each lane."""
        each = zip(*(scene.springs for scene in self.scenes), strict=True)
        return tuple(spring for bond in each for spring in bond)

    @cached_property
    def spring_table(self) -> Springs:
        """The different springs, and which bond has which, in all lanes or in each its own."""
        if self._same:
            return self.scenes[0].spring_table
        shape = len(self.scenes[0].springs), self.lanes
        lengths = [scene.spring_lengths for scene in self.scenes]
        lengths = None if lengths[0] is None else np.stack(lengths, axis=1).ravel()  # type: ignore[arg-type]
        return Springs(self.springs, shape, lengths)

    @property
    def _group(self) -> Indices:
        group = self.spring_table.group
        return group[:, None] if group.ndim == 1 else group

    def places_of(self, lane: int) -> Indices:
        """The number in `spring_table` of each different spring of a lane's scene."""
        scene, group = self.scenes[lane], self._group
        place = np.zeros(len(scene.spring_table), dtype=int)
        place[scene.spring_table.group] = group[:, lane if group.shape[1] > 1 else 0]
        return place

    def with_springs(self, springs: Sequence[Potential]) -> Ensemble:
        """The same scenes with other springs, one for each different one of `spring_table`."""
        if self._same:
            return Ensemble(self.scenes[0].with_springs(springs), self.lanes)
        found = []
        for lane, scene in enumerate(self.scenes):
            mine = dict(zip(scene.spring_table.group, self._group[:, lane], strict=True))
            found.append(scene.with_springs([springs[mine[k]] for k in range(len(mine))]))
        return Ensemble(found)

    @property
    def cost(self) -> int:
        """Work of one evaluation of all forces, in bonds."""
        return sum(scene.cost for scene in self.scenes)

    @property
    def closing(self) -> float | Array:
        """As for each of the scenes."""
        if self._same:
            return self.scenes[0].closing
        found = np.full(len(self.spring_table), -np.inf)
        for lane, scene in enumerate(self.scenes):
            each = np.broadcast_to(scene.closing, len(scene.spring_table))
            np.maximum.at(found, self._group[:, lane], each[scene.spring_table.group])
        return found

    def arrays(self, state: State) -> tuple[Array, Array]:
        """u and v as the loop advances them; lanes stand last."""
        each = [scene.arrays(self.lane(state, k)) for k, scene in enumerate(self.scenes)]
        u, v = (np.ascontiguousarray(np.stack(x, axis=-1)) for x in zip(*each, strict=True))
        return u, v

    def parts(self, method: Method) -> list[Part]:
        """The lanes that run in one loop, each time."""
        return self._parts if method.explicit else self._parts_in_turn

    @cached_property
    def _parts(self) -> list[Part]:
        return parts(self, True)

    @cached_property
    def _parts_in_turn(self) -> list[Part]:
        return parts(self, False)

    def of(self, first: int, count: int) -> Ensemble:
        """Some lanes, and the last one as often as one compiled loop lacks lanes."""
        scenes = self.scenes[first : first + count]
        width = filled(count)
        if count == self.lanes == width:
            return self
        more = scenes[-1:] * (width - count)
        found = Ensemble(scenes[0], width) if self._same else Ensemble([*scenes, *more])
        found.__dict__["_first"] = first
        return found

    @cached_property
    def _bonds(self) -> Any:
        return side_by_side(self)

    def bind(self, u: Array, v: Array, method: Method, dt: float) -> Any:
        """These scenes in one loop, advancing the arrays of `arrays` in place, where they run side
        by side and there is one for so many."""
        if self._bonds is None or filled(self.lanes) != self.lanes or self.lanes > MOST:
            raise TensegrityError(f"no loop takes {self.lanes} lanes of {self.scenes[0]!r} at once")
        return kernel.bind(u, v, self._bonds, method, dt)

    def frequency_of(self, stiffness: Array) -> float:
        """Bound on the largest angular frequency [rad/s] of any lane."""
        if self._same:
            return self.scenes[0].frequency_of(stiffness)
        each = zip(self.scenes, stiffness.T, strict=True)
        return max(scene.frequency_of(k) for scene, k in each)

    def extreme(self, spring: int, u: Array, side: int) -> str:
        """Where an elongation of that spring is lowest (side 0) or highest (1), in words."""
        r = self.stretch(u)
        mine = np.broadcast_to(self._group == spring, r.shape)
        r = np.where(mine, r, np.inf if side == 0 else -np.inf)
        lane = int(np.unravel_index(np.argmax(r) if side else np.argmin(r), r.shape)[1])
        scene = self.scenes[lane]
        bond = np.flatnonzero(mine[:, lane])[0]
        where = scene.extreme(int(scene.spring_table.group[bond]), u[..., lane], side)
        return f"{where} of lane {self._first + lane}"

    def stiffest(self, u: Array, ranges: Array) -> str:
        """Where the stretch is largest, in words."""
        r = np.abs(self.stretch(u))
        lane = int(np.unravel_index(np.argmax(r), r.shape)[1])
        scene = self.scenes[lane]
        mine = np.zeros((len(scene.spring_table), 2))
        mine[scene.spring_table.group] = ranges[self._group[:, 0 if self._same else lane]]
        return f"{scene.stiffest(u[..., lane], mine)} of lane {self._first + lane}"

    # states

    def at_rest(self, velocity: Mapping[int, ArrayLike] | None = None) -> State:
        """The undeformed state, some sites given a velocity [m/s]: {site: one or each lane's}.

        Sites whose motion is prescribed are where their drive begins.
        """
        wanted, each = (*self.shape[1:-1], self.lanes), [{} for _ in self.scenes]  # type: ignore
        for site, values in velocities(velocity):
            try:
                given = check.floats("velocity", values)
                if given.shape == self.shape[1:-1]:
                    given = given[..., None]
                given = np.broadcast_to(given, wanted)
            except ValueError:
                raise TensegrityError(
                    f"velocity {check.shown(values)} of site {site} must be one number or "
                    f"{self.lanes}"
                ) from None
            for lane, mine in enumerate(each):
                one = given[..., lane]
                mine[site] = one if one.ndim else float(one)
        states = [scene.at_rest(mine) for scene, mine in zip(self.scenes, each, strict=True)]
        state = State(*(np.stack([getattr(x, k) for x in states], axis=-1) for k in "uv"))
        self.check(state)
        return state

    def check(self, state: State) -> float:
        """Refuse a state of another shape, or one that a scene alone refuses.

        Returns the largest energy of a lane [J].
        """
        self._refuse_other(state)
        known = self._known_energy(state)
        if known is not None:
            return known
        return max(scene.check(self.lane(state, k)) for k, scene in enumerate(self.scenes))

    def _known_energy(self, state: State) -> float | None:
        """The same, where all lanes are of one scene and nothing is wrong with any."""
        one = self.scenes[0]
        held = list(one.held)
        if not self._same or one.clearance or state.u[held].any() or state.v[held].any():
            return None
        try:
            energy = self.available_energy(state)
        except TensegrityError:
            return None
        return energy if np.isfinite(energy) else None

    def lane(self, state: State, number: int) -> State:
        """The state of one of the scenes, by its number from 0."""
        self._refuse_other(state)
        number = check.whole("lane", number, least=0, below=self.lanes)
        return known_state(*(np.ascontiguousarray(x[..., number]) for x in (state.u, state.v)))

    @property
    def _words(self) -> str:
        return f"ensemble has {self.shape}, lanes last"

    # what is computed from displacements u (..., sites[, dim], lanes)

    def _each(self, function: Callable[[Scene, Any], Any]) -> Any:
        """What a function of scene and lane gives, lanes last."""
        each = [function(scene, lane) for lane, scene in enumerate(self.scenes)]
        return np.stack(each, axis=-1)

    def elongation(self, u: ArrayLike) -> Array:
        """Elongation of each bond [m]; (..., bonds, lanes)."""
        u = check.rows("displacements", u, self.shape)
        return self._each(lambda scene, k: scene.elongation(u[..., k]))

    def stretch(self, u: ArrayLike) -> Array:
        """Elongation of every spring [m]; (..., springs, lanes)."""
        u = check.rows("displacements", u, self.shape, are_finite=False)
        return self._each(lambda scene, k: scene.stretch(u[..., k]))

    def bond_energy(self, u: Array) -> Array:
        """Energy of each bond [J]; (..., bonds, lanes)."""
        u = check.rows("displacements", u, self.shape)
        return self._each(lambda scene, k: scene.bond_energy(u[..., k]))

    def bond_tension(self, u: Array) -> Array:
        """Tension of each bond [N]; (..., bonds, lanes)."""
        u = check.rows("displacements", u, self.shape)
        return self._each(lambda scene, k: scene.bond_tension(u[..., k]))

    def site_energy(self, u: Array, v: Array) -> Array:
        """Energy of each site [J], as of each of the scenes; (..., sites, lanes)."""
        u, v = self._rows(u, v)
        return self._each(lambda scene, k: scene.site_energy(u[..., k], v[..., k]))

    def lane_energy(self, u: Array, v: Array) -> Array:
        """Total energy of each scene [J]; (..., lanes)."""
        return self.site_energy(u, v).sum(axis=-2)

    def energy(self, state: State) -> float:
        """Total energy of all lanes [J]."""
        self._refuse_other(state)
        return float(self.energies(state.u[None], state.v[None])[0])

    def energies(self, u: Array, v: Array) -> Array:
        """Total energy [J] of all lanes of each of many states; u, v (states, *shape)."""
        return np.array([np.sum(each) for each in self._lane_energies(u, v)])

    def available_energy(self, state: State, energy: float | None = None) -> float:
        """What one spring could get: the largest energy of a lane [J]."""
        return float(np.max(self._energies(state))) if energy is None else energy

    def _energies(self, state: State) -> Array:
        """Total energy of each lane [J]; (lanes,)."""
        return self._lane_energies(state.u[None], state.v[None])[0]

    def _lane_energies(self, u: Array, v: Array) -> Array:
        """Total energy of each lane [J] of many states (states, *shape); (states, lanes)."""
        moved = [np.ascontiguousarray(np.moveaxis(x, -1, 0)) for x in (u, v)]
        if self._same:  # all of one scene in one call
            rows = (x.reshape(-1, *self.scenes[0].shape) for x in moved)
            return self.scenes[0].energies(*rows).reshape(self.lanes, len(u)).T
        each = zip(self.scenes, *moved, strict=True)
        return np.stack([scene.energies(*states) for scene, *states in each], axis=-1)

    def momentum(self, state: State) -> float:
        """Total momentum of all lanes [kg m/s]."""
        return sum(scene.momentum(self.lane(state, k)) for k, scene in enumerate(self.scenes))

    def forces(self, u: ArrayLike) -> Array:
        """Forces on all sites [N] at displacements u, shape of u; see `Scene.forces`."""
        u = check.vector("displacement", u, self.shape)
        return self._each(lambda scene, k: scene.forces(np.ascontiguousarray(u[..., k])))

    def stiffness(self, u: ArrayLike) -> Any:
        """Derivative of `-forces(u)`, sparse (u.size, u.size) [N/m]; see `Scene.stiffness`."""
        from scipy.sparse import coo_array, csr_array

        u = check.vector("displacement", u, self.shape)
        rows, columns, values = [], [], []
        for lane, scene in enumerate(self.scenes):
            one = coo_array(scene.stiffness(np.ascontiguousarray(u[..., lane])))
            rows.append(one.row * self.lanes + lane)
            columns.append(one.col * self.lanes + lane)
            values.append(one.data)
        at, to, values = (np.concatenate(x) for x in (rows, columns, values))
        return csr_array((values, (at, to)), shape=(u.size, u.size))

    def __repr__(self) -> str:
        what = repr(self.scenes[0]) if self._same else f"{self.scenes[0]!r}, ..."
        return f"Ensemble({what}, {self.lanes} lanes)"
