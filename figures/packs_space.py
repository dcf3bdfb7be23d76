"""The 833 beads from the side: motion, displacements magnified, and contact forces as lines.

Seen along y: of every layer the row of beads below the struck one, left; all contacts, right.
"""

from __future__ import annotations

import numpy as np

from figures import _motion, _packs
from figures._packs import D, row
from granular import energies
from tensegrity import Record

NAME = "packs_space"
GROUP = "packs"

END, FRAMES = 1e-3, 60
FACTOR, MOST = 60, 60.0  # of the displacements; N of the widest line
SHOWN = (6, 18, 36)  # frames of the picture
TIMES = (4e-4, 1e-3)  # s
LATERAL = {4e-4: 0.346, 1e-3: 0.259}
UPPER = {4e-4: 0.5392, 1e-3: 0.5694}


def seen(scene):
    """Sites of the row iy = 3 of every layer, and the striker."""
    rows = [scene.parts[f"layer {k}"][21:28] for k in range(1, 18)]
    return [*np.concatenate(rows).tolist(), scene.sites - 1]


def data():
    """Displacements and speeds of the beads seen, forces of all contacts, shares of energy."""
    scene = _packs.cube()
    record = Record(interval=END / FRAMES)
    run = _packs.exact(scene, END, record)
    sites, shares = seen(scene), energies(run).fractions
    kinetic = 0.5 * scene.mass[:, None] * run.v**2
    layers = shares[:, :-1].reshape(len(run.t), 17, 49).sum(axis=2)
    parts = {"striker": shares[:, -1]} | {
        f"layers {a + 1} to {b}": layers[:, a:b].sum(axis=1) for a, b in ((0, 6), (6, 11), (11, 17))
    }
    lateral = kinetic[..., :2].sum(axis=(1, 2)) / kinetic.sum(axis=(1, 2))
    return {
        "frames": {
            "t [s]": run.t,
            **{f"ux {k} [m]": run.u[:, k, 0] for k in sites},
            **{f"uz {k} [m]": run.u[:, k, 2] for k in sites},
            **{f"speed {k} [m/s]": np.linalg.norm(run.v[:, k], axis=1) for k in sites},
        },
        "forces": {f"force {k} [N]": f for k, f in enumerate(-scene.bond_tension(run.u).T)},
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
            row("space", f"beads that share the energy {words}",
                float(t["beads that share it"][k])),
        ]  # fmt: skip
    return rows


def _stages(tables, panels):
    scene = _packs.cube()
    sites = seen(scene)
    places = scene.positions[:, [0, 2]]
    box = 0, 7.5 * D, scene.places[:, 2].max() + D / 2
    stage = _motion.Stage(panels, places[sites], D, box, FACTOR, MOST)
    columns = {kind: np.stack([x for key, x in tables["frames"].items() if key.startswith(kind)],
                              axis=1) for kind in ("ux", "uz", "speed")}  # fmt: skip
    force = np.stack(list(tables["forces"].values()), axis=1)

    def show(k):
        u = np.stack([columns["ux"][k], columns["uz"][k]], axis=1)
        carry = force[k] > 0.02
        ends = places[scene.bonds[carry]]
        stage.show(u, columns["speed"][k], 0.15, ends, force[k][carry])

    return stage, show


def draw(figure, tables):
    """Three instants; where the energy is."""
    figure.set_size_inches(14, 6)
    panels = figure.subplots(1, 2 * len(SHOWN) + 1, width_ratios=[1] * 2 * len(SHOWN) + [1.7])
    for n, k in enumerate(SHOWN):
        stage, show = _stages(tables, panels[2 * n : 2 * n + 2])
        show(k)
        t = 1e3 * tables["frames"]["t [s]"][k]
        panels[2 * n].set_title(f"{t:.2f} ms:\nmotion x {FACTOR}", fontsize=9)
        panels[2 * n + 1].set_title(f"forces,\nwidest {MOST:g} N", fontsize=9)
    for axes in panels[1:-1]:
        axes.set(ylabel="", yticklabels=[])
    figure.colorbar(stage.disks, ax=panels[:-1], label="speed [m/s]", location="bottom", shrink=0.4)
    t = tables["energy"]
    names = ["layers 12 to 17", "layers 7 to 11", "layers 1 to 6", "striker"]
    panels[-1].stackplot(1e3 * t["t [s]"], [t[name] for name in names], labels=names, alpha=0.8)
    panels[-1].plot(1e3 * t["t [s]"], t["lateral part of the motion"], "k--", lw=1.2,
                    label="lateral part of the motion")  # fmt: skip
    panels[-1].set(xlabel="time [ms]", ylabel="share of the energy", ylim=(0, 1), title="energy")
    panels[-1].margins(x=0)
    panels[-1].legend(fontsize=7, loc="upper right", framealpha=0.8, frameon=True)


def animate(tables, path):
    """Motion left, contact forces right, as a GIF."""
    import matplotlib.pyplot as plt

    figure, panels = plt.subplots(1, 2, figsize=(8, 8), dpi=70, layout="constrained")
    stage, show = _stages(tables, panels)
    panels[1].set_title(f"contact forces, widest line {MOST:g} N", fontsize=9)
    figure.colorbar(stage.disks, ax=panels, label="speed [m/s]", location="bottom", shrink=0.5)

    def frame(k):
        show(k)
        t = 1e3 * tables["frames"]["t [s]"][k]
        panels[0].set_title(f"t = {t:.2f} ms, displacements x {FACTOR}", fontsize=9)

    _motion.gif(path, figure, range(FRAMES + 1), frame)
