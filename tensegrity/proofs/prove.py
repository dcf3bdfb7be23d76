"""Certificates: travelling waves and folds that are proved to exist, and where they are.

A certificate is the outcome of a proof in ball arithmetic, in which every rounding is bounded.  It
is stored as the numbers from which `verify` computes it again.  The wave proved is that of a ring,
whose period is stated; the wave of the line differs from it by about its tail at half the period.
Sources: the talk, part IV; `proofs.ring` for the method.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from fractions import Fraction
from os import PathLike
from typing import Any

import numpy as np

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.printing import Lines, Printed
from tensegrity.prisms.closed import exact
from tensegrity.prisms.problem import EquilibriumPath
from tensegrity.proofs.balls import (
    BITS,
    Balls,
    BallSpring,
    ball,
    exact_prism,
    flint,
    fraction,
    precision,
)
from tensegrity.proofs.ring import Bounds, Taylor, prove_wave, taylor
from tensegrity.springs.potential import Potential
from tensegrity.typing import Array
from tensegrity.unit_names import in_units
from tensegrity.waves.solitary import SolitaryWave

READ = ("decimals", "double")
FORMAT = "tensegrity certificate 1"
RESOLVED = 2e-14  # of the peak, below which coefficients are round-off
MORE = 1.5  # modes over those resolved: the refined wave has more digits
MODES = 1200  # most of a proof
SHORTEST, LONGEST = 2.0, 1e4  # rings [sites]
NEAR = 1e-3  # of the peak: a wave handed over that is farther from the true one is none
SLACK = 1.5  # of a radius that is computed again
FOLD_BITS, WIDTHS = 256, [10.0**-k for k in range(2, 9)]  # of the height
SHRINKS = 12  # steps of the interval Newton method


@dataclass(frozen=True)
class Enclosure:
    """A number that lies within a radius of another.

    Attributes
    ----------
    mid : str
        Decimals.
    radius : float
        A bound.
    """

    mid: str
    radius: float

    @classmethod
    def of(cls, value: Any) -> Enclosure:
        """That of a ball, whose middle is rounded to the digits it has."""
        digits = max(3, int(value.rel_accuracy_bits() * math.log10(2)))
        mid = value.mid().str(digits, radius=False)
        return cls(mid, _above((value - ball(str(Fraction(mid)))).abs_upper()))

    def __float__(self) -> float:
        return float(self.mid)

    def contains(self, value: str | float | Fraction) -> bool:
        """Whether a number, such as a text of decimals, lies within."""
        return abs(Fraction(value) - Fraction(self.mid)) <= Fraction(self.radius)

    def __str__(self) -> str:
        return f"{self.mid} +- {self.radius:.2g}"


@dataclass(frozen=True, eq=False, repr=False)
class Certificate(Printed):
    """Whether a travelling wave is proved to exist, and how near.

    Attributes
    ----------
    proved : bool
    reason : str
        Which bound failed, and what would help; empty if proved.
    radius : float
        Largest distance of the true wave from the one handed over [m]; inf if not proved.
    centre_radius : float
        The same from the refined wave, the centre of the proof [m].
    peak : Enclosure or None
        Elongation of the true wave at its middle [m].
    speed : float
        [sites/s], which stands for its decimals or for its binary value, as does the mass.
    y, z1, z2 : float
        Bounds of the proof: y [m], z1, z2 [1/m]; see `proofs.ring`.
    period : str
        Sites of the ring, a fraction.
    tail : float
        Elongation of the wave at half the period [m], an estimate of the largest difference from
        the wave of the line.
    spring : str
    """

    proved: bool
    reason: str
    radius: float
    centre_radius: float
    peak: Enclosure | None
    speed: float
    y: float
    z1: float
    z2: float
    period: str
    tail: float
    spring: str
    _stored: dict[str, Any] = field(repr=False)

    def _lines(self) -> Lines:
        ring = f"a ring of {float(Fraction(self.period)):.9g} sites"
        if not self.proved:
            yield f"not proved on {ring}: {self.reason}"
            return
        yield (
            f"proved: on {ring}, a travelling wave of speed {self.speed!r} sites/s exists, and "
            f"only one within {in_units(f'{self.centre_radius:.2g} m')} of the centre stored here, "
            f"with the elongation {in_units(f'{self.peak} m')} at its middle"
        )
        yield (
            f"{in_units(f'{self.radius:.2g} m')} from the wave handed over; the ring costs about "
            f"{in_units(f'{self.tail:.1g} m')} against the line"
        )
        yield f"bounds Y {self.y:.3g}, Z1 {self.z1:.3g}, Z2 {self.z2:.3g}; {self.spring}"

    def save(self, path: str | PathLike[str]) -> None:
        """Write the certificate as JSON, completely or not at all.

        Raises
        ------
        TensegrityError
            Not proved, or the file cannot be written.
        """
        if not self.proved:
            raise TensegrityError(f"nothing is proved: {self.reason}")
        with check.replacing(check.path("path", path)) as place:
            place.write_text(json.dumps(self._stored, indent=1), encoding="utf-8")


@dataclass(frozen=True)
class Fold:
    """A limit point of a rigid prism, enclosed.

    Attributes
    ----------
    height, load, twist : Enclosure
        [m], [N] with compression > 0, [rad].
    unique : float
        Half the range of heights about it in which it is the only one [m].
    """

    height: Enclosure
    load: Enclosure
    twist: Enclosure
    unique: float

    def __str__(self) -> str:
        return (
            f"proved: a fold at height {self.height} m, load {self.load} N, twist {self.twist} "
            f"rad, the only one within {self.unique:.2g} m"
        )


def prove(
    of: SolitaryWave | EquilibriumPath, period: float | None = None, exact: str = "decimals"
) -> Certificate | tuple[Fold, ...]:
    """Prove that a wave exists near a computed one, or enclose the folds of a prism.

    Parameters
    ----------
    of : SolitaryWave or EquilibriumPath
        What `solitary_wave` returns for a chain of equal masses, or `equilibrium_path` for a prism
        with rigid bases and bars.
    period : float, optional
        Sites of the ring on which a wave is proved; by default twice the half-length on which it
        was computed, where its tail is round-off.
    exact : {"decimals", "double"}, optional
        Whether numbers such as 0.1 stand for 1/10 or for their binary values.

    Returns
    -------
    Certificate or tuple of Fold
        Of a wave, or of all folds of the path.

    Raises
    ------
    TensegrityError
        Bad input; a spring whose energy is not analytic about 0, as at a kink, or no expression of
        the elongation; a wave of several components; python-flint is not installed.

    Notes
    -----
    The largest elongation must stay below the distance from 0 to the nearest singularity of the
    energy, such as the locking of a prism.

    Examples
    --------
    >>> from tensegrity import Prism, prove, solitary_wave
    >>> softening = Prism(base=1.0, height=0.25, prestrain=0.1, k_cross=1.0).potential()
    >>> proof = prove(solitary_wave(softening, speed_ratio=1.03), period=40.0)
    >>> proof.proved, proof.peak.mid[:14], proof.centre_radius < 1e-18
    (True, '0.029798257400', True)
    """
    if not isinstance(exact, str) or exact not in READ:
        raise TensegrityError(f"exact {check.shown(exact)} must be one of {READ}")
    if isinstance(of, EquilibriumPath):
        return _folds(of, exact)
    check.kind("of", of, SolitaryWave)
    if not isinstance(of.potential, Potential):
        raise TensegrityError("the wave must have one component")
    half = float(np.abs(of.x).max())
    sites = 2 * half if period is None else period
    sites = check.number("period", sites, above=SHORTEST, below=LONGEST, unit="sites")
    with precision(BITS):
        spring, ends = BallSpring.of(of.potential, exact), of.potential.domain
        numbers = {"mass": of.mass, "speed": of.speed, "period": sites}
        stored = {"format": FORMAT, "spring": spring.source, "domain": [*map(repr, ends)]}
        stored |= {name: str(fraction(x, exact)) for name, x in numbers.items()}
        handed, size = _sampled(of, sites, half), abs(float(of.amplitude))
        resolved = np.flatnonzero(np.abs(handed) > RESOLVED * size)
        count = min(math.ceil(MORE * resolved.max(initial=0)) + 8, MODES)
        guess = np.append(handed, np.zeros(count))[:count]
        found = prove_wave(_law(spring, guess, ends), guess, *_ring(stored))
        off = [x - flint().arb(float(y)) for x, y in zip(found.centre, handed, strict=False)]
        away = _norm(off) + float(2 * np.abs(handed[count:]).sum() * (1 + 1e-9))
        tail = float(np.abs(of.elongation(min(sites / 2, half))))
        return _certified(found, stored, away, size, tail, f"{of.potential!r}", of.speed)


def verify(path: str | PathLike[str]) -> Certificate:
    """Compute a stored proof again from its file alone.

    Parameters
    ----------
    path : str or path
        What `Certificate.save` wrote; nothing in it is evaluated.

    Returns
    -------
    Certificate
        As computed again.

    Raises
    ------
    TensegrityError
        No such file, one that is damaged, or one whose claims do not follow from its numbers.
    """
    file = check.path("path", path)
    try:
        stored = json.loads(file.read_text(encoding="utf-8"))
        if stored["format"] != FORMAT:
            raise ValueError("another format")
        claims = {name: float(stored[name]) for name in ("radius", "centre_radius", "tail")}
        peak, speed = str(stored["peak"]["mid"]), float(Fraction(stored["speed"]))
        with precision(BITS):
            found = _again(stored)
            away, size = claims["radius"] - claims["centre_radius"], abs(float(Fraction(peak)))
            again = _certified(
                found, stored, away, size, claims["tail"], str(stored["text"]), speed
            )
    except TensegrityError:
        raise
    except (KeyError, IndexError, TypeError, ValueError, ArithmeticError, OSError) as error:
        raise TensegrityError(f"{file} is no certificate, or damaged: {error!r}") from error
    ratio = again.centre_radius / claims["centre_radius"] if claims["centre_radius"] > 0 else 0.0
    if not again.proved or again.peak is None:
        raise TensegrityError(f"{file} does not hold: {again.reason}")
    if not (1 / SLACK <= ratio <= SLACK and away >= 0 and again.peak.contains(peak)):
        raise TensegrityError(
            f"{file} does not hold: its numbers give the radius {again.centre_radius:.3g} m and "
            f"the peak {again.peak} m, it claims {claims['centre_radius']:.3g} m and {peak} m"
        )
    return again


def _again(stored: dict[str, Any]) -> Bounds:
    """The bounds of stored numbers."""
    source = stored["spring"]
    if "prism" in source:
        spring = BallSpring.of_prism([str(x) for x in source["prism"]])
    else:
        spring = BallSpring.of_program(source["energy"], [str(x) for x in source["parameters"]])
    centre, (low, high) = [str(x) for x in stored["centre"]], map(float, stored["domain"])
    law = _law(spring, np.array([float(Fraction(x)) for x in centre]), (low, high))
    return prove_wave(law, [ball(x) for x in centre], *_ring(stored), refine=False)


def _sampled(wave: SolitaryWave, period: float, half: float) -> Array:
    """Coefficients of a wave's periodic images, from samples."""
    points = 4 * max(len(wave.x), math.ceil(len(wave.x) * period / half)) + 1  # none at both ends
    x = np.arange(points) * (period / points)
    images = range(-1 - math.ceil(half / period), 1 + math.ceil(half / period))
    return np.fft.rfft(sum(wave.elongation(x + n * period) for n in images)).real / points


