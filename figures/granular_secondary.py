"""A late, large signal needs unequal branches, with either striker; no misalignment is needed.

Aligned, lossless guides as in the paper: a steel branch beside one of steel, PTFE or Parylene-C
coated beads, struck by 0.45 g at 0.5 m/s or by 5.33 g at 0.35 m/s. The force on bead 5 of stem 2
after 1 ms is compared with the first one there. What the branches retain is the energy of their
beads over that of the striker before the blow; a straight line of as many beads retains next to
nothing.
"""

import numpy as np

from figures import _guide
from figures._draw import name_curves, note
from granular import Bead, chain, diamond_guide, energies, sensor_force

NAME = "granular_secondary"
GROUP = "granular"

BRANCHES = {"steel": _guide.STEEL, "PTFE": _guide.PTFE, "Parylene": _guide.PARYLENE}
STRIKERS = {"0.45 g": (_guide.light, 0.5), "5.33 g": (_guide.heavy, 0.35)}
END, LATE = 2.9e-3, 1.0e-3  # s; the train through the steel branch has passed by then
EVERY, WAITING = 2e-6, (1.2e-3, END)  # s
LINE = _guide.STEM + _guide.BRANCH + 2 * _guide.STEM  # beads


def data():
    """Force on bead 5 of stem 2, and energy in the branches, of each guide and striker."""
    tables = {}
    for weight, (make, speed) in STRIKERS.items():
        for name, soft in BRANCHES.items():
            branches = (_guide.STEEL, soft)
            guide = diamond_guide(bead=_guide.STEEL, branches=branches, striker=make(speed))
            run = _guide.followed(guide, END, every=round(EVERY / _guide.DT))
            parts = energies(run).parts
            tables[f"{name}, {weight}"] = {
                "t [s]": run.t,
                "force [N]": sensor_force(run, "stem 2", 5),
                "energy in the branches":
                (parts["branch 1"] + parts["branch 2"]) / parts["striker"][0],
            }  # fmt: skip
        tables[f"line, {weight}"] = {
            "energy in the branches": [straight(make(speed))], "at [s]": [END]
        }  # fmt: skip
    return tables


def straight(striker):
    """Energy over the striker's that remains in the beads of a straight line, where the branches
    would be, once the waves have passed."""
    row = chain([Bead(_guide.STEEL.diameter, _guide.STEEL.material, _guide.STEEL.mass)] * LINE,
                striker=striker)  # fmt: skip
    run = _guide.followed(row, END, every=round(EVERY / _guide.DT))
    site = row.site_energy(run)[-1]
    place = slice(1 + _guide.STEM, 1 + _guide.STEM + _guide.BRANCH)
    return float(site[place].sum() / run.energy[0])


def late(one):
    """Largest force after `LATE` over that before."""
    t, force = np.asarray(one["t [s]"]), np.asarray(one["force [N]"])
    return force[t > LATE].max() / force[t <= LATE].max()


def retained(one):
    """Least and largest fraction in the branches while it is called trapped."""
    t, part = np.asarray(one["t [s]"]), np.asarray(one["energy in the branches"])
    inside = part[(t >= WAITING[0]) & (t <= WAITING[1])]
    return inside.min(), inside.max()


def table(tables):
    """Late over first force, and energy retained."""
    lines = {}
    for weight in STRIKERS:
        for name in BRANCHES:
            one, scene = tables[f"{name}, {weight}"], f"{name} beside steel, {weight}"
            lines[f"{scene}: late over first force"] = late(one), "large only unequal, 5.33 g"
            if name == "steel":
                least, most = retained(one)
                lines[f"{scene}: least retained in both branches, 1.2 to 2.9 ms"] = least, "some"
                lines[f"{scene}: most retained in both branches, 1.2 to 2.9 ms"] = most, "some"
        alone = tables[f"line, {weight}"]["energy in the branches"][0]
        lines[f"straight line, {weight}: retained in as many beads"] = alone, "none"
    return _guide.rows("secondary", lines)


def draw(figure, tables):
    """Forces over the first one, and energy retained."""
    figure.set_size_inches(9, 6.4)
    panels = figure.subplots(2, 2, sharex=True)
    for (above, below), weight in zip(panels.T, STRIKERS, strict=True):
        for k, name in enumerate(BRANCHES):
            one = tables[f"{name}, {weight}"]
            t, force = 1e3 * np.asarray(one["t [s]"]), np.asarray(one["force [N]"])
            first = force[t <= 1e3 * LATE].max()
            above.plot(t, force / first - 1.2 * k, f"C{k}", lw=1)
            words = f"{name}\n{late(one):.2f}"
            note(above, words, (2.95, 0.1 - 1.2 * k), color=f"C{k}")
            below.plot(t, one["energy in the branches"], f"C{k}", label=name)
        above.axvline(1e3 * LATE, color="0.5", ls=":", lw=1)
        above.set(ylabel="force on bead 5 of stem 2", yticks=[])
        above.set_title(f"striker of {weight}: largest after 1 ms, over the first")
        below.set(xlabel="time [ms]", ylabel="energy in the branches",
                  xlim=(0, 3.6), ylim=(0, 1))  # fmt: skip
        alone = tables[f"line, {weight}"]["energy in the branches"][0]
        below.axhline(alone, color="k", ls=":", lw=1)
        note(below, "dotted: in a straight line", (2.9, alone), (0, 3), ha="right")
        below.set_title("what the branches retain")
        name_curves(below)
