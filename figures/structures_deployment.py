"""Deployed from nearly flat: cross strings paid out while base strings are drawn in.

A prism under no load is prestressed at one twist only, with s^2 = h^2 + 2 R^2 (1 - S): the lower
it is, the shorter its cross strings beside its base.  So shorter cross strings lower it.  The
condition of prestress, bN^2 > sN^2 + lN^2/S, holds on all of a straight line of (sN, lN) if it
does at both ends, for its right side is convex.
"""

from __future__ import annotations

import numpy as np

from figures._structures import film, frames, show
from tensegrity import Prism, column, control_path

NAME = "structures_deployment"
GROUP = "structures"

STIFFNESS = {"k_cross": 1.0, "k_base": 5.0, "k_bar": 50.0}
REFERENCE = Prism(1.0, 0.7, 0.1, **STIFFNESS)
FLAT = {"cross": 0.35, "base": 1.16}  # natural lengths when folded [m]
COUNTS = (1, 3)
FRAMES = 30


def paths():
    """For each number of units the path from folded to the reference."""
    rest = REFERENCE.natural_lengths()
    folded = Prism.from_members(bar=rest.bar, **FLAT, **STIFFNESS)
    for count in COUNTS:
        s = column(folded, count)
        cross, bases = 3 * count, 6 * count  # numbers of the first of each
        wanted = dict.fromkeys(range(cross, bases), rest.cross)
        wanted |= dict.fromkeys(range(bases, len(s.ends)), rest.base)
        yield count, control_path(s, wanted)


def data(progress=iter):
    """Heights, tensions, slack, stability and work along the way."""
    tables, marks = {}, []
    for count, path in progress(list(paths())):
        cross, bases = 3 * count, 6 * count
        heights = path.positions[:, -3:, 2].mean(axis=1) - path.positions[:, :3, 2].mean(axis=1)
        tables[f"units_{count}"] = {
            "control": path.control, "height": heights, "work": path.work,
            "bar": path.tensions[:, :cross].mean(axis=1),
            "cross": path.tensions[:, cross:bases].mean(axis=1),
            "base": path.tensions[:, bases : bases + 3].mean(axis=1),
            "slack": path.slack.sum(axis=1), "stable": path.stable_load,
        }  # fmt: skip
        marks += [(count, e.kind, e.control, e.note) for e in path.events]
        marks.append((count, "end", float(path.control[-1]), path.end))
        tables["frames"] = frames(path, np.linspace(0, len(path) - 1, FRAMES).astype(int))
    names = ("units", "event", "control", "note")
    return tables | {"events": dict(zip(names, map(list, zip(*marks, strict=True)), strict=True))}


def draw(figure, tables):
    """Height and work; tensions; the column folded and deployed."""
    first = tables[f"units_{COUNTS[0]}"]
    figure.set_size_inches(11, 5.5)
    cells = figure.add_gridspec(2, 4)
    heights, work = figure.add_subplot(cells[0, 0]), figure.add_subplot(cells[1, 0])
    for count, style in zip(COUNTS, ("-", "--"), strict=True):
        units = tables[f"units_{count}"]
        word = "1 unit" if count == 1 else f"{count} units"
        heights.plot(units["control"], units["height"], "C0" + style, label=word)
        work.plot(units["control"], units["work"], "C2" + style, label=word)
    heights.set_ylabel("height [m]")
    heights.legend(fontsize=8)
    work.set(xlabel="control", ylabel="energy stored since [J]")
    tension = figure.add_subplot(cells[:, 1])
    for name, colour in (("cross", "C0"), ("base", "C1"), ("bar", "0.2")):
        tension.plot(first["control"], first[name], color=colour, label=name)
    tension.set(xlabel="control", ylabel="tension of one unit's members [N]")
    tension.legend(fontsize=8)
    for place, frame in ((2, 0), (3, FRAMES - 1)):
        show(figure.add_subplot(cells[:, place], projection="3d"), tables["frames"], frame)


def animate(tables, path):
    """The column going up."""
    film(tables["frames"], path)


def table(tables):
    """Events, and the ends of the paths."""
    events = tables["events"]
    return [dict(zip(events, row, strict=True)) for row in zip(*events.values(), strict=True)]
