"""Arrival times of the pulses in chains of prisms that differ in prestrain and are struck alike.

Model: equal masses in a row, free at both ends; the first one receives a velocity.  A pulse arrives
at the first peak of the last mass's acceleration, to which the pressure of that end is proportional
if it is a small source (see `radiation`).  The amplitude of the pulse, and hence its speed, is not
known in advance: the arrivals are those of runs, with all prestrains in one batch.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from tensegrity.errors import LockingError, TensegrityError
from tensegrity.measure.observables import passage
from tensegrity.printing import filled, span
from tensegrity.prisms.prism import Prism
from tensegrity.readonly import fixed
from tensegrity.runs.integrate import simulate
from tensegrity.runs.record import Record
from tensegrity.runs.run import Run, RunBatch
from tensegrity.scenes.chain import Chain
from tensegrity.scenes.ensemble import Ensemble
from tensegrity.typing import Array

TOLERANCE = 1e-10  # of the runs; the error of arrivals is then about 1e-8 s
SAMPLES = 32  # prestrains of a range that are run: a batch of efficient size
LEAST = 1e-2  # velocity of the last mass over the initial one at which a pulse has arrived
EXTENSION = 1.6  # factor by which a run is lengthened if some pulse has not arrived
EARLY = 0.5  # duration of the test for locking, over the acoustic travel time per site
PATIENCE = 4.0  # longest run, over the acoustic travel time through the chain
SEARCH_RATIO = 64.0  # factor by which the search for a sufficient range extends either end


class Arrivals(NamedTuple):
    """Arrivals of the pulses of some chains.

    Attributes
    ----------
    t : ndarray, (chains,)
        Time of the first peak of the last mass's acceleration [s].
    width : ndarray, (chains,)
        Duration for which the acceleration exceeds half that peak [s].
    """

    t: Array
    width: Array

    def __str__(self) -> str:
        return filled(f"arrivals {span(self.t, 's')}, pulse widths {span(self.width, 's')}")


class ArrivalRange(NamedTuple):
    """Arrivals over a range of prestrains; the smaller the prestrain, the later the arrival.

    Attributes
    ----------
    prestrains, t : ndarray, (SAMPLES,)
        Increasing prestrains, and their decreasing arrival times [s].
    """

    prestrains: Array
    t: Array

    @property
    def span(self) -> float:
        """Largest delay between two chains of the range [s]."""
        return float(self.t[0] - self.t[-1])

    def prestrain(self, t: Array) -> Array:
        """Prestrain at which the pulse arrives at time t [s], by cubic spline interpolation."""
        return np.exp(self._inverse(t))

    def slope(self, t: Array) -> Array:
        """Relative derivative of that prestrain with respect to t [1/s], < 0."""
        return self._inverse(t, 1)

    @property
    def _inverse(self):  # type: ignore[no-untyped-def]
        from scipy.interpolate import CubicSpline

        return CubicSpline(self.t[::-1], np.log(self.prestrains[::-1]))


@dataclass(frozen=True)
class Struck:
    """Chains that differ in prestrain only.

    Parameters
    ----------
    prism : Prism
        The prism of every chain; its prestrain is replaced.
    sites : int
        Number of masses of a chain.
    mass : float
        Of each site [kg].
    velocity : float
        Initial velocity of the first mass [m/s], > 0 towards the last.
    """

    prism: Prism
    sites: int
    mass: float
    velocity: float

    def scene(self, prestrains: Sequence[float] | Array) -> Ensemble:
        """The chains of these prestrains as an ensemble."""
        springs = {p: replace(self.prism, prestrain=float(p)).potential() for p in set(prestrains)}
        return Ensemble([Chain(springs[p], self.sites, self.mass) for p in prestrains])

    def sound_speed(self, prestrains: Sequence[float] | Array) -> Array:
        """Sound speed of each chain [sites/s]; (chains,)."""
        each = [springs.springs[0].stiffness(0.0) for springs in self.scene(prestrains).scenes]
        return np.sqrt(np.array(each) / self.mass)

    def run(self, prestrains: Sequence[float] | Array, t_end: float, record: Record) -> RunBatch:
        """Run the chains of these prestrains, struck at t = 0.

        Parameters
        ----------
        prestrains : sequence of float or ndarray, (chains,)
        t_end : float
            [s].
        record : Record

        Returns
        -------
        RunBatch
            u [m] and v [m/s] of shape (T, sites, chains).

        Raises
        ------
        LockingError
            The impact makes the bars of a chain meet.
        """
        scene = self.scene(prestrains)
        try:
            return simulate(
                scene, scene.at_rest({0: self.velocity}), t_end, tol=TOLERANCE, record=record
            )
        except LockingError as error:
            raise LockingError(
                f"velocity {self.velocity:g} m/s locks chains of prestrains "
                f"{min(prestrains):g} to {max(prestrains):g}: {error}"
            ) from error

    def arrivals(self, prestrains: Sequence[float] | Array) -> Arrivals:
        """Arrival of the pulse at the end of each chain of these prestrains.

        Raises
        ------
        TensegrityError
            A pulse does not arrive: its energy is dispersed on the way.
        """
        travel = self.sites / self.sound_speed(prestrains)
        last = Record(every=1, sites=(self.sites - 2, self.sites - 1))
        t_end = 1.25 * travel.min()
        while True:
            run = self.run(prestrains, t_end, last)
            arrivals = [self._arrival(one) for one in run]
            if all(arrivals):
                return Arrivals(*(np.array(x) for x in zip(*arrivals, strict=True)))
            if t_end > PATIENCE * travel.max():
                missing = prestrains[arrivals.index(None)]
                raise TensegrityError(
                    f"prestrain {missing:g}: no pulse reaches the end of the chain within "
                    f"{t_end:.4g} s, {t_end / travel.max():.2g} times the acoustic travel time"
                )
            t_end *= EXTENSION

    def _arrival(self, run: Run) -> tuple[float, float] | None:
        """Time and width [s] of one chain's pulse, or None if the run does not cover it."""
        from scipy.interpolate import CubicSpline

        if np.abs(run.v[:, 1]).max() < LEAST * self.velocity:
            return None
        elongation, rate = (x[:, 1] - x[:, 0] for x in (run.u, run.v))
        spring = run.scene.springs[-1]
        push = -spring.tension(elongation) / self.velocity  # scaled force on the last mass
        rise = -spring.stiffness(elongation) * rate / self.velocity
        try:
            t = passage(run.t, np.maximum(push, 0.0), rise)
        except TensegrityError:  # no peak yet
            return None
        curve = CubicSpline(run.t, push)
        crossings = curve.solve(float(curve(t)) / 2, extrapolate=False)
        before, after = crossings[crossings < t], crossings[crossings > t]
        return (t, float(after[0] - before[-1])) if len(before) and len(after) else None


