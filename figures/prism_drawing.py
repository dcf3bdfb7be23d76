"""A triangular prism: base, height, twist, kinds of members, and the sign convention.

Self-stressed state of a triangular prism in side and top view.  The prestrained cross strings are
in tension and the bars in compression; the top triangle is rotated by 5 pi/6 relative to the
bottom one.
"""

import numpy as np
from matplotlib.patches import Arc

from tensegrity import Prism

GROUP = "start"

PRISM = Prism(base=1.0, height=1.1, prestrain=0.05, k_cross=1.0, k_base=5.0, k_bar=50.0)
TURNED = np.radians(-38)  # rotation of the view about the axis
TILT = np.radians(14)  # elevation of the view
KINDS = {  # group of members: colour, width, label
    "bars": ("0.25", 6.0, "bar: compression"),
    "cross": ("#c0392b", 1.8, "cross string: tension"),
    "base": ("#17607a", 1.8, "base string: tension"),
}
FORCE = {"arrowstyle": "-|>", "color": "0.2", "lw": 1.6}
ARROW = {"arrowstyle": "<->", "color": "0.35", "lw": 1.0, "shrinkA": 0, "shrinkB": 0}


def kind(height_apart, is_string):
    """Kind of a member: base string, cross string or bar."""
    if not is_string:
        return "bars"
    return "base" if abs(height_apart) < 1e-9 else "cross"


def data():
    """Nodes of the self-stressed state; its members with end nodes, tensions and lengths."""
    structure = PRISM.structure()
    nodes, ends = np.array(structure.positions), np.array(structure.ends)
    rise = nodes[ends[:, 1], 2] - nodes[ends[:, 0], 2]
    kinds = [kind(z, one) for z, one in zip(rise, structure.is_string, strict=True)]
    first, last = (np.arctan2(*nodes[i, 1::-1]) for i in (0, bar_end(ends, kinds, 0)))
    twist = float(np.degrees(last - first) % 360)
    return {
        "nodes": dict(zip("xyz", nodes.T, strict=True)),
        "members": {"first": ends[:, 0], "second": ends[:, 1], "kind": kinds,
                    "tension [N]": structure.tensions},
        "numbers": {
            "quantity": ["base", "height", "twist [deg]", "prestrain"],
            "value": [PRISM.base, float(np.ptp(nodes[:, 2])), twist, PRISM.prestrain],
        },
    }  # fmt: skip


def bar_end(ends, kinds, node):
    """The node at the other end of the bar that meets a node."""
    for (a, b), name in zip(ends.tolist(), kinds, strict=True):
        if name == "bars" and node in (a, b):
            return b if a == node else a
    raise ValueError(f"no bar ends at node {node}")


def table(tables):
    """The dimensions that are drawn."""
    for name, value in zip(*tables["numbers"].values(), strict=True):
        yield {"quantity": name, "here": value}


def seen(nodes):
    """Projected coordinates of points in space, and their distances towards the viewer."""
    x, y, z = nodes.T
    right = np.cos(TURNED) * x - np.sin(TURNED) * y
    away = np.sin(TURNED) * x + np.cos(TURNED) * y
    up = np.cos(TILT) * z + np.sin(TILT) * away
    return np.column_stack([right, up]), np.sin(TILT) * z - np.cos(TILT) * away


def members(axes, places, depth, tables):
    """Draw the members from the farthest to the nearest."""
    t = tables["members"]
    rows = sorted(zip(t["first"], t["second"], t["kind"], strict=True),
                  key=lambda row: depth[row[0]] + depth[row[1]])  # fmt: skip
    for a, b, name in rows:
        colour, width, label = KINDS[name]
        axes.plot(*places[[a, b]].T, color=colour, lw=width, solid_capstyle="round", label=label)
    axes.plot(*places.T, "o", color="white", mec="0.2", ms=6, zorder=5)


def draw(figure, tables):
    """Side view with lengths and signs, top view with the twist."""
    figure.set_size_inches(9.5, 5.2)
    side, top = figure.subplots(1, 2, width_ratios=(1.25, 1))
    nodes = np.column_stack(list(tables["nodes"].values()))
    from_side(side, nodes, tables)
    from_above(top, nodes, tables)
    for axes, words in ((side, "from the side"), (top, "from above")):
        axes.set_title(words)
        axes.set_aspect("equal")
        axes.set_axis_off()


def from_side(axes, nodes, tables):
    """The side view: height, kinds of members, and the signs along the axis."""
    places, depth = seen(nodes)
    members(axes, places, depth, tables)
    (bottom, up), far = np.array([[0, 0, z] for z in (nodes[:, 2].min(), nodes[:, 2].max())]), 0.86
    levels = seen(np.array([bottom, up]))[0][:, 1]
    axes.annotate("", (far, levels[1]), (far, levels[0]), arrowprops=ARROW)
    axes.text(far + 0.05, levels.mean(), "height", va="center")
    for level in levels:
        axes.plot([0.0, far + 0.04], [level, level], color="0.6", lw=0.7, ls=":")
    high = levels[1] + 0.2
    for x, tip, tail in ((-0.14, high, high + 0.34), (0.14, high + 0.34, high)):
        axes.annotate("", (x, tip), (x, tail), arrowprops=FORCE)
    axes.text(-0.2, high + 0.17, "load,\nshortening > 0", ha="right", va="center")
    axes.text(0.2, high + 0.17, "tension,\nelongation > 0", ha="left", va="center")
    handles = dict(zip(*axes.get_legend_handles_labels()[::-1], strict=True))
    axes.legend(handles.values(), handles.keys(), loc="upper center",
                bbox_to_anchor=(0.5, 0.02), ncols=3, handlelength=1.4)  # fmt: skip
    axes.set(xlim=(-0.95, 1.25), ylim=(levels[0] - 0.3, high + 0.45))


def from_above(axes, nodes, tables):
    """The top view: base, and the twist between a node and the upper end of its bar."""
    places, depth = nodes[:, :2], nodes[:, 2]
    members(axes, places, depth, tables)
    t = tables["members"]
    ends = np.column_stack([t["first"], t["second"]])
    low = [i for i in range(len(nodes)) if depth[i] < depth.mean()]
    start, end = low[0], bar_end(ends, t["kind"], low[0])
    for node in (start, end):
        axes.plot(*np.array([(0, 0), places[node]]).T, color="0.45", lw=0.9, ls="--", zorder=4)
    angles = [np.degrees(np.arctan2(*places[node][::-1])) for node in (start, end)]
    axes.add_patch(Arc((0, 0), 0.42, 0.42, theta1=angles[0], theta2=angles[1], color="0.2", lw=1.4))
    along = np.radians(angles[0] + 65)
    line, on_arc = {"arrowstyle": "-", "color": "0.35", "lw": 0.8}, (np.cos(along), np.sin(along))
    axes.annotate("twist 5π/6", 0.21 * np.array(on_arc), (0.42, 0.62), ha="center", arrowprops=line)
    below = [i for i in low if i != start]
    a, b = places[below]
    out = (a + b) / 2
    out = 0.16 * out / np.linalg.norm(out)
    axes.annotate("", b + out, a + out, arrowprops=ARROW)
    axes.text(*((a + b) / 2 + 1.7 * out), "base", ha="center", va="center")
    stretch = "prestrain = (length − natural length)\n/ natural length of a cross string"  # noqa: RUF001
    axes.text(0, -0.98, stretch, ha="center", va="center", fontsize=9)
    axes.set(xlim=(-0.9, 0.9), ylim=(-1.15, 0.85))
