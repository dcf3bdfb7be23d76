"""Whether a pack reduces the force by 70 or 99 % depends on the reference force.

A pack of 833 steel beads struck at 1.65 m/s: forces on floor, single floor beads and sides. The
talk states "force mitigation efficiency at the bottom wall: 70 %" without a reference force. The
table gives the efficiency for several reference forces, for this pack and for variants.
"""

import numpy as np

from figures import _packs
from figures._packs import FAST, STEEL
from granular import wall_force
from granular.contact_network import wall_sites
from tensegrity import Record, largest_peak

NAME = "packs_floor"
GROUP = "packs"

END = 1e-3  # s
SHOWN = {"centre (3, 3)": 24, "corner (6, 6)": 48, "corner (0, 0)": 0}  # beads on the floor
FRONT = 4.5e-4  # s: the direct front has arrived, no reflection has yet
COLUMN_END = 3e-4


def data(by=1.0):
    """Forces on floor, single beads and sides; the peaks; efficiencies.

    Parameters
    ----------
    by : float, optional
        Factor of the speed of the blow.
    """
    scene = _packs.cube(by=by)
    sites = {site for name in ("floor", "left", "right") for site in wall_sites(scene, name)}
    run = _packs.exact(scene, END, Record(interval=_packs.ROW, sites=sorted(sites)))
    each, before = wall_force(run, "floor", each=True), run.t < FRONT
    total, sides = each.sum(axis=1), {name: wall_force(run, name) for name in ("left", "right")}
    hit, column = _packs.direct(STEEL, by * FAST), _packs.column([STEEL] * 17, by * FAST)
    peaks = {
        "floor": largest_peak(run.t, total),
        "first front": largest_peak(run.t[before], total[before]),
        "largest single bead": max((largest_peak(run.t, x) for x in each.T), key=lambda x: x[1]),
        **{f"{name} side": largest_peak(run.t, force) for name, force in sides.items()},
        "column": largest_peak(*_packs.floor_of(column, COLUMN_END, name="end")),
        "steel sides": largest_peak(*_packs.floor_of(_packs.cube(sides="steel", by=by), END)),
    }
    force = {what: peak for what, (_, peak) in peaks.items()}
    against = {
        "the striker straight on the wall": force["floor"] / hit,
        "the same 17 layers as one straight column": force["floor"] / force["column"],
        "the same pack with steel sides": force["floor"] / force["steel sides"],
        "the striker, first front only": force["first front"] / hit,
        "the striker, one sensor below the worst floor bead": force["largest single bead"] / hit,
    }
    return {
        "forces": {
            "t [s]": run.t, "floor [N]": total, **{f"{k} [N]": f for k, f in sides.items()},
            **{f"bead {name} [N]": each[:, k] for name, k in SHOWN.items()},
        },
        "peaks": {"what": list(peaks), "t [s]": [t for t, _ in peaks.values()],
                  "force [N]": list(force.values())},
        "efficiency": {"against": list(against), "efficiency": [1 - x for x in against.values()]},
        "numbers": {"energy error": [run.energy_error]},
    }  # fmt: skip


REFERENCES = {"floor": 202.404006, "first front": 170.10, "largest single bead": 9.81913,
              "left side": 136.85496, "right side": 127.76841}  # fmt: skip


def table(tables):
    """Peaks and efficiencies."""
    what, times, forces = tables["peaks"].values()
    force, found = dict(zip(what, forces, strict=True)), tables["efficiency"].values()
    return _packs.rows("floor", {
        **{f"{name}, peak [N]": (force[name], known) for name, known in REFERENCES.items()},
        "peak on the floor at [us]": (1e6 * times[0], 606.2904),
        **{f"efficiency against {name}": (e, "talk: 0.70") for name, e in zip(*found, strict=True)},
        "energy error": tables["numbers"]["energy error"][0],
    })  # fmt: skip


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
