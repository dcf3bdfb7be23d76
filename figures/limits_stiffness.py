"""One bond far stiffer than the rest: where the implicit method outperforms the explicit ones."""

from __future__ import annotations

import time

import numpy as np
import sympy as sp

from figures._draw import name_curves
from figures._limits import COLOURS, DIFFERENT, EXPLICIT, grid, moved, slope
from tensegrity import METHODS, Chain, Potential
from tensegrity.scenes.dynamics import dynamics

NAME = "limits_stiffness"
GROUP = "limits"

RATIOS = np.geomspace(1e2, 1e8, 7)
EACH_SIDE = 6  # soft bonds on either side of the stiff one
SPEED, DURATION = 0.4, 6.0
ERROR = 1e-4  # of u and v of the end, wanted
FIRST, FINER = 6, 1.1  # steps of an implicit method tried first, and the factor between tries
BELOW = 0.99  # of the stability limit
REPEATS = 3


def scene(ratio):
    """Chain and state: a blow on one end of a soft chain with a stiff bond in its middle."""
    r, k = sp.symbols("r k")
    soft, stiff = (Potential(k * (r**2 / 2 + r**4 / 4), r, {k: x}) for x in (1.0, ratio))
    chain = Chain([soft] * EACH_SIDE + [stiff] + [soft] * EACH_SIDE, 2 * EACH_SIDE + 2)
    return chain, chain.at_rest({0: SPEED})


def least(method, ratio):
    """Steps that stability alone asks for."""
    chain, _ = scene(ratio)
    low = np.array([[-1.0, 1.0], [-1e-3, 1e-3]])  # elongations of the soft and the stiff spring
    limit = METHODS[method].stability_limit / dynamics(chain).frequency(low)
    return max(FIRST, int(np.ceil(DURATION / (BELOW * limit))))


def needed(method, ratio, reference):
    """Least steps, of a row, with the wanted error; its error."""
    start, steps = scene(ratio), least(method, ratio)
    while True:
        error = distance(moved(*start, method, DURATION / steps, steps), reference)
        if error <= ERROR:
            return steps, error
        steps = int(np.ceil(steps * FINER))


def distance(one, reference):
    """Largest difference of two (u, v), over the largest of the reference."""
    worst = [np.max(np.abs(a - b)) / np.max(np.abs(b)) for a, b in zip(one, reference, strict=True)]
    return float(max(worst)) if np.isfinite(worst).all() else np.inf


def exact(ratio):
    """u and v at the end, much finer than stability asks for."""
    steps = 4 * max(least("rkn6", ratio), 200)
    return moved(*scene(ratio), "rkn6", DURATION / steps, steps)


def seconds(method, ratio, steps):
    """Median time of such a run."""
    found = []
    for _ in range(REPEATS):
        before = time.perf_counter()
        moved(*scene(ratio), method, DURATION / steps, steps)
        found.append(time.perf_counter() - before)
    return float(np.median(found))


def data(ratios=RATIOS, timed=True):
    """Steps that a small error takes against the ratio of stiffnesses, and times as ratios."""
    references = [exact(ratio) for ratio in ratios.tolist()]
    steps, times = {}, {}
    for name in DIFFERENT:
        found = [needed(name, *pair) for pair in zip(ratios.tolist(), references, strict=True)]
        steps[name] = np.array([n for n, _ in found])
        steps[f"{name}: error"] = np.array([error for _, error in found])
        if timed:
            each = zip(ratios.tolist(), steps[name].tolist(), strict=True)
            times[name] = np.array([seconds(name, *pair) for pair in each])
    slowest = max((t.max() for t in times.values()), default=1.0)
    relative = {name: t / slowest for name, t in times.items()}
    return {"steps": {"ratio": ratios, **steps}, "times": {"ratio": ratios, **relative}}


def crossing(table, implicit, explicit):
    """Ratio of stiffnesses from which the implicit method needs less; nan if none was tried."""
    gain, x = np.log(table[explicit] / table[implicit]), np.log(table["ratio"])
    above = np.flatnonzero(gain > 0)
    if above.size == 0:
        return float("nan")
    k = max(above[0], 1)
    return float(np.exp(np.interp(0, gain[k - 1 : k + 1], x[k - 1 : k + 1])))


def text(tables):
    """The section of the page."""
    t = tables["steps"]
    stiff = t["ratio"] >= 1e5
    rows = [
        [
            name,
            f"{slope(t['ratio'][stiff], t[name][stiff]):.2f}" if name in EXPLICIT else "-",
            str(t[name][0]),
            str(t[name][-1]),
        ]
        for name in DIFFERENT
    ]
    first, last = f"{t['ratio'][0]:g}", f"{t['ratio'][-1]:.0e}"
    head = ["method", "power of the ratio", f"steps at {first}", f"steps at {last}"]
    return (
        f"One bond of {2 * EACH_SIDE + 1} is stiffer than the rest and hardly vibrates. For an "
        f"error of {ERROR:.0e} the steps of explicit methods, bound by stability, grow with a "
        "power of the ratio of stiffnesses; those of an implicit one do not.\n\n"
        f"{grid(head, rows)}\n\n"
        "Each implicit step, however, solves its equations by Newton's method: the cost in time is "
        "shown on the right of the picture, and printed."
    )


def table(tables):
    """From where on the implicit method wins."""
    (implicit,) = [n for n in DIFFERENT if n not in EXPLICIT]
    return [
        {
            "figure": NAME,
            "quantity": f"ratio of stiffnesses from which {implicit} takes {less} than {name} "
            f"(nan: not up to {tables[what]['ratio'][-1]:.0e})",
            "here": crossing(tables[what], implicit, name),
        }
        for what, less in (("steps", "fewer steps"), ("times", "less time"))
        for name in EXPLICIT
    ]


def draw(figure, tables):
    """Steps and times against the ratio of stiffnesses."""
    figure.set_size_inches(9, 4.5)
    left, right = figure.subplots(1, 2)
    for name in DIFFERENT:
        for axes, what in ((left, "steps"), (right, "times")):
            t = tables[what]
            axes.loglog(t["ratio"], t[name], "o-", ms=4, color=COLOURS[name], label=name)
    left.set_title("explicit methods: steps grow with the root", fontsize=10)
    right.set_title("what these steps take", fontsize=10)
    left.set(xlabel="ratio of stiffnesses", ylabel=f"steps for an error of {ERROR:g}")
    right.set(xlabel="ratio of stiffnesses", ylabel="time over the slowest")
    for axes in (left, right):
        axes.set_xlim(right=30 * axes.get_xlim()[1])
        name_curves(axes)
