"""Sound that ends of chains radiate into a linear fluid behind a baffle: Rayleigh's integral.

Model: each end is a rigid circular piston in an infinite rigid plane, y = 0, and moves along y;
the fluid, linear and without loss, fills y > 0 and does not act back on the ends.  Then
p = rho/(2 pi) int a(t - R/c)/R dS over the piston.  The integral over R, at a fixed angle about
the point's foot on the plane, can be done, and what is left runs along the rim:
p = rho c [v(t - y/c) where the foot is on the piston, - (1/pi) int_0^pi v(t - R/c) dtheta/dpsi
dpsi], the plane wave and the wave of the rim.  A piston that is small against the distance and
the pulse is a point: p = rho A a(t - R/c)/(2 pi R).  Rayleigh, The Theory of Sound, 278; the wave
of the rim: Tupholme, Mathematika 16, 209 (1969), Stepanishen, J. Acoust. Soc. Am. 49, 1629 (1971).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.errors import TensegrityError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from typing import Any

    from tensegrity.typing import Array

NODES = 16  # along half a rim
LOOKS = 401  # instants among which a peak is looked for


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
        times, (x, y) = _outer(t, points)
        angle = np.pi * (np.arange(NODES) + 0.5) / NODES  # midpoints: exponential convergence
        off = np.abs(x - place)  # of the foot from the centre
        near, far = np.minimum(off, self.radius), np.maximum(off, self.radius)
        ratio, inside = near / far, off < self.radius

        def at(distance: Array) -> Array:
            return _since_start(curve, times - distance / self.speed)

        nearest = at(np.hypot(y, far - near))  # taken off all: what is left is small and smooth
        total = np.where(inside, at(y) - nearest, 0.0)
        for psi in angle:
            squared = 1 + ratio**2 - 2 * ratio * math.cos(psi)
            rim = np.hypot(y, far * np.sqrt(squared))
            weight = np.where(inside, 1.0, ratio**2) - ratio * math.cos(psi)
            total -= (at(rim) - nearest) * weight / squared / NODES
        return np.asarray(self.density * self.speed * total)

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
        times, (x, y) = _outer(t, points)
        for place, curve in zip(self.places, self._curves(), strict=True):
            distance = np.hypot(x - place, y)
            acceleration = _since_start(curve.derivative(), times - distance / self.speed)
            with np.errstate(divide="ignore", invalid="ignore"):
                yield self.density * self.area * acceleration / (2 * np.pi * distance)

    def _curves(self) -> list[Any]:
        """Velocity of each end as a spline of fifth degree."""
        from scipy.interpolate import make_interp_spline

        return [make_interp_spline(self.t, v, k=5) for v in self.velocity.T]


def _outer(t: Array, points: Array) -> tuple[Array, Array]:
    """Instants that broadcast against points, and coordinates x, y."""
    return t.reshape((*t.shape, *[1] * (points.ndim - 1))), np.moveaxis(points, -1, 0)


def _since_start(curve: Any, t: Array) -> Array:
    return np.where(t > 0, curve(np.maximum(t, 0.0)), 0.0)
