"""Sound that ends of chains radiate into a linear fluid behind a baffle: Rayleigh's integral.

Model: each end is a rigid circular piston in an infinite rigid plane, y = 0, and moves along y;
the fluid, linear and without loss, fills y > 0 and does not act back on the ends.  Then
p = rho/(2 pi) int a(t - R/c)/R dS over the piston.  The integral over R, at a fixed angle about
the point's foot on the plane, can be done, and what is left runs along the rim:
p = rho c [v(t - y/c) where the foot is on the piston, - (1/pi) int_0^pi v(t - R/c) dtheta/dpsi
dpsi], the plane wave and the wave of the rim.  A piston that is small against the distance and
the pulse is a point: p = rho A a(t - R/c)/(2 pi R).
The integral along the rim is taken by the trapezoidal rule of a period, which converges
exponentially; its nodes lie denser where the rim is near and are doubled until an estimate of its
error is small, however short the pulse is on sound's way across an end.
Rayleigh, The Theory of Sound, 278; the wave of the rim: Tupholme, Mathematika 16, 209 (1969),
Stepanishen, J. Acoust. Soc. Am. 49, 1629 (1971).

How well a lens focuses: that all pulses come to the focus at the same instant makes the pressure
there as large as these ends can make it, the sum of what each makes alone: alignment.  It is not
the largest pressure on the axis: a place before the focus is nearer to the ends, whose pressures
fall like 1/R.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from tensegrity.errors import ResolutionError, TensegrityError
from tensegrity.typing import Array

TOLERANCE = 1e-9  # of the pressure that an end's fastest or steepest motion could make at most
ROUND_OFF = 2e-15  # of velocities, and of what they change by in the last digits of instants
FEWEST, MOST = 4, 2**18  # nodes along half a rim; per change of the velocity on sound's way
SLOWEST = 1024  # such changes on the way from a centre to its rim, at most
SLOW = 0.9  # ratio of two changes of an integral by which the next ones are told, at most
CLOSE = 0.5  # near over far of a rim from which a point is close to it
STEEPEST_MAP = 1 - 1e-10  # parameter m up to which SciPy's elliptic functions are exact
SMALLEST = 1e-300
SELF, RADII, ANGLES = 16, 2, 3  # nodes on an end: along a radius for itself; for the others
LOOKS = 401  # instants among which a peak is looked for
FINE, COARSE = 0.02, 0.1  # of the pulse, between instants among which a peak is looked for
AXIS = 0.5, 1.5  # of the way to the focus: where on the axis it is looked for
PLACES = 81  # there
SIMPLEX = ((0.0, 0.0), (0.5, 0.0), (0.0, 0.5))  # in steps of place and instant


@dataclass(frozen=True, eq=False)
class Ends:
    """Pistons along a line, at rest until t = 0.

    Parameters
    ----------
    places : ndarray, (ends,)
        x of their centres [m].
    area : float
        Of each [m^2].
    density, speed : float
        Of the fluid [kg/m^3], of sound in it [m/s].
    t : ndarray, (T,)
        Recorded instants [s].
    velocity : ndarray, (T, ends)
        Of the pistons, into the fluid [m/s].
    """

    places: Array
    area: float
    density: float
    speed: float
    t: Array
    velocity: Array

    @property
    def radius(self) -> float:
        """Of a piston [m]."""
        return math.sqrt(self.area / math.pi)

    def as_pistons(self, points: Array, t: Array) -> Iterator[Array]:
        """Pressure [Pa] that each end makes, (*t.shape, *points.shape[:-1]) at a time.

        Parameters
        ----------
        points : ndarray, (..., 2)
            x, y >= 0 [m].
        t : ndarray, (...)
            [s], up to the last recorded instant.
        """
        for place, curve in zip(self.places, self._curves(), strict=True):
            yield self._radiated(place, curve, points, t)

    def _radiated(self, place: float, curve: Any, points: Array, t: Array) -> Array:
        """What a piston makes there of which `curve` is the velocity: its pressure."""
        from scipy.special import ellipj, ellipkm1

        times, (x, y) = t.reshape(-1, 1), points.reshape(-1, 2).T
        off = np.abs(x - place)  # of the foot from the centre
        near, far = np.minimum(off, self.radius), np.maximum(off, self.radius)
        ratio, inside, nearest = near / far, off < self.radius, np.hypot(y, far - near)

        def at(distance: Array) -> Array:
            return _since_start(curve, times - distance / self.speed)

        # taken off all: what is left is small and, as 1/squared has its pole at y, smooth
        taken = at(np.where(ratio > CLOSE, y, nearest))
        gap = (1 - ratio) ** 2
        # the integrand's branch points in psi are those of the nodes' map, an elliptic function
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
        """How often a velocity can change while sound goes from a centre to its rim, at least 1."""
        way = self.radius / self.speed
        changes = max(steepest * way / max(fastest, SMALLEST), 1.0)
        if changes > SLOWEST:
            raise ResolutionError(
                f"host_speed {self.speed:g} m/s: on the {way:.3g} s of sound's way from the centre "
                f"of an end to its rim its velocity changes {changes:.3g} times, must be at most "
                f"{SLOWEST}"
            )
        return changes

    def peaks(self, point: Array, around: Array, within: Array) -> Array:
        """When the pressure of each end alone is largest at a point [s]; (ends,).

        Parameters
        ----------
        point : ndarray, (2,)
            x, y >= 0 [m].
        around, within : ndarray, (ends,)
            The instants looked at: [s], so much on either side of each.

        Raises
        ------
        TensegrityError
            There is none.
        """
        from scipy.optimize import brentq

        found = []
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
            found.append(brentq(rising, t[k - 1], t[k + 1], xtol=1e-14 * t[k], rtol=1e-14))
        return np.array(found)

    def as_points(self, points: Array, t: Array) -> Iterator[Array]:
        """The same for ends much smaller than the distance and the pulse; inf at their centres."""
        times, (x, y) = t[(...,) + (None,) * (points.ndim - 1)], np.moveaxis(points, -1, 0)
        for place, curve in zip(self.places, self._curves(), strict=True):
            distance = np.hypot(x - place, y)
            acceleration = _since_start(curve.derivative(), times - distance / self.speed)
            with np.errstate(divide="ignore", invalid="ignore"):
                yield self.density * self.area * acceleration / (2 * np.pi * distance)

    def energy(self) -> float:
        """What the ends radiate until the last recorded instant [J]: the work of all pressures."""
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
        """Velocity of each end as a spline of fifth degree."""
        from scipy.interpolate import make_interp_spline

        return [make_interp_spline(self.t, v, k=5) for v in self.velocity.T]


def _face(radius: float, separation: float) -> tuple[Array, Array]:
    """Distances of nodes on a piston at a `separation` from its centre, weights of their
    mean: Gauss's in the square of the radius, equal angles."""
    nodes, weights = np.polynomial.legendre.leggauss(SELF if separation == 0 else RADII)
    angle = np.pi * (np.arange(1 if separation == 0 else ANGLES) + 0.5) / ANGLES
    r = radius * np.sqrt((1 + nodes) / 2)
    off = np.abs(separation + r[:, None] * np.exp(1j * angle)).ravel()
    return off, np.repeat(weights / 2, len(angle)) / len(angle)


