"""What the motion of a scene needs beyond the scene's data: springs in a table, bonds as the
compiled loop takes them, bounds of the stiffness, names of places.

A scene is data.  `dynamics(scene)` computes these from it once for each thread, and keeps them as
long as the scene lives, with what runs found out about it; nothing is shared between threads.
"""

from __future__ import annotations

import threading
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.engine import kernel
from tensegrity.engine.bonds import Bonds, by_spring
from tensegrity.engine.openings import is_treated
from tensegrity.errors import TensegrityError
from tensegrity.readonly import ReadOnly, fixed, same_content
from tensegrity.springs.collection import Springs

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from tensegrity.engine.energies import Energies
    from tensegrity.engine.methods import Method
    from tensegrity.typing import Array, Indices, SceneData


def dynamics(scene: Any) -> Any:
    """The `Dynamics` of a scene, or of an ensemble, in this thread."""
    try:
        return scene._in_thread.dynamics
    except AttributeError:
        scene._in_thread.dynamics = scene._dynamics()
        return scene._in_thread.dynamics


class HasDynamics(ReadOnly):
    """Base of what `simulate` takes: a scene, or several that run together.

    Equal content makes two of them equal.
    """

    if TYPE_CHECKING:

        @property
        def shape(self) -> tuple[int, ...]: ...
        @property
        def sites(self) -> int: ...

    def __eq__(self, other: object) -> bool:
        if type(self) is not type(other):
            return NotImplemented
        return self is other or same_content(self.__getstate__(), other.__getstate__())

    def __hash__(self) -> int:
        return hash((type(self), self.shape))

    @cached_property
    def _in_thread(self) -> threading.local:
        return threading.local()

    def _dynamics(self) -> Any:
        raise NotImplementedError


