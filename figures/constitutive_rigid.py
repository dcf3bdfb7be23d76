"""A slender rigid prism locks where its bars meet, a thick one collapses flat."""

import numpy as np

from figures._draw import name_curves
from tensegrity import NoLocking, Prism

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
    stretched = np.linspace(0, 0.5 * min(high, -3 * low), POINTS // 4)
    r = np.append(compressed[compressed < 0], stretched)
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
    """Load above and energy below, of the slender and the thick prism."""
    figure.set_size_inches(9, 5.5)
    axes = figure.subplots(2, 2, sharex="col")
    shapes = (SLENDER, "locks"), (THICK, "collapses flat")
    for column, (height, word) in zip(axes.T, shapes, strict=True):
        for prestrain in PRESTRAINS:
            table = tables[f"h{height:g}_p{prestrain:g}"]
            for ax, name in zip(column, ("load", "energy"), strict=True):
                ax.plot(table["height"], table[name], label=f"prestrain {prestrain:g}")
        if np.isfinite(locking := table["locking_height"][0]):
            column[0].set_ylim(-0.45, 1.0)  # the load is unbounded at locking
            for ax in column:
                ax.axvline(locking, color="0.4", ls="--", lw=1)
            place = column[1].get_xaxis_transform()
            column[1].text(locking + 0.01, 0.7, "locking:\nbars meet", transform=place)
        column[0].set_title(f"height {height:g} m, base 1 m: {word}")
        column[0].set(ylabel="axial load [N]\n(compression > 0)")
        column[1].set(xlabel="height [m]", ylabel="energy [J]")
        name_curves(column[0])
