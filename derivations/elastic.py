"""The fully elastic prism: equilibrium equations and axial stiffness in closed form.

The equations are the gradient of the energy.  For the stiffness the coordinates are (l, b, h)
instead of (l, phi, h).  Bases and bars then contribute to the diagonal of the Hessian only, their
stiffnesses enter as compliances, and rigid members are the value at zero compliance rather than a
limit.  Source: the talk, part III, "Elastic problem", "Axial stiffness".
"""

from __future__ import annotations

from functools import cache

import sympy as sp

from derivations import prism, regular
from derivations.argument import Step
from derivations.prism import base, height, k_bar, k_base, k_cross, prestrain, twist
from derivations.regular import ANY, TRIANGLE, Polygon

TITLE = "The elastic prism: equilibrium equations and axial stiffness"

third_load = sp.Symbol("f", real=True)  # a third of the axial load, compression > 0
slenderness, extension = sp.symbols("eta_0 q", positive=True)  # h0/a, p0/(1 + p0)
base_compliance, bar_compliance = sp.symbols("c_2 c_3", nonnegative=True)  # 1/k2, 1/k3
bar = sp.Symbol("b", positive=True)


def equations() -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    """(g1, g2, g3), the gradient of U + 3 f h with the normalisation of the talk."""
    energy = prism.energy() + 3 * third_load * height
    g1 = sp.diff(energy, base) / (2 * sp.sqrt(3))
    g2 = -sp.diff(energy, twist) / (sp.sqrt(3) * base)
    g3 = -sp.diff(energy, height) / 3
    return g1, g2, g3


@cache
def cross_length_squared(of: Polygon = TRIANGLE) -> sp.Expr:
    """s^2(l, b, h), the twist eliminated by the bar length, on the branch 0 < phi < pi."""
    cosine = sp.Symbol("c")
    compatibility = prism.bar_length_squared(None, of).subs(sp.cos(twist), cosine) - bar**2
    (cos_twist,) = sp.solve(compatibility, cosine)
    squared = of.expanded(prism.cross_length_squared(None, of))
    return squared.subs({sp.sin(twist): sp.sqrt(1 - cos_twist**2), sp.cos(twist): cos_twist})


@cache
def _reference(of):
    """The reference state in units of the circumradius, a = 1, l = 2 S, h = eta0."""
    lengths = {base: 2 * of.sine, height: slenderness}
    squared = prism.bar_length_squared(None, of).subs({twist: of.reference_twist, **lengths})
    return {**lengths, bar: sp.sqrt(sp.expand(of.expanded(squared)))}


def _at_reference(expression, of):
    """An expression in l, b, h at the reference, expanded so that powers of sqrt 3 combine."""
    expression = sp.expand(expression.subs(_reference(of)))
    if of is ANY:  # the roots are powers of sin phi = C
        expression = sp.expand(expression.replace(_is_root, _in_cosine))
        return sp.cancel(sp.expand(expression.subs(of.cosine**2, 1 - of.sine**2)))
    return sp.expand(sp.radsimp(expression))


def _is_root(power):
    squared = 1 - regular.half_sine**2
    return (
        power.is_Pow
        and power.exp.is_Rational
        and power.exp.q == 2
        and sp.expand(power.base - squared) == 0
    )


def _in_cosine(power):
    return regular.half_cosine ** (2 * power.exp)


@cache
def string_hessian(of: Polygon = TRIANGLE) -> sp.Matrix:
    """Hessian in (l, b, h) of the energy of the cross strings at the reference, for k1 = 1.

    With s^2 = S and force density q, the second derivatives of (s - sN)^2/2 are
    (1 - q)/(4 S) S_i S_j + (q/2) S_ij.
    """
    squared, coordinates = cross_length_squared(of), (base, bar, height)
    length_squared = _at_reference(squared, of)
    slope = [_at_reference(sp.diff(squared, x), of) for x in coordinates]

    def entry(i, j):
        curvature = _at_reference(sp.diff(squared, coordinates[i], coordinates[j]), of)
        outer = (1 - extension) / (4 * length_squared) * sp.expand(slope[i] * slope[j])
        return prism.CROSS.count(of) * (outer + extension / 2 * curvature)

    return sp.Matrix(3, 3, entry)


@cache
def axial_stiffness(of: Polygon = TRIANGLE) -> sp.Expr:
    """K_h0/k1 in eta0, q and the compliances c2 = k1/k2 and c3 = k1/k3."""
    return condensed(string_hessian(of), of)


