"""Tensegrity prisms as springs, and lattices of masses joined by them."""

from tensegrity.errors import (
    EquilibriumError,
    LockingError,
    NoLocking,
    ResolutionError,
    StabilityError,
    TensegrityError,
)
from tensegrity.integrate import simulate
from tensegrity.lattice import Chain, State
from tensegrity.potential import Potential, PowerLaw
from tensegrity.prism import Prism
from tensegrity.record import Record
from tensegrity.response import EquilibriumPath, equilibrium_path
<<<<<<< HEAD
from tensegrity.run import Run
=======
from tensegrity.solitary import SolitaryWave, solitary_wave
>>>>>>> 902723facc02bfa55b08691d3ceb0af03ad6c78a

__all__ = [
    "Chain",
    "EquilibriumError",
    "EquilibriumPath",
    "LockingError",
    "NoLocking",
    "Potential",
    "PowerLaw",
    "Prism",
    "Record",
    "ResolutionError",
    "Run",
    "SolitaryWave",
    "StabilityError",
    "State",
    "TensegrityError",
    "equilibrium_path",
    "simulate",
    "solitary_wave",
]
