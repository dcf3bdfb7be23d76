"""Prestress splits the well of a unit with strings of both hands; a larger one ends both wells.

Prisms with upright bars and strings of both hands (`catalogue.twin_strings`): where they have two
stable twists depends on shape and prestrain alone, between a threshold and the prestrain at which
one hand is slack where the other is longest.  The paths of the structure with elastic bars
(`catalogue.twin_prism`) go through the pitchfork at the threshold, and a torque ends a well at the
maximum of its curve (thresholds of this kind: A. Micheletti et al. 2023).
"""

from functools import cache

import numpy as np

from figures._draw import note
from tensegrity import catalogue, control_path, equilibrium_path, held, plates

GROUP = "waves"

HEIGHTS = {3: np.linspace(0.5, 2.0, 31), 4: np.linspace(0.7, 2.2, 31)}  # over the side
PRESTRAINS = {3: np.linspace(0.01, 0.25, 49), 4: np.linspace(0.02, 0.62, 49)}
TWISTS = 801
DRAWN = 0.05, 0.115  # prestrains between which strings of a structure are drawn in
UNEQUAL = 5e-4  # prestrain of one hand more
K_BAR = 1e4  # N/m; strings 1 N/m
PUSHED = 0.09, 0.1, 0.11  # prestrains of structures that a torque switches
LIMITS = np.linspace(0.0834, 0.115, 80)  # prestrains
SIDE = 1.0


@cache
def unit(sides):
    return catalogue.twin_strings(sides=sides)


def of_shape(sides, height, prestrain, torque=0.0):
    """The potential of a unit of side 1 m."""
    rest = np.hypot(height, SIDE) / (1 + prestrain)
    return unit(sides).varied({"h": height, "N": rest, "N_2": rest, "M": torque})


def wells(potential, sides):
    """Stable twists between those at which a hand is longest [rad], each to half a cell."""
    end = np.pi / 2 - np.pi / sides
    twists = np.linspace(-end, end, TWISTS)
    torque = potential.tension(twists)
    rises = np.flatnonzero((torque[:-1] < 0) & (torque[1:] >= 0))
    return (twists[rises] + twists[rises + 1]) / 2


def threshold(sides, height):
    """Prestrain that splits the well."""
    return (SIDE / np.tan(np.pi / sides)) ** 2 / (2 * (height**2 + SIDE**2))


def last(sides, height):
    """Prestrain that ends both."""
    from derivations import bistable as form

    at = {form.sides: sides, form.radius: SIDE / (2 * np.sin(np.pi / sides))}
    return np.array([float(form.last_of_prism().subs({**at, form.height: h})) for h in height])


def turned(positions):
    """Twist of triangular prisms [rad]."""
    upper = positions[..., 3, :]  # the lower polygon is held, its first corner at the angle 0
    return np.arctan2(upper[..., 1], upper[..., 0])


SUPPORTS = held(range(3)) + plates([], range(3, 6))


def natural(prestrain):
    """Natural length of strings [m]."""
    return np.hypot(SIDE, 1.0) / (1 + prestrain)


def drawn(end, branch="stable", more=0.0):
    """The structure, and its path as its strings are drawn in to a prestrain."""
    s = catalogue.twin_prism(prestrain=DRAWN[0], k_bar=K_BAR)
    ends = {m: natural(end + more * (m < s.bars + 3)) for m in range(s.bars, len(s.ends))}
    return s, control_path(s, ends, SUPPORTS, branch)


def prestrain_of(path, end):
    """Prestrain of the strings along a path of `drawn`."""
    first = natural(DRAWN[0])
    return natural(0.0) / (first + path.control * (natural(end) - first)) - 1


