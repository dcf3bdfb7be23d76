"""Validity of the chain of springs: loss of stability of columns of prisms.

Units share their triangles, or stand on rigid plates guided along the column, each on triangles of
its own; the top is free to tilt or rides on a guided plate.  With plates between its units a column
carries the load of one unit, whatever their number: it is the chain, except for a unit whose top
may tilt, or that buckles between its plates, as slender ones of large prestrain do.  With shared
triangles it tilts or bows at a load that falls about as the inverse square of its length; guiding
the top is equivalent to half the length.
"""

from __future__ import annotations

import math

import numpy as np

from figures._files import lines
from tensegrity import Prism, equilibrium_path, plates

NAME = "structures_columns"
GROUP = "structures"

COUNTS = (1, 2, 3, 5, 7, 10)
SHAPES = ((0.5, 0.4), (0.7, 0.1), (1.0, 0.1), (1.5, 0.02))
UNITS = 5  # of the columns in the map
SLENDERNESS = (0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0)
PRESTRAINS = (0.01, 0.03, 0.1, 0.4)
STIFFNESS = {"k_base": 5.0, "k_bar": 50.0}
KINDS = {  # title: whether there are plates between units, and whether the top is guided
    "shared triangles, top free to tilt": (False, False),
    "shared triangles, top guided": (False, True),
    "plates between, top free to tilt": (True, False),
    "plates between, top guided": (True, True),
}


def lost(prism, count, between, guided, limit):
    """Load at which the uniform state loses stability below a limit [N]; nan where it does not."""
    s = prism.column(count, plates=between)
    low, up = range(3), range(s.nodes - 3, s.nodes)
    held = (
        {"supports": plates(low, up)}
        if guided
        else {"supports": plates(low), "loads": {n: (0, 0, -1 / 3) for n in up}}
    )
    path = equilibrium_path(s, branch="symmetric", max_load=limit, **held)
    found = [e.load for e in path.events if e.kind == "bifurcation"]
    if not found and path.load[-1] < limit * (1 - 1e-9):
        raise ValueError(f"{s}: {path.end} at {path.load[-1]:g} N, below {limit:g} N")
    return found[0] if found else math.nan


def largest_of_chain(prism):
    """Largest load that the chain of springs carries: that of one of them [N]."""
    path = equilibrium_path(prism)
    folds = [e.load for e in path.events if e.kind == "fold"]
    return folds[0] if folds else float(path.load[-1])


def data(progress=iter):
    """Load at which a column tilts or bows, over the largest load of its chain of springs."""
    cases = {"columns": [(*shape, count) for shape in SHAPES for count in COUNTS]}
    cases["map"] = [
        (height, prestrain, UNITS) for height in SLENDERNESS for prestrain in PRESTRAINS
    ]
    names = ("slenderness", "prestrain", "units", "plates", "guided", "load", "largest", "share")
    tables = {name: [] for name in cases}
    for name, case in progress([(name, case) for name, listed in cases.items() for case in listed]):
        slenderness, prestrain, count = case
        prism = Prism(1.0, slenderness, prestrain, 1.0, **STIFFNESS)
        largest = largest_of_chain(prism)
        for between, guided in KINDS.values():
            load = lost(prism, count, between, guided, 0.999 * largest)
            tables[name].append((*case, between, guided, load, largest, load / largest))
    return {
        name: dict(zip(names, map(list, zip(*rows, strict=True)), strict=True))
        for name, rows in tables.items()
    }


def draw(figure, tables):
    """Above by the number of units, below by shape; at 1 the column carries all its chain does."""
    figure.set_size_inches(13, 7)
    cells = figure.subplots(2, 4, sharex="row", sharey="row")
    tables = {
        name: {key: np.array(column) for key, column in table.items()}
        for name, table in tables.items()
    }
    for (title, kind), above, below in zip(KINDS.items(), *cells, strict=True):
        table, shares = part(tables["columns"], kind)
        for k, (slenderness, prestrain) in enumerate(SHAPES):
            rows = (table["slenderness"] == slenderness) & (table["prestrain"] == prestrain)
            above.semilogy(table["units"][rows], shares[rows], "o-", color=f"C{k}", ms=9 - 2 * k,
                           label=f"height {slenderness:g} m, prestrain {prestrain:g}")  # fmt: skip
        above.set_title(title, fontsize=10)
        above.set(xlabel="units", xticks=COUNTS)
        table, shares = part(tables["map"], kind)
        marks = below.scatter(table["slenderness"], table["prestrain"], c=np.log10(shares),
                              marker="s", s=150, vmin=-3, vmax=0, cmap="viridis")  # fmt: skip
        below.set(xscale="log", yscale="log", xlabel="slenderness, height / base")
        below.set_xticks(SLENDERNESS, [f"{x:g}" for x in SLENDERNESS])
        below.set_xticks([], minor=True)
        below.set_yticks(PRESTRAINS, [f"{x:g}" for x in PRESTRAINS])
        below.set_yticks([], minor=True)
        below.margins(0.12)
    cells[0, 0].set_ylabel("load at loss of stability /\nlargest of the chain")
    cells[0, 3].legend(fontsize=9, loc="lower left")
    cells[1, 0].set_ylabel("prestrain of the cross strings")
    bar = figure.colorbar(marks, ax=cells[1].tolist(), ticks=[-3, -2, -1, 0])
    bar.ax.set_yticklabels(["0.001", "0.01", "0.1", "1"])
    bar.set_label(f"the same ratio, {UNITS} units")


def part(table, kind):
    """Rows of a kind, and their load ratios, 1 where stability is not lost."""
    rows = (table["plates"] == kind[0]) & (table["guided"] == kind[1])
    table = {name: column[rows] for name, column in table.items()}
    return table, np.where(np.isnan(table["share"]), 1.0, table["share"])


def table(tables):
    """Each column that was computed."""
    return [line for columns in tables.values() for line in lines(columns)]
