"""When is the chain of springs enough?  Where columns of prisms with shared triangles give way."""

from __future__ import annotations

import math

import numpy as np

from tensegrity import Prism, column, equilibrium_path, plates

NAME = "structures_columns"
GROUP = "structures"

COUNTS = (1, 2, 3, 5, 7, 10)
SHAPES = ((0.5, 0.4), (0.7, 0.1), (1.0, 0.1), (1.5, 0.02))
STIFFNESS = {"k_base": 5.0, "k_bar": 50.0}


def lost(prism, count, guided, limit):
    """Load at which the uniform state loses stability below a limit [N]; nan where it does not."""
    s = column(prism, count)
    low, up = range(3), range(s.nodes - 3, s.nodes)
    held = (
        {"supports": plates(low, up)}
        if guided
        else {"supports": plates(low), "loads": {n: (0, 0, -1 / 3) for n in up}}
    )
    path = equilibrium_path(s, branch="symmetric", max_load=limit, **held)
    found = [e.load for e in path.events if e.kind == "bifurcation"]
    return found[0] if found else math.nan


def data(progress=iter):
    """Load where a column tilts or bows, over the largest of its chain of springs."""
    rows = []
    for slenderness, prestrain in progress(SHAPES):
        prism = Prism(1.0, slenderness, prestrain, 1.0, **STIFFNESS)
        path = equilibrium_path(prism)
        folds = [e.load for e in path.events if e.kind == "fold"]
        largest = folds[0] if folds else float(path.load[-1])
        for count in COUNTS:
            for guided in (False, True):
                load = lost(prism, count, guided, 0.999 * largest)
                rows.append((slenderness, prestrain, count, guided, load, largest, load / largest))
    names = ("slenderness", "prestrain", "units", "guided", "load", "largest", "share")
    return {"columns": dict(zip(names, map(list, zip(*rows, strict=True)), strict=True))}


def draw(figure, tables):
    """One line a shape and support; at 1 the column carries all that its chain does."""
    table = {name: np.array(column) for name, column in tables["columns"].items()}
    for number, (axes, guided) in enumerate(
        zip(figure.subplots(1, 2, sharey=True), (False, True), strict=True)
    ):
        for k, (slenderness, prestrain) in enumerate(SHAPES):
            rows = (table["slenderness"] == slenderness) & (table["guided"] == guided)
            rows &= table["prestrain"] == prestrain
            share = np.where(np.isnan(table["share"][rows]), 1.0, table["share"][rows])
            axes.semilogy(table["units"][rows], share, "o-", color=f"C{k}",
                          label=f"height {slenderness:g} m, prestrain {prestrain:g}")  # fmt: skip
        axes.set(xlabel="units", title=("top free to tilt", "top on a guided plate")[number])
        axes.set_xticks(COUNTS)
        if number == 0:
            axes.set_ylabel("load at loss of stability / largest of the chain")
            axes.legend(fontsize=8)


def table(tables):
    """Each column of the map."""
    columns = tables["columns"]
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
