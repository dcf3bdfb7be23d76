"""Closed forms of a unit at rest, as expressions, LaTeX, MathML and C.

With D = L^2/2 of each kind of members, their force density q = T/L, and the further energy E, the
stiffness of the controlled coordinate is the ratio of the determinants of

    M = [[sum n q DD'' + E'', D'], [D'^T, -diag(L^2/(n (k - q)))]]

and of M without the row and column of that coordinate; a rigid member has no entry on the diagonal,
and no limit is taken.  The determinants are expanded by Laplace's rule in a ring of polynomials, in
which roots, sines and cosines are symbols; their relations are used once, at the end.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from string import ascii_lowercase
from typing import Any

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.once import once
from tensegrity.printing import Lines, Printed
from tensegrity.unit import rest as at_rest
from tensegrity.unit.determinants import TERMS, TooLongError, ratio
from tensegrity.unit.rest import Described

STIFFNESS = "axial stiffness"
LONGEST = 200  # operations of an expression, beyond which its parts get names
EVIDENCE = 1e-20  # size of a number that would be 0, over its parts, in 40 digits


@dataclass(frozen=True, eq=False, repr=False)
class Formula(Printed):
    """A closed form.

    Attributes
    ----------
    name : str
        What it is.
    expression : sympy.Expr
        In the symbols of the unit and those of `where`.
    where : dict of sympy.Symbol to sympy.Expr
        Definitions, each in symbols of the unit and in those defined before it.
    note : str
        That the value is a number because the formula would be too long, or empty.
    """

    name: str
    expression: Any
    where: Mapping[Any, Any] = field(default_factory=dict)
    note: str = ""

    @property
    def whole(self) -> Any:
        """The expression with all definitions put in."""
        form = self.expression
        for symbol, value in [*self.where.items()][::-1]:
            form = form.xreplace({symbol: value})
        return form

    def latex(self) -> str:
        """The expression as LaTeX, without delimiters; `where` holds its definitions."""
        from derivations.typeset import latex

        return latex(self.expression)

    def mathml(self) -> str:
        """The expression as an element of HTML with displayed MathML."""
        from derivations.typeset import mathml

        return mathml(self.expression)

    def c(self, name: str = "value") -> str:
        """A function in C99 that returns the value.

        Parameters
        ----------
        name : str, optional
            Of the function; its arguments are the symbols, sorted by their names.

        Returns
        -------
        str

        Raises
        ------
        TensegrityError
            `name`, or that of a symbol, is no identifier.
        """
        import sympy as sp

        given = sorted(self.whole.free_symbols, key=str)
        for one in (name, *map(str, given)):
            check.kind("name", one, str)
            if not re.fullmatch(r"[A-Za-z_]\w*", one):
                raise TensegrityError(f"name {check.shown(one)} must be an identifier of C")
        shared, (form,) = sp.cse([self.whole], symbols=sp.numbered_symbols(f"{name}_"))
        lines = [f"    const double {x} = {sp.ccode(value)};" for x, value in shared]
        arguments = ", ".join(f"double {x}" for x in given) or "void"
        body = [*lines, f"    return {sp.ccode(form)};"]
        return "\n".join(
            ["#include <math.h>", "", f"double {name}({arguments})", "{", *body, "}", ""]
        )

    def _lines(self) -> Lines:
        yield f"{self.name} = {self.expression}"
        yield from (f"  {x} = {value}" for x, value in self.where.items())
        yield from [f"  {self.note}"] * bool(self.note)


def formula(unit: Described, name: str) -> Formula:
    """See `Unit.formula`."""
    known = names(unit)
    if name not in known:
        raise TensegrityError(f"formula {check.shown(name)} must be one of {', '.join(known)}")
    try:
        form = _form(unit, name)
    except TooLongError:
        value = _value(unit, name)
        return Formula(name, value, note=f"a number: the formula has more than {TERMS} terms")
    return Formula(name, *_shortened(form))


def names(unit: Described) -> tuple[str, ...]:
    """Names of the formulas of a unit."""
    each = [f"{what}_{k}" for what in ("tension", "natural_length")
            for k in range(len(unit.members))]  # fmt: skip
    return STIFFNESS, *each


def _value(unit: Described, name: str) -> Any:
    import sympy as sp

    what, _, number = name.rpartition("_")
    rest = at_rest.at_rest(unit)
    if name == STIFFNESS:
        return sp.Float(at_rest.condensed_stiffness(unit), 17)
    k = int(number)
    strain = rest.tensions[k] / rest.stiffness[k]
    return sp.Float(rest.tensions[k] if what == "tension" else rest.lengths[k] - strain, 17)


def _shortened(form: Any, letter: str = "a") -> tuple[Any, dict[Any, Any]]:
    """An expression and definitions of its parts, if it is long."""
    import sympy as sp

    if form.count_ops() <= LONGEST:
        return form, {}
    taken = {str(x) for x in form.free_symbols}
    fresh = (x for x in sp.numbered_symbols(f"{letter}_", start=1) if str(x) not in taken)
    shared, (short,) = sp.cse([form], symbols=fresh)
    return short, dict(shared)


@once
def _form(unit: Described, name: str) -> Any:
    import sympy as sp

    state = _State(unit)
    if name == STIFFNESS:
        return state.stiffness()
    what, _, number = name.rpartition("_")
    places = [one[0] for one in state.members]
    if int(number) not in places:  # without length at rest
        member = unit.members[int(number)]
        return _rational(-member.k * member.natural if what == "tension" else member.natural)
    k = places.index(int(number))
    length, density = sp.sqrt(2 * state.half_squares[k]), state.densities()[k]
    if what == "tension":
        return sp.factor(sp.together(density)) * length
    return length * sp.factor(sp.together(1 - density / state.k[k]))


def argument(unit: Described) -> list[Any]:
    """See `Unit.argument`."""
    import sympy as sp

    from derivations.argument import Step

    members, energy = unit.members, unit.energy
    length, natural, tension = (sp.IndexedBase(x) for x in ("L", "N", "T"))
    pulls = [m.count * tension[k] * m.length for k, m in enumerate(members)]
    forces = [sum((sp.diff(x, q) for x in pulls), sp.diff(energy, q)) for q in unit.coordinates]
    elastic = [(k, m) for k, m in enumerate(members) if m.k is not sp.oo]
    stored = [m.count * m.k * (length[k] - natural[k]) ** 2 / 2 for k, m in elastic]
    given = {
        "The lengths of the members are": [(length[k], m.length) for k, m in enumerate(members)],
        "The energy is": [(sp.Symbol("U"), sum(stored, energy))],
        "Without load the forces on the coordinates vanish,": [(x, 0) for x in forces],
        "at rest, where": [*unit.rest.items()],
        "with the parameters": [*unit.parameters.items()],
        "The tensions of the self-stress are": _by_member(unit, tension, "tension"),
        "and the natural lengths": _by_member(unit, natural, "natural_length"),
    }
    made = formula(unit, STIFFNESS)
    stiffness = f"The stiffness of {unit.control}, the others in equilibrium, is"
    given[stiffness] = [(sp.Symbol("K"), made.expression), *made.where.items()]
    steps = [
        Step(words, *(sp.Eq(a, b, evaluate=False) for a, b in pairs))
        for words, pairs in given.items() if pairs
    ]  # fmt: skip
    for letter, soft in zip(ascii_lowercase[1:], _softnesses(unit), strict=False):
        try:
            form = _form(_rigid(unit, soft), STIFFNESS)
        except (TensegrityError, TooLongError):  # without bound itself, or with no closed form
            continue
        short, where = _shortened(form, letter)
        pairs = [(sp.Symbol("K"), short), *where.items()]
        words = f"For rigid members, {' and '.join(map(str, soft))} without bound, it becomes"
        steps.append(Step(words, *(sp.Eq(a, b, evaluate=False) for a, b in pairs)))
    return steps


def _softnesses(unit: Described) -> list[tuple[Any, ...]]:
    """Spring constants, each and all of them, whose members the self-stress finds a tension for
    if they are rigid."""
    free = [m for m in unit.members if m.natural is None and m not in unit.prestrain]
    others = [unit.energy, *unit.rest.values(), *(m.k for m in unit.members if m not in free)]
    bound = set().union(*(x.free_symbols for x in others))
    each = [k for k in dict.fromkeys(m.k for m in free) if k.is_Symbol and k not in bound]
    return [*((k,) for k in each), *[tuple(each)] * (len(each) > 1)]


def _rigid(unit: Any, soft: Sequence[Any]) -> Any:
    """The unit whose members of these spring constants are rigid."""
    import sympy as sp

    members = [replace(m, k=m.k.subs(dict.fromkeys(soft, sp.oo))) for m in unit.members]
    known = {x: value for x, value in unit.parameters.items() if x not in soft}
    return replace(unit, members=members, parameters=known)


def _by_member(unit: Described, symbol: Any, what: str) -> list[tuple[Any, Any]]:
    return [(symbol[k], formula(unit, f"{what}_{k}").whole) for k in range(len(unit.members))]


class _State:
    """A unit at rest in symbols: parameters stay, floats are rational."""

    def __init__(self, unit: Described) -> None:
        import sympy as sp
        from sympy.simplify.fu import TR8

        self.q, self.rest = unit.coordinates, {q: _rational(x) for q, x in unit.rest.items()}
        energy, self.members, lengths = _rational(unit.energy), [], []
        for number, m in enumerate(unit.members):
            length, count, k = (_rational(x) for x in (m.length, m.count, m.k))
            if m.natural is not None and k is not sp.oo and _vanishes(self.at(length)):
                energy += count * k * (length - _rational(m.natural)) ** 2 / 2  # has no direction
                continue
            self.members.append((number, m, count, k, unit.prestrain.get(m)))
            lengths.append(length)
        halves = [sp.expand(TR8(sp.expand(x**2 / 2))) for x in lengths]
        self.half_squares = [self.at(x) for x in halves]
        self.slopes = [[self.at(sp.diff(x, q)) for q in self.q] for x in halves]
        self.bends = [[[self.at(sp.diff(x, a, b)) for b in self.q] for a in self.q] for x in halves]
        self.forces = [self.at(sp.diff(energy, q)) for q in self.q]
        self.curvatures = [[self.at(sp.diff(energy, a, b)) for b in self.q] for a in self.q]
        self.counts = [count for _, _, count, _, _ in self.members]
        self.k = [k for _, _, _, k, _ in self.members]

    def at(self, expression: Any) -> Any:
        """An expression at rest."""
        return expression.subs(self.rest)

    @cache  # noqa: B019
    def densities(self) -> list[Any]:
        """Force density of one of each of the members."""
        import sympy as sp

        found = [self._given(k) for k in range(len(self.members))]
        missing = [k for k, x in enumerate(found) if x is None]
        found = [sp.Integer(0) if x is None else x for x in found]
        loads = self._left(found)
        if all(map(_vanishes, loads)):
            return found
        rows = [[self.counts[k] * self.slopes[k][i] for k in missing] for i in range(len(loads))]
        matrix = sp.Matrix(len(loads), len(missing), [x for row in rows for x in row])
        some = _independent(matrix)
        if len(some) < len(missing):
            raise TensegrityError(
                f"the prestrain leaves {len(missing) - len(some)} states of self-stress open"
            )
        right = -sp.Matrix([loads[i] for i in some])
        solved = matrix[some, :].LUsolve(right) if some else []
        for k, value in zip(missing, solved, strict=True):
            found[k] = sp.factor(sp.radsimp(sp.cancel(sp.together(value))))
        for q, x in zip(self.q, self._left(found), strict=True):
            if not _vanishes(x):
                raise TensegrityError(f"no self-stress at rest: a force is left on {q}")
        return found

    def _given(self, k: int) -> Any:
        """The force density of a member that prestrain or natural length give, else None."""
        import sympy as sp

        _, member, _, stiffness, prestrain = self.members[k]
        if prestrain is not None:
            strain = _rational(prestrain)
            return stiffness * strain / (1 + strain)
        if member.natural is None or stiffness is sp.oo:
            return None
        return stiffness * (1 - _rational(member.natural) / sp.sqrt(2 * self.half_squares[k]))

    def _left(self, densities: Sequence[Any]) -> list[Any]:
        """Forces on the coordinates."""
        each = list(zip(self.counts, densities, self.slopes, strict=True))
        return [force + sum(n * x * slope[i] for n, x, slope in each)
                for i, force in enumerate(self.forces)]  # fmt: skip

    def stiffness(self) -> Any:
        """The ratio of determinants."""
        import sympy as sp

        q, dim = self.densities(), len(self.q)
        members, size = range(len(q)), dim + len(q)
        matrix = sp.zeros(size, size)
        for i in range(dim):
            for j in range(dim):
                parts = (self.counts[m] * q[m] * self.bends[m][i][j] for m in members)
                matrix[i, j] = self.curvatures[i][j] + sum(parts)
            for m in members:
                matrix[i, dim + m] = matrix[dim + m, i] = self.slopes[m][i]
        for m in members:
            if self.k[m] is not sp.oo:
                ease = self.counts[m] * (self.k[m] - q[m])
                matrix[dim + m, dim + m] = -2 * self.half_squares[m] / ease
        return ratio(matrix, dim - 1)


def _rational(expression: Any) -> Any:
    """An expression whose floats are the fractions of few digits that they are written as."""
    import sympy as sp

    floats = {x: sp.nsimplify(x, rational=True) for x in expression.atoms(sp.Float)}
    return expression.xreplace(floats)


def _numbers(expressions: Sequence[Any]) -> list[Any]:
    """Values of expressions with numbers in place of symbols, the same for the same names."""
    import mpmath
    import sympy as sp

    symbols = sorted(set().union(*(x.free_symbols for x in expressions)), key=str)
    values = {x: sp.Rational(7 + 3 * k, 11 + 2 * k) for k, x in enumerate(symbols)}
    with mpmath.workdps(at_rest.DIGITS):
        return [sp.N(x.xreplace(values), at_rest.DIGITS) for x in expressions]


def _vanishes(expression: Any) -> bool:
    """Whether an expression is 0 for some values of its symbols, hence for all."""
    import sympy as sp

    parts = sp.Add.make_args(sp.expand(expression))
    values = _numbers([sum(parts), *parts])
    size = max((abs(x) for x in values[1:]), default=0)
    return bool(abs(values[0]) <= EVIDENCE * max(size, 1))


def _independent(matrix: Any) -> list[int]:
    """Rows of a matrix that are independent, as many as there are."""
    import numpy as np

    if not matrix.cols:
        return []
    numbers = np.array([complex(x) for x in _numbers(list(matrix))]).reshape(matrix.shape)
    rows: list[int] = []
    for k in range(matrix.rows):
        if np.linalg.matrix_rank(numbers[[*rows, k]], 1e-9) > len(rows):
            rows.append(k)
    return rows[: matrix.cols]
