"""Time and memory of a site from a hundred to ten million, and what follows for more.

Chains of prisms and face-centred packs of steel beads, velocity Verlet on one thread, and the same
packs in LAMMPS on one rank; CPU time, the least of several processes for each size.  From the cost
of a bead and of its steps follows up to how many steps, and on how many ranks, LAMMPS takes less
time; from that of a design in a search and of a case handed to a worker, what 1e8 designs cost.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor

import numpy as np

from benchmarks import lammps
from benchmarks._charts import FOLDER, charted
from benchmarks._timing import record, table
from granular import Bead, Striker, materials
from granular.design import Order, search
from tensegrity import sweep

CHAINS = tuple(10**k for k in range(2, 8))
PACKS = (3, 5), (8, 10), (20, 22), (46, 46), (100, 100)  # layers and side
LARGEST = 214, 216  # ten million beads, where there is room for them
ROOM = 16e9  # bytes
REPEATS, FEW = 3, 100  # processes, of sizes or layers below so many
COLUMNS = ("sites", "built [s]", "site-step [ns]", "built [B]", "run [B]")
BEYOND = 10**8, 10**9, 10**10
DESIGNS, BUDGET = 10**8, 20_000
CASES = 20_000
STEEL = materials["steel"]


def measured(kind, *size):
    """The five numbers of `benchmarks._sizes`, least of several processes."""
    command = [sys.executable, "-m", "benchmarks._sizes", kind, *map(str, size)]
    one = os.environ | {"TENSEGRITY_THREADS": "1"}
    found = [
        subprocess.run(command, capture_output=True, text=True, check=True, env=one).stdout.split()
        for _ in range(REPEATS if size[0] < FEW else 1)
    ]
    return np.array(found, dtype=float).min(axis=0)


def by_size():
    """{kind: rows of the five numbers}, printed."""
    free = os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    sizes = [*PACKS, *[LARGEST] * (free > ROOM)]
    found = {"chain of prisms": [measured("chain", n) for n in CHAINS]}
    found["pack"] = [measured("pack", *size) for size in sizes]
    if lammps.library():
        found["pack, LAMMPS"] = [measured("peer", *size) for size in PACKS]
    for kind, rows in found.items():
        table(kind, ["", *COLUMNS[1:]], [(f"{n:.0f}", s, 1e9 * e, *b) for n, s, e, *b in rows])
    return found


def beyond(found):
    """Print what the largest size of each kind says of larger ones."""
    rows = []
    for kind, several in found.items():
        count, built, each, _, most = several[-1]
        rows += [
            (f"{kind}, {n:.0e}", n * built / count / 3600, 1000 * n * each / 3600, n * most / 1e9)
            for n in BEYOND
        ]
    head = ["in proportion", "built [h]", "1e3 steps [h]", "memory [GB]"]
    table("larger scenes, one thread", head, rows)


def leave(ours, theirs):
    """Print where LAMMPS takes less time than one thread here, by steps and by ranks."""
    rows = []
    for mine, other in zip(ours, theirs, strict=False):
        count, built, each = mine[:3]
        _, start, step = other[:3]
        crossing = max(0.0, (built - start) / (count * (step - each)))
        record("pack", f"{count:.0f} beads", "step over LAMMPS", each, step)
        record("pack", f"{count:.0f} beads", "memory over LAMMPS", mine[4], other[4])
        rows.append((f"{count:.0f} beads", built / start, step / each, crossing))
    title = (
        "LAMMPS on one rank is faster below so many steps; a step is, on more ranks than its ratio"
    )
    table(title, ["", "build here/L.", "step L./here", "steps"], rows)


def designs():
    """Print what a search costs a design, and a sweep a case; in proportion, for 1e8 of them."""
    big, small = Bead(10e-3, STEEL), Bead(4e-3, STEEL)
    space, how = Order([big] * 10 + [small] * 10), {"wall": STEEL, "t_end": 1e-3, "seed": 0}
    search(space, striker=Striker(big, 0.44), budget=64, **how)
    began = time.process_time()
    best = search(space, striker=Striker(big, 0.44), budget=BUDGET, **how)
    each = (time.process_time() - began) / best.evaluations
    with ProcessPoolExecutor(2) as pool:
        sweep(abs, range(100), pool)
        began = time.process_time()
        sweep(abs, range(CASES), pool)
        handed = (time.process_time() - began) / CASES
    rows = [
        ("a design of 20 beads", 1e6 * each, DESIGNS * each / 3600),
        ("handing over a case", 1e6 * handed, DESIGNS * handed / 3600),
        ("workers kept busy", each / handed, ""),
    ]
    table("designs", ["", "us", "1e8 [h]"], rows)


def chart(found):
    """Time and memory of a site against their number."""
    rows = [(kind, n, s, 1e9 * e, *b) for kind, several in found.items() for n, s, e, *b in several]
    with charted("scale", FOLDER, ("kind", *COLUMNS), rows, figsize=(7, 3.4)) as (figure, written):
        figure.suptitle("The time of a step is nearly proportional to the number of sites")
        panels = figure.subplots(1, 2)
        for kind, several in found.items():
            count, _, each, _, most = np.transpose(several)
            below = 7 if kind == "pack" else -15
            for axes, y, beside in zip(panels, (1e9 * each, most), (7, below), strict=True):
                axes.loglog(count, y, "o-", ms=4)
                axes.annotate(kind, (count[-1], y[-1]), (0, beside), textcoords="offset points",
                              ha="right", fontsize=8.5)  # fmt: skip
        panels[0].set(ylabel="a site and a step [ns]", title="(a) time")
        panels[1].set(ylabel="memory of a site [bytes]", title="(b) memory")
        for axes in panels:
            axes.set(xlabel="number of sites")
            axes.margins(y=0.2)
    return written


def main():
    """Print all tables and write the chart."""
    found = by_size()
    beyond(found)
    if "pack, LAMMPS" in found:
        leave(found["pack"], found["pack, LAMMPS"])
    designs()
    print(*chart(found))
