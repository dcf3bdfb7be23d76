"""Certificates: travelling waves and folds that are proved to exist, and where they are.

A certificate is the outcome of a proof in ball arithmetic, in which every rounding is bounded.  It
is stored as the numbers from which `verify` computes it again.  A wave is proved on the infinite
line, or on a ring whose period is stated.  Sources: the talk, part IV; `proofs.ring` and
`proofs.line` for the method.
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
from tensegrity.prisms.problem import EquilibriumPath
from tensegrity.proofs.balls import (
    BITS,
    BallSpring,
    Enclosure,
    above,
    ball,
    flint,
    fraction,
    precision,
)
from tensegrity.proofs.folds import Fold, folds
from tensegrity.proofs.line import prove_on_line
from tensegrity.proofs.ring import Bounds, Taylor, prove_wave, taylor
from tensegrity.springs.potential import Potential
from tensegrity.typing import Array
from tensegrity.unit_names import in_units
from tensegrity.waves.asymptotics import decay_rate
from tensegrity.waves.solitary import SolitaryWave

READ = ("decimals", "double")
FORMAT = "tensegrity certificate 2"
RESOLVED = 2e-14  # of the peak, below which coefficients are round-off
MORE = 1.5  # modes over those resolved: the refined wave has more digits
MODES = 1200  # most of a proof
SHORTEST, LONGEST = 2.0, 1e4  # rings [sites]
LINE = "inf"
CLAIMS = "radius", "centre_radius", "tail"
NEAR = 1e-3  # of the peak: a wave handed over that is farther from the true one is none
SLACK = 1.5  # of a radius that is computed again
DECAYED = 40.0  # half the ring of a proof on the line, over the distance in which the tail decays


@dataclass(frozen=True, eq=False, repr=False)
class Certificate(Printed):
    """Whether a travelling wave is proved to exist, and how near.

    Attributes
    ----------
    proved : bool
    reason : str
        Which bound failed, and what would help; empty if proved.
    radius : float
        Largest distance of the true wave from the one handed over [m]; inf if not proved.  On the
        line for distances from the middle up to half of `ring`.
    centre_radius : float
        The same from the refined wave, the centre of the proof [m].
    peak : Enclosure or None
        Elongation of the true wave at its middle [m].
    speed : float
        [sites/s], which stands for its decimals or for its binary value, as does the mass.
    y, z1, z2 : float
        Bounds of the proof; see `proofs.ring` and `proofs.line`.
    period : str
        Sites of the ring on which the wave exists, a fraction; inf on the line.
    ring : str
        Sites of the ring on which the bounds are computed.
    tail : float
        A bound on the elongation of the wave at half of `ring` [m], which is an estimate of the
        largest difference of a ring's wave from that of the line; on the line also farther away.
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
    ring: str
    tail: float
    spring: str
    _stored: dict[str, Any] = field(repr=False)

    def _lines(self) -> Lines:
        line, sites = self.period == LINE, f"{float(Fraction(self.ring)):.9g} sites"
        where = "the infinite line" if line else f"a ring of {sites}"
        if not self.proved:
            yield f"not proved on {where}: {self.reason}"
            return
        kind = "solitary" if line else "travelling"
        near = in_units(f"{self.centre_radius:.2g} m")
        yield (
            f"proved: on {where}, a locally unique {kind} wave of speed {self.speed!r} sites/s "
            f"exists within {near} of the centre stored here, with the elongation "
            f"{in_units(f'{self.peak} m')} at its middle"
        )
        tail = in_units(f"{self.tail:.1g} m")
        yield f"{in_units(f'{self.radius:.2g} m')} from the wave handed over; " + (
            f"below {tail} from {float(Fraction(self.ring)) / 2:.9g} sites on"
            if line
            else f"the ring costs about {tail} against the line"
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


def prove(
    of: SolitaryWave | EquilibriumPath,
    period: float | None = None,
    exact: str = "decimals",
) -> Certificate | tuple[Fold, ...]:
    """Prove that a wave exists near a computed one, or enclose folds.

    Parameters
    ----------
    of : SolitaryWave or EquilibriumPath
        What `solitary_wave` returns for a chain of equal masses, or `equilibrium_path` for a prism.
    period : float, optional
        Sites of the ring on which a wave is proved, or inf for the infinite line; by default twice
        the half-length on which it was computed, where its tail is round-off.
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
        the elongation; a wave of several components; a fold that cannot be proved; python-flint is
        not installed.

    Notes
    -----
    The largest elongation must stay below the distance from 0 to the nearest singularity of the
    energy, such as the locking of a prism.

    Examples
    --------
    >>> import math
    >>> from tensegrity import Prism, prove, solitary_wave
    >>> softening = Prism(base=1.0, height=0.25, prestrain=0.1, k_cross=1.0).potential()
    >>> proof = prove(solitary_wave(softening, speed_ratio=1.03), period=math.inf)
    >>> proof.proved, proof.peak.mid[:18], proof.tail < 1e-12
    (True, '0.0297982574006468', True)
    """
    if not isinstance(exact, str) or exact not in READ:
        raise TensegrityError(f"exact {check.shown(exact)} must be one of {READ}")
    if isinstance(of, EquilibriumPath):
        return folds(of, exact)
    check.kind("of", of, SolitaryWave)
    if not isinstance(of.potential, Potential):
        raise TensegrityError("the wave must have one component")
    half, line = float(np.abs(of.x).max()), period == math.inf
    rate = decay_rate(of.excess * (2 + of.excess))
    if line:
        period = float(math.ceil(2 * DECAYED / rate))
    sites = 2 * half if period is None else period
    sites = check.number("period", sites, above=SHORTEST, below=LONGEST, unit="sites")
    with precision(BITS):
        spring, ends = BallSpring.of(of.potential, exact), of.potential.domain
        numbers = {"mass": of.mass, "speed": of.speed, "ring": sites}
        stored = {"format": FORMAT, "spring": spring.source, "domain": [*map(repr, ends)]}
        stored |= {name: str(fraction(x, exact)) for name, x in numbers.items()}
        stored |= {"rate": repr(rate), "period": LINE if line else stored["ring"]}
        handed, size = _sampled(of, sites, half), abs(float(of.amplitude))
        resolved = np.flatnonzero(np.abs(handed) > RESOLVED * size)
        count = min(math.ceil(MORE * resolved.max(initial=0)) + 8, MODES)
        guess = np.append(handed, np.zeros(count))[:count]
        stored |= {
            "handed": [repr(x) for x in guess.tolist()], "text": f"{of.potential!r}",
            "left out": repr(float(2 * np.abs(handed[count:]).sum() * (1 + 1e-9))),
        }  # fmt: skip
        found = _bounds(_law(spring, guess, ends), guess, stored, refine=True)
        return _certified(found, stored)


def verify(path: str | PathLike[str]) -> Certificate:
    """Compute a stored proof again from its file alone.

    Parameters
    ----------
    path : str or path
        What `Certificate.save` wrote; nothing in it is evaluated.

    Returns
    -------
    Certificate
        As computed again, the distance from the wave handed over and the tail included; that wave
        is given by the coefficients of its series, and a bound on those left out.

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
        if stored["period"] not in (LINE, stored["ring"]):
            raise ValueError("another period")
        claims = {name: float(stored[name]) for name in CLAIMS}
        peak = str(stored["peak"]["mid"])
        with precision(BITS):
            again = _certified(_again(stored), stored)
    except TensegrityError:
        raise
    except (KeyError, IndexError, TypeError, ValueError, ArithmeticError, OSError) as error:
        raise TensegrityError(f"{file} is no certificate, or damaged: {error!r}") from error
    if not again.proved or again.peak is None:
        raise TensegrityError(f"{file} does not hold: {again.reason}")
    for name, claim in claims.items():
        value = getattr(again, name)
        if not value / SLACK <= claim <= value * SLACK:
            raise TensegrityError(
                f"{file} does not hold: its numbers give the {name} {value:.3g} m, it claims "
                f"{claim:.3g} m"
            )
    if not again.peak.contains(peak):
        raise TensegrityError(f"{file} does not hold: the peak is {again.peak} m, not {peak} m")
    return again


def _again(stored: dict[str, Any]) -> Bounds:
    """The bounds of stored numbers."""
    source = stored["spring"]
    if "prism" in source:
        spring = BallSpring.of_prism([str(x) for x in source["prism"]])
    else:
        spring = BallSpring.of_program(source["energy"], [str(x) for x in source["parameters"]])
    handed, (low, high) = [float(x) for x in stored["handed"]], map(float, stored["domain"])
    law = _law(spring, np.array(handed), (low, high))
    return _bounds(law, [ball(str(x)) for x in stored["centre"]], stored, refine=False)


def _bounds(law: Taylor, guess: Any, stored: dict[str, Any], refine: bool) -> Bounds:
    """Those of the line or of the ring, by mass, speed and ring."""
    period, momentum = ball(stored["ring"]), ball(stored["mass"]) * ball(stored["speed"]) ** 2
    if not (period > 0 and momentum > 0):
        raise ValueError("a ring, mass or speed that is not above 0")
    if stored["period"] == LINE:
        return prove_on_line(law, guess, period, momentum, float(stored["rate"]), refine)
    return prove_wave(law, guess, period, momentum, refine)


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


def _certified(found: Bounds, stored: dict[str, Any]) -> Certificate:
    """The certificate of some bounds."""
    y, z1, z2 = map(above, (found.y, found.z1, found.z2))
    text, arb = str(stored["text"]), flint().arb
    centre_radius = radius = tail = math.inf
    peak, reason = None, ""
    handed = [arb(float(x)) for x in stored["handed"]]
    size = float(abs(handed[0] + 2 * sum(handed[1:], arb(0))))
    if found.distance is not None:
        off = [abs(x - h) for x, h in zip(found.wave, handed, strict=True)]
        away = off[0] + 2 * sum(off[1:], arb(0)) + arb(float(stored["left out"]))
        centre_radius, tail = above(found.distance), above(found.tail)
        radius = above((found.distance + away).abs_upper())
    if math.isinf(z1):
        reason = "the wave comes too near to where the energy is not analytic, or is subsonic"
    elif not z1 < 1:
        reason = f"Z1 {z1:.3g} must be below 1: more modes, or a longer ring"
    elif found.distance is None:
        reason = (
            f"2 Y Z2 {2 * y * z2:.3g} must be below (1 - Z1)^2 {(1 - z1) ** 2:.3g}: a nearer wave, "
            "or a longer ring"
        )
    elif not radius < NEAR * size:
        reason = (
            f"the true wave is up to {radius:.3g} m away, must be within {NEAR * size:.3g} m, "
            f"{NEAR:g} of the peak"
        )
    else:
        middle = found.wave[0] + 2 * sum(found.wave[1:], arb(0))
        peak = Enclosure.of(middle + arb(0, found.at_peak))
        stored = stored | {
            "centre": [str(_exact(x)) for x in found.centre],
            "centre_radius": repr(centre_radius), "radius": repr(radius), "tail": repr(tail),
            "peak": {"mid": peak.mid, "radius": repr(peak.radius)},
        }  # fmt: skip
    return Certificate(
        not reason, reason, radius if not reason else math.inf, centre_radius, peak,
        float(Fraction(stored["speed"])), y, z1, z2, stored["period"], stored["ring"], tail, text,
        stored,
    )  # fmt: skip


def _exact(x: Any) -> Fraction:
    """The value of a ball without radius."""
    whole, exponent = x.mid().man_exp()
    return Fraction(int(whole)) * Fraction(2) ** int(exponent)
