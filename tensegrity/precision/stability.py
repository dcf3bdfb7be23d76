"""Where methods fail on a scene: the largest stable step, and the drift of energy.

A step is unstable if a tiny disturbance grows more than it does in the reference run, by `GROWN`;
bisection finds the largest stable one, in runs of the scene itself.  `simulate` admits steps up to
the method's limit over a bound of the frequency at the elongations reached, and a difference of the
two has reasons that are measured: the bound exceeds the largest frequency of the linearised scene;
growth just beyond the limit is too slow for the length of the run; or the stiffness changes in the
run, so that growth in one state is undone in others.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from tensegrity.engine.methods import Method
from tensegrity.errors import LockingError, TensegrityError
from tensegrity.precision.trials import FAILED, Reference, Trials
from tensegrity.scenes.scene import State
from tensegrity.typing import Array

DISTURBANCE = 1e-9  # of the largest velocity
GROWN = 10.0  # growth of a disturbance over that in the reference run, beyond which a step fails
CLOSE = 0.003  # relative width of the bracket of the largest stable step
MARGIN = 1.5  # of the logarithm of a growth that is estimated
WRONG = 0.1  # error of a run whose states are not those of the reference
AGREES = 0.02  # within which a found step and a predicted one are the same
WIDER, MOST = 1.25, 12  # factor and number of steps tried beyond the limit, or below it
SHORTEST = 4  # steps of a run, at the limit, below which nothing can be found
BEYOND = 1.05  # step over the largest stable one at which failing is watched
DENSE = 400  # coordinates up to which eigenvalues are dense
NUMBERS, STATES = (
    5_000,
    9,
)  # coordinates of all states that are linearised, and least number of these
LONG, LOOKS = 10, 40  # length of the run whose energy is watched, over the scene's; instants
FRACTION = 0.5  # of the stability limit, of its steps
NO_DRIFT = 1e-12  # change of the energy that is round-off
TREND = 3.0  # change of the energy over its scatter, from which it drifts


@dataclass(frozen=True)
class Limit:
    """The largest stable step of a method.

    Attributes
    ----------
    method : str
    found : float
        By bisection [s]; nan where the run has too few steps, inf where nothing grew.
    predicted : float
        Up to which `simulate` accepts steps [s].
    fails : str
        How a run fails just beyond: "growth" of the energy, "locking" of a spring, "drift" of the
        energy, or "error" alone.
    reason : str
        Why found and predicted steps differ by more than 2 %; empty where they do not.
    """

    method: str
    found: float
    predicted: float
    fails: str = ""
    reason: str = ""

    def __str__(self) -> str:
        found = f"found {self.found:.4g} s" if math.isfinite(self.found) else "none found"
        words = [f"{self.method}: {found}, predicted {self.predicted:.4g} s"]
        words += [f"beyond: {self.fails}"] * bool(self.fails) + [self.reason] * bool(self.reason)
        return "; ".join(words)


@dataclass(frozen=True)
class Drift:
    """How far the energy is off with a method, in a run ten times as long as the scene's.

    Attributes
    ----------
    method : str
    dt, t_end : float
        Step, half of the stability limit, and duration [s].
    first, largest : float
        Largest error of the energy within the scene's own duration, and in all, relative.
    drift : float
        Relative change of the energy in one second, by least squares.
    drifts : bool
        Whether that is more than the energy's oscillation.
    """

    method: str
    dt: float
    t_end: float
    first: float
    largest: float
    drift: float
    drifts: bool

    def __str__(self) -> str:
        words = f", drifts by {self.drift:.1e} a second" if self.drifts else ", no drift"
        return f"{self.method}: off by {self.largest:.1e} after {self.t_end:.4g} s{words}"


class Linearised:
    """Largest frequencies of the linearised scene in some states of the reference run.

    Attributes
    ----------
    largest, smallest : float
        Of the largest frequencies of all states [rad/s].
    mean : float
        Largest frequency with the mean stiffness of these states [rad/s].
    """

    def __init__(self, trials: Trials) -> None:
        samples = trials.samples[0]
        count = min(max(NUMBERS // max(samples[0].size, 1), STATES), len(samples))
        at = np.unique(np.linspace(0, len(samples) - 1, count).round().astype(int))
        matrices = [self._matrix(trials, samples[k]) for k in at]
        found = [frequency(one) for one in matrices]
        self.largest, self.smallest = max(found), min(found)
        self.mean = frequency(sum(matrices[1:], matrices[0]) / len(matrices))

    def _matrix(self, trials: Trials, u: Array) -> Any:
        """Stiffness over masses, symmetric."""
        from scipy.sparse import diags_array

        of = trials.dynamics.listed(u)
        weights = np.sqrt(np.asarray(of.inverse_mass, dtype=float))
        weights = np.broadcast_to(weights.reshape(len(u), -1), u.reshape(len(u), -1).shape)
        scaled = diags_array(weights.ravel())
        return scaled @ of.scene.stiffness(u) @ scaled


def frequency(matrix: Any) -> float:
    """Largest frequency of a stiffness over masses [rad/s]."""
    if matrix.shape[0] <= DENSE:
        largest = np.linalg.eigvalsh(matrix.toarray())[-1]
    else:
        from scipy.sparse.linalg import eigsh

        start = np.random.default_rng(0).standard_normal(matrix.shape[0])
        largest = eigsh(matrix, 1, which="LA", v0=start, tol=1e-4, return_eigenvectors=False)[0]
    return math.sqrt(max(float(largest), 0.0))


class Watch:
    """Growth of a disturbance in runs of a scene."""

    def __init__(self, trials: Trials, true: Reference) -> None:
        self.trials, self.true, scene = trials, true, trials.scene
        noise = np.random.default_rng(1).standard_normal(trials.scene.shape)
        fixed = [*scene.held, *getattr(scene, "drive", ())]
        noise[fixed] = 0
        v = trials.state.v + DISTURBANCE * (trials.scale[1] or 1.0) * noise
        self.disturbed = State(trials.state.u, v)
        self._first = float(np.linalg.norm(v - trials.state.v)) or 1.0

    def growth(self, method: Method, dt: float) -> float:
        """Of the disturbance, in a run of about the scene's duration; inf where it failed."""
        steps = max(round(self.trials.t_end / dt), 1)
        try:
            ends = [
                self.trials.run(method, steps, math.inf, state=state, t_end=steps * dt)
                for state in (self.trials.state, self.disturbed)
            ]
        except FAILED:
            return math.inf
        du, dv = ends[1].u - ends[0].u, ends[1].v - ends[0].v
        size = math.hypot(self.trials.fastest * np.linalg.norm(du), np.linalg.norm(dv))
        return size / self._first if math.isfinite(size) else math.inf

    @cached_property
    def linearised(self) -> Linearised:
        return Linearised(self.trials)


