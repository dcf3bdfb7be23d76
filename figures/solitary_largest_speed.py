"""The largest speed before the bars meet, over slenderness and prestrain."""

from __future__ import annotations

import numpy as np

from derivations import waves as derived
from tensegrity import Prism
from tensegrity.waves.limit import largest_speed

NAME = "solitary_largest_speed"
GROUP = "waves"

SLENDERNESS = np.geomspace(0.36, 3.0, 6)
PRESTRAINS = np.geomspace(1e-4, 0.3, 5)
CLOSEST = (4e-3, 8e-3)  # stroke left to the largest wave of each of two extrapolations


def data():
    """Largest speed [sites/s] for unit base, mass and k_cross, twice, and the two-body estimate."""
    rows = []
    for slenderness in SLENDERNESS.tolist():
        for prestrain in PRESTRAINS.tolist():
            spring = Prism(1.0, slenderness, prestrain, 1.0).potential()
            fine, coarse = (largest_speed(spring, closest=closest) for closest in CLOSEST)
            values = {
                derived.mass: 1.0,
                derived.stroke: -spring.domain[0],
                derived.locking_energy: float(spring.energy(spring.domain[0])),
            }
            estimate = float(derived.largest_speed().subs(values))
            sound = spring.sound_speed()
            rows.append((slenderness, prestrain, fine, coarse, estimate, fine / sound))
    names = ("slenderness", "prestrain", "speed", "speed_coarse", "two_body", "speed_ratio")
    return {"map": dict(zip(names, map(np.array, zip(*rows, strict=True)), strict=True))}


def draw(figure, tables):
    """Over the sound speed; over the two-body estimate."""
    figure.set_size_inches(11, 4.4)
    table = tables["map"]
    shape = (len(SLENDERNESS), len(PRESTRAINS))
    x, y = (table[name].reshape(shape) for name in ("slenderness", "prestrain"))
    gap = np.max(np.abs(table["speed_coarse"] / table["speed"] - 1))
    panels = (
        (np.log10(table["speed_ratio"]), "log$_{10}$ of the largest c/c$_s$"),
        (table["speed"] / table["two_body"], "largest speed / two-body estimate"),
    )
    for axes, (values, label) in zip(figure.subplots(1, 2), panels, strict=True):
        image = axes.contourf(x, y, values.reshape(shape), levels=12, cmap="viridis")
        axes.plot(x, y, "k.", ms=2)
        axes.set(
            xscale="log", yscale="log", xlabel="slenderness, height / base",
            ylabel="prestrain of the cross strings",
        )  # fmt: skip
        axes.set_xticks([0.4, 0.7, 1, 2, 3], ["0.4", "0.7", "1", "2", "3"], minor=False)
        axes.set_xticks([], minor=True)
        figure.colorbar(image, label=label)
    figure.suptitle(f"two resolutions agree to {gap:.1e}", fontsize=9)
