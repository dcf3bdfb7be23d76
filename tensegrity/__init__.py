"""Tensegrity prisms as springs, and lattices of masses joined by them."""

from tensegrity.errors import (
    EquilibriumError,
    LockingError,
    NoLocking,
    ResolutionError,
    StabilityError,
    TensegrityError,
)
from tensegrity.potential import Potential, PowerLaw
from tensegrity.prism import Prism

__all__ = [
    "EquilibriumError",
    "LockingError",
    "NoLocking",
    "Potential",
    "PowerLaw",
    "Prism",
    "ResolutionError",
    "StabilityError",
    "TensegrityError",
]
