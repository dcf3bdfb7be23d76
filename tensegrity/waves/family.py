"""Families of solitary waves of one sign: their existence, and the wave of a given peak.

The waves of a family are ordered by the magnitude of the peak elongation, here called the size, and
speed and energy increase along it.  `by_target` samples the family on coarse grids, which takes
milliseconds per wave, until a wave is near the target; this one is then solved to round-off.
"""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np

from tensegrity.errors import ResolutionError, TensegrityError
from tensegrity.root import polynomial_through
from tensegrity.waves.asymptotics import decay_rate
from tensegrity.waves.cosines import Grid, cosine_sum
from tensegrity.waves.nonlinear_part import nonlinear_part, rising_parts
from tensegrity.waves.travelling import (
    NoWaveError,
    Profile,
    Scaled,
    amplitude_is,
    initial_profile,
    newton,
)

SIGNS = {"compression": -1, "rarefaction": 1}  # of the elongation
LEAST = 2.0**-52  # size over the spring's scale at which the speed rounds to the sound speed
LEAST_OF_END = 2.0**-30  # smallest size over the domain for a spring without a scale
MOST_BINADES = 1023  # of the table for an unbounded domain
SMALLEST = np.finfo(float).tiny  # smallest normal number
PER_BINADE = 6  # sizes per factor of 2 in the table
CLOSER = 34  # sizes between the last at which the spring resists and the next
TINY = 2.0**-1000  # m: smallest size in the table of a spring without a scale
ROUGH = 1e-4  # residual, and last Newton step, during the search
FIRST_POINTS, MOST_POINTS = 192, 32768  # of the grid
ROUGH_TAIL, TAIL = 1e-8, 1e-17  # expected elongation at the end of the grid, over the peak
TAIL_LEFT = 1e-14  # largest computed elongation there, over the peak
NO_TAIL = 1e-2  # the same on the longest grid, above which the wave is not solitary
LONGEST = 8  # half-length over that of the linear tail, during the search
CORE = 3.0  # sites within which a wave has decayed to its linear tail
FLAT = 0.02  # relative distance to a front below which a wave is extended from one farther away
STROKE = 0.9995  # fraction of the stroke in which waves are sought
NO_STIFFNESS = 1e-12  # stiffness at a front over m c^2 that is round-off
NEAREST = 2.0**-20  # distance from a wall, over the stroke, at which its force is evaluated
AT_END = 2.0**-36  # the same for a wave at the end of a domain with finite force
STEADY = 0.02  # tolerance on the exponent of the force at a wall
FIRST_LAG, LAGS = 1e-6, 4001  # first distance from the peak over that of the decay of V; nodes
ROUND_OFF = 1e-13  # distance from the peak, over it, below which differences of V are round-off
NODES = 6  # waves of an extrapolation; the remaining stroke doubles from one to the next


