"""The rigid-elastic potential in the forms of compiled code, without cancellation.

Two forms of V(h) of `rigid_response` are evaluated: `energy()`, relative to a loaded height h1,
whose error vanishes with the elongation r; and `tension()`, its derivative with two square roots
and one division, without cancellation at the reference and at both locking ends.  Both follow from
V by a change of variable to the change of twist delta = phi - phi1 from a known state, where
compatibility, h^2 - h1^2 = 2 a^2 (cos phi - cos phi1), is quadratic in tan(delta/2).  The
parameters in terms of a prism, `parameter_expressions`, are derived from the geometry of the
self-stressed and the loaded state.
"""

from __future__ import annotations

from functools import cache

import sympy as sp

from derivations import prism, regular
from derivations.prism import (
    circumradius,
    k_cross,
    natural_cross,
    prestrain,
    reference_height,
    twist,
)
from derivations.regular import ANY, TRIANGLE, Polygon
from derivations.rigid_response import (
    bar,
    cos_twist,
    elongation,
    force,
    height,
    loaded_cosine,
    loaded_height,
    locking_height_squared,
    potential_energy,
    preload,
    turn_rate,
)

__all__ = [
    "PARAMETERS", "THROUGH", "bar", "circumradius", "cos_twist", "elongation", "energy", "force",
    "height", "k_cross", "loaded_height", "locking_height_squared", "natural_cross",
    "potential_energy", "preload", "tension",
]  # fmt: skip

delta, twist_1 = sp.symbols(
    "delta phi_1", real=True
)  # change of twist from the known state; its twist
gain = sp.Symbol("z")  # h^2 - h1^2
area = sp.Symbol("A")  # a^2
root, root_1 = sp.symbols("rho rho_1")  # 2 a^2 sin phi, now and in the known state


@cache
def turn() -> tuple[sp.Expr, sp.Expr]:
    """sin delta and 1 - cos delta as rational functions of z and rho, without cancellation.

    Compatibility, z = 2 a^2 (cos(phi1 + delta) - cos phi1), is a quadratic in tan(delta/2).
    The root that vanishes with z is -z/(rho + rho1), in conjugate form.
    """
    t = -gain / (root + root_1)
    return sp.cancel(2 * t / (1 + t**2)), sp.cancel(2 * t**2 / (1 + t**2))


@cache
def cross_gain(of: Polygon = TRIANGLE, start: sp.Expr = twist_1) -> sp.Expr:
    """s^2 - s1^2 in terms of delta, with h eliminated by constant b."""
    squared = prism.cross_length_squared(circumradius, of) - prism.bar_length_squared(circumradius)
    difference = squared.subs(twist, start + delta) - squared.subs(twist, start)
    return sp.expand(of.expanded(difference)).subs(circumradius**2, area)


def height_rate() -> sp.Expr:
    """d phi/d h at constant b, with rho = 2 a^2 sin phi."""
    return turn_rate().subs(sp.sin(twist), root / (2 * circumradius**2)).subs(prism.height, height)


stiffness = sp.Symbol("k_1")
shift, far_shift = sp.symbols("d_1 d_2")  # h1 - h0, h1 + h0
lock, far_lock, no_lock = sp.symbols("p_1 p_2 p_3")  # (r + p1)(r + p2) + p3 = h^2 - h_lock^2
stroke, far_stroke = sp.symbols("e_1 e_2")  # (e1 - r)(e2 + r) = b^2 - h^2
length_at_rest, natural = sp.symbols("h_1 s_N")
squared_0, surplus = sp.symbols("S_0 G")  # s0^2, s0^2 - s_N^2
length_1, extension_1 = sp.symbols("s_1 x_1")  # s1, s1 - s_N
versine_gain, sine_gain = sp.symbols("alpha beta")  # of s^2 - s1^2 in 1 - cos, sin delta

PARAMETERS = (
    stiffness, preload, length_at_rest, shift, far_shift, lock, far_lock, no_lock, stroke,
    far_stroke, area, natural, squared_0, surplus, root_1, length_1, extension_1, versine_gain,
    sine_gain,
)  # fmt: skip


def parameters_of(of: Polygon = TRIANGLE) -> tuple[sp.Symbol, ...]:
    """Symbols of the law: `PARAMETERS`, and those of the polygon if it is `ANY`."""
    return (*PARAMETERS, *regular.SIDES) if of is ANY else PARAMETERS


above_lock, below_stretch = sp.symbols("X Y")  # h^2 - h_lock^2, b^2 - h^2

THROUGH = (
    (gain, (elongation + shift) * (elongation + far_shift), 2 * (length_at_rest + elongation)),
    (
        above_lock,
        (elongation + lock) * (elongation + far_lock) + no_lock,
        2 * (length_at_rest + elongation),
    ),
    (
        below_stretch,
        (stroke - elongation) * (far_stroke + elongation),
        -2 * (length_at_rest + elongation),
    ),
)
"""Squares through which `tension` depends on r, as (symbol, value, derivative).

The values are products of distances, which are exact next to their zeros.  The derivatives are
written as 2 h rather than sums of distances, which is exact down to h = 0, where a thick prism is
flat.
"""


@cache
def energy(of: Polygon = TRIANGLE) -> sp.Expr:
    """V(r) = U(h1 + r) - U(h1) + F0 r [J], with an error proportional to r for small r."""
    sine, versine = turn()
    gained = versine_gain * versine + sine_gain * sine
    extended = gained / (sp.sqrt(length_1**2 + gained) + length_1)
    weight = prism.CROSS.count(of) / 2 * stiffness
    value = weight * extended * (extended + 2 * extension_1)
    value = value.subs(gain, elongation * (elongation + 2 * length_at_rest))
    value = value.subs(root, sp.sqrt(above_lock * below_stretch))
    return value.subs({symbol: form for symbol, form, _ in THROUGH}) + preload * elongation


