"""The guide of the paper: its beads, runs, sensor curves and densities.

Curves are offset like the paper's, so many newtons per division.  Our choice where the paper's
text gives no sensor: bead 16 of stem 1.
"""

from __future__ import annotations

import numpy as np

from granular import Bead, Striker, energies, materials, overlaps, sensor_force, simulate
from tensegrity import Record

STEEL = Bead(4.76e-3, materials["steel"], mass=0.45e-3)
PTFE = Bead(4.76e-3, materials["ptfe"], mass=0.123e-3)
CLOCK = 3e-6  # s: sampling interval of the paper's density plots
PARYLENE = STEEL.coated(materials["parylene"], 50e-6)
HEAVY = Bead.of_mass(5.33e-3, materials["steel"])
STEM, BRANCH = 19, 47  # beads in each
DT = 0.1e-6  # s: energy to 2e-8 or better in these scenes
MIXED = (("stem 1", 16), ("branch 1", 7), ("branch 2", 7), ("stem 2", 5))  # sensors, figs. 4-6
INSTANTS = (0.6e-3, 1.2e-3, 2.4e-3)  # s, at which energy fractions are printed
ROWS = 10  # steps between recorded rows


def light(speed):
    """The striker of 0.45 g."""
    return Striker(STEEL, speed)


def heavy(speed):
    """The striker of 5.33 g."""
    return Striker(HEAVY, speed)


def followed(scene, t_end, dt=DT, every=ROWS):
    """A run of all sites as in the paper: a fixed step, and a row every `every` steps."""
    return simulate(scene, scene.start(), t_end, method="rkn6", dt=dt, record=Record(every=every))


def curves(run, sensors):
    """Sensor forces as a table: t and one column for each (part, number)."""
    columns = {f"{part} {n} [N]": sensor_force(run, part, n) for part, n in sensors}
    return {"t [s]": run.t, **columns}


def line(scene, branch):
    """Sites from the striker's end to the other through one branch, and where parts begin."""
    parts = [p for p in ("stem 1", f"branch {branch}", "stem 2") if p in scene.parts]
    sites = [s for p in parts for s in scene.parts[p]]
    return sites, np.cumsum([0, *(len(scene.parts[p]) for p in parts)])[1:-1]


def density_table(run, branch):
    """Sensor forces along stem 1, a branch and stem 2: t and a column for each site.

    Every 3 us, or every row of the run where these are farther apart.
    """
    sites, _ = line(run.scene, branch)
    step = max(1, round(CLOCK / (run.t[1] - run.t[0])))
    forces = sensor_force(run, sites)[::step]
    return {
        "t [s]": run.t[::step],
        **{f"site {k + 1} [N]": forces[:, k] for k in range(len(sites))},
    }


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
    axes.set_yticks(np.arange(apart * len(names) + 1), [])
    axes.set(xlabel="time [ms]", ylabel="force [divisions]")
    axes.set_title(title, fontsize=9)
    axes.set_ylim(-0.5, apart * len(names))
    axes.margins(x=0)


def draw_density(figure, axes, table, breaks, title):
    """Colours of force, site against time in units of 3 us, the paper's step between rows."""
    forces = np.stack([c for n, c in table.items() if n != "t [s]"], axis=1)
    from matplotlib.colors import PowerNorm

    image = axes.imshow(
        forces, origin="lower", aspect="auto", cmap="inferno",
        norm=PowerNorm(0.5, 0, forces.max()), interpolation="nearest",
        extent=(0.5, forces.shape[1] + 0.5, 0, table["t [s]"][-1] / CLOCK),
    )  # fmt: skip
    for place in breaks:
        axes.axvline(place + 0.5, color="w", lw=0.7, ls=":")
    axes.set(xlabel="site", ylabel="time step of 3 µs")
    axes.set_title(title, fontsize=9)
    axes.grid(False)
    figure.colorbar(image, ax=axes, label="force [N]")


def scene_tables(run, sensors, branch):
    """Curves, density, energies of the parts and some numbers of a run of the full guide."""
    largest, mean = overlaps(run, f"branch {branch}")
    return {
        "curves": curves(run, sensors),
        "density": density_table(run, branch),
        "energies": {"t [s]": run.t, **{f"{k} [J]": e for k, e in energies(run).parts.items()}},
        "numbers": {
            "largest overlap [m]": np.array([largest]),
            "mean peak overlap [m]": np.array([mean]),
            "energy error": np.array([run.energy_error]),
            "momentum error": np.array([momentum_error(run)]),
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


def draw_scene(figure, axes, tables, divisions, titles):
    """Curves on the left, density on the right."""
    draw_curves(axes[0], tables["curves"], divisions, titles[0])
    breaks = [STEM, STEM + BRANCH]
    draw_density(figure, axes[1], tables["density"], breaks, titles[1])


def number(tables, name):
    """One of the numbers of a scene."""
    return float(tables["numbers"][name][0])


def curve(tables, part, bead):
    """(t, force) of a sensor of a scene."""
    return tables["curves"]["t [s]"], tables["curves"][f"{part} {bead} [N]"]


def share(tables, part, instant):
    """Part of the total energy that is in a part of the guide at an instant."""
    energies = tables["energies"]
    total = sum(e[0] for name, e in energies.items() if name != "t [s]")
    return float(np.interp(instant, energies["t [s]"], energies[f"{part} [J]"]) / total)


def soft_shares(figure, tables, of):
    """Lines of the fraction of the energy in the second branch at `INSTANTS`."""
    return [
        row(figure, f"energy in {of} at {1e3 * t:g} ms", share(tables, "branch 2", t), "trapped")
        for t in INSTANTS
    ]


def soft_overlaps(figure, tables, mean):
    """Lines of the overlaps in the second branch; `mean` is the value of the paper."""
    said = {"largest overlap": "order of 10", "mean peak overlap": mean}
    where = {"largest overlap": "in the Parylene branch", "mean peak overlap": "there"}
    return [
        row(figure, f"{name} {where[name]} [um]", 1e6 * number(tables, f"{name} [m]"), words)
        for name, words in said.items()
    ]


def balances(figure, tables, of=""):
    """Lines of the errors of energy and momentum."""
    return [
        row(figure, f"{of}energy error", number(tables, "energy error")),
        row(figure, f"{of}momentum error, walls included", number(tables, "momentum error")),
    ]


def row(figure, quantity, here, paper="", experiment=""):
    """One line of the table of the group."""
    return {
        "figure": figure,
        "quantity": quantity,
        "paper": paper,
        "experiment": experiment,
        "here": here,
    }