def limits(
    trials: Trials, true: Reference, methods: Sequence[Method], share: float
) -> Iterator[Limit]:
    """The largest stable step of each method.

    Parameters
    ----------
    trials : Trials
    true : Reference
    methods : sequence of Method
        Explicit ones.
    share : float
        Of the time allowed, after which no more are begun.

    Yields
    ------
    Limit
    """
    if not hasattr(trials.scene, "stiffness") or not trials.fastest:
        return
    watch = Watch(trials, true)
    for method in methods:
        if trials.used() > share:
            return
        yield _limit(watch, method)


def _limit(watch: Watch, method: Method) -> Limit:
    trials, predicted = watch.trials, method.stability_limit / watch.trials.fastest
    if trials.t_end < SHORTEST * predicted:
        words = f"the run has fewer than {SHORTEST} steps at the limit"
        return Limit(method.name, math.nan, predicted, reason=words)
    usual = GROWN * max(watch.growth(method, predicted / 4), 1.0)

    def stable(dt: float) -> bool:
        return watch.growth(method, dt) <= usual

    low = high = predicted
    if stable(predicted):
        for _ in range(MOST):
            low, high = high, WIDER * high
            if trials.t_end < high or not stable(high):
                break
        else:
            low = math.inf
        if trials.t_end < high:
            low = math.inf
    else:
        for _ in range(MOST):
            low, high = low / WIDER, low
            if stable(low):
                break
    if math.isinf(low):
        words = f"nothing grew in the {math.ceil(trials.t_end / predicted)} steps of the run"
        return Limit(method.name, low, predicted, reason=words)
    while high - low > CLOSE * low:
        middle = (low + high) / 2
        low, high = (middle, high) if stable(middle) else (low, middle)
    reason = "" if _agree(low, predicted) else _reason(watch, method, low, usual)
    return Limit(method.name, low, predicted, _failure(trials, method, BEYOND * low), reason)


def _agree(found: float, other: float) -> bool:
    return abs(found / other - 1) <= AGREES


