"""Waves of a family by peak elongation, speed or energy, and their change with the speed.

Speed and energy increase with the size of the peak.  `near` returns a wave from which Newton's
method converges to the target, and the condition that fixes the target in Newton's method.  A
target is a name, "amplitude", "above" or "energy", and a value: the magnitude of the peak
elongation [m], m c^2 - V''(0) [N/m], or the energy [J].  Below, the magnitude of the peak
elongation of a wave is called its size.

m c^2 r = K V'(r) differentiated with respect to c gives (m c^2 - K V''(r)) r_c = -2 m c r, one
linear solve with the tangent of Newton's method.  As m c^2 times the integral of (du/dx)^2 is that
of r V', the energy is the integral of r V'/2 + V, so dH/dc = integral of (3 V' + r V'') r_c/2.
Source: G. Friesecke, R. Pego, Nonlinearity 15, 1343 (2002).
"""

from __future__ import annotations

import contextlib
import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.errors import ResolutionError, TensegrityError
from tensegrity.typing import Array
from tensegrity.waves.cosines import Series
from tensegrity.waves.family import SIGNS
from tensegrity.waves.multidomain import Integrals, Mesh
from tensegrity.waves.travelling import (
    NoWaveError,
    Profile,
    Scaled,
    amplitude_is,
    energy_is,
    solved,
    speed_is,
)

MOST = 1000  # largest number of a family of one sign
SEARCHES = 60  # steps of a search
NARROW = 5e-3  # width of the bracket in log size at which it contains the last wave of a family
SETTLED = 1e-12  # relative width of the bracket that is round-off
FRONT = 1 - 1e-7  # largest size, over that of a front
FACTOR = math.log(4.0)  # largest change of log(size/(end - size)) in a step of the search
CLOSE = 0.03  # relative distance from the target at which Newton's method is sure to converge


def near(family, name, value, mass):
    """A wave near a target.

    Parameters
    ----------
    family : Family
    name : {"amplitude", "above", "energy"}
    value : float
        Peak elongation in magnitude [m], m c^2 - V''(0) [N/m], or energy [J]; > 0.
    mass : float
        Of each site [kg], for messages.

    Returns
    -------
    profile : Profile
        A wave from which Newton's method converges to the target.
    condition : callable
        The condition that fixes the target, for `travelling.newton`.
    """
    return {"amplitude": _with_size, "above": _with_stiffness, "energy": _with_energy}[name](
        family, value, mass
    )


def _with_size(family, size, mass):
    def peak(profile):
        return abs(profile.law.reference)

    def describe(size):
        return f"peak {family.sign * size:.6g} m"

    if not family.sizes[0] <= size < family.rising_part.top:
        family.wave(size)  # raises an error with the reason
    profile = _search(
        family, lambda profile: math.log(peak(profile) / size), size, describe(size),
        lambda profile: describe(peak(profile)),
    )  # fmt: skip
    return profile, amplitude_is(size / peak(profile))


def _with_stiffness(family, above, mass):
    def describe(above):
        return f"speed {math.sqrt((family.rest + above) / mass):.6g} sites/s"

    def level(profile):
        return profile.nu * profile.law.secant

    part = family.rising_part
    if above >= part.ceiling and family.top_stiffness >= 0:
        raise TensegrityError(
            f"{describe(above)} must be below {describe(part.ceiling)}: the spring softens, and as "
            f"waves of {family.name} approach that speed they become plateaus of unbounded width"
        )
    if above <= part.floor:
        raise TensegrityError(
            f"{describe(above)} must be above {describe(part.floor)}, that of the front at which "
            f"the family before {family.name} ends"
        )

    def place(value):  # maps the open range of the family to the real line
        left = part.ceiling - value if family.ends_in_plateau else 1.0
        return math.log(value - part.floor) - math.log(left)

    def excess(profile):
        value = level(profile)
        if value <= part.floor or (family.ends_in_plateau and value >= part.ceiling):
            raise NoWaveError(f"a wave with {describe(value)} does not belong to {family.name}")
        return place(value) - place(above)

    start = _start(family, family.long_wave > above)
    profile = _search(
        family, excess, start, describe(above), lambda profile: describe(level(profile))
    )
    return profile, speed_is(above / profile.law.secant)


def _with_energy(family, target, mass):
    def joules(profile):
        return profile.energy * profile.law.reference * profile.law.force

    start = _start(family, 2 * (family.rest * family.sizes**2 / 2 + family.energy) > target)
    profile = _search(
        family, lambda profile: math.log(joules(profile) / target), start,
        f"energy {target:.6g} J", lambda profile: f"energy {joules(profile):.6g} J",
    )  # fmt: skip
    return profile, energy_is(target / (profile.law.reference * profile.law.force))


