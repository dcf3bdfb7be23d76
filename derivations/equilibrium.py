"""Equilibrium of the six nodes: member forces under axial load, self-stress, taut range.

The unknowns are force densities, force over length: x1 of the cross strings and x2 of the base
strings in tension, x3 of the bars in compression.  F is the total axial load, compression > 0,
distributed equally over the three nodes of each base.  The result does not depend on the
stiffnesses.  Above the height at which base strings and bars unload together, upright cross strings
alone carry the load.  Source: the talk, part III, "Equilibrium problem", "Numerical approach".
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import sympy as sp

from derivations import prism, regular
from derivations.argument import Step
from derivations.prism import base, height, twist
from derivations.regular import ANY, TRIANGLE, Polygon

TITLE = "Equilibrium of the nodes: force densities, self-stress, taut range"

densities = x1, x2, x3 = sp.symbols("x_1 x_2 x_3", real=True)
load = sp.Symbol("F", real=True)


@cache
def residuals() -> list[sp.Matrix]:
    """Total forces on the six nodes, three lower and three upper ones, as a list of vectors."""
    lower, upper = prism.nodes()
    positions = [*lower, *upper]
    up = sp.Matrix([0, 0, load / 3])
    forces = [up] * 3 + [-up] * 3
    for member, density in zip(prism.MEMBERS, (x1, x2, -x3), strict=True):  # bars are compressed
        for i, j in member.ends:
            force = density * (positions[j] - positions[i])
            forces[i], forces[j] = forces[i] + force, forces[j] - force
    return [force.applyfunc(lambda f: sp.expand(sp.expand_trig(f))) for force in forces]


def _reduced(expression):
    """Polynomial in cos(phi) and sin(phi), the latter at most to the first power."""
    expanded = sp.expand(expression)
    return sp.expand(expanded.subs(sp.sin(twist) ** 2, 1 - sp.cos(twist) ** 2))


@cache
def matrix() -> sp.Matrix:
    """Coefficients of x1, x2, x3 in the three equations of one upper node."""
    return residuals()[3].jacobian(densities)


@cache
def determinant() -> sp.Expr:
    """Determinant of `matrix`; where it vanishes, self-stress exists and no load is carried."""
    return sp.factor(_reduced(matrix().det()))


@cache
def force_densities() -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    """x1, x2, x3 under the axial load F, solved at one node and verified at all six."""
    adjugate = matrix().adjugate() * sp.Matrix([0, 0, load / 3])
    solution = [sp.cancel(_reduced(x) / determinant()) for x in adjugate]
    at_solution = dict(zip(densities, solution, strict=True))
    for residual in residuals():
        for component in residual.subs(at_solution):
            if _reduced(sp.numer(sp.together(component))) != 0:
                raise ArithmeticError("the solution of one node fails on another")
    return tuple(solution)


@cache
def self_stress() -> dict[sp.Expr, tuple[sp.Expr, sp.Expr]]:
    """{twist: (x2/x1, x3/x1)} for the twists at which the unloaded prism can be prestressed."""
    singular = sp.solveset(determinant(), twist, sp.Interval.Lopen(-sp.pi, sp.pi))
    states = {}
    for value in singular:
        for state in matrix().subs(twist, value).nullspace():
            state = (state / state[0]).applyfunc(sp.radsimp)
            states[value] = (state[1], state[2])
    return states


def tensegrity_twist() -> sp.Expr:
    """The only twist of `self_stress` with tensioned strings and compressed bars."""
    (value,) = [t for t, ratios in self_stress().items() if all(r > 0 for r in ratios)]
    return value


@cache
def ratios() -> tuple[sp.Expr, sp.Expr]:
    """x2/x1 and x3/x1 under any load, functions of the twist alone."""
    first, second, third = force_densities()
    return tuple(sp.cancel(x / first) for x in (second, third))


@cache
def taut_range() -> tuple[sp.Expr, sp.Expr]:
    """Ends of the open interval of twists in which the three force densities have one sign."""
    zeros = {sp.Integer(0), 2 * sp.pi}
    for ratio in ratios():
        for part in sp.fraction(sp.together(ratio)):
            zeros |= set(sp.solveset(part, twist, sp.Interval(0, 2 * sp.pi)))
    ends = sorted(zeros, key=float)
    good = [
        (low, high)
        for low, high in pairwise(ends)
        if all(ratio.subs(twist, (low + high) / 2).evalf() > 0 for ratio in ratios())
    ]
    if good[0][0] == 0 or any(a[1] != b[0] for a, b in pairwise(good)):
        raise ArithmeticError("the taut twists are not one interval")
    return good[0][0], good[-1][1]


def unloaded_at_low_end() -> sp.Expr:
    """Load, in terms of x1, at which base strings and bars unload together."""
    (value,) = sp.solve(force_densities()[0].subs(twist, taut_range()[0]) - x1, load)
    return value


# --- beyond the lower end of the taut range: bars have their natural length ----------------------


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


def argument() -> list[Step]:
    low, high = taut_range()
    upper = residuals()[3]
    steps = [
        Step("The three components of the force on an upper node must vanish:", *upper),
        Step("These are three equations for three unknowns, with the determinant", determinant()),
        Step(
            "The solution at this node balances all six nodes:",
            *(sp.Eq(x, value) for x, value in zip(densities, force_densities(), strict=True)),
        ),
        Step(
            "Without load a non-zero state requires a vanishing determinant. The null vectors are",
            *(
                sp.And(sp.Eq(twist, t), sp.Eq(x2 / x1, r2), sp.Eq(x3 / x1, r3), evaluate=False)
                for t, (r2, r3) in self_stress().items()
            ),
        ),
        Step(
            "Only at the following twist are all strings in tension and the bars in compression; "
            "at the other one, base strings are compressed if cross strings are tensioned.",
            sp.Eq(twist, tensegrity_twist()),
        ),
        Step(
            "Under load the ratios depend on the twist only:",
            sp.Eq(x2 / x1, ratios()[0]),
            sp.Eq(x3 / x1, ratios()[1]),
        ),
        Step(
            "Both are positive in a single interval of twists:",
            sp.And(low < twist, twist < high),
        ),
        Step(
            "At its upper end the cross strings unload while the load remains finite. At its lower "
            "end base strings and bars unload together, under the load",
            sp.Eq(load, unloaded_at_low_end()),
        ),
    ]
    return steps
