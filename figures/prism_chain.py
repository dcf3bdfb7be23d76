"""A chain: masses lumped at the bases of prisms, which are its springs, under a preload.

Between two masses stands a prism with rigid bases and bars, shortened and twisted by the preload
from its self-stressed state.  Along the axis it is a spring whose energy V is a function of its
elongation alone.
"""

import numpy as np
from matplotlib.patches import Ellipse

from figures.prism_drawing import KINDS
from tensegrity import Prism

GROUP = "waves"

PRISM, PRELOAD, UNITS = Prism(1.0, 0.9, 0.1, 1.0), 0.06, 4
TILT, TURNED = np.radians(16), np.radians(20)  # of the view: from ahead, about the axis
DISC = 0.16  # thickness of a mass, drawn


def data():
    """Height and twist of a prism under the preload; its nodes, the axis along z."""
    height, radius = PRISM.potential(PRELOAD).length, PRISM.base / np.sqrt(3)
    straight = PRISM.height**2 - height**2  # what the rigid bars gain across
    twist = np.arccos(np.cos(np.radians(150)) - straight / (2 * radius**2))
    turns = np.radians(120) * np.arange(3)
    angles = np.concatenate([turns, turns + twist])
    nodes = {"x": radius * np.cos(angles), "y": radius * np.sin(angles),
             "z": np.repeat([0.0, height], 3)}  # fmt: skip
    numbers = {"height without preload": PRISM.height, "height under preload": height,
               "twist under preload [deg]": float(np.degrees(twist))}  # fmt: skip
    return {"nodes": nodes, "numbers": {"quantity": [*numbers], "value": [*numbers.values()]}}


def table(tables):
    """The dimensions that are drawn."""
    for name, value in zip(*tables["numbers"].values(), strict=True):
        yield {"quantity": name, "here": value}


def members():
    """(lower node, upper or other node, kind) of a prism whose bars join node j to 3 + j."""
    for j in range(3):
        yield j, 3 + j, "bars"
        yield j, 3 + (j + 1) % 3, "cross"
        yield j, (j + 1) % 3, "base"
        yield 3 + j, 3 + (j + 1) % 3, "base"


def seen(nodes, start):
    """A prism that begins at a place of the axis, projected with the axis to the right."""
    x, y, z = nodes.T
    up, away = (np.cos(TURNED) * x - np.sin(TURNED) * y, np.sin(TURNED) * x + np.cos(TURNED) * y)
    return np.column_stack([start + z + np.sin(TILT) * away, up])


def draw(figure, tables):
    """Prisms and masses in a row, with preload, displacements and elongation."""
    figure.set_size_inches(9, 3.6)
    axes = figure.subplots()
    nodes = np.column_stack(list(tables["nodes"].values()))
    height, radius = np.ptp(nodes[:, 2]), np.abs(nodes[:, :2]).max()
    pitch = height + DISC
    for k in range(UNITS):
        places = seen(nodes, k * pitch + DISC / 2)
        for a, b, name in members():
            colour, width, _ = KINDS[name]
            axes.plot(*places[[a, b]].T, colour, lw=0.6 * width, solid_capstyle="round", zorder=2)
    for k in range(UNITS + 1):
        size = 2 * radius * np.sin(TILT) + DISC, 2.1 * radius
        axes.add_patch(Ellipse((k * pitch, 0), *size, fc="0.85", ec="0.4", alpha=0.75, zorder=1))
        axes.text(k * pitch, -1.12 * radius, "m", ha="center", va="top", style="italic")
    top, end = 1.25 * radius, UNITS * pitch
    arrow = {"arrowstyle": "-|>", "color": "k", "lw": 1.8}
    for tip, tail in ((-0.35, -0.95), (end + 0.35, end + 0.95)):
        axes.annotate("", (tip, 0), (tail, 0), arrowprops=arrow)
        axes.text((tip + tail) / 2, 0.12, "preload $F_0$", ha="center", fontsize=10)
    for k, name in ((1, "n"), (2, "n+1")):
        moved = {"arrowstyle": "->", "color": "C0"}
        axes.annotate("", (k * pitch + 0.45, top), (k * pitch, top), arrowprops=moved)
        axes.plot([k * pitch] * 2, [0.1, top], "C0", lw=0.8, ls=":")
        axes.text(k * pitch + 0.2, top + 0.06, f"$u_{{{name}}}$", color="C0", ha="center")
    words = "prism: a spring of energy $V(r_n)$\nelongation $r_n = u_{n+1} - u_n$"
    below = {"y": -1.5 * radius, "va": "top", "ha": "center"}
    axes.text(1.3 * pitch, s=words, **below)
    for place, name in ((2.5, "bars"), (3.2, "cross"), (4.1, "base")):
        colour, _, words = KINDS[name]
        axes.text(place * pitch, s=words.split(":")[0], color=colour, **below)
    axes.set(xlim=(-1.4, end + 1.4), ylim=(-2.1 * radius, 1.75 * radius), aspect="equal")
    axes.set_title("Prisms under a preload are the springs between lumped masses", fontsize=12)
    axes.set_axis_off()
