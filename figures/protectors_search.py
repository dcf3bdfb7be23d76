"""A few thousand computed designs suffice to surpass random and stepped protectors.

20 beads between a free steel striker of 10 mm at 0.44 m/s and a steel wall.  Forces of searches are
those with a quarter of the step; random designs: 1,000 with each seed.
"""

from operator import itemgetter

import numpy as np

from figures import _protectors as common
from figures._files import lines, side_by_side

NAME = "protectors_search"
GROUP = "protectors"

MARKS = np.unique(np.round(np.logspace(0, np.log10(40000), 200)).astype(int))
BETTER = "random ones better than the stepped one"


def curves(histories):
    """Designs computed, and the least force so far, at some of them, for every seed."""
    marks = MARKS[max(map(len, histories)) >= MARKS]
    least = {f"seed {k} [N]": x[marks[marks <= len(x)] - 1] for k, x in enumerate(histories)}
    return {"designs": marks, **least}


def data():
    """Least force against designs for every seed; results; reference designs."""
    tables, rows = {}, []
    for name, scene in common.SCENES.items():
        drawn, results = common.drawn(name), common.searches(name)
        tables[f"{name} {scene.method}"] = curves([one.least for one in results])
        tables[f"{name} random"] = curves(np.minimum.accumulate(drawn, axis=1))
        forces = common.forces(list(scene.compared.values()), scene.t_end)
        known = dict(zip(scene.compared, forces, strict=True))
        known["random, median"] = float(np.median(drawn))
        known["random, best of 1,000, median of seeds"] = float(np.median(drawn.min(axis=1)))
        known[BETTER] = float(np.mean(drawn < known["stepped"]))
        tables[f"{name} compared"] = {"design": list(known), "force [N]": list(known.values())}
        rows += [{
            "scene": name, "seed": seed, "designs": len(one.least), "force [N]": one.peak_force,
            "converged in time": one.converged_in_time, "design": common.letters(name, one.beads),
        } for seed, one in enumerate(results)]  # fmt: skip
    orders = common.every_order()
    best = {name: values[:20] for name, values in orders["best"].items()}
    return tables | {"found": side_by_side(rows), "T1 best": best, "T1 all": orders["all"]}


def table(tables):
    """Forces of reference designs and of the best of each search."""
    rows = []
    for name, scene in common.SCENES.items():
        for design, force in zip(*tables[f"{name} compared"].values(), strict=True):
            is_random = design.startswith("random")
            rows.append((name, design, f"{force:.1%}" if design == BETTER else force,
                         common.RANDOM if is_random else 1,
                         f"0 to {common.SEEDS - 1}" if is_random else ""))  # fmt: skip
        found = [one for one in lines(tables["found"]) if one["scene"] == name]
        best, reached = min(found, key=itemgetter("force [N]")), [x["force [N]"] for x in found]
        about = max(one["designs"] for one in found), f"0 to {len(found) - 1}"
        note = "" if best["converged in time"] else " (NOT converged in time)"
        hits = sum(force <= best["force [N]"] * (1 + 1e-6) for force in reached)
        method = scene.method
        rows += [
            (name, f"{method}, median of seeds", float(np.median(reached)), *about),
            (name, f"{method}, best: {best['design']}{note}", best["force [N]"], *about),
            (name, f"{method}, seeds that reach it", f"{hits} of {len(found)}", *about),
        ]
    best, median = lines(tables["T1 best"])[0], tables["T1 all"]["median [N]"][0]
    rows += [
        ("T1", f"all orders, best: {best['design']}", best["force [N]"], 184756, ""),
        ("T1", "all orders, median", median, 184756, ""),
    ]
    names = ("scene", "what", "value", "designs", "seeds")
    return [dict(zip(names, row, strict=True)) for row in rows]


def draw(figure, tables):
    """One panel per scene: searches, random designs, and lines for reference designs."""
    figure.set_size_inches(9, 6.6)
    for axes, (name, scene) in zip(figure.subplots(2, 2).flat, common.SCENES.items(), strict=True):
        known = dict(zip(*tables[f"{name} compared"].values(), strict=True))
        words = {"ga": "evolution", "cma": "evolution (cma)"}[scene.method]
        for kind, colour, said, up, side in (
            (scene.method, "C1" if scene.method == "cma" else "C0", words, -14, "right"),
            ("random", "0.4", "random", 0, "left"),
        ):
            marks, *several = tables[f"{name} {kind}"].values()
            marks = marks[: min(map(len, several))]
            several = np.stack([least[: len(marks)] for least in several])
            middle = np.median(several, axis=0)
            axes.fill_between(
                marks, several.min(axis=0), several.max(axis=0), color=colour, alpha=0.3, lw=0
            )
            axes.plot(marks, middle, color=colour)
            axes.annotate(said, (marks[-1], middle[-1]), (4, up), ha=side, va="center",
                          textcoords="offset points", color=colour)  # fmt: skip
        words = {known[kind]: kind for kind in ("random, median", "stepped")}
        for force, side in zip(sorted(words), ("top", "bottom"), strict=True):
            axes.axhline(force, color="0.3", ls=":", lw=1)
            axes.text(0.99, force, words[force], color="0.3", ha="right", va=side,
                      transform=axes.get_yaxis_transform())  # fmt: skip
        axes.set(
            xscale="log", yscale="log", xlabel="designs computed", ylabel="largest wall force [N]"
        )
        axes.set_title(f"{name}: {scene.title}", fontsize=9)
        axes.set_ylim(0.92 * axes.get_ylim()[0])
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_formatter("")
        low, high = axes.get_ylim()
        axes.set_yticks([x for x in (2, 3, 4, 6, 8, 10, 15, 20, 30, 40, 60, 80) if low < x < high])
