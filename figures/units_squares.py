"""Rotating squares: their counter-rotation is a zero mode where neither tilt nor hinges resist.

Rigid squares hinged at their corners and tilted by turns, so that a cell is two squares.  Each
hinge is a pair law of both squares' places and angles: a spring of zero length (1 N/m) and a
torsional one.  Bands along a path of phases from a square to the one at its right and the one
above; marks are the closed forms at phases 0, 0, where w² is 8 (k rho² sin² beta + kt)/J
(neighbours turn against each other), 8 k/m twice, and 8 k rho² cos² beta/J.
"""

import math
from itertools import pairwise

import numpy as np
import sympy as sp

from figures._draw import note
from tensegrity import PairLattice, PairLaw, bands

GROUP = "units"

FIRST, SECOND = sp.symbols("x y t"), sp.symbols("X Y T")
INERTIAS = MASS, _, TURNING = 1.0, 1.0, 0.3  # kg, kg, kg m²
CASES = {"tilted": (0.3, 0.01), "upright": (0.0, 0.0)}  # beta [rad], kt [N m]
CORNERS = [0.0, 0.0], [np.pi, 0.0], [np.pi / 2, np.pi / 2], [0.0, 0.0]  # of the path
NAMES = "0, 0", "π, 0", "π/2, π/2", "0, 0"
MODES = "counter-rotation", "squares against each other", "common rotation"  # at the centre
POINTS = 60  # phases a side of the path
TILTS = np.linspace(0.0, 0.7, 8)
SOUND = 1e-3  # phase from a square to the next, of waves that are nearly sound
DIRECTIONS = {"to the right": 0.0, "at 22.5 deg": np.pi / 8, "diagonal": np.pi / 4}


def lattice(beta, kt):
    """Squares of half diagonal 1 m, tilted by +-beta."""
    (x, y, t), (X, Y, T) = FIRST, SECOND

    def hinge(towards, side):
        def moved(angle, turn):
            return sp.Matrix([sp.cos(angle + turn) - sp.cos(angle),
                              sp.sin(angle + turn) - sp.sin(angle)])  # fmt: skip

        gap = sp.Matrix([X - x, Y - y])
        gap += moved(towards + sp.pi - side * beta, T) - moved(towards + side * beta, t)
        energy = gap.dot(gap) / 2 + sp.Symbol("kt") * (T - t) ** 2 / 2
        return PairLaw(energy, FIRST, SECOND, {"kt": kt})

    pitch = 2 * math.cos(beta)
    right, above = ((0, 0), (1, 1)), ((0, -1), (1, 0))  # cells of the neighbours of either square
    bonds = [(i, 1 - i, cells[i], hinge(towards, 1 - 2 * i)) for i in (0, 1)
             for cells, towards in ((right, 0), (above, sp.pi / 2))]  # fmt: skip
    vectors, positions = [[pitch, pitch], [pitch, -pitch]], [[0, 0], [pitch, 0]]
    return PairLattice(vectors, positions, bonds, mass=INERTIAS)


def frequencies(of, phases):
    """Of waves with phases from a square to the next ones, (waves, 2)."""
    right, above = np.transpose(phases)
    return bands(of, np.column_stack([right + above, right - above])).frequencies


def centre(beta, kt):
    """Closed forms at the centre of the zone, the counter-rotation first."""
    s, c = math.sin(beta), math.cos(beta)
    squared = 8 * (s**2 + kt) / TURNING, 8 / MASS, 8 * c**2 / TURNING
    return np.sqrt(squared)


def path():
    """Distances along the path, and the phases there."""
    turns = np.array(CORNERS)
    lengths = np.linalg.norm(np.diff(turns, axis=0), axis=1)
    at = np.concatenate([[0.0], np.cumsum(lengths)])
    s = np.unique(np.concatenate([np.linspace(a, b, POINTS) for a, b in pairwise(at)]))
    return at, s, np.column_stack([np.interp(s, at, turns[:, k]) for k in (0, 1)])


