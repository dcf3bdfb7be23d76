"""What is read off a run of beads: sensors, arrivals and speeds, energies, momenta, overlaps.

A sensor in a bead reads the force across its middle plane, seeds/001, eq. (5): half the sum of
the forces of its contacts, each taken along the bead's displacement (derived in
`derivations.ledger_paper`, entry "paper.eq5").  Forces of contacts count compression as positive.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from granular.contact_network import contacts_of, wall_forces, wall_sites
from granular.crystal import beads_by_site, crystal_of, rows, whole
from tensegrity import TensegrityError, check
from tensegrity.measure.observables import passage
from tensegrity.root import root
from tensegrity.runs.run import Run
from tensegrity.typing import Array, Flags

CLOCK = 3e-6  # s: sampling interval of the paper's density plots
LEVEL = 0.05  # of the largest peak: smaller ones do not count as pulses


def sensor_force(run: Run, part: str, number: int) -> Array:
    """Force that a sensor in a bead reads, seeds/001, eq. (5).

    Parameters
    ----------
    run : Run
        Of a chain or a guide of beads, with the bead and its neighbours recorded.
    part : str
        Such as "stem 1".
    number : int
        Of the bead in that part, from 1.

    Returns
    -------
    ndarray, (T,)
        [N], >= 0; 0 for a bead not yet touched.

    Raises
    ------
    TensegrityError
        Not a run, or one of a scene without beads; no such bead; the bead or a neighbour was not
        recorded.
    """
    forces, along = _sensed(run, part, number)
    return (forces * along).sum(axis=-1) / 2


def mean_force(run: Run, part: str, number: int) -> Array:
    """Half the sum of the forces of a bead's contacts [N], (T,), whatever their directions."""
    return _sensed(run, part, number)[0].sum(axis=-1) / 2


def _sensed(run: Run, part: str, number: int) -> tuple[Array, Array]:
    """Forces of a bead's contacts [N], and their cosines to its displacement; (T, contacts)."""
    scene = crystal_of(run)
    site, contacts = scene.site(part, number), contacts_of(scene)
    u = rows(run, contacts.neighbours(site))
    forces = scene.contact_forces(u)[:, contacts.of_site(site)]
    return forces, contacts.cosines(u, site)


def wall_force(run: Run, name: str, each: bool = False) -> Array:
    """Contact force on a wall.

    Parameters
    ----------
    run : Run
        Of a chain, a guide or a pack, with all beads recorded that can touch the wall: those of
        `granular.contact_network.wall_sites(scene, name)`.
    name : str
        Such as "floor"; "start" and "end" of a chain.  Walls of one name count together.
    each : bool, optional
        Every site's share, in the order of the sites.

    Returns
    -------
    ndarray, (T,) or (T, sites)
        [N], compression > 0.

    Raises
    ------
    TensegrityError
        No such wall; a bead that can touch it was not recorded.
    """
    scene = crystal_of(run)
    each = check.truth("each", each)
    forces = wall_forces(scene, rows(run, wall_sites(scene, name)), name)
    return forces if each else forces.sum(axis=-1)


def density(run: Run, sites: Sequence[int]) -> Array:
    """Sensor forces of several beads of a run of all sites [N], (T, beads)."""
    scene = crystal_of(run)
    u = rows(run, range(scene.sites))
    sites = check.sequence("sites", sites, "sites")
    if not sites:
        raise TensegrityError("sites is empty: nothing to read")
    for site in sites:
        check.whole("site", site, least=0, below=scene.sites)
    forces = scene.contact_forces(u)
    of = contacts_of(scene)
    columns = [(forces[:, of.of_site(s)] * of.cosines(u, s)).sum(axis=-1) / 2 for s in sites]
    return np.stack(columns, axis=1)


