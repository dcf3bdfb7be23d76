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

A wave of several components (`coupled`) is one too, with a matrix for P; nu counts from the fastest
sound, and is below 0 for waves slower than it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from tensegrity.errors import TensegrityError
from tensegrity.waves.asymptotics import decay_rate
from tensegrity.waves.cosines import Grid
from tensegrity.waves.nonlinear_part import nonlinear_part

SWEEPS = 400  # largest number of iterations of the map before Newton's method
ROUGHLY = 1e-3  # change of rho at which these iterations end
ITERATIONS = 25  # of Newton's method
PATIENCE = 5  # iterations without a new smallest step after which it has failed
CONVERGED = 1e-9  # last step of Newton's method: convergence is quadratic
STUCK = 1e-6  # step below which stagnation is accepted: the residual decides
HALVINGS = 30  # of a Newton step that leaves the domain
FINER = 4  # refinement of the grid on which the residual is computed
TARGET, LARGEST = 2e-13, 1e-12  # defect aimed at, and the largest that is accepted


class NoWaveError(TensegrityError):
    """Newton's method did not converge to a localised wave."""


class Scaled:
    """f, g, g' and the scaled energy of a potential, for a reference elongation A [m]."""

    steepest = 6.0  # decay of a tail per site: steeper ones end within the core

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

    def admits(self, rho):
        low, high = self.potential.domain
        r = self.reference * rho
        return low < r.min() and r.max() < high

    def decay(self, nu):
        """Decay of the tail [1/site]."""
        return decay_rate(nu / self.rest if self.rest > 0 else math.inf)

    def boxed(self, length, nu):
        """The half-length of a grid: any will do."""
        return length

    def energy(self, rho):
        beyond = self._nonlinear.energy(self.reference * rho) / self.reference / self.reference
        return self.rest * rho * rho / 2 + beyond / self.secant


@dataclass(frozen=True, eq=False)
class Profile:
    """A solution (rho, nu) on a grid."""

    law: Any
    grid: Grid
    rho: np.ndarray
    nu: float

    dense: ClassVar[int] = 601  # unknowns up to which the tangent is formed; beyond, GMRES

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

    def mapped(self):
        """P g(rho)."""
        return self.grid.apply(self.symbol, self.law.beyond(self.rho))

    def mapped_rate(self):
        """nu times its derivative in nu."""
        return self.grid.apply(self.symbol_rate, self.law.beyond(self.rho))

    def mapped_along(self):
        """The function of steps of rho that gives its change."""
        slope = self.law.slope(self.rho)
        return lambda step: self.grid.apply(self.symbol, slope * step)

    def mapped_matrix(self):
        """That function as a matrix."""
        return self.grid.matrix(self.symbol) * self.law.slope(self.rho)

    @property
    def energy(self):
        """Integral of rho f/2 + F: kinetic and potential energy over A V'(A)."""
        rho = self.rho
        density = rho * self.law.tension(rho) / 2 + self.law.energy(rho)
        return float(self.grid.weights @ density)

    @property
    def tail(self):
        """Largest elongation near the end of the grid over the peak."""
        far = np.max(np.abs(self.rho[..., -(self.grid.points // 16) :]))
        return float(far / np.max(np.abs(self.rho[..., 0])))

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
        return float(np.max(np.abs(self._fine.rho - self._fine.mapped())))

    def admitted(self):
        """Defect aimed at, and the largest that is accepted where finer grids do not lower it."""
        return TARGET, LARGEST

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
    for _ in range(HALVINGS):
        new = replace(profile, rho=profile.rho + step_rho, nu=profile.nu + step_nu)
        if new.nu * profile.nu > 0 and profile.law.admits(new.rho):
            return new
        step_rho, step_nu = step_rho / 2, step_nu / 2
    raise NoWaveError("no travelling wave found above the sound speed within the spring's domain")


def _newton_step(profile, condition):
    """Newton steps of rho and nu."""
    gap = profile.rho - profile.mapped()
    step = solved(profile, condition, -np.append(gap, condition(profile)[0]))
    return step[:-1].reshape(gap.shape), float(step[-1]) * profile.nu


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
    _, row, corner = condition(profile)
    column = -profile.mapped_rate()  # of step_nu/nu
    if profile.rho.size > profile.dense:
        return _by_gmres(profile, column, row, corner, right, accuracy)
    matrix = np.empty((len(right), len(right)))
    matrix[:-1, :-1] = -profile.mapped_matrix()
    matrix[:-1, :-1].flat[:: len(right)] += 1
    matrix[:-1, -1], matrix[-1, :-1], matrix[-1, -1] = column.ravel(), row.ravel(), corner
    return np.linalg.solve(matrix, right)


def _by_gmres(profile, column, row, corner, right, accuracy):
    from scipy.sparse.linalg import LinearOperator, gmres

    mapped = profile.mapped_along()

    def tangent(step):
        last, step = np.ravel(step)[-1], np.ravel(step)[:-1].reshape(column.shape)
        upper = step - mapped(step) + last * column
        return np.append(upper, np.sum(row * step) + corner * last)

    operator = LinearOperator((len(right), len(right)), matvec=tangent, dtype=float)
    step, failed = gmres(operator, right, rtol=accuracy, restart=100, maxiter=4)
    if failed:
        raise NoWaveError("the linear solver of the travelling wave did not converge")
    return step
