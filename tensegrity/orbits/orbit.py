"""Time-periodic orbits of scenes: `periodic_orbit`, and those of undriven ones by half-period
shooting.

An orbit that is at rest at t = 0 and again at half its period returns along the same path: the
unknowns are the displacements u(0), the equations v(T/2) = 0, and for a given energy T is a further
unknown.  Newton's method takes the derivatives from the tangent map of half a period.  Rigid
motions under which a scene is invariant are fixed by the guess; the corresponding conserved momenta
vanish, so that as many equations are redundant.
Source: J. L. Marin, S. Aubry, Nonlinearity 9, 1501 (1996).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, TypeAlias

import numpy as np

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.errors import TensegrityError
from tensegrity.orbits.driven_orbit import WholePeriod
from tensegrity.orbits.half_period import HalfPeriod
from tensegrity.orbits.period import DrivePeriod, fitting
from tensegrity.orbits.shooting import NoOrbitError, Orbit, is_reversible
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.scene import Scene, State
from tensegrity.typing import Duration

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
    free = np.flatnonzero(np.repeat(dynamics(scene).inverse_mass, scene.dim) > 0)
    roots = np.sqrt(np.repeat(scene.mass, scene.dim)[free])
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
