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
        members += [
            line(number, along, path.columns[along][row], s, member, x, path.tensions[row, member],
                 path.slack[row, member]) for member in range(len(s.ends))
        ]  # fmt: skip
    return side_by_side(members)


def line(frame, along, value, s, member, x, tension, slack):
    """The line of a member of a structure with nodes at x [m] in the table of all frames."""
    return {
        "frame": frame, along: float(value),
        **dict(zip(ENDS, x[s.ends[member]].ravel().tolist(), strict=True)),
        "tension": float(tension), "slack": bool(slack), "string": bool(s.is_string[member]),
    }  # fmt: skip


def show(axes, table, frame=0):
    """The structure of one frame; colours and limits are those of all frames.

    Returns
    -------
    callable (int) -> list of matplotlib.artist.Artist
        Shows another frame there; returns what it changes.
    """
    from matplotlib import colormaps
    from mpl_toolkits.mplot3d.art3d import Line3DCollection

    along, count = list(table)[1], 1 + max(table["frame"])
    ends = np.stack([table[name] for name in ENDS], axis=1).reshape(count, -1, 2, 3)
    tension, slack, string = (
        np.reshape(table[name], ends.shape[:2]) for name in ("tension", "slack", "string")
    )
    largest = tension[string].max()
    styles = {"color": "0.15", "lw": 2.6}, {"lw": 1.4}, {"color": "0.6", "lw": 1.0, "ls": "--"}
    kinds = [axes.add_collection(Line3DCollection([], **one), autolim=False) for one in styles]
    wide, unit = (
        1.05 * np.abs(ends[..., :2]).max(),
        {"shortening": " m", "time": " s"}.get(along, ""),
    )
    low, high = ends[..., 2].min(), ends[..., 2].max()
    axes.set(xlim=(-wide, wide), ylim=(-wide, wide), zlim=(low, high), xlabel="x [m]",
             ylabel="y [m]", zlabel="z [m]")  # fmt: skip
    axes.set_box_aspect((2 * wide, 2 * wide, high - low), zoom=0.72)  # with its labels
    axes.locator_params(nbins=4)
    axes.zaxis.labelpad = 8
    axes.M = axes.get_proj()

    def draw(frame):
        taut = string[frame] & ~slack[frame]
        for kind, chosen in zip(kinds, (~string[frame], taut, slack[frame]), strict=True):
            kind.set_segments(ends[frame, chosen])
            kind.do_3d_projection()
        kinds[1].set_color(colormaps["viridis"](tension[frame, taut] / largest))
        value = abs(table[along][frame * ends.shape[1]])
        words = f"{along} {value:.2f}{unit}; slack strings dashed\ncolour: tension, 0 to "
        return [*kinds, axes.set_title(f"{words}{largest:.2f} N", fontsize=8, y=0.97)]

    draw(frame)
    return draw


def film(table, path):
    """All frames as a GIF."""
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(5, 4.6))
    draw = show(figure.add_subplot(projection="3d"), table)
    plotting.film(path, figure, range(1 + max(table["frame"])), draw, rate=9)


def upright(s, lower):
    """A structure turned and moved so that three nodes lie at height 0, the others above."""
    x = s.positions - s.positions[list(lower)].mean(axis=0)
    first, second = x[lower[0]], x[lower[1]] - x[lower[0]]
    axis = np.cross(first, second)
    axis *= np.sign(axis @ x.mean(axis=0)) / np.linalg.norm(axis)
    first = first / np.linalg.norm(first)
    return s.at(x @ np.array([first, np.cross(axis, first), axis]).T)
