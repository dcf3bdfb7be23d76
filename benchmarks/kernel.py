"""Cost of a bond-step against the error of the force: exact laws and polynomials of them.

Rigid and elastic prisms, velocity Verlet.  Each law runs the same blow on the same chain; what
its force errs by is taken against the converged law, what its motion errs by against that law
compiled in extended precision, at the same steps.  The elastic law runs with one, two and three
iterations of its inner solve.  Then the forms of the rigid tension, the textbook's and the one
found by program, and Hertz's contact, against what their square roots and divisions alone take;
ensembles in lanes; and long chains in pieces on threads.  Printed and charted; the targets were
measured elsewhere, on a processor with vectors twice as long.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks._charts import FOLDER, charted
from benchmarks._timing import best, table
from benchmarks.chain import UNITS, machine_bound, unit_calls
from tensegrity import (
    METHODS,
    Chain,
    Polynomial,
    Potential,
    PowerLaw,
    Prism,
    ResolutionError,
    simulate,
)
from tensegrity.engine.bound import Bound
from tensegrity.engine.compiled import Compiled, evaluated, loop_of_law
from tensegrity.engine.kernel import bind
from tensegrity.engine.law import functions
from tensegrity.engine.threaded import ThreadedChain
from tensegrity.scenes.dynamics import dynamics
from tensegrity.springs.provenance import potential_of_law

SITES, STEPS, DT = 1000, 1000, 0.1
TIMED = 1000  # steps of one timed call
ERRORS = 10.0 ** -np.arange(2.0, 14.0)
ITERATIONS = (1, 2, 3)
REFERENCE = 4
MARGIN = 0.05  # of the range of a fit over what is met
FLOOR = 1e-16  # least error shown in the chart
EQUAL = 1e-11  # error of the force at which polynomial and inner solve are compared

LANED, LANES = 40, (1, 8, 64)  # sites of a chain in an ensemble, numbers of lanes
LONG = (100_000, 1_000_000)  # sites

RIGID = Prism(1.0, 0.8, 0.02, 1.0)
FAMILIES = {
    "rigid": (RIGID.potential(), 0.03),
    "elastic": (Prism(1.0, 1.0, 0.1, 1.0, 5.0, 50.0).potential(), 0.16),
}


def _with_law(spring, law):
    """The spring with another law of the same parameters."""
    return potential_of_law(
        law, spring.values, spring.length, spring.computable_domain, spring.ends
    )


def blow(chain, speed):
    return chain.at_rest(dict.fromkeys(range(4), speed))


def contestants(family):
    """{name: spring} of one family, the converged one for comparison, and the range of the run."""
    spring, speed = FAMILIES[family]
    chain = Chain(spring, SITES)
    low, high = simulate(chain, blow(chain, speed), STEPS * DT, dt=DT).elongation_range[0]
    room = MARGIN * (high - low)
    found, converged = {}, spring
    if family == "rigid":
        found["formula"] = spring
    else:
        for steps in ITERATIONS:
            found[f"{steps} iterations"] = _with_law(spring, replace(spring.law, steps=steps))
        converged = _with_law(spring, replace(spring.law, steps=REFERENCE))
    for error in ERRORS:
        try:
            fit = Polynomial(spring, low - room, high + room, error)
        except ResolutionError:
            break
        found[f"degree {fit.degree}"] = fit
    return found, converged, (low, high)


def bound_loop(engine, chain, u, v):
    return bind(u, v, dynamics(chain).loop_bonds, METHODS["verlet"], DT, engine)


def motion(spring, speed, extended=False):
    """Displacements after the run."""
    chain = Chain(spring, SITES)
    engine = loop_of_law(spring.law)
    if extended:
        engine = Compiled.of(dynamics(chain).loop_bonds, extended=True)
    dtype = np.longdouble if extended else float
    state = blow(chain, speed)
    u, v = state.u.astype(dtype), state.v.astype(dtype)
    bound_loop(engine, chain, u, v).advance(STEPS)
    return u


def measure(families=FAMILIES):
    """Rows of (family, law, ns per bond-step, error of the force, error of the motion)."""
    loops, rows = {}, []
    for family in families:
        found, converged, met = contestants(family)
        speed = FAMILIES[family][1]
        r = np.linspace(*met, 2001)
        exact = evaluated(converged.law, 1, converged.values, r)
        reference = motion(converged, speed, extended=True)
        for name, spring in found.items():
            force = evaluated(spring.law, 1, spring.values, r)
            gap = np.abs(force - exact).max() / np.abs(exact).max()
            moved = np.abs(motion(spring, speed) - reference).max() / np.abs(reference).max()
            chain = Chain(spring, SITES)
            u, v = 1e-3 * np.sin(np.arange(SITES) ** 2), np.zeros(SITES)
            loop = bound_loop(loop_of_law(spring.law), chain, u, v)
            loops[family, name] = lambda loop=loop: loop.advance(TIMED)
            rows.append((family, name, float(gap), float(moved)))
    times = best(loops)
    scale = 1e9 / (TIMED + 1) / (SITES - 1)
    return [(f, n, times[f, n] * scale, gap, moved) for f, n, gap, moved in rows]


def textbook():
    """The rigid prism's energy as one types it, by the height, differentiated by program."""
    import sympy as sp

    from benchmarks._peers import prism_values
    from derivations import rigid_elastic

    r = sp.Symbol("r")
    return Potential(rigid_elastic.potential_energy().subs(prism_values(RIGID, r)), r)


