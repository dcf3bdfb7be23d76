"""Observables of a run of a chain or a network: arrival, speed and duration of pulses, momenta.

The arrival at a bond is the instant at which the rate of its elongation vanishes; instants and
positions are interpolated between the recorded values.
"""

from __future__ import annotations

import math
from functools import singledispatch
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.engine import forces
from tensegrity.errors import TensegrityError
from tensegrity.measure.peaks import PEAK_FRACTION, noise_of, peak_bonds, sites_around
from tensegrity.measure.records import first_peak
from tensegrity.measure.series import TimeSeries
from tensegrity.root import polynomial_through, root
from tensegrity.runs.run import Run
from tensegrity.scenes.chain import Chain, refuse_ring
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.network import Network
from tensegrity.scenes.scene import State
from tensegrity.typing import Array, Fraction, Index

ROUND_OFF = 1e-12  # of a peak: a smaller elongation is round-off
NEIGHBOURS = 5  # recorded instants on either side from which a peak is interpolated


def passage(t: Array, elongation: Array, rate: Array) -> float:
    """Instant of the first large extremum of the elongation of a bond.

    Parameters
    ----------
    t, elongation, rate : ndarray, (T,)
        Recorded instants [s], elongation of one bond [m] and its time derivative [m/s].

    Returns
    -------
    float
        The root of the rate [s], by the polynomial through the ten instants around it: the
        error is of tenth order in the recording interval.

    Raises
    ------
    TensegrityError
        No extremum within the record; arrays of different lengths, or values that are not finite.
    """
    t, elongation, rate = check.columns(t=t, elongation=elongation, rate=rate)
    size = np.abs(elongation)
    large = size >= PEAK_FRACTION * size.max()
    sign_changes = (rate[:-1] * rate[1:] <= 0) & (large[:-1] | large[1:]) & (size.max() > 0)
    if not sign_changes.any():
        raise TensegrityError("no peak passes this bond within the run")
    first = int(np.argmax(sign_changes))
    part = slice(max(first + 1 - NEIGHBOURS, 0), first + 1 + NEIGHBOURS)
    start = t[first]
    curve = polynomial_through(t[part] - start, rate[part])
    return float(start + root(curve, 0.0, t[first + 1] - start, relative=1e-14))


@overload
def arrival(run: Run, bond: int, direction: int | None = None, after: float = ...) -> float: ...
@overload
def arrival(run: TimeSeries, *, after: float = ...) -> float: ...
def arrival(
    run: Run | TimeSeries,
    bond: int | None = None,
    direction: int | None = None,
    after: float = -math.inf,
) -> float:
    """Instant [s] at which the peak of the leading pulse passes a bond, or a sensor.

    Parameters
    ----------
    run : Run or TimeSeries
        With both sites of the bond recorded often enough to resolve the pulse; or what a sensor
        recorded, whose first large peak counts, as by `first_peak`.
    bond : int, optional
        Of a run: bond j joins sites j and j + 1.
    direction : int, optional
        1: only pulses towards higher sites; -1: only towards lower ones.  By default either.  The
        sign of elongation times mean velocity of the two sites gives the direction in which energy
        flows, towards higher sites where it is negative.
    after : float, optional
        Only instants from this one on count [s], for instance to time a reflected pulse; by
        default all.

    Returns
    -------
    float
        The first extremum of the elongation that is at least half the largest one among the
        instants that count.

    Raises
    ------
    TensegrityError
        A site of the bond was not recorded; no such pulse passes.

    Examples
    --------
    >>> from tensegrity import Chain, Prism, Record, arrival, simulate, solitary_wave
    >>> spring = Prism(base=1.0, height=0.7, prestrain=0.01, k_cross=1.0).potential()
    >>> wave, chain = solitary_wave(spring, speed_ratio=2.0), Chain(spring, 120)
    >>> start = wave.launch(chain, at=30.5) + wave.launch(chain, at=85.5, direction=-1)
    >>> run = simulate(chain, start, 50 / wave.speed, tol=1e-8, record=Record(every=1))
    >>> [round(arrival(run, 70, direction) * wave.speed, 2) for direction in (1, -1)]
    [39.23, 15.0]
    """
    after = check.number("after", after, finite=False, unit="s")
    if isinstance(run, TimeSeries):
        if bond is not None or direction is not None:
            raise TensegrityError(f"bond {bond} and direction {direction} are those of a run")
        return first_peak(run, between=(after, math.inf)).instant
    if not all(isinstance(getattr(run, name, None), np.ndarray) for name in ("t", "u", "v")):
        raise TensegrityError(f"run is {type(run).__name__}, not a Run or a TimeSeries")
    bond = check.whole("bond", bond, least=0)
    if direction is not None and check.whole("direction", direction, least=-1) not in (-1, 1):
        raise TensegrityError(f"direction {direction} must be 1 or -1")
    counts = run.t >= after
    if run.u.ndim != 2:
        raise TensegrityError(
            f"rows of shape {run.u.shape[1:]} are not those of one chain: select a run or an axis"
        )
    try:
        left, right = run.sites.index(bond), run.sites.index(bond + 1)
    except ValueError:
        raise TensegrityError(
            f"bond {bond} joins sites {bond} and {bond + 1}, which are not both among the "
            f"{len(run.sites)} sites recorded, {min(run.sites)} to {max(run.sites)}"
        ) from None
    if not counts.any():
        raise TensegrityError(f"no recorded instant lies after {after:g} s")
    t, u, v = run.t[counts], run.u[counts], run.v[counts]
    elongation, rate = u[:, right] - u[:, left], v[:, right] - v[:, left]
    if direction is not None:
        flow = -elongation * (v[:, left] + v[:, right])
        elongation = np.where(direction * flow > 0, elongation, 0.0)
    return passage(t, elongation, rate)


