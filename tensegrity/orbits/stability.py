"""Floquet multipliers of exact waves, of fronts and of periodic orbits: `floquet`.

A wave r(x - c t) is mapped to itself by a run of duration 1/c followed by a shift back by one site.
The tangent of this map on an open window, with perturbations that are 0 ahead of the window and are
dropped behind it, has a double multiplier 1, which belongs to the wave's shift and to its change
with the speed.  Linear waves are slower than the wave and leave the window, so that their
multipliers lie inside the unit circle and only an instability of the wave lies outside.  On a ring
a wave would interact with its own radiation and be unstable for that reason.  A front has one
neutral motion, its shift.  The ends of a front of bonds alone move: its perturbations are those of
elongations and velocities, in a window of a longer chain whose free ends do not affect it in time.
With dashpots g to the ground as the only ones, the tangent on a ring is conformally symplectic: its
multipliers come in pairs with the product exp(-g/(m c)).  The partner of the shift's 1 lies inside
the circle |mu| = exp(-g/(2 m c)) of linear waves; an open window, which moves that circle inwards,
has a resonance next to it instead, 3e-5 away in the example of `transition_wave`.
Source: G. Friesecke, R. Pego, Nonlinearity 17, 207 (2004), whose exponential weight is here the
balancing of the matrix by LAPACK.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tensegrity import check
from tensegrity.errors import ResolutionError, TensegrityError
from tensegrity.orbits.flow import DrivenFlow, Flow
from tensegrity.orbits.orbit import family_of
from tensegrity.orbits.shooting import STABLE, Multipliers, Orbit, descending
from tensegrity.printing import Lines, Printed
from tensegrity.scenes.chain import Chain
from tensegrity.springs.potential import Potential
from tensegrity.typing import Array
from tensegrity.waves.by_target import neutral_motions
from tensegrity.waves.solitary import SolitaryWave
from tensegrity.waves.transition import TransitionWave

FIRST, MOST = 4, 2048  # steps per site passed
ORDER, MARGIN = 3, 1.2  # of the double multiplier 1, split by the root of the error; of steps
CLOSED = 1e-6  # largest distance of the neutral multipliers from 1
RETURNED = 1e-5  # the same of an orbit, whose steps are given
AGREE = 1e-7  # difference of equal multipliers in two windows
TAIL, FRONT_TAIL = 1e-12, 1e-9  # fraction of the peak or step outside of the window
SHORTER = 0.08  # part of the sites by which the second window is shorter at each end
LARGEST = 700  # sites of a window
AROUND = 12  # sites beyond it, where elongations are perturbed, or more if sound is faster


@dataclass(frozen=True, eq=False, repr=False)
class Floquet(Printed):
    """Multipliers of small perturbations of a wave or of a periodic orbit.

    Attributes
    ----------
    multipliers : ndarray of complex
        Factors by which perturbations grow per site that a wave passes, or per period, in
        descending modulus, without the neutral ones.  Of a wave only those that do not depend on
        the window: instabilities, and resonances inside the unit circle.
    neutral : ndarray of complex
        Multipliers that are exactly 1 in theory, as computed.
    growth : float
        Growth rate of the fastest growing perturbation [1/s]; 0 if none grows.
    stable : bool
        Whether no perturbation grows.
    """

    multipliers: NDArray[np.complex128]
    neutral: NDArray[np.complex128]
    growth: float
    stable: bool

    def _lines(self) -> Lines:
        largest = ", ".join(f"{x:.6g}" for x in self.multipliers[:3]) or "only neutral ones"
        verdict = "stable" if self.stable else f"unstable, growth {self.growth:.6g} 1/s"
        yield f"{verdict}; multipliers {largest}"
        yield f"neutral ones within {np.abs(self.neutral - 1).max(initial=0):.1e} of 1"


def floquet(of: SolitaryWave | TransitionWave | Orbit) -> Floquet:
    """Stability of an exact wave, a front or a periodic orbit from its Floquet multipliers.

    Parameters
    ----------
    of : SolitaryWave, TransitionWave or Orbit
        What `solitary_wave`, `transition_wave` or `periodic_orbit` returns.

    Returns
    -------
    Floquet
        Multipliers per site that a wave passes, or per period of an orbit.  Those of an orbit
        belong to its finite chain: complex ones off the unit circle that change with the number of
        sites are due to waves reflected at the ends.

    Raises
    ------
    TensegrityError
        Not a wave or an orbit, a wave of several components, or one too wide for a window.
    ResolutionError
        The neutral multipliers deviate from 1 by more than 1e-6 with the smallest steps, or by more
        than 1e-5 for an orbit, or an unstable multiplier depends on the window.

    Examples
    --------
    The force r + r^7 carries waves that are unstable near the sound speed:

    >>> import sympy as sp
    >>> from tensegrity import Potential, floquet, solitary_wave
    >>> r = sp.Symbol("r")
    >>> wave = solitary_wave(Potential(r**2 / 2 + r**8 / 8, r), speed=1.02)
    >>> f"{floquet(wave).multipliers[0].real:.7f}, dH/dc {wave.energy_slope:.5f} J s/site"
    '1.0033536, dH/dc -3.01873 J s/site'
    """
    if isinstance(of, Orbit):
        return _of_orbit(of)
    front = isinstance(of, TransitionWave)
    if not front:
        check.kind("of", of, SolitaryWave)
    half = math.ceil(of.reach(FRONT_TAIL if front else TAIL)) + 2
    sites = 2 * half + 1
    if sites > LARGEST:
        raise TensegrityError(
            f"the wave needs a window of {sites} sites, must be at most {LARGEST}: it decays "
            f"slowly, as its speed is only {of.speed_ratio:.9g} of the sound speed"
        )
    x: Array = np.arange(-half, half + 1, dtype=np.float64)
    place = np.tile(x, 2)  # of the entries of a state
    there = back = np.eye(2 * sites)
    if isinstance(of, TransitionWave):
        if of.ground is None:
            x, place, there, back = _window_of_bonds(of, half)
        chain = Chain(of.potential, len(x), of.mass, ground=of.ground, damping=of.damping)
        flow = DrivenFlow(chain, FIRST, 1 / of.speed)
        launched = of.displacement(x), -of.speed * of.rate(x)
        flow.steps = min(max(FIRST, flow.first_steps(*launched, 1 / of.speed)), MOST)
        _passed(of, flow, x)
        shift = np.concatenate(flow.rates_at_start(1 / of.speed))
        motions = (there @ shift)[:, None]
    else:
        motions = neutral_motions(of, x).reshape(2, 2 * sites).T
        assert isinstance(of.potential, Potential)  # of one component, as dH/dc exists
        flow = Flow(Chain(of.potential, sites, of.mass), FIRST)
    inner = np.flatnonzero(np.abs(place) <= half - math.floor(SHORTER * sites))
    while True:
        tangent = there @ _passed(of, flow, x) @ back
        rest, neutral = _deflated(tangent, motions, place)
        off = float(np.abs(neutral - 1).max())
        if off <= CLOSED:
            break
        if flow.steps >= MOST:
            raise ResolutionError(
                f"the neutral multipliers of the wave are {off:.1e} from 1 with {flow.steps} steps "
                f"per site, must be within {CLOSED:g}"
            )
        finer = flow.steps * min(MARGIN * (off / CLOSED) ** (1 / ORDER), 4.0)
        flow.steps = min(math.ceil(finer), MOST)
    pair = np.ix_(inner, inner)
    other = _deflated(tangent[pair], motions[inner], place[inner])[0]
    first, second = (_multipliers(matrix) for matrix in (rest, other))
    near = np.abs(first[:, None] - second).min(axis=1)
    uncertain = first[(np.abs(first) > 1 + STABLE) & (near > AGREE)]
    if uncertain.size:
        raise ResolutionError(f"multiplier {uncertain[0]:.9g} of the wave depends on the window")
    return _verdict(first[(near <= AGREE) & (np.abs(first) > AGREE)], neutral, of.speed)


def _of_orbit(orbit: Orbit) -> Floquet:
    """The multipliers of one period, without those of the neutral motions."""
    of = family_of(orbit)
    of.flow.steps = orbit.steps
    others, neutral = of.multipliers(of.guess)
    off = float(np.abs(neutral - 1).max(initial=0.0))
    if not off <= RETURNED:
        raise ResolutionError(
            f"the neutral multipliers of the orbit are {off:.1e} from 1 with {orbit.steps} steps a "
            f"period, must be within {RETURNED:g}: its state does not return to itself"
        )
    return _verdict(others, neutral, 1 / orbit.period)


def _window_of_bonds(front: TransitionWave, half: int) -> tuple[Array, Array, Array, Array]:
    """Sites of a chain around a front of bonds, the places of the elongations and velocities of
    its window, and the matrices that give these from displacements and velocities, and that give
    displacements and velocities from these if all others are 0."""
    fastest = math.sqrt(front.potential.stiffness(front.elongation(front.x)).max() / front.mass)
    around = math.ceil(AROUND * max(1.0, fastest / front.speed))
    x: Array = np.arange(-half - around, half + around + 1, dtype=np.float64)
    sites = len(x)
    bonds = np.eye(sites - 1, sites, 1) - np.eye(sites - 1, sites)
    whole = np.vstack([np.kron([1, 0], bonds), np.kron([0, 1], np.eye(sites))])
    place = np.concatenate([(x[1:] + x[:-1]) / 2, x])
    inside = np.abs(place) <= half
    return x, place[inside], whole[inside], np.linalg.pinv(whole)[:, inside]


def _passed(wave: SolitaryWave | TransitionWave, flow: Flow | DrivenFlow, x: Array) -> Array:
    """Tangent of the map: a run of duration 1/c, then a shift back by one site."""
    sites = len(x)
    u, v = wave.displacement(x), -wave.speed * wave.rate(x)
    rows = flow.tangents(u, v, 1 / wave.speed)[2].reshape(2, sites, 2 * sites)
    moved = np.zeros_like(rows)
    moved[:, :-1] = rows[:, 1:]
    return moved.reshape(2 * sites, 2 * sites)


def _deflated(tangent: Array, motions: Array, x: Array) -> tuple[Array, Multipliers]:
    """A tangent without the invariant space of the neutral motions, and the multipliers there.

    The projection is along perturbations that vanish near the peak: its left vectors decay on both
    sides, so that the matrix remains as easy to balance.
    """
    weight = np.exp(-np.abs(x))[:, None]
    left = np.linalg.solve(motions.T @ (weight * motions), (weight * motions).T)
    within = left @ tangent @ motions
    return tangent - tangent @ motions @ left, _multipliers(within)


def _multipliers(matrix: Array) -> Multipliers:
    """Eigenvalues in descending modulus."""
    return descending(np.linalg.eigvals(matrix).astype(complex))


def _verdict(multipliers: Multipliers, neutral: Multipliers, rate: float) -> Floquet:
    """A `Floquet` from multipliers in descending modulus, and periods or sites per second."""
    largest = float(np.abs(multipliers).max(initial=0.0))
    stable = largest <= 1 + STABLE
    return Floquet(multipliers, neutral, 0.0 if stable else rate * math.log(largest), stable)
