"""Geometry, energy and natural lengths of the triangular tensegrity prism.

Two equilateral triangles of base strings, the upper one raised by the height and turned by
the twist, joined by three bars and three cross strings without thickness.  The geometry is
typed once, as the positions of six nodes and the table of `MEMBERS` between them; lengths,
energy and natural lengths follow.
Source: seeds/000, part III, "Compatibility equations" and "Elastic problem".
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import sympy as sp
from sympy.simplify.fu import TR8

from derivations.argument import Step

TITLE = "The prism: geometry, energy, natural lengths"

base, height, circumradius = sp.symbols("l h a", positive=True)
twist = sp.Symbol("phi", real=True)
k_cross, k_base, k_bar = sp.symbols("k_1 k_2 k_3", positive=True)
natural_cross, natural_base, natural_bar = sp.symbols("s_N l_N b_N", positive=True)
reference_height = sp.Symbol("h_0", positive=True)
prestrain = sp.Symbol("p_0", nonnegative=True)

REFERENCE_TWIST = 5 * sp.pi / 6
"""Twist of the self-stressed state in which strings pull and bars push."""

CIRCUMRADIUS = base / sp.sqrt(3)


def nodes(
    height: sp.Expr = height, twist: sp.Expr = twist, radius: sp.Expr = CIRCUMRADIUS
) -> tuple[list[sp.Matrix], list[sp.Matrix]]:
    """Positions of the three lower and of the three upper nodes, as two lists of vectors."""

    def triangle(turn, level):
        angles = [turn + 2 * sp.pi * i / 3 for i in range(3)]
        return [sp.Matrix([radius * sp.cos(t), radius * sp.sin(t), level]) for t in angles]

    return triangle(0, 0), triangle(twist, height)


def _squared_distance(start, end):
    difference = end - start
    return sp.expand(TR8(sp.expand(difference.dot(difference))))  # products of sines to sums


@dataclass(frozen=True)
class Member:
    """A kind of members, equal by symmetry.

    Attributes
    ----------
    kind : str
    stiffness, natural : sympy.Symbol
        Spring constant [N/m] and natural length [m] of one of them.
    ends : tuple of (int, int)
        Nodes that each joins: 0 to 2 the lower ones, 3 to 5 the upper ones.
    """

    kind: str
    stiffness: sp.Symbol
    natural: sp.Symbol
    ends: tuple

    @property
    def number(self) -> int:
        """How many there are."""
        return len(self.ends)

    def length_squared(self, radius: sp.Expr = CIRCUMRADIUS) -> sp.Expr:
        """Squared length in circumradius (or base), twist and height [m^2]."""
        lower, upper = nodes(radius=radius)
        start, end = self.ends[0]
        return _squared_distance(*((*lower, *upper)[node] for node in (start, end)))

    def length(self) -> sp.Expr:
        """Length(l, phi, h) [m]."""
        return sp.sqrt(self.length_squared())

    def tension(self, length: sp.Expr | None) -> sp.Expr:
        """Tension of one at a length [N]."""
        return self.stiffness * (length - self.natural)

    def energy(self, length: sp.Expr | None) -> sp.Expr:
        """Elastic energy of all at a length [J]."""
        return sp.Rational(self.number, 2) * self.stiffness * (length - self.natural) ** 2


# A bar joins a lower node to the upper one turned away from it by the twist, a cross string to
# the one before that, turned by the twist less 2 pi/3.
CROSS = Member("cross", k_cross, natural_cross, tuple((i, 3 + (i + 2) % 3) for i in range(3)))
BASE = Member(
    "base", k_base, natural_base,
    tuple((level + i, level + (i + 1) % 3) for level in (0, 3) for i in range(3)),
)  # fmt: skip
BAR = Member("bar", k_bar, natural_bar, tuple((i, 3 + i) for i in range(3)))
MEMBERS = (CROSS, BASE, BAR)


@cache
def bar_length_squared(radius: sp.Expr = CIRCUMRADIUS) -> sp.Expr:
    """b^2."""
    return BAR.length_squared(radius)


@cache
def cross_length_squared(radius: sp.Expr = CIRCUMRADIUS) -> sp.Expr:
    """s^2."""
    return CROSS.length_squared(radius)


def bar_length() -> sp.Expr:
    """b(l, phi, h) [m]."""
    return sp.sqrt(bar_length_squared())


def cross_length() -> sp.Expr:
    """s(l, phi, h) [m]."""
    return sp.sqrt(cross_length_squared())


@cache
def energy() -> sp.Expr:
    """Elastic energy of all members, U(l, phi, h) [J]."""
    return sum(member.energy(member.length()) for member in MEMBERS)


def at_reference(expression: sp.Expr) -> sp.Expr:
    """An expression at the self-stressed state: twist 5 pi/6, height h0."""
    return expression.subs({twist: REFERENCE_TWIST, height: reference_height})


@cache
def natural_lengths() -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    """Natural lengths (s_N, l_N, b_N) [m] that put the unloaded prism at twist 5 pi/6, height h0.

    The prestrain p0 = (s0 - s_N)/s_N gives s_N; l_N and b_N follow because U is stationary
    there in all three coordinates: three equations for the two unknowns, which can be met
    at this twist and at phi = -pi/6 only.
    """
    cross = at_reference(cross_length()) / (1 + prestrain)
    gradient = [at_reference(sp.diff(energy(), q)) for q in (base, twist, height)]
    residual = [g.subs(natural_cross, cross) for g in gradient]
    solutions = sp.linsolve(residual, [natural_base, natural_bar])
    if len(solutions) != 1:
        raise ArithmeticError("the reference state has no unique self-stress")
    base_length, bar = next(iter(solutions))
    return cross, sp.apart(sp.factor(base_length), k_base), sp.apart(sp.factor(bar), k_bar)


def least_k_base() -> sp.Expr:
    """Stiffness of the base strings [N/m] below which their natural length is not positive."""
    (value,) = sp.solve(natural_lengths()[1], k_base)
    return value


def argument() -> list[Step]:
    squared = [bar_length_squared(), cross_length_squared()]
    members = sp.symbols("b s", positive=True)
    rises = sp.solve(squared[0] - members[0] ** 2, height)
    rest = (natural_cross, natural_base, natural_bar)
    return [
        Step("Positions of the three lower and the three upper nodes:",
             *(sp.Matrix.hstack(*triangle) for triangle in nodes())),
        Step("A bar joins a lower node to the upper one turned away by the twist, a cross string "
             "to the one that follows it:",
             *(sp.Eq(x**2, length) for x, length in zip(members, squared, strict=True))),
        Step("so the height is", sp.Eq(height, rises[-1])),
        Step("Elastic energy of 3 cross strings, 6 base strings and 3 bars, U =", energy()),
        Step("Natural lengths for which U is stationary at twist 5 pi/6 and height h0:",
             *(sp.Eq(x, value) for x, value in zip(rest, natural_lengths(), strict=True))),
    ]  # fmt: skip
