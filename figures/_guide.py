"""The guide of the paper: its beads, runs, sensor curves and densities.

Curves are offset like the paper's, so many newtons per division.  Our choice where the paper's
text gives no sensor: bead 16 of stem 1.
"""

import numpy as np

from granular import (
    Bead,
    Striker,
    diamond_guide,
    energies,
    materials,
    overlaps,
    sensor_force,
    simulate,
)
from tensegrity import Record

STEEL = Bead(4.76e-3, materials["steel"], mass=0.45e-3)
PTFE = Bead(4.76e-3, materials["ptfe"], mass=0.123e-3)
CLOCK = 3e-6  # s: sampling interval of the paper's density plots
PARYLENE = STEEL.coated(materials["parylene"], 50e-6)
HEAVY = Bead.of_mass(5.33e-3, materials["steel"])
STEM, BRANCH = 19, 47  # beads in each
DT = 0.1e-6  # s: energy to 2e-8 or better in these scenes
MIXED, MIXED_END = (("stem 1", 16), ("branch 1", 7), ("branch 2", 7), ("stem 2", 5)), 2.4e-3
"""Sensors of figs. 4 to 6, and the time of their runs [s]."""
INSTANTS = (0.6e-3, 1.2e-3, 2.4e-3)  # s, at which energy fractions are printed


def light(speed):
    """The striker of 0.45 g."""
    return Striker(STEEL, speed)


def heavy(speed):
    """The striker of 5.33 g."""
    return Striker(HEAVY, speed)


def followed(scene, t_end, dt=DT, every=10):
    """A run of all sites as in the paper: a fixed step, and a row every `every` steps."""
    return simulate(scene, scene.start(), t_end, method="rkn6", dt=dt, record=Record(every=every))


def mixed(soft, striker):
    """The run of a steel guide whose second branch is of other beads."""
    return followed(diamond_guide(bead=STEEL, branches=(STEEL, soft), striker=striker), MIXED_END)


def curves(run, sensors):
    """Sensor forces as a table: t and one column for each (part, number)."""
    columns = {f"{part} {n} [N]": sensor_force(run, part, n) for part, n in sensors}
    return {"t [s]": run.t, **columns}


def scene_tables(run, sensors, branch):
    """Curves, density along a branch, energies of the parts and some numbers of a full guide.

    The density is the sensor force at each site of stem 1, the branch and stem 2, every 3 us, or
    every row of the run where these are farther apart.
    """
    largest, mean = overlaps(run, f"branch {branch}")
    sites = [s for p in ("stem 1", f"branch {branch}", "stem 2") for s in run.scene.parts[p]]
    step = max(1, round(CLOCK / (run.t[1] - run.t[0])))
    forces = enumerate(sensor_force(run, sites)[::step].T, 1)
    return {
        "curves": curves(run, sensors),
        "density": {"t [s]": run.t[::step], **{f"site {k} [N]": x for k, x in forces}},
        "energies": {"t [s]": run.t, **{f"{k} [J]": e for k, e in energies(run).parts.items()}},
        "numbers": {
            "largest overlap [m]": [largest],
            "mean peak overlap [m]": [mean],
            "energy error": [run.energy_error],
            "momentum error": [momentum_error(run)],
        },
    }


def skew(run):
    """Largest difference of the upper branch and the mirrored lower one, over the largest u."""
    upper, lower = (list(run.scene.parts[f"branch {k}"]) for k in (1, 2))
    return np.abs(run.u[:, upper] * [1, -1] - run.u[:, lower]).max() / np.abs(run.u).max()


def momentum_error(run):
    """Largest change of the momentum of beads and walls, over the striker's."""
    total = run.momentum()
    return np.abs(total - total[0]).max() / total[0, 0]


