"""Little prestrain and short prisms let waves run at seventy times the speed of sound."""

from __future__ import annotations

import numpy as np

from derivations import waves as derived
from figures._draw import name_curves
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
    """Over the sound speed; over the two-body estimate; a curve for each prestrain."""
    figure.set_size_inches(9, 4.4)
    table, panels = tables["map"], figure.subplots(1, 2)
    shape = (len(SLENDERNESS), len(PRESTRAINS))
    gap = np.max(np.abs(table["speed_coarse"] / table["speed"] - 1))
    curves = table["speed_ratio"], table["speed"] / table["two_body"]
    panels[0].set_yscale("log")
    for axes, values in zip(panels, curves, strict=True):
        for k, prestrain in enumerate(PRESTRAINS):
            y = values.reshape(shape)[:, k]
            axes.plot(SLENDERNESS, y, "o-", ms=3, label=f"{prestrain:.2g}")
        axes.set(xscale="log", xlim=(0.33, 5), xlabel="slenderness, height / base")
        axes.set_xticks([0.4, 0.7, 1, 2, 3], ["0.4", "0.7", "1", "2", "3"], minor=False)
        axes.set_xticks([], minor=True)
        name_curves(axes)
    panels[0].set(ylabel="largest speed / sound speed")
    panels[0].set_yticks([2, 5, 10, 20, 50], ["2", "5", "10", "20", "50"], minor=False)
    panels[0].set_yticks([], minor=True)
    panels[0].set_title("(a) fast where soft at rest", fontsize=11)
    panels[1].set(ylabel="largest speed / two-body estimate")
    panels[1].set_title("(b) the two-body estimate is a bound", fontsize=11)
    figure.suptitle("Largest speed before the bars meet, by prestrain of the cross strings (at the "
                    f"curves)\ntwo resolutions agree to {gap:.0e}", fontsize=10)  # fmt: skip
