"""Prisms with any number of sides, with n as a symbol.

R is the circumradius of the base, S = sin(pi/n), C = cos(pi/n), eta = h0/R, q = p0/(1 + p0).  The
triangular prism of the talk is the case S = sqrt 3/2, C = 1/2.
Source: the talk, part III, whose statements are for n = 3.
"""

from __future__ import annotations

from functools import cache

import sympy as sp

from derivations import elastic, hardening, prism, regular
from derivations.argument import Step
from derivations.prism import circumradius, twist
from derivations.regular import ANY, half_angle, half_sine
from derivations.rigid_response import turn_rate

TITLE = "Prisms with any number of sides"

cross_density, base_density, bar_density = sp.symbols("x_1 x_2 x_3", real=True)
natural_lengths = prism.natural_cross, prism.natural_base, prism.natural_bar


@cache
def balance() -> list[sp.Expr]:
    """Radial, tangential and axial force on a lower node of the unloaded prism."""
    at = regular.node(0, ANY, radius=circumradius)
    others = {
        base_density: [regular.node(i, ANY, radius=circumradius) for i in (1, -1)],
        cross_density: [regular.node(-1, ANY, prism.height, twist, circumradius)],
        bar_density: [regular.node(0, ANY, prism.height, twist, circumradius)],
    }
    force = sum(
        (density * (end - at) for density, ends in others.items() for end in ends),
        sp.zeros(3, 1),
    )
    return [sp.simplify(f) for f in force]


@cache
def self_stress() -> dict[sp.Symbol, sp.Expr]:
    """Force densities {base, bar} in equilibrium with 1 in a cross string, at the twist."""
    radial, tangential, axial = balance()
    (bar,) = sp.solve(axial, bar_density)
    turning = tangential.subs(bar_density, bar).subs(twist, ANY.reference_twist)
    if sp.simplify(turning) != 0:
        raise ArithmeticError("the twist pi/2 + pi/n is no state of self-stress")
    (base,) = sp.solve(radial.subs(bar_density, bar).subs(twist, ANY.reference_twist), base_density)
    ratio = sp.simplify(base / cross_density)
    if sp.simplify(ratio - 1 / (2 * sp.sin(half_angle))) != 0:
        raise ArithmeticError("the base strings do not carry 1/(2 S) of a cross string")
    return {base_density: 1 / (2 * half_sine), bar_density: bar / cross_density}


@cache
def load() -> sp.Expr:
    """Load -dV/dh for rigid bases and bars [N], compression > 0, in h, s and the twist."""
    squared = prism.CROSS.length_squared(circumradius, ANY)
    slope = sp.diff(squared, prism.height) + sp.diff(squared, twist) * turn_rate()
    length = sp.Symbol("s", positive=True)
    weight = ANY.sides * prism.CROSS.tension(length) / (2 * length)
    return -sp.simplify(weight * slope)


@cache
def derivatives() -> list[sp.Expr]:
    """[V'', V'''] at the reference, in eta, q, R, k1, n, S and C."""
    return [sp.factor(x) for x in hardening.derivatives(3, ANY)]


@cache
def members_condition() -> tuple[sp.Expr, tuple[sp.Expr, sp.Expr, sp.Expr]]:
    """b^2 - s^2 - l^2/S, of which x1 is the root, and the lengths s, l, b at self-stress.

    The lengths depend on x1 and the natural lengths, because the tension of each kind of member is
    its force density times its length.
    """
    densities = {**self_stress(), cross_density: sp.Integer(1)}
    lengths = []
    for member, density in zip(
        prism.MEMBERS, (cross_density, base_density, bar_density), strict=True
    ):
        length = sp.Symbol("L", positive=True)
        tension = cross_density * densities[density] * length
        (value,) = sp.solve(member.tension(length) - tension, length)
        lengths.append(value)
    gap = prism.bar_length_squared(None, ANY) - prism.cross_length_squared(None, ANY)
    gap = prism.at_reference(gap, ANY)
    if not regular.vanishes(gap - prism.base**2 / half_sine):
        raise ArithmeticError("b^2 - s^2 is not l^2/S in the self-stressed state")
    cross, base, bar = lengths
    return bar**2 - cross**2 - base**2 / half_sine, (cross, base, bar)


@cache
def height_squared() -> sp.Expr:
    """h^2 of the self-stressed prism in s and l."""
    s = sp.Symbol("s", positive=True)
    squared = prism.at_reference(prism.cross_length_squared(None, ANY), ANY)
    (value,) = sp.solve(squared - s**2, prism.reference_height**2)
    return sp.factor(value)


def argument() -> list[Step]:
    densities = self_stress()
    second, third = derivatives()
    condition, lengths = members_condition()
    names = sp.symbols("s l b")
    return [
        Step("With force densities x_1, x_2, x_3 of cross strings, base strings and bars, the "
             "radial, tangential and axial forces on a lower node are", sp.Matrix(balance())),
        Step("Without load they vanish at the twist", sp.Eq(twist, sp.pi / 2 + sp.pi / ANY.sides)),
        Step("for every n. The force densities of base strings and bars, over that of a cross "
             "string, are then",
             *(sp.Eq(name / cross_density, x) for name, x in densities.items())),
        Step("There is one state of self-stress, hence 6 n - 6 - 4 n + 1 = 2 n - 5 mechanisms: one "
             "for the triangular prism and two more for each further side. Prestress stiffens all "
             "of them."),
        Step("With rigid bases and bars the load is",
             sp.Eq(sp.Symbol("F"), load().subs(half_angle, sp.pi / ANY.sides))),
        Step("and at the reference, with the change of twist as parameter,",
             sp.Eq(sp.Symbol("V''"), second), sp.Eq(sp.Symbol("V'''"), third)),
        Step("The prism therefore softens first unless eta^2 exceeds the first, and locks if it "
             "exceeds the second, of",
             hardening.hardening_slenderness_squared(ANY),
             hardening.locking_slenderness_squared(ANY)),
        Step("For elastic members the axial stiffness is a rational function of S, eta, q and the "
             "compliances. The Hessian of the cross strings in (l, b, h) is",
             elastic.string_hessian(ANY).applyfunc(sp.factor)),
        Step("From cut lengths: the length of each member in the self-stressed prism follows from "
             "x_1,",
             *(sp.Eq(name, x) for name, x in zip(names, lengths, strict=True))),
        Step("and x_1 is the only root in (0, min(k_1, 2 S k_2)) of the following function. It "
             "decreases from b_N^2 - s_N^2 - l_N^2/S, which must be positive.", condition),
        Step("The height is then", sp.Eq(prism.reference_height**2, height_squared())),
    ]  # fmt: skip
