"""Exact solitary waves of a chain of equal masses and springs: `solitary_wave`.

A wave is found from its speed, its peak elongation or its energy, to round-off.  For the equation
and how it is solved see `travelling`.  Sources:
G. Friesecke, J. Wattis, Commun. Math. Phys. 161, 391 (1994) (existence); seeds/000, part III.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.notebook import page
from tensegrity.root import root
from tensegrity.scenes.chain import Chain
from tensegrity.scenes.scene import State
from tensegrity.springs.potential import Potential
from tensegrity.typing import Array
from tensegrity.waves.asymptotics import sound_speed
from tensegrity.waves.by_target import near, sign_and_number, stiffness_above
from tensegrity.waves.family import STROKE, Family, refined
from tensegrity.waves.multidomain import Integrals, may_cross_kink, multidomain_wave
from tensegrity.waves.travelling import NoWaveError, Series

LEAST_LEVEL = 1e-8  # of the crest, at which a width is asked for
PLOTTED = 1e-3  # of the crest, where a notebook's picture ends


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
    _shape: Series | Integrals = field(repr=False)

    def elongation(self, x: ArrayLike) -> Array:
        """Elongation [m] at distances x from the crest (sites, any shape), by Fourier's series.

        Raises `TensegrityError` where an x is not a number, as do `rate` and `displacement`.
        """
        return self._shape.elongation(check.numbers("x", x, "sites"))

    def rate(self, x: ArrayLike) -> Array:
        """du/dx [m per site] at distances x from the crest: the velocity is -speed times it."""
        return self._shape.rate(check.numbers("x", x, "sites"))

    def displacement(self, x: ArrayLike) -> Array:
        """u(x) [m], 0 far ahead of the crest (x > 0)."""
        return self._shape.displacement(check.numbers("x", x, "sites"))

    @property
    def strain(self) -> Array:
        """Elongation over the length of the spring at `x`, extension > 0; (n,)."""
        if self.potential.length is None:
            raise TensegrityError("no strain: the potential has no length; see elongation(x)")
        return self._on_x / self.potential.length

    @cached_property
    def _halves(self):
        """Elongation and rate at the places of `x` from the crest on."""
        return self._shape.on_grid()

    @property
    def _on_x(self):
        half = self._halves[0]
        return np.concatenate([half[:0:-1], half])

    @property
    def speed_ratio(self) -> float:
        """Speed over sound speed; inf in a sonic vacuum."""
        return self.speed / self.sound_speed if self.sound_speed else math.inf

    @property
    def shift(self) -> float:
        """How far a passing wave carries each mass [m], > 0 along its way."""
        return self._shape.shift

    def width(self, level: float = 0.05) -> float:
        """Distance in sites between the two places where the elongation is `level` of the crest."""
        level = check.number("level", level, above=0, below=1)
        below = np.flatnonzero(self._halves[0] / self.amplitude < level)
        if below.size == 0 or level < LEAST_LEVEL:
            raise TensegrityError(f"level {level:g} must be at least {LEAST_LEVEL:g}")
        first = len(self.x) // 2 + below[0]
        places = self.x[first - 1], self.x[first]
        return 2 * root(
            lambda x: float(self.elongation(x)) / self.amplitude - level, *places, 1e-13
        )

    def reach(self, tail: float = 1e-12) -> float:
        """Distance from the crest, in sites, beyond which less than `tail` (< 1) of it is left."""
        tail = check.number("tail", tail, above=0, below=1)
        left = np.maximum(*(np.abs(half) / np.abs(half).max() for half in self._halves)) >= tail
        return float(self.x[len(self.x) // 2 + np.flatnonzero(left)[-1]])

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

    def _texts(self):
        """Its numbers as text, by name."""
        ratio = f" = {self.speed_ratio:.6g} sound speeds" if self.sound_speed else ""
        return {
            "speed": f"{self.speed:.6g} sites/s{ratio}",
            "crest": f"{self.amplitude:.6g} m",
            "width": f"{self.width():.4g} sites at 5 % of the crest",
            "energy": f"{self.energy:.6g} J",
            "momentum": f"{self.momentum:.6g} kg m/s",
            "residual": f"{self.residual:.1e}",
        }

    def __str__(self) -> str:
        text = {name: f"{name} {value}" for name, value in self._texts().items()}
        width = text["width"].replace("the crest", "it")
        return (
            f"solitary wave of {self.family}, {text['speed']}\n{text['crest']}, {width}\n"
            f"{text['energy']}, {text['momentum']}\n{text['residual']}"
        )

    def _repr_html_(self) -> str:
        def draw(figure: Any) -> None:
            near = np.abs(self.x) <= self.reach(PLOTTED)
            axes = figure.subplots()
            axes.plot(self.x[near], self._on_x[near])
            axes.set(xlabel="distance from the crest [sites]", ylabel="elongation [m]")

        return page(f"Solitary wave of {self.family}", self._texts(), draw)


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
    Where the crest is beyond a kink of the force, as where contacts open, the wave is solved in
    pieces, see `tensegrity.waves.multidomain`: seconds, not a tenth of one.
    """
    check.kind("potential", potential, Potential)
    mass = check.number("mass", mass, above=0, unit="kg")
    given = {
        "speed": speed, "speed_ratio": speed_ratio, "excess": excess, "amplitude": amplitude,
        "energy": energy,
    }  # fmt: skip
    targets = {name: value for name, value in given.items() if value is not None}
    if len(targets) != 1:
        raise TensegrityError(
            f"{' and '.join(targets) or 'nothing'} given: give exactly one of {', '.join(given)}"
        )
    ((name, value),) = targets.items()
    value = check.number(name, value)
    label, sound = f"{name} {value:g}", sound_speed(potential, mass)
    sign, number = sign_and_number(potential, family, value if name == "amplitude" else None)
    side = Family(potential, sign, number or 0)
    if name == "amplitude":
        value = abs(value)
    elif name == "energy":
        value = check.number("energy", value, above=0, unit="J")
    else:
        name, value = "above", stiffness_above(name, value, sound, mass, side.rest)
    if number is None:
        side = side.holding(name, value)
    try:
        profile, condition = near(side, name, value, mass)
        try:
            solution = _characteristics(*refined(profile, condition))
        except NoWaveError:
            found = _wave(side, mass, sound, *_characteristics(profile, profile.residual()))
            raise TensegrityError(
                f"no solitary wave of {side.name} with {label}: the nearest one found has a "
                f"crest of {found.amplitude:.6g} m, speed {found.speed:.6g} sites/s and energy "
                f"{found.energy:.6g} J, where the family ends"
            ) from None
    except TensegrityError:
        if not may_cross_kink(side, name, value):
            raise
        solution = multidomain_wave(side, name, value)
    return _wave(side, mass, sound, *solution)


