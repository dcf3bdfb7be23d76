"""Axial load and elastic energy of rigid-elastic prisms against height, to locking or collapse."""

from __future__ import annotations

import numpy as np

from tensegrity import NoLocking, Prism

NAME = "constitutive_rigid"
GROUP = "constitutive"

SLENDER, THICK = 0.7, 0.25  # height over base
PRESTRAINS = (0.0, 0.01, 0.05, 0.1, 0.2)
POINTS = 400


def data():
    """Height, load (compression > 0) and energy for both prisms and every prestrain."""
    return {
        f"h{height:g}_p{prestrain:g}": _curve(Prism(1.0, height, prestrain, k_cross=1.0))
        for height in (SLENDER, THICK)
        for prestrain in PRESTRAINS
    }


def _curve(prism):
    spring = prism.potential()
    low, high = spring.domain
    compressed = low * (1 - np.logspace(-5, 0, POINTS))  # graded towards locking
    r = np.append(
        compressed[compressed < 0], np.linspace(0, 0.5 * min(high, -3 * low), POINTS // 4)
    )
    try:
        locking = prism.locking_height()
    except NoLocking:
        locking = np.nan
    return {
        "height": prism.height + r,
        "load": -spring.tension(r),
        "energy": spring.energy(r),
        "locking_height": np.full(1, locking),
    }


def draw(figure, tables):
    """Four panels: load and energy of the slender and the thick prism."""
    axes = figure.subplots(2, 2, sharex="col")
    for column, (height, word) in enumerate(((SLENDER, "locks"), (THICK, "collapses flat"))):
        load_axes, energy_axes = axes[:, column]
        for index, prestrain in enumerate(PRESTRAINS):
            table = tables[f"h{height:g}_p{prestrain:g}"]
            style = {"color": f"C{index}", "label": f"prestrain {prestrain:g}"}
            load_axes.plot(table["height"], table["load"], **style)
            energy_axes.plot(table["height"], table["energy"], **style)
        locking = table["locking_height"][0]
        if np.isfinite(locking):
            for ax in (load_axes, energy_axes):
                ax.axvline(locking, color="0.4", ls="--", lw=1)
            energy_axes.annotate(
                "locking: bars meet", (locking, 0.9), xytext=(6, 0), color="0.3",
                xycoords=("data", "axes fraction"), textcoords="offset points",
            )  # fmt: skip
        load_axes.axhline(0, color="0.7", lw=0.8)
        load_axes.set_title(f"height {height:g} m, base 1 m: {word}", fontsize=10)
        energy_axes.set_xlabel("height [m]")
        if np.isfinite(locking):
            load_axes.set_ylim(-0.35, 1.0)  # the load is unbounded at locking
    axes[0, 0].set_ylabel("axial load [N]\n(compression > 0)")
    axes[1, 0].set_ylabel("energy [J]")
    axes[0, 1].legend(fontsize=8)
