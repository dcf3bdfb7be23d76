"""Tensegrity prisms as springs, and lattices of masses joined by them."""

from tensegrity.ensemble import Ensemble
from tensegrity.errors import (
    ContactError,
    EquilibriumError,
    LockingError,
    NoLocking,
    RangeError,
    RecordError,
    ResolutionError,
    StabilityError,
    TensegrityError,
)
from tensegrity.integrate import simulate
from tensegrity.lattice import Chain
from tensegrity.network import Network
from tensegrity.polynomial import Polynomial
from tensegrity.potential import Potential, PowerLaw
from tensegrity.prism import Prism
from tensegrity.record import Record
from tensegrity.response import EquilibriumPath, equilibrium_path
from tensegrity.resume import resume
from tensegrity.run import Run
from tensegrity.scene import State
from tensegrity.solitary import SolitaryWave, solitary_wave
from tensegrity.walls import Wall

__all__ = [
    "Chain",
    "ContactError",
    "Ensemble",
    "EquilibriumError",
    "EquilibriumPath",
    "LockingError",
    "Network",
    "NoLocking",
    "Polynomial",
    "Potential",
    "PowerLaw",
    "Prism",
    "RangeError",
    "Record",
    "RecordError",
    "ResolutionError",
    "Run",
    "SolitaryWave",
    "StabilityError",
    "State",
    "TensegrityError",
    "Wall",
    "equilibrium_path",
    "resume",
    "simulate",
    "solitary_wave",
]