class Family:
    """Waves of one sign, ordered by the size a > 0 [m], the magnitude of the peak elongation.

    They belong to one rising part of Q = 2V/r^2 (`nonlinear_part`), by default the first.
    """

    def __init__(self, potential, sign, number=0) -> None:
        self.potential, self.sign = potential, sign
        self.name = next(name for name, s in SIGNS.items() if s == sign)
        self.end = sign * potential.domain[int(sign > 0)]
        self.nonlinear = nonlinear_part(potential)
        self.rest, self.power = self.nonlinear.rest, self.nonlinear.growth(sign)[0]
        self.sizes, self.gain, self.energy, self.stiffness = self._table()
        self.secant = self.rest + self.gain  # |V'|/a
        self.rising_parts = rising_parts(self.nonlinear, sign, self.sizes)
        self._check_existence()
        if number >= len(self.rising_parts):
            raise TensegrityError(
                f"no solitary wave of {self.name} {number + 1}: 2V/r^2 exceeds its earlier values "
                f"{len(self.rising_parts)} times only"
            )
        self.rising_part = self.rising_parts[number]
        self.name += f" {number + 1}" if number else ""
        self.long_wave = self.long_wave_at(self.sizes)

    def holding(self, name, value):
        """The family of this sign that contains a target of `by_target`; else the last one."""
        number = next(
            (k for k, part in enumerate(self.rising_parts) if value < part.bound(name)),
            len(self.rising_parts) - 1,
        )
        same = self.rising_part is self.rising_parts[number]
        return self if same else Family(self.potential, self.sign, number)

    def force(self, size):
        """|V'| [N] at elongations of given size [m]."""
        return self.rest * size + self.sign * self.nonlinear.tension(self.sign * size)

    def slope(self, size):
        """V'' [N/m] at elongations of given size [m]."""
        return self.rest + self.nonlinear.stiffness(self.sign * size)

    def stored(self, size):
        """V - V(0) [J] at elongations of given size [m]."""
        return self.rest * size * size / 2 + self.nonlinear.energy(self.sign * size)

    def _table(self):
        """Sizes a up to the end of the domain, |V'|/a - V''(0), V - V''(0) a^2/2 and V'' there, as
        far as the spring resists and all values are finite; (4, n)."""
        scale = min(self.nonlinear.scale, self.end)
        least = (LEAST if math.isfinite(self.nonlinear.scale) else LEAST_OF_END) * scale
        if math.isinf(self.end):
            first = math.log2(TINY) if math.isinf(least) else math.log2(least)
            sizes = 2.0 ** (np.arange(PER_BINADE * (MOST_BINADES - first)) / PER_BINADE + first)
        else:
            near = 2.0 ** -(np.arange(4, -math.log2(least / self.end), 1 / PER_BINADE))
            far = 1 - np.logspace(0, math.log10(1 - STROKE), 161)
            sizes = self.end * np.sort(np.concatenate([near, far[far > 1 / 16]]))
        rows, good = self._rows(sizes)
        # without a scale the energies of the smallest elongations underflow
        first = 0 if math.isfinite(self.nonlinear.scale) else int(np.argmax(good))
        last = len(good) if good[first:].all() else first + int(np.argmin(good[first:]))
        rows = rows[:, first:last]
        if first < last < len(good):  # Q may have its maximum close to where the force ends
            closer, good = self._rows(np.linspace(sizes[last - 1], sizes[last], CLOSER)[1:-1])
            rows = np.hstack([rows, closer[:, : len(good) if good.all() else int(np.argmin(good))]])
        if rows.shape[1] < 2:
            raise TensegrityError(
                f"no solitary wave of {self.name}: this spring does not resist {self.name}"
            )
        return rows

    def _rows(self, sizes):
        """Rows of the table, and whether the spring resists and all values are finite."""
        r = self.sign * sizes
        with np.errstate(all="ignore"):
            gain = self.nonlinear.tension(r) / r
            rows = np.array(
                [sizes, gain, self.nonlinear.energy(r), self.potential.derivative(2, r)]
            )
            energy = (self.rest + gain) * sizes**2
            return rows, np.isfinite(rows).all(axis=0) & np.isfinite(energy) & (energy > SMALLEST)

    def long_wave_at(self, size):
        """m c^2 - V''(0) [N/m] by the long-wave equation for peaks of given size; not positive if
        there is no wave.

        The equation m c^2 r = T + T''/12, T = V'(r), has the first integral
        T'^2/24 = m c^2 (r T - V) - T^2/2, which vanishes at the peak.
        """
        r = self.sign * size
        gain = self.nonlinear.tension(r) / r
        unit = self.rest + np.abs(gain)
        gain, rest = gain / unit, self.rest / unit
        energy = 2 * self.nonlinear.energy(r) / size / size / unit
        twice = rest + 2 * gain - energy  # 2 (r T - V)/a^2: not positive where the spring softens
        good = (twice > 0) & (gain > 0)
        above = (rest * energy + gain**2) / np.where(good, twice, 1.0)
        return np.where(good, above * unit, -self.rest)

    def _check_existence(self):
        """Require V'(r)/r > V''(0) for some r, as a wave has at its peak: m c^2 |r| = |K V'| is at
        most max |V'| there, and the tail decays only if c > cs."""
        secant = self.secant
        grows = self.gain.max() > 1e-9 * self.rest and secant.max() > secant[0] * (1 + 1e-9)
        if not (grows and self.rising_parts):
            raise TensegrityError(
                f"no solitary wave of {self.name}: V'(r)/r does not exceed its value at rest, "
                f"{secant[0]:g} N/m (at the end it is {secant[-1]:g} N/m), as a wave with a "
                "decaying tail requires at its peak"
            )

    @cached_property
    def rough_tension(self):
        """|V'| [N] as a function of the size, interpolated in logarithms; positive."""
        a = self.sizes
        x, y = np.log(a), np.log(self.secant) + np.log(a)
        slope = self.stiffness / self.secant

        def tension(size):
            place = np.log(np.maximum(size, SMALLEST))
            inside = np.maximum(place, x[0])
            i = np.clip(np.searchsorted(x, inside, side="right"), 1, len(x) - 1)
            width = x[i] - x[i - 1]
            u = (inside - x[i - 1]) / width
            w = 1 - u
            cubic = w * w * (1 + 2 * u) * y[i - 1] + u * u * (1 + 2 * w) * y[i]
            cubic = cubic + width * u * w * (w * slope[i - 1] - u * slope[i])
            return np.exp(cubic + slope[0] * (place - inside))

        return tension

    def wave(self, size):
        """The wave of a given size [m] on a coarse grid."""
        if size < self.sizes[0]:
            why = "the speed is the sound speed" if self.rest else "the energy is 0"
            raise NoWaveError(
                f"peak {self.sign * size:g} m must be at least {self.sizes[0]:g} m in size: {why} "
                "to round-off"
            )
        if size >= self.rising_part.top:
            flat = f", and towards it waves of {self.name} become plateaus of unbounded width"
            flat = flat if self.top_stiffness >= 0 else ""
            raise NoWaveError(
                f"peak {self.sign * size:g} m must be below {self.rising_part.top:g} m in size, "
                f"where 2V/r^2 is largest: the spring softens{flat}"
            )
        law = Scaled(self.potential, self.sign * size)
        if size > (1 - FLAT) * self.rising_part.top and self.ends_in_plateau:
            return self._near_front(law)
        nu = float(self.long_wave_at(size)) / law.secant
        points, length = FIRST_POINTS, 0.0
        while points <= MOST_POINTS:
            if not nu > 0:
                raise NoWaveError(
                    f"no solitary wave of {self.name} with a peak of {self.sign * size:g} m: its "
                    "speed would be below the sound speed"
                )
            needed = half_length(law, nu, ROUGH_TAIL)
            if needed > 1.2 * length:
                length, decay = needed, -math.log(ROUGH_TAIL) / (needed - CORE)
                decay, grid = min(decay, 2.5), Grid(points, length)
                profile = initial_profile(law, grid, decay, self._rough(size), nu, self.power)
            else:
                profile = profile.on(Grid(points, length))
            profile = newton(profile, amplitude_is(1.0), ROUGH)
            nu = profile.nu
            if profile.tail > ROUGH and length < LONGEST * needed:
                length *= 2  # the core is wide if the force is only slightly nonlinear
            elif profile.tail > NO_TAIL:
                raise NoWaveError(f"no localised wave with a peak of {self.sign * size:g} m")
            elif profile.defect() < ROUGH:
                return profile
            points *= 2
        raise _unresolved(law)

    @property
    def ends_in_plateau(self):
        """Whether the family ends at a front that its waves approach as plateaus."""
        return math.isfinite(self.rising_part.top) and self.top_stiffness > 0

    @property
    def top_stiffness(self):
        return self.stiffness_from_top(1.0)

    def stiffness_from_top(self, part):
        """V'' [N/m] at `part` times the size at which 2V/r^2 is largest; 0 if it is round-off."""
        k = float(self.potential.stiffness(self.sign * part * self.rising_part.top))
        return k if abs(k) > NO_STIFFNESS * (self.rest + self.rising_part.ceiling) else 0.0

    @cached_property
    def _with_plateau(self):
        """A wave with the onset of a plateau."""
        return self.wave((1 - FLAT) * self.rising_part.top)

    def _near_front(self, law):
        speed_squared = (self.rest + self.rising_part.ceiling) / self.top_stiffness
        start = _lengthened(
            self._with_plateau, law, self.rising_part, decay_rate(speed_squared - 1)
        )
        while start.grid.points <= MOST_POINTS:
            profile = newton(start, amplitude_is(1.0), ROUGH)
            if profile.defect() < ROUGH:
                return profile
            start = profile.on(Grid(2 * profile.grid.points, profile.grid.half_length))
        raise _unresolved(law)

    def _rough(self, size):
        """f of `Scaled`, interpolated; not finite at large arguments of a diverging iteration."""

        @np.errstate(over="ignore", invalid="ignore")
        def f(rho):
            return self.rough_tension(size * rho) / self.rough_tension(size)

        return f

    def exponent_at_end(self, part):
        """y V''/|V'| at the distance y = `part` times the stroke from the end of the domain: n + 1
        for V ~ y^-n, 0 for a finite force."""
        y = part * self.end
        r = self.sign * (self.end - y)
        return float(y * self.potential.derivative(2, r) / abs(self.potential.derivative(1, r)))

    @property
    def kink(self):
        """Size of the elongation at the first kink of the force on this side [m]; inf if none."""
        places = [self.sign * place for place, *_ in self.potential.kinks]
        return min((place for place in places if place > 0), default=math.inf)

    @cached_property
    def finite_at_end(self):
        """Whether the force is finite at the end of the domain, even if a wall is just beyond."""
        nearest = self.exponent_at_end(AT_END)
        return nearest < max(STEADY, self.exponent_at_end(NEAREST) / 2)

    def stiffness_at_end(self, closest):
        """Limit of m c^2 [N/m] as the peak approaches the end of the domain: of a wave there if the
        force is finite, else extrapolated in the square root of the remaining stroke."""
        finite = self.finite_at_end
        left = np.array([AT_END]) if finite else closest * 2.0 ** np.arange(NODES)
        values = []
        for part in left.tolist():
            law = Scaled(self.potential, self.sign * self.end * (1 - part))
            try:
                near = self.wave(abs(law.reference))
                profile, _ = refined(near, amplitude_is(1.0))
            except (NoWaveError, ResolutionError):
                peak = math.nextafter(self.end, 0.0) if finite else abs(law.reference)
                return self._collision(peak)
            values.append(profile.mu * law.secant)
        return values[0] if finite else polynomial_through(np.sqrt(left), np.array(values))(0.0)

    def _collision(self, peak):
        """m c^2 [N/m] of a wave far above the sound speed, in which masses collide in pairs.

        The relative velocity of a pair is c sigma, with (c sigma)^2 = 4 V/m at the peak; sigma is
        the size of the peak plus the lag of the bond behind free flight; `derivations.softening`.
        """
        stored = float(self.stored(peak))
        near = stored / abs(float(self.potential.tension(self.sign * peak)))  # decay length of V
        y = np.geomspace(max(FIRST_LAG * near, ROUND_OFF * peak), peak, LAGS)
        lag = y * (1 / np.sqrt(1 - self.stored(peak - y) / stored) - 1)
        sigma = peak + 2 * math.sqrt(y[0] * near) + float(np.trapezoid(lag, np.log(y)))
        return 4 * stored / sigma**2


