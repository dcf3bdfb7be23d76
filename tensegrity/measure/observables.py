"""What is read off a run: arrivals and speed of the leading pulse; pulses at one instant.

Times are taken where the elongation of one bond turns, by its own rate, and places never from a
largest value along the chain: both lie between the samples.

What passes through a bond of a chain: energy and momentum of the part beyond it, over time.
Beyond bond j lie the sites above j with their bonds.  The bond pulls the first of them back with
its tension T, so the part gains momentum at the rate -T and energy at the rate -T v, v being
that site's velocity.  Integrated over recorded instants, by a spline of degree 7, this must give
what the sites themselves hold: a balance that a run closes only if it is right, recorded densely
enough, and the far end is free.  With bond 0 of a chain whose first site is held it is the
balance of the force at the held end.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.engine import forces
from tensegrity.errors import TensegrityError
from tensegrity.runs.run import Run
from tensegrity.scenes.chain import Chain
from tensegrity.scenes.dynamics import dynamics
from tensegrity.scenes.ensemble import Ensemble
from tensegrity.scenes.network import Network
from tensegrity.scenes.scene import State
from tensegrity.typing import Array, Indices

ROUND_OFF = 1e-12  # of a crest: less is nothing
PEAK_FRACTION = 0.5  # an extremum counts as the pulse if it is this part of the largest
NEIGHBOURS = 5  # recorded instants on either side that locate a crest
DEGREE = 7  # of the spline that a budget integrates


def passage(t: Array, elongation: Array, rate: Array) -> float:
    """Instant at which the first large extremum of an elongation passes.

    Parameters
    ----------
    t, elongation, rate : ndarray, (T,)
        Recorded instants [s], elongation of one bond [m] and its time derivative [m/s].

    Returns
    -------
    float
        The root of the rate [s], by the polynomial through the ten instants around it: the
        error is of tenth order in the recording interval.
    """
    from scipy.interpolate import BarycentricInterpolator
    from scipy.optimize import brentq

    t, elongation, rate = _columns(t=t, elongation=elongation, rate=rate)
    size = np.abs(elongation)
    large = size >= PEAK_FRACTION * size.max()
    sign_changes = (rate[:-1] * rate[1:] <= 0) & (large[:-1] | large[1:]) & (size.max() > 0)
    if not sign_changes.any():
        raise TensegrityError("no crest passes this bond within the run")
    first = int(np.argmax(sign_changes))
    part = slice(max(first + 1 - NEIGHBOURS, 0), first + 1 + NEIGHBOURS)
    start = t[first]
    curve = BarycentricInterpolator(t[part] - start, rate[part])
    for place in (first, first + 1):  # the curve passes through the samples to round-off only
        if rate[place] == 0:
            return float(t[place])
    return float(start + brentq(curve, 0.0, t[first + 1] - start, xtol=1e-300, rtol=1e-14))


def arrival(run: Run, bond: int) -> float:
    """Instant [s] at which the crest of the leading pulse passes a bond.

    Parameters
    ----------
    run : Run
        With both sites of the bond recorded often enough to resolve the pulse.
    bond : int
        Bond j joins sites j and j + 1.
    """
    if not all(isinstance(getattr(run, name, None), np.ndarray) for name in ("t", "u", "v")):
        raise TensegrityError(f"run is {type(run).__name__}, not a Run")
    bond = check.whole("bond", bond, least=0)
    if run.u.ndim != 2:
        raise TensegrityError(
            f"rows of shape {run.u.shape[1:]} are not those of one chain: take a lane or an axis"
        )
    try:
        left, right = run.sites.index(bond), run.sites.index(bond + 1)
    except ValueError:
        raise TensegrityError(f"sites {bond} and {bond + 1} of bond {bond} not recorded") from None
    return passage(run.t, run.u[:, right] - run.u[:, left], run.v[:, right] - run.v[:, left])


def speed(run: Run, bonds: tuple[int, int]) -> float:
    """Speed of the leading pulse between two bonds of a run, in sites per second."""
    if not isinstance(bonds, (tuple, list)) or len(bonds) != 2:
        raise TensegrityError(f"bonds {check.shown(bonds)} must be two numbers of bonds")
    first, second = (check.whole("bond", bond, least=0) for bond in bonds)
    if first == second:
        raise TensegrityError(f"bonds {first} and {second} must differ")
    passed, then = arrival(run, first), arrival(run, second)
    if passed == then:
        raise TensegrityError(f"crests pass the bonds {first} and {second} at once, at {then:g} s")
    return (second - first) / (then - passed)


def duration(run: Run, bond: int, level: float = 0.05) -> float:
    """How long the leading pulse keeps a bond beyond `level` of its crest there [s].

    Times the speed it is a width in sites; exact for a wave of permanent form.
    """
    from scipy.interpolate import CubicSpline

    arrival_time = arrival(run, bond)
    left, right = run.sites.index(bond), run.sites.index(bond + 1)
    curve = CubicSpline(run.t, run.u[:, right] - run.u[:, left])
    level = check.number("level", level, above=0, below=1)
    crossings = curve.solve(level * float(curve(arrival_time)), extrapolate=False)
    before, after = crossings[crossings < arrival_time], crossings[crossings > arrival_time]
    if before.size == 0 or after.size == 0:
        raise TensegrityError(f"the pulse does not fall to {level:g} of its crest within the run")
    return float(after[0] - before[-1])


@dataclass(frozen=True)
class Pulse:
    """A pulse at one instant.

    Attributes
    ----------
    place : float
        Of its crest, where site j is at j (a bond is centred half a site further).
    elongation : float
        Of its crest [m], by the parabola through three bonds.
    energy : float
        [J] between the cuts, where the elongation stops falling or changes its sign.
    momentum : float
        [kg m/s] between the cuts, > 0 towards higher sites.
    first, last : int
        Sites between the cuts.
    """

    place: float
    elongation: float
    energy: float
    momentum: float
    first: int
    last: int


def pulses(chain: Chain, state: State, fraction: float = 0.1) -> list[Pulse]:
    """Pulses of a chain at one instant, the foremost (highest site) first.

    Parameters
    ----------
    chain : Chain
    state : State
    fraction : float, optional
        A crest counts from this part of the largest elongation on, above 0, at most 1.  How many
        pulses a train has depends on it.

    Returns
    -------
    list of Pulse
    """
    if isinstance(chain, Ensemble):
        raise TensegrityError("chain is an Ensemble: take one of its scenes")
    check.kind("chain", chain, Chain)
    chain.energy(state)  # refuses what is no state of it
    fraction = check.number("fraction", fraction, above=0)
    if fraction > 1:
        raise TensegrityError(f"fraction {fraction:g} must be at most 1")
    r = chain.elongation(state.u)
    site_energy = chain.site_energy(state.u, state.v)
    found = []
    for j in _peaks(r, fraction)[::-1].tolist():
        low, high = _pulse_end(r, j, -1), _pulse_end(r, j, 1)
        inside = slice(low + 1, high + 1)
        shift, top = _parabola(r, j)
        found.append(
            Pulse(
                place=j + 0.5 + shift,
                elongation=top,
                energy=float(np.sum(site_energy[inside])),
                momentum=float(np.sum((chain.mass * state.v)[inside])),
                first=low + 1,
                last=high,
            )
        )
    return found


def tail_front(chain: Chain, state: State, level: float = 0.5) -> float:
    """Place of the front of what follows the leading pulse, where site j is at j.

    Parameters
    ----------
    chain : Chain
    state : State
    level : float, optional
        The front is where the elongation, seen from the leading pulse, first comes to this part
        of the largest one behind it; to about a tenth of a site.
    """
    level = check.number("level", level, above=0, below=1)
    lead = pulses(chain, state, PEAK_FRACTION)[0]
    behind = np.abs(chain.elongation(state.u)[: lead.first])
    if behind.max(initial=0.0) <= ROUND_OFF * abs(lead.elongation):
        raise TensegrityError("nothing follows the leading pulse")
    threshold = level * behind.max()
    j = int(np.flatnonzero(behind >= threshold)[-1])
    if j + 1 == behind.size or behind[j + 1] == 0:
        return j + 0.5
    return j + 0.5 + float(np.log(behind[j] / threshold) / np.log(behind[j] / behind[j + 1]))


def _columns(**given: ArrayLike) -> list[Array]:
    """Arrays of one axis, of the same length and not empty; finite."""
    arrays = [check.floats(name, value) for name, value in given.items()]
    shape = arrays[0].shape
    if len(shape) != 1 or not shape[0]:
        raise TensegrityError(f"{next(iter(given))} has shape {shape}, must have one axis, (n,)")
    return [check.vector(name, x, shape) for name, x in zip(given, arrays, strict=True)]


def _peaks(r: Array, fraction: float) -> Indices:
    """Bonds whose |elongation| is a maximum between neighbours of `fraction` of the largest."""
    size = np.abs(r)
    if size.max() == 0:
        raise TensegrityError("no pulse: the chain is undeformed")
    padded = np.concatenate([[0], size, [0]])
    peak = (size >= padded[:-2]) & (size > padded[2:]) & (size >= fraction * size.max())
    return np.flatnonzero(peak)


def _pulse_end(r: Array, crest: int, step: int) -> int:
    """Bond at which a pulse ends: where |r| stops falling, or the sign changes."""
    sign, j = np.sign(r[crest]), crest
    while 0 <= j + step < len(r) and abs(r[j + step]) <= abs(r[j]) and r[j + step] * sign > 0:
        j += step
    return j


def _parabola(r: Array, j: int) -> tuple[float, float]:
    """Shift of the extremum from bond j, and its value, by the parabola through three bonds."""
    if not 0 < j < len(r) - 1:
        return 0.0, float(r[j])
    bend = r[j - 1] - 2 * r[j] + r[j + 1]
    shift = (r[j - 1] - r[j + 1]) / (2 * bend)
    return float(shift), float(r[j] - bend * shift**2 / 2)


def crest(elongation: ArrayLike) -> tuple[float, float]:
    """Place of the foremost large extremum along a chain, in bonds, and its elongation.

    Parameters
    ----------
    elongation : ndarray, (bonds,)
        At one instant [m].  The parabola through the extremum and its neighbours refines both.
    """
    (r,) = _columns(elongation=elongation)
    inner = [j for j in _peaks(r, PEAK_FRACTION) if 0 < j < len(r) - 1] if r.any() else []
    if not inner:
        raise TensegrityError("no crest within the chain")
    shift, top = _parabola(r, int(inner[-1]))
    return int(inner[-1]) + shift, top


def width(x: Array, profile: ArrayLike, level: float = 0.05) -> float:
    """Distance between the outermost points around the crest where a profile has fallen to a level.

    Parameters
    ----------
    x, profile : ndarray, (n,)
        Place, increasing, and value.
    level : float
        Part of the extreme value, between 0 and 1.
    """
    level = check.number("level", level, above=0, below=1)
    x, profile = _columns(x=x, profile=profile)
    size = np.abs(profile)
    top = int(np.argmax(size))
    left = np.flatnonzero(size[: top + 1] < level * size[top])
    right = top + np.flatnonzero(size[top:] < level * size[top])
    if left.size == 0 or right.size == 0:
        raise TensegrityError(f"the profile does not fall to {level:g} of its crest on both sides")

    def crossing(low: int, high: int) -> float:
        part = (level * size[top] - size[low]) / (size[high] - size[low])
        return x[low] + part * (x[high] - x[low])

    return float(crossing(right[0], right[0] - 1) - crossing(left[-1], left[-1] + 1))


def angular_momentum(network: Network, state: State) -> float | Array:
    """Total angular momentum of a network about the origin [kg m^2/s]; a float, in space (3,)."""
    check.kind("network", network, Network)
    network.momentum(state)  # refuses what is no state of the network
    momentum = network.mass[:, None] * state.v
    x = network.positions + state.u
    if network.dim == 1:
        return 0.0
    if network.dim == 2:
        return float(np.sum(x[:, 0] * momentum[:, 1] - x[:, 1] * momentum[:, 0]))
    return np.cross(x, momentum).sum(axis=0)


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
    check.kind("network", network, Network)
    u = check.rows("displacements", u, network.shape)
    along = forces.elongations(dynamics(network).contact_bonds, u)[1]
    return check.finite("direction", along[..., : len(network.bonds), :])


def wall_gaps(network: Network, u: ArrayLike) -> Array:
    """Distance of each wall contact of a network from the wall's plane less the radius [m].

    Parameters as for `directions`; (..., wall contacts).
    """
    check.kind("network", network, Network)
    return check.finite("gap", dynamics(network).elongations(u)[..., len(network.bonds) :])


@dataclass(frozen=True, eq=False)
class Budget:
    """Energy and momentum beyond a bond.

    Attributes
    ----------
    t : ndarray, (T,)
        [s]
    energy, momentum : ndarray, (T,)
        Of the sites beyond the bond [J], [kg m/s], from their displacements and velocities.
    work, impulse : ndarray, (T,)
        Passed through the bond since the first instant, by quadrature [J], [kg m/s].
    energy_error, momentum_error : float
        Largest difference of the two accounts, over the size of the energy of the whole chain at
        the first instant and over the largest change of the momentum; absolute where that is 0.
    """

    t: Array
    energy: Array
    momentum: Array
    work: Array
    impulse: Array
    energy_error: float
    momentum_error: float


def beyond(run: Run, bond: int) -> Budget:
    """The budget of the part of a chain beyond a bond.

    Parameters
    ----------
    run : Run
        Of a chain whose last end is free, all sites recorded.  Springs that change while it
        runs are refused: the work of the change does not pass through the bond.
    bond : int
        Bond j joins sites j and j + 1.

    Raises
    ------
    TensegrityError
        Bad input, or another run, one of another scene or too few of its sites or instants.
    """
    from scipy.interpolate import make_interp_spline

    if not isinstance(run, Run):
        raise TensegrityError(f"run is {type(run).__name__}, not a Run")
    chain = run.scene
    if not isinstance(chain, Chain):
        raise TensegrityError(f"the scene of the run is {type(chain).__name__}, not a Chain")
    if chain.tune:
        raise TensegrityError("the springs change in time: their work passes through no bond")
    bond = check.whole("bond", bond, least=0, below=chain.sites - 1)
    if run.sites != tuple(range(chain.sites)):
        raise TensegrityError(f"{len(run.sites)} of {chain.sites} sites recorded: record all")
    if chain.ends[1] != "free":
        raise TensegrityError("the last site is fixed: its force is not part of this budget")
    if len(run.t) <= DEGREE:
        raise TensegrityError(f"{len(run.t)} instants recorded, must be above {DEGREE}")
    bonds = chain.bond_energy(run.u)
    kinetic = 0.5 * chain.mass * run.v**2
    energy = kinetic[:, bond + 1 :].sum(axis=1) + bonds[:, bond + 1 :].sum(axis=1)
    momentum = run.v[:, bond + 1 :] @ chain.mass[bond + 1 :]
    tension = chain.bond_tension(run.u)[:, bond]
    rates = np.stack([-tension * run.v[:, bond + 1], -tension], axis=1)
    work, impulse = make_interp_spline(run.t, rates, DEGREE).antiderivative()(run.t).T
    gaps = [np.abs(x - x[0] - y).max() for x, y in ((energy, work), (momentum, impulse))]
    change = np.abs(momentum - momentum[0]).max()
    return Budget(
        run.t, energy, momentum, work, impulse,
        float(gaps[0] / (abs(run.energy[0]) or 1.0)), float(gaps[1] / (change or 1.0)),
    )  # fmt: skip
