"""Whatever is handed to a public callable: a finite answer or a TensegrityError, nothing else.

Every public function, class and method is found by itself.  Each of its arguments in turn is
replaced by wrong values, and by its own example with a part of it spoilt.  An argument needs an
example only where no default is there: by its name in `EXAMPLES`, or for one callable in `CALLS`.
"""

import dataclasses
import importlib
import inspect
import math
import signal
import tempfile
import warnings
from importlib.util import find_spec
from inspect import signature
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import sympy as sp
from test_types import PUBLIC

import granular
import tensegrity as ts
from granular import contact_network, design
from granular.lammps import run_lammps, to_lammps
from granular.layout import diamond_layout, y_layout
from tensegrity import objective
from tensegrity.checked import declared
from tensegrity.engine import methods
from tensegrity.measure import observables
from tensegrity.prisms.fold_curve import limit_load
from tensegrity.prisms.stability import first_loss, lowest
from tensegrity.scenes.scene import Scene
from tensegrity.waves.curve import largest_speed

WRONG = {
    "None": None, "text": "x", "text of a number": "1.5", "empty text": "", "bytes": b"1",
    "True": True, "numpy's True": np.True_, "nan": math.nan, "inf": math.inf, "-inf": -math.inf,
    "-1": -1, "0": 0, "1e308": 1e308, "1e30": 1e30, "1e-30": 1e-30, "5e-324": 5e-324,
    "10**12": 10**12, "huge": 10**400, "-huge": -(10**400), "half": 2.5, "complex": 1j,
    "list": [], "list of text": ["x"], "list of None": [None, None], "ragged": [[1.0], [1.0, 2.0]],
    "dict": {}, "set": {1}, "object": object(), "type": float, "function": lambda *_: None,
    "array": np.array([1, 2]), "0-d": np.array(2.5), "0-d nan": np.array(math.nan),
    "complex array": np.ones(3, complex), "objects": np.array([None, {}], dtype=object),
    "deep": np.ones((1, 1, 1, 1)), "namespace": SimpleNamespace(prism=1, scene=2),
}  # fmt: skip
NO_NUMBERS = (
    "text", "text of a number", "empty text", "bytes", "True", "numpy's True", "nan", "huge",
    "complex", "list", "list of text", "dict", "object", "function", "array", "0-d nan",
    "namespace",
)  # fmt: skip
PARTS = ("None", "text", "True", "nan", "inf", "-1", "1e308", "huge", "list", "array", "0-d nan")
EXTREME = ("1e308", "1e30", "1e-30", "5e-324", "10**12", "half", "0-d")
SECONDS = 20  # of a processor, that a call may take
LONGEST = 500  # characters of a message
SEARCHES = (  # take long with these: see their tests
    ts.orbit_path, ts.solitary_wave, largest_speed, limit_load, design.peak_force,
    design.search, design.robustness, granular.pack, granular.fcc_pack, granular.hexagonal_pack,
    ts.work_precision,
)  # fmt: skip
MADE_BY_OTHERS = {
    "BeadChain", "EquilibriumPath", "WorkPrecision", "Pack", "Run", "SolitaryWave", "StructurePath",
    "TransitionWave", "Transmission",
}  # fmt: skip
INNER = {  # what runs, paths and searches ask of their objects, and nobody else
    "Best", "Budget", "Corrected", "Floquet", "Method", "Midpoint", "Modes", "Nystrom",
    "Objective", "Orbit", "Prediction", "Problem", "Pulse", "Splitting", "StructureModes",
    "Trace", "arrays", "at", "available_energy", "beyond", "bind", "by_beads", "changed",
    "check", "check_room", "children", "columns", "contacts_at", "contacts_within", "cosines",
    "default", "derivative", "designs", "each", "energies", "evaluate", "extreme", "fastest",
    "finer_share", "followed", "freedom", "frequency", "frequency_of", "is_alike",
    "largest_stiffness", "listed", "listings", "measure", "mutants", "name", "name_of",
    "needed", "nystrom_of", "of", "opened", "palindrome", "parts", "placed", "places_of",
    "plan", "present_ranges", "projected", "random", "reachable", "refuse_open", "rows",
    "shared", "steps", "stiffest", "stiffness_within", "stored_by_site", "stretch", "table",
    "tangent", "trace", "varied", "walls_hold", "walls_named", "with_springs", "worth",
}  # fmt: skip

REFUSED = {"PairLaw.over_time", "PairLaw.sound_speed", "PairLaw.to_c"}  # of a Potential, always

R, TIME = sp.symbols("r t")
SPRING = ts.Prism(1.0, 0.7, 0.01, 1.0).potential()
ENDS = sp.symbols("q_i q_j")
HINGE = ts.PairLaw((ENDS[1] - ENDS[0]) ** 2 / 2, *ENDS)
HINGES = ts.PairLattice([[1.0]], [[0.0]], [(0, 0, 1, HINGE)])
ELASTIC = ts.Prism(1.0, 0.7, 0.01, 1.0, 10.0, 100.0)
STEEL, PTFE = granular.materials["steel"], granular.materials["ptfe"]
BEAD, SMALL = granular.Bead(4.76e-3, STEEL), granular.Bead(3e-3, STEEL)
STRIKER = granular.Striker(BEAD, 0.5)
BEADS = granular.chain([BEAD] * 6, striker=STRIKER, end=STEEL)
LINE = ts.Chain(SPRING, 24)
LANES = ts.Ensemble(ts.Chain(SPRING, 4), 2)
ROW = ts.Lattice([(0, 0)], [(1, 0)], strings=[(0, 0, 1)]).prestressed([0.1])
TRUSS = ts.Structure([[-1, 0], [1, 0], [0, 1]], bars=[(0, 2), (1, 2)])
FLAT = TRUSS.at([[-1, 0], [1, 0], [0.1, 0.0]], natural_lengths=None)
WALL = ts.Wall((0, 0), (0, 1))
NET = ts.Network([[0, 1], [1, 1], [2, 1]], [(0, 1), (1, 2)], SPRING, walls=[WALL], radius=0.4,
              wall_contacts=[(0, 0)], wall_spring=ts.PowerLaw(1.0, 1.5))  # fmt: skip
