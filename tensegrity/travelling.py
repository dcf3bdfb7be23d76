"""The equation of a travelling wave on a lattice, solved with Fourier's series on a half-line.

A wave r(x - c t) of elongations, x in sites, obeys m c^2 r'' = T(x + 1) - 2 T(x) + T(x - 1) with
T = V'(r).  Divided by the second derivative it is m c^2 r = K T, where K is convolution with the
tent 1 - |x| of one site, (sin(k/2)/(k/2))^2 in Fourier space: a compact operator, no root to
choose.  A wave that is even about its crest is a cosine series on [0, L]; it stands for a
periodic one, so L must reach where the tail is round-off.

Everything here is scaled by a reference elongation A of either sign: r = A rho, T = V'(A) f(rho),
m c^2 = mu V'(A)/A.  So mu rho = K f(rho), with f(1) = 1, for compression and for extension.
Starting values come from the map rho -> K f/(K f)(0): at given norm it climbs the energy of
a convex law (M. Herrmann, Proc. R. Soc. Edinburgh A 140, 753 (2010)), so it needs no small wave
to begin with.  Newton's method does the rest, mu being an unknown beside rho.  The amplitude
orders the waves of a family: it is the natural parameter, and no arc length is followed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tensegrity.errors import TensegrityError

SWEEPS = 400  # of the map that starts Newton's method
ROUGHLY = 1e-3  # change of rho in a sweep that ends them
ITERATIONS = 25
CONVERGED = 1e-9  # last step of Newton's method: the next one would square it
STUCK = 1e-6  # ... or one from which on they no longer shrink: the residual will judge
DENSE = 600  # points up to which the tangent is formed; beyond, GMRES on cosine transforms
FINER = 4  # the residual is taken on a grid so many times finer


class NoWave(TensegrityError):
    """Newton's method found no localised wave."""


class Scaled:
    """f, f' and its energy for a potential and a reference elongation A [m] of either sign."""

    def __init__(self, potential, reference):
        self.potential, self.reference = potential, reference
        self.force = float(potential.tension(reference))  # V'(A) [N]
        self.rest = self._stiffness(0.0)

    def tension(self, rho):
        return self.potential.tension(self.reference * rho) / self.force

    def stiffness(self, rho):
        return self._stiffness(rho)

    def _stiffness(self, rho):
        return self.potential.stiffness(self.reference * rho) * (self.reference / self.force)

    def energy(self, rho):
        return self.potential.energy(self.reference * rho) / (self.reference * self.force)


@dataclass(frozen=True)
class Grid:
    """Points x_j = j L/N, j = 0 .. N, and the cosines that belong to them."""

    points: int
    half_length: float

    @cached_property
    def x(self):
        return np.arange(self.points + 1) * (self.half_length / self.points)

    @cached_property
    def wave_numbers(self):
        return np.arange(self.points + 1) * (np.pi / self.half_length)

    @cached_property
    def box(self):
        """Symbol of the mean over one site, sin(k/2)/(k/2); K is its square."""
        return np.sinc(self.wave_numbers / (2 * np.pi))

    @cached_property
    def weights(self):
        """Weights of the integral over the whole line, (N + 1,)."""
        w = np.full(self.points + 1, 2 * self.half_length / self.points)
        w[[0, -1]] /= 2
        return w

    def coefficients(self, values):
        """Cosine coefficients of an even function from its values on the grid."""
        from scipy.fft import dct

        a = dct(values, type=1) / self.points
        a[[0, -1]] /= 2
        return a

    def values(self, coefficients):
        """Values on the grid; the inverse of `coefficients`."""
        from scipy.fft import dct

        a = coefficients.copy()
        a[[0, -1]] *= 2
        return dct(a, type=1) / 2

    def smooth(self, values):
        """K applied to values on the grid."""
        return self.values(self.box**2 * self.coefficients(values))

    @cached_property
    def matrix(self):
        """K as a matrix between values on the grid, (N + 1, N + 1)."""
        n = self.points
        kernel = np.fft.irfft(self.box**2, 2 * n)  # of the whole period
        i = np.arange(n + 1)
        matrix = kernel[np.abs(i[:, None] - i)] + kernel[(i[:, None] + i) % (2 * n)]
        matrix[:, [0, -1]] /= 2
        return matrix

    def moved(self, values, other):
        """Values on another grid by the series of these; zero beyond this grid."""
        a = self.coefficients(values)
        if other.half_length == self.half_length:
            b = np.zeros(other.points + 1)
            n = min(len(a), len(b))
            b[:n] = a[:n]
            return other.values(b)
        inside = other.x <= self.half_length
        moved = np.zeros(other.points + 1)
        moved[inside] = cosine_sum(a, self.wave_numbers, other.x[inside])
        return moved


def cosine_sum(coefficients, wave_numbers, x, function=np.cos):
    """sum_n a_n cos(k_n x) at any places, in pieces that fit the cache."""
    flat = np.ravel(x)
    result = np.empty(flat.size)
    for start in range(0, flat.size, 256):
        part = slice(start, start + 256)
        result[part] = function(np.outer(flat[part], wave_numbers)) @ coefficients
    return result.reshape(np.shape(x))


