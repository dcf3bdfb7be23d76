"""The prism without base strings: bars at rest, cross strings upright, one closed form.

Above the height at which base strings and bars unload together nothing holds the bases apart.
The bars keep their natural length, and the cross strings pull alone, along the axis.
Source: seeds/000, part III, "Numerical approach".
"""

from functools import cache

import sympy as sp

from derivations import prism
from derivations.prism import base, height, natural_bar, twist


def upright_twist() -> sp.Expr:
    """Twist at which a cross string stands upright, s = h."""
    leaning = prism.cross_length_squared() - height**2
    (value,) = sp.solveset(leaning, twist, sp.Interval(0, sp.pi))
    return value


def base_squared() -> sp.Expr:
    """l^2 [m^2] of the state of this height, from the natural length of the bars."""
    square = sp.Symbol("square")
    squared = prism.bar_length_squared().subs(twist, upright_twist()).subs(base**2, square)
    (value,) = sp.solve(squared - natural_bar**2, square)
    return sp.factor(value)


@cache
def load() -> sp.Expr:
    """Axial load [N], compression > 0, of a state in which no base string is needed."""
    energy = sum(member.energy(member.length()) for member in (prism.CROSS, prism.BAR))
    state = {twist: upright_twist(), base: sp.sqrt(base_squared())}
    slopes = [sp.simplify(sp.diff(energy, x).subs(state)) for x in (base, twist, height)]
    if slopes[:2] != [0, 0]:
        raise ArithmeticError("the prism does not hang in equilibrium without base strings")
    return -slopes[2]
