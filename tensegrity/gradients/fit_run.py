"""Fits of a run to records of several sensors.

The model is one run from a known start; the errors of the samples are independent, with the noise
of each record up to a common factor.  SciPy minimises the squared residuals over the logarithms of
the parameters.  The slope of their sum is exact: one reverse pass gives it by all numbers of the
scene, which are differentiated by the parameters.  Each column of the Jacobian follows from another
run, and is corrected such that it agrees with that slope: fits end where the exact slope is 0, and
a parameter on which the scene depends in another way than by its numbers is found out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from inspect import signature
from typing import TYPE_CHECKING, Any

import numpy as np

from tensegrity import check, plotting
from tensegrity.checked import checked
from tensegrity.engine.force_law import SITE
from tensegrity.errors import TensegrityError
from tensegrity.gradients.compute import gradient, traces_of
from tensegrity.gradients.objective import Trace, cubic, of
from tensegrity.likelihood import UNDEFINED, covariance, intervals, quantile
from tensegrity.measure.series import TimeSeries
from tensegrity.printing import Lines, Printed
from tensegrity.scenes.dynamics import HasDynamics, dynamics
from tensegrity.scenes.scene import State
from tensegrity.typing import Array, Duration, Fraction
from tensegrity.unit_names import in_units

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from tensegrity.engine.methods import Method
    from tensegrity.scenes.scene import Scene

TRIGGER = "trigger"
LARGE = 0.3  # relative standard error above which a parameter counts as not identified
TOGETHER = 0.99  # correlation from which two parameters are known in combination only
NEAR = 1e-5  # change of a logarithm from run to run
DIFFERENT = 1e-3  # of a slope: what it may differ from that by another run
ROUND_OFF = 1e-5  # of a slope by another run
ROOM = 0.1  # of the length of the records, by which the trigger may move
FEW = 0.05  # of that length, the unit of the trigger


@dataclass(frozen=True, repr=False)
class RunFit(Printed):
    """Parameters of a scene fitted to records, with their uncertainty.

    Attributes
    ----------
    scene : Scene
        With the estimated parameters.
    values, errors : dict of str to float
        Estimates and standard errors; those of the trigger in s.
    correlation : ndarray, (parameters, parameters)
        Correlation matrix of the estimates.
    condition : float
        Condition number of the Jacobian with respect to relative changes of the parameters.
    residuals : tuple of ndarray
        Recorded minus computed values of each record, in its unit.
    factor : float
        Standard deviation of the residuals over the noise of the records: near 1, or the model
        differs from what was recorded.
    degrees : int
        Samples minus parameters.
    unidentified : tuple of str
        What the records do not determine, in words.
    """

    scene: Scene
    values: dict[str, float]
    errors: dict[str, float]
    correlation: Array
    condition: float
    residuals: tuple[Array, ...]
    factor: float
    degrees: int
    unidentified: tuple[str, ...]
    _misfit: Any

    @checked
    def intervals(self, level: Fraction = 0.95) -> dict[str, tuple[float, float]]:
        """Confidence intervals of the parameters by profile likelihood, as `Fit.intervals`.

        Parameters
        ----------
        level : float, optional
            Confidence level, above 0 and below 1.

        Returns
        -------
        dict of str to (float, float)
            Lower and upper end; 0 or inf, of the trigger -inf or inf, where the records set no
            bound.

        Raises
        ------
        TensegrityError
            A level out of bounds.
        EquilibriumError
            A fit at the border of the scenes that can be computed, or an end that was not found.
        """
        return intervals(self._misfit, self.factor, quantile(level, self.degrees))

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw records and fitted traces against the time of the run; returns Matplotlib's axes."""
        drawn: Axes = plotting.axes(ax)
        late = self.values.get(TRIGGER, 0.0)
        for (sensor, record), left in zip(
            self._misfit.records.items(), self.residuals, strict=True
        ):
            (points,) = drawn.plot(record.t + late, record.values, ".", ms=3, alpha=0.4)
            words = " and ".join(map(str, sensor if isinstance(sensor, tuple) else (sensor,)))
            drawn.plot(record.t + late, record.values - left, color=points.get_color(), label=words)
        drawn.set(xlabel=in_units("t [s]"), ylabel=f"value [{record.unit}]")
        drawn.legend(frameon=False)
        return drawn

    def _lines(self) -> Lines:
        for name, value in self.values.items():
            yield f"{name} = {value:.6g} +- {self.errors[name]:.2g}"
        count = sum(map(len, self.residuals))
        yield (
            f"  {count} samples of {len(self.residuals)} records; residuals {self.factor:.3g} of "
            f"their noise; condition {self.condition:.3g}"
        )
        yield from (f"  not identified: {words}" for words in self.unidentified)