def slow_operations(law):
    """Square roots and divisions of a tension that depend on the elongation."""
    import casadi as ca

    tension = functions(law)["tension"]
    depends, roots, divisions = {}, 0, 0
    for k in range(tension.n_instructions()):
        kind, inputs = tension.instruction_id(k), tension.instruction_input(k)
        if kind == ca.OP_OUTPUT:
            continue
        found = inputs[0] == 0 if kind == ca.OP_INPUT else any(depends.get(i) for i in inputs)
        found = found and kind != ca.OP_CONST
        depends[tension.instruction_output(k)[0]] = found
        roots += found and kind in (ca.OP_SQRT, ca.OP_CONSTPOW, ca.OP_POW)
        divisions += found and kind in (ca.OP_DIV, ca.OP_INV)
    return roots, divisions


def forms():
    """{form of a tension: (ns per bond-step, ns of its square roots and divisions alone)}."""
    springs = {
        "textbook form": textbook(),
        "found by program": FAMILIES["rigid"][0],
        "Hertz": PowerLaw(1.0, 1.5, preload=0.1),
    }
    calls = unit_calls()
    for name, spring in springs.items():
        chain = Chain(spring, SITES)
        u, v = 1e-3 * np.sin(np.arange(SITES) ** 2), np.zeros(SITES)
        loop = bound_loop(loop_of_law(spring.law), chain, u, v)
        calls[name] = lambda loop=loop: loop.advance(TIMED)
    times, scale = best(calls), 1e9 / (TIMED + 1) / (SITES - 1)
    found = {}
    for name, spring in springs.items():
        roots, divisions = slow_operations(spring.law)
        least = (roots * times["roots"] + divisions * times["divisions"]) / UNITS * 1e9
        found[name] = times[name] * scale, least
    return found


