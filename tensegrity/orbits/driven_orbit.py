"""Periodic responses of driven and damped chains, by shooting over the period of the drives.

The unknowns are the state z(0) = (u, v) at the sites that move freely, the equations z(T) = z(0);
Newton's method takes the tangent of the whole period, whose eigenvalues are the orbit's Floquet
multipliers.  Source: R. Seydel, Practical Bifurcation and Stability Analysis, chapter 7.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from tensegrity.orbits.flow import DrivenFlow
from tensegrity.orbits.shooting import Shooting
from tensegrity.scenes.chain import Chain
from tensegrity.scenes.scene import State
from tensegrity.typing import Array

ANGLE, LEAST = 0.5, 16  # first dt times the bound on the frequency, and least number of steps
SHIFTED = 1e-9  # change of a shift of the whole chain in one period, below which it is neutral


class WholePeriod(Shooting):
    """The equations z(T) = z(0) in unknowns u(0) [m] and v(0) T/2 pi [m] of the free sites.

    Parameters
    ----------
    scene : Chain
    guess : State
        Its velocities count too.
    period : float
        Of the drives, or a whole multiple [s].

    Attributes
    ----------
    free : ndarray of int
        Numbers of the sites whose motion is not prescribed.
    """

    def __init__(self, scene: Chain, guess: State, period: float) -> None:
        super().__init__(scene, DrivenFlow(scene, 1, period))
        self._period, self._start = period, scene.at_rest()
        moved = [site for site, drive in scene.drive.items() if drive.prescribes]
        free = self.of.inverse_mass > 0
        free[moved] = False
        self.free = np.flatnonzero(free)
        self.guess = np.concatenate([guess.u[self.free], guess.v[self.free] * self._rate(period)])
        self._shifts: float | None = None if len(self.free) == scene.sites else 0.0

    @staticmethod
    def _rate(period: float) -> float:
        """Displacement over velocity in harmonic motion [s]."""
        return period / (2 * math.pi)

    @property
    def steps(self) -> int:
        """A first number of steps of the period."""
        u = self.state(self.guess, self._period).u
        frequency = self.of.frequency(self.of.ranges_at(u))
        return max(LEAST, math.ceil(self._period * frequency / ANGLE))

    def state(
        self, x: Array, period: float, values: Mapping[str, float] | None = None
    ) -> State:
        """The state at t = 0 of given unknowns.

        Parameters
        ----------
        x : ndarray, (2 free,)
        period : float
            [s]
        values : dict of str to float, optional
            Other values of parameters of the drives.

        Returns
        -------
        State
        """
        u, v = self._start.u.copy(), self._start.v.copy()
        for site, drive in self.scene.drive.items():
            if drive.prescribes and values:
                u[site], v[site] = (drive.varied(values).at(0.0, k)[0] for k in (0, 1))
        u[self.free], v[self.free] = x.reshape(2, -1)
        v[self.free] /= self._rate(period)
        return State(u, v)

    def equations(
        self,
        x: Array,
        period: float,
        values: Mapping[str, float] | None = None,
        by: str | None = None,
    ) -> tuple[Array, Array, Array]:
        """z(T) - z(0), and its derivatives by z(0) and by a parameter at constant T.

        Parameters
        ----------
        x, period, values
            As of `state`.
        by : str, optional

        Returns
        -------
        residual : ndarray, (2 free,)
            [m], velocities times T/2 pi; nan outside of the springs' domains.
        jacobian : ndarray, (2 free, 2 free)
        column : ndarray, (2 free,)
        """
        start, free, sites = self.state(x, period, values), self.free, self.scene.sites
        here = np.append(free, sites + free)
        if not self.inside(start.u):
            return x + math.nan, np.eye(len(x)), 0 * x
        u, v, tangent, column = self.flow.tangents(start.u, start.v, period, values, by)
        scale = np.repeat([1.0, self._rate(period)], len(free))
        tangent = tangent[np.ix_(here, here)] * scale[:, None] / scale
        column = column[here] * scale
        residual = np.append(u[free], v[free] * self._rate(period)) - x
        if not (np.isfinite(tangent).all() and np.isfinite(residual).all()):
            return x + math.nan, np.eye(len(x)), 0 * x
        jacobian = tangent - np.eye(len(x))
        count = len(free)
        if self._shifts is None:
            shift = np.abs(jacobian[:, :count].sum(axis=1)).max()
            self._shifts = float(shift < SHIFTED)
        residual[count:] += self._shifts * np.mean(x[:count] - self.guess[:count])
        jacobian[count:, :count] += self._shifts / count
        return residual, jacobian, column

    def step(self, x: Array) -> tuple[Array, float]:
        """Newton's step, and the largest entry of z(T) - z(0) over that of z(0) or z(T)."""
        residual, jacobian, _ = self.equations(x, self._period)
        if not np.isfinite(residual).all():
            return residual, math.inf
        size = max(float(np.abs(x).max()), float(np.abs(x + residual).max()), 1e-300)
        return np.linalg.solve(jacobian, -residual), float(np.abs(residual).max()) / size

    def size(self, step: Array, x: Array) -> float:
        """A change of x over the larger of x and what it becomes."""
        if not step.any():
            return 0.0
        return float(np.abs(step).max() / max(np.abs(x).max(), np.abs(x + step).max()))


def whole_map(scene: Chain, state: State, period: float, steps: int) -> Array:
    """The tangent of a whole period at the sites that move freely.

    Parameters
    ----------
    scene : Chain
    state : State
        At t = 0.
    period : float
        [s]
    steps : int

    Returns
    -------
    ndarray, (2 free, 2 free)
    """
    whole = WholePeriod(scene, state, period)
    whole.flow.steps = steps
    here = np.append(whole.free, scene.sites + whole.free)
    return np.asarray(whole.flow.tangents(state.u, state.v, period)[2][np.ix_(here, here)])
