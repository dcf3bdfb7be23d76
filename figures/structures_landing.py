"""Six bars fall on a floor: the largest force does not grow with the height throughout.

An expandable octahedron, tilted, is dropped from rest.  Every node presses the floor in proportion
to its depth, without loss or friction.  The higher the fall, the harder presses the node that is
hit hardest; the largest force on the floor is that of all nodes that press at once, two or three,
as fully as their turns coincide.  The compression of bars is compared with Euler's buckling load.
"""

import numpy as np

from figures._draw import note
from figures._tables import arrays
from tensegrity import Record, Wall, catalogue, simulate

GROUP = "structures"

STRUT, K_BAR, K_STRING, PRESTRAIN = 1.0, 2e4, 200.0, 0.1  # m, N/m, N/m
MASSES = {"mass": 0.02, "bar_mass": 0.2}  # kg: of each joint, and of each bar along it
GYRATION = 0.025  # m: radius of gyration of the bars
GRAVITY, FLOOR = 9.81, 1e4  # m/s^2, N/m of each node
TILT = (0.2, 0.8, 0.1)  # rad, about the three axes in turn
HEIGHTS, ALL = (0.5, 1.0, 1.5, 1.8), np.round(np.arange(0.1, 2.51, 0.1), 10)  # m
AFTER, DT, EVERY = 0.2, 1e-4, 5  # s; s; steps from one row of the picture to the next


def dropped(height):
    """The octahedron with its lowest node at a height [m]."""
    s = catalogue.expandable_octahedron(STRUT, PRESTRAIN, K_BAR, K_STRING)
    x = s.positions
    for axis, angle in enumerate(TILT):
        i, j = {0, 1, 2} - {axis}
        turn = np.eye(3)
        turn[[i, j, i, j], [i, j, j, i]] = (
            np.cos(angle),
            np.cos(angle),
            -np.sin(angle),
            np.sin(angle),
        )
        x = x @ turn.T
    return s.at(np.add(x, (0, 0, height - x[:, 2].min())), **MASSES)


def landing(height):
    """Times from the first touch [s], forces of the floor on each node and compressions of the
    bars [N], (rows,), (rows, nodes) and (rows, bars), and the energy error of the run."""
    s = dropped(height)
    scene = s.network(walls=[Wall((0, 0, 0), (0, 0, 1))], wall_law=FLOOR, gravity=GRAVITY)
    fall = float(np.sqrt(2 * height / GRAVITY))
    run = simulate(scene, scene.at_rest(), fall + AFTER, method="rkn6", dt=DT,
                   record=Record(every=1))  # fmt: skip
    after = run.t > fall - 0.005
    forces, pushes = scene.wall_load(run.u[after]), -scene.bond_tension(run.u[after])[:, : s.bars]
    return run.t[after] - fall, forces, pushes, run.energy_error


def buckling():
    """Euler's load of a bar with hinged ends [N]: pi^2 EA (radius of gyration over length)^2."""
    return float(np.pi**2 * K_BAR * STRUT * (GYRATION / STRUT) ** 2)


def peaks(height):
    """Largest force on the floor, and of one node, and compression of a bar, of a landing."""
    _, forces, pushes, error = landing(height)
    whole = forces.sum(axis=1)
    return {"height [m]": height, "floor [N]": whole.max(), "node [N]": forces.max(),
            "nodes at once": int(np.sum(forces[whole.argmax()] > 0.1 * whole.max())),
            "bar [N]": pushes.max(), "energy error": error}  # fmt: skip


def data():
    tables = {}
    for height in HEIGHTS:
        t, forces, _, _ = landing(height)
        tables[f"{height} m"] = {"time [s]": t[::EVERY], "floor [N]": forces.sum(axis=1)[::EVERY]}
    tables["peaks"] = arrays([peaks(float(height)) for height in ALL])
    tables["buckling"] = {"load [N]": np.array([buckling()])}
    return tables


def draw(figure, tables):
    figure.set_size_inches(9, 4.2)
    times, floor, bars = figure.subplots(1, 3)
    for k, height in enumerate(HEIGHTS):
        t, force = tables[f"{height} m"].values()
        times.plot(1e3 * t, force - 520 * k, f"C{k}", lw=1)
        times.annotate(f"from {height} m", (1e3 * t[-1], 330 - 520 * k), color=f"C{k}", ha="right")
        times.axhline(-520 * k, color="0.8", lw=0.6, zorder=0)
    times.set(xlabel="time since the first touch [ms]", ylabel="force on the floor [N], shifted")
    times.set_yticks([0, 200, 400])
    times.set_title("nodes land one after another")
    height, whole, node, count, push, _ = tables["peaks"].values()
    floor.plot(height, whole, "0.5", lw=1, zorder=1)
    for k, number in enumerate(sorted({int(n) for n in count})):
        chosen = count == number
        words = f"{number} node{'s' * (number > 1)} at once"
        floor.plot(height[chosen], whole[chosen], f"C{k}o", zorder=2)
        note(floor, words, (0.97, 0.14 - 0.05 * k), inside=True, ha="right", color=f"C{k}")
    floor.plot(height, node, "k--", lw=1)
    note(floor, "dashed: largest on one node", (0.97, 0.19), inside=True, ha="right")
    floor.set(xlabel="height of the fall [m]", ylabel="largest force on the floor [N]")
    floor.set_ylim(0)
    floor.set_title("how many press at once decides")
    (load,) = tables["buckling"]["load [N]"]
    bars.plot(height, push, "C3o-", ms=4)
    bars.axhline(load, color="k", ls="--", lw=1)
    bars.annotate(f"buckling load {load:.0f} N", (height[-1], load), (0, -5), ha="right", va="top",
                  textcoords="offset points")  # fmt: skip
    bars.set(xlabel="height of the fall [m]", ylabel="largest compression of a bar [N]")
    bars.set_ylim(0)
    bars.set_title("bars come to their buckling load")


def table(tables):
    height, whole, node, count, push, error = tables["peaks"].values()
    for k, place in enumerate(height):
        if place in HEIGHTS:
            yield {"fall": f"{place:g} m", "force on the floor [N]": float(whole[k]),
                   "nodes at once": int(count[k]), "on one node [N]": float(node[k]),
                   "bar [N]": float(push[k]), "energy error": float(error[k])}  # fmt: skip
