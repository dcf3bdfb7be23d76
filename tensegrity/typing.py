"""Types that signatures share: names for a type checker, nothing is computed here.

Arguments that are converted are `numpy.typing.ArrayLike`; what comes back is one of the arrays
below, whose shapes and units stand in the docstrings.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol, TypeAlias, TypeVar, runtime_checkable

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Flags: TypeAlias = NDArray[np.bool_]
Indices: TypeAlias = NDArray[np.int64]
Function = TypeVar("Function", bound=Callable[..., Any])
Number = TypeVar("Number", float, Array)  # in and out alike


@runtime_checkable
class SceneData(Protocol):
    """A scene, as `tensegrity.scenes.dynamics` takes it: data, and nothing of a run."""

    sites: int
    dim: int
    mass: Array  # [kg], (sites,)
    held: Sequence[int]  # sites that stay where they are
    loads: Any  # constant forces [N], of the shape of u or 0
    springs: tuple[Any, ...]  # the Potential of each bond
    drive: Mapping[int, Any]  # {site: Drive}
    damping: Any  # Damping or None
    tune: Any  # arguments of the springs in time, or the spring of an instant

    @property
    def shape(self) -> tuple[int, ...]:
        """Of u and v: (sites,) of a chain, (sites, dim) of a network."""


@runtime_checkable
class LawForms(Protocol):
    """A law of force, as the engine compiles it."""

    @property
    def parameters(self) -> tuple[Any, ...]:
        """Names, or symbols, of what differs from one spring of the law to another."""

    def forms(self) -> tuple[Any, Any, Sequence[Any]]:
        """Elongation and parameters as CasADi symbols; energy [J], tension [N], stiffness [N/m]
        and its slope [N/m^2] in them."""


@runtime_checkable
class Observer(Protocol):
    """What a march serves: see `tensegrity.runs.march`."""

    def wanted(self, end: int) -> Sequence[Any]:
        """States, and room for them, of an attempt that goes on to step `end`."""

    def take(self, motion: Any) -> None:
        """Take them, once the attempt stands."""


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
