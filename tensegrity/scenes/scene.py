"""What every scene that `simulate` runs is made of: states, and what its parts have in common."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check
from tensegrity.engine import forces
from tensegrity.errors import TensegrityError
from tensegrity.readonly import FixedDict
from tensegrity.scenes.dynamics import HasDynamics, dynamics
from tensegrity.scenes.forcing import checked_forcing

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from typing import Any

    from numpy.typing import ArrayLike

    from tensegrity.scenes.forcing import Damping, Drive
    from tensegrity.springs.potential import Potential
    from tensegrity.typing import Array

BYTES_PER_SITE = 176  # bytes that a run takes for each site, its rows apart
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


def unchecked_state(u: Array, v: Array) -> State:
    """A state of arrays that are known to be right."""
    state = object.__new__(State)
    state.__dict__.update(u=u, v=v)
    return state


class Scene(HasDynamics):
    """Base of scenes: masses joined by bonds, as data.

    A scene has `sites` of `dim` coordinates, their `mass` (sites,), the numbers of those `held`,
    constant `loads` [N], the `shape` of u, and one of `springs` for each bond.  What its motion
    needs besides is computed from these by `tensegrity.scenes.dynamics`.

    What a scene is built from cannot be changed; make another one.  Scenes of equal content are
    equal.

    Attributes
    ----------
    drive : dict of int to Drive
        Motions that are prescribed, and forces that depend on time, of some sites.
    damping : Damping or None
        Dashpots.
    tune : dict of str to expression, or callable t -> Potential
        Arguments of the springs that depend on time, or the spring of an instant.
    """

    drive: Mapping[int, Drive] = FixedDict()
    damping: Damping | None = None
    tune: Any = FixedDict()
    sites: int
    dim: int
    mass: Array
    loads: Any
    springs: tuple[Potential, ...]
    held: Sequence[int]
    shape: tuple[int, ...]
    _shape_text: str
    if TYPE_CHECKING:

        def elongation(self, u: ArrayLike) -> Array: ...
        def bond_energy(self, u: Array) -> Array: ...
        def bond_tension(self, u: Array) -> Array: ...
        def site_energy(self, u: Array, v: Array) -> Array: ...
        def momentum(self, state: State) -> Any: ...
        def at_rest(self, velocity: Any = None) -> State: ...
        def _check_sites(self, state: State) -> None: ...

    def _set_forcing(self, drive: Any, damping: Any, tune: Any = None) -> None:
        """Keep what drives, damps and tunes the scene, if it fits."""
        self.__dict__.update(checked_forcing(self, drive, damping, tune))

    def check(self, state: State) -> None:
        """Refuse a state that is not one of this scene.

        Parameters
        ----------
        state : State

        Raises
        ------
        TensegrityError
            It has another shape, moves a held site, brings unlisted sites into contact, or a spring
            out of its domain.
        """
        dynamics(self).checked(state)

    def energy(self, state: State) -> float:
        """Total energy [J], the potential of the loads included."""
        self._refuse_other(state)
        return float(dynamics(self).energies(state.u[None], state.v[None])[0])

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
        of = dynamics(self)
        tension = of.springs.evaluate("tension", r)
        pull = forces.scattered_forces(of.contact_bonds, tension, along)[: self.sites].reshape(
            u.shape
        )
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
        of = dynamics(self)
        tension, stiffness = (of.springs.evaluate(x, r) for x in ("tension", "stiffness"))
        found = forces.tangent(of.contact_bonds, r, along, tension, stiffness)
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
        return u, *forces.elongations(dynamics(self).contact_bonds, u)

    def _refuse_other(self, state: object) -> None:
        refuse_other(state, self.shape, self._shape_text)

    def _checked_rows(self, u: ArrayLike, v: ArrayLike) -> tuple[Array, Array]:
        """Displacements and velocities of one state or of many, checked."""
        u, v = check.rows("displacements", u, self.shape), check.rows("velocities", v, self.shape)
        if u.shape != v.shape:
            raise TensegrityError(f"displacements have shape {u.shape}, velocities {v.shape}")
        return u, v


def refuse_other(state: object, shape: tuple[int, ...], words: str) -> None:
    """Refuse what is no state of this shape, which a scene has as it says in words."""
    if not isinstance(state, State):
        raise TensegrityError(f"state is {type(state).__name__}, not a State")
    if state.u.shape != shape:
        raise TensegrityError(f"state has shape {state.u.shape}, the {words}")


def velocities(given: Mapping[int, Any] | None) -> Iterable[tuple[int, Any]]:
    """Pairs of a site and its velocity, from a dict or None."""
    given = {} if given is None else given
    if not isinstance(given, Mapping):
        raise TensegrityError(f"velocity {check.shown(given)} must be a dict {{site: velocity}}")
    return given.items()