@overload
def speed(run: Run, where: tuple[int, int]) -> float: ...
@overload
def speed(
    run: Run, where: str, numbers: tuple[int, int], between: tuple[float, float] = ...
) -> float: ...
@overload
def speed(
    run: tuple[TimeSeries, TimeSeries], where: float, *, between: tuple[float, float] = ...
) -> float: ...
@checked
def speed(
    run: Run | tuple[TimeSeries, TimeSeries],
    where: str | tuple[int, int] | float,
    numbers: tuple[int, int] | None = None,
    between: tuple[float, float] = (-math.inf, math.inf),
) -> float:
    """Speed of the leading pulse between two bonds of a chain, two beads of a part, or two sensors.

    Parameters
    ----------
    run : Run, or two TimeSeries
        With the sites of both bonds, or both beads and their neighbours, recorded often enough to
        resolve the pulse; or what two sensors recorded.
    where : (int, int), str or float
        Two bonds of a `Chain`; of a scene of beads, a part such as "stem 1"; or the distance of the
        sensors [m].
    numbers : (int, int), optional
        Numbers of the two beads in that part, from 1.
    between : (float, float), optional
        Of beads and sensors: interval of time that is searched [s], for a reflected pulse behind
        the incident one.

    Returns
    -------
    float
        Of a chain in sites per second, as a lattice has no other length.  Of beads in m/s: the
        distance through touching beads, or that given, over the time between the peaks of the two
        sensor forces.  Positive if the pulse travels from the first place to the second.

    Raises
    ------
    TensegrityError
        Bad input; a place without a peak; both peaks at one instant.

    Examples
    --------
    >>> from tensegrity import Chain, PowerLaw, simulate, speed
    >>> spring = PowerLaw(1.0, 1.5, preload=1.0)
    >>> chain = Chain(spring, sites=100)
    >>> run = simulate(chain, chain.at_rest({0: 0.05}), t_end=70, tol=1e-8)
    >>> print(f"{speed(run, (40, 60)):.4f}, sound speed {spring.sound_speed(1.0):.4f} sites/s")
    1.2105, sound speed 1.2247 sites/s
    """
    if not isinstance(run, (tuple, list)):
        return speed_in(check.kind("run", run, Run).scene, run, where, numbers, between)
    series = [check.kind("series", one, TimeSeries) for one in run]
    if len(series) != 2 or numbers is not None:
        raise TensegrityError(f"{len(series)} series with numbers {numbers}, must be two without")
    way = check.number("distance of the sensors", where, unit="m")
    passed, then = (first_peak(one, between=between).instant for one in series)
    if passed == then:
        raise TensegrityError(f"both series have their first peak at {then:g} s")
    return way / (then - passed)


