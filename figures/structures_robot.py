"""A robot of six bars kicks itself off the floor by the work of its winches.

Sixteen of the 24 strings of an expandable octahedron, tilted and at rest on its lowest node, are
wound in and out, each at a frequency of its own, and keep EA.  Its nodes press the floor without
friction, so that it turns over, jumps and lands while its centre of mass stays above one place; it
does not get anywhere.  The energy that it gains is the work of the winches.
"""

import numpy as np
import sympy as sp

from figures._files import side_by_side
from figures._structures import film, line, show
from figures.structures_landing import FLOOR, GRAVITY, dropped
from tensegrity import Record, Wall, simulate

GROUP = "structures"

T = sp.Symbol("t")
DEPTH, SLOWEST, FASTEST = 0.25, 1.5, 4.0  # of the natural length; rad/s
END, DT, FRAMES = 2.0, 1 / 4096, 64  # s; s
SHOWN = 40  # frame of the picture


def robot():
    """The octahedron on the floor, and natural lengths {string: expression of t [m]}."""
    s = dropped(0.0)
    axial = s.stiffnesses * s.natural_lengths
    s = s.at(
        s.positions, k_bar=None, k_string=None, EA_bar=axial[: s.bars], EA_string=axial[s.bars :]
    )
    strings = range(s.bars, len(s.ends))
    omega = dict(zip(strings, np.linspace(SLOWEST, FASTEST, len(strings)).tolist(), strict=True))
    return s, {
        m: s.natural_lengths[m] * (1 - DEPTH * sp.sin(omega[m] * T) ** 2) for m in strings if m % 3
    }


def moved(end=END, dt=DT, rows=FRAMES * 16):
    """The run of the robot, with this many rows."""
    s, wound = robot()
    scene = s.network(
        natural_lengths=wound, walls=[Wall((0, 0, 0), (0, 0, 1))], wall_law=FLOOR, gravity=GRAVITY
    )
    every = Record(every=max(1, round(end / dt) // rows))
    return simulate(scene, scene.at_rest(), end, dt=dt, method="rkn6", record=every)


def centre(s, run):
    """Centre of mass at each row [m], (rows, 3)."""
    mass = s.weighing_mass
    return np.einsum("n,tnk->tk", mass, s.positions + run.u) / mass.sum()


def data():
    (s, wound), run = robot(), moved()
    middle = centre(s, run)
    tables = {
        "run": {
            "time [s]": run.t, "work [J]": run.work,
            "energy gained [J]": run.energy - run.energy[0],
            "floor [N]": run.scene.wall_load(run.u).sum(axis=1), "height [m]": middle[:, 2],
            "sideways [m]": np.hypot(*(middle - middle[0])[:, :2].T),
        }
    }  # fmt: skip
    lengths, frames = sp.lambdify(T, list(wound.values())), []
    for number, row in enumerate(np.linspace(0, len(run.t) - 1, FRAMES).astype(int).tolist()):
        natural = s.natural_lengths.copy()
        natural[[*wound]] = lengths(run.t[row])
        now = s.at(s.positions + run.u[row], natural_lengths=natural)
        frames += [
            line(number, "time", run.t[row], s, member, now.positions, now.tensions[member],
                 now.slack[member]) for member in range(len(s.ends))
        ]  # fmt: skip
    return tables | {"frames": side_by_side(frames)}


def draw(figure, tables):
    figure.set_size_inches(11, 4.2)
    t, work, gained, floor, height, _ = tables["run"].values()
    energy, force = figure.add_subplot(1, 3, 1), figure.add_subplot(1, 3, 2)
    energy.plot(t, work, "C0", lw=2.5, label="work of the winches")
    energy.plot(t, gained, "k--", lw=1, label="energy gained")
    energy.set(xlabel="time [s]", ylabel="energy [J]", title="the work is the energy gained")
    energy.legend(fontsize=8)
    force.plot(t, floor, "C1", lw=0.8)
    force.set(xlabel="time [s]", ylabel="force on the floor [N]", title="it leaves the floor")
    beside = force.twinx()
    beside.plot(t, height, "C2", lw=1.5)
    beside.set_ylabel("height of the centre of mass [m]", color="C2")
    beside.set_ylim(0)
    beside.grid(visible=False)
    show(figure.add_subplot(1, 3, 3, projection="3d"), tables["frames"], SHOWN)


def animate(tables, path):
    """Write all frames as an animation."""
    film(tables["frames"], path)


def table(tables):
    t, work, gained, floor, height, sideways = tables["run"].values()
    for end in (END / 2, END):
        row = int(np.argmin(np.abs(t - end)))
        yield {"time [s]": float(t[row]), "work [J]": float(work[row]),
               "energy gained less work [J]": float(gained[row] - work[row]),
               "largest force on the floor [N]": float(floor[: row + 1].max()),
               "height [m]": float(height[row]), "sideways [m]": float(sideways[row])}  # fmt: skip
