"""Scenes of `golden.py`, small and with short runs, so that other machines, which round otherwise,
find the same, and what is measured of them: {name: function that gives scene, state, duration}.
"""

import tempfile
from functools import partial

import numpy as np
import sympy as sp
from contact_laws import law_of
from random_scenes import toda

import granular as gr
import tensegrity as ts
from granular.lammps import to_lammps

T, W, R, RATE, U, V, C = sp.symbols("t W r rate u v c")
U_X, V_X, V_Y, SPEED, SLIP = sp.symbols("u_x v_x v_y speed slip")
STEEL, PTFE = gr.materials["steel"], gr.materials["ptfe"]
BEAD, SMALL = gr.Bead(10e-3, STEEL), gr.Bead(6e-3, STEEL)
STRIKER = gr.Striker(BEAD, 0.5)
HANGING = {"gravity": 9.81, "preload": 2.0}
KONO, CROSSLEY = gr.kuwabara_kono(1e-6), gr.hunt_crossley(0.2)
SPRING = ts.Prism(1.0, 0.7, 0.1, 1.0).potential()
SOFT, RIGID = ts.Prism(1.0, 1.0, 0.1, 1.0, 5.0, 50.0), ts.Prism(1.0, 0.7, 0.02, 1.0)
LINEAR, DUFFING = ts.Potential(R**2 / 2, R), ts.Potential(R**2 / 2 + R**4 / 4, R)
CUBIC = ts.Potential(R**2 / 2 + R**3 / 3 - R**4 / 4, R)
WELLS = ts.Potential(R**4 / 4 - 0.45 * R**3 + 0.175 * R**2, R)
SHAKER = ts.Drive(force=0.05 * sp.cos(W * T), parameters={"W": 0.7})
DRAG = ts.Force(-W * V * abs(V), at=[1, 3], parameters={"W": [0.2, 0.3]})
STIFFER = ts.Force(0.1 * R**3 + C * RATE, "bonds", parameters={"c": 0.05})
KELVIN = ts.Force(-C * sp.Max(-R, 0) * sp.Max(-RATE, 0), "bonds", parameters={"c": 2e7})
SQUARE = [[0, 0], [1, 0], [1, 1], [0, 1]], [[0, 1], [1, 2], [2, 3], [3, 0], [0, 2], [1, 3]]
BOX = {"floor": (ts.Wall((0, 0), (0, 1)), STEEL), "left": (ts.Wall((0, 0), (1, 0)), STEEL)}
PLATES = ts.plates([0, 1, 2], [3, 4, 5])


def struck(scene, t_end):
    return scene, scene.start(), t_end


def thrown(scene, t_end, **velocity):
    """A scene at rest, but for the sites named s0, s1, ..."""
    moved = {int(name[1:]): v for name, v in velocity.items()}
    return scene, scene.at_rest(moved), t_end


def loose(dim, **more):
    """Beads apart from each other, above a floor and beside a wall."""
    draw, grid = np.random.default_rng(dim), np.stack(np.meshgrid(*[range(2)] * dim), -1)
    places = (grid.reshape(-1, dim) * 1.02 + 0.52 + draw.uniform(0, 0.01, (2**dim, dim))) * 10e-3
    walls = BOX if dim == 2 else {"floor": (ts.Wall((0, 0, 0), (0, 0, 1)), STEEL)}
    scene = gr.pack(places, BEAD, walls, **more)
    return scene, scene.at_rest(dict(enumerate(draw.uniform(-3, 1, places.shape)))), 2e-4


def heap(contacts="fixed", **more):
    """Three beads on each other, on a floor and between walls."""
    places = 10e-3 * np.array([(0.5, 0.5), (1.5, 0.5), (1.0, 0.5 + 0.75**0.5)])
    right = {"right": (ts.Wall((20e-3, 0), (-1, 0)), PTFE)}
    return gr.pack(places, BEAD, BOX | right, contacts, **more)


def square(**more):
    """Masses on a square, of which one is held."""
    drag = ts.Force((-C * V_X * SPEED, -C * V_Y), parameters={"c": 0.1})
    rubbed = ts.Force((0.1 * RATE * R**2, -0.3 * SLIP), "bonds")
    given = {"mass": [1, 1.5, 0.8, 1.2], "held": [0], "forces": (drag, rubbed)} | more
    return thrown(ts.Network(*SQUARE, DUFFING, **given), 4.0, s2=(0.2, 0.1))


