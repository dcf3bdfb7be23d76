"""The errors that a user may receive; each message names the quantity, its value and its bound."""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import Any

SAID: dict[str, Callable[[str], str]] = {"message": str}  # by `units`, in the names that it gave


class TensegrityError(ValueError):
    """Base of all errors raised by this toolkit."""

    def __init__(self, *given: object) -> None:
        super().__init__(*(SAID["message"](x) if isinstance(x, str) else x for x in given))


class CompilerError(TensegrityError):
    """No C compiler can be run, or it rejected a source or timed out, or the disk is full."""


class LockingError(TensegrityError):
    """An elongation reached the end of a spring's domain, where bars touch or line up.

    Raised by a run, it carries the recorded part in `run` (None elsewhere).
    """

    run: Any = None


class RangeError(LockingError):
    """An elongation left the range for which the fitted force of a run is valid."""


class NoLocking(TensegrityError):
    """The prism is so thick that it collapses flat before its bars meet."""


class StabilityError(TensegrityError):
    """The time step is beyond the stability limit of the method.

    Raised by a run, it carries the recorded part in `run` (None elsewhere).
    """

    run: Any = None
    largest: float = inf  # largest stable step [s], where it is known beforehand


class ContactError(TensegrityError):
    """A contact formed that is not in the scene's list, or a site slid off the end of its wall.

    Raised by a run, it carries the recorded part in `run` (None elsewhere).
    """

    run: Any = None


class ResolutionError(TensegrityError):
    """A grid is too coarse for the requested result."""


class EquilibriumError(TensegrityError):
    """No equilibrium state carries the requested load."""


class RecordError(TensegrityError):
    """A row or a checkpoint could not be written; rows written before are intact.

    Raised by a run, it carries the recorded part in `run` (None elsewhere).
    """

    run = None
