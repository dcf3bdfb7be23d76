"""Structures drawn in space: bars black, strings by tension, slack ones dashed."""

import numpy as np

from figures._files import side_by_side
from tensegrity import plotting

ENDS = ("x0", "y0", "z0", "x1", "y1", "z1")


def frames(path, rows):
    """Some rows of a path, one line for each member of each: ends, tension, whether slack."""
    s, along, members = path.structure, next(iter(path.columns)), []
    for number, row in enumerate(np.asarray(rows).tolist()):
        x = path.positions[row] - [0, 0, path.positions[row, :, 2].min()]  # on the ground
        for member, ends in enumerate(s.ends.tolist()):
            members.append({
                "frame": number, along: float(path.columns[along][row]),
                **dict(zip(ENDS, x[ends].ravel().tolist(), strict=True)),
                "tension": float(path.tensions[row, member]),
                "slack": bool(path.slack[row, member]), "string": bool(s.is_string[member]),
            })  # fmt: skip
    return side_by_side(members)


def show(axes, table, frame):
    """The structure of one frame; colours and limits are those of all frames."""
    from matplotlib import colormaps

    along, rows = list(table)[1], np.flatnonzero(np.array(table["frame"]) == frame)
    everything = np.column_stack([table[name] for name in ENDS])
    tension, strings = np.array(table["tension"]), np.array(table["string"])
    largest = tension[strings].max()
    for row in rows.tolist():
        line = {"color": "0.15", "lw": 2.6}
        if strings[row]:
            line = {"color": colormaps["viridis"](tension[row] / largest), "lw": 1.4}
            if table["slack"][row]:
                line = {"color": "0.6", "lw": 1.0, "ls": "--"}
        axes.plot(*everything[row].reshape(2, 3).T, **line)
    wide = 1.05 * np.abs(everything[:, [0, 1, 3, 4]]).max()
    low, high = everything[:, [2, 5]].min(), everything[:, [2, 5]].max()
    axes.set(xlim=(-wide, wide), ylim=(-wide, wide), zlim=(low, high), xlabel="x [m]",
             ylabel="y [m]", zlabel="z [m]")  # fmt: skip
    axes.set_box_aspect((2 * wide, 2 * wide, high - low), zoom=0.72)  # with its labels
    axes.locator_params(nbins=4)
    axes.zaxis.labelpad = 8
    unit = " m" if along == "shortening" else ""
    words = f"{along} {abs(table[along][rows[0]]):.2f}{unit}; slack strings dashed\n"
    axes.set_title(f"{words}colour: tension, 0 to {largest:.2f} N", fontsize=8, y=0.97)


def film(table, path):
    """All frames as a GIF."""
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(5, 4.6))
    axes = figure.add_subplot(projection="3d")

    def frame(number):
        axes.clear()
        show(axes, table, number)

    plotting.film(path, figure, range(1 + max(table["frame"])), frame, rate=9)


def upright(s, lower):
    """A structure turned and moved so that three nodes lie at height 0, the others above."""
    x = s.positions - s.positions[list(lower)].mean(axis=0)
    first, second = x[lower[0]], x[lower[1]] - x[lower[0]]
    axis = np.cross(first, second)
    axis *= np.sign(axis @ x.mean(axis=0)) / np.linalg.norm(axis)
    first = first / np.linalg.norm(first)
    return s.at(x @ np.array([first, np.cross(axis, first), axis]).T)
