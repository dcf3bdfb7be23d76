"""Speed, energy and width along a family of solitary waves, `along`, and its `largest_speed`.

Waves of a family are ordered by the size of their amplitude; speed and energy increase along it,
except near a threshold.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.branches.table import Table
from tensegrity.checked import checked
from tensegrity.errors import TensegrityError
from tensegrity.printing import printed
from tensegrity.root import root
from tensegrity.springs.potential import Potential
from tensegrity.typing import Array, Flags, Mass
from tensegrity.waves.by_target import sign_and_number
from tensegrity.waves.family import STROKE, Family
from tensegrity.waves.nonlinear_part import nonlinear_part
from tensegrity.waves.solitary import SolitaryWave, solitary_wave

if TYPE_CHECKING:
    from matplotlib.axes import Axes


FAR, FARTHER = 8.0, 1.5  # end of an unbounded family over the scale, and its first amplitude
WITHOUT_SCALE = 4.0  # m: its end where all waves are similar
NEAR_START, HALF, NEAR_END = 3e-3, 0.5, 0.4  # fractions of the range of amplitudes
FEW = 12  # waves from which the stability of a family is described
CLOSE = 1e-12  # of the amplitude at which the energy is least or largest
COLUMNS = "amplitude", "speed", "excess", "energy", "momentum", "width", "residual"
AT_FRONT, AT_WALL = 1e-5, 1e-2  # parts of it that are left at a front and at other ends


class WaveTable(Table):
    """Waves along a family."""

    _units: ClassVar = {"amplitude": "m", "speed": "sites/s", "energy": "J", "momentum": "kg m/s",
                        "width": "sites"}  # fmt: skip


@dataclass(frozen=True, eq=False)
class FamilyCurve:
    """Waves along a family; arrays of shape (waves,).

    Attributes
    ----------
    amplitude : ndarray
        Elongation of the peak [m], extension > 0.
    speed, excess : ndarray
        [sites/s]; speed over sound speed, less 1.
    energy, momentum : ndarray
        [J], [kg m/s].
    width : ndarray
        [sites] at 5 % of the peak.
    residual : ndarray
        As of `SolitaryWave`.
    waves : tuple of SolitaryWave
    """

    amplitude: Array
    speed: Array
    excess: Array
    energy: Array
    momentum: Array
    width: Array
    residual: Array
    waves: tuple[SolitaryWave, ...] = field(repr=False)

    __str__ = printed(amplitude="m", speed="sites/s", energy="J", momentum="kg m/s", width="sites")
    __repr__ = __str__

    def __len__(self) -> int:
        return len(self.waves)

    @cached_property
    def energy_slope(self) -> Array:
        """As of `SolitaryWave` [J s/site]."""
        return np.array([wave.energy_slope for wave in self.waves])

    @property
    def stable(self) -> Flags:
        """Whether the energy increases with the speed, (waves,): a wave for which it does not is
        unstable.  `floquet` of a wave takes all perturbations into account."""
        return self.energy_slope > 0

    def plot(self, ax: Axes | None = None, *, x: str = "speed", y: str = "amplitude") -> Axes:
        """Draw one quantity against another, dashed where waves are not `stable`.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            By default of a new figure.
        x, y : str, optional
            Names of two of the arrays.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        TensegrityError
            `ax` is not a Matplotlib axes, or a name is not that of an array.
        """
        columns = {name: getattr(self, name) for name in COLUMNS} | {"stable": self.stable}
        return WaveTable(columns, (), "").plot(ax, x=x, y=y)


def along(
    potential: Potential,
    mass: float,
    family: str,
    peaks: tuple[float, float],
    ends: str,
    points: int,
    given: dict[str, ArrayLike | None],
) -> FamilyCurve:
    """Solitary waves along a family, at given values of one target of `solitary_wave`; by default
    at amplitudes that cover the whole family.  See `PredictedFamily.curve`.

    Parameters
    ----------
    potential : Potential
        Of each bond.
    mass : float
        Of each site [kg].
    family : str
    peaks : (float, float)
        First and last amplitude of the family [m], extension > 0.
    ends : str
        How the family ends, as of `PredictedFamily`.
    points : int
        Number of waves where no target is given, >= 4.
    given : dict of str to array_like or None
        Values of the targets, at most one of which is not None.

    Returns
    -------
    FamilyCurve

    Raises
    ------
    TensegrityError
        More than one target, values that are not a sequence, or a value without a wave.
    """
    points = check.whole("points", points, least=4)
    targets = {name: value for name, value in given.items() if value is not None}
    if len(targets) > 1:
        raise TensegrityError(f"{' and '.join(targets)} given: give at most one of them")
    whole = not targets
    scale = nonlinear_part(potential).scale
    far = FAR * scale if math.isfinite(scale) else WITHOUT_SCALE
    ((name, wanted),) = (targets or {"amplitude": amplitudes(*peaks, ends, points, far)}).items()
    values = check.floats(name, wanted)
    if values.ndim != 1 or not values.size:
        raise TensegrityError(f"{name} has shape {values.shape}, must be (n,), n > 0")
    waves = []
    for value in values.tolist():
        try:
            waves.append(solitary_wave(potential, mass, family=family, **{name: value}))
        except TensegrityError:
            if not whole:
                raise
    return _table(tuple(waves))


def falling(
    curve: FamilyCurve, family: str, speeds: tuple[float, float]
) -> tuple[tuple[float, float], ...]:
    """Ranges of the speed [sites/s] in which the energy decreases with it.

    There a wave has one real multiplier above 1 (G. Friesecke, R. Pego, Nonlinearity 15, 1343
    (2002)); `floquet` finds all of them.

    Parameters
    ----------
    curve : FamilyCurve
        Changes of the sign of dH/dc are sought between its waves.
    family : str
    speeds : (float, float)
        Limits of the speed, at which a range ends that contains the first or the last wave.

    Returns
    -------
    tuple of (float, float)
        In the order of the amplitudes.

    Raises
    ------
    TensegrityError
        The curve has no waves.
    """
    if not len(curve):
        raise TensegrityError(f"no wave of {family} was found")
    law, mass, stable = curve.waves[0].potential, curve.waves[0].mass, curve.stable

    def at(amplitude: float) -> SolitaryWave:
        return solitary_wave(law, mass, amplitude=amplitude, family=family)

    ends = [] if stable[0] else [speeds[0]]
    for k in np.flatnonzero(stable[1:] != stable[:-1]):
        low, high = curve.amplitude[k : k + 2].tolist()
        ends.append(at(root(lambda a: at(a).energy_slope, low, high, CLOSE * abs(high))).speed)
    ends += [] if stable[-1] else [speeds[1]]
    return tuple(zip(ends[::2], ends[1::2], strict=True))


def stability_in_words(unstable: Callable[[int], tuple[tuple[float, float], ...]]) -> str:
    """Text on the ranges of unstable waves.

    Parameters
    ----------
    unstable : callable (points) -> ranges of the speed [sites/s]
        As of `PredictedFamily`.

    Returns
    -------
    str
    """
    try:
        intervals = unstable(FEW)
    except TensegrityError as error:
        return f"stability is not known: {error}"
    if not intervals:
        return "no unstable wave was found: the energy increases with the speed"
    ranges = " and ".join(f"from {low:.6g} to {high:.6g} sites/s" for low, high in intervals)
    return f"unstable {ranges}, where the energy decreases with the speed"


def amplitudes(first: float, last: float, ends: str, points: int, far: float) -> Array:
    """Amplitudes along a family, refined towards both of its limits.

    Parameters
    ----------
    first, last : float
        Limits of the amplitude [m], extension > 0.
    ends : str
        How the family ends, as of `PredictedFamily`.
    points : int
    far : float
        In place of an infinite limit, or 1.5 times the first one if that is larger [m].

    Returns
    -------
    ndarray, (points,)
        [m].
    """
    if math.isinf(last):
        last = math.copysign(max(far, FARTHER * abs(first)), last)
    near = np.geomspace(NEAR_START, HALF, points // 2)
    left = AT_FRONT if ends == "front" else AT_WALL
    parts = np.concatenate([near, 1 - np.geomspace(NEAR_END, left, points - near.size)])
    return first + (last - first) * parts


def _table(waves: tuple[SolitaryWave, ...]) -> FamilyCurve:
    names = [name for name in COLUMNS if name != "width"]
    columns = {name: np.array([getattr(wave, name) for wave in waves]) for name in names}
    return FamilyCurve(width=np.array([wave.width() for wave in waves]), waves=waves, **columns)


@checked
def largest_speed(
    potential: Potential,
    mass: Mass = 1.0,
    family: str | None = None,
    closest: Annotated[float, f">= {1 - STROKE}", "<= 0.1"] = 1e-3,
) -> float:
    """The limiting speed of a family of waves.

    Parameters
    ----------
    potential, mass, family
        As in `solitary_wave`.
    closest : float, optional
        Fraction of the stroke that remains at the peak of the largest computed wave; 0.0005 to 0.1.

    Returns
    -------
    float
        [sites/s]: for a spring that locks, the limit as the peak approaches locking; for one that
        softens, the speed of a front; for a domain that ends at a finite force, the speed of the
        wave whose peak is at that end.

    Raises
    ------
    TensegrityError
        No such wave exists, or the speeds are unbounded.

    Notes
    -----
    Near locking the force is proportional to the inverse square root of the remaining stroke; the
    speed is extrapolated in that root, to a relative error of about 1e-5, which a second value of
    `closest` estimates.
    """
    sign, number = sign_and_number(potential, family, None)
    side = Family(potential, sign, number or 0)
    if math.isfinite(side.rising_part.ceiling):
        return math.sqrt((side.rest + side.rising_part.ceiling) / mass)
    if math.isinf(side.end):
        raise TensegrityError("no largest speed: the spring does not lock (its domain is open)")
    return math.sqrt(side.stiffness_at_end(closest) / mass)