def _start(family, enough):
    """The smallest tabulated size at which a wave can exist and `enough` holds, or the last one."""
    inside = (family.sizes > family.rising_part.start) & (family.sizes < family.rising_part.top)
    rows = np.flatnonzero(enough & inside & (family.long_wave > family.rising_part.floor))
    return family.sizes[rows[0]] if rows.size else _last(family)


def _last(family):
    """Size of the largest wave of the search [m]; for peaks beyond a kink see `multidomain`."""
    return min(family.sizes[-1], FRONT * min(family.end, family.rising_part.top), family.kink)


def _search(family, excess, start, target, reached):
    """Secant steps in the size until |excess| < CLOSE; the excess must increase with the size.

    The steps are in log(a/(end - a)) of the size a, or in log a if there is no end.  If the family
    ends before the target, the message describes the last wave by `reached`.
    """
    largest, (place, size_at) = _last(family), _coordinate(min(family.end, family.rising_part.top))
    size, before = min(start, largest), None
    low, high = -math.inf, math.inf  # bracket of the wave's coordinate
    below = above = None  # waves computed at its ends
    reason = "the search did not converge"
    for _ in range(SEARCHES):
        here, profile, gap = place(size), None, None
        try:
            profile = family.wave(size)
            gap = excess(profile)
        except (NoWaveError, ResolutionError) as error:
            profile, reason = None, error
        if gap is not None and abs(gap) < CLOSE:
            return profile
        if below if gap is None else not gap < 0:  # without a wave: beyond those below
            high, above = min(high, here), profile or above
        else:
            low, below = max(low, here), profile or below
        one_sided = high - low < NARROW and not (below and above)
        if one_sided or (below and size == largest):
            raise _out_of_range(family, target, reached, below, above)
        if (gap is None and size == largest) or high - low < SETTLED * (1 + abs(high)):
            break
        new = _next(here, gap, before, low, high)
        before = (here, gap) if gap is not None else None
        size = min(size_at(new), largest)
    error = ResolutionError if isinstance(reason, ResolutionError) else TensegrityError
    raise error(f"{target}: no solitary wave of {family.name} found ({reason})")


def _coordinate(end):
    """The coordinate of a size in which the search steps, and its inverse."""
    if math.isinf(end):
        return math.log, math.exp
    return lambda size: math.log(size / (end - size)), lambda new: end / (1 + math.exp(-new))


def _next(here, gap, before, low, high):
    """The next coordinate: a secant step from `here` and the one before, an outward step if there
    is no wave at `here`, or a bisection if the step leaves the bracket."""
    slope, step = 1.0, FACTOR
    if gap is not None:
        if before and before[0] != here:
            slope = max((gap - before[1]) / (here - before[0]), 0.2)
        step = max(-FACTOR, min(FACTOR, -gap / slope))
    if low < here + step < high:
        return here + step
    return (low + high) / 2 if math.isfinite(high - low) else here + step / 8


def _out_of_range(family, target, reached, below, above):
    """The error for a target beyond the smallest or largest wave of the family."""
    side, profile, last = ("above", below, "largest") if below else ("below", above, "smallest")
    range_ = f"the {last} found before the end of the domain or of the family"
    if last == "smallest":
        with contextlib.suppress(TensegrityError):
            range_ += f"; the largest has {reached(family.wave(_last(family)))}"
    return TensegrityError(
        f"no solitary wave of {family.name} with {target}: it is {side} {reached(profile)}, that "
        f"of the wave with a peak of {profile.law.reference:.6g} m, {range_}"
    )


def stiffness_above(name, value, sound, mass, rest):
    """m c^2 - V''(0) of a wave with a given speed.

    Parameters
    ----------
    name : {"speed", "speed_ratio", "excess"}
    value : float
        Speed [sites/s], speed over sound speed, or that ratio minus 1.
    sound : float
        Sound speed [sites/s].
    mass : float
        Of each site [kg].
    rest : float
        V''(0) [N/m].

    Returns
    -------
    float
        [N/m], > 0.

    Raises
    ------
    TensegrityError
        A speed that is not above the sound speed, or a ratio in a sonic vacuum.
    """
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
            f"speed {speed:g} must be above {sound:g} sites/s, the sound speed: slower waves "
            "have no decaying tail"
        )
    stiffness = mass * speed * speed
    if not (above > 0 and stiffness < math.inf):
        raise TensegrityError(
            f"speed {float(speed)} sites/s gives m c^2 = {float(stiffness)} N/m, must be a "
            f"number above the stiffness at rest, {rest} N/m"
        )
    return above


