"""Waves of rarefaction in a column of Kresling units, and of compression in their second state.

Creases of two kinds between two hexagons (twist 40 deg, height 1.8 radii): two states without
stress, a barrier where the twist is a right angle, and two limit points on the path under load.
In a column of such units height and twist travel together, in solitary waves faster than any
sound: a rarefaction where all units are in the first state, a compression in the second.  Dots are
the end of a run that begins with the exact wave.
"""

import math
from functools import cache

import numpy as np
import sympy as sp

from figures._draw import note
from figures._files import lines, side_by_side
from tensegrity import Chain, Member, Unit, equilibrium_path, simulate, solitary_wave

GROUP = "units"

SIDES, RADIUS, HEIGHT, TWIST = 6, 1.0, 1.8, 2 * math.pi / 9  # m
H, F = sp.symbols("h f")
LOWEST = 0.7  # m, where the path ends
INERTIAS = 1.0, 0.5  # kg, kg m²
RATIOS = {"first": 1.003, "second": 1.01}  # speeds of the waves in each state over the faster sound
SITES, START, TIME, TOLERANCE = 450, 150.5, 40.0, 1e-9  # of columns and runs
KINDS = "rarefaction", "compression"
BONDS = {"first": (120, 320), "second": (130, 260)}  # that are shown
EVERY = 3  # bonds a dot


def unit(height=HEIGHT, twist=TWIST):
    """The unit, at rest at a height and twist."""

    def crease(sign):
        chord = 2 * RADIUS * sp.sin((F + sign * sp.pi / SIDES) / 2)
        return sp.sqrt(H**2 + chord**2)

    creases = [Member(crease(sign), 1.0, SIDES) for sign in (-1, 1)]
    return Unit([F], H, creases, rest={H: height, F: twist})


@cache
def states():
    """The unstressed state at rest, the barrier, and the second one."""
    return dict(zip(("first", "barrier", "second"), unit().equilibria(), strict=True))


@cache
def travelled(state):
    """The wave in a column of units in one of their states, and a run that begins with it."""
    at = states()[state]
    column = Chain(unit(at.h, at.f).pair(sites=(H, F)), SITES, mass=INERTIAS)
    wave = solitary_wave(column, speed_ratio=RATIOS[state])
    return wave, simulate(column, wave.launch(column, at=START), TIME, tol=TOLERANCE)


def corners(height, twist):
    """The lower and the upper hexagon, whose corners are joined across twist -+ pi/n."""
    angles = 2 * np.pi / SIDES * np.arange(SIDES) - 0.4
    upper = angles + twist - np.pi / SIDES
    angles, z = np.concatenate([angles, upper]), np.repeat([0.0, height], SIDES)
    return {"x": RADIUS * np.cos(angles), "y": RADIUS * np.sin(angles), "z": z}


def data():
    path = equilibrium_path(unit(), min_height=LOWEST)
    tables = {"path": {name: path.columns[name] for name in ("h", "f", "load", "energy")}}
    rows = [{"state": e.kind, "h": e.h, "f": e.f, "load": e.load, "energy": e.energy}
            for e in path.events]  # fmt: skip
    rows += [{"state": name, "h": one.h, "f": one.f, "load": 0.0, "energy": one.energy}
             for name, one in states().items()]  # fmt: skip
    tables["states"] = side_by_side(rows)
    for name, one in states().items():
        tables[f"unit, {name}"] = corners(one.h, one.f)
    for state, (first, last) in BONDS.items():
        wave, run = travelled(state)
        bonds = np.arange(first, last)
        begin = wave.elongation(bonds + 0.5 - START)
        exact = wave.elongation(bonds + 0.5 - START - wave.speed * TIME)
        found = np.diff(run.final.u, axis=0)[first:last]
        columns = {"bond": bonds}
        for k, name in enumerate(("du", "dphi")):
            columns |= {f"{name}, begin": begin[:, k], f"{name}, exact": exact[:, k],
                        f"{name}, run": found[:, k]}  # fmt: skip
        tables[f"wave, {state}"] = columns
        tables[f"peak, {state}"] = {
            "du": [wave.elongation(0.0)[0]], "dphi": [wave.elongation(0.0)[1]],
            "speed": [wave.speed], "sound": [wave.sound_speed], "residual": [wave.residual],
        }  # fmt: skip
    return tables


