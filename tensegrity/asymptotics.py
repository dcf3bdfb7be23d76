"""Approximate profiles of solitary waves: near the sound speed, and far above it.

Both give the elongation against the distance x from the crest, in sites.  The sech^2 profile
holds for small waves little faster than sound (Friesecke and Pego, Nonlinearity 12, 1601
(1999)); the tent is the limit of waves that reach the locking stroke (Friesecke and Matthies,
Physica D 171, 211 (2002)).  Source: seeds/000, part III, "Tensegrity metamaterials".
"""

from __future__ import annotations

import math

import numpy as np

from tensegrity import check
from tensegrity.errors import TensegrityError


def sound_speed(spring, mass=1.0):
    """sqrt(V''(0)/m), in sites per second; 0 in a sonic vacuum."""
    mass = check.number("mass", mass, above=0, unit="kg")
    stiffness = float(spring.stiffness(0.0))
    if stiffness < 0:
        raise TensegrityError(f"stiffness {stiffness:g} N/m at rest must be at least 0")
    return math.sqrt(stiffness / mass)


def sech2(spring, speed_ratio, x):
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
    ratio = check.number("speed_ratio", speed_ratio)
    if ratio <= 1:
        raise TensegrityError(f"speed_ratio {ratio:g} must be above 1")
    stiffness, slope = float(spring.stiffness(0.0)), float(spring.stiffness_slope(0.0))
    if stiffness <= 0 or slope == 0:
        raise TensegrityError(
            f"no sech^2 wave: V'' = {stiffness:g} N/m must be above 0 and "
            f"V''' = {slope:g} N/m^2 not 0"
        )
    half = math.sqrt(6 * (ratio - 1))  # gamma/2
    return stiffness / slope * (half / np.cosh(half * np.asarray(x, dtype=float))) ** 2


def tent(spring, x):
    """Elongation [m] of the wave that reaches the locking stroke: -d (1 - |x|) for |x| < 1."""
    stroke = -spring.domain[0]
    if math.isinf(stroke):
        raise TensegrityError("no tent: the spring has no locking stroke (its domain is open)")
    return -stroke * np.clip(1 - np.abs(np.asarray(x, dtype=float)), 0, None)
