"""Springs of one law, whatever their numbers: a kernel is compiled for a law, not for a number."""

import math

import sympy as sp

from tensegrity import Potential

R, K, A, B, C = sp.symbols("r k a b c")
COEFFICIENTS = sp.symbols("c3:9")


def series(*coefficients, k=1.0, length=None, domain=(-math.inf, math.inf)):
    """V = k r^2/2 + c3 r^3 + c4 r^4 + ..., up to c8 r^8."""
    energy = K * R**2 / 2 + sum(c * R**n for n, c in enumerate(COEFFICIENTS, 3))
    given = dict.fromkeys(COEFFICIENTS, 0.0) | dict(zip(COEFFICIENTS, coefficients, strict=False))
    return Potential(energy, R, {K: k} | given, length, domain)


def lennard_jones(n, m, a=1.0, b=2.0, shift=0.0):
    """V = a (1 + r)^-n - b (1 + r)^-m + shift."""
    energy = A * (1 + R) ** -n - B * (1 + R) ** -m + C
    return Potential(energy, R, {A: a, B: b, C: shift}, domain=(-1.0, math.inf))