def rows(**more):
    """Three chains of beads, each with its own blow."""
    scene = ts.Ensemble(gr.chain([BEAD] * 6, end=STEEL, **more), 3)
    return scene, scene.at_rest({0: [0.2, 0.3, 0.4]}), 1e-4


def chain_of(spring=SPRING, t_end=8.0, **more):
    return thrown(ts.Chain(spring, 6, np.linspace(1, 1.5, 6), **more), t_end, s1=0.03)


SCENES = {
    "gaps": lambda: thrown(
        gr.chain([BEAD, SMALL] * 3, end=STEEL, gaps=1e-6), 1e-4, s1=-0.3, s5=0.2
    ),
    "between walls": lambda: thrown(
        gr.chain([BEAD] * 4, start_wall=PTFE, end=STEEL, preload=3.0), 1e-4, s1=-0.3
    ),
    "gap by gap": lambda: thrown(
        gr.chain([BEAD] * 4, gaps=[0, 2e-6, 1e-6], law=gr.power(1e9, 1.4)), 1e-4, s0=0.1
    ),
    "lossy": lambda: struck(gr.chain([BEAD] * 5, striker=STRIKER, end=STEEL, law=KONO), 1.2e-4),
    "crossley": lambda: struck(
        gr.chain([BEAD] * 5, striker=STRIKER, end=STEEL, law=CROSSLEY, **HANGING), 1e-4
    ),
    "adhesion": lambda: thrown(
        gr.chain([BEAD] * 5, end=STEEL, law=law_of("DMT", 2e-7), preload=1.0), 1e-4, s0=0.05
    ),
    "adhesive pack": lambda: loose(2, law=law_of("DMT", 2e-7)),
    "table": lambda: thrown(gr.chain([BEAD] * 4, law=law_of("table", 2e-7)), 1e-4, s0=0.05),
    "following": lambda: loose(2),
    "heap": lambda: thrown(heap(contacts="follow", gravity=9.81), 1e-4, s2=(0.1, -0.3)),
    "following in space": lambda: loose(3, law=KONO),
    "not listed": lambda: thrown(  # is refused where they meet
        ts.Network([[0.0, 0.0], [3.0, 0.0]], [], ts.PowerLaw(1e3, 1.5), radius=0.5),
        5.0,
        s0=(1, 0.1),
    ),
    "y": lambda: struck(
        gr.y_guide(3, 4, bead=BEAD, striker=STRIKER, law=KONO, friction=(0.2, 0.05), end=STEEL),
        1e-4,
    ),
    "diamond": lambda: struck(
        gr.diamond_guide(
            3, 5, bead=BEAD, branches=(gr.Bead(10e-3, PTFE), BEAD), wall=STEEL, striker=STRIKER
        ),
        1e-4,
    ),
    "cubic pack": lambda: struck(
        gr.fcc_pack(2, 2, bead=BEAD, floor=STEEL, sides=PTFE, striker=STRIKER, gravity=9.81), 6e-5
    ),
    "pushed": lambda: chain_of(drive={0: SHAKER}, damping=ts.Damping(0.02, 0.01)),
    "moved": lambda: chain_of(
        drive={0: ts.Drive(displacement=([0, 1, 3, 9], [0, 0.02, -0.01, 0])), 5: SHAKER}
    ),
    "ground": lambda: chain_of(ground=[WELLS] * 5 + [DUFFING], ends=("fixed", "free")),
    "tuned": lambda: chain_of(
        SPRING.over_time(prestrain=0.1 + 0.01 * sp.sin(T)), drive={0: SHAKER}
    ),
    "forces": lambda: chain_of(toda(), forces=(DRAG, STIFFER, ts.Force(sp.sin(T) * U, at=[2]))),
    "square": square,
    "driven square": lambda: square(
        drive={
            1: ts.Drive(force=(0.1 * sp.cos(T), None)),
            2: ts.Drive(displacement=(None, 0.1 * T)),
        },
        damping=ts.Damping(bond=0.05, ground=0.02),
        held=[0, 3],
    ),
    "following forces": lambda: loose(2, forces=[KELVIN]),
    "plates": lambda: thrown(SOFT.column(3, "alternate", plates=(2.0, 0.4)), 6.0, s1=(0.02, 0.05)),
    "towers": lambda: thrown(
        ts.catalogue.tower(2).network(held=[0, 1, 2], damping=ts.Damping(0.1)),
        3.0,
        s5=(0.1, 0, -0.3),
    ),
    "lattice": lambda: thrown(
        ts.catalogue.kagome().network((2, 2), damping=ts.Damping(ground=0.1)), 2.0, s4=(0.2, 0.1)
    ),
    "rows": rows,
    "lossy rows": lambda: rows(law=CROSSLEY, forces=[ts.Force(-U, at=[2])]),
    "surrogate": lambda: chain_of(ts.Polynomial(SPRING, -0.05, 0.1, 1e-9)),
}


