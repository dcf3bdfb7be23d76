"""Where strings go slack, the stable branch of an icosahedron leaves the symmetric path."""

import numpy as np

from figures._draw import name_curves, note
from figures._files import lines, side_by_side
from figures._structures import film, frames, show, upright
from tensegrity import catalogue, equilibrium_path, plates

GROUP = "structures"

LOWER, UPPER = (0, 4, 8), (3, 7, 11)
PRESTRAIN = 0.1
FRAMES = 36


def icosahedron():
    """Six bars and 24 strings, upright on a triangle of strings."""
    return upright(catalogue.expandable_octahedron(4.0, PRESTRAIN), LOWER)


def data():
    """Both branches, their events, and nodes and tensions along the stable one."""
    s, tables, marks = icosahedron(), {}, []
    for branch, limit in (("stable", 1.3), ("symmetric", 1.6)):
        path = equilibrium_path(s, supports=plates(LOWER, UPPER), branch=branch,
                                max_shortening=limit)  # fmt: skip
        tables[branch] = {
            "shortening": path.shortening, "load": path.load,
            "stable_height": path.stable_height, "slack": path.slack.sum(axis=1),
        }  # fmt: skip
        marks += [{"branch": branch, "event": e.kind, "shortening": e.shortening, "load": e.load}
                  for e in path.events]  # fmt: skip
        if branch == "stable":
            rows = np.linspace(0, len(path) - 1, FRAMES).astype(int)
            tables["frames"] = frames(path, rows)
    return tables | {"events": side_by_side(marks)}


def draw(figure, tables):
    """Load against shortening on both branches; the structure before and after slackening."""
    left, right = figure.add_gridspec(1, 2, width_ratios=(1, 1.25))
    axes = figure.add_subplot(left)
    for branch, style in (("symmetric", "C1--"), ("stable", "C0-")):
        table = tables[branch]
        axes.plot(table["shortening"], table["load"], style, lw=1.8, label=branch)
    for kind, mark in (("slack", "o"), ("fold", "s"), ("plate", "^")):
        events = [one for one in lines(tables["events"]) if one["event"] == kind]
        places = [(one["shortening"], one["load"]) for one in events]
        for place in places:
            axes.plot(*place, mark, color="0.2", ms=5)
        if places:
            note(axes, kind, places[0], (-4, 7), ha="right")
    axes.set(xlabel="shortening [m]", ylabel="load [N], compression > 0")
    name_curves(axes)
    space = figure.add_subplot(right, projection="3d")
    show(space, tables["frames"], FRAMES - 1)


def animate(tables, path):
    """Animate the compression along the stable branch."""
    film(tables["frames"], path)


def table(tables):
    """The located events."""
    return lines(tables["events"])