@checked
def fit_run(
    records: Mapping[Any, TimeSeries],
    scene: Callable[..., Scene | tuple[Scene, State]],
    free: Mapping[str, float],
    *,
    dt: Duration,
    method: str | Method | None = None,
    t_end: Duration | None = None,
) -> RunFit:
    """Fit parameters of a scene to what sensors recorded of its motion, by least squares.

    Parameters
    ----------
    records : dict of Trace to TimeSeries
        What was recorded of each trace of the run (see `tensegrity.objective`), in its unit; of
        several traces, as the loads on both sides of a bead with a sensor, their mean.
    scene : callable (**parameters) -> Scene or (Scene, State)
        Makes the scene, and its initial state unless that is `scene.start()` or `scene.at_rest()`.
    free : dict of str to float
        Initial guesses of the parameters, none 0, all of which keep their sign.  "trigger", which
        may be 0, is the time of the run at time 0 of the records [s], by default 0; it is not
        handed to `scene`.
    dt : float
        Step [s], as of `gradient`.
    method : str or Method, optional
        As of `gradient`.
    t_end : float, optional
        End of the run [s]; by default that of the records, and a tenth more if the trigger is free.
        Samples before 0 or after the end are compared with the first or last value.

    Returns
    -------
    RunFit

    Raises
    ------
    TensegrityError
        Bad input; fewer samples than unknowns; a parameter on which the run depends in a way that
        `gradient` does not follow, such as sizes of a network; and the errors of `gradient` at the
        guesses.

    Notes
    -----
    Samples count by the noise of their record, or all records by their largest value where one has
    no noise.  A guess from which the pulses arrive more than a width off leads to another minimum:
    `factor` is large then.

    Examples
    --------
    >>> import numpy as np
    >>> from tensegrity import Chain, PowerLaw, Record, TimeSeries, fit_run, objective, simulate
    >>> def beads(stiffness, speed):
    ...     chain = Chain(PowerLaw(stiffness, 1.5), sites=6)
    ...     return chain, chain.at_rest({0: speed})
    >>> chain, start = beads(2.0, 1.0)
    >>> t = np.linspace(0, 5, 101)
    >>> run = simulate(chain, start, 5.0, dt=0.01, record=Record(times=t))
    >>> load = -chain.bond_tension(run.u)[:, 3]
    >>> noise = 0.01 * np.random.default_rng(1).normal(size=101)
    >>> record = TimeSeries(t, load + noise, "N", noise=0.01)
    >>> guess = {"stiffness": 1.5, "speed": 0.9}
    >>> print(fit_run({objective.load(3): record}, beads, guess, dt=0.01))
    stiffness = 2.00105 +- 0.0034
    speed = 0.998529 +- 0.0023
      101 samples of 1 records; residuals 0.86 of their noise; condition 2.82
    """
    from scipy.optimize import least_squares

    at = _Misfit(_checked(records), scene, _guesses(free, scene), dt, method, t_end)
    count, zero = sum(map(len, at.records.values())), np.zeros(len(at.names))
    if count <= len(zero):
        raise TensegrityError(f"{count} samples are too few for {len(zero)} unknowns and the noise")
    at.evaluated(zero)  # raises the errors of the guesses
    solved = least_squares(lambda z: at(z)[0], zero, lambda z: at(z)[1], method="trf", xtol=1e-10)
    at = at.around(solved.x)
    r, slopes = at.evaluated(zero)
    degrees = count - len(zero)
    spread = float(np.sqrt(r @ r / degrees))
    one, correlation, condition = covariance(slopes)
    alone = spread * np.sqrt(np.diag(one))
    values = {name: at.value(k, 0.0) for k, name in enumerate(at.names)}
    errors = {
        name: float(error * at.unit(name)) for name, error in zip(at.names, alone, strict=True)
    }
    parts = np.split(-r * at.size, np.cumsum([len(x) for x in at.records.values()])[:-1])
    return RunFit(
        at.made(zero)[0], values, errors, correlation, condition,
        tuple(part * noise for part, noise in zip(parts, at.noises, strict=True)),
        spread * at.size, degrees, _unidentified(at.names, alone, correlation), at,
    )  # fmt: skip


