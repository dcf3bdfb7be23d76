"""In tension the base strings go slack; in compression the bars meet."""

import math

import numpy as np

from tensegrity import Prism, equilibrium_path

NAME = "response_states"
GROUP = "response"

PRISM = Prism(1.0, 1.0, 0.1, k_cross=1.0, k_base=5.0, k_bar=50.0)
HIGHEST = 1.3
STATES = ("slack base strings", "base strings unload", "reference", "halfway", "contact")


def data(progress=iter):
    """One row per state: height, twist, base, load, and which strings are slack."""
    path = equilibrium_path(PRISM, max_height=HIGHEST)
    start = int(np.flatnonzero(path.height == PRISM.height)[0])
    slack, contact = (next(e for e in path.events if e.kind == k) for k in ("slack", "contact"))
    halfway = (start + len(path)) // 2
    points = [path[0], slack.at, path[start], path[halfway], contact.at]
    columns = {x: [p[x] for p in progress(points)] for x in ("height", "twist", "base", "load")}
    columns["base_slack"] = [True, True, False, False, False]
    columns["cross_slack"] = [False, False, False, False, True]
    return {"states": columns}


def draw(figure, tables):
    """Bars thick, strings thin, slack strings dashed."""
    figure.set_size_inches(9, 3.3)
    table = tables["states"]
    for index, name in enumerate(STATES):
        height, twist, base, load = (table[x][index] for x in ("height", "twist", "base", "load"))
        axes = figure.add_subplot(1, len(STATES), index + 1, projection="3d")
        third = 2 * math.pi / 3 * np.arange(3)
        radius = base / math.sqrt(3)
        low = np.array([radius * np.cos(third), radius * np.sin(third), 0 * third]).T
        turned = third + twist
        up = np.array([radius * np.cos(turned), radius * np.sin(turned), height + 0 * third]).T

        def line(start, end, axes=axes, **style):
            axes.plot(*np.array([start, end]).T, **style)

        base_style = {"color": "C0", "lw": 1, "ls": "--" if table["base_slack"][index] else "-"}
        cross_style = {"color": "C3", "lw": 1, "ls": "--" if table["cross_slack"][index] else "-"}
        for i in range(3):
            line(low[i], up[i], color="0.2", lw=4, solid_capstyle="round")
            line(low[i], up[(i + 2) % 3], **cross_style)
            for ring in (low, up):
                line(ring[i], ring[(i + 1) % 3], **base_style)
        axes.set(xlim=(-0.6, 0.6), ylim=(-0.6, 0.6), zlim=(0, HIGHEST))
        axes.set_box_aspect((1, 1, HIGHEST / 1.2))
        axes.view_init(elev=18, azim=-70)
        axes.set_axis_off()
        axes.set_title(
            f"{name}\ntwist {math.degrees(twist):.0f}°\nheight {height:.3f} m\nload {load:.2f} N",
            fontsize=8,
        )
