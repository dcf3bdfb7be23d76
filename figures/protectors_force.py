"""Optimised protectors spread the impact: smaller forces, for longer, from more of the beads."""

import numpy as np

from figures import _protectors as common
from figures._files import lines, side_by_side

NAME = "protectors_force"
GROUP = "protectors"

WINDOWS = {"T1": 3.0, "T2": 2.0, "S": 3.0, "M": 1.5}  # times the time of the search
SHOWN = {"T1": 0.8e-3, "T2": 6e-3, "S": 0.8e-3, "M": 8e-3}  # s
PIXELS = 300  # instants of a density


def designs(name):
    """{what: beads} that are followed."""
    known = common.SCENES[name].compared
    some = {kind: beads for kind, beads in known.items() if kind != "alternating"}
    return {**some, "best": common.best(name).beads}


def data():
    """Wall forces and measures of each scene's designs; densities of the stepped and the best."""
    tables = {}
    for name, scene in common.SCENES.items():
        rows, columns = [], {}
        for kind, beads in designs(name).items():
            one = common.trace(beads, scene.t_end, WINDOWS[name])
            rows.append({"design": kind, **common.measures(one)})
            seen = one["t"] <= SHOWN[name]
            columns |= {"t [s]": one["t"][seen], f"{kind} [N]": one["force"][seen]}
            if kind in ("stepped", "best"):
                some = np.linspace(0, seen.sum() - 1, PIXELS).astype(int)
                shares = {f"bead {k}": x for k, x in enumerate(one["shares"][some].T)}
                tables[f"{name} {kind} shares"] = {"t [s]": one["t"][some], **shares}
        tables[f"{name} forces"], tables[f"{name} measures"] = columns, side_by_side(rows)
        tables[f"{name} design"] = {"best": [common.letters(name, common.best(name).beads)]}
    said = [*advantages(tables), *orders(), *waves(tables)]
    names = ("the talk", "number", "verdict")
    tables["sentences"] = dict(zip(names, zip(*said, strict=True), strict=True))
    return tables


def measured(tables, name, key):
    """{design: one of the measures}."""
    one = tables[f"{name} measures"]
    return dict(zip(one["design"], one[key], strict=True))


def advantages(tables):
    """The force of the best design and of others: statement, numbers, verdict."""
    for name in common.SCENES:
        force = measured(tables, name, "peak [N]")
        uniform = sorted((k for k in force if "uniform" in k), key=force.get, reverse=True)
        shown = {k: force[k] for k in (*uniform, "stepped")}
        shown["random median"] = float(np.median(common.drawn(name)))
        numbers = (f"{k} / best {x / common.best(name).peak_force:.2f}" for k, x in shown.items())
        verdict = "holds against uniform and stepped; modest against random"
        yield f"dramatic advantages ({name})", ", ".join(numbers), verdict


def orders():
    """What the best thousandth of all orders of T1 have in common."""
    best = common.every_order()["best"]["design"]
    top = np.array([["Ab".index(kind) for kind in one] for one in best])  # 0 large, 1 small
    last = (top[:, -2:] == 1).all(axis=1).mean()
    number = f"T1, best 0.1 % of all orders: the last two are light in {last:.0%}"
    yield "soft/light beads near the wall", number, "holds" if last > 0.9 else "does not hold"
    heavy = (top == 0).mean(axis=0)
    number = (
        f"T1, best 0.1 %: heavy at places 1 and 2 in {heavy[0]:.0%} and {heavy[1]:.0%}, at 3 to 10 "
        f"in {heavy[2:10].min():.0%} to {heavy[2:10].max():.0%}"
    )
    verdict = "not for the first one or two; holds behind them"
    yield "hard/heavy beads near the struck end", number, verdict
    changes = top[:, 1:] != top[:, :-1]
    whole = common.forces([common.SCENES["T1"].compared["alternating"]], 1e-3)[0]
    number = (
        f"T1, best 0.1 %: {(1 + changes.sum(axis=1)).mean():.1f} blocks on average; a change at "
        f"places 11 to 18 in {changes[:, 10:17].mean():.0%}, at 3 to 10 in "
        f"{changes[:, 2:9].mean():.0%}; full alternation gives {whole:.1f} N"
    )
    verdict = "partly: blocks of two to four, nearer to the wall"
    yield "alternating hard and soft beads in the centre", number, verdict


def waves(tables):
    """The wave that arrives at the wall, in the stepped and in the best design."""
    for name in common.SCENES:
        of = measured(tables, name, "width [us]"), measured(tables, name, "impulse [mN s]")
        (wide, wider), sums = ([one["stepped"], one["best"]] for one in of)
        number = (
            f"width at half height {wide:.1f} -> {wider:.1f} us; impulse on the wall "
            f"{sums[0]:.2f} -> {sums[1]:.2f} mN s"
        )
        verdict = "holds" if wider > 2 * wide else "not by the width of the largest pulse"
        yield f"extended, small-amplitude wave ({name})", number, verdict
    beads = "effective beads at the peak"
    for name in common.SCENES:
        one = measured(tables, name, beads)
        few, more = one["stepped"], one["best"]
        number = f"beads that share the energy at the peak {few:.1f} -> {more:.1f} of 21"
        verdict = "holds as a ratio; not equipartition" if more > 1.2 * few else "does not hold"
        yield f"marked thermalization ({name})", number, verdict
    light, force = (measured(tables, "T1", key)["uniform 4 mm"] for key in (beads, "peak [N]"))
    number = f"uniform 4 mm: {light:.1f} beads share the energy, and yet {force:.1f} N"
    yield "thermalization is what protects", number, "not sufficient"


def table(tables):
    """The statements of the talk with their numbers."""
    return lines(tables["sentences"])


def draw(figure, tables):
    """Wall forces of each scene; energy fractions in the stepped and in the best order of sizes."""
    figure.set_size_inches(9, 9.5)
    panels = figure.subplots(3, 2).ravel()
    for axes, (name, scene) in zip(panels[:4], common.SCENES.items(), strict=True):
        force = measured(tables, name, "peak [N]")
        least = min((kind for kind in force if "uniform" in kind), key=force.get)
        t = 1e3 * tables[f"{name} forces"]["t [s]"]
        for kind, style in ((least, "C0"), ("stepped", "C1"), ("best", "k")):
            force = tables[f"{name} forces"][f"{kind} [N]"]
            top = int(np.argmax(force))
            axes.plot(t, force, style, lw=1.6 if kind == "best" else 0.9)
            axes.annotate(kind, (t[top], force[top]), (3, 14 if kind == least else 2),
                          textcoords="offset points", color=style, clip_on=False)  # fmt: skip
        axes.set(xlabel="time [ms]", ylabel="force on the wall [N]", xlim=(0, t[-1]))
        axes.set_title(f"{name}: {scene.title}", fontsize=9)
        axes.set_ylim(0, 1.15 * axes.get_ylim()[1])
    for axes, kind in zip(panels[4:], ("stepped", "best"), strict=True):
        instants, *one = tables[f"T1 {kind} shares"].values()
        image = axes.pcolormesh(
            1e3 * instants, np.arange(len(one)), np.stack(one), cmap="magma_r", vmin=0,
            vmax=0.4, shading="nearest", rasterized=True,
        )  # fmt: skip
        axes.set(xlabel="time [ms]", ylabel="bead, 0 is the striker", title=f"T1, {kind}: energy")
        axes.set_yticks(range(0, len(one), 5))
        axes.grid(False)
    figure.colorbar(image, ax=panels[5], label="fraction of the energy", extend="max")