@singledispatch
def speed_in(scene: Any, run: Run, where: Any, numbers: Any, between: Any) -> float:
    """The implementation of `speed` for a type of scene; other packages register theirs.

    Parameters
    ----------
    scene : Scene
        The scene of the run, whose type selects the implementation.
    run, where, numbers, between
        As for `speed`.

    Returns
    -------
    float
        As for `speed`.

    Raises
    ------
    TensegrityError
        A scene that is neither a Chain nor one of beads.
    """
    raise TensegrityError(f"the scene of the run is {type(scene).__name__}, not a Chain or beads")


@speed_in.register
def _of_chain(scene: Chain, run: Run, where: Any, numbers: Any, between: Any) -> float:
    bonds = where
    if not isinstance(bonds, (tuple, list)) or len(bonds) != 2:
        raise TensegrityError(f"bonds {check.shown(bonds)} must be two numbers of bonds")
    if numbers is not None:
        raise TensegrityError(f"numbers {check.shown(numbers)} belong to a part of beads")
    first, second = (check.whole("bond", bond, least=0) for bond in bonds)
    if first == second:
        raise TensegrityError(f"bonds {first} and {second} must differ")
    passed, then = arrival(run, first), arrival(run, second)
    if passed == then:
        raise TensegrityError(f"peaks pass both bonds, {first} and {second}, at {then:g} s")
    return (second - first) / (then - passed)


@checked
def duration(run: Run, bond: Index, level: Fraction = 0.05) -> float:
    """Duration of the leading pulse at a bond, between two crossings of a level.

    The duration times the speed is a width in sites, exact for a wave of permanent form.

    Parameters
    ----------
    run : Run
        Of a chain, with both sites of the bond recorded.
    bond : int
        Bond j joins sites j and j + 1.
    level : float, optional
        Fraction of the peak elongation of that bond, between 0 and 1.

    Returns
    -------
    float
        [s], > 0.

    Raises
    ------
    TensegrityError
        Bad input; no pulse, or one that does not fall to the level within the run.
    """
    from scipy.interpolate import CubicSpline

    arrival_time = arrival(run, bond)
    left, right = run.sites.index(bond), run.sites.index(bond + 1)
    curve = CubicSpline(run.t, run.u[:, right] - run.u[:, left])
    crossings = curve.solve(level * float(curve(arrival_time)), extrapolate=False)
    before, after = crossings[crossings < arrival_time], crossings[crossings > arrival_time]
    if before.size == 0 or after.size == 0:
        raise TensegrityError(f"the pulse does not fall to {level:g} of its peak within the run")
    return float(after[0] - before[-1])


@checked
def tail_front(chain: Chain, state: State, level: Fraction = 0.5) -> float:
    """Position of the front of the tail that follows the leading pulse, with site j at j.

    Parameters
    ----------
    chain : Chain
    state : State
    level : float, optional
        Fraction of the largest |elongation| behind the leading pulse, between 0 and 1.  The front
        is the place nearest to the pulse where the elongation reaches it.

    Returns
    -------
    float
        [sites]; accurate to about a tenth of a site.

    Raises
    ------
    TensegrityError
        Bad input; an undeformed chain; nothing behind the leading pulse.
    """
    chain.energy(state)  # refuses what is no state of it
    refuse_ring(chain, "the front of a tail")
    r = chain.elongation(state.u)
    peaks = peak_bonds(r, PEAK_FRACTION)
    if not peaks:
        raise TensegrityError("no pulse: the chain is undeformed")
    behind = np.abs(r[: sites_around(r, peaks[-1])[0]])
    if behind.max(initial=0.0) <= ROUND_OFF * abs(r[peaks[-1]]):
        raise TensegrityError("nothing follows the leading pulse")
    threshold = level * behind.max()
    j = int(np.flatnonzero(behind >= threshold)[-1])
    if j + 1 == behind.size or behind[j + 1] == 0:
        return j + 0.5
    return j + 0.5 + float(np.log(behind[j] / threshold) / np.log(behind[j] / behind[j + 1]))


