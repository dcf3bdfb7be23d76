"""Prisms from what is cut and measured: natural lengths, moduli, diameters.

Source: the forms of `derivations.polygon`, "From cut lengths".
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from tensegrity import check
from tensegrity.errors import EquilibriumError
from tensegrity.once import once

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from typing import Any


def member_stiffness(modulus: float, area: float, length: float) -> float:
    """Spring constant of a member.

    Parameters
    ----------
    modulus : float
        Young's modulus [Pa].
    area : float
        Cross section [m^2].
    length : float
        Natural length [m]: not the stressed one.

    Returns
    -------
    float
        EA over the natural length [N/m].
    """
    modulus = check.number("modulus", modulus, above=0, unit="Pa")
    area = check.number("area", area, above=0, unit="m^2")
    length = check.number("length", length, above=0, unit="m")
    return check.number("stiffness", modulus * area / length, above=0, unit="N/m")


def assembled(
    lengths: Sequence[float], stiffness: Sequence[float], sides: int
) -> tuple[float, float, float]:
    """(base, height, prestrain) of the prism that such members make; see `Prism.from_members`."""
    from scipy.optimize import brentq

    sine = math.sin(math.pi / sides)
    cross, base, bar = lengths
    if not 1e-100 < min(lengths) <= max(lengths) < 1e100:
        raise EquilibriumError(
            f"natural lengths {min(lengths):g} to {max(lengths):g} m must be within 1e-100 to 1e100"
        )
    needed = cross**2 + base**2 / sine
    if not bar**2 > needed:
        raise EquilibriumError(
            f"bars of natural length {bar:g} m leave all strings slack: bN^2 = {bar**2:.9g} m^2 "
            f"must be above sN^2 + lN^2/sin(pi/{sides}) = {needed:.9g} m^2"
        )
    if not 1e-100 < min(stiffness) <= stiffness[0] < 1e100:
        raise EquilibriumError(
            f"stiffness {min(stiffness):g} N/m must be above 1e-100 and k_cross {stiffness[0]:g} "
            "N/m below 1e100"
        )
    condition, stretched, level = _forms()
    softness = [1 / k for k in stiffness]
    most = min(stiffness[0], 2 * sine * stiffness[1])

    def gap(x: float) -> float:
        return condition(x, *lengths, *softness, sine)

    high = most * (1 - 1e-16)
    if not gap(0.0) * gap(high) < 0:
        raise EquilibriumError(
            f"bar {lengths[2]:g} m is too long beside cross {lengths[0]:g} m and base "
            f"{lengths[1]:g} m: no numbers are near enough to the stress that strings take then"
        )
    density = brentq(gap, 0.0, high, xtol=1e-300, rtol=1e-15)
    length, side, _ = stretched(density, *lengths, *softness, sine)
    squared = level(length, side, sine)
    if not squared > 0:
        raise EquilibriumError(
            f"these members make no prism: h^2 = {squared:.6g} m^2 must be above 0 (cross strings "
            f"of {length:g} m beside a base of {side:g} m)"
        )
    return side, math.sqrt(squared), density / (stiffness[0] - density)


@once
def _forms() -> tuple[Callable[..., Any], ...]:
    """Condition, lengths and squared height as functions; stiffnesses enter as compliances."""
    import sympy as sp

    from derivations import polygon, prism, regular

    softness = sp.symbols("c_1:4", nonnegative=True)
    constants = (prism.k_cross, prism.k_base, prism.k_bar)
    condition, lengths = polygon.members_condition()
    soft = dict(zip(constants, (1 / c for c in softness), strict=True))
    symbols = (polygon.cross_density, *polygon.natural_lengths, *softness, regular.half_sine)
    forms = [sp.cancel(length.subs(soft)) for length in lengths]
    squares = [form**2 for form in forms]
    gap = squares[2] - squares[0] - squares[1] / regular.half_sine
    if sp.simplify(gap - condition.subs(soft)) != 0:
        raise ArithmeticError("the condition on members is not that of their lengths")
    cross = sp.Symbol("s", positive=True)
    return (
        sp.lambdify(symbols, gap, "math"),
        sp.lambdify(symbols, forms, "math"),
        sp.lambdify((cross, prism.base, regular.half_sine), polygon.height_squared(), "math"),
    )