def taken(result, names):
    """Attributes of a result."""
    return {name: np.asarray(getattr(result, name)) for name in names.split()}


def part_of(scene):
    """The part of a scene of beads in which sensors are."""
    return "chain" if "chain" in scene.parts else "stem 1"


MEASURES = {  # of a run, and of the force on a sensor
    "energies": lambda run, _: taken(
        gr.energies(run), "kinetic stored effective_number virial_ratio"
    ),
    "shares": lambda run, _: taken(gr.energies(run), "fractions participation_ratio"),
    "overlaps": lambda run, _: {"": gr.overlaps(run)},
    "walls": lambda run, _: {"": gr.wall_force(run, "end")},
    "largest": lambda run, force: {"": ts.largest_peak(run.t, force)},
    "peaks": lambda run, force: {"": np.concatenate(ts.peaks(run.t, force))},
    "sampled": lambda run, force: {"": np.concatenate(ts.sampled(run.t, force, 3e-6))},
    "width": lambda run, force: {"": ts.width(run.t, force)},
    "duration": lambda run, _: {"": [ts.duration(run, 1), ts.arrival(run, 1)]},
    "momentum": lambda run, _: {"": run.momentum()},
    "speed": lambda run, _: {"": ts.speed(run, part_of(run.scene), (1, 3))},
}


def measured(name):
    """What is measured of beads that were struck, or why it is not."""
    scene, state, t_end = SCENES[name]()
    run = ts.simulate(scene, state, t_end, dt=t_end / 400, record=ts.Record(every=8))
    force = gr.sensor_force(run, part_of(scene), 1)
    found = {"force": force}
    for what, function in MEASURES.items():
        try:
            found |= {f"{what} {key}": value for key, value in function(run, force).items()}
        except ts.TensegrityError as error:
            found[what] = str(error)
    return found


GRADED = {
    "peak": ts.objective.peak(ts.objective.load(bond=1)),
    "impulse": ts.objective.impulse(bond=1),
    "energy": ts.objective.energy([1, 2]),
    "velocity": ts.objective.velocity(2),
    "norm": ts.objective.p_norm(ts.objective.load(1), 8),
    "misfit": ts.objective.misfit(ts.objective.displacement(1), [2e-5, 7e-5], [0.0, 1e-6]),
}


def graded(name, trace, method):
    """Derivatives of what a scene does."""
    scene, state, t_end = SCENES[name]()
    found = ts.gradient(trace, scene, state, t_end, dt=t_end / 300, method=method)
    return taken(found, "value mass u v") | dict(found.parameters)


def of_lammps():
    scene, state, t_end = SCENES["cubic pack"]()
    with tempfile.TemporaryDirectory() as folder:
        return {"text": to_lammps(scene, state, t_end, t_end / 99, f"{folder}/in").read_text()}


def graded_all():
    """{name: derivatives}: of all objectives of one scene, of one objective of all scenes."""
    smooth = ["pushed", "moved", "ground", "forces", "square", "lossy", "crossley", "y", "towers"]
    elastic = ["gaps", "adhesion", "between walls", "rows", "table", "cubic pack", "diamond"]
    cases = [(k, "velocity", "rk4") for k in smooth] + [(k, "peak", "rkn6") for k in elastic]
    cases += [("rows", k, "verlet") for k in GRADED]
    cases += [("lossy rows", k, "rk4") for k in ("energy", "peak")]
    return {f"{scene}, {k}": partial(graded, scene, GRADED[k], how) for scene, k, how in cases}
