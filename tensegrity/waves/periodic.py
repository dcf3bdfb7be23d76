"""Periodic travelling waves of a chain.

A periodic wave of elongations r(x - c t), period P sites and given mean satisfies the equation of
`travelling` on a circle, m c^2 r = K V'(r), in all components but the mean, which is given.  Waves
of a period start from the linear one of that length and are ordered by their height, the difference
of maximum and minimum.
Source: M. Toda, J. Phys. Soc. Jpn. 22, 431 (1967), cnoidal waves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check, plotting
from tensegrity.checked import checked
from tensegrity.errors import ResolutionError, TensegrityError
from tensegrity.printing import Lines, Printed, drawn
from tensegrity.root import root
from tensegrity.scenes.chain import PERIODIC, Chain
from tensegrity.scenes.scene import State
from tensegrity.springs.potential import Potential
from tensegrity.typing import Array, Mass
from tensegrity.unit_names import in_units
from tensegrity.waves.cosines import Grid, cosine_sum

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FIRST_POINTS, MOST_POINTS = 64, 1024  # of the grid of half a period
SMALL = 1e-3  # first height over the elongation at which the stiffness has changed by half
SIZES, CHANGE = 2.0 ** np.arange(-60, 60), 0.5  # m, where this is sought
GROWTH = 1.25  # of the height from one wave to the next, until the speed is passed
MOST_HEIGHTS = 120
ITERATIONS, CONVERGED = 20, 1e-9  # of Newton's method, which is quadratic; last step over height
RESIDUAL = 1e-12  # largest admissible residual over the largest force


@dataclass(frozen=True, eq=False, repr=False)
class PeriodicWave(Printed):
    """A periodic travelling wave; the result of `periodic_wave`.

    Attributes
    ----------
    spring : Potential
    mass : float
        Of each site [kg].
    period : float
        [sites].
    speed : float
        [sites/s].
    mean, maximum, minimum : float
        Of the elongation over a period [m].
    residual : float
        Largest |m c^2 r - K V'(r)| without its mean, over the largest |V'(r)|, on a grid twice as
        fine.
    """

    spring: Potential = field(repr=False)
    mass: float
    period: float
    speed: float
    mean: float
    maximum: float
    minimum: float
    residual: float
    _grid: Grid = field(repr=False)
    _coefficients: Array = field(repr=False)
    _rates: Array = field(repr=False)

    _draw = drawn

    @property
    def height(self) -> float:
        """Maximum less minimum of the elongation [m]."""
        return self.maximum - self.minimum

    def elongation(self, x: ArrayLike) -> Array:
        """Elongation [m] at distances x [sites] from a maximum, any shape."""
        return self._sum(self._coefficients, x)

    def rate(self, x: ArrayLike) -> Array:
        """du/dx [m per site] less the mean elongation; the velocity is -speed times this."""
        return self._sum(self._rates, x)

    def _sum(self, coefficients: Array, x: ArrayLike) -> Array:
        x = check.finite("x", check.numbers("x", x, "sites"))
        return cosine_sum(coefficients, self._grid.wave_numbers, np.remainder(x, self.period))

    @checked
    def launch(self, ring: Chain, at: float = 0.0, direction: int = 1) -> State:
        """The state of a ring with this wave.

        Parameters
        ----------
        ring : Chain
            A ring of this wave's spring and mass, of a whole number of periods; its stretch is the
            number of sites times the mean.
        at : float, optional
            Position of a maximum in sites; the middle of bond j is at j + 1/2.
        direction : int, optional
            1 towards higher sites, -1 towards lower ones.

        Returns
        -------
        State
            Its momentum is 0, and so is the displacement of site 0.

        Raises
        ------
        TensegrityError
            A chain that is no ring, or springs, masses, a number of sites or a stretch that differ.
        """
        if direction not in (-1, 1):
            raise TensegrityError(f"direction {direction} must be 1 or -1")
        if ring.ends != PERIODIC:
            raise TensegrityError("a periodic wave needs a ring: a Chain of ends 'periodic'")
        if any(s != self.spring for s in set(ring.springs)) or np.any(ring.mass != self.mass):
            raise TensegrityError("the springs or masses of the ring differ from those of the wave")
        count = ring.sites / self.period
        if round(count) < 1 or abs(count - round(count)) > 1e-9 * count:
            raise TensegrityError(
                f"a ring of {ring.sites} sites has {count:g} periods of {self.period:g} sites, "
                "must have a whole number"
            )
        needed = ring.sites * self.mean
        if abs(ring.stretch - needed) > 1e-9 * (abs(needed) + self.height):
            raise TensegrityError(
                f"stretch {ring.stretch:g} m of the ring must be {needed:.12g} m, of {ring.sites} "
                f"elongations of mean {self.mean:g} m"
            )
        x = np.arange(ring.sites) - at
        u = np.append(0.0, np.cumsum(self.elongation(x[:-1] + 0.5)))
        return State(u, -direction * self.speed * self.rate(x))

    def _lines(self) -> Lines:
        yield f"periodic wave of {self.period:g} sites, speed {self.speed:.9g} sites/s"
        yield f"elongation {self.minimum:.6g} m to {self.maximum:.6g} m, mean {self.mean:.6g} m"
        yield f"residual {self.residual:.1e}"

    def plot(self, ax: Axes | None = None) -> Axes:
        """Elongation over one period.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            By default of a new figure.

        Returns
        -------
        matplotlib.axes.Axes
        """
        axes: Axes = plotting.axes(ax)
        x = np.linspace(-self.period / 2, self.period / 2, 401)
        axes.plot(x, self.elongation(x))
        axes.set(xlabel="distance from a maximum [sites]", ylabel=in_units("elongation [m]"))
        return axes


@checked
def periodic_wave(
    spring: Potential,
    mass: Mass = 1.0,
    *,
    period: Annotated[float, "> 1", "sites"],
    speed: Annotated[float, "> 0", "sites/s"] | None = None,
    height: Annotated[float, "> 0", "m"] | None = None,
    mean: float = 0.0,
) -> PeriodicWave:
    """A periodic travelling wave of a chain of equal masses and springs.

    Parameters
    ----------
    spring : Potential
    mass : float, optional
        Of each site [kg].
    period : float
        [sites].
    speed, height : float
        One of both: speed [sites/s], or maximum less minimum of the elongation [m].
    mean : float, optional
        Of the elongation [m].

    Returns
    -------
    PeriodicWave

    Raises
    ------
    TensegrityError
        Bad input, a spring that does not resist at the mean, or no such wave: waves of a period
        begin with the linear one, and their speeds rise or fall with their heights from there.
    ResolutionError
        The finest grid does not resolve the wave.

    Examples
    --------
    >>> import sympy as sp
    >>> from tensegrity import Potential, periodic_wave
    >>> r = sp.Symbol("r")
    >>> periodic_wave(Potential(r**2 / 2 + r**3 / 3, r), period=12, speed=1.02)
    periodic wave of 12 sites, speed 1.02 sites/s
    elongation -0.0621062 m to 0.180847 m, mean 0 m
    residual 2.6e-16
    """
    if (speed is None) == (height is None):
        raise TensegrityError("give one of speed and height")
    mean = check.number("mean", mean, unit="m")
    low, high = spring.domain
    if not low < mean < high:
        raise TensegrityError(f"mean {mean:g} m must be inside the domain of the spring")
    rest = float(spring.stiffness(mean))
    if not rest > 0:
        raise TensegrityError(f"stiffness {rest:g} N/m of the spring at the mean must be above 0")
    points = FIRST_POINTS
    while points <= MOST_POINTS:
        circle = _Circle(spring, Grid(points, period / 2), mean)
        if height is None:
            r, mu = circle.at_speed(mass * float(speed or 0.0) * float(speed or 0.0))
        else:
            r, mu = circle.at_height(height)
        residual = circle.residual(r, mu)
        if residual <= RESIDUAL:
            break
        points *= 2
    else:
        raise ResolutionError(
            f"a residual of {residual:.1e} with {MOST_POINTS} points in half a period"
        )
    coefficients = circle.grid.coefficients(r)
    rates = circle.grid.box * circle.grid.coefficients(spring.tension(r)) / mu
    rates[0] = 0.0
    return PeriodicWave(
        spring, mass, period, math.sqrt(mu / mass), mean, float(r[0]), float(r[-1]), residual,
        circle.grid, coefficients, rates,
    )  # fmt: skip


class _Circle:
    """The equation on half a period; r on the grid from a maximum to a minimum, mu = m c^2."""

    def __init__(self, spring: Potential, grid: Grid, mean: float) -> None:
        self.spring, self.grid, self.mean = spring, grid, mean
        self.symbol = grid.box**2
        self.symbol[0] = 0.0
        self.rest = float(spring.stiffness(mean))

    def linear(self, height: float) -> tuple[Array, float]:
        """The linear wave of this height."""
        r = self.mean + height / 2 * np.cos(self.grid.wave_numbers[1] * self.grid.x)
        return r, float(self.symbol[1] * self.rest)

    def newton(self, r: Array, mu: float, height: float) -> tuple[Array, float] | None:
        """The wave of a height near (r, mu); None if there is none."""
        matrix, size = self.grid.matrix(self.symbol), len(r)
        low, high = self.spring.domain
        tangent = np.zeros((size + 1, size + 1))
        for _ in range(ITERATIONS):
            if not (low < r.min() and r.max() < high):
                return None
            spread = self.grid.apply(self.symbol, self.spring.tension(r))
            tangent[:-1, :-1] = mu * np.eye(size) - matrix * self.spring.stiffness(r)
            tangent[:-1, -1] = r - self.mean
            tangent[-1, 0], tangent[-1, -2] = 1.0, -1.0
            off = np.append(mu * (r - self.mean) - spread, r[0] - r[-1] - height)
            try:
                step = np.linalg.solve(tangent, off)
            except np.linalg.LinAlgError:
                return None
            r, mu = r - step[:-1], float(mu - step[-1])
            if not (np.isfinite(r).all() and mu > 0):
                return None
            if np.abs(step[:-1]).max() <= CONVERGED * height:
                return (r, mu) if low < r.min() and r.max() < high else None
        return None

    def heights(self) -> Any:
        """Waves of growing heights, (height, r, mu), up to the last that is found."""
        height = SMALL * self._scale()
        found = self.newton(*self.linear(height), height)
        factor = GROWTH
        for _ in range(MOST_HEIGHTS):
            if found is None:
                return
            yield height, *found
            r, mu = found
            while factor - 1 > 1e-3:
                guess = self.mean + (r - self.mean) * factor
                found = self.newton(guess, mu, height * factor)
                if found is not None and np.argmax(found[0]) == 0:
                    break
                factor, found = math.sqrt(factor), None
            height *= factor

    def _scale(self) -> float:
        """Distance from the mean at which the stiffness has changed by half, or the domain ends."""
        low, high = self.spring.domain
        room = min(high - self.mean, self.mean - low)
        for size in SIZES[room > 2 * SIZES]:
            both = self.spring.derivative(2, self.mean + np.array([-size, size]))
            if not np.all(np.abs(both / self.rest - 1) < CHANGE):
                return float(size)
        return room if math.isfinite(room) else 1.0

    def at_height(self, height: float) -> tuple[Array, float]:
        """The wave of a height."""
        last = 0.0
        for reached, r, mu in self.heights():
            last = reached
            if reached * GROWTH >= height:
                guess = self.mean + (r - self.mean) * height / reached
                found = self.newton(guess, mu, height)
                if found is not None:
                    return found
        raise TensegrityError(f"no periodic wave of height {height:g} m: they end at {last:.6g} m")

    def at_speed(self, mu: float) -> tuple[Array, float]:
        """The wave of a speed, mu = m c^2."""
        before, first = None, float(self.symbol[1] * self.rest)
        reached = first
        for height, r, here in self.heights():
            if before is not None and (before[2] - mu) * (here - mu) <= 0:
                return self._between(before, (height, r, here), mu)
            if before is None and (here - mu) * (first - mu) <= 0:
                raise TensegrityError(
                    f"{self._words(mu)} is that of the linear wave: give a height"
                )
            before, reached = (height, r, here), here
        raise TensegrityError(
            f"{self._words(mu)}: no periodic wave of {2 * self.grid.half_length:g} sites; those "
            f"from the linear one on have m c^2 from {first:.9g} to {reached:.9g} N/m"
        )

    @staticmethod
    def _words(mu: float) -> str:
        return f"speed with m c^2 = {mu:.9g} N/m"

    def _between(self, one: Any, other: Any, mu: float) -> tuple[Array, float]:
        """The wave of a speed between those of two."""
        found: dict[float, tuple[Array, float]] = {one[0]: one[1:], other[0]: other[1:]}

        def above(height: float) -> float:
            if height not in found:
                near = min(found, key=lambda h: abs(h - height))
                r, here = found[near]
                wave = self.newton(self.mean + (r - self.mean) * height / near, here, height)
                if wave is None:
                    raise TensegrityError(f"{self._words(mu)}: no periodic wave is found")
                found[height] = wave
            return found[height][1] - mu

        return found[root(above, one[0], other[0])]

    def residual(self, r: Array, mu: float) -> float:
        """Largest residual over the largest force, on a grid twice as fine."""
        finer = Grid(2 * self.grid.points, self.grid.half_length)
        on = self.grid.moved(r, finer)
        low, high = self.spring.domain
        if not (low < on.min() and on.max() < high):
            return math.inf
        symbol = finer.box**2
        symbol[0] = 0.0
        tension = self.spring.tension(on)
        off = mu * (on - self.mean) - finer.apply(symbol, tension)
        return float(np.abs(off).max() / np.abs(tension).max())