HERTZ = ts.PowerLaw(1.0, 1.5, preload=0.1)
FAMILY = ts.predict(HERTZ)["compression"]
WAVE = ts.solitary_wave(SPRING, speed_ratio=2.0)
CELL = ts.solitary_wave(ts.Potential(R**2 / 2 + R**3 / 3, R), [1.0, 0.25], speed_ratio=1.05)
LINEAR, CUBIC = ts.Potential(R**2 / 2, R), ts.Potential(R**2 / 2 + R**3 / 3 - R**4 / 4, R)
CNOIDAL = ts.periodic_wave(CUBIC, period=12, height=0.1)
WELLS = ts.Potential(R**4 / 4 - 0.45 * R**3 + 0.175 * R**2, R)
FRONT = ts.transition_wave(CUBIC, ahead=0.0, behind=2 / 3)
PAIR = ts.Chain(ts.Prism(1.0, 0.7, 0.1, 1.0).potential(), 2, ends=("fixed", "free"))
SWUNG = ts.periodic_orbit(PAIR, ts.State([0, 0.04], [0, 0]), period=3.7)
LENNARD_JONES = ts.Potential(((1 + R) ** -12 - 2 * (1 + R) ** -6) / 72, R, domain=(-1.0, math.inf))
WIDTH, HEIGHT = sp.symbols("w h", positive=True)
CABLES = ts.Member(WIDTH, 1.0, 2, string=True)
BARS = ts.Member(sp.sqrt(WIDTH**2 + HEIGHT**2), 50.0, 2)
CROSS = {"inner": [WIDTH], "control": HEIGHT, "members": [CABLES, ts.Member(HEIGHT, 2.0, 2), BARS],
         "energy": sp.Symbol("c") * (HEIGHT - 0.75) ** 2, "parameters": {"c": 1.0},
         "rest": {"w": 1.0, "h": 0.75}, "prestrain": {CABLES: 0.1},
         "events": {"square": HEIGHT - WIDTH}}  # fmt: skip
UNIT = ts.Unit(**CROSS)
RUN = ts.simulate(LINE, LINE.at_rest({0: 0.03}), 20.0, record=ts.Record(every=1))
CROSSING, JOINED = ts.Chain(SPRING, 81), ts.interface(SPRING, SPRING, (40, 60), (1.0, 1.1))
MEETING = ts.simulate(CROSSING, WAVE.launch(CROSSING, 20) + WAVE.launch(CROSSING, 60, -1),
                      40 / WAVE.speed, dt=0.02, record=ts.Record(every=10**6))  # fmt: skip
MET = ts.simulate(JOINED, WAVE.launch(JOINED, 20), 40 / WAVE.speed, dt=0.02,
                  record=ts.Record(every=10**6))  # fmt: skip
SHORT_RUN = ts.simulate(LINE, LINE.at_rest({0: 0.01}), 1.0, record=ts.Record(times=[0.0, 1.0]))
EVEN = ts.simulate(LINE, LINE.at_rest({0: 0.03}), 8.0, record=ts.Record(interval=1.0))
BEADS_RUN = ts.simulate(BEADS, BEADS.start(), 6e-5, record=ts.Record(every=1))
CUBE = granular.fcc_pack(2, 2, bead=BEAD, floor=STEEL, sides=STEEL, striker=STRIKER)
PACKED = ts.simulate(CUBE, CUBE.start(), 1e-5, dt=1e-6)
FOLDER = tempfile.TemporaryDirectory()
FILE = f"{FOLDER.name}/run.npy"
ts.simulate(LINE, LINE.at_rest({0: 0.01}), 1.0, dt=0.1, record=ts.Record(path=FILE, checkpoint=1.0))
RUN.save(f"{FOLDER.name}/kept")
ts.files.write(f"{FOLDER.name}/truss.csv", TRUSS)
CURVE = f"{FOLDER.name}/curve.txt"
np.savetxt(CURVE, [[0.0, 0.0], [0.1, 2.0]], header="travel force")
T = np.linspace(0.0, 1e-4, 200)
SERIES = ts.TimeSeries(T, np.exp(-(((T - 5e-5) / 1e-5) ** 2)), "N")
X = np.linspace(-5.0, 5.0, 101)
SOLVED = {"supports": ts.held([0, 1]), "loads": {2: (0.0, -0.1)}}
PRESTRESS = {"prestrain": 0.1, "k_bar": 50.0, "k_string": 2.0, "mass": 0.5}
GUIDE = {"stem": 3, "branch": 3, "half_angle": 0.7, "bead": BEAD, "branches": (BEAD, BEAD)}
GUIDE |= {"wall": STEEL, "striker": STRIKER, "end": STEEL, "gap": 0.0, "through": 0.0}
GUIDE |= {"law": granular.hertz, "gravity": 9.81, "preload": 0.1}
LAYOUT = {"stem": 3, "branch": 3, "half_angle": 0.7, "diameter": 0.005}
ROWS = {"name": "own", "order": 2, "default_fraction": 0.1, "reference": "", "limitations": ""}
SPLIT = {"kicks": (0.5, 0.5), "drifts": (1.0,)}
NYSTROM = {"nodes": (0.5,), "matrix": ((0.0,),), "positions": (0.5,), "velocities": (1.0,)}

