"""The hypotheses H1, H2 and H3 on potentials with localised waves, for the rigid-elastic prism.

Lengths are in units of the circumradius.  In compression the twist phi runs from 5 pi/6 to pi;
X = h^2 and C = cos phi are then polynomials of each other, and g = s^2 - s0^2 is elementary in C.
The proofs reduce each claim to the sign of a polynomial.
Source: the talk, part III, "Properties of the elastic potential of rigid-elastic prisms".
"""

from __future__ import annotations

from functools import cache

import sympy as sp

from derivations import prism
from derivations.argument import Step
from derivations.prism import twist
from derivations.regular import TRIANGLE, Polygon
from derivations.rigid_response import lock_order, locking_height_squared

TITLE = "Hardening: H1, H2, H3, and the limit of no prestrain"

eta, extension, radius = sp.symbols("eta_0 q a", positive=True)  # h0/a, p0/(1 + p0), l/sqrt 3
square, lock_square, cosine = sp.symbols("X X_l C", real=True)  # h^2, h_lock^2, cos phi
turn = sp.Symbol("delta", real=True)  # phi - 5 pi/6


@cache
def path(of: Polygon = TRIANGLE) -> tuple[sp.Expr, sp.Expr]:
    """(h^2 - h0^2, s^2 - s0^2) as functions of the change of twist at constant b, for a = 1."""
    one = sp.Integer(1)
    bars, strings = prism.bar_length_squared(one, of), prism.cross_length_squared(one, of)
    gained = [-bars, strings - bars]
    here = [of.expanded(x.subs(twist, of.reference_twist + turn)) for x in gained]
    first, second = (sp.expand(x - x.subs(turn, 0)) for x in here)
    return first, second


@cache
def derivatives(highest: int = 4, of: Polygon = TRIANGLE) -> list[sp.Expr]:
    """[V'', V''', ...] at the reference in eta0, q, a, k1, by power series in delta."""
    gained = [sp.series(x, turn, 0, highest + 1).removeO() for x in path(of)]
    r, *unknown = sp.symbols(f"r t_1:{highest}")
    guess = sum(t * r**k for k, t in enumerate(unknown, 1))
    compatibility = sp.expand((eta + r) ** 2 - eta**2 - gained[0].subs(turn, guess))
    for k, t in enumerate(unknown, 1):  # the coefficients of delta(r) in turn
        (value,) = sp.solve(compatibility.coeff(r, k), t)
        compatibility = sp.expand(compatibility.subs(t, value))
        guess = guess.subs(t, value)
    gain, rest = sp.symbols("g S", positive=True)  # s^2 - s0^2 = O(r^2), s0^2
    held = sp.expand(prism.CROSS.energy(sp.sqrt(rest + gain), of))
    energy = sp.series(held.subs(prism.natural_cross, (1 - extension) * sp.sqrt(rest)), gain, 0, 3)
    g = sp.expand(gained[1].subs(turn, guess))
    at_rest = prism.at_reference(prism.cross_length_squared(sp.Integer(1), of), of)
    at_rest = sp.expand(at_rest.subs(prism.reference_height, eta))
    linear, quadratic = (sp.expand(energy.removeO()).coeff(gain, k) for k in (1, 2))
    return [
        sp.factorial(k) * radius ** (2 - k) * sp.expand(
            linear * g.coeff(r, k) + quadratic.subs(rest, at_rest) * sp.expand(g**2).coeff(r, k)
        )
        for k in range(2, highest + 1)
    ]  # fmt: skip


def curvature_ratio(of: Polygon = TRIANGLE) -> sp.Expr:
    """h0 V'''/V'', which does not depend on the prestrain."""
    second, third = derivatives(3, of)
    return sp.expand(sp.cancel(eta * radius * third / second))


def hardening_slenderness_squared(of: Polygon = TRIANGLE) -> sp.Expr:
    """eta0^2 at which V''' changes sign: below it the prism softens first."""
    (value,) = sp.solve(curvature_ratio(of).subs(eta, sp.sqrt(square)), square)
    return value


def locking_slenderness_squared(of: Polygon = TRIANGLE) -> sp.Expr:
    """eta0^2 below which the bars never meet, where h_lock = 0."""
    shape = {prism.base: 2 * of.sine, prism.reference_height: sp.sqrt(square)}
    (value,) = sp.solve(locking_height_squared(of).subs(shape), square)
    return sp.expand(value)