@lru_cache(maxsize=64)
def arrival_range(struck: Struck, low: float, high: float) -> ArrivalRange:
    """Arrivals over a range of prestrains in geometric progression.

    Parameters
    ----------
    struck : Struck
    low, high : float
        Smallest and largest prestrain.

    Returns
    -------
    ArrivalRange

    Raises
    ------
    TensegrityError
        The arrival is not decreasing throughout: after a strong impact it does not depend on a
        small prestrain.
    """
    early = EARLY / float(struck.sound_speed([low])[0])
    # bars meet, if at all, soon after the impact and near the struck mass
    struck.run([low, high], early, Record(sites=(0,)))
    coarse = np.geomspace(low, high, SAMPLES // 4)  # runs of strong impacts are slow: refuse early
    _require_falling(struck, coarse, struck.arrivals(coarse).t)
    prestrains = np.geomspace(low, high, SAMPLES)
    t = struck.arrivals(prestrains).t
    _require_falling(struck, prestrains, t)
    return ArrivalRange(fixed(prestrains), fixed(t))


def _require_falling(struck: Struck, prestrains: Array, t: Array) -> None:
    later = np.flatnonzero(np.diff(t) >= 0)
    if not later.size:
        return
    k, high = int(later[-1]), prestrains[-1]
    within = f"from {prestrains[k + 1]:.4g} to {high:.4g}" if k + 2 < len(t) else "of no part"
    raise TensegrityError(
        f"velocity {struck.velocity:g} m/s: arrival is not monotone in the prestrain, "
        f"{t[k]:.6g} s at {prestrains[k]:.4g} and {t[k + 1]:.6g} s at {prestrains[k + 1]:.4g}; "
        f"it is over prestrains {within}, and over a wider range at a smaller velocity"
    )


def sufficient_range(struck: Struck, low: float, high: float, span: float) -> str:
    """Describe a range of prestrains that gives a span of delays; first smaller, then larger ones.

    Parameters
    ----------
    struck : Struck
    low, high : float
        The range that does not give it.
    span : float
        Required span [s].

    Returns
    -------
    str
    """
    for least, largest in ((low / SEARCH_RATIO, high), (low, high * SEARCH_RATIO)):
        range_ = _monotone_range(struck, low, high, least, largest)
        if range_ is None or range_.span < span:
            continue
        if least < low:
            return f"{range_.prestrain(range_.t[-1] + span):.3g} to {high:.3g} can"
        return f"{low:.3g} to {range_.prestrain(range_.t[0] - span):.3g} can"
    return (
        f"neither smaller ones, to {low / SEARCH_RATIO:.3g}, nor larger ones, to "
        f"{high * SEARCH_RATIO:.3g}, can: longer chains can, or a focus farther away"
    )


def _monotone_range(
    struck: Struck, low: float, high: float, least: float, largest: float
) -> ArrivalRange | None:
    """Arrivals over the largest part of a range on which they decrease, or None if that part is
    not wider than from low to high."""
    while least < low or largest > high:
        try:
            return arrival_range(struck, least, largest)
        except TensegrityError:  # the arrival is not monotone, or the bars meet
            least, largest = min(least * 2, low), max(largest / 2, high)
    return None
