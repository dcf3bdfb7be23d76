"""Bistable bonds limit the torque of an impact on the wall to that which switches one of them.

Twenty squares with strings of both hands join 21 discs, the last of which is held; the first is
struck.  In one well the blow runs through the chain to the wall.  With two, the bonds near the blow
switch to their upper wells and keep part of its energy there, and the blow pushes the wall with at
most the torque that ends a well, as long as there are bonds to switch; what is thrown back later
pulls with more (S. Shan et al., Adv. Mater. 27, 4296 (2015), for compression).
"""

from functools import cache

import numpy as np
from scipy.optimize import brentq

from figures._draw import note
from figures._tables import arrays
from figures.transition_units import natural
from tensegrity import Chain, Record, State, catalogue, simulate

GROUP = "waves"

BONDS, BLOW, TORQUE = 20, 0.2, 3e-3  # discs of 1 kg m^2; rad/s of the first; N m on each bond
END, DT = 400.0, 0.1  # s
PRESTRAINS = {"one well": np.linspace(0.1, 0.24, 8), "two wells": np.linspace(0.255, 0.315, 13)}


@cache
def bond(prestrain):
    """The spring between two discs, by their relative twist."""
    rest = natural(prestrain)
    return catalogue.twin_strings(sides=4).varied({"N": rest, "N_2": rest, "M": TORQUE})


@cache
def well(prestrain, side=1):
    """The lower (side = 1) or the upper well [rad]."""
    one, twists = bond(prestrain), side * np.linspace(0.0 if side > 0 else 0.02, 0.78, 2001)
    torque = side * one.tension(twists)
    k = np.flatnonzero((torque[:-1] < 0) & (torque[1:] >= 0))[0]
    return brentq(lambda x: float(one.tension(x)), *sorted(twists[k : k + 2]), xtol=1e-15)


def fold(prestrain):
    """Torque at which the lower well ends [N m]."""
    return -float(bond(prestrain).tension(np.linspace(0.0, well(prestrain), 4001)).min())


def run(prestrain):
    """Times, torque on the wall, and elongations [s], [N m], [rad] after the blow on a chain of
    bonds with this prestrain."""
    one = bond(prestrain)
    u = np.append(-np.cumsum(np.full(BONDS, well(prestrain)))[::-1], 0.0)
    v = np.append(BLOW, np.zeros(BONDS))
    chain = Chain(one, BONDS + 1, ends=("free", "fixed"))
    record = Record(times=np.linspace(0, END, 2001))
    found = simulate(chain, State(u, v), END, dt=DT, record=record)
    twist = np.diff(found.u)
    return found.t, -one.tension(twist[:, -1]), twist


def stored(prestrain, twist):
    """Least number of bonds in the upper well over the last quarter, and the part of the blow's
    energy in them."""
    try:
        upper = well(prestrain, -1)
    except IndexError:
        return 0, 0.0
    least = int(np.sum(twist[3 * len(twist) // 4 :] < 0, axis=1).min())
    lifted = np.subtract(*bond(prestrain).energy([upper, well(prestrain)]))
    return least, least * float(lifted) / (BLOW**2 / 2)


def data():
    """Peaks and energies by prestrain, and the history of the lowest peak of each kind."""
    tables = {}
    for name, prestrains in PRESTRAINS.items():
        runs, rows = [run(p) for p in prestrains], []
        for p, (_, torque, twist) in zip(prestrains, runs, strict=True):
            bonds, part = stored(p, twist)
            rows.append({"prestrain": p, "peak": torque.max(), "bonds": bonds, "stored": part,
                         "fold": fold(p)})  # fmt: skip
        tables[name] = arrays(rows)
        t, torque, _ = runs[tables[name]["peak"].argmin()]
        tables[f"best of {name}"] = {"t": t[::2], "torque": torque[::2]}
    return tables


def draw(figure, tables):
    """Peaks and stored energy by prestrain above, histories below."""
    figure.set_size_inches(11, 8)
    axes = figure.subplot_mosaic([["peak", "kept"], ["torque"] * 2])
    for k, (name, color) in enumerate((("one well", "C1"), ("two wells", "C0"))):
        x, peak, *_ = tables[name].values()
        axes["peak"].plot(x, 1e3 * peak, color, marker="o", ms=4)
        note(axes["peak"], name, (x[0], 1e3 * peak[0]), (4, 8), color=color)
        t, torque = tables[f"best of {name}"].values()
        axes["torque"].plot(t, 1e3 * torque, color, lw=1)
        words = f"best of {name}: {1e3 * peak.min():.2f} mN m"
        note(axes["torque"], words, (0.98, 0.93 - 0.08 * k), inside=True, ha="right", color=color)
    x, _, bonds, share, ends = tables["two wells"].values()
    axes["peak"].plot(x, 1e3 * ends, "k--", lw=1)
    note(axes["peak"], "dashed: the torque that ends a well", (0.65, 0.07), inside=True, ha="right")
    axes["kept"].bar(x, 100 * share, width=0.003, color="C0")
    for place in zip(x[bonds > 0], 100 * share[bonds > 0], bonds[bonds > 0], strict=True):
        note(axes["kept"], f"{place[2]:g}", place[:2], (0, 3), ha="center")
    axes["peak"].set(ylabel="peak push on the wall [mN m]", ylim=(0, None))
    axes["kept"].set(ylabel="energy of the blow kept [%]", ylim=(0, None))
    for name in ("peak", "kept"):
        axes[name].set(xlabel="prestrain of all bonds", xlim=(0.09, 0.325))
    axes["torque"].set(xlabel="time [s]", ylabel="torque on the wall [mN m]", ylim=(None, 140))
    axes["peak"].set_title("Two wells: the wall is pushed no more than ends a well")
    axes["kept"].set_title("Kept in upper wells, and how many bonds stay there")
    axes["torque"].set_title("What the wall feels: pushed > 0, later pulled")


def table(tables):
    """Peaks, the torque that ends a well, and what is kept."""
    for name in PRESTRAINS:
        x, peak, bonds, share, ends = tables[name].values()
        k, most = peak.argmin(), share.argmax()
        yield {
            "bonds": name, "lowest peak [N m]": float(peak[k]), "at prestrain": float(x[k]),
            "fold there [N m]": float(ends[k]), "most kept": float(share[most]),
            "at": float(x[most]), "upper bonds": int(bonds[most]),
            "largest pull [N m]": float(-tables[f"best of {name}"]["torque"].min()),
        }  # fmt: skip
