"""The parameters of the rigid-elastic potential, in terms of the prism.

They are the symbols of the forms in `rigid_elastic`, each derived from the geometry of the
self-stressed and the loaded state.
"""

from __future__ import annotations

from functools import cache

import sympy as sp

from derivations import prism, regular
from derivations import rigid_elastic as form
from derivations import rigid_response as plain
from derivations.prism import circumradius, k_cross, prestrain, twist
from derivations.regular import ANY, TRIANGLE, Polygon


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
    cosine = plain.cos_twist().subs(
        {circumradius**2: radius_squared, plain.bar: sp.sqrt(bar_squared)}
    )
    cosine = sp.expand(cosine).subs(plain.height, plain.loaded_height)
    sine = sp.sqrt(1 - cosine**2)
    known = {sp.cos(form.twist_1): cosine, sp.sin(form.twist_1): sine, form.area: radius_squared}
    cross_squared = of.expanded(prism.cross_length_squared(None, of)).subs(
        {sp.cos(twist): cosine, sp.sin(twist): sine, prism.height: plain.loaded_height}
    )
    cross_squared_0 = prism.at_reference(prism.cross_length_squared(None, of), of)
    natural_length = sp.sqrt(cross_squared_0) / (1 + prestrain)
    # cross_gain = versine_gain (1 - cos delta) + sine_gain sin delta
    gained = form.cross_gain(of)
    half = gained.subs(form.delta, sp.pi) / 2
    lock_height = sp.sqrt(plain.locking_height_squared(of))
    shape = dict(zip(regular.SIDES, regular.SIDES, strict=True)) if of is ANY else {}
    given = {
        form.stiffness: k_cross,
        plain.preload: plain.preload,
        form.length_at_rest: plain.loaded_height,
        form.shift: plain.loaded_height - plain.reference_height,
        form.far_shift: plain.loaded_height + plain.reference_height,
        form.lock: plain.loaded_height - lock_height,
        form.far_lock: plain.loaded_height + lock_height,
        form.no_lock: sp.Integer(0),
        form.stroke: sp.sqrt(bar_squared) - plain.loaded_height,
        form.far_stroke: sp.sqrt(bar_squared) + plain.loaded_height,
        form.area: radius_squared,
        form.natural: natural_length,
        form.squared_0: cross_squared_0,
        form.surplus: cross_squared_0 - natural_length**2,
        form.root_1: (2 * form.area * sp.sin(form.twist_1)).subs(known),
        form.length_1: sp.sqrt(cross_squared),
        form.extension_1: sp.sqrt(cross_squared) - natural_length,
        form.versine_gain: half.subs(known),
        form.sine_gain: (gained.subs(form.delta, sp.pi / 2) - half).subs(known),
    }
    return given | shape
