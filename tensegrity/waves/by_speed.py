"""The derivative of a solitary wave with respect to its speed, and dH/dc.

m c^2 r = K V'(r) differentiated with respect to c gives (m c^2 - K V''(r)) r_c = -2 m c r, one
linear solve with the tangent of Newton's method.  As m c^2 times the integral of (du/dx)^2 is that
of r V', the energy is the integral of r V'/2 + V, so dH/dc = integral of (3 V' + r V'') r_c/2.
Source: G. Friesecke, R. Pego, Nonlinearity 15, 1343 (2002).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.typing import Array
from tensegrity.waves.cosines import Series
from tensegrity.waves.multidomain import Integrals, Mesh
from tensegrity.waves.travelling import Profile, Scaled, energy_is, solved, speed_is

ACCURACY = 1e-13  # of the linear solve on large grids


def by_speed(wave: Any) -> tuple[float, Series | Integrals]:
    """dH/dc and the derivative of the shape with respect to the speed.

    Parameters
    ----------
    wave : SolitaryWave

    Returns
    -------
    slope : float
        [J s/site]
    shape : Series or Integrals
        Derivative of displacement, rate and elongation [m s/site].
    """
    if wave._shape.rate(0.0).ndim:
        raise TensegrityError("dH/dc of waves with several components is not computed")
    derivative = _on_mesh if isinstance(wave._shape, Integrals) else _on_grid
    return derivative(wave, wave.mass * wave.speed**2)


def _on_grid(wave: Any, squared: float) -> tuple[float, Series]:
    """`by_speed` of a Fourier series; `squared` is m c^2 [N/m]."""
    law, grid = Scaled(wave.potential, wave.amplitude), wave._shape.grid
    rho = grid.values(wave._shape.rates * grid.box) / wave.amplitude
    gain = math.expm1(2 * math.log1p(wave.excess))  # of m c^2 over the stiffness at rest
    nu = law.rest * gain if law.rest else squared / law.secant
    profile = Profile(law, grid, rho, nu)
    unit = np.zeros(len(rho) + 1)
    unit[-1] = 2 * squared / (wave.speed * law.secant * nu)  # d log(nu)/dc
    rho_c = solved(profile, speed_is(nu), unit, ACCURACY)[:-1]
    energy = profile.energy
    slope = energy_is(energy)(profile)[1] @ rho_c * energy * law.reference * law.force
    stiffness = law.secant * (law.rest + law.slope(rho))
    tension = grid.coefficients(stiffness * law.reference * rho_c)
    rates = grid.box * tension / squared - 2 / wave.speed * wave._shape.rates
    return float(slope), Series(grid, rates)


def _on_mesh(wave: Any, squared: float) -> tuple[float, Integrals]:
    """`by_speed` of a wave with a kink."""
    mesh: Mesh = wave._shape.mesh
    tension = wave._shape.values * squared
    r = mesh.mean @ wave._shape.values
    stiffness = np.asarray(wave.potential.stiffness(r))
    tangent = -mesh.mean * stiffness
    tangent.flat[:: len(r) + 1] += squared
    r_c = np.linalg.solve(tangent, -2 * wave.mass * wave.speed * r)
    slope = mesh.weights @ ((3 * tension + r * stiffness) * r_c) / 2
    return float(slope), Integrals(
        mesh, stiffness * r_c / squared - 2 / wave.speed * wave._shape.values
    )


def neutral_motions(wave: Any, x: ArrayLike) -> Array:
    """The perturbations that a wave neither amplifies nor damps: its shift, and its change with
    the speed.

    Parameters
    ----------
    wave : SolitaryWave
    x : array_like, (n,)
        Distances of sites from the peak, in sites.

    Returns
    -------
    ndarray, (2, 2, n)
        Displacement and velocity of the shift (d/dx), then of the change (d/dc).
    """
    x = check.numbers("x", x, "sites")
    rate, change = wave.rate(x), wave._by_speed[1]
    before, after = (wave.potential.tension(wave.elongation(x + side)) for side in (-0.5, 0.5))
    bend = (after - before) / (wave.mass * wave.speed**2)
    shift = rate, -wave.speed * bend
    return np.array([shift, (change.displacement(x), -rate - wave.speed * change.rate(x))])