class _Misfit:
    """Computed minus recorded values over their noise and `size`, with derivatives; see
    `tensegrity.likelihood`."""

    model = "scenes that can be computed"

    def __init__(
        self, records: Any, make: Any, start: dict[str, float], dt: float, method: Any, t_end: Any
    ) -> None:
        self.records, self._make, self._start, self.names = records, make, start, tuple(start)
        self._sensors = [one if isinstance(one, tuple) else (one,) for one in records]
        self.traces = tuple(dict.fromkeys(trace for one in self._sensors for trace in one))
        tops = [float(np.abs(one.values).max()) for one in records.values()]
        noises = [one.noise for one in records.values()]
        self.noises = noises if all(noises) else tops
        self.size = max(top / noise for top, noise in zip(tops, self.noises, strict=True))
        ends = [
            max(one.t[-1] for one in records.values()),
            min(one.t[0] for one in records.values()),
        ]
        self.span = ends[0] - ends[1]
        last = ends[0] + start.get(TRIGGER, 0.0) + ROOM * self.span * (TRIGGER in start)
        self._given = last if t_end is None else t_end, dt, method
        self._known: dict[bytes, Any] = {}

    def unit(self, name: str) -> float:
        """What the unknown of a parameter counts."""
        return FEW * self.span if name == TRIGGER else abs(self._start[name])

    def value(self, k: int, z: float) -> float:
        """A parameter whose unknown is z."""
        name, start = self.names[k], self._start[self.names[k]]
        return float(start + self.unit(name) * z if name == TRIGGER else start * math.exp(z))

    def around(self, z: Array) -> _Misfit:
        """The same misfit, with unknowns that count from z."""
        start = {name: self.value(k, z[k]) for k, name in enumerate(self.names)}
        t_end, dt, method = self._given
        return _Misfit(self.records, self._make, start, dt, method, t_end)

    def __call__(self, z: Array) -> tuple[Array, Array]:
        """Misfits, (samples,), all `UNDEFINED` where the scene cannot be computed; derivatives,
        (samples, unknowns)."""
        if (key := z.tobytes()) not in self._known:  # SciPy asks for values, then for derivatives
            try:
                result = self.evaluated(z)
            except TensegrityError:
                count = sum(map(len, self.records.values()))
                result = np.full(count, UNDEFINED), np.zeros((count, len(z)))
            self._known[key] = result
        return self._known[key]

    def made(self, z: Array) -> tuple[Any, State]:
        """The scene and its initial state."""
        values = {name: self.value(k, z[k]) for k, name in enumerate(self.names)}
        values.pop(TRIGGER, None)
        made = self._make(**values)
        scene = made[0] if isinstance(made, tuple) and len(made) == 2 else made
        if not isinstance(scene, HasDynamics):
            raise TensegrityError(f"scene gave {check.shown(made)}, must give a scene and a state")
        begin = getattr(scene, "start", None) or scene.at_rest  # type: ignore[attr-defined]
        return scene, begin() if scene is made else made[1]

    def evaluated(self, z: Array) -> tuple[Array, Array]:
        """Misfits and derivatives."""
        (scene, state), (t_end, dt, method) = self.made(z), self._given
        late = (
            self.value(self.names.index(TRIGGER), z[self.names.index(TRIGGER)])
            if TRIGGER in self.names
            else 0.0
        )
        run: list[Any] = []

        def half(t: Array, y: Array) -> tuple[float, Array]:
            r, back = self._compared(t, y, late)
            run[:] = t, y, r
            return float(r @ r / 2), back(r)

        moved, rates = zip(*(self._moved(z, k) for k in range(len(z))), strict=True)
        wanted = sorted({name for one in rates for name in one} - {"u", "v", "mass"})
        found = gradient(
            of(self.traces, half), scene, state, t_end, method=method, dt=dt, wanted=wanted
        )
        given = {"u": found.u, "v": found.v, "mass": found.mass, **found.parameters}
        (t, y, r), slopes = run, np.empty((len(run[2]), len(z)))
        for k, name in enumerate(self.names):
            if name == TRIGGER:
                up, down = (
                    self._compared(t, y, late + s * NEAR * self.unit(name))[0] for s in (1, -1)
                )
                slopes[:, k] = (up - down) / (2 * NEAR)
                continue
            there = traces_of(self.traces, moved[k][0], moved[k][1], t_end, method, dt)
            slopes[:, k] = column = (self._compared(*there, late)[0] - r) / NEAR
            exact = sum(np.sum(given[one] * rate) for one, rate in rates[k].items() if one in given)
            lacks = float(exact - column @ r)
            bound = DIFFERENT * np.linalg.norm(column) + ROUND_OFF
            if abs(lacks) > bound * np.linalg.norm(r):
                raise TensegrityError(
                    f"{name} changes the scene in a way that gradients do not follow: springs, "
                    "forces, masses and initial states may depend on it"
                )
            if lacks:
                slopes[:, k] += r * (lacks / (r @ r))
        return r, slopes

    def _compared(self, t: Array, y: Array, late: float) -> tuple[Array, Callable[[Array], Array]]:
        """Misfits of traces y at instants t, and the pullback of derivatives by them."""
        parts, places = [], []
        for sensor, record, noise in zip(
            self._sensors, self.records.values(), self.noises, strict=True
        ):
            first, weights = cubic(t, np.clip(record.t + late, 0.0, t[-1]))
            at = first[:, None] + np.arange(weights.shape[1])
            rows = [self.traces.index(trace) for trace in sensor]
            share = weights / (len(rows) * noise * self.size)
            parts.append(
                (share * y[rows][:, at].sum(axis=0)).sum(axis=1)
                - record.values / (noise * self.size)
            )
            places.append((rows, at, share))

        def back(by: Array) -> Array:
            slope, begin = np.zeros_like(y), 0
            for rows, at, share in places:
                part = share * by[begin : begin + len(at), None]
                for row in rows:
                    np.add.at(slope[row], at, part)
                begin += len(at)
            return slope

        return np.concatenate(parts), back

    def _moved(self, z: Array, k: int) -> tuple[Any, dict[str, Array]]:
        """The scene and state beside those of z, and the derivatives of all their numbers by an
        unknown, but for those that are 0."""
        if self.names[k] == TRIGGER:
            return None, {}
        there, back = (self.made(z + s * NEAR * np.eye(len(z))[k]) for s in (1, -1))
        up, down = _numbers(*there), _numbers(*back)
        if [x.shape for x in up.values()] != [x.shape for x in down.values()]:
            raise TensegrityError(f"{self.names[k]} changes the number of sites or bonds")
        rates = {name: (up[name] - down[name]) / (2 * NEAR) for name in up}
        return there, {name: rate for name, rate in rates.items() if rate.any()}


