"""Prestrains found by gradients bring the peak on the wall to a twentieth of the best uniform one.

Sixty rigid prisms (side 1 m, height 0.7 m, 1 N/m, masses 1 kg), site 0 moving at 0.05 m/s, the last
site held by a wall. The prestrains, each from 0.001 to 0.1, are optimised by descent: the highest
maxima of the wall load over 1,000 s are reduced together by linear programs within a trust region,
which shrinks where the actual reduction falls short of the predicted one. Initial chains are random
ones whose gradients are not lost to round-off: in the others the motion is chaotic, and gradients
are exact but useless. A result counts if this holds for it, and if its peak persists with two finer
steps.

The chain is the best of five starts; another processor rounds differently, and its iteration may
end at another one. The force after the end of the window is not constrained, and the optimiser
moves it there: a window ten times longer shows it.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import linprog

from figures import _gradients
from figures._stored import stored
from tensegrity import Chain, Prism, gradient
from tensegrity import objective as o

NAME = "gradients_protector"
GROUP = "gradients"

BONDS, SPEED, RANGE = 60, 0.05, (0.001, 0.1)
WINDOW, LONGER, DT = 1000.0, 10_000.0, 0.2  # s
FINER = (0.05, 0.025)  # s: what is found is computed again, since an optimiser finds errors
MOVED = 0.001  # relative change of a peak that is the integration's
UNIFORM = np.append(np.geomspace(0.01, 0.1, 14), 0.0708)  # the last: of finer scans
RANDOM, STARTS, DIGITS = 40, 5, 13  # chains drawn; starts; digits unaffected by round-off these
MAXIMA, REACH, NEAR = 24, 0.1, 1e-4  # pressed down; relative change of a prestrain, first and last
ROUNDS, PROGRAMS = 3, 60  # each round begins with the first reach


def chain(prestrains):
    """The chain before the wall."""
    springs = [Prism(1.0, 0.7, p, 1.0).potential() for p in prestrains]
    return Chain(springs, BONDS + 1, ends=("free", "fixed"))


def differentiated(prestrains, objectives, window=WINDOW, wanted=(), dt=DT):
    """Gradients of objectives."""
    scene = chain(prestrains)
    state = scene.at_rest({0: SPEED})
    return gradient(objectives, scene, state, window, dt=dt, method="rkn6", wanted=wanted)


def peak(prestrains, window=WINDOW, dt=FINER[0]):
    """Largest load of the wall [N]."""
    return differentiated(prestrains, o.peak(o.load(wall=0)), window, dt=dt).value


def load(prestrains):
    """Load of the wall after each step [N]."""
    recorded = []

    def keep(t, y):
        recorded.append(y[0].copy())
        return 0.0, 0 * y

    differentiated(prestrains, o.of([o.load(wall=0)], keep))
    return recorded[0]


def maxima(x):
    """Heights [N] of the highest maxima of the load, and their relative slopes by logarithms."""
    y = load(np.exp(x))
    tops = np.flatnonzero((y[1:-1] > y[:-2]) & (y[1:-1] >= y[2:]) & (y[1:-1] > 0)) + 1
    tops = tops[np.argsort(-y[tops])[:MAXIMA]]
    if y[-1] > max(y[-2], 0):
        tops = np.append(tops, len(y) - 1)
    samples = [_gradients.sample(o.load(wall=0), k) for k in tops]
    found = differentiated(np.exp(x), samples, wanted=("prestrain",))
    heights = np.array([one.value for one in found])
    slopes = np.array([one.by("prestrain") for one in found]) * np.exp(x) / heights[:, None]
    order = np.argsort(-heights)
    return heights[order], slopes[order]


def pressed(start):
    """Chains on the way downhill: peaks at the steps [N], prestrains."""
    low, high = np.log(RANGE)
    x, reach = np.log(start), REACH
    heights, slopes = maxima(x)
    way = [(heights[0], start)]
    for _ in range(PROGRAMS):
        lines = np.column_stack([slopes, -np.ones(len(heights))])
        bounds = [*zip(np.maximum(low - x, -reach), np.minimum(high - x, reach), strict=True),
                  (None, None)]  # fmt: skip
        found = linprog(np.append(np.zeros(BONDS), 1.0), A_ub=lines,
                        b_ub=-np.log(heights / heights[0]), bounds=bounds)  # fmt: skip
        if reach < NEAR or found.x is None or found.x[-1] > -1e-6:
            break
        trial = np.clip(x + found.x[:-1], low, high)
        there = maxima(trial)
        way.append((there[0][0], np.exp(trial)))
        gain = np.log(there[0][0] / heights[0]) / found.x[-1]  # 1: as the slopes promise
        if gain > 0:
            x, (heights, slopes) = trial, there
        reach *= 2 if gain > 0.75 else 0.25 if gain < 0.1 else 1 if gain > 0.4 else 0.5
        reach = min(reach, 0.5)
    return way


def settled(way):
    """The lowest peak with the finest step, and its chain, of those whose peaks persist."""
    for _, prestrains in sorted(way, key=lambda one: one[0]):
        top = differentiated(prestrains, o.peak(o.load(wall=0)), wanted=("prestrain",))
        if top.digits < DIGITS:
            continue
        finer = [peak(prestrains, dt=dt) for dt in FINER]
        if max(abs(one / finer[-1] - 1) for one in (top.value, *finer)) < MOVED:
            return finer[-1], prestrains
    return np.inf, way[0][1]


def drawn():
    """Gradients of the peaks of random chains, and the chains: logarithms of prestrains uniform."""
    rows = np.exp(np.random.default_rng(0).uniform(*np.log(RANGE), (RANDOM, BONDS)))
    peaks = [differentiated(p, o.peak(o.load(wall=0)), wanted=("prestrain",)) for p in rows]
    return list(zip(peaks, rows, strict=True))


def search(first):
    """Prestrains of the best chain, from the best of those drawn that are not chaotic."""
    calm = [(one.value, row) for one, row in first if one.digits >= DIGITS]
    found = []
    for best in sorted(calm, key=lambda one: one[0])[:STARTS]:
        for _ in range(ROUNDS):
            best = settled([best, *pressed(best[1])])
        found.append(best)
    return min(found, key=lambda one: one[0])[1]


@stored(NAME)
def data():
    """The best uniform chain, random ones and that found: prestrains and loads of the wall."""
    uniform = [peak(np.full(BONDS, p)) for p in UNIFORM]
    first = drawn()
    best = search(first)
    designs = {"best uniform": np.full(BONDS, UNIFORM[int(np.argmin(uniform))]),
               "by gradients": best}  # fmt: skip
    loads, values, peaks = {"t": DT * np.arange(int(WINDOW / DT) + 1)}, {}, {}
    for name, prestrains in designs.items():
        loads[name] = load(prestrains)
        for window in (WINDOW, LONGER):
            for dt in FINER:
                peaks[name, window] = peak(prestrains, window, dt)
                values[f"peak, {name}, {window:g} s, dt {dt:g} s [N]"] = peaks[name, window]
    last = differentiated(best, o.peak(o.load(wall=0)), wanted=("prestrain",), dt=FINER[0])
    values |= {
        f"median of {RANDOM} random chains, {WINDOW:g} s [N]":
        np.median([one.value for one, _ in first]),
        "fraction of these without chaotic motion":
        np.mean([one.digits >= DIGITS for one, _ in first]),
        "digits unaffected by round-off the chain found": last.digits,
        "its steepest slope [% of the peak per % of a prestrain]":
        np.abs(last.by("prestrain") * best / last.value).max(),
        **{f"uniform over found, {window:g} s":
           peaks["best uniform", window] / peaks["by gradients", window]
           for window in (WINDOW, LONGER)},
    }  # fmt: skip
    return {
        "loads": loads,
        "prestrains": {"bond": np.arange(BONDS), **designs},
        "numbers": _gradients.numbers(values),
    }


def table(tables):
    """The numbers."""
    return _gradients.lines(NAME, tables)


def draw(figure, tables):
    """Envelopes of the load of the wall, and the prestrains."""
    figure.set_size_inches(9, 4.2)
    left, right = figure.subplots(1, 2)
    loads, prestrains = tables["loads"], tables["prestrains"]
    span = 10.0  # s, of each of which the largest load is drawn
    width = round(span / DT)
    for colour, name in (("C0", "best uniform"), ("C1", "by gradients")):
        highest = np.maximum(loads[name][1:].reshape(-1, width).max(axis=1), 1e-9)
        peak = loads[name].max()
        left.stairs(highest, loads["t"][::width], color=colour, lw=1.2)
        left.axhline(peak, color=colour, ls="--", lw=0.8)
        left.annotate(f"{name}, peak {peak:.2g} N", (loads["t"][-1], peak), (0, 4), ha="right",
                      textcoords="offset points", color=colour,
                      bbox={"fc": "w", "ec": "none", "pad": 0.5})  # fmt: skip
        right.semilogy(prestrains["bond"], prestrains[name], ".-", lw=0.8, color=colour)
        right.annotate(name, (30, prestrains[name][30]), (0, 9 if colour == "C0" else -38),
                       textcoords="offset points", color=colour)  # fmt: skip
    left.set(xlabel="time [s]", ylabel=f"largest load in {span:g} s on the wall [N]",
             yscale="log", ylim=(1e-4, 0.2))  # fmt: skip
    right.set(xlabel="bond, from the struck end", ylabel="prestrain", ylim=(5e-4, 0.2))
