"""Exact solitary waves of a chain of equal masses and springs: `solitary_wave`.

A wave is found from its speed, its peak elongation or its energy, to round-off.  For the equation
and how it is solved see `travelling`.  Sources:
G. Friesecke, J. Wattis, Commun. Math. Phys. 161, 391 (1994) (existence); seeds/000, part III.
"""

from __future__ import annotations

import math

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.springs.potential import Potential
from tensegrity.waves.asked import with_energy, with_size, with_stiffness
from tensegrity.waves.asymptotics import sound_speed
from tensegrity.waves.family import SIGNS, STROKE, Family, refined
from tensegrity.waves.pieces import beyond_corner, in_pieces
from tensegrity.waves.travelling import NoWave
from tensegrity.waves.wave import SolitaryWave, wave_of

MOST = 1000  # families of one sign that can be asked for


def solitary_wave(
    potential: Potential,
    mass: float = 1.0,
    *,
    speed: float | None = None,
    speed_ratio: float | None = None,
    excess: float | None = None,
    amplitude: float | None = None,
    energy: float | None = None,
    family: str | None = None,
) -> SolitaryWave:
    """The solitary wave of a chain, to round-off.

    Parameters
    ----------
    potential : Potential
        Of all springs.
    mass : float, optional
        Of each site [kg].
    speed, speed_ratio, excess, amplitude, energy : float
        Exactly one: speed [sites/s], speed over sound speed, the same less 1 (which keeps its
        digits close to sound), elongation of the crest [m] (negative: compression), or energy [J].
    family : str, optional
        "compression" or "rarefaction"; by default that of the amplitude's sign, else the one
        whose waves start from zero amplitude: compression where the spring stiffens in
        compression.  Springs that stiffen both ways carry the other one too, above a threshold.
        Where a spring stiffens, softens and stiffens more there are several families of one sign,
        see `predict`: "rarefaction 2" is the second.  Without a number it is the one to which
        speed or amplitude belong, and with an energy the first.

    Returns
    -------
    SolitaryWave
        With a residual of at most 1e-12.

    Raises
    ------
    TensegrityError
        Bad input, or no such wave exists; the message says why.
    ResolutionError
        The wave exists, but not even the finest grid resolves it.
    LockingError
        The amplitude lies outside the domain of the potential.

    Notes
    -----
    Where the crest is beyond a corner of the force, as where contacts open, the wave is solved in
    pieces, see `tensegrity.waves.pieces`: seconds, not a tenth of one.
    """
    check.kind("potential", potential, Potential)
    mass = check.number("mass", mass, above=0, unit="kg")
    given = {
        "speed": speed, "speed_ratio": speed_ratio, "excess": excess, "amplitude": amplitude,
        "energy": energy,
    }  # fmt: skip
    asked = {name: value for name, value in given.items() if value is not None}
    if len(asked) != 1:
        raise TensegrityError(
            f"{' and '.join(asked) or 'nothing'} given: give exactly one of {', '.join(given)}"
        )
    ((name, value),) = asked.items()
    value = check.number(name, value)
    sound = sound_speed(potential, mass)
    sign, number = _sign_and_number(potential, family, value if name == "amplitude" else None)
    side = Family(potential, sign, number or 0)
    label = f"{name} {value:g}"
    if name == "amplitude":
        value = abs(value)
        side = side.with_crest(value) if number is None else side
    elif name == "energy":
        value = check.number("energy", value, above=0, unit="J")
    else:
        name, value = "above", _above(name, value, sound, mass, side.rest)
        side = side.with_level(value) if number is None else side
    try:
        return _smooth(side, mass, sound, name, value, label)
    except TensegrityError:
        if not beyond_corner(side, name, value):
            raise
    return in_pieces(side, mass, sound, name, value)


def _smooth(side, mass, sound, name, value, label):
    """The wave by Fourier's series."""
    if name == "amplitude":
        profile, condition = with_size(side, value)
    elif name == "energy":
        profile, condition = with_energy(side, value)
    else:
        profile, condition = with_stiffness(side, value, mass)
    try:
        exact, residual = refined(profile, condition)
    except NoWave:
        near = wave_of(side.name, mass, sound, profile, profile.residual())
        raise TensegrityError(
            f"no solitary wave of {side.name} with {label}: the nearest one found has a "
            f"crest of {near.amplitude:.6g} m, speed {near.speed:.6g} sites/s and energy "
            f"{near.energy:.6g} J, where the family ends"
        ) from None
    return wave_of(side.name, mass, sound, exact, residual)


