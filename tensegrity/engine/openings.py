"""Corrections of a step at the loss or gain of contacts, by the known error of its quadrature.

The force of a contact is strength overlap^exponent for a positive overlap, otherwise 0.  The kicks
of a step are a quadrature of it, whose error next to a root of the overlap is known in closed form:
`derivations.openings`.  This module computes the tables for `openings.c`.
"""

from __future__ import annotations

import math

import numpy as np

from tensegrity.once import once

DEGREE = 20  # of the polynomials for the zeta functions, exact to round-off of their sums
TERMS, BERNOULLI = 8, (1 / 6, -1 / 30, 1 / 42, -1 / 30, 5 / 66, -691 / 2730, 7 / 6, -3617 / 510)
LOWEST, HIGHEST = 1.0, 3.0  # exponents for which the order was verified
TREATED = 3  # order minus the exponent where contacts are corrected


def hurwitz(s, q):
    """Hurwitz' zeta function of real order s, not 1, for q > 0: sum of (q + n)^-s, continued.

    Computed from the first terms and the Euler-Maclaurin sum of the rest; SciPy's function is NaN
    for s < 1.
    """
    q, s = np.asarray(q, dtype=np.longdouble), np.longdouble(s)  # large terms nearly cancel
    total = sum((q + n) ** -s for n in range(TERMS))
    far = q + TERMS
    total = total + far ** (1 - s) / (s - 1) + far**-s / 2
    rising, factorial = s, 2.0
    for k, number in enumerate(BERNOULLI, start=1):
        total = total + number / factorial * rising * far ** (-s - 2 * k + 1)
        rising *= (s + 2 * k - 1) * (s + 2 * k)
        factorial *= (2 * k + 1) * (2 * k + 2)
    return np.asarray(total, dtype=float)


@once
def zeta_powers(s):
    """Coefficients in t = 2 q - 1 of zeta(s, 1 + q), (DEGREE + 1,)."""
    from numpy.polynomial import chebyshev

    t, coefficients = chebyshev.chebpts1(DEGREE + 8), np.zeros(DEGREE + 1)
    powers = chebyshev.cheb2poly(chebyshev.chebfit(t, hurwitz(s, 1 + (1 + t) / 2), DEGREE))
    coefficients[: len(powers)] = powers  # NumPy drops highest coefficients that are 0
    return coefficients


@once
def zetas(exponent):
    """Coefficients in t = 2 q - 1 of zeta(s, 1 + q), for s = -exponent, -exponent - 1 and
    1 - exponent; (3, DEGREE + 1).  The first term of zeta(s, q), q^-s, is added by the loop."""
    return np.array([zeta_powers(s) for s in (-exponent, -exponent - 1, 1 - exponent)])


def beta(exponent):
    """Integral of (y (1 - y))^exponent over (0, 1)."""
    return math.exp(2 * math.lgamma(exponent + 1) - math.lgamma(2 * exponent + 2))


def is_treated(exponent):
    """Whether contacts of that exponent are corrected; NaN is not."""
    return (exponent >= LOWEST) & (exponent <= HIGHEST)


def contacts(bonds, batch=1):
    """Contacts that can be lost, at the places of a loop, or those of each spring of a network.

    Returns
    -------
    dict of ndarray
        "place", "side", "strength", (kinks, places[, batch]), of a network (kinks, springs), with
        "spring", int32, (places,), the spring at each place: a contact is closed where its
        overlap, side (elongation - place), is positive [m]; it adds side strength
        overlap^exponent [N] to the tension.  A force with several kinks is that of several
        contacts; entries after the last kink of a bond are NaN.  "row", of the same shape, is the
        index of the exponent into "exponents", "betas", (rows,), and "tables", (rows, 3,
        DEGREE + 1).
    """
    place, strength, exponent, side = np.moveaxis(bonds.kinks, -1, 0)
    within, springs, spring = is_treated(exponent), bonds.group, None
    if bonds.contacts is not None:
        springs, spring = slice(None), springs[bonds.runs.source].astype(np.int32)
    elif batch > 1 and springs.ndim == 1:
        springs = np.repeat(springs[:, None], batch, axis=1)
    exponents = np.unique(exponent[within])
    rows = np.searchsorted(exponents, np.where(within, exponent, 0.0))
    columns = {"place": place, "side": side, "strength": strength}
    return {name: np.where(within, x, np.nan)[:, springs] for name, x in columns.items()} | {
        "row": np.where(within, rows, 0)[:, springs],
        "spring": spring,
        "exponents": exponents,
        "betas": np.array([beta(x) for x in exponents.tolist()]),
        "tables": np.array([zetas(x) for x in exponents.tolist()]),
    }
