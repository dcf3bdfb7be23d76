"""The law of a bond, in SymPy and in CasADi.

A `Law` is a scalar energy of one elongation with named parameters, which CasADi differentiates
(unless the law has its own form of the tension).  A law may also be defined by CasADi expressions:
it needs a hash, `parameters`, `forms()`, and `compiled` as in `Law`.  Code generated from a law
with a `name`, which identifies it in all processes, is cached: see `tensegrity.engine.disk_cache`.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from tensegrity.engine import simd
from tensegrity.engine.disk_cache import cached, maker
from tensegrity.errors import TensegrityError
from tensegrity.once import once, undisturbed

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import sympy as sp

DERIVATIVES = ("energy", "tension", "stiffness", "slope")
LEAST = 1e-10  # relative error of the constants of a law, of which a jump may be the round-off


@dataclass(frozen=True)
class Law:
    """Energy V(r; parameters) of a bond, and optionally a better form of its tension.

    Attributes
    ----------
    energy : sympy.Expr
        Energy [J] as a function of `elongation` [m] and `parameters`.
    elongation : sympy.Symbol
    parameters : tuple of sympy.Symbol
        Their values are given at run time, so that one compiled kernel serves all springs.
    tension : sympy.Expr, optional
        A form of dV/dr [N] preferred to automatic differentiation of the energy.
    through : tuple of (symbol, value, derivative), optional
        Intermediate quantities through which `tension` depends on the elongation, each with its
        value and a form of its derivative preferred to automatic differentiation.
    general : Law, optional
        The law of the same parameters for which this one is compiled at a value of one of them:
        it is differentiated by that one.
    """

    energy: sp.Expr
    elongation: sp.Symbol
    parameters: tuple[sp.Symbol, ...] = ()
    tension: sp.Expr | None = None
    through: tuple[tuple[sp.Symbol, sp.Expr, sp.Expr], ...] = ()
    general: Any = None
    compiled = DERIVATIVES  # derivatives that are compiled outside the loop
    is_expression = True  # whether `energy` says all, and may be put to other uses
    name = ""  # identifies the law in other processes, if not empty

    def forms(self) -> tuple[Any, Any, Sequence[Any]]:
        """The law in CasADi.

        Returns
        -------
        r, p : casadi.SX
            Symbols of the elongation and of all parameters, (parameters,).
        forms : tuple of casadi.SX
            Energy, tension, stiffness, slope, each the derivative of the one before it.
        """
        import casadi as ca

        r, p = ca.SX.sym("r"), ca.SX.sym("p", len(self.parameters))
        symbols = (self.elongation, *self.parameters)
        values = (r, *ca.vertsplit(p)) if self.parameters else (r,)
        passed = [symbol for symbol, _, _ in self.through]
        y = ca.SX.sym("y", len(passed))

        def sx(expression):
            known = (*values, *ca.vertsplit(y)) if passed else values
            return ca.SX(to_casadi(expression, (*symbols, *passed))(*known))

        y_of_r = ca.vertcat(*(sx(value) for _, value, _ in self.through))
        y_rate = ca.vertcat(*(sx(rate) for _, _, rate in self.through))

        def rate(value):
            along = ca.dot(ca.gradient(value, y), y_rate) if passed else 0
            return ca.gradient(value, r) + along

        energy = sx(self.energy)
        tension = rate(energy) if self.tension is None else sx(self.tension)
        stiffness = rate(tension)
        forms = (energy, tension, stiffness, rate(stiffness))
        return r, p, [ca.substitute(form, y, y_of_r) if passed else form for form in forms]


class DerivedLaw(Law):
    """A law that a function of this package derives when its expressions are needed.

    Parameters
    ----------
    make : callable
        A function of a module that returns a `Law`.
    *arguments
        Its arguments, texts and numbers, on which alone the law depends.
    """

    def __init__(self, make: Callable[..., Law], *arguments: Any) -> None:
        self.__dict__.update(make=make, arguments=arguments)
        self.__dict__["name"] = maker(make, *arguments)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, DerivedLaw) and self.name == other.name

    def __hash__(self) -> int:
        return hash(self.name)

    def __repr__(self) -> str:
        return f"DerivedLaw({self.name.rpartition(' ')[0]})"

    def forms(self) -> tuple[Any, Any, Sequence[Any]]:
        """The law in CasADi; see `Law.forms`."""
        return _derived(self).forms()


@once
def _derived(law):
    return law.make(*law.arguments)


def _derived_property(name):
    return property(lambda self: getattr(_derived(self), name))


for _field in fields(Law):
    setattr(DerivedLaw, _field.name, _derived_property(_field.name))
DerivedLaw.parameters = property(lambda self: tuple(law_properties(self)["parameters"]))  # type: ignore


def named(what: str, laws: Sequence[Any], *more: Any) -> tuple[Any, ...] | None:
    """Key for `disk_cache.cached` of a value computed from laws.

    Parameters
    ----------
    what : str
        Kind of value.
    laws : sequence of Law
    *more
        Further values on which it depends.

    Returns
    -------
    tuple, or None where a law has no name
    """
    names = tuple(getattr(law, "name", "") for law in laws)
    return (what, names, *more) if all(names) else None


def to_casadi(expression: Any, symbols: Sequence[Any]) -> Callable[..., Any]:
    """A SymPy expression, or a list of them, as a function of CasADi SX symbols.

    Common subexpressions are computed once.  The order of terms depends on that of
    `symbols` only, not on what SymPy has done before in the process.
    """
    import casadi as ca
    import sympy as sp

    choose, signum = (sp.Function(name, real=True) for name in ("choose", "signum"))

    def branches(*pairs):
        result = sp.Integer(0)
        for value, condition in reversed(pairs):
            result = value if condition == True else choose(condition, value, result)  # noqa: E712
        return result

    own = [sp.Dummy(f"x{k}") for k in range(len(symbols))]  # a symbol may be called exp
    # terms are sorted by the names that are printed, which of a dummy is a running number
    last_first = sorted(own, key=lambda one: one.name, reverse=True)
    printed = {one: sp.Symbol(f"given_{k:04d}") for k, one in enumerate(last_first)}
    renamed = dict(zip(symbols, own, strict=True))

    def is_one_sided_power(one):
        return one.is_Pow and isinstance(one.base, sp.Max) and 0 in one.base.args

    def one_sided_power(one):  # derivatives of a power of a maximum are 0 times inf at 0
        inside, *others = (x for x in one.base.args if x != 0)
        if one.exp.is_integer or others:
            return one
        return sp.Piecewise((inside**one.exp, inside > 0), (0, True))

    def prepared(one):
        one = sp.sympify(one).replace(is_one_sided_power, one_sided_power)
        return one.replace(sp.Piecewise, branches).replace(sp.sign, signum).xreplace(renamed)

    names = {
        "Max": lambda *x: ca.fmax(*x),
        "Min": lambda *x: ca.fmin(*x),
        "Abs": ca.fabs,
        "Heaviside": lambda x, *_: x > 0,
        "ln": ca.log,
        "choose": ca.if_else,
        "signum": ca.sign,
    }
    several = isinstance(expression, (list, tuple))
    shared, forms = sp.cse([prepared(one) for one in (expression if several else [expression])])
    shared = [(symbol, form.xreplace(printed)) for symbol, form in shared]
    forms = [form.xreplace(printed) for form in forms]
    return sp.lambdify(
        [printed[one] for one in own],
        forms if several else forms[0],
        modules=[names, ca],
        cse=lambda given: (shared, given),
    )


def horner(coefficients, t):
    """Value at t of the polynomial with these coefficients, the constant first."""
    value = coefficients[-1]
    for coefficient in coefficients[-2::-1]:
        value = value * t + coefficient
    return value


def deflated(coefficients, root):
    """Coefficients of (P(t) - P(root))/(t - root), for those of P(t), the constant first."""
    quotient = [coefficients[-1]]
    for coefficient in coefficients[-2:0:-1]:
        quotient.append(coefficient + root * quotient[-1])
    return quotient[::-1]


def check_law(law: Law) -> None:
    """Refuse a law that cannot be translated, saying why."""
    import sympy as sp

    for constant in (sp.nan, sp.oo, -sp.oo, sp.zoo, sp.I):
        if law.energy.has(constant):
            raise TensegrityError(f"energy {law.energy} contains {constant}")
    try:
        functions(law)
    except Exception as error:  # SymPy's printer and CasADi raise many kinds of errors
        raise TensegrityError(f"energy {law.energy} cannot be translated: {error}") from error


def is_piecewise(expression: Any) -> bool:
    """Whether a SymPy expression is defined piecewise, so that derivatives may jump."""
    import sympy as sp

    return expression.has(sp.Max, sp.Min, sp.Abs, sp.Heaviside, sp.Piecewise, sp.sign)


@once
def error_of(expression: Any) -> Any:
    """Error of an expression by errors of the constants and symbols in it, relative to those."""
    import sympy as sp

    if expression.is_Integer or not expression.args:
        return sp.Integer(0) if expression.is_Integer else sp.Abs(expression)
    if isinstance(expression, sp.Piecewise):
        return sp.Add(*(error_of(piece) for piece, _ in expression.args))
    power = expression.exp if expression.is_Pow else None
    certain = {x for x in expression.args if x.is_Integer or (x == power and x.is_number)}
    parts = [x if x in certain else sp.Dummy() for x in expression.args]
    back, whole = dict(zip(parts, expression.args, strict=True)), expression.func(*parts)
    errors = [sp.Abs(whole.diff(x).xreplace(back)) * error_of(back[x]) for x in back if x.is_Dummy]
    return sp.Add(*errors)


@once
def functions(law: Any) -> Any:
    """CasADi functions of a law.

    Returns
    -------
    dict of casadi.Function
        "energy", "tension", "stiffness", "slope": (r, parameters) -> value, each the
        derivative of the one before it.
    """
    import casadi as ca

    with undisturbed():
        r, p, forms = law.forms()
        return {
            name: ca.Function(name, [r, p], [form])
            for name, form in zip(DERIVATIVES, forms, strict=True)
        }


def evaluate(law, order, parameters, r):
    """A derivative of the energy of a law, evaluated by CasADi.

    Parameters
    ----------
    law : Law
    order : int
        Order of the derivative, 0 to 3.
    parameters, r : ndarray
        As of `Compiled.evaluate`.

    Returns
    -------
    ndarray, shape of r
    """
    if not r.size:
        return np.zeros(r.shape)
    function = functions(law)[DERIVATIVES[order]]
    p = np.asarray(parameters, dtype=float)[: len(law.parameters)]
    if p.ndim == 2:
        p = np.tile(p, r.size // r.shape[-1])
    with undisturbed():
        values = np.array(function(r.reshape(1, -1), p.reshape(len(p), -1 if p.size else 1)))
    return values.reshape(r.shape)


@once
def law_properties(law: Any) -> dict[str, Any]:
    """Properties of a law.

    Returns
    -------
    dict
        "parameters", their names; "cost", an estimate of the time of a tension in a compiled loop
        [s], from a count of operations; "instructions", their number; "cut", whether the law has
        kinks; "packed" and "packed_energy", whether SIMD code makes tension and energy faster.
    """
    return cached(named("facts", (law,)), lambda: _law_properties(law))


def _law_properties(law):
    import casadi as ca

    slow = {ca.OP_SQRT: 16, ca.OP_DIV: 8, ca.OP_INV: 8}
    slow |= {ca.OP_SIN: 20, ca.OP_COS: 20}
    slow |= dict.fromkeys((ca.OP_EXP, ca.OP_LOG, ca.OP_POW), 150)
    kinked = {
        ca.OP_FMAX,
        ca.OP_FMIN,
        ca.OP_FABS,
        ca.OP_SIGN,
        ca.OP_LT,
        ca.OP_LE,
        ca.OP_IF_ELSE_ZERO,
    }
    tension = functions(law)["tension"]
    done = [tension.instruction_id(k) for k in range(tension.n_instructions())]
    return {
        "parameters": [str(parameter) for parameter in _resolved(law).parameters],
        "cost": 4e-11 * sum(slow.get(one, 1) for one in done),
        "cut": any(one in kinked for one in done),
        "instructions": tension.n_instructions(),
        "packed": simd.benefits_from_simd(tension),
        "packed_energy": "energy" in law.compiled
        and simd.benefits_from_simd(functions(law)["energy"]),
    }


def _resolved(law):
    return _derived(law) if isinstance(law, DerivedLaw) else law


@dataclass(frozen=True)
class Change:
    """The time derivative of a law's energy at constant elongation, as a law.

    Attributes
    ----------
    law : Law
        Its parameters and their rates are the parameters of the change.
    moving : tuple of int, optional
        Indices of the parameters whose rates are not 0; by default all.
    """

    law: Law
    moving: tuple[int, ...] | None = None
    compiled = ("energy",)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the parameters of the law, then of their rates."""
        return tuple(f"{kind}{k}" for kind in "pq" for k in range(len(self.law.parameters)))

    @property
    def name(self) -> str:
        """Identifies the change in other processes, if not empty."""
        name = getattr(self.law, "name", "")
        return f"change with {self.moving} of {name}" if name else ""

    def forms(self) -> tuple[Any, Any, Sequence[Any]]:
        """The change in CasADi, by automatic differentiation; see `Law.forms`."""
        import casadi as ca

        r, p, forms = self.law.forms()
        rates = ca.SX.sym("rates", p.numel())
        moving = range(p.numel()) if self.moving is None else self.moving
        along = ca.vertcat(*(rates[k] if k in moving else 0 for k in range(p.numel())))
        changes = [ca.jtimes(form, p, along) for form in forms]
        return r, ca.vertcat(p, rates), changes

    def both(self) -> Any:
        """CasADi function (r, parameters) -> tension of the law, rate of its energy."""
        import casadi as ca

        tension = functions(self.law)["tension"]
        change = functions(self)["energy"]
        r, p = ca.SX.sym("r"), ca.SX.sym("p", len(self.parameters))
        return ca.Function("both", [r, p], [tension(r, p[: p.numel() // 2]), change(r, p)])


def interpret(function, inputs, apply):
    """Evaluate the instructions of an SX function with other values and operations.

    Parameters
    ----------
    function : casadi.Function
        A function of one output, made of SX.
    inputs : sequence of sequences
        Values of the entries of each input.
    apply : callable (operation, *values) -> value
        Does an operation, such as `applied`.

    Returns
    -------
    list
        Values of the entries of the output.
    """
    import casadi as ca

    work, results = {}, {}
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        source, target = function.instruction_input(k), function.instruction_output(k)
        if operation == ca.OP_CONST:
            work[target[0]] = ca.SX(function.instruction_constant(k))
        elif operation == ca.OP_INPUT:
            work[target[0]] = inputs[source[0]][source[1]]
        elif operation == ca.OP_OUTPUT:
            results[target[1]] = work[source[0]]
        else:
            work[target[0]] = apply(operation, *(work[i] for i in source))
    return [results.get(k, ca.SX(0)) for k in range(function.nnz_out(0))]


def applied(operation, value, *other):
    """The result of an operation of CasADi, by its number."""
    return (value.binary if other else value.unary)(operation, value, *other)
