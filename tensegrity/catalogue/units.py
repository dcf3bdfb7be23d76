"""Units with two stable states, as potentials of one coordinate."""

from __future__ import annotations

import math

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.springs.potential import Potential


def twin_strings(
    sides: int = 3,
    base: float = 1.0,
    height: float = 1.0,
    prestrain: float = 0.1,
    k_string: float = 1.0,
    *,
    other_prestrain: float | None = None,
    torque: float = 0.0,
) -> Potential:
    """Energy of a prism with upright rigid bars and cross strings of both hands, by its twist.

    The polygons, each rigid, turn about their common axis without other loads; prestrains are
    those at twist 0.  Beyond the prestrain base^2 cot^2(pi/sides)/(2 (height^2 + base^2)) equal
    strings make two wells of equal depth; unequal prestrains, or a torque, lift one of them.  The
    wells end where one hand is slack while the other is longest: with equal sides and bars beyond
    the prestrain 0.1260 of triangles and 0.4142 of squares.  Each well has a barrier on its outer
    side as well, where the taut strings are longest: a unit that passes it turns on until its bars
    meet, at the end of the domain.

    Parameters
    ----------
    sides : int, optional
        Corners of each polygon, at least 3.
    base, height : float, optional
        Side of the polygons, and length of the bars [m].
    prestrain, k_string : float, optional
        Of the strings that a positive twist stretches, > -1; stiffness of every string [N/m].
    other_prestrain : float, optional
        Of the strings of the other hand; by default the same.
    torque : float, optional
        Constant torque towards positive twists [N m].

    Returns
    -------
    Potential
        Energy [J] of the twist [rad] in place of an elongation: tension and stiffness are in N m
        and N m/rad.  Strings go slack.  The twist 0 need not be an equilibrium.

    Raises
    ------
    TensegrityError
        An argument outside these bounds.

    Examples
    --------
    >>> from tensegrity import catalogue
    >>> unit = catalogue.twin_strings(prestrain=0.1)
    >>> unit.tension([-0.3307602768, 0.0, 0.3307602768]).round(9) + 0.0
    array([0., 0., 0.])
    """
    import sympy as sp

    from derivations import bistable as form

    sides = check.whole("sides", sides, least=3)
    base = check.number("base", base, above=0, unit="m")
    height = check.number("height", height, above=0, unit="m")
    k_string = check.number("k_string", k_string, above=0, unit="N/m")
    given = prestrain if other_prestrain is None else other_prestrain
    prestrains = [
        check.number(*x, above=-1) for x in (("prestrain", prestrain), ("other_prestrain", given))
    ]
    radius = base / (2 * math.sin(math.pi / sides))
    length = math.hypot(height, base)
    values = {
        form.height: height, form.radius: radius, form.stiffness: sides * k_string,
        form.natural: length / (1 + prestrains[0]), form.other: length / (1 + prestrains[1]),
        form.torque: check.number("torque", torque, unit="N m"),
    }  # fmt: skip
    if not math.isfinite(sides * k_string * (radius + length) * (radius + length)):
        raise TensegrityError(f"base {base:g} m and height {height:g} m are too large")
    energy = form.energy(form.twin_strings(), form.twist).subs(form.sides, sp.Integer(sides))
    flat = math.acos(max(1 - (height / radius) ** 2 / 2, -1.0))  # or bars that meet
    renamed = {symbol: sp.Symbol(str(symbol).replace("'", "_2")) for symbol in values}
    named = {str(renamed[symbol]): value for symbol, value in values.items()}
    return Potential(energy.xreplace(renamed), form.twist, named, domain=(-flat, flat))
