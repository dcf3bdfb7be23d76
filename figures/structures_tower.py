"""A two-stage tensegrity tower: form finding from natural lengths, then axial compression."""

from __future__ import annotations

import numpy as np

from figures._files import lines
from figures._structures import film, frames, show, upright
from tensegrity import catalogue, equilibrium_path, plates

NAME = "structures_tower"
GROUP = "structures"

LOWER, UPPER = (0, 1, 2), (9, 10, 11)
FRAMES = 30
LENGTHS = {  # natural ones of six members each [m]
    "bars": 2.33,
    "end triangles": 1.56,
    "saddles": 0.97,
    "diagonals": 1.26,
    "verticals": 0.93,
}


def tower():
    """The tower, upright, in the equilibrium shape of its natural lengths."""
    s = catalogue.tower(2)
    lengths = np.repeat(list(LENGTHS.values()), 6)
    return upright(s.at(s.positions, natural_lengths=lengths).relaxed(), LOWER)


def data(progress=iter):
    """The equilibrium form, its softest modes, and the path between smooth plates."""
    s = tower()
    form = {
        "group": list(LENGTHS),
        "members": [
            " ".join(f"{i}-{j}" for i, j in six) for six in s.ends.reshape(5, 6, 2).tolist()
        ],
        "natural_length": list(LENGTHS.values()),
        "length": s.lengths[::6].tolist(),
        "tension": s.tensions[::6].tolist(),
    }
    tables = {"form": form, "nodes": dict(zip("xyz", s.positions.T.tolist(), strict=True))}
    tables["modes"] = {"eigenvalue": s.modes(6).eigenvalues.tolist()}
    marks = []
    for branch in progress(("stable", "symmetric")):
        path = equilibrium_path(s, supports=plates(LOWER, UPPER), branch=branch)
        tables[branch] = {
            "shortening": path.shortening, "load": path.load,
            "stable_height": path.stable_height, "slack": path.slack.sum(axis=1),
        }  # fmt: skip
        marks += [(branch, e.kind, e.shortening, e.load, e.note) for e in path.events]
        marks.append((branch, "end", float(path.shortening[-1]), float(path.load[-1]), path.end))
        if branch == "stable":
            tables["frames"] = frames(path, np.linspace(0, len(path) - 1, FRAMES).astype(int))
    names = ("branch", "event", "shortening", "load", "note")
    tables["events"] = dict(zip(names, map(list, zip(*marks, strict=True)), strict=True))
    return tables


def draw(figure, tables):
    """The equilibrium form; load against shortening; the tower at the end of the stable path."""
    figure.set_size_inches(11, 4.5)
    cells = figure.add_gridspec(1, 3, width_ratios=(1, 1.1, 1))
    show(figure.add_subplot(cells[0], projection="3d"), tables["frames"], 0)
    show(figure.add_subplot(cells[2], projection="3d"), tables["frames"], FRAMES - 1)
    axes = figure.add_subplot(cells[1])
    for branch, style in (("symmetric", "C1--"), ("stable", "C0-")):
        axes.plot(tables[branch]["shortening"], tables[branch]["load"], style, label=branch)
    events = tables["events"]
    for kind, mark in (("slack", "o"), ("fold", "s"), ("bifurcation", "x"), ("contact", "^")):
        at = [k for k, name in enumerate(events["event"]) if name == kind]
        if at:
            axes.plot([events["shortening"][k] for k in at], [events["load"][k] for k in at],
                      mark, color="0.2", ms=5, label=kind)  # fmt: skip
    axes.set(xlabel="shortening [m]", ylabel="load [N], compression > 0")
    axes.legend(fontsize=8)


def animate(tables, path):
    """Animate the compression along the stable branch."""
    film(tables["frames"], path)


def table(tables):
    """Members and lengths of the form, then the located events."""
    return lines(tables["form"]) + lines(tables["events"])
