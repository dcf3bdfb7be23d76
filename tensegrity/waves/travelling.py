"""The travelling-wave equation on a lattice, solved by Fourier series on a half-line.

A wave of elongations r(x - c t), x in sites, satisfies m c^2 r'' = T(x + 1) - 2 T(x) + T(x - 1)
with T = V'(r).  Integrated twice it is m c^2 r = K T, where K is the convolution with the tent
1 - |x| of one site, (sin(k/2)/(k/2))^2 in Fourier space: a compact operator, without a branch to
choose.  A wave that is even about its peak is a cosine series on [0, L]; the series is periodic, so
L must be large enough for the tail to be round-off.

All quantities are scaled by a reference elongation A of either sign: r = A rho, T = V'(A) f(rho),
m c^2 = mu V'(A)/A.  Thus mu rho = K f(rho), with f(1) = 1, in compression and in extension.

Near the sound speed this equation is nearly degenerate, since f is almost rest rho and mu almost
rest.  Subtracting the linear law gives nu rho + rest (1 - K) rho = K g(rho) with nu = mu - rest and
g = f - rest rho (`nonlinear_part`).  It is solved in the form rho = P g(rho),
P = K/(nu + rest (1 - K)), which is as well conditioned near the sound speed as far above it.
Initial values come from iterating rho -> K f/(K f)(0): at given norm this map increases the energy
of a convex law (M. Herrmann, Proc. R. Soc. Edinburgh A 140, 753 (2010)), so that no small wave is
needed to begin with.  Newton's method follows, with rho and nu as unknowns.  The amplitude orders
the waves of a family and is therefore the continuation parameter; no arc length is needed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tensegrity.errors import TensegrityError
from tensegrity.waves.nonlinear_part import nonlinear_part

SWEEPS = 400  # largest number of iterations of the map before Newton's method
ROUGHLY = 1e-3  # change of rho at which these iterations end
ITERATIONS = 25  # of Newton's method
PATIENCE = 5  # iterations without a new smallest step after which it has failed
CONVERGED = 1e-9  # last step of Newton's method: convergence is quadratic
STUCK = 1e-6  # step below which stagnation is accepted: the residual decides
DENSE = 600  # points up to which the tangent is formed; beyond, GMRES on cosine transforms
HALVINGS = 30  # of a Newton step that leaves the domain
FINER = 4  # refinement of the grid on which the residual is computed
SINE_RISE = [(-1) ** n / math.factorial(2 * n + 3) for n in range(8, -1, -1)]  # (1 - sin y/y)/y^2


class NoWaveError(TensegrityError):
    """Newton's method did not converge to a localised wave."""


class Scaled:
    """f, g, g' and the scaled energy of a potential, for a reference elongation A [m]."""

    def __init__(self, potential, reference) -> None:
        self.potential, self.reference = potential, reference
        self._nonlinear = nonlinear_part(potential)
        gain = float(self._nonlinear.tension(reference)) / reference
        self.secant = self._nonlinear.rest + gain  # V'(A)/A [N/m]
        self.rest, self.gain = self._nonlinear.rest / self.secant, gain / self.secant
        self.force = self.secant * reference  # V'(A) [N]

    def tension(self, rho):
        return self.rest * rho + self.beyond(rho)

    def beyond(self, rho):
        """g = f - rest rho."""
        return self._nonlinear.tension(self.reference * rho) / self.reference / self.secant

    def slope(self, rho):
        """g'."""
        return self._nonlinear.stiffness(self.reference * rho) / self.secant

    def energy(self, rho):
        beyond = self._nonlinear.energy(self.reference * rho) / self.reference / self.reference
        return self.rest * rho * rho / 2 + beyond / self.secant


def _cosines(values):
    """Discrete cosine transform of type I: twice the sums of values times cosines, with the end
    values counted once."""
    return np.fft.rfft(np.concatenate([values, values[-2:0:-1]])).real


@dataclass(frozen=True)
class Grid:
    """Points x_j = j L/N, j = 0 .. N, and their cosine series."""

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
        a = _cosines(values) / self.points
        a[[0, -1]] /= 2
        return a

    def values(self, coefficients):
        """Values on the grid; the inverse of `coefficients`."""
        a = coefficients.copy()
        a[[0, -1]] *= 2
        return _cosines(a) / 2

    @cached_property
    def complement(self):
        """Symbol of 1 - K, without cancellation at small wave numbers."""
        half = self.wave_numbers / 2
        series = np.polyval(SINE_RISE, np.minimum(half, 1) ** 2)
        rise = np.where(half < 1, half**2 * series, 1 - self.box)
        return rise * (1 + self.box)

    def apply(self, symbol, values):
        """An even convolution, given by its symbol, of values on the grid."""
        return self.values(symbol * self.coefficients(values))

    def smooth(self, values):
        """K applied to values on the grid."""
        return self.apply(self.box**2, values)

    def matrix(self, symbol):
        """Matrix of an even convolution on grid values, (N + 1, N + 1)."""
        n = self.points
        kernel = np.fft.irfft(symbol, 2 * n)  # of the whole period
        i = np.arange(n + 1)
        matrix = kernel[np.abs(i[:, None] - i)] + kernel[(i[:, None] + i) % (2 * n)]
        matrix[:, [0, -1]] /= 2
        return matrix

    def moved(self, values, other):
        """Values on another grid by the cosine series of these; 0 beyond this grid."""
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
    """sum_n a_n cos(k_n x), or with another function, in blocks that fit the processor's cache.

    Parameters
    ----------
    coefficients, wave_numbers : ndarray, (n,)
        a_n and k_n [1/site].
    x : ndarray, any shape
        Sites.
    function : callable, optional
        np.cos or np.sin.

    Returns
    -------
    ndarray, shape of x
    """
    flat = np.ravel(x)
    result = np.empty(flat.size)
    for start in range(0, flat.size, 256):
        part = slice(start, start + 256)
        result[part] = function(np.outer(flat[part], wave_numbers)) @ coefficients
    return result.reshape(np.shape(x))


