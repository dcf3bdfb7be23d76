"""The mass of a tensegrity is in its bars: lumped at the nodes, it slows all modes of a tower.

The tower of two stages of TsgFEM, held at its base, with sections sized for one stress; nearly all
of its mass is in six bars.  With consistent masses its frequencies are those that were published;
with half of each member's mass at either end bars turn with three times their inertia.
Source: Ma, Chen & Skelton 2022, TsgFEM: Tensegrity Finite Element Method, JOSS 7, 3390, whose code
prints the frequencies.
"""

import numpy as np

from tensegrity import Structure, held

GROUP = "structures"

NODES = np.array([
    (10, 0, 0), (-5, 8.660254037844387, 0), (-5, -8.660254037844387, 0),
    (8.660254037844387, 5, 30), (-8.660254037844387, 5, 30), (0, -10, 30),
    (5, 8.660254037844387, 60), (-10, 0, 60), (5, -8.660254037844387, 60),
])  # fmt: skip
BARS = [(0, 4), (1, 5), (2, 3), (4, 8), (5, 6), (3, 7)]
STRINGS = [
    (3, 4), (4, 5), (5, 3), (6, 7), (7, 8), (8, 6),
    (0, 3), (1, 4), (2, 5), (3, 6), (4, 7), (5, 8),
]  # fmt: skip
ALIKE = 6, 3, 3, 6  # members of one section: bars, middle and upper triangle, uprights
EA = 1.8276127564266516e10, 34816243.71535878, 17408121.857679367, 52996079.17587026  # N
NATURAL = 35.68219463340943, 17.29266860849596, 17.292668608495955, 30.394374737195296  # m
MASS = 1245433.649539911, 62.346717284978986, 31.17335864248945, 166.80405839915707  # kg
PUBLISHED = [
    0.010888669723670856, 0.019539454953775917, 0.03396454232465901, 0.03396454232466567,
    0.19559331016018464, 0.1955933101601994, 0.2752722622063401, 0.2752722622063637,
    0.2934010791770417, 0.34845697203876896, 0.3484569720387873, 0.41251363411172426,
    3.9142912332076105, 3.914291233207611, 3.9258744719270924, 8.610031002648665,
    8.610031002648668, 8.620964452912498,
]  # fmt: skip
BASE = held([0, 1, 2])
SWAY = 2  # number of the mode that is drawn, from 0
LARGE = 6.0  # m, of its largest displacement in the picture
ENDS = ("x0", "z0", "x1", "z1")


def tower(**masses):
    """The tower, with the masses of its members along them, or other ones."""
    ea, natural, mass = (np.repeat(x, ALIKE) for x in (EA, NATURAL, MASS))
    given = {"bar_mass": mass[:6], "string_mass": mass[6:]} | masses
    return Structure(
        NODES, BARS, STRINGS, k_bar=(ea / natural)[:6], k_string=(ea / natural)[6:],
        natural_lengths=natural, **given,
    )  # fmt: skip


def lumped(structure):
    """The same with all masses at the nodes, half of each member's at either end."""
    none = {"bar_mass": None, "string_mass": None}
    return structure.at(structure.positions, mass=structure.weighing_mass, **none)


def data():
    s, count = tower(), len(PUBLISHED)
    exact, low = (x.modes(count, BASE) for x in (s, lumped(s)))
    hertz = [x.frequencies / (2 * np.pi) for x in (exact, low)]
    moved = s.positions + LARGE * exact.shapes[SWAY]
    lines = {}
    for name, x in (("at rest", s.positions), ("sways", moved)):
        for place, ends in zip(ENDS, (x[s.ends[:, e], k] for e in (0, 1) for k in (0, 2)),
                               strict=True):  # fmt: skip
            lines[f"{place} {name}"] = ends
    return {
        "frequencies": {"mode": np.arange(1, count + 1), "published": np.array(PUBLISHED),
                        "along members": hertz[0], "lumped": hertz[1]},
        "tower": {"string": s.is_string, **lines},
        "mass": {"bars": [MASS[0] * 6], "all": [float(s.weighing_mass.sum())]},
    }  # fmt: skip


def draw(figure, tables):
    """The frequencies of both, what lumping takes, and a mode of the tower."""
    figure.set_size_inches(10.5, 5.2)
    grid = figure.add_gridspec(2, 2, width_ratios=(1, 1.9), height_ratios=(1.5, 1))
    left, upper = figure.add_subplot(grid[:, 0]), figure.add_subplot(grid[0, 1])
    lower = figure.add_subplot(grid[1, 1], sharex=upper)
    table = tables["tower"]
    for name, shade in (("at rest", 0.0), ("sways", 0.65)):
        x0, z0, x1, z1 = (table[f"{place} {name}"] for place in ENDS)
        for k, string in enumerate(table["string"]):
            style = {"color": "C0", "lw": 1.0} if string else {"color": "0.1", "lw": 3.0}
            left.plot((x0[k], x1[k]), (z0[k], z1[k]), alpha=1 - shade, **style)
    left.set(aspect="equal", xlabel="x [m]", ylabel="z [m]",
             title=f"the tower, and how it sways in mode {SWAY + 1}")  # fmt: skip
    of = tables["frequencies"]
    upper.semilogy(of["mode"], of["published"], "o", mfc="none", ms=9, color="0.3",
                   label="published (TsgFEM)")  # fmt: skip
    upper.semilogy(of["mode"], of["along members"], ".", color="C0", label="mass along members")
    upper.semilogy(of["mode"], of["lumped"], "_", ms=9, mew=2, color="C3",
                   label="lumped at the nodes")  # fmt: skip
    upper.set(ylabel="frequency [Hz]", title="frequencies")
    upper.legend(frameon=False, loc="upper left")
    loss = 100 * (1 - np.array(of["lumped"]) / of["along members"])
    lower.bar(of["mode"], loss, color="C3", width=0.6)
    lower.set(xlabel="mode", ylabel="too low by [%]", xticks=of["mode"],
              title="what lumping takes")  # fmt: skip


def table(tables):
    of = tables["frequencies"]
    yield {"mode": "part of the mass that is in bars",
           "along members [Hz]": tables["mass"]["bars"][0] / tables["mass"]["all"][0]}  # fmt: skip
    for number, published, exact, low in zip(*of.values(), strict=True):
        yield {"mode": f"mode {int(number)}", "published [Hz]": float(published),
               "along members [Hz]": float(exact), "lumped [Hz]": float(low),
               "too low by [%]": float(100 * (1 - low / exact))}  # fmt: skip
