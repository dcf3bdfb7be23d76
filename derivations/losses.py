"""Decay of Nesterenko's wave on a chain of contacts that dissipate a little.

Each contact loses the integral of its dissipative force times the rate of the overlap while the
wave passes, and the wave's energy decreases by this amount per contact.  The momentum that
the wave loses stays in the beads behind it.
Model: G. Kuwabara, K. Kono, Jpn. J. Appl. Phys. 26, 1230 (1987); own derivation.
"""

from __future__ import annotations

from functools import cache

import sympy as sp

from derivations import contact
from derivations.argument import Step

TITLE = "Losses: the decay of a solitary wave on beads"

time, number = sp.symbols("gamma j", positive=True)
first = sp.Symbol("xi_0", positive=True)


def _integral(expression: sp.Expr) -> sp.Expr:
    """Integral over the hump of w = cos(y), y = kappa x, from -pi/2 to pi/2."""
    y = sp.Symbol("y")
    return sp.integrate(expression.subs(_w, sp.cos(y)), (y, -sp.pi / 2, sp.pi / 2))


_w = sp.Symbol("w", positive=True)


@cache
def loss_and_energy() -> tuple[sp.Expr, sp.Expr]:
    """Energy that a contact loses to the force gamma dF/dt, and energy of the wave, for n = 3/2.

    F = alpha xi^n is the elastic force; the wave moves by one contact in the time 1/c.
    """
    n = sp.Rational(3, 2)
    lam, kappa, power = (x.subs(contact.exponent, n) for x in contact.nesterenko())
    speed = sp.sqrt(contact.constant * lam / contact.mass)
    shape = _w**power
    slope_squared = sp.diff(shape, _w) ** 2 * (1 - _w**2) * kappa**2
    rate_of_loss = time * n * contact.constant * speed * contact.wave ** (n + 1)
    lost = rate_of_loss * _integral(sp.expand(shape ** (n - 1) * slope_squared)) / kappa
    kinetic = contact.mass * speed**2 * contact.wave**2 * _integral(shape**2) / (2 * kappa)
    whole = kinetic * (n + 3) / (n + 1)  # by the virial theorem, as in `contact.effective_mass`
    return sp.simplify(lost), sp.simplify(whole)


@cache
def rate() -> sp.Expr:
    """K of d(xi_m)/dj = -K gamma sqrt(alpha/m) xi_m^(5/4)."""
    lost, energy = loss_and_energy()
    slope = -lost / sp.diff(energy, contact.wave)
    unit = time * sp.sqrt(contact.constant / contact.mass) * contact.wave ** sp.Rational(5, 4)
    return sp.simplify(-slope / unit)


@cache
def growth() -> sp.Expr:
    """Increase of xi_m^(-1/4) from one contact to the next."""
    return rate() / 4 * time * sp.sqrt(contact.constant / contact.mass)


def amplitude() -> sp.Expr:
    """Amplitude of the overlap after j contacts."""
    return (first ** sp.Rational(-1, 4) + growth() * number) ** -4


def argument() -> list[Step]:
    lost, energy = loss_and_energy()
    return [
        Step("While Nesterenko's wave passes, a contact with the force gamma dF/dt besides its "
             "elastic one F = alpha xi^(3/2) loses", lost),
        Step("and the wave has the energy", energy),
        Step("The energy falls by the loss from one contact to the next, so that the amplitude "
             "follows d xi_m/dj = -K gamma √(alpha/m) xi_m^(5/4) with",
             sp.Eq(sp.Symbol("K"), rate()),
             sp.Eq(sp.Symbol("K"), rate().evalf(6), evaluate=False)),
        Step("The root of the fourth order of 1/xi_m grows in proportion to the distance; far from "
             "the blow the amplitude falls like its fourth power:",
             sp.Eq(contact.wave, amplitude())),
    ]  # fmt: skip
