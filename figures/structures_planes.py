"""Two-bar truss and planar X under compression: bifurcation from the symmetric path."""

from __future__ import annotations

import numpy as np

from figures._files import lines
from tensegrity import Structure, catalogue, equilibrium_path, held, plates

NAME = "structures_planes"
GROUP = "structures"

BRANCHES = ("stable", "symmetric")
RISES = (1.0, 3.0)  # of the pair over half its span
TALL = (1.0, 2.0)  # height of the X over its width
SHOWN = {"pair": (3.0, 2.0), "X": (2.0, 0.4)}  # of which shapes are drawn, at which shortening [m]
MARKS = {"slack": "o", "fold": "s", "turn": "D", "bifurcation": "X"}


def pair(rise):
    """Two bars from the ground to an apex; without stress."""
    return Structure([[-1, 0], [1, 0], [0, rise]], bars=[(0, 2), (1, 2)], k_bar=10.0)


def cross(height):
    """Four strings round a rectangle of width 1, prestrained by 0.1, and two bars."""
    return catalogue.snelson_x(1.0, height, prestrain=0.1, k_bar=10.0)


def path_of(kind, size, branch):
    """The pair with its feet held; the X on smooth ground, its upper nodes loaded and free."""
    if kind == "pair":
        return equilibrium_path(pair(size), supports=held([0, 1]), loads={2: (0, -1)},
                                branch=branch, max_shortening=2.2 * size)  # fmt: skip
    loads = {node: (0, -0.5) for node in (2, 3)}
    return equilibrium_path(cross(size), supports=plates([0, 1]), loads=loads, branch=branch,
                            max_shortening=0.85 * size)  # fmt: skip


def data(progress=iter):
    """Both branches of each, their events, and shapes on both at one shortening."""
    tables = {"events": {}, "shapes": {}}
    curves, marks, shapes = [], [], []
    cases = [("pair", rise) for rise in RISES] + [("X", height) for height in TALL]
    for kind, size in progress(cases):
        for branch in BRANCHES:
            path = path_of(kind, size, branch)
            curves += [
                (kind, size, branch, *row)
                for row in zip(path.shortening.tolist(), path.load.tolist(),
                               path.stable_height.tolist(), strict=True)
            ]  # fmt: skip
            marks += [(kind, size, branch, e.kind, e.shortening, e.load, e.note)
                      for e in path.events]  # fmt: skip
            if SHOWN[kind][0] == size:
                row = int(np.argmin(np.abs(path.shortening - SHOWN[kind][1])))
                x, s = path.positions[row], path.structure
                for member, (i, j) in enumerate(s.ends.tolist()):
                    shapes.append((kind, branch, *x[i].tolist(), *x[j].tolist(),
                                   bool(s.is_string[member]), bool(path.slack[row, member]),
                                   float(path.shortening[row])))  # fmt: skip
    names = ("kind", "size", "branch", "shortening", "load", "stable")
    tables["curves"] = columns(names, curves)
    tables["events"] = columns((*names[:3], "event", "shortening", "load", "note"), marks)
    names = ("kind", "branch", "x0", "y0", "x1", "y1", "string", "slack", "shortening")
    return tables | {"shapes": columns(names, shapes)}


def columns(names, rows):
    """Rows as named columns."""
    return dict(zip(names, map(list, zip(*rows, strict=True)), strict=True))


def draw(figure, tables):
    """Loads, and the shapes of both branches."""
    figure.set_size_inches(10, 7.5)
    cells = figure.add_gridspec(2, 3, width_ratios=(2, 1, 1))
    words = {"pair": "two bars, rise over half span", "X": "planar X, height over width"}
    for row, kind in enumerate(words):
        axes = figure.add_subplot(cells[row, 0])
        loads(axes, tables, kind)
        axes.set_title(words[kind], fontsize=10)
        for place, branch in enumerate(BRANCHES, start=1):
            shape(figure.add_subplot(cells[row, place]), tables["shapes"], kind, branch)


def loads(axes, tables, kind):
    """Both branches of all sizes, thin where unstable at given shortening; events marked."""
    curves = {name: np.array(values) for name, values in tables["curves"].items()}
    sizes = dict.fromkeys(
        s for k, s in zip(curves["kind"], curves["size"], strict=True) if k == kind
    )
    for number, size in enumerate(sizes):
        for branch, style, width in (("symmetric", "--", 1.2), ("stable", "-", 2.2)):
            rows = (curves["kind"] == kind) & (curves["size"] == size)
            rows &= curves["branch"] == branch
            along, load = curves["shortening"][rows], curves["load"][rows]
            axes.plot(along, load, f"C{number}{style}", lw=0.7)
            load = np.where(curves["stable"][rows], load, np.nan)
            axes.plot(along, load, f"C{number}{style}", lw=width,
                      label=f"{size:g}, {branch} branch")  # fmt: skip
    events = tables["events"]
    for name, mark in MARKS.items():
        at = [k for k, e in enumerate(events["event"]) if e == name and events["kind"][k] == kind]
        if at:
            axes.plot([events["shortening"][k] for k in at], [events["load"][k] for k in at],
                      mark, color="0.2", ms=5, label=name)  # fmt: skip
    axes.set(xlabel="shortening [m]", ylabel="load [N], compression > 0")
    if kind == "X":
        axes.set_ylim(-0.05, 2.0)
    axes.legend(
        fontsize=7, loc="lower left" if kind == "pair" else "upper left", ncols=1 + (kind == "X")
    )


def shape(axes, shapes, kind, branch):
    """Members of one shape: bars black, strings blue, slack ones dashed."""
    found = [row for row in zip(*shapes.values(), strict=True) if row[:2] == (kind, branch)]
    for _, _, x0, y0, x1, y1, string, slack, _ in found:
        style = {"color": "0.15", "lw": 2.6}
        if string:
            style = {"color": "0.6", "ls": "--"} if slack else {"color": "C0", "lw": 1.4}
        axes.plot([x0, x1], [y0, y1], **style)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel="x [m]", ylabel="y [m]")
    axes.set_title(f"{branch} branch\nat shortening {found[0][-1]:.2f} m", fontsize=8)


def table(tables):
    """The located events."""
    return lines(tables["events"])
