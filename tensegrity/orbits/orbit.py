"""Time-periodic orbits of scenes: `periodic_orbit`, and those of undriven ones by half-period
shooting.

An orbit that is at rest at t = 0 and again at half its period returns along the same path: the
unknowns are the displacements u(0), the equations v(T/2) = 0, and for a given energy T is a further
unknown.  Newton's method takes the derivatives from the tangent map of half a period.  Rigid
motions under which a scene is invariant are fixed by the guess; the corresponding conserved momenta
vanish, so that as many equations are redundant.  The tangent of a period is R P^-1 R P, P that of
half a period, and R the reversal of velocities.
Source: J. L. Marin, S. Aubry, Nonlinearity 9, 1501 (1996).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, Any, TypeAlias

import numpy as np

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.errors import TensegrityError
from tensegrity.orbits.driven_orbit import DrivePeriod, WholePeriod, fitting
from tensegrity.orbits.flow import DrivenFlow, Flow
from tensegrity.orbits.shooting import (
    FINEST,
    Multipliers,
    NoOrbitError,
    Orbit,
    Shooting,
    descending,
    is_reversible,
    symmetries,
)
from tensegrity.scenes.acting import per_coordinate
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.scene import Scene, State
from tensegrity.typing import Array, Duration

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
        grounded = bool(dynamics(scene).further_forces)
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


Family: TypeAlias = HalfPeriod | WholePeriod

HARMONICS = 6  # number of harmonics compared with the bands
CROWDED = 4.0  # neighbouring modes closer than so many mean distances form a band


@checked
def periodic_orbit(
    scene: Scene,
    guess: State | Orbit,
    *,
    period: Duration | None = None,
    energy: Annotated[float, "> 0", "J"] | None = None,
) -> Orbit:
    """A time-periodic orbit of a scene: of an undriven one, at rest twice in a period, or the
    response of one with drives, dashpots and forces of its own.

    Parameters
    ----------
    scene : Scene
        A chain, or a network, guide or pack whose list of contacts is fixed.
    guess : State or Orbit
        Displacements near those of a turning point; velocities are ignored.  A family is followed
        by small changes of the period or energy of an orbit.  For a driven scene the state at
        t = 0, velocities included; `scene.at_rest()` leads to the response to weak drives.
    period, energy : float
        Exactly one of them: the period [s], or the energy above that at rest [J].  With an energy
        the guess must be an `Orbit`, whose period starts the search.  For a driven scene the period
        is by default the shortest one of its drives, otherwise a whole multiple of that, to 1e-9;
        no energy can be given.

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
    if not isinstance(guess, (State, Orbit)):
        raise TensegrityError(f"guess {check.shown(guess)} is not a State or an Orbit")
    if dynamics(scene).follows:
        raise TensegrityError(
            "periodic_orbit: contacts are detected during a run, must be fixed: see `scene.listed`"
        )
    if not is_reversible(scene):
        return _driven_orbit(scene, guess, period, energy)
    if (period is None) == (energy is None):
        raise TensegrityError("give exactly one of period and energy")
    began = guess.state if isinstance(guess, Orbit) else guess
    scene.check(began)
    if period is None:
        if not isinstance(guess, Orbit):
            raise TensegrityError(
                "an energy requires an Orbit as guess, whose period starts the search"
            )
        period = guess.period
    half_period = HalfPeriod(scene, began.u.ravel(), period, energy)
    if len(half_period.free) and not half_period.extent(began.u.ravel()) > 0:
        raise TensegrityError(
            "guess is the undeformed state at rest: give the displacements of a turning point"
        )
    time = period
    return _orbit(half_period, lambda: _in_band(scene, time))


def _driven_orbit(
    scene: Scene, guess: State | Orbit, period: float | None, energy: float | None
) -> Orbit:
    """`periodic_orbit` of a scene that is driven or damped."""
    if dynamics(scene).springs.changing:
        raise TensegrityError("periodic_orbit is not available for springs that change with time")
    if energy is not None:
        raise TensegrityError("the energy of a driven orbit cannot be given: its drives set it")
    shortest = DrivePeriod(scene).value
    if period is not None:
        shortest = fitting(period, shortest)
    began = guess.state if isinstance(guess, Orbit) else guess
    scene.check(began)
    return _orbit(WholePeriod(scene, began, shortest), str)


def _orbit(of: Family, reason: Callable[[], str]) -> Orbit:
    """The orbit near a guess, or an error with what may be the reason."""
    if not len(of.free):
        raise TensegrityError(
            f"periodic_orbit: all {of.scene.sites} sites are held or moved, none is free"
        )
    try:
        return of.orbit(of.settled(of.guess, of.steps))
    except (NoOrbitError, np.linalg.LinAlgError) as error:
        raise TensegrityError(f"no periodic orbit found: {error}{reason()}") from None


def family_of(orbit: Orbit, by: str = "") -> Family:
    """The equations of an orbit, to be followed by its "energy", its "period" or a parameter of its
    drives."""
    scene, state, period = orbit.scene, orbit.state, orbit.period
    if not is_reversible(scene):
        return WholePeriod(scene, state, period, by)
    return HalfPeriod(scene, state.u.ravel(), period, orbit.energy if by == "energy" else None)


def _in_band(scene: Scene, period: float) -> str:
    """Text on the first harmonic of a period that lies among the modes of a scene."""
    stiffness = scene.stiffness(scene.at_rest().u).toarray()
    free = np.flatnonzero(per_coordinate(scene, dynamics(scene).inverse_mass) > 0)
    roots = np.sqrt(per_coordinate(scene, scene.mass).ravel()[free])
    squares = np.linalg.eigvalsh(stiffness[np.ix_(free, free)] / np.outer(roots, roots))
    frequencies = np.sqrt(np.maximum(squares, 0)) / (2 * np.pi)
    spacing = CROWDED * frequencies[-1] / len(frequencies)
    for n in range(1, HARMONICS + 1):
        above = int(np.searchsorted(frequencies, n / period))
        if 0 < above < len(frequencies) and frequencies[above] - frequencies[above - 1] < spacing:
            low, high = above - 1, above
            while low and frequencies[low] - frequencies[low - 1] < spacing:
                low -= 1
            while (
                high + 1 < len(frequencies) and frequencies[high + 1] - frequencies[high] < spacing
            ):
                high += 1
            return (
                f"; harmonic {n} of the period, {n / period:.6g} Hz, lies in the band "
                f"{frequencies[low]:.6g} to {frequencies[high]:.6g} Hz, in which no localised "
                "orbit exists"
            )
    return ""