@cache
def string_gain() -> tuple[sp.Expr, sp.Expr]:
    """C = cos phi = (X - X_l)/2 - 1, and g up to a constant, in X; sin phi > 0."""
    bars = prism.bar_length_squared(sp.Integer(1)).subs(sp.cos(twist), cosine)
    level = sp.expand(bars - bars.subs(cosine, -1))  # b^2 - h^2 against its value at phi = pi
    (as_cosine,) = sp.solve(lock_square - level.subs(prism.height, 0) - square, cosine)
    strings = sp.expand_trig(prism.cross_length_squared(sp.Integer(1)))
    g = strings.subs({sp.sin(twist): sp.sqrt(1 - cosine**2), sp.cos(twist): cosine})
    return as_cosine, g.subs(prism.height, sp.sqrt(square)).subs(cosine, as_cosine)


def third_derivative_sign() -> sp.Expr:
    """(s^2)''' over positive factors, a polynomial in C = cos phi and X_l = h_lock^2."""
    as_cosine, g = string_gain()
    third = 2 * square * sp.diff(g, square, 3) + 3 * sp.diff(g, square, 2)  # (s^2)'''/(4 h)
    third = third.subs(square, sp.solve(as_cosine - cosine, square)[0])
    positive = sp.Rational(3, 4) * sp.sqrt(3) * (1 - cosine**2) ** sp.Rational(-5, 2)
    return sp.collect(sp.expand(sp.simplify(third / positive)), lock_square)


@cache
def convexity_coefficients() -> list[sp.Expr]:
    """Coefficients of a polynomial in y and z with the sign of 2 s^2 g'' - g'^2 (s is convex).

    tan((pi - phi)/2) = (2 - sqrt3)/(1 + z), so that phi runs from 5 pi/6 to pi as z from 0 to
    infinity, and eta0^2 = sqrt3/6 + y.  All must be positive for the claim at y, z >= 0.
    """
    _, g = string_gain()
    t, y, z = sp.symbols("t y z", nonnegative=True)
    first, second = sp.diff(g, square), sp.diff(g, square, 2)
    claim = 2 * g * (4 * square * second + 2 * first) - 4 * square * first**2
    height_squared = lock_square + 2 * (1 + cosine)
    sine = sp.sqrt(1 - cosine**2)
    claim = sp.expand(sp.powsimp(claim.subs(square, height_squared))).subs(sine, 2 * t / (1 + t**2))
    claim = claim.subs(cosine, -(1 - t**2) / (1 + t**2))
    least = hardening_slenderness_squared() - locking_slenderness_squared()
    claim = sp.together(claim.subs(lock_square, least + y))
    numerator, _ = sp.fraction(sp.cancel(claim, extension=sp.sqrt(3)))  # over 288 t^3 > 0
    terms = sp.Poly(numerator, t, y, extension=sp.sqrt(3)).terms()  # t^k, times (1 + z)^6
    powers = [(2 - sp.sqrt(3)) ** k * (1 + z) ** (6 - k) * y**j for (k, j), _ in terms]
    whole = sum(c * power for (_, c), power in zip(terms, powers, strict=True))
    return sp.Poly(whole, y, z, extension=sp.sqrt(3)).coeffs()


@cache
def prove_hardening() -> sp.Expr:
    """H3 for eta0^2 > sqrt3/6, by three independent bounds, which must agree.

    With g of `string_gain` and (k) for the k-th derivative, V(3) is (3/2) k1 times
    (1 - s_N/s) g(3) + (3 s_N/(2 s^3)) g(1) (g(2) - g(1)^2/(2 s^2)), and g(1) < 0.
    """
    bound = hardening_slenderness_squared()
    (critical,) = sp.solve(third_derivative_sign(), lock_square)  # increases with C on (-1, 0)
    start = sp.cos(prism.REFERENCE_TWIST)
    if sp.expand(critical.subs(cosine, start) + locking_slenderness_squared() - bound) != 0:
        raise ArithmeticError("the third derivatives of g and V change sign at different places")
    rising = sp.factor(sp.diff(critical, cosine))  # (1 - C^2)/C^2
    if sp.simplify(rising - (1 - cosine**2) / cosine**2) != 0:
        raise ArithmeticError("the bound on h_lock is not largest at the reference")
    if any(c <= 0 for c in convexity_coefficients()):
        raise ArithmeticError("a coefficient is not positive: the convexity of s(h) is not proved")
    if sp.expand(sp.limit(stroke_condition(), turn, 0) - bound) != 0:
        raise ArithmeticError("the comparison of strokes gives another slenderness")
    return bound


