"""Chains of prisms and face-centred packs of any size, and the same packs in LAMMPS: each in a
process of its own, for its memory.

Every function returns the number of sites, CPU seconds of the build, CPU seconds of a site and a
step of velocity Verlet, and the largest memory after the build and after the steps [bytes a site].
"""

import resource
import sys
import time
from pathlib import Path

import numpy as np

from benchmarks import lammps, packs
from granular import simulate
from tensegrity import Chain, Prism, Record, State

WORK, LONGEST = 5e7, 1600  # site-steps, and steps, of the longer one of two runs
MORE, ROUNDS = 8, 3  # times as many as of the shorter one; turns, of which the least time counts


def memory():
    """Largest memory of this program so far [bytes]; the other figure counts its parent's too."""
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
        return next(int(x.split()[1]) * 1024 for x in lines if x.startswith("VmHWM"))
    except (OSError, StopIteration):
        pass
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def stepped(run, sites):
    """CPU seconds of a site and a step: the difference of two runs, after a first one."""
    few = max(2, round(min(WORK / sites, LONGEST) / MORE))
    times = {few: np.inf, MORE * few: np.inf}
    run(2)
    for _ in range(ROUNDS):
        for steps in times:
            began = time.process_time()
            run(steps)
            times[steps] = min(times[steps], time.process_time() - began)
    return (times[MORE * few] - times[few]) / ((MORE - 1) * few * sites)


def measured(small, build, dt):
    """The five numbers of scenes built here; a small one is run first, which compiles the loop."""

    def run(scene, start, steps):
        last = Record(times=[steps * dt])
        simulate(scene, start, steps * dt, dt=dt, method="verlet", record=last)

    run(*small, 2)
    base, began = memory(), time.process_time()
    scene, start = build()
    built, size, count = time.process_time() - began, memory(), scene.sites
    each = stepped(lambda steps: run(scene, start, steps), count)
    return count, built, each, (size - base) / count, (memory() - base) / count


def chain(count):
    """A chain of prisms of which all sites move, with a step of a tenth of the unit of time."""

    def build(count=count):
        scene = Chain(Prism(1.0, 0.7, 0.1, 1.0).potential(), count)
        return scene, State(np.zeros(count), 1e-3 * np.sin(0.1 * np.arange(count)))

    return measured(build(50), build, 0.1)


def pack(layers, side):
    """A pack of steel beads, struck, of which all move."""

    def build(layers=layers, side=side):
        scene = packs.pack(layers, side)
        start = scene.start()
        return scene, State(start.u, start.v + 1e-6 * np.sin(np.arange(scene.sites))[:, None])

    return measured(build(2, 2), build, packs.STEP)


def peer(layers, side):
    """The beads of that pack, and their neighbours, in LAMMPS, all moving."""
    module = lammps.library()
    d = packs.STEEL.diameter
    base, began = memory(), time.process_time()
    core = module.lammps(cmdargs=lammps.QUIET)
    high, width = layers * d / 2**0.5, (side + 0.5) * d
    core.commands_string(f"""
        units si
        atom_style sphere
        atom_modify sort 0 0
        boundary f f f
        comm_modify vel yes
        lattice custom 1 a1 {d} 0 0 a2 0 {d} 0 a3 0 0 {d * 2**0.5} basis 0 0 0 basis 0.5 0.5 0.5
        region box block {-d} {width} {-d} {width} {-d} {high} units box
        create_box 1 box
        region inside block 0 {width - 0.7 * d} 0 {width - 0.7 * d} 0 {high - d / 2} units box
        create_atoms 1 region inside
        set group all diameter {d}
        set group all density {packs.STEEL.material.density}
        pair_style gran/hertz/history 1e9 NULL 0 NULL 0 0
        pair_coeff * *
        neighbor {0.1 * d} bin
        timestep 1e-8
        fix motion all nve
        velocity all create 1e-6 1 loop geom
        run 0
    """)
    built, size, count = time.process_time() - began, memory(), core.get_natoms()
    each = stepped(lambda steps: core.command(f"run {steps} post no"), count)
    return count, built, each, (size - base) / count, (memory() - base) / count


if __name__ == "__main__":
    print(*globals()[sys.argv[1]](*map(int, sys.argv[2:])))
