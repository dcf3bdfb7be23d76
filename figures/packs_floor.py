"""Whether a pack reduces the force by 70 or 99 % depends on the reference force.

A pack of 833 steel beads struck at 1.65 m/s: forces on floor, single floor beads and sides. The
talk states "force mitigation efficiency at the bottom wall: 70 %" without a reference force. The
table gives the efficiency for several reference forces, for this pack and for variants.
"""

from __future__ import annotations

import numpy as np

from figures import _packs
from figures._packs import FAST, STEEL, row
from granular import wall_force
from granular.contact_network import wall_sites
from tensegrity import Record, largest_peak

NAME = "packs_floor"
GROUP = "packs"

END = 1e-3  # s
SHOWN = {"centre (3, 3)": 24, "corner (6, 6)": 48, "corner (0, 0)": 0}  # beads on the floor
FRONT = 4.5e-4  # s: the direct front has arrived, no reflection has yet
COLUMN_END = 3e-4


def data():
    """Forces on floor, single beads and sides; the peaks; efficiencies."""
    scene = _packs.cube()
    sites = {site for name in ("floor", "left", "right") for site in wall_sites(scene, name)}
    record = Record(interval=_packs.ROW, sites=sorted(sites))
    run = _packs.exact(scene, END, record)
    each = wall_force(run, "floor", each=True)
    total = each.sum(axis=1)
    sides = {name: wall_force(run, name) for name in ("left", "right")}
    hit = _packs.direct(STEEL, FAST)
    lone = largest_peak(*_packs.floor_of(_packs.column([STEEL] * 17, FAST), COLUMN_END, name="end"))
    steel = largest_peak(*_packs.floor_of(_packs.cube(sides="steel"), END))
    before = run.t < FRONT
    peak, first = largest_peak(run.t, total), largest_peak(run.t[before], total[before])
    single = max((largest_peak(run.t, each[:, k]) for k in range(49)), key=lambda found: found[1])
    against = {
        "the striker straight on the wall": (peak[1], hit),
        "the same 17 layers as one straight column": (peak[1], lone[1]),
        "the same pack with steel sides": (peak[1], steel[1]),
        "the striker, first front only": (first[1], hit),
        "the striker, one sensor below the worst floor bead": (single[1], hit),
    }
    return {
        "forces": {
            "t [s]": run.t, "floor [N]": total, **{f"{k} [N]": f for k, f in sides.items()},
            **{f"bead {name} [N]": each[:, k] for name, k in SHOWN.items()},
        },
        "peaks": {
            "what": ["floor", "first front", "largest single bead", "left side", "right side"],
            "t [s]": [x[0] for x in (peak, first, single, *(largest_peak(run.t, f) for f in
                                                            sides.values()))],
            "force [N]": [x[1] for x in (peak, first, single, *(largest_peak(run.t, f) for f in
                                                                sides.values()))],
        },
        "efficiency": {
            "against": list(against),
            "efficiency": [1 - force / other for force, other in against.values()],
        },
        "numbers": {"energy error": np.array([run.energy_error]), "direct [N]": np.array([hit])},
    }  # fmt: skip


REFERENCES = {"floor": "202.404006", "first front": "170.10", "largest single bead": "9.81913",
              "left side": "136.85496", "right side": "127.76841"}  # fmt: skip


def table(tables):
    """Peaks and efficiencies."""
    peaks, found = tables["peaks"], tables["efficiency"]
    return [
        *(row("floor", f"{what}, peak [N]", force, REFERENCES[what])
          for what, force in zip(peaks["what"], peaks["force [N]"], strict=True)),
        row("floor", "peak on the floor at [us]", 1e6 * peaks["t [s]"][0], "606.2904"),
        *(row("floor", f"efficiency against {what}", e, "talk: 0.70")
          for what, e in zip(found["against"], found["efficiency"], strict=True)),
        row("floor", "energy error", float(tables["numbers"]["energy error"][0])),
    ]  # fmt: skip


def draw(figure, tables):
    """Forces on floor, single beads and sides against time; efficiencies as bars."""
    from figures._draw import name_curves

    figure.set_size_inches(9, 6.6)
    (a, b), (c, d) = figure.subplots(2, 2)
    forces, peaks = tables["forces"], tables["peaks"]
    t = 1e3 * forces["t [s]"]
    a.plot(t, forces["floor [N]"], "C0")
    for k, what in ((0, "maximum"), (1, "first front")):
        at, force = 1e3 * peaks["t [s]"][k], peaks["force [N]"][k]
        a.plot(at, force, "o", color="C3", ms=5)
        a.annotate(f"{what}\n{force:.0f} N", (at, force), (0, 4), textcoords="offset points",
                   ha="left" if k == 0 else "right", va="bottom")  # fmt: skip
    a.set(title="floor", ylim=(0, 250))
    for name in SHOWN:
        b.plot(t, forces[f"bead {name} [N]"], lw=1, label=name)
    for name in ("left", "right"):
        c.plot(t, forces[f"{name} [N]"], lw=1, label=name)
    for axes, title in ((b, "single beads of the floor"), (c, "side walls of PTFE")):
        axes.set(title=title, xlim=(0, 1.35))
        name_curves(axes)
    for axes in (a, b, c):
        axes.set(xlabel="time [ms]", ylabel="force [N]")
    found = tables["efficiency"]
    place = np.arange(len(found["against"]))[::-1]
    d.barh(place, 100 * np.array(found["efficiency"]), color="C0", height=0.55)
    d.axvline(70, color="C3", lw=1, ls="--")
    d.text(71, 4.42, "the talk's 70 %", color="C3")
    names = [x.replace(", ", ",\n").replace(" as one", "\nas one") for x in found["against"]]
    names = [x.replace("straight on", "straight\non").replace("below", "\nbelow") for x in names]
    d.set_yticks(place, names, fontsize=8)
    for y, e in zip(place, found["efficiency"], strict=True):
        d.text(2, y, f"{100 * e:.1f} %", color="w", va="center")
    d.set(xlabel="1 - force / reference force [%]", ylabel="reference", title="efficiency",
          xlim=(0, 118), ylim=(-0.5, 4.8))  # fmt: skip
