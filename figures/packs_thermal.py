"""The energy spreads over most beads, and heavy and light ones come to equal kinetic energies.

Lines of 40 beads of 10 mm between steel walls, all touching, the first started at 1 m/s. The long-
time mean of kinetic over total energy is 5/9 by the virial theorem for Hertz's law, whatever the
motion: it checks the run, and says nothing of equipartition. That is the ratio of the mean kinetic
energies of heavy and light beads: 1 in equilibrium.
"""

import numpy as np

from figures import _packs
from figures._draw import name_curves
from granular import Bead, chain, energies, materials, simulate
from tensegrity import Record

NAME = "packs_thermal"
GROUP = "packs"

STEEL, PTFE, GLASS = (Bead(0.01, materials[name]) for name in ("steel", "ptfe", "glass"))
LINES = {"steel": [STEEL] * 40, "steel, glass": [STEEL, GLASS] * 20,
         "steel, PTFE": [STEEL, PTFE] * 20, "PTFE": [PTFE] * 40}  # fmt: skip
END, DT, INTERVAL = 4e-2, 4e-7, 1e-5  # s
MIXED = ("steel, glass", "steel, PTFE")  # heavy and light beads in turn
MEAN = 400  # rows, of ratios that are drawn
EARLY, LATE = (0.0, 2e-3), (END / 2, END)  # s
SPANS = {  # s, and the mean number there of an independent code
    "steel": ((0, 2e-3, 2.49), (5e-3, 1e-2, 17.1), (1e-2, 2e-2, 23.0)),
    "steel, glass": ((0, 2e-3, 5.42), (5e-3, 1e-2, 23.8), (1e-2, 2e-2, 26.3)),
    "steel, PTFE": ((0, 4e-3, 5.02), (1e-2, 2e-2, 18.5), (2e-2, 4e-2, 23.8)),
    "PTFE": ((0, 4e-3, 2.45), (4e-3, 1e-2, 2.9), (2e-2, 4e-2, 18.4)),
}


def data(by=1.0):
    """Numbers of beads and virial ratios against time.

    Parameters
    ----------
    by : float, optional
        Factor of the speed of the blow.
    """
    tables = {"lines": {}, "virial": {}, "kinetic": {}}
    for name in LINES:
        run = followed(name, by)
        if name in MIXED:
            tables["kinetic"] |= {f"{name}, {kind}": x for kind, x in kinetic(run).items()}
        tables["lines"]["t [s]"] = tables["virial"]["t [s]"] = run.t
        tables["lines"][name] = energies(run).effective_number
        tables["virial"][name] = energies(run).virial_ratio
    return tables


def followed(name, by=1.0):
    """The run of a line between two walls."""
    scene = chain(LINES[name], start_wall=STEEL.material, end=STEEL.material)
    state = scene.at_rest({scene.parts["chain"][0]: by})
    record = Record(interval=INTERVAL)
    return simulate(scene, state, END, method="rkn6", dt=DT, record=record)


def kinetic(run):
    """Mean kinetic energy of the heavy and of the light beads of a mixed line at each instant [J],
    without the two at each end: one of these was started."""
    energy = (run.scene.mass * run.v**2 / 2)[:, 3:-3]
    return {"heavy": energy[:, ::2].mean(axis=1), "light": energy[:, 1::2].mean(axis=1)}


def heavy_over_light(tables, name, span):
    """Ratio of these energies in the mean over a time."""
    t = tables["lines"]["t [s]"]
    within = (t >= span[0]) & (t <= span[1])
    heavy, light = (tables["kinetic"][f"{name}, {kind}"][within] for kind in ("heavy", "light"))
    return float(heavy.mean() / light.mean())


def table(tables):
    """Means over spans of time, and of the virial ratio over the second half."""
    t, rows = tables["lines"]["t [s]"], {}
    for name, spans in SPANS.items():
        for first, last, known in spans:
            words = f"{name}: beads that share the energy, {1e3 * first:g} to {1e3 * last:g} ms"
            rows[words] = tables["lines"][name][(t >= first) & (t <= last)].mean(), known
    for name in LINES:
        mean = tables["virial"][name][t >= END / 2].mean()
        rows[f"{name}: mean virial ratio, 20 to 40 ms"] = mean, 5 / 9
    for name in MIXED:
        for span in (EARLY, LATE):
            words = f"{name}: kinetic energy of heavy over light beads, {1e3 * span[0]:g} to "
            rows[f"{words}{1e3 * span[1]:g} ms"] = heavy_over_light(tables, name, span), 1
    return _packs.rows("thermal", rows)


def draw(figure, tables):
    """Effective number of beads, and the ratio of the kinetic energies of heavy and light ones."""
    figure.set_size_inches(9, 4.2)
    a, b = figure.subplots(1, 2)
    t = tables["lines"]["t [s]"]

    def smooth(values, rows):
        return np.convolve(values, np.ones(rows) / rows, "valid")

    for name in LINES:
        a.plot(*(smooth(x, 50) for x in (1e3 * t, tables["lines"][name])), lw=1, label=name)
    for k, name in enumerate(MIXED, 1):
        heavy, light = (
            smooth(tables["kinetic"][f"{name}, {kind}"], MEAN) for kind in ("heavy", "light")
        )
        b.plot(smooth(1e3 * t, MEAN), heavy / light, f"C{k}", lw=1, label=name)
    b.plot([0, 40], [1, 1], color="k", lw=0.8, ls=":")
    b.text(5, 0.5, "dotted: equipartition")
    for axes in (a, b):
        axes.set(xlabel="time [ms]", xlim=(0, 52))
        name_curves(axes)
    a.set(ylabel="effective beads with energy, of 40", title="beads that hold the energy")
    b.set(ylabel="kinetic energy of heavy over light beads", ylim=(0, None),
          title=f"means over {1e3 * INTERVAL * MEAN:g} ms")  # fmt: skip
