"""Acoustic radiation of the ends of chains into a linear fluid: Rayleigh's integral.

Model: each end is a rigid circular piston in an infinite rigid baffle, y = 0, and moves along y;
the fluid is linear and lossless, fills y > 0 and does not react on the ends.  Then
p = rho/(2 pi) int a(t - R/c)/R dS over the piston.  The integral over R, at a fixed angle about
the projection of the point on the baffle, is elementary, and an integral along the rim remains:
p = rho c [v(t - y/c) if the projection is on the piston, - (1/pi) int_0^pi v(t - R/c) dtheta/dpsi
dpsi], the plane wave and the edge wave.  A piston that is small compared with the distance and the
length of the pulse acts as a point source: p = rho A a(t - R/c)/(2 pi R).
The integral along the rim is computed by the trapezoidal rule for a periodic function, which
converges exponentially; its nodes are denser where the rim is near, and their number is doubled
until an estimate of the error is small, however short the pulse is compared with the acoustic
travel time across an end.
Rayleigh, The Theory of Sound, 278; the edge wave: Tupholme, Mathematika 16, 209 (1969),
Stepanishen, J. Acoust. Soc. Am. 49, 1629 (1971).

Focusing: if all pulses arrive at the focus at the same time, the pressure there is the largest that
these ends can produce, the sum of their separate peaks; `alignment` measures this.  It is not the
largest pressure on the axis, because points in front of the focus are nearer to the ends, whose
pressures decay like 1/R.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from tensegrity.errors import ResolutionError, TensegrityError
from tensegrity.printing import filled
from tensegrity.typing import Array

TOLERANCE = 1e-9  # error over the largest pressure that the velocity or acceleration permits
ROUND_OFF = 2e-15  # relative round-off of velocities and of times
FEWEST, MOST = 4, 2**18  # nodes along half a rim: per change of the velocity, and in all
SLOWEST = 1024  # largest number of such changes during the travel from a centre to its rim
SLOW = 0.9  # largest ratio of successive changes of an integral in the error estimate
CLOSE = 0.5  # ratio near/far above which a point counts as close to the rim
STEEPEST_MAP = 1 - 1e-10  # parameter m up to which SciPy's elliptic functions are accurate
SMALLEST = 1e-300  # avoids division by 0
SELF, RADII, ANGLES = 16, 2, 3  # nodes on an end: along a radius for itself; for the others
LOOKS = 401  # times among which the peak of one end is bracketed
FINE, COARSE = 0.02, 0.1  # spacing of such times for the lens, over the width of the pulse
AXIS = 0.5, 1.5  # range of the axis that is searched, over the distance of the focus
PLACES = 81  # points of that range
SIMPLEX = ((0.0, 0.0), (0.5, 0.0), (0.0, 0.5))  # initial simplex in steps of place and time


@dataclass(frozen=True, eq=False)
class Ends:
    """Circular pistons along a line, at rest until t = 0.

    Parameters
    ----------
    places : ndarray, (ends,)
        x of their centres [m].
    area : float
        Area of each piston [m^2].
    density, speed : float
        Density [kg/m^3] and sound speed [m/s] of the fluid.
    t : ndarray, (T,)
        Recorded times [s].
    velocity : ndarray, (T, ends)
        Velocities of the pistons [m/s], > 0 into the fluid.
    """

    places: Array
    area: float
    density: float
    speed: float
    t: Array
    velocity: Array

    @property
    def radius(self) -> float:
        """Radius of a piston [m]."""
        return math.sqrt(self.area / math.pi)

    def as_pistons(self, points: Array, t: Array) -> Iterator[Array]:
        """Iterate over the ends' pressures [Pa], each (*t.shape, *points.shape[:-1]).

        Parameters
        ----------
        points : ndarray, (..., 2)
            x, y >= 0 [m].
        t : ndarray, (...)
            Times [s], up to the last recorded one.
        """
        for place, curve in zip(self.places, self._curves(), strict=True):
            yield self._radiated(place, curve, points, t)

    def _radiated(self, place: float, curve: Any, points: Array, t: Array) -> Array:
        """Pressure [Pa] of a piston whose velocity is the spline `curve`."""
        from scipy.special import ellipj, ellipkm1

        times, (x, y) = t.reshape(-1, 1), points.reshape(-1, 2).T
        off = np.abs(x - place)  # distance of the point's projection from the centre
        near, far = np.minimum(off, self.radius), np.maximum(off, self.radius)
        ratio, inside, nearest = near / far, off < self.radius, np.hypot(y, far - near)

        def at(distance: Array) -> Array:
            return _since_start(curve, times - distance / self.speed)

        # subtracted from the integrand: the remainder is small, and smooth at the pole of 1/squared
        taken = at(np.where(ratio > CLOSE, y, nearest))
        gap = (1 - ratio) ** 2
        # the elliptic map of the nodes has the branch points of the integrand in psi
        m = np.minimum(4 * ratio / (4 * ratio + gap + (y / far) ** 2), STEEPEST_MAP)
        quarter = ellipkm1(1 - m)

        def rim(part: float, k: Any) -> Array:
            _, cn, dn, _ = ellipj(part * quarter[k], m[k])  # cn = sin(psi/2)
            squared = gap[k] + 4 * ratio[k] * cn**2
            weight = np.where(inside[k], 1.0, ratio[k] ** 2) - ratio[k] * (1 - 2 * cn**2)
            weight *= 2 / np.pi * quarter[k] * dn / np.maximum(squared, SMALLEST)
            return (at(np.hypot(y[k], far[k] * np.sqrt(squared))) - taken[:, k]) * weight

        fastest, steepest = (float(np.abs(f(self.t)).max()) for f in (curve, curve.derivative()))
        with np.errstate(divide="ignore"):
            afar = self.area * steepest / (2 * np.pi * self.speed * nearest)
        least = TOLERANCE * np.minimum(fastest, afar)
        least += ROUND_OFF * (fastest + steepest * np.abs(times).max(initial=0.0))
        nodes = FEWEST * quarter * self._changes(fastest, steepest)
        total = np.where(inside, at(y) - taken, 0.0) - _mean(rim, least, nodes)
        whole = self.density * self.speed * total
        return np.asarray(whole.reshape((*t.shape, *points.shape[:-1])))

    def _changes(self, fastest: float, steepest: float) -> float:
        """Number of changes of the velocity during the acoustic travel from centre to rim, >= 1."""
        way = self.radius / self.speed
        changes = max(steepest * way / max(fastest, SMALLEST), 1.0)
        if changes > SLOWEST:
            raise ResolutionError(
                f"host_speed {self.speed:g} m/s: during the {way:.3g} s that a wave travels from "
                f"the centre of an end to its rim the velocity changes {changes:.3g} times, must "
                f"be at most {SLOWEST}"
            )
        return changes

    def peaks(self, point: Array, around: Array, within: Array) -> Array:
        """Times at which the pressures of the separate ends have their peaks at a point.

        Parameters
        ----------
        point : ndarray, (2,)
            x, y >= 0 [m].
        around, within : ndarray, (ends,)
            Centre and half-width of the interval of time that is searched for each end [s].

        Returns
        -------
        ndarray, (ends,)
            [s].

        Raises
        ------
        TensegrityError
            There is no peak in some interval.
        """
        from scipy.optimize import brentq

        instants = []
        curves = zip(self.places, self._curves(), around, within, strict=True)
        for place, curve, middle, most in curves:
            t = np.linspace(max(middle - most, 0.0), middle + most, LOOKS)
            k = int(np.argmax(self._radiated(place, curve, point, t)[1:-1])) + 1
            rate = curve.derivative()

            def rising(t: float, place: float = place, rate: Any = rate) -> float:
                return float(self._radiated(place, rate, point, np.array(t)))

            if not rising(t[k - 1]) > 0 > rising(t[k + 1]):
                raise TensegrityError(
                    f"the pressure of the end at x = {place:g} m has no peak at "
                    f"{tuple(point.tolist())} m within {most:.3g} s of {middle:.6g} s"
                )
            instants.append(brentq(rising, t[k - 1], t[k + 1], xtol=1e-14 * t[k], rtol=1e-14))
        return np.array(instants)

    def as_points(self, points: Array, t: Array) -> Iterator[Array]:
        """Iterate over the ends' pressures [Pa] as point sources, for ends much smaller than the
        distance and the length of the pulse; inf at their centres.  Arguments as `as_pistons`."""
        times, (x, y) = t[(...,) + (None,) * (points.ndim - 1)], np.moveaxis(points, -1, 0)
        for place, curve in zip(self.places, self._curves(), strict=True):
            distance = np.hypot(x - place, y)
            acceleration = _since_start(curve.derivative(), times - distance / self.speed)
            with np.errstate(divide="ignore", invalid="ignore"):
                yield self.density * self.area * acceleration / (2 * np.pi * distance)

    def energy(self) -> float:
        """Energy radiated until the last recorded time [J]: work of the pressures on the ends."""
        from scipy.interpolate import make_interp_spline

        t = np.linspace(0.0, self.t[-1], len(self.t) // 2)
        power, curves = np.zeros(len(t)), self._curves()
        for place, source in zip(self.places, curves, strict=True):
            faces = [_face(self.radius, abs(end - place)) for end in self.places]
            off, weights = (np.concatenate(x) for x in zip(*faces, strict=True))
            on_faces = self._radiated(place, source, np.stack([place + off, 0 * off], -1), t)
            ends = np.repeat(np.arange(len(curves)), [len(face[0]) for face in faces])
            velocities = np.stack([curve(t) for curve in curves], axis=-1)
            power += np.sum(on_faces * weights * velocities[:, ends], axis=1)
        return float(self.area * make_interp_spline(t, power, k=5).integrate(0.0, t[-1]))

    def _curves(self) -> list[Any]:
        """Velocity of each end as a quintic spline."""
        from scipy.interpolate import make_interp_spline

        return [make_interp_spline(self.t, v, k=5) for v in self.velocity.T]


def _face(radius: float, separation: float) -> tuple[Array, Array]:
    """Nodes of a quadrature over a piston: their distances from a centre at a `separation`, and the
    weights of the mean; Gauss points in the square of the radius, equally spaced angles."""
    nodes, weights = np.polynomial.legendre.leggauss(SELF if separation == 0 else RADII)
    angle = np.pi * (np.arange(1 if separation == 0 else ANGLES) + 0.5) / ANGLES
    r = radius * np.sqrt((1 + nodes) / 2)
    off = np.abs(separation + r[:, None] * np.exp(1j * angle)).ravel()
    return off, np.repeat(weights / 2, len(angle)) / len(angle)


def _mean(rim: Callable[[float, Any], Array], least: Array, fewest: Array) -> Array:
    """Mean over a period of an even function of an angle by the trapezoidal rule.

    The number of nodes is doubled, reusing the previous ones, until the sum of all further changes,
    estimated as a geometric series from the last two, is at most `least` at each point.

    Parameters
    ----------
    rim : callable
        Values (T, n) at a fraction of half the period, for the indices of n points.
    least : ndarray, (points,)
        Admissible error of the mean at each point.
    fewest : ndarray, (points,)
        Smallest number of nodes along half the period for each point.

    Returns
    -------
    ndarray, (T, points)

    Raises
    ------
    ResolutionError
        `MOST` nodes do not suffice.
    """
    k, nodes = np.arange(len(least)), math.ceil(fewest.min(initial=MOST))
    total = (rim(0.0, k) + rim(1.0, k)) / 2
    for j in range(1, nodes):
        total += rim(j / nodes, k)
    mean, change = total / nodes, np.zeros(len(least))
    while k.size:
        nodes *= 2
        if nodes > MOST:
            raise ResolutionError(
                f"{MOST} nodes along a rim leave an error of {(change[k] / least[k]).max():.2g} "
                "times the admissible one: a point lies too close to the rim"
            )
        for j in range(1, nodes, 2):
            total[:, k] += rim(j / nodes, k)
        new = total[:, k] / nodes
        before, change[k] = change[k], np.abs(new - mean[:, k]).max(axis=0, initial=0.0)
        mean[:, k] = new
        ratio = np.minimum(change[k] / np.maximum(before, SMALLEST), SLOW)
        left = change[k] * ratio / (1 - ratio)  # the rest of a geometric series
        k = k[(left > least[k]) | (nodes < fewest[k])]
    return mean


def _since_start(curve: Any, t: Array) -> Array:
    return np.where(t > 0, curve(np.maximum(t, 0.0)), 0.0)


@dataclass(frozen=True)
class Focusing:
    """Measures of how well a lens focuses; computed by `Lens.focusing`.

    Attributes
    ----------
    peak : float
        Peak pressure at the focus [Pa].
    alignment : float
        `peak` over the sum of the peak pressures of the separate ends there: 1 if all pulses arrive
        at the same time, whatever their amplitudes.
    gain : float
        `peak` over that of the same chains with equal prestrains, the median of those chosen.
    place : float
        y [m] of the largest pressure on the line through the focus normal to the baffle, between
        0.5 and 1.5 times the y of the focus.
    largest : float
        Peak pressure at that point [Pa].
    transmitted : float
        Energy radiated by the ends until 1.25 times the last arrival, over that of all impacts.
    focus : float
        y of the focus [m].
    """

    peak: float
    alignment: float
    gain: float
    place: float
    largest: float
    transmitted: float
    focus: float

    def __str__(self) -> str:
        low, high = (part * self.focus for part in AXIS)
        more = 100 * (self.largest / self.peak - 1)
        return filled(
            f"peak at the focus {self.peak:.4g} Pa, {self.gain:.3g} times that of equal chains\n"
            f"alignment: 1 - {1 - self.alignment:.1e} of the sum of the peaks of each end alone\n"
            f"largest on the axis, y = {low:.4g} to {high:.4g} m: {self.largest:.4g} Pa at y = "
            f"{self.place:.4g} m, {more:.2f} % above the focus at y = {self.focus:g} m\n"
            f"transmitted: {100 * self.transmitted:.3g} % of the energy of the impacts"
        )

    __repr__ = __str__


def focusing(lens: Any, transmitted: float) -> Focusing:
    """The focusing of a lens from its pressures; `transmitted` as in `Focusing`."""
    x, y = lens.focus
    pulse = float(lens.pulse_widths.min())
    peak = _top(lambda t: lens.pressure(lens.focus, t), lens.focus_time, 2 * pulse, FINE * pulse)
    each = np.diagonal(lens.pressures(lens.focus, lens.focus_arrivals), axis1=0, axis2=1)
    equal = np.full(lens.chains, np.median(lens.chain_prestrains))
    seen = lens.arrivals_of(equal).t + lens.distances / lens.host_speed
    middle, within = (seen.max() + seen.min()) / 2, np.ptp(seen) / 2 + 2 * pulse
    gain = peak / _top(lambda t: lens.pressure(lens.focus, t, equal), middle, within, FINE * pulse)
    place, largest = _largest(lens, x, y, pulse)
    return Focusing(peak, min(peak / float(each.sum()), 1.0), gain, place, largest, transmitted, y)


def _top(pressure: Callable[[Array], Array], middle: float, within: float, step: float) -> float:
    """Largest value of a function of time within an interval."""
    from scipy.optimize import minimize_scalar

    t = np.arange(middle - within, middle + within, step)
    best = float(t[np.argmax(pressure(t))])
    ends = (best - step, best + step)
    highest = minimize_scalar(
        lambda t: -float(pressure(t)), bounds=ends, method="bounded", options={"xatol": 1e-6 * step}
    )
    return -float(highest.fun)


def _largest(lens: Any, x: float, y: float, pulse: float) -> tuple[float, float]:
    """Position [m] and value [Pa] of the largest pressure on the axis."""
    from scipy.optimize import minimize

    low, high = AXIS
    places = np.linspace(low * y, high * y, PLACES)
    way = (high - low) * y / lens.host_speed
    t = lens.focus_time + np.arange(-way / 2 - 2 * pulse, way / 2 + 2 * pulse, COARSE * pulse)
    pressures = lens.pressure(np.stack([np.full(PLACES, x), places], axis=-1), t)
    i, k = np.unravel_index(np.argmax(pressures), pressures.shape)
    start, steps = np.array([places[k], t[i]]), np.array([places[1] - places[0], COARSE * pulse])

    def lower(moved: Array) -> float:
        place, instant = start + moved * steps
        return -float(lens.pressure((x, place), instant)) / pressures[i, k]

    ends = (places[[0, -1]] - start[0]) / steps[0]
    bounds, options = [tuple(ends), (-2.0, 2.0)], {"initial_simplex": SIMPLEX, "xatol": 1e-4}
    top = minimize(lower, [0.0, 0.0], method="Nelder-Mead", bounds=bounds, options=options)
    return float(start[0] + top.x[0] * steps[0]), float(-top.fun * pressures[i, k])
