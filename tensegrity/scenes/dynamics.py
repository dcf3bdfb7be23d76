"""Quantities that a run derives from a scene: a table of its springs, its bonds in the form of the
compiled loop, bounds on its stiffness and frequencies, and descriptions of its bonds for messages.

They are computed once per thread, and kept with prepared loops for the lifetime of the scene.
"""

from __future__ import annotations

import math
import threading
from copy import copy
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check
from tensegrity.engine import forces, kernel
from tensegrity.engine.bonds import BLOCK, Bonds, by_spring
from tensegrity.engine.native import aligned_copy
from tensegrity.engine.openings import is_treated
from tensegrity.errors import TensegrityError
from tensegrity.readonly import ReadOnly, Repeated, fixed, same_content
from tensegrity.scenes.acting import Acting
from tensegrity.scenes.inertia import Inertia
from tensegrity.springs.collection import Springs

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from typing import Any

    from numpy.typing import ArrayLike

    from tensegrity.engine.energies import Energies
    from tensegrity.engine.methods import Method
    from tensegrity.springs.potential import Potential
    from tensegrity.typing import Array, Indices

SURROGATES = 4  # scenes with fitted springs that are cached with a scene
IN_CACHE = 20_000  # contacts times rows whose energies are computed in one call


def dynamics(scene: Any) -> Any:
    """The `Dynamics` of a scene, or of an ensemble, in this thread."""
    try:
        return scene._in_thread.dynamics
    except AttributeError:
        scene._in_thread.dynamics = scene._dynamics()
        return scene._in_thread.dynamics