def _lengthened(wave, law, rising_part, rate):
    """An approximate profile with the peak `law.reference`, closer to the front than `wave`.

    On its plateau between two fronts such a wave is the state of the front minus gap cosh(k x),
    with the `rate` k per site at which small deviations from that state grow in the linear lattice.
    A smaller gap therefore lengthens the plateau and changes little else; `derivations.softening`.
    """
    far, near = (rising_part.top - abs(x.reference) for x in (wave.law, law))  # gaps
    longer = math.log(far / near) / rate
    length = wave.grid.half_length + longer
    grid = Grid(math.ceil(wave.grid.points * length / wave.grid.half_length), length)
    place = grid.x - longer
    outside = np.maximum(place, 0.0)
    series = wave.grid.coefficients(wave.rho * abs(wave.law.reference))
    slope = rising_part.top - cosine_sum(series, wave.grid.wave_numbers, outside)
    slope += near / 2 * np.exp(-rate * grid.x) - far / 2 * np.exp(-rate * outside)
    top = near * np.cosh(rate * np.minimum(grid.x, longer))
    rho = (rising_part.top - np.where(place < 0, top, slope)) / abs(law.reference)
    left = (rising_part.ceiling - wave.nu * wave.law.secant) * (near / far) ** 2
    return Profile(law, grid, rho, (rising_part.ceiling - left) / law.secant)


