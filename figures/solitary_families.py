"""Faster solitary waves are narrower, have more energy and a higher peak, in all these prisms."""

import numpy as np

from figures._draw import note
from tensegrity import Prism, predict

GROUP = "waves"

SPRINGS = {  # name: (prism, preload, family)
    "stiffening, compression": (Prism(1.0, 0.8, 0.02, 1.0), 0.0, "compression"),
    "stiffening, rarefaction": (Prism(1.0, 0.8, 0.02, 1.0), 0.0, "rarefaction"),
    "weakly prestressed": (Prism(1.0, 0.6, 0.001, 1.0), 0.0, "compression"),
    "elastic, softening": (Prism(1.0, 0.5, 0.4, 1.0, 2.0, 20.0), 0.05, "rarefaction"),
    "elastic, stiffening, then soft": (Prism(1.0, 1.0, 0.1, 1.0, 5.0, 50.0), 0.0, "compression"),
}
FASTEST = 6.0  # speed ratio
POINTS = 10


def data():
    """Speed ratio minus 1, width, energy over k_cross base^2, and peak of each wave."""
    tables = {}
    for name, (prism, preload, family) in SPRINGS.items():
        spring = prism.potential(preload=preload)
        waves = predict(spring)[family]
        bound = waves.speeds[1] / spring.sound_speed() - 1
        excess = np.geomspace(2e-3, min(FASTEST, 1 + 0.9 * bound) - 1, POINTS)
        curve = waves.curve(speed_ratio=1 + excess)
        found = {"width": curve.width, "energy": curve.energy, "peak": curve.amplitude}
        tables[name.replace(", ", "_").replace(" ", "_")] = {"speed_excess": excess} | found
    return tables


def draw(figure, tables):
    """Width, energy and peak against the excess over the sound speed."""
    figure.set_size_inches(9, 4.2)
    axes = figure.subplots(1, 3)
    for k, (name, table) in enumerate(zip(SPRINGS, tables.values(), strict=True)):
        for one, column in zip(axes, ("width", "energy", "peak"), strict=True):
            one.loglog(table["speed_excess"], np.abs(table[column]), ".-", ms=4, lw=1)
        place = 0.99, 0.955 - 0.055 * k
        note(axes[0], name, place, inside=True, ha="right", color=f"C{k}", fontsize=9)
    excess = np.geomspace(2e-3, 0.05, 2)
    axes[0].loglog(excess, 9.0 * (24 * excess) ** -0.5, "k:", lw=1)
    axes[0].annotate("slope -1/2", (0.026, 13))
    labels = (
        "width at 5 % of the peak [sites]",
        "energy over $k_{cross} l^2$, base $l$",
        "peak elongation over the base",
    )
    titles = "width", "energy", "peak"
    for one, label, title in zip(axes, labels, titles, strict=True):
        one.set(xlabel="speed over that of sound, less 1", ylabel=label, title=title)
    ticks = (2, 3, 5, 10, 20, 40)
    axes[0].set_yticks(ticks, [str(tick) for tick in ticks])
    axes[0].set_yticks([], minor=True)
