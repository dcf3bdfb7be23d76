"""Ensembles: scenes of one shape that run as a batch with one time step.

The scenes are the last axis of every array, so that the values of one site in all scenes are
contiguous in memory and the processor advances several of them with one vector instruction: a batch
of short chains takes less time than the chains one after the other.  Networks run sequentially, as
do all scenes with an implicit method or with springs of different force laws.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.engine import kernel
from tensegrity.engine.bonds import Bonds
from tensegrity.engine.methods import Method
from tensegrity.errors import TensegrityError
from tensegrity.printing import concise
from tensegrity.readonly import fixed
from tensegrity.scenes.dynamics import Dynamics, HasDynamics, dynamics
from tensegrity.scenes.scene import (
    BYTES_PER_SITE,
    Scene,
    State,
    refuse_other,
    unchecked_state,
    velocities,
)
from tensegrity.springs.collection import Springs
from tensegrity.springs.potential import Potential
from tensegrity.typing import Array, Indices

BATCH_SIZES = (64, 48, 32, 24, 16, 8)  # numbers of scenes for which compiled loops exist
BATCH_MULTIPLE, LARGEST_BATCH = 32, 1024  # larger batches: multiples of the one up to the other


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

    @property
    def is_driven(self) -> bool:
        """Whether some scene is driven, damped or tuned."""
        return any(one.is_driven for one in self.members)

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
        found = np.full(len(self.springs), -np.inf)
        for number, one in enumerate(self.members):
            mine = np.broadcast_to(one.zero_length_elongation, len(one.springs))
            np.maximum.at(found, self._group[:, number], mine[one.springs.group])
        return found

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
        return self._split(1 if self._bonds is None else LARGEST_BATCH)

    @cached_property
    def _singles(self) -> list[Part]:
        return self._split(1)

    def _split(self, most: int) -> list[Part]:
        numbers = {kind: k for k, kind in enumerate(self.springs.kinds)}
        found = []
        for first in range(0, len(self.scenes), most):
            count = min(len(self.scenes) - first, most)
            scene = self._part(first, count) if count > 1 else self.scenes[first]
            places = np.array([numbers[kind] for kind in dynamics(scene).springs.kinds])
            found.append(Part(first + np.arange(count), scene, places))
        return found

    def _part(self, first: int, count: int) -> Any:
        """Consecutive scenes, padded with copies of the last one to the size of a batch."""
        scenes, width = self.scenes[first : first + count], padded_count(count)
        if count == len(self.scenes) == width:
            return self.scene
        kind, more = type(self.scene), scenes[-1:] * (width - count)
        found = kind(scenes[0], width) if self._same else kind([*scenes, *more])
        dynamics(found)._first = first
        return found

    # the engine's view

    @cached_property
    def _bonds(self) -> Bonds | None:
        """Bonds of a loop over all scenes; None if the scenes must run sequentially."""
        bonds = [one.loop_bonds for one in self.members]
        if self.is_driven or any(one.contacts is not None for one in bonds):
            return None
        laws, law, parameters = self.springs.table
        group = self.springs.group
        if group.ndim == 2 and np.any(law[group] != law[group[:, :1]]):
            return None
        mass = np.ascontiguousarray(self.inverse_mass)
        return Bonds(laws, law, parameters, group, mass, kinks=self.springs.kinks)

    def arrays(self, state: State) -> tuple[Array, Array]:
        """u and v in the form of the compiled loop."""
        each = [one.arrays(self.scene.select(state, k)) for k, one in enumerate(self.members)]
        u, v = (np.ascontiguousarray(np.stack(x, axis=-1)) for x in zip(*each, strict=True))
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
        if self._bonds is None or padded_count(count) != count or count > LARGEST_BATCH:
            raise TensegrityError(
                f"no compiled loop takes {count} scenes of {self.scenes[0]!r} together"
            )
        return kernel.bind(u, v, self._bonds, method, dt)

    def checked(self, state: State) -> float:
        """Refuse a state that some scene refuses; return the largest energy of a scene [J]."""
        self.scene.select(state, 0)
        one = self.members[0]
        held = list(self.scenes[0].held)
        if self._same and not (one.clearance or state.u[held].any() or state.v[held].any()):
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
        moved = [np.ascontiguousarray(np.moveaxis(x, -1, 0)) for x in (u, v)]
        if self._same:  # all of one scene in one call
            rows = (x.reshape(-1, *self.scenes[0].shape) for x in moved)
            return self.members[0].energies(*rows).reshape(len(self.members), len(u)).T
        each = zip(self.members, *moved, strict=True)
        return np.stack([one.energies(*states) for one, *states in each], axis=-1)

    def elongations(self, u: Array) -> Array:
        """Elongation of each bond [m]; (..., bonds, scenes)."""
        each = [one.elongations(u[..., k]) for k, one in enumerate(self.members)]
        return np.stack(each, axis=-1)

    def bond_frequency_bound(self, stiffness: Array) -> float:
        """Bound on the largest angular frequency [rad/s] of any scene."""
        if self._same:
            return self.members[0].bond_frequency_bound(stiffness)
        each = zip(self.members, stiffness.T, strict=True)
        return max(one.bond_frequency_bound(k) for one, k in each)

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


def padded_count(count: int) -> int:
    """Size of the smallest batch with at least `count` scenes for which a compiled loop exists."""
    if count == 1 or count > LARGEST_BATCH:
        return count
    return min(
        (n for n in BATCH_SIZES if n >= count),
        default=BATCH_MULTIPLE * math.ceil(count / BATCH_MULTIPLE),
    )


class Ensemble(HasDynamics):
    """Several scenes of one shape, which run as a batch, for `simulate` and `gradient`.

    States have u [m] and v [m/s] of shape (sites[, dim], scenes), and runs have shape
    (T, sites[, dim], scenes); see `RunBatch`.

    Parameters
    ----------
    scenes : Scene, or sequence of Scene
        One scene, which is repeated, or several, each with masses and springs of its own.
    count : int, optional
        Number of repetitions, at least 1; required with a single scene, excluded with a sequence.

    Raises
    ------
    TensegrityError
        No scene, scenes of different shapes, or networks with contacts="follow".

    Examples
    --------
    Eight chains of prisms, struck at different velocities:

    >>> import numpy as np
    >>> from tensegrity import Chain, Ensemble, Prism, simulate
    >>> chain = Chain(Prism(1.0, 0.7, 0.01, 1.0).potential(), 40)
    >>> impacts = Ensemble(chain, 8)
    >>> runs = simulate(impacts, impacts.at_rest({0: np.linspace(0.01, 0.03, 8)}), 10.0, tol=1e-8)
    >>> runs.final.u.shape
    (40, 8)
    >>> len(runs), runs[7].u.shape[1:]
    (8, (40,))
    """

    def __init__(self, scenes: Scene | Sequence[Scene], count: int | None = None) -> None:
        if isinstance(scenes, Scene) and count is not None:
            count = check.whole("count", count, least=1)
            check.room(
                f"a run of {scenes.sites} sites in {count} scenes",
                BYTES_PER_SITE * scenes.sites * count,
            )
            scenes = (scenes,) * count
        elif count is not None or isinstance(scenes, Scene) or not isinstance(scenes, Sequence):
            raise TensegrityError(
                f"scenes {check.shown(scenes)}, count {check.shown(count)}: give a scene and "
                "its count, or several scenes"
            )
        self.scenes = tuple(scenes)
        for number, scene in enumerate(self.scenes):
            if not isinstance(scene, Scene) or dynamics(scene).follows:
                raise TensegrityError(
                    f"scene {number} is {check.shown(scene)}, not a Chain or a Network of fixed "
                    "contacts"
                )
        if not self.scenes:
            raise TensegrityError("scenes is empty")
        one = self.scenes[0]
        for number, scene in enumerate(self.scenes):
            if _form(one) != _form(scene):
                raise TensegrityError(f"scene {number}, {scene!r}, differs in shape from {one!r}")

    @property
    def count(self) -> int:
        """Number of scenes in the batch."""
        return len(self.scenes)

    @cached_property
    def shape(self) -> tuple[int, ...]:
        """Shape of the displacements of a state."""
        return (*self.scenes[0].shape, self.count)

    @property
    def sites(self) -> int:
        """Number of sites of each scene."""
        return self.scenes[0].sites

    @property
    def dim(self) -> int:
        """Number of coordinates of each site."""
        return self.scenes[0].dim

    def _dynamics(self) -> BatchDynamics:
        return BatchDynamics(self)

    def at_rest(self, velocity: Mapping[int, ArrayLike] | None = None) -> State:
        """The undeformed state, in which the given sites have a velocity and all others rest.

        {site: velocity} [m/s]: one velocity for all scenes, or one per scene along the last axis.
        A site whose motion is prescribed has the displacement and velocity of its drive at t = 0.
        """
        wanted, each = (*self.shape[1:-1], self.count), [{} for _ in self.scenes]  # type: ignore
        for site, values in velocities(velocity):
            try:
                given = check.floats("velocity", values)
                if given.shape == self.shape[1:-1]:
                    given = given[..., None]
                given = np.broadcast_to(given, wanted)
            except ValueError:
                raise TensegrityError(
                    f"velocity {check.shown(values)} of site {site} must be one number or "
                    f"{self.count}"
                ) from None
            for number, mine in enumerate(each):
                one = given[..., number]
                mine[site] = one if one.ndim else float(one)
        states = [scene.at_rest(mine) for scene, mine in zip(self.scenes, each, strict=True)]
        state = State(*(np.stack([getattr(x, k) for x in states], axis=-1) for k in "uv"))
        self.check(state)
        return state

    def check(self, state: State) -> None:
        """Refuse a state of another shape, or one that a scene of the ensemble refuses."""
        dynamics(self).checked(state)

    def select(self, state: State, number: int) -> State:
        """The state of one scene, by its index from 0."""
        refuse_other(state, self.shape, f"ensemble has {self.shape}, scenes last")
        number = check.whole("scene", number, least=0, below=self.count)
        return unchecked_state(*(np.ascontiguousarray(x[..., number]) for x in (state.u, state.v)))

    __str__ = concise

    def __repr__(self) -> str:
        same = all(scene is self.scenes[0] for scene in self.scenes)
        what = repr(self.scenes[0]) if same else f"{self.scenes[0]!r}, ..."
        return f"Ensemble({what}, {self.count} scenes)"


def _form(scene: Scene) -> tuple[object, ...]:
    """What the scenes of an ensemble must have in common."""
    of = dynamics(scene)
    return scene.shape, len(scene.springs), of.wall_count, of.turns
