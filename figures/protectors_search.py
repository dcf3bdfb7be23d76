"""A few thousand computed designs suffice to surpass random and stepped protectors."""

from __future__ import annotations

import numpy as np

from figures import _protectors as common

NAME = "protectors_search"
GROUP = "protectors"

MARKS = np.unique(np.round(np.logspace(0, np.log10(40000), 200)).astype(int))
BETTER = "random ones better than the stepped one"
COLOURS = {"ga": "C0", "cma": "C1"}


def curve(least):
    """Designs computed, and the least force so far, at some of them."""
    marks = MARKS[len(least) >= MARKS]
    return marks, least[marks - 1]


def data():
    """Least force against designs for every seed; results; reference designs."""
    tables = {}
    for (name, method), results in common.searches().items():
        columns = {}
        for one in results:
            marks, least = curve(one.least)
            columns["designs"] = max(columns.get("designs", marks), marks, key=len)
            columns[f"seed {one.seed} [N]"] = least
        tables[f"{name} {method}"] = columns
    for name, scene in common.SCENES.items():
        drawn = common.drawn(name)
        tables[f"{name} random"] = {"designs": curve(drawn[0])[0]}
        for seed, one in enumerate(np.minimum.accumulate(drawn, axis=1)):
            tables[f"{name} random"][f"seed {seed} [N]"] = curve(one)[1]
        forces = common.forces(list(scene.compared.values()), scene.t_end)
        known = dict(zip(scene.compared, forces, strict=True))
        known["random, median"] = float(np.median(drawn))
        known["random, best of 1,000, median of seeds"] = float(np.median(drawn.min(axis=1)))
        known[BETTER] = float(np.mean(drawn < known["stepped"]))
        tables[f"{name} compared"] = {"design": list(known), "force [N]": list(known.values())}
    columns = {}
    for (name, method), results in common.searches().items():
        for one in results:
            for key, value in {
                "scene": name, "method": method, "seed": one.seed, "designs": len(one.least),
                "force [N]": one.peak_force, "converged in time": one.converged_in_time,
                "rejected": one.rejected, "design": common.letters(name, one.beads),
            }.items():  # fmt: skip
                columns.setdefault(key, []).append(value)
    tables["found"] = columns
    orders = common.every_order()
    tables["T1 all"] = {"rank": np.arange(1, 21)}
    tables["T1 all"] |= {name: values[:20] for name, values in orders["best"].items()}
    tables["T1 quantiles"] = orders["quantiles"]
    return tables


def table(tables):
    """Forces of reference designs and of the best of each method."""
    lines = []
    for name in common.SCENES:
        one = tables[f"{name} compared"]
        known = dict(zip(one["design"], one["force [N]"], strict=True))
        for design, force in known.items():
            drawn = common.RANDOM if design.startswith("random") else 1
            seeds = f"0 to {common.SEEDS - 1}" if design.startswith("random") else ""
            value = f"{force:.1%}" if design == BETTER else force
            lines.append(line(name, design, value, drawn, seeds))
        found = tables["found"]
        for method in COLOURS:
            here = [k for k, pair in enumerate(zip(found["scene"], found["method"], strict=True))
                    if pair == (name, method)]  # fmt: skip
            if not here:
                continue
            reached = np.array([found["force [N]"][k] for k in here])
            least = here[int(np.argmin(reached))]
            designs = max(found["designs"][k] for k in here)
            seeds = f"0 to {len(here) - 1}"
            lines.append(line(name, f"{method}, median of seeds", np.median(reached), designs,
                              seeds))  # fmt: skip
            note = "" if found["converged in time"][least] else " (NOT converged in time)"
            lines.append(line(name, f"{method}, best: {found['design'][least]}{note}",
                              reached.min(), designs, seeds))  # fmt: skip
            hits = int(np.sum(reached <= reached.min() * (1 + 1e-6)))
            lines.append(line(name, f"{method}, seeds that reach it", f"{hits} of {len(here)}",
                              designs, seeds))  # fmt: skip
    best, median = tables["T1 all"]["force [N]"][0], tables["T1 quantiles"]["force [N]"][-1]
    lines.append(line("T1", f"all orders, best: {tables['T1 all']['design'][0]}", best, 184756, ""))
    lines.append(line("T1", "all orders, median", median, 184756, ""))
    return lines


def line(scene, quantity, value, designs, seeds):
    """A row of the group's table."""
    value = float(value) if not isinstance(value, str) else value
    return {"scene": scene, "what": quantity, "value": value, "designs": designs, "seeds": seeds}


def draw(figure, tables):
    """One panel per scene: methods, random designs, and lines for reference designs."""
    figure.set_size_inches(9, 6.6)
    for axes, (name, scene) in zip(
        figure.subplots(2, 2).ravel(), common.SCENES.items(), strict=True
    ):
        one = tables[f"{name} compared"]
        known = dict(zip(one["design"], one["force [N]"], strict=True))
        searched = [
            (m, c, tables[f"{name} {m}"]) for m, c in COLOURS.items() if f"{name} {m}" in tables
        ]
        for method, colour, columns in [*searched, ("random", "0.5", tables[f"{name} random"])]:
            marks = columns["designs"]
            several = [least for key, least in columns.items() if key != "designs"]
            shortest = min(map(len, several))
            several = np.stack([least[:shortest] for least in several])
            axes.fill_between(marks[:shortest], several.min(axis=0), several.max(axis=0),
                              color=colour, alpha=0.3, lw=0)  # fmt: skip
            middle = np.median(several, axis=0)
            axes.plot(marks[:shortest], middle, color=colour)
            words = {"ga": "evolution", "cma": "evolution (cma)"}.get(method, method)
            axes.annotate(words, (marks[shortest - 1], middle[-1]),
                          (0, 10 if method == "random" else -14), ha="right",
                          textcoords="offset points", color=colour)  # fmt: skip
        words = {known[kind]: kind for kind in ("random, median", "stepped")}
        low, high = sorted(words)
        for force, side in ((high, "bottom"), (low, "top")):
            axes.axhline(force, color="0.3", ls=":", lw=1)
            axes.text(0.99, force, words[force], color="0.3", ha="right", va=side,
                      transform=axes.get_yaxis_transform())  # fmt: skip
        axes.set(xscale="log", yscale="log", xlabel="designs computed",
                 ylabel="largest wall force [N]")  # fmt: skip
        axes.set_title(f"{name}: {scene.title}", fontsize=9)
        axes.set_ylim(0.92 * axes.get_ylim()[0])
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_formatter("")
        least, most = axes.get_ylim()
        axes.set_yticks(
            [x for x in (2, 3, 4, 6, 8, 10, 15, 20, 30, 40, 60, 80) if least < x < most]
        )


def text(tables):
    """The scenes of the search, and their results."""
    lines = [
        "20 beads between a free steel striker of 10 mm at 0.44 m/s and a steel wall.  Forces of "
        "searches are those with a quarter of the step; random designs: 1,000 with each seed.",
        "",
        "| scene | what | force [N] | designs | seeds |",
        "|---|---|---|---|---|",
    ]
    for one in table(tables):
        value = one["value"] if isinstance(one["value"], str) else f"{one['value']:.7g}"
        lines.append(
            f"| {one['scene']} | {one['what']} | {value} | {one['designs']} | {one['seeds']} |"
        )
    return "\n".join(lines)
