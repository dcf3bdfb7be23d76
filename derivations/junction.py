"""A solitary wave at a junction, as a quasi-particle with conserved momentum and energy.

A wave of momentum I0 is incident; one of momentum I1 is reflected, and n of momentum I2 are
transmitted into each of two branches at angles +-theta to the axis.  All waves have the same
effective mass, so that energies are proportional to squared momenta.  Source: the paper, eq. (7).
"""

from __future__ import annotations

from functools import cache

import sympy as sp

from derivations import contact
from derivations.argument import Step

TITLE = "The junction: momentum and energy of the split wave"

incident = sp.Symbol("I_0", positive=True)
reflected, transmitted = sp.symbols("I_1 I_2", real=True)
half_angle = sp.Symbol("theta", positive=True)
waves = sp.Symbol("n", positive=True)


def balances() -> tuple[sp.Expr, sp.Expr]:
    """Axial momentum and energy before minus after; I1 is positive backwards."""
    momentum = incident + reflected - 2 * waves * transmitted * sp.cos(half_angle)
    energy = incident**2 - reflected**2 - 2 * waves * transmitted**2
    return momentum, energy


@cache
def split() -> tuple[sp.Expr, sp.Expr]:
    """(I1, I2) for any half-angle and number of waves, from the solution with nonzero I2."""
    solutions = sp.solve(balances(), [reflected, transmitted], dict=True)
    (solution,) = [s for s in solutions if s[transmitted] != 0]
    return tuple(sp.factor(solution[x]) for x in (reflected, transmitted))


def at_thirty_degrees() -> tuple[sp.Expr, sp.Expr]:
    """(I1, I2) of the printed guide, with 60 degrees between the branches."""
    return tuple(sp.factor(x.subs(half_angle, sp.pi / 6)) for x in split())


def force_ratios() -> tuple[sp.Expr, sp.Expr]:
    """Peak force of the incident wave over those of transmitted and reflected waves, n = 1."""
    power = contact.scalings()[0].subs(contact.exponent, sp.Rational(3, 2))
    back, forth = (x.subs(waves, 1) for x in at_thirty_degrees())
    return (incident / forth) ** power, (incident / back) ** power


def no_reflection() -> sp.Expr:
    """Half-angle at which the reflected wave vanishes for n = 1; beyond it I1 is negative."""
    back = split()[0].subs(waves, 1)
    (cosine,) = sp.solve(sp.numer(sp.together(back)) / incident, sp.cos(half_angle))[-1:]
    return sp.acos(sp.Abs(cosine))


def argument() -> list[Step]:
    momentum, energy = balances()
    to_branch, to_stem = force_ratios()
    return [
        Step("The axial momentum and the energy (P^2/2M) are conserved:",
             sp.Eq(momentum, 0), sp.Eq(energy, 0)),
        Step("Besides I2 = 0 there is one solution,",
             *(sp.Eq(x, v) for x, v in zip((reflected, transmitted), split(), strict=True))),
        Step("For branches at 30 degrees to the axis this is eq. (7):",
             *(sp.Eq(x, v)
               for x, v in zip((reflected, transmitted), at_thirty_degrees(), strict=True))),
        Step("With one wave per branch and F ~ I^(6/5), the ratios of the incident to the "
             "transmitted and to the reflected force are",
             sp.Eq(to_branch, to_branch.evalf(4), evaluate=False),
             sp.Eq(to_stem, to_stem.evalf(4), evaluate=False)),
        Step("For one wave per branch the reflected wave vanishes at the half-angle",
             sp.Eq(half_angle, no_reflection())),
    ]  # fmt: skip
