"""Types that signatures share: names for a type checker, nothing is computed here.

Arguments that are converted are `numpy.typing.ArrayLike`; what comes back is one of the arrays
below, whose shapes and units stand in the docstrings.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Flags: TypeAlias = NDArray[np.bool_]
Indices: TypeAlias = NDArray[np.int64]
Function = TypeVar("Function", bound=Callable[..., Any])
Number = TypeVar("Number", float, Array)  # in and out alike


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
