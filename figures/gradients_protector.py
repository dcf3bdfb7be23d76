"""A chain of 60 prisms whose prestrains are chosen by gradients: the force behind it.

Sixty rigid prisms (side 1 m, height 0.7 m, 1 N/m, masses 1 kg), site 0 moving at 0.05 m/s, the
last site held by a wall.  The prestrains, each from 0.001 to 0.1, are moved downhill on p-norms of
the wall's load, p = 8, 32, 128, over a window of 1,000 s.  The force behind the end of the window
is not asked for, and the optimiser hides it there: a window ten times longer shows it.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize

from tensegrity import Chain, Prism, gradient
from tensegrity import objective as o

NAME = "gradients_protector"
GROUP = "gradients"

BONDS, SPEED, RANGE = 60, 0.05, (0.001, 0.1)
WINDOW, LONGER, DT = 1000.0, 10_000.0, 0.2
FINER = 0.05  # s: what is found is computed again, since an optimiser finds errors of a run
NORMS, PASSES, SEEDS = (8, 32, 128), 100, (0,)
UNIFORM = np.geomspace(0.01, 0.1, 12)
RANDOM = 8


def chain(prestrains):
    """The chain before the wall."""
    springs = [Prism(1.0, 0.7, p, 1.0).potential() for p in prestrains]
    return Chain(springs, BONDS + 1, ends=("free", "fixed"))


def force(prestrains, objective=None, window=WINDOW, wanted=(), finer=False):
    """Gradient of the wall's peak, or of another objective."""
    scene, asked = chain(prestrains), objective or o.peak(o.load(wall=0))
    state = scene.at_rest({0: SPEED})
    dt = FINER if finer else DT
    return gradient(asked, scene, state, window, dt, "rkn6", wanted=wanted)


def descend(start):
    """Prestrains that p-norms lead to, and how many passes that took."""
    x, low_high, used = np.log(start), np.log(RANGE), 0
    best = (np.inf, start)
    for p in NORMS:
        asked = o.p_norm(o.load(wall=0), p)

        def value(x, asked=asked):
            found = force(np.exp(x), asked, wanted=("prestrain",))
            return np.log(found.value), found.by("prestrain") * np.exp(x) / found.value

        found = minimize(value, x, jac=True, method="L-BFGS-B", bounds=[low_high] * BONDS,
                         options={"maxfun": PASSES})  # fmt: skip
        x, used = found.x, used + found.nfev
        peak = force(np.exp(x)).value
        if peak < best[0]:
            best = peak, np.exp(x)
    return best[1], used


def data():
    """The best uniform chain, random ones and those found: prestrains and loads of the wall."""
    uniform = [force(np.full(BONDS, p)).value for p in UNIFORM]
    at = UNIFORM[int(np.argmin(uniform))]
    drawn = [
        np.exp(np.random.default_rng(seed).uniform(*np.log(RANGE), BONDS)) for seed in range(20)
    ]
    random = [force(p).value for p in drawn]
    found = [descend(drawn[seed]) for seed in SEEDS]
    peaks = [force(p).value for p, _ in found]
    best, passes = found[int(np.argmin(peaks))]
    designs = {"best uniform": np.full(BONDS, at), "by gradients": best}
    loads, numbers = {"t": DT * np.arange(int(WINDOW / DT) + 1)}, {"quantity": [], "value": []}
    for name, prestrains in designs.items():
        trace = {}

        def keep(t, y, trace=trace):
            trace["load"] = y[0].copy()
            return 0.0, 0 * y

        force(prestrains, o.of([o.load(wall=0)], keep))
        loads[name] = trace["load"]
        for window in (WINDOW, LONGER):
            numbers["quantity"].append(f"peak, {name}, {window:g} s [N]")
            numbers["value"].append(force(prestrains, window=window, finer=True).value)
    numbers["quantity"] += [
        "median of random chains [N]",
        "passes of the best",
        "uniform over found",
    ]
    numbers["value"] += [float(np.median(random)), passes, min(uniform) / min(peaks)]
    return {
        "loads": loads,
        "prestrains": {"bond": np.arange(BONDS), **designs},
        "numbers": numbers,
    }


def table(tables):
    """The numbers."""
    numbers = tables["numbers"]
    pairs = zip(numbers["quantity"], numbers["value"], strict=True)
    return [{"picture": NAME, "quantity": k, "value": float(x)} for k, x in pairs]


def draw(figure, tables):
    """Loads of the wall in the window, and the prestrains."""
    figure.set_size_inches(10, 4.2)
    left, right = figure.subplots(1, 2)
    loads, prestrains = tables["loads"], tables["prestrains"]
    for k, name in enumerate(("best uniform", "by gradients")):
        shown = np.maximum(loads[name], 1e-6)
        left.semilogy(loads["t"], shown, color=f"C{k}", lw=0.7, label=name)
        left.axhline(loads[name].max(), color=f"C{k}", ls="--", lw=0.8)
        right.semilogy(prestrains["bond"], prestrains[name], ".-", color=f"C{k}", label=name)
    left.set(xlabel="time [s]", ylabel="load of the wall [N]", ylim=(1e-5, 0.2))
    left.set_title("pushing loads; dashed: their peaks", fontsize=10)
    right.set(xlabel="bond, from the struck end", ylabel="prestrain")
    right.set_ylim(1e-4)
    right.legend(loc="lower left")