def _law(spring: BallSpring, guess: Array, ends: tuple[float, float]) -> Taylor:
    norm = float(abs(guess[0]) + 2 * np.abs(guess[1:]).sum())
    if not norm > 0:
        raise TensegrityError("the wave is 0, which always exists")
    law = taylor(spring, norm * (1 + 1e-9), ends)
    if law is None:
        raise TensegrityError(
            f"the energy is not analytic in a disc about 0 that holds elongations of {norm:.6g} m: "
            "it has a kink, or locks, at or before that distance on one of both sides"
        )
    return law


def _ring(stored: dict[str, Any]) -> tuple[Any, Any]:
    """Period and m c^2."""
    return ball(stored["period"]), ball(stored["mass"]) * ball(stored["speed"]) ** 2


def _norm(modes: list[Any]) -> float:
    return _above(
        (abs(modes[0]) + 2 * sum((abs(x) for x in modes[1:]), flint().arb(0))).abs_upper()
    )


def _above(bound: Any) -> float:
    """A float that is not below a bound."""
    return float(np.nextafter(float(bound), math.inf)) if bound.is_finite() else math.inf


def _certified(
    found: Bounds,
    stored: dict[str, Any],
    away: float,
    size: float,
    tail: float,
    text: str,
    speed: float,
) -> Certificate:
    """The certificate of some bounds, for a wave at a distance from the centre and of some size."""
    y, z1, z2 = map(_above, (found.y, found.z1, found.z2))
    centre_radius = math.inf if found.radius is None else _above(found.radius)
    radius = float(np.nextafter(centre_radius + away, math.inf))
    peak, reason = None, ""
    if not z1 < 1:
        reason = f"Z1 {z1:.3g} must be below 1: more modes, or a longer ring"
    elif found.radius is None:
        reason = (
            f"2 Y Z2 {2 * y * z2:.3g} must be below (1 - Z1)^2 {(1 - z1) ** 2:.3g}: a nearer wave"
        )
    elif not radius < NEAR * size:
        reason = (
            f"the true wave is up to {radius:.3g} m away, must be within {NEAR * size:.3g} m, "
            f"{NEAR:g} of the peak"
        )
    else:
        middle = found.centre[0] + 2 * sum(found.centre[1:], flint().arb(0))
        peak = Enclosure.of(middle + flint().arb(0, found.radius))
        stored = stored | {
            "centre": [str(_exact(x)) for x in found.centre],
            "centre_radius": repr(centre_radius), "radius": repr(radius), "tail": repr(tail),
            "peak": {"mid": peak.mid, "radius": repr(peak.radius)}, "text": text,
        }  # fmt: skip
    return Certificate(
        not reason, reason, radius if not reason else math.inf, centre_radius, peak, speed,
        y, z1, z2, stored["period"], tail, text, stored,
    )  # fmt: skip


