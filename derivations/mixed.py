"""Equilibrium of a prism with elastic bases or bars, in mixed variables for any stiffness.

The tension k (length - natural length) of a stiff member is lost to round-off if it is computed
from coordinates.  The tensions are therefore unknowns and the lengths follow from them,
l = l0 + (change of tension)/k2 and b = b0 + (change of tension)/k3; for rigid members the
compliance 1/k is zero.  The twist enters by the tangent of half its change from the reference, so
that all forms are algebraic.  All unknowns are changes from the self-stressed state; constants
that cancel there are eliminated symbolically.

Lengths are in units of the base l0, forces in units of k1 l0.  The equations are the gradient of
`prism.energy()` at fixed height (the talk, part III, "Elastic problem": g1 = g2 = 0) and the
compatibility of the bars; the load is -dU/dh.

Above the height at which base strings and bars unload together the state is a closed form: the
bars have their natural length, and the upright cross strings alone carry the load ("Numerical
approach").
"""

from __future__ import annotations

from functools import cache

import sympy as sp

from derivations import prism, regular
from derivations.elastic import bar_compliance, base_compliance  # k1/k3, k1/k2
from derivations.prism import base, height, twist
from derivations.regular import ANY, TRIANGLE, Polygon

base_tension, bar_tension = sp.symbols("y_2 y_3", real=True)  # changes of tension
# tan of half the change of twist from the self-stressed state
half_turn = sp.Symbol("tau", real=True)
rise = sp.Symbol("eta", real=True)  # h - h0
UNKNOWNS = (base_tension, bar_tension, half_turn, rise)

reference_height, prestrain = prism.reference_height, prism.prestrain
PARAMETERS = (reference_height, prestrain, base_compliance, bar_compliance)

_PULLS = sp.symbols("t_1 t_2 t_3", real=True)  # tensions of one member
_cross, _bar = sp.symbols("s b", positive=True)
_UNITS = {prism.k_cross: 1}


def _turned(expression, of):
    """With the twist as the reference plus a change, in terms of the tangent of half of it."""
    turn = sp.Symbol("delta", real=True)
    sine, versine = sp.symbols("sigma nu", real=True)
    expression = sp.expand(of.expanded(expression.subs(twist, of.reference_twist + turn)))
    expression = expression.subs({sp.cos(turn): 1 - versine, sp.sin(turn): sine})
    square = 1 + half_turn**2
    return sp.expand(expression), {sine: 2 * half_turn / square, versine: 2 * half_turn**2 / square}


@cache
def gain(squared: sp.Expr, of: Polygon = TRIANGLE) -> sp.Expr:
    """A squared length minus its reference value, each term small for small unknowns."""
    wider, higher = sp.symbols("Lambda Z", real=True)  # l^2 - 1, h^2 - h0^2
    expression, turned = _turned(squared, of)
    expression = expression.subs({base**2: 1 + wider, height**2: reference_height**2 + higher})
    reference = prism.at_reference(squared, of).subs(base, 1)
    widened = base_compliance * base_tension
    known = {wider: widened * (2 + widened), higher: rise * (2 * reference_height + rise)}
    return sp.expand(expression - reference).subs(known | turned)


def reference_length(squared: sp.Expr, of: Polygon = TRIANGLE) -> sp.Expr:
    """A length in the self-stressed state, in units of the base."""
    return sp.sqrt(prism.at_reference(squared, of).subs(base, 1))


@cache
def reference_tensions(of: Polygon = TRIANGLE) -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    """Tensions (cross, base, bar) of single members in the self-stressed state."""
    pulls = (
        member.tension(prism.at_reference(member.length(of), of)).subs(member.natural, natural)
        for member, natural in zip(prism.MEMBERS, prism.natural_lengths(of), strict=True)
    )
    return tuple(sp.factor(sp.expand(pull)).subs(_UNITS | {base: 1}) for pull in pulls)


@cache
def _gradient(coordinate, of):
    """dU/d(coordinate), with natural lengths replaced by length minus tension over stiffness."""
    s, b = prism.cross_length(of), prism.bar_length(of)
    derivative = sp.diff(prism.energy(of), coordinate).subs(
        {
            member.natural: member.length(of) - pull / member.stiffness
            for member, pull in zip(prism.MEMBERS, _PULLS, strict=True)
        }
    )
    return sp.expand(sp.expand(derivative).subs({s: _cross, b: _bar}))


def lengths(of: Polygon = TRIANGLE) -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    """Lengths (cross, base, bar) in the unknowns; that of the bar follows from its tension."""
    cross = prism.cross_length_squared(None, of)
    return (
        sp.sqrt(reference_length(cross, of) ** 2 + gain(cross, of)),
        1 + base_compliance * base_tension,
        reference_length(prism.bar_length_squared(None, of), of) + bar_compliance * bar_tension,
    )