def sign_and_number(potential, family, amplitude):
    """The sign and the number of the family that contains a wave.

    Parameters
    ----------
    potential : Potential
    family : str or None
        "compression" or "rarefaction", with a number from the second family on.
    amplitude : float or None
        Peak elongation [m], if that is the target.

    Returns
    -------
    sign : {-1, 1}
        Sign of the elongation.
    number : int or None
        Index of the family from 0; None if `family` has no number.

    Raises
    ------
    TensegrityError
        An unknown family, or an amplitude that is 0, outside the domain, or of the other sign.
    """
    number = None
    if family is not None:
        word, _, rest = family.partition(" ") if isinstance(family, str) else ("", "", "")
        if word not in SIGNS or not (rest == "" or (rest.isdecimal() and 0 < int(rest) <= MOST)):
            raise TensegrityError(
                f"family {check.shown(family)} must be one of {', '.join(SIGNS)}, with a number "
                "from the second family on"
            )
        family, number = word, int(rest) - 1 if rest else None
    if amplitude is None:
        resists = float(potential.stiffness(0.0)) > 0
        rising_parts = resists and float(potential.derivative(3, 0.0)) > 0
        return SIGNS[family or ("rarefaction" if rising_parts else "compression")], number
    if amplitude == 0:
        raise TensegrityError("amplitude 0 m must not be 0")
    sign = int(math.copysign(1, amplitude))
    if family and SIGNS[family] != sign:
        raise TensegrityError(
            f"amplitude {amplitude:g} m has the wrong sign for family {family!r}: compression < 0"
        )
    if not potential.domain[0] < amplitude < potential.domain[1]:
        potential.tension(amplitude)  # raises an error that names the end of the domain
    return sign, number


ACCURACY = 1e-13  # of the linear solve on large grids


def by_speed(wave: Any) -> tuple[float, Series | Integrals]:
    """dH/dc and the derivative of the shape with respect to the speed.

    Parameters
    ----------
    wave : SolitaryWave

    Returns
    -------
    slope : float
        [J s/site]
    shape : Series or Integrals
        Derivative of displacement, rate and elongation [m s/site].
    """
    if wave._shape.rate(0.0).ndim:
        raise TensegrityError("dH/dc of waves with several components is not computed")
    derivative = _on_mesh if isinstance(wave._shape, Integrals) else _on_grid
    return derivative(wave, wave.mass * wave.speed**2)


def _on_grid(wave: Any, squared: float) -> tuple[float, Series]:
    """`by_speed` of a Fourier series; `squared` is m c^2 [N/m]."""
    law, grid = Scaled(wave.potential, wave.amplitude), wave._shape.grid
    rho = grid.values(wave._shape.rates * grid.box) / wave.amplitude
    gain = math.expm1(2 * math.log1p(wave.excess))  # of m c^2 over the stiffness at rest
    nu = law.rest * gain if law.rest else squared / law.secant
    profile = Profile(law, grid, rho, nu)
    unit = np.zeros(len(rho) + 1)
    unit[-1] = 2 * squared / (wave.speed * law.secant * nu)  # d log(nu)/dc
    rho_c = solved(profile, speed_is(nu), unit, ACCURACY)[:-1]
    energy = profile.energy
    slope = energy_is(energy)(profile)[1] @ rho_c * energy * law.reference * law.force
    stiffness = law.secant * (law.rest + law.slope(rho))
    tension = grid.coefficients(stiffness * law.reference * rho_c)
    rates = grid.box * tension / squared - 2 / wave.speed * wave._shape.rates
    return float(slope), Series(grid, rates)


def _on_mesh(wave: Any, squared: float) -> tuple[float, Integrals]:
    """`by_speed` of a wave with a kink."""
    mesh: Mesh = wave._shape.mesh
    tension = wave._shape.values * squared
    r = mesh.mean @ wave._shape.values
    stiffness = np.asarray(wave.potential.stiffness(r))
    tangent = -mesh.mean * stiffness
    tangent.flat[:: len(r) + 1] += squared
    r_c = np.linalg.solve(tangent, -2 * wave.mass * wave.speed * r)
    slope = mesh.weights @ ((3 * tension + r * stiffness) * r_c) / 2
    return float(slope), Integrals(
        mesh, stiffness * r_c / squared - 2 / wave.speed * wave._shape.values
    )


def neutral_motions(wave: Any, x: ArrayLike) -> Array:
    """The perturbations that a wave neither amplifies nor damps: its shift, and its change with
    the speed.

    Parameters
    ----------
    wave : SolitaryWave
    x : array_like, (n,)
        Distances of sites from the peak, in sites.

    Returns
    -------
    ndarray, (2, 2, n)
        Displacement and velocity of the shift (d/dx), then of the change (d/dc).
    """
    x = check.numbers("x", x, "sites")
    rate, change = wave.rate(x), wave._by_speed[1]
    before, after = (wave.potential.tension(wave.elongation(x + side)) for side in (-0.5, 0.5))
    bend = (after - before) / (wave.mass * wave.speed**2)
    shift = rate, -wave.speed * bend
    return np.array([shift, (change.displacement(x), -rate - wave.speed * change.rate(x))])