def peak(
    t: ArrayLike, force: ArrayLike, between: tuple[float, float] = (-math.inf, math.inf)
) -> tuple[float, float]:
    """Instant and height of the first large peak of a recorded force.

    Parameters
    ----------
    t, force : ndarray, (T,)
        [s], [N].
    between : (float, float)
        Only this time is looked at [s].

    Returns
    -------
    instant, height : float
        Located between the rows by a spline of fifth order.

    Raises
    ------
    TensegrityError
        Fewer than 12 rows in that time; a record as for `pulses`.
    """
    from scipy.interpolate import make_interp_spline

    t, force = _record(t, force)
    inside = _within(t, between)
    if inside.sum() < 12:
        raise TensegrityError(f"{inside.sum()} instants between {between} s are too few for a peak")
    t, force = t[inside], force[inside]
    spline = make_interp_spline(t, force, k=5)
    instant = passage(t, force, spline.derivative()(t))
    return instant, float(spline(instant))


def largest(
    t: ArrayLike, force: ArrayLike, between: tuple[float, float] = (-math.inf, math.inf)
) -> tuple[float, float]:
    """Instant [s] and height [N] of the largest force of a record, the rows' or one between them.

    Parameters as for `peak`, and the same spline; where the first large peak is the largest, both
    give the same.  At an end of that time it is the row's.  A pulse wants ten rows and more: the
    spline overshoots a step.

    Raises
    ------
    TensegrityError
        No row in that time; a record as for `pulses`.
    """
    t, force = _with_crests(*_record(t, force))
    inside = _within(t, between)
    if not inside.any():
        raise TensegrityError(f"no instant of the record lies between {between} s")
    top = int(np.argmax(force[inside]))
    return float(t[inside][top]), float(force[inside][top])


def _with_crests(t: Array, force: Array) -> tuple[Array, Array]:
    """A record with the maxima between its rows, by a spline of fifth order, as further rows."""
    from scipy.interpolate import make_interp_spline

    spline = make_interp_spline(t, force, k=min(5, len(t) - 1))
    slope = spline.derivative()
    rate = slope(t)
    rows = np.flatnonzero((rate[:-1] > 0) & (rate[1:] < 0))
    instants = [root(slope, t[k], t[k + 1]) for k in rows.tolist()]
    return np.insert(t, rows + 1, instants), np.insert(force, rows + 1, spline(instants))


def speed(
    run: Run,
    part: str,
    numbers: tuple[int, int],
    between: tuple[float, float] = (-math.inf, math.inf),
) -> float:
    """Speed of the leading pulse between two sensors of a part.

    Parameters
    ----------
    run, part
        As for `sensor_force`.
    numbers : (int, int)
        Of the two beads.
    between : (float, float)
        Only this time is looked at [s]: for a reflected pulse, behind the incident one.

    Returns
    -------
    float
        [m/s]: the way through touching beads over the time between both peaks; > 0 if the pulse
        runs from the first bead to the second.

    Raises
    ------
    TensegrityError
        As `sensor_force` and `peak`; the same bead twice, or both peaks at one instant.
    """
    way = crystal_of(run).distance(part, numbers)
    first, second = (peak(run.t, sensor_force(run, part, n), between)[0] for n in numbers)
    if first == second:
        raise TensegrityError(f"beads {numbers} of {part} peak at the same instant, {first:g} s")
    return way / (second - first)


def _within(t: Array, between: tuple[float, float]) -> Flags:
    """Which instants lie between two others, both included."""
    if not isinstance(between, (tuple, list)) or len(between) != 2:
        raise TensegrityError(f"between {check.shown(between)} must be two instants")
    first, last = (check.number("end of between", x, finite=False, unit="s") for x in between)
    return (t >= first) & (t <= last)


