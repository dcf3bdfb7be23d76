"""Results as they are: `python tests/golden.py [START ...]` writes to golden.npz all of them, or
those of the cases whose names begin so, and leaves out what is no case any more.

What stays the same while the machinery changes is held against this file by `test_golden`: to the
bit on the machine, the compiler and the NumPy that made it, else to `ROUND_OFF`.  It is written
anew only where a result is meant to change, and the commit says which and why.
"""

import math
import platform
import sys
import tempfile
from pathlib import Path

import numpy as np
import sympy as sp
from golden_rooms import rooms
from golden_scenes import SCENES as MORE
from random_scenes import KINDS
from structures import icosahedron

from granular import Bead, Striker, chain, hexagonal_pack, materials
from tensegrity import (
    Chain,
    Damping,
    Drive,
    Ensemble,
    Network,
    PowerLaw,
    Prism,
    Record,
    TensegrityError,
    gradient,
    objective,
    resume,
    simulate,
)
from tensegrity.engine.native import described

PATH = Path(__file__).with_name("golden.npz")
ROUND_OFF = 1e-8  # of the largest of each array: digits that other instructions leave
LOOSER = {  # for cases whose names begin so
    "fits": 1e-6,  # the place of a minimum is known to half the digits
    "gradients contacts": 1e-3,  # beads that touch: ill-conditioned
}
NOTHING = {  # zero but for round-off
    "gradients between walls, peak|value",
    "laws linear table|order 3",
    "lattices octahedra|stress",
    "lattices resonators|stress",
    "lattices x_plate|stress",
    "waves front|momentum",
    *(
        f"statics {name}|residual"
        for name in ("heap", "adhesive heap", "cubic pack", "adhesive cubic pack", "guide")
    ),
}
ROWS = 5  # of a run that are kept
RUNS = (  # step and method; record
    ({}, {}),
    ({"tol": 1e-6}, {"every": 7}),
    ({"tol": 1e-9}, {"interval": 0.11}),
    ({"dt": 1 / 200}, {"every": 3, "sites": [0, 1]}),
    ({"dt": 1 / 400, "method": "rkn6"}, {"times": [0.1, 0.37, 0.9]}),
    ({"dt": 1 / 300, "method": "corrected6"}, {"interval": 0.23}),
    ({"dt": 1 / 500, "method": "rk4"}, {}),
)
STEEL = Bead(4.76e-3, materials["steel"])
T = sp.Symbol("t")


def driven():
    """A prism chain shaken at one end, with dashpots, whose prestrain changes."""
    spring = Prism(1.0, 0.8, 0.02, 1.0).potential().over_time(prestrain=0.02 + 0.001 * T)
    scene = Chain(
        spring, 20, drive={0: Drive(displacement=0.01 * (1 - sp.cos(T)))},
        damping=Damping(bond=0.01, ground=0.002),
    )  # fmt: skip
    return scene, scene.at_rest(), 10.0


def gas():
    """Discs whose contacts come and go."""
    at = np.array([(1.5 * i, 1.4 * j) for i in range(4) for j in range(3)], dtype=float)
    law = PowerLaw(1e3, 1.5)
    scene = Network(at, (), law, contacts="follow", law=law, radius=0.5)
    v = 2 * np.stack([np.cos(2.4 * np.arange(12)), np.sin(2.4 * np.arange(12))], axis=1)
    return scene, scene.at_rest(dict(enumerate(v))), 0.6


def structure():
    """An icosahedron whose strings go slack."""
    scene = icosahedron(0.02).network()
    return scene, scene.at_rest({0: (0.3, 0.1, -0.2), 7: (-0.2, 0.2, 0.1)}), 4.0


def beads():
    """A chain of different beads, struck, before a wall."""
    row = [STEEL, Bead(6e-3, materials["ptfe"])] * 5
    scene = chain(row, striker=Striker(STEEL, 0.5), end=materials["steel"])
    return scene, scene.start(), 2e-4


