"""Contacts that open: the order that is lost, and steps beside the events that restore it."""

from __future__ import annotations

import numpy as np

from figures import _located
from figures._limits import COLOURS, gap, listed, moved, slope
from tensegrity import Chain, PowerLaw
from tensegrity.engine.methods import METHODS

NAME = "limits_contacts"
GROUP = "limits"

BEADS, DURATION = 6, 9.0  # unit masses, unit contacts
HERTZ = 1.5
BLOWS = {  # preload, velocities at the start
    "closed": (1.0, {0: 0.3, 5: -0.2}),
    "opening": (0.0, {0: 1.0, 1: -0.3, 5: -0.6}),
}
COUNTS = np.geomspace(30, 960, 21).astype(int)  # steps
FEW_COUNTS = np.geomspace(30, 360, 8).astype(int)  # of runs with located steps
FINE = 4000, 1000  # steps of the references: fixed where all is smooth, graded elsewhere
FLOOR = 1e-12  # errors below it are round-off


def scene(name):
    """Chain and initial state."""
    preload, velocity = BLOWS[name]
    chain = Chain(PowerLaw(1.0, HERTZ, preload=preload), BEADS)
    return chain, chain.at_rest(velocity)


def exact(name):
    """u and v at the end, to round-off."""
    if name == "closed":
        return moved(*scene(name), "rkn6", DURATION / FINE[0], FINE[0])
    return _located.run(*scene(name), DURATION, "rkn6", DURATION / FINE[1])[:2]


def affordable(counts, method):
    """Numbers of steps that a method is tried with: half as many where steps are implicit."""
    return counts if METHODS[method].explicit else counts[counts < 350][::2]


def fixed(name, method, reference):
    """Errors of fixed steps."""
    start, counts = scene(name), affordable(COUNTS, method)
    errors = [gap(moved(*start, method, DURATION / n, n), reference) for n in counts.tolist()]
    return {"steps": counts, "error": np.array(errors)}


def located(method, grade, reference):
    """Errors of steps located at the events, and how many steps these were."""
    start, found = scene("opening"), []
    for n in affordable(FEW_COUNTS, method).tolist():
        u, v, steps, events = _located.run(*start, DURATION, method, DURATION / n, grade)
        found.append((n, steps, events, gap((u, v), reference)))
    names = ("steps far from events", "steps", "events", "error")
    return dict(zip(names, map(np.array, zip(*found, strict=True)), strict=True))


def order(table):
    """Power of the step in the error, over all steps that are not down at round-off."""
    steps = table.get("steps far from events", table["steps"])
    above = table["error"] > FLOOR
    return -slope(steps[above], table["error"][above])


def data(methods=tuple(METHODS)):
    """Errors against steps of each method in each scene, and the orders fitted to them."""
    tables, orders = {}, []
    closed, opening = exact("closed"), exact("opening")
    for name in methods:
        found = {
            "closed": fixed("closed", name, closed),
            "opening": fixed("opening", name, opening),
            "located": located(name, False, opening),
            "graded": located(name, True, opening),
        }
        orders.append([order(table) for table in found.values()])
        tables |= {f"{name}_{how}": table for how, table in found.items()}
    columns = dict(zip(found, np.transpose(orders), strict=True))
    nominal = [METHODS[name].order for name in methods]
    return {"orders": {"method": list(methods), "nominal": nominal, **columns}, **tables}


def text(tables):
    """What the page says."""
    t = tables["orders"]
    rows = [dict(zip(t, row, strict=True)) for row in zip(*t.values(), strict=True)]

    def each(how):
        return listed([f"{row['method']} {row[how]:.1f}" for row in rows])

    best = max(rows, key=lambda row: row["graded"])["method"]
    beyond = [row["method"] for row in rows if row["graded"] < row["nominal"] - 0.5]
    but = f" (not of {listed(beyond)}, whose processor looks beyond the ends of a step)"
    one, other = tables[f"{best}_opening"], tables[f"{best}_graded"]
    near = int(np.argmin(np.abs(other["steps"] - one["steps"][-1])))
    return (
        "The force of a contact grows like the overlap to the power 3/2: where contacts open or "
        "close it has one derivative only. Measured orders on a chain of "
        f"{BEADS} beads that stays closed: {each('closed')}; on one with "
        f"{other['events'][-1]} openings and closings: {each('opening')}. To end a step at each "
        f"event is not enough: {each('located')}; the impulse beside it still is a power 5/2 of "
        "time. Steps that also shrink like a power of the time to the event restore the order"
        f"{but if beyond else ''}: {each('graded')}; {best} then has an error of "
        f"{other['error'][near]:.0e} after {other['steps'][near]} steps, against "
        f"{one['error'][-1]:.0e} after {one['steps'][-1]} fixed ones. This is a prototype in "
        "`figures/_located.py`, for few beads: `simulate` has fixed steps, and its `tol` refines "
        "them by what it sees, not by the order that the method has elsewhere."
    )


def draw(figure, tables):
    """Error against steps: all closed, opening with fixed steps, opening with located ones."""
    figure.set_size_inches(13, 4.5)
    panels = figure.subplots(1, 3, sharey=True)
    t = tables["orders"]
    for k, name in enumerate(t["method"]):
        colour = COLOURS[name]
        for axes, how, style in (
            (panels[0], "closed", "o-"), (panels[1], "opening", "o-"), (panels[2], "located", "x:"),
            (panels[2], "graded", "o-"),
        ):  # fmt: skip
            one = tables[f"{name}_{how}"]
            label = f"{name}: order {t[how][k]:.1f}" + (", ended only" if how == "located" else "")
            axes.loglog(one["steps"], one["error"], style, color=colour, ms=3, lw=1, label=label)
    panels[0].set(title="closed: precompressed", ylabel="largest error of u and v at the end")
    panels[1].set(title="opening: fixed steps")
    panels[2].set(title="opening: located steps")
    panels[0].set_ylim(bottom=1e-18)
    for axes in panels:
        axes.set(xlabel="steps")
        axes.legend(fontsize=7 if axes is not panels[2] else 6, loc="lower left")