def approximate_wave(side: Family, mass: float, size: float) -> SolitaryWave:
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
    return _wave(side, mass, sound, *_characteristics(profile, profile.residual()))


def _characteristics(profile, residual):
    """m c^2 [N/m] and that over V''(0), less 1, of a profile that was found by Fourier's series;
    amplitude, energy, residual and shape."""
    law, grid = profile.law, profile.grid
    stiffness = profile.mu * law.secant
    rates = grid.box * (law.force * grid.coefficients(law.tension(profile.rho))) / stiffness
    bonds = law.reference * law.force * (grid.weights @ law.energy(profile.rho))
    masses = stiffness / 2 * (grid.weights @ grid.values(rates) ** 2)
    gain = profile.nu / law.rest if law.rest else math.inf
    amplitude = float(law.reference * profile.rho[0])
    return stiffness, gain, amplitude, float(bonds + masses), residual, Series(grid, rates)


def _wave(side, mass, sound, stiffness, gain, amplitude, energy, residual, shape):
    """The wave of a family with these numbers and this shape."""
    speed, half = math.sqrt(stiffness / mass), shape.grid.x
    return SolitaryWave(
        potential=side.potential, mass=mass, x=np.concatenate([-half[:0:-1], half]), speed=speed,
        sound_speed=sound, excess=math.expm1(math.log1p(gain) / 2), family=side.name,
        amplitude=amplitude, energy=energy, momentum=float(mass * speed * shape.shift),
        residual=residual, _shape=shape,
    )  # fmt: skip


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
    sign, number = sign_and_number(potential, family, None)
    side = Family(potential, sign, number or 0)
    if math.isfinite(side.rising_part.ceiling):
        return math.sqrt((side.rest + side.rising_part.ceiling) / mass)
    if math.isinf(side.end):
        raise TensegrityError("no largest speed: the spring does not lock (its domain is open)")
    return math.sqrt(side.stiffness_at_end(closest) / mass)
