"""The family of solitary waves of one sign: whether there is one, and the wave asked for.

Waves of a family are ordered by the size of the crest's elongation, with speed and energy rising
along it.  It is sampled by `travelling` on coarse grids, which takes milliseconds a wave, until
one is near what is asked; that one is then solved to round-off.
"""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np

from tensegrity.errors import ResolutionError, TensegrityError
from tensegrity.travelling import (
    Grid,
    NoWave,
    Scaled,
    amplitude_is,
    decay_rate,
    energy_is,
    solved,
    speed_is,
    started,
)

SIGNS = {"compression": -1, "rarefaction": 1}  # of the elongation
TARGET, LARGEST = 2e-13, 1e-12  # residual aimed at, and the largest that is returned
HUGE = 1e70  # forces, energies whose cubes are still numbers
NOT_SMALL = 1e-3  # relative excess from which differences of tensions are taken
ROUGH = 1e-4  # residual, and Newton's last step, while a wave is sought
FIRST_POINTS, MOST_POINTS = 192, 32768
ROUGH_TAIL, TAIL = 1e-8, 1e-17  # of the crest, expected at the end of the grid
TAIL_LEFT = 1e-14  # of the crest, found there
NO_TAIL = 1e-2  # of the crest, left at the end of the longest grid: it is no solitary wave
LONGEST = 8  # half-length over what the linear tail needs, while a wave is sought
CORE = 3.0  # sites in which a wave has fallen to its linear tail
SLOWEST_DECAY = 6.0  # per site: faster tails are over within the core
FRONT = 1 - 1e-6  # part of the size of a front
STROKE = 0.9995  # part of the stroke to the end of the domain that a wave is looked for in
CLOSE = 0.03  # relative distance from which Newton's method is trusted to reach the target
SEARCHES = 60
NODES = 6  # waves, the stroke left halved from one to the next, from which a limit is taken
FACTOR = 4.0  # largest change of amplitude/(stroke left) in a step of the search


