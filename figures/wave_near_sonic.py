"""Waves little faster than sound, emerging from an impact, against the sech^2 profile."""

from __future__ import annotations

from figures import _impact
from tensegrity import Prism

NAME = "wave_near_sonic"
GROUP = "waves"

PRISM = Prism(base=1.0, height=0.7, prestrain=0.1, k_cross=1.0)
WAVES = {  # speed ratio: masses struck, sites, bond at which the pulse is read, sought velocities
    1.05: {"struck": 2, "sites": 900, "travel": 800, "bracket": (0.03, 0.05), "around": 14},
    1.01: {"struck": 4, "sites": 1600, "travel": 1500, "bracket": (0.004, 0.01), "around": 14},
}


def data():
    """Profile of the leading pulse at each speed, and its asymptotics."""
    tables = {}
    for ratio, how in WAVES.items():
        for name, table in _impact.comparison(PRISM.potential(), ratio, **how).items():
            tables[f"{ratio}_{name}"] = table
    return tables


def draw(figure, tables):
    """Profile and numbers of each speed, one row each."""
    figure.set_size_inches(8, 8.5)
    axes = figure.subplots(len(WAVES), 2, width_ratios=(3, 1.25))
    for row, ratio in zip(axes, WAVES, strict=True):
        one = {n: tables[f"{ratio}_{n}"] for n in ("measured", "asymptotic", "numbers")}
        _impact.draw(*row, one, f"c = {ratio} c$_s$, height 0.7 m, prestrain 0.1")
