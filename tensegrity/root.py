"""A root of a function, the polynomial through points, and the peak of samples.

Roots are found by Chandrupatla's method (Advances in Engineering Software 28, 145 (1997)): inverse
quadratic interpolation where it is reliable, bisection otherwise.  Polynomials are evaluated by the
barycentric formula (Berrut & Trefethen 2004).  SciPy has equivalent methods, but its import takes
longer than most first calls of this package.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from typing import Any

import numpy as np

from tensegrity.typing import Array

STEPS = 3000  # more than the bisections from the largest number to the smallest
ROUND_OFF = sys.float_info.epsilon


def root(
    f: Callable[[float], float],
    low: float,
    high: float,
    absolute: float = 1e-300,
    relative: float = 2 * ROUND_OFF,
    part: float = 0.5,
) -> float:
    """A point where f changes its sign between two points.

    Parameters
    ----------
    f : callable (float) -> float
    low, high : float
    absolute, relative : float, optional
        Admissible errors, of which the sum counts.
    part : float, optional
        Fraction of the interval at which f is first evaluated.

    Returns
    -------
    float

    Raises
    ------
    ValueError
        The signs at both ends are equal, or f is NaN there.
    """
    a, b = float(low), float(high)
    at_a, at_b = f(a), f(b)
    if at_a == 0:
        return a
    if not (at_a <= 0 <= at_b or at_b <= 0 <= at_a):
        raise ValueError(f"no change of sign: {at_a:g} at {a:g} and {at_b:g} at {b:g}")
    c, at_c = a, at_a
    for _ in range(STEPS):
        best, value = (a, at_a) if abs(at_a) < abs(at_b) else (b, at_b)
        least = (relative * abs(best) + absolute) / (abs(b - a) or math.inf)
        if value == 0 or b == a or least > 0.5:
            return best
        x = a + min(max(part, least), 1 - least) * (b - a)
        if x in (a, b):
            return best
        at_x = f(x)
        if (at_x > 0) == (at_a > 0):
            c, at_c = a, at_a
        else:
            c, at_c, b, at_b = b, at_b, a, at_a
        a, at_a, part = x, at_x, 0.5
        place, height = (a - b) / (c - b), (at_a - at_b) / (at_c - at_b)
        if height**2 < place and (1 - height) ** 2 < 1 - place:
            part = at_a / (at_b - at_a) * at_c / (at_b - at_c)
            part += (c - a) / (b - a) * at_a / (at_c - at_a) * at_b / (at_c - at_b)
    raise ValueError(f"no root found between {low:g} and {high:g}")


def polynomial_through(x: Array, y: Array) -> Callable[[float], float]:
    """The polynomial of lowest degree through some points.

    Parameters
    ----------
    x, y : ndarray, (n,)
        Different places, and the values there.

    Returns
    -------
    callable (float) -> float
    """
    distances = (x[:, None] - x) / np.ptp(x)
    np.fill_diagonal(distances, 1.0)
    weights = 1 / np.prod(distances, axis=1)

    def value(at: float) -> float:
        if at in x:
            return float(y[x == at][0])
        parts = weights / (at - x)
        return float(parts @ y / parts.sum())

    return value


def peak_weights(y: Array, at: Any) -> Array:
    """Weights of samples `at` - 1, `at` and `at` + 1 in the vertex of the parabola through them.

    These are also the derivatives of the vertex with respect to the samples, as a shift of its
    place does not change its height to first order.

    Parameters
    ----------
    y : ndarray, (n,)
        Equally spaced samples.
    at : ndarray of int, any shape

    Returns
    -------
    ndarray, (*shape of at, 3)
    """
    before, here, after = (y[at + k] for k in (-1, 0, 1))
    s = (after - before) / (2 * (2 * here - before - after))
    return np.stack([s * (s - 1) / 2, 1 - s**2, s * (s + 1) / 2], axis=-1)
