"""Packs of beads: from the call to the answer against LAMMPS, memory, and what following costs.

CPU time, minima over repeats, ratios in one run.  LAMMPS runs as `granular.lammps` writes it, by
velocity Verlet.  Its error is that of our own velocity Verlet, which moves alike to 1e-9: from
errors at two steps follows the step, and with the measured cost of a step the time, for the error
that `simulate(tol=1e-6)` reached.  Without LAMMPS the rest is measured.
"""

from __future__ import annotations

import math
import resource
import subprocess
import sys
import time
from functools import partial

import numpy as np

from benchmarks._timing import record, table
from granular import Bead, Striker, fcc_pack, materials, simulate
from granular.lammps import run_lammps
from tensegrity import Record, State, TensegrityError

STEEL = Bead(9.53e-3, materials["steel"])
SPEED, END, TOL = 1.65, 1e-3, 1e-6
EXACT = 5e-8  # s: step of the reference, by rkn6: 5e-7 of the speed at 1 ms, less before
STEPS = 1000  # of a timed call
LARGE = (20, 50, 0.2e-3)  # layers and side of the large pack, and its time [s]
STEP = 2e-7  # s
QUIET = (2e-4, 5e-4)  # s: ends of runs that leave beads at rest
REPEATS, TURNS = 3, 7


def pack(layers=17, side=7, **options):
    """The pack of the talk, or one of other counts."""
    return fcc_pack(
        layers, side, bead=STEEL, floor=materials["steel"], sides=materials["ptfe"],
        striker=Striker(STEEL, SPEED), **options,
    )  # fmt: skip


def contacts(scene):
    """Number of contacts in the list."""
    return len(scene.bonds) + len(scene.wall_contacts)


def cpu(call, repeats=REPEATS, who=resource.RUSAGE_SELF):
    """Smallest CPU time of a call [s], of this process or of those it starts."""
    found = []
    for _ in range(repeats):
        before = resource.getrusage(who)
        call()
        after = resource.getrusage(who)
        found.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return min(found)


def answer(how):
    """Build the pack, run it for 1 ms, and keep the last state; the run."""
    scene = pack()
    return simulate(scene, scene.start(), END, record=Record(times=[END]), **how)


def gap(run, reference):
    """Largest difference of velocities over the striker's speed, at the end."""
    return float(np.abs(run.final.v - reference.final.v).max() / SPEED)


def step_cost(ranks=1):
    """CPU seconds of one step in LAMMPS, its start apart."""
    scene = pack()
    times = [
        cpu(partial(run_lammps, scene, scene.start(), n * 1e-7, 1e-7, ranks=ranks, every=n), 2,
            resource.RUSAGE_CHILDREN)
        for n in (STEPS, 4 * STEPS)
    ]  # fmt: skip
    return (times[1] - times[0]) / (3 * STEPS)


def loop_costs():
    """Nanoseconds per contact-step here, fixed and followed, start apart, and of whole calls.

    The calls take turns.
    """
    calls, listed = {}, contacts(pack())
    for kind in ("fixed", "follow"):
        scene = pack(contacts=kind)
        state = scene.start()
        for n in (STEPS, 6 * STEPS):
            how = {"dt": STEP, "method": "verlet", "record": Record(every=n)}
            calls[kind, n] = partial(simulate, scene, state, n * STEP, **how)
            calls[kind, n]()
    times = dict.fromkeys(calls, math.inf)
    for _ in range(TURNS):
        for name, call in calls.items():
            times[name] = min(times[name], cpu(call, 1))
    found = {}
    for kind in ("fixed", "follow"):
        few, many = times[kind, STEPS], times[kind, 6 * STEPS]
        found[kind] = (many - few) / (5 * STEPS) / listed * 1e9
        found[f"{kind}, whole call"] = many
    return found


