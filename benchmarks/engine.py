"""The cost of generality in the loop: parameters of each bond or lane, and an older loop.

All ratios are of CPU time in one run.  With $TENSEGRITY_BEFORE naming a checkout of an earlier
revision (`git worktree add ../before 5119a1f`), its loop on a uniform chain of prisms is timed
and ours in alternating processes, and the bits of both are compared.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np

from benchmarks._timing import best, table
from granular import Bead, Striker, chain, materials
from tensegrity import METHODS, Chain, Ensemble, Network, PowerLaw, Prism, State, simulate
from tensegrity.scenes.dynamics import dynamics

SIZES = (100, 1_000, 100_000)
WORK = 2_000_000  # bond-steps per timed call
DT, LANES, LANED = 0.02, 8, 100
PRISM = Prism(1.0, 0.8, 0.02, 1.0).potential()
TAPERED, RUN = 300, 2e-4  # beads, s
BEFORE = "TENSEGRITY_BEFORE"
ROUNDS = 5


def hertz(factor=1.0):
    return PowerLaw(factor, 1.5, preload=0.1)


def scenes(sites):
    """{name: scene} of that many sites."""
    factors = np.linspace(1, 2, sites - 1)
    prestrains = np.linspace(0.02, 0.03, min(sites - 1, 2_000))
    kinds = [Prism(1.0, 0.8, p, 1.0).potential() for p in prestrains]
    places, bonds = np.arange(sites, dtype=float)[:, None], _neighbours(sites)
    return {
        "equal prisms": Chain(PRISM, sites),
        "equal prisms, a network on a line": Network(places, bonds, PRISM),
        "prisms of different prestrain": Chain(
            [kinds[j % len(kinds)] for j in range(sites - 1)], sites
        ),
        "equal Hertz contacts": Chain(hertz(), sites),
        "all different Hertz contacts": Chain([hertz(f) for f in factors], sites),
    }


def _neighbours(sites):
    first = np.arange(sites - 1)
    return np.stack([first, first + 1], axis=1)


def laned():
    """{name: ensemble} of `LANES` chains."""

    def chains(spring):
        masses = 1 + np.arange(LANES) / LANES
        return Ensemble([Chain(spring(k), LANED, mass=masses[k]) for k in range(LANES)])

    return {
        "equal prisms": Ensemble(Chain(PRISM, LANED), LANES),
        "own prisms and masses": chains(
            lambda k: [Prism(1.0, 0.8, 0.02 + k / 800 + j / 1e5, 1.0).potential()
                       for j in range(LANED - 1)]
        ),
        "equal Hertz contacts": Ensemble(Chain(hertz(), LANED), LANES),
        "own Hertz contacts and masses": chains(
            lambda k: [hertz(1 + k / 8 + j / 1e3) for j in range(LANED - 1)]
        ),
    }  # fmt: skip


def loop(scene, steps):
    """A call of that many steps, from a small motion."""
    r = 1e-3 * np.random.default_rng(0).standard_normal(scene.shape)
    u, v = dynamics(scene).arrays(State(r, np.zeros(scene.shape)))
    bound = dynamics(scene).bind(u, v, METHODS["verlet"], DT)
    return lambda: bound.advance(steps)


def times(found, bonds, steps):
    """{name: ns per bond-step}."""
    calls = {name: loop(scene, steps) for name, scene in found.items()}
    return {name: t * 1e9 / (steps * bonds) for name, t in best(calls).items()}


def tapered():
    """CPU seconds per step of a tapered chain of beads by the default call, and a uniform one."""
    steel = materials["steel"]
    beads = [Bead(d, steel) for d in np.linspace(5e-3, 4e-3, TAPERED)]
    found = {}
    for name, given in (("uniform", [beads[0]] * TAPERED), ("tapered", beads)):
        scene = chain(given, striker=Striker(given[0], speed=0.5))
        state, steps = scene.start(), simulate(scene, scene.start(), RUN).steps
        call = {name: lambda scene=scene, state=state: simulate(scene, state, RUN)}
        found[name] = best(call)[name] / steps
    return found


def against(before):
    """{sites: (our time over that of an earlier revision, whether the bits are the same)}."""
    here, found = Path(__file__).parent, {}
    for _ in range(ROUNDS):
        for folder in (here.parent, Path(before).resolve()):
            answer = subprocess.run(
                [sys.executable, str(here / "_stamp.py")], cwd=folder, capture_output=True,
                env=os.environ | {"PYTHONPATH": str(folder)}, text=True, check=True,
            )  # fmt: skip
            for line in answer.stdout.splitlines():
                sites, seconds, digest = line.split()
                mine = found.setdefault(int(sites), {}).setdefault(folder == here.parent, [])
                mine.append((float(seconds), digest))
    return {
        sites: (min(x[True])[0] / min(x[False])[0], x[True][0][1] == x[False][0][1])
        for sites, x in found.items()
    }


def main():
    """Print nanoseconds per bond-step, and the ratios with their targets."""
    cost = {sites: times(scenes(sites), sites - 1, max(WORK // sites, 20)) for sites in SIZES}
    rows = [(name, *(cost[n][name] for n in SIZES)) for name in cost[SIZES[0]]]
    table("ns per bond-step, velocity Verlet", ["", *map(str, SIZES)], rows)
    pairs = [
        ("all different Hertz contacts", "equal Hertz contacts", "<= 1.2"),
        ("prisms of different prestrain", "equal prisms", "<= 3"),
        ("equal prisms, a network on a line", "equal prisms", "<= 1.05"),
    ]
    rows = [(a, *(cost[n][a] / cost[n][b] for n in SIZES), aim) for a, b, aim in pairs]
    sizes = [str(n) for n in SIZES]
    table("over the equal ones", ["", *sizes, "target"], rows, ours=sizes)
    lanes = times(laned(), LANES * (LANED - 1), WORK // (LANES * LANED))
    rows = [
        ("own Hertz contacts and masses", lanes["own Hertz contacts and masses"]
         / lanes["equal Hertz contacts"], "<= 1.25"),
        ("own prisms and masses", lanes["own prisms and masses"] / lanes["equal prisms"], "<= 3"),
    ]  # fmt: skip
    heads = ["", "ratio", "target"]
    table(f"{LANES} lanes of {LANED} sites, over equal ones", heads, rows, ours=["ratio"])
    call = tapered()
    rows = [("tapered over uniform", call["tapered"] / call["uniform"], "<= 1.6")]
    table(f"a step of {TAPERED} beads by the default call", heads, rows, ours=["ratio"])
    before = os.environ.get(BEFORE)
    if not before:
        print(f"no earlier revision to compare with: set {BEFORE}")
        return
    rows = [
        (str(n), ratio, "same" if same else "NO") for n, (ratio, same) in against(before).items()
    ]
    heads = ["sites", "<= 1.03", "bits"]
    table("uniform prisms, time over that of the earlier revision", heads, rows, ours=["<= 1.03"])
