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
    *(member.stiffness for member in prism.MEMBERS),
    *(member.natural for member in prism.MEMBERS),
)


@cache
def energy() -> sp.Expr:
    """Elastic energy of the members, U(positions) [J]."""

    def length(i, j):
        return sp.sqrt(sum((POSITIONS[3 * i + k] - POSITIONS[3 * j + k]) ** 2 for k in range(3)))

    return sum(
        member.energy(length(i, j)) / member.number
        for member in prism.MEMBERS
        for i, j in member.ends
    )


def symmetric_positions() -> list[sp.Expr]:
    """The 18 coordinates in terms of base, twist and height."""
    lower, upper = prism.nodes()
    return [x for node in (*lower, *upper) for x in node]
