"""Types used in signatures, and the protocols between subpackages.

Arguments that are converted are `numpy.typing.ArrayLike`; results are the arrays below, whose
shapes and units are given in the docstrings.  `Mass` and the like are numbers with bounds; see
`tensegrity.checked`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any, Protocol, TypeAlias, TypeVar, runtime_checkable

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Flags: TypeAlias = NDArray[np.bool_]
Indices: TypeAlias = NDArray[np.int64]
Function = TypeVar("Function", bound=Callable[..., Any])
Number = TypeVar("Number", float, Array)  # the result has the type of the argument

# arguments of what is `checked`
Positive: TypeAlias = Annotated[float, "> 0"]
NotNegative: TypeAlias = Annotated[float, ">= 0"]
Fraction: TypeAlias = Annotated[float, "> 0", "< 1"]
FractionOrOne: TypeAlias = Annotated[float, "> 0", "<= 1"]
Quantile: TypeAlias = Annotated[float, ">= 0", "<= 1"]
Length: TypeAlias = Annotated[float, "> 0", "m"]
Distance: TypeAlias = Annotated[float, ">= 0", "m"]
Duration: TypeAlias = Annotated[float, "> 0", "s"]
Speed: TypeAlias = Annotated[float, "> 0", "m/s"]
Mass: TypeAlias = Annotated[float, "> 0", "kg"]
Stiffness: TypeAlias = Annotated[float, "> 0", "N/m"]
StiffnessOrInf: TypeAlias = Annotated[float, "> 0", "or inf", "N/m"]
Preload: TypeAlias = Annotated[float, ">= 0", "N"]
Count: TypeAlias = Annotated[int, ">= 1"]
Order: TypeAlias = Annotated[int, ">= 1", "< 4"]  # of an expansion
Sides: TypeAlias = Annotated[int, ">= 3"]
Index: TypeAlias = Annotated[int, ">= 0"]


@runtime_checkable
class Motion(Protocol):
    """Displacements and velocities: a State, or all recorded rows of a Run.

    What depends on positions only takes their array u; what depends on velocities too takes these.
    """

    @property
    def u(self) -> Array:
        """Displacements [m]."""

    @property
    def v(self) -> Array:
        """Velocities [m/s], shape of u."""


@runtime_checkable
class Sampled(Protocol):
    """Samples of a quantity, such as a `TimeSeries`."""

    @property
    def t(self) -> Array:
        """Instants [s], (T,)."""

    @property
    def values(self) -> Array:
        """(T,)."""


@runtime_checkable
class SceneData(Protocol):
    """A scene: data for `tensegrity.scenes.dynamics`, without any state of a run."""

    sites: int
    dim: int
    mass: Array  # [kg], (sites,)
    held: Sequence[int]  # fixed sites
    loads: Any  # constant forces [N], of the shape of u or 0
    springs: Sequence[Any]  # the Potential of each bond
    drive: Mapping[int, Any]  # {site: Drive}
    damping: Any  # Damping or None

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of u and v: (sites,) of a chain, (sites, dim) of a network."""


@runtime_checkable
class LawForms(Protocol):
    """A force law that the engine can compile."""

    @property
    def parameters(self) -> tuple[Any, ...]:
        """Names or symbols of the quantities that differ between springs of the same law."""

    def forms(self) -> tuple[Any, Any, Sequence[Any]]:
        """Elongation and parameters as CasADi symbols, and expressions of the energy [J], tension
        [N], stiffness [N/m] and its derivative [N/m^2]."""


@runtime_checkable
class Observer(Protocol):
    """An observer of a march; see `tensegrity.runs.march`."""

    def wanted(self, end: int) -> Sequence[Any]:
        """The states requested of an attempt to advance to step `end`, with arrays for them."""

    def take(self, motion: Any) -> None:
        """Take these states, once the attempt is accepted."""


class Members(Protocol):
    """The numbers that describe a prism; see `Prism`."""

    @property
    def base(self) -> float:
        """[m]."""

    @property
    def height(self) -> float:
        """[m]."""

    @property
    def prestrain(self) -> float:
        """Of the cross strings."""

    @property
    def k_cross(self) -> float:
        """[N/m]."""

    @property
    def k_base(self) -> float:
        """[N/m]; inf is rigid."""

    @property
    def k_bar(self) -> float:
        """[N/m]; inf is rigid."""

    @property
    def sides(self) -> int:
        """Of the base."""
