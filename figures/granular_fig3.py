"""A train splits into two equal ones, and these recombine behind the diamond.

Fig. 3 of the paper: trains of waves in the full guide, all PTFE and all steel.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from figures import _guide
from figures._guide import PTFE, STEEL, row
from granular import diamond_guide
from tensegrity import largest_peak, peaks

NAME = "granular_fig3"
GROUP = "granular"

SENSORS = (("stem 1", 16), ("branch 1", 7), ("branch 1", 27), ("branch 1", 43), ("stem 2", 5))
SCENES = {  # bead, striker, duration [s], step [s], newtons per division of the paper's runs
    "PTFE": (PTFE, _guide.light(0.25), 4.2e-3, 0.4e-6, 0.5),
    "steel": (STEEL, _guide.heavy(0.18), 2.0e-3, 0.1e-6, 5.0),
}
LEVEL = 0.1  # of the largest peak: threshold of a counted pulse
ENTERED = {"PTFE": 1.9e-3, "steel": 0.55e-3}  # s: before anything returns to the sensors


def data(by=1.0):
    """Curves, densities and energies of both scenes.

    The steps differ: rows of curves are spaced by 4 us in PTFE and 1 us in steel, those of the
    densities by 4 us and 3 us.

    Parameters
    ----------
    by : float, optional
        Factor of the speed of the blow.
    """
    tables = {}
    for name, (bead, striker, t_end, dt, _) in SCENES.items():
        guide = diamond_guide(bead=bead, striker=replace(striker, speed=by * striker.speed))
        run = _guide.followed(guide, t_end, dt)
        found = _guide.scene_tables(run, SENSORS, 1)
        found["numbers"]["difference of the branches"] = np.array([_guide.skew(run)])
        tables |= {f"{name}_{key}": one for key, one in found.items()}
    return tables


def scene(tables, name):
    """The tables of one scene."""
    start = f"{name}_"
    return {k.removeprefix(start): t for k, t in tables.items() if k.startswith(start)}


def table(tables):
    """The statements of the paper on both trains, and the numbers of the runs."""
    lines = []
    for name in SCENES:
        one = scene(tables, name)
        counts, heights = [], []
        for sensor in SENSORS[:2]:
            t, force = _guide.curve(one, *sensor)
            inside = t < ENTERED[name]
            found = peaks(t[inside], force[inside], LEVEL)[1]
            counts.append(len(found))
            heights.append(found.max())
        leading = [peaks(*_guide.curve(one, *s), LEVEL)[1][0] for s in SENSORS[1:]]
        last = largest_peak(*_guide.curve(one, *SENSORS[-1]))[1]
        lines += [
            row("3", f"{name}: largest in a branch over largest in stem 1",
                float(heights[1] / heights[0]), "about half"),
            row("3", f"{name}: pulses above 10 %, stem 1 and branch, until returns",
                f"{counts[0]}, {counts[1]}", "a train, two trains"),
            row("3", f"{name}: difference of both branches",
                _guide.number(one, "difference of the branches"), "identical"),
            row("3", f"{name}: leading pulse at bead 43 over bead 7 (120 deg bend between)",
                float(leading[2] / leading[0]), "passes"),
            row("3", f"{name}: largest in stem 2 over largest in stem 1 (150 deg bends)",
                float(last / heights[0]), "recombine"),
            *_guide.balances("3", one, f"{name}: "),
        ]  # fmt: skip
    return lines


def draw(figure, tables):
    """Both scenes, one row per scene."""
    figure.set_size_inches(9, 10)
    axes = figure.subplots(2, 2)
    titles = {"PTFE": "PTFE, 0.45 g at 0.25 m/s", "steel": "steel, 5.33 g at 0.18 m/s"}
    for name, both in zip(SCENES, axes, strict=True):
        divisions = [SCENES[name][-1]] * len(SENSORS)
        names = (titles[name], "stem 1, branch 1, stem 2")
        _guide.draw_scene(figure, both, scene(tables, name), divisions, names)