def pushed(prestrain):
    """Twist [rad] and torque [N m] of dead forces along the tangents at twist 0, on the path from
    one well through both folds to the other, and the twists of the folds."""
    s, path = drawn(prestrain)
    lengths = s.natural_lengths.copy()
    lengths[s.bars :] = natural(prestrain)
    there = s.at(path.positions[-1], natural_lengths=lengths)
    sense = -np.sign(turned(there.positions))
    tangents = dict(zip((3, 4, 5), sense * np.cross([0, 0, 1], s.positions[3:]), strict=True))
    back = equilibrium_path(there, supports=SUPPORTS, loads=tangents, max_shortening=0.4)
    at = sense * turned(back.positions)
    folds = [at[event.row] for event in back.events if event.kind == "fold"]
    return at, back.load * np.hypot(*s.positions[3, :2]) * np.cos(at), folds


def data():
    """Numbers of wells, twists along paths, and limits."""
    tables = {}
    for sides, heights in HEIGHTS.items():
        grid = PRESTRAINS[sides]
        count = [[len(wells(of_shape(sides, h, p), sides)) for h in heights] for p in grid]
        counts = zip(heights, np.transpose(count), strict=True)
        counts = {f"wells at height {height:.3g}": column for height, column in counts}
        tables[f"{sides} sides"] = {"prestrain": grid} | counts
        limits = {"threshold": threshold(sides, heights), "last": last(sides, heights)}
        tables[f"{sides} sides, limits"] = {"height": heights} | limits
    branches = {"a branch": ("stable", 0.0), "straight": ("symmetric", 0.0)}
    for name, how in (branches | {"unequal": ("stable", UNEQUAL)}).items():
        _, path = drawn(DRAWN[1], *how)
        tables[name] = {"prestrain": prestrain_of(path, DRAWN[1]),
                        "twist": turned(path.positions), "stable": path.stable_load}  # fmt: skip
        if name == "straight":
            tables["split"] = {"prestrain": np.array([prestrain_of(path.events[0], DRAWN[1])])}
    twists = np.linspace(-0.46, 0.46, 185)
    torques = {f"torque at {p:g}": of_shape(3, 1.0, p).tension(twists) for p in PUSHED}
    tables["potential"] = {"twist": twists} | torques
    places = [wells(of_shape(3, 1.0, p), 3)[-1] for p in LIMITS]
    tables["wells"] = {"prestrain": LIMITS, "twist": np.array(places)}
    for p in PUSHED:
        at, torque, folds = pushed(p)
        tables[f"structure {p:g}"] = {"twist": at, "torque": torque}
        tables[f"folds {p:g}"] = {"twist": np.array(folds)}
    return tables


def count(table):
    """Wells, (prestrains, heights)."""
    return np.column_stack([column for name, column in table.items() if name != "prestrain"])


def draw(figure, tables):
    """Where there are two wells, above; the pitchfork and how a torque switches wells, below."""
    figure.set_size_inches(11, 8.4)
    panels = figure.subplots(2, 2)
    for sides, ax in zip(HEIGHTS, panels[0], strict=True):
        _shapes(ax, tables, sides)
    _pitchfork(panels[1, 0], tables)
    ax = panels[1, 1]
    for number, p in enumerate(PUSHED):
        color, (twist, *_) = f"C{number}", tables["potential"].values()
        ax.plot(twist, 1e3 * tables["potential"][f"torque at {p:g}"], color, lw=1)
        twist, torque = tables[f"structure {p:g}"].values()
        ax.plot(twist, 1e3 * torque, color, ls="none", marker="o", ms=4)
        at = np.argmax(np.where(twist < 0, torque, -1))
        note(ax, f"prestrain {p:g}", (twist[at], 1e3 * torque[at]), (0, 6), ha="right", color=color)
        folds, order = tables[f"folds {p:g}"]["twist"], np.argsort(twist)
        ax.plot(folds, 1e3 * np.interp(folds, twist[order], torque[order]), "ks", ms=6, mfc="none")
    words = "lines: energy of rigid bars\ndots: path of the structure\nsquares: its folds"
    ax.annotate(words, (-0.27, -12))
    ax.set(xlabel="twist [rad]", ylabel="torque [mN m]", xlim=(-0.45, 0.45), ylim=(-13, 14))
    ax.set_title("A torque switches wells at a fold (triangles)")