def tension_changes(of: Polygon = TRIANGLE) -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    """Tensions (cross, base, bar) minus those of the self-stressed state."""
    squared = prism.cross_length_squared(None, of)
    return (
        gain(squared, of) / (lengths(of)[0] + reference_length(squared, of)),
        base_tension,
        bar_tension,
    )


def tensions(of: Polygon = TRIANGLE) -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    """Tensions (cross, base, bar) of single members."""
    return tuple(
        start + change
        for start, change in zip(reference_tensions(of), tension_changes(of), strict=True)
    )


def _in_unknowns(coordinate, of):
    expression, turned = _turned(_gradient(coordinate, of), of)
    cross, width, bar = lengths(of)
    known = dict(zip(_PULLS, tensions(of), strict=True))
    known |= {_cross: cross, _bar: bar, base: width, height: reference_height + rise}
    return expression.subs(known | turned)


def base_equilibrium(of: Polygon = TRIANGLE) -> sp.Expr:
    """dU/dl in the unknowns."""
    return _in_unknowns(base, of)


def twist_equilibrium(of: Polygon = TRIANGLE) -> sp.Expr:
    """dU/d phi in the unknowns."""
    return _in_unknowns(twist, of)


def bar_compatibility(of: Polygon = TRIANGLE) -> sp.Expr:
    """b^2 from the coordinates minus b^2 from the tension of the bar."""
    longer = bar_compliance * bar_tension
    squared = prism.bar_length_squared(None, of)
    bar = reference_length(squared, of)
    return gain(squared, of) - longer * (2 * bar + longer)


def load(of: Polygon = TRIANGLE) -> sp.Expr:
    """Total axial load -dU/dh, compression > 0."""
    return -_in_unknowns(height, of)


def stored_energy(of: Polygon = TRIANGLE) -> sp.Expr:
    """U - U0 in the tensions and their changes, with an error that vanishes with the changes."""
    counts = [member.count(of) for member in prism.MEMBERS]
    compliances = 1, base_compliance, bar_compliance
    members = zip(counts, compliances, tension_changes(of), reference_tensions(of), strict=True)
    return sum(n * c * change * (change + 2 * start) / 2 for n, c, change, start in members)


def energy_at_twist(of: Polygon = TRIANGLE) -> sp.Expr:
    """U - U0 in base tension, half turn and rise, from which that of elastic bars follows."""
    bar, more = (f(prism.bar_length_squared(None, of), of) for f in (reference_length, gain))
    change = more / (sp.sqrt(bar**2 + more) + bar) / bar_compliance
    return stored_energy(of).subs(bar_tension, change)


def upright_twist(of: Polygon = TRIANGLE) -> sp.Expr:
    """Twist at which a cross string stands upright, s = h: 2 pi/n."""
    if of is ANY:
        if sp.simplify(prism.cross_length_squared(None, of).subs(twist, 2 * of.angle)) != height**2:
            raise ArithmeticError("cross strings are not upright at twist 2 pi/n")
        return 2 * of.angle
    leaning = prism.cross_length_squared() - height**2
    (value,) = sp.solveset(leaning, twist, sp.Interval(0, sp.pi))
    return value


def upright_base_squared(of: Polygon = TRIANGLE) -> sp.Expr:
    """l^2 of the upright state at a height [m^2], from the natural length of the bars."""
    square = sp.Symbol("square")
    squared = prism.bar_length_squared(None, of).subs(twist, upright_twist(of))
    squared = of.expanded(squared) if of is ANY else squared
    squared = squared.subs(base**2, square)
    (value,) = sp.solve(squared - prism.natural_bar**2, square)
    return sp.factor(value)


@cache
def upright_load(of: Polygon = TRIANGLE) -> sp.Expr:
    """Axial load of the upright state [N], compression > 0, which needs no base strings."""
    energy = sum(member.energy(member.length(of), of) for member in (prism.CROSS, prism.BAR))
    state = {twist: upright_twist(of), base: sp.sqrt(upright_base_squared(of))}
    if of is ANY:
        sines = {regular.half_sine: sp.sin(of.angle), regular.half_cosine: sp.cos(of.angle)}
        energy, state = energy.subs(sines), {x: v.subs(sines) for x, v in state.items()}
    slopes = [sp.simplify(sp.diff(energy, x).subs(state)) for x in (base, twist, height)]
    if slopes[:2] != [0, 0]:
        raise ArithmeticError("the upright prism is not in equilibrium without base strings")
    return -slopes[2]
