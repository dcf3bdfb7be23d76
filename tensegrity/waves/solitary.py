"""Exact solitary waves of a chain of equal masses and springs: `solitary_wave`.

A wave is computed to round-off from its speed, its peak elongation or its energy.  The equation
and its solution are in `travelling`, those of columns between heavy plates in `coupled`.  Sources:
G. Friesecke, J. Wattis, Commun. Math. Phys. 161, 391 (1994) (existence); the talk, part III.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check, plotting
from tensegrity.checked import checked
from tensegrity.errors import TensegrityError
from tensegrity.printing import Lines, Printed, drawn
from tensegrity.root import root
from tensegrity.scenes.chain import Chain, refuse_step
from tensegrity.scenes.network import Network
from tensegrity.scenes.scene import State
from tensegrity.springs.pair_law import PairLaw
from tensegrity.springs.potential import Potential
from tensegrity.typing import Array, Fraction
from tensegrity.unit_names import in_units
from tensegrity.waves.by_target import by_speed, near, sign_and_number, stiffness_above
from tensegrity.waves.cell_wave import cell_wave
from tensegrity.waves.cosines import Series
from tensegrity.waves.coupled import same, unit_of
from tensegrity.waves.family import Family, refined
from tensegrity.waves.multidomain import Integrals, may_cross_kink, multidomain_wave
from tensegrity.waves.pair_waves import Tail, line_wave
from tensegrity.waves.travelling import NoWaveError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LEAST_LEVEL = 1e-8  # of the peak, at which a width is computed
PLOTTED = 1e-3  # of the peak, where a picture ends


@dataclass(frozen=True, eq=False, repr=False)
class TravellingWave(Printed):
    """A wave of permanent form in a chain of equal masses and springs; see `SolitaryWave`."""

    potential: Potential | Network = field(repr=False)
    mass: float
    x: Array = field(repr=False)
    speed: float
    sound_speed: float
    excess: float
    family: str
    amplitude: Any
    energy: float
    momentum: float
    residual: float
    _shape: Series | Integrals = field(repr=False)
    tail: Tail | None = field(default=None, kw_only=True)

    if TYPE_CHECKING:
        _on_x: Array

        def reach(self, tail: float = ...) -> float: ...
        def width(self, level: float = ...) -> float: ...

    def elongation(self, x: ArrayLike) -> Array:
        """Elongation [m] at distances x from the peak (sites, any shape), by Fourier series.

        Raises `TensegrityError` if some x is not a number, as do `rate` and `displacement`.
        """
        return self._shape.elongation(check.numbers("x", x, "sites"))

    def rate(self, x: ArrayLike) -> Array:
        """du/dx [m per site] at distances x from the peak; the velocity is -speed du/dx."""
        return self._shape.rate(check.numbers("x", x, "sites"))

    def displacement(self, x: ArrayLike) -> Array:
        """Displacement u(x) [m], 0 far ahead of the peak (x > 0)."""
        return self._shape.displacement(check.numbers("x", x, "sites"))

    @property
    def strain(self) -> Array:
        """Strain on the grid `x`: elongation over the length of the spring, extension > 0; (n,)."""
        length = self.potential.length if isinstance(self.potential, Potential) else None
        if length is None:
            raise TensegrityError("no strain: the potential has no length; see elongation(x)")
        return self._on_x / length

    @property
    def speed_ratio(self) -> float:
        """Speed over sound speed; inf in a sonic vacuum."""
        return self.speed / self.sound_speed if self.sound_speed else math.inf

    @property
    def shift(self) -> Any:
        """Displacement of each mass after the wave has passed [m], > 0 in its direction; in a
        column of each coordinate, (2,)."""
        return self._shape.shift

    @checked
    def launch(
        self, chain: Chain | Network, at: float, direction: int = 1, tail: Fraction = 1e-12
    ) -> State:
        """The state of a chain that is at rest except for this wave.

        Parameters
        ----------
        chain : Chain or Network
            A chain or a column with this wave's spring and mass, at least where the wave is.
        at : float
            Position of the peak in sites: site j is at j, and the middle of bond j at j + 1/2.
        direction : int, optional
            1 towards higher sites, -1 towards lower ones.
        tail : float, optional
            Fraction of the peak below which the wave may be cut off at the chain's ends, < 1.

        Returns
        -------
        State
            Masses ahead of the wave have u = 0, those behind it u = `direction` times `shift`; if
            one end of the chain is fixed, u is 0 there instead.

        Raises
        ------
        TensegrityError
            The wave does not fit the chain's length, springs or masses, or both ends are fixed.

        Examples
        --------
        >>> from tensegrity import Chain, Prism, solitary_wave
        >>> chain = Chain(Prism(1.0, 0.7, 0.01, 1.0).potential(), 200)
        >>> wave = solitary_wave(chain.springs[0], speed_ratio=1.1)
        >>> f"{chain.energy(wave.launch(chain, at=60)) / wave.energy:.10f}"
        '1.0000000000'
        """
        wanted = Chain if isinstance(self.potential, Potential) else Network
        if not isinstance(chain, wanted):
            raise TensegrityError(f"chain is {type(chain).__name__}, not a {wanted.__name__}")
        if direction not in (-1, 1):
            raise TensegrityError(f"direction {direction} must be 1 or -1")
        self._check_place(chain, at, self.reach(tail), tail)
        x = np.arange(chain.sites) - at
        u, v = self.displacement(x), -direction * self.speed * self.rate(x)
        if direction == -1:
            u -= self.displacement(-math.inf)  # the masses ahead are those of lower index
        for site in chain.held:
            u -= u[site]
            v[site] = 0.0
        refuse_step(chain, u)
        return State(np.ascontiguousarray(u), v)

    def _check_place(self, chain, at, reach, tail):
        last = chain.sites - 1
        if at - reach < 0 or at + reach > last:
            raise TensegrityError(
                f"the wave at {at:g} falls to {tail:g} of its peak only {reach:.4g} sites away, "
                f"but the ends of the chain are {at:g} and {last - at:g} sites away"
            )
        if len(chain.held) == 2:
            raise TensegrityError(
                f"both ends of the chain are fixed, but the wave changes its length by "
                f"{-self.shift:g} m"
            )
        near = slice(math.floor(at - reach), math.ceil(at + reach) + 1)
        if isinstance(self.potential, Network):
            if not same(self.potential, unit_of(chain)):
                raise TensegrityError("the units of the column differ from those of the wave")
            return
        if any(s.at(0.0) != self.potential for s in chain.springs[near]):
            raise TensegrityError(f"the springs around {at:g} differ from that of the wave")
        if np.any(np.abs(chain.mass[near] / self.mass - 1) > 1e-15):
            raise TensegrityError(
                f"the masses around {at:g} differ from that of the wave, {self.mass:g} kg"
            )

    @property
    def _title(self):
        return f"solitary wave of {self.family}"

    def _texts(self):
        """The characteristics of the wave as text, by name."""
        ratio = f" = {self.speed_ratio:.6g} sound speeds" if self.sound_speed else ""
        return {
            "speed": f"{self.speed:.6g} sites/s{ratio}",
            "peak": f"{self.amplitude:.6g} m"
            if np.ndim(self.amplitude) == 0
            else ", ".join(f"{x:.6g}" for x in self.amplitude),
            "width": f"{self.width():.4g} sites at 5 % of the peak",
            "energy": f"{self.energy:.6g} J",
            "momentum": f"{self.momentum:.6g} kg m/s",
            "residual": f"{self.residual:.1e}",
        } | ({"tail": f"{self.tail.amplitude:.2g}"} if self.tail else {})

    def _lines(self) -> Lines:
        first, *others = (f"{name} {value}" for name, value in self._texts().items())
        yield f"{self._title}, {first}"
        yield from (", ".join(others[k : k + 2]) for k in range(0, len(others), 2))

    _draw = drawn

    def plot(self, ax: Axes | None = None) -> Axes:
        """Elongation against the distance from the peak, extension > 0.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            By default of a new figure.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        TensegrityError
            `ax` is not a Matplotlib axes.
        """
        drawn: Axes = plotting.axes(ax)
        near = np.abs(self.x) <= self.reach(PLOTTED)
        drawn.plot(self.x[near], self._on_x[near])
        drawn.set(xlabel="distance from the peak [sites]", ylabel=in_units("elongation [m]"))
        return drawn


class SolitaryWave(TravellingWave):
    """A solitary wave of a chain of equal masses and springs, computed by `solitary_wave`.

    Attributes
    ----------
    potential : Potential or Network
        Of a column the Network of one unit.
    mass : float
        Of each site [kg].
    x : ndarray, (n,)
        Grid of distances from the peak of the elongation, in sites, symmetric about 0.
    speed, sound_speed : float
        [sites/s].
    excess : float
        speed/sound_speed - 1, to full relative precision even if it is small; inf in a sonic
        vacuum.
    family : str
        Such as "compression" or "rarefaction 2"; the first family of a sign has no number.
    amplitude : float or ndarray, (dim,)
        Peak elongation [m], extension > 0: negative in a compression wave.  Of a column of each
        coordinate: differences of those that are free, values of others.
    energy : float
        Total energy [J].
    momentum : float
        Momentum [kg m/s] of a wave towards higher sites: positive in a compression wave; of a
        column that along the first coordinate.
    residual : float
        Largest |m c^2 r - K V'(r)| over the largest |V'(r)|, on a grid 4 times finer than that of
        the solution; K is the convolution of `travelling`.
    tail : Tail or None
        The wave train on both sides of a wave of units that turn; None where there is none.
    """

    @cached_property
    def _halves(self):
        """Elongation and rate at the points x >= 0 of the grid."""
        return self._shape.on_grid()

    @property
    def _on_x(self):
        half = self._halves[0].T
        return np.concatenate([half[:0:-1], half])

    @cached_property
    def _by_speed(self):
        return by_speed(self)

    @property
    def energy_slope(self) -> float:
        """dH/dc [J s/site] along the family, by one linear solve with the tangent of Newton's
        method; where it is 0, the wave's stability changes (Friesecke and Pego 2002).  Its
        error is 1e-9 or less of it, or about 1e-3 where the stiffness has a pole in the wave."""
        return self._by_speed[0]

    @checked
    def width(self, level: Fraction = 0.05) -> float:
        """Distance in sites between the two points where the elongation is `level` of the peak; of
        a column along the first coordinate."""
        peak = np.ravel(self.amplitude)[0]
        below = np.flatnonzero(np.atleast_2d(self._halves[0])[0] / peak < level)
        if below.size == 0 or level < LEAST_LEVEL:
            raise TensegrityError(f"level {level:g} must be at least {LEAST_LEVEL:g}")
        first = len(self.x) // 2 + below[0]
        places = self.x[first - 1], self.x[first]
        return 2 * root(lambda x: np.ravel(self.elongation(x))[0] / peak - level, *places, 1e-13)

    @checked
    def reach(self, tail: Fraction = 1e-12) -> float:
        """Distance from the peak [sites] beyond which the wave is below `tail` times the peak."""
        both = [np.abs(np.atleast_2d(half)).max(axis=0) for half in self._halves]
        left = np.maximum(*(half / half.max() for half in both)) >= tail
        return float(self.x[len(self.x) // 2 + np.flatnonzero(left)[-1]])


@checked
def solitary_wave(
    potential: Potential | Network | Sequence[Potential],
    mass: Any = 1.0,
    *,
    inner: Mapping[int, tuple[float, Potential]] | None = None,
    speed: float | None = None,
    speed_ratio: float | None = None,
    excess: float | None = None,
    amplitude: float | None = None,
    energy: float | None = None,
    family: str | None = None,
) -> Any:
    """The solitary wave of a chain of equal masses and springs, or of a cell, to round-off.

    Parameters
    ----------
    potential : Potential or Network
        Of each spring; or a line of equal units, such as `Prism.column(plates=...)` of one
        handedness, in which waves have several components.
    mass : float, optional
        Of each site [kg]; a line has its own.  Several springs or masses, one or one for each
        bond and site, are a cell that repeats, as in `dispersion`; it must have a mirror.
    inner : dict of int to (float, Potential), optional
        Mass [kg] and spring of what hangs on a site of the cell.
    speed, speed_ratio, excess, amplitude, energy : float
        Exactly one of: speed [sites/s]; speed over sound speed; that ratio minus 1, which keeps
        its relative precision near the sound speed; peak elongation [m], negative in compression;
        energy [J].  Of a line of units one of the first three, relative to the fastest sound.
    family : str, optional
        "compression" or "rarefaction"; by default that of the amplitude's sign, or the family that
        starts from zero amplitude: compression if the spring stiffens in compression.  A spring
        that stiffens in both directions carries the other family too, above a threshold.  A
        spring that stiffens, softens and stiffens again has several families of one sign (see
        `predict`): "rarefaction 2" is the second.  Without a number, the family is the one that
        contains the speed or amplitude, and for an energy the first.  A line has one of a sign.

    Returns
    -------
    SolitaryWave, or `CellWave` of a cell
        With a residual of at most 1e-12, where forces of turning units cancel of their round-off:
        1e-11, near sound 1e-9 at excesses of 1e-4.  Those of a line of units have its coordinates
        as a last axis.

    Raises
    ------
    TensegrityError
        Bad input, or no such wave exists; the message gives the reason.
    ResolutionError
        The wave exists, but the finest grid does not resolve it.
    LockingError
        The amplitude lies outside the domain of the potential.

    Notes
    -----
    If the peak is beyond a kink of the force, such as a loss of contact, the profile is solved on
    several subdomains (`tensegrity.waves.multidomain`): in seconds instead of a tenth of one.

    Examples
    --------
    >>> from tensegrity import Prism, solitary_wave
    >>> wave = solitary_wave(Prism(1.0, 0.7, 0.01, 1.0).potential(), speed_ratio=1.1)
    >>> f"{wave.family}, peak {wave.amplitude:.5f} m, {wave.width():.3f} sites wide"
    'compression, peak -0.01407 m, 5.588 sites wide'

    Between heavy plates a prism turns as it is extended, and the twist is part of the wave:

    >>> column = Prism(1.0, 0.7, 0.1, 1.0, 5.0, 50.0).column(3, "same", plates=(3.0, 0.577))
    >>> solitary_wave(column, speed_ratio=1.1).elongation(0.0).round(5)
    array([0.18162, 0.046  ])
    """
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
    if isinstance(potential, Network):
        fields = line_wave(potential, mass, family, name, value)
        return SolitaryWave(**fields)
    several = isinstance(mass, (list, tuple)) or (isinstance(mass, np.ndarray) and mass.ndim > 0)
    if several or inner is not None or isinstance(potential, (list, tuple)):
        return cell_wave(potential, mass, inner, name, value)
    mass = check.number("mass", mass, above=0, unit="kg")
    check.kind("potential", potential, Potential)
    if isinstance(potential, PairLaw):
        raise TensegrityError(
            "a wave of a pair law needs its inertias: give a row of it, Chain(pair, 2, mass=...)"
        )
    label, sound = f"{name} {value:g}", potential.sound_speed(mass)
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
            last = _wave(side, mass, sound, *_characteristics(profile, profile.residual()))
            raise TensegrityError(
                f"no solitary wave of {side.name} with {label}: the nearest one, at which the "
                f"family ends, has a peak of {last.amplitude:.6g} m, speed "
                f"{last.speed:.6g} sites/s and energy {last.energy:.6g} J"
            ) from None
    except TensegrityError:
        if not may_cross_kink(side, name, value):
            raise
        solution = multidomain_wave(side, name, value)
    return _wave(side, mass, sound, *solution)


def _characteristics(profile, residual):
    """m c^2 [N/m], m c^2/V''(0) - 1, amplitude [m], energy [J], residual and shape of a profile
    given by Fourier series."""
    law, grid = profile.law, profile.grid
    stiffness = profile.mu * law.secant
    rates = grid.box * (law.force * grid.coefficients(law.tension(profile.rho))) / stiffness
    bonds = law.reference * law.force * (grid.weights @ law.energy(profile.rho))
    masses = stiffness / 2 * np.sum(grid.weights * grid.values(rates) ** 2)
    gain = profile.nu / law.rest if law.rest else math.inf
    amplitude = float(law.reference * profile.rho[0])
    return stiffness, gain, amplitude, float(bonds + masses), residual, Series(grid, rates)


def _wave(side, mass, sound, stiffness, gain, amplitude, energy, residual, shape):
    """The wave of a family with these characteristics and this shape."""
    speed, half = math.sqrt(stiffness / mass), shape.grid.x
    return SolitaryWave(
        potential=side.potential, mass=mass, x=np.concatenate([-half[:0:-1], half]), speed=speed,
        sound_speed=sound, excess=math.expm1(math.log1p(gain) / 2), family=side.name,
        amplitude=amplitude, energy=energy, momentum=mass * speed * shape.shift,
        residual=residual, _shape=shape,
    )  # fmt: skip
