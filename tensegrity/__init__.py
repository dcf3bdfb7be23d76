"""Tensegrity prisms as springs, and lattices of masses joined by them."""

from tensegrity.animation import animate
from tensegrity.errors import (
    CompilerError,
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
from tensegrity.gradients import objective
from tensegrity.gradients.compute import gradient
from tensegrity.lens.lens import Lens
from tensegrity.prisms.closed import member_stiffness
from tensegrity.prisms.contact import bar_contact
from tensegrity.prisms.fit import fit
from tensegrity.prisms.path import EquilibriumPath, equilibrium_path, equilibrium_paths
from tensegrity.prisms.prism import Prism, column
from tensegrity.runs.integrate import resume, simulate
from tensegrity.runs.record import Record
from tensegrity.runs.run import Run
from tensegrity.runs.sweep import sweep
from tensegrity.scenes.chain import Chain
from tensegrity.scenes.ensemble import Ensemble
from tensegrity.scenes.forcing import Damping, Drive
from tensegrity.scenes.network import Network
from tensegrity.scenes.scene import State
from tensegrity.scenes.walls import Wall
from tensegrity.springs.polynomial import Polynomial
from tensegrity.springs.potential import Potential, PowerLaw
from tensegrity.structures.path import control_path, equilibrium
from tensegrity.structures.structure import Structure
from tensegrity.structures.structure_path import StructurePath
from tensegrity.structures.supports import held, plates
from tensegrity.waves.prediction import Prediction, predict
from tensegrity.waves.solitary import SolitaryWave, solitary_wave
from tensegrity.waves.spectrum import Modes, dispersion, modes

__all__ = [
    "Chain",
    "CompilerError",
    "ContactError",
    "Damping",
    "Drive",
    "Ensemble",
    "EquilibriumError",
    "EquilibriumPath",
    "Lens",
    "LockingError",
    "Modes",
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
    "Structure",
    "StructurePath",
    "TensegrityError",
    "Wall",
    "animate",
    "bar_contact",
    "column",
    "control_path",
    "dispersion",
    "equilibrium",
    "equilibrium_path",
    "equilibrium_paths",
    "fit",
    "gradient",
    "held",
    "member_stiffness",
    "modes",
    "objective",
    "plates",
    "predict",
    "resume",
    "simulate",
    "solitary_wave",
    "sweep",
]
