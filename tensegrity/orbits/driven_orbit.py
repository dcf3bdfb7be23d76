"""Periodic responses of driven and damped scenes, by shooting over the period of the drives.

The period is common to all functions of time in a scene, from the angular frequencies of their
sines and cosines.  The unknowns are the state z(0) = (u, v) of the coordinates that move freely,
the equations z(T) = z(0); Newton's method takes the tangent of the whole period, whose eigenvalues
are the orbit's Floquet multipliers.
Source: R. Seydel, Practical Bifurcation and Stability Analysis, chapter 7.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from fractions import Fraction
from typing import Any

import numpy as np

from tensegrity.errors import TensegrityError
from tensegrity.orbits.flow import DrivenFlow
from tensegrity.orbits.shooting import FINEST, Multipliers, Orbit, Shooting, descending
from tensegrity.readonly import FixedDict
from tensegrity.scenes.dynamics import dynamics, varied
from tensegrity.scenes.forcing import driven_entries, time_signals
from tensegrity.scenes.scene import Scene, State
from tensegrity.typing import Array

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


LEAST = 16  # steps of a period
FINENESS = 16  # parts into which a step is divided where the extent of a motion is computed
ON_CIRCLE = 1e-6  # distance of a multiplier from its value at an event
SHIFTED = 1e-9  # change of a translation of the chain in one period below which it is neutral


class WholePeriod(Shooting):
    """The equations z(T) = z(0) in unknowns u(0) [m] and v(0) T/2 pi [m] of the free entries, those
    whose motion is not prescribed, and a parameter of the drives.

    Parameters
    ----------
    scene : Scene
    guess : State
        Displacements and velocities near those of the orbit at t = 0.
    period : float
        Period of the drives, or a whole multiple of it [s].
    by : str, optional
        The parameter, with which T may change; without one the last unknown has no effect.
    """

    kinds, longest, closed = ("doubling", "torus"), 0.02, 1e-11

    def __init__(self, scene: Scene, guess: State, period: float, by: str = "") -> None:
        super().__init__(scene, DrivenFlow(scene, 1, period))
        self._by, self._first, self._start = by, period, scene.at_rest()
        self._periods = DrivePeriod(scene) if by else None
        self._rate = period / (2 * math.pi)  # displacement over velocity [s]
        self._moved, self._motions = driven_entries(scene, True)
        free = self.inverse_mass > 0
        free[self._moved] = False
        self.free = np.flatnonzero(free)
        here = self._unknowns(guess.u.ravel(), guess.v.ravel())
        self.guess = np.append(here, drive_parameters(scene)[by] if by else 0.0)
        self.count, self._size = len(here), float(np.abs(here).max(initial=0.0))
        self.scale = np.full(self.count, self._size or 1.0)
        axes = np.tile(np.eye(scene.dim), (scene.sites, 1))  # shifts of the whole scene
        axes = axes[:, free.reshape(-1, scene.dim).all(axis=0)][free]
        self._shifts, self._checked = axes / math.sqrt(scene.sites), False

    def _unknowns(self, u: Array, v: Array) -> Array:
        return np.append(u[self.free], v[self.free] * self._rate)

    @property
    def steps(self) -> int:
        """A first number of steps of the period."""
        start = self._state(self.guess)
        steps = self.flow.first_steps(start.u, start.v, self._first)
        if steps > FINEST:
            raise TensegrityError(
                f"a period of {self._first:g} s takes {steps} steps, must take at most {FINEST}: "
                f"the scene's frequencies or decay rates are {steps / FINEST:.3g} times too large"
            )
        return max(LEAST, steps)

    def steps_to(self, value: float) -> int:
        """Least number of steps where the parameter has another value; refuses it if a drive has
        no period on the way."""
        assert self._periods is not None
        last = self._first * self._periods.factor_to(self._by, value)
        return WholePeriod(self.scene, self._state(self.guess), last).steps

    def _values(self, x: Array) -> dict[str, float]:
        """The parameter by name."""
        return {self._by: float(x[-1])} if self._by else {}

    def _period(self, x: Array) -> tuple[float, float]:
        """T [s], and its derivative with respect to the parameter."""
        if self._periods is None:
            return self._first, 0.0
        factor, slope = self._periods.factor(self._by, float(x[-1]))
        return self._first * factor, self._first * slope

    def _state(self, x: Array) -> State:
        """The state at t = 0 of given unknowns."""
        both, values = np.stack([self._start.u.ravel(), self._start.v.ravel()]), self._values(x)
        for entry, signal in zip(self._moved if values else (), self._motions, strict=False):
            both[:, entry] = [signal.varied(values)(np.zeros(1), k)[0] for k in (0, 1)]
        both[:, self.free] = x[:-1].reshape(2, -1)
        both[1, self.free] /= self._rate
        return State(*both.reshape(2, *self.scene.shape))

    def evaluated(self, x: Array) -> tuple[Array, Array, Any]:
        """See `Shooting.evaluated`; velocities count times the first T/2 pi."""
        start, count, (period, slope) = self._state(x), len(self.free), self._period(x)
        outside = x[:-1] + math.nan, np.eye(len(x) - 1, len(x)), None
        if not self.inside(start.u):
            return outside
        here = np.append(self.free, start.u.size + self.free)
        begin = start.u.ravel(), start.v.ravel()
        u, v, tangent, column = self.flow.tangents(*begin, period, self._values(x), self._by)
        scale = np.repeat([1.0, self._rate], count)
        tangent = tangent[np.ix_(here, here)] * scale[:, None] / scale
        column = column[here] * scale
        residual = self._unknowns(u, v) - x[:-1]
        if not (np.isfinite(tangent).all() and np.isfinite(residual).all()):
            return outside
        if slope:
            column = column + slope * self._unknowns(*self.flow.rates_at_start(period))
        size, jacobian = self._largest(x, residual), tangent - np.eye(len(tangent))
        if not self._checked:
            moved = np.abs(jacobian[:, :count] @ self._shifts).max(axis=0, initial=0.0)
            self._shifts, self._checked = self._shifts[:, moved < SHIFTED], True
        residual[count:] += self._shifts @ (self._shifts.T @ (x - self.guess)[:count])
        jacobian[count:, :count] += self._shifts @ self._shifts.T
        return residual / size, np.column_stack([jacobian, column]) / size, tangent

    def _largest(self, x: Array, change: Array) -> float:
        """The largest unknown of the guess, or at the start or the end of a period [m]."""
        ends = float(np.abs(x[:-1]).max()), float(np.abs(x[:-1] + change).max())
        return max(self._size, *ends, 1e-300)

    def size(self, step: Array, x: Array) -> float:
        """A change relative to the larger of x before and after it."""
        if not step.any():
            return 0.0
        x = x[:-1]
        return float(np.abs(step).max() / max(np.abs(x).max(), np.abs(x + step).max()))

    def orbit(self, x: Array) -> Orbit:
        """The orbit of given unknowns."""
        scene, state, values, (period, _) = (
            self.scene,
            self._state(x),
            self._values(x),
            self._period(x),
        )
        if values:
            drive = {
                site: one.varied({k: y for k, y in values.items() if k in one.parameters})
                for site, one in scene.drive.items()
            }
            scene = varied(scene, drive=FixedDict(drive))
        end = self.flow.end(state.u.ravel(), state.v.ravel(), period, values)
        change = self._unknowns(*end) - x[:-1]
        residual = float(np.abs(change).max()) / self._largest(x, change)
        opens = bool(self.of.springs.kinks_within(self.flow.ranges))
        energy = self.above_rest(state.u, state.v)
        return Orbit(scene, state, period, energy, residual, opens, self.flow.steps)

    def amplitude(self, orbit: Orbit) -> float:
        """Half of the largest extent of the orbit that was computed last [m]; see `OrbitPath`."""
        waves, finer = np.fft.rfft(self.flow.displacements, axis=0), FINENESS * self.flow.steps
        return float(FINENESS * np.ptp(np.fft.irfft(waves, finer, axis=0), axis=0).max() / 2)

    def multipliers(self, x: Array) -> tuple[Multipliers, Multipliers]:
        """Floquet multipliers in descending modulus, and the neutral ones: none."""
        found = descending(np.linalg.eigvals(self.found(x)[2]).astype(complex))
        return found, found[:0]

    def distances(self, multipliers: Multipliers) -> tuple[Array, ...]:
        """For each kind of event, any number of values that change their sign there."""
        return 1 + multipliers.real, 1 - np.abs(multipliers) ** 2

    def is_event(self, kind: str, multipliers: Multipliers) -> bool:
        """Whether multipliers are those of an event of this kind, where one of its numbers is 0."""
        pairs = np.abs(multipliers[multipliers.imag > 0]) - 1
        apart = np.abs(pairs if kind == "torus" else 1 + multipliers)
        return kind not in self.kinds or bool(apart.min(initial=1.0) < ON_CIRCLE)


def drive_parameters(scene: Scene) -> dict[str, float]:
    """The parameters of all drives, each with its value."""
    values: dict[str, float] = {}
    for drive in scene.drive.values():
        for name, value in drive.parameters.items():
            if values.setdefault(name, value) != value:
                raise TensegrityError(
                    f"parameter {name} is {values[name]:g} in one drive and {value:g} in another"
                )
    return values
