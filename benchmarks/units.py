"""Pair laws over springs: time per bond of the loop, and of gradients of both ends.

A row of rotating units, whose bonds have sines and cosines of two angles, over plane springs in a
network of as many bonds; and the gradient of a law that is told of both ends, over the same law
written in differences, whose coordinates are free.  At last 120 struck units to t = 300, at equal
error, beside a loop in numba of the same energy and method.  CPU times of whole calls, least of
several rounds in one run.
"""

from __future__ import annotations

import numpy as np

from benchmarks._peers import has
from benchmarks._timing import cpu, table
from tensegrity import (
    METHODS,
    Chain,
    Network,
    PairLaw,
    Potential,
    Record,
    State,
    TensegrityError,
    gradient,
    objective,
    simulate,
)

SITES, T_END, DT = 400, 400.0, 0.05
STRUCK, SPEED, UNTIL, FAR = 120, 0.2, 300.0, slice(60, None)  # units, of the first; t; that count
TILT, INERTIA = 0.35, 1 / (4 * 1.815**2)
ERRORS = (1e-4, 1e-7)  # of rotations of units far from the struck one, which are not chaotic
FEWEST, MORE = 300, 1.4  # steps, and factor to the next number of them


def laws():
    """The unit with and without its site energy; Kresling creases, and these with a trace of an
    energy of both ends that makes the twist no free coordinate."""
    import sympy as sp

    (u, a), (v, b) = first, second = sp.symbols("u a"), sp.symbols("v b")
    tilt = 0.35
    arm = 1 / (2 * sp.cos(tilt))
    along = v - u + arm * (2 * sp.cos(tilt) - sp.cos(tilt + a) - sp.cos(tilt + b))
    across = arm * (sp.sin(tilt + b) - sp.sin(tilt + a))
    k = sp.Symbol("k")
    unit = along**2 / 2 + k * across**2 / 2 + 3.8e-5 * (a + b) ** 2 / 2
    creases = sum(
        3 * (sp.sqrt((1.8 + v - u) ** 2 + 4 * sp.sin((0.7 + b - a + s) / 2) ** 2)
             - sp.sqrt(1.8**2 + 4 * sp.sin((0.7 + sp.Integer(0) + s) / 2) ** 2)) ** 2
        for s in (0.5, -0.5)
    )  # fmt: skip
    given = {"k": 0.0185}
    return {
        "rotating unit": PairLaw(unit, first, second, given),
        "rotating unit, site": PairLaw(unit, first, second, given, site=7.7e-5 * a**2),
        "differences": PairLaw(k * creases, first, second, {"k": 1.0}),
        "both ends": PairLaw(k * creases + 1e-9 * a * b, first, second, {"k": 1.0}),
    }


def rotating():
    """Energies of a bond and of a site of rotating units, and their coordinates."""
    import sympy as sp

    (u, a), (v, b) = first, second = sp.symbols("u a"), sp.symbols("v b")
    arm = 1 / (2 * sp.cos(TILT))
    along = v - u + arm * (2 * sp.cos(TILT) - sp.cos(TILT + a) - sp.cos(TILT + b))
    across = arm * (sp.sin(TILT + b) - sp.sin(TILT + a))
    energy = along**2 / 2 + 0.01851 * across**2 / 2 + 3.835e-5 * (a + b) ** 2 / 2
    return energy, first, second, 2 * 3.835e-5 * a**2