def _mean(rim: Callable[[float, Any], Array], least: Array, fewest: Array) -> Array:
    """Mean over a period of an even function of an angle by the trapezoidal rule.

    Nodes are doubled, those before taken over, until what all further doublings would change, a
    geometric series by the last two changes, is at most `least` at each point.

    Parameters
    ----------
    rim : callable
        Of a part of half the period and numbers of points: values (T, their count).
    least : ndarray, (points,)
        Error of each point's mean that is small enough at all T.
    fewest : ndarray, (points,)
        Nodes along half the period that each point needs at least.

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
                "times that allowed, must be 1: a point lies too close to the rim"
            )
        for j in range(1, nodes, 2):
            total[:, k] += rim(j / nodes, k)
        new = total[:, k] / nodes
        before, change[k] = change[k], np.abs(new - mean[:, k]).max(axis=0, initial=0.0)
        mean[:, k] = new
        ratio = np.minimum(change[k] / np.maximum(before, SMALLEST), SLOW)
        left = change[k] * ratio / (1 - ratio)  # as of a geometric series
        k = k[(left > least[k]) | (nodes < fewest[k])]
    return mean


def _since_start(curve: Any, t: Array) -> Array:
    return np.where(t > 0, curve(np.maximum(t, 0.0)), 0.0)


@dataclass(frozen=True)
class Focusing:
    """What a lens makes of its blows; `Lens.focusing` finds it.

    Attributes
    ----------
    peak : float
        Largest pressure at the focus [Pa].
    alignment : float
        That over the sum of the largest pressures that each end makes there alone: 1 where all
        pulses come at the same instant, however weak they are.
    gain : float
        `peak` over that of the same chains with equal prestrains, the median of those chosen.
    place : float
        y [m] on the line through the focus at right angles to the ends, between half and one and
        a half of that of the focus, where the pressure comes to be largest.
    largest : float
        The pressure there [Pa].
    transmitted : float
        Energy that the ends radiate until 1.25 times the last arrival, over that of all blows.
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
        return (
            f"peak at the focus {self.peak:.4g} Pa, {self.gain:.3g} times that of equal chains\n"
            f"alignment: 1 - {1 - self.alignment:.1e} of the sum of the peaks of each end alone\n"
            f"largest on the axis, y = {low:.4g} to {high:.4g} m: {self.largest:.4g} Pa at y = "
            f"{self.place:.4g} m, {more:.2f} % above the focus at y = {self.focus:g} m\n"
            f"transmitted: {100 * self.transmitted:.3g} % of the energy of the blows"
        )


