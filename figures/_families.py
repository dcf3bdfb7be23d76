"""Potentials whose families of solitary waves are drawn."""

import math

import sympy as sp

from tensegrity import Potential, Prism

R = sp.Symbol("r")


def force(*coefficients):
    """V' = r + c0 r^2 + c1 r^3 + ..."""
    terms = (sp.nsimplify(c) * R ** (k + 3) / (k + 3) for k, c in enumerate(coefficients))
    return Potential(R**2 / 2 + sum(terms), R)


def lennard_jones(n, m):
    """V''(0) = 1, zero distance at r = -1."""
    energy = ((1 + R) ** -n / n - (1 + R) ** -m / m) / (n - m)
    return Potential(energy, R, domain=(-1.0, math.inf))


def springs():
    """{name: potential}"""
    softening = Prism(1.0, 0.5, 0.4, 1.0, 2.0, 20.0)
    return {
        "Toda": Potential(sp.exp(-R) + R - 1, R),
        "Lennard-Jones 12-6": lennard_jones(12, 6),
        "Lennard-Jones 6-3": lennard_jones(6, 3),
        "rigid prism (0.7, 0.01)": Prism(1.0, 0.7, 0.01, 1.0).potential(),
        "elastic prism, preload 0": softening.potential(),
        "elastic prism, preload 0.05": softening.potential(preload=0.05),
        "elastic prism, preload 0.1": softening.potential(preload=0.1),
        "elastic prism, preload 0.15": softening.potential(preload=0.15),
        "$V' = r + r^2 - r^3$": force(1, -1),
        "$V' = r + r^3 - r^5$": force(0, 1, 0, -1),
        "$V' = r + 0.914\\,r^3 - 0.01\\,r^4 - 0.375\\,r^5$": force(0, 0.914, -0.01, -0.375),
        "$V' = r + r^2 - 1.2\\,r^3 + 0.3\\,r^4$": force(1, -1.2, 0.3),
    }
