"""Whatever is handed to a public function: a valid answer or a TensegrityError, nothing else.

For each callable one good call; then each of its arguments in turn is replaced by each of a table
of wrong values.
"""

import inspect
import math
import tempfile
import warnings
from types import SimpleNamespace

import numpy as np
import pytest
import sympy as sp

import granular
import tensegrity
from granular import design
from granular import observables as beads_observables
from granular.lammps import to_lammps
from granular.layout import crossed_layout, diamond_layout, y_layout
from tensegrity import (
    Chain,
    Damping,
    Drive,
    Ensemble,
    Lens,
    Network,
    Polynomial,
    Potential,
    PowerLaw,
    Prism,
    Record,
    Run,
    State,
    Structure,
    TensegrityError,
    Wall,
    bar_contact,
    column,
    control_path,
    dispersion,
    equilibrium,
    equilibrium_path,
    equilibrium_paths,
    export,
    fit,
    gradient,
    held,
    member_stiffness,
    modes,
    objective,
    plates,
    predict,
    resume,
    simulate,
    solitary_wave,
)
from tensegrity.engine import methods
from tensegrity.measure import budget, observables
from tensegrity.prisms.fold_curve import limit_load
from tensegrity.prisms.stability import first_loss, lowest
from tensegrity.runs import tuning
from tensegrity.waves import asymptotics
from tensegrity.waves.solitary import largest_speed

WRONG = {
    "None": None, "text": "x", "text of a number": "1.5", "empty text": "", "bytes": b"1",
    "True": True, "numpy's True": np.True_, "nan": math.nan, "inf": math.inf, "-inf": -math.inf,
    "-1": -1, "0": 0, "1e308": 1e308, "5e-324": 5e-324, "huge": 10**400, "-huge": -(10**400),
    "half": 2.5, "complex": 1j, "list": [], "list of text": ["x"], "list of None": [None, None],
    "ragged": [[1.0], [1.0, 2.0]], "dict": {}, "set": {1}, "object": object(), "type": float,
    "function": lambda *_: None, "array": np.array([1, 2]), "complex array": np.ones(3, complex),
    "objects": np.array([None, {}], dtype=object), "namespace": SimpleNamespace(prism=1, scene=2),
}  # fmt: skip
NO_NUMBERS = (
    "text", "text of a number", "empty text", "bytes", "True", "numpy's True", "nan", "huge",
    "complex", "list", "list of text", "dict", "object", "function", "array", "namespace",
)  # fmt: skip
EXTREME = ("1e308", "5e-324", "half")
SEARCHES = (  # take long with these: see their tests
    solitary_wave,
    largest_speed,
    limit_load,
    Lens,
    design.peak_force,
    design.search,
)
MADE_BY_THE_LIBRARY = {
    "StructurePath",
    "Run",
    "SolitaryWave",
    "Prediction",
    "Modes",
    "EquilibriumPath",
    "BeadChain",
    "Pack",
}