def focusing(lens: Any, transmitted: float) -> Focusing:
    """Measure it in the pressures of a lens; `transmitted` as in `Focusing`."""
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
    """The largest of a function of the instant."""
    from scipy.optimize import minimize_scalar

    t = np.arange(middle - within, middle + within, step)
    best = float(t[np.argmax(pressure(t))])
    ends = (best - step, best + step)
    found = minimize_scalar(
        lambda t: -float(pressure(t)), bounds=ends, method="bounded", options={"xatol": 1e-6 * step}
    )
    return -float(found.fun)


def _largest(lens: Any, x: float, y: float, pulse: float) -> tuple[float, float]:
    """Where on the axis, and how large [m, Pa]."""
    from scipy.optimize import minimize

    low, high = AXIS
    places = np.linspace(low * y, high * y, PLACES)
    way = (high - low) * y / lens.host_speed
    t = lens.focus_time + np.arange(-way / 2 - 2 * pulse, way / 2 + 2 * pulse, COARSE * pulse)
    found = lens.pressure(np.stack([np.full(PLACES, x), places], axis=-1), t)
    i, k = np.unravel_index(np.argmax(found), found.shape)
    start, steps = np.array([places[k], t[i]]), np.array([places[1] - places[0], COARSE * pulse])

    def lower(moved: Array) -> float:
        place, instant = start + moved * steps
        return -float(lens.pressure((x, place), instant)) / found[i, k]

    ends = (places[[0, -1]] - start[0]) / steps[0]
    bounds, options = [tuple(ends), (-2.0, 2.0)], {"initial_simplex": SIMPLEX, "xatol": 1e-4}
    top = minimize(lower, [0.0, 0.0], method="Nelder-Mead", bounds=bounds, options=options)
    return float(start[0] + top.x[0] * steps[0]), float(-top.fun * found[i, k])
