"""What else `golden.py` keeps, room by room: {name: function that gives numbers and texts}."""

import contextlib
import hashlib
import re
import tempfile
from functools import partial

import numpy as np
import sympy as sp
from contact_laws import law_of
from designs import BLOW, CHOICE, ORDER, SIZES
from golden_scenes import (
    BEAD,
    CUBIC,
    DUFFING,
    HANGING,
    LINEAR,
    RIGID,
    SHAKER,
    SMALL,
    SOFT,
    SPRING,
    STEEL,
    WELLS,
    T,
    V,
    W,
    chain_of,
    graded_all,
    heap,
    measured,
    of_lammps,
    square,
    taken,
)
from random_scenes import toda
from structures import icosahedron, upright

import granular as gr
import tensegrity as ts
from granular.design import robustness, search
from granular.lammps import run_lammps
from tensegrity.prisms.fold_curve import limit_load
from tensegrity.prisms.stability import first_loss
from tensegrity.waves.curve import largest_speed


def table(path):
    """Rows of a path, ten of them, and its events."""
    few = np.unique(np.linspace(0, len(path) - 1, 10).astype(int))
    found = {name: np.asarray(column)[few] for name, column in path.columns.items()}
    for k, event in enumerate(path.events):
        found[f"event {k} {event.kind}"] = [float(x) for x in event.at.values()]
    return found | {"rows": len(path), "end": path.end}


def loaded(structure, nodes, load):
    """Loads along the last axis."""
    return {n: (0,) * (structure.dim - 1) + (load,) for n in nodes}


def arch(**more):
    """Two bars that snap through under a load, the ground beneath them."""
    s = ts.Structure([[-1, 0], [1, 0], [0, 0.3]], bars=[(0, 2), (1, 2)], k_bar=10.0)
    return ts.equilibrium_path(s, supports=ts.held([0, 1]), loads={2: (0, -1.0)}, **more)


def squeezed(branch):
    ball = upright(icosahedron(0.02))
    ends = ts.plates([0, 4, 8], [3, 7, 11])
    return ts.equilibrium_path(ball, supports=ends, branch=branch, max_shortening=0.6)


THICK, PENTAGON = ts.Prism(1.0, 0.5, 0.4, 1.0, 3.0, 30.0), ts.Prism(1.0, 1.2, 0.05, 1.0, sides=5)
SLENDER = ts.Prism(0.02, 0.03, 0.02, 300.0, 2e3, 3e4)
PATHS = {
    "rigid": lambda: ts.equilibrium_path(RIGID),
    "rigid pentagon": lambda: ts.equilibrium_path(PENTAGON),
    "rigid, ends": lambda: ts.equilibrium_path(RIGID, min_height=0.5, max_load=0.5, max_height=0.8),
    "elastic": lambda: ts.equilibrium_path(SOFT),
    "elastic, ends": lambda: ts.equilibrium_path(SOFT, max_load=0.05, max_height=1.05),
    "thick": lambda: ts.equilibrium_path(THICK, past_contact=True),
    "several": lambda: ts.equilibrium_paths(
        [SOFT, RIGID, ts.Prism(1.0, 0.9, 0.1, 1.0, k_bar=50.0)]
    )[2],
    "limit load": lambda: limit_load(ts.Prism(1.0, 0.4, 0.3, 1.0, 5.0, 50.0), 0.35),
    "arch": lambda: arch(max_load=2.0),
    "arch, shortening": lambda: arch(max_shortening=0.2),
    "prism": lambda: ts.equilibrium_path(
        SOFT.structure(),
        supports=ts.plates([0, 1, 2]),
        loads=loaded(SOFT.structure(), (3, 4, 5), -1),
        max_load=0.01,
    ),
    "ball": lambda: squeezed("stable"),
    "symmetric ball": lambda: squeezed("symmetric"),
    "control": lambda: ts.control_path(SOFT.structure(), {3: 0.9, 4: 0.9, 5: 0.9}),
}


def strained():
    return ts.catalogue.octahedra().equilibrium(np.diag([1.02, 1, 0.99]))


