"""Trusses that others computed, as structures of bars.

The space truss and its published numbers: A. Dutzler, TrussPy 3.0.0, example NTA-A,
doi 10.5281/zenodo.7723338; its dimensionless numbers are read here as m and N.
"""

import numpy as np
import pytest
import sympy as sp
from mpmath import mp
from scipy.optimize import root

from tensegrity import Structure, equilibrium_path, held

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


@pytest.fixture(scope="module")
def path():
    return space_truss()


def of(path, kind):
    return [e for e in path.events if e.kind == kind]


def factor(path, event):
    """The load factor at an event."""
    return event.load * moves(path)[-1, -1] / path.load[-1]


def test_two_bar_truss_snaps_through_at_the_closed_form_load():
    """P = 2 EA (1 - cos(a)^(2/3))^(3/2), where the bars' slope has fallen to cos^3 = cos(a)."""
    cosine = 1 / np.hypot(1, 2 * RISE / SPAN)
    limit = 2 * (1 - cosine ** (2 / 3)) ** 1.5
    apex = np.sqrt(cosine ** (-2 / 3) - 1) * SPAN / 2
    folds = of(two_bars(), "fold")
    assert np.allclose([e.load for e in folds], [limit, -limit], rtol=1e-14, atol=0)
    assert np.allclose([e.shortening for e in folds], [0.5 - apex, 0.5 + apex], rtol=1e-13, atol=0)
    assert np.allclose(two_bars_in_closed_form()[1], [limit, -limit], rtol=1e-14, atol=0)


def test_space_truss_passes_through_the_published_state_to_all_its_digits(path):
    _, found = states(path, 5, STATE_40[5])
    assert list(STATE_40[:5]) in found[:, :5].round(8).tolist()


def test_space_truss_carries_the_published_loads_to_all_their_digits(path):
    """On the stretch between the first two turns of node 5, where it was driven."""
    height = moves(path)[:, 4]
    first, second = (np.flatnonzero(np.diff(np.sign(np.diff(height)))) + 1)[:2]
    for increment, published in DRIVEN.items():
        rows, found = states(path, 4, driven(increment))
        ((*_, load),) = found[(first <= rows) & (rows < second)]
        assert f"{load:.4g}" == f"{float(published):.4g}"


def test_space_truss_has_the_published_limit_points(path):
    """Between the most extreme published load and the top of a parabola through three."""
    loads = [factor(path, e) for e in of(path, "fold")]
    assert len(loads) == len(EXTREMES)
    for load, (before, extreme, after) in zip(loads, EXTREMES.values(), strict=True):
        beyond = (load - extreme) * np.sign(2 * extreme - before - after)
        digit = 10.0 ** (np.floor(np.log10(abs(extreme))) - 3)
        assert -digit / 2 <= beyond <= abs(2 * extreme - before - after) / 8 + digit


def test_space_truss_snaps_back(path):
    """Load and shortening both turn."""
    kinds = [e.kind for e in path.events if e.kind in ("fold", "turn")]
    assert kinds[:8] == ["fold"] * 3 + ["turn"] + ["fold"] * 2 + ["turn", "fold"]


def test_rows_of_the_space_truss_are_equilibria_of_the_energy(path):
    stored, symbols = energy(NODES, BARS, LOADS)
    derived = sp.lambdify(symbols, [sp.diff(stored, x) for x in symbols], "numpy", cse=True)
    *x, load = moves(path).T
    for found, force in zip(derived(*x), LOADS.values(), strict=True):
        assert np.abs(found - load * force).max() < 1e-12


def test_limit_points_agree_with_thirty_digits(path):
    """Gradient and Hessian by SymPy, the extended system by mpmath."""
    stored, symbols = energy(NODES, BARS, LOADS)
    gradient = sp.Matrix([stored]).jacobian(symbols)
    force = list(LOADS.values())
    total = float(np.linalg.norm(forces(), axis=1).sum())
    with mp.workdps(30):
        evaluate = sp.lambdify(symbols, (gradient, gradient.jacobian(symbols)), "mpmath", cse=True)

        def system(*x):
            g, h = evaluate(*x[:5])
            null = mp.matrix(x[6:])
            return [
                *(g[i] - x[5] * force[i] for i in range(5)),
                *(h * null),
                mp.fdot(null, null) - 1,
            ]

        for event in of(path, "fold"):
            near = at(path, event, moves(path))
            hessian = np.array(evaluate(*near[:5])[1].tolist(), dtype=float)
            null = np.linalg.svd(hessian)[2][-1]
            exact = mp.findroot(system, [*near, *null], tol=1e-40, maxsteps=20)
            assert abs(exact[5] - factor(path, event)) <= 1e-12 * abs(exact[5])
            work = mp.fdot(force, exact[:5]) / total
            assert abs(work - event.shortening) <= 1e-12
