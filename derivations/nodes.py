"""The prism with six free nodes: 18 coordinates, no symmetry assumed.

Source: seeds/000, part III; the members are those of `derivations.prism`, whose energy is this
one at symmetric positions.
"""

from __future__ import annotations

from functools import cache

import sympy as sp

from derivations import prism

POSITIONS = sp.symbols("x:18", real=True)
"""Coordinates of the lower nodes, then of the upper ones: x0 y0 z0 x1 ..."""

CONSTANTS = (
    prism.k_cross, prism.k_base, prism.k_bar,
    prism.natural_cross, prism.natural_base, prism.natural_bar,
)  # fmt: skip


def members() -> list[tuple[str, int, int]]:
    """(kind, node, node) of the 3 cross strings, 6 base strings and 3 bars; nodes 3 to 5 are up.

    A bar joins a lower node to the upper one turned away from it by the twist, a cross string
    to the one before that.
    """
    cross = [("cross", i, 3 + (i + 2) % 3) for i in range(3)]
    bars = [("bar", i, 3 + i) for i in range(3)]
    sides = [("base", level + i, level + (i + 1) % 3) for level in (0, 3) for i in range(3)]
    return [*cross, *sides, *bars]


@cache
def energy() -> sp.Expr:
    """Elastic energy of the members, U(positions) [J]."""
    stiffness = {"cross": prism.k_cross, "base": prism.k_base, "bar": prism.k_bar}
    natural = {
        "cross": prism.natural_cross, "base": prism.natural_base, "bar": prism.natural_bar,
    }  # fmt: skip

    def length(i, j):
        return sp.sqrt(sum((POSITIONS[3 * i + k] - POSITIONS[3 * j + k]) ** 2 for k in range(3)))

    return sum(
        stiffness[kind] / 2 * (length(i, j) - natural[kind]) ** 2 for kind, i, j in members()
    )


def symmetric_positions() -> list[sp.Expr]:
    """The 18 coordinates in terms of base, twist and height."""
    lower, upper = prism.nodes()
    return [x for node in (*lower, *upper) for x in node]