R = sp.Symbol("r")
SPRING = Prism(1.0, 0.7, 0.01, 1.0).potential()
ELASTIC = Prism(1.0, 0.7, 0.01, 1.0, 10.0, 100.0)
STEEL = granular.materials["steel"]
BEAD = granular.Bead(4.76e-3, STEEL)
PTFE, SMALL = granular.materials["ptfe"], granular.Bead(3e-3, STEEL)
STRIKER = granular.Striker(BEAD, 0.5)
BEADS = granular.chain([BEAD] * 6, striker=STRIKER, end=STEEL)
LINE = Chain(SPRING, 24)
LANES = Ensemble(Chain(SPRING, 4), 2)
TRUSS = Structure([[-1, 0], [1, 0], [0, 1]], bars=[(0, 2), (1, 2)])
NET = Network([[0, 0], [1, 0], [0, 1]], [(0, 1), (1, 2)], SPRING)
WALL = Wall((0, 0), (0, 1))
WAVE = solitary_wave(SPRING, speed_ratio=2.0)
LENNARD_JONES = Potential(((1 + R) ** -12 - 2 * (1 + R) ** -6) / 72, R, domain=(-1.0, math.inf))
LENS = Lens(Prism(1.0, 0.8, 0.01, 1.0), 3, 2, velocity=0.01)
RUN = simulate(LINE, LINE.at_rest({0: 0.03}), 20.0, record=Record(every=1))
BEADS_RUN = simulate(BEADS, BEADS.start(), 6e-5, record=Record(every=1))
CUBE = granular.fcc_pack(2, 2, bead=BEAD, floor=STEEL, sides=STEEL, striker=STRIKER)
PACKED = simulate(CUBE, CUBE.start(), 1e-5, dt=1e-6)
FOLDER = tempfile.TemporaryDirectory()
FILE = f"{FOLDER.name}/run.npy"
simulate(LINE, LINE.at_rest({0: 0.01}), 1.0, dt=0.1, record=Record(path=FILE, checkpoint=1.0))
RUN.save(f"{FOLDER.name}/kept")
T = np.linspace(0.0, 1e-4, 200)
FORCE = np.exp(-(((T - 5e-5) / 1e-5) ** 2))
X = np.linspace(-5.0, 5.0, 101)
TIMES = {"t": T, "force": FORCE}
GUIDE = {"stem": 3, "branch": 3, "half_angle": 0.7, "bead": BEAD, "branches": (BEAD, BEAD)}
GUIDE |= {"wall": STEEL, "striker": STRIKER, "end": STEEL, "gap": 0.0, "through": 0.0}
GUIDE |= {"law": granular.hertz, "gravity": 9.81, "preload": 0.1}
LAYOUT = {"stem": 3, "branch": 3, "half_angle": 0.7, "diameter": 0.005}
ROWS = {"name": "own", "order": 2, "step": 0.1, "reference": "", "when_not": ""}
SPLIT = {"kicks": (0.5, 0.5), "drifts": (1.0,)}
NYSTROM = {"nodes": (0.5,), "matrix": ((0.0,),), "positions": (0.5,), "velocities": (1.0,)}


def in_a_run(kind):
    """A method made and used: rows that are no method are refused by the run at the latest."""

    def run(**rows):
        return simulate(LINE, LINE.at_rest({0: 0.01}), 1.0, method=kind(**rows))

    run.__name__ = kind.__name__
    return run


