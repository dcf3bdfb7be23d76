"""Objectives of a gradient: traces of a run, and numbers computed from them.

A trace is one number after every step, such as the load of a bond or the displacement of a site; as
an objective it stands for its value at the end.  An objective is computed from traces together with
its derivatives with respect to every sample, so that the formula itself is differentiated.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import permutations
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.errors import TensegrityError
from tensegrity.root import peak_weights, root
from tensegrity.typing import Array, Index

Rule = Callable[[Array, Array], tuple[float, ArrayLike]]

STEEPEST = 1000.0  # exponent of a p-norm
TINY = 1e-30  # step of a derivative through the complex plane


@dataclass(frozen=True)
class Trace:
    """A number after every step; made by `load`, `displacement`, `velocity` and `energy`.

    Attributes
    ----------
    kind : {"bond", "wall", "displacement", "velocity", "energy"}
    where : int, tuple of int, or None
        Number of the bond, wall or site; the sites of an energy, None for all.
    axis : int
        Coordinate of a displacement or velocity.
    """

    kind: str
    where: Any
    axis: int = 0
    _given_by = ", such as objective.load(bond=3), nor made of one"

    def __str__(self) -> str:
        name = "load" if self.kind in ("bond", "wall") else self.kind
        return f"{name} of {self.kind if name == 'load' else 'site'} {self.where}"


@dataclass(frozen=True, eq=False)
class Objective:
    """A number computed from traces.

    Attributes
    ----------
    traces : tuple of Trace
    rule : callable (t, y) -> (value, derivatives)
        y and the derivatives have the shape (traces, instants).
    over : (float, float), or None
        The interval of time on which it depends [s]; None for the end of the run.
    name : str
    latest : float
        Earliest time at which a run may end [s].
    """

    traces: tuple[Trace, ...]
    rule: Callable[[Array, Array], tuple[float, Any]]
    over: tuple[float, float] | None
    name: str
    latest: float = 0.0

    def __repr__(self) -> str:
        return f"{self.name} of {', '.join(map(str, self.traces))}"


ALWAYS = (0.0, np.inf)


@checked
def load(bond: Index | None = None, wall: Index | None = None) -> Trace:
    """Compressive force of a bond, or of all contacts with a wall.

    Parameters
    ----------
    bond : int, optional
        Number of the bond; in a network the wall contacts are counted after the bonds.
    wall : int, optional
        Number of the wall; in a chain, of the held end.

    Returns
    -------
    Trace
        -V.tension(r) [N], compression > 0, without the preload that the bond carries at rest.

    Raises
    ------
    TensegrityError
        Neither or both of `bond` and `wall`; not a number of either.

    Examples
    --------
    >>> from tensegrity import objective
    >>> objective.load(bond=3)
    Trace(kind='bond', where=3, axis=0)
    >>> print(objective.load(bond=3))
    load of bond 3
    """
    if (bond is None) == (wall is None):
        raise TensegrityError(f"load of bond {bond!r} and wall {wall!r}: give one of the two")
    return Trace("wall", wall) if bond is None else Trace("bond", bond)


@checked
def displacement(site: Index, axis: Index = 0) -> Trace:
    """Displacement of a site [m], along one axis in a network."""
    return Trace("displacement", site, axis)


@checked
def velocity(site: Index, axis: Index = 0) -> Trace:
    """Velocity of a site [m/s], along one axis in a network."""
    return Trace("velocity", site, axis)


def energy(sites: Sequence[int] | None = None) -> Trace:
    """Energy of some sites, by default of all [J]: their kinetic energy, half of that of their
    bonds, that of their wall contacts, and the potential of their loads; as `scene.site_energy`."""
    if sites is None:
        return Trace("energy", None)
    numbers = check.sequence("sites", sites, "site numbers")
    chosen = tuple(check.whole("site", s, least=0) for s in numbers)
    if not chosen or len(set(chosen)) < len(chosen):
        raise TensegrityError(f"sites {check.shown(chosen)} must be different, and at least one")
    return Trace("energy", chosen)


@checked
def peak(trace: Trace) -> Objective:
    """Largest value of a trace: the vertex of the parabola through its largest sample and the two
    next to it.

    Parameters
    ----------
    trace : Trace

    Returns
    -------
    Objective
        In the unit of the trace.

    Examples
    --------
    >>> from tensegrity import objective
    >>> objective.peak(objective.load(bond=3))
    peak of load of bond 3
    """
    return Objective((trace,), _peak, ALWAYS, "peak")


@checked
def p_norm(
    trace: Trace,
    p: Annotated[float, ">= 1", f"<= {STEEPEST}"] = 32,
    over: tuple[float, float] | None = None,
) -> Objective:
    """A smooth approximation of the peak: (dt sum of max(y, 0)^p)^(1/p).

    Parameters
    ----------
    trace : Trace
    p : float, optional
        From 1 to 1000; the larger, the closer to the peak.
    over : (float, float), optional
        Interval of time [s], ends included; by default the whole run.

    Returns
    -------
    Objective
        In the unit of the trace times s^(1/p).

    Raises
    ------
    TensegrityError
        p or the interval is out of bounds.
    """

    def rule(t: Any, y: Any) -> Any:
        dt = (t[-1] - t[0]) / (len(t) - 1) if len(t) > 1 else 1.0
        pressed = np.maximum(y[0], 0)
        largest = pressed.max()
        if largest == 0:
            return 0.0, np.zeros_like(y)
        ratio = pressed / largest
        mean = dt * np.sum(ratio**p)
        value = largest * mean ** (1 / p)
        return value, (dt * (ratio ** (p - 1)) * mean ** (1 / p - 1))[None]

    latest = 0.0 if over is None else _window(over)[1]
    return Objective((trace,), rule, _window(over), f"{p:g}-norm", latest)


def impulse(bond: int | None = None, wall: int | None = None) -> Objective:
    """Impulse of a load [N s], compression > 0, by the trapezoidal rule over the steps."""

    def rule(t: Any, y: Any) -> Any:
        half = np.diff(t) / 2
        weights = np.append(half, 0) + np.append(0, half)
        return float(weights @ y[0]), weights[None]

    return Objective((load(bond, wall),), rule, ALWAYS, "impulse")


@checked
def arrival(site: Index, displacement: Annotated[float, "m"]) -> Objective:
    """Time at which a site first passes a displacement [s], by a cubic through four samples.

    Parameters
    ----------
    site : int
    displacement : float
        [m], passed from either side.

    Returns
    -------
    Objective
        `gradient` raises a TensegrityError where the site never passes the displacement.
    """
    rule = partial(_arrival, level=displacement, who=f"site {site}")
    return Objective((Trace("displacement", site),), rule, ALWAYS, "arrival")


@checked
def misfit(trace: Trace, t: ArrayLike, values: ArrayLike) -> Objective:
    """Half the sum of squared differences of a trace from given values.

    Parameters
    ----------
    trace : Trace
    t : array_like, (n,)
        Instants [s], increasing, within the run; between the steps the trace is interpolated by a
        cubic through four samples.
    values : array_like, (n,)
        Target values, in the unit of the trace.

    Returns
    -------
    Objective
        In the square of that unit.

    Raises
    ------
    TensegrityError
        Arrays of different shapes, or instants that do not increase from 0 or later.
    """
    t, values = check.columns(t=t, values=values)
    if np.any(np.diff(t) <= 0) or t[0] < 0:
        raise TensegrityError("t must increase, from 0 s or later")
    times, wanted = t.copy(), values.copy()

    def rule(t: Any, y: Any) -> Any:
        first, weights = cubic(t, times)
        at = first[:, None] + np.arange(weights.shape[1])
        short = np.sum(weights * y[0][at], axis=1) - wanted
        slope = np.zeros_like(y)
        np.add.at(slope[0], at, weights * short[:, None])
        return float(short @ short / 2), slope

    return Objective((trace,), rule, ALWAYS, "misfit", float(times[-1]))


def of(traces: Sequence[Trace], function: Rule) -> Objective:
    """A user's function of traces.

    Parameters
    ----------
    traces : sequence of Trace
    function : callable (t, y) -> (value, derivatives)
        t (steps + 1,) [s]; y (traces, steps + 1), one row for each trace in the given order; the
        derivatives of the value with respect to y have the shape of y.

    Returns
    -------
    Objective

    Raises
    ------
    TensegrityError
        Not a sequence of traces, or not a function; by `gradient`, invalid results of it.
    """
    if isinstance(traces, Trace) or not isinstance(traces, Sequence) or not len(traces):
        raise TensegrityError(f"traces {check.shown(traces)} must be a sequence of traces")
    if not callable(function):
        raise TensegrityError(f"function {check.shown(function)} is not a function (t, y)")

    def rule(t: Any, y: Any) -> Any:
        answer = function(t.copy(), y.copy())
        if not isinstance(answer, tuple) or len(answer) != 2:
            raise TensegrityError(
                f"function of traces gave {check.shown(answer)}, must give (value, derivatives)"
            )
        value = check.number("value of a function of traces", answer[0])
        slope = check.floats("derivatives of a function of traces", answer[1])
        return value, check.vector("derivatives of a function of traces", slope, y.shape)

    parts = tuple(check.kind("trace", trace, Trace) for trace in traces)
    return Objective(parts, rule, ALWAYS, "function")


def objective_of(given: Trace | Objective) -> Objective:
    """An objective itself, or the objective of a bare trace, its value at the end."""
    if isinstance(given, Objective):
        return given
    return Objective((check.kind("objective", given, Trace),), _last, None, "end")


def _last(t: Array, y: Array) -> tuple[float, Array]:
    return float(y[0, -1]), np.eye(1, y.shape[1], y.shape[1] - 1)


def _window(over: Any) -> tuple[float, float]:
    if over is None:
        return ALWAYS
    if not isinstance(over, (tuple, list)) or len(over) != 2:
        raise TensegrityError(f"over {check.shown(over)} must be (from, to)")
    first, last = (check.number("end of over", x, least=0, unit="s") for x in over)
    if not first < last:
        raise TensegrityError(f"over ({first:g}, {last:g}) s must be an interval")
    return first, last


def _peak(t: Array, y: Array) -> tuple[float, Array]:
    trace, slope = y[0], np.zeros_like(y)
    k = int(np.argmax(trace))
    near = slice(k - 1, k + 2)
    if 0 < k < len(trace) - 1 and trace[near].min() < trace[k]:
        slope[0, near] = peak_weights(trace, k)
        return float(slope[0, near] @ trace[near]), slope
    slope[0, k] = 1
    return float(trace[k]), slope


def cubic(t: Array, times: Array) -> tuple[Any, Array]:
    """First sample and weights of the cubic through four samples around each instant.

    With fewer than four samples, the polynomial through all of them.

    Returns
    -------
    first : ndarray of int, (n,)
    weights : ndarray, (n, 4)
    """
    count = min(4, len(t))
    dt = (t[-1] - t[0]) / (len(t) - 1) if len(t) > 1 else 1.0
    place = (times - t[0]) / dt
    first = np.clip(np.floor(place).astype(int) - 1, 0, len(t) - count)
    return first, _weights(place - first, count)


def _weights(x: Any, count: int) -> Array:
    """Weights of samples at 0, 1, .., count - 1 in the value at x of the polynomial through them;
    (.., count)."""
    weights = np.ones((*np.shape(x), count), dtype=np.result_type(x, float))
    for i, j in permutations(range(count), 2):
        weights[..., i] *= (x - j) / (i - j)
    return weights


def _arrival(t: Array, y: Array, level: float, who: str) -> tuple[float, Array]:
    above = y[0] - level
    crossed = np.flatnonzero((above[:-1] * above[1:] <= 0) & (above[:-1] != above[1:]))
    if not crossed.size:
        raise TensegrityError(
            f"{who} never passes {level:g} m: it goes from {y[0].min():.6g} m to "
            f"{y[0].max():.6g} m up to {t[-1]:.6g} s"
        )
    k, count = int(crossed[0]), min(4, len(t))
    first = min(max(k - 1, 0), len(t) - count)
    here, dt = slice(first, first + count), t[1] - t[0]
    x = root(lambda x: float(_weights(x, count) @ above[here]), k - first, k - first + 1)
    rate = float((_weights(x + 1j * TINY, count) @ above[here]).imag / TINY)
    if rate == 0:
        raise TensegrityError(
            f"{who} touches {level:g} m at {t[first] + x * dt:.6g} s without passing it"
        )
    slope = np.zeros_like(y)
    slope[0, here] = -dt * _weights(x, count) / rate
    return float(t[first] + x * dt), slope
