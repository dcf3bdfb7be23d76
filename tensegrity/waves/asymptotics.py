"""Asymptotic profiles of solitary waves: near the sound speed, and at high energy.

Both give the elongation as a function of the distance x from the peak, in sites.  The sech^2
profile holds for waves of small amplitude with speeds slightly above the sound speed (Friesecke and
Pego, Nonlinearity 12, 1601 (1999)); the tent profile is the high-energy limit if the energy at the
locking stroke is unbounded (Friesecke and Matthies, Physica D 171, 211 (2002)).  A prism stores a
finite energy: its waves approach the tent but do not tend to it, neither as the peak approaches the
locking stroke nor as the prestrain vanishes.  Both formulas are those of `derivations.waves`.
Source: the talk, part III, "Tensegrity metamaterials".
"""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.engine.programs import derived, run
from tensegrity.errors import TensegrityError
from tensegrity.once import once
from tensegrity.root import root
from tensegrity.springs.potential import Potential
from tensegrity.typing import Array

FASTEST = 1e100  # largest speed ratio; its square is finite


@checked
def sech2(
    spring: Potential, speed_ratio: Annotated[float, "> 1", f"< {FASTEST}"], x: ArrayLike
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

    Returns
    -------
    ndarray, shape of x
        r = (V''/V''') (gamma/2)^2 sech^2(gamma x/2) [m], gamma^2 = 24 (c - cs)/cs; negative
        (compression) if the spring stiffens in compression, V''' < 0.  Error O(gamma^4).

    Raises
    ------
    TensegrityError
        V''(0) <= 0 or V'''(0) = 0, a speed ratio out of its range, or an x that is not a number.

    Examples
    --------
    At 1.01 sound speeds the peak is 6 % above that of the exact wave:

    >>> from tensegrity import Prism, sech2, solitary_wave
    >>> spring = Prism(base=1.0, height=0.7, prestrain=0.1, k_cross=1.0).potential()
    >>> exact = solitary_wave(spring, speed_ratio=1.01).amplitude
    >>> round(float(sech2(spring, 1.01, 0.0)) / exact, 3)
    1.055
    """
    x = check.numbers("x", x, "sites")
    stiffness, slope = float(spring.stiffness(0.0)), float(spring.stiffness_slope(0.0))
    if stiffness <= 0 or slope == 0:
        raise TensegrityError(
            f"no sech^2 wave: V'' = {stiffness:g} N/m must be above 0 and "
            f"V''' = {slope:g} N/m^2 not 0"
        )
    with np.errstate(over="ignore"):  # cosh overflows far from the peak, where the wave is 0
        return _value("sech2", stiffness, slope, speed_ratio, x)


@checked
def tent(spring: Potential, x: ArrayLike) -> Array:
    """Elongation [m] of the wave of high energy: -d (1 - |x|) for |x| < 1, and 0 elsewhere.

    Here d is the locking stroke [m], and x the distance from the peak [sites], of any shape.
    """
    x, stroke = check.numbers("x", x, "sites"), -spring.domain[0]
    if math.isinf(stroke):
        raise TensegrityError("no tent: the spring has no locking stroke (its domain is open)")
    return _value("tent", stroke, np.clip(x, -1, 1))


@once
def forms() -> dict[str, tuple[Any, tuple[Any, ...]]]:
    """Symbolic elongations {name: (expression, symbols)}: "sech2" as a function of stiffness, its
    slope, c/cs and x; "tent" as a function of the locking stroke and x."""
    import sympy as sp

    from derivations import waves

    ratio = sp.Symbol("ratio")
    gamma_squared = waves.gamma_squared().subs(waves.speed, ratio * waves.acoustic_speed)
    sech2 = (waves.sech_strain() * waves.spacing).subs(waves.spacing, 1)
    sech2 = sech2.subs(waves.gamma, sp.sqrt(sp.simplify(gamma_squared)))
    tent = (waves.tent() * waves.spacing).subs(waves.spacing, 1)
    return {
        "sech2": (sech2, (waves.stiffness, waves.slope, ratio, waves.position)),
        "tent": (tent, (waves.stroke, waves.position)),
    }


def _value(name: str, *values: Any) -> Array:
    value: Array = run(derived(_exponential, name), np, values)[0]
    return value


def _exponential(name: str) -> tuple[list[Any], tuple[Any, ...]]:
    """One of `forms` in exponentials, and its symbols."""
    from sympy import exp

    form, symbols = forms()[name]
    return [form.rewrite(exp)], symbols


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
