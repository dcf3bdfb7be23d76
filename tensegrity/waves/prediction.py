"""Existence and limits of the solitary waves of a spring, from its energy alone: `predict`.

Each statement is derived in `derivations.softening` under hypotheses that are checked here for the
given spring.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.errors import TensegrityError
from tensegrity.printing import Lines, Printed
from tensegrity.root import root
from tensegrity.springs.potential import Potential
from tensegrity.typing import Array, Fraction, Mass, Order, Positive
from tensegrity.waves.asymptotics import decay_rate, form, left_at_wall, small_errors, small_wave
from tensegrity.waves.curve import FamilyCurve, along, falling, stability_in_words
from tensegrity.waves.family import NEAREST, SIGNS, STEADY, Family
from tensegrity.waves.nonlinear_part import grows_from_rest, nonlinear_part

GROWTH = 1e-6  # relative growth of 2V/r^2 over the last factor of 2 in size that is unbounded
FARTHER = 2.0**11  # ratio of the two distances from the wall at which its exponent is computed
CLOSEST = 4e-3  # fraction of the stroke that remains at the peak of the largest computed wave


@dataclass(frozen=True, repr=False)
class Hypothesis(Printed):
    """A condition of a prediction.

    Attributes
    ----------
    statement : str
        The condition, in SI units.
    value : float
        The quantity that the condition is about.
    holds : bool
        Whether it is satisfied.
    """

    statement: str
    value: float
    holds: bool

    def _lines(self) -> Lines:
        yield f"{self.statement}: {self.value:.6g}, {'holds' if self.holds else 'FAILS'}"


@dataclass(frozen=True, repr=False)
class PredictedFamily(Printed):
    """A family of solitary waves between two limits.

    Attributes
    ----------
    name : str
        Value of the argument `family` of `solitary_wave`.
    starts : {"rest", "threshold"}
        At zero amplitude, or at the peak elongation `crests[0]`.
    ends : {"front", "tent", "largest speed", "end of the domain", "none"}
        "front": waves become flat plateaus bounded by fronts; "tent": the domain ends at a wall of
        unbounded energy, and the profile tends to a tent; "largest speed": the domain ends at a
        wall of bounded energy; "end of the domain": it ends at a finite force; "none": the family
        is unbounded.
    speeds : (float, float)
        Open range of the speeds [sites/s].
    crests : (float, float)
        Open range of the peak elongation [m], from the start of the family to its end; the first
        value is an estimate if the family starts at a threshold.
    top_rate : float
        Rate k [1/site] of the exponential departure of the profile from a plateau: the width grows
        by (2/k) log 10 when the peak comes ten times closer to its limit.  nan without a plateau.
    wall : (float, float)
        n and A of V = A y^-n at the distance y [m] from the end of the domain, A in J m^n; nan
        unless the family ends there.
    hypotheses : tuple of Hypothesis
        The conditions of the prediction.
    why : str
        The reasons for the start and the end of the family.
    """

    name: str
    starts: str
    ends: str
    speeds: tuple[float, float]
    crests: tuple[float, float]
    top_rate: float
    wall: tuple[float, float]
    hypotheses: tuple[Hypothesis, ...]
    why: str
    _potential: Potential = field(repr=False)
    _mass: float = field(repr=False)
    _rest: tuple[float, float, float] = field(repr=False)  # V'', V''', V'''' at rest
    _growth: tuple[float, float] = field(repr=False)  # p, d of V' = V''(0) r + side d |r|^p there

    @property
    def certain(self) -> bool:
        """Whether all hypotheses hold."""
        return all(h.holds for h in self.hypotheses)

    def curve(
        self,
        points: int = 14,
        *,
        speed: ArrayLike | None = None,
        speed_ratio: ArrayLike | None = None,
        excess: ArrayLike | None = None,
        amplitude: ArrayLike | None = None,
        energy: ArrayLike | None = None,
    ) -> FamilyCurve:
        """Speed, energy and width of exact waves along the family.

        Parameters
        ----------
        points : int, optional
            Number of waves if no target is given, at least 4: from close to the start of the
            family to close to its end, or far into the nonlinear range of an unbounded one.  Near
            a threshold, where the first amplitude is an estimate, waves that do not exist are
            omitted.
        speed, speed_ratio, excess, amplitude, energy : array_like, (waves,), optional
            At most one target: a value for each wave, as for `solitary_wave`.

        Returns
        -------
        FamilyCurve

        Raises
        ------
        TensegrityError
            More than one target, or no wave has a given value.

        Examples
        --------
        >>> from tensegrity import Prism, predict
        >>> spring = Prism(base=1.0, height=0.7, prestrain=0.01, k_cross=1.0).potential()
        >>> curve = predict(spring)["compression"].curve(speed_ratio=[1.1, 1.5, 2.0])
        >>> curve.width.round(2).tolist()
        [5.59, 3.14, 2.68]
        """
        given = {
            "speed": speed, "speed_ratio": speed_ratio, "excess": excess, "amplitude": amplitude,
            "energy": energy,
        }  # fmt: skip
        return along(self._potential, self._mass, self.name, self.crests, self.ends, points, given)

    def unstable(self, points: int = 28) -> tuple[tuple[float, float], ...]:
        """Ranges of the speed in which waves are unstable because their energy decreases with it.

        Parameters
        ----------
        points : int, optional
            Number of waves of the `curve` between which changes are sought.

        Returns
        -------
        tuple of (float, float)
            [sites/s] in the order of the amplitudes, to about 1e-9; see `curve.falling`.
        """
        return falling(self.curve(points), self.name, self.speeds)

    @cached_property
    def stability(self) -> str:
        """The result of `unstable` from fewer waves, as text; computed once, in 0.1 to 2 s."""
        return stability_in_words(self.unstable)

    @checked
    def small(self, x: ArrayLike, excess: Fraction, order: Order = 1) -> Array:
        """Elongation of a small wave, of 1 to 3 terms; see `sech2`.

        Parameters
        ----------
        x : array_like
            Distance from the peak, in sites.
        excess : float
            c/cs - 1, below 1.
        order : int, optional

        Returns
        -------
        ndarray, shape of x
            [m].

        Raises
        ------
        TensegrityError
            As of `sech2`, or no waves of this family start from rest.
        """
        if self.starts != "rest":
            raise TensegrityError(f"no small wave: {self.name} starts at a {self.starts}")
        sign = SIGNS[self.name.split()[0]]
        return small_wave(self._potential, excess * (2 + excess), x, order, sign)

    @cached_property
    def small_errors(self) -> tuple[float, ...]:
        """Limits of the largest error of `small` over peak kappa^(2 order) as the excess tends to
        0, of orders 1 to 3, of order 1 where V is even; kappa as of `sech2`.

        Raises `TensegrityError` as `small` does.
        """
        self.small(0.0, 0.5)  # refuses
        return small_errors(self._potential)

    @checked
    def small_peak(self, excess: Positive) -> float:
        """Peak elongation [m] of a wave with c/cs - 1 = `excess`, to second order in `excess`.

        To leading order if V'''(0) is 0 or jumps.  Raises `TensegrityError` if no waves start from
        rest, or the sound speed is 0.
        """
        if excess >= 1:
            raise TensegrityError(f"excess {excess:g} must be below 1: the wave is not small")
        stiffness, slope, bend = self._rest
        power, growth = self._growth
        if self.starts != "rest" or not stiffness > 0 or math.isnan(growth):
            raise TensegrityError(
                f"no small wave: waves of {self.name} start at {self.starts}, where the stiffness "
                f"{stiffness:g} N/m must be above 0 and increase like a power of the elongation"
            )
        if slope and not math.isnan(slope):
            return float(form("small_peak")(stiffness, slope, bend, excess))
        size = float(form("small_peak_of_power")(stiffness, excess, power, growth))
        return SIGNS[self.name.split()[0]] * size

    @checked
    def wall_peak(self, speed: Annotated[float, "> 0", "sites/s"]) -> float:
        """Peak elongation [m] of a fast wave [sites/s] of a family that ends with a tent.

        The relative error of the distance to the wall is O(1/c).  Raises `TensegrityError` for
        other families.
        """
        power, strength = self.wall
        if self.ends != "tent" or not power > 0:
            raise TensegrityError(
                f"no tent: the family of {self.name} ends with {self.ends}, or the energy at its "
                "wall is not a power y^-n"
            )
        stroke = abs(self.crests[1])
        left = left_at_wall(power, strength, stroke, speed, self._mass)
        return math.copysign(stroke - left, self.crests[1])

    def _lines(self) -> Lines:
        low, high = self.speeds
        first, last = self.crests
        start = f"about {first:.6g} m" if self.starts == "threshold" else "0"
        end = "no end" if self.ends == "none" else self.ends
        yield f"{self.name} waves:"
        yield f"  peak elongation from {start} ({self.starts}) to {last:.6g} m ({end})"
        yield f"  speed from {low:.6g} to {high:.6g} sites/s"
        yield from (f"  {words}" for words in (self.stability, self.why, *self.hypotheses))


@dataclass(frozen=True, repr=False)
class Prediction(Printed):
    """The families of solitary waves of a chain of equal masses and springs.

    Attributes
    ----------
    potential : Potential
    mass : float
        Of each site [kg].
    sound_speed : float
        [sites/s].
    families : tuple of PredictedFamily
        In each sign in the order of their speeds.
    absent : dict of str to str
        For a sign without solitary waves, "compression" or "rarefaction", the reason.
    """

    potential: Potential = field(repr=False)
    mass: float
    sound_speed: float
    families: tuple[PredictedFamily, ...]
    absent: dict[str, str]

    def __getitem__(self, name: str) -> PredictedFamily:
        for family in self.families:
            if family.name == name:
                return family
        known = ", ".join(f.name for f in self.families) or "none"
        raise TensegrityError(f"family {check.shown(name)} is not one of {known}")

    def _lines(self) -> Lines:
        yield (
            f"solitary waves for masses of {self.mass:g} kg, by the energy V of a spring at the "
            f"elongation r; speed of sound {self.sound_speed:.6g} sites/s"
        )
        yield from (*map(str, self.families), *self.absent.values())


@checked
def predict(potential: Potential, mass: Mass = 1.0) -> Prediction:
    """The families of solitary waves that a chain carries, with their limits and the reasons.

    Parameters
    ----------
    potential : Potential
        Of each spring, in equilibrium at r = 0.
    mass : float, optional
        Of each site [kg].

    Returns
    -------
    Prediction

    Raises
    ------
    TensegrityError
        Bad input, or a spring that is not in stable equilibrium at r = 0.

    Notes
    -----
    No wave is computed, with one exception: the largest speed of a family that ends at a wall of
    finite energy is the limit of computed waves (`tensegrity.waves.by_target.largest_speed`).

    Examples
    --------
    >>> from tensegrity import Prism, predict
    >>> prediction = predict(Prism(1.0, 0.7, 0.01, 1.0).potential())
    >>> for family in prediction.families:
    ...     low, high = family.speeds
    ...     print(f"{family.name} from {family.starts}: {low:.3f} to {high:.3f} sites/s")
    compression from rest: 0.550 to 3.513 sites/s
    rarefaction from threshold: 0.550 to 2.941 sites/s
    """
    families, absent = [], {}
    nonlinear_part(potential)  # says where the spring is not at rest
    sound = potential.sound_speed(mass)  # refuses one that does not return to it
    for name, sign in SIGNS.items():
        try:
            first = Family(potential, sign)
        except TensegrityError as error:
            absent[name] = f"{error}."
            continue
        sides = [first, *(Family(potential, sign, k) for k in range(1, len(first.rising_parts)))]
        families += [_predicted(side, mass) for side in sides]
    return Prediction(potential, mass, sound, tuple(families), absent)


def _predicted(side: Family, mass: float) -> PredictedFamily:
    part, sign = side.rising_part, side.sign
    from_rest = part.start == 0
    first = 0.0 if from_rest else _first_peak(side)
    why = [_describe_start(side, from_rest)]
    holds = [] if math.isinf(part.ceiling) else [
        Hypothesis(
            "V''(r*) > 0 where 2V/r^2 is largest, or V'' = 0 beyond it", side.top_stiffness,
            side.ends_in_plateau or _is_constant_beyond(side),
        )
    ]  # fmt: skip
    rate, wall, last = math.nan, (math.nan, math.nan), sign * part.top
    if math.isfinite(part.ceiling):
        ends, top = "front", part.ceiling
        why.append("2V/r^2 has a maximum, at which the waves become plateaus of unbounded width")
        if side.ends_in_plateau:
            why[-1] += f", between fronts from 0 to {last:.9g} m (`transition_wave`)"
            rate = decay_rate((side.rest + top) / side.top_stiffness - 1)
        else:
            why.append(_describe_degenerate_front(side))
    elif math.isfinite(side.end):
        ends, wall, top, reason = _wall(side)
        why.append(reason)
        last = sign * side.end
        if ends == "tent":
            power = not math.isnan(wall[0])
            holds.append(Hypothesis("V ~ A y^-n at the end of the domain, n >= 0", wall[0], power))
    else:
        level = 2 * side.energy / side.sizes**2
        grows = level[-1] - np.interp(side.sizes[-1] / 2, side.sizes, level)
        bounded = grows < GROWTH * (side.rest + abs(level[-1]))
        ends, top, last = "none", float(level[-1]) if bounded else math.inf, sign * math.inf
        why.append(f"2V/r^2 increases {'to a bound' if bounded else 'without bound'}")
    speeds = [math.sqrt((side.rest + above) / mass) for above in (part.floor, top)]
    smooth = side.nonlinear.rest, side.nonlinear.slope, side.nonlinear.bend
    return PredictedFamily(
        side.name, "rest" if from_rest else "threshold", ends, (speeds[0], speeds[1]),
        (first, last), rate, wall, tuple(holds), "; ".join(why), side.potential, mass, smooth,
        side.nonlinear.growth(sign),
    )  # fmt: skip


def _is_constant_beyond(side: Family) -> bool:
    """Whether the force is constant beyond the maximum of 2V/r^2."""
    return side.top_stiffness == side.stiffness_from_top(1.01) == 0


def _describe_degenerate_front(side: Family) -> str:
    """The behaviour of a family of waves near a front at which V'' <= 0."""
    if side.top_stiffness < 0:
        return "but V'' < 0 there: no plateau forms, and speeds may exceed the limit"
    if _is_constant_beyond(side):
        return "V'' = 0 beyond it: plateaus are exactly flat, of a width that their energy sets"
    return "but V'' = 0 there: the approach to the plateau is not exponential"


def _describe_start(side: Family, from_rest: bool) -> str:
    if side.rest == 0:
        return "a sonic vacuum: there are waves of every amplitude"
    if from_rest and grows_from_rest(side.nonlinear, side.sign):
        power, _ = side.nonlinear.growth(side.sign)
        terms = {2.0: "V'''(0)", 3.0: "V''''(0), with V'''(0) = 0,"}
        term = terms.get(power, f"a nonlinear force proportional to |r|^{power:g}")
        return f"{term} stiffens the spring on this side: there are waves of any small amplitude"
    level = "its value at rest" if side.rising_part.floor == 0 else "that of the preceding front"
    return f"2V/r^2 exceeds {level} only beyond |r| = {side.rising_part.start:.6g} m: a threshold"