def sampled(
    t: ArrayLike, force: ArrayLike, interval: float = CLOCK, phase: float = 0.0
) -> tuple[Array, Array]:
    """A recorded force as an oscilloscope reads it.

    Parameters
    ----------
    t, force : ndarray, (T,)
        Recorded more often than every `interval`.
    interval, phase : float
        Of the clock [s]: it reads at phase, phase + interval, ... after the first row; the phase
        is >= 0 and shorter than the record.

    Returns
    -------
    times, values : ndarray, (samples,)
        [s], [N].

    Raises
    ------
    TensegrityError
        The record is coarser than the clock, or as for `pulses`; a phase out of range.
    """
    from scipy.interpolate import CubicSpline

    t, force = _record(t, force)
    interval = check.number("sampling interval", interval, above=0, unit="s")
    phase = check.number("phase", phase, least=0, unit="s")
    if phase >= t[-1] - t[0]:
        raise TensegrityError(
            f"phase {phase:g} s must be below the length of the record, {t[-1] - t[0]:g} s"
        )
    if np.diff(t).max() > interval:
        raise TensegrityError(
            f"rows {np.diff(t).max():.3g} s apart must be at most one interval, {interval:.3g} s"
        )
    times = np.arange(t[0] + phase, t[-1], interval)
    try:
        return times, CubicSpline(t, force)(times)
    except ValueError as error:
        raise TensegrityError(f"forces to {np.abs(force).max():g} N: {error}") from error


def sampled_peak(
    t: ArrayLike,
    force: ArrayLike,
    between: tuple[float, float] = (-math.inf, math.inf),
    interval: float = CLOCK,
    phase: float = 0.0,
) -> tuple[float, float]:
    """Instant and height of the largest sample that an oscilloscope reads between two instants.

    Parameters as for `peak` and `sampled`; an instant is off by up to half an interval.
    """
    times, values = sampled(t, force, interval, phase)
    inside = _within(times, between)
    if not inside.any():
        raise TensegrityError(f"no sample every {interval:g} s between {between} s")
    largest = np.argmax(values[inside])
    return float(times[inside][largest]), float(values[inside][largest])


def pulses(t: ArrayLike, force: ArrayLike, level: float = LEVEL) -> tuple[Array, Array]:
    """Instants and heights of all peaks above a part of the largest; two arrays (pulses,).

    Located between the rows as by `peak`.
    A peak counts if the force falls below three quarters of the lower of two neighbours between
    them; otherwise the higher stands for both.

    Raises
    ------
    TensegrityError
        A level not between 0 and 1; instants that do not grow, or forces that are not finite, or
        not as many.
    """
    from scipy.signal import find_peaks

    level = check.number("level", level, above=0, below=1)
    t, force = _with_crests(*_record(t, force))
    top = force.max()
    padded = np.concatenate([[0.0], force, [0.0]])
    found, facts = find_peaks(padded, height=level * top, prominence=0)
    distinct = facts["prominences"] >= facts["peak_heights"] / 4
    return t[found[distinct] - 1], facts["peak_heights"][distinct]


def _record(t: ArrayLike, force: ArrayLike) -> tuple[Array, Array]:
    """Instants and forces as arrays (T,), T >= 2, if they are a record."""
    t, force = check.floats("instants", t), check.floats("forces", force)
    if t.ndim != 1 or len(t) < 2 or force.shape != t.shape:
        raise TensegrityError(
            f"a record of instants of shape {t.shape} and forces of shape {force.shape} must have "
            "one of each for every row, and two rows"
        )
    for name, x in (("instant", t), ("force", force)):
        if not np.isfinite(x).all():
            row = int(np.flatnonzero(~np.isfinite(x))[0])
            raise TensegrityError(f"{name} {x[row]} of row {row} must be finite")
    if not np.all(np.diff(t) > 0):
        raise TensegrityError(f"instants must grow, not by {np.diff(t).min():g} s between two rows")
    return t, force


