"""A whole force-displacement curve with its fold, against AUTO-07p and plain loops.

The prism that collapses flat, from its reference down to a low height.  Every method gives rows
(height, load); one cubic spline through them is compared with the potential on a fine grid of
heights, so that a method may take as few points as its curve needs.  Each is run over a range of
its own step control: time against interpolated error, printed and charted.  AUTO-07p gets its
equations and their Jacobian as Fortran written from the same energy; it runs where `auto-07p`
and gfortran are found.
"""

from __future__ import annotations

import contextlib
import shutil
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

from benchmarks import _auto
from benchmarks._charts import FOLDER, charted
from benchmarks._timing import least, record
from tensegrity import Prism, equilibrium_paths
from tensegrity.branches.continuation import Settings
from tensegrity.branches.problem import trace
from tensegrity.engine.threaded import processors
from tensegrity.prisms.equations import numbers, problem

PRISM = Prism(1.0, 0.5, 0.4, 1.0, 2.0, 20.0)
LOWEST = 0.05
TOLERANCES = 10.0 ** -np.arange(4.0, 13.0)
STEPS = (0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002)
EQUAL = 1e-7  # interpolated error, relative to the largest load, at which times are compared
ROUNDS = 25
MANY = 1000  # prisms in one call


def error(height, load):
    """Largest error of a cubic spline through the rows, over the largest load."""
    from scipy.interpolate import CubicSpline

    order = np.argsort(height)
    height, load = np.asarray(height)[order], np.asarray(load)[order]
    kept = np.concatenate([[True], np.diff(height) > 0])
    dense = np.linspace(LOWEST, PRISM.height, 4001)
    exact = -PRISM.potential().tension(dense - PRISM.height)
    return np.abs(CubicSpline(height[kept], load[kept])(dense) - exact).max() / exact.max()


def ours(tolerance):
    p = numbers(PRISM, LOWEST)
    settings = Settings(tolerance=tolerance)
    branch = trace(problem(), np.zeros(4), p, settings, direction=-1, stop=("height",))
    return branch.height, branch.load


# --- plain loops in (l, phi, h, load): tangent predictor, fixed steps ------------------------


def _plain():
    """Gradient of U(l, phi, h) plus load, and its Jacobian, as SymPy expressions of numbers."""
    import sympy as sp

    from derivations import prism as derived

    load = sp.Symbol("F")
    unknowns = (derived.base, derived.twist, derived.height, load)
    cross, base, bar = PRISM.natural_lengths()
    energy = derived.energy().subs(
        {
            derived.k_cross: PRISM.k_cross, derived.k_base: PRISM.k_base,
            derived.k_bar: PRISM.k_bar, derived.natural_cross: cross,
            derived.natural_base: base, derived.natural_bar: bar,
        }
    )  # fmt: skip
    gradient = sp.Matrix([sp.diff(energy, x) for x in unknowns[:3]]) + sp.Matrix([0, 0, load])
    return unknowns, gradient, gradient.jacobian(unknowns)


START = np.array([PRISM.base, 5 * np.pi / 6, PRISM.height, 0.0])


def scipy_loop(equations, step):
    """One call of scipy.optimize.root a point, exact Jacobian."""
    from scipy.optimize import root

    g, jacobian = equations
    z, tangent = START, np.array([0.0, 0.0, -1.0, 0.0])
    rows = [z]
    while z[2] > LOWEST:
        matrix = np.vstack([jacobian(*z), tangent])
        tangent = np.linalg.solve(matrix, [0, 0, 0, 1])
        tangent /= np.linalg.norm(tangent)
        guess = z + step * tangent
        z = root(
            lambda x, t=tangent, y=guess: np.append(g(*x), t @ (x - y)), guess,
            jac=lambda x, t=tangent: np.vstack([jacobian(*x), t]), tol=1e-12,
        ).x  # fmt: skip
        rows.append(z)
    rows = np.array(rows)
    return rows[:, 2], rows[:, 3]


def casadi_loop(functions, step):
    """Newton in NumPy, residual and Jacobian from CasADi's machine by ordinary calls."""
    z, tangent = START, np.array([0.0, 0.0, -1.0, 0.0])
    rows = [z]
    while z[2] > LOWEST:
        matrix = np.vstack([np.array(functions(z)[1]), tangent])
        tangent = np.linalg.solve(matrix, [0, 0, 0, 1])
        tangent /= np.linalg.norm(tangent)
        guess = z = z + step * tangent
        for _ in range(10):
            g, jacobian = (np.array(x) for x in functions(z))
            system = np.append(g.ravel(), tangent @ (z - guess))
            move = np.linalg.solve(np.vstack([jacobian, tangent]), system)
            z = z - move
            if np.abs(move).max() < 1e-12:
                break
        rows.append(z)
    rows = np.array(rows)
    return rows[:, 2], rows[:, 3]


