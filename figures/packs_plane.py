"""An oblique impact reaches the floor as early as a normal one, with a sixth less force.

A planar pack struck both ways: the animations of the talk. 12 rows of 21 and 20 steel beads, a
steel striker at 1 m/s on the middle of the top row: straight down, and at 30 degrees along a close-
packed line. The animation magnifies displacements and shows contact forces as lines whose width is
the force.
"""

from __future__ import annotations

import math

import numpy as np

from figures import _packs
from figures._packs import ROW, SLOW, STEEL, D, row
from granular import wall_force
from tensegrity import Record, largest_peak, peaks
from tensegrity.animation import moving
from tensegrity.plotting import film

NAME = "packs_plane"
GROUP = "packs"

TILTED = (-0.5, math.sqrt(0.75)), (0.5, -math.sqrt(0.75))
HITS = {"straight": {}, "oblique": {"offset": TILTED[0], "direction": TILTED[1]}}
END, FRAMES = 6e-4, 60
FACTOR, MOST, FASTEST = 60, 50.0, 0.5  # of the displacements; N of the widest line; m/s
KNOWN = {"straight": (575.759026, 219.97633), "oblique": (482.694720, 224.91311)}
SPEEDS = {"straight": (643.5, 480.9), "oblique": (639.3, 489.5)}  # m/s, of the first and last pair


def down(scene):
    """Contacts of the line of touching beads at 60 degrees, from the struck bead to the right."""
    x, found, site = scene.positions, [], scene.parts["row 1"][10]
    for number in range(2, 13):
        part = np.array(scene.parts[f"row {number}"])
        following = part[np.argmin(np.abs(x[part, 0] - x[site, 0] - D / 2))]
        pair = sorted((site, int(following)))
        found += np.flatnonzero((scene.bonds == pair).all(axis=1)).tolist()
        site = int(following)
    return found


def data():
    """Forces on the floor and fronts of each hit."""
    tables = {}
    for name, how in HITS.items():
        scene = _packs.plane(**how)
        run = _packs.exact(scene, END, Record(interval=ROW))
        struck = [k for k in range(len(scene.bonds)) if scene.sites - 1 in scene.bonds[k]]
        line = [max(struck, key=lambda k: scene.contact_forces(run.u)[:, k].max()), *down(scene)]
        forces = scene.contact_forces(run.u)[:, line]
        firsts = np.array([first(run.t, force) for force in forces.T])
        tables |= {
            f"{name}_floor": {"t [s]": run.t, "floor [N]": wall_force(run, "floor")},
            f"{name}_line": {
                "t [s]": firsts[:, 0],
                "speed [m/s]": np.append(D / np.diff(firsts[:, 0]), np.nan),
            },
        }  # fmt: skip
    return tables


def first(t, force):
    """Instant and height of the first peak above a fifth of the largest force."""
    instants, heights = peaks(t, force, level=0.2)
    return instants[0], heights[0]


def thinned(scene):
    """A run with as many rows as the GIF has frames."""
    return _packs.exact(scene, END, Record(interval=END / FRAMES))


def table(tables):
    """Peaks on the floor, speeds of the front."""
    rows = []
    for name in HITS:
        t = tables[f"{name}_floor"]
        instant, force = largest_peak(t["t [s]"], t["floor [N]"])
        line = tables[f"{name}_line"]
        rows += [
            row(f"plane, {name}", "peak on the floor [N]", force, KNOWN[name][0]),
            row(f"plane, {name}", "at [us]", 1e6 * instant, KNOWN[name][1]),
            row(f"plane, {name}", "over the direct hit", force / _packs.direct(STEEL, SLOW)),
            *(row(f"plane, {name}", f"front along the close-packed line, {where} [m/s]",
                  float(line["speed [m/s]"][k]), SPEEDS[name][n])
              for n, (where, k) in enumerate((("first", 0), ("last", -2)))),
        ]  # fmt: skip
    return rows


def draw(figure, tables):
    """Force on the floor, and speed of the front."""
    from figures._draw import name_curves

    figure.set_size_inches(9, 4.2)
    a, b = figure.subplots(1, 2)
    for name in HITS:
        t = tables[f"{name}_floor"]
        a.plot(1e3 * t["t [s]"], t["floor [N]"], label=name)
        b.plot(np.arange(1, 12), tables[f"{name}_line"]["speed [m/s]"][:-1], "o-", ms=4, label=name)
    name_curves(a, at=np.argmax)
    b.set_xlim(0, 14.5)
    name_curves(b)
    direct = _packs.direct(STEEL, SLOW)
    a.axhline(direct, color="k", lw=0.8, ls=":")
    a.text(0.35, direct + 8, "direct hit on the floor")
    a.set(xlabel="time [ms]", ylabel="force on the floor [N]")
    b.set(xlabel="row", ylabel="speed of the front along the close-packed line [m/s]")


def animate(tables, path):
    """Animate both impacts, with contact forces as lines."""
    import matplotlib.pyplot as plt

    figure, panels = plt.subplots(2, 1, figsize=(7, 8.6), dpi=80, layout="constrained")
    draws = [
        moving(thinned(_packs.plane(**how)), axes, factor=FACTOR, top=FASTEST, widest=MOST)
        for axes, how in zip(panels, HITS.values(), strict=True)
    ]
    film(path, figure, range(FRAMES + 1), lambda row: [draw(row) for draw in draws], rate=10)
