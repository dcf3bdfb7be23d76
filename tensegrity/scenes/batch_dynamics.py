"""The dynamics of an ensemble: parts of it run in one compiled loop each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from tensegrity.engine import kernel, threaded
from tensegrity.engine.bonds import Bonds
from tensegrity.engine.methods import Method
from tensegrity.errors import TensegrityError
from tensegrity.readonly import fixed
from tensegrity.scenes.dynamics import Dynamics, dynamics
from tensegrity.scenes.scene import State
from tensegrity.springs.collection import Springs
from tensegrity.springs.potential import Potential
from tensegrity.typing import Array, Indices

# Numbers of scenes for which compiled loops exist.  The arrays of the largest batch of short chains
# fit into the cache of a processor.
BATCH_SIZES = (8, 16, 24, 32, 48, 64)
AT_ONCE = 200  # sites whose values in a batch are copied into another order at a time


class Part(NamedTuple):
    """Scenes of an ensemble that run in one loop.

    Attributes
    ----------
    numbers : ndarray of int
        Consecutive indices of these scenes in the ensemble.
    scene : Scene or Ensemble
        The scenes themselves, padded with copies of the last one to the size of a batch.
    places : ndarray of int
        Index of each of its distinct springs among those of the whole ensemble.
    """

    numbers: Indices
    scene: Any
    places: Indices

    def of(self, array: Array) -> Array:
        """The part's section of an array whose last axis is the scenes, padded with the last."""
        if len(self.numbers) == 1:
            return np.ascontiguousarray(array[..., self.numbers[0]])
        each = np.minimum(self.numbers[0] + np.arange(self.scene.count), self.numbers[-1])
        return np.ascontiguousarray(array[..., each])