INSTANCES = {  # of classes whose methods are called
    "Bead": BEAD, "BeadChain": BEADS, "Chain": LINE,
    "Choice": design.Choice(3, 0.005, [STEEL, PTFE]),
    "Contact": granular.Contact(1e9), "Drive": ts.Drive(force=0.1), "Ensemble": LANES,
    "Force": ts.Force(TIME),
    "Lattice": ROW, "Matrix": ts.Matrix(1.0, 0.3, 1.0), "PairLattice": HINGES, "PairLaw": HINGE,
    "EquilibriumPath": ts.equilibrium_path(ELASTIC)[:2], "Network": NET,
    "Guide": granular.y_guide(**GUIDE), "Pack": CUBE, "Order": design.Order([BEAD, SMALL]),
    "Polynomial": ts.Polynomial(SPRING, -0.01, 0.01), "Potential": LENNARD_JONES, "Prism": ELASTIC,
    "PowerLaw": ts.PowerLaw(1.0, 1.5, 0.1), "Run": RUN, "SolitaryWave": WAVE, "State": RUN.final,
    "Unit": UNIT, "Member": CABLES,
    "TransitionWave": FRONT,
    "WorkPrecision": ts.work_precision(LINE, LINE.at_rest({0: 0.1}), 5.0, ["rkn6"], seconds=1.0),
    "Sizes": design.Sizes(3, (0.004, 0.006), 0.015, STEEL), "Structure": TRUSS,
    "TimeSeries": SERIES,
    "StructurePath": ts.equilibrium_path(TRUSS, max_load=0.1, **SOLVED), "Wall": WALL,
}  # fmt: skip
EXAMPLES = {  # of arguments, by their names
    "amplitude": WAVE.amplitude, "area": 1e-6, "at": 12, "axes": [0], "bars": [(0, 1)], "base": 1.0,
    "bead": BEAD, "beads": [BEAD] * 3, "between": (2e-5, 8e-5), "bond": 4,
    "bonds": [(0, 1), (1, 2)], "branch": 3, "branches": (BEAD, BEAD), "budget": 64,
    "cases": [1, -2], "chain": LINE, "chirality": "same", "coating": STEEL, "columns": 2,
    "constant": 1e9, "contact_radius": 1e-3, "contacts": "follow", "core": BEAD, "count": 3,
    "damping": ts.Damping(0.1, [0.1] * 24), "density": 1e3, "diameter": 0.005,
    "diameters": (0.004, 0.006), "direction": (0, -1), "displacement": 0.1, "domain": (-1.0, 1.0),
    "drive": {0: ts.Drive(force=0.1)}, "dt": 0.1, "elongation": np.exp(-(X**2)),
    "ends": ("free", "fixed"), "energy": R**2, "error": 0.1, "every": 1, "exponent": 1.5,
    "extent": (1.0, 0.0),
    "force": np.exp(-(((T - 5e-5) / 1e-5) ** 2)), "force_densities": [0.0, 0.0], "function": str,
    "gap": 1e-5, "given": [BEAD, SMALL], "gravity": 9.81, "ground": [0.1, 0.2], "half_angle": 0.7,
    "height": 0.7, "high": 0.01, "interval": 3e-6, "k_bar": 100.0, "k_base": 10.0, "k_cross": 1.0,
    "counts": 2, "lattice": ROW, "law": granular.hertz,
    "layers": 2, "length": 0.015, "lengths": [1.0, 1.0],
    "level": 0.05, "loads": {2: (0.0, -0.1)}, "low": -0.01, "lower": [0], "mass": 1.0,
    "masses": [1.0, 2.0], "material": STEEL, "materials": [STEEL, PTFE], "max_height": 0.75,
    "max_load": 1.0, "member": 0, "method": "rkn6", "min_height": 0.4, "modulus": 1e9,
    "name": "end", "natural_lengths": {0: 1.1}, "nodes": [0, 1], "noise": 0.1, "normal": (0.0, 1.0),
    "of": WAVE,
    "number": 1, "numbers": (1, 3), "objective": objective.displacement(1), "offset": (0, 1),
    "guess": LINE.at_rest(),
    "other": STEEL, "over": (0.1, 0.5), "p": 8, "parameters": {"k": 1.0}, "part": "chain",
    "path": f"{FOLDER.name}/made", "period": 1.0,
    "phase": 0.0, "places": [(0.0, 0.1), (0.0, 0.2)],
    "point": (0.0, 0.0), "points": [(0.0, 20.0)], "poisson": 0.3,
    "positions": [[0, 0], [1, 0], [0, 1]], "potential": SPRING, "preload": 0.1, "prestrain": 0.01,
    "prestrains": [0.01, 0.02], "prism": ELASTIC, "prisms": [ELASTIC, ELASTIC],
    "profile": np.exp(-(X**2)), "r": 0.0, "ranks": 1, "rate": -2 * X * np.exp(-(X**2)),
    "row": [0, 1, 0], "rows": 2, "run": BEADS_RUN, "scene": LINE, "scenes": [LINE] * 2,
    "seed": 0, "side": (0.0, 1.0), "site": 1, "sites": [1, 2], "space": design.Order([BEAD, SMALL]),
    "speed": 0.5, "speed_ratio": 1.05, "spring": SPRING, "springs": [SPRING, SPRING],
    "start": (0.0, 0.0), "state": LINE.at_rest({0: 0.01}), "stem": 3, "stiffness": 1.0,
    "stop": (1.0, 0.0), "striker": STRIKER, "struck": 0, "structure": TRUSS,
    "supports": ts.held([0, 1]), "t": T, "t_end": 1.0, "tail": 1e-6, "thickness": 1e-5,
    "times": [0.1, 0.2], "tol": 1e-4, "trace": objective.load(1), "traces": [objective.load(1)],
    "upper": [1], "velocity": {0: 0.1}, "wall": STEEL,
    "walls": [WALL], "wanted": ("prestrain",), "wavenumbers": [0.1], "x": 0.0,
}  # fmt: skip


