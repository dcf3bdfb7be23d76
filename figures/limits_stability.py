"""Stability limits of the methods: the step at which the highest mode of a chain begins to grow."""

import numpy as np
import sympy as sp

from figures._files import lines
from figures._limits import COLOURS, EXPLICIT, grid
from figures._tables import arrays
from tensegrity import METHODS, Chain, Potential, State
from tensegrity.scenes.dynamics import dynamics

GROUP = "limits"

SITES = 8  # so few that their frequencies are well apart
CLOSE = 0.02  # relative width of the bracket of the limit
TIMES = 20.0  # how many times over the amplitude may grow by e while it is watched
FEWEST = 200  # steps watched
SHOWN = 0.15  # of the limit, on either side, unless the growth is over before
FAR_STEPS = (10.0, 1e3, 1e5)  # dt * omega tried with implicit methods
FEW = 40  # steps of these


def chain():
    """Unit masses and springs, and the largest frequency."""
    r = sp.Symbol("r", real=True)
    return Chain(Potential(r**2 / 2, r), SITES), 2 * np.cos(np.pi / (2 * SITES))


def growth(method, z, steps):
    """Logarithm of the amplitude's growth per step, all modes excited, over the last half."""
    row, omega = chain()
    u, v = np.random.default_rng(1).standard_normal((2, SITES))
    loop = dynamics(row).bind(u, v, method, z / omega)
    loop.advance(steps // 2)
    before = row.energy(State(u, v))
    loop.advance(steps // 2)
    return 0.5 * np.log(row.energy(State(u, v)) / before) / (steps // 2)


def worst(method, limit):
    """Step that grows fastest closely above a limit, that growth, and how wide the growth is."""
    z = limit * np.linspace(1, 1 + CLOSE / 2, 20_001)
    rate = predicted_growth(method, z)
    top = int(np.argmax(rate))
    over = np.flatnonzero(rate[top:] < 0.01 * rate[top])
    width = z[top + over[0]] - limit if over.size else np.inf
    return float(z[top]), float(rate[top]), width


def bracket(method):
    """What the bare loop does on both sides of the limit, and around it.

    Just below it and at the step that grows fastest above, with as many steps.
    """
    limit = method.stability_limit
    above, rate, width = worst(method, limit)
    steps = max(FEWEST, int(TIMES / rate))
    below = (1 - CLOSE / 2) * limit
    grown = [growth(method, z, steps) for z in (below, above)]
    width = min(SHOWN * limit, width)
    near = limit + width * np.linspace(-0.5, 1.5, 21)
    line = limit + width * np.linspace(-0.5, 1.5, 401)
    expected = predicted_growth(method, line)
    seen = max(FEWEST, int(TIMES / expected.max()))
    grows = np.array([growth(method, z, seen) for z in near])
    around = {"dt omega": near, "growth": grows, "line": line, "predicted": expected}
    found = {"below": below, "growth below": grown[0], "above": above, "growth above": grown[1]}
    return {"limit": limit, **found, "growth predicted": rate, "steps": steps}, around


def predicted_growth(method, z):
    """Largest growth per step of any mode of the chain, by the eigenvalues of a step."""
    modes = np.sin(np.pi * np.arange(1, SITES) / (2 * SITES)) / np.cos(np.pi / (2 * SITES))
    xx, xv, vx, vv = method.step_matrix(np.multiply.outer(z, modes))
    steps = np.moveaxis(np.array([[xx, xv], [vx, vv]]), (0, 1), (-2, -1))
    return np.log(np.abs(np.linalg.eigvals(steps)).max(axis=(-1, -2)))


def data():
    """Growth per step on both sides of each limit and around it."""
    rows, tables = [], {}
    for name in EXPLICIT:
        found, tables[name] = bracket(METHODS[name])
        rows.append({"method": name, "stages": METHODS[name].stages} | found)
    far = [{"method": m.name, "dt omega": z, "growth": growth(m, z, FEW)}
           for m in METHODS.values() if not m.explicit for z in FAR_STEPS]  # fmt: skip
    return {"limits": arrays(rows), "implicit": arrays(far)} | tables


def text(tables):
    """The section of the page."""
    rows = []
    for row in lines(tables["limits"]):
        above = f"{row['above']:.3f}, by {np.expm1(row['growth above']):.2g} a step"
        share = f"{row['limit'] / row['stages']:.2f}"
        rows.append([row["method"], f"{row['limit']:.4f}", f"{row['below']:.3f}", above, share])
    head = ["method", "largest dt omega", "nothing grew at", "grew at", "limit for each evaluation"]
    far, names = max(tables["implicit"]["dt omega"]), dict.fromkeys(tables["implicit"]["method"])
    return (
        "The step times the largest angular frequency must stay below a number of the method, "
        "found from its coefficients and found again by letting the bare loop run on a linear "
        f"chain.\n\n{grid(head, rows)}\n\n"
        "A weak growth is a resonance: a few thousand steps do no harm there, a million do. "
        "`simulate` refuses a larger step with a `StabilityError`, at the stiffness that the "
        f"motion itself meets. {', '.join(names)} has no limit: nothing grew at {far:g}."
    )


def draw(figure, tables):
    """Growth per step around each limit, predicted and found."""
    figure.set_size_inches(9, 4)
    for axes, name in zip(figure.subplots(1, len(EXPLICIT)), EXPLICIT, strict=True):
        t, colour, limit = tables[name], COLOURS[name], METHODS[name].stability_limit
        axes.plot(t["line"], t["predicted"], color=colour, lw=1)
        axes.plot(t["dt omega"], t["growth"], "o", color=colour, ms=4)
        axes.axvline(limit, color="k", lw=0.6, ls=":")
        axes.ticklabel_format(useOffset=False, style="plain", axis="x")
        axes.locator_params(axis="x", nbins=3)
        axes.set(xlabel="step dt $\\omega_{max}$", title=f"{name}: limit {limit:.4f}")
    figure.supylabel("growth per step, logarithm of the amplitude", fontsize=10)
    words = "A mode grows where the eigenvalues of a step (line) say so; dots: the loop on a chain"
    figure.suptitle(words)
