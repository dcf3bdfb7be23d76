"""A planar pack of 246 beads as a protector: evolutionary optimisation, and its motion."""

from __future__ import annotations

import numpy as np

from figures import _pack as common
from figures._disks import disks
from granular import sensor_force, simulate, wall_force
from tensegrity import Record, plotting

NAME = "protectors_pack"
GROUP = "protectors"

FRAMES, RATE = 90, 12
END = 1.2e-3  # s, of the moving picture
HELD = 8.0  # N: upper end of the colour scale
COLOURS = {"steel": "0.45", "ptfe": "#f4f1e6", "rubber": "#303030", "bronze": "#b9772f",
           "glass": "#9fd3dd", "nylon": "#e9c6d8"}  # fmt: skip


def data():
    """Floor peaks of all designs, the searches, floor forces in time, the best in motion."""
    compared, drawn = common.peaks()["compared"], common.peaks()["drawn"]["force [N]"]
    found = {name: common.best(name) for name in common.SPACES}
    rows = {"design": [], "floor peak [N]": [], "at [us]": [], "designs": [], "seed": []}

    def add(*values):
        for column, value in zip(rows.values(), values, strict=True):
            column.append(value)

    for name, force, time in zip(*compared.values(), strict=True):
        add(name, force, 1e6 * time, 1, "")
    add("random orders, median", float(np.median(drawn)), "", len(drawn), 0)
    add("random orders, best", float(drawn.min()), "", len(drawn), 0)
    tables = {"peaks": rows}
    for name, best in found.items():
        add(f"{name}, evolution", best.peak_force, 1e6 * common.peak(best.beads)[1],
            len(best.least), best.seed)  # fmt: skip
        tables[f"history {name}"] = {
            "designs": np.arange(1, len(best.least) + 1),
            "least [N]": best.least,
        }
    columns = {}
    shown = {
        "uniform steel": common.COMPARED["uniform steel"],
        "alternating rows, steel on top": common.COMPARED["alternating rows, steel on top"],
        **{f"{name}, evolution": best.beads for name, best in found.items()},
    }
    for name, beads in shown.items():
        run = followed(beads, common.T_END)
        columns["t [s]"], columns[f"{name} [N]"] = run.t, wall_force(run, "floor")
    tables["floor"] = columns
    name, best = min(found.items(), key=lambda item: item[1].peak_force)
    run = followed(best.beads, END)
    scene, some = run.scene, np.linspace(0, len(run.t) - 1, FRAMES + 1).astype(int)
    sites = range(common.COUNT)
    places = scene.positions[: common.COUNT]
    tables["beads"] = {
        "x [m]": places[:, 0], "z [m]": places[:, 1],
        "material": [bead.material.name for bead in best.beads],
    }  # fmt: skip
    forces = sensor_force(run, sites)[some]
    tables["forces"] = {
        "t [s]": run.t[some],
        **{f"bead {k} [N]": f for k, f in enumerate(forces.T)},
    }
    tables["shown"] = {"search": [name], "converged in time": [best.converged_in_time]}
    return tables


def followed(beads, t_end):
    """A run of all beads of a design."""
    scene, _ = common.build(beads)
    dt = t_end / (4 * round(t_end / (4 * common.FINE)))
    return simulate(scene, scene.start(), t_end, method="rkn6", dt=dt, record=Record(every=4))


def table(tables):
    """Floor peaks."""
    one = tables["peaks"]
    rows = zip(one["design"], one["floor peak [N]"], one["designs"], one["seed"], strict=True)
    return [
        {"scene": "pack", "what": a, "value": float(b), "designs": c, "seeds": str(d)}
        for a, b, c, d in rows
    ]


def stage(axes, tables, colour=None):
    """Draw the beads as disks; returns the collection that takes the colours."""
    places = np.stack([tables["beads"]["x [m]"], tables["beads"]["z [m]"]], axis=1)
    colours = {"cmap": "inferno_r"} if colour is None else {"facecolors": colour}
    found = disks(axes, places, common.DIAMETER, lw=0.6, edgecolors="0.3", **colours)
    if colour is None:
        found.set_clim(0, HELD)
    axes.set(ylabel="z [mm]", xlim=(-2, 202), ylim=(-2, 112))
    return found