def in_a_run(kind):
    """A method made and used: rows that are no method are refused by the run at the latest."""

    def run(**rows):
        return ts.simulate(LINE, LINE.at_rest({0: 0.01}), 1.0, method=kind(**rows))

    run.__name__ = kind.__name__
    return run


CALLS = [  # where other arguments are needed, or several in one call
    (ts.Prism.from_members, {"cross": 0.13, "base": 0.08, "bar": 0.1623, "k_cross": 19192.7,
                          "k_base": 31188.2, "k_bar": 4.7e7, "sides": 3}),
    (ts.compare_models, {"models": {"one": float}, "quantity": float, "reference": "one",
                         "record": ts.Record()}),
    (ts.prism_models, {"prism": ELASTIC, "count": 2, "speed": 0.01, "mass": 1.0, "gyration": 0.5,
                       "bars": 0.2}),
    (ts.work_precision, {"scene": LINE, "state": LINE.at_rest({0: 0.01}), "t_end": 1.0,
                         "methods": ["verlet"], "peers": [], "reference": LINE.at_rest(),
                         "seconds": 0.5}),
    (ts.equilibrium_path, {"prism": ELASTIC, "min_height": 0.4, "max_load": 1.0, "max_height": 0.75,
                        "past_contact": False}),
    (ts.equilibrium_path, {"prism": TRUSS, "max_load": 0.1, "branch": "stable",
                        "max_shortening": 0.1} | SOLVED),
    (ts.Structure, {"positions": [[0, 0], [1, 0], [0, 1]], "bars": [(0, 1)], "strings": [(1, 2)],
                 "k_bar": 1.0, "k_string": [1.0], "mass": 1.0, "natural_lengths": [1.0, 1.0],
                 "platforms": (), "bar_mass": 1.0, "string_mass": [0.1]}),
    (ts.Structure, {"positions": [[0, 0], [1, 0], [0, 1]], "bars": [(0, 1)], "strings": [(1, 2)],
                 "EA_bar": 1.0, "EA_string": [1.0], "buckling": 1.0, "plateau": 0.5}),
    (ts.Lattice, {"positions": [[0, 0], [1, 0]], "vectors": [[2, 0], [0, 1]],
                  "bars": [(0, 1, (0, 0))], "strings": [(1, 0, (1, 0)), (0, 0, (0, 1))],
                  "k_bar": 1.0, "k_string": [1.0, 1.0], "mass": 1.0, "natural_lengths": [1.0] * 3,
                  "bar_mass": [1.0], "string_mass": 0.1}),
    (ts.Lattice, {"positions": [[0, 0]], "vectors": [[1, 0]], "bars": [(0, 0, 1)],
                  "strings": [(0, 0, 1)], "EA_bar": 1.0, "EA_string": [1.0]}),
    (ROW.equilibrium, {"gradient": [[1.1, 0], [0, 1]]}),
    (ts.Matrix, {"modulus": 1.0, "poisson": 0.3, "density": 1.0, "loss": 0.1, "radius": 0.1,
                 "antiplane": True}),
    (ts.sheath, {"prism": ELASTIC, "G": 1.0, "outer": 2.0, "radius": 1.0}),
    (ts.catalogue.square().embedded, {"matrix": ts.Matrix(1.0, 0.3, 1.0), "cast": "released"}),
    (ts.bands, {"lattice": ROW, "wavenumbers": [[0.1], [2.0]]}),
    (ts.decay, {"lattice": ts.catalogue.square(), "frequencies": [0.1, 2.0], "axis": 0,
                "wavenumbers": 0.0}),
    (ts.effective_mass, {"lattice": ROW, "frame": [0], "frequencies": [0.1]}),
    (ts.control_path, {"structure": TRUSS, "natural_lengths": {0: 1.1}, "branch": "stable",
                    "keep": "EA",
                    "supports": ts.held([0, 1]), "loads": {0: (0.0, -0.1)}}),
    (TRUSS.prestressed, {"force_densities": [0.0, 0.0]}),
    (FLAT.prestressed, {"tension": {0: -0.1}, "supports": ts.held([0, 1]), "groups": [[0, 1]]}),
    (TRUSS.self_stress, {"supports": ts.held([0, 1]), "groups": [[0, 1]], "tolerance": 1e-9}),
    (FLAT.nearest_form, {"supports": ts.held([0, 1])}),
    (ROW.prestressed, {"force_densities": [0.1]}),
    (ELASTIC.problem, {"min_height": 0.4, "max_load": 1.0, "max_height": 0.75,
                       "past_contact": False}),
    (TRUSS.problem, {"max_load": 0.1, "branch": "stable", **SOLVED}),
    (ts.Member, {"length": WIDTH, "k": 1.0, "count": 2, "natural": 0.5, "string": True}),
    (ts.Unit, CROSS),
    (UNIT.formula, {"name": "axial stiffness"}),
    (UNIT.potential, {"preload": 0.1, "at": {"w": 1.0, "h": 0.75}}),
    (UNIT.problem, {"min_height": 0.4, "max_load": 1.0, "max_height": 0.8}),
    (ts.equilibrium_path, {"prism": UNIT, "min_height": 0.4, "max_load": 1.0, "max_height": 0.8}),
    (UNIT.axial_stiffness, {"at": {"w": 1.0, "h": 0.75}}),
    (UNIT.about, {"state": {"w": 1.0, "h": 0.75}}),
    (UNIT.equilibria, {"box": {"w": (0.5, 1.5), "h": (0.1, 1.5)}}),
    (ts.bar_contact, {"path": ts.equilibrium_path(ELASTIC), "diameter": 0.01}),
    (ts.fit, {"shortening": [0.0, 0.01, 0.02, 0.03], "load": [0.0, 0.001, 0.002, 0.003],
           "prism": ELASTIC, "free": ("prestrain",), "noise": 0.1}),
    *((take, {"force": SERIES.values}) for take in (ts.peaks, ts.first_peak, ts.largest_peak)),
    (ts.sampled, {"force": SERIES.values}),
    (ts.fit_run, {"records": {objective.load(1): SERIES}, "free": {"k": 1.0, "trigger": 0.1},
                  "scene": lambda k: ts.Chain(ts.PowerLaw(k, 1.5), 3), "dt": 1e-5,
                  "method": "verlet", "t_end": 2e-4}),
    (ts.read_record, {"path": CURVE, "channel": "force", "time": "travel", "scale": 2.0,
                      "offset": 0.1, "unit": "N"}),
    (ts.TimeSeries, {"values": SERIES.values, "unit": "N", "history": ["cut"]}),
    (SERIES.since, {"instant": 1e-5}),
    (SERIES.filtered, {"below": 1e5, "above": 1e4, "order": 2, "zero_phase": False}),
    (ts.arrival, {"run": SERIES, "after": 1e-5}), (ts.speed, {"run": (SERIES, SERIES.since(1e-5)),
                                                              "where": 0.1, "between": (0, 1)}),
    (ts.read_curve, {"path": CURVE, "x": "mm", "y": "-kN", "columns": ("travel", 1)}),
    (ts.catalogue.snelson_x, PRESTRESS | {"width": 1.0, "height": 2.0, "k_bar": [50.0, 60.0]}),
    (ts.catalogue.prism, {"sides": 4, "base": 1.0, "height": 2.0} | PRESTRESS),
    (ts.catalogue.column, {"count": 2, "sides": 3, "base": 1.0, "height": 2.0} | PRESTRESS),
    (ts.catalogue.expandable_octahedron, {"strut": 2.0} | PRESTRESS),
    (ts.catalogue.truncated_tetrahedron, {"strut": 2.0} | PRESTRESS),
    (ts.catalogue.geodesic, {"solid": "cube", "pattern": "diamond", "strut": 2.0, "ratio": 0.9}
     | PRESTRESS),
    (ts.catalogue.twin_strings, {"sides": 4, "base": 1.0, "height": 1.2, "prestrain": 0.1,
                                "k_string": 2.0, "other_prestrain": 0.2, "other_k_string": 1.0,
                                "torque": 0.01}),
    (ts.catalogue.twin_prism, {"sides": 4, "base": 1.0, "height": 1.2} | PRESTRESS),
    (ts.catalogue.tower, {"stages": 2, "radius": 1.0, "height": 1.5, "twist": 2.9} | PRESTRESS),
    (ts.catalogue.plate, {"rows": 2, "columns": 1, "side": 1.0, "height": 0.5} | PRESTRESS),
    (ts.catalogue.dome, {"sides": 5, "hoops": 1, "radius": 1.0, "rise": 0.2, "post": 0.3}
     | PRESTRESS),
    (ts.PairLaw, {"energy": sp.Symbol("k") * (ENDS[1] - ENDS[0]) ** 2, "first": ENDS[:1],
                  "second": ENDS[1:], "parameters": {"k": 1.0}, "site": ENDS[0] ** 2,
                  "rest": {ENDS[0]: 0.1, ENDS[1]: 0.1}} | {"site": 1.0}),
    (ts.Unit([ENDS[0]], ENDS[1], [ts.Member(1 + ENDS[1], 1.0)], ENDS[0] ** 2,
             rest=dict.fromkeys(ENDS, 0)).pair, {"sites": ["q_j"]}),
    (ts.PairLattice, {"vectors": [[1.0]], "positions": [[0.0]], "bonds": [(0, 0, 1, HINGE)],
                      "mass": 1.0}),
    (ts.Potential, {"energy": sp.Symbol("k") * R**2, "elongation": R, "parameters": {"k": 1.0},
                 "length": 1.0, "domain": (-1.0, 1.0)}),
    (ts.Potential.from_table, {"elongation": [-1.0, -0.5, 0.5, 1.0, 2.0], "kind": "smooth",
                               "tension": [-1.0, -0.6, 0.6, 1.5, 3.0], "noise": 0.1,
                               "preload": 0.1, "extrapolate": True, "length": 1.0}),
    (ts.units, {"length": "mm", "force": "N", "time": "s", "mass": "t", "energy": "mJ"}),
    (SPRING.varied, {"values": {"prestrain": 0.02}}), (SPRING.at, {"t": 0.1}),
    (SPRING.over_time, {"prestrain": 0.01 + 0.001 * TIME}),
    (ts.Chain, {"spring": SPRING, "sites": 3, "mass": [1.0, 2.0, 1.0], "ends": ("free", "fixed")}),
    (ts.Chain, {"spring": SPRING, "sites": 3, "drive": {0: ts.Drive(force=0.1)},
             "damping": ts.Damping(0.1)}),
    (ts.Chain, {"spring": SPRING, "sites": 2, "ground": [SPRING, SPRING]}),
    (ts.Chain, {"spring": SPRING, "sites": 3, "ends": "periodic", "stretch": 0.01}),
    (ts.Force, {"expression": SPRING, "at": [0], "parameters": {}}),
    (ts.Drive, {"displacement": sp.sin(TIME)}),
    (ts.Force, {"expression": R * TIME, "on": "bonds", "at": [0], "parameters": {}}),
    (ts.Force(TIME).values, {"x": 0.1, "rate": 0.1, "t": 0.1}),
    (granular.kuwabara_kono, {"c": 1e-6}), (granular.hunt_crossley, {"c": 0.1}),
    (granular.viscous, {"c": 0.1}), (granular.carretero_gonzalez, {"g": 0.1, "a": 1.5}),
    (granular.kuwabara_kono, {"restitution": 0.9, "speed": 1.0}),
    (granular.tsuji, {"restitution": 0.9}), (granular.dmt, {"work": 0.05}),
    (ts.Drive, {"force": ([0.0, 1.0, 2.0], [0.0, 0.1, 0.2])}),
    (ts.Drive(force=0.1).at, {"t": [0.0, 1.0], "order": 0}),
    (ts.Ensemble, {"scenes": ts.Chain(SPRING, 3), "count": 2}),
    (ts.State, {"u": np.zeros(3), "v": np.zeros(3)}),
    (WALL.height, {"x": (1.0, 1.0)}),
    (WALL.overhang, {"x": (1.0, 1.0)}),
    (WALL.distance, {"x": (1.0, 1.0)}),
    (ts.Network, {"positions": [[0, 1], [1, 1], [2, 1]], "bonds": [(0, 1), (1, 2)],
               "lengths": [1.0, 1.0], "mass": 1.0, "walls": [WALL], "wall_contacts": [(0, 0)],
               "wall_spring": SPRING, "wall_gaps": [0.95], "radius": 0.05,
               "loads": np.zeros((3, 2)), "held": [2]}),
    (ts.animate, {"run": SHORT_RUN, "path": f"{FOLDER.name}/made.gif", "show": "energy",
                  "frames": 1, "rate": 10.0, "factor": 2.0, "label": "load [N]", "view": None}),
    (ts.Record, {"every": 1, "sites": [0, 1], "path": None}),
    (ts.Record, {"interval": 0.1, "path": FILE, "checkpoint": 1.0}),
    (ts.resume, {"path": FILE, "scene": None}),
    (ts.Run.load, {"path": f"{FOLDER.name}/kept"}),
    (ts.files.read, {"path": f"{FOLDER.name}/truss.csv"}),
    (ts.files.write, {"path": f"{FOLDER.name}/made.csv", "thing": TRUSS}),
    (RUN.table, {"quantity": "v", "sites": [1, 2], "times": [0.1, 0.2]}),
    (RUN.to_csv, {"path": f"{FOLDER.name}/made.csv", "quantity": "tension", "sites": [1]}),
    (RUN.to_dataframe, {"quantity": "v", "sites": [1, 2], "times": [0.1, 0.2]}),
    *([] if find_spec("flint") is None else [
        (ts.prove, {"of": WAVE, "period": 30.0, "exact": "decimals"}),
        (ts.verify, {"path": str(Path(__file__).with_name("wave.json"))}),
    ]),
    (ts.gradient, {"dt": 0.1, "method": "verlet", "wanted": ("prestrain",), "checkpoints": 5}),
    (objective.load, {"wall": 1}),
    (objective.load, {"bond": 1}),
    (objective.impulse, {"bond": 1}),
    (objective.misfit, {"t": [0.1, 0.2], "values": [0.0, 1.0]}),
    (ts.solitary_wave, {"speed_ratio": 2.0, "family": "compression"}),
    (ts.solitary_wave, {"speed": 2 * WAVE.sound_speed}),
    (ts.periodic_orbit, {"scene": PAIR, "guess": SWUNG, "period": SWUNG.period}),
    (ts.periodic_orbit, {"scene": PAIR, "guess": SWUNG, "energy": SWUNG.energy}),
    (ts.orbit_path, {"orbit": SWUNG, "by": "period", "until": 3.68}),
    (ts.solitary_wave, {"amplitude": WAVE.amplitude}),
    (ts.transition_wave, {"spring": CUBIC, "ahead": 0.0, "behind": 2 / 3}),
    (ts.transition_wave, {"spring": LINEAR, "ahead": 0.0, "behind": 1.0, "ground": WELLS,
                          "damping": ts.Damping(ground=0.5)}),
    (FRONT.launch, {"chain": ts.Chain(CUBIC, 101), "at": 50.0, "direction": 1, "tail": 1e-6}),
    (ts.solitary_wave, {"energy": WAVE.energy}),
    (ts.solitary_wave, {"excess": 0.5}),
    (ts.genuine, {"make": lambda light: CELL, "low": 0.1, "high": 0.9, "count": 2}),
    (FAMILY.small_peak, {"excess": 1e-3}),
    (FAMILY.small, {"x": [0.0, 1.0], "excess": 1e-3, "order": 2}),
    (ts.predict, {"potential": HERTZ}),
    (ts.predict(LENNARD_JONES)["compression"].wall_peak, {"speed": 100.0}),
    (largest_speed, {"potential": SPRING, "mass": 1.0, "family": None, "closest": 0.04}),
    (limit_load, {"prism": ELASTIC, "prestrain": 0.012}),
    (first_loss, {"prism": ELASTIC, "support": "plates"}),
    (lowest, {"prism": ELASTIC, "path": ts.equilibrium_path(ELASTIC)[:2], "support": "plates",
              "count": 1}),
    (in_a_run(methods.Splitting), ROWS | SPLIT),
    (in_a_run(methods.Nystrom), ROWS | NYSTROM),
    (in_a_run(methods.Midpoint), ROWS),
    (in_a_run(methods.Corrected), ROWS | {"base": methods.METHODS["verlet"]}),
    (ts.angular_momentum, {"network": NET, "state": NET.at_rest()}),
    (ts.directions, {"network": NET, "u": NET.at_rest().u}),
    (ts.wall_gaps, {"network": NET, "u": NET.at_rest().u}),
    (observables.passage, {"t": X}),
    (ts.pulses, {"run": RUN, "row": 3}),
    (ts.phase_shift, {"run": MEETING, "left": WAVE, "right": WAVE}),
    (ts.interface, {"near": SPRING, "far": ELASTIC.potential(), "sites": (4, 4),
                    "mass": (1.0, 2.0)}),
    (ts.transmission, {"run": MET, "row": 1}),
    (ts.spectrum, {"run": EVEN, "sites": [1, 3, 5], "of": "u"}),
    (ts.lyapunov, {"scene": LINE, "state": LINE.at_rest({0: 0.01}), "t_end": 1.0, "dt": 0.1,
                   "every": 5, "tangent": LINE.at_rest({0: 0.1}), "seed": 1}),
    (ts.spectrum(EVEN).ridge, {"least": 0.1}),
    (ts.periodic_wave, {"spring": CUBIC, "mass": 1.0, "period": 8.0, "height": 0.1, "mean": 0.01}),
    (ts.periodic_wave, {"spring": CUBIC, "period": 12.0, "speed": 1.02}),
    (CNOIDAL.launch, {"ring": ts.Chain(CUBIC, 12, ends="periodic"), "at": 1.0, "direction": -1}),
    (CNOIDAL.elongation, {"x": [0.0, 1.0]}), (CNOIDAL.rate, {"x": [0.0, 1.0]}),
    (ts.shock, {"spring": CUBIC, "behind": 0.1, "ahead": 0.01, "mass": 1.0}),
    (ts.shock(CUBIC, 0.1).launch, {"chain": ts.Chain(CUBIC, 20), "at": 5.0}),
    (FAMILY.curve, {"speed_ratio": [1.5, 2.0]}),
    (ts.arrival, {"run": RUN, "bond": 4, "direction": 1}),
    (ts.tail_front, {"state": RUN.final}),
    (ts.budget, {"run": RUN}),
    (ts.bond_force, {"run": RUN}),
    (ts.speed, {"run": RUN, "where": (3, 5)}),
    (ts.width, {"x": X}),
    (granular.materials.__getitem__, {"name": "steel"}),
    (granular.fcc_pack, {"layers": 2, "side": 2, "floor": STEEL, "striker": STRIKER}),
    (granular.hexagonal_pack, {"rows": 2, "columns": 2, "sides": STEEL, "striker": STRIKER}),
    (granular.pack, {"beads": [BEAD] * 2, "walls": {"floor": (WALL, STEEL)}, "contacts": "fixed",
                     "gravity": 0.0, "preload": {}}),
    (contact_network.wall_forces, {"scene": CUBE, "u": CUBE.at_rest().u, "name": "floor"}),
    (contact_network.wall_sites, {"scene": CUBE, "name": "floor"}),
    (CUBE.distance, {"part": "layer 1", "numbers": (1, 2)}),
    (granular.sensor_force, {"number": 2}),
    (granular.wall_force, {"run": PACKED, "name": "floor", "each": True}),
    (to_lammps, {"scene": CUBE, "state": CUBE.start(), "t_end": 1e-5, "dt": 1e-6, "every": 2}),
    (run_lammps, {"scene": CUBE, "state": CUBE.start(), "t_end": 1e-5, "dt": 1e-6, "ranks": 1}),
    (INSTANCES["Sizes"].beads, {"row": [0.005, 0.005, 0.005]}),
    (design.peak_force, {"t_end": 1e-4}),
    (design.search, {"t_end": 1e-4, "budget": 64, "checkpoint": "search.npz"}),
    (design.robustness, {"t_end": 1e-3, "draws": 2}),
    (granular.Guide, {"layout": y_layout(3, 3, 0.7, BEAD.diameter),
                      "beads": dict.fromkeys(("stem 1", "branch 1", "branch 2"), BEAD),
                      "striker": STRIKER, "end": STEEL, "law": granular.hertz,
                      "gravity": 9.81, "preload": 0.1}),
    (y_layout, LAYOUT | {"gap": 0.0, "through": 0.0}),
    (diamond_layout, LAYOUT | {"gap": 0.0, "through": 0.0}),
]  # fmt: skip
if find_spec("flint") is None:
    INNER = {*INNER, "prove", "verify"}


