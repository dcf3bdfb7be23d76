"""Protectors of the talk: design spaces, reference designs, and the force on the wall.

Part II of the talk names topology (the order of beads), size and material, not the numbers; ours:
20 beads of 10 mm or below, a free steel striker of 10 mm at 0.44 m/s, a steel wall.
"""

import itertools
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from typing import NamedTuple

import numpy as np

from figures import _searches
from figures._stored import stored
from granular import Bead, Striker, chain, energies, materials, simulate, wall_force
from granular.design import Choice, Order, Sizes, objective, peak_force, search
from tensegrity import Record, largest_peak, sweep

GROUP = "protectors"
STEEL = materials["steel"]
BIG, SMALL = Bead(10e-3, STEEL), Bead(4e-3, STEEL)
SOFT = Bead(10e-3, materials["ptfe"])
NAMES = ("steel", "ptfe", "rubber", "bronze", "glass", "nylon")
STRIKER = Striker(BIG, speed=0.44)
COUNT = 20
RANDOM, SEEDS = 1000, 5  # designs drawn with each seed
PART = 2048  # designs of one case of a sweep
ROWS = 3000  # recorded rows of a trace


class Scene(NamedTuple):
    """What is optimised."""

    title: str
    space: object
    t_end: float  # s
    method: str
    seeds: int
    budget: int
    compared: dict[str, list[Bead]]  # reference designs


def of(material, diameter=10e-3):
    """A uniform design."""
    return [Bead(diameter, materials[material])] * COUNT


