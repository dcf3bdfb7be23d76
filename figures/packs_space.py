"""Forces spread along lines of contacts; after 1 ms the top third still holds most of the energy.

A pack of 833 beads seen from the side: magnified displacements and contact forces. The view is
along y; the beads that reach the largest speeds are drawn in front of the others. Contact forces
are lines whose width is the force.
"""

from __future__ import annotations

from functools import cache

import numpy as np

import tensegrity
from figures import _packs
from figures._packs import row
from granular import energies
from tensegrity import Record
from tensegrity.animation import moving

NAME = "packs_space"
GROUP = "packs"

END, FRAMES = 1e-3, 60
FACTOR, MOST, FASTEST = 60, 60.0, 0.5  # of the displacements; N of the widest line; m/s
SHOWN = (6, 18, 36)  # frames of the picture
VIEW = (-60, 20)  # degrees, of the film
TIMES = (4e-4, 1e-3)  # s
LATERAL = {4e-4: 0.346, 1e-3: 0.259}
UPPER = {4e-4: 0.5392, 1e-3: 0.5694}


@cache
def motion():
    """The run, one row per frame."""
    return _packs.exact(_packs.cube(), END, Record(interval=END / FRAMES))


def data():
    """Energy fractions, effective number of beads, lateral fraction of the motion."""
    run = motion()
    scene, shares = run.scene, energies(run).fractions
    kinetic = 0.5 * scene.mass[:, None] * run.v**2
    layers = shares[:, :-1].reshape(len(run.t), 17, 49).sum(axis=2)
    parts = {"striker": shares[:, -1]} | {
        f"layers {a + 1} to {b}": layers[:, a:b].sum(axis=1) for a, b in ((0, 6), (6, 11), (11, 17))
    }
    lateral = kinetic[..., :2].sum(axis=(1, 2)) / kinetic.sum(axis=(1, 2))
    return {
        "energy": {
            "t [s]": run.t, **parts, "beads that share it": energies(run).effective_number,
            "lateral part of the motion": lateral,
        },
    }  # fmt: skip


def table(tables):
    """Redirection and trapping of the pack of one material."""
    t = tables["energy"]
    rows = []
    for instant in TIMES:
        k = int(np.argmin(np.abs(t["t [s]"] - instant)))
        words = f"at {1e3 * instant:g} ms"
        rows += [
            row("space", f"redirection: lateral part of the kinetic energy {words}",
                float(t["lateral part of the motion"][k]), LATERAL[instant]),
            row("space", f"trapping: energy in the upper six layers {words}",
                float(t["layers 12 to 17"][k]), UPPER[instant]),
            row("space", f"effective number of beads that hold the energy {words}",
                float(t["beads that share it"][k])),
        ]  # fmt: skip
    return rows


def _moving(axes, label=""):
    return moving(motion(), axes, factor=FACTOR, top=FASTEST, widest=MOST, label=label)


def draw(figure, tables):
    """Three instants, and the distribution of the energy over time."""
    figure.set_size_inches(9, 5.4)
    *panels, last = figure.subplots(1, len(SHOWN) + 1, width_ratios=[1] * len(SHOWN) + [1.4])
    for axes, k in zip(panels, SHOWN, strict=True):
        _moving(axes, "" if k == SHOWN[-1] else None)(k)
        axes.set_title(f"{1e3 * motion().t[k]:.2f} ms", fontsize=10)
    for axes in panels[1:]:
        axes.set(ylabel="", yticklabels=[])
    t = tables["energy"]
    names = ["layers 12 to 17", "layers 7 to 11", "layers 1 to 6", "striker"]
    last.stackplot(1e3 * t["t [s]"], [t[name] for name in names], alpha=0.6)
    last.plot(1e3 * t["t [s]"], t["lateral part of the motion"], "k--", lw=1.2)
    for k, (y, name) in enumerate(zip((0.47, 0.64, 0.8), names, strict=False)):
        last.text(0.97, y, name, ha="right", color=f"C{k}", fontweight="bold")
    last.text(0.03, 0.92, names[-1], color="C3", fontweight="bold", ha="left")
    last.text(0.5, 0.2, "dashed: lateral part of\nthe kinetic energy", ha="center")
    last.set(xlabel="time [ms]", ylabel="fraction of the energy", ylim=(0, 1), title="where it is")
    last.margins(x=0)
    figure.supxlabel(f"displacements x {FACTOR}; the widest line is {MOST:g} N", fontsize=9)


def animate(tables, path):
    """The pack in space, cut open by transparency: what moves is seen."""
    speed = np.minimum(np.linalg.norm(motion().v, axis=-1), FASTEST)
    how = {"frames": FRAMES + 1, "rate": 10, "factor": FACTOR, "view": VIEW}
    tensegrity.animate(motion(), path, speed, label=f"speed, up to {FASTEST:g} [m/s]", **how)
