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
from dataclasses import dataclass
from typing import Any

from tensegrity.engine.law import to_casadi
from tensegrity.once import once
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
    elongations : tuple of sympy.Expr, (members,)
    energy : sympy.Expr
    constants, values : tuple of sympy.Symbol, of sympy.Expr
        Symbols of numbers, and these numbers in the coordinates at rest and parameters.
    """

    unknowns: tuple[Any, ...]
    sines: tuple[Any, ...]
    versines: tuple[Any, ...]
    angles: tuple[bool, ...]
    elongations: tuple[Any, ...]
    energy: Any
    constants: tuple[Any, ...]
    values: tuple[Any, ...]


@once
def changes(unit: Described) -> Changes:
    """The changes of a unit; see `Changes`."""
    of = _Expansion(unit.coordinates)
    elongations = tuple(of.length(member.length) for member in unit.members)
    energy = of.polynomial(unit.energy)
    energy = of.difference(unit.energy) if energy is None else energy
    numbers, values = tuple(of.constants.values()), tuple(of.constants)
    return Changes(of.u, of.s, of.v, tuple(of.angles), elongations, energy, numbers, values)


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

    def length(self, length: Any) -> Any:
        """The change of a length."""
        import sympy as sp

        plain = self.polynomial(length)
        squared = self.polynomial(length**2) if plain is None else None
        if squared is None:
            return self.difference(length) if plain is None else plain
        rest = self.constant(length)
        return squared / (rest + sp.sqrt(rest**2 + squared))

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
        terms = ((power, self.constant(x)) for power, x in powers.items() if x != 0)
        return sp.Add(*(x * power for power, x in terms))

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
        Unknowns: changes of the free coordinates, then of the tensions of stiff members; changes of
        the controlled coordinates; parameters.
    energy : casadi.SX
        W.
    sizes : casadi.SX, shape of z
        Magnitude of the terms of each equation dW/dz.
    tensions : casadi.SX, (members,)
        Of one of each; of a slack string what has its sign, were it taut.
    changes : casadi.SX, (coordinates,)
        Of the unit's coordinates, in their order.
    stiff : tuple of bool, (members,)
    """

    z: Any
    h: Any
    p: Any
    energy: Any
    sizes: Any
    tensions: Any
    changes: Any
    stiff: tuple[bool, ...]

    @property
    def equations(self) -> Any:
        """dW/dz."""
        import casadi as ca

        return ca.gradient(self.energy, self.z)

    @property
    def loads(self) -> Any:
        """-dW/dh, compression > 0."""
        import casadi as ca

        return -ca.gradient(self.energy, self.h)


def is_stiff(unit: Described) -> tuple[bool, ...]:
    """Whether the tension of each of the members is an unknown."""
    k = [float(x) for x in at_rest.at_rest(unit).stiffness]
    least = min(k, default=1.0)
    return tuple(x == float("inf") or x >= STIFF * least for x in k)


@once
def mixed(unit: Described, controls: tuple[Any, ...], half_turns: bool = False) -> Mixed:
    """The mixed energy of a unit.

    Parameters
    ----------
    unit : Unit
    controls : tuple of sympy.Symbol
        The coordinates that are given.
    half_turns : bool, optional
        Whether the unknowns of angles are tangents of half their changes, so that sines and cosines
        are algebraic.

    Returns
    -------
    Mixed
        Its parameters are those of `numbers`.
    """
    import casadi as ca

    of, stiff, q = changes(unit), is_stiff(unit), unit.coordinates
    free = [k for k, x in enumerate(q) if x not in controls]
    z = ca.SX.sym("z", len(free) + sum(stiff))
    h, moved = ca.SX.sym("h", len(controls)), ca.SX.zeros(len(q))
    count, members = len(of.constants), len(unit.members)
    p = ca.SX.sym("p", count + 4 * members)
    start, ease, active, number = (p[count + k * members : count + (k + 1) * members]
                                   for k in range(4))  # fmt: skip
    sines, versines = ca.SX.zeros(len(q)), ca.SX.zeros(len(q))
    for place, k in enumerate(free):
        turned = half_turns and of.angles[k]
        moved[k] = 2 * ca.atan(z[place]) if turned else z[place]
        square = 1 + z[place] ** 2
        sines[k] = 2 * z[place] / square if turned else ca.sin(z[place])
        versines[k] = 2 * z[place] ** 2 / square if turned else 2 * ca.sin(z[place] / 2) ** 2
    for place, x in enumerate(controls):
        k = q.index(x)
        moved[k], sines[k], versines[k] = h[place], ca.sin(h[place]), 2 * ca.sin(h[place] / 2) ** 2
    symbols = (*of.unknowns, *of.sines, *of.versines, *of.constants)
    given = [*map(ca.vertsplit, (moved, sines, versines, p[:count]))]
    flat = [x for part in given for x in part]
    found = to_casadi([*of.elongations, of.energy], symbols)(*flat) if flat else []
    *elongations, energy = (ca.SX(x) for x in found)
    whole, tensions, place = energy, [], len(free)
    soft = [float(k) for k in at_rest.at_rest(unit).stiffness if k < float("inf")]
    unit_force = 2.0 ** round(math.log2(min(soft, default=1.0)))
    squares = ca.gradient(energy, z[: len(free)]) ** 2 if free else ca.SX.zeros(0)
    for k, e in enumerate(elongations):
        if stiff[k]:
            y, taut, slack = z[place], active[k], 1 - active[k]
            place += 1
            tension = start[k] + y
            own = tension * e - ease[k] * y**2 / 2
            own = taut * own - slack * (tension**2 + ease[k] * start[k] ** 2) / 2
            tension = taut * tension + slack * (ease[k] * start[k] + e) * unit_force
        else:
            tension = start[k] + ease[k] * e
            own = active[k] * (start[k] * e + ease[k] * e**2 / 2)
            own -= (1 - active[k]) * start[k] ** 2 / (2 * ease[k])
        tensions.append(tension)
        whole += number[k] * own
        if free:
            pull = number[k] * active[k] * tension * ca.gradient(e, z[: len(free)])
            squares += pull**2
    sizes = ca.sqrt(squares)
    return Mixed(z, h, p, whole, sizes, ca.vertcat(*tensions), moved, stiff)


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


def numbers(unit: Described, taut: tuple[bool, ...] | None = None) -> Any:
    """Parameters of `mixed`, as `exact_numbers`, (parameters,)."""
    import numpy as np

    return np.array([float(x) for x in exact_numbers(unit, taut)])