def against_lammps(ours):
    """Rows of the comparison at equal error."""
    reference = answer({"method": "rkn6", "dt": EXACT})
    found = []
    seconds = cpu(lambda: found.append(answer({"tol": TOL})), 1)
    run = found[0]
    reached = gap(run, reference)
    coarse, fine = (gap(answer({"method": "verlet", "dt": dt}), reference) for dt in (8e-8, 4e-8))
    order = math.log2(coarse / fine)
    step = 4e-8 * (reached / fine) ** (1 / 2)
    rows = [
        ("here, tol=1e-6, CPU s", seconds, ""), ("error reached", reached, "<= 1e-6"),
        ("steps, method", f"{run.steps}", run.method), ("order of Verlet seen", order, "2"),
        ("Verlet step, same error [s]", step, ""),
    ]  # fmt: skip
    try:
        each = step_cost()
    except TensegrityError as error:
        print(error)
        return rows
    theirs = each * END / step
    record("833 beads", "a step", "here over LAMMPS", ours * contacts(pack()), each * 1e9)
    record("833 beads", "same error", "here over LAMMPS", seconds, theirs)
    return [
        *rows,
        ("LAMMPS, ns/contact-step", each / contacts(pack()) * 1e9, ""),
        ("LAMMPS / here, a step", each * 1e9 / ours / contacts(pack()), ""),
        ("LAMMPS, CPU s, same error", theirs, ""),
        ("here / LAMMPS", seconds / theirs, "<= 0.1"),
    ]


CHILD = """
import resource, time
from benchmarks import packs
from tensegrity import Record
from granular import simulate
small = packs.pack(2, 2)
simulate(small, small.start(), 1e-6, dt=2e-7, method="verlet")
base = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
began = time.process_time()
scene = packs.pack({layers}, {side})
built = time.process_time()
run = simulate(scene, scene.start(), {end}, dt=2e-7, method="verlet", record=Record(every=10**6))
done = time.process_time()
most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(scene.sites, packs.contacts(scene), built - began, done - built, (most - base) * 1024)
"""


def large():
    """Rows on the large pack: time and memory, in a process of its own."""
    layers, side, end = LARGE
    code = CHILD.format(layers=layers, side=side, end=end)
    began = time.perf_counter()
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    wall = time.perf_counter() - began
    sites, listed, built, ran, size = map(float, said.stdout.split())
    steps = end / 2e-7
    return [
        ("beads", f"{sites:.0f}", ""), ("contacts", f"{listed:.0f}", ""),
        ("built, CPU s", built, ""), ("run for 0.2 ms, CPU s", ran, "minutes"),
        ("all, wall s", wall, ""), ("ns/contact-step, all", ran / listed / steps * 1e9, ""),
        ("peak memory, MB", size / 1e6, ""),
        ("over 1 kB a bead, .5 a contact", size / (1000 * sites + 500 * listed), "<= 1"),
    ]  # fmt: skip


def beads_at_rest():
    """Rows on a struck pack of which a part has not moved yet, against the same pack with a faint
    motion of all beads, which are then all in the steps."""
    scene = pack(41, 14)
    start, faint, found = scene.start(), 1e-250, []
    v = start.v + faint
    v[scene.held,] = 0.0
    for end in QUIET:
        rows = simulate(scene, start, end, dt=STEP, method="verlet", record=Record(every=25))
        how = {"dt": STEP, "method": "rkn6", "record": Record(times=[end])}
        parts, whole = (
            cpu(partial(simulate, scene, state, end, **how)) for state in (start, State(start.u, v))
        )
        record("8,037 beads", f"{end:g} s", "resting over moving", parts, whole)
        moving = float(np.any(rows.v != 0, axis=-1).mean())
        found.append((f"{end:g} s: moving on average, time", f"{moving:.2f}", parts / whole))
    return found


def main():
    """Print all of it."""
    costs = loop_costs()
    head = ["", "measured", "target"]
    for kind in ("follow", "follow, whole call"):
        record("833 beads", kind, "over fixed", costs[kind], costs[kind.replace("follow", "fixed")])
    table(
        "833 beads, velocity Verlet, ns per contact-step, CPU",
        head,
        [
            ("fixed", costs["fixed"], ""),
            ("follow", costs["follow"], ""),
            ("follow / fixed, a step", costs["follow"] / costs["fixed"], ""),
            ("follow / fixed, whole call",
             costs["follow, whole call"] / costs["fixed, whole call"], "<= 1.05"),
        ],
    )  # fmt: skip
    table("833 beads, 1 ms, from the call to the answer", head, against_lammps(costs["fixed"]))
    table("8,037 beads, of which many are at rest", head, beads_at_rest())
    table("50,000 beads, 0.2 ms", head, large())
