"""Limit load of elastic prisms against prestrain, by continuation of the fold in two parameters."""

from __future__ import annotations

from tensegrity import Prism
from tensegrity.prisms.fold_curve import limit_load

NAME = "response_limit_load"
GROUP = "response"

HEIGHTS = (0.3, 0.4, 0.5, 0.6)
PRESTRAINS = (0.4, 1e-3)
STIFFNESS = {"k_base": 2.0, "k_bar": 20.0}


def data(progress=iter):
    """Columns of the limit curve of each height."""
    return {
        f"h{height:g}": limit_load(
            Prism(1.0, height, PRESTRAINS[0], k_cross=1.0, **STIFFNESS), PRESTRAINS[1]
        ).columns
        for height in progress(HEIGHTS)
    }


def draw(figure, tables):
    """Limit load, and the height at which it is reached."""
    load_axes, height_axes = figure.subplots(1, 2)
    for height in HEIGHTS:
        table = tables[f"h{height:g}"]
        load_axes.plot(table["prestrain"], table["load"])
        height_axes.plot(table["prestrain"], table["height"] / height, label=f"height {height:g} m")
    load_axes.set(xlabel="prestrain of the cross strings", ylabel="limit load [N]")
    height_axes.set(
        xlabel="prestrain of the cross strings", ylabel="height at the limit / reference height"
    )
    height_axes.legend(fontsize=8, title="base 1 m, k_base 2, k_bar 20 N/m", title_fontsize=8)
