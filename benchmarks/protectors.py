"""Protectors evaluated: designs a second on one core, in lanes, by numba, by LAMMPS.

T1 of the figures: a striker, 20 steel beads of 10 and 4 mm, a wall, 1 ms.  The same scheme is
"rkn6" with the same step in both; velocity Verlet, with the step that LAMMPS gets, stands beside
it.  The numba loop is what one would write: one design after the other, the force without
branches, its maximum kept on the way.  CPU time, minima of rounds.
"""

from __future__ import annotations

import math
import pickle
import time
from concurrent.futures import ProcessPoolExecutor

import numpy as np

from benchmarks._peers import has
from benchmarks._timing import cpu, record, table
from benchmarks.lammps import QUIET, library
from granular import Bead, Striker, materials
from granular.design import Order, objective, peak_force, search
from granular.design.searching import Problem
from tensegrity import METHODS

STEEL = materials["steel"]
BIG, SMALL = Bead(10e-3, STEEL), Bead(4e-3, STEEL)
STRIKER = Striker(BIG, 0.44)
SPACE = Order([BIG] * 10 + [SMALL] * 10)
T_END, VERLET = 1e-3, 2e-7  # s
DESIGNS, FEW = 512, 4
LOOK = 5  # steps of LAMMPS between two looks at the last bead
AIM = 1.5
MESSAGES = 200
BUDGET = 5000
SWEEP = 1e6  # designs


def numba_peaks(method):
    """A function (masses, contacts, speed, dt, steps) -> forces, of one core."""
    import numba

    kicks, drifts = np.array(method.kicks), np.array(method.drifts)

    @numba.njit(error_model="numpy", fastmath={"contract", "nsz", "arcp"})
    def run(weights, contacts, speed, dt, steps):
        forces = np.empty(len(weights))
        count = weights.shape[1]
        u, v, f = np.empty(count + 1), np.empty(count), np.empty(count + 1)
        for design in range(len(weights)):
            u[:], v[:], f[:] = 0.0, 0.0, 0.0
            v[0], largest = speed, 0.0
            w, k = weights[design], contacts[design]
            for step in range(steps + 1):
                for stage in range(len(drifts)):
                    a, b = dt * kicks[stage], dt * drifts[stage]
                    if stage == 0 and step > 0:
                        a += dt * kicks[-1]
                    if step == steps:
                        break
                    for j in range(count):
                        r = max(u[j] - u[j + 1], 0.0)
                        f[j + 1] = k[j] * r * math.sqrt(r)
                    if stage == 0:
                        largest = max(largest, f[count])
                    for j in range(count):
                        v[j] += a * w[j] * (f[j] - f[j + 1])
                        u[j] += b * v[j]
            forces[design] = largest
        return forces

    return run


def arrays(rows):
    """Inverse masses and contact constants of designs, the striker's first; (designs, 21)."""
    all_ = SPACE.designs(rows).behind(BIG)
    return 1 / all_.mass, all_.contacts(STEEL)