def halves(first, second):
    """The stepped design: the first kind at the struck end."""
    return [first] * (COUNT // 2) + [second] * (COUNT // 2)


SCENES = {
    "T1": Scene(
        "order of 10 steel beads of 10 mm and 10 of 4 mm",
        Order(halves(BIG, SMALL)), 1e-3,
        "ga", 10, 5000,
        {"uniform 10 mm": of("steel"), "uniform 4 mm": of("steel", 4e-3),
         "stepped": halves(BIG, SMALL), "alternating": [BIG, SMALL] * (COUNT // 2)},
    ),
    "T2": Scene(
        "order of 10 steel and 10 PTFE beads of 10 mm",
        Order(halves(BIG, SOFT)), 8e-3,
        "ga", 10, 5000,
        {"uniform steel": of("steel"), "uniform PTFE": of("ptfe"),
         "stepped": halves(BIG, SOFT), "alternating": [BIG, SOFT] * (COUNT // 2)},
    ),
    "S": Scene(
        "diameters of 20 steel beads, 4 to 10 mm, 140 mm in all",
        Sizes(COUNT, (4e-3, 10e-3), 0.140, STEEL), 1e-3,
        "cma", 6, 25000,
        {"uniform 7 mm": of("steel", 7e-3), "stepped": halves(BIG, SMALL)},
    ),
    "M": Scene(
        "materials of 20 beads of 10 mm, six to choose from",
        Choice(COUNT, 10e-3, [materials[name] for name in NAMES]), 12e-3,
        "ga", 3, 40000,
        {"uniform steel": of("steel"), "uniform rubber": of("rubber"),
         "stepped": halves(BIG, SOFT), "alternating": [BIG, SOFT] * (COUNT // 2)},
    ),
}  # fmt: skip


def forces(chains, t_end):
    """Largest wall forces of designs, to 1e-4 [N]."""
    return peak_force(chains, striker=STRIKER, wall=STEEL, t_end=t_end)


def found(case):
    """Result of one search; (scene, seed)."""
    name, seed = case
    scene = SCENES[name]
    return search(
        scene.space, striker=STRIKER, wall=STEEL, t_end=scene.t_end,
        method=scene.method, budget=scene.budget, seed=seed,
    )  # fmt: skip


@stored(GROUP)
def histories():
    """Every search, as columns: {"scene seed": columns}."""
    cases = [(name, seed) for name, scene in SCENES.items() for seed in range(scene.seeds)]
    with ProcessPoolExecutor() as pool:
        results = zip(cases, sweep(found, cases, executor=pool), strict=True)
    return {f"{name} {seed}": _searches.columns(one) for (name, seed), one in results}


@cache
def searches(name):
    """What each seed found in a scene."""
    return [_searches.found(histories()[f"{name} {seed}"]) for seed in range(SCENES[name].seeds)]


def best(name):
    """The best result of all searches of a scene."""
    return min(searches(name), key=lambda one: one.peak_force)


@cache
def drawn(name):
    """Forces of random designs, in the order in which they were drawn [N]; (seeds, designs)."""
    space = SCENES[name].space
    rows = [space.random(np.random.default_rng(seed), RANDOM) for seed in range(SEEDS)]
    return np.array([some((name, one)) for one in rows])


def some(case):
    """Forces of rows of genes of a scene, with the steps of a search [N]."""
    name, rows = case
    scene = SCENES[name]
    unit = scene.space.all_kinds.unit(STEEL, STRIKER.speed)[0]
    steps = objective.step_count(unit, scene.t_end, 2 * objective.STEP_FRACTION * unit)
    designs = scene.space.designs(rows)
    return objective.largest(designs, STRIKER, STEEL, scene.t_end, steps).force


@stored(GROUP)
def every_order():
    """All 184756 orders of T1: the best thousandth of them with their forces, and the median."""
    places = np.array(list(itertools.combinations(range(COUNT), COUNT // 2)))
    rows = np.ones((len(places), COUNT), dtype=int)
    np.put_along_axis(rows, places, 0, axis=1)
    cases = [("T1", rows[k : k + PART]) for k in range(0, len(rows), PART)]
    with ProcessPoolExecutor() as pool:
        forces = np.concatenate(sweep(some, cases, executor=pool))
    top = np.argsort(forces)[: round(1e-3 * len(forces))]
    return {
        "best": {
            "force [N]": forces[top],
            "design": ["".join("Ab"[k] for k in rows[j]) for j in top],
        },
        "all": {"median [N]": [np.median(forces)]},
    }


def letters(name, beads):
    """A design as text: one letter per bead, or diameters in mm."""
    if name == "S":
        return " ".join(f"{1e3 * bead.diameter:.2f}" for bead in beads)
    if name in ("T1", "T2"):
        return "".join("A" if bead == BIG else "b" for bead in beads)
    return "".join(bead.material.name[0].upper() for bead in beads)


def trace(beads, t_end, scale=1.0):
    """Histories of the wall force and of the energies of the beads.

    Returns
    -------
    dict
        t [s]; force on the wall [N]; fraction of the energy of each bead (T, beads), the
        striker first; effective number of beads, by entropy.
    """
    scene = chain(beads, striker=STRIKER, end=STEEL)
    dt = scale * t_end / (4 * ROWS)
    run = simulate(
        scene, scene.start(), 4 * ROWS * dt, method="rkn6", dt=dt, record=Record(every=4)
    )
    found = energies(run)
    return {"t": run.t, "force": wall_force(run, "end"), "shares": found.fractions,
            "effective": found.effective_number}  # fmt: skip


def measures(one):
    """Measures of the force on the wall: peak [N], full width of the largest pulse at half maximum
    [us], impulse [mN s], effective beads at the peak."""
    t, force = one["t"], one["force"]
    instant, peak = largest_peak(t, force)
    top, ends = np.searchsorted(t, instant), np.flatnonzero(force < peak / 2)
    before, after = ends[ends < top].max(initial=0), ends[ends >= top].min(initial=len(t) - 1)
    return {
        "peak [N]": peak,
        "width [us]": 1e6 * float(t[after] - t[before]),
        "impulse [mN s]": 1e3 * float(np.trapezoid(force, t)),
        "effective beads at the peak": float(np.interp(instant, t, one["effective"])),
    }