def _reason(watch: Watch, method: Method, found: float, usual: float) -> str:
    """Why a found step is not the predicted one, or an empty text where nothing explains it.

    The limit at the largest frequency, and at the least of those that the run has, where growth
    has time to be seen, enclose the steps that are explained.
    """
    trials, of, limit = watch.trials, watch.linearised, method.stability_limit
    steps = max(round(trials.t_end / found), 1)
    if of.largest == 0:
        return "no spring acts in the states that were looked at"
    over, least = trials.fastest / of.largest, min(of.smallest, of.mean)
    needed = math.log(usual * math.sqrt(trials.state.u.size))
    seen = visible(method, needed, trials.t_end * of.largest)
    last = visible(method, MARGIN * needed, trials.t_end * least) / least if least else math.inf
    words = []
    if over > 1 + AGREES:
        words.append(f"the bound of the frequency is {over - 1:.1%} above the largest frequency")
    if seen > (1 + AGREES) * limit:
        words.append(
            f"growth is too slow to be seen in a run of {steps} steps up to "
            f"{seen / limit:.3g} of the limit"
        )
    if least < (1 - AGREES) * of.largest:
        words.append(
            f"the stiffness changes in the run: its largest frequency is {of.smallest:.3g} to "
            f"{of.largest:.3g} rad/s, that of the mean stiffness {of.mean:.3g}"
        )
    whole = AGREES + 0.5 / steps  # growth is seen after whole steps
    if (1 - AGREES) * limit / of.largest <= found <= (1 + whole) * last and words:
        return "; ".join(words)
    if trials.dynamics.is_driven:
        return "forces depend on time or velocity, which change the growth"
    run = trials.run(method, steps, math.inf, t_end=steps * found)
    off, reached = trials.gap(run.u, run.v, watch.true), run.march.fastest
    if found < limit / of.largest and (off > WRONG or reached > (1 + AGREES) * of.largest):
        return (
            f"runs with such steps are off by {off:.2g} and meet other states, whose frequencies "
            f"may be {reached:.3g} rad/s, for {of.largest:.3g} of those that were linearised"
        )
    return ""


def visible(method: Method, needed: float, duration: float) -> float:
    """The smallest dt * omega at which an oscillator's amplitude grows so much in a run.

    Parameters
    ----------
    method : Method
    needed : float
        Logarithm of the growth.
    duration : float
        Of the run, times omega.

    Returns
    -------
    float
    """
    z = method.stability_limit * np.linspace(1, 8, 20_001)[1:]
    xx, xv, vx, vv = method.step_matrix(z)
    half, determinant = (xx + vv) / 2, xx * vv - xv * vx
    root = np.sqrt((half**2 - determinant).astype(complex))
    rate = np.log(np.maximum(np.abs(half + root), np.abs(half - root)))
    grown = np.flatnonzero(rate * duration / z >= needed)
    return float(z[grown[0]]) if grown.size else math.inf


def _failure(trials: Trials, method: Method, dt: float) -> str:
    """How a run fails with a step: growth, locking, drift, or by its error alone."""
    try:
        end = trials.run(method, max(round(trials.t_end / dt), 1), math.inf)
        first, last = (_energies(trials, s.u[None], s.v[None])[0] for s in (trials.state, end))
    except (LockingError, TensegrityError) as error:
        locks = isinstance(error, LockingError) or "end of its domain" in str(error)
        return "locking" if locks else "growth"
    if trials.dynamics.is_driven:
        return "error"
    change = last / first - 1 if first else last
    return "growth" if change > 1 else "drift" if abs(change) > AGREES else "error"


def _energies(trials: Trials, u: Array, v: Array) -> Array:
    """Energies of states [J]."""
    return np.asarray(trials.dynamics.energies(u, v))


def drifts(trials: Trials, methods: Sequence[Method], share: float) -> Iterator[Drift]:
    """The error of the energy of each method; none of scenes whose energy is not conserved.

    Parameters
    ----------
    trials : Trials
    methods : sequence of Method
    share : float
        Of the time allowed, after which no more are begun.

    Yields
    ------
    Drift
    """
    if trials.dynamics.is_driven or trials.dynamics.batch or not trials.fastest:
        return
    for method in methods:
        if trials.used() > share:
            return
        t_end = LONG * trials.t_end
        least = trials.steps(method, FRACTION * method.stability_limit / method.scale)
        steps = LOOKS * math.ceil(LONG * least / LOOKS)
        try:
            end = trials.run(method, steps, instants=LOOKS, t_end=t_end)
            found = _energies(trials, *end.march.samples)
        except (LockingError, TensegrityError):
            continue
        kinetic = found.max() - found.min() if not found[0] else 0.0
        error = found / found[0] - 1 if found[0] else found / (kinetic or 1.0)
        if not np.isfinite(error).all():
            continue
        t = np.linspace(0, 1, LOOKS + 1)
        slope, at_first = np.polyfit(t, error, 1)
        scatter = float(np.std(error - slope * t - at_first))
        own = error[: LOOKS // LONG + 1]
        yield Drift(
            method.name,
            t_end / steps,
            t_end,
            float(np.max(np.abs(own))),
            float(np.max(np.abs(error))),
            float(slope / t_end),
            bool(abs(slope) > max(TREND * scatter, NO_DRIFT)),
        )