CALLS = [
    (Prism, {"base": 1.0, "height": 0.7, "prestrain": 0.01, "k_cross": 1.0, "k_base": 10.0,
             "k_bar": 100.0}),
    (Prism(1.0, 0.7, 0.01, 1.0).potential, {"preload": 0.01}),
    (ELASTIC.potential, {"preload": 0.01}),
    (equilibrium_path, {"prism": ELASTIC, "min_height": 0.4, "max_load": 1.0, "max_height": 0.75,
                        "past_contact": False}),
    (equilibrium_paths, {"prisms": [ELASTIC, ELASTIC], "min_height": 0.4, "max_load": 1.0,
                         "max_height": 0.75, "past_contact": False, "executor": None}),
    (equilibrium_path, {"prism": TRUSS, "supports": held([0, 1]), "loads": {2: (0.0, -1.0)},
                        "max_load": 0.1, "branch": "stable", "max_shortening": 0.1}),
    (Structure, {"positions": [[0, 0], [1, 0], [0, 1]], "bars": [(0, 1)], "strings": [(1, 2)],
                 "k_bar": 1.0, "k_string": [1.0], "mass": 1.0, "natural_lengths": [1.0, 1.0],
                 "platforms": ()}),
    (equilibrium, {"structure": TRUSS, "loads": {2: (0.0, -0.1)}, "supports": held([0, 1])}),
    (lambda force: equilibrium(TRUSS, {2: force}, held([0, 1])), {"force": (0.0, -0.1)}),
    (held, {"nodes": [0, 1], "axes": [0]}),
    (plates, {"lower": [0], "upper": [1], "normal": (0.0, 1.0)}),
    (column, {"prism": ELASTIC, "count": 2, "chirality": "same", "plates": False}),
    (control_path, {"structure": TRUSS, "natural_lengths": {0: 1.1}, "supports": held([0, 1]),
                    "branch": "stable", "loads": {0: (0.0, -0.1)}}),
    (lambda force: control_path(TRUSS, {0: 1.1}, held([0, 1]), loads={0: force}),
     {"force": (0.0, -0.1)}),
    (lambda value: control_path(TRUSS, {0: value}, held([0, 1])), {"value": 1.1}),
    (TRUSS.prestressed, {"force_densities": [0.0, 0.0]}),
    (TRUSS.prestressed, {"prestrain": None, "force_densities": [0.0, 0.0]}),
    (TRUSS.modes, {"count": 1, "supports": held([0, 1])}),
    (TRUSS.is_stable, {"supports": held([0, 1])}),
    (member_stiffness, {"modulus": 1e9, "area": 1e-6, "length": 0.1}),
    (Prism.from_members, {"cross": 0.13, "base": 0.08, "bar": 0.1623, "k_cross": 19192.7,
                          "k_base": 31188.2, "k_bar": 4.7e7, "sides": 3}),
    (ELASTIC.structure, {"mass": 1.0}),
    (bar_contact, {"path": equilibrium_path(ELASTIC), "diameter": 0.01}),
    (fit, {"shortening": [0.0, 0.01, 0.02, 0.03], "load": [0.0, 0.001, 0.002, 0.003],
           "prism": ELASTIC, "free": ("prestrain",), "offset": False, "noise": 0.1}),
    (fit([0.0, 0.01, 0.02, 0.03], [0.0, 0.001, 0.002, 0.003], ELASTIC, noise=0.1).intervals,
     {"level": 0.9}),
    (Potential, {"energy": R**2, "elongation": R, "parameters": {}, "length": 1.0,
                 "domain": (-1.0, 1.0)}),
    (lambda **k: Potential(sp.Symbol("k") * R**2, R, k), {"k": 1.0}),
    (PowerLaw, {"stiffness": 1.0, "exponent": 1.5, "preload": 0.1, "length": 1.0}),
    (Polynomial, {"spring": SPRING, "low": -0.01, "high": 0.01, "error": 1e-6}),
    (SPRING.energy, {"r": 0.0}),
    (SPRING.tension, {"r": 0.0}),
    (SPRING.stiffness, {"r": [0.0]}),
    (ELASTIC.potential().energy, {"r": 0.0}),
    (Chain, {"spring": SPRING, "sites": 3, "mass": 1.0, "ends": ("free", "fixed")}),
    (lambda mass: Chain(SPRING, 2, mass), {"mass": [1.0, 2.0]}),
    (lambda first: Chain(SPRING, 2, ends=(first, "free")), {"first": "fixed"}),
    (Chain, {"spring": SPRING, "sites": 3, "drive": {0: Drive(force=0.1)},
             "damping": Damping(0.1), "tune": {"prestrain": 0.01 + 0.001 * sp.Symbol("t")}}),
    (Drive, {"displacement": sp.sin(sp.Symbol("t"))}),
    (Drive, {"force": ([0.0, 1.0, 2.0], [0.0, 0.1, 0.2])}),
    (Drive(force=0.1).at, {"t": [0.0, 1.0], "order": 0}),
    (Damping, {"bond": [0.1], "ground": [0.1, 0.2]}),
    (SPRING.varied, {"values": {"prestrain": 0.02}}),
    (LINE.at_rest, {"velocity": {0: 0.1}}),
    (lambda site: LINE.at_rest({site if site.__hash__ else "list": 0.1}), {"site": 3}),
    (lambda value: LINE.at_rest({0: value}), {"value": 0.1}),
    (LINE.elongation, {"u": np.zeros(24)}),
    (LINE.bond_energy, {"u": np.zeros(24)}),
    (LINE.bond_tension, {"u": np.zeros(24)}),
    (LINE.energy, {"state": LINE.at_rest()}),
    (LINE.momentum, {"state": LINE.at_rest()}),
    (Ensemble, {"scenes": Chain(SPRING, 3), "lanes": 2}),
    (Ensemble, {"scenes": [Chain(SPRING, 3)] * 2}),
    (LINE.forces, {"u": np.zeros(24)}),
    (NET.stiffness, {"u": np.zeros((3, 2))}),
    (LANES.at_rest, {"velocity": {0: [0.1, 0.2]}}),
    (lambda value: LANES.at_rest({0: value}), {"value": 0.1}),
    (LANES.lane, {"state": LANES.at_rest(), "number": 0}),
    (State, {"u": np.zeros(3), "v": np.zeros(3)}),
    (Wall, {"point": (0, 0), "normal": (0, 1), "extent": (1, 0)}),
    (Wall.between, {"start": (0, 0), "stop": (1, 0), "side": (0, 1)}),
    (WALL.height, {"x": (1.0, 1.0)}),
    (WALL.overhang, {"x": (1.0, 1.0)}),
    (WALL.distance, {"x": (1.0, 1.0)}),
    (Network, {"positions": [[0, 1], [1, 1], [2, 1]], "bonds": [(0, 1), (1, 2)], "spring": SPRING,
               "lengths": [1.0, 1.0], "mass": 1.0, "walls": [WALL], "wall_contacts": [(0, 0)],
               "wall_spring": SPRING, "wall_gaps": [0.95], "radius": 0.05,
               "loads": np.zeros((3, 2)), "held": [2]}),
    (NET.at_rest, {"velocity": {0: (0.1, 0.0)}}),
    (lambda value: NET.at_rest({0: value}), {"value": (0.1, 0.0)}),
    (NET.elongation, {"u": np.zeros((3, 2))}),
    (NET.wall_gap, {"u": np.zeros((3, 2))}),
    (NET.energy, {"state": NET.at_rest()}),
    (NET.momentum, {"state": NET.at_rest()}),
    (NET.angular_momentum, {"state": NET.at_rest()}),
    (Record, {"every": 1, "sites": [0, 1], "path": None}),
    (Record, {"times": [0.1, 0.2]}),
    (Record, {"interval": 0.1, "path": FILE, "checkpoint": 1.0}),
    (resume, {"path": FILE, "scene": None}),
    (RUN.save, {"path": f"{FOLDER.name}/saved"}),
    (Run.load, {"path": f"{FOLDER.name}/kept"}),
    (simulate, {"scene": LINE, "state": LINE.at_rest({0: 0.01}), "t_end": 1.0, "method": "rkn6",
                "dt": 0.1, "record": Record()}),
    (simulate, {"scene": LINE, "state": LINE.at_rest({0: 0.01}), "t_end": 1.0, "tol": 1e-4}),
    (gradient, {"objective": objective.displacement(1), "scene": LINE,
                "state": LINE.at_rest({0: 0.01}), "t_end": 1.0, "dt": 0.1, "method": "verlet",
                "wanted": ("prestrain",), "exact": False, "checkpoints": 5}),
    (objective.load, {"bond": 1}),
    (objective.load, {"wall": 1}),
    (objective.displacement, {"site": 1, "axis": 0}),
    (objective.velocity, {"site": 1, "axis": 0}),
    (objective.energy, {"sites": [0, 1]}),
    (objective.peak, {"trace": objective.load(1)}),
    (objective.p_norm, {"trace": objective.load(1), "p": 8, "over": (0.1, 0.5)}),
    (objective.impulse, {"bond": 1}),
    (objective.arrival, {"site": 1, "displacement": 0.1}),
    (objective.misfit, {"trace": objective.load(1), "t": [0.1, 0.2], "values": [0.0, 1.0]}),
    (objective.of, {"traces": [objective.load(1)], "function": lambda t, y: (0.0, 0 * y)}),
    (objective.objective_of, {"given": objective.load(1)}),
    (solitary_wave, {"potential": SPRING, "mass": 1.0, "speed_ratio": 2.0,
                     "family": "compression"}),
    (solitary_wave, {"potential": SPRING, "speed": 2 * WAVE.sound_speed}),
    (solitary_wave, {"potential": SPRING, "amplitude": WAVE.amplitude}),
    (solitary_wave, {"potential": SPRING, "energy": WAVE.energy}),
    (solitary_wave, {"potential": SPRING, "excess": 0.5}),
    (Lens, {"prism": Prism(1.0, 0.8, 0.01, 1.0), "sites": 3, "chains": 2, "spacing": 2.0,
            "focus": (0.0, 20.0), "host_speed": 1.5, "host_density": 1e-3, "area": 1.0,
            "velocity": 0.01, "prestrains": (0.005, 0.1), "mass": 1.0}),
    (LENS.run, {"t_end": 1.0, "record": Record(every=1), "prestrains": [0.01, 0.02]}),
    (LENS.arrivals_of, {"prestrains": [0.01, 0.02]}),
    (LENS.pressure, {"points": (0.0, 20.0), "t": [20.0, 21.0], "prestrains": [0.01, 0.02]}),
    (LENS.pressures, {"points": [(0.0, 20.0)], "t": [20.0]}),
    (LENS.point_pressures, {"points": [(0.0, 20.0)], "t": [20.0]}),
    (predict, {"potential": SPRING, "mass": 1.0}),
    (modes, {"scene": NET, "about": NET.at_rest(), "count": 3}),
    (dispersion, {"springs": [SPRING, SPRING], "masses": [1.0, 2.0], "wavenumbers": [0.1]}),
    (lambda mass: dispersion(SPRING, mass, [0.1]), {"mass": 1.0}),
    (predict(SPRING)["compression"].small_crest, {"excess": 1e-3}),
    (predict(LENNARD_JONES)["compression"].wall_crest, {"speed": 100.0}),
    (WAVE.launch, {"chain": Chain(SPRING, 200), "at": 100, "direction": 1, "tail": 1e-6}),
    (WAVE.width, {"level": 0.05}),
    (WAVE.reach, {"tail": 1e-6}),
    (WAVE.elongation, {"x": 0.0}),
    (WAVE.rate, {"x": 0.0}),
    (WAVE.displacement, {"x": 0.0}),
    (largest_speed, {"potential": SPRING, "mass": 1.0, "family": None, "closest": 0.04}),
    (limit_load, {"prism": Prism(1.0, 0.7, 0.01, 1.0, 10.0, 100.0), "prestrain": 0.012}),
    (first_loss, {"prism": ELASTIC, "support": "plates"}),
    (lowest, {"prism": ELASTIC, "path": equilibrium_path(ELASTIC)[:2], "support": "plates",
              "count": 1}),
    (methods.find, {"method": "rkn6"}),
    (in_a_run(methods.Splitting), ROWS | SPLIT),
    (in_a_run(methods.Nystrom), ROWS | NYSTROM),
    (in_a_run(methods.Corrected), ROWS | {"base": methods.METHODS["verlet"]}),
    (in_a_run(methods.Processed), ROWS | SPLIT | {"entry": ((0.0, 0.0), (0.0,))}),
    (asymptotics.sound_speed, {"spring": SPRING, "mass": 1.0}),
    (asymptotics.sech2, {"spring": SPRING, "speed_ratio": 1.05, "x": 0.0}),
    (asymptotics.tent, {"spring": SPRING, "x": 0.0}),
    (observables.passage, {"t": X, "elongation": np.exp(-X**2), "rate": -2 * X * np.exp(-X**2)}),
    (observables.arrival, {"run": RUN, "bond": 4}),
    (observables.speed, {"run": RUN, "bonds": (3, 5)}),
    (observables.duration, {"run": RUN, "bond": 4, "level": 0.5}),
    (observables.pulses, {"chain": LINE, "state": RUN.final, "fraction": 0.5}),
    (observables.tail_front, {"chain": LINE, "state": RUN.final, "level": 0.5}),
    (observables.crest, {"elongation": np.exp(-X**2)}),
    (observables.width, {"x": X, "profile": np.exp(-X**2), "level": 0.05}),
    (budget.beyond, {"run": RUN, "bond": 4}),
    (tuning.simulate_tuned, {"chain": Chain(SPRING, 3), "state": State(np.zeros(3), np.zeros(3)),
                             "t_end": 1.0, "spring_at": lambda t: SPRING, "dt": 0.1,
                             "method": "verlet", "record": Record()}),
    (granular.Material, {"name": "own", "modulus": 1e9, "poisson": 0.3, "density": 1e3,
                         "source": ""}),
    (lambda material: granular.materials[material], {"material": "steel"}),
    (granular.Bead, {"diameter": 0.005, "material": STEEL, "mass": 1e-3, "contact_radius": 1e-3}),
    (granular.Striker, {"bead": BEAD, "speed": 0.5}),
    (granular.bead_of_mass, {"mass": 1e-3, "material": STEEL}),
    (granular.coated, {"core": BEAD, "coating": STEEL, "thickness": 1e-5}),
    (granular.Contact, {"constant": 1e9, "exponent": 1.5}),
    (granular.Contact(1e9).overlap, {"force": 1.0}),
    (granular.Contact(1e9).spring, {"preload": 1.0, "length": 0.005}),
    (granular.hertz, {"bead": BEAD, "other": STEEL}),
    (granular.power, {"constant": 1e9, "exponent": 1.5}),
    (granular.chain, {"beads": [BEAD] * 3, "striker": STRIKER, "gravity": 9.81, "preload": 0.1,
                      "end": STEEL, "law": granular.hertz}),
    (granular.chain, {"beads": [BEAD] * 3, "start_wall": STEEL, "end": STEEL}),
    (granular.fcc_pack, {"layers": 2, "side": 2, "bead": BEAD, "floor": STEEL, "sides": STEEL,
                         "striker": STRIKER, "struck": (0, 1), "contacts": "follow",
                         "gravity": 9.81, "preload": 0.1}),
    (granular.hexagonal_pack, {"rows": 2, "columns": 2, "bead": BEAD, "floor": STEEL,
                               "sides": STEEL, "striker": STRIKER, "struck": 0, "gap": 1e-5,
                               "offset": (0, 1), "direction": (0, -1), "contacts": "follow",
                               "gravity": 9.81, "preload": 0.1}),
    (granular.pack, {"places": [(0.0, 0.1), (0.0, 0.2)], "beads": [BEAD] * 2,
                     "walls": {"floor": (WALL, STEEL)}, "contacts": "fixed", "gravity": 0.0,
                     "preload": {}}),
    (lambda pair: granular.pack([(0.0, 0.1)], BEAD, {"floor": pair}), {"pair": (WALL, STEEL)}),
    (PACKED.scene.members, {"part": "layer 1"}),
    (granular.wall_force, {"run": PACKED, "name": "floor", "each": True}),
    (granular.wall_force, {"run": BEADS_RUN, "name": "end"}),
    (to_lammps, {"scene": CUBE, "state": CUBE.start(), "t_end": 1e-5, "dt": 1e-6, "every": 2,
                 "path": f"{FOLDER.name}/in.beads"}),
    (beads_observables.energy_shares, {"run": PACKED}),
    (beads_observables.effective_number, {"run": PACKED}),
    (beads_observables.participation_ratio, {"run": PACKED}),
    (beads_observables.virial_ratio, {"run": PACKED}),
    (asymptotics.forms, {}),
    (export.to_c, {"potential": SPRING, "path": f"{FOLDER.name}/spring.c"}),
    (tensegrity.sweep, {"function": abs, "cases": [1, -2], "executor": None,
                        "checkpoint": "sweep.npz"}),
    (design.Order, {"given": [BEAD, SMALL]}),
    (design.Choice, {"count": 3, "diameter": 0.005, "materials": [STEEL, PTFE]}),
    (design.Sizes, {"count": 3, "diameters": (0.004, 0.006), "length": 0.015, "material": STEEL}),
    (design.peak_force, {"beads": [BEAD] * 3, "striker": STRIKER, "wall": STEEL, "t_end": 2e-4,
                         "dt": 1e-6}),
    (design.search, {"space": design.Order([BEAD, SMALL]), "striker": STRIKER, "wall": STEEL,
                     "t_end": 1e-4, "build": None, "method": "ga", "budget": 64, "seed": 0,
                     "executor": None, "checkpoint": "search.npz"}),
    (granular.y_guide, GUIDE),
    (granular.diamond_guide, GUIDE),
    (granular.Guide, {"layout": y_layout(3, 3, 0.7, BEAD.diameter),
                      "beads": dict.fromkeys(("stem 1", "branch 1", "branch 2"), BEAD),
                      "wall": STEEL, "striker": STRIKER, "end": STEEL, "law": granular.hertz,
                      "gravity": 9.81, "preload": 0.1}),
    (y_layout, LAYOUT | {"gap": 0.0, "through": 0.0}),
    (diamond_layout, LAYOUT | {"gap": 0.0, "through": 0.0}),
    (crossed_layout, LAYOUT),
    (BEADS.site, {"part": "chain", "number": 2}),
    (BEADS.members, {"part": "chain"}),
    (BEADS.distance, {"part": "chain", "numbers": (1, 3)}),
    (granular.sensor_force, {"run": BEADS_RUN, "part": "chain", "number": 2}),
    (beads_observables.mean_force, {"run": BEADS_RUN, "part": "chain", "number": 2}),
    (beads_observables.density, {"run": BEADS_RUN, "sites": [1, 2]}),
    (beads_observables.peak, TIMES | {"between": (2e-5, 8e-5)}),
    (beads_observables.speed, {"run": BEADS_RUN, "part": "chain", "numbers": (1, 3),
                               "between": (0.0, 6e-5)}),
    (beads_observables.sampled, TIMES | {"interval": 3e-6, "phase": 0.0}),
    (beads_observables.sampled_peak, TIMES | {"between": (0.0, 1e-4), "interval": 3e-6,
                                              "phase": 0.0}),
    (beads_observables.pulses, TIMES | {"level": 0.05}),
    (beads_observables.part_energies, {"run": BEADS_RUN}),
    (beads_observables.momentum, {"run": BEADS_RUN}),
    (beads_observables.overlaps, {"run": BEADS_RUN, "part": "chain"}),
]  # fmt: skip


