"""Cost of a bond-step of the compiled loop, against NumPy and Numba doing the same arithmetic.

The rivals run velocity Verlet on the same chain with the same expression of the tension,
turned into Python by SymPy's `lambdify` with common subexpressions kept.  The machine's own
bound, what its square roots and divisions take, is measured in the same run.
"""

from __future__ import annotations

import ctypes
import warnings

import numpy as np

from benchmarks._timing import best, table
from tensegrity import METHODS, Chain, Prism, simulate
from tensegrity.engine import native
from tensegrity.engine.kernel import bind
from tensegrity.precision.peers import numba_loop
from tensegrity.prisms.closed import rigid_law
from tensegrity.scenes.dynamics import dynamics

SIZES = (100, 1_000, 100_000, 1_000_000)
WORK = 4_000_000  # bond-steps per timed call
DT = 0.05

UNIT = """
#include <math.h>
#define N 512
static double x[N], y[N];
void roots(long long n)
{
    for (int i = 0; i < N; i++) x[i] = 1 + 0.01 * i;
    for (long long k = 0; k < n; k++) {
        for (int i = 0; i < N; i++) y[i] = sqrt(x[i]);
        __asm__ volatile("" ::"r"(y) : "memory");
    }
}
void divisions(long long n)
{
    for (int i = 0; i < N; i++) x[i] = 1 + 0.01 * i;
    for (long long k = 0; k < n; k++) {
        for (int i = 0; i < N; i++) y[i] = 1.1 / x[i];
        __asm__ volatile("" ::"r"(y) : "memory");
    }
}
"""


UNITS = 2_000 * 512  # operations of one call, short enough to run undisturbed


def unit_calls():
    """Calls that perform only square roots, or only divisions."""
    unit, calls = native.library(UNIT), {}
    for name in ("roots", "divisions"):
        function = getattr(unit, name)
        function.argtypes = [ctypes.c_longlong]
        calls[name] = lambda function=function: function(UNITS // 512)
    return calls


def machine_bound():
    """Nanoseconds of a square root and of a division by themselves."""
    return {name: t / UNITS * 1e9 for name, t in best(unit_calls()).items()}


def rival_force(modules):
    """The tension with its `through` quantities inserted, as one Python function of (r, p...)."""
    import sympy as sp

    law = rigid_law()
    expression = law.tension.subs({symbol: value for symbol, value, _ in law.through})
    return sp.lambdify((law.elongation, *law.parameters), expression, modules, cse=True)


def _numpy_rival(spring, u, v, steps):
    force, p = rival_force("numpy"), spring.values.tolist()

    def run():
        edges = np.zeros(len(u) + 1)
        edges[1:-1] = force(np.diff(u), *p)
        for _ in range(steps):
            v[:] += DT / 2 * np.diff(edges)
            u[:] += DT * v
            edges[1:-1] = force(np.diff(u), *p)
            v[:] += DT / 2 * np.diff(edges)

    return run


def _numba_rival(spring, u, v, steps, **options):
    loop, p = numba_loop(rival_force("math"), **options), tuple(spring.values)
    return lambda: loop(u, v, steps, p, DT)


def _ours(chain, u, v, steps):
    bound = bind(u, v, dynamics(chain).loop_bonds, METHODS["verlet"], DT)
    return lambda: bound.advance(steps)


def _start(sites):
    rng = np.random.default_rng(0)
    return 1e-3 * rng.standard_normal(sites), np.zeros(sites)


def rivals(sites):
    """All contestants on a chain of that many sites, and the bond-steps of one call of each."""
    spring = Prism(1.0, 0.8, 0.02, 1.0).potential()
    chain = Chain(spring, sites)
    steps = max(40, WORK // sites)  # the closing kick of a call costs a stage
    calls = {"compiled": _ours(chain, *_start(sites), steps)}
    work = {"compiled": steps * (sites - 1)}
    slow = max(3, steps // 20)
    calls["numpy"] = _numpy_rival(spring, *_start(sites), slow)
    work["numpy"] = slow * (sites - 1)
    try:
        import numba  # noqa: F401
    except ImportError:
        warnings.warn("numba is not installed: pip install '.[bench]'", stacklevel=2)
    else:
        calls["numba"] = _numba_rival(spring, *_start(sites), steps)
        calls["numba, error_model numpy"] = _numba_rival(
            spring, *_start(sites), steps, error_model="numpy"
        )
        work |= dict.fromkeys(("numba", "numba, error_model numpy"), steps * (sites - 1))
    return calls, work


def overheads():
    """Seconds of one call of the prepared loop, and of a whole `simulate` of one step."""
    chain = Chain(Prism(1.0, 0.8, 0.02, 1.0).potential(), 2)
    u, v = np.zeros(2), np.zeros(2)
    prepared = _ours(chain, u, v, 1)
    state = chain.at_rest({0: 0.001})
    times = best(
        {
            "call": lambda: [prepared() for _ in range(1000)],
            "simulate": lambda: [simulate(chain, state, DT, dt=DT) for _ in range(10)],
        }
    )
    return times["call"] / 1000, times["simulate"] / 10


def main():
    """Print nanoseconds per bond-step, the ratios, and the targets with the measured values."""
    unit = machine_bound()
    bound = 2 * unit["roots"] + unit["divisions"]
    cost = {}
    for sites in SIZES:
        calls, work = rivals(sites)
        cost[sites] = {n: t / work[n] * 1e9 for n, t in best(calls).items()}
    names = list(cost[1_000])
    rows = [(n, *(cost[s].get(n, "-") for s in SIZES)) for n in names]
    table("ns per bond-step, velocity Verlet, rigid-elastic prisms", ["", *map(str, SIZES)], rows)
    rows = [
        (n, *((cost[s][n] / cost[s]["compiled"]) if n in cost[s] else "-" for s in SIZES))
        for n in names
    ]
    table("times the compiled loop", ["", *map(str, SIZES)], rows)
    table(
        "bound of this machine [ns]",
        ["square root", "division", "2 + 1"],
        [("", unit["roots"], unit["divisions"], bound)],
    )
    at = cost[1_000]
    call, whole = overheads()
    missing = "numba missing"
    targets = [
        ("4 x plain numba", at.get("numba", np.nan) / at["compiled"], ">= 4"),
        ("12 x numpy", at["numpy"] / at["compiled"], ">= 12"),
        ("expert numba", at.get("numba, error_model numpy", np.nan) / at["compiled"], ">= 1"),
        ("over the machine's bound", at["compiled"] / bound, "<= 1.15"),
        ("1e6 sites over 1e3", cost[1_000_000]["compiled"] / at["compiled"], "<= 1.15"),
        ("call of the loop [us]", call * 1e6, "<= 2"),
        ("simulate, one step [us]", whole * 1e6, "-"),
    ]
    if "numba" not in at:
        print(missing)
    table("targets at 1000 sites", ["", "measured", "target"], targets)
