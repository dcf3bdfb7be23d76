"""Error against processor time: every method, and other programs, on six scenes.

Solitary wave, wave near locking and softening chain (smooth); struck beads and a Y-guide (contacts
that open, steel); eight chains at once.  Each is a call of `tensegrity.work_precision`: times are
CPU times, the least of several rounds.  "simulate(tol=)" is the whole call with a tolerance, its
rows and energies; our other runs are those of the march alone with a given step, and a peer's run
is its own call.  Peers are given the force in the form in which our loop has it.
"polynomials" is rkn6 with polynomials of the force whose error is a small part of the run's.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from benchmarks import _peers
from benchmarks._charts import FOLDER, charted
from benchmarks._timing import table
from benchmarks.methods import EXTENDED, LEVELS, scenes
from tensegrity import (
    METHODS,
    Chain,
    Ensemble,
    Polynomial,
    Prism,
    ResolutionError,
    solitary_wave,
    work_precision,
)
from tensegrity.precision.peers import Peer
from tensegrity.scenes.dynamics import dynamics

FITS = 1e-4, 1e-7, 1e-10, 1e-13  # errors of polynomials
POLYNOMIALS = "polynomials"
LANES, ENSEMBLE_SITES, ENSEMBLE_END = 8, 40, 60.0
SECONDS = 120.0  # of one scene
PROGRAMS = "dop853", "dop853, compiled", "heyoka", "numba"
TARGETS = (  # scene, contestant, wanted ratio
    ("wave", "heyoka", 8.0),
    ("ensemble", "heyoka batch 8", 2.4),
    ("wave", "dop853, compiled", 25.0),
    ("wave", "dop853", 60.0),
)


def all_scenes():
    """{name: (scene, state, duration)}, and {name: peers}."""
    from benchmarks.lammps import SPEED, STEEL, guide_walls
    from granular import Striker, chain, y_guide

    prism = Prism(1.0, 0.7, 0.01, 1.0)
    line = Chain(prism.potential(), 128)
    fast = solitary_wave(line.springs[0], speed_ratio=3.0)
    soft = Prism(1.0, 0.5, 0.4, 1.0, 2.0, 20.0).potential(preload=0.05)
    held = Chain(soft, 128, ends=("fixed", "free"))
    beads = chain([STEEL] * 60, striker=Striker(STEEL, SPEED))
    guide = y_guide(bead=STEEL, striker=Striker(STEEL, SPEED))
    few = Chain(line.springs[0], ENSEMBLE_SITES)
    batch = Ensemble(few, LANES)
    states = batch.at_rest({0: np.linspace(0.02, 0.04, LANES)})

    def lammps(steps, walls=()):
        return Peer("LAMMPS", partial(_peers.lammps, steps=steps, walls=walls))

    def eight(*run):
        return _peers.heyoka_batch(few, *run[1:], _peers.prism_tension(prism))

    runs = {
        "wave": scenes()["wave"],
        "locking": (line, fast.launch(line, at=40), 60 / fast.speed),
        "softening": (held, held.at_rest({1: 0.15}), 60.0),
        "contacts": (beads, beads.start(), 400e-6),
        "Y-guide": (guide, guide.start(), 300e-6),
        "ensemble": (batch, states, ENSEMBLE_END),
    }
    others = {
        "contacts": ("dop853", lammps((400, 1600, 6400, 25600))),
        "Y-guide": ("dop853", lammps((300, 1200, 4800), guide_walls(guide))),
        "ensemble": (Peer("heyoka batch 8", eight),),
    }
    return runs, {name: others.get(name, PROGRAMS) for name in runs}


def measured(run, peers):
    """Error against cost of a scene; of smooth chains also with polynomials for their force."""
    scene, state, t_end = run
    smooth = isinstance(scene, Chain) and scene.springs[0].smooth
    given = "long double" if smooth and EXTENDED else None
    found = work_precision(*run, peers=peers, reference=given, seconds=SECONDS)
    if not smooth:
        return found
    met = dynamics(scene).bind(*dynamics(scene).arrays(state), METHODS["rkn6"], t_end / 1000)
    met.advance(1000)
    low, high = met.range[0]
    room, rows = 0.05 * (high - low), []
    for error in FITS:
        try:
            fit = Polynomial(scene.springs[0], low - room, high + room, error)
        except ResolutionError:  # as good as there is
            break
        moved = dynamics(scene).with_springs([fit])
        ours = work_precision(moved, state, t_end, ["rkn6"], reference=found.final,
                              seconds=SECONDS / 10)  # fmt: skip
        rows += [replace(row, method=POLYNOMIALS, dt=np.nan) for row in ours.ladder("rkn6")]
    return replace(found, rows=(*found.rows, *front(rows)))


def front(rows):
    """The rows that none is both cheaper and better than."""
    found = []
    for row in sorted(rows, key=lambda row: (row.seconds, row.error)):
        if not found or row.error < found[-1].error:
            found.append(row)
    return found


def seconds(found):
    """{program: CPU seconds at each error}, and the least of our loops under ""."""
    names = dict.fromkeys(row.method for row in found.rows)
    times = {name: np.array([found.cost(name, x) for x in LEVELS]) for name in names}
    return times | {"": np.min([times[name] for name in found.methods], axis=0)}


def dashed(times, scale=1.0):
    """Rows of a table, with a dash where an error was not reached."""
    return [(who, *(x if np.isfinite(x) else "-" for x in scale * t)) for who, t in times.items()]


def chart(found, folder=FOLDER):
    """Time against error, a panel for each scene, as PNG and CSV; the files written."""
    rows = [(name, *vars(row).values()) for name, one in found.items() for row in one.rows]
    names = ("scene", "method", "setting", "dt", "evaluations", "error", "seconds", "compiled")
    with charted("work_precision", folder, names, rows, figsize=(11, 7)) as (figure, written):
        panels = figure.subplots(2, -(-len(found) // 2), sharex=True, squeeze=False).ravel()
        handles = {}
        for letter, axes, (scene, one) in zip("abcdef", panels, found.items(), strict=False):
            one.plot(axes, "seconds")
            axes.get_legend().remove()
            axes.set(title=f"({letter}) {scene}", xlabel="", ylabel="", xlim=(1, 1e-15))
            for line in axes.lines:
                handles.setdefault(line.get_label(), line)
        figure.supxlabel("error of the last state, relative: smaller to the right", fontsize=10)
        figure.supylabel("processor time of a run [s]", fontsize=10)
        figure.legend(handles=handles.values(), loc="outside lower center", ncols=5, fontsize=9)
    return written


def main():
    """Print times at equal error, ratios and targets; chart them all."""
    runs, peers = all_scenes()
    found = {name: measured(run, peers[name]) for name, run in runs.items()}
    heads, times = ["", *(f"{level:.0e}" for level in LEVELS)], {}
    for name, one in found.items():
        print(f"\n{name}: {one}")
        times[name] = seconds(one)
        least = times[name].pop("")
        others = {who: t / least for who, t in times[name].items() if who not in one.methods}
        table(f"{name}: milliseconds at equal error", heads, dashed(times[name], 1e3))
        table(f"{name}: times ours", heads, dashed(others))
        times[name] = others
    goals = []
    for name, who, wanted in TARGETS:
        ratio = times[name].get(who, np.full(len(LEVELS), np.inf))[1:-1]
        ratio = ratio[np.isfinite(ratio)]
        if len(ratio):
            goals.append((f"{name}: {who}", f">= {wanted:g}", ratio.min(), ratio.max()))
    table("1e-3 ... 1e-11", ["times ours", "target", "measured", "at most"], goals)
    print(*chart(found), sep="\n")
