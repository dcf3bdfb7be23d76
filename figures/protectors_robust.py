"""With gaps of 1 µm a design retains most of its gain; sizes optimised for gaps retain more.

Designs for touching beads and designs for a quantile. Diameters have a relative standard
deviation of 1 %, and gaps up to 1 um separate the beads; each design is searched with one set of
draws and compared with another. What a design gains is the difference of its force from that of the
best uniform chain, and what it keeps is the gain under deviations, of both, over the gain of
touching beads.
"""

import numpy as np

from figures import _protectors as common
from figures._files import lines, side_by_side
from figures._stored import stored
from granular.design import Scatter, peak_force, robustness, search

NAME = "protectors_robust"
GROUP = "protectors"

DEVIATIONS = {"diameters": 0.01, "gaps": 1e-6}
QUANTILE = 0.9
GAPS = (0.0, 1e-7, 3e-7, 1e-6, 3e-6, 1e-5)  # m, largest
DRAWS, SEED, SEARCHED = 400, 1, 99  # another seed than that of the search
UNIFORM = {"T1": "uniform 4 mm", "S": "uniform 7 mm"}  # the best of those that the space allows
NOMINAL = {"T1": ("ga", 5000), "S": ("gradient", 4000)}  # method and budget
ROBUST = {"T1": ("ga", 3000), "S": ("cma", 12000)}
TRIED = {"T1": 64, "S": 16}  # draws of each design of a search
COLOURS = {"uniform": "0.5", "for touching beads": "C3", "for deviations": "C0"}


def blow(name):
    """Striker, wall and time of a scene."""
    return {"striker": common.STRIKER, "wall": common.STEEL, "t_end": common.SCENES[name].t_end}


def found(name, how, scatter=None):
    """The best design of a search: (method, budget)."""
    method, budget = how
    space = common.SCENES[name].space
    return search(space, method=method, budget=budget, scatter=scatter, **blow(name)).beads


@stored("protectors_robust")
def data():
    """Quantiles of the force of each design against the largest gap, and at the stated deviations;
    what is kept of a gain; the designs."""
    tables, rows = {}, []
    for name, gapless in UNIFORM.items():
        scatter = Scatter(**DEVIATIONS, draws=TRIED[name], seed=SEARCHED, quantile=QUANTILE)
        designs = {
            "uniform": common.SCENES[name].compared[gapless],
            "for touching beads": found(name, NOMINAL[name]),
            "for deviations": found(name, ROBUST[name], scatter),
        }
        tables[name], touching = {"largest gap [m]": np.array(GAPS)}, {}
        for kind, beads in designs.items():
            several = [
                robustness(
                    beads, diameters=DEVIATIONS["diameters"], gaps=gap, draws=DRAWS, seed=SEED,
                    **blow(name),
                ) for gap in GAPS
            ]  # fmt: skip
            for q in (0.1, 0.5, 0.9):
                forces = np.array([one.quantile(q) for one in several])
                tables[name][f"{kind}, {q:.0%} [N]"] = forces
            one = several[GAPS.index(DEVIATIONS["gaps"])]
            median = one.quantile(0.5)
            touching[kind] = peak_force(beads, **blow(name)), median
            exact, deviating = touching["uniform"]
            gain = exact - touching.get("for touching beads", (0.0,))[0]
            rows.append({
                "scene": name, "design": kind, "touching [N]": touching[kind][0],
                "median [N]": median, "nine tenths below [N]": one.quantile(0.9),
                "gain kept": (deviating - median) / gain,
                "beads": common.letters(name, beads),
            })  # fmt: skip
    return tables | {"kept": side_by_side(rows)}


def table(tables):
    """Forces of each design, touching and with deviations, and the fraction of the gain."""
    quantities = ("touching [N]", "median [N]", "nine tenths below [N]", "gain kept")
    return [
        {"scene": one["scene"], "value": one[key], "designs": DRAWS, "seeds": str(SEED),
         "what": f"{one['scene']}, {one['design']}: {key.removesuffix(' [N]')}"}
        for one in lines(tables["kept"]) for key in quantities
    ]  # fmt: skip


def draw(figure, tables):
    """One panel per scene: median force against the largest gap, with the tenths on both sides."""
    figure.set_size_inches(9, 4.2)
    for axes, name in zip(figure.subplots(1, 2), UNIFORM, strict=True):
        columns = tables[name]
        gaps = 1e6 * columns["largest gap [m]"]
        for kind, colour in COLOURS.items():
            low, middle, high = (columns[f"{kind}, {q:.0%} [N]"] for q in (0.1, 0.5, 0.9))
            axes.fill_between(gaps, low, high, color=colour, alpha=0.2, lw=0)
            axes.plot(gaps, middle, color=colour, marker="o", ms=4)
            axes.annotate(
                UNIFORM[name] if kind == "uniform" else kind, (gaps[1], middle[1]),
                xytext=(0, -14 if kind == "for touching beads" else 8), textcoords="offset points",
                color=colour, fontsize=9,
            )  # fmt: skip
        axes.set_xscale("symlog", linthresh=0.1, linscale=0.5)
        what = "order" if name == "T1" else "sizes"
        axes.set(xlabel="largest gap between beads [µm]", ylabel="force on the wall [N]",
                 ylim=(0, 1.15 * columns["uniform, 90% [N]"].max()), xlim=(0, gaps[-1]),
                 title=f"{name}, {what} of 20 steel beads")  # fmt: skip
        axes.set_xticks(gaps, [f"{gap:g}" for gap in gaps])
