"""Time-periodic orbits of undriven chains, by half-period shooting: `periodic_orbit`.

An orbit that is at rest at t = 0 and again at half its period returns along the same path: the
unknowns are the displacements u(0), the equations v(T/2) = 0, and for a given energy T is one more
unknown.  Newton's method takes their derivatives from the tangents of half a period.  At free ends
a shift of the whole chain is no motion: the mean displacement is that of the guess.
Source: J. L. Marin, S. Aubry, Nonlinearity 9, 1501 (1996).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.orbits.flow import Flow
from tensegrity.runs.integrate import simulate
from tensegrity.runs.run import Run
from tensegrity.scenes.chain import Chain
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.scene import State
from tensegrity.typing import Array

ITERATIONS, HALVINGS = 60, 8  # of Newton's method, and of one of its steps
LONGEST = 0.3  # step of it over the largest displacement
CONVERGED = 1e-12  # last step of Newton's method over the largest displacement
STUCK = 1e-9  # the same, below which round-off may end the iteration
SETTLED = 1e-9  # change of the displacements between two numbers of steps, over the largest
ANGLE = 0.25  # first dt times the bound on the frequency
FINEST = 4096  # steps per half period
SHORTEST = 1e-3  # half period times the bound on the frequency
AT_REST = 1e-5  # of the guess's displacements, below which an orbit is the state at rest
HARMONICS = 6  # that are compared with the bands
CROWDED = 4.0  # neighbouring modes closer than so many mean distances form a band


@dataclass(frozen=True, eq=False)
class Orbit:
    """A time-periodic motion, computed by `periodic_orbit`.

    Attributes
    ----------
    scene : Chain
    state : State
        At rest, at the turning point that the guess lies nearer to.
    period : float
        [s]
    energy : float
        Above that at rest [J].
    residual : float
        Largest |v| at half the period over the largest |v| that linear motion of the same
        displacements and period has.
    opens : bool
        Whether some spring passes a kink, such as the loss of contact: fewer digits then.
    steps : int
        Steps of half a period.
    """

    scene: Chain = field(repr=False)
    state: State = field(repr=False)
    period: float
    energy: float
    residual: float
    opens: bool
    steps: int = field(repr=False)

    def __str__(self) -> str:
        opens = "; springs pass kinks" if self.opens else ""
        return (
            f"periodic orbit of {self.scene.sites} sites, period {self.period:.6g} s, energy "
            f"{self.energy:.6g} J\nresidual {self.residual:.1e}{opens}"
        )

    def run(self, tol: float = 1e-9) -> Run:
        """A run of one period from `state`, with the tolerance of `simulate`."""
        return simulate(self.scene, self.state, self.period, tol=tol)


def periodic_orbit(
    scene: Chain,
    guess: State | Orbit,
    *,
    period: float | None = None,
    energy: float | None = None,
) -> Orbit:
    """A time-periodic orbit of a chain without drives and dashpots, at rest twice in a period.

    Parameters
    ----------
    scene : Chain
    guess : State or Orbit
        Whose displacements are near those of a turning point; velocities are ignored.  An orbit
        is followed by small changes of period or energy.
    period, energy : float
        One of them: the period [s], or the energy above that at rest [J].  With an energy the guess
        is an `Orbit`, whose period starts the search.

    Returns
    -------
    Orbit

    Raises
    ------
    TensegrityError
        Bad input, a scene that is driven, damped or has forces of its own, no orbit near the guess
        (the message says which harmonic of the period lies in a band), or one that is the state at
        rest.

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
    check.kind("scene", scene, Chain)
    if dynamics(scene).is_driven:
        raise TensegrityError(
            "periodic_orbit: not for chains with drives, dashpots, tuned springs or forces"
        )
    if not isinstance(guess, (State, Orbit)):
        raise TensegrityError(f"guess {check.shown(guess)} is not a State or an Orbit")
    if (period is None) == (energy is None):
        raise TensegrityError("give exactly one of period and energy")
    began = guess.state if isinstance(guess, Orbit) else guess
    scene.check(began)
    if not np.ptp(began.u) > 0:
        raise TensegrityError(
            "guess is at rest undeformed: give the displacements of a turning point"
        )
    if energy is not None:
        if not isinstance(guess, Orbit):
            raise TensegrityError(
                "an energy needs an Orbit as guess, whose period starts the search"
            )
        energy = check.number("energy", energy, above=0, unit="J")
        time = guess.period
    else:
        time = check.number("period", period, above=0, unit="s")
    half = _HalfPeriod(scene, began.u, energy)
    try:
        found = half.settled(began.u, time / 2)
    except _NoOrbitError as error:
        raise TensegrityError(f"no periodic orbit found: {error}{_in_band(scene, time)}") from None
    return found


class _NoOrbitError(Exception):
    """Newton's method did not converge."""