def _first_peak(side: Family) -> float:
    """Peak elongation [m] at which the long-wave equation gives the family's lowest speed."""
    below = side.sizes <= side.rising_part.start
    level = side.long_wave[below]
    slower = np.flatnonzero(level <= side.rising_part.floor)
    sizes = side.sizes[below]
    if not slower.size or slower[-1] + 1 >= sizes.size:
        return side.sign * side.rising_part.start
    ends = sizes[slower[-1]], sizes[slower[-1] + 1]
    floor = side.rising_part.floor
    return side.sign * root(lambda x: float(side.long_wave_at(x)) - floor, *ends, relative=1e-12)


def _wall(side: Family) -> tuple[str, tuple[float, float], float, str]:
    """The end of a family at the end of the domain: its kind, (n, A), m c^2 - V''(0) [N/m], and a
    description."""
    near, nearest = side.exponent_at_end(NEAREST), NEAREST
    while not math.isfinite(near):  # the force overflows so close to a steep wall
        near, nearest = side.exponent_at_end(4 * nearest), 4 * nearest
    if near > 1 - STEADY and not side.finite_at_end:
        far = side.exponent_at_end(min(FARTHER * nearest, 0.5))
        n = near - 1 if abs(near - far) < STEADY * near else math.nan
        n = float(np.round(n)) if abs(n - np.round(n)) < STEADY / 4 else n
        y = nearest * side.end
        force = abs(float(side.potential.tension(side.sign * (side.end - y))))
        strength = force * y ** (n + 1) / n if n > 0 else math.nan
        return "tent", (n, strength), math.inf, (
            "the energy is unbounded at the end of the domain: fast waves tend to the tent profile"
        )  # fmt: skip
    above = side.stiffness_at_end(CLOSEST) - side.rest
    kind = "end of the domain" if side.finite_at_end else "largest speed"
    force = "finite" if side.finite_at_end else "unbounded"
    return kind, (math.nan, math.nan), above, (
        f"the domain ends at a finite energy and {force} force, which limits the speed"
    )  # fmt: skip
