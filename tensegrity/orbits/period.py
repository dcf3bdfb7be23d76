"""Periods of drives: the common period of all functions of time in a scene, from the angular
frequencies of their sines and cosines."""

from __future__ import annotations

import math
from collections.abc import Mapping
from fractions import Fraction
from typing import Any

import numpy as np

from tensegrity.errors import TensegrityError
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.forcing import time_signals
from tensegrity.scenes.scene import Scene

MULTIPLES = 1000  # largest ratio of a common period to one of its parts
FIT = 1e-9  # relative, of periods that are whole multiples of each other
SHORTER = 12  # parts of a common period that are tried as periods
SAMPLES = 64  # instants of that trial


class _Rate:
    """An angular frequency, of symbols with these names."""

    def __init__(self, expression: Any) -> None:
        import sympy as sp

        symbols = sorted(expression.free_symbols, key=str)
        self.names = [str(one) for one in symbols]
        forms = [expression, *(expression.diff(one) for one in symbols)]
        self._forms = sp.lambdify(symbols, forms, "math")

    def values(self, given: Mapping[str, float]) -> list[float]:
        """Of the frequency [rad/s] and of its derivatives by all symbols."""
        return [float(x) for x in self._forms(*(given[name] for name in self.names))]


class DrivePeriod:
    """The shortest common period of all drives and forces of a scene.

    Parameters
    ----------
    scene : Scene

    Attributes
    ----------
    value : float
        [s]

    Raises
    ------
    TensegrityError
        No function of time, one without a period, or several whose periods do not fit together.
    """

    def __init__(self, scene: Scene) -> None:
        rates: list[tuple[str, _Rate, dict[str, float]]] = []
        signals = time_signals(scene)
        for signal in signals:
            rates += [(str(signal), _Rate(x), given) for x, given in _angular_rates(signal)]
        forces = [one for one in dynamics(scene).further_forces if not one.stores]
        for force in forces:
            rates += [(str(force.expression), _Rate(x), given) for x, given in _of_force(force)]
        if not rates:
            raise TensegrityError(
                "the scene has no periodic drive: only the state at rest is periodic"
            )
        self._rates = rates
        idle = [name for number, (name, _, _) in enumerate(rates) if not self._at(number, {})]
        if idle:
            raise TensegrityError(f"drive {idle[0]} has no period: its angular frequency is 0")
        name, first = rates[0][0], self._at(0, {})
        common = 1
        for number, (other, _, _) in enumerate(rates):
            ratio = abs(self._at(number, {}) / first)
            part = Fraction(ratio).limit_denominator(MULTIPLES)
            if not part or abs(float(part) / ratio - 1) > FIT:
                raise TensegrityError(
                    f"periods of the drives do not fit: {name} repeats after "
                    f"{2 * math.pi / abs(first):.9g} s, {other} after "
                    f"{2 * math.pi / abs(self._at(number, {})):.9g} s"
                )
            common = math.lcm(common, part.denominator)
        value = 2 * math.pi * common / abs(first)
        if not forces:
            value /= max(k for k in range(1, SHORTER + 1) if _repeats(signals, value / k))
        self.value: float = value

    def _at(self, number: int, values: Mapping[str, float]) -> float:
        """An angular frequency [rad/s] at other values of parameters."""
        _, rate, given = self._rates[number]
        return rate.values({**given, **values})[0]

    def factor(self, parameter: str, value: float) -> tuple[float, float]:
        """The period with another value of a parameter of the drives over the original one, and its
        derivative with respect to the parameter.

        Raises
        ------
        TensegrityError
            A parameter that changes the ratio of periods.
        """
        slopes, at = [], {parameter: value}
        for _, rate, given in self._rates:
            here, *by = rate.values(given | at)
            slopes.append(-dict(zip(rate.names, by, strict=True)).get(parameter, 0.0) / here)
        if max(slopes) - min(slopes) > FIT * max(map(abs, slopes)):
            raise TensegrityError(
                f"parameter {parameter} changes the ratio of the periods of the drives: nothing "
                "repeats at other values"
            )
        factor = self._at(0, {}) / self._at(0, at)
        return factor, factor * slopes[0]

    def factor_to(self, parameter: str, value: float) -> float:
        """As `factor`, without the derivative, for the end of a path.

        Raises
        ------
        TensegrityError
            On the way there an angular frequency becomes 0: a drive has no period.
        """
        for number, (name, *_) in enumerate(self._rates):
            rate = self._at(number, {parameter: value})
            if not rate * self._at(number, {}) > 0:
                raise TensegrityError(
                    f"drive {name} has no period on the way to {parameter} {value:g}: its angular "
                    f"frequency, {rate:g} rad/s there, becomes 0"
                )
        return self.factor(parameter, value)[0]


def fitting(period: float, shortest: float) -> float:
    """The whole multiple of the drives' period that equals a given period [s], to 1e-9."""
    times = round(period / shortest)
    if times < 1 or abs(period / (times * shortest) - 1) > FIT:
        raise TensegrityError(
            f"period {period:.12g} s must be a whole multiple of the drives' period, "
            f"{shortest:.12g} s, to {FIT:g}"
        )
    return times * shortest


def _repeats(signals: list[Any], period: float) -> bool:
    t = period * np.linspace(0, 1, SAMPLES, endpoint=False) ** 1.5
    for signal in signals:
        now, later = (signal(x, 0) for x in (t, t + period))
        if np.abs(later - now).max() > FIT * max(np.abs(now).max(), 1e-300):
            return False
    return True


def _angular_rates(signal: Any) -> list[tuple[Any, dict[str, float]]]:
    """Angular frequencies in a function of time, each with the values of its symbols."""
    expression = getattr(signal, "expression", None)
    if expression is None:
        raise TensegrityError(f"{signal.name}: {signal} have no period, give an expression of t")
    rates = _rates_in(expression, signal.parameters, str(signal))
    return [(rate, signal.parameters) for rate in rates]


def _of_force(force: Any) -> list[tuple[Any, dict[str, float]]]:
    expressions = force.expression if isinstance(force.expression, tuple) else (force.expression,)
    terms: list[tuple[Any, dict[str, float]]] = []
    for expression in expressions:
        for rate in _rates_in(expression, force.parameters, str(expression)):
            names = {str(s) for s in rate.free_symbols}
            some = {k: np.atleast_1d(x) for k, x in force.parameters.items() if k in names}
            places = max((len(x) for x in some.values()), default=1)
            each = ({k: float(x[i % len(x)]) for k, x in some.items()} for i in range(places))
            terms += [(rate.subs(values), {}) for values in each]
    return terms


def _rates_in(expression: Any, parameters: Any, words: str) -> list[Any]:
    import sympy as sp
    from sympy.functions.elementary.trigonometric import TrigonometricFunction

    (t,) = [s for s in expression.free_symbols if str(s) == "t"] or [sp.Symbol("t")]
    rates: list[Any] = []
    while True:
        inner = [
            one for one in expression.atoms(TrigonometricFunction)
            if one.has(t) and not one.args[0].diff(t).has(t)
        ]  # fmt: skip
        if not inner:
            break
        rates += [one.args[0].diff(t) for one in inner]
        expression = expression.xreplace({one: sp.Dummy() for one in inner})
    other = {str(s) for one in rates for s in one.free_symbols} - {*parameters}
    if expression.has(t) or other:
        raise TensegrityError(f"drive {words} has no period: it is no function of sines of t")
    return sorted(set(rates), key=str)
