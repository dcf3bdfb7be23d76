"""Straight chains of beads: runs, and colour maps of the energy density."""

from __future__ import annotations

import numpy as np

from granular import Bead, Striker, chain, hertz, materials, simulate
from tensegrity import Record, State

DIAMETER = 4.76e-3  # m
SPEED = 0.5  # m/s, of a striker like the first bead
ROWS, KEPT = 1600, 400  # instants of a run and of a density
FINE = 1 / 25  # step over the time of an impact of the quickest contact


def bead(material, ratio=1.0):
    """A bead of a material, larger than that of the paper by a factor."""
    return Bead(ratio * DIAMETER, materials[material])


def struck(beads, t_end, speed=SPEED):
    """A run of a chain, free at its end, that a bead like its first hits."""
    scene = chain(beads, striker=Striker(beads[0], speed))
    impacts = [(b.mass**2 / (hertz(b, b).constant ** 2 * SPEED)) ** 0.2 for b in set(beads)]
    steps = int(t_end / (FINE * min(impacts)))
    record = Record(every=max(1, steps // ROWS))
    return simulate(scene, scene.start(), t_end, method="rkn6", dt=t_end / steps, record=record)


def energies(run):
    """Energy of each site over that of the striker: t and a column for each site."""
    chosen = slice(None, None, max(1, len(run.t) // KEPT))
    density = run.scene.site_energy(State(run.u[chosen], run.v[chosen])) / run.energy[0]
    return {"t [s]": run.t[chosen], **{f"site {k}": density[:, k] for k in range(density.shape[1])}}


def draw_density(axes, table, title, breaks=()):
    """Colours of energy, site against time; returns the image."""
    from matplotlib.colors import LogNorm

    density = np.stack([c for n, c in table.items() if n != "t [s]"], axis=1)
    image = axes.imshow(
        np.clip(density, 1e-4, None), origin="lower", aspect="auto", cmap="viridis",
        norm=LogNorm(1e-4, 1), interpolation="nearest",
        extent=(-0.5, density.shape[1] - 0.5, 0, 1e3 * table["t [s]"][-1]),
    )  # fmt: skip
    for place in breaks:
        axes.axvline(place + 0.5, color="w", lw=0.7, ls=":")
    axes.set_title(title, fontsize=9)
    axes.set(xlabel="site", ylabel="time [ms]")
    axes.grid(False)
    return image