def public():
    """{code: (name, callable)} of functions, classes and methods that take anything."""
    found = {}
    for module in (ts, granular, design, *map(importlib.import_module, PUBLIC)):
        own = [k for k, x in vars(module).items() if getattr(x, "__module__", 0) == module.__name__]
        for name in getattr(module, "__all__", own):
            thing = getattr(module, name)
            if name[0] == "_" or name in INNER or not callable(thing) or is_error(thing):
                continue
            if name not in MADE_BY_OTHERS:
                found.setdefault(thing, (name, thing))
            for method in dir(thing) if inspect.isclass(thing) else ():
                code = inspect.getattr_static(thing, method)
                made = isinstance(code, (classmethod, staticmethod))
                if f"{name}.{method}" in REFUSED:
                    continue
                if method[0] != "_" and method not in INNER and (made or inspect.isfunction(code)):
                    assert made or name in INSTANCES, f"add an instance of {name} to INSTANCES"
                    one = getattr(thing if made else INSTANCES[name], method)
                    found.setdefault(one.__func__, (f"{name}.{method}", one))
    return {code: (name, one) for code, (name, one) in found.items() if signature(one).parameters}


def is_error(thing):
    return isinstance(thing, type) and issubclass(thing, Exception)


def cases():
    """(name, callable, good arguments) of `CALLS`, and of every other public callable."""
    others = public()
    for function, given in CALLS:
        code = getattr(function, "__func__", function)
        others.pop(code, None)
        yield code.__qualname__.replace("<lambda>", "/".join(given)), function, given
    yield from ((name, function, {}) for name, function in others.values())


