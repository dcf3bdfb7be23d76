"""The wave of a family with a given crest, speed or energy, roughly: a search along the family.

Speed and energy rise with the size of the crest.  Each function gives a wave from which Newton's
method reaches the one that is asked for, and the condition that holds that one.
"""

from __future__ import annotations

import contextlib
import math

import numpy as np

from tensegrity.errors import ResolutionError, TensegrityError
from tensegrity.waves.travelling import NoWave, amplitude_is, energy_is, speed_is

SEARCHES = 60
NARROW = 5e-3  # step in the logarithm of a size at which the last wave of a family is told
FRONT = 1 - 1e-7  # part of the size of a front
FACTOR = 4.0  # largest change of amplitude/(stroke left) in a step of the search
CLOSE = 0.03  # relative distance from which Newton's method is trusted to reach the target


def with_size(family, size):
    """A wave near, and the condition, for a crest of that size [m]."""

    def crest(profile):
        return abs(profile.law.reference)

    def reached(profile):
        return f"crest {family.sign * crest(profile):.6g} m"

    if not family.sizes[0] <= size < family.rise.top:
        family.wave(size)  # says why not
    profile = _search(
        family, lambda profile: math.log(crest(profile) / size), size,
        f"crest {family.sign * size:.6g} m", reached,
    )  # fmt: skip
    return profile, amplitude_is(size / crest(profile))


def with_stiffness(family, above, mass):
    """A wave near, and the condition, for m c^2 - V''(0) = above [N/m]."""

    def say(above):
        return f"speed {math.sqrt((family.rest + above) / mass):.6g} sites/s"

    rise = family.rise
    if above >= rise.ceiling and family.top_stiffness >= 0:
        raise TensegrityError(
            f"{say(above)} must be below {say(rise.ceiling)}: the spring softens, and as "
            f"waves of {family.name} approach that speed their tops grow flat and endless"
        )
    if above <= rise.floor:
        raise TensegrityError(
            f"{say(above)} must be above {say(rise.floor)}, that of the front at which the "
            f"waves before those of {family.name} end"
        )

    def reached(profile):
        return say(profile.nu * profile.law.secant)

    def place(value):  # from -inf to inf within the family
        left = rise.ceiling - value if family.flattens else 1.0
        return math.log(value - rise.floor) - math.log(left)

    def excess(profile):
        value = profile.nu * profile.law.secant
        if value <= rise.floor or (family.flattens and value >= rise.ceiling):
            raise NoWave(f"a wave with {say(value)} is none of {family.name}")
        return place(value) - place(above)

    start = _start(family, family.long_wave > above)
    profile = _search(family, excess, start, say(above), reached)
    return profile, speed_is(above / profile.law.secant)


def with_energy(family, target):
    """A wave near, and the condition, for an energy [J]."""

    def joules(profile):
        return profile.energy * profile.law.reference * profile.law.force

    def reached(profile):
        return f"energy {joules(profile):.6g} J"

    stored = family.rest * family.sizes**2 / 2 + family.energy
    profile = _search(
        family, lambda profile: math.log(joules(profile) / target),
        _start(family, 2 * stored > target), f"energy {target:.6g} J", reached,
    )  # fmt: skip
    return profile, energy_is(target / (profile.law.reference * profile.law.force))


def _start(family, enough):
    """The first size at which a wave may exist and has enough of something, or the last."""
    inside = (family.sizes > family.rise.start) & (family.sizes < family.rise.top)
    found = np.flatnonzero(enough & inside & (family.long_wave > family.rise.floor))
    return family.sizes[found[0]] if found.size else _last(family)


def _last(family):
    """Size of the largest wave that is looked for [m]: crests beyond corners, see `pieces`."""
    return min(family.sizes[-1], FRONT * min(family.end, family.rise.top), family.corner)


def _search(family, excess, start, asked, reached):
    """Secant steps in the size until |excess| < CLOSE; excess must rise with the size.

    Steps are those of log(a/(end - a)), or log a where there is no end.  Where waves end on the
    way, the last one found is told by `reached`.
    """
    largest, end = _last(family), min(family.end, family.rise.top)

    def coordinate(size):
        return math.log(size) if math.isinf(end) else math.log(size / (end - size))

    def size_at(value):
        return math.exp(value) if math.isinf(end) else end / (1 + math.exp(-value))

    size, before = min(start, largest), None
    low, high = -math.inf, math.inf  # coordinates between which the wave must lie
    below = above = None  # waves found there
    reason = "the search did not settle"
    for _ in range(SEARCHES):
        here = coordinate(size)
        try:
            profile = family.wave(size)
            gap = excess(profile)
        except (NoWave, ResolutionError) as error:
            gap, reason = None, error
        if gap is not None and abs(gap) < CLOSE:
            return profile
        if gap is None and below:
            high = min(high, here)
        elif gap is None or gap < 0:
            low, below = max(low, here), below if gap is None else profile
        else:
            high, above = min(high, here), profile
        if below and (size == largest or (not above and high - low < NARROW)):
            raise _beyond(family, asked, "above", reached, below, "largest")
        if above and not below and high - low < NARROW:
            raise _beyond(family, asked, "below", reached, above, "smallest")
        if (gap is None and size == largest) or high - low < 1e-12 * (1 + abs(high)):
            break
        slope = 1.0
        if before and gap is not None and before[0] != here:
            slope = max((gap - before[1]) / (here - before[0]), 0.2)
        step = math.log(FACTOR) if gap is None else -gap / slope
        step = max(-math.log(FACTOR), min(math.log(FACTOR), step))
        new = here + step
        if not low < new < high:
            new = (low + high) / 2 if math.isfinite(high - low) else here + step / 8
        before = (here, gap) if gap is not None else None
        size = min(size_at(new), largest)
    error = ResolutionError if isinstance(reason, ResolutionError) else TensegrityError
    raise error(f"{asked}: no solitary wave of {family.name} found ({reason})")


def _beyond(family, asked, side, reached, profile, last):
    """The error for what lies beyond the last wave found on one side."""
    range_ = f"the {last} found before the end of the domain or of the family"
    if last == "smallest":
        with contextlib.suppress(TensegrityError):
            range_ += f"; its largest has {reached(family.wave(_last(family)))}"
    return TensegrityError(
        f"no solitary wave of {family.name} with {asked}: it is {side} {reached(profile)}, that "
        f"of the wave with a crest of {profile.law.reference:.6g} m, {range_}"
    )