def lammps_evaluation(module, row):
    """The largest wall force of one design by LAMMPS, velocity Verlet: all that it takes."""
    beads = [BIG, *SPACE.beads(row)]
    edges = np.concatenate([[0.0], np.cumsum([bead.diameter for bead in beads])])
    centres = (edges[1:] + edges[:-1]) / 2
    core = module.lammps(cmdargs=QUIET)
    density = STEEL.density
    core.commands_string(f"""
        units si
        atom_style sphere
        atom_modify map array sort 0 0
        boundary f f f
        comm_modify vel yes
        region box block -0.02 {edges[-1] + 0.02} -0.02 0.02 -0.02 0.02
        create_box 1 box
        pair_style granular
        pair_coeff * * hertz/material {STEEL.modulus} 0 {STEEL.poisson} &
            tangential linear_nohistory 0 0
        neighbor 0.001 bin
        neigh_modify every 1 delay 0 check yes
        timestep {VERLET}
        fix motion all nve
    """)
    places = np.zeros((len(beads), 3))
    places[:, 0] = centres
    core.create_atoms(
        len(beads), list(range(1, len(beads) + 1)), [1] * len(beads), places.ravel().tolist()
    )
    for number, bead in enumerate(beads, 1):
        core.command(f"set atom {number} diameter {bead.diameter:.17g}")
    modulus = STEEL.modulus / (2 * (1 - STEEL.poisson**2))
    core.commands_string(f"""
        set group all density {density:.17g}
        velocity all set 0 0 0
        set atom 1 vx {STRIKER.speed}
        region plane plane {edges[-1]:.17g} 0 0 -1 0 0
        fix wall all wall/gran/region granular hertz {4 / 3 * modulus:.17g} 0 &
            tangential linear_nohistory 0 0 region plane
    """)
    largest = 0.0
    core.command("run 0 post no")
    for _ in range(round(T_END / VERLET) // LOOK):
        core.command(f"run {LOOK} pre no post no")
        ids = core.numpy.extract_atom("id")[: len(beads)]
        x = core.numpy.extract_atom("x")[: len(beads), 0]
        largest = max(largest, x[np.argmax(ids)] + beads[-1].radius - edges[-1])
    core.close()
    return objective.Designs.of([beads]).contacts(STEEL)[0, -1] * largest**1.5


def messages():
    """Seconds that a part of a search costs beyond its work, and bytes that it sends."""
    row = SPACE.random(np.random.default_rng(0), 16)
    problem = Problem(SPACE, STRIKER, STEEL, T_END, T_END / 439, None)
    size = len(pickle.dumps((problem, row)))
    with ProcessPoolExecutor(1) as pool:
        pool.submit(sent, (problem, row)).result()
        began = time.perf_counter()
        for _ in range(MESSAGES):
            pool.submit(sent, (problem, row)).result()
        return (time.perf_counter() - began) / MESSAGES, size


def sent(case):
    """What a worker returns for a part, without the work."""
    return np.zeros(len(case[1]))


def main():
    """Print designs a second, ratios, and what a sweep of a million costs."""
    rows = SPACE.random(np.random.default_rng(0), DESIGNS)
    designs = SPACE.designs(rows)
    unit = float(SPACE.all_kinds.unit(STEEL, STRIKER.speed)[0])
    steps = objective.step_count(unit, T_END, 2 * objective.STEP_FRACTION * unit)
    beads = [SPACE.beads(row) for row in rows]
    calls = {
        "lanes, rkn6": lambda: objective.largest(designs, STRIKER, STEEL, T_END, steps),
        "peak_force, default": lambda: peak_force(
            beads, striker=STRIKER, wall=STEEL, t_end=T_END
        ),
    }  # fmt: skip
    work = {name: DESIGNS for name in calls}
    if has("numba"):
        given = arrays(rows)
        for name, dt in (("rkn6", T_END / steps), ("verlet", VERLET)):
            loop = numba_peaks(METHODS[name])
            calls[f"numba, {name}"] = lambda loop=loop, dt=dt: loop(
                *given, STRIKER.speed, dt, round(T_END / dt)
            )
            work[f"numba, {name}"] = DESIGNS
        ours = objective.largest(designs, STRIKER, STEEL, T_END, steps).force
        apart = np.max(np.abs(calls["numba, rkn6"]() / ours - 1))
    module = library()
    if module is not None:
        calls["LAMMPS, verlet"] = lambda: [lammps_evaluation(module, row) for row in rows[:FEW]]
        work["LAMMPS, verlet"] = FEW
    seconds = cpu(calls)
    rates = {name: work[name] / t for name, t in seconds.items()}
    table("T1, designs a second on one core", ["", "1/s"], rates.items())
    pairs = [("numba, rkn6", f">= {AIM}"), ("numba, verlet", "-"), ("LAMMPS, verlet", "-")]
    ratios = [(f"lanes / {name}", rates["lanes, rkn6"] / rates[name], aim)
              for name, aim in pairs if name in rates]  # fmt: skip
    for name, faster, _ in ratios:
        record("ratios", name, "seconds", 1.0, faster)
    if "numba, rkn6" in rates:
        ratios.append(("largest difference, numba at steps", apart, "-"))
    if module is not None:
        theirs = np.array(calls["LAMMPS, verlet"]())
        fine = peak_force(beads[:FEW], striker=STRIKER, wall=STEEL, t_end=T_END)
        ratios.append(("difference of LAMMPS", np.max(np.abs(theirs / fine - 1)), "-"))
    table("ratios", ["", "measured", "target"], ratios)
    began = time.process_time()
    found = search(SPACE, striker=STRIKER, wall=STEEL, t_end=T_END, budget=BUDGET)
    cost = (time.process_time() - began) / found.evaluations
    message, size = messages()
    table("a search", ["", "measured"], [
        ("force found [N]", found.peak_force), ("designs", found.evaluations),
        ("us a design, all in all", 1e6 * cost), ("us a message of 16 designs", 1e6 * message),
        ("kB a message", size / 1e3),
        ("minutes for a million, one core", SWEEP * cost / 60),
    ])  # fmt: skip


if __name__ == "__main__":
    main()
