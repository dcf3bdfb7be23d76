"""Shortening its cross strings raises a folded prism, except where its weight folds it.

Limits of the starting state.  Without load a prism is prestressed at one twist only, with
s^2 = h^2 + 2 R^2 (1 - S): shorter cross strings then lower it, longer ones are slack, and the
prism is a mechanism.  Hence a weight must load the strings.  In the flat state no member has an
axial component: a flat prism under weight stays flat, whatever the tension of its cross strings.
Nearly flat, the strings carry a weight only where shortening raises it: down to a fold, which a
heavier prism reaches earlier.
"""

import numpy as np

from figures._draw import name_curves, note
from figures._files import lines, side_by_side
from figures._structures import film, frames, show
from tensegrity import Prism, control_path, equilibrium, plates

GROUP = "structures"

REFERENCE = Prism(1.0, 0.29, 0.1, k_cross=1.0, k_base=20.0, k_bar=400.0)
LONG = 1.5  # natural length of the cross strings when folded, over that at the reference
LIGHT, HEAVY = 1e-4, 1e-3  # weight of each node above the ground [N]
COUNTS = (1, 3)
GROUND = plates([0, 1, 2])
FRAMES = 30


def cross_strings(count):
    """Member numbers of the cross strings of a column."""
    return range(3 * count, 6 * count)


def weights(s, weight):
    """Loads on all nodes above the ground."""
    return {node: (0.0, 0.0, -weight) for node in range(3, s.nodes)}


def deployed(count):
    """The path from the folded column, found from its long cross strings, to the reference."""
    s = REFERENCE.column(count)
    cross, loads = cross_strings(count), weights(s, LIGHT)
    lengths = s.natural_lengths.copy()
    lengths[cross] *= LONG
    folded = equilibrium(s.at(s.positions, natural_lengths=lengths), loads, GROUND).structure
    wanted = {member: s.natural_lengths[member] for member in cross}
    return control_path(folded, wanted, GROUND, loads=loads)


def paid_out():
    """The reverse path of one heavier prism, from the reference around the fold."""
    s = REFERENCE.structure()
    loads = weights(s, HEAVY)
    standing = equilibrium(s, loads, GROUND).structure
    wanted = {member: LONG * s.natural_lengths[member] for member in cross_strings(1)}
    return control_path(standing, wanted, GROUND, loads=loads)


def columns(count, path):
    """Natural length of the cross strings, height, work, slack and stability."""
    cross = cross_strings(count)
    rest = path.structure.natural_lengths[cross[0]]
    reference = REFERENCE.natural_lengths().cross
    end = reference if rest > reference else LONG * reference
    return {
        "control": path.control, "natural_length": rest + path.control * (end - rest),
        "height": path.positions[:, -3:, 2].mean(axis=1), "work": path.work,
        "slack": path.slack.sum(axis=1), "stable": path.stable_load,
    }  # fmt: skip


def data():
    """Heights, slack, stability and work along the way."""
    tables, marks = {}, []
    for name, count, weight in (*((f"units_{n}", n, LIGHT) for n in COUNTS), ("heavy", 1, HEAVY)):
        path = deployed(count) if weight == LIGHT else paid_out()
        table = tables[name] = columns(count, path)
        events = [(e.kind, e.row, f"control {e.control:.9g}") for e in path.events]
        for kind, row, words in (("start", 0, ""), *events, ("end", len(path) - 1, path.end)):
            at = {key: float(table[key][row]) for key in ("natural_length", "height", "work")}
            marks.append({"units": count, "weight": weight, "event": kind, **at,
                          "slack": int(table["slack"][row]), "stable": bool(table["stable"][row]),
                          "note": words})  # fmt: skip
        if name == f"units_{COUNTS[-1]}":
            tables["frames"] = frames(path, np.linspace(0, len(path) - 1, FRAMES).astype(int))
    return tables | {"events": side_by_side(marks)}


def draw(figure, tables):
    """Height and work of a unit; the column folded and deployed."""
    figure.set_size_inches(9, 7)
    cells = figure.add_gridspec(2, 2)
    heights, work = (figure.add_subplot(cells[row, 0]) for row in (0, 1))
    for count, colour in zip(COUNTS, ("C0", "C2"), strict=True):
        units, label = tables[f"units_{count}"], f"{count} unit{'s' * (count > 1)}"
        heights.plot(units["natural_length"], units["height"] / count, colour, label=label)
        work.plot(units["natural_length"], 1e3 * units["work"] / count, colour, label=label)
    length, height = (tables["heavy"][name] for name in ("natural_length", "height"))
    number = int(np.argmax(length))
    for part, style in ((slice(number + 1), "C3"), (slice(number, None), "C3:")):
        heights.plot(length[part], height[part], style)
    fold, words = (length[number], height[number]), "ten times the weight:\nfold (dotted: unstable)"
    heights.plot(*fold, "ks", ms=4)
    note(heights, words, fold, (-10, 60), color="C3")
    heights.set(ylabel="height of a unit [m]", ylim=(0, 0.45))
    work.set_ylabel("work done on a unit [mJ]")
    for axes in (heights, work):
        axes.invert_xaxis()
        axes.set_xlabel("natural length of cross strings [m], decreasing")
        name_curves(axes)
    for place, frame in ((0, 0), (1, FRAMES - 1)):
        show(figure.add_subplot(cells[place, 1], projection="3d"), tables["frames"], frame)


def animate(tables, path):
    """Animate the deployment."""
    film(tables["frames"], path)


def table(tables):
    """Events, and the ends of the paths."""
    return lines(tables["events"])
