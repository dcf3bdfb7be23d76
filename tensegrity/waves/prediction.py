"""What solitary waves a spring carries, before any is computed: `predict`.

Each statement is derived in `derivations.softening`, under hypotheses that are checked here for
the spring at hand.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.once import once
from tensegrity.root import root
from tensegrity.springs.potential import Potential
from tensegrity.waves.asymptotics import sound_speed
from tensegrity.waves.family import NEAREST, SIGNS, STEADY, Family
from tensegrity.waves.nonlinear_part import grows_from_rest, nonlinear_part
from tensegrity.waves.travelling import decay_rate

GROWTH = 1e-6  # relative rise of Q over the last factor of 2 in size, where it has no bound
FARTHER = 2.0**11  # times what is left there, where the exponent is taken again
CLOSEST = 4e-3  # of the stroke, left to the largest wave of a family that ends at a wall


@dataclass(frozen=True)
class Hypothesis:
    """A condition of a prediction.

    Attributes
    ----------
    statement : str
    value : float
        Of what it is about.
    holds : bool
    """

    statement: str
    value: float
    holds: bool

    def __str__(self) -> str:
        return f"{self.statement}: {self.value:.6g}, {'holds' if self.holds else 'FAILS'}"


@dataclass(frozen=True)
class PredictedFamily:
    """Solitary waves between two limits.

    Attributes
    ----------
    name : str
        As `solitary_wave(family=)` takes it.
    starts : {"rest", "threshold"}
        With zero amplitude, or with the crest `crests[0]`.
    ends : {"front", "tent", "largest speed", "end of the domain", "none"}
        With flat tops at a front; at a wall of unbounded energy; at a wall of bounded energy;
        where the domain ends at a finite force; not at all.
    speeds : (float, float)
        Open range [sites/s].
    crests : (float, float)
        Open range of the crest's elongation [m], from where the family starts to where it ends;
        the first is an estimate where it starts at a threshold.
    top_rate : float
        Rate k [1/site] at which a wave leaves a flat top: the width grows by (2/k) log 10 for a
        crest ten times closer.  nan without one.
    wall : (float, float)
        n and A of V = A y^-n at the distance y [m] from the end of the domain, A in J m^n; nan
        where the family does not end there.
    hypotheses : tuple of Hypothesis
    why : str
        In words.
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
    _mass: float = field(repr=False)
    _rest: tuple[float, float, float] = field(repr=False)  # V'', V''', V'''' at rest
    _growth: tuple[float, float] = field(repr=False)  # p, d of V' = V''(0) r + side d |r|^p there

    @property
    def certain(self) -> bool:
        """Whether all hypotheses hold."""
        return all(h.holds for h in self.hypotheses)

    def small_crest(self, excess: float) -> float:
        """Crest [m] of a wave with c/cs - 1 = `excess`, to second order in it.

        To leading order where V'''(0) is 0 or jumps.  Raises `TensegrityError` where no waves start
        from rest, or the sound speed is 0.
        """
        excess = check.number("excess", excess, above=0)
        if excess >= 1:
            raise TensegrityError(f"excess {excess:g} must be below 1: the wave is not small")
        stiffness, slope, bend = self._rest
        power, growth = self._growth
        if self.starts != "rest" or not stiffness > 0 or math.isnan(growth):
            raise TensegrityError(
                f"no small wave: waves of {self.name} start at {self.starts} with stiffness "
                f"{stiffness:g} N/m there, which must be above 0 and grow by a power"
            )
        if slope and not math.isnan(slope):
            return float(_form("small_crest")(stiffness, slope, bend, excess))
        size = float(_form("small_crest_of_power")(stiffness, excess, power, growth))
        return SIGNS[self.name.split()[0]] * size

    def wall_crest(self, speed: float) -> float:
        """Crest [m] of a fast wave [sites/s] of a family that ends at the tent; error O(1/c).

        That error is one of the distance to the wall, relative.  Raises `TensegrityError` for
        other families.
        """
        speed = check.number("speed", speed, above=0, unit="sites/s")
        power, strength = self.wall
        if self.ends != "tent" or not power > 0:
            raise TensegrityError(
                f"no tent: the family of {self.name} ends with {self.ends}, or its wall is no "
                "power y^-n"
            )
        stroke, beta = abs(self.crests[1]), float(_form("delay")(power))

        scale = math.log(4 * strength / self._mass) - 2 * math.log(speed)

        def mismatch(log_left: float) -> float:
            sigma = stroke - beta * math.exp(log_left)
            return scale - 2 * math.log(sigma) - power * log_left

        high = math.log(stroke / max(beta, 1.0) * (1 - 1e-9))
        low = min((scale - 2 * math.log(stroke)) / power - 1.0, high - 1.0)
        if mismatch(high) > 0:
            raise TensegrityError(f"speed {speed:g} sites/s is too slow for the limit of the tent")
        left = math.exp(root(mismatch, low, high, 1e-14))
        return math.copysign(stroke - left, self.crests[1])

    def __str__(self) -> str:
        low, high = self.speeds
        first, last = self.crests
        about = "about " if self.starts == "threshold" else ""
        return "\n".join(
            [
                f"{self.name}: from {self.starts} to {self.ends}",
                f"  speeds {low:.6g} to {high:.6g} sites/s, crests {about}{first:.6g} to "
                f"{last:.6g} m",
                f"  {self.why}",
                *(f"  {h}" for h in self.hypotheses),
            ]
        )