def plane_pack():
    """A hexagonal pack, struck from above."""
    scene = hexagonal_pack(
        4, 6, bead=STEEL, floor=materials["steel"], sides=materials["ptfe"],
        striker=Striker(STEEL, 1.0),
    )  # fmt: skip
    return scene, scene.start(), 1e-4


def different():
    """Chains side by side with springs and masses of their own."""
    chains = [Chain(PowerLaw(k, 1.5, preload=0.1), 12, k) for k in (1.0, 1.3, 1.7)]
    scene = Ensemble(chains)
    return scene, scene.at_rest({0: [0.1, 0.2, 0.3]}), 12.0


OWN = {f.__name__: f for f in (driven, gas, structure, beads, plane_pack, different)}
SCENES = {name: lambda f=f: f(np.random.default_rng(3)) for name, f in KINDS.items()} | OWN
SCENES |= MORE
RESUMED = {
    "locking": {"dt": 1 / 300, "method": "rkn6"}, "beads": {"tol": 1e-6}, "lossy rows": {},
    "following": {"dt": 1 / 100}, "forces": {"tol": 1e-8}, "driven": {"tol": 1e-4},
}  # fmt: skip


def numbers_of(run):
    """Numbers of a run: a few rows, and sums over all."""
    rows = np.unique(np.linspace(0, len(run.t) - 1, ROWS).astype(int))
    energy = run.energy.sum(axis=-1) if run.energy.ndim == 2 else run.energy  # of all scenes
    found = {"t": run.t[rows], "u": run.u[rows], "v": run.v[rows], "energy": energy[rows]}
    found |= {"final_u": run.final.u, "final_v": run.final.v}
    for name in ("steps", "error_estimate", "elongation_range", "work"):
        if getattr(run, name, None) is not None:
            found[name] = getattr(run, name)
    return found | {"sum_u": run.u.sum(axis=0), "sum_energy": energy.sum()}


def of_run(scene, step, record):
    """One run, its times and steps in units of its duration."""
    scene, state, t_end = SCENES[scene]()
    step, record = dict(step), dict(record)
    if "dt" in step:
        step["dt"] *= t_end
    for name in ("interval", "times"):
        if name in record:
            record[name] = np.multiply(record[name], t_end).tolist()
    return numbers_of(simulate(scene, state, t_end, **step, record=Record(**record)))


def of_file(scene, step):
    """A run to a file, broken off half way and gone on with."""
    scene, state, t_end = SCENES[scene]()

    def half_way(t, *_):
        return t > t_end / 2

    with tempfile.TemporaryDirectory() as folder:
        record = Record(every=2, path=f"{folder}/rows.npy", checkpoint=0)
        step = step | ({"dt": step["dt"] * t_end} if "dt" in step else {})
        simulate(scene, state, t_end, **step, record=record, observe=half_way)
        return numbers_of(resume(record.path, scene))


def of_gradient(scene, method):
    """Value and derivatives of a site's last displacement."""
    name, (scene, state, t_end) = scene, SCENES[scene]()
    trace = objective.displacement(1)
    how = {"checkpoints": 1} if name == "contacts" else {}  # beads that touch: ill-conditioned
    found = gradient(trace, scene, state, t_end, dt=t_end / 900, method=method, **how)
    numbers = {name: getattr(found, name) for name in ("value", "mass", "u", "v")}
    return numbers | dict(found.parameters)


def of_changing():
    """Springs of which each third changes in another phase, beside constant ones."""
    spring = Prism(1.0, 0.8, 0.02, 1.0).potential()
    each = [spring.over_time(prestrain=0.02 + 0.002 * sp.sin(T / 2 - k)) for k in range(3)]
    scene = Chain([*(each * 9), spring, spring], 30)
    return numbers_of(simulate(scene, scene.at_rest({0: 0.03}), 20.0, method="rkn6", dt=0.1))