class BatchDynamics(Dynamics):
    """Quantities derived from an ensemble for its runs; scenes are the last axis of all arrays."""

    def __init__(self, ensemble: Any) -> None:
        super().__init__(ensemble)
        self.batch = (ensemble.count,)
        self.scenes = ensemble.scenes
        self.members = [dynamics(scene) for scene in ensemble.scenes]
        self.wall_count, self.turns = self.members[0].wall_count, self.members[0].turns
        self._same = all(scene is self.scenes[0] for scene in self.scenes)
        self._first = 0  # index of the first scene in the ensemble of which this is a part

    @cached_property
    def inverse_mass(self) -> Array:
        """1/m [1/kg], 0 for a held site; (sites, scenes)."""
        return fixed(np.stack([one.inverse_mass for one in self.members], axis=1))

    @cached_property
    def is_driven(self) -> bool:
        """Whether some scene is driven or damped, or changes."""
        return any(one.is_driven for one in self.members)

    @cached_property
    def needs_rates(self) -> bool:
        """Whether a scene has forces that a Runge-Kutta method takes only."""
        return any(one.needs_rates for one in self.members)

    @property
    def further_forces(self) -> tuple[Any, ...]:
        """The forces of all scenes besides those of springs, drives and dashpots."""
        return tuple(force for one in self.members for force in one.further_forces)

    @cached_property
    def springs(self) -> Springs:
        """The distinct springs, and which one each bond has, per scene if the scenes differ."""
        if self._same:
            return self.members[0].springs
        each = zip(*(scene.springs for scene in self.scenes), strict=True)
        lengths = [one.spring_lengths for one in self.members]
        return Springs(
            tuple(spring for bond in each for spring in bond),
            (len(self.scenes[0].springs), len(self.scenes)),
            None if lengths[0] is None else np.stack(lengths, axis=1).ravel(),
        )

    @property
    def _group(self) -> Indices:
        group = self.springs.group
        return group[:, None] if group.ndim == 1 else group

    def spring_numbers(self, number: int) -> Indices:
        """Index in `springs` of each distinct spring of one scene."""
        springs, group = self.members[number].springs, self._group
        place = np.zeros(len(springs), dtype=int)
        place[springs.group] = group[:, number if group.shape[1] > 1 else 0]
        return place

    def with_springs(self, springs: Sequence[Potential]) -> Any:
        """The same scenes with one new spring for each distinct spring in `springs`."""
        kind = type(self.scene)
        if self._same:
            return kind(self.members[0].with_springs(springs), len(self.members))
        places = (self.spring_numbers(number).tolist() for number in range(len(self.members)))
        each = zip(self.members, places, strict=True)
        return kind([one.with_springs([springs[k] for k in place]) for one, place in each])

    @property
    def cost(self) -> int:
        """Cost of one evaluation of all forces, in bonds of a chain."""
        return sum(one.cost for one in self.members)

    @property
    def zero_length_elongation(self) -> Any:
        """Elongation [m] at which the ends of a bond of each distinct spring meet."""
        if self._same:
            return self.members[0].zero_length_elongation
        elongations = np.full(len(self.springs), -np.inf)
        for number, one in enumerate(self.members):
            mine = np.broadcast_to(one.zero_length_elongation, len(one.springs))
            np.maximum.at(elongations, self._group[:, number], mine[one.springs.group])
        return elongations

    @property
    def is_loaded(self) -> bool:
        """Whether constant loads act on some scene."""
        return any(one.is_loaded for one in self.members)

    def forces(self, u: Array) -> Array:
        """Forces on all sites [N], shape of u."""
        each = [one.forces(np.ascontiguousarray(u[..., k])) for k, one in enumerate(self.members)]
        return np.stack(each, axis=-1)

    # parts

    def parts(self, method: Method) -> list[Part]:
        """The groups of scenes that run in one loop each."""
        return self._parts if method.explicit else self._singles

    @cached_property
    def _parts(self) -> list[Part]:
        return self._split(1 if self._bonds is None else BATCH_SIZES[-1])

    @cached_property
    def _singles(self) -> list[Part]:
        return self._split(1)

    def _split(self, most: int) -> list[Part]:
        numbers = {kind: k for k, kind in enumerate(self.springs.kinds)}
        parts = []
        for first in range(0, len(self.scenes), most):
            count = min(len(self.scenes) - first, most)
            scene = self._part(first, count) if count > 1 else self.scenes[first]
            places = np.array([numbers[kind] for kind in dynamics(scene).springs.kinds])
            parts.append(Part(first + np.arange(count), scene, places))
        return parts

    def _part(self, first: int, count: int) -> Any:
        """Consecutive scenes, padded with copies of the last one to the size of a batch."""
        scenes, width = self.scenes[first : first + count], BATCH_SIZES[-1]
        if count == len(self.scenes):
            width = batch_size(count)
            if count == width:
                return self.scene
        kind, more = type(self.scene), scenes[-1:] * (width - count)
        joined = kind(scenes[0], width) if self._same else kind([*scenes, *more])
        dynamics(joined)._first = first
        return joined

    # the engine's view

    @cached_property
    def _bonds(self) -> Bonds | None:
        """Bonds of a loop over all scenes; None if each scene has a loop of its own."""
        bonds = [one.loop_bonds for one in self.members]
        if self.is_driven or any(x.contacts is not None or x.stretch is not None for x in bonds):
            return None
        laws, law, parameters = self.springs.table
        group = self.springs.group
        if group.ndim == 2 and np.any(law[group] != law[group[:, :1]]):
            return None
        mass = np.ascontiguousarray(self.inverse_mass)
        return Bonds(laws, law, parameters, group, mass, kinks=self.springs.kinks)

    def rows(self, state: State) -> tuple[Array, Array]:
        """u and v in the form of the compiled loop."""
        if self._bonds is not None:
            return super().rows(state)
        each = [one.rows(self.scene.select(state, k)) for k, one in enumerate(self.members)]
        u, v = (np.stack(x, axis=-1) for x in zip(*each, strict=True))
        return u, v

    def bind(self, u: Array, v: Array, method: Method, dt: float) -> Any:
        """The loop over all scenes, for a number of scenes for which a compiled one exists.

        Parameters
        ----------
        u, v : ndarray, (sites, scenes)
            Arrays [m], [m/s] that the loop advances in place.
        method : Method
        dt : float
            Time step [s].

        Returns
        -------
        object
            The loop, as `tensegrity.engine.kernel.bind` returns it.

        Raises
        ------
        TensegrityError
            No compiled loop takes these scenes together.
        """
        count = len(self.scenes)
        if self._bonds is None or count not in BATCH_SIZES:
            raise TensegrityError(
                f"no compiled loop takes {count} scenes of {self.scenes[0]!r} together"
            )
        return kernel.bind(u, v, self._bonds, method, dt)

    def checked(self, state: State) -> float:
        """Refuse a state that some scene refuses; return the largest energy of a scene [J]."""
        self.scene.select(state, 0)
        held, starts = self.inverse_mass == 0, (np.moveaxis(x, -1, 1) for x in (state.u, state.v))
        clear = not any(one.clearance for one in self.members[: 1 if self._same else None])
        if clear and not any(x[held].any() for x in starts):
            try:
                energy = self.available_energy(state)
            except TensegrityError:
                energy = math.nan  # the check of each scene below names the fault
            if math.isfinite(energy):
                return energy
        return max(each.checked(self.scene.select(state, k)) for k, each in enumerate(self.members))

    def available_energy(self, state: State, energy: float | None = None) -> float:
        """Upper bound on the energy of a single spring [J]: the largest energy of a scene."""
        if energy is None:
            energy = float(np.max(self.energies(state.u[None], state.v[None])))
        return energy

    def energies(self, u: Array, v: Array) -> Array:
        """Total energy of each scene [J], (states, scenes); u and v (states, *shape)."""

        def of(part: slice) -> Array:
            states = [_scenes_first(x[..., part]) for x in (u, v)]
            if self._same:  # all of one scene in one call
                rows = (x.reshape(-1, *self.scenes[0].shape) for x in states)
                return self.members[0].energies(*rows).reshape(-1, len(u)).T
            each = zip(self.members[part], *states, strict=True)
            return np.stack([one.energies(*mine) for one, *mine in each], axis=-1)

        size = BATCH_SIZES[-1]
        parts = [slice(k, k + size) for k in range(0, len(self.members), size)]
        return np.concatenate(threaded.each(of, parts, u.size), axis=-1)

    def elongations(self, u: Any) -> Array:
        """Elongation of each bond [m]; (..., bonds, scenes)."""
        each = [one.elongations(u[..., k]) for k, one in enumerate(self.members)]
        return np.stack(each, axis=-1)

    def bond_frequency_bound(self, stiffness: Array) -> float:
        """Bound on the largest angular frequency [rad/s] of any scene."""
        if self._same:
            return self.members[0].bond_frequency_bound(stiffness)
        each = zip(self.members, stiffness.T, strict=True)
        return max(one.bond_frequency_bound(k) for one, k in each)

    def spring_frequency_bound(self, stiffness: Array) -> float:
        """The same, given the stiffness of each distinct spring [N/m], (springs,)."""
        if np.isinf(stiffness).any():
            return np.inf  # the two sites of a bond coincide
        return self.bond_frequency_bound(stiffness[self.springs.group])

    def where_fastest(self, ranges: Array) -> str:
        """Name the scene with the largest bound on its frequency, over ranges of elongation [m]
        (springs, 2)."""
        each = [one.frequency(ranges[self.spring_numbers(k)]) for k, one in enumerate(self.members)]
        return f" of scene {self._first + int(np.argmax(each))}"

    def where_extreme(self, spring: int, u: Array, side: int) -> str:
        """Describe the bond and the scene in which a spring has its extreme elongation.

        Parameters
        ----------
        spring : int
            Index of a distinct spring in `springs`.
        u : ndarray, (sites, scenes)
            Displacements [m].
        side : {0, 1}
            0 for the smallest elongation, 1 for the largest.

        Returns
        -------
        str
        """
        r = self.elongations(u)
        mine = np.broadcast_to(self._group == spring, r.shape)
        r = np.where(mine, r, np.inf if side == 0 else -np.inf)
        number = int(np.unravel_index(np.argmax(r) if side else np.argmin(r), r.shape)[1])
        one, bond = self.members[number], np.flatnonzero(mine[:, number])[0]
        where = one.where_extreme(int(one.springs.group[bond]), u[..., number], side)
        return f"{where} of scene {self._first + number}"

    def where_stiffest(self, u: Array, ranges: Array) -> str:
        """Describe the bond and the scene with the largest elongation in magnitude."""
        r = np.abs(self.elongations(u))
        number = int(np.unravel_index(np.argmax(r), r.shape)[1])
        where = self.members[number].where_stiffest(
            u[..., number], ranges[self.spring_numbers(number)]
        )
        return f"{where} of scene {self._first + number}"


def _scenes_first(states: Array) -> Array:
    """States (count, *shape, scenes) as a contiguous array (scenes, count, *shape), copied by
    pieces that fit into the cache."""
    reordered = np.empty((states.shape[-1], *states.shape[:-1]))
    rows = max(1, AT_ONCE // max(1, math.prod(states.shape[1:-1])))
    for k in range(0, len(states), rows):
        reordered[:, k : k + rows] = np.moveaxis(states[k : k + rows], -1, 0)
    return reordered


def batch_size(count: int) -> int:
    """Least size of a batch of at least `count` scenes for which a compiled loop exists."""
    return next(size for size in BATCH_SIZES if size >= count)
