"""Regular polygons, the bases of prisms: three sides (`TRIANGLE`), or n as a symbol (`ANY`)."""

from __future__ import annotations

from dataclasses import dataclass

import sympy as sp
from sympy.simplify.fu import TR8

base = sp.Symbol("l", positive=True)
number_of_sides = sp.Symbol("n", positive=True, integer=True)
half_sine, half_cosine = sp.symbols("S C", positive=True)  # of pi/n
SIDES = number_of_sides, half_sine, half_cosine
half_angle = sp.Symbol("alpha", positive=True)  # pi/n as the argument of a sine


@dataclass(frozen=True)
class Polygon:
    """A regular polygon: its number of sides n, the angle pi/n, and its sine and cosine.

    Attributes
    ----------
    sides : int or sympy.Expr
        At least 3.
    angle, sine, cosine : sympy.Expr, optional
        By default those of the sides.

    Raises
    ------
    ValueError
        If the number of sides is no whole number or below 3.

    Examples
    --------
    >>> from derivations.regular import Polygon
    >>> Polygon(4).circumradius
    sqrt(2)*l/2
    """

    sides: sp.Expr
    angle: sp.Expr = None
    sine: sp.Expr = None
    cosine: sp.Expr = None

    def __post_init__(self) -> None:
        sides = sp.sympify(self.sides, strict=True)
        whole = isinstance(sides, sp.Expr) and sides.is_integer is not False
        if not whole or (sides.is_number and not sides >= 3):
            raise ValueError(f"{self.sides} sides of a polygon must be a whole number, at least 3")
        angle = sp.pi / sides if self.angle is None else self.angle
        given = {"sides": sides, "angle": angle, "sine": self.sine, "cosine": self.cosine}
        for name, function in (("sine", sp.sin), ("cosine", sp.cos)):
            given[name] = function(angle) if given[name] is None else given[name]
        for name, value in given.items():
            object.__setattr__(self, name, value)

    @property
    def reference_twist(self) -> sp.Expr:
        """Twist of the self-stressed state with tensioned strings and compressed bars."""
        return sp.pi / 2 + self.angle

    @property
    def circumradius(self) -> sp.Expr:
        """Circumradius of a polygon of side l [m]."""
        return base / (2 * self.sine)

    def expanded(self, expression: sp.Expr) -> sp.Expr:
        """An expression with sines of sums expanded in terms of `sine` and `cosine`."""
        expression = sp.expand_trig(expression)
        known = {sp.sin(half_angle): half_sine, sp.cos(half_angle): half_cosine}
        return expression.subs(known)


TRIANGLE = Polygon(sp.Integer(3))
ANY = Polygon(number_of_sides, half_angle, half_sine, half_cosine)


def node(
    number: int,
    of: Polygon,
    height: sp.Expr = sp.S.Zero,
    twist: sp.Expr = sp.S.Zero,
    radius: sp.Expr | None = None,
) -> sp.Matrix:
    """Position of a node of a polygon at a height, rotated by a twist.

    Parameters
    ----------
    number : int
        Number of the node, counter-clockwise.
    of : Polygon
    height, twist : sympy.Expr, optional
        [m], [rad]; zero by default.
    radius : sympy.Expr, optional
        Circumradius [m]; by default that of a polygon of side l.

    Returns
    -------
    sympy.Matrix, (3, 1)
        [m].
    """
    radius = of.circumradius if radius is None else radius
    angle = twist + 2 * of.angle * number
    return sp.Matrix([radius * sp.cos(angle), radius * sp.sin(angle), height])


def squared_distance(start: sp.Matrix, end: sp.Matrix) -> sp.Expr:
    """Squared distance between two positions, with products of sines reduced to sums."""
    difference = end - start
    return sp.expand(TR8(sp.expand(difference.dot(difference))))


def vanishes(expression: sp.Expr) -> bool:
    """Whether an expression in sine and cosine of pi/n is zero for every n."""
    numerator = sp.fraction(sp.together(expression))[0]
    return sp.expand(sp.expand(numerator).subs(half_sine**2, 1 - half_cosine**2)) == 0 or (
        sp.simplify(
            numerator.subs({half_sine: sp.sin(half_angle), half_cosine: sp.cos(half_angle)})
        )
        == 0
    )
