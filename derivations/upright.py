"""The upright prism: states above the height at which base strings and bars unload together.

The bars have their natural length there, and the upright cross strings alone carry the load.
Source: the talk, part III, "Numerical approach".
"""

from __future__ import annotations

from functools import cache

import sympy as sp

from derivations import prism, regular
from derivations.prism import base, height, twist
from derivations.regular import ANY, TRIANGLE, Polygon


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
