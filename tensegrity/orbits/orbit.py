"""Time-periodic orbits of scenes: `periodic_orbit`, and those of undriven ones by half-period
shooting.

An orbit that is at rest at t = 0 and again at half its period returns along the same path: the
unknowns are the displacements u(0), the equations v(T/2) = 0, and for a given energy T is one more
unknown.  Newton's method takes their derivatives from the tangents of half a period.  Where a scene
may be shifted or turned as a whole, it stays where the guess is; the momenta that are conserved
then vanish, so that as many equations are redundant.
Source: J. L. Marin, S. Aubry, Nonlinearity 9, 1501 (1996).
"""

from __future__ import annotations

import math

import numpy as np

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.orbits.driven_orbit import WholePeriod
from tensegrity.orbits.flow import Flow
from tensegrity.orbits.period import DrivePeriod, fitting
from tensegrity.orbits.shooting import (
    FINEST,
    NoOrbitError,
    Orbit,
    Shooting,
    symmetries,
)
from tensegrity.scenes.chain import Chain
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.scene import Scene, State
from tensegrity.typing import Array

ANGLE = 0.25  # first dt times the bound on the frequency
SHORTEST = 1e-3  # half period times the bound on the frequency
AT_REST = 1e-5  # of the guess's displacements, below which an orbit is the state at rest
HARMONICS = 6  # that are compared with the bands
CROWDED = 4.0  # neighbouring modes closer than so many mean distances form a band


def periodic_orbit(
    scene: Scene,
    guess: State | Orbit,
    *,
    period: float | None = None,
    energy: float | None = None,
) -> Orbit:
    """A time-periodic orbit of a scene: of an undriven one, at rest twice in a period, or the
    response of a chain with drives, dashpots and forces of its own.

    Parameters
    ----------
    scene : Scene
        A chain, or a network, guide or pack whose list of contacts is fixed.
    guess : State or Orbit
        Whose displacements are near those of a turning point; velocities are ignored.  An orbit
        is followed by small changes of period or energy.  Of a driven scene the state at t = 0,
        velocities included; `scene.at_rest()` leads to the response to weak drives.
    period, energy : float
        One of them: the period [s], or the energy above that at rest [J].  With an energy the guess
        is an `Orbit`, whose period starts the search.  Of a driven scene the shortest period of its
        drives by default, otherwise a whole multiple of it to 1e-9, and no energy.

    Returns
    -------
    Orbit

    Raises
    ------
    TensegrityError
        Bad input, contacts that come and go, a drive without a period, drives whose periods do not
        fit together, springs that change in time, no orbit near the guess (the message says which
        harmonic of the period lies in a band), or one that is the state at rest.

    Examples
    --------
    A breather of prisms above the band, centred on a bond:

    >>> import numpy as np
    >>> from tensegrity import Chain, Prism, State, periodic_orbit
    >>> chain = Chain(Prism(1.0, 0.7, 0.1, 1.0).potential(), 40)
    >>> x = np.arange(40) - 19.5
    >>> guess = State(0.02 * np.sin(np.pi * x) / np.cosh(0.63 * x), 0 * x)
    >>> orbit = periodic_orbit(chain, guess, period=1 / 0.5570224355385)
    >>> f"{orbit.energy:.9f} J"
    '0.014267564 J'
    """
    check.kind("scene", scene, Scene)
    if not isinstance(guess, (State, Orbit)):
        raise TensegrityError(f"guess {check.shown(guess)} is not a State or an Orbit")
    if dynamics(scene).follows:
        raise TensegrityError(
            "periodic_orbit: contacts of the scene come and go, must be fixed: see `scene.listed`"
        )
    if dynamics(scene).is_driven:
        return _driven_orbit(scene, guess, period, energy)
    if (period is None) == (energy is None):
        raise TensegrityError("give exactly one of period and energy")
    began = guess.state if isinstance(guess, Orbit) else guess
    scene.check(began)
    half_period = HalfPeriod(scene, began.u.ravel())
    if not half_period.extent(began.u.ravel()) > 0:
        raise TensegrityError(
            "guess is at rest undeformed: give the displacements of a turning point"
        )
    if energy is not None:
        if not isinstance(guess, Orbit):
            raise TensegrityError(
                "an energy needs an Orbit as guess, whose period starts the search"
            )
        half_period.energy = check.number("energy", energy, above=0, unit="J")
        time = guess.period
    else:
        time = check.number("period", period, above=0, unit="s")
    try:
        return half_period.orbit(time / 2)
    except (NoOrbitError, np.linalg.LinAlgError) as error:
        raise TensegrityError(f"no periodic orbit found: {error}{_in_band(scene, time)}") from None