def part_energies(run: Run) -> dict[str, Array]:
    """Energy of each part of the scene at the recorded instants.

    Parameters
    ----------
    run : Run
        With all sites recorded.

    Returns
    -------
    dict of str to ndarray, (T,)
        [J]: kinetic, and half that of each contact of two beads.  "walls" hold all of theirs;
        the sum is the total energy.
    """
    scene = crystal_of(run)
    u, v = whole(run)
    contacts = contacts_of(scene)
    inside = contacts.bead_energies(u, v)
    energies = {
        part: inside[:, list(sites)].sum(axis=1)
        for part, sites in scene.parts.items()
        if part != "wall"
    }
    return {**energies, "walls": contacts.wall_energy(u)}


def momentum(run: Run) -> Array:
    """Momentum of all beads and of what the walls of a guide have taken [N s], (T[, dim]).

    Constant in a guide, and in a chain without loads and end wall (a held site takes impulse
    that is not recorded).  All sites must have been recorded.
    """
    crystal_of(run)
    total = np.einsum("s,ts...->t...", run.scene.mass, whole(run)[1])
    return total if run.impulse is None else total + run.impulse.sum(axis=1)


def overlaps(run: Run, part: str | None = None) -> tuple[float, float]:
    """Largest and mean peak overlap of the contacts between beads of a part (all: None) [m].

    Peaks between the rows too, as by `largest`.
    """
    scene = crystal_of(run)
    u = rows(run, range(scene.sites))
    chosen = contacts_of(scene).within(part)
    if not chosen:
        raise TensegrityError(f"part {part!r} has no contact of two of its beads")
    peaks = [largest(run.t, overlap)[1] for overlap in scene.overlaps(u)[:, chosen].T]
    return max(peaks), float(np.mean(peaks))


def energy_shares(run: Run) -> Array:
    """Part of the energy that each bead has.

    A bead has its motion, half of each contact with another bead and all of its contacts with
    walls; the potential of gravity and of a preload counts for none.

    Parameters
    ----------
    run : Run
        With all sites recorded.

    Returns
    -------
    ndarray, (T, beads)
        In the order of the sites, walls of a chain left out; every row adds up to 1.

    Raises
    ------
    TensegrityError
        Not a run of beads; a site that was not recorded; no energy at all.
    """
    kinetic, stored = _energies(run)
    energies = kinetic + stored
    total = energies.sum(axis=-1, keepdims=True)
    if not np.all(total > 0):
        raise TensegrityError(f"energy {total.min():g} J of a row must be above 0 to be shared")
    return energies / total


def effective_number(run: Run) -> Array:
    """Number of beads that share the energy, exp of the entropy of `energy_shares`; (T,)."""
    shares = energy_shares(run)
    logs = np.log(np.where(shares > 0, shares, 1.0))
    return np.exp(-np.sum(shares * logs, axis=-1))


def participation_ratio(run: Run) -> Array:
    """Number of beads that share the energy, 1 over the sum of squared `energy_shares`; (T,)."""
    return 1 / np.sum(energy_shares(run) ** 2, axis=-1)


def virial_ratio(run: Run) -> Array:
    """Kinetic energy over kinetic and contact energy; (T,).

    Its mean over a long time is 5/9 for a line of Hertz beads that just fills the room between two
    walls, without gravity or preload: the potential is homogeneous of degree 5/2 in the
    displacements, whether or not contacts open, and these stay bounded, so that 2 <T> = 5/2 <V>
    (virial theorem).
    """
    kinetic, stored = (x.sum(axis=-1) for x in _energies(run))
    return kinetic / (kinetic + stored)


def _energies(run: Run) -> tuple[Array, Array]:
    """Kinetic energy of each bead and that of its contacts [J], two arrays (T, beads)."""
    scene = crystal_of(run)
    u, v = whole(run)
    beads = list(beads_by_site(scene))
    kinetic = 0.5 * run.scene.mass * (v**2 if v.ndim == 2 else np.sum(v**2, axis=-1))
    return kinetic[:, beads], contacts_of(scene).stored(u)[:, beads]