class Family:
    """The waves of one sign: a family, ordered by the size a > 0 [m] of the crest's elongation."""

    def __init__(self, potential, sign):
        self.potential, self.sign = potential, sign
        self.name = next(name for name, s in SIGNS.items() if s == sign)
        self.end = sign * potential.domain[int(sign > 0)]
        self.rest = float(potential.stiffness(0.0))
        self.sizes, self.tension, self.energy, self.stiffness = self._table()
        self.largest = self.sizes[-1]
        self.excess, self.long_wave = self._excess()
        self._check_existence()

    def _table(self):
        """Sizes up to the end of the domain, |V'|, V and V'' there, while the spring resists and
        all is finite; (4, n)."""
        if math.isinf(self.end):
            sizes = np.logspace(-15, 9, 481)
        else:
            near, far = np.logspace(-9, -1, 161), 1 - np.logspace(0, math.log10(1 - STROKE), 161)
            sizes = self.end * np.sort(np.concatenate([near, far[far > 0.1]]))
        r = self.sign * sizes
        with np.errstate(all="ignore"):
            rows = [sizes, self.sign * self.potential.tension(r), self.potential.energy(r)]
            rows = np.array([*rows, self.potential.stiffness(r)])
            good = (np.abs(rows) < HUGE).all(axis=0) & (rows[1] > 0)
        rows = rows[:, : len(sizes) if good.all() else int(np.argmin(good))]
        if rows.shape[1] < 2:
            raise TensegrityError(
                f"no solitary wave of {self.name}: this spring does not resist {self.name}"
            )
        return rows

    def _excess(self):
        """|V'| - V''(0) a [N], and m c^2 - V''(0) [N/m] of the long-wave equation, at `sizes` a.

        The equation m c^2 r = T + T''/12, T = V'(r), has the integral
        T'^2/24 = m c^2 (r T - V) - T^2/2, which vanishes at the crest.  For small waves the
        excess over the linear law comes from V'' - V''(0): a plain difference would be round-off.
        """
        from scipy.integrate import cumulative_trapezoid

        a, rest = self.sizes, self.rest
        gain = self.stiffness - rest

        def extra(direct, integrand, linear):
            integral = cumulative_trapezoid(integrand, a, initial=0) + integrand[0] * a[0] / 2
            return np.where(np.abs(integral) > NOT_SMALL * linear, direct, integral)

        first = extra(self.tension - rest * a, gain, rest * a)
        second = extra(a * self.tension - self.energy - rest * a**2 / 2, a * gain, rest * a**2 / 2)
        twice = rest * a**2 + 2 * second  # 2 (r T - V): not positive where the spring gives way
        excess = 2 * rest * (a * first - second) + first**2
        good = (twice > 0) & (first > 0)
        return first, np.where(good, excess / np.where(good, twice, 1.0), -rest)

    def _check_existence(self):
        """A wave needs V'(r)/r > V''(0) at its crest: m c^2 |r| = |K V'| is at most max |V'| there,
        and c > cs for a tail that decays."""
        secant = self.rest + self.excess / self.sizes
        grows = secant.max() > secant[0] * (1 + 1e-9)
        if not (grows and self.long_wave.max() > 1e-9 * self.rest):
            raise TensegrityError(
                f"no solitary wave of {self.name}: V'(r)/r does not rise above its value at rest, "
                f"{secant[0]:g} N/m (beyond, it is {secant[-1]:g} N/m), but a wave whose tail "
                "decays needs more at its crest"
            )

    @cached_property
    def rough_tension(self):
        """|V'| [N] as a function of the size, interpolated in logarithms; positive."""
        from scipy.interpolate import CubicHermiteSpline

        slope = self.sizes * self.stiffness / self.tension
        spline = CubicHermiteSpline(np.log(self.sizes), np.log(self.tension), slope)
        return lambda size: np.exp(spline(np.log(np.maximum(size, self.sizes[0]))))

    def wave(self, size):
        """The wave of that size, roughly resolved."""
        if size >= self.front[0]:
            raise NoWave(
                f"crest {self.sign * size:g} m must be below {self.front[0]:g} m in size: the "
                f"spring softens, and as waves of {self.name} approach that their tops grow flat "
                "and endless"
            )
        law = Scaled(self.potential, self.sign * size)
        above = np.interp(math.log(size), np.log(self.sizes), self.long_wave)
        mu = law.rest + above * law.reference / law.force
        points, length = FIRST_POINTS, 0.0
        while points <= MOST_POINTS:
            if not mu > law.rest:
                raise NoWave(
                    f"no solitary wave of {self.name} with a crest of {self.sign * size:g} m: it "
                    "would be slower than sound"
                )
            needed = _half_length(mu / law.rest if law.rest > 0 else math.inf, ROUGH_TAIL)
            if needed > 1.2 * length:
                length, decay = needed, -math.log(ROUGH_TAIL) / (needed - CORE)
                profile = started(law, Grid(points, length), min(decay, 2.5), self._rough(size))
            else:
                profile = profile.on(Grid(points, length))
            profile = solved(profile, amplitude_is(1.0), ROUGH)
            mu = profile.mu
            if profile.tail > ROUGH and length < LONGEST * needed:
                length *= 2  # the core is wide, as for a force hardly steeper than linear
            elif mu > law.rest and profile.tail > NO_TAIL:
                raise NoWave(f"no localised wave with a crest of {self.sign * size:g} m")
            elif mu > law.rest and profile.residual() < ROUGH:
                return profile
            points *= 2
        raise ResolutionError(
            f"{MOST_POINTS} points do not resolve the wave with a crest of {self.sign * size:.9g} m"
        )

    def _rough(self, size):
        """f of `Scaled`, interpolated."""
        return lambda rho: self.rough_tension(size * rho) / self.rough_tension(size)

    def stiffness_at_end(self, closest):
        """Limit of m c^2 [N/m] towards the end of the domain, by Neville's scheme in the root of
        the stroke left."""
        left = closest * 2.0 ** np.arange(NODES)
        values = []
        for part in left.tolist():
            law = Scaled(self.potential, self.sign * self.end * (1 - part))
            near = self.wave(abs(law.reference))
            profile, _ = refined(near, amplitude_is(1.0))
            values.append(profile.mu * law.force / law.reference)
        return extrapolated(np.sqrt(left), values)

    def with_stiffness(self, target, mass):
        """A wave near, and the condition, for m c^2 = target [N/m]."""

        def excess(profile):
            law = profile.law
            return math.log((profile.mu - law.rest) * law.force / law.reference) - wanted

        def say(value):
            return f"speed {math.sqrt(value / mass):.6g} sites/s"

        wanted = math.log(target - self.rest)
        fast = np.flatnonzero(self.long_wave > target - self.rest)
        start = self.sizes[fast[0]] if fast.size else self.largest
        if target >= self.front[1]:
            raise TensegrityError(
                f"{say(target)} must be below {say(self.front[1])}: the spring softens, and as "
                f"waves of {self.name} approach that speed their tops grow flat and endless"
            )

        def reached(profile):
            return say(profile.mu * profile.law.force / profile.law.reference)

        profile = self._search(excess, start, say(target), reached)
        return profile, speed_is(target * profile.law.reference / profile.law.force)

    def with_energy(self, target):
        """A wave near, and the condition, for an energy [J]."""

        def joules(profile):
            return profile.energy * profile.law.reference * profile.law.force

        def reached(profile):
            return f"energy {joules(profile):.6g} J"

        enough = np.flatnonzero(2 * self.energy > target)
        start = self.sizes[enough[0]] if enough.size else self.sizes[-1]
        profile = self._search(
            lambda profile: math.log(joules(profile) / target), start, f"energy {target:.6g} J",
            reached,
        )  # fmt: skip
        return profile, energy_is(target / (profile.law.reference * profile.law.force))

    @cached_property
    def front(self):
        """Size [m] and m c^2 [N/m] of the front that ends a family, (inf, inf) without one.

        Where a spring softens after it has stiffened the waves grow flat tops, whose ends are
        fronts: between r = 0 and r the forces balance if m c^2 = V'(r)/r, the energy flows if
        V(r) = r V'(r)/2.
        """
        from scipy.optimize import brentq

        top = int(np.argmax(self.long_wave))
        if top in (0, len(self.sizes) - 1):
            return math.inf, math.inf

        def surplus(size):
            r = self.sign * size
            return float(r * self.potential.tension(r) - 2 * self.potential.energy(r))

        low, high = self.sizes[[top - 1, top + 1]]
        if not surplus(low) > 0 > surplus(high):
            return math.inf, math.inf
        size = brentq(surplus, low, high, xtol=1e-300, rtol=1e-14)
        return size, float(self.potential.tension(self.sign * size)) / (self.sign * size)

    def _search(self, excess, start, asked, reached):
        """Secant steps in the size until |excess| < CLOSE; excess must rise with the size."""
        largest, end = self.largest, min(self.end, self.front[0])
        largest = min(largest, FRONT * end)
        coordinate = Coordinate(end)
        size, before = min(start, largest), None
        reason = "the search did not settle"
        low, high = -math.inf, math.inf  # coordinates between which the wave must lie
        for _ in range(SEARCHES):
            here = coordinate(size)
            try:
                profile = self.wave(size)
                gap = excess(profile)
            except NoWave as error:  # below the threshold of the family
                profile, gap, reason = None, None, error
            if gap is not None and abs(gap) < CLOSE:
                return profile
            if gap is None or gap < 0:
                low = max(low, here)
                if size == largest:
                    what = f": {reason}" if gap is None else f" is above {reached(profile)}"
                    raise TensegrityError(
                        f"{asked}{what}, that of the wave with a crest of "
                        f"{self.sign * largest:.6g} m, the largest before the end of the domain "
                        "or of the family"
                    )
            else:
                high = min(high, here)
            if high - low < 1e-12 * (1 + abs(high)):
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
            size = min(coordinate.size(new), largest)
        raise TensegrityError(f"{asked}: no solitary wave of {self.name} found ({reason})")


