"""Gradients lead in the first second; after ten, both find twenty diameters of 26 to 27 N."""

from __future__ import annotations

import time

import numpy as np

from figures import _protectors as common
from figures._stored import stored
from granular.design import search

NAME = "protectors_time"
GROUP = "protectors"

T_END = 6e-4  # s: the largest force of good designs comes by 0.45 ms
SEEDS = (0, 1, 2)
BUDGETS = {"cma": 100_000, "gradient": 10_000}
COLOURS = {"cma": "C1", "gradient": "C3"}
LABELS = {"cma": "evolution (cma)", "gradient": "gradients"}
POINTS = 200


def timed(method, seed, budget):
    """Result of one search on one core, and its processor time [s]."""
    began = time.process_time()
    found = search(
        common.SCENES["S"].space, striker=common.STRIKER, wall=common.STEEL, t_end=T_END,
        method=method, budget=budget, seed=seed,
    )  # fmt: skip
    return found, time.process_time() - began


@stored("protectors_time")
def data():
    """Least force against processor time, of each method and seed; the results."""
    tables, reached = {}, {}
    for method, budget in BUDGETS.items():
        timed(method, SEEDS[0], 64)  # compiles
        columns = {}
        for seed in SEEDS:
            found, seconds = timed(method, seed, budget)
            count = found.evaluations
            marks = np.unique(np.geomspace(1, count, POINTS).astype(int))
            columns[f"time, seed {seed} [s]"] = marks * seconds / count
            columns[f"seed {seed} [N]"] = np.minimum.accumulate(found.history)[marks - 1]
            for key, value in {
                "method": method, "seed": seed, "designs": count, "time [s]": seconds,
                "force [N]": found.peak_force, "converged in time": found.converged_in_time,
                "diameters [mm]": " ".join(f"{1e3 * bead.diameter:.5f}" for bead in found.beads),
            }.items():  # fmt: skip
                reached.setdefault(key, []).append(value)
        tables[method] = columns
    tables["reached"] = reached
    return tables


def table(tables):
    """The result of each search, and its time."""
    one = tables["reached"]
    return [
        {"scene": "S", "what": f"{LABELS[method]}, {seconds:.0f} s of one core",
         "value": float(force), "designs": designs, "seeds": str(seed)}
        for method, seed, designs, seconds, force in zip(
            *(one[k] for k in ("method", "seed", "designs", "time [s]", "force [N]")), strict=True
        )
    ]  # fmt: skip


def draw(figure, tables):
    """One line per search."""
    figure.set_size_inches(8, 4.2)
    figure.suptitle(__doc__.splitlines()[0].rstrip("."), fontsize=11)
    axes = figure.subplots()
    for method, colour in COLOURS.items():
        columns = tables[method]
        for seed in SEEDS:
            times, forces = columns[f"time, seed {seed} [s]"], columns[f"seed {seed} [N]"]
            axes.step(times, forces, where="post", color=colour, lw=1.2)
            axes.plot(times[-1], forces[-1], "o", color=colour, ms=4)
        axes.text(0.011, 54 if method == "cma" else 31, f"{LABELS[method]}, {len(SEEDS)} seeds",
                  color=colour)  # fmt: skip
    axes.set(
        xscale="log", yscale="log", ylim=(25, 80), xlim=(0.01, None),
        xlabel="processor time of one core [s]", ylabel="least wall force so far [N]",
    )  # fmt: skip
    axes.set_yticks([25, 30, 40, 50, 60, 80], [25, 30, 40, 50, 60, 80])
    axes.yaxis.set_minor_formatter("")