def in_numba(energy, first, second, site):
    """The loop of a splitting in numba, on u and v in place."""
    import numba
    import sympy as sp

    (u, a), (v, b) = first, second
    r, compile_ = sp.Symbol("r"), numba.njit(error_model="numpy")
    bond = energy.subs(v, u + r)
    slopes = [bond.diff(x) for x in (r, a, b)]
    bond = compile_(sp.lambdify((r, a, b), slopes, "math", cse=True))
    own = compile_(sp.lambdify(a, sp.sympify(site).diff(a), "math"))

    @compile_
    def kick(q, w, dt):
        for i in range(len(q)):
            w[i, 1] -= dt / INERTIA * own(q[i, 1])
        for i in range(len(q) - 1):
            pull, one, other = bond(q[i + 1, 0] - q[i, 0], q[i, 1], q[i + 1, 1])
            w[i, 0] += dt * pull
            w[i + 1, 0] -= dt * pull
            w[i, 1] -= dt / INERTIA * one
            w[i + 1, 1] -= dt / INERTIA * other

    @compile_
    def loop(q, w, steps, dt, kicks, drifts):
        kick(q, w, kicks[0] * dt)
        for step in range(steps):
            for part in range(len(drifts)):
                q += w * (drifts[part] * dt)
                last = part == len(drifts) - 1 and step < steps - 1  # with the first of the next
                kick(q, w, (kicks[part + 1] + (kicks[0] if last else 0.0)) * dt)

    return loop


def struck():
    """Functions of the number of steps that give the last rotations, by name."""
    law = rotating()
    energy, first, second, site = law
    chain = Chain(PairLaw(energy, first, second, site=site), STRUCK, mass=(1.0, INERTIA))
    start, few = chain.at_rest({0: (SPEED, 0.0)}), Record(every=10**6)

    def ours(steps):
        run = simulate(chain, start, UNTIL, dt=UNTIL / steps, method="rkn6", record=few)
        return run.final.u[:, 1]

    programs = {"ours": ours}
    if has("numba"):
        loop = in_numba(*law)

        def numbas(method):
            def run(steps):
                q, w = start.u.copy(), start.v.copy()
                loop(q, w, steps, UNTIL / steps, np.array(method.kicks), np.array(method.drifts))
                return q[:, 1]

            return run

        programs["numba, same method"] = numbas(METHODS["rkn6"])
    return programs


def race():
    """CPU times of `struck` at equal errors."""
    programs = struck()
    exact = programs["ours"](12000)
    rows = []
    for error in ERRORS:
        calls, steps = {}, {}
        for name, run in programs.items():
            count = FEWEST
            with np.errstate(all="ignore"):
                while not _off(run, count, exact) <= error:
                    count = int(count * MORE)
            calls[name], steps[name] = (lambda run=run, count=count: run(count)), count
        times = cpu(calls)
        rows += [
            (f"{name}, {error:g}", steps[name], 1e3 * times[name], times[name] / times["ours"])
            for name in programs
        ]
    columns = ("program, error", "steps", "ms", "over ours")
    table("120 rotating units, at equal error", columns, rows)


def _off(run, steps, exact):
    try:
        return np.abs(run(steps) - exact)[FAR].max()
    except TensegrityError:  # above the stability limit
        return np.inf


def main() -> None:
    import sympy as sp

    r, each, pairs = sp.Symbol("r"), np.arange(SITES), laws()
    places = np.stack([each, 0 * each], axis=1).astype(float)
    springs = Network(places, np.stack([each[:-1], each[1:]], axis=1), Potential(r**2 / 2, r))
    speeds = 1e-3 * np.random.default_rng(0).standard_normal(places.shape)
    scenes = {"plane spring": springs}
    scenes |= {x: Chain(pair, SITES, mass=(1.0, 0.0759)) for x, pair in pairs.items()}
    state, few = State(0 * places, speeds), Record(every=10**6)

    def run(scene):
        return lambda: simulate(scene, state, T_END, dt=DT, method="verlet", record=few)

    forward = cpu({name: run(scene) for name, scene in scenes.items()})
    each_step, plane = 1e9 * DT / T_END / SITES, forward["plane spring"]
    rows = [(x, s * each_step, s / plane) for x, s in forward.items()]
    table("pair laws", ("law", "ns a bond", "over plane springs"), rows)

    def reverse(scene):
        return lambda: gradient(objective.displacement(200), scene, state, T_END / 20, dt=DT)

    back = cpu({x: reverse(scenes[x]) for x in ("differences", "both ends")})
    rows = [(x, 1e3 * s, s / back["differences"]) for x, s in back.items()]
    table("gradients of pair laws", ("law", "ms", "over differences"), rows)
    race()


if __name__ == "__main__":
    main()
