"""Prestrain and preload tune the bands of a chain of prisms, also during wave propagation.

Alternating masses on equal prisms: the edges of the gap and the cut-off scale with the square root
of the axial stiffness.  Then a chain is driven at one frequency while its cross strings are
shortened and released: the gap moves over that frequency, and no wave is transmitted meanwhile.
Source: the talk, "tunable" and "adjusted on the fly, through suitable control of prestress".
"""

import math

import numpy as np

from tensegrity import Chain, Damping, Drive, EquilibriumError, Prism, Record, dispersion, simulate

NAME = "driven_tuning"
GROUP = "driven"

HEIGHT, MASSES = 0.8, (1.0, 2.5)  # m, kg; base 1 m, k_cross 1 N/m
PRESTRAINS = np.geomspace(2e-3, 0.2, 41)
PRELOADS = (0.0, 0.02, 0.05)  # N
CELLS, FAR, SOFT, STRENGTH = 40, 12, 18, 0.1  # cells; the observed one; dashpots; N s/m
BEFORE, AFTER, T_END = 0.05, 0.08, 1200.0  # prestrains; s
SIZE = 1e-4  # m


def edges(prestrain, preload=0.0):
    """Lower and upper edge of the gap, and the cut-off [rad/s]; NaN where no prism stands."""
    try:
        spring = Prism(1.0, HEIGHT, prestrain, 1.0).potential(preload)
    except EquilibriumError:
        return (math.nan,) * 3
    low, high = dispersion(spring, MASSES, [math.pi])[0]
    return low, high, dispersion(spring, MASSES, [0.0])[0, 1]


def frequency():
    """A frequency first in the optic band, later in the middle of the gap [rad/s]."""
    low, high, _ = edges(AFTER)
    return 0.5 * (low + high)


def shaken():
    """A chain that is driven, and whose prestrain changes, at once."""
    import sympy as sp

    t, w = sp.Symbol("t"), frequency()
    turns = [sp.tanh((t - share * T_END) / (0.03 * T_END)) for share in (0.35, 0.7)]
    prestrain = BEFORE + (AFTER - BEFORE) * (turns[0] - turns[1]) / 2
    spring = Prism(1.0, HEIGHT, BEFORE, 1.0).potential().over_time(prestrain=prestrain)
    grown = 1 - sp.exp(-((t / (0.05 * T_END)) ** 2))
    cells = np.arange(2 * CELLS) / 2
    ground = STRENGTH * np.clip((cells - SOFT) / (CELLS - SOFT), 0, None) ** 2
    chain = Chain(
        spring, 2 * CELLS, np.tile(MASSES, CELLS), damping=Damping(ground=ground),
        drive={0: Drive(displacement=SIZE * grown * sp.sin(w * t))},
    )  # fmt: skip
    record = Record(interval=1.0, sites=(2 * FAR,))
    run = simulate(chain, chain.at_rest(), T_END, method="rkn6", record=record)
    strain = np.array([float(prestrain.subs(t, x)) for x in run.t[::20]])
    return run, strain


def data():
    """Edges over prestrain for each preload; the transmitted wave as the prestrain changes."""
    tables, names = {}, ("gap from", "gap to", "cut-off")
    for preload in PRELOADS:
        found = zip(*(edges(p, preload) for p in PRESTRAINS), strict=True)
        columns = dict(zip(names, map(np.array, found), strict=True))
        tables[f"preload {preload:g} N"] = {"prestrain": PRESTRAINS, **columns}
    run, strain = shaken()
    low, high, _ = np.transpose([edges(p) for p in strain])
    return tables | {
        "arrived": {"t": run.t, "u": run.u[:, 0] / SIZE},
        "prestrain": {"t": run.t[::20], "prestrain": strain, "gap from": low, "gap to": high},
        "run": {"frequency": [frequency()], "balance": [run.energy_error]},
    }


def draw(figure, tables):
    """Bands above, a tuned run below."""
    figure.set_size_inches(9, 7)
    above, below = figure.subfigures(2, 1)
    highest = max(np.nanmax(tables[f"preload {x:g} N"]["cut-off"]) for x in PRELOADS)
    titles = "Prestrain moves the bands", "less so under 0.02 N", "and under 0.05 N"
    panels = above.subplots(1, 3, sharey=True)
    for ax, preload, title in zip(panels, PRELOADS, titles, strict=True):
        x, low, high, top = tables[f"preload {preload:g} N"].values()
        for bottom, up, style in ((0, low, {"color": "C0", "alpha": 0.25}),
                                  (low, high, {"color": "0.85"}),
                                  (high, top, {"color": "C3", "alpha": 0.25})):  # fmt: skip
            ax.fill_between(x, bottom, up, **style)
        ax.plot(x, top, "k-", lw=1)
        ax.set(xscale="log", xlabel="prestrain", ylim=(0, 1.05 * highest), title=title)
    panels[0].set_ylabel("frequency [rad/s]")
    for words, y, color in (("acoustic band", 0.9, "C0"), ("gap", 2.6, "0.35"),
                            ("optic band", 3.6, "C3"), ("cut-off", 4.2, "k")):  # fmt: skip
        panels[2].annotate(words, (3e-3, y), color=color)
    gap, arrived = below.subplots(1, 2)
    t, _, low, high = tables["prestrain"].values()
    w = tables["run"]["frequency"][0]
    gap.fill_between(t, low, high, color="0.85")
    gap.axhline(w, color="C2")
    gap.annotate("gap", (600, 1.7), color="0.35", ha="center")
    gap.annotate("drive", (20, w - 0.2), color="C2")
    gap.set(xlabel="time [s]", ylabel="frequency [rad/s]", ylim=(0, 1.5 * w),
            title=f"Prestrain from {BEFORE:g} to {AFTER:g} and back moves the gap")  # fmt: skip
    arrived.plot(*tables["arrived"].values(), "C2", lw=0.6)
    arrived.set(xlabel="time [s]", ylabel=f"displacement in cell {FAR} over the drive's",
                title="and meanwhile no wave arrives")  # fmt: skip


def table(tables):
    """Ranges of the edges; the wave transmitted before, during and after the change."""
    rows = []
    for preload in PRELOADS:
        x, low, high, top = tables[f"preload {preload:g} N"].values()
        rows.append({
            "chain": f"prisms, preload {preload:g} N, prestrain {x[0]:g} to {x[-1]:g}",
            "gap from [rad/s]": f"{np.nanmin(low):.4f} to {np.nanmax(low):.4f}",
            "to": f"{np.nanmin(high):.4f} to {np.nanmax(high):.4f}",
            "cut-off": f"{np.nanmin(top):.4f} to {np.nanmax(top):.4f}",
        })  # fmt: skip
    t, u = tables["arrived"].values()
    before, between, after = (np.abs(u[(t > a * T_END) & (t < b * T_END)]).max()
                              for a, b in ((0.2, 0.3), (0.55, 0.65), (0.9, 1.0)))  # fmt: skip
    rows.append({
        "chain": f"driven at {tables['run']['frequency'][0]:.4f} rad/s and tuned",
        "in the gap, over the drive": between, "in the band": min(before, after),
        "balance of energy": tables["run"]["balance"][0],
    })  # fmt: skip
    return rows
