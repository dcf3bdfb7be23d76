"""Bistable bonds limit the torque of an impact on the wall to that which switches one of them.

Twenty squares with strings of both hands join 21 discs, the last of which is held; the first is
struck.  In one well the blow runs through the chain to the wall.  With two, the bonds near the blow
switch to their upper wells and keep part of its energy there, and the blow pushes the wall with at
most the torque that ends a well, as long as there are bonds to switch; what is thrown back later
pulls with more (S. Shan et al., Adv. Mater. 27, 4296 (2015), for compression).  The prestrain is
optimised by gradients of the peak: first the same of all bonds, from the best of a scan, then that
of four groups, from equal ones and from the best that the evolution strategy of
`granular.design.search` finds.
"""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace

import numpy as np

from figures.transition_units import natural
from granular.design.methods import POPULATION, adapting
from tensegrity import Chain, LockingError, Record, State, catalogue, gradient, simulate
from tensegrity import objective as o

NAME = "transition_trap"
GROUP = "waves"

BONDS, BLOW, TORQUE = 20, 0.2, 3e-3  # discs of 1 kg m^2; rad/s of the first; N m on each bond
END, DT = 400.0, 0.1  # s
ONE_WELL = np.linspace(0.1, 0.24, 8)  # prestrains
TWO_WELLS = np.linspace(0.255, 0.315, 13)
GROUPS, STEPS, FIRST, LEAST = 4, 8, 4e-3, 1e-4  # of equal bonds; of the descent, in prestrain
START, RANGE = 0.285, (0.2525, 0.32)
SPLITS = 0.25  # prestrain
GRID, POPULATIONS, SEED = 1e-3, 20, 0  # of prestrains in the search


@cache
def bond(prestrain):
    """The spring between two discs, by their relative twist."""
    rest = natural(prestrain)
    return unit().varied({"N": rest, "N_2": rest, "M": TORQUE})


@cache
def unit():
    return catalogue.twin_strings(sides=4)


@cache
def well(prestrain, side=1):
    """The lower (side = 1) or the upper well [rad], and how it changes with the prestrain."""
    from scipy.optimize import brentq

    one = bond(prestrain)
    twists = side * np.linspace(0.0 if side > 0 else 0.02, 0.78, 2001)
    outward = np.flatnonzero(side * one.tension(twists[1:]) >= 0)
    inward = np.flatnonzero(side * one.tension(twists[:-1]) < 0)
    k = outward[outward >= inward[0]][0]
    place = brentq(lambda x: float(one.tension(x)), *sorted(twists[k : k + 2]), xtol=1e-15)
    h = 1e-6
    rest = natural(prestrain)
    ends = (one.varied({"N": rest + s, "N_2": rest + s}) for s in (h, -h))
    slope = np.subtract(*(float(end.tension(place)) for end in ends)) / (2 * h)
    return place, -slope / float(one.stiffness(place)) * by_prestrain(prestrain)


def by_prestrain(prestrain):
    """Derivative of the natural length [m]."""
    return -natural(prestrain) / (1 + prestrain)


def fold(prestrain):
    """Torque at which the lower well ends [N m]."""
    return -float(bond(prestrain).tension(np.linspace(0.0, well(prestrain)[0], 4001)).min())


def struck(prestrains):
    """The chain of bonds with these prestrains, and its state after the blow."""
    places = np.array([well(p)[0] for p in prestrains])
    u = np.append(-np.cumsum(places[::-1])[::-1], 0.0)
    v = np.zeros(BONDS + 1)
    v[0] = BLOW
    return Chain([bond(p) for p in prestrains], BONDS + 1, ends=("free", "fixed")), State(u, v)


def run(prestrains):
    """Times, torque on the wall, and elongations [s], [N m], [rad]."""
    chain, state = struck(prestrains)
    one = simulate(chain, state, END, dt=DT, record=Record(times=np.linspace(0, END, 2001)))
    twist = np.diff(one.u)
    return one.t, -chain.springs[-1].tension(twist[:, -1]), twist


