"""Calls of a warm process over those of an earlier commit, measured alternately.

Run as a program, with the package of some commit on the path, it prints the least microseconds of
each case that its input names: CPU time of its thread.
"""

from __future__ import annotations

import math
import os
import subprocess
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

CHOICES = {"dt": {"dt": 0.01}, "default": {}, "tol 1e-3": {"tol": 1e-3}, "tol 1e-7": {"tol": 1e-7}}
PRISMS = {"2 steps of 10 prisms": (10, 0.02), "20 s of 10": (10, 20.0), "20 s of 128": (128, 20.0)}
BEADS = "60 beads", "pack of 833"
NAMES = [f"{run}, {choice}" for run in PRISMS for choice in CHOICES] + list(BEADS)
CABLES = {f"hanging chain of {n} strings": n for n in (20, 30, 50)}
ROUNDS, CALLS, LONG = 12, 20, 3000.0  # calls that take longer than so many us are timed twice


def call_of(name):
    """A call of `simulate` on the package on the path."""
    from granular import Bead, Striker, chain, fcc_pack, materials
    from tensegrity import Chain, Prism, simulate

    if name in CABLES:
        return hanging(CABLES[name])
    if name in BEADS:
        bead = Bead(9.53e-3, materials["steel"])
        striker = Striker(bead, 1.65)
        if name == BEADS[0]:
            scene = chain([bead] * 60, striker=striker)
            return partial(simulate, scene, scene.start(), t_end=3e-4, tol=1e-6)
        walls = {"floor": materials["steel"], "sides": materials["ptfe"]}
        scene = fcc_pack(17, 7, bead=bead, striker=striker, **walls)
        return partial(simulate, scene, scene.start(), t_end=5e-5, tol=1e-5)
    run, choice = name.split(", ")
    sites, t_end = PRISMS[run]
    scene = Chain(Prism(1.0, 0.7, 0.01, 1.0).potential(), sites)
    return partial(simulate, scene, scene.at_rest({0: 0.09}), t_end, **CHOICES[choice])


def hanging(pieces):
    """Equilibrium of a steel cable of 10 mm and 2 m between ends 1.6 m apart, from straight."""
    from tensegrity import Structure, equilibrium, held

    places = [(1.6 * n / pieces, 0.0) for n in range(pieces + 1)]
    strings, each = [(n, n + 1) for n in range(pieces)], 2 / pieces
    cable = Structure(places, strings=strings, k_string=1.57e7 / each,
                      natural_lengths=[each] * pieces)  # fmt: skip
    loads = {n: (0.0, -12.1 / pieces) for n in range(1, pieces)}
    return lambda: equilibrium(cable.at(places), loads, held([0, pieces]))


def worker():
    """Answer each name in the input by the least time of some calls [us], nan where it cannot."""
    known, best = {}, {}
    for name in map(str.strip, sys.stdin):
        try:
            if name not in known:
                call = call_of(name)
                for _ in range(1 if name in CABLES else 3):
                    call()
                known[name] = call
        except Exception:  # a commit from before what it takes, or its versions of packages
            print(math.nan, flush=True)
            continue
        count, found = CALLS if best.get(name, 0.0) < LONG else 2, []
        for _ in range(count):
            began = time.thread_time_ns()
            known[name]()
            found.append((time.thread_time_ns() - began) / 1e3)
        best[name] = min(found)
        print(best[name], flush=True)


def against(commit, names=NAMES, rounds=ROUNDS):
    """{case: (us here, us at a commit)}."""
    root, found = Path(__file__).parent.parent, {}
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree"
        git = ["git", "-C", str(root), "worktree"]
        subprocess.run([*git, "add", "-q", "--detach", str(tree), commit], check=True)
        here = Path(__file__).resolve()
        try:
            rivals = [
                subprocess.Popen(
                    [sys.executable, str(here)], cwd=path, text=True,
                    stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                    env=os.environ | {"PYTHONPATH": str(path), "OPENBLAS_NUM_THREADS": "1"},
                )
                for path in (root, tree)
            ]  # fmt: skip
            for name in names:
                found[name] = tuple(map(min, zip(*_alternately(rivals, name, rounds), strict=True)))
            for one in rivals:
                one.communicate()
        finally:
            subprocess.run([*git, "remove", "--force", str(tree)], check=True)
    return found


def _alternately(rivals, name, rounds):
    """Times of a case by each, round after round."""
    for _ in range(rounds):
        times = []
        for one in rivals:
            print(name, file=one.stdin, flush=True)
            times.append(float(one.stdout.readline()))
        yield times


if __name__ == "__main__":
    worker()
