"""Checks of what a user hands in; a failed one says which quantity, its value and its bound."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.errors import TensegrityError

if TYPE_CHECKING:
    from typing import Any

    from numpy.typing import ArrayLike

    from tensegrity.typing import Array


def number(
    name: str,
    value: Any,
    *,
    above: float | None = None,
    least: float | None = None,
    finite: bool = True,
    unit: str = "",
) -> float:
    """`value` as a float, if it is one number within its bounds."""
    try:
        value = float(value)
    except (TypeError, ValueError):
        raise TensegrityError(f"{name} {value!r} is not a number") from None
    shown = f"{name} {value:g}{unit and ' ' + unit}"
    if math.isnan(value) or (finite and math.isinf(value)):
        raise TensegrityError(f"{shown} is not {'finite' if finite else 'a number'}")
    if above is not None and not value > above:
        raise TensegrityError(f"{shown} must be above {above:g}")
    if least is not None and not value >= least:
        raise TensegrityError(f"{shown} must be at least {least:g}")
    return value


def whole(name: str, value: object, *, least: int) -> int:
    """`value` as an int, if it is a whole number not below `least`."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)):
        raise TensegrityError(f"{name} {value!r} is not a whole number")
    if value < least:
        raise TensegrityError(f"{name} {value} must be at least {least}")
    return int(value)


def vector(name: str, value: ArrayLike, shape: tuple[int, ...]) -> Array:
    """A state array as the compiled loop takes it: float64, C-contiguous, finite.

    Sequences are converted; an array of another type or layout is refused, because a
    silent copy would hide that the loop does not work on the caller's memory.
    """
    if not isinstance(value, np.ndarray):
        try:
            value = np.array(value, dtype=float)
        except (TypeError, ValueError):
            raise TensegrityError(f"{name} is not an array of numbers") from None
    if value.dtype != np.float64:
        raise TensegrityError(f"{name} has dtype {value.dtype}, must be float64")
    if value.shape != shape:
        raise TensegrityError(f"{name} has shape {value.shape}, must be {shape}")
    if not value.flags.c_contiguous:
        raise TensegrityError(f"{name} is not C-contiguous; pass numpy.ascontiguousarray of it")
    if not np.isfinite(value).all():
        where = int(np.flatnonzero(~np.isfinite(value.ravel()))[0])
        raise TensegrityError(f"{name} is {value.ravel()[where]} at index {where}, must be finite")
    return value