def draw(figure, tables):
    """The search, floor forces in time, the best pack, and one instant of it."""
    from matplotlib.patches import Patch

    figure.set_size_inches(13, 8.5)
    axes = figure.subplots(2, 2)
    for name in common.SPACES:
        one = tables[f"history {name}"]
        axes[0, 0].plot(one["designs"], one["least [N]"], label=f"{name}, evolution")
    peaks = tables["peaks"]
    known = dict(zip(peaks["design"], peaks["floor peak [N]"], strict=True))
    for k, name in enumerate(("alternating rows, steel on top", "random orders, median",
                              "random orders, best")):  # fmt: skip
        axes[0, 0].axhline(known[name], color="0.3", ls=("-.", "--", ":")[k], lw=1, label=name)
    axes[0, 0].set(xlabel="designs computed", ylabel="largest floor force [N]", ylim=(0, None))
    axes[0, 0].legend(fontsize=8)
    floor = tables["floor"]
    for column, force in floor.items():
        if column != "t [s]":
            axes[0, 1].plot(1e3 * floor["t [s]"], force, lw=1, label=column.removesuffix(" [N]"))
    axes[0, 1].set(xlabel="time [ms]", ylabel="force on the floor [N]", yscale="symlog",
                   ylim=(0, None))  # fmt: skip
    axes[0, 1].yaxis.set_major_formatter("{x:g}")
    axes[0, 1].legend(fontsize=8)
    materials = tables["beads"]["material"]
    stage(axes[1, 0], tables, [COLOURS[name] for name in materials])
    used = [name for name in COLOURS if name in materials]
    handles = [Patch(facecolor=COLOURS[n], edgecolor="0.3", label=n) for n in used]
    axes[1, 0].legend(handles=handles, ncols=len(used), fontsize=8, loc="upper center")
    axes[1, 0].set_title(f"the best: {tables['shown']['search'][0]}")
    forces, t = _forces(tables), tables["forces"]["t [s]"]
    frame = int(np.argmin(np.abs(t - 0.4e-3)))
    disks = stage(axes[1, 1], tables)
    disks.set_array(forces[frame])
    axes[1, 1].set_title(f"the same, {1e3 * t[frame]:.2f} ms after the blow")
    figure.colorbar(disks, ax=axes[1, 1], label="force on a bead [N]", shrink=0.7, extend="max")


def _forces(tables):
    return np.stack([f for name, f in tables["forces"].items() if name != "t [s]"], axis=1)


def animate(tables, path):
    """Write all frames as a GIF."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(9, 5.2), dpi=80, layout="constrained")
    forces, t = _forces(tables), tables["forces"]["t [s]"]
    disks = stage(axes, tables)
    figure.colorbar(disks, ax=axes, label="force on a bead [N]", shrink=0.8, extend="max")

    def show(row):
        disks.set_array(forces[row])
        axes.set_title(f"{1e3 * t[row]:.2f} ms after the blow, the best pack")

    plotting.film(path, figure, range(len(t)), show, RATE)


def text(tables):
    """Floor peaks of all designs."""
    one = tables["peaks"]
    lines = [
        "246 beads of 9.53 mm in 12 rows between PTFE walls on a steel floor, struck from above by "
        f"a steel bead at 1 m/s; the largest force on the floor within {1e3 * common.T_END:g} ms.",
        "", "| design | floor peak [N] | designs computed | seed |", "|---|---|---|---|",
    ]  # fmt: skip
    rows = zip(one["design"], one["floor peak [N]"], one["designs"], one["seed"], strict=True)
    lines += [f"| {a} | {b:.6g} | {c} | {d} |" for a, b, c, d in rows]
    if not tables["shown"]["converged in time"][0]:
        lines += ["", "The best is not converged in time: its force in a longer window differs."]
    return "\n".join(lines)
