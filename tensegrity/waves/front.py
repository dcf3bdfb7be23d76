"""Fronts between two states of a lattice, solved by Fourier series in addition to a smooth step.

A front moves towards higher sites, x in sites from its centre.  It is a step in closed form and a
periodic remainder w that is 0 at both ends of -L .. L.  With d f = f(x + 1/2) - f(x - 1/2), tension
T, springs G and dashpots g to the ground, dashpots eta in the bonds, and r the elongation:

* With springs to the ground the displacement u is solved for, and the speed c:
  m c^2 u'' = d (T(r) - eta c r') + g c u' - G'(u), where r = d u.
* Without these the elongation is solved for: m c^2 (r - r+) = K (T(r) - T(r+) - eta c r'), with K
  of `travelling`.  Far behind the front this is the Rankine-Hugoniot condition
  m c^2 (r- - r+) = T(r-) - T(r+).  A front that is subsonic, or supersonic, on both sides exists
  for isolated r-, which is the unknown.  One that is supersonic ahead only exists for every r-:
  then the unknown is a force at the seam x = +-L, which closes the periodic system and decays
  with L.

Sources: N. Nadkarni et al., Phys. Rev. Lett. 116, 244501 (2016); L. Truskinovsky and A. Vainchtein,
SIAM J. Appl. Math. 66, 533 (2005); P. Lax, Comm. Pure Appl. Math. 10, 537 (1957).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from tensegrity.errors import ResolutionError, TensegrityError
from tensegrity.waves.cosines import cosine_sum
from tensegrity.waves.travelling import CONVERGED, ITERATIONS, NoWaveError

WIDTH = 1.5  # of the step, in sites
NODES, WEIGHTS = np.polynomial.legendre.leggauss(40)  # to integrate it over a site
HALF_LENGTH = 20.0  # of the first grid, in sites
MOST = 4000  # points
DECAYED = 1e-10  # remainder at the ends over the step
FINE, COARSE = 1e-12, 1e-8  # its short waves, aimed at; both, admitted
SEAM = 100  # remainder at the ends over short waves: above it they come from the seam
HALVINGS = 9  # of a Newton step
DIFFERENCE = 1e-5  # of the unknown besides w, for the tangent


def step(x, order=0):
    """(1 - tanh(x/WIDTH))/2, which is 1 behind and 0 ahead, or a derivative of order 1 or 2."""
    y = 1 / (1 + np.exp(np.minimum(2 * x / WIDTH, 700)))
    slope = -2 / WIDTH * y * (1 - y)
    return (y, slope, -2 / WIDTH * slope * (1 - 2 * y))[order]


def step_ahead(x):
    """Integral of the step from x to infinity."""
    return WIDTH / 2 * np.logaddexp(0, -2 * x / WIDTH)


def step_mean(x):
    """Mean of the step over one site."""
    return step_ahead(x - 0.5) - step_ahead(x + 0.5)


@dataclass(frozen=True)
class Line:
    """An odd number of points of the period -L .. L, with x = 0 in the middle."""

    points: int
    half_length: float

    @cached_property
    def x(self):
        return (np.arange(self.points) - self.points // 2) * (2 * self.half_length / self.points)

    @cached_property
    def wave_numbers(self):
        return np.arange(self.points // 2 + 1) * (np.pi / self.half_length)

    @cached_property
    def rate(self):
        """Symbol of the derivative."""
        return 1j * self.wave_numbers

    @cached_property
    def difference(self):
        """Symbol of d."""
        return 2j * np.sin(self.wave_numbers / 2)

    @cached_property
    def box(self):
        """Symbol of the mean over one site; K is its square."""
        return np.sinc(self.wave_numbers / (2 * np.pi))

    def apply(self, symbol, values):
        """A convolution, given by its symbol, of values on the grid."""
        return np.fft.irfft(symbol * np.fft.rfft(values), self.points)

    def matrix(self, symbol):
        """Matrix of a convolution, (points, points)."""
        i = np.arange(self.points)
        return np.fft.irfft(symbol, self.points)[(i[:, None] - i) % self.points]

    def integral(self, values):
        return float(np.sum(values)) * 2 * self.half_length / self.points

    def series(self, values):
        """Coefficients of the cosine and sine series of values on the grid."""
        a = np.fft.rfft(values) * np.exp(-1j * self.wave_numbers * self.x[0]) / self.points
        a[1:] *= 2
        return a.real, -a.imag


@dataclass(frozen=True)
class FrontSeries:
    """Shape of a front: du/dx = level + jump step(x) + a series, which is 0 beyond the grid."""

    line: Line
    rates: Any
    level: float
    jump: float
    begin: float  # u - level x far ahead

    def rate(self, x):
        return self.level + self.jump * step(x) + self._sum(*self.rates, x)

    def elongation(self, x):
        even, odd = (a * self.line.box for a in self.rates)
        return self.level + self.jump * step_mean(x) + self._sum(even, odd, x)

    def displacement(self, x):
        x, end, k = np.asarray(x, dtype=float), self.line.half_length, self.line.wave_numbers[1:]
        even, odd = self.rates
        series = [np.append(0.0, -odd[1:] / k), np.append(0.0, even[1:] / k)]
        at = np.clip(x, -end, end)
        wavy = self._sum(*series, at) - self._sum(*series, np.array(end)) + even[0] * (at - end)
        steps = self.level * x - self.jump * step_ahead(x) if self.level or self.jump else 0.0
        return self.begin + wavy + steps

    def _sum(self, even, odd, x):
        inside, k = np.abs(x) <= self.line.half_length, self.line.wave_numbers
        at = np.where(inside, x, 0.0)
        total = cosine_sum(even, k, at) + cosine_sum(odd, k, at, np.sin)
        return np.where(inside, total, 0.0)

    @property
    def shift(self):
        """Displacement by the front [m]; infinite where the elongation changes."""
        if self.jump:
            return -math.copysign(math.inf, self.jump)
        return float(self.displacement(-self.line.half_length)) - self.begin


@dataclass(frozen=True, eq=False)
class Front:
    """A front, or an approximation of it.

    Attributes
    ----------
    spring, ground : Potential, Potential or None
    mass, bond, site : float
        Mass of a site [kg], dashpots of the bonds and to the ground [N s/m].
    ahead, behind : float
        Displacements, or without springs to the ground elongations [m].
    overtaken : bool
        Whether the front is subsonic relative to the state behind, and supersonic ahead.
    line : Line
    w : ndarray, (points,)
        The remainder [m].
    unknown : float
        Speed [sites/s], state behind [m], or force at the seam [N].
    """

    spring: Any
    ground: Any
    mass: float
    bond: float
    site: float
    ahead: float
    behind: float
    overtaken: bool
    line: Line
    w: Any
    unknown: float

    @property
    def end(self):
        """State behind [m]."""
        return self.behind if self.ground is not None or self.overtaken else self.unknown

    @cached_property
    def stiffness(self):
        """m c^2 [N/m]."""
        if self.ground is not None:
            return self.mass * self.unknown**2
        force = self.spring.tension([self.end, self.ahead])
        return float(force[0] - force[1]) / (self.end - self.ahead)

    @property
    def speed(self):
        return math.sqrt(self.stiffness / self.mass) if self.ground is None else self.unknown

    @cached_property
    def state(self):
        """The function solved for, and its derivative, on the grid [m]."""
        x, jump = self.line.x, self.end - self.ahead
        rate = jump * step(x, 1) + self.line.apply(self.line.rate, self.w)
        return self.ahead + jump * step(x) + self.w, rate

    @cached_property
    def elongation(self):
        """Elongation and its derivative on the grid [m]."""
        if self.ground is None:
            return self.state
        line, jump = self.line, self.end - self.ahead
        steps = [step(line.x + 0.5, k) - step(line.x - 0.5, k) for k in (0, 1)]
        r, rate = (line.apply(line.difference * s, self.w) for s in (1, line.rate))
        return jump * steps[0] + r, jump * steps[1] + rate

    @cached_property
    def _beyond(self):
        """Force in the bonds minus that of the step [N]."""
        r, rate = self.elongation
        linear = self.stiffness * (self.end - self.ahead) * step(self.line.x)
        force = self.spring.tension(r) - float(self.spring.tension(self.ahead))
        return force - linear - self.bond * self.speed * rate

    def residual(self):
        """Left-hand minus right-hand side of the equation [N]."""
        line, c, jump = self.line, self.speed, self.end - self.ahead
        if self.ground is not None:
            r, rate = self.elongation
            u, slope = self.state
            bend = jump * step(line.x, 2) + line.apply(line.rate**2, self.w)
            force = self.spring.tension(r) - self.bond * c * rate
            pull = self.ground.tension(u) - self.site * c * slope
            return self.stiffness * bend - line.apply(line.difference, force) + pull
        smooth = WEIGHTS / 2 @ step_mean(line.x + NODES[:, None] / 2) - step(line.x)
        left = self.stiffness * (self.w - jump * smooth) - line.apply(line.box**2, self._beyond)
        seam = np.exp(-((line.half_length - np.abs(line.x)) ** 2))
        return left + self.unknown * seam if self.overtaken else left

    def tangent(self):
        """Derivative of the residual with respect to w, (points, points)."""
        line, drag = self.line, self.bond * self.speed
        slope = self.spring.stiffness(self.elongation[0])
        if self.ground is None:
            tangent = line.matrix(drag * line.box**2 * line.rate)
            tangent -= line.matrix(line.box**2) * slope
            tangent.flat[:: line.points + 1] += self.stiffness
            return tangent
        linear = self.stiffness * line.rate + drag * line.difference**2 - self.site * self.speed
        move = line.matrix(line.difference)
        tangent = line.matrix(linear * line.rate) - move @ (slope[:, None] * move)
        tangent.flat[:: line.points + 1] += self.ground.stiffness(self.state[0])
        return tangent

    def scale(self):
        """The largest force [N], by which residuals are divided."""
        change = abs(self.stiffness * (self.end - self.ahead))
        return change + float(np.max(np.abs(self.spring.tension(self.elongation[0]))))

    def defect(self):
        """Largest residual on a finer grid over the largest force."""
        fine = self.on(Line(2 * self.line.points - 1, self.line.half_length))
        return float(np.max(np.abs(fine.residual()))) / self.scale()

    def on(self, line):
        """The same front on another grid."""
        even, odd = self.line.series(self.w)
        shape = FrontSeries(self.line, (even, odd), 0.0, 0.0, 0.0)
        return replace(self, line=line, w=shape.rate(line.x))

    @property
    def dissipated(self):
        """Energy dissipated by the dashpots for each site passed [J]."""
        rates = self.bond * self.elongation[1] ** 2 + self.site * self.slope**2
        return self.speed * self.line.integral(rates)

    @property
    def slope(self):
        """du/dx minus its value ahead, on the grid."""
        if self.ground is not None:
            return self.state[1]
        line, jump = self.line, self.end - self.ahead
        return jump * step_mean(line.x) + line.apply(line.box, self._beyond) / self.stiffness

    def shape(self):
        if self.ground is not None:
            return FrontSeries(self.line, self.line.series(self.slope), 0.0, 0.0, self.ahead)
        jump = self.end - self.ahead
        rates = self.line.series(self.slope - jump * step(self.line.x))
        return FrontSeries(self.line, rates, self.ahead, jump, 0.0)


def newton(front):
    """Newton's method for a front whose state at x = 0 is the mean of both ends.

    Parameters
    ----------
    front : Front
        Initial value.

    Returns
    -------
    Front

    Raises
    ------
    NoWaveError
        The iteration does not converge.
    """
    size, n = math.inf, front.line.points
    matrix = np.zeros((n + 1, n + 1))
    matrix[-1, n // 2] = 1
    for _ in range(ITERATIONS):
        change = DIFFERENCE * (abs(front.unknown) + DIFFERENCE)
        sides = [replace(front, unknown=front.unknown + s * change) for s in (1, -1)]
        try:
            gap = front.residual()
            matrix[:-1, :-1] = front.tangent()
            matrix[:-1, -1] = (sides[0].residual() - sides[1].residual()) / (2 * change)
            moves = np.linalg.solve(matrix, -np.append(gap, front.w[n // 2]))
        except (np.linalg.LinAlgError, ValueError) as error:
            raise NoWaveError(f"the tangent of the front is singular: {error}") from None
        size = float(np.max(np.abs(moves[:-1])) / abs(front.end - front.ahead))
        front = _moved(front, moves, np.max(np.abs(gap)))
        if size < CONVERGED:
            return front
    raise NoWaveError(
        f"no front found: the last relative Newton step, {size:.1e}, must be below {CONVERGED:g}"
    )


def _moved(front, moves, gap):
    """The front after a Newton step, halved some times if the residual is larger after it."""
    new, most = None, 2 * max(gap, CONVERGED * front.scale())
    for part in 0.5 ** np.arange(HALVINGS):
        w, unknown = front.w + part * moves[:-1], front.unknown + part * float(moves[-1])
        tried = replace(front, w=w, unknown=unknown)
        try:
            size = np.max(np.abs(tried.residual())) if tried.stiffness > 0 < tried.speed else None
        except (TensegrityError, ZeroDivisionError):
            continue  # beyond the domain, or no step
        if size is not None:
            new, most = tried, most if part == 1 else gap
            if size < most:
                break
    if new is None:
        raise NoWaveError("no front found within the domain of its springs")
    return new


def resolved(front):
    """The front near an approximation, on a sufficiently long and fine grid.

    Parameters
    ----------
    front : Front

    Returns
    -------
    Front

    Raises
    ------
    NoWaveError
        Newton's method does not converge.
    ResolutionError
        The front decays too slowly, or is too sharp, for the finest grid.
    """
    while True:
        front = newton(front)
        line, size = front.line, abs(front.end - front.ahead)
        edge, waves = line.points // 20, np.abs(np.fft.rfft(front.w)) / line.points
        tail = float(np.max(np.abs(front.w[np.r_[:edge, -edge:0]]))) / size
        shortest = float(waves[-edge:].max()) / size
        longer, finer = (1.5, 1) if tail > max(SEAM * shortest, DECAYED) else (1, 1.5)
        points = 2 * round(line.points * longer * finer / 2) + 1
        if (tail < DECAYED and shortest < FINE) or (points > MOST and max(tail, shortest) < COARSE):
            return front
        if points > MOST:
            raise ResolutionError(
                f"{line.points} points do not resolve the front: {tail:.1e} of it is left "
                f"at {line.half_length:.3g} sites from its centre, {shortest:.1e} in short waves"
            )
        front = front.on(Line(points, line.half_length * longer))
