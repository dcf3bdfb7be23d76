"""Approximate profiles of solitary waves: near the sound speed, and far above it.

Both give the elongation against the distance x from the crest, in sites.  The sech^2 profile
holds for small waves little faster than sound (Friesecke and Pego, Nonlinearity 12, 1601
(1999)); the tent is the limit where the energy stored before locking has no bound (Friesecke and
Matthies, Physica D 171, 211 (2002)).  A prism stores a finite energy: its waves come close to
the tent and not to it, neither as they use up the stroke nor as the prestrain vanishes.  Both
formulas are those of `derivations.waves`.  Source: seeds/000, part III, "Tensegrity
metamaterials".
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.once import once
from tensegrity.springs.potential import Potential
from tensegrity.typing import Array

FASTEST = 1e100  # speed ratio whose square is still a number


def sech2(spring: Potential, speed_ratio: float, x: ArrayLike) -> Array:
    """Elongation of the small-amplitude solitary wave.

    Parameters
    ----------
    spring : Potential
    speed_ratio : float
        c/cs, > 1.
    x : array_like
        Distance from the crest, in sites.

    Returns
    -------
    ndarray, shape of x
        r = (V''/V''') (gamma/2)^2 sech^2(gamma x/2) [m], gamma^2 = 24 (c - cs)/cs; negative
        (compression) where the spring stiffens in compression, V''' < 0.  Error O(gamma^4).
    """
    check.kind("spring", spring, Potential)
    x = check.numbers("x", x, "sites")
    ratio = check.number("speed_ratio", speed_ratio, above=1, below=FASTEST)
    stiffness, slope = float(spring.stiffness(0.0)), float(spring.stiffness_slope(0.0))
    if stiffness <= 0 or slope == 0:
        raise TensegrityError(
            f"no sech^2 wave: V'' = {stiffness:g} N/m must be above 0 and "
            f"V''' = {slope:g} N/m^2 not 0"
        )
    with np.errstate(over="ignore"):  # far away cosh is infinite and the wave 0
        return _function("sech2")(stiffness, slope, ratio, x)


def tent(spring: Potential, x: ArrayLike) -> Array:
    """Elongation [m] of the wave that reaches the locking stroke: -d (1 - |x|) for |x| < 1."""
    check.kind("spring", spring, Potential)
    x, stroke = check.numbers("x", x, "sites"), -spring.domain[0]
    if math.isinf(stroke):
        raise TensegrityError("no tent: the spring has no locking stroke (its domain is open)")
    return _function("tent")(stroke, np.clip(x, -1, 1))


@once
def forms() -> dict[str, tuple[Any, tuple[Any, ...]]]:
    """Elongations "sech2", in terms of stiffness, its slope, c/cs and x, and "tent", in terms of
    the locking stroke and x: {name: (expression, symbols)}."""
    import sympy as sp

    from derivations import waves as derived

    ratio = sp.Symbol("ratio")
    gamma_squared = derived.gamma_squared().subs(derived.speed, ratio * derived.acoustic_speed)
    sech2 = (derived.sech_strain() * derived.spacing).subs(derived.spacing, 1)
    sech2 = sech2.subs(derived.gamma, sp.sqrt(sp.simplify(gamma_squared)))
    tent = (derived.tent() * derived.spacing).subs(derived.spacing, 1)
    return {
        "sech2": (sech2, (derived.stiffness, derived.slope, ratio, derived.position)),
        "tent": (tent, (derived.stroke, derived.position)),
    }


@once
def _function(name: str) -> Callable[..., Array]:
    import sympy as sp

    form, symbols = forms()[name]
    return sp.lambdify(symbols, form, modules="numpy")