def _driven_orbit(
    scene: Scene, guess: State | Orbit, period: float | None, energy: float | None
) -> Orbit:
    """`periodic_orbit` of a scene that is driven or damped."""
    if scene.tune:
        raise TensegrityError("periodic_orbit: not for chains with tuned springs")
    check.kind("driven scene", scene, Chain)
    if energy is not None:
        raise TensegrityError("the energy of a driven orbit cannot be given: its drives set it")
    shortest = DrivePeriod(scene).value
    if period is not None:
        shortest = fitting(check.number("period", period, above=0, unit="s"), shortest)
    began = guess.state if isinstance(guess, Orbit) else guess
    scene.check(began)
    whole = WholePeriod(scene, began, shortest)
    try:
        x, residual = whole.settled(whole.guess, whole.steps)
    except (NoOrbitError, np.linalg.LinAlgError) as error:
        raise TensegrityError(f"no periodic orbit found: {error}") from None
    return whole.found(x, shortest, residual)


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
        Orthonormal motions of the whole scene, displaced as the guess.
    energy : float or None
        The orbit's [J]; by default T/2 stays as it is.
    """

    energy: float | None = None

    def __init__(self, scene: Scene, guess: Array) -> None:
        super().__init__(scene, Flow(scene, 1))
        self._guess, self.free = guess, np.flatnonzero(self.inverse_mass > 0)
        self.shifts = symmetries(scene, guess)[self.free]
        self._size = self.extent(guess) or 1.0

    def extent(self, u: Array) -> float:
        """The range of displacements, 0 among them, apart from motions of the whole scene [m]."""
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
        """The orbit of given unknowns, at the turning point that the guess lies nearer to."""
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
        """The larger of the parts by which u and T/2 change."""
        parts = np.abs(step[:-1]).max() / self.extent(x[:-1]), abs(step[-1] / x[-1])
        return float(max(parts))

    def refuse(self, x: Array) -> None:
        """Refuse the state at rest."""
        if self.extent(x[:-1]) < AT_REST * self._size:
            raise NoOrbitError("the guess slides to the state at rest")

    def equations(self, u: Array, half: float) -> tuple[Array, Array, Array]:
        """v(T/2) at free sites, its derivatives by their displacements, and by T/2; with the
        motion of the whole scene from the guess, which shall be 0.

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
        end, v, tangent = self.flow.tangents(u, 0 * u, half, of_u=False)
        jacobian, v = tangent[np.ix_(self.free, self.free)], v[self.free]
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


def _in_band(scene: Scene, period: float) -> str:
    """Words on the first harmonic of a period that lies among the modes of a scene."""
    stiffness = scene.stiffness(scene.at_rest().u).toarray()
    free = np.flatnonzero(np.repeat(dynamics(scene).inverse_mass, scene.dim) > 0)
    roots = np.sqrt(np.repeat(scene.mass, scene.dim)[free])
    squares = np.linalg.eigvalsh(stiffness[np.ix_(free, free)] / np.outer(roots, roots))
    found = np.sqrt(np.maximum(squares, 0)) / (2 * np.pi)
    spacing = CROWDED * found[-1] / len(found)
    for n in range(1, HARMONICS + 1):
        above = int(np.searchsorted(found, n / period))
        if 0 < above < len(found) and found[above] - found[above - 1] < spacing:
            low, high = above - 1, above
            while low and found[low] - found[low - 1] < spacing:
                low -= 1
            while high + 1 < len(found) and found[high + 1] - found[high] < spacing:
                high += 1
            return (
                f"; harmonic {n} of the period, {n / period:.6g} Hz, lies in the band "
                f"{found[low]:.6g} to {found[high]:.6g} Hz, in which nothing localised exists"
            )
    return ""