def _exact(x: Any) -> Fraction:
    """The value of a ball without radius."""
    whole, exponent = x.mid().man_exp()
    return Fraction(int(whole)) * Fraction(2) ** int(exponent)


def _folds(path: EquilibriumPath, read: str) -> tuple[Fold, ...]:
    """Enclosures of the folds of a rigid prism, by the interval Newton method for V'' = 0."""
    prism = path.prism
    if not prism.is_rigid:
        raise TensegrityError(
            f"{check.shown(prism)}: folds are proved of prisms with rigid bases and bars"
        )
    folds = []
    with precision(FOLD_BITS):
        spring = BallSpring.of(prism.potential(), read)
        rest, *of = (ball(spring.source["prism"][k]) for k in (5, 0, 1, 2, 3))
        for event in path.events:
            if event.kind == "fold":
                r = flint().arb(event.at["height"]) - rest
                folds.append(_fold(spring, r.mid(), rest, exact_prism(prism, of)))
    return tuple(folds)


def _fold(spring: BallSpring, near: Any, rest: Any, prism: Any) -> Fold:
    arb = flint().arb

    def newton(box: Any) -> Any:
        middle = box.mid()
        slope = 6 * spring.series(box, 4, FOLD_BITS)[3]
        return middle - 2 * spring.series(middle, 3, FOLD_BITS)[2] / slope

    for width in WIDTHS:
        half = arb(width) * rest
        box = near + arb(0, 1) * half
        image = newton(box)
        if image.is_finite() and box.contains_interior(image):
            break
    else:
        raise TensegrityError(
            f"no fold is proved near height {float(near + rest):.9g} m: the proof needs V''' != 0"
        )
    for _ in range(SHRINKS):
        image = newton(image).intersection(image)
    height = image + rest
    load = -spring.series(image, 2, FOLD_BITS)[1]
    (twist,) = exact("twist", prism, height, own=Balls())
    return Fold(Enclosure.of(height), Enclosure.of(load), Enclosure.of(twist), float(half))
