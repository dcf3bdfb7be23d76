"""In tension the base strings go slack; in compression the bars meet."""

import math

import numpy as np

from figures._files import lines
from tensegrity import Prism, equilibrium_path

GROUP = "response"

PRISM = Prism(1.0, 1.0, 0.1, k_cross=1.0, k_base=5.0, k_bar=50.0)
HIGHEST = 1.3
STATES = ("slack base strings", "base strings unload", "reference", "halfway", "contact")


def data():
    """One row per state: height, twist, base, load, and which strings are slack."""
    path = equilibrium_path(PRISM, max_height=HIGHEST)
    start = int(np.flatnonzero(path.height == PRISM.height)[0])
    slack, contact = (next(e.at for e in path.events if e.kind == k) for k in ("slack", "contact"))
    points = [path[0], slack, path[start], path[(start + len(path)) // 2], contact]
    columns = {x: [p[x] for p in points] for x in ("height", "twist", "base", "load")}
    columns["base_slack"] = [True, True, False, False, False]
    columns["cross_slack"] = [False, False, False, False, True]
    return {"states": columns}


def draw(figure, tables):
    """Bars thick, strings thin, slack strings dashed."""
    figure.set_size_inches(9, 3.3)
    panels = figure.subplots(1, len(STATES), subplot_kw={"projection": "3d"})
    third = 2 * np.pi / 3 * np.arange(3)
    for axes, name, state in zip(panels, STATES, lines(tables["states"]), strict=True):
        height, twist, base, load, *slack = state.values()
        radius, turned = base / math.sqrt(3), third + twist
        low = np.array([radius * np.cos(third), radius * np.sin(third), 0 * third]).T
        up = np.array([radius * np.cos(turned), radius * np.sin(turned), height + 0 * third]).T
        bars = {"color": "0.2", "lw": 4, "solid_capstyle": "round"}
        strings, cross = ({"color": colour, "lw": 1, "ls": "--" if loose else "-"}
                          for colour, loose in zip(("C0", "C3"), slack, strict=True))  # fmt: skip
        for i in range(3):
            members = ((low[i], up[i], bars), (low[i], up[i - 1], cross),
                       (low[i], low[i - 1], strings), (up[i], up[i - 1], strings))  # fmt: skip
            for start, end, style in members:
                axes.plot(*np.array([start, end]).T, **style)
        axes.set(xlim=(-0.6, 0.6), ylim=(-0.6, 0.6), zlim=(0, HIGHEST))
        axes.set_box_aspect((1, 1, HIGHEST / 1.2))
        axes.view_init(elev=18, azim=-70)
        axes.set_axis_off()
        words = f"{name}\ntwist {math.degrees(twist):.0f}°\nheight {height:.3f} m\n"
        axes.set_title(f"{words}load {load:.2f} N", fontsize=8)
