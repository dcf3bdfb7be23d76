"""Evaluation of SymPy expressions in NumPy or in multiple precision, without SymPy.

An expression becomes a program: a list of operations, each on results of earlier ones.  A program
is data that can be stored in a file, and consists of the operations listed here only.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from functools import reduce
from typing import Any

from tensegrity.engine.disk_cache import cached, maker
from tensegrity.once import once

SUMS = {"Add": operator.add, "Mul": operator.mul}
FUNCTIONS = ("sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "exp", "log")
CHOICES = {
    "Max": "maximum",
    "Min": "minimum",
    "Abs": "absolute",
    "Heaviside": "heaviside",
}  # NumPy's
CONSTANTS = {"Pi": "pi"}


def program(expressions: Sequence[Any], symbols: Sequence[Any]) -> dict[str, list[Any]]:
    """Operations for SymPy expressions of some symbols; common subexpressions are computed once.

    Returns
    -------
    dict
        "steps", each ["Given", index in symbols], ["Ratio", p, q] or [operation, steps...], and
        "results", the numbers of the steps that give the expressions.
    """
    import sympy as sp

    steps: list[list[Any]] = []
    known: dict[Any, int] = {}

    def put(*step):
        steps.append(list(step))
        return len(steps) - 1

    def written(e):
        kind = type(e).__name__
        if e in symbols:
            return put("Given", list(symbols).index(e))
        if e.is_Rational or e.is_Float:
            ratio = sp.Rational(e)
            return put("Ratio", int(ratio.p), int(ratio.q))
        if kind in CONSTANTS:
            return put(kind)
        if e.is_Pow and abs(e.exp) == sp.Rational(1, 2):
            root = put("sqrt", place(e.base))
            return root if e.exp > 0 else put("Pow", root, place(sp.Integer(-1)))
        if kind in (*SUMS, "Pow", *FUNCTIONS, *CHOICES):
            return put(kind, *map(place, e.args))
        raise TypeError(f"{kind} in {e} is no operation of a program")

    def place(e):
        if e not in known:
            known[e] = written(e)
        return known[e]

    return {"results": [place(sp.sympify(e)) for e in expressions], "steps": steps}


def run(program: dict[str, list[Any]], context: Any, values: Sequence[Any]) -> list[Any]:
    """Evaluate a program.

    Parameters
    ----------
    program : dict
        Result of the function `program`.
    context : mpmath.MPContext, proofs.balls.Balls, or the module numpy
        Its functions and, but of NumPy, its numbers are used.
    values : sequence of mpf, of balls, or of float or ndarray
        Values of the symbols.

    Returns
    -------
    list
        Values of the expressions.

    Raises
    ------
    ValueError
        An operation that is not listed here.
    """
    number, raised = getattr(context, "mpf", float), getattr(context, "raised", operator.pow)
    results: list[Any] = []
    for name, *numbers in program["steps"]:
        if name == "Given":
            value = values[numbers[0]]
        elif name == "Ratio":
            value = number(numbers[0]) / numbers[1]
        elif name in CONSTANTS:
            value = +getattr(context, CONSTANTS[name])
        elif name in SUMS:
            value = reduce(SUMS[name], (results[i] for i in numbers))
        elif name == "Pow":
            base, power = (results[i] for i in numbers)
            power = int(power) if power == int(power) else power
            value = 1 / base if power == -1 else raised(base, power)  # a float's may overflow
        elif name in FUNCTIONS or name in CHOICES:
            value = getattr(context, CHOICES.get(name, name))(*(results[i] for i in numbers))
        else:
            raise ValueError(f"{name} is no operation of a program")
        results.append(value)
    return [results[i] for i in program["results"]]


@once
def derived(make: Callable[..., tuple[Sequence[Any], Sequence[Any]]], *arguments: Any) -> Any:
    """The program of (expressions, symbols) that a function of a module derives, cached on disk.

    Its arguments are texts, numbers, and functions of that module.
    """
    return cached(("program", maker(make, *arguments)), lambda: program(*make(*arguments)))
