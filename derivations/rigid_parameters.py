"""The parameters of the rigid-elastic potential, in terms of the prism.

They are the symbols of `rigid_elastic`, whose forms compiled code evaluates: each is derived from
the geometry of the self-stressed state and of the loaded one.
"""

from __future__ import annotations

from functools import cache

import sympy as sp

from derivations import prism
from derivations.prism import circumradius, k_cross, prestrain, twist
from derivations.regular import ANY, TRIANGLE, Polygon
from derivations.rigid_elastic import (
    SIDES,
    area,
    cross_gain,
    delta,
    extension_1,
    far_lock,
    far_shift,
    far_stroke,
    length_1,
    length_at_rest,
    lock,
    natural,
    no_lock,
    root_1,
    shift,
    sine_gain,
    squared_0,
    stiffness,
    stroke,
    surplus,
    twist_1,
    versine_gain,
)
from derivations.rigid_response import (
    bar,
    cos_twist,
    height,
    loaded_height,
    locking_height_squared,
    preload,
    reference_height,
)


@cache
def parameter_expressions(of: Polygon = TRIANGLE) -> dict[sp.Symbol, sp.Expr]:
    """The parameters in terms of l, h0, p0, k1, the loaded height h1 and F0.

    Returns
    -------
    dict of Symbol to Expr
        For a prism that locks; where `locking_height_squared` is negative, p1 = p2 = h1 and
        p3 = -h_lock^2 keep rho real.
    """
    radius_squared = prism.CIRCUMRADIUS**2 if of is TRIANGLE else of.circumradius**2
    bar_squared = prism.at_reference(prism.bar_length_squared(None, of), of)
    cosine = cos_twist().subs({circumradius**2: radius_squared, bar: sp.sqrt(bar_squared)})
    cosine = sp.expand(cosine).subs(height, loaded_height)
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
    shape = dict(zip(SIDES, SIDES, strict=True)) if of is ANY else {}
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
