"""Chains of prisms of different prestrains, struck alike: when their pulses come to the end.

Model: equal masses in a row, free at both ends, the first one set in motion.  A pulse arrives at
the first peak of the last mass's acceleration, which is what that end radiates as a small source
(see `radiation`).  The crest that a blow makes, and so its speed, is not known beforehand:
arrivals are those of runs, all prestrains side by side in one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from tensegrity.errors import LockingError, TensegrityError
from tensegrity.measure.observables import passage
from tensegrity.prisms.prism import Prism
from tensegrity.readonly import fixed
from tensegrity.runs.integrate import simulate
from tensegrity.runs.record import Record
from tensegrity.runs.run import Run, RunBatch
from tensegrity.scenes.chain import Chain
from tensegrity.scenes.ensemble import Ensemble
from tensegrity.typing import Array

TOLERANCE = 1e-10  # of the runs: arrivals are then within 1e-8 s or so
SAMPLES = 32  # prestrains of a range that are run: as many chains as a processor likes
LEAST = 1e-2  # of the blow's velocity: a last mass that was never so fast has seen no pulse
EXTENSION = 1.6  # a run in which some pulse does not arrive is done again, so much longer
EARLY = 0.5  # of the time that sound takes for a site: so long the first prism is watched
PATIENCE = 4.0  # of the time that sound takes: no pulse comes later
SEARCH_RATIO = 64.0  # factor by which the search for a sufficient range extends either end


class Arrivals(NamedTuple):
    """Of the pulses of some chains, (chains,) each.

    Attributes
    ----------
    t : ndarray
        First peak of the last mass's acceleration [s].
    width : ndarray
        How long the acceleration stays above half that peak [s].
    """

    t: Array
    width: Array


class ArrivalRange(NamedTuple):
    """Arrivals over a range of prestrains; later for smaller ones.

    Attributes
    ----------
    prestrains, t : ndarray, (SAMPLES,)
        Prestrains increase, arrivals [s] fall.
    """

    prestrains: Array
    t: Array

    @property
    def span(self) -> float:
        """Of all delays that can be had between two chains, the longest [s]."""
        return float(self.t[0] - self.t[-1])

    def prestrain(self, t: Array) -> Array:
        """At which pulses arrive then, by the cubic spline through the samples."""
        return np.exp(self._inverse(t))

    def slope(self, t: Array) -> Array:
        """Relative change of that prestrain with the instant [1/s], < 0."""
        return self._inverse(t, 1)

    @property
    def _inverse(self):  # type: ignore[no-untyped-def]
        from scipy.interpolate import CubicSpline

        return CubicSpline(self.t[::-1], np.log(self.prestrains[::-1]))


@dataclass(frozen=True)
class Struck:
    """Chains that differ in their prestrain alone.

    Parameters
    ----------
    prism : Prism
        Of every chain, but for its prestrain.
    sites : int
        Masses of a chain.
    mass : float
        Of each [kg].
    velocity : float
        Given to the first mass [m/s], > 0 towards the last.
    """

    prism: Prism
    sites: int
    mass: float
    velocity: float

    def scene(self, prestrains: Sequence[float] | Array) -> Ensemble:
        """The chains of these prestrains, side by side."""
        springs = {p: replace(self.prism, prestrain=float(p)).potential() for p in set(prestrains)}
        return Ensemble([Chain(springs[p], self.sites, self.mass) for p in prestrains])

    def sound_speed(self, prestrains: Sequence[float] | Array) -> Array:
        """Of small waves in each chain [sites/s]."""
        each = [springs.springs[0].stiffness(0.0) for springs in self.scene(prestrains).scenes]
        return np.sqrt(np.array(each) / self.mass)

    def run(self, prestrains: Sequence[float] | Array, t_end: float, record: Record) -> RunBatch:
        """All of them, struck at t = 0."""
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
        """When the pulse of each chain comes to its end.

        Raises
        ------
        TensegrityError
            If one does not come: all that the blow gave is left behind on the way.
        """
        travel = self.sites / self.sound_speed(prestrains)
        last = Record(every=1, sites=(self.sites - 2, self.sites - 1))
        t_end = 1.25 * travel.min()
        while True:
            run = self.run(prestrains, t_end, last)
            found = [self._arrival(one) for one in run]
            if all(found):
                return Arrivals(*(np.array(x) for x in zip(*found, strict=True)))
            if t_end > PATIENCE * travel.max():
                missing = prestrains[found.index(None)]
                raise TensegrityError(
                    f"prestrain {missing:g}: no pulse comes to the end of the chain within "
                    f"{t_end:.4g} s, {t_end / travel.max():.2g} times what sound takes"
                )
            t_end *= EXTENSION

    def _arrival(self, run: Run) -> tuple[float, float] | None:
        """Instant and width [s] of one chain's pulse, or None where it is not seen as a whole."""
        from scipy.interpolate import CubicSpline

        if np.abs(run.v[:, 1]).max() < LEAST * self.velocity:
            return None
        elongation, rate = (x[:, 1] - x[:, 0] for x in (run.u, run.v))
        spring = run.scene.springs[-1]
        push = -spring.tension(elongation) / self.velocity  # of the last bond on the last mass
        rise = -spring.stiffness(elongation) * rate / self.velocity
        try:
            t = passage(run.t, np.maximum(push, 0.0), rise)
        except TensegrityError:  # no crest yet
            return None
        curve = CubicSpline(run.t, push)
        crossings = curve.solve(float(curve(t)) / 2, extrapolate=False)
        before, after = crossings[crossings < t], crossings[crossings > t]
        return (t, float(after[0] - before[-1])) if len(before) and len(after) else None


@lru_cache(maxsize=64)
def arrival_range(struck: Struck, low: float, high: float) -> ArrivalRange:
    """Arrivals between two prestrains, in equal ratios.

    Raises
    ------
    TensegrityError
        If arrivals do not fall throughout: at large blows they do not depend on a small prestrain.
    """
    early = EARLY / float(struck.sound_speed([low])[0])
    # where bars come into contact they do so at the start, near the struck mass
    struck.run([low, high], early, Record(sites=(0,)))
    coarse = np.geomspace(low, high, SAMPLES // 4)  # at large blows runs take long: refuse early
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
        f"it is over prestrains {within}, and over more of them at a smaller velocity"
    )


def sufficient_range(struck: Struck, low: float, high: float, span: float) -> str:
    """Which prestrains can give such a span [s], in words; smaller ones first, then larger."""
    for least, largest in ((low / SEARCH_RATIO, high), (low, high * SEARCH_RATIO)):
        found = _monotone_range(struck, low, high, least, largest)
        if found is None or found.span < span:
            continue
        if least < low:
            return f"{found.prestrain(found.t[-1] + span):.3g} to {high:.3g} can"
        return f"{low:.3g} to {found.prestrain(found.t[0] - span):.3g} can"
    return (
        f"neither smaller ones, to {low / SEARCH_RATIO:.3g}, nor larger ones, to "
        f"{high * SEARCH_RATIO:.3g}, can: longer chains can, or a focus farther away"
    )


def _monotone_range(
    struck: Struck, low: float, high: float, least: float, largest: float
) -> ArrivalRange | None:
    """Arrivals over as much of a range, from one of its ends, as they fall over; it has to be
    wider than from low to high."""
    while least < low or largest > high:
        try:
            return arrival_range(struck, least, largest)
        except TensegrityError:  # not monotone, or the bars meet
            least, largest = min(least * 2, low), max(largest / 2, high)
    return None
