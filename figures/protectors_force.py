"""Optimised protectors spread the impact: smaller forces, for longer, from more of the beads."""

from __future__ import annotations

import numpy as np

from figures import _protectors as common

NAME = "protectors_force"
GROUP = "protectors"

WINDOWS = {"T1": 3.0, "T2": 2.0, "S": 3.0, "M": 1.5}  # times the time of the search
SHOWN = {"T1": 0.8e-3, "T2": 6e-3, "S": 0.8e-3, "M": 8e-3}  # s
PIXELS = 300  # instants of a density


def designs(name):
    """{what: beads} that are followed."""
    known = common.SCENES[name].compared
    uniform = {kind: beads for kind, beads in known.items() if kind.startswith("uniform")}
    return {**uniform, "stepped": known["stepped"], "best": common.best(name).beads}


def data():
    """Wall forces and measures of each scene's designs; densities of the stepped and the best."""
    tables = {}
    for name, scene in common.SCENES.items():
        rows, columns = {}, {}
        for kind, beads in designs(name).items():
            one = common.trace(beads, scene.t_end, WINDOWS[name])
            for key, value in {"design": kind, **common.measures(one)}.items():
                rows.setdefault(key, []).append(value)
            seen = one["t"] <= SHOWN[name]
            columns["t [s]"] = one["t"][seen]
            columns[f"{kind} [N]"] = one["force"][seen]
            if kind in ("stepped", "best"):
                some = np.linspace(0, seen.sum() - 1, PIXELS).astype(int)
                shares = {f"bead {k}": x for k, x in enumerate(one["shares"][some].T)}
                tables[f"{name} {kind} shares"] = {"t [s]": one["t"][some], **shares}
                columns[f"{kind}, effective beads"] = one["effective"][seen]
        tables[f"{name} forces"] = columns
        tables[f"{name} measures"] = rows
        tables[f"{name} design"] = {"best": [common.letters(name, common.best(name).beads)]}
    tables["sentences"] = sentences(tables)
    return tables


def measured(tables, name, design, key):
    """One of the measures of a design."""
    one = tables[f"{name} measures"]
    return one[key][one["design"].index(design)]


def sentences(tables):
    """Statements of the talk, the deciding numbers, and the verdicts."""
    lines = []

    def say(claim, number, verdict):
        lines.append((claim, number, verdict))

    peak = "peak [N]"
    for name, scene in common.SCENES.items():
        found = common.best(name).peak_force
        drawn = float(np.median(common.drawn(name)))
        uniform = {k: measured(tables, name, k, peak) for k in scene.compared if "uniform" in k}
        worst, least = max(uniform, key=uniform.get), min(uniform, key=uniform.get)
        stepped = measured(tables, name, "stepped", peak)
        say(
            f"dramatic advantages ({name})",
            f"{worst} / best {uniform[worst] / found:.2f}, {least} / best "
            f"{uniform[least] / found:.2f}, stepped / best {stepped / found:.2f}, random median / "
            f"best {drawn / found:.2f}",
            "holds against uniform and stepped; modest against random",
        )
    best = common.every_order()["best"]["design"]  # 0.1 % of all
    top = np.array([["Ab".index(kind) for kind in one] for one in best])  # 0 large, 1 small
    last = float((top[:, -2:] == 1).all(axis=1).mean())
    say(
        "soft/light beads near the wall",
        f"T1, best 0.1 % of all orders: the last two are light in {last:.0%}",
        "holds" if last > 0.9 else "does not hold",
    )
    heavy = (top == 0).mean(axis=0)
    say(
        "hard/heavy beads near the struck end",
        f"T1, best 0.1 %: heavy at places 1 and 2 in {heavy[0]:.0%} and {heavy[1]:.0%}, at 3 to 10 "
        f"in {heavy[2:10].min():.0%} to {heavy[2:10].max():.0%}",
        "not for the first one or two; holds behind them",
    )
    changes = top[:, 1:] != top[:, :-1]
    whole = common.forces([common.SCENES["T1"].compared["alternating"]], 1e-3)[0]
    blocks = (1 + changes.sum(axis=1)).mean()
    say(
        "alternating hard and soft beads in the centre",
        f"T1, best 0.1 %: {blocks:.1f} blocks on average; a change at places 11 to 18 in "
        f"{changes[:, 10:17].mean():.0%}, at 3 to 10 in {changes[:, 2:9].mean():.0%}; full "
        f"alternation gives {whole:.1f} N",
        "partly: blocks of two to four, nearer to the wall",
    )
    for name in common.SCENES:
        wide = [measured(tables, name, kind, "width [us]") for kind in ("stepped", "best")]
        sums = [measured(tables, name, kind, "impulse [mN s]") for kind in ("stepped", "best")]
        say(
            f"extended, small-amplitude wave ({name})",
            f"width at half height {wide[0]:.1f} -> {wide[1]:.1f} us; impulse on the wall "
            f"{sums[0]:.2f} -> {sums[1]:.2f} mN s",
            "holds" if wide[1] > 2 * wide[0] else "not by the width of the largest pulse",
        )
    for name in common.SCENES:
        some = [measured(tables, name, kind, "effective beads at the peak")
                for kind in ("stepped", "best")]  # fmt: skip
        say(
            f"marked thermalization ({name})",
            f"beads that share the energy at the peak {some[0]:.1f} -> {some[1]:.1f} of 21",
            "holds as a ratio; not equipartition" if some[1] > 1.2 * some[0] else "does not hold",
        )
    light = measured(tables, "T1", "uniform 4 mm", "effective beads at the peak")
    say(
        "thermalization is what protects",
        f"uniform 4 mm: {light:.1f} beads share the energy, and yet "
        f"{measured(tables, 'T1', 'uniform 4 mm', peak):.1f} N",
        "not sufficient",
    )
    return dict(zip(("the talk", "number", "verdict"), zip(*lines, strict=True), strict=True))