def _numbers(scene: Any, state: State) -> dict[str, Array]:
    """The numbers of a scene and its initial state by which `gradient` differentiates."""
    of = dynamics(scene)
    group, (laws, law, parameters) = of.springs.group, of.springs.table
    found = {"u": np.array(state.u), "v": np.array(state.v), "mass": np.array(scene.mass)}

    def put(name: str, count: int, places: Any, values: Any) -> None:
        found.setdefault(name, np.zeros(count))[places] = values

    for number, one in enumerate(laws):
        mine = np.flatnonzero(law[group] == number)
        for k, symbol in enumerate(one.parameters):
            put(str(symbol), len(group), mine, parameters[group[mine], k])
    if of.is_driven:
        counts = {"sites": scene.sites, "bonds": len(group)}
        for force in of.acting.applied(as_forces=True):
            for name, values in zip(force.law.names, force.values, strict=False):
                put(
                    name, counts["sites" if force.law.on == SITE else "bonds"], force.places, values
                )
        for site, drive in scene.drive.items():
            for name, value in drive.parameters.items():
                put(name, scene.sites, site, value)
    return found


def _unidentified(names: Sequence[str], errors: Array, correlation: Array) -> tuple[str, ...]:
    """What records do not determine, in words."""
    loose = [(k, e) for k, e in zip(names, errors, strict=True) if k != TRIGGER and e > LARGE]
    words = [f"{name}: its standard error is {100 * error:.3g} % of it" for name, error in loose]
    for i, j in np.argwhere(np.triu(np.abs(correlation) > TOGETHER, 1)).tolist():
        words.append(
            f"{names[i]} and {names[j]}: correlation {correlation[i, j]:.4f}, one combination is "
            "known"
        )
    return tuple(words)


def _checked(records: Any) -> dict[Any, TimeSeries]:
    """Records by their sensors."""
    if not isinstance(records, Mapping) or not records:
        raise TensegrityError(
            f"records {check.shown(records)} must be a dict {{trace: TimeSeries}}"
        )
    for sensor, record in records.items():
        for one in sensor if isinstance(sensor, tuple) and sensor else (sensor,):
            check.kind("sensor", one, Trace)
        check.kind(f"record of {sensor}", record, TimeSeries)
        if not record.values.any():
            raise TensegrityError(f"all values of the record of {sensor} are 0")
    return dict(records)


def _guesses(free: Any, scene: Any) -> dict[str, float]:
    """Guesses of parameters, once the scene is found to take them."""
    if not isinstance(free, Mapping) or not free:
        raise TensegrityError(f"free {check.shown(free)} must be a dict {{parameter: guess}}")
    guesses = {}
    for name, value in free.items():
        check.kind("name in free", name, str)
        guesses[name] = check.number(f"guess of {name}", value)
        if name != TRIGGER and not guesses[name]:
            raise TensegrityError(f"guess of {name} is 0: fitted parameters keep their sign")
    if not callable(scene):
        raise TensegrityError(f"scene {check.shown(scene)} is not a function of parameters")
    try:
        signature(scene).bind(**{name: 0 for name in guesses if name != TRIGGER})
    except (TypeError, ValueError) as error:
        raise TensegrityError(f"the function that makes the scene: {error}") from None
    return guesses
