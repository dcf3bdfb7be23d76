"""Axial response of a prism with rigid bases and bars: one degree of freedom, in closed form.

With constant l and b the height determines the twist, and only the cross strings store energy.
The derivation gives phi(h), V(h), its derivatives, and both ends of the range, in the form of the
talk (part III, "Rigid-elastic model").
"""

from __future__ import annotations

from functools import cache

import sympy as sp

from derivations import prism
from derivations.argument import Step
from derivations.prism import circumradius, natural_cross, prestrain, twist
from derivations.regular import TRIANGLE, Polygon

TITLE = "The rigid-elastic prism: twist, force, locking"

height, bar = sp.symbols("h b", positive=True)
reference_height, loaded_height = sp.symbols("h_0 h_1", positive=True)
elongation, preload = sp.symbols("r F_0", real=True)


@cache
def cos_twist() -> sp.Expr:
    """cos phi at constant b."""
    cosine = sp.Symbol("c")
    compatibility = prism.bar_length_squared(circumradius).subs(sp.cos(twist), cosine)
    return sp.solve(compatibility - bar**2, cosine)[0]


def loaded_cosine(of: Polygon = TRIANGLE) -> sp.Expr:
    """cos phi at the loaded height."""
    radius_squared = prism.CIRCUMRADIUS**2 if of is TRIANGLE else of.circumradius**2
    bar_squared = prism.at_reference(prism.bar_length_squared(None, of), of)
    cosine = cos_twist().subs({circumradius**2: radius_squared, bar: sp.sqrt(bar_squared)})
    return sp.expand(cosine).subs(height, loaded_height)


def loaded_twist(of: Polygon = TRIANGLE) -> sp.Expr:
    """phi at the loaded height."""
    return sp.acos(loaded_cosine(of))


@cache
def cross_length(of: Polygon = TRIANGLE) -> sp.Expr:
    """s(h), with the twist eliminated, on the branch 0 < phi < pi."""
    squared = of.expanded(prism.cross_length_squared(circumradius, of))
    sine = sp.sqrt(1 - cos_twist() ** 2)
    return sp.sqrt(squared.subs({sp.sin(twist): sine, sp.cos(twist): cos_twist()}))


def potential_energy(of: Polygon = TRIANGLE) -> sp.Expr:
    """Energy V(h) of the cross strings [J]."""
    return prism.CROSS.energy(cross_length(of), of)


def force(order: int = 1, of: Polygon = TRIANGLE) -> sp.Expr:
    """Derivative of V(h): order 1 is the axial force [N], tension > 0; 2 is the stiffness [N/m]."""
    return sp.diff(potential_energy(of), height, order)


@cache
def locking_height_squared(of: Polygon = TRIANGLE) -> sp.Expr:
    """h^2 at twist pi, where the bars meet on the axis; negative if they never do."""
    square = sp.Symbol("H")
    squared = prism.bar_length_squared(None, of)
    at_lock = squared.subs({twist: sp.pi, prism.height**2: square})
    return sp.solve(at_lock - prism.at_reference(squared, of), square)[0]


# --- the same force in the twist, and both ends of the range ---------------------------------


def turn_rate() -> sp.Expr:
    """d phi/d h at constant b."""
    squared = prism.bar_length_squared(circumradius)
    return -sp.diff(squared, prism.height) / sp.diff(squared, twist)


@cache
def force_of_twist() -> sp.Expr:
    """F = dV/dh at constant b, in terms of h, s and phi [N], tension > 0."""
    squared = prism.cross_length_squared(circumradius)
    slope = sp.diff(squared, prism.height) + sp.diff(squared, twist) * turn_rate()
    length = sp.Symbol("s", positive=True)
    factor = sp.apart(sp.expand(slope / (2 * prism.height)), sp.sin(twist))
    return prism.CROSS.number * prism.CROSS.tension(length) * prism.height / length * factor


def stretched_height() -> sp.Expr:
    """h at twist 0, where the bars stand upright, the other locking end."""
    return sp.sqrt(prism.at_reference(prism.bar_length_squared()))


@cache
def lock_force() -> sp.Expr:
    """Leading term of dV/dh above the locking height H, in g = h - H.

    There s has a square-root term, s^2 = s_lock^2 - kappa g^(1/2) + O(g).
    """
    gap, lock = sp.symbols("g H", positive=True)
    length = sp.Symbol("s_lock", positive=True)
    at_lock = {bar: sp.sqrt(lock**2 + 4 * circumradius**2), height: lock + gap}
    slope = sp.diff(cross_length() ** 2, height).subs(at_lock)
    kappa = sp.limit(sp.simplify(slope) * sp.sqrt(gap), gap, 0, "+")
    tension = prism.CROSS.number * prism.CROSS.tension(length)  # ds = d(s^2)/(2 s)
    return tension / (2 * length) * kappa / sp.sqrt(gap)


def lock_order() -> tuple[sp.Expr, sp.Expr]:
    """Exponents of the distance to locking in the force and in the energy up to locking."""
    gap = sp.Symbol("g", positive=True)
    exponent = lock_force().as_coeff_exponent(gap)[1]
    return exponent, max(exponent + 1, sp.Integer(0))


@cache
def locking_energy() -> sp.Expr:
    """V between the reference and locking [J]; it is finite, as both string lengths are."""
    at_lock = prism.cross_length_squared().subs({twist: sp.pi})
    at_lock = sp.expand(at_lock.subs(prism.height**2, locking_height_squared()))
    at_rest = sp.sqrt(prism.at_reference(prism.cross_length_squared()))
    natural = at_rest / (1 + prestrain)
    stored = prism.CROSS.energy(sp.sqrt(at_lock)) - prism.CROSS.energy(at_rest)
    return sp.factor_terms(stored.subs(natural_cross, natural))


def argument() -> list[Step]:
    locked, other = sp.Symbol("h_lock"), sp.Symbol("h_stretch")
    return [
        Step("At constant l and b the bar length determines the twist:",
             sp.Eq(sp.cos(twist), cos_twist())),
        Step("Only the cross strings store energy. V(h) is", potential_energy()),
        Step("Its derivative, in terms of the twist instead of the roots, is",
             sp.Eq(sp.Symbol("F"), force_of_twist())),
        Step("In compression the bars meet on the axis at phi = pi, at the height",
             sp.Eq(locked**2, locking_height_squared())),
        Step("which exists if the prism is slender enough. With g = h - H > 0 the force near it is",
             lock_force()),
        Step("an inverse square root, so that the energy up to locking is finite:",
             sp.Eq(sp.Symbol("V_lock"), locking_energy())),
        Step("In extension the prism locks where the bars stand upright, phi = 0, at the height",
             sp.Eq(other, stretched_height())),
    ]  # fmt: skip
