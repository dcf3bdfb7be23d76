"""Potentials whose families of solitary waves are drawn, and waves along each family."""

from __future__ import annotations

import math

import numpy as np
import sympy as sp

from tensegrity import Potential, Prism, TensegrityError, solitary_wave

R = sp.Symbol("r")
POINTS = 14  # waves of a family
FAR = 4.0  # crests of a family without end go so far, over the unit of length


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


def crests(family):
    """Crests along a family [m], close to both of its limits."""
    first, last = family.crests
    if math.isinf(last):
        last = math.copysign(max(FAR, 1.5 * abs(first)), last)
    near = np.geomspace(3e-3, 0.5, POINTS // 2)
    end = 1e-5 if family.ends == "front" else 1e-2
    parts = np.concatenate([near, 1 - np.geomspace(0.4, end, POINTS - near.size)])
    return first + (last - first) * parts


def waves(potential, family):
    """Those that are found: near a threshold, whose crest is an estimate, some are not."""
    found = []
    for crest in crests(family).tolist():
        try:
            found.append(solitary_wave(potential, amplitude=crest, family=family.name))
        except TensegrityError:
            continue
    return found
