"""Functions of time given by the user: expressions and interpolated samples, with the check that
they are finite and continuous over a run."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from tensegrity import check
from tensegrity.engine.law import is_piecewise
from tensegrity.errors import TensegrityError
from tensegrity.once import once
from tensegrity.readonly import FixedDict, fixed
from tensegrity.typing import Array, Sampled

INTERVALS = 4096  # intervals of a run that are searched for a jump
CANDIDATES = 8  # intervals of largest change that are bisected
HALVINGS = 40  # bisections of each
JUMP = 1e-4  # change left in the smallest interval, over the largest change, that counts as a jump
KINK_ORDER = 2.0  # order of any method where the rate of a signal jumps
RTOL = 1e-9  # relative tolerance on initial values and on the end of samples


class Expression:
    """A SymPy expression of t and of parameters as a function of time [s].

    `order_limit` is the highest order of any method with this signal; a kink of the expression
    reduces it.
    """

    knots: ClassVar[Array] = np.zeros(0)

    def __init__(self, name: str, expression: Any, parameters: Mapping[str, float]) -> None:
        self.name, self.expression, self.parameters = name, expression, dict(parameters)
        _functions(expression, tuple(parameters))  # refuses one that cannot be translated
        self.span = -np.inf, np.inf
        self.order_limit = KINK_ORDER if is_piecewise(expression) else np.inf

    def __call__(self, t: Array, order: int = 0, by: str | None = None) -> Array:
        """Values, rates for order 1 and their rates for order 2, or the derivatives of these by a
        parameter; of the shape of t."""
        of, names = self.expression, tuple(self.parameters)
        made = (
            _functions(_rate(of), names, by)[1] if order == 2 else _functions(of, names, by)[order]
        )
        with np.errstate(all="ignore"):
            values = np.broadcast_to(made(t, *self.parameters.values()), np.shape(t))
        bad = ~np.isfinite(values)
        if np.iscomplexobj(values) or bad.any():
            where = np.atleast_1d(t)[np.atleast_1d(bad)]
            value = values[bad].flat[0] if where.size else "complex"
            at = f" at t = {where[0]:.6g} s" if where.size else ""
            words = ("", "rate of the ", "second rate of the ")[order]
            raise TensegrityError(f"{words}{self.name} {self.expression} is {value}{at}")
        return values

    @property
    def key(self) -> Any:
        """Equal for equal functions of time."""
        return self.expression, tuple(self.parameters.items())

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Expression) and (self.name, self.key) == (other.name, other.key)

    def __hash__(self) -> int:
        return hash(self.key)

    def varied(self, values: Mapping[str, float]) -> Expression:
        """The same with other values of those parameters that it has."""
        changed = {k: values[k] for k in self.parameters if k in values}
        return Expression(self.name, self.expression, self.parameters | changed)

    def __repr__(self) -> str:
        given = ", ".join(f"{name} = {x:.9g}" for name, x in self.parameters.items())
        return f"{self.expression}{given and f' with {given}'}"


class Samples:
    """Samples interpolated by a cubic spline, whose third derivative jumps."""

    order_limit = 4.0
    parameters: ClassVar[Mapping[str, float]] = {}

    def __init__(self, name: str, t: Array, values: Array) -> None:
        self.name, self.knots, self._values = name, t, values
        self.span = float(t[0]), float(t[-1])

    @property
    def key(self) -> Any:
        """Equal for equal functions of time."""
        return id(self)

    @cached_property
    def _spline(self) -> Any:
        from scipy.interpolate import CubicSpline

        return CubicSpline(self.knots, self._values)

    def __call__(self, t: Array, order: int = 0, by: None = None) -> Array:
        """Values, or rates for order 1; of the shape of t."""
        return self._spline(t, order)

    def __repr__(self) -> str:
        return f"{len(self.knots)} samples from {self.span[0]:g} s to {self.span[1]:g} s"


def signals_of(
    name: str, given: Any, parameters: Mapping[str, float] = FixedDict()
) -> tuple[Any, ...]:
    """A function of t for each coordinate, or None for a coordinate that is free.

    Parameters
    ----------
    name : str
        For messages.
    given : expression, float, (t, values), time series, or sequence of expressions
    parameters : dict of str to float, optional
        Values of further symbols.

    Returns
    -------
    tuple of Expression, Samples or None

    Raises
    ------
    TensegrityError
        Samples or expressions that are no functions of time.
    """
    if isinstance(given, Sampled):
        given = given.t, given.values
    if isinstance(given, (tuple, list)) and len(given) == 2 and _is_array(given[0]):
        t, values = (check.floats(f"samples of the {name}", x) for x in given)
        if t.ndim != 1 or len(t) < 2 or values.ndim not in (1, 2) or len(values) != len(t):
            raise TensegrityError(
                f"samples of the {name} have shapes {t.shape} and {values.shape}, must be "
                "(samples,) of two or more, and the same or (samples, dim)"
            )
        for x in (t, values):
            check.vector(f"samples of the {name}", x, x.shape)
        stays = np.flatnonzero(np.diff(t) <= 0)
        if stays.size:
            raise TensegrityError(
                f"time {t[stays[0] + 1]:g} s of the samples of the {name} follows "
                f"{t[stays[0]]:g} s, must increase: a drive cannot jump"
            )
        columns = values.reshape(len(t), -1).T
        return tuple(Samples(name, fixed(t), fixed(column)) for column in columns)
    if not isinstance(given, (tuple, list)):
        return (expression_of(name, given, parameters),)
    if not 1 <= len(given) <= 3 or all(one is None for one in given):
        raise TensegrityError(f"{name} {check.shown(given)} must have 1 to 3 components")
    return tuple(None if one is None else expression_of(name, one, parameters) for one in given)


def _is_array(x: Any) -> bool:
    return isinstance(x, (list, tuple)) or (hasattr(x, "__array__") and np.ndim(x) > 0)


def expression_of(
    name: str, given: Any, parameters: Mapping[str, float] = FixedDict()
) -> Expression:
    """A function of time from an expression of t and of parameters, or from a number.

    Parameters
    ----------
    name : str
        For messages.
    given : expression, Expression or float
    parameters : dict of str to float, optional
        Values of further symbols, of which those that occur are taken.

    Returns
    -------
    Expression

    Raises
    ------
    TensegrityError
        An expression of other symbols, or one that cannot be translated.
    """
    import sympy as sp

    if isinstance(given, Expression):  # taken from another scene
        given = given.expression
    if not isinstance(given, sp.Expr):
        given = sp.Float(check.number(name, given))
    names = {str(s) for s in given.free_symbols}
    other = sorted(names - {"t", *parameters})
    if other:
        words = f", {', '.join(parameters)}" if parameters else " alone"
        raise TensegrityError(
            f"{name} {check.shown(given)} depends on {', '.join(other)}, must depend on t{words}"
        )
    return Expression(name, given, {k: x for k, x in parameters.items() if k in names})


@once
def _functions(expression: Any, names: tuple[str, ...] = (), by: str | None = None) -> Any:
    """The expression and its derivative in t, or the derivatives of both by a parameter, as
    functions of an array of t and of the parameters."""
    import sympy as sp

    symbols = {name: sp.Symbol(name, real=True) for name in ("t", *names)}
    try:
        expression = expression.xreplace({s: symbols[str(s)] for s in expression.free_symbols})
        if by is not None:
            expression = sp.diff(expression, symbols[by])
        rate = sp.diff(expression, symbols["t"]).replace(sp.DiracDelta, lambda *_: sp.Integer(0))
        made = (expression, rate)
        modules = [{"erf": np.vectorize(math.erf, otypes=[float])}, "numpy"]
        functions = [sp.lambdify([*symbols.values()], x, modules, cse=True) for x in made]
        with np.errstate(all="ignore"):
            for one in functions:
                values = one(np.array([0.3, 0.7]), *np.linspace(0.4, 0.6, len(names)))
                np.broadcast_to(values, (2,)).astype(float)
    except Exception as error:  # SymPy's printers and NumPy raise many types here
        raise TensegrityError(f"expression {expression} cannot be translated: {error}") from error
    return functions


@once
def _rate(expression: Any) -> Any:
    """The derivative in t."""
    import sympy as sp

    t = [s for s in expression.free_symbols if str(s) == "t"]
    return sp.diff(expression, t[0]) if t else sp.Integer(0)


def check_signals(signals: Sequence[Any], t_end: float) -> None:
    """Refuse signals that are not finite and continuous from 0 to `t_end` [s]."""
    for signal in {one.key: one for one in signals}.values():
        low, high = signal.span
        if low > 0 or high < t_end * (1 - RTOL):
            raise TensegrityError(f"{signal.name}: {signal} do not reach from 0 to {t_end:g} s")
        if t_end:
            _refuse_jump(signal, t_end)


def largest_frequency(signals: Sequence[Any], t_end: float) -> float:
    """Largest estimate of an angular frequency among the signals [rad/s]: the maximum rate over
    half the range of the values, which is exact for a sine plus a constant."""
    return max((_frequency(signal, t_end) for signal in signals), default=0.0)


def _frequency(signal: Any, t_end: float) -> float:
    own = signal.knots[(signal.knots >= 0) & (signal.knots <= t_end)]
    t = np.concatenate([np.linspace(0, t_end, INTERVALS + 1), *_steepest(signal, t_end), own])
    half = float(np.ptp(signal(t))) / 2
    return float(np.max(np.abs(signal(t, 1)))) / half if half else 0.0


def _steepest(signal: Any, t_end: float) -> list[Array]:
    """Times of repeated bisections, each of which continues in the half of larger change."""
    t = np.linspace(0, t_end, INTERVALS + 1)
    candidates = np.argsort(np.abs(np.diff(signal(t))))[-CANDIDATES:]
    low, high = t[candidates], t[candidates + 1]
    instants = [low, high]
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        values = [signal(x) for x in (low, middle, high)]
        first = np.abs(values[1] - values[0]) > np.abs(values[2] - values[1])
        low, high = np.where(first, low, middle), np.where(first, middle, high)
        instants += [low, high]
    return instants


def _refuse_jump(signal: Any, t_end: float) -> None:
    """Bisect the intervals of largest change: the change across a jump does not decrease."""
    low, high = np.reshape(_steepest(signal, t_end), (-1, 2, CANDIDATES)).swapaxes(0, 1)
    change = np.abs(signal(high) - signal(low))
    left, largest = change[-1], float(change.max())
    scale = float(np.max(np.abs(signal(np.linspace(0, t_end, INTERVALS + 1)))))
    if largest > 0 and left.max() > max(JUMP * largest, 1e-9 * scale):
        at = low[-1][int(left.argmax())]
        raise TensegrityError(
            f"{signal.name} {signal} jumps by {left.max():.6g} at t = {at:.6g} s: a drive must be "
            "continuous"
        )


def in_columns(signals: Sequence[Any], by: str | None = None) -> Any:
    """Functions of time as one function (t, order) -> (t.size, signals), or their derivatives by a
    parameter; equal ones are evaluated once."""
    distinct = {signal.key: signal for signal in signals}
    number = [list(distinct).index(signal.key) for signal in signals]

    def values(t: Array, order: int) -> Array:
        rows = [signal(t, order, by) if by in (None, *signal.parameters) else 0 * t
                for signal in distinct.values()]  # fmt: skip
        return np.stack(rows, axis=-1)[..., number] if rows else np.zeros((*t.shape, 0))

    return values
