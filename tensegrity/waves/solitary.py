"""Exact solitary waves of a chain of equal masses and springs: `solitary_wave`.

A wave is found from its speed, its peak elongation or its energy, to round-off, and can be
launched on a chain.  For the equation and how it is solved see `travelling`.  Sources:
G. Friesecke, J. Wattis, Commun. Math. Phys. 161, 391 (1994) (existence); seeds/000, part III.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.notebook import page
from tensegrity.root import root
from tensegrity.scenes.chain import Chain
from tensegrity.scenes.scene import State
from tensegrity.springs.potential import Potential
from tensegrity.waves.asymptotics import sound_speed
from tensegrity.waves.family import SIGNS, STROKE, Family, refined
from tensegrity.waves.travelling import Grid, NoWave, cosine_sum

if TYPE_CHECKING:
    from typing import Any

    from numpy.typing import ArrayLike

    from tensegrity.typing import Array

LEAST_LEVEL = 1e-8  # of the crest, at which a width is asked for
MOST = 1000  # families of one sign that can be asked for
SHOWN = 1e-3  # of the crest, where a notebook's picture ends


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
    excess : float
        speed/sound_speed - 1, to full relative precision also where it is small; inf in a sonic
        vacuum.
    family : str
        "compression" or "rarefaction", with a number from the second family of that sign on.
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
    x: Array = field(repr=False)
    speed: float
    sound_speed: float
    excess: float
    family: str
    amplitude: float
    energy: float
    momentum: float
    residual: float
    _grid: Grid = field(repr=False)
    _rates: Array = field(repr=False)  # cosine coefficients of du/dx

    def elongation(self, x: ArrayLike) -> Array:
        """Elongation [m] at distances x from the crest (sites, any shape), by Fourier's series.

        Raises `TensegrityError` where an x is not a number, as do `rate` and `displacement`.
        """
        return self._sum(self._rates * self._grid.box, x)

    def rate(self, x: ArrayLike) -> Array:
        """du/dx [m per site] at distances x from the crest: the velocity is -speed times it."""
        return self._sum(self._rates, x)

    def displacement(self, x: ArrayLike) -> Array:
        """u(x) [m], 0 far ahead of the crest (x > 0)."""
        x = np.clip(_distances(x), -self._grid.half_length, self._grid.half_length)
        k = self._grid.wave_numbers[1:]
        wavy = cosine_sum(self._rates[1:] / k, k, x, np.sin)
        return wavy + self._rates[0] * (x - self._grid.half_length)

    def _sum(self, coefficients, x):
        x = _distances(x)
        inside = np.abs(x) <= self._grid.half_length
        value = cosine_sum(coefficients, self._grid.wave_numbers, np.where(inside, x, 0.0))
        return np.where(inside, value, 0.0)

    @property
    def strain(self) -> Array:
        """Elongation over the length of the spring at `x`, extension > 0; (n,)."""
        if self.potential.length is None:
            raise TensegrityError("no strain: the potential has no length; see elongation(x)")
        return self._on_x / self.potential.length

    @cached_property
    def _on_x(self):
        half = self._grid.values(self._rates * self._grid.box)
        return np.concatenate([half[:0:-1], half])

    @property
    def speed_ratio(self) -> float:
        """Speed over sound speed; inf in a sonic vacuum."""
        return self.speed / self.sound_speed if self.sound_speed else math.inf

    @property
    def shift(self) -> float:
        """How far a passing wave carries each mass [m], > 0 along its way."""
        return float(-2 * self._grid.half_length * self._rates[0])

    def width(self, level: float = 0.05) -> float:
        """Distance in sites between the two places where the elongation is `level` of the crest."""
        level = check.number("level", level, above=0, below=1)
        half = self._on_x[len(self.x) // 2 :] / self.amplitude
        below = np.flatnonzero(half < level)
        if below.size == 0 or level < LEAST_LEVEL:
            raise TensegrityError(f"level {level:g} must be at least {LEAST_LEVEL:g}")
        places = self._grid.x[below[0] - 1], self._grid.x[below[0]]
        return 2 * root(
            lambda x: float(self.elongation(x)) / self.amplitude - level, *places, 1e-13
        )

    def reach(self, tail: float = 1e-12) -> float:
        """Distance from the crest, in sites, beyond which less than `tail` (< 1) of it is left."""
        tail = check.number("tail", tail, above=0, below=1)
        rates = np.abs(self._grid.values(self._rates))
        half = np.abs(self._on_x[len(self.x) // 2 :])
        left = np.maximum(rates / rates.max(), half / half.max()) >= tail
        return float(self._grid.x[np.flatnonzero(left)[-1]])

    def launch(self, chain: Chain, at: float, direction: int = 1, tail: float = 1e-12) -> State:
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
            Part of the crest that may be cut off at the ends of the chain, below 1.

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
        at = check.number("at", at)
        if check.whole("direction", direction, least=-1) == 0 or direction > 1:
            raise TensegrityError(f"direction {direction} must be 1 or -1")
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

    def __str__(self) -> str:
        ratio = f" = {self.speed_ratio:.6g} sound speeds" if self.sound_speed else ""
        return (
            f"solitary wave of {self.family}, speed {self.speed:.6g} sites/s{ratio}\n"
            f"crest {self.amplitude:.6g} m, width {self.width():.4g} sites at 5 % of it\n"
            f"energy {self.energy:.6g} J, momentum {self.momentum:.6g} kg m/s\n"
            f"residual {self.residual:.1e}"
        )

    def _repr_html_(self) -> str:
        ratio = f" = {self.speed_ratio:.6g} sound speeds" if self.sound_speed else ""
        rows = {
            "speed": f"{self.speed:.6g} sites/s{ratio}",
            "crest": f"{self.amplitude:.6g} m",
            "width": f"{self.width():.4g} sites at 5 % of the crest",
            "energy": f"{self.energy:.6g} J",
            "momentum": f"{self.momentum:.6g} kg m/s",
            "residual": f"{self.residual:.1e}",
        }

        def draw(figure: Any) -> None:
            near = np.abs(self.x) <= self.reach(SHOWN)
            axes = figure.subplots()
            axes.plot(self.x[near], self._on_x[near])
            axes.set(xlabel="distance from the crest [sites]", ylabel="elongation [m]")

        return page(f"Solitary wave of {self.family}", rows, draw)


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
    if name == "amplitude":
        if number is None:
            side = side.with_crest(abs(value))
        profile, condition = side.with_size(abs(value))
    elif name == "energy":
        value = check.number("energy", value, above=0, unit="J")
        profile, condition = side.with_energy(value)
    else:
        above = _above(name, value, sound, mass, side.rest)
        if number is None:
            side = side.with_level(above)
        profile, condition = side.with_stiffness(above, mass)
    try:
        exact, residual = refined(profile, condition)
    except NoWave:
        near = _wave(side.name, mass, sound, profile, profile.residual())
        raise TensegrityError(
            f"no solitary wave of {side.name} with {name} {value:g}: the nearest one found has a "
            f"crest of {near.amplitude:.6g} m, speed {near.speed:.6g} sites/s and energy "
            f"{near.energy:.6g} J, where the family ends"
        ) from None
    return _wave(side.name, mass, sound, exact, residual)


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
    return _wave(side.name, mass, sound, profile, profile.residual())


def _distances(x):
    x = check.floats("x", x)
    if np.isnan(x).any():
        raise TensegrityError("x nan sites is not a number")
    return x


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
            f"speed {speed:g} must be above {sound:g} sites/s, the sound speed: a slower wave "
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
    slope = float(potential.stiffness_slope(0.0)) if _smooth_at_rest(potential) else -1.0
    return 1 if slope > 0 else -1


def _smooth_at_rest(potential):
    return float(potential.stiffness(0.0)) > 0


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


def _wave(family, mass, sound, profile, residual):
    law, grid = profile.law, profile.grid
    stiffness = profile.mu * law.secant  # m c^2
    speed = math.sqrt(stiffness / mass)
    tension = law.force * grid.coefficients(law.tension(profile.rho))
    rates = grid.box * tension / stiffness
    bonds = law.reference * law.force * (grid.weights @ law.energy(profile.rho))
    masses = stiffness / 2 * (grid.weights @ grid.values(rates) ** 2)
    return SolitaryWave(
        potential=law.potential, mass=mass, x=np.concatenate([-grid.x[:0:-1], grid.x]),
        speed=speed, sound_speed=sound, family=family,
        excess=math.expm1(math.log1p(profile.nu / law.rest) / 2) if law.rest else math.inf,
        amplitude=float(law.reference * profile.rho[0]),
        energy=float(bonds + masses),
        momentum=float(-mass * speed * 2 * grid.half_length * rates[0]),
        residual=residual, _grid=grid, _rates=rates,
    )  # fmt: skip