def draw(figure, tables):
    """Wall forces of each scene; energy fractions in the stepped and in the best order of sizes."""
    figure.set_size_inches(9, 9.5)
    panels = figure.subplots(3, 2).ravel()
    for axes, (name, scene) in zip(panels, common.SCENES.items(), strict=False):
        forces = tables[f"{name} forces"]
        uniform = [kind for kind in scene.compared if kind.startswith("uniform")]
        least = min(uniform, key=lambda kind: measured(tables, name, kind, "peak [N]"))
        for kind, style in ((least, "C0"), ("stepped", "C1"), ("best", "k")):
            t, force = 1e3 * forces["t [s]"], forces[f"{kind} [N]"]
            top = int(np.argmax(force))
            axes.plot(t, force, style, lw=1.6 if kind == "best" else 0.9)
            up = 14 if kind == least else 2
            axes.annotate(kind, (t[top], force[top]), (3, up), textcoords="offset points",
                          color=style, clip_on=False)  # fmt: skip
        axes.set(xlabel="time [ms]", ylabel="force on the wall [N]", xlim=(0, t[-1]))
        axes.set_title(f"{name}: {scene.title}", fontsize=9)
        axes.set_ylim(0, 1.15 * axes.get_ylim()[1])
    for axes, kind in zip(panels[4:], ("stepped", "best"), strict=True):
        one = dict(tables[f"T1 {kind} shares"])
        instants = 1e3 * one.pop("t [s]")
        image = axes.pcolormesh(
            instants, np.arange(len(one)), np.stack(list(one.values())), cmap="magma_r", vmin=0,
            vmax=0.4, shading="nearest", rasterized=True,
        )  # fmt: skip
        axes.set(xlabel="time [ms]", ylabel="bead, 0 is the striker", title=f"T1, {kind}: energy")
        axes.set_yticks(range(0, len(one), 5))
        axes.grid(False)
    figure.colorbar(image, ax=panels[5], label="fraction of the energy", extend="max")


def text(tables):
    """The statements of the talk with their numbers, and the measures of all designs."""
    one = tables["sentences"]
    lines = ["| the talk says | number | verdict |", "|---|---|---|"]
    lines += [f"| {a} | {b} | {c} |" for a, b, c in zip(*one.values(), strict=True)]
    for name, scene in common.SCENES.items():
        rows = tables[f"{name} measures"]
        lines += ["", f"{name}, {scene.title}; the best is {tables[f'{name} design']['best'][0]}:"]
        lines += ["", "| " + " | ".join(rows) + " |", "|---" * len(rows) + "|"]
        for values in zip(*rows.values(), strict=True):
            cells = (v if isinstance(v, str) else f"{v:.4g}" for v in values)
            lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)
