"""Bistable bonds limit the torque of an impact on the wall to that which switches one of them.

Twenty squares with strings of both hands join 21 discs, the last of which is held; the first is
struck.  In one well the blow runs through the chain to the wall.  With two, the bonds near the blow
switch to their upper wells and keep part of its energy there, and the blow pushes the wall with at
most the torque that ends a well, as long as there are bonds to switch; what is thrown back later
pulls with more (S. Shan et al., Adv. Mater. 27, 4296 (2015), for compression).  The prestrains of
four groups of bonds are then optimised by gradients of the peak.
"""

from functools import cache

import numpy as np
from scipy.optimize import brentq, minimize

from figures._draw import note
from figures._tables import arrays
from figures.transition_units import natural
from tensegrity import Chain, Record, State, catalogue, gradient, simulate
from tensegrity import objective as o

GROUP = "waves"

BONDS, BLOW, TORQUE = 20, 0.2, 3e-3  # discs of 1 kg m^2; rad/s of the first; N m on each bond
END, DT = 400.0, 0.1  # s
PRESTRAINS = {"one well": np.linspace(0.1, 0.24, 8), "two wells": np.linspace(0.255, 0.315, 13)}
GROUPS, START, RANGE = 4, 0.285, (0.2525, 0.32)  # of equal bonds; prestrains with two wells
STEPS = 8  # of the descent


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


def struck(groups):
    """The chain of groups of as many bonds, of one prestrain each, and its state after the blow."""
    prestrains = np.repeat(groups, BONDS // len(groups))
    u = np.append(-np.cumsum([well(p) for p in prestrains[::-1]])[::-1], 0.0)
    v = np.append(BLOW, np.zeros(BONDS))
    chain = Chain([bond(p) for p in prestrains], BONDS + 1, ends=("free", "fixed"))
    return chain, State(u, v)


def run(groups):
    """Times, torque on the wall, and elongations [s], [N m], [rad] after the blow."""
    chain, state = struck(groups)
    found = simulate(chain, state, END, dt=DT, record=Record(times=np.linspace(0, END, 2001)))
    twist = np.diff(found.u)
    return found.t, -chain.springs[-1].tension(twist[:, -1]), twist


def peak(groups):
    """Largest torque on the wall [N m], and its derivatives by the prestrains of the groups."""
    wall = o.peak(o.load(bond=BONDS - 1))
    found = gradient(wall, *struck(groups), END, dt=DT, wanted=("N", "N_2"))
    lengths, wells = (
        np.repeat([(of(p + 1e-6) - of(p - 1e-6)) / 2e-6 for p in groups], BONDS // len(groups))
        for of in (natural, well)
    )
    moved = -np.cumsum(found.u)[:-1]  # the well of a bond moves the discs before it
    slopes = (found.by("N") + found.by("N_2")) * lengths + moved * wells
    return found.value, slopes.reshape(len(groups), -1).sum(axis=1)


def descended(start):
    """Lowest peaks [N m] along a descent by gradients, and the prestrains of groups at its end."""
    way, bounds = [peak(start)[0]], [RANGE] * len(start)
    found = minimize(
        peak, start, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": STEPS},
        callback=lambda intermediate_result: way.append(intermediate_result.fun),
    )  # fmt: skip
    return np.array(way), found.x


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
    """Peaks and energies by prestrain, the descent, and the history of each lowest peak."""
    tables = {}
    for name, prestrains in PRESTRAINS.items():
        runs, rows = [run([p]) for p in prestrains], []
        for p, (_, torque, twist) in zip(prestrains, runs, strict=True):
            bonds, part = stored(p, twist)
            rows.append({"prestrain": p, "peak": torque.max(), "bonds": bonds, "stored": part,
                         "fold": fold(p)})  # fmt: skip
        tables[name] = arrays(rows)
        t, torque, _ = runs[tables[name]["peak"].argmin()]
        tables[f"best of {name}"] = {"t": t[::2], "torque": torque[::2]}
    way, groups = descended(np.full(GROUPS, START))
    t, torque, _ = run(groups)
    tables["best of four groups"] = {"t": t[::2], "torque": torque[::2]}
    tables["descent"], tables["groups"] = {"peak": way}, {"prestrain": groups}
    return tables


def draw(figure, tables):
    """Peaks and stored energy by prestrain above, histories and the descent below."""
    figure.set_size_inches(11, 8)
    axes = figure.subplot_mosaic([["peak", "kept"], ["torque", "descent"]])
    way, groups = tables["descent"]["peak"], tables["groups"]["prestrain"]
    lowest = {name: tables[name]["peak"].min() for name in PRESTRAINS} | {"four groups": way[-1]}
    for k, (name, color) in enumerate(zip(lowest, ("C1", "C0", "C2"), strict=True)):
        t, torque = tables[f"best of {name}"].values()
        axes["torque"].plot(t, 1e3 * torque, color, lw=1)
        words = f"best of {name}: {1e3 * lowest[name]:.2f} mN m"
        note(axes["torque"], words, (0.98, 0.93 - 0.08 * k), inside=True, ha="right", color=color)
        if name in PRESTRAINS:
            x, peak, *_ = tables[name].values()
            axes["peak"].plot(x, 1e3 * peak, color, marker="o", ms=4)
            note(axes["peak"], name, (x[0], 1e3 * peak[0]), (4, 8), color=color)
    axes["descent"].plot(1e3 * way, "C2", marker="o", ms=4)
    axes["descent"].set(xlabel="step of the descent", ylabel="peak push on the wall [mN m]")
    axes["descent"].set(ylim=(0, None))
    words = "prestrains from blow to wall: " + ", ".join(f"{p:.3f}" for p in groups)
    note(axes["descent"], words, (0.98, 0.93), inside=True, ha="right")
    axes["descent"].set_title("Prestrains of four groups, by gradients")
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
    """Peaks, the torque that ends a well, and what is kept; the best of four groups."""
    for name in PRESTRAINS:
        x, peak, bonds, share, ends = tables[name].values()
        k, most = peak.argmin(), share.argmax()
        yield {
            "bonds": name, "lowest peak [N m]": float(peak[k]), "at prestrain": float(x[k]),
            "fold there [N m]": float(ends[k]), "most kept": float(share[most]),
            "at": float(x[most]), "upper bonds": int(bonds[most]),
            "largest pull [N m]": float(-tables[f"best of {name}"]["torque"].min()),
        }  # fmt: skip
    yield {
        "bonds": "four groups, by gradients",
        "lowest peak [N m]": float(tables["descent"]["peak"][-1]),
        "largest pull [N m]": float(-tables["best of four groups"]["torque"].min()),
    }
