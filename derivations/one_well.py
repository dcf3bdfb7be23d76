"""The prism has one stable state: why prestress alone never makes it bistable.

Without load the force densities are in the ratios of a state of self-stress, which exists at one
twist only.  There, along the states in which bars and cross strings balance, the force density of
the cross strings increases with their length and that of the base strings decreases: the ratio that
the self-stress requires occurs once.  Members are linear and strings go slack; the polygons have
any number of sides.
"""

from __future__ import annotations

from functools import cache

import sympy as sp

from derivations import prism, regular
from derivations.argument import Step
from derivations.prism import base, height, twist
from derivations.regular import ANY, half_angle

TITLE = "One well: the unloaded prism has one state of rest above the flat one"

q_cross, q_base, q_bar = densities = sp.symbols("q_1 q_2 q_3", real=True)  # tension over length
cross, bar = sp.symbols("s b", positive=True)  # lengths
sine = regular.half_sine


def lengths_squared() -> list[sp.Expr]:
    """Of cross strings, base strings and bars of a prism of n sides [m^2]."""
    angle = {sine: sp.sin(half_angle), regular.half_cosine: sp.cos(half_angle)}
    inclined = (member.inclined for member in prism.MEMBERS)
    squared = (member.length_squared(of=ANY) for member in prism.MEMBERS)
    return [s.subs(angle) if up else base**2 for s, up in zip(squared, inclined, strict=True)]


def weighted(weights: tuple[sp.Expr, ...]) -> sp.Expr:
    """Sum over all members of squared lengths, each times the weight of its kind."""
    counts = [member.count(ANY) for member in prism.MEMBERS]
    return sum(n * q * s for n, q, s in zip(counts, weights, lengths_squared(), strict=True))


@cache
def stationary() -> tuple[sp.Expr, ...]:
    """Derivatives of the energy with respect to height, twist and side for any law of the members:
    each contributes its force density times half the derivative of its squared length."""
    return tuple(sp.diff(weighted(densities) / 2, by) for by in (height, twist, base))


@cache
def self_stress() -> dict[sp.Expr, tuple[sp.Expr, ...]]:
    """{twist: ratios of the force densities to that of the cross strings} above the flat state."""
    (of_bars,) = sp.solve(stationary()[0], q_bar)
    turning, spreading = (x.subs(q_bar, of_bars) for x in stationary()[1:])
    states = {}
    if sp.simplify(turning / sp.cos(twist - half_angle)).has(twist):
        raise ArithmeticError("self-stress exists at other twists")
    for at in (half_angle + sp.pi / 2, half_angle - sp.pi / 2):
        (of_base,) = sp.solve(sp.simplify(spreading.subs(twist, at)), q_base)
        states[at] = tuple(sp.simplify(x / q_cross) for x in (q_cross, of_base, of_bars))
    return states


@cache
def stress_form() -> sp.Expr:
    """Sum of squared lengths weighted with the self-stress of taut strings, for q_1 = 1."""
    ratios = self_stress()[half_angle + sp.pi / 2]
    return sp.factor(sp.simplify(sp.expand_trig(weighted(ratios))))


@cache
def of_points() -> sp.Expr:
    """Contribution of small polygons to the energy of bars and cross strings in balance, for
    q_1 = 1 and slack base strings; it is negative at some twists."""
    return sp.factor(sp.simplify(sp.expand_trig(weighted((1, 0, -1)) / 2)))


@cache
def mismatch_slope() -> sp.Expr:
    """Rate at which the base strings deviate from the self-stress as the cross strings lengthen:
    derivative of q_1 q_2*/q_1* - q_2 at the twist of self-stress *, where bars balance the cross
    strings."""
    at, bars = half_angle + sp.pi / 2, sp.Function("b")(cross)
    of_cross, _, of_bars = lengths_squared()
    ratio = sp.simplify((of_bars - of_cross).subs(twist, at) / base**2)
    side = sp.sqrt((bars**2 - cross**2) / ratio)
    q = [
        member.tension(length) / length
        for member, length in zip(prism.MEMBERS, (cross, side, bars), strict=True)
    ]
    rate = sp.diff(bars, cross)
    (balanced,) = sp.solve(sp.diff(q[0] + q[2], cross), rate)
    slope = sp.diff(q[0] * self_stress()[at][1] - q[1], cross).subs(rate, balanced)
    slope = slope.subs(bars, bar).subs(bar**2 - cross**2, base**2 * ratio)
    return sp.expand(sp.simplify(slope.subs(sp.sin(half_angle), sine)))


def argument() -> list[Step]:
    """The argument as sentences and formulas."""
    slope = mismatch_slope()
    if not slope.is_positive:
        raise ArithmeticError("the self-stress may occur twice")
    return [
        Step("With force densities q1, q2, q3 of cross strings, base strings and bars the energy "
             "of a prism of n sides, alpha = pi/n, is stationary in height, twist and side where "
             "there vanish", *stationary()),
        Step("Above the flat state, and unless the polygons are points, this needs one of two "
             "twists, with the ratios",
             *(sp.And(sp.Eq(twist, at), sp.Eq(q_base / q_cross, ratios[1]),
                      sp.Eq(q_bar / q_cross, ratios[2]), evaluate=False)
               for at, ratios in self_stress().items())),
        Step("or no forces at all. At the second twist the base strings would push. Without forces "
             "strings would be shorter and bars longer than in the prestressed state, and the sum "
             "of all squared lengths, weighted with its force densities, below 0, its value there. "
             "But for q1 = 1 it is nowhere negative:", stress_form()),
        Step("At the first twist, as the cross strings lengthen and the bars balance them, the "
             "density q1 q2*/q1* that the self-stress * asks of the base strings gains on theirs "
             "at the positive rate", slope),
        Step("so that it is met once. Polygons that are points are no minimum either: their energy "
             "falls at some twists, as it changes by", of_points()),
        Step("The energy under axial load has one minimum above the flat "
             "state; the mirror image of the minimum lies beyond that state."),
    ]  # fmt: skip
