"""The public names and where they are defined, which are imported when they are first used."""

from . import catalogue, files, objective
from .animation import animate
from .branches.problem import Problem, trace
from .engine.methods import METHODS
from .engine.schemes import Nystrom, Splitting
from .errors import (
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
from .files.records import read_record
from .gradients.compute import gradient
from .gradients.fit_run import fit_run
from .lattices.bands import bands
from .lattices.bloch import PairLattice
from .lattices.lattice import Lattice
from .lattices.matrix import Matrix
from .lattices.moduli import moduli
from .lattices.response import decay, effective_mass
from .measure.budget import bond_force, budget
from .measure.interfaces import interface, phase_shift, transmission
from .measure.observables import (
    angular_momentum,
    arrival,
    directions,
    duration,
    speed,
    tail_front,
    wall_gaps,
    width,
)
from .measure.pulses import pulses
from .measure.records import first_peak, largest_peak, peaks, sampled
from .measure.series import TimeSeries
from .measure.spectrum import spectrum
from .orbits.lyapunov import lyapunov
from .orbits.orbit import periodic_orbit
from .orbits.path import orbit_path
from .orbits.stability import floquet
from .precision.models import compare_models, prism_models
from .precision.result import WorkPrecision
from .precision.work import work_precision
from .printing import units
from .prisms.closed import member_stiffness
from .prisms.contact import bar_contact, sheath
from .prisms.fit import fit
from .prisms.measured import read_curve
from .prisms.path import equilibrium_path, equilibrium_paths
from .prisms.prism import Prism
from .proofs.prove import prove, verify
from .runs.integrate import resume, simulate
from .runs.record import Record
from .runs.run import Run
from .runs.sweep import sweep
from .scenes.chain import Chain
from .scenes.ensemble import Ensemble
from .scenes.force import Force
from .scenes.forcing import Damping, Drive
from .scenes.network import Network
from .scenes.scene import State
from .scenes.walls import Wall
from .springs.pair_law import PairLaw
from .springs.polynomial import Polynomial
from .springs.potential import Potential
from .springs.power_law import PowerLaw
from .structures.equilibrium import control_path, equilibrium
from .structures.structure import Structure
from .structures.supports import held, plates
from .unit.member import Member
from .unit.unit import Unit
from .waves.asymptotics import sech2, tent
from .waves.cell_wave import genuine
from .waves.periodic import periodic_wave
from .waves.prediction import predict
from .waves.shock import shock
from .waves.solitary import SolitaryWave, solitary_wave
from .waves.spectrum import dispersion, modes
from .waves.transition import transition_wave

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
    "LockingError",
    "Matrix",
    "Member",
    "Network",
    "NoLocking",
    "Nystrom",
    "PairLattice",
    "PairLaw",
    "Polynomial",
    "Potential",
    "PowerLaw",
    "Prism",
    "Problem",
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
    "TimeSeries",
    "Unit",
    "Wall",
    "WorkPrecision",
    "angular_momentum",
    "animate",
    "arrival",
    "bands",
    "bar_contact",
    "bond_force",
    "budget",
    "catalogue",
    "compare_models",
    "control_path",
    "decay",
    "directions",
    "dispersion",
    "duration",
    "effective_mass",
    "equilibrium",
    "equilibrium_path",
    "equilibrium_paths",
    "files",
    "first_peak",
    "fit",
    "fit_run",
    "floquet",
    "genuine",
    "gradient",
    "held",
    "interface",
    "largest_peak",
    "lyapunov",
    "member_stiffness",
    "modes",
    "moduli",
    "objective",
    "orbit_path",
    "peaks",
    "periodic_orbit",
    "periodic_wave",
    "phase_shift",
    "plates",
    "predict",
    "prism_models",
    "prove",
    "pulses",
    "read_curve",
    "read_record",
    "resume",
    "sampled",
    "sech2",
    "sheath",
    "shock",
    "simulate",
    "solitary_wave",
    "spectrum",
    "speed",
    "sweep",
    "tail_front",
    "tent",
    "trace",
    "transition_wave",
    "transmission",
    "units",
    "verify",
    "wall_gaps",
    "width",
    "work_precision",
]
__version__: str
