"""A solitary wave at a junction, as a quasi-particle that keeps momentum and energy.

One wave of momentum I0 arrives; one of momentum I1 goes back, and n of momentum I2 leave in
each of two branches at +-theta from the axis. All have the same effective mass, so energies
are as the squares of the momenta. Source: seeds/001, eq. (7).
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
    """Axial momentum and energy: what comes minus what leaves; I1 is counted backwards > 0."""
    momentum = incident + reflected - 2 * waves * transmitted * sp.cos(half_angle)
    energy = incident**2 - reflected**2 - 2 * waves * transmitted**2
    return momentum, energy


@cache
def split() -> tuple[sp.Expr, sp.Expr]:
    """(I1, I2) for any half-angle and number of waves, the solution with I2 not zero."""
    solutions = sp.solve(balances(), [reflected, transmitted], dict=True)
    (found,) = [s for s in solutions if s[transmitted] != 0]
    return tuple(sp.factor(found[x]) for x in (reflected, transmitted))


def at_thirty_degrees() -> tuple[sp.Expr, sp.Expr]:
    """(I1, I2) of the printed guide: 60 degrees between the branches."""
    return tuple(sp.factor(x.subs(half_angle, sp.pi / 6)) for x in split())


def force_ratios() -> tuple[sp.Expr, sp.Expr]:
    """Largest force of the incident wave over that of the transmitted and reflected one, n = 1."""
    power = contact.scalings()[0].subs(contact.exponent, sp.Rational(3, 2))
    back, forth = (x.subs(waves, 1) for x in at_thirty_degrees())
    return (incident / forth) ** power, (incident / back) ** power


def no_reflection() -> sp.Expr:
    """Half-angle at which the reflected wave vanishes, n = 1; beyond, none of its kind returns."""
    back = split()[0].subs(waves, 1)
    (cosine,) = sp.solve(sp.numer(sp.together(back)) / incident, sp.cos(half_angle))[-1:]
    return sp.acos(sp.Abs(cosine))


def argument() -> list[Step]:
    momentum, energy = balances()
    to_branch, to_stem = force_ratios()
    return [
        Step("Axial momentum and energy (P^2/2M) before and after:",
             sp.Eq(momentum, 0), sp.Eq(energy, 0)),
        Step("Besides I2 = 0 there is one solution:",
             *(sp.Eq(x, v) for x, v in zip((reflected, transmitted), split(), strict=True))),
        Step("For branches at 30 degrees from the axis, eq. (7):",
             *(sp.Eq(x, v)
               for x, v in zip((reflected, transmitted), at_thirty_degrees(), strict=True))),
        Step("With one wave a branch and F ~ I^(6/5), the force ratios incident to transmitted and "
             "incident to reflected are", sp.Eq(to_branch, to_branch.evalf(4), evaluate=False),
             sp.Eq(to_stem, to_stem.evalf(4), evaluate=False)),
        Step("The reflected wave vanishes, for one wave a branch, at the half-angle",
             sp.Eq(half_angle, no_reflection())),
    ]  # fmt: skip
