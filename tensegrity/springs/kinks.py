"""Kinks of the force of a piecewise law: place, strength, exponent and side of each.

The pieces meet at the zeros of the switching functions, and on either side of such a border the
energy is one smooth expression.  The jumps of its derivatives across the border, or the power by
which they grow there, are evaluated in multiple precision so close to the border that the higher
terms of the series are negligible.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise
from typing import Any

from tensegrity.engine.law import LEAST, error_of, is_piecewise
from tensegrity.once import once

DIGITS = 400  # decimal digits of the evaluation
OFFSET = "1e-40"  # distance from a border [m]: below the length scales of any law
HIGHEST = 4  # highest derivative of the energy whose jump counts: later ones permit order 5
SAME = 1e-17  # difference of an exponent from the fraction or float that it is taken for
PURE = 1e-15  # negligible coefficient of the next power [1/m], over that of the first
MOST_BORDERS = 64  # largest number of borders of a law
SEARCH_EXPONENTS = range(-240, 81)  # powers of 2^(1/4) between which zeros are bracketed
Kink = tuple[float, float, float, float]
TAUT = 1e-10  # shortening over natural length up to which a string counts as taut
UNKNOWN: Kink = (math.nan, math.nan, math.nextafter(1.0, 0.0), math.nan)
"""A kink of unknown place; its exponent is taken as nearly 1, and steps are not corrected."""


def kinks(
    energy: Any,
    elongation: Any,
    symbols: Sequence[Any],
    values: Sequence[float],
    domain: tuple[float, float] = (-math.inf, math.inf),
) -> tuple[Kink, ...]:
    """Kinks of the force of a spring.

    Parameters
    ----------
    energy : sympy.Expr
        V(r) [J].
    elongation : sympy.Symbol
        r [m].
    symbols : sequence of sympy.Symbol
        Parameters of the energy.
    values : sequence of float or sympy.Number
        Their values, of which floats count as the rational numbers that they are.
    domain : (float, float), optional
        Range of elongation that is searched [m].

    Returns
    -------
    tuple of (place [m], strength [N/m^exponent], exponent, side)
        The tension contains the terms side strength max(side (r - place), 0)^exponent; exponent 0
        is a jump of the force, and -1 one of the energy.  `UNKNOWN` if the pieces cannot be
        separated.
    """
    if not is_piecewise(energy := _exact(energy, elongation)):
        return ()
    import mpmath
    import sympy as sp

    located: list[Kink] = []
    with mpmath.workdps(DIGITS):
        law = _Law(symbols, [_number(sp.Rational(value)) for value in values])
        try:
            pieces = law.pieces(energy, *map(mpmath.mpf, domain))
            ends = [*(start for start, _ in pieces[2:]), mpmath.mpf(domain[1])]
            for ((start, left), (place, right)), end in zip(pairwise(pieces), ends, strict=False):
                if left != right:
                    room = min(place - start, end - place)
                    located += _kinks_at(law, place, room, (left, right))
        except (_AmbiguousError, ArithmeticError, ValueError, TypeError, NotImplementedError):
            return (UNKNOWN,)
    return tuple(located)


class _AmbiguousError(Exception):
    pass


def _elongation() -> Any:
    import sympy as sp

    return sp.Symbol("r", real=True)


@once
def _exact(energy: Any, elongation: Any) -> Any:
    """The energy of a real elongation, with every float replaced by its exact rational value."""
    import sympy as sp

    numbers = {x: sp.Rational(float(x)) for x in energy.atoms(sp.Float)}
    return energy.xreplace(numbers | {elongation: _elongation()})


@once
def _derivative(expression: Any, symbol: Any, order: int) -> Any:
    """A derivative, from the one below: SymPy would derive all of these again, and factor them."""
    import sympy as sp

    return sp.diff(_derivative(expression, symbol, order - 1), symbol) if order else expression


@once
def _function(expression: Any, symbols: Any, derivative: int = 0) -> Any:
    import sympy as sp

    expression = _derivative(expression, symbols[0], derivative)
    return sp.lambdify(symbols, expression, "mpmath", cse=True, docstring_limit=0)


class _Law:
    """Expressions of the elongation with values for their parameters."""

    def __init__(self, symbols: Sequence[Any], values: Sequence[Any]) -> None:
        self._symbols, self._values = (_elongation(), *symbols), values

    def __call__(self, expression: Any, at: Any, derivative: int = 0) -> Any:
        """Value of an expression, or of a derivative of it, at an elongation."""
        return _function(expression, self._symbols, derivative)(at, *self._values)

    def real(self, expression: Any, at: Any, derivative: int = 0) -> Any:
        """Value of an expression or a derivative, which must be finite and real."""
        import mpmath

        value = mpmath.mpmathify(self(expression, at, derivative))
        if not mpmath.isfinite(value) or mpmath.im(value):
            raise _AmbiguousError
        return mpmath.re(value)

    def error(self, energy: Any, k: int, place: Any, far: Any) -> Any:
        """Error of the k-th derivative of a piece at a place by relative errors of 1 in all its
        constants; those of a polynomial may be differences, of terms of the size that it has at
        another place."""
        import mpmath

        r = self._symbols[0]
        places = [place, far] if mpmath.isfinite(far) and energy.is_polynomial(r) else [place]
        error = error_of(_derivative(energy, r, k))
        return max(self.real(error, x) for x in places)

    def pieces(self, energy: Any, low: Any, high: Any) -> list[tuple[Any, Any]]:
        """Lower end and expression of each smooth piece of an energy between two elongations."""
        import mpmath

        inner = _innermost(energy)
        if inner is None:
            return [(low, energy)]
        zeros = {x for g in _switching_functions(inner) for x in self.zeros(g, low, high)}
        borders, pieces = [low, *sorted(zeros), high], []
        if len(borders) > MOST_BORDERS:
            raise _AmbiguousError
        for start, end in pairwise(borders):
            if mpmath.isinf(start):
                inside = end - abs(end) - 1 if mpmath.isfinite(end) else mpmath.mpf(1) / 3
            else:
                inside = (start + end) / 2 if mpmath.isfinite(end) else start + abs(start) + 1
            pieces += self.pieces(
                energy.xreplace({inner: self._branch_at(inner, inside)}), start, end
            )
        return pieces

    def _branch_at(self, part: Any, at: Any) -> Any:
        """The branch of a piecewise part that applies at an elongation."""
        import sympy as sp

        if isinstance(part, sp.Piecewise):
            for expression, condition in part.args:
                if self(condition, at):
                    return expression
            raise _AmbiguousError
        value = [self.real(argument, at) for argument in part.args]
        if isinstance(part, (sp.Max, sp.Min)):
            pick = max if isinstance(part, sp.Max) else min
            return part.args[value.index(pick(value))]
        sign = 1 if value[0] > 0 else -1
        if isinstance(part, sp.Abs):
            return sign * part.args[0]
        return sp.Integer(sign if isinstance(part, sp.sign) else (sign + 1) // 2)

    def zeros(self, g: Any, low: Any, high: Any) -> list[Any]:
        """Zeros of an expression between two elongations."""
        r = self._symbols[0]
        if not g.has(r):
            return []
        roots = (
            self._roots(_coefficients(g, r))
            if g.is_polynomial(r)
            else self._bracketed_zeros(g, low, high)
        )
        return [x for x in roots if low < x < high]

    def _roots(self, coefficients: Sequence[Any]) -> list[Any]:
        """Real roots of a polynomial, the coefficient of the highest power first."""
        import mpmath
        import sympy as sp

        numbers = [self.real(x, mpmath.mpf(0)) for x in coefficients]
        while numbers and not numbers[0]:
            numbers = numbers[1:]
        if len(numbers) <= 2:
            return [-numbers[1] / numbers[0]] if len(numbers) == 2 else []
        rational = [sp.Rational(str(x)) for x in numbers]
        return [_number(x) for x in set(sp.real_roots(sp.Poly(rational, self._symbols[0])))]

    def _bracketed_zeros(self, g: Any, low: Any, high: Any) -> list[Any]:
        """Zeros of an expression that is not a polynomial, bracketed by its sign on a grid."""
        import mpmath

        sizes = [mpmath.mpf(2) ** (mpmath.mpf(k) / 4) for k in SEARCH_EXPONENTS]
        points = {mpmath.mpf(0), *sizes, *(-x for x in sizes), low, high} - {
            mpmath.inf,
            -mpmath.inf,
        }
        points = sorted(x for x in points if low <= x <= high)
        with mpmath.workdps(15):
            signs = [_sign(self(g, x)) for x in points]
        roots = [x for x, sign in zip(points, signs, strict=True) if sign == 0]
        for a, b, one, other in zip(points, points[1:], signs, signs[1:], strict=False):
            if one * other < 0:
                value = lambda x: self(g, x)  # noqa: E731
                roots.append(mpmath.findroot(value, (a, b), solver="anderson", verify=False))
        return roots


def _innermost(energy: Any) -> Any:
    """A piecewise part of an energy whose own arguments are smooth."""
    import sympy as sp

    these = energy.atoms(sp.Max, sp.Min, sp.Abs, sp.Heaviside, sp.Piecewise, sp.sign)
    inner = (x for x in these if not any(is_piecewise(argument) for argument in x.args))
    return min(inner, key=str, default=None)


def _switching_functions(part: Any) -> list[Any]:
    """Expressions whose zeros are the borders between pieces."""
    import sympy as sp

    if isinstance(part, (sp.Max, sp.Min)):
        return [a - b for k, a in enumerate(part.args) for b in part.args[:k]]
    if isinstance(part, sp.Piecewise):
        relations = {x for _, condition in part.args for x in condition.atoms(sp.Rel)}
        return [x.lhs - x.rhs for x in relations]
    return [part.args[0]]


@once
def _coefficients(g: Any, r: Any) -> Any:
    import sympy as sp

    return sp.Poly(g, r).all_coeffs()


def _number(x: Any) -> Any:
    import mpmath
    import sympy as sp

    if x.is_Rational:
        return mpmath.mpf(int(x.p)) / int(x.q)
    return mpmath.mpf(sp.Float(x.evalf(DIGITS), DIGITS))


def _sign(value: Any) -> float:
    """1, 0 or -1; NaN for a value that is not finite and real."""
    import mpmath

    if not mpmath.isfinite(value) or mpmath.im(value):
        return math.nan
    return float(mpmath.sign(mpmath.re(value)))


def _kinks_at(law: _Law, place: Any, room: Any, energies: tuple[Any, Any]) -> list[Kink]:
    """Kinks at a border between two smooth energies, of which the shorter one has this `room`."""
    kinks, regular, sides = [], [], tuple(zip((-1, 1), energies, strict=True))
    for side, energy in sides:
        powers, values = _one_sided_terms(law, energy, place, side)
        regular.append(values)
        for factor, exponent in powers:  # the energy has the part factor x^exponent
            kinks.append((float(place), float(factor * exponent), float(exponent - 1), float(side)))
    jumps = _jumps(*regular)
    for k in list(jumps):
        error = max(law.error(energy, k, place, place + side * room) for side, energy in sides)
        if abs(jumps[k]) <= LEAST * error:
            del jumps[k]
    if jumps:
        first = min(jumps)
        side = -1 if abs(regular[0][first]) > abs(regular[1][first]) else 1
        for k, jump in jumps.items():
            strength = jump * side ** abs(k - 1) / math.factorial(max(k - 1, 0))
            kinks.append((float(place), float(strength), float(k - 1), float(side)))
    return kinks


def _jumps(left: list[Any], right: list[Any]) -> dict[int, Any]:
    """Jumps of the derivatives across a border that are not small beside them, by their order."""
    import mpmath

    jumps, far = {}, 100 * mpmath.mpf(OFFSET)
    size = [max(abs(a), abs(b)) for a, b in zip(left, right, strict=False)]
    for k, (a, b, next_size) in enumerate(zip(left, right, size[1:], strict=False)):
        if abs(b - a) > max(LEAST * size[k], far * next_size):
            jumps[k] = b - a
    return jumps


def _one_sided_terms(law: _Law, energy: Any, place: Any, side: int) -> tuple[list[Any], list[Any]]:
    """Leading terms of an energy on one side of a border: its fractional powers, and its finite
    derivatives with the next one."""
    import mpmath

    near, order = mpmath.mpf(OFFSET), HIGHEST + 1
    values = [law.real(energy, place + side * near, k) for k in range(order)]
    distance = [near, 2 * near, 4 * near]
    steep = [law.real(energy, place + side * x, order) for x in distance]
    grows = mpmath.log(abs(steep[1] / steep[0]), 2) if steep[0] and steep[1] else mpmath.mpf(0)
    if grows > -SAME:
        return [], [*values, steep[0]]
    exponent = _recognised(order + grows)
    if exponent <= 1:  # the force is infinite
        raise _AmbiguousError
    powers = exponent, exponent + 1, mpmath.mpf(order)
    rows = [[mpmath.ff(p, order) * x ** (p - order) for p in powers] for x in distance]
    one, next_one, _ = mpmath.lu_solve(mpmath.matrix(rows), mpmath.matrix(steep)) * side**order
    terms = [(one, exponent)]
    if abs(next_one) > PURE * abs(one):
        terms.append((next_one, exponent + 1))
    return terms, [*values, steep[0]][: math.ceil(exponent) + 1]


def _recognised(exponent: Any) -> Any:
    """The fraction or float that equals an exponent to many digits."""
    import mpmath

    plain = Fraction(float(exponent)).limit_denominator(1000)
    for known in (mpmath.mpf(plain.numerator) / plain.denominator, mpmath.mpf(float(exponent))):
        if abs(known - exponent) < SAME:
            return known
    raise _AmbiguousError