def data():
    at, s, phases = path()
    tables = {"corners": {"name": NAMES, "distance": at}}
    for name, (beta, kt) in CASES.items():
        found = frequencies(lattice(beta, kt), phases)
        tables[name] = {"distance": s, "right": phases[:, 0], "above": phases[:, 1]}
        tables[name] |= {f"band {k}": column for k, column in enumerate(found.T)}
        tables[f"{name}, centre"] = {"closed form": centre(beta, kt)}
    kt = CASES["tilted"][1]
    for stiffness in (kt, 0.0):
        found = [frequencies(lattice(beta, stiffness), [[0, 0]])[0] for beta in TILTS]
        closed = np.array([centre(beta, stiffness)[0] for beta in TILTS])
        near = [w[np.abs(w - x).argmin()] for w, x in zip(found, closed, strict=True)]
        tables[f"kt {stiffness:g}"] = {"beta": TILTS, "found": near}
        fine = np.linspace(TILTS[0], TILTS[-1], 141)
        every = [centre(beta, stiffness)[0] for beta in fine]
        tables[f"closed form, kt {stiffness:g}"] = {"beta": fine, "frequency": every}
    free, angles = lattice(CASES["tilted"][0], 0.0), np.array(list(DIRECTIONS.values()))
    slow = frequencies(free, SOUND * np.column_stack([np.cos(angles), np.sin(angles)]))
    tables["sound"] = {"direction": list(DIRECTIONS), "slow": slow[:, 0] / SOUND,
                       "fast": slow[:, 1] / SOUND}  # fmt: skip
    return tables


def draw(figure, tables):
    """Bands of tilted and of upright squares, and the counter-rotation against the tilt."""
    figure.set_size_inches(9, 4)
    panels = figure.subplots(1, 3, width_ratios=(1, 1, 0.9))
    corners = tables["corners"]
    for axes, name in zip(panels, CASES, strict=False):
        of, beta, kt = tables[name], *CASES[name]
        for k in range(6):
            axes.plot(of["distance"], of[f"band {k}"], "C0", lw=1.5)
        for k, w in enumerate(tables[f"{name}, centre"]["closed form"]):
            axes.plot(corners["distance"][[0, -1]], [w, w], "o", color="0.3" if k else "C3",
                      mfc="white", clip_on=False, zorder=3)  # fmt: skip
        axes.set(xlabel="phases to the right, above [rad]", ylabel="frequency [rad/s]")
        axes.set_ylim(0, 5.4)
        axes.set_xticks(corners["distance"], corners["name"])
        axes.set_xlim(0, corners["distance"][-1])
        axes.set_title(f"tilt {beta:g} rad, torsion {kt:g} N m" if kt else "tilt 0, no torsion")
        axes.tick_params(axis="y", pad=7)
        words, at = ("counter-rotation", 2.5) if kt else ("zero mode", 0.2)
        note(axes, words, (4.2 if kt else np.pi, at), color="C3", ha="center", va="center")
    axes = panels[2]
    for kt, colour in ((CASES["tilted"][1], "C0"), (0.0, "C3")):
        of = tables[f"kt {kt:g}"]
        axes.plot(of["beta"], of["found"], "o", color=colour, mfc="white", clip_on=False, zorder=3)
        of = tables[f"closed form, kt {kt:g}"]
        axes.plot(of["beta"], of["frequency"], color=colour)
        words = f"torsion {kt:g} N m" if kt else "no torsion"
        note(axes, words, (0.03, 0.9) if kt else (0.97, 0.1), color=colour, inside=True,
             ha="left" if kt else "right")  # fmt: skip
    axes.set(xlabel="tilt [rad]", ylabel="frequency [rad/s]", title="counter-rotation at 0, 0")
    axes.set(xlim=(0, None), ylim=(0, None))


def table(tables):
    """Frequencies at the centre of the zone, found and in closed form, and sound."""
    for name in CASES:
        found = [tables[name][f"band {k}"][0] for k in (2, 3, 5)]
        closed = tables[f"{name}, centre"]["closed form"]
        for words, one, other in zip(MODES, found, closed, strict=True):
            yield {"wave": f"{name}: {words}", "found": float(one), "closed form": float(other)}
    for direction, slow, fast in zip(*tables["sound"].values(), strict=True):
        yield {"wave": f"sound {direction}, no torsion", "found": float(slow),
               "faster": float(fast), "closed form": math.sqrt(0.5 / MASS)}  # fmt: skip
