"""Units with two stable states: a rigid mechanism between two mirrored sets of strings.

The mechanism has one coordinate x; the strings of one hand have the squared length L(x), those of
the other L(-x), and all have the same prestrain p at x = 0.  Prestress makes that state unstable
beyond a prestrain that depends on the shape alone.  A. Micheletti and others (2023) found such
thresholds for tensegrity units; those derived here are for a prism with strings of both hands, and
for a rotor in the plane.
"""

from __future__ import annotations

from functools import cache

import sympy as sp

from derivations.argument import Step

TITLE = "Bistable units: strings of both hands and the prestrain that splits a well"

x, twist = sp.symbols("x varphi", real=True)
# of strings; their lengths unstressed
stiffness, natural, other = sp.symbols("k N N'", positive=True)
other_stiffness = sp.Symbol("k'", positive=True)
prestrain, torque = sp.symbols("p M", real=True)
sides = sp.Symbol("n", positive=True)
base, height, radius = sp.symbols("l h a", positive=True)  # side; bars, upright; circumradius
arm, distance, angle = sp.symbols("b R alpha", positive=True)
squared = sp.Function("L")
curvature, quartic = sp.symbols("U_2 U_4", real=True)  # derivatives of the energy at x = 0


@cache
def energy(length: sp.Expr, at: sp.Symbol) -> sp.Expr:
    """Energy of one string of each hand, taut or slack, minus the work of a torque.

    Parameters
    ----------
    length : sympy.Expr
        Squared length of the former as a function of `at`.
    at : sympy.Symbol

    Returns
    -------
    sympy.Expr
        [J] of `natural` and `other`, the natural lengths, `stiffness` and `other_stiffness`, and
        `torque`.
    """
    hands = (length, natural, stiffness), (length.subs(at, -at), other, other_stiffness)
    stored = (k * sp.Max(0, sp.sqrt(square) - rest) ** 2 / 2 for square, rest, k in hands)
    return sum(stored) - torque * at


@cache
def threshold() -> sp.Expr:
    """The prestrain at which the stiffness of the state x = 0 vanishes."""
    stretch = sp.sqrt(squared(x)) - natural
    second = sp.diff(stretch**2, x, 2)  # the other hand has the same at x = 0
    second = second.subs(natural, sp.sqrt(squared(x)) / (1 + prestrain))
    (critical,) = sp.solve(second, prestrain)
    return sp.simplify(critical)


def threshold_of(length: sp.Expr, at: sp.Symbol) -> sp.Expr:
    """The threshold for a given squared length."""
    return sp.simplify(threshold().subs(squared(x), length.subs(at, x)).doit().subs(x, 0))


def twin_strings() -> sp.Expr:
    """Squared length of a string from a corner to the next one of the other polygon.

    Bars of length h join corresponding corners; as one polygon rotates, they incline, and the
    polygons approach each other.
    """
    apart = height**2 - 2 * radius**2 * (1 - sp.cos(twist))  # squared, of the polygons
    return apart + 2 * radius**2 * (1 - sp.cos(twist + 2 * sp.pi / sides))


@cache
def of_prism() -> sp.Expr:
    """The threshold of the prism in terms of its side."""
    critical = threshold_of(twin_strings(), twist).subs(radius, base / (2 * sp.sin(sp.pi / sides)))
    half = sp.Symbol("c", positive=True)  # cot(pi/n)
    form = sp.simplify(sp.expand_trig(sp.expand(critical).subs(sp.pi / sides, sp.acot(half))))
    return sp.factor(form).subs(half, sp.cot(sp.pi / sides))


@cache
def last_of_prism() -> sp.Expr:
    """The prestrain at which the wells of the prism end: one hand goes slack where the other is
    longest, and no force drives the polygons back."""
    length = twin_strings()
    longest = sp.pi / 2 - sp.pi / sides
    shorter = sp.simplify(length.subs(twist, -longest))
    return sp.sqrt(sp.simplify(length.subs(twist, 0) / shorter)) - 1


def rotor() -> sp.Expr:
    """Squared length of a string from the end of an arm to an anchor at an angle to it."""
    return distance**2 + arm**2 - 2 * distance * arm * sp.cos(angle + x)


@cache
def wells() -> tuple[sp.Expr, sp.Expr]:
    """Near the threshold, U = U2 x^2/2 + U4 x^4/24 - M x with U2 < 0: the position of the wells
    without torque, and the torque at which one of them ends."""
    form = curvature * x**2 / 2 + quartic * x**4 / 24
    (place,) = (root for root in sp.solve(sp.diff(form, x), x) if root.subs(
        {curvature: -1, quartic: 1}) > 0)  # fmt: skip
    fold = max(sp.solve(sp.diff(form, x, 2), x), key=lambda one: one.subs(
        {curvature: -1, quartic: 1}))  # fmt: skip
    return place, sp.simplify(sp.diff(form, x).subs(x, -fold))


