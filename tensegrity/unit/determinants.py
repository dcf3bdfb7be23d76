"""Ratios of determinants of symbolic matrices, in lowest terms.

The entries are polynomials over a common denominator of their row, with symbols for roots, sines
and cosines; the determinants are expanded by Laplace's rule, and the relations of these symbols are
used once, at the end.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

from tensegrity.errors import TensegrityError

TERMS = 2000  # of a determinant
FACTORED = 400  # terms of a quotient, up to which common factors are looked for


class TooLongError(Exception):
    """A determinant has more than `TERMS` terms."""


def ratio(matrix: Any, row: int) -> Any:
    """Determinant of a symmetric matrix over that without one row and column, factored.

    Parameters
    ----------
    matrix : sympy.Matrix
    row : int

    Returns
    -------
    sympy.Expr

    Raises
    ------
    TensegrityError
        The smaller determinant is 0.
    TooLongError
    """
    import sympy as sp

    size = matrix.rows
    algebra = _Algebra(matrix)
    whole = _determinant(algebra.rows, tuple(range(size)))
    others = tuple(k for k in range(size) if k != row)
    part = _determinant([algebra.rows[k] for k in others], others)
    if not algebra.reduced(part):
        raise TensegrityError("the inner coordinates have a motion without stiffness at rest")
    top, bottom, few = algebra.quotient(whole, part * algebra.multiples[row])
    return _signed(sp.factor(top) / sp.factor(bottom)) if few else top / bottom


def _signed(product: Any) -> Any:
    """A product whose sums begin with few minus signs."""
    import sympy as sp

    coefficient, factors = sp.Integer(1), []
    for one in sp.Mul.make_args(product):
        base, power = one.as_base_exp()
        minus = sum(x.could_extract_minus_sign() for x in base.args if base.is_Add)
        if one.is_Rational:
            coefficient *= one
        elif power.is_Integer and 2 * minus > len(base.args) and base.is_Add:
            coefficient *= (-1) ** power
            factors.append((-base) ** power)
        else:
            factors.append(one)
    rest = sp.Mul(*factors)
    if rest.is_Add and coefficient != 1:
        return sp.Mul(coefficient, rest, evaluate=False)
    return coefficient * rest


class _Algebra:
    """A ring of polynomials for the entries of a matrix, with symbols for roots and the like.

    Attributes
    ----------
    rows : list of dict of int to PolyElement
        Entries of each row that are not 0, times `multiples` of the row.
    """

    def __init__(self, matrix: Any) -> None:
        import sympy as sp

        self.atoms: dict[Any, Any] = {}
        split = [[sp.fraction(sp.together(self._plain(x))) for x in matrix.row(i)]
                 for i in range(matrix.rows)]  # fmt: skip
        symbols = set().union(*(x.free_symbols for row in split for pair in row for x in pair))
        self.relations = self._relations()
        symbols |= set().union(*(r.free_symbols for _, r in self.relations), set())
        atoms = [*self.atoms.values()]
        names = [*atoms, *sorted(symbols - {*atoms}, key=str)] or [sp.Dummy()]
        self.ring = sp.ring(names, sp.QQ)[0]
        self.names = names
        self.rows, self.multiples = [], []
        for row in split:
            multiple = self.ring.one
            for _, below in row:
                multiple = multiple.lcm(self.ring.from_expr(sp.expand(below)))
            self.multiples.append(multiple)
            entries = {}
            for j, (above, below) in enumerate(row):
                value = self.ring.from_expr(sp.expand(above))
                if value:
                    below = self.ring.from_expr(sp.expand(below))
                    entries[j] = value * multiple.exquo(below)
            self.rows.append(entries)

    def _plain(self, x: Any) -> Any:
        """An expression with symbols for what is no rational function of symbols."""
        import sympy as sp

        if x.is_Rational or x.is_Symbol:
            return x
        if x.is_Add or x.is_Mul:
            return x.func(*map(self._plain, x.args))
        if x.is_Pow and x.exp.is_Integer:
            return self._plain(x.base) ** x.exp
        if x.is_Pow and x.exp.is_Rational:
            root = x.base ** sp.Rational(1, x.exp.q)
            atom = self.atoms.setdefault(root, sp.Dummy(f"root{len(self.atoms)}"))
            return atom**x.exp.p
        return self.atoms.setdefault(x, sp.Dummy(f"atom{len(self.atoms)}"))

    def _relations(self) -> list[tuple[Any, Any]]:
        """(symbol, power, what that power is) of roots, and of sines whose cosine is there."""
        import sympy as sp

        found = []
        for form, atom in list(self.atoms.items()):
            if form.is_Pow:
                found.append((atom**form.exp.q, self._plain(form.base)))
            elif isinstance(form, sp.sin) and sp.cos(*form.args) in self.atoms:
                found.append((atom**2, 1 - self.atoms[sp.cos(*form.args)] ** 2))
        return found

    def reduced(self, value: Any) -> Any:
        """A polynomial with powers of roots and sines replaced."""
        import sympy as sp

        for power, other in self.relations:
            below = sp.fraction(sp.together(other))[1]
            if below.is_Rational:
                modulus = self.ring.from_expr(sp.expand(power - other))
                value = value.rem([modulus])
        return value

    def quotient(self, above: Any, below: Any) -> tuple[Any, Any, bool]:
        """Numerator and denominator, where they are not long in lowest terms, the latter without
        square roots where this is shorter; and whether they are not long."""
        best = self.reduced(above), self.reduced(below)
        few = len(best[0]) + len(best[1]) <= FACTORED
        best = best[0].cancel(best[1]) if few else best
        for power, _ in self.relations if few else ():
            above, below = best
            atom, exponent = power.as_base_exp()
            place = self.names.index(atom)
            if exponent == 2 and below.degree(place) == 1:
                mirror = below.compose(self.ring.gens[place], -self.ring.gens[place])
                other = self.reduced(above * mirror).cancel(self.reduced(below * mirror))
                best = min(best, other, key=lambda x: len(x[0]) + len(x[1]))
        above, below = best
        back = {atom: form for form, atom in self.atoms.items()}

        def written(value: Any) -> Any:
            form = value.as_expr()
            while form.free_symbols & set(back):
                form = form.xreplace(back)
            return form

        return written(above), written(below), few


def _determinant(rows: Sequence[Mapping[int, Any]], columns: tuple[int, ...]) -> Any:
    """Determinant of a sparse matrix by Laplace's rule, minors of the last rows computed once."""
    order = sorted(range(len(rows)), key=lambda k: -len(rows[k]))  # full rows first
    sign = _sign(order)

    @cache
    def minor(depth: int, left: tuple[int, ...]) -> Any:
        if depth == len(order):
            return 1
        total: Any = 0
        for place, column in enumerate(left):
            entry = rows[order[depth]].get(column)
            if entry:
                part = minor(depth + 1, left[:place] + left[place + 1 :])
                total += (-1) ** place * entry * part
                if hasattr(total, "terms") and len(total) > TERMS:
                    raise TooLongError
        return total

    return sign * minor(0, columns)


def _sign(order: Sequence[int]) -> int:
    """Sign of a permutation."""
    swaps = sum(a > b for k, a in enumerate(order) for b in order[k + 1 :])
    return -1 if swaps % 2 else 1