def completed(name, function, given):
    """Good arguments, with examples for those that have no default; and examples of all."""
    one, given, fitting = getattr(function, "__self__", None), dict(given), EXAMPLES
    if isinstance(one, (Scene, ts.Ensemble)):
        u = np.zeros(one.shape)
        fitting = EXAMPLES | {"u": u, "v": u, "state": ts.State(u, u)}
    examples = dict(given)
    for argument in signature(function).parameters.values():
        if argument.kind in (argument.VAR_KEYWORD, argument.VAR_POSITIONAL):
            continue
        if argument.default is argument.empty and argument.name not in given:
            assert argument.name in fitting, (
                f"{name} has a new argument: add a value of {argument.name!r} to EXAMPLES, or a "
                "call to CALLS"
            )
            given[argument.name] = fitting[argument.name]
        examples[argument.name] = given.get(argument.name, fitting.get(argument.name))
    return given, examples


def spoilt(example):
    """(words, the example with a part that is wrong)."""
    if isinstance(example, dict):
        for key, value in example.items():
            for words, part in [*((kind, WRONG[kind]) for kind in PARTS), *spoilt(value)]:
                yield f"{key}: {words}", example | {key: part}
            for kind in ("None", "text", "nan", "-1", "10**12"):
                yield f"key {kind}", {WRONG[kind]: value}
    elif isinstance(example, (list, tuple)) and example:
        first, *rest = example
        for words, part in [*((kind, WRONG[kind]) for kind in PARTS), *spoilt(first)]:
            yield f"first {words}", type(example)([part, *rest])
        yield "one less", example[:-1]
        yield "twice", example * 2
    elif isinstance(example, np.ndarray) and example.size:
        for kind in ("nan", "inf", "1e308", "-1"):
            wrong = np.array(example, dtype=float)
            wrong.flat[0] = WRONG[kind]
            yield f"array with {kind}", wrong
        yield "objects", example.astype(object)
        yield "an axis more", example[None]
        yield "one row less", example[:-1]
        yield "backwards", -example[::-1]


