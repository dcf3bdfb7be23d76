"""States, and the base class of the scenes that `simulate` runs: masses joined by bonds, as data,
with the energy, forces and tangent stiffness that follow from them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check
from tensegrity.engine import forces
from tensegrity.errors import TensegrityError
from tensegrity.printing import concise, printed
from tensegrity.readonly import FixedDict
from tensegrity.scenes.dynamics import HasDynamics, dynamics
from tensegrity.scenes.force import place_counts
from tensegrity.scenes.forcing import checked_forcing
from tensegrity.typing import Motion

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence
    from typing import Any, Self

    from numpy.typing import ArrayLike

    from tensegrity.scenes.force import Force
    from tensegrity.scenes.forcing import Damping, Drive
    from tensegrity.springs.potential import Potential
    from tensegrity.typing import Array

BYTES_PER_SITE = 176  # memory of a run per site, not counting its recorded rows
SMALLEST_MASS = 1e-300  # kg: its inverse is finite


@dataclass(frozen=True, eq=False)
class State:
    """Displacements and velocities of all sites.

    Parameters
    ----------
    u : array_like, (sites,) or (sites, dim)
        Displacement [m]; of a chain, > 0 towards higher sites.  Stored as a C-contiguous array of
        float64: integers, other floats, views and lists are converted; an array that already has
        this form is not copied.
    v : array_like, shape of u
        Velocity [m/s], of the same sign and stored in the same way.

    Raises
    ------
    TensegrityError
        Values that are not real numbers (complex numbers, Booleans, text) or not finite, or
        shapes that differ.

    Examples
    --------
    >>> from tensegrity import State
    >>> state = State(u=[0, 0, 0], v=[0.1, 0, 0])
    >>> print(state.u, state.v)
    [0. 0. 0.] [0.1 0.  0. ]
    """

    u: Array
    v: Array

    __repr__ = __str__ = printed(u="m", v="m/s")

    if TYPE_CHECKING:  # what converts is taken, arrays are kept

        def __init__(self, u: ArrayLike, v: ArrayLike) -> None: ...

    def __post_init__(self) -> None:
        u = check.floats("displacement", self.u)
        if u.ndim not in (1, 2, 3):
            raise TensegrityError(f"displacement has {u.ndim} dimensions, must have 1 to 3")
        object.__setattr__(self, "u", check.vector("displacement", u, u.shape))
        object.__setattr__(self, "v", check.vector("velocity", self.v, u.shape))

    def __add__(self, other: State) -> State:
        """Superposition, for waves that are too far from each other to interact."""
        if not isinstance(other, State):
            return NotImplemented
        if self.u.shape != other.u.shape:
            raise TensegrityError(f"states of {self.u.size} and {other.u.size} sites do not add")
        return State(self.u + other.u, self.v + other.v)

    def reversed(self) -> State:
        """The state from which time runs backwards."""
        return State(self.u.copy(), -self.v)


def unchecked_state(u: Array, v: Array) -> State:
    """A state of arrays that have been validated already."""
    state = object.__new__(State)
    state.__dict__.update(u=u, v=v)
    return state


class Scene(HasDynamics):
    """Base class of scenes: masses joined by bonds, as data.

    A scene has `sites` of `dim` coordinates each, their `mass` (sites,), the indices of the sites
    that are `held`, constant `loads` [N], the `shape` of u, and in `springs` one potential for each
    bond; of one that changes with time, functions of a state take that at t = 0.  The quantities
    that a run derives from these are in `tensegrity.scenes.dynamics`.

    Scenes are immutable, and equal if their contents are equal.

    Attributes
    ----------
    drive : dict of int to Drive
        Prescribed motions of sites, and forces that depend on time.
    damping : Damping or None
        Dashpots.
    bond_mass : ndarray, (bonds,), or None
        Of a network whose bonds have mass [kg].
    """

    __str__ = concise
    drive: Mapping[int, Drive] = FixedDict()
    damping: Damping | None = None
    bond_mass: Array | None = None
    _forces: tuple[Force, ...] = ()
    _arguments_of_sites: tuple[str, ...] = ()
    sites: int
    dim: int
    mass: Array
    loads: Any
    springs: Sequence[Potential]
    held: Sequence[int]
    shape: tuple[int, ...]
    _shape_text: str
    if TYPE_CHECKING:

        def site_energy(self, state: Motion) -> Array: ...
        def momentum(self, state: State) -> Any: ...
        def at_rest(self, velocity: Any = None) -> State: ...
        def _check_sites(self, state: State) -> None: ...
        def _by_argument(
            self, name: str, by_mass: Array, by_spring: Callable[[str], Array], by_gap: Any
        ) -> Array: ...

    def __new__(cls, *_: Any, **given: Any) -> Self:
        if "tune" in given:
            raise TensegrityError("tune is no argument: give springs `.over_time(name=expression)`")
        return super().__new__(cls)

    def _set_forcing(self, drive: Any, damping: Any, forces: Any = ()) -> None:
        """Set the validated attributes `drive`, `damping` and `_forces`."""
        self.__dict__.update(checked_forcing(self, drive, damping, forces))
        of = dynamics(self)
        acting = of.acting  # refuses forces on places that do not exist
        if of.springs.changing and not acting.splits:
            raise TensegrityError("springs that change exclude forces but of time and dashpots")

    def check(self, state: State) -> None:
        """Refuse a state that this scene cannot have.

        Parameters
        ----------
        state : State

        Raises
        ------
        TensegrityError
            The state has another shape, moves a held site, has unlisted sites in contact, or has a
            spring outside its domain.
        """
        dynamics(self).checked(state)

    def elongation(self, u: ArrayLike) -> Array:
        """Elongation of each bond [m]; u (..., *shape of the scene) gives (..., bonds)."""
        r = dynamics(self).elongations(u)[..., : place_counts(self)["bonds"]]
        return check.finite("elongation", r)

    def bond_energy(self, u: ArrayLike) -> Array:
        """Energy of each bond [J]; u as for `elongation`, (..., bonds)."""
        return dynamics(self).evaluate("energy", u)[..., : place_counts(self)["bonds"]]

    def bond_tension(self, u: ArrayLike) -> Array:
        """Tension of each bond [N]; u as for `elongation`, (..., bonds)."""
        return dynamics(self).evaluate("tension", u)[..., : place_counts(self)["bonds"]]

    def energy(self, state: State) -> float:
        """Total energy of a state [J], including the potential of the loads."""
        self._refuse_other(state)
        return float(dynamics(self).energies(state.u[None], state.v[None])[0])

    def forces(self, u: ArrayLike) -> Array:
        """Static forces on all sites: those of the bonds, of springs to the ground, and constant
        loads.

        Parameters
        ----------
        u : array_like, shape of the scene
            Displacements [m].

        Returns
        -------
        ndarray, shape of u
            [N]; 0 at held sites.  Elongations are measured from the loaded equilibrium, so that
            the ends of a preloaded chain carry the preload.
        """
        u, r, along = self._elongated(u)
        of = dynamics(self)
        tension = of.springs.evaluate("tension", r)
        total = forces.scattered_forces(of.contact_bonds, tension, along)[: self.sites].reshape(
            u.shape
        )
        total = total + self.loads - of.acting.stored(1, u)
        total[list(self.held)] = 0
        return total

    def stiffness(self, u: ArrayLike) -> Any:
        """Tangent stiffness matrix: the derivative of `-forces(u)` in u at the free sites.

        Parameters
        ----------
        u : array_like, shape of the scene
            Displacements [m].

        Returns
        -------
        scipy.sparse.csr_array, (u.size, u.size)
            [N/m], symmetric; rows and columns in the order of u.ravel(), 0 at held sites.
        """
        from scipy.sparse import csr_array, diags_array

        u, r, along = self._elongated(u)
        of = dynamics(self)
        tension, stiffness = (of.springs.evaluate(x, r) for x in ("tension", "stiffness"))
        tangent = forces.tangent(of.contact_bonds, r, along, tension, stiffness, u)
        free = np.ones(u.shape, dtype=bool)
        free[list(self.held)] = False
        ground = of.acting.stored(2, u) * free
        free = np.append(free.ravel(), np.zeros(tangent.shape[0] - u.size, dtype=bool))
        both = free[tangent.row] & free[tangent.col]
        entries = tangent.data[both], (tangent.row[both], tangent.col[both])
        bonds = csr_array(entries, shape=(u.size, u.size))
        return bonds + diags_array(ground.ravel(), format="csr") if ground.any() else bonds

    def _elongated(self, u: ArrayLike) -> tuple[Array, Array, Array]:
        """Validated displacements, their elongations, and the directions of the bonds."""
        u = check.vector("displacement", u, self.shape)
        self.check(State(u, np.zeros(self.shape)))
        return u, *forces.elongations(dynamics(self).contact_bonds, u)

    def _hidden_energy(self, state: State) -> float:
        """What a single spring may have beyond the energy of a state [J]."""
        return 0.0

    def _refuse_other(self, state: object) -> None:
        refuse_other(state, self.shape, self._shape_text)

    def _checked_rows(self, state: Motion) -> tuple[Array, Array]:
        """Validated displacements and velocities of one state or of many."""
        if not isinstance(state, Motion):
            raise TensegrityError(f"state {check.shown(state)} is neither a State nor a Run")
        u = check.rows("displacements", state.u, self.shape)
        v = check.rows("velocities", state.v, self.shape)
        if u.shape != v.shape:
            raise TensegrityError(f"displacements have shape {u.shape}, velocities {v.shape}")
        return u, v


def refuse_other(state: object, shape: tuple[int, ...], words: str) -> None:
    """Refuse anything but a state of the required shape.

    Parameters
    ----------
    state : object
    shape : tuple of int
        Required shape of u.
    words : str
        Description of this shape for the message, such as "chain has (10,) sites".

    Raises
    ------
    TensegrityError
        Another type or shape.
    """
    if not isinstance(state, State):
        raise TensegrityError(f"state is {type(state).__name__}, not a State")
    if state.u.shape != shape:
        raise TensegrityError(f"state has shape {state.u.shape}, the {words}")


def momenta(scene: Any, v: Array) -> Array:
    """Total momenta of rows of velocities, (rows,) or (rows, dim); with a `PairLaw` of its free
    coordinates."""
    if scene.mass.ndim == 1:
        return np.einsum("s,ts...->t...", dynamics(scene).row_mass, v)
    law = scene.springs[0]
    free = np.array(law.free)
    if not free.any():
        names = ", ".join(law.coordinates)
        raise TensegrityError(f"no momentum: no coordinate of the pair law ({names}) is free")
    return np.einsum("sd,tsd->td", scene.mass[:, free], v[..., free])


def velocities(given: Mapping[int, Any] | None) -> Iterable[tuple[int, Any]]:
    """Pairs of a site and its velocity, from a dict or None (no pairs)."""
    given = {} if given is None else given
    if not isinstance(given, Mapping):
        raise TensegrityError(f"velocity {check.shown(given)} must be a dict {{site: velocity}}")
    return given.items()
