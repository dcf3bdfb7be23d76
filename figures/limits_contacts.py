"""Contacts that open cost a method its order, and corrections restore most of it."""

from __future__ import annotations

import numpy as np

from figures._draw import name_curves
from figures._limits import COLOURS, gap, grid, moved, slope
from tensegrity import METHODS, Chain, PowerLaw
from tensegrity.scenes.dynamics import dynamics

NAME = "limits_contacts"
GROUP = "limits"

BEADS, DURATION = 6, 9.0  # unit masses, unit contacts
HERTZ = 1.5
EXPONENTS = (1.0, 1.5, 2.0, 2.5)
BLOWS = {  # preload, velocities at the start
    "closed": (1.0, {0: 0.3, 5: -0.2}),
    "opening": (0.0, {0: 1.0, 1: -0.3, 5: -0.6}),
}
PLAIN, CORRECTED = "rkn6", "corrected6"
COUNTS = np.geomspace(30, 960, 21).astype(int)  # steps
FINE = 2000  # steps of the references, corrected
FLOOR = 1e-12  # below: round-off


def scene(name, exponent=HERTZ):
    """Chain and initial state."""
    preload, velocity = BLOWS[name]
    chain = Chain(PowerLaw(1.0, exponent, preload=preload), BEADS)
    return chain, chain.at_rest(velocity)


def exact(name, exponent=HERTZ):
    """u and v at the end, to round-off."""
    return moved(*scene(name, exponent), CORRECTED, DURATION / FINE, FINE)


def events(exponent=HERTZ):
    """Openings and closings of the scene that opens."""
    chain, state = scene("opening", exponent)
    u, v = dynamics(chain).arrays(state)
    loop = dynamics(chain).bind(u, v, METHODS[CORRECTED], DURATION / FINE)
    closed = []
    for step in range(FINE):
        loop.advance(1, opened=step > 0)
        closed.append(chain.elongation(u) < 0)
    return int(np.sum(np.diff(closed, axis=0)))


def errors(name, method, reference, exponent=HERTZ):
    """Errors of the end against steps."""
    start = scene(name, exponent)
    found = [gap(moved(*start, method, DURATION / n, n), reference) for n in COUNTS.tolist()]
    return {"steps": COUNTS, "error": np.array(found)}


def order(table):
    """Power of the step in the error, over all steps that are not down at round-off."""
    above = table["error"] > FLOOR
    return -slope(table["steps"][above], table["error"][above])


def data(methods=tuple(METHODS), exponents=EXPONENTS):
    """Errors against steps of each method in each scene, and the orders fitted to them."""
    tables = {}
    references = {name: exact(name) for name in BLOWS}
    for method in methods:
        for name, reference in references.items():
            tables[f"{method}_{name}"] = errors(name, method, reference)
    for exponent in exponents:
        reference = exact("opening", exponent)
        for method in (PLAIN, CORRECTED):
            tables[f"{method}_{exponent:g}"] = errors("opening", method, reference, exponent)
    orders = {name: [order(tables[f"{m}_{name}"]) for m in methods] for name in BLOWS}
    powers = {m: [order(tables[f"{m}_{n:g}"]) for n in exponents] for m in (PLAIN, CORRECTED)}
    nominal = [METHODS[name].order for name in methods]
    return {
        "orders": {"method": list(methods), "nominal": nominal, **orders},
        "exponents": {"exponent": list(exponents), **powers},
        "events": {"exponent": [HERTZ], "events": [events()]},
        **tables,
    }


def text(tables):
    """The section of the page."""
    t, powers = tables["orders"], tables["exponents"]
    one, other = tables[f"{PLAIN}_opening"], tables[f"{CORRECTED}_opening"]
    last = int(np.argmin(np.abs(other["steps"] - 480)))
    orders = grid(
        ["method", "order, closed chain", "order, contacts that open"],
        [
            [name, f"{a:.1f}", f"{b:.1f}"]
            for name, a, b in zip(t["method"], t["closed"], t["opening"], strict=True)
        ],
    )
    exponents = grid(
        ["exponent", f"order of {PLAIN}", f"order of {CORRECTED}"],
        [
            [f"{n:g}", f"{a:.1f}", f"{b:.1f}"]
            for n, a, b in zip(powers["exponent"], powers[PLAIN], powers[CORRECTED], strict=True)
        ],
    )
    return (
        "The force of a contact grows like a power of the overlap, 3/2 for spheres: where contacts "
        f"open or close it has one derivative only. Measured orders on a chain of {BEADS} beads "
        f"that stays closed, and on one with {tables['events']['events'][0]} openings and closings:"
        f"\n\n{orders}\n\n"
        "The kicks of a method are a quadrature of the forces, whose error at an event is known "
        f"in closed form (`derivations`, openings): {CORRECTED} takes the steps of {PLAIN} and "
        f"subtracts that error. After {other['steps'][last]} steps it is "
        f"{other['error'][last]:.0e} off, {PLAIN} after {one['steps'][-1]} still "
        f"{one['error'][-1]:.0e}. For contacts of other exponents:\n\n{exponents}\n\n"
        "The next terms are of order exponent + 3. Contacts that close for less than a step, "
        "across the end of one, are not corrected. Corrections are not reversible in time."
    )


def draw(figure, tables):
    """Error against steps: all closed, opening; orders for other exponents."""
    figure.set_size_inches(9, 4.6)
    panels = figure.subplots(1, 3, width_ratios=(1, 1, 0.85))
    powers = tables["exponents"]
    for axes, how in zip(panels, BLOWS, strict=False):
        for name in tables["orders"]["method"]:
            if how == "closed" and name == CORRECTED:
                continue  # does the steps of the plain one
            one = tables[f"{name}_{how}"]
            label = f"{name}, {name.replace('rkn', 'corrected')}"
            label = label if how == "closed" and name == PLAIN else name
            axes.loglog(one["steps"], one["error"], color=COLOURS[name], lw=1.3, label=label)
        axes.set(
            ylim=(1e-16, 1e2), xlim=(25, 3e4), xlabel="steps", yticks=10.0 ** np.arange(-16, 3, 4)
        )
        name_curves(axes)
    for name, colour in ((PLAIN, COLOURS[PLAIN]), (CORRECTED, COLOURS[CORRECTED])):
        panels[2].plot(powers["exponent"], powers[name], "o", color=colour)
        panels[2].annotate(name, (powers["exponent"][1], powers[name][1]), (0, 10), ha="center",
                           textcoords="offset points", color=colour)  # fmt: skip
    for more, words in ((1, "exponent + 1"), (3, "exponent + 3")):
        x = np.array([EXPONENTS[0], EXPONENTS[-1]])
        panels[2].plot(x, x + more, "0.5", ls=":")
        panels[2].annotate(words, (x[1], x[1] + more), (0, 4), ha="right", color="0.4",
                           textcoords="offset points", fontsize=9)  # fmt: skip
    panels[0].set(title="(a) closed: full order", ylabel="largest error of u and v at the end")
    panels[1].set(title="(b) opening: order lost", ylabel="largest error of u and v at the end")
    panels[2].set(title="(c) orders, opening", xlabel="exponent of the contacts",
                  ylabel="measured order", ylim=(1, 6.5))  # fmt: skip
    for axes in panels:
        axes.title.set_fontsize(11)
