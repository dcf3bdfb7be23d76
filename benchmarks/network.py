"""Cost of the network loop: packs of beads in space, and a half guide, against their peers.

A pack of 833 steel beads, that of the talk (17 layers of 7 x 7, each bead touching 12, in a box of
five walls) and one of 37 x 37 x 37; velocity Verlet from random velocities, nanoseconds of CPU
time per contact and step of the whole loop.  Peers do the same sums: an earlier revision of this
package named by $TENSEGRITY_BEFORE (a checkout), a plain loop over contacts in numba, and LAMMPS
(granular hertz/material, no damping).  All take turns, in many short calls, the least of each
counts.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
import warnings
from pathlib import Path

import numpy as np

from benchmarks import lammps
from benchmarks._network import DT, SPEED, WORK, pack
from benchmarks._timing import table
from granular import Striker, y_guide
from tensegrity import METHODS, Record, State, simulate
from tensegrity.engine import threaded
from tensegrity.engine.bound import Bound
from tensegrity.engine.compiled import Compiled
from tensegrity.scenes.dynamics import dynamics

PACKS = {"833 beads": (7, 17), "50,653 beads": (37, 37)}
BEFORE = "TENSEGRITY_BEFORE"
ROUNDS = 40
THREADS = 2
FEWEST = 20  # steps of one call, whose last kick takes the forces once more
ROWS = 500


def bound(scene, state, dt, threads=1):
    """A scene bound to its loop, and its u and v."""
    u, v = dynamics(scene).arrays(state)
    bonds = dynamics(scene).loop_bonds
    given = Compiled.of(bonds), u, v, bonds, METHODS["verlet"], dt
    return (Bound(*given) if threads == 1 else threaded.ThreadedNetwork(*given, threads)), u, v


def in_numba(network, velocity, steps, dt=DT):
    """Velocity Verlet by a plain loop, as one would type it: a call that returns u and v."""
    import numba

    k, k_wall = (network.springs[i].values[0] for i in (0, -1))

    @numba.njit(error_model="numpy")
    def loop(x, u, v, f, bonds, length, mass, site, wall, normal, offset, radius, steps, dt):
        for step in range(steps + 1):
            kick = dt if 0 < step < steps else dt / 2
            drift = dt if step < steps else 0.0
            f[:] = 0
            for b in range(len(bonds)):
                i, j = bonds[b]
                dx = x[j, 0] + u[j, 0] - x[i, 0] - u[i, 0]
                dy = x[j, 1] + u[j, 1] - x[i, 1] - u[i, 1]
                dz = x[j, 2] + u[j, 2] - x[i, 2] - u[i, 2]
                distance = np.sqrt(dx * dx + dy * dy + dz * dz)
                overlap = max(length[b] - distance, 0.0)
                pull = -k * overlap * np.sqrt(overlap) / distance
                f[i, 0] += pull * dx
                f[i, 1] += pull * dy
                f[i, 2] += pull * dz
                f[j, 0] -= pull * dx
                f[j, 1] -= pull * dy
                f[j, 2] -= pull * dz
            for c in range(len(site)):
                s, n = site[c], normal[wall[c]]
                height = -offset[wall[c]]
                for axis in range(3):
                    height += n[axis] * (x[s, axis] + u[s, axis])
                overlap = max(radius - height, 0.0)
                push = k_wall * overlap * np.sqrt(overlap)
                for axis in range(3):
                    f[s, axis] += push * n[axis]
            for s in range(len(u)):
                for axis in range(3):
                    v[s, axis] += kick / mass * f[s, axis]
                    u[s, axis] += drift * v[s, axis]

    u, v, f = np.zeros_like(velocity), velocity.copy(), np.zeros_like(velocity)
    site, wall = network.wall_contacts.T.copy()
    normal = np.array([w.normal for w in network.walls])
    offset = np.array([w.normal @ w.point for w in network.walls])
    given = (
        network.positions, u, v, f, network.bonds, network.lengths, network.mass[0], site, wall,
        normal, offset, network.radius[0],
    )  # fmt: skip

    def run():
        u[:], v[:] = 0.0, velocity
        loop(*given, steps, dt)
        return u, v

    return run


class _Earlier:
    """The earlier revision, in a process of its own that advances on request."""

    def __init__(self, folder, size, steps):
        here = Path(__file__).parent
        self._process = subprocess.Popen(
            [sys.executable, str(here / "_network.py"), *map(str, (*size, steps))],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=folder,
            env=os.environ | {"PYTHONPATH": str(Path(folder).resolve())},
        )  # fmt: skip

    def __call__(self):
        """CPU seconds of its call."""
        self._process.stdin.write("\n")
        self._process.stdin.flush()
        return float(self._process.stdout.readline())

    def close(self):
        self._process.stdin.close()
        self._process.wait()


def _cpu(call):
    """CPU seconds of a call, or what it says itself."""
    began = time.process_time()
    said = call()
    return said if isinstance(said, float) else time.process_time() - began


def least(calls, rounds=ROUNDS):
    """Least CPU seconds of each call, all in turn."""
    for call in calls.values():
        call()
    found = dict.fromkeys(calls, float("inf"))
    for _ in range(rounds):
        for name, call in calls.items():
            found[name] = min(found[name], _cpu(call))
    return found


def contestants(size, module):
    """Calls of all contestants for a pack, steps and contacts of a call."""
    network = pack(*size)
    velocity = SPEED * np.random.default_rng(0).standard_normal(network.shape)
    contacts = len(network.springs)
    steps = max(FEWEST, WORK // contacts)
    loop, _, _ = bound(network, State(np.zeros(network.shape), velocity), DT)
    calls = {"here": lambda: loop.advance(steps)}
    try:
        calls["numba"] = in_numba(network, velocity, steps)
    except ImportError:
        warnings.warn("numba is not installed: pip install '.[bench]'", stacklevel=2)
    if module is not None:
        peer = lammps.Peer(module, network.positions, in_box(network), velocities=velocity)
        peer.core.command(f"timestep {DT}")
        calls["LAMMPS"] = lambda: peer.run(steps)
    if os.environ.get(BEFORE):
        calls["earlier"] = _Earlier(os.environ[BEFORE], size, steps)
    return calls, steps * contacts


def in_box(network):
    """The walls of a pack as LAMMPS takes them."""
    site, wall = network.wall_contacts.T
    return [
        (site[wall == k].tolist(), one.point, one.normal) for k, one in enumerate(network.walls)
    ]


def packs(module):
    """{pack: {contestant: ns per contact-step}}."""
    found = {}
    for name, size in PACKS.items():
        calls, work = contestants(size, module)
        found[name] = {n: t / work * 1e9 for n, t in least(calls).items()}
        if "earlier" in calls:
            calls["earlier"].close()
    return found


def streamed(name):
    """Rows: bytes that pass in a step of a pack, and what moving as many takes here at least."""
    network = pack(*PACKS[name])
    _, u, v = bound(network, State(*np.zeros((2, *network.shape))), DT)
    (laid,) = dynamics(network).loop_bonds.laid.values()
    size = 2 * (u.nbytes + v.nbytes) + network.positions.nbytes
    arrays = [x for x in laid.fields.values() if hasattr(x, "nbytes")]  # of sites and contacts
    size += sum(x.nbytes for x in arrays)
    one, other = np.ones((2, size // 16))
    copied = least({"copy": lambda: np.copyto(one, other)})["copy"]
    contacts = len(network.springs)
    return [
        ("bytes a contact-step", size / contacts), ("copied here [GB/s]", size / copied / 1e9),
        ("ns, if that were all", copied / contacts * 1e9),
    ]  # fmt: skip


def rows():
    """CPU milliseconds of a call of 2,000 steps with one row, with many, and of their energies."""
    network = pack(*PACKS["833 beads"])
    state = State(
        np.zeros(network.shape), SPEED * np.random.default_rng(0).standard_normal(network.shape)
    )
    steps = 4 * ROWS

    def run(every):
        given = {"dt": DT, "method": "verlet", "record": Record(every=every)}
        return simulate(network, state, steps * DT, **given)

    kept = run(4)
    calls = {
        "1 row": lambda: run(steps), f"{ROWS} rows": lambda: run(4),
        "their energies": lambda: dynamics(network).energies(kept.u, kept.v),
    }  # fmt: skip
    return [(name, 1e3 * seconds) for name, seconds in least(calls, 7).items()]


def half_guide(module):
    """ns per contact-step of the half guide in the plane, here and in LAMMPS."""
    steel, dt, steps = lammps.STEEL, lammps.DT, 2_000
    guide = y_guide(bead=steel, striker=Striker(steel, lammps.SPEED))
    loop, u, v = bound(guide, guide.start(), dt)
    start = u.copy(), v.copy()

    def here():
        u[:], v[:] = start
        loop.advance(steps)

    calls = {"here": here}
    if module is not None:
        walls = lammps.guide_walls(guide)
        for style in ("granular", "history"):
            peer = lammps.Peer(module, guide.positions, walls, style)
            calls[f"LAMMPS {style}"] = lambda peer=peer: peer.run(steps)
    return {n: t / steps / len(guide.springs) * 1e9 for n, t in least(calls).items()}


def threads():
    """Wall seconds of one thread over those of several on the large pack; whether bits agree."""
    network = pack(*PACKS["50,653 beads"])
    velocity = SPEED * np.random.default_rng(0).standard_normal(network.shape)
    runs = [bound(network, State(np.zeros(network.shape), velocity), DT, n) for n in (1, THREADS)]
    seconds = [float("inf")] * 2
    for _ in range(ROUNDS // 2):
        for k, (loop, _, _) in enumerate(runs):
            began = time.perf_counter()
            loop.advance(10)
            seconds[k] = min(seconds[k], time.perf_counter() - began)
    same = all(np.array_equal(a, b) for a, b in zip(runs[0][1:], runs[1][1:], strict=True))
    return seconds[0] / seconds[1], same


def main():
    """Print nanoseconds per contact-step, and the ratios with their targets."""
    module = lammps.library()
    if not os.environ.get(BEFORE):
        print(f"no earlier revision to compare with: set {BEFORE}")
    cost = packs(module)
    names = list(next(iter(cost.values())))
    found = [(n, *(cost[s][n] for s in cost)) for n in names]
    table("ns per contact-step, velocity Verlet, packs in space", ["", *cost], found)
    wide = "avx512f" in _features()
    aims = {
        "earlier": ">= 3", "numba": ">= 2.4" if wide else ">= 0.87",
        "LAMMPS": ">= 12" if wide else ">= 6",
    }  # fmt: skip
    found = [
        (n, *(cost[s][n] / cost[s]["here"] for s in cost), aims[n]) for n in names if n in aims
    ]
    table("times the loop here", ["", *cost, "target"], found, theirs=list(cost))
    memory = zip(*(streamed(name) for name in PACKS), strict=True)
    found = [(one[0], one[1], other[1]) for one, other in memory]
    table("what passes through memory", ["", *PACKS], found)
    table("833 beads, a call of 2,000 steps", ["", "CPU ms"], rows())
    guide = half_guide(module)
    found = [(n, t, t / guide["here"]) for n, t in guide.items()]
    table("half guide, LAMMPS >= 8 times", ["", "ns", "times"], found, theirs=["times"])
    ratio, same = threads()
    found = [(f"{THREADS} threads, 50,653 beads", ratio, ">= 1.7", "same" if same else "NO")]
    heads = ["", "ratio", "target", "bits"]
    table("one thread over several, wall clock", heads, found, theirs=["ratio"])


def _features():
    """Features of the processor that the compiler uses."""
    if "-mno-avx512f" in os.environ.get("CC", ""):
        return ""
    try:
        return Path("/proc/cpuinfo").read_text()
    except OSError:
        return ""
