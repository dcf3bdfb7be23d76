"""Where strings go slack, the stable branch of an icosahedron leaves the symmetric path."""

from __future__ import annotations

import numpy as np

from figures._draw import name_curves
from figures._files import lines
from figures._structures import film, frames, show, upright
from tensegrity import catalogue, equilibrium_path, plates

NAME = "structures_icosahedron"
GROUP = "structures"

LOWER, UPPER = (0, 4, 8), (3, 7, 11)
PRESTRAIN = 0.1
FRAMES = 36


def icosahedron():
    """Six bars and 24 strings, upright on a triangle of strings."""
    return upright(catalogue.expandable_octahedron(4.0, PRESTRAIN), LOWER)


def data(progress=iter):
    """Both branches, their events, and nodes and tensions along the stable one."""
    s, tables, marks = icosahedron(), {}, []
    for branch in progress(("stable", "symmetric")):
        limit = 1.3 if branch == "stable" else 1.6
        path = equilibrium_path(
            s, supports=plates(LOWER, UPPER), branch=branch, max_shortening=limit
        )
        tables[branch] = {
            "shortening": path.shortening, "load": path.load,
            "stable_height": path.stable_height, "slack": path.slack.sum(axis=1),
        }  # fmt: skip
        marks += [(branch, e.kind, e.shortening, e.load) for e in path.events]
        if branch == "stable":
            rows = np.linspace(0, len(path) - 1, FRAMES).astype(int)
            tables["frames"] = frames(path, rows)
    names = ("branch", "event", "shortening", "load")
    tables["events"] = dict(zip(names, map(list, zip(*marks, strict=True)), strict=True))
    return tables


def draw(figure, tables):
    """Load against shortening on both branches; the structure before and after slackening."""
    axes = figure.add_subplot(1, 2, 1)
    for branch, style in (("symmetric", "C1--"), ("stable", "C0-")):
        table = tables[branch]
        axes.plot(table["shortening"], table["load"], style, lw=1.8, label=branch)
    events = tables["events"]
    for kind, mark in (("slack", "o"), ("fold", "s"), ("plate", "^")):
        at = [k for k, name in enumerate(events["event"]) if name == kind]
        if at:
            axes.plot([events["shortening"][k] for k in at], [events["load"][k] for k in at],
                      mark, color="0.2", ms=5)  # fmt: skip
            axes.annotate(kind, (events["shortening"][at[0]], events["load"][at[0]]), (-4, 7),
                          textcoords="offset points", ha="right")  # fmt: skip
    axes.set(xlabel="shortening [m]", ylabel="load [N], compression > 0")
    name_curves(axes)
    space = figure.add_subplot(1, 2, 2, projection="3d")
    show(space, tables["frames"], FRAMES - 1)


def animate(tables, path):
    """Animate the compression along the stable branch."""
    film(tables["frames"], path)


def table(tables):
    """The located events."""
    return lines(tables["events"])
