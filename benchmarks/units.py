"""Pair laws over springs: time per bond of the loop, and of gradients of both ends.

A row of rotating units, whose bonds have sines and cosines of two angles, over plane springs in a
network of as many bonds; and the gradient of a law that is told of both ends, over the same law
written in differences, whose coordinates are free.  CPU times of whole calls, least of several
rounds in one run.
"""

from __future__ import annotations

import time

import numpy as np

from benchmarks._timing import table
from tensegrity import (
    Chain,
    Network,
    PairLaw,
    Potential,
    Record,
    State,
    gradient,
    objective,
    simulate,
)

SITES, ROUNDS, T_END, DT = 400, 9, 400.0, 0.05


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


def cpu(calls):
    """Least CPU time of each call [s], in turn."""
    best = dict.fromkeys(calls, np.inf)
    for _ in range(ROUNDS):
        for name, call in calls.items():
            start = time.process_time()
            call()
            best[name] = min(best[name], time.process_time() - start)
    return best


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


if __name__ == "__main__":
    main()
