"""The pulse splits at the junction; it takes twice as long in the soft branch as in the steel one.

The guide of Fig. 5 of the paper; beads are coloured by the contact force of eq. (5).
"""

from functools import cache

import numpy as np

import tensegrity
from figures import _guide
from figures._disks import disks
from figures._draw import note
from figures._guide import PARYLENE, STEEL
from granular import diamond_guide, sensor_force

NAME = "granular_motion"
GROUP = "granular"

END = 1.5e-3  # s
FRAMES = 100  # of the GIF
SHOWN = {9: "fork", 14: "fork", 42: "rejoined", 94: "rejoined"}  # frames of the picture, and where
SEEN = {"fork": (-45, 55), "rejoined": (150, 250)}  # mm
STEM = 0.196  # m: where stem 2 begins
HELD = 6.0  # N: upper end of the colour scale


@cache
def motion(end, frames):
    """The run of the guide of Fig. 5, one row per frame."""
    guide = diamond_guide(bead=STEEL, branches=(STEEL, PARYLENE), striker=_guide.light(0.50))
    return _guide.followed(guide, end, every=round(end / frames / _guide.DT))


def data():
    """Force on each bead at each frame, bead positions and walls of the guide of Fig. 5."""
    run = motion(END, FRAMES)
    guide = run.scene
    forces = sensor_force(run, range(1, guide.sites))
    x, y = guide.positions[1:].T
    edges = np.array([[*w.start, *w.end] for w in guide.layout.walls if not w.is_bevel])
    soft = np.isin(np.arange(1, guide.sites), guide.parts["branch 2"])
    return {
        "beads": {"x [m]": x, "y [m]": y, "soft": soft.astype(int)},
        "forces": {"t [s]": run.t, **{f"bead {k} [N]": f for k, f in enumerate(forces.T, 1)}},
        "walls": dict(zip(("x0 [m]", "y0 [m]", "x1 [m]", "y1 [m]"), edges.T, strict=True)),
    }


def _forces(tables):
    return np.stack([f for name, f in tables["forces"].items() if name != "t [s]"], axis=1)


def draw(figure, tables):
    """Draw selected frames, about the fork and where the branches rejoin."""
    figure.set_size_inches(9, 6.2)
    forces, t = _forces(tables), tables["forces"]["t [s]"]
    panels = figure.subplots(2, 2)
    *places, soft = tables["beads"].values()
    style = {"cmap": "BuPu", "lw": 0.6, "edgecolors": np.where(soft == 1, "C1", "0.5")}
    for axes, (frame, where) in zip(panels.flat, SHOWN.items(), strict=True):
        for x0, y0, x1, y1 in zip(*tables["walls"].values(), strict=True):
            axes.plot([1e3 * x0, 1e3 * x1], [1e3 * y0, 1e3 * y1], "0.4", lw=1)
        beads = disks(axes, np.stack(places, axis=1), STEEL.diameter, **style)
        beads.set(array=forces[frame], clim=(0, HELD))
        if where == "rejoined":  # in stem 2, of which the first beads follow the branches
            there = np.where(places[0] > STEM, forces[frame], 0.0).argmax()
            at = 1e3 * places[0][there], 1e3 * places[1][there]
            note(axes, "it arrives", at, (12, 16), arrowprops={"arrowstyle": "->"})
        axes.set(title=f"{1e3 * t[frame]:.2f} ms after the blow", xlim=SEEN[where], ylim=(-32, 32),
                 ylabel="y [mm]")  # fmt: skip
    for side, name, y in (("top", "steel branch", 30), ("bottom", "Parylene branch", -30)):
        panels[0, 0].text(-42, y, name, va=side)
    label = "force on a bead [N]; orange outlines: Parylene branch"
    figure.colorbar(beads, ax=panels, label=label, shrink=0.7, extend="max")


def animate(tables, path):
    """Write all frames as an animation."""
    forces = np.insert(_forces(tables), 0, 0.0, axis=1)  # no force is read at the striker
    label = "force by eq. (5) [N]"
    tensegrity.animate(motion(END, FRAMES), path, forces, frames=FRAMES + 1, label=label)