def plain_functions():
    import casadi as ca
    import sympy as sp

    from tensegrity.engine.law import to_casadi

    unknowns, gradient, jacobian = _plain()
    g = sp.lambdify(unknowns, list(gradient), "math", cse=True)
    dg = sp.lambdify(unknowns, jacobian.tolist(), "math", cse=True)
    z = ca.SX.sym("z", 4)
    residual = ca.vertcat(*to_casadi(list(gradient), unknowns)(*ca.vertsplit(z)))
    vm = ca.Function("plain", [z], [residual, ca.jacobian(residual, z)])
    return (lambda *x: np.array(g(*x)), lambda *x: np.array(dg(*x))), vm


# --- the comparison --------------------------------------------------------------------------


def many(count=MANY):
    """{workers: CPU seconds here, wall seconds} of a path with stability, in one call for many
    prisms: here alone, and by a pool of processes."""
    prisms = [Prism(1.0, 0.5, 0.4, 1.0, 2.0 + k / count, 20.0) for k in range(count)]
    found = {}
    for workers in sorted({1, processors()}):
        with contextlib.ExitStack() as stack:
            pool = workers > 1 and stack.enter_context(ProcessPoolExecutor(workers))
            equilibrium_paths(prisms[:99], executor=pool or None)
            for _ in range(3):
                spent, began = time.process_time(), time.perf_counter()
                equilibrium_paths(prisms, executor=pool or None)
                now = (time.process_time() - spent) / count, (time.perf_counter() - began) / count
                found[workers] = tuple(map(min, now, found.get(workers, now)))
    return found


def at_equal_error(rows):
    """Shortest time with an error of at most `EQUAL`; nan where none is that good."""
    return min((row[3] for row in rows if row[2] <= EQUAL), default=float("nan"))


def measure():
    """{method: rows of (setting, points, interpolated error, seconds)}."""
    scipy_functions, vm = plain_functions()
    loops = {
        "this": (ours, TOLERANCES),
        "casadi machine + numpy": (lambda step: casadi_loop(vm, step), STEPS),
        "scipy root": (lambda step: scipy_loop(scipy_functions, step), STEPS),
    }
    found = {}
    for name, (method, settings) in loops.items():
        found[name] = []
        method(settings[0])
        for setting in settings:
            seconds, rows = least(lambda m=method, s=setting: m(s), ROUNDS if name == "this" else 2)
            found[name].append((setting, len(rows[0]), error(*rows), seconds))
    if shutil.which("auto-07p") and shutil.which("gfortran"):
        with tempfile.TemporaryDirectory() as folder:
            program = _auto.build(Path(folder), START, *_plain())
            found["auto-07p inside"], found["auto-07p process"] = [], []
            for setting in STEPS:
                runs = [_auto.run(program, setting, LOWEST) for _ in range(7)]
                rows = runs[-1][0]
                for name, k in (("auto-07p inside", 1), ("auto-07p process", 2)):
                    seconds = min(run[k] for run in runs)
                    found[name].append((setting, len(rows[0]), error(*rows), seconds))
    return found


def chart(found, folder=FOLDER):
    """Time against interpolated error of every method, as PNG and CSV; the files written."""
    rows = [(name, *row) for name, several in found.items() for row in several]
    names = ("method", "setting", "points", "relative_error", "seconds")
    with charted("continuation", folder, names, rows) as (figure, written):
        axes = figure.subplots()
        for (name, several), mark in zip(found.items(), "os^Dv", strict=False):
            _, _, errors, seconds = zip(*several, strict=True)
            axes.loglog(errors, [1e3 * s for s in seconds], mark + "-", ms=5, label=name)
        axes.set(
            xlabel="largest error of the interpolated curve, over the largest load [1]",
            ylabel="time of a curve with its fold [ms]",
        )
        axes.invert_xaxis()
        axes.legend(fontsize=8)
    return written


def main():
    """Print and chart time and interpolated error of every method, and times at equal error."""
    found = measure()
    print(
        "one curve with its fold; time is the best of a few runs, on a machine that may be shared"
    )
    for name, rows in found.items():
        print(f"\n{name}\n{'setting':>10}{'points':>8}{'error':>10}{'ms':>9}{'us/point':>10}")
        for setting, points, wrong, seconds in rows:
            each = seconds / points * 1e6
            print(f"{setting:10.1e}{points:8d}{wrong:10.1e}{seconds * 1e3:9.3f}{each:10.1f}")
    mine = at_equal_error(found["this"])
    print(f"\nat an interpolated error of at most {EQUAL:g} of the largest load")
    for name, rows in found.items():
        seconds = at_equal_error(rows)
        record("equal error", name, "this over it", mine, seconds)
        print(f"{name:>24}: {seconds * 1e3:8.3f} ms, {seconds / mine:6.2f} times this")
    if "auto-07p inside" not in found:
        print("auto-07p: not measured, it needs the programs auto-07p and gfortran")
    for workers, (spent, wall) in many().items():
        print(
            f"{MANY} prisms in one call, {workers} process(es), with stability: "
            f"{spent * 1e3:.3f} ms CPU here, {wall * 1e3:.3f} ms wall a path"
        )
    print(*chart(found), sep="\n")
