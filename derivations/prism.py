"""Geometry, energy and natural lengths of the regular tensegrity prism.

Two regular polygons of base strings, the upper one raised by the height and rotated by the twist,
are joined by bars and cross strings without thickness: three of each, or n (`derivations.regular`).
The geometry is entered once, as the positions of the nodes and the table of `MEMBERS`.
Source: the talk, part III, "Compatibility equations" and "Elastic problem".
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import sympy as sp

from derivations import regular
from derivations.argument import Step
from derivations.regular import ANY, TRIANGLE, Polygon, node, squared_distance, vanishes

TITLE = "The prism: geometry, energy, natural lengths"

base = regular.base
height, circumradius = sp.symbols("h a", positive=True)
twist = sp.Symbol("phi", real=True)
k_cross, k_base, k_bar = sp.symbols("k_1 k_2 k_3", positive=True)
natural_cross, natural_base, natural_bar = sp.symbols("s_N l_N b_N", positive=True)
reference_height = sp.Symbol("h_0", positive=True)
prestrain = sp.Symbol("p_0", nonnegative=True)

REFERENCE_TWIST = TRIANGLE.reference_twist  # 5 pi/6
CIRCUMRADIUS = base / sp.sqrt(3)


def nodes() -> tuple[list[sp.Matrix], list[sp.Matrix]]:
    """Positions of the three lower and the three upper nodes, as two lists of vectors."""
    lower = [node(i, TRIANGLE, radius=CIRCUMRADIUS) for i in range(3)]
    return lower, [node(i, TRIANGLE, height, twist, CIRCUMRADIUS) for i in range(3)]


@dataclass(frozen=True)
class Member:
    """A kind of member, of which all are equivalent by symmetry.

    Attributes
    ----------
    kind : str
    stiffness, natural : sympy.Symbol
        Spring constant [N/m] and natural length [m] of one of them.
    step : int
        Number of nodes, around the polygon, between its first and its second end.
    inclined : bool
        Whether it joins the lower to the upper polygon; otherwise each polygon has its own.
    """

    kind: str
    stiffness: sp.Symbol
    natural: sp.Symbol
    step: int
    inclined: bool

    def pairs(self, sides: int = 3) -> list[tuple[int, int]]:
        """The nodes that members join; 0 to n - 1 are the lower ones, n to 2 n - 1 the upper."""
        starts = (0,) if self.inclined else (0, sides)
        return [
            (start + i, (sides if self.inclined else start) + (i + self.step) % sides)
            for start in starts
            for i in range(sides)
        ]

    @property
    def ends(self) -> list[tuple[int, int]]:
        """The pairs of a triangular prism."""
        return self.pairs()

    @property
    def number(self) -> int:
        """The number of such members of a triangular prism."""
        return len(self.ends)

    def count(self, of: Polygon = TRIANGLE) -> sp.Expr:
        """The number of such members."""
        return of.sides if self.inclined else 2 * of.sides

    def length_squared(self, radius: sp.Expr | None = None, of: Polygon = TRIANGLE) -> sp.Expr:
        """Squared length in circumradius (by default in the base), twist and height [m^2]."""
        if radius is None:
            radius = CIRCUMRADIUS if of is TRIANGLE else of.circumradius
        start = node(0, of, radius=radius)
        if not self.inclined:
            squared = squared_distance(start, node(self.step, of, radius=radius))
            return of.expanded(squared) if of is ANY else squared
        return squared_distance(start, node(self.step, of, height, twist, radius))

    def length(self, of: Polygon = TRIANGLE) -> sp.Expr:
        """Length(l, phi, h) [m]."""
        if not self.inclined:
            return base
        return sp.sqrt(self.length_squared(of=of))

    def tension(self, length: sp.Expr | None) -> sp.Expr:
        """Tension of one member at a length [N]."""
        return self.stiffness * (length - self.natural)

    def energy(self, length: sp.Expr | None, of: Polygon = TRIANGLE) -> sp.Expr:
        """Elastic energy of all members of this kind at a length [J]."""
        return self.count(of) / 2 * self.stiffness * (length - self.natural) ** 2


# A bar joins a lower node to the upper one at the angle of the twist, a cross string to the one
# before it, at the twist minus 2 pi/n.
CROSS = Member("cross", k_cross, natural_cross, -1, True)
BASE = Member("base", k_base, natural_base, 1, False)
BAR = Member("bar", k_bar, natural_bar, 0, True)
MEMBERS = (CROSS, BASE, BAR)


def members(connectivity: int = 1) -> tuple[Member, Member, Member]:
    """`MEMBERS` of a prism whose cross strings end that many nodes before the bars."""
    return replace(CROSS, step=-connectivity), BASE, BAR


@cache
def bar_length_squared(radius: sp.Expr | None = None, of: Polygon = TRIANGLE) -> sp.Expr:
    """Squared length b^2 of a bar [m^2]."""
    return BAR.length_squared(radius, of)


@cache
def cross_length_squared(radius: sp.Expr | None = None, of: Polygon = TRIANGLE) -> sp.Expr:
    """Squared length s^2 of a cross string [m^2]."""
    return CROSS.length_squared(radius, of)


def bar_length(of: Polygon = TRIANGLE) -> sp.Expr:
    """b(l, phi, h) [m]."""
    return sp.sqrt(bar_length_squared(None, of))


def cross_length(of: Polygon = TRIANGLE) -> sp.Expr:
    """s(l, phi, h) [m]."""
    return sp.sqrt(cross_length_squared(None, of))


@cache
def energy(of: Polygon = TRIANGLE) -> sp.Expr:
    """Elastic energy of all members, U(l, phi, h) [J]."""
    return sum(member.energy(member.length(of), of) for member in MEMBERS)


def at_reference(expression: sp.Expr, of: Polygon = TRIANGLE) -> sp.Expr:
    """An expression at the self-stressed state: twist pi/2 + pi/n, height h0."""
    expression = expression.subs({twist: of.reference_twist, height: reference_height})
    return of.expanded(expression) if of is ANY else expression


@cache
def natural_lengths(of: Polygon = TRIANGLE) -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    """Natural lengths (s_N, l_N, b_N) [m] that put the unloaded prism at twist 5 pi/6, height h0.

    The prestrain p0 = (s0 - s_N)/s_N determines s_N.  l_N and b_N follow from the stationarity of U
    in all three coordinates: three equations for two unknowns, which have a solution only at this
    twist and at phi = pi/n - pi/2.
    """
    cross = at_reference(cross_length(of), of) / (1 + prestrain)
    gradient = [at_reference(sp.diff(energy(of), q), of) for q in (base, twist, height)]
    residual = [g.subs(natural_cross, cross) for g in gradient]
    if of is ANY:  # sine and cosine are symbols: one of the three equations is checked separately
        residual, last = [residual[0], residual[2]], residual[1]
    solutions = sp.linsolve(residual, [natural_base, natural_bar])
    if of is ANY:
        known = dict(zip((natural_base, natural_bar), next(iter(solutions)), strict=True))
        if not vanishes(last.subs(known)):
            raise ArithmeticError("the reference state has no self-stress")
    if len(solutions) != 1:
        raise ArithmeticError("the reference state has no unique self-stress")
    base_length, bar = next(iter(solutions))
    return cross, sp.apart(sp.factor(base_length), k_base), sp.apart(sp.factor(bar), k_bar)


@cache
def reference_tensions(of: Polygon = TRIANGLE) -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    """Tensions (cross, base, bar) of single members in the self-stressed state, over k1 l."""
    pulls = (
        member.tension(at_reference(member.length(of), of)).subs(member.natural, natural)
        for member, natural in zip(MEMBERS, natural_lengths(of), strict=True)
    )
    return tuple(sp.factor(sp.expand(pull)).subs({k_cross: 1, base: 1}) for pull in pulls)


@cache
def least_k_base(of: Polygon = TRIANGLE) -> sp.Expr:
    """Stiffness of the base strings [N/m] below which their natural length is not positive."""
    (value,) = sp.solve(natural_lengths(of)[1], k_base)
    return value


def argument() -> list[Step]:
    squared = [bar_length_squared(), cross_length_squared()]
    members = sp.symbols("b s", positive=True)
    heights = sp.solve(squared[0] - members[0] ** 2, height)
    rest = (natural_cross, natural_base, natural_bar)
    return [
        Step("The positions of the three lower and the three upper nodes are",
             *(sp.Matrix.hstack(*triangle) for triangle in nodes())),
        Step("A bar joins a lower node to the upper one at the angle of the twist, a cross string "
             "to the one before it. Their squared lengths are",
             *(sp.Eq(x**2, length) for x, length in zip(members, squared, strict=True))),
        Step("so that the height is", sp.Eq(height, heights[-1])),
        Step("The elastic energy U of 3 cross strings, 6 base strings and 3 bars is", energy()),
        Step("U is stationary at twist 5 pi/6 and height h0 for the natural lengths",
             *(sp.Eq(x, value) for x, value in zip(rest, natural_lengths(), strict=True))),
    ]  # fmt: skip
