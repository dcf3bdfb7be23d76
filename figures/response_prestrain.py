"""A thick prism folds at a load that grows with prestrain; a slender one stiffens to contact."""

from __future__ import annotations

import numpy as np

from figures._draw import name_curves
from tensegrity import Prism, equilibrium_path

NAME = "response_prestrain"
GROUP = "response"

SHAPES = {"thick": 0.5, "slender": 1.5}  # height over base
PRESTRAINS = (0.01, 0.1, 0.4)
STIFFNESS = {"k_base": 5.0, "k_bar": 50.0}


def data(progress=iter):
    """Columns of the equilibrium path for each shape and prestrain, and its events."""
    tables = {}
    for shape, prestrain in progress([(s, p) for s in SHAPES for p in PRESTRAINS]):
        prism = Prism(1.0, SHAPES[shape], prestrain, k_cross=1.0, **STIFFNESS)
        path = equilibrium_path(prism, max_height=1.05 * prism.height)
        name = f"{shape}_p{prestrain:g}"
        tables[name] = path.columns
        tables[f"{name}_events"] = {
            "kind": [e.kind for e in path.events],
            "shortening": [e.shortening for e in path.events],
            "load": [e.load for e in path.events],
        }
    return tables


MARKS = {"fold": "^", "contact": "s", "flat": "v", "slack": "o"}


def draw(figure, tables):
    """Two panels; states unstable under a prescribed load are dashed, events are marked."""
    figure.set_size_inches(9, 4.5)
    axes = figure.subplots(1, len(SHAPES))
    for ax, shape in zip(axes, SHAPES, strict=True):
        shown = set()
        for index, prestrain in enumerate(PRESTRAINS):
            name = f"{shape}_p{prestrain:g}"
            table, events = tables[name], tables[f"{name}_events"]
            x, y, stable = table["shortening"], table["load"], np.array(table["stable_load"])
            ax.plot(x, y, f"C{index}--", lw=0.9, label=f"prestrain {prestrain:g}")
            ax.plot(x, np.where(stable, y, np.nan), f"C{index}", lw=1.7)
            for kind, at, load in zip(*events.values(), strict=True):
                ax.plot(at, load, MARKS[kind], color=f"C{index}", ms=5)
                if kind not in shown:
                    ax.annotate(kind, (at, load), (-4, 6), textcoords="offset points", ha="right")
                    shown.add(kind)
        ax.axhline(0, color="0.7", lw=0.8)
        ax.set_title(f"{shape}: height {SHAPES[shape]:g} m, base 1 m", fontsize=10)
        ax.set(xlabel="shortening [m]", ylabel="axial load [N], compression > 0")
        name_curves(ax)