def of_error(scene, how):
    """What a call is refused with."""
    scene, state, t_end = SCENES[scene]()
    try:
        simulate(scene, state, t_end, **how(t_end))
    except TensegrityError as error:
        return {"text": f"{type(error).__name__}: {error}"}
    return {"text": "no error"}


ERRORS = {
    "both": lambda t: {"dt": 0.1, "tol": 1e-6},
    "coarse": lambda t: {"dt": t},
    "method": lambda t: {"method": "euler"},
    "late": lambda t: {"record": Record(times=[2 * t])},
    "site": lambda t: {"record": Record(sites=[10**6])},
    "tight": lambda t: {"tol": 1e-20},
}


def cases():
    """{name: function that gives its numbers}; names begin with those of rooms."""
    found = {}
    for k, scene in enumerate(SCENES):
        chosen = [RUNS[(k + 2 * n) % len(RUNS)] for n in range(4)]
        for step, record in [RUNS[1], *RUNS[3:]] if scene in MORE else chosen:
            what = ", ".join(map(str, (*step.items(), *record.items())))
            found[f"scenes {scene}: {what}"] = lambda s=scene, a=step, b=record: of_run(s, a, b)
    for scene in ("locking", "contacts", "pack"):
        for method in ("verlet", "rkn6"):
            found[f"gradients {scene} {method}"] = lambda s=scene, m=method: of_gradient(s, m)
    for scene in ("locking", "contacts", "guide"):
        for name, how in ERRORS.items():
            found[f"errors {scene} {name}"] = lambda s=scene, h=how: of_error(s, h)
    for scene, step in RESUMED.items():
        found[f"resumed {scene}"] = lambda s=scene, a=step: of_file(s, a)
    return found | {"scenes of changing springs": of_changing} | rooms()


def machine():
    """Processor, its vector instructions, compiler and NumPy."""
    path = Path("/proc/cpuinfo")
    lines = [line.split(":", 1) for line in path.read_text().splitlines()] if path.exists() else []
    about = {line[0].strip(): line[1].split() for line in lines if len(line) == 2}
    name = " ".join(about.get("model name", [platform.processor()]))
    vectors = sorted(x for x in about.get("flags", []) if x.startswith(("avx", "fma")))
    return f"{name} ({' '.join(vectors)}); {described()}; NumPy {np.__version__}"


def results(case):
    """Numbers of a case, or what it was refused with."""
    try:
        found = case()
    except TensegrityError as error:
        found = {"text": f"{type(error).__name__}: {error}"}
    return {name: np.asarray(value) for name, value in found.items()}


def stored():
    """{case|field: its array}, of the file."""
    found, start = {}, 0
    with np.load(PATH) as file:
        index, data = str(file["index"]).splitlines(), file["data"].tobytes()
    for line in index:
        name, kind, shape = line.split("\t")
        shape, kind = [int(x) for x in shape.split()], np.dtype(kind)
        found[name] = np.frombuffer(data, kind, math.prod(shape), start).reshape(shape)
        start += found[name].nbytes
    return found


if __name__ == "__main__":
    kept = {"machine": np.array(machine())}
    before = stored() if sys.argv[1:] else {}
    for name, case in cases().items():
        if before and not name.startswith(tuple(sys.argv[1:])):
            kept |= {k: x for k, x in before.items() if k.startswith(f"{name}|")}
            continue
        kept |= {f"{name}|{field}": value for field, value in results(case).items()}
    index = [f"{k}\t{x.dtype.str}\t{' '.join(map(str, x.shape))}" for k, x in kept.items()]
    # all bytes as one array: 3,000 entries of a zip file would be as large as what they hold
    data = np.frombuffer(b"".join(x.tobytes() for x in kept.values()), np.uint8)
    np.savez_compressed(PATH, index="\n".join(index), data=data)
    print(
        f"{len(cases())} cases, {len(kept)} arrays, {PATH.stat().st_size / 1e6:.2f} MB, {machine()}"
    )