def _parabola(r: Array, j: int) -> tuple[float, float]:
    """Shift of the extremum from bond j, and its value, by the parabola through three bonds."""
    if not 0 < j < len(r) - 1:
        return 0.0, float(r[j])
    bend = r[j - 1] - 2 * r[j] + r[j + 1]
    shift = (r[j - 1] - r[j + 1]) / (2 * bend)
    return float(shift), float(r[j] - bend * shift**2 / 2)


def peak(elongation: ArrayLike) -> tuple[float, float]:
    """Position of the foremost large extremum along a chain [bonds], and its elongation [m].

    Parameters
    ----------
    elongation : ndarray, (bonds,)
        At one instant [m].  The parabola through the extremum and its neighbours refines both.
    """
    (r,) = check.columns(elongation=elongation)
    inner = [j for j in peak_bonds(r, PEAK_FRACTION) if 0 < j < len(r) - 1]
    if not inner:
        raise TensegrityError("no peak within the chain")
    shift, top = _parabola(r, int(inner[-1]))
    return int(inner[-1]) + shift, top


@checked
def width(x: Array, profile: ArrayLike, level: Fraction = 0.05) -> float:
    """Width of the peak of a profile, between the nearest points where it falls to a level.

    Parameters
    ----------
    x, profile : ndarray, (n,)
        Position, increasing, and value.
    level : float
        Fraction of the extreme value, between 0 and 1.

    Returns
    -------
    float
        In the unit of x, > 0; the profile is interpolated linearly.

    Raises
    ------
    TensegrityError
        Bad input; a profile that does not fall to the level on both sides, or has noise, which
        crosses the level at once.
    """
    x, profile = check.columns(x=x, profile=profile)
    if not np.all(np.diff(x) > 0):
        raise TensegrityError(f"x must increase, not by {np.diff(x).min():g}")
    noise = noise_of(x, profile)
    if noise:
        raise TensegrityError(
            f"the profile has noise of {noise:.3g}: smooth it, as by scipy.signal.savgol_filter"
        )
    size = np.abs(profile)
    top = int(np.argmax(size))
    left = np.flatnonzero(size[: top + 1] < level * size[top])
    right = top + np.flatnonzero(size[top:] < level * size[top])
    if left.size == 0 or right.size == 0:
        raise TensegrityError(f"the profile does not fall to {level:g} of its peak on both sides")

    def crossing(low: int, high: int) -> float:
        part = (level * size[top] - size[low]) / (size[high] - size[low])
        return x[low] + part * (x[high] - x[low])

    return float(crossing(right[0], right[0] - 1) - crossing(left[-1], left[-1] + 1))


@checked
def angular_momentum(network: Network, state: State) -> float | Array:
    """Total angular momentum of a network about the origin [kg m^2/s]; a float, in space (3,)."""
    network.momentum(state)  # refuses what is no state of the network
    momentum = dynamics(network).momenta(state.v)
    x = network.positions + state.u
    if network.dim == 1:
        return 0.0
    if network.dim == 2:
        return float(np.sum(x[:, 0] * momentum[:, 1] - x[:, 1] * momentum[:, 0]))
    return np.cross(x, momentum).sum(axis=0)


@checked
def directions(network: Network, u: ArrayLike) -> Array:
    """Unit vector of each bond of a network, from its first site to its second.

    Parameters
    ----------
    network : Network
    u : array_like, (..., sites, dim)
        Displacements [m].

    Returns
    -------
    ndarray, (..., bonds, dim)
    """
    u = check.rows("displacements", u, network.shape)
    along = forces.elongations(dynamics(network).contact_bonds, u)[1]
    return check.finite("direction", along[..., : len(network.bonds), :])


@checked
def wall_gaps(network: Network, u: ArrayLike) -> Array:
    """Distance of each wall contact of a network from the wall's plane less the radius [m].

    Parameters as for `directions`; (..., wall contacts).
    """
    return check.finite("gap", dynamics(network).elongations(u)[..., len(network.bonds) :])