STATICS = {
    "heap": lambda: taken(heap(gravity=9.81).equilibrium, "u residual"),
    "adhesive heap": lambda: taken(
        heap(preload={2: (0, -1)}, law=law_of("DMT", 2e-7)).equilibrium, "u residual"
    ),
    "cubic pack": lambda: taken(
        gr.fcc_pack(2, 2, bead=BEAD, floor=STEEL, sides=STEEL, **HANGING).equilibrium, "u residual"
    ),
    "adhesive cubic pack": lambda: taken(
        gr.fcc_pack(
            2,
            2,
            bead=BEAD,
            floor=STEEL,
            sides=STEEL,
            contacts="follow",
            gravity=9.81,
            law=law_of("DMT", 2e-7),
        ).equilibrium,
        "u residual",
    ),
    "guide": lambda: taken(
        gr.y_guide(3, 3, bead=BEAD, end=STEEL, **HANGING).equilibrium, "u residual"
    ),
    "prism": lambda: taken(
        ts.equilibrium(
            SOFT.structure(), loaded(SOFT.structure(), (3, 4, 5), -0.005), ts.plates([0, 1, 2])
        ),
        "displacements reactions tensions slack stable",
    ),
    "ball": lambda: (
        taken(icosahedron(0.02), "positions lengths tensions densities")
        | taken(icosahedron().self_stress(), "singular_values feasible")
        | taken(icosahedron(0.02).modes(9), "frequencies eigenvalues")
    ),
    "catalogue": lambda: {
        name: getattr(ts.catalogue, name)().tensions
        for name in [
            "dome",
            "expandable_octahedron",
            "geodesic",
            "plate",
            "prism",
            "snelson_x",
            "tower",
            "truncated_tetrahedron",
            "twin_prism",
        ]
    },
    "modes": lambda: taken(ts.modes(chain_of(ground=DUFFING)[0], count=5), "frequencies"),
    "prisms": lambda: (
        taken(RIGID, "reference_twist")
        | {
            "natural": SOFT.natural_lengths(),
            "stiffness": SOFT.axial_stiffness(),
            "locking": RIGID.locking_height(),
            "loss": first_loss(SLENDER, "tilting").load,
            "bars": ts.bar_contact(ts.equilibrium_path(SOFT), 0.2)[1:],
        }
    ),
}


def of_wave(wave):
    x = np.linspace(-4, 4, 9)
    found = {
        name: getattr(wave, name)(x)
        for name in ("displacement", "elongation", "rate")
        if hasattr(wave, name)
    }
    return found | taken(wave, "speed sound_speed excess amplitude energy momentum shift family")


def launched(spring):
    """A wave on its way, and what is measured of it."""
    wave, row = ts.solitary_wave(spring, speed_ratio=1.3), ts.Chain(spring, 60)
    run = ts.simulate(
        row, wave.launch(row, 20), 15 / wave.speed, dt=0.05, record=ts.Record(every=9)
    )
    (pulse,) = ts.pulses(run)
    return (
        taken(pulse, "place amplitude direction speed energy momentum first last")
        | taken(ts.budget(run, 25), "energy momentum work impulse")
        | {"u": run.final.u}
    )


def crossed():
    near, far = (ts.Prism(1.0, 0.8, prestrain, 1.0).potential() for prestrain in (0.1, 0.02))
    row, wave = ts.interface(near, far, (40, 40)), ts.solitary_wave(near, speed_ratio=1.2)
    run = ts.simulate(row, wave.launch(row, at=22.0), 28 / wave.speed, dt=0.05)
    names = "incident reflected transmitted reflected_delays transmitted_delays"
    return {
        name: [p.amplitude if hasattr(p, "amplitude") else p for p in np.atleast_1d(value)]
        for name, value in taken(ts.transmission(run), names).items()
    }


