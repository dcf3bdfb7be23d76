"""A struck row of bistable discs switches from end to end; with the wells exchanged it does not.

Each disc has a square twin-string prism to the ground, whose strings hold it at one of two twists;
a torque makes one of them the lower.  A blow on the first disc that carries it over the barrier
releases the energy of the others one by one, and the front takes the speed of `transition_wave`.
A disc whose torque acts the other way stops it (N. Nadkarni et al., Phys. Rev. Lett. 116, 244501
(2016)).
"""

import numpy as np
from scipy.optimize import brentq

import tensegrity as ts
from figures._draw import note
from figures._scenes import linear
from figures._tables import arrays

GROUP = "waves"

PRESTRAIN, TORQUE = 0.28, 3e-3  # N m
COUPLING, DASHPOT = 0.05, 0.1  # N m/rad, N m s/rad
SPRING = linear(COUPLING)
SITES, BLOW, END = 40, 0.2, 500.0  # discs of 1 kg m^2; rad/s of the first; s
DEFECT = 20
TORQUES = (2e-3, 2.5e-3, 3e-3, 3.5e-3, 4e-3, 5e-3)
DASHPOTS = (0.1, 0.15, 0.25)
STRUCK = "struck in the upper wells, all switch"
ROWS = {STRUCK: (1, None), "in the lower wells, none does": (-1, None),
        "a disc biased the other way stops it": (1, DEFECT)}  # fmt: skip
INSTANTS, SKIP = 2001, 16


def unit(torque):
    """The spring to the ground."""
    return ts.catalogue.twin_strings(sides=4, prestrain=PRESTRAIN, torque=torque)


def wells(ground):
    """Twists of the upper and of the lower well [rad], of a positive torque."""
    near = brentq(lambda x: float(ground.stiffness(x)), 0.0, 0.35)
    far = brentq(lambda x: float(ground.stiffness(x)), -0.35, 0.0)
    both = (-0.5, far), (near, 0.5)
    return [brentq(lambda x: float(ground.tension(x)), *ends, xtol=1e-15) for ends in both]


def run(side, defect):
    """The run of a row whose discs rest in the upper (side = 1) or in the lower wells."""
    ground, (high, low) = [unit(TORQUE)] * SITES, wells(unit(TORQUE))
    u, v = np.full(SITES, high if side > 0 else low), np.zeros(SITES)
    if defect is not None:
        ground[defect] = unit(-TORQUE)
        u[defect] = -low  # the lower well of a disc biased the other way
    v[0] = side * BLOW
    chain = ts.Chain(SPRING, SITES, ground=ground, damping=ts.Damping(ground=DASHPOT))
    record = ts.Record(times=np.linspace(0, END, INSTANTS))
    return ts.simulate(chain, ts.State(u, v), END, tol=1e-6, record=record)


def front(torque, dashpot):
    """The front that leaves the upper wells."""
    ground = unit(torque)
    high, low = wells(ground)
    return ts.transition_wave(
        SPRING, ahead=high, behind=low, ground=ground, damping=ts.Damping(ground=dashpot)
    )


def measured(one):
    """Speed [sites/s] at which the twists of a run become positive in the middle of the row."""
    first, last = SITES // 3, 2 * SITES // 3
    passed = [one.t[np.flatnonzero(one.u[:, n] > 0)[0]] for n in (first, last)]
    return (last - first) / (passed[1] - passed[0])


def data():
    """Twists of the rows, and speeds of fronts."""
    tables = {}
    for name, (side, defect) in ROWS.items():
        one = run(side, defect)
        tables[name] = {"t": one.t[::SKIP]}
        tables[name] |= {f"twist {n}": one.u[::SKIP, n] for n in range(SITES)}
        if name == STRUCK:
            tables["run"] = {"speed": np.array([measured(one)])}
    for dashpot in DASHPOTS:
        rows = []
        for torque in TORQUES:
            one = front(torque, dashpot)
            rows.append({"torque": torque, "released": one.released, "speed": one.speed,
                         "residual": one.residual})  # fmt: skip
        tables[f"dashpot {dashpot:g}"] = arrays(rows)
    return tables


def twists(table):
    """(instants, discs)."""
    return np.column_stack([table[f"twist {n}"] for n in range(SITES)])


def draw(figure, tables):
    """Twists of three rows against time above, speeds of fronts below."""
    figure.set_size_inches(11, 7.6)
    panels = figure.subplot_mosaic([[*ROWS], ["speed"] * 3], height_ratios=(1.25, 1))
    for name in ROWS:
        ax, table = panels[name], tables[name]
        edges = -0.5, SITES - 0.5, table["t"][0], table["t"][-1]
        shown = ax.imshow(twists(table), cmap="coolwarm", vmin=-0.5, vmax=0.5, extent=edges,
                          aspect="auto", origin="lower")  # fmt: skip
        ax.set(xlabel="disc", ylabel="time [s]", title=name)
    figure.colorbar(shown, ax=[panels[name] for name in ROWS]).set_label("twist [rad]")
    ax, run_speed = panels["speed"], tables["run"]["speed"][0]
    for number, dashpot in enumerate(DASHPOTS):
        _, released, speed, _ = tables[f"dashpot {dashpot:g}"].values()
        color, words = f"C{number}", f"dashpot {dashpot:g} N m s/rad"
        ax.plot(1e3 * released, speed, color, marker="o", ms=4)
        note(ax, words, (1e3 * released[-1], speed[-1]), (6, -3), color=color)
        if dashpot == DASHPOT:
            there = 1e3 * released[TORQUES.index(TORQUE)], run_speed
            ax.plot(*there, "kx", ms=10, mew=1.5)
            note(ax, "run (a)", there, (-8, 8), ha="right")
    ax.set(xlabel="energy released by a disc [mJ]", ylabel="speed of the front [discs/s]")
    ax.set(xlim=(1.3, 4.1), ylim=(0, 0.125))
    ax.set_title("Fronts that release more are faster, dashpots slow them")


def table(tables):
    """How many discs each blow switches, and the speed of the front beside that of the wave."""
    rows = []
    for name in ROWS:
        u = twists(tables[name])
        switched = int(np.sum(np.sign(u[-1]) != np.sign(u[0])))
        rows.append({"row": name, "discs switched": switched, "of": SITES})
    rows[0] |= {
        "speed [discs/s]": float(tables["run"]["speed"][0]),
        "speed of the front": float(tables[f"dashpot {DASHPOT:g}"]["speed"][TORQUES.index(TORQUE)]),
        "largest residual": max(
            float(tables[f"dashpot {g:g}"]["residual"].max()) for g in DASHPOTS
        ),
    }
    return rows
