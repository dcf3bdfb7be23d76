"""Periodic responses of driven and damped scenes, by shooting over the period of the drives.

The unknowns are the state z(0) = (u, v) of the coordinates that move freely, the equations
z(T) = z(0); Newton's method takes the tangent of the whole period, whose eigenvalues are the
orbit's Floquet multipliers.  Source: R. Seydel, Practical Bifurcation and Stability Analysis,
chapter 7.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from tensegrity.errors import TensegrityError
from tensegrity.orbits.flow import DrivenFlow
from tensegrity.orbits.shooting import FINEST, Orbit, Shooting
from tensegrity.readonly import FixedDict
from tensegrity.scenes.dynamics import varied
from tensegrity.scenes.forcing import driven_entries
from tensegrity.scenes.scene import Scene, State
from tensegrity.typing import Array

LEAST = 16  # steps of a period
SHIFTED = 1e-9  # change of a translation of the chain in one period below which it is neutral


class WholePeriod(Shooting):
    """The equations z(T) = z(0) in unknowns u(0) [m] and v(0) T/2 pi [m] of the free entries.

    Parameters
    ----------
    scene : Scene
    guess : State
        Displacements and velocities near those of the orbit at t = 0.
    period : float
        Period of the drives, or a whole multiple of it [s].

    Attributes
    ----------
    free : ndarray of int
        Entries whose motion is not prescribed.
    """

    def __init__(self, scene: Scene, guess: State, period: float) -> None:
        super().__init__(scene, DrivenFlow(scene, 1, period))
        self._period, self._start = period, scene.at_rest()
        self._rate = period / (2 * math.pi)  # displacement over velocity [s]
        self._moved, self._motions = driven_entries(scene, True)
        free = self.inverse_mass > 0
        free[self._moved] = False
        self.free = np.flatnonzero(free)
        self.guess = self._unknowns(guess.u.ravel(), guess.v.ravel())
        axes = np.tile(np.eye(scene.dim), (scene.sites, 1))  # shifts of the whole scene
        axes = axes[:, free.reshape(-1, scene.dim).all(axis=0)][free]
        self._shifts, self._checked = axes / math.sqrt(scene.sites), False

    def _unknowns(self, u: Array, v: Array) -> Array:
        return np.append(u[self.free], v[self.free] * self._rate)

    @property
    def steps(self) -> int:
        """A first number of steps of the period."""
        start = self.state(self.guess)
        steps = self.flow.first_steps(start.u, start.v, self._period)
        if steps > FINEST:
            raise TensegrityError(
                f"a period of {self._period:g} s takes {steps} steps, must take at most {FINEST}: "
                f"the scene's frequencies or decay rates are {steps / FINEST:.3g} times too large"
            )
        return max(LEAST, steps)

    def state(self, x: Array, values: Mapping[str, float] | None = None) -> State:
        """The state at t = 0 of given unknowns.

        Parameters
        ----------
        x : ndarray, (2 free,)
        values : dict of str to float, optional
            Other values of parameters of the drives.

        Returns
        -------
        State
        """
        both = np.stack([self._start.u.ravel(), self._start.v.ravel()])
        for entry, signal in zip(self._moved if values else (), self._motions, strict=False):
            both[:, entry] = [signal.varied(values)(np.zeros(1), k)[0] for k in (0, 1)]
        both[:, self.free] = x.reshape(2, -1)
        both[1, self.free] /= self._rate
        return State(*both.reshape(2, *self.scene.shape))

    def equations(
        self,
        x: Array,
        period: float,
        values: Mapping[str, float] | None = None,
        by: str | None = None,
    ) -> tuple[Array, Array, Array]:
        """z(T) - z(0), and its derivatives with respect to z(0) and to a parameter at constant T.

        Parameters
        ----------
        x, values
            As of `state`.
        period : float
            T [s].
        by : str, optional

        Returns
        -------
        residual : ndarray, (2 free,)
            [m], velocities times the first T/2 pi; nan outside of the springs' domains.
        jacobian : ndarray, (2 free, 2 free)
        column : ndarray, (2 free,)
        """
        start, free = self.state(x, values), self.free
        here = np.append(free, start.u.size + free)
        if not self.inside(start.u):
            return x + math.nan, np.eye(len(x)), 0 * x
        begin = start.u.ravel(), start.v.ravel()
        u, v, tangent, column = self.flow.tangents(*begin, period, values, by)
        scale = np.repeat([1.0, self._rate], len(free))
        tangent = tangent[np.ix_(here, here)] * scale[:, None] / scale
        column = column[here] * scale
        residual = self._unknowns(u, v) - x
        if not (np.isfinite(tangent).all() and np.isfinite(residual).all()):
            return x + math.nan, np.eye(len(x)), 0 * x
        jacobian = tangent - np.eye(len(x))
        count = len(free)
        if not self._checked:
            moved = np.abs(jacobian[:, :count] @ self._shifts).max(axis=0, initial=0.0)
            self._shifts, self._checked = self._shifts[:, moved < SHIFTED], True
        residual[count:] += self._shifts @ (self._shifts.T @ (x - self.guess)[:count])
        jacobian[count:, :count] += self._shifts @ self._shifts.T
        return residual, jacobian, column

    def multipliers(self, jacobian: Array) -> NDArray[np.complex128]:
        """Floquet multipliers, (2 free,), from the derivatives of `equations` in z(0)."""
        count, whole = len(self.free), jacobian + np.eye(len(jacobian))
        whole[count:, :count] -= self._shifts @ self._shifts.T
        return np.linalg.eigvals(whole).astype(complex)

    def rates(self, period: float) -> Array:
        """The time derivative of the state at the start of the last run, (2 free,) [m/s]."""
        v, acceleration = self.flow.rates_at_start(period)
        return self._unknowns(v, acceleration)

    def found(
        self, x: Array, period: float, residual: float, values: Mapping[str, float] | None = None
    ) -> Orbit:
        """The orbit of given unknowns.

        Parameters
        ----------
        x, values
            As of `state`.
        period : float
            [s]
        residual : float

        Returns
        -------
        Orbit
        """
        scene, state = self.scene, self.state(x, values)
        if values:
            drive = {
                site: one.varied({k: y for k, y in values.items() if k in one.parameters})
                for site, one in scene.drive.items()
            }
            scene = varied(scene, drive=FixedDict(drive))
        self.flow.end(state.u.ravel(), state.v.ravel(), period, values)
        opens = bool(self.of.springs.kinks_within(self.flow.ranges))
        energy = self.above_rest(state.u, state.v)
        return Orbit(scene, state, period, energy, residual, opens, self.flow.steps)

    def step(self, x: Array) -> tuple[Array, float]:
        """Newton's step, and the largest entry of z(T) - z(0) over that of z(0) or z(T)."""
        residual, jacobian, _ = self.equations(x, self._period)
        if not np.isfinite(residual).all():
            return residual, math.inf
        size = max(float(np.abs(x).max()), float(np.abs(x + residual).max()), 1e-300)
        step = np.asarray(np.linalg.solve(jacobian, -residual), dtype=float)
        return step, float(np.abs(residual).max()) / size

    def size(self, step: Array, x: Array) -> float:
        """A change of x relative to the larger of x before and after it."""
        if not step.any():
            return 0.0
        return float(np.abs(step).max() / max(np.abs(x).max(), np.abs(x + step).max()))


def whole_multipliers(orbit: Orbit) -> NDArray[np.complex128]:
    """Floquet multipliers of an orbit of a driven or damped scene, (2 free,)."""
    whole = WholePeriod(orbit.scene, orbit.state, orbit.period)
    whole.flow.steps = orbit.steps
    return whole.multipliers(whole.equations(whole.guess, orbit.period)[1])