def stroke_condition() -> sp.Expr:
    """eta0^2 above which a twist by -delta changes the height by more than one by delta.

    V grows with |delta|, so that V(r) < V(-r) is equivalent to h(delta) + h(-delta) > 2 h0.
    Squaring twice gives 4 even eta0^2 > odd^2, with the even and odd parts of h^2 - h0^2 in delta.
    """
    gained, back = path()[0], path()[0].subs(turn, -turn)
    even, odd = sp.expand((gained + back) / 2), sp.expand((gained - back) / 2)
    return sp.simplify(odd**2 / (4 * even))


def cubic_stiffness() -> sp.Expr:
    """Force over r^3 at the reference without prestrain [N/m^3]."""
    return sp.factor(derivatives()[2].subs(extension, 0) / 6)


def argument() -> list[Step]:
    second, third, fourth = derivatives()
    names = [sp.Symbol("V" + "'" * k) for k in (2, 3, 4)]
    force_order, energy_order = lock_order()
    gap = sp.Symbol("r") + sp.Symbol("d")
    return [
        Step("With the change of twist delta = phi - 5 pi/6 and a = 1 the geometry is",
             sp.Eq(square - eta**2, path()[0]),
             sp.Eq(sp.Symbol("s") ** 2 - sp.Symbol("s_0") ** 2, path()[1])),
        Step("Expanding delta(r), and then V, gives at the reference",
             *(sp.Eq(n, v) for n, v in zip(names, (second, third, fourth), strict=True))),
        Step("H1 holds on (-d, b - h0), not up to infinity: V grows with |delta| and vanishes only "
             "at 0, where V'' > 0 if and only if the prestrain is positive."),
        Step("H2 fails: near locking force and energy have the following powers, so that the "
             "energy is finite and (r + d) V tends to 0. Only V >= c0 holds there.",
             gap**force_order, sp.Symbol("V_lock") - gap**energy_order),
        Step("For H3, the curvature of the force at the reference is, for every prestrain,",
             sp.Eq(eta * radius * names[1] / names[0], curvature_ratio())),
        Step("so that V''' < 0 there if and only if the slenderness exceeds",
             sp.Eq(eta**2, hardening_slenderness_squared())),
        Step("For H3 on all of (-d, 0]: V''' is a positive multiple of (1 - s_N/s) g''' plus a "
             "positive multiple of g' (g'' - g'^2/(2 s^2)), where g' < 0. g''' has the sign of",
             third_derivative_sign()),
        Step("which is negative for X_l > (1 + C)^2/(-C). The right side is at most its value at "
             "C = -sqrt3/2, the same bound. The bracket is positive: with tan((pi - phi)/2) = "
             "(2 - sqrt3)/(1 + z) and eta0^2 = sqrt3/6 + y it is a polynomial of "
             f"{len(convexity_coefficients())} terms with positive coefficients, the least being",
             min(convexity_coefficients())),
        Step("V(r) < V(-r) holds for every change of twist if and only if eta0^2 exceeds the "
             "following. Its supremum, for delta to 0, is the same bound, above which H3 holds.",
             stroke_condition()),
        Step("The bars never meet below the slenderness",
             sp.Eq(eta**2, locking_slenderness_squared())),
        Step("Without prestrain V'' and V''' vanish; a cubic force, a sonic vacuum, remains:",
             sp.Eq(sp.Symbol("F"), cubic_stiffness() * sp.Symbol("r") ** 3)),
        Step("V'' and V''' are proportional to q for small q, V'''' is not. The first correction "
             "to the sech^2 wave has the relative size gamma^2 V'' V''''/V'''^2, so that gamma^2 "
             "must be much smaller than q."),
    ]  # fmt: skip