def outcome(function, arguments):
    """What a call answers, or the ts.TensegrityError that it raises; any other error passes."""

    def late(*_):
        raise TimeoutError(f"more than {SECONDS} s")

    signal.signal(signal.SIGPROF, late)
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return function(**arguments)
    except ts.TensegrityError as error:
        return error
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)


def has_nan(answer, depth=3):
    """Whether a number in an answer is NaN."""
    if dataclasses.is_dataclass(answer):
        answer = vars(answer)
    if isinstance(answer, dict):
        answer = tuple(answer.values())
    if isinstance(answer, (tuple, list)) and depth:
        return any(has_nan(part, depth - 1) for part in answer)
    number = isinstance(answer, (float, np.floating, np.ndarray))
    return number and np.asarray(answer).dtype.kind == "f" and bool(np.isnan(answer).any())


def faults(name, function, given):
    """What calls of a function answer that they should not, in words."""
    good, examples = completed(name, function, given)
    answer = outcome(function, good)
    has_none = has_nan(answer)  # where there is no such number, as its class says
    if isinstance(answer, Exception) and function is not run_lammps:
        yield f"the good call: {answer!r}"
    for argument, example in examples.items():
        number = type(example) in (int, float)
        for kind, wrong in [*WRONG.items(), *spoilt(example)]:
            takes_long = function in SEARCHES and any(word in kind for word in EXTREME)
            if takes_long or (kind == "10**12" and type(example) is float):
                continue
            words = f"{argument} = {kind}"
            try:
                answer = outcome(function, good | {argument: wrong})
            except Exception as error:
                yield f"{words}: {type(error).__name__}: {error}"
                continue
            if isinstance(answer, ts.TensegrityError):
                if len(str(answer)) > LONGEST:
                    yield f"{words}: {answer}"
            elif number and kind in NO_NUMBERS and not takes_others(argument, kind):
                yield f"{words} was taken"
            elif has_nan(answer) and not has_none:
                yield f"{words} gives NaN: {answer!r:.200}"


