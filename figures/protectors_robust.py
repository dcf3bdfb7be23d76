"""With gaps of 1 µm a design retains most of its gain; sizes optimised for gaps retain more.

Designs for touching beads and designs for a quantile. Diameters have a relative standard
deviation of 1 %, and gaps up to 1 um separate the beads; each design is searched with one set of
draws and compared with another. What a design gains is the difference of its force from that of the
best uniform chain, and what it keeps is the gain under deviations, of both, over the gain of
touching beads.
"""

from __future__ import annotations

import numpy as np

from figures import _protectors as common
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
    tables, kept, built = {}, {}, {}
    for name in UNIFORM:
        scatter = Scatter(**DEVIATIONS, draws=TRIED[name], seed=SEARCHED, quantile=QUANTILE)
        designs = {
            "uniform": common.SCENES[name].compared[UNIFORM[name]],
            "for touching beads": found(name, NOMINAL[name]),
            "for deviations": found(name, ROBUST[name], scatter),
        }
        columns = {"largest gap [m]": np.array(GAPS)}
        for kind, beads in designs.items():
            several = [
                robustness(
                    beads, diameters=DEVIATIONS["diameters"], gaps=gap, draws=DRAWS, seed=SEED,
                    **blow(name),
                ) for gap in GAPS
            ]  # fmt: skip
            for q in (0.1, 0.5, 0.9):
                columns[f"{kind}, {q:.0%} [N]"] = np.array([one.quantile(q) for one in several])
            built.setdefault("scene", []).append(name)
            built.setdefault("for", []).append(kind)
            built.setdefault("design", []).append(common.letters(name, beads))
            one = several[GAPS.index(DEVIATIONS["gaps"])]
            for key, value in {
                "scene": name, "design": kind, "touching [N]": peak_force(beads, **blow(name)),
                "median [N]": one.quantile(0.5), "nine tenths below [N]": one.quantile(0.9),
            }.items():  # fmt: skip
                kept.setdefault(key, []).append(value)
        tables[name] = columns
    kept["gain kept"] = gains(kept)
    return tables | {"kept": kept, "designs": built}


def gains(kept):
    """Fraction of the gain of the best touching design over the uniform chain that a design has
    under deviations, by medians; that of the uniform chain is 0."""
    numbers = [kept[k] for k in ("touching [N]", "median [N]")]
    out = []
    for k in range(0, len(kept["scene"]), len(COLOURS)):
        exact, median = (np.array(x[k : k + len(COLOURS)]) for x in numbers)
        out += ((median[0] - median) / (exact[0] - exact[1])).tolist()
    return out


def table(tables):
    """Forces of each design, touching and with deviations, and the fraction of the gain."""
    one, lines = tables["kept"], []
    for k, (name, kind) in enumerate(zip(one["scene"], one["design"], strict=True)):
        for what in ("touching [N]", "median [N]", "nine tenths below [N]", "gain kept"):
            lines.append({
                "scene": name, "what": f"{name}, {kind}: {what.removesuffix(' [N]')}",
                "value": float(one[what][k]), "designs": DRAWS, "seeds": str(SEED),
            })  # fmt: skip
    return lines


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
        axes.set(xlabel="largest gap between beads [µm]", ylabel="force on the wall [N]",
                 ylim=(0, 1.15 * columns["uniform, 90% [N]"].max()))  # fmt: skip
        axes.set_xlim(0, gaps[-1])
        axes.set_xticks(gaps, [f"{gap:g}" for gap in gaps])
        what = "order" if name == "T1" else "sizes"
        axes.set_title(f"({'a' if name == 'T1' else 'b'}) {name}, {what} of 20 steel beads",
                       loc="left")  # fmt: skip


def text(tables):
    """The designs, and what they keep."""
    one = tables["kept"]
    lines = ["Diameters deviate by 1 % (standard deviation); the bands contain eight draws of ten.",
             "", "| " + " | ".join(one) + " |", "|---" * len(one) + "|"]  # fmt: skip
    for values in zip(*one.values(), strict=True):
        cells = (v if isinstance(v, str) else f"{v:.3g}" for v in values)
        lines.append("| " + " | ".join(cells) + " |")
    built = tables["designs"]
    lines += ["", *(f"* {a}, {b}: {c}" for a, b, c in zip(*built.values(), strict=True))]
    return "\n".join(lines)
