"""Orbits that are at rest twice in a period, by half-period shooting; see `periodic_orbit`.

The tangent of a period is R P^-1 R P, P that of half a period, and R the reversal of velocities.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from tensegrity.errors import TensegrityError
from tensegrity.orbits.flow import DrivenFlow, Flow
from tensegrity.orbits.shooting import (
    FINEST,
    Multipliers,
    NoOrbitError,
    Orbit,
    Shooting,
    descending,
    symmetries,
)
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.scene import Scene, State
from tensegrity.typing import Array

ANGLE = 0.25  # first dt times the bound on the frequency
SHORTEST = 1e-3  # half period times the bound on the frequency
AT_REST = 1e-5  # of the guess's displacements, below which an orbit is the state at rest
ON_CIRCLE = 1e-6  # distance of the sum of a pair of multipliers from its value at an event
MEETING = 24  # most pairs of multipliers among which collisions are located
MEET = 1e-6  # imaginary part of mu + 1/mu up to which a pair lies on the unit circle


class HalfPeriod(Shooting):
    """The equations v(T/2) = 0 in unknowns u(0) [m] of the free entries and T [s], and, if the
    energy is held, that energy [J].

    Parameters
    ----------
    scene : Scene
    guess : ndarray, (entries,)
        Displacements [m].
    period : float
        [s]
    energy : float, optional
        Held instead of the period [J].

    Attributes
    ----------
    shifts : ndarray, (free, motions)
        Orthonormal rigid motions of the whole scene at the displacements of the guess.
    """

    longest, closed = 0.1, 1e-9

    def __init__(
        self, scene: Scene, guess: Array, period: float, energy: float | None = None
    ) -> None:
        grounded = dynamics(scene).has_forces
        super().__init__(scene, DrivenFlow(scene, 1, 0.0) if grounded else Flow(scene, 1))
        self._part = {} if grounded else {"of_u": False}
        self._began, self._first, self._energy = guess, period, energy
        self.free = np.flatnonzero(self.inverse_mass > 0)
        self.shifts = symmetries(scene, guess)[self.free]
        if grounded:
            self.shifts = self.shifts[:, :0]
        self.guess = np.append(guess[self.free], [period] if energy is None else [period, energy])
        self._size = self.extent(guess) or 1.0
        self.scale = self.guess[:-1].copy()
        self.scale[: len(self.free)] = self._size
        self.count = len(self.free) - 1 - self.shifts.shape[1]
        self.kinds = ("doubling", "stability", *(("torus",) if self.count <= MEETING else ()))

    def extent(self, u: Array) -> float:
        """The range of displacements, 0 included, without rigid motions of the whole scene [m]."""
        u = (u - self.rest.ravel())[self.free]
        return float(np.ptp(np.append(u - self.shifts @ (u @ self.shifts), 0.0)))

    def _start(self, x: Array) -> tuple[Array, float]:
        """u(0) of all entries, and T/2."""
        u = self._began.copy()
        u[self.free] = x[: len(self.free)]
        return u, float(x[len(self.free)]) / 2

    def steps_to(self, value: float) -> int:
        """Least number of steps where the last unknown has another value."""
        return 1

    @property
    def steps(self) -> int:
        """A first number of steps of half the period."""
        u, half = self._began, self._first / 2
        frequency = self.of.frequency(self.of.ranges_at(u.reshape(self.scene.shape)))
        most = FINEST * ANGLE / frequency if frequency > 0 else 0.0
        if not half <= most:
            raise TensegrityError(f"period {2 * half:g} s must be at most {2 * most:g} s")
        if half < SHORTEST / frequency:
            least = 2 * SHORTEST / frequency
            raise TensegrityError(f"period {2 * half:g} s must be at least {least:g} s")
        return max(8, math.ceil(half * frequency / ANGLE))

    def orbit(self, x: Array) -> Orbit:
        """The orbit of given unknowns, at the turning point nearer to the guess."""
        u, half = self._start(x)
        end, v = self.flow.end(u, 0 * u, half)
        residual = float(np.abs(v[self.free]).max()) * half / (math.pi * self.extent(u))
        opens = bool(self.of.springs.kinks_within(self.flow.ranges))
        if np.abs(end - self._began).max() < np.abs(u - self._began).max():
            u = end
        state = State(*(x.reshape(self.scene.shape) for x in (u, 0 * u)))
        self.scene.check(state)
        energy = self.above_rest(u, 0 * u)
        return Orbit(self.scene, state, 2 * half, energy, residual, opens, self.flow.steps)

    def size(self, step: Array, x: Array) -> float:
        """The larger of the relative changes of u, and of T where the energy is held."""
        count = len(self.free)
        of_u = float(np.abs(step[:count]).max()) / self.extent(self._start(x)[0])
        return max(of_u, float(np.abs(step[count:] / x[count:-1]).max(initial=0.0)))

    def refuse(self, x: Array) -> None:
        """Refuse the state at rest."""
        if self.extent(self._start(x)[0]) < AT_REST * self._size:
            raise NoOrbitError("the iteration converges to the state at rest")

    def evaluated(self, x: Array) -> tuple[Array, Array, Any]:
        """See `Shooting.evaluated`: v(T/2) at free sites, with the rigid motion of the whole scene
        from the guess, which must be 0, and the missing energy."""
        (u, half), free, count = self._start(x), self.free, len(self.free)
        outside = x[:-1] + math.nan, np.eye(len(x) - 1, len(x)), None
        if half <= 0 or not self.inside(u):
            return outside
        end, v, tangent = self.flow.tangents(u, 0 * u, half, **self._part)[:3]
        matrix, v = tangent[-len(u) :][np.ix_(free, free)], v[free]
        if not (np.isfinite(matrix).all() and np.isfinite(v).all() and self.inside(end)):
            return outside
        shifts = self.shifts * float(np.abs(matrix).max())
        residual, jacobian = np.zeros(len(x) - 1), np.zeros((len(x) - 1, len(x)))
        residual[:count] = v + shifts @ (self.shifts.T @ (u - self._began)[free])
        jacobian[:count, :count] = matrix + shifts @ self.shifts.T
        jacobian[:count, count] = (self.forces(end) * self.inverse_mass)[free] / 2
        size = max(self._size, self.extent(u))  # round-off increases with the orbit
        unit = math.pi * size / min(self._first / 2, half)
        residual[:count] /= unit
        jacobian[:count] /= unit
        if self._energy is not None:
            scale = max(self._energy, abs(x[-1]))
            residual[-1] = (self.above_rest(u, 0 * u) - x[-1]) / scale
            jacobian[-1, :count], jacobian[-1, -1] = -self.forces(u)[free] / scale, -1 / scale
        return residual, jacobian, None

    def amplitude(self, orbit: Orbit) -> float:
        """Half of the largest displacement between the two turning points [m]; see `OrbitPath`."""
        u = orbit.state.u.ravel()
        return float(np.abs(self.flow.end(u, 0 * u, orbit.period / 2)[0] - u).max() / 2)

    def multipliers(self, x: Array) -> tuple[Multipliers, Multipliers]:
        """Floquet multipliers in descending modulus, and the neutral ones.

        Motions that a period maps to themselves, along the orbit and of the whole scene, have a
        symplectic complement that is invariant and contains them; the multipliers sought are those
        in it modulo these motions, and each of these motions stands for a pair of neutral ones.
        """
        (u, half), free, count = self._start(x), self.free, len(self.free)
        root = 1 / np.sqrt(self.inverse_mass[free])  # makes the form that of canonical variables
        here, roots = np.append(free, len(u) + free), np.tile(root, 2)
        tangent = self.flow.tangents(u, 0 * u, half)[2][np.ix_(here, here)]
        tangent = roots[:, None] * tangent / roots
        form = np.kron([[0, 1], [-1, 0]], np.eye(count))
        reversal = np.repeat([1.0, -1.0], count)[:, None]
        whole = reversal * (-form @ tangent.T @ form @ (reversal * tangent))
        motions = np.zeros((2 * count, 1 + self.shifts.shape[1]))
        motions[count:, 0] = self.forces(u)[free] / root
        motions[:count, 1:] = root[:, None] * self.shifts
        basis, neutral = np.linalg.qr(motions)[0], motions.shape[1]
        rest = np.linalg.qr(np.hstack([basis, form @ basis]), mode="complete")[0][:, 2 * neutral :]
        ones = np.linalg.eigvals(basis.T @ whole @ basis).astype(complex)
        found = np.linalg.eigvals(rest.T @ whole @ rest).astype(complex)
        return descending(found), descending(np.append(ones, 1 / ones))

    def distances(self, multipliers: Multipliers) -> tuple[Array, ...]:
        """The sum mu + 1/mu of a pair passes 2 and -2 linearly; where two pairs collide on the
        circle and leave it, the square of the difference of their sums changes its sign."""
        sums = _sums(multipliers)
        on = np.abs(sums.imag) < MEET
        apart = np.diff(np.sort(sums.real[on])) ** 2
        off = -4 * sums.imag[~on & (sums.imag > 0)] ** 2
        meeting = np.append(off, apart) + 4 * MEET**2
        return (2 + sums.real, 2 - sums.real, meeting)[: len(self.kinds)]

    def is_event(self, kind: str, multipliers: Multipliers) -> bool:
        """Whether multipliers are those of an event of this kind, where one of its numbers is 0."""
        sums = _sums(multipliers)
        if kind == "torus":
            place = np.sort(sums[np.abs(sums.imag) < 2 * MEET].real)
            near = np.argmin(np.diff(place)) if len(place) > 1 else 0
            return len(place) > 1 and abs(place[near]) < 2
        end = -2.0 if kind == "doubling" else 2.0
        return bool(np.abs(sums - end).min(initial=1.0) < ON_CIRCLE)


def _sums(multipliers: Multipliers) -> Multipliers:
    """mu + 1/mu of each pair of multipliers, (pairs,)."""
    real = multipliers[multipliers.imag == 0]
    halves = [x[: len(x) // 2] for x in (real[real.real > 0], real[real.real < 0])]
    one = np.concatenate([multipliers[multipliers.imag > 0], *halves])
    return np.asarray(one + 1 / one, dtype=complex)
