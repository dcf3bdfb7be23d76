"""A solitary wave as it was found: its numbers, its profile, and how it is launched on a chain."""

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
from tensegrity.waves.travelling import Grid, cosine_sum

if TYPE_CHECKING:
    from typing import Any

    from numpy.typing import ArrayLike

    from tensegrity.springs.potential import Potential
    from tensegrity.typing import Array

LEAST_LEVEL = 1e-8  # of the crest, at which a width is asked for
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
        x = np.clip(check.numbers("x", x, "sites"), -self._grid.half_length, self._grid.half_length)
        k = self._grid.wave_numbers[1:]
        wavy = cosine_sum(self._rates[1:] / k, k, x, np.sin)
        return wavy + self._rates[0] * (x - self._grid.half_length)

    def _sum(self, coefficients, x):
        x = check.numbers("x", x, "sites")
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


def wave_of(family, mass, sound, profile, residual):
    """The wave of a profile that was found."""
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