def stored(prestrain, twist):
    """Least number of bonds in the upper well over the last quarter, and the part of the blow's
    energy in them."""
    try:
        upper = well(prestrain, -1)[0]
    except IndexError:
        return 0, 0.0
    least = int(np.sum(twist[3 * len(twist) // 4 :] < 0, axis=1).min())
    one = bond(prestrain)
    lifted = float(one.energy(upper) - one.energy(well(prestrain)[0]))
    return least, least * lifted / (BLOW**2 / 2)


def peak(groups):
    """Largest torque on the wall [N m], and its derivatives by the prestrains of groups of bonds,
    as many in each."""
    prestrains = np.repeat(groups, BONDS // len(groups))
    chain, state = struck(prestrains)
    wall = o.peak(o.load(bond=BONDS - 1))
    found = gradient(wall, chain, state, END, dt=DT, wanted=("N", "N_2"))
    slopes = (found.by("N") + found.by("N_2")) * [by_prestrain(p) for p in prestrains]
    moved = -np.cumsum(found.u)[:-1]  # by the well of each bond, which moves the discs before it
    slopes += moved * [well(p)[1] for p in prestrains]
    return found.value, slopes.reshape(len(groups), -1).sum(axis=1)


def highest(prestrains):
    """Peak torque on the wall [N m]; infinite if a bond turns over."""
    try:
        return run(prestrains)[1].max()
    except LockingError:
        return np.inf


def searched(populations=POPULATIONS, seed=SEED):
    """Lowest peak [N m] after each population, and the prestrains of groups of the last one."""
    low, high = np.ceil(RANGE[0] / GRID), np.floor(RANGE[1] / GRID)
    space = SimpleNamespace(
        count=GROUPS, diameters=RANGE,
        projected=lambda rows: np.round(np.clip(np.round(rows / GRID), low, high) * GRID, 12),
    )  # fmt: skip
    proposals = adapting(space, np.random.default_rng(seed))
    rows, best, way = next(proposals), (np.inf, None), []
    for _ in range(populations):
        peaks = np.array([highest(np.repeat(row, BONDS // GROUPS)) for row in rows])
        best = min(best, (peaks.min(), tuple(rows[peaks.argmin()])))
        way.append(best[0])
        rows = proposals.send((rows, peaks))
    return np.array(way), np.array(best[1])


def descended(start):
    """Peaks [N m] along a descent by gradients from prestrains of groups of as many bonds each, and
    those at its end."""
    x, reach = np.array(start), FIRST
    (height, slopes), way = peak(x), []
    for _ in range(STEPS):
        way.append(height)
        trial = np.clip(x - reach * slopes / np.abs(slopes).max(), *RANGE)
        there = peak(trial)
        if there[0] < height:
            x, (height, slopes), reach = trial, there, 1.5 * reach
        else:
            reach /= 3
        if reach < LEAST:
            break
    return np.array([*way, height]), x


def data():
    """Peaks and energies by prestrain, what both optimisations find, and three histories."""
    tables = {}
    for name, prestrains in (("one well", ONE_WELL), ("two wells", TWO_WELLS)):
        rows = {"prestrain": prestrains, "peak": [], "bonds": [], "stored": [], "fold": []}
        for p in prestrains:
            _, torque, twist = run([p] * BONDS)
            found = torque.max(), *stored(p, twist), fold(p)
            for key, value in zip(("peak", "bonds", "stored", "fold"), found, strict=True):
                rows[key].append(value)
        tables[name] = {key: np.array(value) for key, value in rows.items()}
    lowest, first = (found["prestrain"][np.argmin(found["peak"])] for found in tables.values())
    best, way = descended([first])[1][0], descended(np.full(GROUPS, START))
    found = searched()
    last = descended(found[1])
    tables["descent"] = {"peak": way[0]}
    tables["search"] = {"peak": found[0]}
    tables["descent from there"] = {"peak": last[0]}
    lowest_way = min(way, last, key=lambda each: each[0][-1])
    tables["groups"] = {"by gradients": way[1], "by search": found[1], "by both": last[1]}
    tables["best"] = {"one well": np.array([lowest]), "two wells": np.array([best])}
    chains = {"best of one well": [lowest] * BONDS, "best of two wells": [best] * BONDS,
              "best of four groups": np.repeat(lowest_way[1], BONDS // GROUPS)}  # fmt: skip
    for name, prestrains in chains.items():
        t, torque, _ = run(prestrains)
        tables[name] = {
            "t": t[::2],
            "torque": torque[::2],
            "peak": np.full(len(t[::2]), torque.max()),
        }
    return tables


def draw(figure, tables):
    """Peaks and stored energy by prestrain above, histories and the descent below."""
    figure.set_size_inches(11, 8)
    panels = figure.subplots(2, 2)
    ax = panels[0, 0]
    for name, color in (("one well", "C1"), ("two wells", "C0")):
        found = tables[name]
        ax.plot(found["prestrain"], 1e3 * found["peak"], color, marker="o", ms=4)
        ax.annotate(name, (found["prestrain"][0], 1e3 * found["peak"][0]), (4, 8),
                    textcoords="offset points", color=color)  # fmt: skip
    two = tables["two wells"]
    ax.plot(two["prestrain"], 1e3 * two["fold"], "k--", lw=1)
    ax.annotate("dashed: the torque that ends a well", (0.65, 0.07), ha="right",
                xycoords="axes fraction")  # fmt: skip
    ax.axvline(SPLITS, color="0.6", lw=1)
    ax.set(xlabel="prestrain of all bonds", ylabel="peak push on the wall [mN m]", ylim=(0, None))
    ax.set_title("(a) Two wells: the wall is pushed no more than ends a well", fontsize=10)
    ax = panels[0, 1]
    ax.bar(two["prestrain"], 100 * two["stored"], width=0.003, color="C0")
    for p, share, bonds in zip(two["prestrain"], two["stored"], two["bonds"], strict=True):
        if bonds:
            ax.annotate(f"{bonds:g}", (p, 100 * share), (0, 3), textcoords="offset points",
                        ha="center", fontsize=10)  # fmt: skip
    ax.set(xlabel="prestrain of all bonds", ylabel="energy of the blow kept [%]")
    ax.set(xlim=panels[0, 0].get_xlim(), ylim=(0, None))
    ax.set_title("(b) Kept in upper wells, and how many bonds stay there", fontsize=10)
    ax, names = panels[1, 0], ("best of one well", "best of two wells", "best of four groups")
    for k, (name, color) in enumerate(zip(names, ("C1", "C0", "C2"), strict=True)):
        found = tables[name]
        ax.plot(found["t"], 1e3 * found["torque"], color, lw=1)
        ax.annotate(f"{name}: {1e3 * found['peak'][0]:.2f} mN m", (0.98, 0.93 - 0.08 * k),
                    xycoords="axes fraction", ha="right", color=color)  # fmt: skip
    ax.set(xlabel="time [s]", ylabel="torque on the wall [mN m]")
    ax.set_title("(c) What the wall feels: pushed > 0, later pulled", fontsize=10)
    ax.set(ylim=(None, 140))
    ax = panels[1, 1]
    begun = len(tables["search"]["peak"]) * POPULATION
    for name, color, designs in (("descent", "C2", 1), ("descent from there", "C3", begun)):
        way = tables[name]["peak"]
        ax.semilogx(designs + np.arange(len(way)), 1e3 * way, color, marker="o", ms=4)
    way = tables["search"]["peak"]
    ax.semilogx(POPULATION * np.arange(1, len(way) + 1), 1e3 * way, "C4", marker=".")
    ax.annotate("gradients", (2, 17), color="C2")
    ax.annotate("search", (80, 5.5), color="C4")
    ax.annotate("then gradients", (begun, 2.2), color="C3", ha="right")
    ax.set(xlabel="designs computed", ylabel="lowest peak push on the wall [mN m]", ylim=(0, None))
    words = ", ".join(f"{p:.3f}" for p in tables["groups"]["by both"])
    ax.set_title(f"(d) Four groups; best, blow to wall: {words}", fontsize=10)


def table(tables):
    """Peaks, the torque that ends a well, and what is kept."""
    rows = []
    for name in ("one well", "two wells"):
        found = tables[name]
        k = int(np.argmin(found["peak"]))
        most = int(np.argmax(found["stored"]))
        rows.append({
            "bonds": name, "lowest peak [N m]": float(found["peak"][k]),
            "at prestrain": float(found["prestrain"][k]),
            "fold there [N m]": float(found["fold"][k]),
            "most kept": float(found["stored"][most]),
            "at": float(found["prestrain"][most]), "upper bonds": int(found["bonds"][most]),
        })  # fmt: skip
    for name in ("best of one well", "best of two wells", "best of four groups"):
        push = {"bonds": name, "lowest peak [N m]": float(tables[name]["peak"][0])}
        rows.append(push | {"largest pull [N m]": float(-tables[name]["torque"].min())})
    for name, way in (("by gradients", "descent"), ("by search", "search"),
                      ("by both", "descent from there")):  # fmt: skip
        rows.append({"bonds": f"four groups {name}",
                     "lowest peak [N m]": float(tables[way]["peak"][-1])})  # fmt: skip
    return rows
