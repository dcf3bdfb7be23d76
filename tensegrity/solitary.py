"""Exact solitary waves of a chain of equal masses and springs: `solitary_wave`.

A wave is found from its speed, its peak elongation or its energy, to round-off, and can be
launched on a chain.  For the equation and how it is solved see `travelling`.  Sources:
G. Friesecke, J. Wattis, Commun. Math. Phys. 161, 391 (1994) (existence); seeds/000, part III.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from tensegrity import check
from tensegrity.asymptotics import sound_speed
from tensegrity.errors import ResolutionError, TensegrityError
from tensegrity.lattice import Chain, State
from tensegrity.potential import Potential
from tensegrity.travelling import (
    Grid,
    NoWave,
    Scaled,
    amplitude_is,
    cosine_sum,
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
ROUGH = 1e-4  # residual while a wave is sought
FIRST_POINTS, MOST_POINTS = 192, 32768
ROUGH_TAIL, TAIL = 1e-8, 1e-17  # of the crest, expected at the end of the grid
TAIL_LEFT = 1e-14  # of the crest, found there
CORE = 3.0  # sites in which a wave has fallen to its linear tail
SLOWEST_DECAY = 6.0  # per site: faster tails are over within the core
FRONT = 1 - 1e-6  # part of the size of a front
STROKE = 0.9995  # part of the stroke to the end of the domain that a wave is looked for in
CLOSE = 0.03  # relative distance from which Newton's method is trusted to reach the target
SEARCHES = 60
FACTOR = 4.0  # largest change of amplitude/(stroke left) in a step of the search


@dataclass(frozen=True, eq=False)
class SolitaryWave:
    """A travelling wave; `solitary_wave` makes it.

    Attributes
    ----------
    potential : Potential
    mass : float
        [kg].
    x : ndarray, (n,)
        Distance from the crest, in sites, both sides of 0.  The crest is where a bond passes
        when its elongation is largest.
    speed, sound_speed : float
        [sites/s].
    amplitude : float
        Elongation of the crest [m], extension > 0: negative in a compression wave.
    energy : float
        [J].
    momentum : float
        [kg m/s] of a wave towards higher sites: positive in a compression wave.
    residual : float
        Largest |m c^2 r - K V'(r)| over the largest |V'(r)|, on a grid 4 times finer than the
        one solved on; K is the convolution of `travelling`.
    """

    potential: Potential = field(repr=False)
    mass: float
    x: np.ndarray = field(repr=False)
    speed: float
    sound_speed: float
    amplitude: float
    energy: float
    momentum: float
    residual: float
    _grid: Grid = field(repr=False)
    _rates: np.ndarray = field(repr=False)  # cosine coefficients of du/dx

    def elongation(self, x):
        """Elongation [m] at distances x from the crest (sites, any shape), by Fourier's series."""
        return self._sum(self._rates * self._grid.box, x)

    def rate(self, x):
        """du/dx [m per site] at distances x from the crest: the velocity is -speed times it."""
        return self._sum(self._rates, x)

    def displacement(self, x):
        """u(x) [m], 0 far ahead of the crest (x > 0)."""
        x = np.clip(np.asarray(x, dtype=float), -self._grid.half_length, self._grid.half_length)
        k = self._grid.wave_numbers[1:]
        wavy = cosine_sum(self._rates[1:] / k, k, x, np.sin)
        return wavy + self._rates[0] * (x - self._grid.half_length)

    def _sum(self, coefficients, x):
        x = np.asarray(x, dtype=float)
        value = cosine_sum(coefficients, self._grid.wave_numbers, x)
        return np.where(np.abs(x) <= self._grid.half_length, value, 0.0)

    @property
    def strain(self):
        """Elongation over the length of the spring at `x`, extension > 0; (n,)."""
        if self.potential.length is None:
            raise TensegrityError("no strain: the potential has no length; see elongation(x)")
        return self._on_x / self.potential.length

    @cached_property
    def _on_x(self):
        half = self._grid.values(self._rates * self._grid.box)
        return np.concatenate([half[:0:-1], half])

    @property
    def speed_ratio(self):
        """Speed over sound speed; inf in a sonic vacuum."""
        return self.speed / self.sound_speed if self.sound_speed else math.inf

    @property
    def shift(self):
        """How far a passing wave carries each mass [m], > 0 along its way."""
        return float(-2 * self._grid.half_length * self._rates[0])

    def width(self, level=0.05):
        """Distance in sites between the two places where the elongation is `level` of the crest."""
        from scipy.optimize import brentq

        level = check.number("level", level, above=0)
        if level >= 1:
            raise TensegrityError(f"level {level:g} must be below 1")
        half = self._on_x[len(self.x) // 2 :] / self.amplitude
        below = np.flatnonzero(half < level)
        if below.size == 0 or level < ROUGH_TAIL:
            raise TensegrityError(f"level {level:g} must be at least {ROUGH_TAIL:g}")
        places = self._grid.x[below[0] - 1], self._grid.x[below[0]]
        return 2 * brentq(
            lambda x: float(self.elongation(x)) / self.amplitude - level, *places, xtol=1e-13
        )

    def reach(self, tail=1e-12):
        """Distance from the crest, in sites, beyond which less than `tail` of it is left."""
        rates = np.abs(self._grid.values(self._rates))
        half = np.abs(self._on_x[len(self.x) // 2 :])
        left = np.maximum(rates / rates.max(), half / half.max()) >= tail
        return float(self._grid.x[np.flatnonzero(left)[-1]])

    def launch(self, chain, at, direction=1, tail=1e-12):
        """The wave as a state of a chain, otherwise at rest.

        Parameters
        ----------
        chain : Chain
            Of this wave's spring and mass, at least where the wave is.
        at : float
            Place of the crest, where site j is at j: bond j is centred at j + 1/2.
        direction : int, optional
            1 towards higher sites, -1 towards lower ones.
        tail : float, optional
            Part of the crest that may be cut off at the ends of the chain.

        Returns
        -------
        State
            The masses ahead of the wave at u = 0, those behind at u = `direction` times `shift`;
            on a chain with one fixed end that end is at 0.

        Raises
        ------
        TensegrityError
            If the wave does not fit the chain, its springs or masses, or both ends are fixed.
        """
        if not isinstance(chain, Chain):
            raise TensegrityError(f"chain is {type(chain).__name__}, not a Chain")
        at, tail = check.number("at", at), check.number("tail", tail, above=0)
        if direction not in (1, -1):
            raise TensegrityError(f"direction {direction!r} must be 1 or -1")
        self._check_place(chain, at, self.reach(tail), tail)
        x = np.arange(chain.sites) - at
        u, v = self.displacement(x), -direction * self.speed * self.rate(x)
        if direction == -1:
            u -= self.displacement(-math.inf)  # at rest ahead is at lower sites
        for site in chain.held:
            u -= u[site]
            v[site] = 0.0
        return State(np.ascontiguousarray(u), v)

    def _check_place(self, chain, at, reach, tail):
        last = chain.sites - 1
        if at - reach < 0 or at + reach > last:
            raise TensegrityError(
                f"the wave at {at:g} falls to {tail:g} of its crest only {reach:.4g} sites away, "
                f"but the ends of the chain are {at:g} and {last - at:g} sites away"
            )
        if len(chain.held) == 2:
            raise TensegrityError(
                f"both ends of the chain are fixed, but the wave changes its length by "
                f"{-self.shift:g} m"
            )
        near = slice(math.floor(at - reach), math.ceil(at + reach) + 1)
        if any(s is not self.potential and s != self.potential for s in chain.springs[near]):
            raise TensegrityError(f"the springs around {at:g} differ from that of the wave")
        if np.any(np.abs(chain.mass[near] / self.mass - 1) > 1e-15):
            raise TensegrityError(
                f"the masses around {at:g} differ from that of the wave, {self.mass:g} kg"
            )

    def __str__(self):
        kind = "compression" if self.amplitude < 0 else "rarefaction"
        ratio = f" = {self.speed_ratio:.6g} sound speeds" if self.sound_speed else ""
        return (
            f"solitary wave of {kind}, speed {self.speed:.6g} sites/s{ratio}\n"
            f"crest {self.amplitude:.6g} m, width {self.width():.4g} sites at 5 % of it\n"
            f"energy {self.energy:.6g} J, momentum {self.momentum:.6g} kg m/s\n"
            f"residual {self.residual:.1e}"
        )


def solitary_wave(
    potential, mass=1.0, *, speed=None, speed_ratio=None, amplitude=None, energy=None, family=None
):
    """The solitary wave of a chain, to round-off.

    Parameters
    ----------
    potential : Potential
        Of all springs.
    mass : float, optional
        Of each site [kg].
    speed, speed_ratio, amplitude, energy : float
        Exactly one: speed [sites/s], speed over sound speed, elongation of the crest [m]
        (negative: compression), or energy [J].
    family : {"compression", "rarefaction"}, optional
        By default that of the amplitude's sign, else the one whose waves start from zero
        amplitude: compression where the spring stiffens in compression.  Springs that stiffen
        both ways carry the other one too, above a threshold.

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
    """
    if not isinstance(potential, Potential):
        raise TensegrityError(f"potential {potential!r} is not a Potential")
    mass = check.number("mass", mass, above=0, unit="kg")
    given = {"speed": speed, "speed_ratio": speed_ratio, "amplitude": amplitude, "energy": energy}
    asked = {name: value for name, value in given.items() if value is not None}
    if len(asked) != 1:
        raise TensegrityError(
            f"{' and '.join(asked) or 'nothing'} given: give exactly one of {', '.join(given)}"
        )
    ((name, value),) = asked.items()
    value = check.number(name, value)
    sound = sound_speed(potential, mass)
    sign = _sign(potential, family, value if name == "amplitude" else None)
    side = _Side(potential, sign)
    if name == "amplitude":
        profile = side.wave(abs(value))
        condition = amplitude_is(1.0)
    elif name == "energy":
        value = check.number("energy", value, above=0, unit="J")
        profile, condition = side.with_energy(value)
    else:
        if name == "speed_ratio" and sound == 0:
            raise TensegrityError(
                "speed_ratio given, but the sound speed is 0 (a sonic vacuum): give the speed"
            )
        speed = value * sound if name == "speed_ratio" else value
        if not speed > sound:
            raise TensegrityError(
                f"speed {speed:g} must be above {sound:g} sites/s, the sound speed: a slower wave "
                "has no decaying tail"
            )
        profile, condition = side.with_stiffness(mass * speed**2, mass)
    profile, residual = _refined(profile, condition)
    return _wave(potential, mass, sound, profile, residual)


def _sign(potential, family, amplitude):
    """-1 or 1, the sign of the elongation."""
    if family is not None and family not in SIGNS:
        raise TensegrityError(f"family {family!r} must be one of {', '.join(SIGNS)}")
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
    slope = float(potential.stiffness_slope(0.0)) if _smooth_at_rest(potential) else -1.0
    return 1 if slope > 0 else -1


def _smooth_at_rest(potential):
    return float(potential.stiffness(0.0)) > 0


class _Side:
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
        """Sizes up to the end of the domain, as far as all is finite, and |V'|, V, V'' there."""
        if math.isinf(self.end):
            sizes = np.logspace(-15, 9, 481)
        else:
            near, far = np.logspace(-9, -1, 161), 1 - np.logspace(0, math.log10(1 - STROKE), 161)
            sizes = self.end * np.sort(np.concatenate([near, far[far > 0.1]]))
        r = self.sign * sizes
        with np.errstate(all="ignore"):
            rows = [sizes, np.abs(self.potential.tension(r)), self.potential.energy(r)]
            rows = np.array([*rows, self.potential.stiffness(r)])
        finite = (np.abs(rows) < HUGE).all(axis=0)
        return rows[:, : len(sizes) if finite.all() else int(np.argmin(finite))]

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
        return first, (2 * rest * (a * first - second) + first**2) / (rest * a**2 + 2 * second)

    def _check_existence(self):
        """A wave needs V'(r)/r > V''(0) at its crest: m c^2 |r| = |K V'| is at most max |V'| there,
        and c > cs for a tail that decays."""
        secant = self.rest + self.excess / self.sizes
        if not secant.max() > secant[0] * (1 + 1e-9):
            why = "falls below" if secant[-1] < secant[0] * (1 - 1e-9) else "stays at"
            raise TensegrityError(
                f"no solitary wave of {self.name}: V'(r)/r {why} its value at rest, "
                f"{secant[0]:g} N/m, but a wave whose tail decays needs more at its crest"
            )

    @cached_property
    def rough_tension(self):
        """|V'| [N] at sizes from 0 to the largest, interpolated."""
        from scipy.interpolate import CubicHermiteSpline

        rows = (self.sizes, self.tension, self.stiffness)
        starts = (0.0, 0.0, self.rest)
        return CubicHermiteSpline(*(np.append(s, row) for s, row in zip(starts, rows, strict=True)))

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
        points, length, grid = FIRST_POINTS, 0.0, None
        while True:
            if not mu > law.rest:
                raise NoWave(
                    f"no solitary wave of {self.name} with a crest of {self.sign * size:g} m: it "
                    "would be slower than sound"
                )
            needed = _half_length(mu / law.rest if law.rest > 0 else math.inf, ROUGH_TAIL)
            if needed > 1.2 * length:
                length, grid = needed, Grid(points, needed)
                decay = -math.log(ROUGH_TAIL) / (needed - CORE)
                profile = started(law, grid, min(decay, 2.5), self._rough(size))
            else:
                points *= 2
                profile = profile.on(Grid(points, length))
            profile = solved(profile, amplitude_is(1.0))
            mu = profile.mu
            if mu > law.rest and profile.tail > 1e-2:
                raise NoWave(f"no localised wave with a crest of {self.sign * size:g} m")
            if mu > law.rest and profile.residual() < ROUGH:
                return profile
            if points > MOST_POINTS:
                raise ResolutionError(
                    f"{MOST_POINTS} points do not resolve the wave with a crest of "
                    f"{self.sign * size:.9g} m"
                )

    def _rough(self, size):
        """f of `Scaled`, interpolated."""
        return lambda rho: self.rough_tension(size * rho) / self.rough_tension(size)

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
        V(r) = r V'(r)/2..
        """
        from scipy.optimize import brentq

        top = int(np.argmax(self.long_wave))
        if top == len(self.sizes) - 1:
            return math.inf, math.inf

        def surplus(size):
            r = self.sign * size
            return float(r * self.potential.tension(r) - 2 * self.potential.energy(r))

        size = brentq(surplus, self.sizes[top - 1], self.sizes[top + 1], xtol=1e-300, rtol=1e-14)
        return size, float(self.potential.tension(self.sign * size)) / (self.sign * size)

    def _search(self, excess, start, asked, reached):
        """Secant steps in the size until |excess| < CLOSE; excess must rise with the size."""
        largest, end = self.largest, min(self.end, self.front[0])
        largest = min(largest, FRONT * end)
        coordinate = _logit(end)
        size, before = min(start, largest), None
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
                        f"{self.sign * largest:.6g} m, next to the end of the domain"
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
        raise TensegrityError(f"{asked}: no solitary wave of {self.name} has it")


class _logit:
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


def _refined(profile, condition):
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


def _wave(potential, mass, sound, profile, residual):
    law, grid = profile.law, profile.grid
    stiffness = profile.mu * law.force / law.reference  # m c^2
    speed = math.sqrt(stiffness / mass)
    tension = law.force * grid.coefficients(law.tension(profile.rho))
    rates = grid.box * tension / stiffness
    bonds = law.reference * law.force * (grid.weights @ law.energy(profile.rho))
    masses = stiffness / 2 * (grid.weights @ grid.values(rates) ** 2)
    return SolitaryWave(
        potential=potential, mass=mass, x=np.concatenate([-grid.x[:0:-1], grid.x]), speed=speed,
        sound_speed=sound, amplitude=float(law.reference * profile.rho[0]),
        energy=float(bonds + masses),
        momentum=float(-mass * speed * 2 * grid.half_length * rates[0]),
        residual=residual, _grid=grid, _rates=rates,
    )  # fmt: skip