class HasDynamics(ReadOnly):
    """Base class of the arguments of `simulate`: a scene, or an ensemble of scenes.

    Two objects are equal if their contents are equal.
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


class Dynamics(Inertia):
    """Quantities derived from a scene for its runs; see `dynamics`.

    Bonds join neighbours on a line, unless a subclass has their geometry.

    Attributes
    ----------
    scene : Scene
    sites, dim, wall_count : int
        Numbers of sites, of coordinates of each site, and of walls.
    shape : tuple of int
        Shape of the displacements of a state.
    batch : tuple of int
        Last axis of `shape` for an ensemble, (scenes,), otherwise ().
    zero_length_elongation : float or ndarray, (springs,)
        Elongation [m] at which the two ends of a bond of each distinct spring coincide, -inf if
        they cannot.
    spring_lengths : ndarray, (bonds,), or None
        Length of each bond [m], if springs of different length count as distinct.
    turns : bool
        Whether bonds can rotate, so that their tension contributes to the transverse stiffness.
    follows : bool
        Whether contacts form and open during a run, so that only near ones are listed.
    law : NewContactLaw or None
        Force law of these.
    clearance : Clearance or None
        Detector of unlisted contacts.
    ranges : list of (ndarray, ndarray, float)
        Cache of recent runs: ranges of elongation (springs, 2) [m], the bound on the stiffness of
        each spring over them [N/m], and the resulting bound on the angular frequency [rad/s].
    reached : dict of float to Reach
        Cache of the elongations that springs attain with a given energy [J] in one bond.
    timed : dict of float to TimedSprings
        Cache of springs that change with time, by the duration of the run [s].
    saving : float or None
        Estimate of the time that fitted forces save in one evaluation of all forces [s].
    prepared : dict of Method to list
        Prepared loops that no run is using.
    """

    batch: tuple[int, ...] = ()
    wall_count: int = 0
    zero_length_elongation: Any = -np.inf
    spring_lengths: Array | None = None
    turns: bool = False
    follows: bool = False
    law: Any = None
    clearance: Any = None

    def __init__(self, scene: Any) -> None:
        self.scene, self.shape = scene, scene.shape
        self.sites, self.dim = scene.sites, scene.dim
        self.ranges: list[tuple[Array, Array, float]] = []
        self.reached: dict[float, Any] = {}
        self.timed: dict[float, Any] = {}
        self.saving: float | None = None
        self.prepared: dict[Method, list[Any]] = {}
        self._surrogates: dict[tuple[Potential, ...], Any] = {}

    def surrogate(self, springs: tuple[Potential, ...]) -> Any:
        """The scene of `with_springs`; the last few are cached with what is derived from them."""
        surrogate = self._surrogates.get(springs)
        if surrogate is None:
            while len(self._surrogates) >= SURROGATES:
                self._surrogates.pop(next(iter(self._surrogates)), None)
            surrogate = self._surrogates[springs] = self.with_springs(springs)
        return surrogate

    @property
    def kinked(self) -> Any:
        """What knows the kinks of the forces: the springs."""
        return self.springs

    def with_springs(self, springs: Sequence[Potential]) -> Any:
        """The same scene with one new spring for each distinct spring in `springs`."""
        scene = varied(self.scene, springs=Repeated(springs, self.springs.group))
        dynamics(scene).__dict__.update(self.unchanged)
        return scene

    @property
    def unchanged(self) -> dict[str, Any]:
        """Cached quantities that do not depend on springs, by name."""
        return {}

    @property
    def arguments(self) -> tuple[str, ...]:
        """Arguments of the sites' constituents (beads, for instance) for which `by_argument`
        returns derivatives."""
        return self.scene._arguments_of_sites

    @property
    def by_argument(self) -> Callable[..., Array]:
        """Function of the name of such an argument, and of derivatives by masses, (sites,), by the
        named parameters of springs, and by gaps, (bonds,) or None; returns those by the argument,
        (sites,)."""
        return self.scene._by_argument

    # the scene's data in the form of the compiled loop

    @cached_property
    def springs(self) -> Springs:
        """The distinct springs, and the index of the one of each bond."""
        return Springs(self.scene.springs, lengths=self.spring_lengths)

    @cached_property
    def is_driven(self) -> bool:
        """Whether forces depend on time or velocity, or motion is prescribed."""
        scene = self.scene
        return bool(scene.drive or scene.damping or scene._forces or self.springs.changing)

    @cached_property
    def sums(self) -> dict[str, tuple[int, ...]]:
        """The sums that a run takes, work and loss [J], and the shape of each; none unless forces
        depend on time or velocity, or motion is prescribed."""
        return dict.fromkeys(("work", "loss") * self.is_driven, self.batch)

    @cached_property
    def acting(self) -> Acting:
        """The forces of the scene on their places."""
        return Acting(self.scene)

    @property
    def needs_rates(self) -> bool:
        """Whether there are forces that a Runge-Kutta method takes only."""
        heavy = self.scene.bond_mass is not None and self.is_driven and not self.springs.changing
        return heavy or not self.acting.splits

    @property
    def further_forces(self) -> tuple[Any, ...]:
        """The forces besides those of springs, drives and dashpots, each a Force."""
        return self.scene._forces

    @cached_property
    def smooth(self) -> bool:
        """Whether no spring has a kink."""
        return all(spring.smooth for spring in self.springs.different)

    @cached_property
    def opens(self) -> bool:
        """Whether some contact can open whose exponent requires corrected steps."""
        return self.follows or bool(is_treated(self.springs.kinks[..., 2]).any())

    @cached_property
    def loop_bonds(self) -> Bonds:
        """Bonds in the form of the compiled loop."""
        springs = self.springs
        return Bonds(*springs.table, springs.group, self.inverse_mass, kinks=springs.kinks)

    @property
    def contact_bonds(self) -> Bonds:
        """Bonds with their geometry, which the loop over a chain does not need."""
        return self.loop_bonds

    def rows(self, state: Any) -> tuple[Array, Array]:
        """Copies of u and v in the form of the loop, with rows for walls after the sites."""
        return state.u.copy(), state.v.copy()

    def arrays(self, state: Any) -> tuple[Array, Array]:
        """The same where a loop advances them fastest."""
        u, v = self.rows(state)
        odd = (len(u) - 1) % BLOCK if u.size == len(u) else 0  # bonds before the whole blocks
        return aligned_copy(u, odd), aligned_copy(v, odd)

    def bind(self, u: Array, v: Array, method: Method, dt: float) -> Any:
        """The compiled loop that advances the `arrays` of a state in place.

        Parameters
        ----------
        u, v, method, dt
            As of `tensegrity.engine.kernel.bind`; `u` in m, `v` in m/s.

        Returns
        -------
        Bound
        """
        return kernel.bind(u, v, self.loop_bonds, method, dt)

    def parts(self, method: Method) -> Sequence[Any]:
        """The groups of scenes that run in one loop each; none of a single scene."""
        return ()

    def listed(self, u: Array) -> Dynamics:
        """Dynamics with the contacts that can act near displacements u: all, for fixed bonds."""
        return self

    def listings(self, u: Array) -> Iterator[tuple[slice, Dynamics]]:
        """Slices of u (T, *shape), each with dynamics with the contacts that can act in it."""
        yield slice(len(u)), self

    def nearest(self, u: Array) -> Dynamics:
        """Dynamics with the contacts that can be expected to form in a run from displacements u."""
        return self

    def forces(self, u: Array) -> Array:
        """Forces on all sites [N], shape of u."""
        return self.scene.forces(u)

    @property
    def cost(self) -> int:
        """Cost of one evaluation of all forces, in bonds of a chain."""
        return len(self.scene.springs)

    def elongations(self, u: ArrayLike) -> Array:
        """Elongation of each bond and gap of each wall contact [m]; (..., springs), nan where u is
        nan."""
        u = check.rows("displacements", u, self.shape, are_finite=False)
        return forces.bond_elongations(self.contact_bonds, u)

    def evaluate(self, name: str, u: Array) -> Array:
        """Energy [J], tension [N] or stiffness [N/m] of each contact; (..., springs)."""
        return self.springs.evaluate(name, check.finite("elongation", self.elongations(u)))

    def energies(self, u: Array, v: Array) -> Array:
        """Total energy of each state [J], (states,); u and v (states, *shape)."""
        if self.acting.stores:
            stored = np.sum(self.acting.stored(0, u).reshape(len(u), -1), axis=-1)
            return self._of_bonds(u, v) + stored
        return self._of_bonds(u, v)

    def _of_bonds(self, u: Array, v: Array) -> Array:
        """The same without springs to the ground."""
        compiled = self.energies_in_one_call
        energies = None if compiled is None else compiled(u, v)
        if energies is not None:
            return energies
        scene, rows = self.scene, (len(u), -1)
        with np.errstate(over="ignore"):  # overflow gives inf, which `checked` refuses
            kinetic = np.sum(self.kinetic(v).reshape(rows), axis=-1)
        some = max(IN_CACHE // max(len(scene.springs), 1), 1)
        parts = [np.sum(self.evaluate("energy", u[k : k + some]), axis=-1)
                 for k in range(0, len(u), some)]  # fmt: skip
        bonds = np.concatenate(parts) if parts else np.zeros(0)
        return kinetic + bonds - np.sum((scene.loads * u).reshape(rows), axis=-1)

    @cached_property
    def energies_in_one_call(self) -> Energies | None:
        """Compiled energies of many states in one call; None if some law has no compiled form."""
        return self.springs.energies(self.scene.mass, self.contact_bonds.contacts)

    @cached_property
    def is_loaded(self) -> bool:
        """Whether constant loads act."""
        return bool(np.any(self.scene.loads))

    def checked(self, state: Any) -> float:
        """Refuse a state that the scene cannot have; return its energy [J]."""
        self.scene._check_sites(state)
        energy = float(self.energies(state.u[None], state.v[None])[0])  # refuses locked springs
        if not math.isfinite(energy):
            raise TensegrityError(f"energy {energy} J of the state must be finite")
        return energy

    def available_energy(self, state: Any, energy: float | None = None) -> float:
        """Upper bound on the energy of a single spring [J]: the energy of the state, if it is not
        given."""
        energy = self.scene.energy(state) if energy is None else energy
        return energy + self.scene._hidden_energy(state)

    def stiffness_bounds(self, ranges: Array, numbers: Indices | None = None) -> Array:
        """Bound on the axial and transverse stiffness of the bonds of each distinct spring.

        Parameters
        ----------
        ranges : ndarray, (springs, 2)
            Elongations [m].
        numbers : ndarray of int, optional
            Indices of the springs; by default all.

        Returns
        -------
        ndarray, (springs,) or shape of `numbers`
            [N/m]; inf where the two ends of a bond coincide.
        """
        springs = self.springs
        if numbers is None:
            if not self.turns and (ranges[:, 0] > self.zero_length_elongation).all():
                return springs.largest("stiffness", ranges)
            numbers = np.arange(len(springs))
        shortest = ranges[:, 0] - self.zero_length_elongation
        k, separate = np.full(len(numbers), np.inf), shortest[numbers] > 0
        within = numbers[separate]
        k[separate] = springs.largest("stiffness", ranges, within)
        if self.turns:
            across = springs.largest("tension", ranges, within) / shortest[within]
            k[separate] = np.maximum(k[separate], across)
        return k

    def frequency(self, ranges: Array) -> float:
        """Bound on the largest angular frequency [rad/s] over ranges of elongation [m]
        (springs, 2)."""
        return self.spring_frequency_bound(self.stiffness_bounds(np.asarray(ranges, dtype=float)))

    def bond_frequency_bound(self, stiffness: Array) -> float:
        """Bound on the largest angular frequency [rad/s], given the bonds' stiffnesses [N/m].

        The eigenvalues of M^-1 K do not exceed the maximum of 2 k (1/m_left + 1/m_right) over the
        bonds.
        """
        return math.sqrt(float(np.max(2 * stiffness * self._mobilities)) + self._on_site_bound)

    def spring_frequency_bound(self, stiffness: Array) -> float:
        """Bound on the largest angular frequency [rad/s], given a bound on the stiffness of each
        distinct spring [N/m], (springs,)."""
        bonds = 2 * float((stiffness * self._largest_mobilities).max())
        return math.sqrt(bonds + self._on_site_bound)

    @cached_property
    def _on_site_bound(self) -> float:
        """Largest stiffness over mass of the springs to the ground, at rest [1/s^2]."""
        stiffness = np.abs(self.acting.stored(2, np.zeros(self.shape)))
        return float(np.max(stiffness * self.inverse_mass))

    @property
    def _mobilities(self) -> Array:
        """1/m_left + 1/m_right of each bond [1/kg]; (sites - 1,)."""
        return self.inverse_mass[:-1] + self.inverse_mass[1:]

    @cached_property
    def _largest_mobilities(self) -> Array:
        """Largest mobility among the bonds of each distinct spring [1/kg]; (springs,)."""
        largest = np.zeros(len(self.springs))
        np.maximum.at(largest, self.springs.group, self._mobilities)
        return fixed(largest)

    def ranges_at(self, u: Array) -> Array:
        """Smallest and largest elongation of each distinct spring, 0 included [m]; (springs, 2)."""
        r, group = self.elongations(u), self.springs.group
        if len(self.springs) == 1:
            return np.array([[min(float(r.min()), 0.0), max(float(r.max()), 0.0)]])
        group = np.broadcast_to(group.reshape(*group.shape, *[1] * (r.ndim - group.ndim)), r.shape)
        ranges = by_spring(group.ravel(), len(self.springs), r.ravel(), r.ravel())
        return np.stack([np.minimum(ranges[:, 0], 0), np.maximum(ranges[:, 1], 0)], axis=1)

    def where_extreme(self, spring: int, u: Array, side: int) -> str:
        """Describe the contact in which a spring has its extreme elongation.

        Parameters
        ----------
        spring : int
            Index of a distinct spring in `springs`.
        u : ndarray, shape of the scene
            Displacements [m].
        side : {0, 1}
            0 for the smallest elongation, 1 for the largest.

        Returns
        -------
        str
        """
        contacts = np.flatnonzero(self.springs.group == spring)
        r = self.elongations(u)[contacts]
        return self._where(int(contacts[np.argmax(r) if side else np.argmin(r)]))

    def _where(self, bond: int) -> str:
        return f"between sites {bond} and {bond + 1}"

    def where_fastest(self, ranges: Array) -> str:
        """Name the scene of an ensemble with the largest bound on its frequency."""
        return ""

    def where_stiffest(self, u: Array, ranges: Array) -> str:
        """Describe the bond with the largest elongation in magnitude."""
        return self._where(int(np.argmax(np.abs(self.elongations(u)))))


def varied(scene: Any, **changed: Any) -> Any:
    """A scene with other values of some attributes, unchecked."""
    other = copy(scene)
    other.__dict__.update(changed)
    return other
