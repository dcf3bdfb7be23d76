"""Prestress splits the well of a unit with strings of both hands; a larger one ends both wells.

Prisms with upright bars and strings of both hands (`catalogue.twin_strings`): where they have two
stable twists depends on shape and prestrain alone, between a threshold and the prestrain at which
one hand is slack where the other is longest.  The paths of the structure with elastic bars
(`catalogue.twin_prism`) go through the pitchfork at the threshold, and a torque ends a well at the
maximum of its curve (thresholds of this kind: A. Micheletti et al. 2023).
"""

from __future__ import annotations

from functools import cache

import numpy as np

from tensegrity import catalogue, control_path, equilibrium_path, held, plates

NAME = "transition_units"
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
        tables[f"{sides} sides"] = {"prestrain": grid} | {
            f"wells at height {h:.3g}": np.array(count)[:, k] for k, h in enumerate(heights)
        }
        tables[f"{sides} sides, limits"] = {
            "height": heights, "threshold": threshold(sides, heights),
            "last": last(sides, heights),
        }  # fmt: skip
    for name, branch, more in (
        ("a branch", "stable", 0.0), ("straight", "symmetric", 0.0), ("unequal", "stable", UNEQUAL),
    ):  # fmt: skip
        _, path = drawn(DRAWN[1], branch, more)
        stable = path.stable_load
        tables[name] = {"prestrain": prestrain_of(path, DRAWN[1]),
                        "twist": turned(path.positions), "stable": stable}  # fmt: skip
        if branch == "symmetric":
            split = path.events[0]
            tables["split"] = {"prestrain": np.array([prestrain_of(split, DRAWN[1])])}
    twists = np.linspace(-0.46, 0.46, 185)
    tables["potential"] = {"twist": twists} | {
        f"torque at {p:g}": of_shape(3, 1.0, p).tension(twists) for p in PUSHED
    }
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
    for letter, (sides, heights), ax in zip("ab", HEIGHTS.items(), panels[0], strict=True):
        found, limits = tables[f"{sides} sides"], tables[f"{sides} sides, limits"]
        ax.pcolormesh(heights, found["prestrain"], count(found), cmap="Blues", vmin=-1, vmax=4,
                      shading="nearest")  # fmt: skip
        for name, words, color in (("threshold", "splits", "C1"), ("last", "ends", "C3")):
            ax.plot(limits["height"], limits[name], color, lw=2)
            ax.annotate(f"derived: {words} the well" + "s" * (name == "last"),
                        (0.97, 0.9 - 0.08 * (name == "last")), xycoords="axes fraction", ha="right",
                        color=color, bbox={"fc": "w", "ec": "none", "pad": 2})  # fmt: skip
        middle = len(heights) // 4
        lower, upper, top = limits["threshold"][middle], limits["last"][middle], found["prestrain"]
        for level, words in ((lower / 2, "one well"), ((lower + upper) / 2, "two wells"),
                             ((upper + top[-1]) / 2, "none")):  # fmt: skip
            ax.text(heights[middle], level, words, ha="center", va="center", fontsize=10)
        ax.set(xlabel="height over side", ylabel="prestrain of the strings")
        ax.set(xlim=heights[[0, -1]], ylim=top[[0, -1]])
        ax.set_title(f"({letter}) {'triangles' if sides == 3 else 'squares'}, by number of wells",
                     fontsize=10)  # fmt: skip
    _pitchfork(panels[1, 0], tables)
    ax, potential = panels[1, 1], tables["potential"]
    for number, p in enumerate(PUSHED):
        found, folds = tables[f"structure {p:g}"], tables[f"folds {p:g}"]["twist"]
        ax.plot(potential["twist"], 1e3 * potential[f"torque at {p:g}"], f"C{number}", lw=1)
        ax.plot(found["twist"], 1e3 * found["torque"], f"C{number}", ls="none", marker="o", ms=4)
        at = np.argmax(np.where(found["twist"] < 0, found["torque"], -1))
        ax.annotate(
            f"prestrain {p:g}",
            (found["twist"][at], 1e3 * found["torque"][at]),
            (0, 6),
            textcoords="offset points",
            ha="right",
            color=f"C{number}",
            fontsize=10,
        )
        level = np.interp(
            folds, np.sort(found["twist"]), found["torque"][np.argsort(found["twist"])]
        )
        ax.plot(folds, 1e3 * level, "ks", ms=6, mfc="none")
    ax.annotate("lines: energy of rigid bars\ndots: path of the structure\nsquares: its folds",
                (-0.27, -12))  # fmt: skip
    ax.set(xlabel="twist [rad]", ylabel="torque [mN m]", xlim=(-0.45, 0.45), ylim=(-13, 14))
    ax.set_title("(d) A torque switches wells at a fold (triangles)", fontsize=10)


def _pitchfork(ax, tables):
    branch, straight, unequal = (tables[name] for name in ("a branch", "straight", "unequal"))
    for side in (1, -1):
        ax.plot(tables["wells"]["prestrain"], side * tables["wells"]["twist"], "0.4", lw=1)
        ax.plot(branch["prestrain"], side * branch["twist"], "C0", ls="none", marker="o", ms=4)
    held_up = ~straight["stable"]
    ax.plot(straight["prestrain"][held_up], straight["twist"][held_up], "C0", ls="--")
    ax.plot(unequal["prestrain"], unequal["twist"], "C2")
    ax.plot([threshold(3, 1.0)], [0], "C1", marker="s", ms=8, ls="none")
    for place, color, words in (
        ((0.052, 0.3), "C0", "stable branches of the structure,\non the wells of rigid bars"),
        ((0.1, 0.03), "C0", "unstable"), ((0.052, -0.2), "C2", "one hand more by 0.0005"),
        ((0.06, 0.05), "C1", "derived threshold"),
    ):  # fmt: skip
        ax.annotate(words, place, color=color)
    ax.set(xlabel="prestrain of the strings", ylabel="twist [rad]", xlim=DRAWN)
    ax.set_title("(c) Drawn in, the structure leaves its straight state", fontsize=10)


def table(tables):
    """Thresholds against counts on the grid, the pitchfork, and how far the structure is off."""
    rows = []
    for sides in HEIGHTS:
        found, limits = tables[f"{sides} sides"], tables[f"{sides} sides, limits"]
        between = (found["prestrain"][:, None] > limits["threshold"]) & (
            found["prestrain"][:, None] < limits["last"])  # fmt: skip
        below = found["prestrain"][:, None] < limits["threshold"]
        wrong = np.count_nonzero(count(found) != np.where(between, 2, below))
        rows.append(
            {"sides": sides, "shapes and prestrains": between.size, "counted otherwise": wrong}
        )
    rows[0] |= {"threshold, height 1": threshold(3, 1.0),
                "pitchfork of the structure": float(tables["split"]["prestrain"][0])}  # fmt: skip
    off = []
    for p in PUSHED:
        found, exact = tables[f"structure {p:g}"], of_shape(3, 1.0, p)
        within = np.abs(found["twist"]) < 0.4
        off.append(np.abs(found["torque"] - exact.tension(found["twist"]))[within].max())
    rows[0] |= {"torque off by [N m]": float(max(off)), "of": float(found["torque"][within].max())}
    return rows
