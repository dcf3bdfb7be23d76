"""Tensegrity prisms as springs, lattices of masses joined by springs, and their nonlinear waves.

"The talk" in docstrings is *Wave Dynamics of Innovative Nonlinear Lattices*, "the paper" *Highly
nonlinear pulse splitting and recombination in a two-dimensional granular network* (2010).
"""

from tensegrity import catalogue, objective
from tensegrity.animation import animate
from tensegrity.engine.methods import METHODS
from tensegrity.engine.schemes import Nystrom, Splitting
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
from tensegrity.gradients.compute import gradient
from tensegrity.lattices.bands import bands
from tensegrity.lattices.effective import effective_mass
from tensegrity.lattices.evanescent import decay
from tensegrity.lattices.lattice import Lattice
from tensegrity.lattices.moduli import moduli
from tensegrity.lens.lens import Lens
from tensegrity.measure.budget import budget
from tensegrity.measure.collision import phase_shift
from tensegrity.measure.interfaces import interface, transmission
from tensegrity.measure.observables import (
    angular_momentum,
    arrival,
    directions,
    duration,
    speed,
    tail_front,
    wall_gaps,
    width,
)
from tensegrity.measure.pulses import pulses
from tensegrity.measure.records import first_peak, largest_peak, peaks, sampled
from tensegrity.orbits.orbit import periodic_orbit
from tensegrity.orbits.path import orbit_path
from tensegrity.orbits.stability import floquet
from tensegrity.prisms.closed import member_stiffness
from tensegrity.prisms.contact import bar_contact
from tensegrity.prisms.fit import fit
from tensegrity.prisms.measured import read_curve
from tensegrity.prisms.path import equilibrium_path, equilibrium_paths
from tensegrity.prisms.prism import Prism
from tensegrity.runs.integrate import resume, simulate
from tensegrity.runs.record import Record
from tensegrity.runs.run import Run
from tensegrity.runs.sweep import sweep
from tensegrity.scenes.chain import Chain
from tensegrity.scenes.ensemble import Ensemble
from tensegrity.scenes.force import Force
from tensegrity.scenes.forcing import Damping, Drive
from tensegrity.scenes.network import Network
from tensegrity.scenes.scene import State
from tensegrity.scenes.walls import Wall
from tensegrity.springs.polynomial import Polynomial
from tensegrity.springs.potential import Potential
from tensegrity.springs.power_law import PowerLaw
from tensegrity.structures.path import control_path, equilibrium
from tensegrity.structures.structure import Structure
from tensegrity.structures.supports import held, plates
from tensegrity.waves.asymptotics import sech2, tent
from tensegrity.waves.prediction import predict
from tensegrity.waves.solitary import SolitaryWave, solitary_wave
from tensegrity.waves.spectrum import dispersion, modes
from tensegrity.waves.transition import transition_wave

__all__ = [
    "METHODS",
    "Chain",
    "CompilerError",
    "ContactError",
    "Damping",
    "Drive",
    "Ensemble",
    "EquilibriumError",
    "Force",
    "Lattice",
    "Lens",
    "LockingError",
    "Network",
    "NoLocking",
    "Nystrom",
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
    "Splitting",
    "StabilityError",
    "State",
    "Structure",
    "TensegrityError",
    "Wall",
    "angular_momentum",
    "animate",
    "arrival",
    "bands",
    "bar_contact",
    "budget",
    "catalogue",
    "control_path",
    "decay",
    "directions",
    "dispersion",
    "duration",
    "effective_mass",
    "equilibrium",
    "equilibrium_path",
    "equilibrium_paths",
    "first_peak",
    "fit",
    "floquet",
    "gradient",
    "held",
    "interface",
    "largest_peak",
    "member_stiffness",
    "modes",
    "moduli",
    "objective",
    "orbit_path",
    "peaks",
    "periodic_orbit",
    "phase_shift",
    "plates",
    "predict",
    "pulses",
    "read_curve",
    "resume",
    "sampled",
    "sech2",
    "simulate",
    "solitary_wave",
    "speed",
    "sweep",
    "tail_front",
    "tent",
    "transition_wave",
    "transmission",
    "wall_gaps",
    "width",
]
__version__ = "0.1.0"  # pyproject.toml reads it here
