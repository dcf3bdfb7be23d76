"""Validity of the chain of springs: waves in columns of prisms with shared triangles.

A column of elastic prisms is struck at one end, with initial velocities in a half bell over
some units: once as masses and members in space, slack strings included, once as a chain of springs
with the mass of a triangle at each site.  Both are free.  For pulses of ten units the
chain has the peak within 6 %, but the speed within 14 % only.  For a sudden blow it has neither:
neighbours that have a triangle in common resist, the peak is 0.43 to 0.77 of that of the chain, and
rotational motions run ahead of it.
"""

from __future__ import annotations

import numpy as np

from figures._files import lines
from tensegrity import Chain, Prism, Record, simulate

NAME = "structures_waves"
GROUP = "structures"

SHAPES = ((0.5, 0.4), (0.7, 0.1), (1.0, 0.1))  # height over base, prestrain of cross strings
STIFFNESS = {"k_cross": 1.0, "k_base": 5.0, "k_bar": 50.0}
WIDTHS = (1, 4, 10)  # units over which the velocity of the blow falls to 0
BLOWS = (1e-3, 0.03)  # its largest velocity over the sound speed
UNITS, NEAR, FAR = 40, 12, 24  # of the column; the units that are watched
ROWS = 800


def struck(prism, blow, width):
    """Compression of the two units, (rows, 2), of the chain and of the column; and the times, in
    units travelled at the sound speed."""
    rate = np.sqrt(prism.axial_stiffness() / prism.sides)  # nodes of 1 kg
    end = FAR + 2 * width + 6
    times = np.linspace(0, end, ROWS)
    record = Record(times=times / rate)
    start = blow * rate * prism.height * np.cos(np.pi / 2 * np.arange(width) / width) ** 2
    chain = Chain(prism.potential(), UNITS + 1, mass=float(prism.sides))
    line = simulate(chain, chain.at_rest(dict(enumerate(start.tolist()))), end / rate, tol=1e-5,
                    record=record)  # fmt: skip
    scene = prism.column(UNITS).network()
    blows = {n: (0, 0, start[n // prism.sides]) for n in range(prism.sides * width)}
    space = simulate(scene, scene.at_rest(blows), end / rate, tol=1e-5, record=record)
    heights = space.u[:, :, 2].reshape(ROWS, UNITS + 1, prism.sides).mean(axis=2)
    watched = [-np.diff(u, axis=1)[:, [NEAR, FAR]] for u in (line.u, heights)]
    return times, *watched


def peak(times, compression):
    """Speed between the units over that of sound, and largest compression of the far one [m]."""
    rows = compression.argmax(axis=0)
    return (FAR - NEAR) / float(np.diff(times[rows])[0]), float(compression[:, 1].max())


def data(progress=iter):
    """Speed and peak of both, and the compression of the far unit for one shape."""
    rows, tables = [], {}
    cases = [(*shape, w, b) for shape in SHAPES for w in WIDTHS for b in BLOWS]
    for slenderness, prestrain, width, blow in progress(cases):
        prism = Prism(1.0, slenderness, prestrain, **STIFFNESS)
        times, line, space = struck(prism, blow, width)
        one, other = peak(times, line), peak(times, space)
        rows.append((slenderness, prestrain, width, blow, one[0], other[0],
                     one[1] / slenderness, other[1] / slenderness))  # fmt: skip
        if (slenderness, prestrain) == SHAPES[-1] and blow == BLOWS[0] and width != WIDTHS[1]:
            tables[f"trace_{width}"] = {
                "time": times, "chain": line[:, 1] / slenderness,
                "column": space[:, 1] / slenderness,
            }  # fmt: skip
    names = ("slenderness", "prestrain", "width", "blow", "chain_speed", "column_speed",
             "chain_peak", "column_peak")  # fmt: skip
    return {"map": dict(zip(names, map(list, zip(*rows, strict=True)), strict=True)), **tables}


def draw(figure, tables):
    """Peak and speed of the column over those of the chain; two traces."""
    figure.set_size_inches(10, 7)
    cells = figure.subplots(2, 2)
    table = {name: np.array(values) for name, values in tables["map"].items()}
    for axes, name in zip(cells[0], ("peak", "speed"), strict=True):
        for k, (slenderness, prestrain) in enumerate(SHAPES):
            for blow, style in zip(BLOWS, ("o-", "s--"), strict=True):
                rows = (table["slenderness"] == slenderness) & (table["blow"] == blow)
                ratio = table[f"column_{name}"][rows] / table[f"chain_{name}"][rows]
                axes.plot(table["width"][rows], ratio, style, color=f"C{k}",
                          label=f"height {slenderness:g} m, prestrain {prestrain:g}"
                          if blow == BLOWS[0] else None)  # fmt: skip
        axes.axhline(1, color="0.4", lw=0.8)
        axes.set(xlabel="width of the blow [units]", ylim=(0, 1.2), xticks=WIDTHS,
                 ylabel=f"{name} of the column / of the chain")  # fmt: skip
    cells[0, 0].legend(fontsize=8, loc="lower right")
    cells[0, 1].plot([], [], "ko-", label=f"blow {BLOWS[0]:g} of the sound speed")
    cells[0, 1].plot([], [], "ks--", label=f"blow {BLOWS[1]:g}")
    cells[0, 1].legend(fontsize=8, loc="lower right")
    for axes, width in zip(cells[1], (WIDTHS[0], WIDTHS[-1]), strict=True):
        trace = tables[f"trace_{width}"]
        axes.plot(trace["time"], 1e4 * np.array(trace["chain"]), "0.5", label="chain")
        axes.plot(trace["time"], 1e4 * np.array(trace["column"]), "C2", label="column")
        word = "1 unit" if width == 1 else f"{width} units"
        axes.set_title(f"height 1 m, blow of {word}", fontsize=10)
        axes.set(xlabel="time [units travelled at sound speed]",
                 ylabel=f"strain of unit {FAR}, 1e-4,\ncompression > 0")  # fmt: skip
        axes.legend(fontsize=8, loc="upper left")


def table(tables):
    """Each case of the map."""
    return lines(tables["map"])