class _HalfPeriod:
    """The equations of an orbit over half its period."""

    def __init__(self, scene: Chain, guess: Array, energy: float | None) -> None:
        self.scene, self._guess, self._energy = scene, guess, energy
        self._of, self._flow = dynamics(scene), Flow(scene, 1)
        self._free = np.flatnonzero(self._of.inverse_mass > 0)
        self._shifts = float(len(self._free) == scene.sites)  # whether it may be shifted
        self._size = float(np.ptp(guess)) or 1.0

    def settled(self, u: Array, half: float) -> Orbit:
        """The orbit, with as many steps as its displacements need."""
        frequency = self._of.frequency(self._of.ranges_at(u))
        most = FINEST * ANGLE / frequency if frequency > 0 else 0.0
        if not half <= most:
            raise TensegrityError(f"period {2 * half:g} s must be at most {2 * most:g} s")
        if half < SHORTEST / frequency:
            least = 2 * SHORTEST / frequency
            raise TensegrityError(f"period {2 * half:g} s must be at least {least:g} s")
        steps, before = max(8, math.ceil(half * frequency / ANGLE)), None
        while True:
            self._flow.steps = steps
            u, half, off = self._solved(u, half)
            if np.ptp(u) < AT_REST * self._size:
                raise _NoOrbitError("the guess slides to the state at rest")
            moved = math.inf if before is None else float(np.abs(u - before).max() / np.ptp(u))
            if moved < SETTLED or steps >= FINEST:
                return self._orbit(u, half, off)
            steps, before = min(2 * steps, FINEST), u

    def _orbit(self, u: Array, half: float, residual: float) -> Orbit:
        end = self._flow.end(u, 0 * u, half)[0]
        opens = bool(self._of.springs.kinks_within(self._flow.ranges))
        if np.abs(end - self._guess).max() < np.abs(u - self._guess).max():
            u = end
        state, scene = State(u - self._shifts * np.mean(u - self._guess), 0 * u), self.scene
        above = scene.energy(state) - scene.energy(scene.at_rest())
        return Orbit(scene, state, 2 * half, above, residual, opens, self._flow.steps)

    def _solved(self, u: Array, half: float) -> tuple[Array, float, float]:
        """u(0), half a period, and the residual, by Newton's method."""
        best = math.inf
        step, by_time, off = self._step(u, half)
        for _ in range(ITERATIONS):
            size = max(float(np.abs(step).max()) / float(np.ptp(u)), abs(by_time) / half)
            if not size < math.inf:
                break
            if size < CONVERGED or (size < STUCK and size > best / 4):
                return u + step, half + by_time, off
            best, part = min(best, size), min(1.0, LONGEST / size)
            for _ in range(HALVINGS):
                tried = u + part * step, half + part * by_time
                step_there, by_time_there, off_there = self._step(*tried)
                if off_there < 2 * off + STUCK:
                    break
                part /= 2
            (u, half), step, by_time, off = tried, step_there, by_time_there, off_there
            if np.ptp(u) < AT_REST * self._size:
                raise _NoOrbitError("the guess slides to the state at rest")
        raise _NoOrbitError(f"the last Newton step is {size:.1e} of the displacements")

    def _step(self, u: Array, half: float) -> tuple[Array, float, float]:
        """Newton steps of u(0) and of half the period, and the residual."""
        free, sites = self._free, self.scene.sites
        low, high = self._of.springs.computable_domain[self._of.springs.group].T
        r = np.diff(u)
        if half <= 0 or np.any((r <= low) | (r >= high)):
            return u, 0.0, math.inf
        end, v, tangent = self._flow.tangents(u, 0 * u, half, of_u=False)
        if not (np.isfinite(tangent).all() and np.isfinite(v).all()):
            return u, 0.0, math.inf
        acceleration = self.scene.forces(end) * self._of.inverse_mass
        jacobian = tangent[np.ix_(free, free)]
        jacobian += self._shifts * float(np.abs(jacobian).max()) / sites
        right, step = -v[free], np.zeros(sites)
        off = float(np.abs(v).max()) * half / (math.pi * float(np.ptp(u)))
        if self._energy is None:
            step[free] = np.linalg.solve(jacobian, right)
            return step, 0.0, off
        matrix = np.zeros((len(free) + 1, len(free) + 1))
        matrix[:-1, :-1], matrix[:-1, -1] = jacobian, acceleration[free]
        matrix[-1, :-1] = -self.scene.forces(u)[free]
        state = State(u, 0 * u)
        missing = self._energy - self.scene.energy(state) + self.scene.energy(self.scene.at_rest())
        scale = float(np.abs(matrix[-1]).max())
        matrix[-1] /= scale
        found = np.linalg.solve(matrix, np.append(right, missing / scale))
        step[free] = found[:-1]
        return step, float(found[-1]), off


def half_map(orbit: Orbit) -> tuple[Array, Array]:
    """The tangent of half a period, and the directions that leave an orbit periodic.

    Parameters
    ----------
    orbit : Orbit

    Returns
    -------
    tangent : ndarray, (2 sites, 2 sites)
        With held sites at rest.
    motions : ndarray, (2 sites, 2 or 4)
        Pairs: change of the period and phase of the orbit; in a free chain its shift and boost.
    """
    scene, u = orbit.scene, orbit.state.u
    of, sites = dynamics(scene), scene.sites
    flow, free = Flow(scene, orbit.steps), np.flatnonzero(of.inverse_mass > 0)
    end, _, tangent = flow.tangents(u, 0 * u, orbit.period / 2)
    is_free = float(len(free) == sites)
    jacobian = tangent[sites:, :sites][np.ix_(free, free)]
    jacobian += is_free * float(np.abs(jacobian).max()) / sites
    by_period, nothing = np.zeros((2, sites))
    acceleration = [scene.forces(x) * of.inverse_mass for x in (u, end)]
    by_period[free] = np.linalg.solve(jacobian, -acceleration[1][free] / 2)
    motions = [by_period, nothing, nothing, acceleration[0]]
    if is_free:
        motions += [nothing + 1, nothing, nothing, nothing + 1]
    return tangent, np.reshape(motions, (-1, 2 * sites)).T


def _in_band(scene: Chain, period: float) -> str:
    """Words on the first harmonic of a period that lies among the modes of a scene."""
    stiffness = scene.stiffness(scene.at_rest().u).toarray()
    free = np.flatnonzero(dynamics(scene).inverse_mass > 0)
    roots = np.sqrt(scene.mass[free])
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
