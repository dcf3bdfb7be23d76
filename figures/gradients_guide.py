"""How the force at the ends of a branched guide depends on every bead's diameter.

A guide of seeds/001 with walls behind its branches; every bead stays at its place and is made
larger by one micrometre.  Contacts become stiffer, masses larger, and above all the gaps change.
The numbers are derivatives at the guide as it is, all from one pass backwards; as contacts open,
they hold for much smaller changes of size than a micrometre.
"""

from __future__ import annotations

import numpy as np

from figures import _gradients
from figures._disks import disks
from granular import Bead, Striker, materials, y_guide
from tensegrity import gradient
from tensegrity import objective as o

NAME = "gradients_guide"
GROUP = "gradients"

STEEL = materials["steel"]
BEAD = Bead(4.76e-3, STEEL)
DT, END = 1e-7, 2.5e-4  # s
NORM = 32


def data():
    """Places of the beads, and the force's derivatives by diameter and modulus."""
    guide = y_guide(10, 10, bead=BEAD, branches=(BEAD, BEAD), wall=materials["ptfe"],
                    striker=Striker(BEAD, 0.585), end=STEEL)  # fmt: skip
    last = guide.parts["branch 1"][-1]
    contact = [k for k, (site, wall) in enumerate(guide.wall_contacts.tolist())
               if site == last][-1]  # fmt: skip
    wall = int(guide.wall_contacts[contact, 1])
    load = o.load(wall=wall)
    norm, peak = gradient([o.p_norm(load, NORM), o.peak(load)], guide, guide.start(), END, dt=DT,
                          checkpoints=100)  # fmt: skip
    per_micron = 100 * 1e-6 / peak.value
    x, y = guide.positions.T
    values = {
        "peak force at the end of branch 1 [N]": peak.value,
        f"{NORM}-norm of it, in N s^(1/{NORM})": norm.value,
        "largest by a diameter [% of the peak per um]":
        np.abs(peak.by("diameter")).max() * per_micron,
        "largest by a modulus [% of the peak per %]":
        np.abs(peak.by("modulus") * STEEL.modulus / peak.value).max(),
        "digits that round-off leaves": peak.digits,
        "returned to the start within [m, m/s]": peak.reversal,
    }  # fmt: skip
    return {
        "beads": {"x": x, "y": y, "percent per um": peak.by("diameter") * per_micron,
                  "percent per percent of modulus":
                  peak.by("modulus") * STEEL.modulus / peak.value},
        "numbers": _gradients.numbers(values),
    }  # fmt: skip


def table(tables):
    """The numbers."""
    return _gradients.lines(NAME, tables)


def draw(figure, tables):
    """The beads at their places, coloured by both derivatives."""
    figure.set_size_inches(10, 4.6)
    beads = tables["beads"]
    places = np.stack([beads["x"], beads["y"]], axis=1)
    titles = {
        "percent per um": "by diameter, beads at their places\n[% of the peak per um]",
        "percent per percent of modulus": "by modulus\n[% of the peak per %]",
    }
    for axes, (name, title) in zip(figure.subplots(1, 2), titles.items(), strict=True):
        value = np.asarray(beads[name])
        most = np.abs(value).max()
        dots = disks(axes, places, BEAD.diameter, cmap="RdBu_r", ec="0.4", lw=0.5)
        dots.set_array(value)
        dots.set_clim(-most, most)
        axes.set(ylabel="y [mm]", title=title)
        axes.autoscale_view()
        axes.margins(0.05)
        figure.colorbar(dots, ax=axes, shrink=0.8)
