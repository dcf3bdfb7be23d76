"""Mixed packs of steel and PTFE: transmitted force, energy trapping and redirection.

Trapping is the fraction of the energy in the upper half, striker included, at the instant of the
peak floor force; redirection is the lateral fraction of the kinetic energy then.  Each pack of rows
or layers is compared with the straight column of the same materials.
"""

from __future__ import annotations

import numpy as np

from figures import _packs
from figures._packs import FAST, PTFE, SLOW, STEEL, row
from granular import energies, wall_force
from tensegrity import Record, largest_peak

NAME = "packs_mixed"
GROUP = "packs"

END = {"plane": 1.2e-3, "space": 2e-3}  # s
INTERVAL = 2e-6  # s between rows
MIXES = ("all steel", "all PTFE", "alternating", "steel over PTFE", "PTFE over steel", "random")
KNOWN = {
    "plane": dict(zip(MIXES, (575.759, 97.3404, 75.9950, 87.3434, 223.5015, 46.9160), strict=True)),
    "space": {"all steel": 202.404, "alternating": 124.317, "steel over PTFE": 97.88,
              "random": 87.905},
}  # fmt: skip
OVER_COLUMN = dict(zip(MIXES, (1.56, 1.77, 1.51, 1.62, 1.79), strict=False))


def by_level(mix, levels):
    """Which of some rows or layers, from the top, are steel."""
    upper = np.arange(levels) < levels / 2
    return {
        "all steel": np.ones(levels, dtype=bool), "all PTFE": np.zeros(levels, dtype=bool),
        "alternating": np.arange(levels) % 2 == 0, "steel over PTFE": upper,
        "PTFE over steel": ~upper,
    }[mix]  # fmt: skip


def beads(hard):
    """Beads of steel where `hard` says so."""
    return [STEEL if x else PTFE for x in hard]


def planar(mix):
    """A pack in the plane."""
    if mix == "random":
        hard = np.random.default_rng(0).permutation(np.arange(247) % 2)[:246]
        return _packs.plane(beads(hard))
    counts = [21 - k % 2 for k in range(12)]
    return _packs.plane(beads(np.repeat(by_level(mix, 12), counts)))


def cubic(mix):
    """A pack in space, struck by steel."""
    if mix == "random":
        hard = np.random.default_rng(0).permutation(833) % 2
    else:
        hard = np.repeat(by_level(mix, 17)[::-1], 49)
    return _packs.cube(bead=beads(hard))


def measured(scene, t_end, levels, name):
    """Peak on the floor, its instant, and trapping and redirection then."""
    run = _packs.quick(scene, t_end, Record(interval=INTERVAL))
    instant, force = largest_peak(run.t, wall_force(run, "floor"))
    k = int(np.argmin(np.abs(run.t - instant)))
    fractions = energies(run).fractions
    count = levels // 2
    upper = [f"row {n}" for n in range(1, count + 1)] if name == "plane" else [
        f"layer {n}" for n in range(levels - count, levels + 1)]  # fmt: skip
    sites = [scene.sites - 1, *(s for part in upper for s in scene.parts[part])]
    kinetic = scene.mass[:, None] * run.v[k] ** 2
    lateral = kinetic[:, :-1].sum() / kinetic.sum()
    curve = 1 - fractions[:, sites].sum(axis=1)
    return (force, instant, 1 - curve[k], lateral, curve.max()), curve, run.t


COLUMNS = ("peak [N]", "at [s]", "upper half", "lateral", "most below")


def data():
    """Numbers of each mix in the plane and in space, and of the columns."""
    tables = {}
    for name, make, levels in (("plane", planar, 12), ("space", cubic, 17)):
        found, curves = [], {}
        for mix in KNOWN[name]:
            numbers, curve, t = measured(make(mix), END[name], levels, name)
            found.append(numbers)
            curves[mix] = curve
        speed = SLOW if name == "plane" else FAST
        lone = []
        for mix in KNOWN[name]:
            if mix == "random":  # its layers are alike
                lone.append(np.nan)
                continue
            column = _packs.column(beads(by_level(mix, levels)), speed)
            lone.append(largest_peak(*_packs.floor_of(column, END[name], name="end"))[1])
        columns = dict(zip(COLUMNS, np.transpose(found), strict=True))
        tables[name] = {"mix": list(KNOWN[name]), **columns, "column [N]": np.array(lone)}
        tables[f"{name}_below"] = {"t [s]": t, **curves}
    return tables


def table(tables):
    """Each mix."""
    rows = []
    for name, known in KNOWN.items():
        t = tables[name]
        for k, mix in enumerate(t["mix"]):
            words = f"{name}, {mix}: "
            rows += [
                row("mixed", f"{words}peak on the floor [N]", float(t["peak [N]"][k]), known[mix]),
                row("mixed", f"{words}trapping: upper half then", float(t["upper half"][k])),
                row("mixed", f"{words}redirection: lateral part then", float(t["lateral"][k])),
            ]
            if np.isfinite(t["column [N]"][k]):
                reference = OVER_COLUMN.get(mix, "") if name == "plane" else ""
                ratio = float(t["peak [N]"][k] / t["column [N]"][k])
                rows.append(row("mixed", f"{words}over the straight column", ratio, reference))
    return rows


def draw(figure, tables):
    """Peaks of packs and columns; energy in the lower half against time."""
    figure.set_size_inches(13, 7.5)
    for (a, b, c), name in zip(figure.subplots(2, 3), ("plane", "space"), strict=True):
        t = tables[name]
        place = np.arange(len(t["mix"]))
        a.bar(place - 0.2, t["peak [N]"], 0.4, label="pack")
        a.bar(place + 0.2, t["column [N]"], 0.4, label="straight column")
        a.set(ylabel="peak force on the floor [N]", title=f"in {name}" if name == "space" else
              "in the plane")  # fmt: skip
        a.legend(fontsize=8)
        b.bar(place - 0.2, t["upper half"], 0.4, label="trapping: energy in the upper half")
        b.bar(place + 0.2, t["lateral"], 0.4, label="redirection: lateral kinetic energy")
        b.set(ylabel="fraction", ylim=(0, 1.25), title="at the peak of the floor force")
        b.legend(fontsize=7, loc="upper left")
        for axes in (a, b):
            axes.set_xticks(place, t["mix"], rotation=25, fontsize=8, ha="right")
        below = tables[f"{name}_below"]
        for mix in t["mix"]:
            c.plot(1e3 * below["t [s]"], below[mix], lw=1, label=mix)
        c.set(xlabel="time [ms]", ylabel="fraction of the energy", title="lower half", ylim=(0, 1))
        c.legend(fontsize=7, loc="upper left", ncols=2)
