"""The collision of two solitary waves, and what it shifts them by."""

from __future__ import annotations

import math

from tensegrity.checked import checked
from tensegrity.errors import TensegrityError
from tensegrity.measure.pulses import Pulse, chain_of, pulses
from tensegrity.runs.run import Run
from tensegrity.waves.solitary import SolitaryWave

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