WAVES = {
    "prism": lambda: ts.solitary_wave(SPRING, speed_ratio=1.2),
    "fast prism": lambda: ts.solitary_wave(SPRING, mass=2.0, speed_ratio=1.9),
    "elastic": lambda: ts.solitary_wave(SOFT.potential(0.01), speed_ratio=1.05),
    "Hertz": lambda: ts.solitary_wave(ts.PowerLaw(1.0, 1.5), amplitude=-0.1),
    "preloaded": lambda: ts.solitary_wave(ts.PowerLaw(1.0, 1.5, 0.1), energy=0.05),
    "Toda": lambda: ts.solitary_wave(toda(), excess=0.3),
    "cubic": lambda: ts.solitary_wave(CUBIC, speed_ratio=1.05, family="rarefaction"),
    "front": lambda: ts.transition_wave(CUBIC, ahead=0.0, behind=2 / 3),
    "front on a ground": lambda: ts.transition_wave(
        LINEAR, ahead=0.0, behind=1.0, ground=WELLS, damping=ts.Damping(ground=0.5)
    ),
}
OTHERS = {
    "launched": lambda: launched(SPRING),
    "crossed": crossed,
    "families": lambda: {
        f"{name} {k}": str(family)
        for name, law in (("prism", SPRING), ("Hertz", ts.PowerLaw(1.0, 1.5)), ("cubic", CUBIC))
        for k, family in enumerate(ts.predict(law).families)
    },
    "curve": lambda: taken(
        ts.predict(SPRING)["compression"].curve(points=5),
        "amplitude speed excess energy momentum width",
    ),
    "limits": lambda: {
        "largest": largest_speed(SPRING),
        "sech2": ts.sech2(SPRING, 1.1, np.arange(4.0)),
        "tent": ts.tent(SPRING, np.arange(-2, 2.0)),
        "dispersion": ts.dispersion([SPRING, CUBIC], [1, 2], [0.1, 2], WELLS),
    },
    "multipliers": lambda: {"growth": ts.floquet(ts.solitary_wave(SPRING, speed_ratio=1.5)).growth},
}


def shaken(**more):
    """A mass on a held base, driven."""
    more = {"drive": {1: SHAKER}, "damping": ts.Damping(ground=0.2)} | more
    scene = ts.Chain(DUFFING, 2, ends=("fixed", "free"), **more)
    return ts.periodic_orbit(scene, scene.at_rest())


def swung(energy=None):
    """A free mass on a held base, and with another energy, as a part of the first one."""
    scene = ts.Chain(SPRING, 2, ends=("fixed", "free"))
    first = ts.periodic_orbit(scene, ts.State([0, 0.04], [0, 0]), period=3.7)
    return ts.periodic_orbit(scene, first, energy=energy * first.energy) if energy else first


AROUND = {
    "damping": ts.Damping(0.1, 0.1),
    "drive": {1: ts.Drive(force=(0.02 * sp.cos(W * T), None), parameters={"W": 1.3})},
}


def of_orbit(orbit):
    found = {"product": np.prod(ts.floquet(orbit).multipliers), "stable": ts.floquet(orbit).stable}
    return found | taken(orbit, "period energy") | {"u": orbit.state.u, "v": orbit.state.v}


ORBITS = {
    "period": swung,
    "energy": lambda: swung(energy=1.01),
    "driven": lambda: shaken(forces=(ts.Force(-0.1 * V * abs(V), at=[1]),)),
    "network": lambda: ts.periodic_orbit(*square(forces=(), held=[0, 3], **AROUND)[:2]),
}
BRANCHES = {
    "driven path": lambda: ts.orbit_path(shaken(), by="W", until=0.9),
    "free path": lambda: ts.orbit_path(swung(), by="period", until=3.75),
}


def of_lattice(lattice):
    q = np.random.default_rng(1).uniform(0, 3, (3, lattice.dim))
    found = {"moduli": ts.moduli(lattice).tangent, "stress": ts.moduli(lattice).stress}
    found |= taken(ts.bands(lattice, q, velocities=True), "frequencies velocities")
    return found | taken(lattice.stability(), "stable wave kind")


CELLS = {
    name: getattr(ts.catalogue, name)
    for name in [
        "honeycomb",
        "kagome",
        "octahedra",
        "resonators",
        "square",
        "triangular",
        "x_plate",
    ]
} | {"strained": strained}
LATTICES = {
    "strained cell": lambda: taken(strained(), "positions tensions"),
    "column": lambda: {
        "moduli": ts.moduli(SOFT.column(periodic=True)).tangent,
        "bands": ts.bands(SOFT.column(periodic=True), [[0.5], [2.0]]).frequencies,
    },
    "plates": lambda: {
        "bands": ts.bands(SOFT.column(plates=(2.0, 0.4), periodic=True), [[0.5], [2.0]]).frequencies
    },
    "decay": lambda: {
        "square": ts.decay(ts.catalogue.square(), [0.1, 2.0], wavenumbers=0.3),
        "resonators": ts.effective_mass(ts.catalogue.resonators(), [0], [0.1, 1.0]),
    },
    "at a frequency": lambda: {"moduli": ts.moduli(ts.catalogue.resonators(), 0.1).tangent},
    "self-stress": lambda: taken(
        ts.catalogue.octahedra().self_stress(), "singular_values feasible gap"
    ),
}