@dataclass(frozen=True, eq=False)
class Profile:
    """A solution (rho, mu) on a grid."""

    law: Scaled
    grid: Grid
    rho: np.ndarray
    mu: float

    @property
    def energy(self):
        """Integral of rho f/2 + F: kinetic and potential energy over A V'(A)."""
        rho = self.rho
        density = rho * self.law.tension(rho) / 2 + self.law.energy(rho)
        return float(self.grid.weights @ density)

    @property
    def tail(self):
        """Largest part of the crest that is left at the end of the grid."""
        return float(np.max(np.abs(self.rho[-(self.grid.points // 16) :])) / self.rho[0])

    def residual(self):
        """max |mu rho - K f(rho)| over max f, on a finer grid."""
        fine = Grid(FINER * self.grid.points, self.grid.half_length)
        rho = self.grid.moved(self.rho, fine)
        f = self.law.tension(rho)
        return float(np.max(np.abs(self.mu * rho - fine.smooth(f))) / np.max(np.abs(f)))

    def on(self, grid):
        """The same profile on another grid, not solved there."""
        return replace(self, grid=grid, rho=self.grid.moved(self.rho, grid))


# What holds a wave: a function of (profile) -> value, gradient in rho, derivative in mu.


def amplitude_is(rho):
    """rho(0) as given."""

    def condition(profile):
        gradient = np.zeros_like(profile.rho)
        gradient[0] = 1
        return profile.rho[0] - rho, gradient, 0.0

    return condition


def speed_is(mu):
    """mu as given."""
    return lambda profile: (profile.mu / mu - 1, np.zeros_like(profile.rho), 1 / mu)


def energy_is(energy):
    """Energy over A V'(A) as given."""

    def condition(profile):
        rho, law = profile.rho, profile.law
        gradient = 1.5 * law.tension(rho) + rho * law.stiffness(rho) / 2
        return profile.energy / energy - 1, profile.grid.weights * gradient / energy, 0.0

    return condition


def started(law, grid, decay, tension):
    """A rough profile with rho(0) = 1: a bump of given decay, swept until it hardly changes.

    `tension` is f, or a cheaper function close to it.
    """
    rho = 1 / np.cosh(np.minimum(decay * grid.x / 2, 300)) ** 2
    mu = 1.0
    for _ in range(SWEEPS):
        new = grid.smooth(tension(rho))
        mu, new = new[0], new / new[0]
        change, rho = np.max(np.abs(new - rho)), new
        if change < ROUGHLY:
            break
    return Profile(law, grid, rho, float(mu))


def solved(profile, condition, converged=CONVERGED):
    """Newton's method on mu rho = K f(rho) and a condition, from a profile close enough.

    Raises
    ------
    NoWave
        If it does not converge.
    """
    previous = math.inf
    for _ in range(ITERATIONS):
        try:
            step_rho, step_mu = _newton_step(profile, condition)
        except (np.linalg.LinAlgError, ValueError) as error:
            raise NoWave(f"the tangent of the travelling wave is singular: {error}") from None
        profile = _stepped(profile, step_rho, step_mu)
        size = max(np.max(np.abs(step_rho)), abs(step_mu / profile.mu))
        if size < converged or (size < STUCK and size > previous / 4):
            return profile
        previous = size
    raise NoWave(f"no travelling wave found: the last iteration still moved {previous:.1e}")


def _stepped(profile, step_rho, step_mu):
    """The whole step, or the part of it that stays in the domain of the potential."""
    for _ in range(30):
        new = replace(profile, rho=profile.rho + step_rho, mu=profile.mu + step_mu)
        low, high = profile.law.potential.domain
        r = profile.law.reference * new.rho
        if new.mu > 0 and low < r.min() and r.max() < high:
            return new
        step_rho, step_mu = step_rho / 2, step_mu / 2
    raise NoWave("no travelling wave found within the domain of the potential")


def _newton_step(profile, condition):
    grid, rho, mu = profile.grid, profile.rho, profile.mu
    f, slope = profile.law.tension(rho), profile.law.stiffness(rho)
    gap, row, corner = condition(profile)
    right = -np.append(mu * rho - grid.smooth(f), gap)
    if grid.points <= DENSE:
        matrix = np.empty((grid.points + 2, grid.points + 2))
        matrix[:-1, :-1] = -grid.matrix * slope
        matrix[:-1, :-1].flat[:: grid.points + 2] += mu
        matrix[:-1, -1], matrix[-1, :-1], matrix[-1, -1] = rho, row, corner
        step = np.linalg.solve(matrix, right)
    else:
        step = _by_gmres(grid, rho, mu, slope, row, corner, right)
    return step[:-1], float(step[-1])


def _by_gmres(grid, rho, mu, slope, row, corner, right):
    from scipy.sparse.linalg import LinearOperator, gmres

    def tangent(step):
        step = np.ravel(step)
        upper = mu * step[:-1] - grid.smooth(slope * step[:-1]) + step[-1] * rho
        return np.append(upper, row @ step[:-1] + corner * step[-1])

    n = len(right)
    operator = LinearOperator((n, n), matvec=tangent, dtype=float)
    step, failed = gmres(operator, right, rtol=1e-6, restart=100, maxiter=3)
    if failed:
        raise NoWave("the linear solver of the travelling wave did not converge")
    return step


def decay_rate(speed_ratio):
    """kappa > 0 of the tail exp(-kappa |x|) in a linear lattice: sinh(kappa/2)/(kappa/2) = c/cs."""
    from scipy.optimize import brentq

    if math.isinf(speed_ratio):
        return math.inf

    def excess(half):
        return math.log(math.sinh(half) / half) - math.log(speed_ratio)

    # sinh(y)/y > exp(y)/(4 y) and > 1 + y^2/6
    high = min(2 * math.log(speed_ratio) + 4, math.sqrt(6 * (speed_ratio - 1)) * 1.001 + 1e-9)
    return 2 * brentq(excess, 1e-12, high, xtol=1e-300, rtol=1e-14)
