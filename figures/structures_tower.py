"""A tower of two stages found from its natural lengths, and pressed between plates."""

from __future__ import annotations

import numpy as np

from figures._files import lines
from figures._structures import film, frames, show, upright
from tensegrity import Structure, equilibrium_path, plates

NAME = "structures_tower"
GROUP = "structures"

LOWER, UPPER = (0, 1, 2), (9, 10, 11)
FRAMES = 30
GROUPS = {  # members (i, j) of the first of three, and their natural length [m]
    "lower bars": ((0, 3), 2.33),
    "upper bars": ((6, 9), 2.33),
    "lower triangle": ((0, 1), 1.56),
    "upper triangle": ((9, 10), 1.56),
    "saddle, rising": ((3, 6), 0.97),
    "saddle, falling": ((3, 8), 0.97),
    "lower cross": ((0, 5), 1.26),
    "lower verticals": ((0, 7), 0.93),
    "upper cross": ((6, 10), 1.26),
    "upper verticals": ((3, 10), 0.93),
}


def members():
    """Each group's three members, by turns of a third."""

    def turned(node, third):
        return node - node % 3 + (node + third) % 3

    return {
        name: [(turned(i, k), turned(j, k)) for k in range(3)]
        for name, ((i, j), _) in GROUPS.items()
    }


def tower():
    """The tower in the shape that its natural lengths give it, upright."""
    third = 2 * np.pi / 3 * np.arange(3)
    start = [(0.0, 0.0), (150.0, 1.3), (210.0, 0.9), (60.0, 2.2)]  # turn [degrees], height [m]
    guess = [(np.cos(np.radians(a) + t), np.sin(np.radians(a) + t), z)
             for a, z in start for t in third]  # fmt: skip
    found = members()
    lengths = [length for _, length in GROUPS.values() for _ in range(3)]
    s = Structure(
        guess,
        bars=found["lower bars"] + found["upper bars"],
        strings=[pair for name in list(GROUPS)[2:] for pair in found[name]],
        k_bar=100.0,
        k_string=1.0,
        natural_lengths=lengths,
    )
    return upright(s.relaxed(), LOWER)


def data(progress=iter):
    """The form found, its softest motions, and the path between smooth plates."""
    s = tower()
    groups = list(members().items())
    form = {
        "group": [name for name, _ in groups],
        "members": [" ".join(f"{i}-{j}" for i, j in pairs) for _, pairs in groups],
        "natural_length": [GROUPS[name][1] for name, _ in groups],
        "length": s.lengths[::3].tolist(),
        "tension": s.tensions[::3].tolist(),
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
    """The form found; load against shortening; the tower at the end of the stable path."""
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
    """The compression on the stable branch."""
    film(tables["frames"], path)


def table(tables):
    """Members and lengths of the form, then the located events."""
    return lines(tables["form"]) + lines(tables["events"])
