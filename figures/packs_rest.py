"""A preload is carried along lines from the corners; impacts then arrive earlier and weaker.

Packs in equilibrium under gravity and a preload, and the same packs struck. The static equilibrium
is computed first: lines are contact forces, their width is the force. The floor carries the weight
and the preload, however the contacts distribute them.
"""

from __future__ import annotations

import numpy as np

from figures import _packs
from figures._packs import STEEL, D, row
from granular import fcc_pack, materials, wall_force
from granular.contact_network import wall_forces, wall_sites
from tensegrity import Record, largest_peak

NAME = "packs_rest"
GROUP = "packs"

GRAVITY = 9.81  # m/s^2
LOADS = {"weight": {"gravity": GRAVITY}, "weight and 1 N a bead": {"gravity": GRAVITY,
         "preload": 1.0}}  # fmt: skip
PRELOADS = (0.0, 0.1, 1.0, 10.0)  # N on each bead of the top row
END = 4e-4


def cubic():
    """The 833 beads in their PTFE box, with weight."""
    return fcc_pack(bead=STEEL, floor=STEEL.material, sides=materials["ptfe"], gravity=GRAVITY)


def data():
    """Contacts and floor of packs at rest; the floor of struck ones; the weight of 833 beads."""
    tables = {}
    for name, loads in LOADS.items():
        scene = _packs.plane(**loads)
        u = scene.equilibrium.u
        u = np.concatenate([u, scene.at_rest().u[-1:]])
        ends, force = _packs.lines(scene, u)
        floor = wall_forces(scene, u, "floor")[list(scene.parts["row 12"])]
        key = name.replace(" ", "_")
        tables[f"{key}_contacts"] = {
            "x0 [m]": ends[:, 0, 0], "z0 [m]": ends[:, 0, 1], "x1 [m]": ends[:, 1, 0],
            "z1 [m]": ends[:, 1, 1], "force [N]": force,
        }  # fmt: skip
        x = scene.positions[list(scene.parts["row 12"]), 0]
        tables[f"{key}_floor"] = {"x [m]": x, "force [N]": floor}
    for preload in PRELOADS:
        scene = _packs.plane(gravity=GRAVITY, preload=preload)
        record = Record(interval=_packs.ROW, sites=wall_sites(scene, "floor"))
        run = _packs.quick(scene, END, record)
        force = wall_force(run, "floor")
        tables.setdefault("struck", {"t [s]": run.t})[f"{preload:g} N"] = force - force[0]
    scene = cubic()
    u = scene.equilibrium.u
    names = dict.fromkeys(scene.wall_names)
    carried = np.array([wall_forces(scene, u, name).sum() for name in names])
    weight = GRAVITY * scene.mass.sum()
    tables["space"] = {"wall": list(names), "force [N]": carried}
    tables["numbers"] = {"weight [N]": np.array([weight]),
                         "left over [N]": np.array([scene.equilibrium.residual])}  # fmt: skip
    return tables


def table(tables):
    """Balance of the weight, and what a preload changes."""
    weight = float(tables["numbers"]["weight [N]"][0])
    floor = float(tables["space"]["force [N]"][0])
    rows = [
        row("rest", "833 beads: the floor's load over the weight, less 1", floor / weight - 1, 0),
        row("rest", "833 beads: one side wall over the weight",
            float(tables["space"]["force [N]"][1]) / weight),
    ]  # fmt: skip
    beads = 246 * STEEL.mass * GRAVITY
    for name, top in zip(LOADS, (0.0, 21.0), strict=True):
        found = tables[f"{name.replace(' ', '_')}_floor"]["force [N]"].sum()
        words = f"planar pack, {name}: the floor's load over it, less 1"
        rows.append(row("rest", words, float(found / (beads + top) - 1), 0))
    t = tables["struck"]["t [s]"]
    for preload in PRELOADS:
        instant, force = largest_peak(t, tables["struck"][f"{preload:g} N"])
        words = f"struck, {preload:g} N on each bead of row 1: further peak [N]"
        rows += [row("rest", words, force), row("rest", "  at [us]", 1e6 * instant)]
    return rows


def draw(figure, tables):
    """Force lines of both, floors, struck floors."""
    from matplotlib.collections import LineCollection

    from figures._draw import name_curves

    figure.set_size_inches(9, 6.4)
    figure.suptitle(__doc__.splitlines()[0].rstrip("."), fontsize=11)
    (a, b), (c, d) = figure.subplots(2, 2)
    for axes, name in ((a, "weight"), (b, "weight and 1 N a bead")):
        t = tables[f"{name.replace(' ', '_')}_contacts"]
        ends = 1e3 * np.stack(list(t.values())[:4], axis=1).reshape(-1, 2, 2)
        most = t["force [N]"].max()
        axes.add_collection(LineCollection(ends, linewidths=5 * t["force [N]"] / most, colors="C3"))
        top = ends[..., 1].max() + 5
        axes.plot([0, 0, 21e3 * D, 21e3 * D], [top, 0, 0, top], "0.3", lw=1.5)
        axes.set(aspect="equal", xlabel="x [mm]", ylabel="z [mm]")
        axes.set_title(f"{name}; widest line {most:.2g} N", fontsize=10)
        axes.grid(False)
        t = tables[f"{name.replace(' ', '_')}_floor"]
        c.plot(1e3 * t["x [m]"], t["force [N]"], "o-", ms=4, label=name.replace(" and", "\nand"))
    c.set(xlabel="x [mm]", ylabel="force [N]", title="single beads on the floor, at rest")
    c.set_ylim(bottom=0)
    c.set_xlim(0, 270)
    name_curves(c)
    for preload in PRELOADS:
        key = f"{preload:g} N"
        d.plot(1e3 * tables["struck"]["t [s]"], tables["struck"][key], lw=1.2, label=key)
    d.set_xlim(0, 0.46)
    name_curves(d)
    d.set(xlabel="time [ms]", ylabel="further force on the floor [N]",
          title="struck, by preload of a bead of row 1")  # fmt: skip