@cache
def tension(of: Polygon = TRIANGLE) -> sp.Expr:
    """V'(r) = dU/dh + F0 [N] with two square roots and one division, in r and `THROUGH`.

    The known state is the self-stressed one, with rho1 = 2 a^2 C and s^2 - s0^2 ~ 1 - cos delta.
    After elimination of rho^2 the denominator in `turn` is 4 a^2 C M, M = 2 a^2 C + rho + z S/C,
    and s = T/M.  The difference s - s_N is replaced by (s^2 - s_N^2)/(s + s_N), which does not
    cancel.
    """
    m, t = sp.symbols("M T")
    cosine = of.expanded(sp.cos(of.reference_twist)) + gain / (2 * area)
    root_squared = sp.expand(4 * area**2 * (1 - cosine**2))
    if of is ANY:
        root_squared = sp.expand(root_squared.subs(of.sine**2, 1 - of.cosine**2))
    known_root = 2 * area * of.cosine

    def at_reference(fraction):
        numerator, denominator = sp.fraction(fraction.subs(root_1, known_root))
        denominator = sp.factor(sp.expand(denominator).subs(root**2, root_squared))
        return sp.factor(numerator) / denominator.subs(m_of_gain, m)

    m_of_gain = known_root + root + of.sine / of.cosine * gain
    sine, versine = (at_reference(x) for x in turn())
    gained = cross_gain().subs(twist_1, prism.REFERENCE_TWIST)
    if of is ANY:
        gained = cross_gain(of, of.reference_twist)
    slope = sp.diff(gained, delta).subs(sp.sin(delta), sine)
    gained = sp.expand(gained.subs(sp.cos(delta), 1 - versine))

    squared_times_m = sp.expand((squared_0 + gained) * m)
    surplus_times_m = sp.expand((surplus + gained) * m)
    extended = t / m - natural
    conjugate = surplus_times_m / (m * (t / m + natural))
    rate = height_rate().subs(circumradius**2, area)
    weight = prism.CROSS.count(of) / 2 * stiffness
    force = weight * extended * (m / t) * slope * rate
    force = sp.factor(sp.cancel(force / extended) * sp.together(conjugate))

    force = force.subs(t, sp.sqrt(squared_times_m * m)).subs(m, m_of_gain)
    if of is ANY:
        force = force.subs(sp.sqrt(1 - of.cosine**2), of.sine)
    current = {height: length_at_rest + elongation, root: sp.sqrt(above_lock * below_stretch)}
    return force.subs(current) + preload


@cache
def half_turn() -> sp.Expr:
    """tan(delta/2) from the self-stressed state, in r and `PARAMETERS` without preload."""
    sine, versine = turn()
    tangent = sp.cancel(sine / (2 - versine))
    tangent = tangent.subs(root, sp.sqrt(sp.Max(above_lock * below_stretch, 0)))
    return tangent.subs({symbol: form for symbol, form, _ in THROUGH})


@cache
def parameter_expressions(of: Polygon = TRIANGLE) -> dict[sp.Symbol, sp.Expr]:
    """The parameters in terms of l, h0, p0, k1, the loaded height h1 and F0.

    Returns
    -------
    dict of Symbol to Expr
        For a prism that locks.  If `locking_height_squared` is negative, p1 = p2 = h1 and
        p3 = -h_lock^2 make rho real.
    """
    radius_squared = prism.CIRCUMRADIUS**2 if of is TRIANGLE else of.circumradius**2
    bar_squared = prism.at_reference(prism.bar_length_squared(None, of), of)
    cosine = loaded_cosine(of)
    sine = sp.sqrt(1 - cosine**2)
    known = {sp.cos(twist_1): cosine, sp.sin(twist_1): sine, area: radius_squared}
    cross_squared = of.expanded(prism.cross_length_squared(None, of)).subs(
        {sp.cos(twist): cosine, sp.sin(twist): sine, prism.height: loaded_height}
    )
    cross_squared_0 = prism.at_reference(prism.cross_length_squared(None, of), of)
    natural_length = sp.sqrt(cross_squared_0) / (1 + prestrain)
    # cross_gain = versine_gain (1 - cos delta) + sine_gain sin delta
    gained = cross_gain(of)
    half = gained.subs(delta, sp.pi) / 2
    lock_height = sp.sqrt(locking_height_squared(of))
    shape = dict(zip(regular.SIDES, regular.SIDES, strict=True)) if of is ANY else {}
    given = {
        stiffness: k_cross,
        preload: preload,
        length_at_rest: loaded_height,
        shift: loaded_height - reference_height,
        far_shift: loaded_height + reference_height,
        lock: loaded_height - lock_height,
        far_lock: loaded_height + lock_height,
        no_lock: sp.Integer(0),
        stroke: sp.sqrt(bar_squared) - loaded_height,
        far_stroke: sp.sqrt(bar_squared) + loaded_height,
        area: radius_squared,
        natural: natural_length,
        squared_0: cross_squared_0,
        surplus: cross_squared_0 - natural_length**2,
        root_1: (2 * area * sp.sin(twist_1)).subs(known),
        length_1: sp.sqrt(cross_squared),
        extension_1: sp.sqrt(cross_squared) - natural_length,
        versine_gain: half.subs(known),
        sine_gain: (gained.subs(delta, sp.pi / 2) - half).subs(known),
    }
    return given | shape
