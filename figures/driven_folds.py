"""Responses of one prism and of ten beads with a light one to a growing frequency, followed through
their folds and torus points.

The beads are those of a granular rectifier: stable, quasi-periodic and bistable responses lie close
to each other above the band of linear waves.  N. Boechler, G. Theocharis, C. Daraio, Nature
Materials 10, 665 (2011).
"""

from __future__ import annotations

import numpy as np
import sympy as sp

from tensegrity import Chain, Damping, Drive, PowerLaw, Prism, orbit_path, periodic_orbit

NAME = "driven_folds"
GROUP = "waves"

COLUMNS = ("W", "amplitude", "multiplier", "stable")
MARKS = {"fold": "ko", "torus": "C3s"}


def shaken():
    """One prism of mass 1 on a held base, from rest."""
    t, frequency = sp.symbols("t W")
    shaker = Drive(force=0.001 * sp.cos(frequency * t), parameters={"W": 1.55})
    spring = Prism(1.0, 0.7, 0.1, 1.0).potential()
    forcing = {"damping": Damping(ground=0.02), "drive": {1: shaker}}
    return Chain(spring, 2, ends=("fixed", "free"), **forcing), 1.85


def beads():
    """Ten beads between a wall that moves and one that is fixed, the second bead light."""
    t, frequency = sp.symbols("t W")
    wall = Drive(displacement=0.02 * sp.cos(frequency * t), parameters={"W": 2.87})
    mass = np.where(np.arange(12) == 2, 0.5, 1.0)
    forcing = {"damping": Damping(ground=0.005), "drive": {0: wall}}
    return Chain(PowerLaw(1.0, 1.5, preload=1.0), 12, mass, ("free", "fixed"), **forcing), 2.73


def data():
    """Frequency, amplitude, largest multiplier and stability along both paths, and their events."""
    tables = {}
    for name, make in (("prism", shaken), ("beads", beads)):
        chain, until = make()
        path = orbit_path(periodic_orbit(chain, chain.at_rest()), by="W", until=until)
        tables[name] = {column: 1.0 * path.columns[column] for column in COLUMNS}
        for kind in MARKS:
            found = [event for event in path.events if event.kind == kind]
            tables[f"{name}_{kind}"] = {
                column: np.array([event.at[column] for event in found], dtype=float)
                for column in COLUMNS[:2]
            }
    return tables


def draw(figure, tables):
    """Amplitude against frequency; unstable parts dashed."""
    figure.set_size_inches(10, 4.2)
    titles = ("one prism on a held base", "ten beads, the second one light")
    for name, one, title in zip(("prism", "beads"), figure.subplots(1, 2), titles, strict=True):
        table = tables[name]
        unstable = table["stable"] == 0
        near = unstable | np.append(unstable[1:], False) | np.insert(unstable[:-1], 0, False)
        for part, style in ((~unstable, "C0-"), (near, "C0--")):
            label = "stable" if part is not near else "unstable"
            one.plot(table["W"], np.where(part, table["amplitude"], np.nan), style, label=label)
        for kind, mark in MARKS.items():
            found = tables[f"{name}_{kind}"]
            if len(found["W"]):
                one.plot(found["W"], found["amplitude"], mark, ms=5, label=kind)
        labels = ("frequency of the drive [rad/s]", "half the extent of the motion [m]")
        one.set(xlabel=labels[0], ylabel=labels[1], title=title)
        one.legend(frameon=False, fontsize=8)