def ensembles():
    """{lanes: ns per bond-step of one chain}."""
    spring, loops = FAMILIES["rigid"][0], {}
    chain = Chain(spring, LANED)
    steps = {lanes: TIMED * 64 // lanes for lanes in LANES}
    for lanes in LANES:
        u = 1e-3 * np.sin(np.arange(LANED * lanes) ** 2).reshape(LANED, lanes)
        loop = bound_loop(
            Compiled.of(dynamics(chain).loop_bonds, lanes), chain, u, np.zeros_like(u)
        )
        loops[lanes] = lambda loop=loop, lanes=lanes: loop.advance(steps[lanes])
    return {n: t * 1e9 / steps[n] / n / (LANED - 1) for n, t in best(loops).items()}


def long_chains():
    """{sites: ns per bond-step in one loop, in pieces on one thread, on two}."""
    spring, found = FAMILIES["rigid"][0], {}
    for sites in LONG:
        chain, loops = Chain(spring, sites), {}
        engine, steps = Compiled.of(dynamics(chain).loop_bonds), 1000 * LONG[0] // sites
        for threads in (0, 1, 2):
            u, v = 1e-3 * np.sin(np.arange(sites) % 1000.0), np.zeros(sites)
            parts = u, v, dynamics(chain).loop_bonds, METHODS["verlet"], DT
            pieces = ThreadedChain(engine, *parts, threads) if threads else None
            loop = pieces or Bound(engine, *parts)
            loops[threads] = lambda loop=loop, steps=steps: loop.advance(steps)
        times = best(loops)
        found[sites] = [times[n] * 1e9 / steps / (sites - 1) for n in (0, 1, 2)]
    return found


def chart(rows, folder=FOLDER):
    """Time against both errors, as PNG and CSV; the files written.

    Errors below `FLOOR`, and none at all, stand there.
    """
    names = ("family", "law", "ns_per_bond_step", "force_error", "motion_error")
    groups = {}
    for family, name, *values in rows:
        kind = "polynomial" if name.startswith("degree") else "exact law"
        label = name.removeprefix("degree ").replace(" iterations", " it.")
        groups.setdefault(f"{family}, {kind}", []).append((label, *values))
    with charted("kernel", folder, names, rows, figsize=(9, 4.2)) as (figure, written):
        left, right = figure.subplots(1, 2, sharey=True)
        for axes, column, what in ((left, 2, "tension"), (right, 3, "motion")):
            for (group, several), mark in zip(groups.items(), "os^D", strict=False):
                errors = [max(x[column], FLOOR) for x in several]
                times = [x[1] for x in several]
                axes.loglog(errors, times, mark + "-", ms=5, label=group)
                for label, *values in several:
                    at = (max(values[column - 1], FLOOR), values[0])
                    axes.annotate(label, at, (3, 4), textcoords="offset points", fontsize=6)
            axes.set_xlabel(f"largest error of the {what}, over its largest value [1]")
            axes.invert_xaxis()
        left.set_ylabel("time of a bond-step [ns]")
        right.legend(fontsize=8)
    return written


def cheapest(rows, family, start, error):
    """Least time of those laws that err by at most `error` in the force; nan where none does."""
    fitting = [t for f, n, t, gap, _ in rows if f == family and start in n and gap <= error]
    return min(fitting, default=float("nan"))


def main():
    """Print and chart times and errors, and the targets with the measured values."""
    unit = machine_bound()
    rows = measure()
    table(
        "one bond-step, velocity Verlet, 1000 prisms; best of a few, machine perhaps shared",
        ["", "ns", "force", "motion"],
        [(f"{family}, {name}", *values) for family, name, *values in rows],
    )
    bound = 2 * unit["roots"] + unit["divisions"]
    formula = cheapest(rows, "rigid", "formula", 1)
    newton = cheapest(rows, "elastic", "iterations", EQUAL)
    polynomial = cheapest(rows, "elastic", "degree", EQUAL)
    table(
        "targets",
        ["", "measured", "target"],
        [
            ("formula over machine's bound", formula / bound, "1.03"),
            ("rigid at 3.5e-12 [ns]", cheapest(rows, "rigid", "degree", 3.5e-12), "0.85"),
            ("elastic at 4e-13 [ns]", cheapest(rows, "elastic", "degree", 4e-13), "1.6"),
            ("inner solve over it at 1e-11", newton / polynomial, ">= 20"),
        ],
    )
    found = forms()
    table(
        "forms, 1000 sites, against the time of their square roots and divisions",
        ["", "ns", "bound", "of it"],
        [(name, t, least, least / t) for name, (t, least) in found.items()],
    )
    batch = ensembles()
    table(
        f"ensembles of {LANED} sites, formula: ns per bond-step of one chain",
        ["", *(f"{n} lanes" for n in batch)],
        [("", *batch.values())],
    )
    threaded = long_chains()
    table(
        "long chains, formula: ns per bond-step, one loop and pieces on threads",
        ["", "one loop", "1 thread", "2 threads", "gain"],
        [(f"{n:.0e} sites", *t, t[0] / t[2]) for n, t in threaded.items()],
    )
    table(
        "targets of forms, lanes and threads",
        ["", "measured", "target"],
        [
            *((f"{name}, of the bound", b / t, ">= 0.97") for name, (t, b) in found.items()),
            ("8 lanes over 1 lane", batch[1] / batch[8], ">= 1.37"),
            *((f"2 threads, {n:.0e} sites", t[0] / t[2], ">= 1.7") for n, t in threaded.items()),
        ],
    )
    print(*chart(rows), sep="\n")
