"""Tensegrity prisms as springs, and lattices of masses joined by them."""

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
from tensegrity.prisms.path import EquilibriumPath, equilibrium_path, equilibrium_paths
from tensegrity.prisms.prism import Prism
from tensegrity.runs.integrate import simulate
from tensegrity.runs.record import Record
from tensegrity.runs.resuming import resume
from tensegrity.runs.run import Run
from tensegrity.scenes.chain import Chain
from tensegrity.scenes.ensemble import Ensemble
from tensegrity.scenes.network import Network
from tensegrity.scenes.scene import State
from tensegrity.scenes.walls import Wall
from tensegrity.springs.polynomial import Polynomial
from tensegrity.springs.potential import Potential, PowerLaw
from tensegrity.waves.prediction import Prediction, predict
from tensegrity.waves.solitary import SolitaryWave, solitary_wave

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
    "Prediction",
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
    "equilibrium_paths",
    "predict",
    "resume",
    "simulate",
    "solitary_wave",
]
