"""Evolution finds packs that pass on a third of the force of random orders.

246 beads of 9.53 mm in 12 rows between PTFE walls on a steel floor, struck from above by a steel
bead at 1 m/s.  Orders of half steel and half PTFE, and beads of any of six materials, are searched
for the least force on the floor.
"""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor

import numpy as np

from figures import _searches
from figures._disks import disks
from figures._stored import stored
from granular import Bead, Striker, hexagonal_pack, materials, sensor_force, simulate, wall_force
from granular.contact_network import wall_sites
from granular.design import Choice, Order, search
from tensegrity import Record, largest_peak, plotting, sweep

NAME = "protectors_pack"
GROUP = "protectors"

STEEL, PTFE = materials["steel"], materials["ptfe"]
DIAMETER = 9.53e-3  # m
HARD, SOFT = Bead(DIAMETER, STEEL), Bead(DIAMETER, PTFE)
STRIKER = Striker(HARD, speed=1.0)
ROWS, COLUMNS = 12, 21
LENGTHS = [COLUMNS - k % 2 for k in range(ROWS)]  # beads of each row, from the top
COUNT = sum(LENGTHS)
T_END, FINE = 2e-3, 1.16e-6  # s, window, and half a step of the search
DRAWN, BUDGET = 100, 1280  # random orders, designs of a search
NAMES = ("steel", "ptfe", "rubber", "bronze", "glass", "nylon")
SPACES = {
    "order of half steel, half PTFE": Order([HARD, SOFT] * (COUNT // 2)),
    "any of six materials": Choice(COUNT, DIAMETER, [materials[name] for name in NAMES]),
}
COLOURS = {"steel": "0.45", "ptfe": "#f4f1e6", "rubber": "#303030", "bronze": "#b9772f",
           "glass": "#9fd3dd", "nylon": "#e9c6d8"}  # fmt: skip
FRAMES, RATE, END = 90, 12, 1.2e-3  # of the moving picture; s
HELD = 8.0  # N: upper end of the colour scale


def by_row(kinds):
    """Beads of which each row is of one kind."""
    return [kind for kind, length in zip(kinds, LENGTHS, strict=True) for _ in range(length)]


COMPARED = {
    "uniform steel": [HARD] * COUNT,
    "uniform PTFE": [SOFT] * COUNT,
    "alternating rows": by_row([HARD, SOFT] * (ROWS // 2)),
    "steel over PTFE": by_row([HARD] * (ROWS // 2) + [SOFT] * (ROWS // 2)),
    "PTFE over steel": by_row([SOFT] * (ROWS // 2) + [HARD] * (ROWS // 2)),
}


def build(beads):
    """The pack on its steel floor between PTFE walls, struck in the middle of the top row."""
    pack = hexagonal_pack(ROWS, COLUMNS, bead=list(beads), floor=STEEL, sides=PTFE, striker=STRIKER)
    return pack, "floor"


def peak(beads):
    """Largest force on the floor [N]."""
    scene, name = build(beads)
    record = Record(every=2, sites=wall_sites(scene, name))
    run = simulate(scene, scene.start(), T_END, method="rkn6", dt=FINE, record=record)
    return largest_peak(run.t, wall_force(run, name))[1]


@stored(GROUP)
def searches():
    """The search of each of the spaces, as columns."""
    with ProcessPoolExecutor() as pool:
        return {
            name: _searches.columns(search(
                space, striker=STRIKER, wall=STEEL, t_end=T_END, build=build, budget=BUDGET,
                executor=pool,
            )) for name, space in SPACES.items()
        }  # fmt: skip


@stored(GROUP)
def peaks():
    """Force on the floor [N] of what is compared, and of all random orders."""
    space = SPACES["order of half steel, half PTFE"]
    drawn = [space.beads(row) for row in space.random(np.random.default_rng(0), DRAWN)]
    with ProcessPoolExecutor() as pool:
        found = np.array(sweep(peak, [*COMPARED.values(), *drawn], pool))
    return {
        "compared": {"design": list(COMPARED), "force [N]": found[: len(COMPARED)]},
        "drawn": {"force [N]": found[len(COMPARED) :]},
    }


def data():
    """Floor peaks of all designs, the searches, the best pack in motion."""
    drawn = peaks()["drawn"]["force [N]"]
    found = {name: _searches.found(columns) for name, columns in searches().items()}
    rows = [(*pair, 1) for pair in zip(*peaks()["compared"].values(), strict=True)]
    rows += [("random orders, median", float(np.median(drawn)), len(drawn)),
             ("random orders, best", float(drawn.min()), len(drawn))]  # fmt: skip
    rows += [(f"{name}, evolution", x.peak_force, len(x.least)) for name, x in found.items()]
    names = ("design", "floor peak [N]", "designs")
    tables = {"peaks": dict(zip(names, map(list, zip(*rows, strict=True)), strict=True))}
    for name, one in found.items():
        tables[f"history {name}"] = {"designs": np.arange(1, len(one.least) + 1),
                                     "least [N]": one.least}  # fmt: skip
    best = min(found.values(), key=lambda one: one.peak_force)
    scene, _ = build(best.beads)
    steps = 4 * round(END / (4 * FINE))
    run = simulate(scene, scene.start(), END, method="rkn6", dt=END / steps, record=Record(every=4))
    some = np.linspace(0, len(run.t) - 1, FRAMES + 1).astype(int)
    forces = sensor_force(run, range(COUNT))[some]
    return tables | {
        "beads": {"x [m]": scene.positions[:COUNT, 0], "z [m]": scene.positions[:COUNT, 1],
                  "material": [bead.material.name for bead in best.beads]},
        "forces": {"t [s]": run.t[some], **{f"bead {k} [N]": f for k, f in enumerate(forces.T)}},
    }  # fmt: skip


def table(tables):
    """Floor peaks."""
    rows = zip(*tables["peaks"].values(), strict=True)
    return [
        {"scene": "pack", "what": a, "value": float(b), "designs": c, "seeds": "0"}
        for a, b, c in rows
    ]


def stage(axes, tables, colours=None):
    """Draw the beads as disks; returns the collection that takes the colours."""
    places = np.stack([tables["beads"]["x [m]"], tables["beads"]["z [m]"]], axis=1)
    style = {"cmap": "inferno_r"} if colours is None else {"facecolors": colours}
    found = disks(axes, places, DIAMETER, lw=0.6, edgecolors="0.3", **style)
    if colours is None:
        found.set_clim(0, HELD)
    axes.set(xlabel="x [mm]", ylabel="z [mm]", xlim=(-2, 202), ylim=(-2, 112))
    return found


def draw(figure, tables):
    """The searches and the best pack."""
    from matplotlib.patches import Patch

    from figures._draw import name_curves

    figure.set_size_inches(9, 4.8)
    left, right = figure.subplots(1, 2, width_ratios=(1, 1.3))
    for name, words in zip(SPACES, ("order of two", "choice of six"), strict=True):
        one = tables[f"history {name}"]
        left.plot(one["designs"], one["least [N]"], label=words)
    known = dict(zip(*list(tables["peaks"].values())[:2], strict=True))
    for name in ("alternating rows", "random orders, median", "random orders, best"):
        left.axhline(known[name], color="0.3", ls=":", lw=1)
        left.text(BUDGET / 2, known[name], name, va="bottom")
    left.set(xlabel="designs computed", ylabel="largest force on the floor [N]", ylim=0)
    name_curves(left)
    materials = tables["beads"]["material"]
    stage(right, tables, [COLOURS[name] for name in materials])
    used = [name for name in COLOURS if name in materials]
    handles = [Patch(facecolor=COLOURS[n], edgecolor="0.3", label=n) for n in used]
    right.legend(
        handles=handles, ncols=3, fontsize=9, loc="upper center", bbox_to_anchor=(0.5, -0.2)
    )


def animate(tables, path):
    """Forces on the beads of the best pack, as a GIF."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(9, 5.2), dpi=80, layout="constrained")
    t, *forces = tables["forces"].values()
    found = stage(axes, tables)
    figure.colorbar(found, ax=axes, label="force on a bead [N]", shrink=0.8, extend="max")

    def show(row):
        found.set_array(np.array([force[row] for force in forces]))
        axes.set_title(f"{1e3 * t[row]:.2f} ms after the blow, the best pack")

    plotting.film(path, figure, range(len(t)), show, RATE)