class Dynamics:
    """Of a scene whose bonds are fixed; see `dynamics`.

    Attributes
    ----------
    scene : Scene
    sites, dim : int
        Number of sites, and of coordinates of each.
    shape : tuple of int
        Of the displacements of a state.
    batch : tuple of int
        The last of these where several scenes run together, (scenes,), else ().
    wall_count : int
        Number of walls.
    closing : float or ndarray, (springs,)
        Elongation [m] at which the ends of a bond of each different spring meet, -inf where they
        cannot.
    spring_lengths : ndarray, (bonds,), or None
        Length of each bond [m], where springs count as different for it.
    turns : bool
        Whether bonds may turn, so that their tension resists motion across them.
    follows : bool
        Whether contacts come and go, so that only those near are listed.
    clearance : Clearance or None
        What watches over contacts that are not listed.
    arguments : tuple of str
        Of what the sites are made of, beads say, by which `by_argument` has derivatives.
    ranges : list of (ndarray, ndarray, float)
        Ranges of elongation (springs, 2) [m] that runs met lately, how stiff each spring is at
        most there [N/m], and the angular frequency that this bounds [rad/s].
    reached : dict of float to Reach
        What springs reach with energies [J] in one bond.
    tuned : dict of float to object
        Springs that change, prepared for runs of some duration [s].
    saving : float or None
        Seconds that fitted forces save in one evaluation of all, roughly.
    prepared : dict of Method to list
        Loops that are prepared for runs, and not in use.
    """

    batch: tuple[int, ...] = ()
    wall_count: int = 0
    zero_length_elongation: Any = -np.inf
    spring_lengths: Array | None = None
    turns: bool = False
    follows: bool = False
    clearance: Any = None
    arguments: tuple[str, ...] = ()

    def __init__(self, scene: Any) -> None:
        self.scene, self.shape = scene, scene.shape
        self.sites, self.dim = scene.sites, scene.dim
        self.ranges: list[tuple[Array, Array, float]] = []
        self.reached: dict[float, Any] = {}
        self.tuned: dict[float, Any] = {}
        self.saving: float | None = None
        self.prepared: dict[Method, list[Any]] = {}

    if TYPE_CHECKING:  # what differs from one kind of scene to another

        @property
        def energies_in_one_call(self) -> Energies | None: ...
        @property
        def cost(self) -> int: ...
        def elongations(self, u: Array) -> Array: ...
        def energies(self, u: Array, v: Array) -> Array: ...
        def bond_frequency_bound(self, stiffness: Array) -> float: ...
        def where_extreme(self, spring: int, u: Array, side: int) -> str: ...
        def where_stiffest(self, u: Array, ranges: Array) -> str: ...
        def by_argument(
            self, name: str, by_mass: Array, by_spring: Callable[[str], Array], by_gap: Any
        ) -> Array: ...

    # the scene's data, as the loop takes it

    @cached_property
    def springs(self) -> Springs:
        """The different springs, and which bond has which."""
        return Springs(self.scene.springs, lengths=self.spring_lengths)

    @cached_property
    def inverse_mass(self) -> Array:
        """1/m [1/kg], 0 for a held site; (sites,)."""
        w = 1 / self.scene.mass
        w[list(self.scene.held)] = 0
        return fixed(w)

    @property
    def is_driven(self) -> bool:
        """Whether forces depend on time or velocity, or motion is prescribed."""
        return is_driven(self.scene)

    @cached_property
    def smooth(self) -> bool:
        """Whether the derivatives of no spring jump."""
        return all(spring.smooth for spring in self.springs.different)

    @cached_property
    def opens(self) -> bool:
        """Whether some contact can open, of an exponent for which steps are corrected."""
        return self.follows or bool(is_treated(self.springs.openings[..., 2]).any())

    @cached_property
    def loop_bonds(self) -> Bonds:
        """Bonds as the loop takes them."""
        springs = self.springs
        return Bonds(*springs.table, springs.group, self.inverse_mass, openings=springs.openings)

    @property
    def contact_bonds(self) -> Bonds:
        """Bonds with their geometry, which a loop over neighbours in a row does without."""
        return self.loop_bonds

    def arrays(self, state: Any) -> tuple[Array, Array]:
        """Copies of u and v as the loop advances them, with rows for walls behind the sites."""
        return state.u.copy(), state.v.copy()

    def bind(self, u: Array, v: Array, method: Method, dt: float) -> Any:
        """The loop, advancing the rows of `arrays` in place."""
        return kernel.bind(u, v, self.loop_bonds, method, dt)

    def listed(self, u: Array) -> Dynamics:
        """That with the contacts which may act near displacements u: here it has them all."""
        return self

    def nearest(self, u: Array) -> Dynamics:
        """That with contacts which may well form in a run from displacements u."""
        return self

    def forces(self, u: Array) -> Array:
        """Forces on all sites [N], shape of u."""
        return self.scene.forces(u)

    # bounds

    @property
    def is_loaded(self) -> bool:
        """Whether constant loads act."""
        return bool(np.any(self.scene.loads))

    def checked(self, state: Any) -> float:
        """Refuse a state that is not one of the scene; its energy [J]."""
        self.scene._check_sites(state)
        energy = float(self.energies(state.u[None], state.v[None])[0])  # refuses what locks
        if not np.isfinite(energy):
            raise TensegrityError(f"energy {energy} J of the state must be finite")
        return energy

    def available_energy(self, state: Any, energy: float | None = None) -> float:
        """What one spring could get of the energy [J]: all; `checked` says it, where known."""
        return self.scene.energy(state) if energy is None else energy

    def stiffness_bounds(self, ranges: Array, numbers: Indices | None = None) -> Array:
        """Bound on the stiffness of a bond of each spring, along it and across.

        Parameters
        ----------
        ranges : ndarray, (springs, 2)
            Elongations [m].
        numbers : ndarray of int, optional
            The springs in question; by default all.

        Returns
        -------
        ndarray, (springs,) or shape of `numbers`
            [N/m]; inf where the ends of a bond meet.
        """
        springs = self.springs
        if numbers is None:
            if not self.turns and (ranges[:, 0] > self.zero_length_elongation).all():
                return springs.largest("stiffness", ranges)
            numbers = np.arange(len(springs))
        shortest = ranges[:, 0] - self.zero_length_elongation
        k, apart = np.full(len(numbers), np.inf), shortest[numbers] > 0
        within = numbers[apart]
        k[apart] = springs.largest("stiffness", ranges, within)
        if self.turns:
            across = springs.largest("tension", ranges, within) / shortest[within]
            k[apart] = np.maximum(k[apart], across)
        return k

    def frequency(self, ranges: Array) -> float:
        """Bound on the largest angular frequency [rad/s] over given ranges (springs, 2)."""
        return self.spring_frequency_bound(self.stiffness_bounds(np.asarray(ranges, dtype=float)))

    def spring_frequency_bound(self, stiffness: Array) -> float:
        """The same for a bound of the stiffness of each spring [N/m], (springs,)."""
        if np.isinf(stiffness).any():
            return np.inf  # the two sites of a bond coincide
        return self.bond_frequency_bound(stiffness[self.springs.group])

    def ranges_at(self, u: Array) -> Array:
        """Smallest and largest elongation, 0 included, of each different spring; (springs, 2)."""
        r, group = self.elongations(u), self.springs.group
        if len(self.springs) == 1:
            return np.array([[min(float(r.min()), 0.0), max(float(r.max()), 0.0)]])
        group = np.broadcast_to(group.reshape(*group.shape, *[1] * (r.ndim - group.ndim)), r.shape)
        ranges = by_spring(group.ravel(), len(self.springs), r.ravel(), r.ravel())
        return np.stack([np.minimum(ranges[:, 0], 0), np.maximum(ranges[:, 1], 0)], axis=1)


def is_driven(scene: SceneData) -> bool:
    """Whether forces depend on time or velocity, or motion is prescribed."""
    return bool(scene.drive or scene.damping or scene.tune)