def _shapes(ax, tables, sides):
    heights, found = HEIGHTS[sides], tables[f"{sides} sides"]
    prestrain, (_, first, end) = found["prestrain"], tables[f"{sides} sides, limits"].values()
    ax.pcolormesh(heights, prestrain, count(found), cmap="Blues", vmin=-1, vmax=4,
                  shading="nearest")  # fmt: skip
    box = {"fc": "w", "ec": "none", "pad": 2}
    limits = (first, "splits the well", "C1"), (end, "ends the wells", "C3")
    for k, (limit, words, color) in enumerate(limits):
        ax.plot(heights, limit, color, lw=2)
        place = (0.97, 0.9 - 0.08 * k)
        note(ax, f"derived: {words}", place, inside=True, ha="right", color=color, bbox=box)
    middle = len(heights) // 4
    levels = np.array([0.0, first[middle], end[middle], prestrain[-1]])
    middles = (levels[1:] + levels[:-1]) / 2
    for level, words in zip(middles, ("one well", "two wells", "none"), strict=True):
        ax.text(heights[middle], level, words, ha="center", va="center")
    ax.set(xlabel="height over side", ylabel="prestrain of the strings")
    ax.set(xlim=heights[[0, -1]], ylim=prestrain[[0, -1]])
    ax.set_title(f"{'triangles' if sides == 3 else 'squares'}, by number of wells")


def _pitchfork(ax, tables):
    for side in (1, -1):
        twist = side * tables["wells"]["twist"]
        ax.plot(tables["wells"]["prestrain"], twist, "0.4", lw=1)
        prestrain, twist, _ = tables["a branch"].values()
        ax.plot(prestrain, side * twist, "C0", ls="none", marker="o", ms=4)
    prestrain, twist, stable = tables["straight"].values()
    ax.plot(prestrain[~stable], twist[~stable], "C0", ls="--")
    prestrain, twist, _ = tables["unequal"].values()
    ax.plot(prestrain, twist, "C2")
    ax.plot([threshold(3, 1.0)], [0], "C1", marker="s", ms=8, ls="none")
    words = "stable branches of the structure,\non the wells of rigid bars"
    ax.annotate(words, (0.052, 0.3), color="C0")
    ax.annotate("unstable", (0.1, 0.03), color="C0")
    ax.annotate("one hand more by 0.0005", (0.052, -0.2), color="C2")
    ax.annotate("derived threshold", (0.06, 0.05), color="C1")
    ax.set(xlabel="prestrain of the strings", ylabel="twist [rad]", xlim=DRAWN)
    ax.set_title("Drawn in, the structure leaves its straight state")


def table(tables):
    """Thresholds against counts on the grid, the pitchfork, and how far the structure is off."""
    rows = []
    for sides in HEIGHTS:
        found, (_, first, end) = tables[f"{sides} sides"], tables[f"{sides} sides, limits"].values()
        grid = found["prestrain"][:, None]
        expected = np.where((grid > first) & (grid < end), 2, grid < first)
        wrong = {"counted otherwise": np.count_nonzero(count(found) != expected)}
        rows.append({"sides": sides, "shapes and prestrains": expected.size} | wrong)
    off = []
    for p in PUSHED:
        at, torque = tables[f"structure {p:g}"].values()
        within = np.abs(at) < 0.4
        off.append(np.abs(torque - of_shape(3, 1.0, p).tension(at))[within].max())
    rows[0] |= {
        "threshold, height 1": threshold(3, 1.0),
        "pitchfork of the structure": float(tables["split"]["prestrain"][0]),
        "torque off by [N m]": float(max(off)), "of": float(torque[within].max()),
    }  # fmt: skip
    return rows
