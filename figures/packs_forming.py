"""Formation of new contacts: a break shot and a gas of beads, at the default time step.

Fifteen touching beads in a triangle are hit by a sixteenth at 5 m/s; 36 separated beads start in as
many directions at 2 m/s.  The energy is conserved through every new contact.
"""

from __future__ import annotations

import math

import numpy as np

from figures._disks import disks
from figures._packs import STEEL, D, row
from granular import pack, simulate, wall_force
from tensegrity import Record, Wall, largest_peak

NAME = "packs_forming"
GROUP = "packs"

INTERVAL = 5e-7  # s between rows
ENDS = {"break shot": 9.1e-3, "gas": 12e-3}  # s
COUNTED = (2e-3, 4e-3, 6e-3, 8e-3, 12e-3)  # s
KNOWN = (14, 26, 38, 46, 60)
ROUND_OFF = 1e-12
SHOWN = (0.0, 1.2e-3, 4e-3)  # s


def box(width, height):
    """Four steel walls about a rectangle, as `pack` takes them."""
    planes = {
        "left": ((0, 0), (1, 0)), "right": ((width, 0), (-1, 0)),
        "floor": ((0, 0), (0, 1)), "lid": ((0, height), (0, -1)),
    }  # fmt: skip
    return {name: (Wall(*plane), STEEL.material) for name, plane in planes.items()}


def break_shot():
    """The pack and its first state."""
    rack = [(12 + k * math.sqrt(3) / 2, 6 + i - k / 2) for k in range(5) for i in range(k + 1)]
    scene = pack(np.array([*rack, (10.5, 6)]) * D, STEEL, box(18 * D, 12 * D))
    return scene, scene.at_rest({15: (5.0, 0.0)})


def gas():
    """The pack and initial state of 36 separated beads that start in as many directions."""
    places = (1 + 1.5 * np.array([(i, j) for i in range(6) for j in range(6)])) * D
    scene = pack(places, STEEL, box(9.5 * D, 9.5 * D))
    angle = math.pi * (3 - math.sqrt(5)) * np.arange(36)
    velocity = 2 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return scene, scene.at_rest(dict(enumerate(velocity.tolist())))


def approached(scene, run):
    """Pairs of beads in contact in some row, with the first such instant; {(i, j): s}."""
    i, j = np.triu_indices(scene.sites, 1)
    found = {}
    for t, u in zip(run.t, run.u, strict=True):
        x = scene.positions + u
        for k in np.flatnonzero(np.linalg.norm(x[j] - x[i], axis=1) < D * (1 - ROUND_OFF)).tolist():
            found.setdefault((int(i[k]), int(j[k])), float(t))
    return found


def data():
    """Energy error, first contacts, velocities, forces on a wall."""
    tables = {}
    for name, make in (("break shot", break_shot), ("gas", gas)):
        scene, state = make()
        run = simulate(scene, state, ENDS[name], record=Record(interval=INTERVAL))
        pairs = approached(scene, run)
        key = name.replace(" ", "_")
        tables[f"{key}_energy"] = {"t [s]": run.t, "error": run.energy / run.energy[0] - 1}
        tables[f"{key}_pairs"] = {
            "i": [p[0] for p in pairs], "j": [p[1] for p in pairs], "t [s]": list(pairs.values()),
        }  # fmt: skip
        rows = [int(np.argmin(np.abs(run.t - t))) for t in SHOWN]
        tables[f"{key}_places"] = {
            f"{axis}{n} [m]": (scene.positions + run.u[k])[:, c]
            for n, k in enumerate(rows) for c, axis in enumerate("xz")
        }  # fmt: skip
        if name == "break shot":
            at = int(np.argmin(np.abs(run.t - 1.2e-3)))
            peak = largest_peak(run.t, wall_force(run, "right"))
            tables["numbers"] = {
                "cue at 1.2 ms [m/s]": run.v[at, 15, :1], "apex at 1.2 ms [m/s]": run.v[at, 0, :1],
                "wall peak at [s]": np.array([peak[0]]), "wall peak [N]": np.array([peak[1]]),
            }  # fmt: skip
    return tables


REFERENCES = (-0.891128, -0.600176, 9014.83e-6, 2252.945)


def table(tables):
    """First contacts, counts, energy."""
    rows = []
    for name in ENDS:
        error = tables[f"{name.replace(' ', '_')}_energy"]["error"]
        rows.append(row(name, "energy error, default step", float(np.abs(error).max()), "1e-8"))
    numbers = tables["numbers"].items()
    rows += [row("break shot", what, float(x[0]), known)
             for (what, x), known in zip(numbers, REFERENCES, strict=True)]  # fmt: skip
    t = tables["break_shot_pairs"]
    first = min(t for i, j, t in zip(*t.values(), strict=True) if 15 in (i, j))
    rows.append(row("break shot", "first contact of the cue [us]", 1e6 * first, 953.0))
    times = np.array(tables["gas_pairs"]["t [s]"])
    rows += [row("gas", f"pairs that touched by {1e3 * t:g} ms", int((times <= t).sum()), known)
             for t, known in zip(COUNTED, KNOWN, strict=True)]  # fmt: skip
    order = np.argsort(times)[:3]
    pairs = tables["gas_pairs"]
    known = (1278.75, 1289.5, 1337.25)
    rows += [row("gas", f"contact {n + 1}: {pairs['i'][k]}, {pairs['j'][k]} [us]",
                 1e6 * times[k], known[n]) for n, k in enumerate(order)]  # fmt: skip
    return rows


def draw(figure, tables):
    """Positions at three instants, pairs in contact, and energy error."""
    figure.set_size_inches(13, 7)
    panels = figure.subplots(2, 4)
    for line, (name, size) in zip(panels, (("break shot", (18, 12)), ("gas", (9.5, 9.5))),
                                  strict=True):  # fmt: skip
        key = name.replace(" ", "_")
        places = tables[f"{key}_places"]
        for n, axes in enumerate(line[:3]):
            x = np.stack([places[f"x{n} [m]"], places[f"z{n} [m]"]], axis=1)
            disks(axes, x, D, facecolors="C0", edgecolors="k", lw=0.4, alpha=0.8)
            axes.set(xlim=(0, 1e3 * size[0] * D), ylim=(0, 1e3 * size[1] * D))
            axes.set_title(f"{name}, {1e3 * SHOWN[n]:g} ms")
        line[0].set(ylabel="z [mm]")
        axes, energy = line[3], tables[f"{key}_energy"]
        axes.plot(1e3 * energy["t [s]"], 1e12 * energy["error"], "C3", lw=0.8)
        axes.set(
            xlabel="time [ms]",
            ylabel="energy error [1e-12]",
            title="energy, and pairs in contact so far",
        )
        other = axes.twinx()
        times = np.sort(tables[f"{key}_pairs"]["t [s]"])
        other.step(1e3 * times, np.arange(1, len(times) + 1), "C0", where="post")
        other.set_ylabel("pairs that touched", color="C0")
        other.grid(False)
