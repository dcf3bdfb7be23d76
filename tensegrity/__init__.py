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
from tensegrity.response import EquilibriumPath, equilibrium_path

__all__ = [
    "EquilibriumError",
    "EquilibriumPath",
    "LockingError",
    "NoLocking",
    "Potential",
    "PowerLaw",
    "Prism",
    "ResolutionError",
    "StabilityError",
    "TensegrityError",
    "equilibrium_path",
]