def rough_wave(side: Family, mass: float, size: float) -> SolitaryWave:
    """A wave of a family as it is first found, several times faster than `solitary_wave`.

    Parameters
    ----------
    side : Family
        Of one potential and sign; it serves many waves.
    mass : float
        Of each site [kg], > 0.
    size : float
        |elongation| of the crest [m], > 0.

    Returns
    -------
    SolitaryWave
        Good to about 1e-4 of its crest, with the residual that it has.

    Raises
    ------
    TensegrityError
        If no such wave exists, or no grid resolves it.
    """
    mass = check.number("mass", mass, above=0, unit="kg")
    profile = side.wave(check.number("size", size, above=0, unit="m"))
    sound = sound_speed(side.potential, mass)
    return wave_of(side.name, mass, sound, profile, profile.residual())


def _above(name, value, sound, mass, rest):
    """m c^2 - V''(0) [N/m] of a speed, a speed ratio or its excess."""
    if name != "speed" and sound == 0:
        raise TensegrityError(
            f"{name} given, but the sound speed is 0 (a sonic vacuum): give the speed"
        )
    if name == "excess":
        value = check.number("excess", value, above=0)
        speed, above = sound * (1 + value), rest * value * (2 + value)
    else:
        speed = value * sound if name == "speed_ratio" else value
        above = rest * (speed / sound - 1) * (speed / sound + 1) if sound else mass * speed * speed
    if name != "excess" and not speed > sound:
        raise TensegrityError(
            f"speed {speed:g} must be above {sound:g} sites/s, the sound speed: one as slow "
            "has no decaying tail"
        )
    stiffness = mass * speed * speed
    if not (above > 0 and stiffness < math.inf):
        raise TensegrityError(
            f"speed {float(speed)} sites/s gives m c^2 = {float(stiffness)} N/m, must be a "
            f"number above the stiffness at rest, {rest} N/m"
        )
    return above


def _sign_and_number(potential, family, amplitude):
    """-1 or 1, the sign of the elongation, and which family of it, from 0, or None."""
    number = None
    if family is not None:
        word, _, rest = family.partition(" ") if isinstance(family, str) else ("", "", "")
        if word not in SIGNS or not (rest == "" or (rest.isdecimal() and 0 < int(rest) <= MOST)):
            raise TensegrityError(
                f"family {check.shown(family)} must be one of {', '.join(SIGNS)}, with a number "
                "from the second family on"
            )
        family, number = word, int(rest) - 1 if rest else None
    return _sign(potential, family, amplitude), number


def _sign(potential, family, amplitude):
    """-1 or 1, the sign of the elongation."""
    if amplitude is not None:
        if amplitude == 0:
            raise TensegrityError("amplitude 0 m must not be 0")
        sign = int(math.copysign(1, amplitude))
        if family and SIGNS[family] != sign:
            raise TensegrityError(
                f"amplitude {amplitude:g} m has the wrong sign for family {family!r}: "
                "compression < 0"
            )
        if not potential.domain[0] < amplitude < potential.domain[1]:
            potential.tension(amplitude)  # says which end
        return sign
    if family:
        return SIGNS[family]
    resists = float(potential.stiffness(0.0)) > 0
    return 1 if resists and float(potential.derivative(3, 0.0)) > 0 else -1


def largest_speed(
    potential: Potential, mass: float = 1.0, family: str | None = None, closest: float = 1e-3
) -> float:
    """The speed that the waves of a family approach but do not reach.

    Parameters
    ----------
    potential, mass, family
        As for `solitary_wave`.
    closest : float, optional
        Part of the stroke that is left to the largest wave computed; 0.0005 to 0.1.

    Returns
    -------
    float
        [sites/s]: where the spring locks, the limit of waves that use up its stroke; where it
        softens, the speed of a front; where its domain ends at a finite force, the speed of the
        wave that gets there.

    Raises
    ------
    TensegrityError
        If no such wave exists, or there is no bound.

    Notes
    -----
    The force near locking grows with the inverse root of the stroke left, and so the speed has
    a series in that root; it is extrapolated, to about 1e-5 of its value.  Another `closest`
    shows how well.
    """
    check.kind("potential", potential, Potential)
    mass = check.number("mass", mass, above=0, unit="kg")
    closest = check.number("closest", closest, least=1 - STROKE)
    if closest > 0.1:
        raise TensegrityError(f"closest {closest:g} must be at most 0.1")
    sign, number = _sign_and_number(potential, family, None)
    side = Family(potential, sign, number or 0)
    if math.isfinite(side.rise.ceiling):
        return math.sqrt((side.rest + side.rise.ceiling) / mass)
    if math.isinf(side.end):
        raise TensegrityError("no largest speed: the spring does not lock (its domain is open)")
    return math.sqrt(side.stiffness_at_end(closest) / mass)