def printed(number):
    """A number as messages show it."""
    return f"{number:g}" if isinstance(number, float) else str(number)


def beside_bounds(said):
    """(number, words of its refusal, whether it is refused) on both sides of each bound that an
    argument declares."""
    beside = (lambda x, to: x + int(math.copysign(1, to))) if said.kind is int else math.nextafter
    for sign, bound in said.keywords.items():
        if sign in ("above", "below"):
            words = f"must be {sign} {printed(bound)}"
            yield bound, words, True
            yield beside(bound, math.inf if sign == "above" else -math.inf), words, False
        elif sign in ("least", "most"):
            words = f"must be at {sign} {printed(bound)}"
            yield bound, words, False
            yield beside(bound, -math.inf if sign == "least" else math.inf), words, True


def takes_others(name, kind):
    """Whether an argument is one number or several of them."""
    several = ("r", "x", "mass", "string_mass", "bond", "rate")
    return name in {"array": several, "list": several, "dict": ("preload",)}.get(kind, ())


CASES = list(cases())


@pytest.mark.parametrize(("name", "function", "given"), CASES, ids=[name for name, *_ in CASES])
def test_wrong_arguments_meet_a_tensegrity_error_or_a_finite_answer(
    name, function, given, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)  # some wrong paths are paths
    assert list(faults(name, function, given)) == []


DECLARING = [case for case in CASES if declared(case[1])]


@pytest.mark.parametrize("case", DECLARING, ids=[name for name, *_ in DECLARING])
def test_numbers_are_refused_at_declared_bounds_and_taken_beside_them(case):
    good, _ = completed(*case)
    for argument, said in declared(case[1]).items():
        for value, words, refused in beside_bounds(said):
            answer = outcome(case[1], good | {argument: value})
            answer = str(answer) if isinstance(answer, ts.TensegrityError) else ""
            is_named = answer.startswith(f"{argument} {printed(value)}")
            assert (is_named and answer.endswith(words)) is refused, f"{argument} {value}: {answer}"


def test_a_new_argument_without_an_example_is_named():
    def new(prism, momentum_flux):
        return prism, momentum_flux

    with pytest.raises(AssertionError, match=r"new has a new argument: add .*'momentum_flux'"):
        completed("new", new, {})
