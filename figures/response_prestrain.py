"""Thick prisms fold at a load that grows with prestrain; slender ones fold late, or touch first.

Of the slender prisms that of prestrain 0.4 passes its limit load before its bars touch; the bars of
those of prestrain 0.01 and 0.1 touch while the load still grows.
"""

import numpy as np

from figures._draw import name_curves, note
from tensegrity import Prism, equilibrium_path
from tensegrity.prisms.fold_curve import limit_load

GROUP = "response"

SHAPES = {"thick": 0.5, "slender": 1.5}  # height over base
PRESTRAINS = (0.01, 0.1, 0.4)
STIFFNESS = {"k_base": 5.0, "k_bar": 50.0}
MARKS = {"fold": "^", "contact": "s", "flat": "v", "slack": "o"}
HEIGHTS, SOFTER = (0.3, 0.4, 0.5, 0.6), {"k_base": 2.0, "k_bar": 20.0}  # of the limit loads
RANGE = (0.4, 1e-3)  # prestrain


def data():
    """The equilibrium path of each shape and prestrain, its events, and the limit load of prisms of
    each height."""
    tables = {}
    for shape, height in SHAPES.items():
        for prestrain in PRESTRAINS:
            prism = Prism(1.0, height, prestrain, k_cross=1.0, **STIFFNESS)
            path = equilibrium_path(prism, max_height=1.05 * height)
            tables[f"{shape}_p{prestrain:g}"] = path.columns
            tables[f"{shape}_p{prestrain:g}_events"] = {
                name: [getattr(e, name) for e in path.events]
                for name in ("kind", "shortening", "load")
            }
    for height in HEIGHTS:
        curve = limit_load(Prism(1.0, height, RANGE[0], k_cross=1.0, **SOFTER), RANGE[1])
        tables[f"h{height:g}"] = curve.columns
    return tables


def draw(figure, tables):
    """States unstable under a prescribed load are dashed, events are marked."""
    figure.set_size_inches(9, 7.5)
    axes = figure.subplot_mosaic([[*SHAPES], ["limit"] * 2])
    for shape, height in SHAPES.items():
        ax = axes[shape]
        for index, prestrain in enumerate(PRESTRAINS):
            table, events = (tables[f"{shape}_p{prestrain:g}{end}"] for end in ("", "_events"))
            x, y, stable = table["shortening"], table["load"], np.array(table["stable_load"])
            ax.plot(x, y, f"C{index}--", lw=0.9, label=f"prestrain {prestrain:g}")
            ax.plot(x, np.where(stable, y, np.nan), f"C{index}", lw=1.7)
            if shape == "thick":  # at the fold, above the unstable part
                top = np.argmax(y)
                note(ax, f"prestrain {prestrain:g}", (x[top], y[top]), (8, 8), color=f"C{index}")
            for kind, at, load in zip(*events.values(), strict=True):
                ax.plot(at, load, MARKS[kind], color=f"C{index}", ms=5)
        ax.axhline(0, color="0.7", lw=0.8)
        ax.set(xlabel="shortening [m]", ylabel="axial load [N], compression > 0")
        ax.margins(y=0.12)
        ax.set_title(f"{shape}: height {height:g} m, base 1 m")
        if shape == "slender":
            name_curves(ax)
    ax = axes["limit"]
    for height in HEIGHTS:
        table = tables[f"h{height:g}"]
        ax.plot(table["prestrain"], table["load"], label=f"height {height:g} m")
    ax.set(xlabel="prestrain of the cross strings", ylabel="limit load [N]", xlim=(0, 0.47))
    ax.set_title("softer members: the limit load grows with prestrain at every height")
    name_curves(ax, at=0)
    words = "triangle up: fold, the limit load; square: bars touch; triangle down: flat"
    figure.supxlabel(f"{words}; dashed: unstable under a prescribed load", fontsize=9)
