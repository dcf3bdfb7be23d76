"""Tapered and decorated chains halve the force of a pulse, which a uniform chain preserves."""

from __future__ import annotations

import numpy as np

from figures import _beads
from figures._beads import bead
from figures._guide import row
from tensegrity import largest_peak

NAME = "granular_graded"
GROUP = "granular"

BEADS = 60
SMALL = 0.4  # radius of the interstitial beads of the decorated chain over that of the others
TAPER = 0.01  # relative decrease of the radius from bead to bead
READ = 50  # contact at which the pulse that arrived is read
SCENES = {  # beads, duration [s]
    "uniform": ([bead("steel")] * BEADS, 0.7e-3),
    "decorated": ([bead("steel", SMALL if k % 2 else 1.0) for k in range(BEADS)], 0.9e-3),
    "tapered": ([bead("steel", (1 - TAPER) ** k) for k in range(BEADS)], 0.55e-3),
    "tapered and decorated": (
        [bead("steel", (1 - TAPER) ** k * (SMALL if k % 2 else 1.0)) for k in range(BEADS)],
        0.8e-3,
    ),
}


def data():
    """Density of energy, and the force at a contact far down the chain."""
    tables = {}
    for name, (beads, t_end) in SCENES.items():
        run = _beads.struck(beads, t_end)
        forces = run.scene.contact_forces(run.u)
        tables[f"{name} density"] = _beads.energies(run)
        tables[f"{name} force"] = {"t [s]": run.t, "force [N]": forces[:, READ]}
        tables[f"{name} numbers"] = {
            "peak at the striker [N]": [largest_peak(run.t, forces[:, 0])[1]],
            "energy error": [run.energy_error],
        }
    return tables


def table(tables):
    """Peak forces far down the chain relative to the uniform chain."""
    tops = {name: largest_peak(*tables[f"{name} force"].values())[1] for name in SCENES}
    return [
        row("graded", f"{name}: peak force at contact {READ} over the uniform chain's",
            tops[name] / tops["uniform"])
        for name in SCENES if name != "uniform"
    ]  # fmt: skip


def draw(figure, tables):
    """Energy densities, and the transmitted force."""
    from figures._draw import name_curves

    figure.set_size_inches(9, 6)
    figure.suptitle(__doc__.splitlines()[0].rstrip("."), fontsize=11)
    grid = figure.add_gridspec(2, 3, width_ratios=(1, 1, 1.2))
    axes = [figure.add_subplot(grid[k // 2, k % 2]) for k in range(len(SCENES))]
    for one, name in zip(axes, SCENES, strict=True):
        image = _beads.draw_density(one, tables[f"{name} density"], name)
    label = "energy over that of the striker"
    figure.colorbar(image, ax=axes, label=label, shrink=0.6, location="bottom")
    side = figure.add_subplot(grid[:, 2])
    for name in SCENES:
        force = tables[f"{name} force"]
        shown = (force["t [s]"] > 0.2e-3) & (force["t [s]"] < 0.5e-3)
        t, height = 1e3 * force["t [s]"][shown], np.maximum(force["force [N]"][shown], 0)
        side.plot(t, height, lw=1, label=name.replace(" and", "\nand"))
    name_curves(side, at=np.argmax)
    side.set(xlabel="time [ms]", ylabel=f"force at contact {READ} [N]", xlim=(0.2, 0.6))
    side.set_title("far down the chain", fontsize=9)
