"""With plates between its units a column of prisms carries the load of a single one.

Units share their triangles, or stand on rigid plates guided along the column, each on triangles of
its own; the top is free to tilt or rides on a guided plate.  With plates between its units a column
carries the load of one unit, whatever their number: it is the chain, except for a unit whose top
may tilt, or that buckles between its plates, as slender ones of large prestrain do.  With shared
triangles it tilts or bows at a load that falls about as the inverse square of its length; guiding
the top is equivalent to half the length.
"""

import itertools
import math

import numpy as np

from figures._draw import name_curves
from figures._files import lines, side_by_side
from tensegrity import Prism, equilibrium_path, plates

GROUP = "structures"

COUNTS = (1, 2, 3, 5, 7, 10)
SHAPES = ((0.5, 0.4), (0.7, 0.1), (1.0, 0.1), (1.5, 0.02))
STIFFNESS = {"k_base": 5.0, "k_bar": 50.0}
KINDS = {  # title: whether there are plates between units, and whether the top is guided
    "shared triangles, top free to tilt": (False, False),
    "shared triangles, top guided": (False, True),
    "plates between, top free to tilt": (True, False),
}


def lost(prism, count, between, guided, limit):
    """Load at which the uniform state loses stability below a limit [N]; nan where it does not."""
    s = prism.column(count, plates=between)
    low, up = range(3), range(s.nodes - 3, s.nodes)
    held = {"supports": plates(low, up if guided else [])}
    if not guided:
        held["loads"] = {n: (0, 0, -1 / 3) for n in up}
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


def data():
    """Load at which a column tilts or bows, over the largest load of its chain of springs."""
    rows = []
    for slenderness, prestrain in SHAPES:
        prism = Prism(1.0, slenderness, prestrain, 1.0, **STIFFNESS)
        largest = largest_of_chain(prism)
        for count, (between, guided) in itertools.product(COUNTS, KINDS.values()):
            load = lost(prism, count, between, guided, 0.999 * largest)
            rows.append({"slenderness": slenderness, "prestrain": prestrain, "units": count,
                         "plates": between, "guided": guided, "load": load, "largest": largest,
                         "share": load / largest})  # fmt: skip
    return {"columns": side_by_side(rows)}


def draw(figure, tables):
    """By the number of units; at 1 the column carries all that its chain of springs does."""
    figure.set_size_inches(9, 3.9)
    table = {key: np.array(column) for key, column in tables["columns"].items()}
    shares = np.where(np.isnan(table["share"]), 1.0, table["share"])
    for axes, (title, kind) in zip(figure.subplots(1, 3, sharey=True), KINDS.items(), strict=True):
        for k, (slenderness, prestrain) in enumerate(SHAPES):
            rows = (table["slenderness"] == slenderness) & (table["prestrain"] == prestrain)
            rows &= (table["plates"] == kind[0]) & (table["guided"] == kind[1])
            label = f"{slenderness:g} m, {prestrain:g}"
            axes.semilogy(table["units"][rows], shares[rows], "o-", ms=9 - 2 * k, label=label)
        axes.set(xlabel="units", xticks=COUNTS, title=title)
        axes.set_ylabel("load at loss of stability /\nlargest of the chain")
        axes.label_outer()
        if kind == (False, False):
            axes.text(0.04, 0.04, "at the curves:\nheight, prestrain", transform=axes.transAxes)
            name_curves(axes)


def table(tables):
    """Each column that was computed."""
    return lines(tables["columns"])
