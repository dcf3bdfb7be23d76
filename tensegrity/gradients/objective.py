"""What a gradient is taken of: traces of a run, and numbers made of them.

A trace is one number after every step: the load of a bond, the displacement of a site.  By
itself, as an objective, it stands for its value at the end.  Numbers are made of traces, with
their derivatives by every sample, so that what is differentiated is the very formula.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import permutations
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.root import crest, root

if TYPE_CHECKING:
    from typing import Any

    from numpy.typing import ArrayLike

    from tensegrity.typing import Array

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
        Number of a bond, wall or site; sites of an energy, None for all.
    axis : int
        Of a displacement or velocity.
    """

    kind: str
    where: Any
    axis: int = 0

    def __str__(self) -> str:
        name = "load" if self.kind in ("bond", "wall") else self.kind
        return f"{name} of {self.kind if name == 'load' else 'site'} {self.where}"


@dataclass(frozen=True, eq=False)
class Objective:
    """A number made of traces.

    Attributes
    ----------
    traces : tuple of Trace
    rule : callable (t, y) -> (value, derivatives)
        y and the derivatives of shape (traces, instants).
    over : (float, float), or None
        The time that it looks at [s]; None: the end of the run.
    name : str
    latest : float
        A run must not end before this time [s].
    """

    traces: tuple[Trace, ...]
    rule: Callable[[Array, Array], tuple[float, Any]]
    over: tuple[float, float] | None
    name: str
    latest: float = 0.0

    def __repr__(self) -> str:
        return f"{self.name} of {', '.join(map(str, self.traces))}"


ALWAYS = (0.0, np.inf)


def load(bond: int | None = None, wall: int | None = None) -> Trace:
    """Compressive force of a bond, or of all contacts with a wall.

    Parameters
    ----------
    bond : int, optional
        Number of the bond; of a network also of a wall contact, behind the bonds.
    wall : int, optional
        Number of the wall; of a chain, of its held ends.

    Returns
    -------
    Trace
        -V.tension(r) [N], compression > 0; what the bond carries at rest under a preload is not
        in it.
    """
    if (bond is None) == (wall is None):
        raise TensegrityError(f"load of bond {bond!r} and wall {wall!r}: give one of the two")
    if bond is not None:
        return Trace("bond", check.whole("bond", bond, least=0))
    return Trace("wall", check.whole("wall", wall, least=0))


def displacement(site: int, axis: int = 0) -> Trace:
    """Displacement of a site [m], of a network along one axis."""
    return Trace(
        "displacement", check.whole("site", site, least=0), check.whole("axis", axis, least=0)
    )


def velocity(site: int, axis: int = 0) -> Trace:
    """Velocity of a site [m/s], of a network along one axis."""
    return Trace("velocity", check.whole("site", site, least=0), check.whole("axis", axis, least=0))


def energy(sites: Sequence[int] | None = None) -> Trace:
    """Energy of some sites [J]: motion, half of their bonds, wall contacts, loads; by default all.

    As `scene.site_energy`.
    """
    if sites is None:
        return Trace("energy", None)
    numbers = check.sequence("sites", sites, "site numbers")
    found = tuple(check.whole("site", s, least=0) for s in numbers)
    if not found or len(set(found)) < len(found):
        raise TensegrityError(f"sites {check.shown(found)} must be some, each once")
    return Trace("energy", found)


def peak(trace: Trace) -> Objective:
    """Largest value of a trace, by the parabola through its largest sample and its neighbours."""
    return Objective((_trace(trace),), _peak, ALWAYS, "peak")


def p_norm(trace: Trace, p: float = 32, over: tuple[float, float] | None = None) -> Objective:
    """A smooth stand-in for the peak: (dt sum of max(y, 0)^p)^(1/p).

    Parameters
    ----------
    trace : Trace
    p : float, optional
        >= 1; 2 to 1000.  The higher, the nearer to the peak.
    over : (float, float), optional
        From when to when [s], both included; by default the whole run.
    """
    p = check.number("p of a norm", p, least=1)
    if p > STEEPEST:
        raise TensegrityError(f"p {p:g} of a norm must be at most {STEEPEST:g}")

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
    return Objective((_trace(trace),), rule, _window(over), f"{p:g}-norm", latest)


