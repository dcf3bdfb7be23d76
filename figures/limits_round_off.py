"""Round-off of elongations grows as steps to the power 1.5 at rest, 2.5 in a drifting chain."""

import numpy as np

from figures._draw import name_curves
from figures._limits import grid, prism_chain, slope
from tensegrity import METHODS
from tensegrity.engine.compiled import Compiled
from tensegrity.engine.kernel import bind
from tensegrity.scenes.dynamics import dynamics
from tensegrity.springs.kinks import TAUT

GROUP = "limits"

SITES, METHOD, DT = 4, "rkn6", 0.3
RUNS = 6  # from different states, for the root mean square
SPEED = 0.02  # m/s, of random velocities whose sum vanishes
DRIFT = 1.0  # m/s, added to all of them
STEPS = 40_000
LOOKS, LATE = 16, 100  # instants; steps from which powers are fitted
EXPECTED = {"at_rest": (0.5, 1.5), "drifting": (1.5, 2.5)}  # powers: of a random walk, see `text`


def starts(drift):
    """Velocities, (runs, sites)."""
    v = SPEED * np.random.default_rng(7).uniform(-1, 1, (RUNS, SITES))
    return v - v.mean(axis=1, keepdims=True) + drift


def energy(engine, chain, u, v):
    """Energy beside that of the drift, in extended precision, of states in either precision."""
    u, v = u.astype(engine.dtype), v.astype(engine.dtype)
    r, v = np.diff(u), v - v.mean()
    (values,) = dynamics(chain).loop_bonds.parameters
    bonds = engine.evaluate(0, values, np.ascontiguousarray(r))
    return bonds.sum() + (v**2).sum() / 2


def growth(drift, steps=STEPS):
    """Differences of double from extended precision against the number of steps."""
    chain, method = prism_chain(SITES), METHODS[METHOD]
    stops = np.unique(np.geomspace(10, steps, LOOKS).astype(int))
    bonds, found = dynamics(chain).loop_bonds, []
    engines = [Compiled.of(bonds, extended=extended) for extended in (False, True)]
    for velocity in starts(drift):
        pairs = [(np.zeros(SITES, one.dtype), velocity.astype(one.dtype)) for one in engines]
        loops = [bind(*pair, bonds, method, DT, one)
                 for one, pair in zip(engines, pairs, strict=True)]  # fmt: skip
        scale, done, rows = energy(engines[1], chain, *pairs[1]), 0, []
        for stop in stops.tolist():
            for loop in loops:
                loop.advance(stop - done)
            done = stop
            ours, theirs = (energy(engines[1], chain, *pair) for pair in pairs)
            (u, _), (exact, _) = pairs
            apart = np.abs(np.diff(u.astype(exact.dtype)) - np.diff(exact)).max()
            rows.append((abs(ours - theirs) / scale, apart / np.abs(np.diff(exact)).max()))
        found.append(np.array(rows, dtype=float))
    energies, places = np.sqrt(np.mean(np.square(found), axis=0)).T
    return {"steps": stops, "energy": energies, "elongation": places}


def data(steps=STEPS):
    """At rest as a whole, and drifting."""
    return {"at_rest": growth(0.0, steps), "drifting": growth(DRIFT, steps)}


def powers(tables, name):
    """Powers of the number of steps in the differences of energy and elongation."""
    t = tables[name]
    late = t["steps"] >= LATE
    return [slope(t["steps"][late], t[key][late]) for key in ("energy", "elongation")]


def text(tables):
    """The section of the page."""
    rows = []
    for name, table in tables.items():
        both = zip(powers(tables, name), EXPECTED[name], strict=True)
        cells = [f"{power:.1f} ({expected:g})" for power, expected in both]
        rows.append([name.replace("_", " "), *cells, f"{table['energy'][-1]:.0e}"])
    steps = tables["at_rest"]["steps"][-1]
    head = ["chain as a whole", "power of the energy (expected)",
            "power of the elongations (expected)", f"energy error after {steps} steps"]  # fmt: skip
    return (
        f"The loop in double precision against the same text in extended precision, {METHOD}, "
        f"root of the mean square over {RUNS} starts. Rounding errors are independent: the energy "
        "error grows with a power of the number of steps, and the phase, hence the elongations, "
        "with a higher one. Elongations are differences of displacements: a chain that drifts as "
        f"a whole, here at {DRIFT:g} m/s, loses digits as it moves away from its origin. Run in a "
        f"frame in which the chain stays.\n\n{grid(head, rows)}\n\n"
        "On one machine and build a run repeats to the last bit, on any number of threads and "
        "however densely it is recorded. The last digits change with the order of operations: "
        "compare runs bit for bit only on one machine and build.\n\n"
        "The stiffness of a string jumps at its natural length, where round-off would decide on "
        f"it. One that is shorter by at most {TAUT:g} of it counts as taut in what is linearised: "
        "stiffness, modes and stability of a structure and of its network, the strings that are "
        "called slack, and the corners of paths. A motion that only shortens strings at rest may "
        "cost less than that stiffness says. Forces and energies, and so motion, know no such "
        "margin."
    )


def draw(figure, tables):
    """Differences from extended precision against steps, and the powers of a random walk."""
    figure.set_size_inches(9, 4.5)
    panels = figure.subplots(1, 2)
    for axes, (name, t) in zip(panels, tables.items(), strict=True):
        steps, late = t["steps"], t["steps"] >= LATE
        for k, (key, power) in enumerate(
            zip(("energy", "elongation"), EXPECTED[name], strict=True)
        ):
            label = f"{key}: power {powers(tables, name)[k]:.2f}"
            axes.loglog(steps, t[key], f"C{k}o", ms=4, label=label)
            middle = np.exp(np.mean((np.log(t[key]) - power * np.log(steps))[late]))
            axes.loglog(steps, middle * steps**power, f"C{k}--", lw=1, label=f"dashed: {power:g}")
        axes.set_title(f"chain {name.replace('_', ' ')} as a whole")
        axes.set(xlabel="steps", ylabel="double minus extended precision, relative")
        axes.set_xlim(steps[0] / 2, 300 * steps[-1])
        name_curves(axes)