def draw_curves(axes, table, divisions, title):
    """Curves above each other, the first on top; `divisions` [N] is one division of each."""
    names = [n for n in table if n != "t [s]"]
    shown = [table[n] / division for n, division in zip(names, divisions, strict=True)]
    apart = 1 + int(max(s.max() for s in shown))
    for k, (name, division, curve) in enumerate(zip(names, divisions, shown, strict=True)):
        base = apart * (len(names) - 1 - k)
        axes.plot(1e3 * table["t [s]"], base + curve, f"C{k}", lw=1)
        part, bead = name.removesuffix(" [N]").rsplit(" ", 1)
        axes.annotate(
            f"{part}\nbead {bead}\n{division:g} N/div", (1.01, base),
            xycoords=("axes fraction", "data"), va="bottom", fontsize=9, color=f"C{k}",
        )  # fmt: skip
    axes.set_yticks(np.arange(apart * len(names) + 1), [])  # of N/div beside each curve
    axes.set(xlabel="time [ms]", ylabel="force [divisions]")
    axes.set_title(title, fontsize=9)
    axes.set_ylim(-0.5, apart * len(names))
    axes.margins(x=0)


def draw_density(axes, table, breaks, title, unit, *, first=1, **style):
    """Colours of a value, site against time in a unit [s], and lines behind some of the sites;
    returns the image."""
    values = np.stack([c for n, c in table.items() if n != "t [s]"], axis=1)
    start = first - 0.5
    image = axes.imshow(
        values, origin="lower", aspect="auto", interpolation="nearest",
        extent=(start, start + values.shape[1], 0, table["t [s]"][-1] / unit), **style,
    )  # fmt: skip
    for place in breaks:
        axes.axvline(place + 0.5, color="w", lw=0.7, ls=":")
    axes.set_title(title, fontsize=9)
    axes.grid(False)
    return image


def draw_scene(axes, tables, divisions, titles):
    """Curves on the left, density on the right, time in units of the paper's step between rows."""
    from matplotlib.colors import PowerNorm

    left, right = axes
    draw_curves(left, tables["curves"], divisions, titles[0])
    norm = PowerNorm(0.5, 0)
    image = draw_density(
        right, tables["density"], (STEM, STEM + BRANCH), titles[1], CLOCK, norm=norm, cmap="inferno"
    )
    right.set(xlabel="site", ylabel="time step of 3 µs")
    right.figure.colorbar(image, ax=right, label="force [N]")


def draw_mixed(figure, tables, divisions, soft, blow):
    """Curves and density of a guide with a soft branch."""
    figure.set_size_inches(9, 5)
    titles = (f"steel and {soft} branch, {blow}", f"stem 1, {soft} branch, stem 2")
    draw_scene(figure.subplots(1, 2), tables, divisions, titles)


def number(tables, name):
    """One of the numbers of a scene."""
    return float(tables["numbers"][name][0])


def curve(tables, part, bead, until=np.inf):
    """(t, force) of a sensor of a scene, up to an instant."""
    t, force = tables["curves"]["t [s]"], tables["curves"][f"{part} {bead} [N]"]
    return t[t < until], force[t < until]


def share(tables, part, instant):
    """Part of the total energy that is in a part of the guide at an instant."""
    t, *parts = tables["energies"].values()
    energy = tables["energies"][f"{part} [J]"]
    return float(np.interp(instant, t, energy / sum(e[0] for e in parts)))


def soft_lines(figure, tables, of, mean=None):
    """Lines of a soft second branch: overlaps, of which `mean` is the paper's value, fractions of
    the energy at `INSTANTS`, and the errors of the balances."""
    lines = {}
    if mean:
        lines = {
            "largest overlap in the Parylene branch [um]":
            (1e6 * number(tables, "largest overlap [m]"), "order of 10"),
            "mean peak overlap there [um]": (1e6 * number(tables, "mean peak overlap [m]"), mean),
        }  # fmt: skip
    lines |= {f"energy in {of} at {1e3 * t:g} ms": (share(tables, "branch 2", t), "trapped")
              for t in INSTANTS}  # fmt: skip
    return rows(figure, lines | balances(tables))


def balances(tables, of=""):
    """The errors of energy and momentum."""
    names = {"energy error": "", "momentum error": ", walls included"}
    return {f"{of}{name}{words}": number(tables, name) for name, words in names.items()}


def rows(figure, found):
    """Lines of the table of the group, from {quantity: here, or (here, paper, experiment)}."""
    lines = []
    for quantity, values in found.items():
        values = values if isinstance(values, tuple) else (values,)
        here, paper, experiment, *_ = (*values, "", "")
        lines.append({"figure": figure, "quantity": quantity, "paper": paper,
                      "experiment": experiment, "here": here})  # fmt: skip
    return lines
