"""Forces spread along lines of contacts; after 1 ms the top third still holds most of the energy.

A pack of 833 beads seen from the side: magnified displacements and contact forces. The view is
along y; the beads that reach the largest speeds are drawn in front of the others. Contact forces
are lines whose width is the force.
"""

from functools import cache

import numpy as np

import tensegrity
from figures import _packs
from granular import energies
from tensegrity import Record
from tensegrity.animation import moving

NAME = "packs_space"
GROUP = "packs"

END, FRAMES = 1e-3, 60
FACTOR, MOST, FASTEST = 60, 60.0, 0.5  # of the displacements; N of the widest line; m/s
SHOWN = (6, 18, 36)  # frames of the picture
VIEW = (-60, 20)  # degrees, of the film
KNOWN = {4e-4: (0.346, 0.5392), 1e-3: (0.259, 0.5694)}
"""At instants [s]: the lateral part of the motion, and the part of the upper six layers."""


@cache
def motion(by):
    """The run, one row per frame."""
    return _packs.exact(_packs.cube(by=by), END, Record(interval=END / FRAMES))


def data(by=1.0):
    """Energy fractions, effective number of beads, lateral fraction of the motion.

    Parameters
    ----------
    by : float, optional
        Factor of the speed of the blow.
    """
    run = motion(by)
    shares = energies(run).fractions
    kinetic = run.scene.mass[:, None] * run.v**2
    layers = shares[:, :-1].reshape(len(run.t), 17, 49).sum(axis=2)
    return {
        "energy": {
            "t [s]": run.t, "striker": shares[:, -1],
            **{f"layers {a + 1} to {b}": layers[:, a:b].sum(axis=1)
               for a, b in ((0, 6), (6, 11), (11, 17))},
            "beads that share it": energies(run).effective_number,
            "lateral part of the motion":
            kinetic[..., :2].sum(axis=(1, 2)) / kinetic.sum(axis=(1, 2)),
        },
    }  # fmt: skip


def table(tables):
    """Redirection and trapping of the pack of one material."""
    one, lines = tables["energy"], {}
    for instant, (lateral, upper) in KNOWN.items():
        k = int(np.argmin(np.abs(one["t [s]"] - instant)))
        lines |= {
            f"{words} at {1e3 * instant:g} ms": (one[name][k], known) for words, name, known in (
                ("redirection: lateral part of the kinetic energy", "lateral part of the motion",
                 lateral),
                ("trapping: energy in the upper six layers", "layers 12 to 17", upper),
                ("effective number of beads that hold the energy", "beads that share it", ""),
            )
        }  # fmt: skip
    return _packs.rows("space", lines)


def _moving(axes, label=""):
    return moving(motion(1.0), axes, factor=FACTOR, top=FASTEST, widest=MOST, label=label)


def draw(figure, tables):
    """Three instants, and the distribution of the energy over time."""
    figure.set_size_inches(9, 4.7)
    *panels, last = figure.subplots(1, len(SHOWN) + 1, width_ratios=[1] * len(SHOWN) + [1.4])
    for axes, k in zip(panels, SHOWN, strict=True):
        _moving(axes, "" if k == SHOWN[-1] else None)(k)
        axes.set_title(f"{1e3 * motion(1.0).t[k]:.2f} ms")
    for axes in panels[1:]:
        axes.set(ylabel="", yticklabels=[])
    t = tables["energy"]
    names = ["layers 12 to 17", "layers 7 to 11", "layers 1 to 6", "striker"]
    last.stackplot(1e3 * t["t [s]"], [t[name] for name in names], alpha=0.6)
    last.plot(1e3 * t["t [s]"], t["lateral part of the motion"], "k--", lw=1.2)
    for y, name in zip((0.47, 0.64, 0.8), names, strict=False):
        last.text(0.97, y, name, ha="right", fontweight="bold")
    last.text(0.03, 0.92, names[-1], fontweight="bold", ha="left")
    last.text(0.5, 0.2, "dashed: lateral part of\nthe kinetic energy", ha="center")
    last.set(xlabel="time [ms]", ylabel="fraction of the energy", ylim=(0, 1), title="where it is")
    last.margins(x=0)
    figure.supxlabel(f"displacements x {FACTOR}; the widest line is {MOST:g} N", fontsize=9)


def animate(tables, path):
    """The pack in space, cut open by transparency: what moves is seen."""
    speed = np.minimum(np.linalg.norm(motion(1.0).v, axis=-1), FASTEST)
    how = {"frames": FRAMES + 1, "rate": 10, "factor": FACTOR, "view": VIEW}
    tensegrity.animate(motion(1.0), path, speed, label=f"speed, up to {FASTEST:g} [m/s]", **how)
