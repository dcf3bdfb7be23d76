"""Waves that meet an interface, or each other: reflection, transmission, phase shifts.

Of two joined chains the near one has the lower sites; the bond that joins both belongs to it.  A
pulse arrives along one of them: pulses that travel back from the interface are reflected, those
that continue in the other chain are transmitted, both of compression and of rarefaction.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.errors import TensegrityError
from tensegrity.measure.pulses import FRACTION, Instant, Pulse, chain_of, check_row, pulses
from tensegrity.printing import Lines, Printed
from tensegrity.runs.run import Run
from tensegrity.scenes.chain import Chain
from tensegrity.scenes.scene import State
from tensegrity.springs.potential import Potential
from tensegrity.typing import Array, FractionOrOne
from tensegrity.waves.solitary import SolitaryWave

NOTHING = 1e-6  # of the incident amplitude: smaller peaks are not pulses
QUIET = 1e-3  # of the incident amplitude: largest elongation at an end that no wave has reached


@checked
def interface(
    near: Potential,
    far: Potential,
    sites: tuple[int, int] = (400, 400),
    mass: ArrayLike = (1.0, 1.0),
) -> Chain:
    """Two chains of equal springs and masses each, joined and free at both ends.

    Parameters
    ----------
    near, far : Potential
        Of the bonds between the sites of either chain; the bond that joins both is a near one.
    sites : (int, int), optional
        Numbers of sites of the near and of the far chain, at least 1.
    mass : (float, float), optional
        Of each site of the near and of the far chain [kg], > 0.

    Returns
    -------
    Chain
        The interface lies at site `sites[0]`, the first one of the far chain.

    Raises
    ------
    TensegrityError
        Bad input.

    Examples
    --------
    >>> from tensegrity import Prism, interface
    >>> hard, soft = (Prism(1.0, 0.7, p, 1.0).potential() for p in (0.1, 0.02))
    >>> chain = interface(hard, soft, sites=(30, 20))
    >>> print(chain.sites, len(set(chain.springs)))
    50 2
    """
    counts = [check.whole("sites", n, least=1) for n in check.sequence("sites", sites, "numbers")]
    masses = [
        check.number("mass", m, above=0, unit="kg")
        for m in check.sequence("mass", mass, "numbers")
    ]  # fmt: skip
    if len(counts) != 2 or len(masses) != 2:
        raise TensegrityError(f"{len(counts)} numbers of sites and {len(masses)} masses: give two")
    before, after = counts
    check.memory(f"a chain of {before + after} sites", 16.0 * (before + after))
    springs = [near] * before + [far] * (after - 1)
    return Chain(springs, before + after, np.repeat(masses, counts))


@dataclass(frozen=True, eq=False, repr=False)
class Transmission(Printed):
    """Reflected and transmitted pulses of an incident one; the result of `transmission`.

    Attributes
    ----------
    site : int
        Where the interface is: the first site of the far chain.
    incident : Pulse
        In the first recorded row.
    reflected, transmitted : tuple of Pulse
        Those that travel away from the interface at a speed that could be measured, in the chain
        along which the incident one came and in the other one; in the order of their places.
    reflected_delays, transmitted_delays : ndarray, (pulses,)
        Delay of each of them at the interface after the arrival of the incident peak [s],
        extrapolated by its speed.
    reflected_energy, transmitted_energy : float
        Fraction of the initial energy in either chain, that between the pulses and the interface
        included.  Their sum deviates from 1 by the energy error of the run.
    """

    site: int
    incident: Pulse
    reflected: tuple[Pulse, ...]
    transmitted: tuple[Pulse, ...]
    reflected_delays: Array = field(repr=False)
    transmitted_delays: Array = field(repr=False)
    reflected_energy: float
    transmitted_energy: float

    def _lines(self) -> Lines:
        groups = {
            "incident": (self.incident,),
            f"reflected, {100 * self.reflected_energy:.6g} % of the energy": self.reflected,
            f"transmitted, {100 * self.transmitted_energy:.6g} % of the energy": self.transmitted,
        }
        yield f"interface at site {self.site}"
        for name, found in groups.items():
            yield f"  {name}" + ("" if found else ": no pulse")
            yield from (f"    {' '.join(str(pulse).split())}" for pulse in found)


@checked
def transmission(run: Run, row: int = -1, fraction: FractionOrOne = FRACTION) -> Transmission:
    """Reflected and transmitted pulses of a wave at the interface of two chains.

    Parameters
    ----------
    run : Run
        Of a chain of two parts as `interface` makes it, all sites recorded.  Its first row has
        one pulse, on its way to the interface along either part.
    row : int, optional
        Index of the recorded instant (negative: from the last one) at which the pulses sought have
        left the interface and nothing has reached an end of the chain.
    fraction : float, optional
        Fraction of the largest |elongation| of its own chain above which a peak counts, above 0,
        at most 1; it must also exceed 1e-6 of the incident amplitude.

    Returns
    -------
    Transmission

    Raises
    ------
    TensegrityError
        Another scene or a chain without an interface; no or several incident pulses; one that has
        not reached the interface; an end bond that was deformed in a recorded row up to this one.

    Examples
    --------
    >>> from tensegrity import Prism, interface, simulate, solitary_wave, transmission
    >>> near = Prism(base=1.0, height=0.8, prestrain=0.1, k_cross=1.0).potential()
    >>> far = Prism(base=1.0, height=0.8, prestrain=0.02, k_cross=1.0).potential()
    >>> chain, wave = interface(near, far, (100, 100)), solitary_wave(near, speed_ratio=1.2)
    >>> run = simulate(chain, wave.launch(chain, at=60.0), 70 / wave.speed, tol=1e-8)
    >>> found = transmission(run)
    >>> f"{found.transmitted_energy:.3f}", found.transmitted[-1].direction
    ('0.982', 1)
    """
    chain, row = chain_of(run), check_row(run, row)
    site = _site_of(chain)
    first = Instant(chain, State(run.u[0], run.v[0]))
    incident = _incident(first.pulses(fraction), site)
    rows = slice(len(run.t) + row + 1 if row < 0 else row + 1)
    _refuse_ends(run, rows, abs(incident.amplitude))
    meets = float(run.t[0]) + abs(site - incident.place) / incident.speed
    if not run.t[row] > meets:
        raise TensegrityError(
            f"at {run.t[row]:g} s the incident pulse has not reached the interface: it does so at "
            f"{meets:g} s"
        )
    last = Instant(chain, State(run.u[row], run.v[row]), NOTHING * abs(incident.amplitude))
    parts = last.pulses(fraction, 0, site), last.pulses(fraction, site, None)
    energies = last.site_energy[:site].sum(), last.site_energy[site:].sum()
    if incident.direction < 0:
        parts, energies = parts[::-1], energies[::-1]
    back, on = (
        tuple(pulse for pulse in part if pulse.direction == direction and pulse.speed)
        for part, direction in zip(parts, (-incident.direction, incident.direction), strict=True)
    )

    def delays(several: tuple[Pulse, ...]) -> Array:
        return np.array([
            run.t[row] - abs(pulse.place - site) / pulse.speed - meets for pulse in several
        ])  # fmt: skip

    whole = float(first.site_energy.sum())
    return Transmission(
        site, incident, back, on, delays(back), delays(on), float(energies[0]) / whole,
        float(energies[1]) / whole,
    )  # fmt: skip


def _site_of(chain: Chain) -> int:
    """The first site of the far chain."""
    springs, mass = chain.springs, chain.mass
    bonds = [k for k in range(1, len(springs)) if springs[k] != springs[k - 1]]
    sites = (np.flatnonzero(np.diff(mass)) + 1).tolist()
    places = {*bonds, *sites}
    if len(places) != 1:
        words = "without" if not places else f"with changes at the sites {sorted(places)}, not with"
        raise TensegrityError(f"a chain {words} one interface: see `interface`")
    return int(places.pop())


def _incident(pulses: list[Pulse], site: int) -> Pulse:
    """The one pulse of the first row, on its way to the interface."""
    if len(pulses) != 1:
        raise TensegrityError(f"{len(pulses)} pulses in the first row, must be 1")
    (pulse,) = pulses
    if not (site - pulse.place) * pulse.direction > 0 or not pulse.speed:
        raise TensegrityError(
            f"the pulse at {pulse.place:g} of the first row, direction {pulse.direction}, is not "
            f"on its way to the interface at {site}"
        )
    return pulse


def _refuse_ends(run: Run, rows: slice, amplitude: float) -> None:
    """Refuse a run in which an end of the chain was deformed."""
    u = run.u[rows]
    at_ends = np.abs(np.stack([u[:, 1] - u[:, 0], u[:, -1] - u[:, -2]])).max(axis=0)
    late = np.flatnonzero(at_ends > QUIET * amplitude)
    if late.size:
        row = int(late[0])
        raise TensegrityError(
            f"an end bond is deformed by {at_ends[row]:g} m at {run.t[row]:g} s, must be at most "
            f"{QUIET * amplitude:g} m: take an earlier row or a longer chain"
        )


ALIKE = 1e-3  # relative difference of amplitudes of one wave, launched and found
CHANGED = 0.2  # relative change of a wave's amplitude in a collision, at most


@checked
def phase_shift(run: Run, left: SolitaryWave, right: SolitaryWave) -> tuple[float, float]:
    """Phase shifts of two solitary waves by their collision.

    Parameters
    ----------
    run : Run
        Of a chain with all sites recorded.  Its first recorded row contains the two incident
        waves, well separated, and nothing else; in its last row they are separated again.
    left, right : SolitaryWave
        The incident waves, that at the lower sites first: head-on, or one overtaking the other.
        Their initial positions are read from the first row.

    Returns
    -------
    (float, float)
        Shifts of the left and of the right wave [sites], > 0 if a wave is ahead, in its direction
        of travel, of its undisturbed position.  The trajectories of the incident and of the
        outgoing wave, each with its own speed, are extrapolated to the instant at which the
        undisturbed waves would coincide.

    Raises
    ------
    TensegrityError
        The waves of the first row are not these, or do not meet within the run; no wave of the
        last row has the direction of one of them and its amplitude to within a fifth.

    Notes
    -----
    Source: M. Toda, J. Phys. Soc. Jpn. 22, 431 (1967), whose lattice shifts waves and leaves
    nothing else behind.
    """
    chain_of(run)
    waves, sizes = (left, right), sorted(abs(wave.amplitude) for wave in (left, right))
    fraction = sizes[0] / sizes[1] / 2
    incident = pulses(run, 0, fraction)
    if len(incident) != 2:
        raise TensegrityError(f"{len(incident)} pulses in the first row, must be 2")
    for name, pulse, wave in zip(("left", "right"), incident, waves, strict=True):
        if pulse.wave is None or abs(pulse.amplitude / wave.amplitude - 1) > ALIKE:
            raise TensegrityError(
                f"the pulse at {pulse.place:.6g} sites in the first row, of amplitude "
                f"{pulse.amplitude:.6g} m, is not the {name} wave, of "
                f"amplitude {wave.amplitude:.6g} m"
            )
    velocities = [pulse.direction * wave.speed for pulse, wave in zip(incident, waves, strict=True)]
    closing = velocities[0] - velocities[1]
    duration = float(run.t[-1] - run.t[0])
    meeting = (incident[1].place - incident[0].place) / closing if closing > 0 else math.inf
    if not meeting < duration:
        raise TensegrityError(
            f"the waves meet {meeting:g} s after the first row, must be within {duration:g} s"
        )
    place = incident[0].place + velocities[0] * meeting
    outgoing = pulses(run, -1, fraction)
    same = [_same(outgoing, pulse) for pulse in incident]
    shifts = [
        pulse.direction * (pulse.place - place) - pulse.speed * (duration - meeting)
        for pulse in same
    ]
    return shifts[0], shifts[1]


def _same(outgoing: list[Pulse], incident: Pulse) -> Pulse:
    """The outgoing pulse that an incident one has become."""
    alike = [
        pulse for pulse in outgoing
        if pulse.wave is not None and pulse.direction == incident.direction
        and abs(pulse.amplitude / incident.amplitude - 1) < CHANGED
    ]  # fmt: skip
    if not alike:
        raise TensegrityError(
            f"no wave of the last row continues the one at {incident.place:g} of amplitude "
            f"{incident.amplitude:g} m"
        )
    return min(alike, key=lambda pulse: abs(pulse.amplitude - incident.amplitude))