def extrapolated(x, y):
    """Value at 0 of the polynomial through points (x, y)."""
    from scipy.interpolate import BarycentricInterpolator

    return float(BarycentricInterpolator(x, y)(0.0))


class Coordinate:
    """log(a/(end - a)), or log a where there is no end."""

    def __init__(self, end):
        self.end = end

    def __call__(self, size):
        return math.log(size) if math.isinf(self.end) else math.log(size / (self.end - size))

    def size(self, value):
        return math.exp(value) if math.isinf(self.end) else self.end / (1 + math.exp(-value))


def _half_length(ratio_squared, tail):
    """Sites from the crest to where `tail` of it is left."""
    decay = min(decay_rate(math.sqrt(ratio_squared)), SLOWEST_DECAY)
    return CORE - math.log(tail) / decay


def refined(profile, condition):
    """Solve on longer and finer grids until tail and residual are round-off."""
    law = profile.law
    length = _half_length(profile.mu / law.rest if law.rest > 0 else math.inf, TAIL)
    density = profile.grid.points / profile.grid.half_length
    previous, tail = math.inf, math.inf
    while (points := _even(length * density)) <= MOST_POINTS:
        profile = solved(profile.on(Grid(points, length)), condition)
        residual = profile.residual()
        if residual <= TARGET or previous / 4 < residual <= LARGEST:
            round_off = 4 * np.finfo(float).eps * profile.mu / (profile.mu - law.rest)
            if profile.tail <= TAIL_LEFT + round_off or profile.tail > tail / 2:
                return profile, residual
            tail, length = profile.tail, 1.3 * length
        else:
            previous, density = residual, 2 * density
    raise ResolutionError(
        f"residual {residual:.1e} with {profile.grid.points} points must be at most {LARGEST:g}: "
        f"the wave with a crest of {law.reference * profile.rho[0]:.9g} m is not resolved"
    )


def _even(points):
    """The next length that a cosine transform is fast for."""
    from scipy.fft import next_fast_len

    return next_fast_len(math.ceil(points), real=True)
