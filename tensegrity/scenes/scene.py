"""What every scene that `simulate` runs is made of: states, and what its parts have in common."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check
from tensegrity.engine import forces, kernel
from tensegrity.engine.bonds import Bonds, by_spring
from tensegrity.engine.openings import is_treated
from tensegrity.errors import TensegrityError
from tensegrity.readonly import FixedDict, ReadOnly, fixed
from tensegrity.scenes.forcing import checked
from tensegrity.springs.collection import Springs

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from typing import Any

    from numpy.typing import ArrayLike

    from tensegrity.engine.methods import Method
    from tensegrity.scenes.forcing import Damping, Drive
    from tensegrity.springs.potential import Potential
    from tensegrity.typing import Array, Indices

PER_SITE = 176  # bytes that a run takes for each site, its rows apart
SMALLEST_MASS = 1e-300  # kg: its inverse is still a number


@dataclass(frozen=True, eq=False)
class State:
    """Displacements and velocities of all sites.

    Parameters
    ----------
    u : array_like, (sites,) or (sites, dim)
        Displacement [m]; of a chain, > 0 towards higher sites.  Kept as an array of float64,
        C-contiguous: integers, other floats, views and lists are converted, what is right already
        is not copied.
    v : array_like, shape of u
        Velocity [m/s], likewise.

    Raises
    ------
    TensegrityError
        What is not made of real numbers (complex ones, truth values, text), or not finite, or of
        another shape.
    """

    u: Array
    v: Array

    if TYPE_CHECKING:  # what converts is taken, arrays are kept

        def __init__(self, u: ArrayLike, v: ArrayLike) -> None: ...

    def __post_init__(self) -> None:
        u = check.floats("displacement", self.u)
        if u.ndim not in (1, 2, 3):
            raise TensegrityError(f"displacement has {u.ndim} dimensions, must have 1 to 3")
        object.__setattr__(self, "u", check.vector("displacement", u, u.shape))
        object.__setattr__(self, "v", check.vector("velocity", self.v, u.shape))

    def __add__(self, other: State) -> State:
        """Superposition, for waves too far apart to act on each other."""
        if not isinstance(other, State):
            return NotImplemented
        if self.u.shape != other.u.shape:
            raise TensegrityError(f"states of {self.u.size} and {other.u.size} sites do not add")
        return State(self.u + other.u, self.v + other.v)

    def reversed(self) -> State:
        """The state from which time runs backwards."""
        return State(self.u.copy(), -self.v)


class Remembered:
    """What runs of a scene know of it; without it they find the same again.

    Attributes
    ----------
    ranges : list of (ndarray, ndarray, float)
        Ranges of elongation (springs, 2) [m] that runs met lately, how stiff each spring is at
        most there [N/m], and the angular frequency that this bounds [rad/s].
    reached : dict of float to Reach
        What springs reach with energies [J] in one bond.
    tuned : dict of (float, float) to Tuned
        Springs that change, prepared for runs of some duration, and before and after [s].
    gain : float or None
        Seconds that fitted forces save in one evaluation of all, roughly.
    plans : dict of Method to list
        Loops that are prepared for runs, and not in use.
    """

    def __init__(self) -> None:
        self.gain: float | None = None
        self.plans: dict[Method, list[Any]] = {}
        self.ranges: list[tuple[Array, Array, float]] = []
        self.reached: dict[float, Any] = {}
        self.tuned: dict[float, Any] = {}


def known_state(u: Array, v: Array) -> State:
    """A state of arrays that are known to be right."""
    state = object.__new__(State)
    state.__dict__.update(u=u, v=v)
    return state


class Scene(ReadOnly):
    """Base of scenes, and what `simulate` asks of one.

    A scene has `sites` of `dim` coordinates, their `mass` (sites,), the numbers of those `held`,
    constant `loads` [N], the `shape` of u, and one of `springs` for each bond.  It says what
    `elongation(u)` its bonds have, what its `energy(state)` is, and with `frequency_of(k)` how
    fast it vibrates at most where its bonds are not stiffer than k; the rest follows, or has a
    default here.

    What a scene is built from cannot be changed; make another one.

    Attributes
    ----------
    closing : float or ndarray
        Elongation [m] at which the ends of a bond of each different spring meet, -inf where they
        cannot.
    spring_lengths : ndarray, (springs,), or None
        Length of each bond [m], where springs count as different for it.
    follows : bool
        Whether contacts come and go, so that only those near are listed.
    turns : bool
        Whether bonds may turn, so that their tension resists motion across them.
    clearance : Clearance or None
        What watches over contacts that are not listed.
    wall_count : int
        Number of walls.
    drive : dict of int to Drive
        Motions that are prescribed, and forces that depend on time, of some sites.
    damping : Damping or None
        Dashpots.
    tune : dict of str to expression
        Arguments of the springs that depend on time.
    energies_at_once : Energies or None
        The energies of many states in one call, where they are compiled.
    """

    closing: float | Array = -np.inf
    turns: bool = False
    follows: bool = False
    spring_lengths: Array | None = None
    clearance: Any = None
    wall_count: int = 0
    drive: Mapping[int, Drive] = FixedDict()
    damping: Damping | None = None
    tune: Mapping[str, Any] = FixedDict()
    energies_at_once: Any = None
    sites: int
    dim: int
    mass: Array
    loads: Any
    springs: tuple[Potential, ...]
    held: Sequence[int]
    shape: tuple[int, ...]
    cost: int
    _words: str
    if TYPE_CHECKING:  # what `simulate` asks of every scene besides

        def check(self, state: State) -> float: ...
        def energy(self, state: State) -> float: ...
        def elongation(self, u: ArrayLike) -> Array: ...
        def bond_energy(self, u: Array) -> Array: ...
        def bond_tension(self, u: Array) -> Array: ...
        def site_energy(self, u: Array, v: Array) -> Array: ...
        def momentum(self, state: State) -> Any: ...
        def frequency_of(self, stiffness: Array) -> float: ...
        def extreme(self, spring: int, u: Array, side: int) -> str: ...
        def stiffest(self, u: Array, ranges: Array) -> str: ...
        def at_rest(self, velocity: Any = None) -> State: ...
        def with_springs(self, springs: Sequence[Potential]) -> Scene: ...

    def _set_forcing(self, drive: Any, damping: Any, tune: Any = None) -> None:
        """Keep what drives, damps and tunes the scene, if it fits."""
        self.__dict__.update(checked(self, drive, damping, tune))

    @property
    def is_driven(self) -> bool:
        """Whether forces depend on time or velocity, or motion is prescribed."""
        return bool(self.drive or self.damping or self.tune)

    @cached_property
    def inverse_mass(self) -> Array:
        """1/m [1/kg], 0 for a held site; (sites,)."""
        w = 1 / self.mass
        w[list(self.held)] = 0
        return fixed(w)

    @cached_property
    def remembered(self) -> Remembered:
        """What its runs found out and the next one need not."""
        return Remembered()

    @cached_property
    def spring_table(self) -> Springs:
        """The different springs, and which bond has which."""
        return Springs(self.springs, lengths=self.spring_lengths)

    @cached_property
    def smooth(self) -> bool:
        """Whether the derivatives of no spring jump."""
        return all(spring.smooth for spring in self.spring_table.different)

    @cached_property
    def opens(self) -> bool:
        """Whether some contact can open, of an exponent for which steps are corrected."""
        return self.follows or bool(is_treated(self.spring_table.openings[..., 2]).any())

    @cached_property
    def loop_bonds(self) -> Bonds:
        """Bonds as the loop takes them."""
        springs = self.spring_table
        return Bonds(*springs.table, springs.group, self.inverse_mass, openings=springs.openings)

    def is_alike(self, other: Scene) -> bool:
        """Whether states of one scene fit the other, bond for bond."""
        mine, others = ((x.shape, len(x.springs), x.wall_count) for x in (self, other))
        return mine == others and self.turns == other.turns

    def arrays(self, state: State) -> tuple[Array, Array]:
        """Copies of u and v as the loop advances them, with rows for walls behind the sites."""
        return state.u.copy(), state.v.copy()

    def bind(self, u: Array, v: Array, method: Method, dt: float) -> Any:
        """This scene in the loop, advancing the rows of `arrays` in place."""
        return kernel.bind(u, v, self.loop_bonds, method, dt)

    def stretch(self, u: ArrayLike) -> Array:
        """Elongation of every spring [m]: of bonds, and behind them of wall contacts."""
        return self.elongation(u)

    def stiffness_within(self, ranges: Array, numbers: Indices | None = None) -> Array:
        """Bound on the stiffness of a bond of each spring, along it and across.

        Parameters
        ----------
        ranges : ndarray, (springs, 2)
            Elongations [m].
        numbers : ndarray of int, optional
            The springs that are asked for; by default all.

        Returns
        -------
        ndarray, (springs,) or shape of `numbers`
            [N/m]; inf where the ends of a bond meet.
        """
        springs = self.spring_table
        if numbers is None:
            if not self.turns and (ranges[:, 0] > self.closing).all():
                return springs.largest("stiffness", ranges)
            numbers = np.arange(len(springs))
        shortest = ranges[:, 0] - self.closing
        k, apart = np.full(len(numbers), np.inf), shortest[numbers] > 0
        within = numbers[apart]
        k[apart] = springs.largest("stiffness", ranges, within)
        if self.turns:
            across = springs.largest("tension", ranges, within) / shortest[within]
            k[apart] = np.maximum(k[apart], across)
        return k

    def frequency(self, ranges: Array) -> float:
        """Bound on the largest angular frequency [rad/s] over given ranges (springs, 2)."""
        return self.fastest(self.stiffness_within(np.asarray(ranges, dtype=float)))

    def fastest(self, stiffness: Array) -> float:
        """The same for a bound of the stiffness of each spring [N/m], (springs,)."""
        if np.isinf(stiffness).any():
            return np.inf  # the two sites of a bond coincide
        return self.frequency_of(stiffness[self.spring_table.group])

    def present_ranges(self, u: Array) -> Array:
        """Smallest and largest elongation, 0 included, of each different spring; (springs, 2)."""
        r, group = self.stretch(u), self.spring_table.group
        if len(self.spring_table) == 1:
            return np.array([[min(float(r.min()), 0.0), max(float(r.max()), 0.0)]])
        group = np.broadcast_to(group.reshape(*group.shape, *[1] * (r.ndim - group.ndim)), r.shape)
        ranges = by_spring(group.ravel(), len(self.spring_table), r.ravel(), r.ravel())
        return np.stack([np.minimum(ranges[:, 0], 0), np.maximum(ranges[:, 1], 0)], axis=1)

    def listed(self, u: Array) -> Scene:
        """The scene with the contacts that may act near displacements u: here it has them all."""
        return self

    def likely(self, u: Array) -> Scene:
        """The scene with contacts that may well form in a run from displacements u."""
        return self

    def energies(self, u: Array, v: Array) -> Array:
        """Total energy [J] of each of many states; u and v (states, *shape of the scene)."""
        return np.array([self.energy(State(*pair)) for pair in zip(u, v, strict=True)])

    def available_energy(self, state: State, energy: float | None = None) -> float:
        """What one spring could get of the energy [J], all of it; what `check` said, if known."""
        return self.energy(state) if energy is None else energy

    @property
    def contact_bonds(self) -> Bonds:
        """Bonds with their geometry, which a loop over neighbours in a row does without."""
        return self.loop_bonds

    def forces(self, u: ArrayLike) -> Array:
        """Forces on all sites at rest.

        Parameters
        ----------
        u : array_like, shape of the scene
            Displacements [m].

        Returns
        -------
        ndarray, shape of u
            [N], loads included; 0 at held sites.  Elongations count from the loaded equilibrium,
            so that the ends of a preloaded chain carry the preload.
        """
        u, r, along = self._elongated(u)
        tension = self.spring_table.evaluate("tension", r)
        pull = forces.pulls(self.contact_bonds, tension, along)[: self.sites].reshape(u.shape)
        pull = pull + self.loads
        pull[list(self.held)] = 0
        return pull

    def stiffness(self, u: ArrayLike) -> Any:
        """Derivative of `-forces(u)` in the displacements of the sites that are free.

        Parameters
        ----------
        u : array_like, shape of the scene
            Displacements [m].

        Returns
        -------
        scipy.sparse.csr_array, (u.size, u.size)
            [N/m], symmetric; rows and columns in the order of u.ravel(), those of held sites 0.
        """
        from scipy.sparse import csr_array

        u, r, along = self._elongated(u)
        tension, stiffness = (self.spring_table.evaluate(x, r) for x in ("tension", "stiffness"))
        found = forces.tangent(self.contact_bonds, r, along, tension, stiffness)
        free = np.ones(u.shape, dtype=bool)
        free[list(self.held)] = False
        free = np.append(free.ravel(), np.zeros(found.shape[0] - u.size, dtype=bool))
        kept = free[found.row] & free[found.col]
        entries = found.data[kept], (found.row[kept], found.col[kept])
        return csr_array(entries, shape=(u.size, u.size))

    def _elongated(self, u: ArrayLike) -> tuple[Array, Array, Array]:
        """Displacements that were checked, elongations there, and the directions of bonds."""
        u = check.vector("displacement", u, self.shape)
        self.check(State(u, np.zeros(self.shape)))
        return u, *forces.elongations(self.contact_bonds, u)

    def _refuse_other(self, state: object) -> None:
        """Refuse what is no state of this shape."""
        if not isinstance(state, State):
            raise TensegrityError(f"state is {type(state).__name__}, not a State")
        if state.u.shape != self.shape:
            raise TensegrityError(f"state has shape {state.u.shape}, the {self._words}")

    def _rows(self, u: ArrayLike, v: ArrayLike) -> tuple[Array, Array]:
        """Displacements and velocities of one state or of many, checked."""
        u, v = check.rows("displacements", u, self.shape), check.rows("velocities", v, self.shape)
        if u.shape != v.shape:
            raise TensegrityError(f"displacements have shape {u.shape}, velocities {v.shape}")
        return u, v


def velocities(given: Mapping[int, Any] | None) -> Iterable[tuple[int, Any]]:
    """Pairs of a site and its velocity, from a dict or None."""
    given = {} if given is None else given
    if not isinstance(given, Mapping):
        raise TensegrityError(f"velocity {check.shown(given)} must be a dict {{site: velocity}}")
    return given.items()