def impulse(bond: int | None = None, wall: int | None = None) -> Objective:
    """Impulse of a load [N s], compression > 0: the trapezoid rule over the steps."""

    def rule(t: Any, y: Any) -> Any:
        half = np.diff(t) / 2
        weights = np.append(half, 0) + np.append(0, half)
        return float(weights @ y[0]), weights[None]

    return Objective((load(bond, wall),), rule, ALWAYS, "impulse")


def arrival(site: int, displacement: float) -> Objective:
    """Time at which a site first passes a displacement [s], by a cubic through four samples.

    Parameters
    ----------
    site : int
    displacement : float
        [m], passed from either side.

    Raises
    ------
    TensegrityError
        By `gradient`, where the site never passes it.
    """
    level = check.number("displacement", displacement, unit="m")
    trace = Trace("displacement", check.whole("site", site, least=0))
    rule = partial(_arrival, level=level, who=f"site {site}")
    return Objective((trace,), rule, ALWAYS, "arrival")


def misfit(trace: Trace, t: ArrayLike, values: ArrayLike) -> Objective:
    """Half the sum of squared differences of a trace from given values.

    Parameters
    ----------
    trace : Trace
    t : array_like, (n,)
        Instants [s], increasing, within the run; between the steps by a cubic through four.
    values : array_like, (n,)
        What the trace should be then.
    """
    t, values = check.floats("t", t), check.floats("values", values)
    if t.ndim != 1 or not t.size or values.shape != t.shape:
        raise TensegrityError(
            f"t of shape {t.shape} and values of shape {values.shape} must be as many, one or more"
        )
    for name, x in (("t", t), ("values", values)):
        check.vector(name, x, x.shape)
    if np.any(np.diff(t) <= 0) or t[0] < 0:
        raise TensegrityError("t must increase, from 0 s or later")
    times, wanted = t.copy(), values.copy()

    def rule(t: Any, y: Any) -> Any:
        first, weights = _cubic(t, times)
        at = first[:, None] + np.arange(weights.shape[1])
        short = np.sum(weights * y[0][at], axis=1) - wanted
        slope = np.zeros_like(y)
        np.add.at(slope[0], at, weights * short[:, None])
        return float(short @ short / 2), slope

    return Objective((_trace(trace),), rule, ALWAYS, "misfit", float(times[-1]))


def of(traces: Sequence[Trace], function: Rule) -> Objective:
    """Any number made of traces.

    Parameters
    ----------
    traces : sequence of Trace
    function : callable (t, y) -> (value, derivatives)
        t (steps + 1,) [s]; y (traces, steps + 1), a row for each trace in the order given, and
        the derivatives of the value by all of them in the same shape.
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

    return Objective(tuple(map(_trace, traces)), rule, ALWAYS, "function")


def objective_of(given: Trace | Objective) -> Objective:
    """An objective as it is, or a bare trace as its value at the end."""
    if isinstance(given, Objective):
        return given
    trace = _trace(given)
    return Objective((trace,), _last, None, "end")


def _last(t: Array, y: Array) -> tuple[float, Array]:
    return float(y[0, -1]), np.eye(1, y.shape[1], y.shape[1] - 1)


def _trace(given: Any) -> Trace:
    check.kind("objective", given, Trace, ", such as objective.load(bond=3), nor made of one")
    return given


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
        slope[0, near] = crest(trace, k)
        return float(slope[0, near] @ trace[near]), slope
    slope[0, k] = 1
    return float(trace[k]), slope


def _cubic(t: Array, times: Array) -> tuple[Any, Array]:
    """First sample and weights of the cubic through four samples around each instant.

    Where there are fewer than four, the polynomial through all.

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
    """Of samples at 0, 1, .., count - 1 in the polynomial through them at x; (.., count)."""
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
        raise TensegrityError(f"{who} touches {level:g} m at {t[first] + x * dt:.6g} s, no passage")
    slope = np.zeros_like(y)
    slope[0, here] = -dt * _weights(x, count) / rate
    return float(t[first] + x * dt), slope