@dataclass(frozen=True)
class Prediction:
    """The families of solitary waves of a chain of equal masses and springs.

    Attributes
    ----------
    potential : Potential
    mass : float
        [kg].
    sound_speed : float
        [sites/s].
    families : tuple of PredictedFamily
    absent : dict
        Why there is none, by the sign that has none: "compression", "rarefaction".
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

    def __str__(self) -> str:
        missing = [f"{name}: none. {why}" for name, why in self.absent.items()]
        return "\n".join([*map(str, self.families), *missing])


def predict(potential: Potential, mass: float = 1.0) -> Prediction:
    """Which solitary waves a chain carries, between which limits, and why.

    Parameters
    ----------
    potential : Potential
        Of all springs, at rest at r = 0.
    mass : float, optional
        Of each site [kg].

    Returns
    -------
    Prediction

    Raises
    ------
    TensegrityError
        Bad input.

    Notes
    -----
    Nothing is integrated; only where a family ends at a wall of finite energy its largest
    speed is that of a limit of computed waves (`tensegrity.waves.solitary.largest_speed`).
    """
    check.kind("potential", potential, Potential)
    mass = check.number("mass", mass, above=0, unit="kg")
    families, absent = [], {}
    nonlinear_part(potential)  # says where the spring is not at rest
    sound = sound_speed(potential, mass)  # refuses one that does not return to it
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
    first = 0.0 if from_rest else _first_crest(side)
    why = [_describe_start(side, from_rest)]
    holds = [] if math.isinf(part.ceiling) else [
        Hypothesis(
            "V''(r*) > 0 where 2V/r^2 is largest, or V'' = 0 from there on", side.top_stiffness,
            side.ends_in_plateau or _is_constant_beyond(side),
        )
    ]  # fmt: skip
    rate, wall, last = math.nan, (math.nan, math.nan), sign * part.top
    if math.isfinite(part.ceiling):
        ends, top = "front", part.ceiling
        why.append("2V/r^2 has a maximum, at which tops grow flat and endless")
        if side.ends_in_plateau:
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
        why.append(f"2V/r^2 rises on and on, {'to a bound' if bounded else 'without bound'}")
    speeds = [math.sqrt((side.rest + above) / mass) for above in (part.floor, top)]
    smooth = side.nonlinear.rest, side.nonlinear.slope, side.nonlinear.bend
    return PredictedFamily(
        side.name, "rest" if from_rest else "threshold", ends, (speeds[0], speeds[1]),
        (first, last), rate, wall, tuple(holds), "; ".join(why), mass, smooth,
        side.nonlinear.growth(sign),
    )  # fmt: skip


def _is_constant_beyond(side: Family) -> bool:
    """Whether the force is constant from where 2V/r^2 is largest on."""
    return side.top_stiffness == side.stiffness_from_top(1.01) == 0


def _describe_degenerate_front(side: Family) -> str:
    """What the tops of a family do whose front is at a state with V'' <= 0."""
    if side.top_stiffness < 0:
        return "but V'' < 0 there: tops do not grow flat, speeds may pass the limit"
    if _is_constant_beyond(side):
        return "V'' = 0 from there on: tops are flat and as wide as their energy asks"
    return "but V'' = 0 there: there is no rate at which tops grow flat"


def _describe_start(side: Family, from_rest: bool) -> str:
    if side.rest == 0:
        return "a sonic vacuum: any amplitude has its wave"
    if from_rest and grows_from_rest(side.nonlinear, side.sign):
        power, _ = side.nonlinear.growth(side.sign)
        turns = {2.0: "V'''(0)", 3.0: "V''''(0), with V'''(0) = 0,"}
        turn = turns.get(power, f"a force beyond the linear one that goes like |r|^{power:g}")
        return f"{turn} stiffens the spring on this side, so waves start from zero"
    level = "that of rest" if side.rising_part.floor == 0 else "that of the front before"
    return (
        f"2V/r^2 rises above {level} only beyond |r| = {side.rising_part.start:.6g} m: a threshold"
    )


def _first_crest(side: Family) -> float:
    """Where the long-wave equation has the level from which the family starts."""
    below = side.sizes <= side.rising_part.start
    level = side.long_wave[below]
    slower = np.flatnonzero(level <= side.rising_part.floor)
    sizes = side.sizes[below]
    if not slower.size or slower[-1] + 1 >= sizes.size:
        return side.sign * side.rising_part.start
    low, high = sizes[slower[-1]], sizes[slower[-1] + 1]
    return side.sign * root(
        lambda size: float(side.long_wave_at(size)) - side.rising_part.floor,
        low,
        high,
        relative=1e-12,
    )


def _wall(side: Family) -> tuple[str, tuple[float, float], float, str]:
    """How a family ends with the domain: a kind, (n, A), m c^2 - V''(0), and words."""
    near, nearest = side.exponent_at_end(NEAREST), NEAREST
    while not math.isfinite(near):  # a wall so steep that its forces are beyond all numbers there
        near, nearest = side.exponent_at_end(4 * nearest), 4 * nearest
    if near > 1 - STEADY and not side.finite_at_end:
        far = side.exponent_at_end(min(FARTHER * nearest, 0.5))
        n = near - 1 if abs(near - far) < STEADY * near else math.nan
        n = float(np.round(n)) if abs(n - np.round(n)) < STEADY / 4 else n
        y = nearest * side.end
        force = abs(float(side.potential.tension(side.sign * (side.end - y))))
        strength = force * y ** (n + 1) / n if n > 0 else math.nan
        return "tent", (n, strength), math.inf, (
            "the energy has no bound at the end of the domain: fast waves tend to the tent"
        )  # fmt: skip
    above = side.stiffness_at_end(CLOSEST) - side.rest
    kind = "end of the domain" if side.finite_at_end else "largest speed"
    force = "finite" if side.finite_at_end else "unbounded"
    return kind, (math.nan, math.nan), above, (
        f"the domain ends at a finite energy and {force} force, so at a largest speed"
    )  # fmt: skip


@once
def _form(name: str) -> Callable[..., float]:
    """A form of `derivations.softening` as a function."""
    import sympy as sp

    from derivations import softening as derived

    symbols, modules = {
        "small_crest": ((derived.a, derived.b, derived.e, derived.excess), "math"),
        "small_crest_of_power": (
            (derived.a, derived.excess, derived.exponent, derived.growth),
            "math",
        ),
        "delay": (derived.power, "scipy"),
    }[name]
    return sp.lambdify(symbols, getattr(derived, name)(), modules)