def sketch(axes, nodes, shift, words):
    """A unit in oblique projection."""
    x, y, z = (np.asarray(nodes[name]) for name in "xyz")
    flat = np.column_stack([x + 0.15 * y + shift, z + 0.3 * y])
    low, high = flat[:SIDES], flat[SIDES:]
    for polygon in (low, high):
        axes.fill(*polygon.T, facecolor="0.92", edgecolor="0.3", lw=1.5)
    for step, colour in ((0, "C0"), (1, "C1")):
        for one, other in zip(low, np.roll(high, -step, axis=0), strict=True):
            axes.plot(*np.transpose([one, other]), colour, lw=1.3)
    note(axes, words, (shift, -0.35), (0, -4), ha="center", va="top")


def profiles(axes, of):
    """Changes of height and twist along the column, at first and at the end."""
    for name, words, colour in (("du", "height [m]", "C0"), ("dphi", "twist [rad]", "C1")):
        exact = of[f"{name}, exact"]
        axes.plot(of["bond"], of[f"{name}, begin"], color=colour, lw=0.8, ls="--")
        axes.plot(of["bond"], exact, color=colour)
        axes.plot(of["bond"][::EVERY], of[f"{name}, run"][::EVERY], ".", color=colour, ms=5)
        peak = int(np.abs(exact).argmax())
        note(axes, words, (of["bond"][peak], exact[peak]), (-26, 0), color=colour, ha="right",
             va="center")  # fmt: skip
    axes.set(xlabel="unit of the column", ylabel="change in a unit")
    axes.margins(0, 0.08)


def draw(figure, tables):
    """The unit in its states, its path and energy; below, the wave in either state."""
    figure.set_size_inches(9, 6.4)
    above, below = figure.subfigures(2, 1, height_ratios=(1, 1.1))
    units, load, energy = above.subplots(1, 3, width_ratios=(1.5, 1, 1))
    for k, name in enumerate(("first", "barrier", "second")):
        sketch(units, tables[f"unit, {name}"], 2.4 * k, name)
    units.set(aspect="equal", title="the unit without load")
    units.axis("off")
    path = tables["path"]
    load.axhline(0, color="0.8", lw=0.8)
    load.plot(path["h"], path["load"], "0.4")
    energy.plot(path["h"], 1e3 * path["energy"], "0.4")
    for one in lines(tables["states"]):
        words, low = one["state"], one["load"] < 0 or one["energy"] < 1e-9
        mark, colour = ("s", "C3") if words == "fold" else ("o", "C2")
        full, named = "white" if words == "barrier" else colour, load if words == "fold" else energy
        for axes, y in ((load, one["load"]), (energy, 1e3 * one["energy"])):
            axes.plot(one["h"], y, mark, color=colour, mfc=full, ms=6)
            if axes is named:
                note(axes, words, (one["h"], y), (0, -7 if low else 7), color=colour,
                     ha="center", va="top" if low else "bottom")  # fmt: skip
    load.set(xlabel="height [m]", ylabel="load [N], compression > 0", title="path under load")
    energy.set(xlabel="height [m]", ylabel="energy [mJ]", title="energy on it")
    for axes in (load, energy):
        axes.margins(0.12, 0.17)
    for axes, state, kind in zip(below.subplots(1, 2), RATIOS, KINDS, strict=True):
        profiles(axes, tables[f"wave, {state}"])
        axes.set_title(f"{state} state: {kind}, at 0 and {TIME:g} s")


def table(tables):
    """The states, and how the runs end."""
    yield from lines(tables["states"])
    for state in RATIOS:
        of, peak = tables[f"wave, {state}"], tables[f"peak, {state}"]
        off = {f"{name} off": float(np.abs(of[f"{name}, run"] - of[f"{name}, exact"]).max())
               for name in ("du", "dphi")}  # fmt: skip
        yield (
            {"state": f"wave at the {state}"} | {key: float(x[0]) for key, x in peak.items()} | off
        )