@dataclass(frozen=True)
class Series:
    """A wave given by the cosine coefficients of du/dx; 0 beyond the grid."""

    grid: Grid
    rates: np.ndarray

    def elongation(self, x):
        """r [m] at distances x from the peak."""
        return self._sum(self.rates * self.grid.box, x)

    def rate(self, x):
        """du/dx [m]."""
        return self._sum(self.rates, x)

    def displacement(self, x):
        """u [m], 0 far ahead."""
        x = np.clip(x, -self.grid.half_length, self.grid.half_length)
        k = self.grid.wave_numbers[1:]
        wavy = cosine_sum(self.rates[1:] / k, k, x, np.sin)
        return wavy + self.rates[0] * (x - self.grid.half_length)

    def _sum(self, coefficients, x):
        inside = np.abs(x) <= self.grid.half_length
        value = cosine_sum(coefficients, self.grid.wave_numbers, np.where(inside, x, 0.0))
        return np.where(inside, value, 0.0)

    def on_grid(self):
        """Elongation and du/dx at the points of the grid."""
        return self.grid.values(self.rates * self.grid.box), self.grid.values(self.rates)

    @property
    def shift(self):
        """Displacement far behind [m]."""
        return float(-2 * self.grid.half_length * self.rates[0])


@dataclass(frozen=True, eq=False)
class Profile:
    """A solution (rho, nu) on a grid."""

    law: Scaled
    grid: Grid
    rho: np.ndarray
    nu: float

    @property
    def mu(self):
        return self.law.rest + self.nu

    @property
    def symbol(self):
        """Symbol of P."""
        return self.grid.box**2 / self._resistance

    @property
    def _resistance(self):
        return self.nu + self.law.rest * self.grid.complement

    @property
    def symbol_rate(self):
        """nu times the derivative of the symbol of P in nu."""
        return -self.symbol * (self.nu / self._resistance)

    @property
    def energy(self):
        """Integral of rho f/2 + F: kinetic and potential energy over A V'(A)."""
        rho = self.rho
        density = rho * self.law.tension(rho) / 2 + self.law.energy(rho)
        return float(self.grid.weights @ density)

    @property
    def tail(self):
        """Largest elongation near the end of the grid over the peak."""
        return float(np.max(np.abs(self.rho[-(self.grid.points // 16) :])) / self.rho[0])

    @cached_property
    def _fine(self):
        return self.on(Grid(FINER * self.grid.points, self.grid.half_length))

    def residual(self):
        """max |mu rho - K f(rho)| over max f, on a finer grid."""
        rho, grid = self._fine.rho, self._fine.grid
        f = self.law.tension(rho)
        return float(np.max(np.abs(self.mu * rho - grid.smooth(f))) / np.max(np.abs(f)))

    def defect(self):
        """max |rho - P g(rho)| on a finer grid: an error of the wave that holds at any speed."""
        fine = self._fine
        return float(
            np.max(np.abs(fine.rho - fine.grid.apply(fine.symbol, self.law.beyond(fine.rho))))
        )

    def on(self, grid):
        """The same profile interpolated on another grid."""
        return replace(self, grid=grid, rho=self.grid.moved(self.rho, grid))


# Conditions that select a wave: profile -> value, gradient in rho, nu times derivative in nu.


def amplitude_is(rho):
    """The condition that rho(0) has a given value."""

    def condition(profile):
        gradient = np.zeros_like(profile.rho)
        gradient[0] = 1
        return profile.rho[0] - rho, gradient, 0.0

    return condition


def speed_is(nu):
    """The condition that nu has a given value."""
    return lambda profile: (profile.nu / nu - 1, np.zeros_like(profile.rho), profile.nu / nu)


def energy_is(energy):
    """The condition that the energy over A V'(A) has a given value."""

    def condition(profile):
        rho, law = profile.rho, profile.law
        gradient = 1.5 * law.tension(rho) + rho * (law.rest + law.slope(rho)) / 2
        return profile.energy / energy - 1, profile.grid.weights * gradient / energy, 0.0

    return condition


def initial_profile(law, grid, decay, tension, nu, power=2.0):
    """An approximate profile with rho(0) = 1, by iterating the map from a long-wave profile.

    Parameters
    ----------
    law, grid : Scaled, Grid
    decay, power : float
        Decay [1/site] of the long wave, and the power of the elongation in the nonlinear force.
    tension : callable
        f, or a cheaper approximation of it.
    nu : float
        Value of nu if the iteration gives none above 0.

    Returns
    -------
    Profile
    """
    half = (power - 1) / 2 if power > 1 else 0.5
    rho = np.cosh(np.minimum(half * decay * grid.x, 300)) ** (-1 / half)
    for _ in range(SWEEPS):
        new = grid.smooth(tension(rho))
        new = new / new[0]
        change, rho = np.max(np.abs(new - rho)), new
        if change < ROUGHLY:
            break
    pull = grid.smooth(law.beyond(rho)) - law.rest * grid.apply(grid.complement, rho)
    mean = float(grid.weights @ (rho * pull) / (grid.weights @ rho**2))
    return Profile(law, grid, rho, mean if mean > 0 else nu)


def newton(profile, condition, converged=CONVERGED):
    """Newton's method for mu rho = K f(rho) and a condition.

    Parameters
    ----------
    profile : Profile
        Initial value.
    condition : callable
        One of the conditions above.
    converged : float, optional
        Step at which the iteration ends, relative to the peak and to nu.

    Returns
    -------
    Profile

    Raises
    ------
    NoWaveError
        The iteration does not converge.
    """
    previous = best = math.inf
    since_best = 0
    for _ in range(ITERATIONS):
        try:
            step_rho, step_nu = _newton_step(profile, condition)
        except (np.linalg.LinAlgError, ValueError) as error:
            raise NoWaveError(f"the tangent of the travelling wave is singular: {error}") from None
        size = max(np.max(np.abs(step_rho)), abs(step_nu / profile.nu))
        profile = _stepped(profile, step_rho, step_nu)
        if size < converged or (size < STUCK and size > previous / 4):
            return profile
        since_best = 0 if size < best else since_best + 1
        previous, best = size, min(best, size)
        if since_best == PATIENCE:
            break
    raise NoWaveError(f"no travelling wave found: the last Newton step is {previous:.1e}")


def _stepped(profile, step_rho, step_nu):
    """The profile after a Newton step, halved until it stays in the domain of the potential."""
    low, high = profile.law.potential.domain
    for _ in range(HALVINGS):
        new = replace(profile, rho=profile.rho + step_rho, nu=profile.nu + step_nu)
        r = profile.law.reference * new.rho
        if new.nu > 0 and low < r.min() and r.max() < high:
            return new
        step_rho, step_nu = step_rho / 2, step_nu / 2
    raise NoWaveError("no travelling wave found above the sound speed within the spring's domain")


def _newton_step(profile, condition):
    """Newton steps of rho and nu."""
    gap = profile.rho - profile.grid.apply(profile.symbol, profile.law.beyond(profile.rho))
    step = solved(profile, condition, -np.append(gap, condition(profile)[0]))
    return step[:-1], float(step[-1]) * profile.nu


def solved(profile, condition, right, accuracy=1e-6):
    """Steps of rho and log(nu) by the tangent of Newton's method.

    Parameters
    ----------
    profile : Profile
    condition : callable
        One of the conditions above.
    right : ndarray, (N + 2,)
        Right-hand sides of rho = P g and of the condition.
    accuracy : float, optional
        Of the iteration on large grids.

    Returns
    -------
    ndarray, (N + 2,)

    Raises
    ------
    ValueError
        The right-hand sides are not finite.
    NoWaveError
        The iteration does not converge.
    """
    if not np.isfinite(right).all():
        raise ValueError("it is not finite")
    grid, rho, symbol = profile.grid, profile.rho, profile.symbol
    slope, (_, row, corner) = profile.law.slope(rho), condition(profile)
    column = -grid.apply(profile.symbol_rate, profile.law.beyond(rho))  # of step_nu/nu
    if grid.points > DENSE:
        return _by_gmres(grid, symbol, slope, column, row, corner, right, accuracy)
    matrix = np.empty((len(right), len(right)))
    matrix[:-1, :-1] = -grid.matrix(symbol) * slope
    matrix[:-1, :-1].flat[:: grid.points + 2] += 1
    matrix[:-1, -1], matrix[-1, :-1], matrix[-1, -1] = column, row, corner
    return np.linalg.solve(matrix, right)


def _by_gmres(grid, symbol, slope, column, row, corner, right, accuracy):
    from scipy.sparse.linalg import LinearOperator, gmres

    def tangent(step):
        step = np.ravel(step)
        upper = step[:-1] - grid.apply(symbol, slope * step[:-1]) + step[-1] * column
        return np.append(upper, row @ step[:-1] + corner * step[-1])

    operator = LinearOperator((len(right), len(right)), matvec=tangent, dtype=float)
    step, failed = gmres(operator, right, rtol=accuracy, restart=100, maxiter=4)
    if failed:
        raise NoWaveError("the linear solver of the travelling wave did not converge")
    return step