def condensed(h: sp.Matrix, of: Polygon = TRIANGLE) -> sp.Expr:
    """A string Hessian in (l, b, h) with 6/c2 and 3/c3 added to its diagonal, condensed to h."""
    soft_base, soft_bar = base_compliance, bar_compliance
    bases, bars = prism.BASE.count(of), prism.BAR.count(of)
    ll, bb, hh = (h[i, i] for i in range(3))
    lb, lh, bh = h[0, 1], h[0, 2], h[1, 2]
    eliminated = (
        soft_base * (bars + soft_bar * bb) * lh**2
        + soft_bar * (bases + soft_base * ll) * bh**2
        - 2 * soft_base * soft_bar * lb * lh * bh
    )
    determinant = (bases + soft_base * ll) * (bars + soft_bar * bb) - soft_base * soft_bar * lb**2
    return hh - eliminated / determinant


def axial_stiffness_of_prism(of: Polygon = TRIANGLE) -> sp.Expr:
    """K_h0 [N/m] in l, h0, p0, k1, k2, k3; an infinite k2 or k3 is a zero compliance."""
    radius = prism.CIRCUMRADIUS if of is TRIANGLE else of.circumradius
    return k_cross * axial_stiffness(of).subs(
        {
            slenderness: prism.reference_height / radius,
            extension: prestrain / (1 + prestrain),
            base_compliance: k_cross / k_base,
            bar_compliance: k_cross / k_bar,
        },
        simultaneous=True,
    )


def limit(**compliances: sp.Expr | float) -> sp.Expr:
    """K_h0/k1 for rigid bases (`base=0`), rigid bars (`bar=0`) or both, simplified."""
    symbols = {"base": base_compliance, "bar": bar_compliance}
    value = axial_stiffness().subs({symbols[name]: c for name, c in compliances.items()})
    return sp.cancel(sp.together(value), extension=sp.sqrt(3))


def small_prestrain() -> sp.Expr:
    """Limit of K_h0/(k1 q) as the prestrain vanishes, for any compliances."""
    value = sp.together(axial_stiffness() / extension).subs(extension, 0)
    return sp.cancel(value, extension=sp.sqrt(3))


def argument() -> list[Step]:
    g1, g2, g3 = equations()
    symbols = sp.symbols("H_ll H_bb H_hh H_lb H_lh H_bh")
    hessian = string_hessian()
    ll, bb, hh, lb, lh, bh = symbols
    symbolic = sp.Matrix([[ll, lb, lh], [lb, bb, bh], [lh, bh, hh]])
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    return [
        Step("The energy of 3 cross strings, 6 base strings and 3 bars is", prism.energy()),
        Step(
            "In equilibrium under the load F = 3f the gradient of U + F h vanishes. With the "
            "normalisation of the talk, (U_l/(2 sqrt 3), -U_phi/(sqrt 3 l), -f - U_h/3), it reads",
            *(sp.Eq(sp.Symbol(f"g_{i}"), g) for i, g in enumerate((g1, g2, g3), 1)),
        ),
        Step(
            "For the stiffness the coordinates are l, b, h. The bar length eliminates the twist:",
            sp.Eq(sp.Symbol("s") ** 2, cross_length_squared()),
        ),
        Step(
            "The Hessian of the cross strings at the reference, with k1 = a = 1 and "
            "q = p0/(1 + p0), has the entries",
            *(sp.Eq(name, hessian[i, j]) for name, (i, j) in zip(symbols, pairs, strict=True)),
        ),
        Step(
            "Bases and bars add 6 k2 and 3 k3 to its diagonal. Eliminating l and b gives, with "
            "c2 = k1/k2 and c3 = k1/k3,",
            sp.Eq(sp.Symbol("K_h0") / k_cross, condensed(symbolic)),
        ),
        Step("For rigid bases this is", sp.Eq(sp.Symbol("K_h0") / k_cross, limit(base=0))),
        Step("for rigid bars", sp.Eq(sp.Symbol("K_h0") / k_cross, limit(bar=0))),
        Step("and if both are rigid", sp.Eq(sp.Symbol("K_h0") / k_cross, limit(base=0, bar=0))),
        Step(
            "The stiffness vanishes with the prestrain in proportion to q:",
            sp.Eq(
                sp.Limit(sp.Symbol("K_h0") / (k_cross * extension), extension, 0), small_prestrain()
            ),
        ),
    ]
