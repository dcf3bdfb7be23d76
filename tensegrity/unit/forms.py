"""The mixed energy of a unit in changes from rest, in SymPy and in CasADi.

A stiff member has its tension T among the unknowns, which loses no digits however stiff it is; a
rigid one is one without compliance.  With the change e of a length, T0 at rest and y = T - T0,

    W = sum over soft n (T0 e + k e^2/2) + sum over stiff n ((T0 + y) e - y^2/(2 k)) + E - E0,

whose derivatives by coordinates and y vanish in equilibrium.  Lengths whose square is a polynomial
in coordinates and in sines and cosines of angles have e = S/(L0 + sqrt(L0^2 + S)), S the change of
the square, from which what cancels at rest is removed symbolically.  The coefficients that remain
are computed in multiple precision, and are the parameters of what is compiled.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from tensegrity.engine.law import to_casadi
from tensegrity.once import once
from tensegrity.readonly import as_fixed
from tensegrity.unit import rest as at_rest
from tensegrity.unit.rest import Described

STIFF = 100.0  # spring constant over the smallest, from which a tension is an unknown
SMALL = 8  # terms of a fraction that is compiled


@dataclass(frozen=True, eq=False)
class Changes:
    """Changes of lengths and of the further energy, in SymPy.

    Attributes
    ----------
    unknowns, sines, versines : tuple of sympy.Symbol, (coordinates,)
        Change of each coordinate, and its sine and 1 - cosine.
    angles : tuple of bool, (coordinates,)
        Whether only sine and versine of the change occur in the lengths.
    lengths : tuple of two sympy.Expr, (members,)
        The length at rest and the change of its square where that is a polynomial of these; else 0
        and the change of the length.
    energy : sympy.Expr
    constants, values : tuple of sympy.Symbol, of sympy.Expr
        Symbols of numbers, and these numbers in the coordinates at rest and parameters.
    """

    unknowns: tuple[Any, ...]
    sines: tuple[Any, ...]
    versines: tuple[Any, ...]
    angles: tuple[bool, ...]
    lengths: tuple[tuple[Any, Any], ...]
    energy: Any
    constants: tuple[Any, ...]
    values: tuple[Any, ...]


@once
def changes(unit: Described) -> Changes:
    """The changes of a unit; see `Changes`."""
    of = _Expansion(unit.coordinates)
    lengths = tuple(of.length(member.length) for member in unit.members)
    energy = of.polynomial(unit.energy)
    energy = of.difference(unit.energy) if energy is None else energy
    numbers, values = tuple(of.constants.values()), tuple(of.constants)
    return Changes(of.u, of.s, of.v, tuple(of.angles), lengths, energy, numbers, values)


class _Expansion:
    """Expressions in changes of the coordinates q from rest, and their numbers as constants."""

    def __init__(self, q: Sequence[Any]) -> None:
        import sympy as sp

        def symbols(kind: str) -> tuple[Any, ...]:
            return tuple(sp.Dummy(f"{kind}{k}", real=True) for k in range(len(q)))

        self.u, self.s, self.v, at_rest = map(symbols, ("u", "s", "v", "rest"))
        self.moved = {x: rest + u for x, rest, u in zip(q, at_rest, self.u, strict=True)}
        self.rest = dict(zip(q, at_rest, strict=True))
        self.back = {rest: x for x, rest in self.rest.items()}
        self.variables = (*self.u, *self.s, *self.v)
        self.angles = [False] * len(q)
        self.constants: dict[Any, Any] = {}  # {number in the coordinates at rest: its symbol}

    def constant(self, value: Any) -> Any:
        """The symbol of a number; small whole numbers stay."""
        import sympy as sp

        value = value.xreplace(self.back)
        if value.is_Rational and max(abs(value.p), value.q) <= SMALL:
            return value
        return self.constants.setdefault(value, sp.Dummy(f"c{len(self.constants)}", real=True))

    def length(self, length: Any) -> tuple[Any, Any]:
        """The change of a length; see `Changes.lengths`."""
        plain = self.polynomial(length)
        squared = self.polynomial(length**2) if plain is None else None
        if squared is not None:
            return self.constant(length), squared
        return 0, self.difference(length) if plain is None else plain

    def polynomial(self, expression: Any) -> Any:
        """The change of a polynomial of coordinates and sines and cosines of them; of what is none,
        None."""
        import sympy as sp
        from sympy.simplify.fu import TR8

        expression = sp.expand(expression)
        if expression.has(sp.sin, sp.cos):
            expression = sp.expand(TR8(expression))
        known = {}
        for one in expression.atoms(sp.sin, sp.cos):
            if one.free_symbols & {*self.moved}:
                known[one] = self._turned(one)
        if None in known.values():
            return None
        form = sp.expand(expression.xreplace(known).xreplace(self.moved))
        for s, v in zip(self.s, self.v, strict=True):
            form = form.replace(
                lambda x, s=s: x.is_Pow and x.base == s and x.exp.is_Integer and x.exp > 1,
                lambda x, s=s, v=v: (2 * v - v**2) ** (x.exp // 2) * s ** (x.exp % 2),
            )
        powers: dict[Any, Any] = {}
        for term in sp.Add.make_args(sp.expand(form)):
            factor, power = term.as_independent(*self.variables, as_Add=False)
            if not power.is_polynomial(*self.variables):
                return None
            powers[power] = powers.get(power, 0) + factor
        powers.pop(sp.S.One, None)  # what does not change
        squares = self._squares(powers)
        form = sp.Add(*(self.constant(x) * power for power, x in powers.items() if x != 0))
        return sp.collect(form, [*squares]).xreplace(squares)

    def _squares(self, powers: dict[Any, Any]) -> dict[Any, Any]:
        """Put changes of squares of coordinates, x^2 - x0^2 = u (u + 2 x0), in place of u and u^2
        where both occur so; what they are."""
        import sympy as sp

        found = {}
        for u, (q, rest) in zip(self.u, self.rest.items(), strict=True):
            square = sp.Dummy(f"square of {q}", real=True)
            for power in [x for x in powers if sp.degree(x, u) == 2]:
                if sp.expand(powers.get(power / u, 0) - 2 * rest * powers[power]) == 0:
                    del powers[power / u]
                    powers[square * power / u**2] = powers.pop(power)
                    found[square] = u * (u + 2 * self.constant(rest))
        return found

    def _turned(self, turn: Any) -> Any:
        """A sine or cosine by those of changes; None if it has not whole multiples of them."""
        import sympy as sp

        (angle,) = turn.args
        cosine, sine = sp.Integer(1), sp.Integer(0)
        for k, x in enumerate(self.moved):
            many = sp.diff(angle, x)
            if not many.is_Integer:
                return None
            self.angles[k] |= bool(many)
            c, s = 1 - self.v[k], self.s[k] * sp.sign(many)
            for _ in range(abs(int(many))):
                cosine, sine = sp.expand(cosine * c - sine * s), sp.expand(sine * c + cosine * s)
        begin = angle.xreplace(self.rest)
        if isinstance(turn, sp.cos):
            return sp.cos(begin) * cosine - sp.sin(begin) * sine
        return sp.sin(begin) * cosine + sp.cos(begin) * sine

    def difference(self, expression: Any) -> Any:
        """The change of any expression, as the difference of two values."""
        variables = {*self.variables}

        def hoisted(x: Any) -> Any:
            if not x.free_symbols & variables:
                return x if x.is_Boolean else self.constant(x)
            if x.is_Add or x.is_Mul:
                same = [y for y in x.args if not y.free_symbols & variables]
                rest = [hoisted(y) for y in x.args if y.free_symbols & variables]
                return x.func(*rest, *([self.constant(x.func(*same))] if same else []))
            return x.func(*map(hoisted, x.args)) if x.args else x

        return hoisted(expression.xreplace(self.moved)) - self.constant(expression)


@dataclass(frozen=True, eq=False)
class Mixed:
    """The mixed energy of a unit in CasADi.

    Attributes
    ----------
    z, h, p : casadi.SX
        Unknowns: changes of the coordinates `free`, then of the tensions of stiff members; changes
        of the controlled coordinates; parameters.
    energy : casadi.SX
        W.
    equations, loads : casadi.SX
        What vanishes, as many as unknowns: forces on the inner coordinates, then what stiff members
        are too long; the forces on the controlled coordinates, compression > 0.
    sizes : casadi.SX
        Magnitude of the terms of each force on an inner coordinate.
    tensions : casadi.SX, (members,)
        Of one of each; of a slack string what has its sign, were it taut.
    changes : casadi.SX, (coordinates,)
        Of the unit's coordinates, in their order.
    stiff : tuple of bool, (members,)
    free : tuple of int
    eliminated : tuple of int
        Numbers of stiff members whose tensions give coordinates, which are no unknowns.
    """

    z: Any
    h: Any
    p: Any
    energy: Any
    equations: Any
    loads: Any
    sizes: Any
    tensions: Any
    changes: Any
    stiff: tuple[bool, ...]
    free: tuple[int, ...]
    eliminated: tuple[int, ...]

    def at(self, p: Any, values: Any) -> Mixed:
        """The same in other parameters p, in which these have values."""
        import casadi as ca

        names = "energy", "equations", "loads", "sizes", "tensions", "changes"
        forms = ca.substitute([getattr(self, x) for x in names], [self.p], [values])
        return replace(self, p=p, **dict(zip(names, forms, strict=True)))


def is_stiff(unit: Described) -> tuple[bool, ...]:
    """Whether the tension of each of the members is an unknown."""
    k = [float(x) for x in at_rest.at_rest(unit).stiffness]
    least = min(k, default=1.0)
    return tuple(x == float("inf") or x >= STIFF * least for x in k)


@once
def mixed(unit: Described, controls: tuple[Any, ...], reduced: bool = False) -> Mixed:
    """The mixed energy of a unit.

    Parameters
    ----------
    unit : Unit
    controls : tuple of sympy.Symbol
        The coordinates that are given.
    reduced : bool, optional
        See `mixed_of`.

    Returns
    -------
    Mixed
        Its parameters are those of `numbers`.
    """
    soft = [float(k) for k in at_rest.at_rest(unit).stiffness if k < float("inf")]
    return mixed_of(unit, is_stiff(unit), controls, reduced, min(soft, default=1.0))


def mixed_of(
    unit: Described,
    stiff: tuple[bool, ...],
    controls: tuple[Any, ...],
    reduced: bool,
    softest: float = 1.0,
) -> Mixed:
    """The mixed energy of a unit, the symbols of which need no values.

    Parameters
    ----------
    unit : Unit
    stiff : tuple of bool, (members,)
        Whether the tension of each of the members is an unknown.
    controls : tuple of sympy.Symbol
        The coordinates that are given.
    reduced : bool
        Whether the unknowns of angles are tangents of half their changes, so that sines and cosines
        are algebraic, and coordinates that are lengths of stiff members follow from their tensions.
    softest : float, optional
        Smallest spring constant, for strings that are slack.

    Returns
    -------
    Mixed
    """
    import casadi as ca

    of, q = changes(unit), unit.coordinates
    given = [q.index(x) for x in controls]
    inner = [k for k in range(len(q)) if k not in given]
    eliminated = _eliminated(unit, of, stiff, inner) if reduced else {}
    free = [k for k in inner if k not in eliminated]
    tense = [k for k, one in enumerate(stiff) if one]
    z, h = ca.SX.sym("z", len(free) + len(tense)), ca.SX.sym("h", len(given))
    count, members = len(of.constants), len(unit.members)
    p = ca.SX.sym("p", count + 4 * members)
    start, ease, active, number = (p[count + k * members : count + (k + 1) * members]
                                   for k in range(4))  # fmt: skip
    coordinates = [ca.SX.sym(x, len(q)) for x in "usv"]
    *each, (whole, balance) = _by_coordinates(of, coordinates, p[:count])
    squares, tensions, compatible = balance**2, [], []
    unit_force = 2.0 ** round(math.log2(softest))
    for k, (e, slope) in enumerate(each):
        own = e, start[k], ease[k], active[k]
        if stiff[k]:
            y = z[len(free) + tense.index(k)]
            energy, pull, tension, longer = _stiff(*own, y, unit_force)
            compatible += [number[k] * longer] * (k not in eliminated.values())
        else:
            energy, pull, tension = _soft(*own)
        tensions.append(tension)
        whole += number[k] * energy
        pull = number[k] * active[k] * pull * slope
        balance += pull
        squares += pull**2
    moved = {k: (z[j], reduced and of.angles[k]) for j, k in enumerate(free)}
    moved |= {k: (ease[j] * z[len(free) + tense.index(j)], False) for k, j in eliminated.items()}
    moved |= {k: (h[j], False) for j, k in enumerate(given)}
    forces, sizes = ([x[k] for k in inner] for x in (balance, ca.sqrt(squares)))
    parts = [whole, ca.vertcat(*forces, *compatible), ca.vertcat(*(-balance[k] for k in given)),
             ca.vertcat(*sizes), ca.vertcat(*tensions), coordinates[0]]  # fmt: skip
    made = ca.substitute(parts, coordinates, _moved(moved))
    return Mixed(*(z, h, p, *made, stiff, tuple(free), tuple(eliminated.values())))


def _by_coordinates(of: Changes, coordinates: Sequence[Any], constants: Any) -> list[Any]:
    """Change of the length of each member, and last of the further energy, each with derivatives by
    the coordinates, the changes of which are given with sines and versines."""
    import casadi as ca

    u, s, v = coordinates
    rests, forms = zip(*of.lengths, strict=True) if of.lengths else ((), ())
    symbols = (*of.unknowns, *of.sines, *of.versines, *of.constants)
    flat = [x for part in (*coordinates, constants) for x in ca.vertsplit(part)]
    found = [ca.SX(x) for x in to_casadi([*rests, 0, *forms, of.energy], symbols)(*flat)]
    each = []
    for squared, rest, form in zip((*rests, 0), found, found[len(rests) + 1 :], strict=False):
        slope = ca.gradient(form, u) + (1 - v) * ca.gradient(form, s) + s * ca.gradient(form, v)
        if squared != 0:
            length = ca.sqrt(rest**2 + form)
            form, slope = form / (rest + length), slope / (2 * length)
        each.append((form, slope))
    return each


def _soft(e: Any, start: Any, ease: Any, active: Any) -> tuple[Any, ...]:
    """Energy of a member that is longer by e, tension that pulls and that is shown; where it does
    not act it is slack."""
    tension = start + ease * e
    own = active * (start * e + ease * e**2 / 2)
    return own - (1 - active) * start**2 / (2 * ease), tension, tension


def _stiff(e: Any, start: Any, ease: Any, active: Any, y: Any, unit: Any) -> tuple[Any, ...]:
    """The same of a member whose tension has changed by y, in its compliance; and by how much it is
    too long, which vanishes."""
    tension, slack = start + y, 1 - active
    own = active * (tension * e - ease * y**2 / 2)
    own -= slack * (tension**2 + ease * start**2) / 2
    shown = active * tension + slack * (ease * start + e) * unit
    return own, tension, shown, active * (e - ease * y) - slack * tension


def _eliminated(
    unit: Described, of: Changes, stiff: Sequence[bool], inner: Sequence[int]
) -> dict[int, int]:
    """Coordinates that are the lengths of stiff members, and the numbers of these."""
    lengths = [form for _, form in of.lengths]
    found = {}
    for k in inner:
        same = [j for j, one in enumerate(unit.members)
                if stiff[j] and lengths[j] == of.unknowns[k] and not one.string]  # fmt: skip
        if same and not of.angles[k]:
            found[k] = same[0]
    return found


def _moved(moved: dict[int, tuple[Any, bool]]) -> list[Any]:
    """Changes of coordinates, their sines and versines; of some by the tangents of half."""
    import casadi as ca

    each = []
    for _, (x, half_turn) in sorted(moved.items()):
        square = 1 + x**2
        each.append((2 * ca.atan(x), 2 * x / square, 2 * x**2 / square) if half_turn else
                    (x, ca.sin(x), 2 * ca.sin(x / 2) ** 2))  # fmt: skip
    return [ca.vertcat(*one) for one in zip(*each, strict=True)]


@once
def exact_numbers(unit: Described, taut: tuple[bool, ...] | None = None) -> list[Any]:
    """Parameters of `mixed`, of type mpf: the constants, then of the members tension at rest,
    spring constant (of stiff ones compliance), whether they act, and number.

    Parameters
    ----------
    unit : Unit
    taut : tuple of bool, (members,), optional
        Which members act; by default all.
    """
    import mpmath

    of, rest = changes(unit), at_rest.at_rest(unit)
    found = at_rest.values(unit, [*of.values, *(m.count for m in unit.members)])
    constants, count = found[: len(of.values)], found[len(of.values) :]
    with mpmath.workdps(at_rest.DIGITS):
        each = zip(is_stiff(unit), rest.stiffness, strict=True)
        ease = [1 / k if stiff else k for stiff, k in each]
        active = [mpmath.mpf(one) for one in (taut or (True,) * len(count))]
    return [*constants, *rest.tensions, *ease, *active, *count]


@once
def numbers(unit: Described, taut: tuple[bool, ...] | None = None) -> Any:
    """Parameters of `mixed`, as `exact_numbers`, (parameters,), read-only."""
    import numpy as np

    return as_fixed(np.array([float(x) for x in exact_numbers(unit, taut)]))