longer, shorter = (sp.Function(name)(x) for name in ("f", "g"))  # lengths of strings at x and -x
EQUAL = {other: natural, other_stiffness: stiffness, torque: 0}
BIASES = torque, other, other_stiffness  # what makes the hands unequal


def taut() -> sp.Expr:
    """The energy of two taut strings of lengths `longer` and `shorter`."""
    hands = (longer, natural, stiffness), (shorter, other, other_stiffness)
    return sum(k * (length - rest) ** 2 / 2 for length, rest, k in hands) - torque * x


@cache
def released(bias: sp.Symbol) -> sp.Expr:
    """Energy of the well at -x minus that at x under a small change of a torque, a natural length
    or a stiffness of the other hand: the wells move too, but their energy is stationary."""
    change = sp.diff(taut(), bias).subs(EQUAL)
    mirrored = change.xreplace({longer: shorter, shorter: longer, x: -x})
    return sp.factor(mirrored - change)


DERIVATIVES = {sp.diff(one, x, order): sp.Symbol(f"{one.func}" + order * "'")
               for order in (2, 1, 0) for one in (longer, shorter)}  # fmt: skip


@cache
def limit(bias: sp.Symbol) -> list[tuple[sp.Expr, sp.Expr]]:
    """Pairs of the natural length, of the first hand or of both, and of the bias with which a well
    ends: slope and curvature of the energy vanish.  For unequal stiffnesses there are two.

    They are forms in the lengths of the strings and their derivatives, the values of `DERIVATIVES`.
    """
    form = taut().subs({one: EQUAL[one] for one in BIASES if one != bias})
    slopes = [sp.diff(form, x, order).subs(DERIVATIVES) for order in (1, 2)]
    (of_bias,) = sp.solve(slopes[0], bias)
    solutions = sp.solve(sp.numer(sp.together(slopes[1].subs(bias, of_bias))), natural)
    return [(one, of_bias.subs(natural, one)) for one in solutions]


def limit_of(bias: sp.Symbol, length: sp.Expr, at: sp.Symbol) -> list[tuple[sp.Expr, sp.Expr]]:
    """The limits for a given squared length.

    Parameters
    ----------
    bias : sympy.Symbol
    length : sympy.Expr
        Squared length of the strings of the first hand as a function of `at`.
    at : sympy.Symbol

    Returns
    -------
    list of (sympy.Expr, sympy.Expr)
        As of `limit`, functions of x.
    """
    roots = {one: sp.sqrt(length.subs(at, sign * x)) for one, sign in ((longer, 1), (shorter, -1))}
    values = {name: one.subs(roots).doit() for one, name in DERIVATIVES.items()}
    return [tuple(one.subs(values) for one in pair) for pair in limit(bias)]


def argument() -> list[Step]:
    """The argument as sentences and formulas."""
    place, fold = wells()
    return [
        Step("A mechanism with one coordinate x between strings of squared length L(x) and L(-x) "
             "has a stationary energy at x = 0, and its second derivative vanishes at the "
             "prestrain", sp.Eq(sp.Symbol("p_c"), threshold())),
        Step("of the shape alone, if L'' < 0. Beyond it there are two wells, mirror images of "
             "each other. A prism with upright bars h and cross strings of both hands, turned by "
             "phi, has", sp.Eq(sp.Symbol("L"), twin_strings())),
        Step("and with the side l of its polygons", sp.Eq(sp.Symbol("p_c"), of_prism())),
        Step("until one hand is slack where the other is longest, at the twist pi/2 - pi/n: the "
             "wells end at", sp.Eq(prestrain, last_of_prism())),
        Step("An arm b about a pivot, with anchors at the distance R and the angles alpha and "
             "-alpha to it:", sp.Eq(sp.Symbol("L"), rotor()),
             sp.Eq(sp.Symbol("p_c"), threshold_of(rotor(), x))),
        Step("Close to the threshold U = U2 x^2/2 + U4 x^4/24 - M x. Without a torque M the wells "
             "are at", sp.Eq(x**2, place**2)),
        Step("A torque lifts one of them by M times their distance, which a front releases, and "
             "ends it at", sp.Eq(torque, fold)),
        Step("Far from the threshold as well: with the lengths f(x) and g(x) = f(-x) of the "
             "strings, a small torque, or a difference of natural lengths or of stiffnesses, lifts "
             "the well at -x above that at x by its size times",
             *(released(one) for one in BIASES)),
        Step("and a well ends at x with the natural length and the torque, or with the two natural "
             "lengths,", *(sp.Eq(name, sp.simplify(form)) for bias in (torque, other)
                           for name, form in zip((natural, bias), limit(bias)[0], strict=True))),
    ]  # fmt: skip
