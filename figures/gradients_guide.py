"""Beads near the measured end decide its force; those of the stem hardly matter.

Sensitivity of the end force of a branched guide to diameter and modulus of every bead: the guide of
the paper with walls behind its branches. A bead that grows at a fixed centre stiffens its contacts,
gains mass and, above all, changes the gaps. All derivatives, given per micrometre, come from one
backward pass through the unperturbed run; because contacts open, a linear prediction holds only for
changes of size much smaller than a micrometre.
"""

import numpy as np

from figures._disks import disks
from figures._files import lines
from granular import Bead, Striker, materials, y_guide
from tensegrity import gradient
from tensegrity import objective as o

NAME = "gradients_guide"
GROUP = "gradients"

STEEL = materials["steel"]
BEAD = Bead(4.76e-3, STEEL)
DT, END = 1e-7, 2.5e-4  # s


def data():
    """Bead positions, and derivatives of the force with respect to diameter and modulus."""
    guide = y_guide(10, 10, bead=BEAD, branches=(BEAD, BEAD), wall=materials["ptfe"],
                    striker=Striker(BEAD, 0.585), end=STEEL)  # fmt: skip
    last = guide.parts["branch 1"][-1]
    wall = [wall for site, wall in guide.wall_contacts.tolist() if site == last][-1]
    load = o.load(wall=wall)
    peak = gradient(o.peak(load), guide, guide.start(), END, dt=DT, checkpoints=100)
    x, y = guide.positions.T
    size, modulus = (peak.by(name) / peak.value for name in ("diameter", "modulus"))
    beads = {"x": x, "y": y, "percent per um": size * 100e-6,
             "percent per percent of modulus": modulus * STEEL.modulus}  # fmt: skip
    values = {
        "peak force at the end of branch 1 [N]": peak.value,
        "largest derivative by a diameter [% of the peak per um]":
        np.abs(beads["percent per um"]).max(),
        "largest derivative by a modulus [% of the peak per %]":
        np.abs(beads["percent per percent of modulus"]).max(),
        "digits unaffected by round-off": peak.digits,
        "error of the reversed run at the start [m, m/s]": peak.reversal,
    }  # fmt: skip
    numbers = {"quantity": list(values), "value": [float(x) for x in values.values()]}
    return {"beads": beads, "numbers": numbers}


def table(tables):
    """The numbers that are printed."""
    return [{"picture": NAME, **line} for line in lines(tables["numbers"])]


def draw(figure, tables):
    """The beads in position, coloured by either derivative."""
    from matplotlib.ticker import MaxNLocator

    figure.set_size_inches(9, 3.9)
    beads = tables["beads"]
    places = np.stack([beads["x"], beads["y"]], axis=1)
    shown = {
        "percent per um": ("a larger diameter, centres fixed", "% of the peak force per µm"),
        "percent per percent of modulus": ("a larger modulus", "% of the peak force per %"),
    }
    for axes, (name, (title, unit)) in zip(figure.subplots(1, 2), shown.items(), strict=True):
        most = np.abs(beads[name]).max()
        dots = disks(axes, places, BEAD.diameter, cmap="RdBu_r", ec="0.4", lw=0.5)
        dots.set(array=np.asarray(beads[name]), clim=(-most, most))
        axes.set(ylabel="y [mm]", title=title)
        axes.autoscale_view()
        axes.margins(0.05)
        axes.annotate("measured here", 1e3 * places[20], (-30, 0), textcoords="offset points",
                      ha="right", va="center", fontsize=9)  # fmt: skip
        bar = figure.colorbar(dots, ax=axes, location="bottom", shrink=0.9, label=unit)
        bar.locator = MaxNLocator(5)
