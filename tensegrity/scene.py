"""What every scene that `simulate` runs is made of: states, and what its parts have in common."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check
from tensegrity.errors import TensegrityError

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from typing import Any

    from numpy.typing import ArrayLike

    from tensegrity.methods import Method
    from tensegrity.potential import Potential
    from tensegrity.typing import Array, Indices

SMALLEST_MASS = 1e-300  # kg: its inverse is still a number
KINK_SHARE = 1 / 16  # of a default step where contacts open: the force has a kink there


@dataclass(frozen=True, eq=False)
class State:
    """Displacements and velocities of all sites.

    Parameters
    ----------
    u : ndarray of float64, (sites,) or (sites, dim)
        Displacement [m]; of a chain, > 0 towards higher sites.
    v : ndarray of float64, shape of u
        Velocity [m/s].
    """

    u: Array
    v: Array

    if TYPE_CHECKING:  # what converts is taken, arrays are kept

        def __init__(self, u: ArrayLike, v: ArrayLike) -> None: ...

    def __post_init__(self) -> None:
        shape = np.shape(self.u)
        if len(shape) not in (1, 2):
            raise TensegrityError(f"displacement has {len(shape)} dimensions, must have 1 or 2")
        object.__setattr__(self, "u", check.vector("displacement", self.u, shape))
        object.__setattr__(self, "v", check.vector("velocity", self.v, shape))

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


class Scene:
    """Base of scenes; `mass` (sites,), `held` and `shape` are theirs.

    Attributes
    ----------
    step_share : float
        Of the default step that a method takes for smooth springs.
    closing : float or ndarray
        Elongation [m] at which the ends of each bond meet, -inf where they cannot.
    """

    step_share: float = 1.0
    closing: float | Array = -np.inf
    sites: int
    mass: Array
    clearance: Any  # a `Clearance`, or None
    if TYPE_CHECKING:  # what `simulate` asks of every scene besides

        @property
        def held(self) -> Sequence[int]: ...
        @property
        def shape(self) -> tuple[int, ...]: ...
        @property
        def cost(self) -> int: ...
        @property
        def wall_count(self) -> int: ...
        def check(self, state: State) -> None: ...
        def energy(self, state: State) -> float: ...
        def watched(self) -> tuple[list[Potential], Indices]: ...
        def present_ranges(self, u: Array) -> Array: ...
        def frequency(self, ranges: Array) -> float: ...
        def arrays(self, state: State) -> tuple[Array, Array]: ...
        def bind(self, u: Array, v: Array, method: Method, dt: float) -> Any: ...
        def extreme(self, row: int, u: Array, side: int) -> str: ...
        def stiffest(self, u: Array, ranges: Array) -> str: ...

    @cached_property
    def inverse_mass(self) -> Array:
        """1/m [1/kg], 0 for a held site; (sites,)."""
        w = 1 / self.mass
        w[self.held] = 0
        return w

    def available_energy(self, state: State) -> float:
        """What one spring could get of the energy [J]: all of it."""
        return self.energy(state)

    def finer_share(self, met: Array) -> float | None:
        """Share of a default step for a second run, from the elongations that the first met.

        None where the first run stands.
        """
        return None

    def _refuse_other(self, state: object, words: str) -> None:
        """Refuse what is no state of this shape; `words` say what the shape is."""
        if not isinstance(state, State):
            raise TensegrityError(f"state is {type(state).__name__}, not a State")
        if state.u.shape != self.shape:
            raise TensegrityError(f"state has shape {state.u.shape}, the {words}")


def velocities(given: Mapping[int, Any] | None) -> Iterable[tuple[int, Any]]:
    """Pairs of a site and its velocity, from a dict or None."""
    if not isinstance(given or {}, Mapping):
        raise TensegrityError(f"velocity {given!r} must be a dict {{site: velocity}}")
    return (given or {}).items()


def law_table(springs: Sequence[Potential]) -> tuple[tuple[Any, ...], Indices, Array]:
    """The different laws, the number of each spring's, and its parameters; (springs, most)."""
    laws = tuple(dict.fromkeys(spring._law for spring in springs))
    width = max((len(spring._values) for spring in springs), default=0)
    parameters = np.zeros((len(springs), width))
    for row, spring in zip(parameters, springs, strict=True):
        row[: len(spring._values)] = spring._values
    return laws, np.array([laws.index(spring._law) for spring in springs], dtype=int), parameters