def _unresolved(law):
    peak = f"the wave with a peak of {law.reference:.9g} m"
    return ResolutionError(f"{MOST_POINTS} points do not resolve {peak}")


def half_length(law, nu, tail=TAIL):
    """Distance from the peak at which a wave has decayed to a fraction of it.

    Parameters
    ----------
    law : Scaled
    nu : float
        Scaled m c^2 - V''(0); see `travelling`.
    tail : float, optional
        The fraction.

    Returns
    -------
    float
        Sites.
    """
    return law.boxed(CORE - math.log(tail) / min(law.decay(nu), law.steepest), nu)


def refined(profile, condition):
    """Solve on longer and finer grids until tail and residual are round-off."""
    law = profile.law
    length = half_length(law, profile.nu)
    density = profile.grid.points / profile.grid.half_length
    previous = tail = defect = largest = math.inf
    while (points := _even(length * density)) <= MOST_POINTS:
        profile = newton(profile.on(Grid(points, length)), condition)
        defect = profile.defect()
        target, largest = profile.admitted()
        if defect <= target or previous / 4 < defect <= largest:
            round_off = 4 * np.finfo(float).eps
            if profile.tail <= TAIL_LEFT + round_off or profile.tail > tail / 2:
                return profile, profile.residual()
            tail, length = profile.tail, law.boxed(1.3 * length, profile.nu)
        else:
            previous, density = defect, 2 * density
    raise ResolutionError(
        f"residual {defect:.1e} with {profile.grid.points} points must be at most {largest:g}: "
        f"the wave with a peak of {law.reference * profile.rho.flat[0]:.9g} m is not resolved"
    )


def _even(points):
    """The next length for which a cosine transform is fast: a product of powers of 2, 3 and 5."""
    length = math.ceil(points)
    while True:
        left = length
        for factor in (2, 3, 5):
            while left % factor == 0:
                left //= factor
        if left == 1:
            return length
        length += 1
