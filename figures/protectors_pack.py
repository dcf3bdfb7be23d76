"""Evolution finds packs that pass on a third of the force of random orders.

246 beads of 9.53 mm in 12 rows between PTFE walls on a steel floor, struck from above by a steel
bead at 1 m/s.  Orders of half steel and half PTFE, and beads of any of six materials, are searched
for the least force on the floor.
"""

from concurrent.futures import ProcessPoolExecutor

import numpy as np

from figures import _searches
from figures._disks import disks
from figures._stored import stored
from granular import Bead, Striker, hexagonal_pack, materials
from granular.design import Choice, Order, search
from granular.design.objective import wall_peak
from tensegrity import sweep

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
    return wall_peak(build, beads, T_END, FINE)[0]


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
    """Floor peaks of all designs, the searches, the best pack."""
    drawn = peaks()["drawn"]["force [N]"]
    found = {name: _searches.found(columns) for name, columns in searches().items()}
    names, forces = peaks()["compared"].values()
    counts = [1] * len(names) + [len(drawn)] * 2 + [len(one.least) for one in found.values()]
    tables = {"peaks": {
        "design": [*names, "random orders, median", "random orders, best",
                   *(f"{name}, evolution" for name in found)],
        "floor peak [N]": [*forces, np.median(drawn), drawn.min(),
                           *(one.peak_force for one in found.values())],
        "designs": counts,
    }}  # fmt: skip
    for name, one in found.items():
        tables[f"history {name}"] = {"designs": np.arange(1, len(one.least) + 1),
                                     "least [N]": one.least}  # fmt: skip
    beads = min(found.values(), key=lambda one: one.peak_force).beads
    x, z = build(beads)[0].positions[:COUNT].T
    materials = [bead.material.name for bead in beads]
    return tables | {"beads": {"x [m]": x, "z [m]": z, "material": materials}}


def table(tables):
    """Floor peaks."""
    names = ("what", "value", "designs")
    rows = zip(*tables["peaks"].values(), strict=True)
    return [{"scene": "pack", **dict(zip(names, row, strict=True)), "seeds": "0"} for row in rows]


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
    x, z, materials = tables["beads"].values()
    disks(right, np.stack([x, z], axis=1), DIAMETER, lw=0.6, edgecolors="0.3",
          facecolors=[COLOURS[name] for name in materials])  # fmt: skip
    right.set(ylabel="z [mm]", xlim=(-2, 202), ylim=(-2, 112))
    handles = [
        Patch(facecolor=COLOURS[n], edgecolor="0.3", label=n) for n in COLOURS if n in materials
    ]
    right.legend(handles=handles, ncols=3, loc="upper center", bbox_to_anchor=(0.5, -0.2))
