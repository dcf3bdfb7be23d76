"""Asymptotic profiles of solitary waves: near the sound speed, and at high energy.

Both give the elongation as a function of the distance x from the peak, in sites.  The sech^2
profile holds for waves of small amplitude with speeds slightly above the sound speed (Friesecke and
Pego, Nonlinearity 12, 1601 (1999)), and is the first term of a series in the decay rate; the tent
profile is the high-energy limit if the energy at the locking stroke is unbounded (Friesecke and
Matthies, Physica D 171, 211 (2002)).  A prism stores a finite energy: its waves approach the tent
but do not tend to it, neither as the peak approaches the locking stroke nor as the prestrain
vanishes.  The formulas are those of `derivations.waves`.
Source: the talk, part III, "Tensegrity metamaterials".
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, Any

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.engine.programs import derived, run
from tensegrity.errors import TensegrityError
from tensegrity.once import once
from tensegrity.root import root
from tensegrity.springs.potential import Potential
from tensegrity.typing import Array, Order
from tensegrity.waves.nonlinear_part import nonlinear_part

SAMPLES = 2001  # of a term of a small wave, whose largest value is sought
FASTEST = 1e100  # largest speed ratio; its square is finite


@checked
def sech2(
    spring: Potential,
    speed_ratio: Annotated[float, "> 1", f"< {FASTEST}"],
    x: ArrayLike,
    order: Order = 1,
) -> Array:
    """Elongation of a solitary wave of small amplitude.

    Parameters
    ----------
    spring : Potential
        Of each bond.
    speed_ratio : float
        c/cs, > 1.
    x : array_like
        Distance from the peak, in sites.
    order : int, optional
        1 to 3, the number of terms; 1 or 2 where V is even about 0.

    Returns
    -------
    ndarray, shape of x
        r = (V''/V''') (kappa/2)^2 sech^2(kappa x/2) + ... [m]; negative (compression) if the spring
        stiffens in compression, V''' < 0.  The error is O(kappa^(2 order + 2)); the next term
        estimates it.  kappa is the decay rate, c/cs = sinh(kappa/2)/(kappa/2); that of the talk,
        24 (c - cs)/cs in place of kappa^2, has an error of the same order.  Where V''' = 0 <
        V'''': r = (V''/V'''')^(1/2) kappa sech(kappa x) + ..., of compression, with the error
        O(kappa^(2 order + 1)); the mirror image is another wave.

    Raises
    ------
    TensegrityError
        V''(0) <= 0, V'''(0) = 0 and V''''(0) <= 0, a spring that is not smooth or not at rest at 0,
        a term that is none of these, a speed ratio out of its range, or an x that is not a number.

    Examples
    --------
    At 1.01 sound speeds the peak is 5 % above that of the exact wave, with three terms 0.03 %:

    >>> from tensegrity import Prism, sech2, solitary_wave
    >>> spring = Prism(base=1.0, height=0.7, prestrain=0.1, k_cross=1.0).potential()
    >>> exact = solitary_wave(spring, speed_ratio=1.01).amplitude
    >>> [round(float(sech2(spring, 1.01, 0.0, order)) / exact, 4) for order in (1, 2, 3)]
    [1.0521, 0.9964, 1.0003]
    """
    return small_wave(spring, (speed_ratio - 1) * (speed_ratio + 1), x, order, -1)


def small_wave(potential: Potential, gain: float, x: ArrayLike, order: int, sign: int) -> Array:
    """The wave of `sech2`.

    Parameters
    ----------
    potential : Potential
    gain : float
        (c/cs)^2 - 1.
    x, order
    sign : {-1, 1}
        Of the wave where V is even.

    Returns
    -------
    ndarray, shape of x
        [m].
    """
    x, terms = check.numbers("x", x, "sites"), small_terms(potential, order)
    even = not nonlinear_part(potential).slope
    kappa = decay_rate(gain)
    with np.errstate(over="ignore"):  # cosh overflows far from the peak, where the wave is 0
        s = 1 / np.cosh(kappa * x) if even else 1 / np.cosh(kappa * x / 2) ** 2
    whole: Any = sum(kappa ** (2 * n) * p for n, p in enumerate(terms, 1))
    return (sign / kappa if even else 1.0) * whole(s)


def small_terms(potential: Potential, order: int) -> list[Polynomial]:
    """R_1, R_2, ... of a small wave, polynomials in sech^2(kappa x/2), or in sech(kappa x) where
    V is even, up to an order of 1 to 4, [m]; see `derivations.waves.expansion`."""
    near = nonlinear_part(potential)
    a, b, e, f, g = near.rest, near.slope, near.bend, near.fifth, near.sixth
    if not (a > 0 and (abs(b) > 0 or (b == 0 and e > 0))):
        raise TensegrityError(
            f"no sech^2 wave: V'' = {a:g} N/m must be above 0 and V''' = {b:g} N/m^2 a number "
            f"that is not 0, or V'''' = {e:g} N/m^3 above 0"
        )
    if b == 0 and order > 1 and (f != 0 or order > 2):
        raise TensegrityError(
            f"no term of order {order}: where V''' = 0 there are 2, and one if the fifth "
            f"derivative of V, {f:g} N/m^4, is not 0"
        )
    found, terms = run(derived(_coefficients, int(b == 0)), np, (a, b, e, f, g)), []
    for n in range(1, order + 1):
        powers = np.zeros(2 * n if b == 0 else n + 1)
        powers[1 :: 2 if b == 0 else 1] = found[n * (n - 1) // 2 :][:n]
        terms.append(Polynomial(powers))
    return terms


def small_errors(potential: Potential) -> tuple[float, ...]:
    """Limits of the error of `small_wave` over peak kappa^(2 order), of orders 1 to 3, of order 1
    where V is even."""
    s = np.linspace(0.0, 1.0, SAMPLES)
    first, *others = small_terms(potential, 4 if nonlinear_part(potential).slope else 2)
    return tuple(float(np.abs(term(s)).max() / abs(first(1.0))) for term in others)


def _coefficients(even: int) -> tuple[list[Any], tuple[Any, ...]]:
    """Those of all terms, one after the other, and the derivatives of V."""
    from sympy import Symbol

    from derivations import waves

    steep = {Symbol("e", positive=True): waves.bend} if even else {}
    found = [p.subs(steep) for one in waves.expansion(bool(even)) for p in one]
    return found, (waves.stiffness, waves.slope, waves.bend, waves.fifth, waves.sixth)


@checked
def tent(spring: Potential, x: ArrayLike) -> Array:
    """Elongation [m] of the wave of high energy: -d (1 - |x|) for |x| < 1, and 0 elsewhere.

    Here d is the locking stroke [m], and x the distance from the peak [sites], of any shape.
    """
    x, stroke = check.numbers("x", x, "sites"), -spring.domain[0]
    if math.isinf(stroke):
        raise TensegrityError("no tent: the spring has no locking stroke (its domain is open)")
    value: Array = run(derived(_tent), np, (stroke, np.clip(x, -1, 1)))[0]
    return value


def _tent() -> tuple[list[Any], tuple[Any, ...]]:
    """The elongation, and the locking stroke and x."""
    from derivations import waves

    return [(waves.tent() * waves.spacing).subs(waves.spacing, 1)], (waves.stroke, waves.position)


def left_at_wall(power: float, strength: float, stroke: float, speed: float, mass: float) -> float:
    """Least distance of a fast wave from a wall V = A y^-n.

    Parameters
    ----------
    power, strength : float
        n and A [J m^n].
    stroke : float
        Distance of the wall from rest [m].
    speed : float
        [sites/s].
    mass : float
        [kg].

    Returns
    -------
    float
        [m].

    Raises
    ------
    TensegrityError
        The speed is too low for the limit of the tent.
    """
    beta = float(form("delay")(power))
    scale = math.log(4 * strength / mass) - 2 * math.log(speed)

    def mismatch(log_left: float) -> float:
        sigma = stroke - beta * math.exp(log_left)
        return scale - 2 * math.log(sigma) - power * log_left

    high = math.log(stroke / max(beta, 1.0) * (1 - 1e-9))
    low = min((scale - 2 * math.log(stroke)) / power - 1.0, high - 1.0)
    if mismatch(high) > 0:
        raise TensegrityError(f"speed {speed:g} sites/s is too slow for the limit of the tent")
    return math.exp(root(mismatch, low, high, 1e-14))


@once
def form(name: str) -> Callable[..., float]:
    """An expression of `derivations.softening` as a function."""
    import sympy as sp

    from derivations import softening as derived

    symbols, modules = {
        "small_peak": ((derived.a, derived.b, derived.e, derived.excess), "math"),
        "small_peak_of_power": (
            (derived.a, derived.excess, derived.exponent, derived.growth),
            "math",
        ),
        "delay": (derived.power, "scipy"),
    }[name]
    return sp.lambdify(symbols, getattr(derived, name)(), modules)


def decay_rate(gain: float) -> float:
    """Decay rate kappa [1/site] of the tail exp(-kappa |x|) in a linear lattice, by
    sinh(kappa/2)/(kappa/2) = c/cs, from gain = (c/cs)^2 - 1."""
    if math.isinf(gain):
        return math.inf
    wanted = math.log1p(gain) / 2

    def mismatch(half: float) -> float:
        square = half * half
        series = square / 6 * (1 + square / 20 * (1 + square / 42 * (1 + square / 72)))
        return (
            math.log1p(series) if half < 0.1 else half + math.log(-math.expm1(-2 * half) / 2 / half)
        ) - wanted

    # sinh(y)/y > exp(y)/(4 y) and > 1 + y^2/6
    high = min(2 * wanted + 4, 1.001 * math.sqrt(6 * math.expm1(wanted)))
    return 2 * root(mismatch, high / 8, high, relative=1e-14)