def label(call):
    return getattr(call[0], "__qualname__", "").replace("<lambda>", "/".join(call[1]))


def outcome(function, arguments):
    """What a call answers, or the TensegrityError that it raises; any other error passes."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return function(**arguments)
    except TensegrityError as error:
        return error


@pytest.mark.parametrize(("function", "good"), CALLS, ids=map(label, CALLS))
def test_wrong_arguments_meet_a_tensegrity_error_or_an_answer(
    function, good, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)  # some wrong paths are paths
    answer = outcome(function, good)
    assert not isinstance(answer, Exception), f"the good call: {answer}"
    for name, value in good.items():
        number = isinstance(value, (int, float)) and not isinstance(value, bool)
        for kind, wrong in WRONG.items():
            if function in SEARCHES and kind in EXTREME:
                continue
            try:
                answer = outcome(function, good | {name: wrong})
            except Exception as error:
                pytest.fail(f"{name} = {kind}: {type(error).__name__}: {error}")
            if number and kind in NO_NUMBERS and not takes_arrays(function, name, kind):
                assert isinstance(answer, TensegrityError), f"{name} = {kind} was taken"
            if isinstance(answer, TensegrityError):
                assert len(str(answer)) < 500, f"{name} = {kind}: {answer}"


def takes_arrays(function, name, kind):
    """Whether an argument is one number or an array of them."""
    return kind in ("array", "list") and name in ("r", "x", "u", "mass", "value", "radius", "force")


def test_every_public_callable_has_a_good_call():
    called = {getattr(function, "__name__", "") for function, _ in CALLS}
    modules = (asymptotics, budget, export, observables, beads_observables, objective)
    public = {name for module in modules for name, thing in vars(module).items()
              if inspect.isfunction(thing) and thing.__module__ == module.__name__}  # fmt: skip
    for module in (tensegrity, granular):
        public |= {name for name in module.__all__ if callable(getattr(module, name))}
    errors = {name for name in public if _is_error(name)}
    public = {name for name in public if not name.startswith("_")}
    assert public - errors - MADE_BY_THE_LIBRARY <= called


def _is_error(name):
    thing = getattr(tensegrity, name, None)
    return isinstance(thing, type) and issubclass(thing, Exception)
