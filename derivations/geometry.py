"""Elongation of a bond between two points in the plane or in space, and the gap to a plane wall.

A bond joins points at the separation D + w, where D is the reference and w the difference of the
displacements.  Elongations are small compared with lengths, and the difference |D + w| - L
cancels leading digits; the form for numerical evaluation avoids the cancellation.  Source:
the paper, eqs. (1)-(6), with overlaps of micrometres of beads of millimetres.
"""

from __future__ import annotations

from functools import cache

import sympy as sp

from derivations.argument import Step

TITLE = "Geometry: elongation of a bond in the plane, gap to a wall"

length = sp.Symbol("L", positive=True)
initial = sp.Symbol("g", real=True)  # |D| - L


@cache
def vectors(dim: int) -> tuple[list[sp.Symbol], list[sp.Symbol]]:
    """Symbols of the reference separation D and of the difference w of the displacements."""
    axes = "xyz"[:dim]
    return sp.symbols([f"D_{a}" for a in axes], real=True), sp.symbols(
        [f"w_{a}" for a in axes], real=True
    )


@cache
def plain_elongation(dim: int) -> sp.Expr:
    """|D + w| - L."""
    return _separation(dim) - length


def _separation(dim):
    return sp.sqrt(sum((d + w) ** 2 for d, w in zip(*vectors(dim), strict=True)))


@cache
def elongation(dim: int) -> sp.Expr:
    """The elongation without cancellation, in g = |D| - L.

    By a - L = (a^2 - L^2)/(a + L), where the numerator contains |D|^2 - L^2 in terms of g.
    """
    separation = _separation(dim)
    reference, relative = vectors(dim)
    at_rest = sum(d**2 for d in reference)
    change = sp.expand(separation**2 - at_rest)
    initial_term = sp.factor((length + initial) ** 2 - length**2)
    terms = [sp.factor(sum(t for t in change.args if t.has(w))) for w in relative]
    return (initial_term + sum(terms)) / (separation + length)


@cache
def direction(dim: int) -> list[sp.Expr]:
    """Gradient of the elongation in w, the unit vector from the first point to the second."""
    return [sp.simplify(sp.diff(plain_elongation(dim), w)) for w in vectors(dim)[1]]


@cache
def wall_gap(dim: int) -> tuple[sp.Expr, list[sp.Expr]]:
    """Gap between a point and a plane of unit normal D, g at w = 0, and its gradient."""
    normal, displacement = vectors(dim)
    gap = initial + sum(n * w for n, w in zip(normal, displacement, strict=True))
    return gap, [sp.diff(gap, w) for w in displacement]


def argument() -> list[Step]:
    gap, normal = wall_gap(2)
    rate = sp.Symbol("r'")
    return [
        Step("The elongation of a bond of length L between two points at the separation D + w is",
             sp.Eq(sp.Symbol("r"), plain_elongation(2))),
        Step("Expanding by the sum of both lengths removes the cancellation; with |D| = L + g it "
             "becomes", sp.Eq(sp.Symbol("r"), elongation(2))),
        Step("Its gradient in w is the unit vector along the bond:", sp.Matrix(direction(2))),
        Step("The gap to a plane wall of unit normal D, initially g, and its gradient are",
             sp.Eq(sp.Symbol("r"), gap), sp.Eq(rate, sp.Matrix(normal), evaluate=False)),
    ]  # fmt: skip