def fitted(of, free):
    """A prism found from the curve of another."""
    x = np.linspace(0, 0.2, 20)
    load = -of.potential().tension(-x) * (1 + 0.01 * np.sin(9 * np.arange(20)))
    start = ts.Prism(of.base, of.height, 0.08, of.k_cross, 4.0, 50.0)
    result = ts.fit(x, load, start, free)
    found = {"values": [*result.values.values()], "errors": [*result.errors.values()]}
    return found | taken(result, "offset condition noise residuals")


def found(space, **more):
    best = search(space, t_end=1e-3, budget=128, seed=1, **BLOW, **more)
    return taken(best, "peak_force evaluations history") | {
        "beads": [bead.diameter for bead in best.beads]
    }


FITS = {
    "prestrain and base": lambda: fitted(SOFT, ("prestrain", "k_base")),
    "prestrain": lambda: fitted(SOFT, ("prestrain",)),
}
DESIGNS = {
    "order": lambda: found(ORDER),
    "choice": lambda: found(CHOICE),
    "sizes": lambda: found(SIZES),
    "robustness": lambda: taken(
        robustness(
            [BEAD, SMALL] * 2, t_end=1e-3, gaps=1e-6, diameters=1e-5, speed=0.01, draws=5, **BLOW
        ),
        "peaks",
    ),
}


LAWS = {
    "prism": lambda: SPRING,
    "elastic": SOFT.potential,
    "preloaded": lambda: ts.PowerLaw(2.0, 1.5, 0.1),
    "rigid pentagon": PENTAGON.potential,
    "surrogate": lambda: ts.Polynomial(SPRING, -0.05, 0.1, 1e-9),
    **{
        f"{kind} table": lambda kind=kind: ts.Potential.from_table(
            [-1.0, -0.5, 0, 0.5, 1.0, 2.0], [-1.1, -0.5, 0, 0.6, 1.5, 3.0], kind
        )
        for kind in ("cubic", "monotone", "linear", "smooth")
    },
    "adhesion": lambda: law_of("DMT", 2e-7)(BEAD, BEAD).potential,
}


def of_law(law):
    """Derivatives of an energy."""
    r = np.array([-0.04, -1e-3, 0.0, 1e-9, 0.03])
    found = {f"order {n}": law.derivative(n, r) for n in range(4)}
    return found | {"domain": law.domain, "kinks": law.kinks}


ADDRESS = re.compile(r"0x[0-9a-f]+|/[\w./-]*/")  # of objects and temporary files


def refused():
    """{callable: texts}, with two wrong values for each of its arguments.

    Calls and wrong values are those of `test_bad_input`, imported here since it runs scenes.
    """
    import test_bad_input as bad

    found, slow = {}, [*bad.SEARCHES, bad.ts.animate, run_lammps]
    for name, function, given in bad.CASES:
        if function in slow:
            continue
        good, examples = bad.completed(name, function, given)
        lines = []
        for argument in examples:
            number = hashlib.sha256(f"{name} {argument}".encode()).digest()[0]
            for kind in np.roll(BAD, number)[:2]:
                wrong = good | {argument: bad.WRONG[kind]}
                with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
                    answer = bad.outcome(function, wrong)  # some wrong paths are paths
                if isinstance(answer, Exception):
                    lines.append(f"{argument} = {kind}: {ADDRESS.sub('', str(answer))}")
        key = name if name not in found else f"{name} of {' '.join(given)}"
        found[key] = "\n".join(lines)
    return found


BAD = "None", "text", "nan", "inf", "-1", "0", "half", "complex", "list", "ragged", "deep", "True"


def each(function, things):
    """{name: function that gives numbers of what a thing, called, gives}."""
    return {name: lambda make=make: function(make()) for name, make in things.items()}


def rooms():
    """{name: function that gives its numbers}, of all rooms."""
    struck = ["gaps", "lossy", "crossley", "adhesion", "y", "diamond"]
    found = {
        "paths": each(table, PATHS),
        "statics": STATICS,
        "waves": each(of_wave, WAVES) | OTHERS,
        "orbits": each(of_orbit, ORBITS) | each(table, BRANCHES),
        "lattices": each(of_lattice, CELLS) | LATTICES,
        "fits": FITS,
        "designs": DESIGNS,
        "laws": each(of_law, LAWS),
        "observables": {name: partial(measured, name) for name in struck},
        "gradients": graded_all(),
        "errors": {"of wrong arguments": refused},
        "lammps": {"cubic pack": of_lammps},
    }
    return {f"{room} {k}": f for room, of in found.items() for k, f in of.items()}
