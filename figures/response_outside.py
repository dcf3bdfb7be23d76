"""Snap-through and snap-back of two trusses, against a closed form and published results.

The space truss and its published numbers: A. Dutzler, TrussPy 3.0.0, example NTA-A,
doi 10.5281/zenodo.7723338; its dimensionless numbers are read here as m and N.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import root

from tensegrity import Structure, equilibrium_path, held

NAME = "response_outside"
GROUP = "response"

SPAN, RISE = 2.0, 0.5  # of the two-bar truss [m]; its bars have EA = 1 N
# Load factors of the space truss as printed in its log, by increment, while node 5 is driven
# by 0.2 a time along z; and the state printed in full (x4, y4, z4, x5, z5, factor).
DRIVEN = {
    31: "-0.002605", 32: "-0.007209", 33: "-0.007957", 34: "-0.007684", 35: "-0.00704",
    36: "-0.006232", 37: "-0.005353", 38: "-0.004449", 39: "-0.003552", 40: "-0.00268",
    41: "-0.00185", 42: "-0.001071", 43: "-0.0003526", 44: "0.0002988", 45: "0.0008773",
    46: "0.001377", 47: "0.001792", 48: "0.002117", 49: "0.002344", 50: "0.002465",
    51: "0.002471", 52: "0.00235", 53: "0.002089", 54: "0.001672", 55: "0.001077",
    56: "0.0002772", 57: "-0.0007688",
}  # fmt: skip
STATE_40 = (-0.03645592, 1.22726375, -1.62247931, -1.1481524, -3.20556769, -0.0026801842402347288)
# Around each limit point: the increment of the most extreme factor and its neighbours.
EXTREMES = {
    12: (0.005587, 0.005657, 0.005609), 25: (-0.0004997, -0.0006199, 4.273e-05),
    29: (0.004758, 0.006282, 0.005208), 33: (-0.007209, -0.007957, -0.007684),
    51: (0.002465, 0.002471, 0.00235), 68: (-0.008106, -0.008151, -0.008081),
    80: (7.467e-05, 0.0002458, 0.0001765), 114: (-0.06394, -0.06545, -0.0651),
    128: (0.03318, 0.03358, 0.03075), 146: (-0.03452, -0.03456, -0.03433),
}  # fmt: skip


def energy(nodes, bars, free):
    """Energy [J] of linear elastic bars in the free displacements, as a SymPy expression.

    Parameters
    ----------
    nodes : sequence of (x, y, z)
        Positions at rest [m].
    bars : dict of (int, int) to float
        Axial stiffness EA [N] of the bar between two nodes, counted from 1.
    free : sequence of str
        Such as "z4": the displacement of node 4 along z [m].

    Returns
    -------
    tuple of (sympy.Expr, list of sympy.Symbol)
    """
    import sympy as sp

    moves = {name: sp.Symbol(name, real=True) for name in free}
    rest = [sp.Matrix([sp.Rational(x) for x in node]) for node in nodes]
    now = [
        point + sp.Matrix([moves.get(f"{axis}{number}", 0) for axis in "xyz"])
        for number, point in enumerate(rest, start=1)
    ]
    total = 0
    for (i, j), stiffness in bars.items():
        length, natural = (
            sp.sqrt((p[j - 1] - p[i - 1]).dot(p[j - 1] - p[i - 1])) for p in (now, rest)
        )
        total += sp.Rational(stiffness) * (length - natural) ** 2 / (2 * natural)
    return total, list(moves.values())


def truss(nodes, bars):
    """A structure of bars whose axial stiffnesses EA are given."""
    ends = np.array(list(bars)) - 1
    lengths = np.linalg.norm(np.diff(np.array(nodes)[ends], axis=1)[:, 0], axis=1)
    return Structure(nodes, bars=ends, k_bar=np.array(list(bars.values())) / lengths)


ARCH = ((-SPAN / 2, 0, 0), (SPAN / 2, 0, 0), (0, 0, RISE))
ARCH_BARS = {(1, 3): 1, (2, 3): 1}


def two_bars():
    """The inclined two-bar truss, pushed down at its apex through the flat state."""
    supports = held([0, 1]) + held([2], axes=[0, 1])
    loads = {2: (0, 0, -1)}
    return equilibrium_path(
        truss(ARCH, ARCH_BARS), supports=supports, loads=loads, max_shortening=2.4 * RISE
    )


def two_bars_in_closed_form():
    """Apex displacements and loads at which the second derivative of the energy vanishes."""
    import sympy as sp

    stored, (z,) = energy(ARCH, ARCH_BARS, ("z3",))
    places = sorted(sp.solve(sp.diff(stored, z, 2), z), reverse=True)
    return [float(x) for x in places], [float(-sp.diff(stored, z).subs(z, x)) for x in places]


NODES = ((2.5, 0, 0), (-1.25, 1.25, 0), (1, 2, 0), (-0.5, 1.5, 1.5), (-2.5, 4.5, 2.5))
BARS = {(1, 4): 0.75, (2, 4): 1, (3, 4): 0.5, (3, 5): 0.75, (2, 5): 1, (4, 5): 1}
END = 3.5  # shortening [m]
LOADS = {"x4": 1, "y4": 1, "z4": -1, "x5": -2, "z5": -2}


FREE = [(int(name[1]) - 1, "xyz".index(name[0])) for name in LOADS]  # node and axis of each


def driven(increment):
    """Displacement of node 5 along z at an increment of `DRIVEN` [m]."""
    return STATE_40[4] + 0.2 * (increment - 40)


def forces():
    """The loads at factor 1 as an array [N], (nodes, 3)."""
    result = np.zeros((len(NODES), 3))
    result[tuple(zip(*FREE, strict=True))] = list(LOADS.values())
    return result


def space_truss():
    """The space truss NTA-A beyond its last limit point."""
    return equilibrium_path(
        truss(NODES, BARS),
        supports=held([0, 1, 2]) + held([4], axes=[1]),
        loads={node: force for node, force in enumerate(forces().tolist()) if any(force)},
        branch="symmetric",
        max_shortening=END,
    )


def moves(path):
    """Displacements in the order of `LOADS`, and the factor, (rows, 6)."""
    places = tuple(zip(*FREE, strict=True))
    moved = (path.positions - path.structure.positions)[:, *places]
    return np.column_stack([moved, path.load / np.linalg.norm(forces(), axis=1).sum()])


def states(path, number, value):
    """Rows before equilibria in which one of `moves` has a value, and these, (count, 6)."""
    s, rows = path.structure, moves(path)
    places = tuple(zip(*FREE, strict=True))

    def left(unknowns):
        x = s.positions.copy()
        x[places] += unknowns[:-1]
        force = s.members.gradient(x) - unknowns[-1] * forces()
        return np.append(force[places], unknowns[number] - value)

    before = np.flatnonzero(np.diff(rows[:, number] > value))
    return before, np.array([root(left, rows[row], tol=1e-13).x for row in before])


def at(path, event, columns):
    """Values of columns (rows, count) at an event, between the rows next to it."""
    row, x = event.row, path.shortening
    part = (event.shortening - x[row]) / (x[row + 1] - x[row])
    return columns[row] + part * (columns[row + 1] - columns[row])


def data(progress=iter):
    """Both curves, their closed form or published points, and their limit points."""
    tables = {}
    for followed in progress((two_bars, space_truss)):
        path, name = followed(), followed.__name__
        if name == "two_bars":
            names, columns = ("z3", "factor"), np.column_stack([-path.shortening, path.load])
        else:
            names, columns = (*LOADS, "factor"), moves(path)
        folds = [at(path, e, columns) for e in path.events if e.kind == "fold"]
        tables[name] = dict(zip(names, columns.T, strict=True))
        tables[f"{name}_limits"] = dict(zip(names, np.transpose(folds), strict=True))
        loads = [e.load for e in path.events if e.kind == "fold"]
        tables[f"{name}_limits"]["factor"] = np.array(loads) * columns[-1, -1] / path.load[-1]
    places, loads = two_bars_in_closed_form()
    tables["two_bars_limits"] |= {"closed_form_z3": places, "closed_form": loads}
    tables["space_truss_limits"]["published"] = [extreme for _, extreme, _ in EXTREMES.values()]
    tables["space_truss_published"] = {
        "z5": [driven(increment) for increment in DRIVEN],
        "factor": [float(factor) for factor in DRIVEN.values()],
    }
    return tables


def draw(figure, tables):
    """Load against displacement of both trusses; published numbers as open marks."""
    left, right = figure.subplots(1, 2, width_ratios=(1, 1.8))
    curve, limits = tables["two_bars"], tables["two_bars_limits"]
    left.plot([-z for z in curve["z3"]], curve["factor"], label="computed")
    left.plot([-z for z in limits["closed_form_z3"]], limits["closed_form"], "o", mfc="none",
              color="C3", label="limit load in\nclosed form")  # fmt: skip
    left.set(xlabel="apex displacement, down [m]", ylabel="load [N]")
    left.set_title("two bars", fontsize=10)
    curve, limits = tables["space_truss"], tables["space_truss_limits"]
    published = tables["space_truss_published"]
    right.plot(curve["z5"], curve["factor"], label="computed")
    right.plot(published["z5"], published["factor"], "o", mfc="none", color="C3", ms=4,
               label="published, node 5 driven")  # fmt: skip
    right.plot(limits["z5"], limits["published"], "_", color="C1", ms=14, mew=1.8,
               label="published extreme\nat each limit point")  # fmt: skip
    right.set(xlabel="displacement of node 5 along z [m]", ylabel="load factor [1]")
    right.set_title("space truss of six bars, TrussPy example NTA-A", fontsize=10)
    for ax, side in ((left, "left"), (right, "right")):
        ax.axhline(0, color="0.7", lw=0.8)
        ax.legend(fontsize=8, loc=f"upper {side}")
