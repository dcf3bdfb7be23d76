"""Contacts that open cost a method its order, and corrections restore most of it."""

import numpy as np

from figures._draw import name_curves, note
from figures._limits import COLOURS, gap, grid, moved, slope
from tensegrity import METHODS, Chain, PowerLaw
from tensegrity.scenes.dynamics import dynamics

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
    orders = zip(t["method"], t["closed"], t["opening"], strict=True)
    orders = grid(["method", "order, closed chain", "order, contacts that open"],
                  [[name, f"{a:.1f}", f"{b:.1f}"] for name, a, b in orders])  # fmt: skip
    exponents = zip(powers["exponent"], powers[PLAIN], powers[CORRECTED], strict=True)
    exponents = grid(["exponent", f"order of {PLAIN}", f"order of {CORRECTED}"],
                     [[f"{n:g}", f"{a:.1f}", f"{b:.1f}"] for n, a, b in exponents])  # fmt: skip
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
    *panels, last = figure.subplots(1, 3, width_ratios=(1, 1, 0.85))
    for axes, how in zip(panels, BLOWS, strict=True):
        for name in tables["orders"]["method"]:
            if how == "closed" and name == CORRECTED:
                continue  # does the steps of the plain one
            both = how == "closed" and name == PLAIN
            axes.loglog(*tables[f"{name}_{how}"].values(), color=COLOURS[name], lw=1.3,
                        label=f"{name}, {CORRECTED}" if both else name)  # fmt: skip
        axes.set(xlim=(25, 3e4), ylim=(1e-16, 1e2), yticks=10.0 ** np.arange(-16, 3, 4))
        axes.set(xlabel="steps", ylabel="largest error of u and v at the end")
        name_curves(axes)
    powers = tables["exponents"]
    for name in (PLAIN, CORRECTED):
        last.plot(powers["exponent"], powers[name], "o", color=COLOURS[name])
        place = powers["exponent"][1], powers[name][1]
        note(last, name, place, (0, 10), ha="center", color=COLOURS[name])
    x = np.array([EXPONENTS[0], EXPONENTS[-1]])
    for more in (1, 3):
        last.plot(x, x + more, "0.5", ls=":")
        note(last, f"exponent + {more}", (x[1], x[1] + more), (0, 4), ha="right", color="0.4",
             fontsize=9)  # fmt: skip
    panels[0].set_title("closed: full order")
    panels[1].set_title("opening: order lost")
    last.set(title="orders, opening", xlabel="exponent of the contacts", ylabel="measured order")
    last.set_ylim(1, 6.5)
