"""The limit load of elastic prisms grows with prestrain at every height."""

from __future__ import annotations

from figures._draw import name_curves
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
    """Limit load of prisms of each height."""
    axes = figure.subplots()
    for height in HEIGHTS:
        table = tables[f"h{height:g}"]
        axes.plot(table["prestrain"], table["load"], label=f"height {height:g} m")
    axes.set(xlabel="prestrain of the cross strings", ylabel="limit load [N]", xlim=(0, 0.47))
    name_curves(axes, at=0)
