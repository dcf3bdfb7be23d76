"""The shape of an expression: its numbers replaced by symbols, so that springs and forces that
differ in these only share one compiled kernel.

Small numbers stay, as they decide which operations are compiled: whole numbers and fractions of
small terms, floats that are multiples of 1/4 up to 8, and exponents that are whole.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import sympy as sp

LARGEST = 64  # numerator or denominator of a rational number that stays
LARGEST_FLOAT = 8  # float that stays, if four times it is whole


class Constant(sp.Symbol):
    """A symbol for a number of an expression, different from every symbol of a user's."""

    __slots__ = ()


def lifted(expressions: Sequence[Any]) -> tuple[list[Any], tuple[Constant, ...], tuple[Any, ...]]:
    """Expressions with symbols for their numbers.

    Parameters
    ----------
    expressions : sequence of sympy.Expr

    Returns
    -------
    shapes : list of sympy.Expr
        The same for expressions that differ in their numbers only; equal numbers have one symbol,
        so that pieces that meet still meet.
    constants : tuple of Constant
    numbers : tuple of sympy.Number
        Their values, as written.
    """
    whole = {one.exp for e in expressions for one in e.atoms(sp.Pow) if one.exp.is_Integer}
    for e in expressions:  # exponents, and limits of sums, which must stay whole
        whole |= {x for limits in e.atoms(sp.Tuple) for x in limits.atoms(sp.Rational)}
    atoms = set().union(*(e.atoms(sp.Float, sp.Rational) for e in expressions))
    found = {x for x in atoms if _is_large(x)} - whole
    outlines: dict[Any, str] = {}

    def outline(e: Any) -> str:
        if e not in outlines:
            if e in found:
                outlines[e] = "#"
            elif not e.args:
                outlines[e] = sp.srepr(e)
            else:
                outlines[e] = f"{type(e).__name__}({', '.join(map(outline, _ordered(e)))})"
        return outlines[e]

    def _ordered(e: Any) -> list[Any]:  # SymPy sorts terms and factors by the values of numbers
        return sorted(e.args, key=outline) if e.is_Add or e.is_Mul else list(e.args)

    numbers: dict[Any, Constant] = {}
    left = list(expressions)[::-1]
    while left:
        e = left.pop()
        if e in found:
            numbers.setdefault(e, Constant(f"constant {len(numbers)}", real=True))
        else:
            left += _ordered(e)[::-1]
    return [e.xreplace(numbers) for e in expressions], tuple(numbers.values()), tuple(numbers)


def _is_large(x: Any) -> Any:
    if x.is_Float:
        return abs(x) > LARGEST_FLOAT or not (4 * float(x)).is_integer()
    return max(abs(x.p), x.q) > LARGEST
