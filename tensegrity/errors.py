"""The errors a user can meet; each message names the quantity, its value and its bound."""

from __future__ import annotations

from math import inf
from typing import Any


class TensegrityError(ValueError):
    """Base of all errors raised by this toolkit."""


class CompilerError(TensegrityError):
    """No C compiler can be run, or it refused a text, or hung, or the disk is full."""


class LockingError(TensegrityError):
    """An elongation reached the end of a spring's domain, where bars touch or line up.

    Raised by a run, it carries the recorded part in `run` (None elsewhere).
    """

    run: Any = None


class RangeError(LockingError):
    """An elongation left the range on which the force of a run was prepared."""


class NoLocking(TensegrityError):
    """The prism is so thick that it collapses flat before its bars meet."""


class StabilityError(TensegrityError):
    """The time step is beyond the stability limit of the method.

    Raised by a run, it carries the recorded part in `run` (None elsewhere).
    """

    run: Any = None
    largest: float = inf  # step [s] that is needed, where that is known beforehand


class ContactError(TensegrityError):
    """A contact formed that is not in the scene's list, or a site slid off the end of its wall.

    Raised by a run, it carries the recorded part in `run` (None elsewhere).
    """

    run: Any = None


class ResolutionError(TensegrityError):
    """A grid is too coarse for what was asked."""


class EquilibriumError(TensegrityError):
    """No equilibrium state carries the load that was asked for."""


class RecordError(TensegrityError):
    """A row or a state could not be written; what was written before is whole.

    Raised by a run, it carries the recorded part in `run` (None elsewhere).
    """

    run = None
