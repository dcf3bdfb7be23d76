"""Orbits that are at rest twice in a period, by half-period shooting; see `periodic_orbit`."""

from __future__ import annotations

import math

import numpy as np

from tensegrity.errors import TensegrityError
from tensegrity.orbits.flow import DrivenFlow, Flow
from tensegrity.orbits.shooting import FINEST, NoOrbitError, Orbit, Shooting, symmetries
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.scene import Scene, State
from tensegrity.typing import Array

ANGLE = 0.25  # first dt times the bound on the frequency
SHORTEST = 1e-3  # half period times the bound on the frequency
AT_REST = 1e-5  # of the guess's displacements, below which an orbit is the state at rest


class HalfPeriod(Shooting):
    """The equations v(T/2) = 0 in unknowns u(0) [m] and T/2 [s].

    Parameters
    ----------
    scene : Scene
    guess : ndarray, (entries,)
        Displacements [m].

    Attributes
    ----------
    free : ndarray of int
        Entries of the sites that are not held.
    shifts : ndarray, (free, motions)
        Orthonormal rigid motions of the whole scene at the displacements of the guess.
    energy : float or None
        Energy of the orbit [J]; by default T/2 is given instead.
    """

    energy: float | None = None

    def __init__(self, scene: Scene, guess: Array) -> None:
        grounded = dynamics(scene).has_forces
        super().__init__(scene, DrivenFlow(scene, 1, 0.0) if grounded else Flow(scene, 1))
        self._part = {} if grounded else {"of_u": False}
        self._guess, self.free = guess, np.flatnonzero(self.inverse_mass > 0)
        self.shifts = symmetries(scene, guess)[self.free]
        if grounded:
            self.shifts = self.shifts[:, :0]
        self._size = self.extent(guess) or 1.0

    def extent(self, u: Array) -> float:
        """The range of displacements, 0 included, without rigid motions of the whole scene [m]."""
        u = (u - self.rest.ravel())[self.free]
        return float(np.ptp(np.append(u - self.shifts @ (u @ self.shifts), 0.0)))

    def orbit(self, half: float) -> Orbit:
        """The orbit near the guess and half a period [s]."""
        u = self._guess
        frequency = self.of.frequency(self.of.ranges_at(u.reshape(self.scene.shape)))
        most = FINEST * ANGLE / frequency if frequency > 0 else 0.0
        if not half <= most:
            raise TensegrityError(f"period {2 * half:g} s must be at most {2 * most:g} s")
        if half < SHORTEST / frequency:
            least = 2 * SHORTEST / frequency
            raise TensegrityError(f"period {2 * half:g} s must be at least {least:g} s")
        x, off = self.settled(np.append(u, half), max(8, math.ceil(half * frequency / ANGLE)))
        return self.found(x, off)

    def found(self, x: Array, residual: float) -> Orbit:
        """The orbit of given unknowns, at the turning point nearer to the guess."""
        u, half = x[:-1], float(x[-1])
        end = self.flow.end(u, 0 * u, half)[0]
        opens = bool(self.of.springs.kinks_within(self.flow.ranges))
        if np.abs(end - self._guess).max() < np.abs(u - self._guess).max():
            u = end
        state = State(*(x.reshape(self.scene.shape) for x in (u, 0 * u)))
        self.scene.check(state)
        energy = self.above_rest(u, 0 * u)
        return Orbit(self.scene, state, 2 * half, energy, residual, opens, self.flow.steps)

    def size(self, step: Array, x: Array) -> float:
        """The larger of the relative changes of u and T/2."""
        parts = np.abs(step[:-1]).max() / self.extent(x[:-1]), abs(step[-1] / x[-1])
        return float(max(parts))

    def refuse(self, x: Array) -> None:
        """Refuse the state at rest."""
        if self.extent(x[:-1]) < AT_REST * self._size:
            raise NoOrbitError("the iteration converges to the state at rest")

    def equations(self, u: Array, half: float) -> tuple[Array, Array, Array]:
        """v(T/2) at free sites, and its derivatives with respect to their displacements and to
        T/2; with the rigid motion of the whole scene from the guess, which must be 0.

        Parameters
        ----------
        u : ndarray, (entries,)
            [m]
        half : float
            [s]

        Returns
        -------
        v : ndarray, (free,)
        jacobian : ndarray, (free, free)
        acceleration : ndarray, (free,)
        """
        end, v, tangent = self.flow.tangents(u, 0 * u, half, **self._part)[:3]
        jacobian, v = tangent[-len(u) :][np.ix_(self.free, self.free)], v[self.free]
        if not (np.isfinite(jacobian).all() and np.isfinite(v).all() and self.inside(end)):
            return v + math.nan, jacobian, 0 * v
        acceleration = (self.forces(end) * self.inverse_mass)[self.free]
        shifts = self.shifts * float(np.abs(jacobian).max())
        moved = self.shifts.T @ (u - self._guess)[self.free]
        return v + shifts @ moved, jacobian + shifts @ self.shifts.T, acceleration

    def step(self, x: Array) -> tuple[Array, float]:
        """Newton's step, and |v(T/2)| over that of linear motion."""
        u, half, free = x[:-1], float(x[-1]), self.free
        if half <= 0 or not self.inside(u):
            return x + math.nan, math.inf
        v, jacobian, acceleration = self.equations(u, half)
        if not np.isfinite(v).all():
            return x + math.nan, math.inf
        right, step = -v, np.zeros(len(x))
        off = float(np.abs(v).max()) * half / (math.pi * self.extent(u))
        if self.energy is None:
            step[free] = np.linalg.solve(jacobian, right)
            return step, off
        matrix = np.zeros((len(free) + 1, len(free) + 1))
        matrix[:-1, :-1], matrix[:-1, -1] = jacobian, acceleration
        matrix[-1, :-1] = -self.forces(u)[free]
        missing = self.energy - self.above_rest(u, 0 * u)
        scale = float(np.abs(matrix[-1]).max())
        matrix[-1] /= scale
        step[[*free, -1]] = np.linalg.solve(matrix, np.append(right, missing / scale))
        return step, off
