"""Units with two stable states, as potentials of one coordinate and as structures."""

from __future__ import annotations

import math
from itertools import combinations
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.catalogue.symmetry import prestressed
from tensegrity.checked import checked
from tensegrity.errors import TensegrityError
from tensegrity.springs.potential import Potential
from tensegrity.structures.structure import Structure
from tensegrity.typing import Length, NotNegative, Sides, Stiffness


@checked
def twin_strings(
    sides: Sides = 3,
    base: Length = 1.0,
    height: Length = 1.0,
    prestrain: Annotated[float, "> -1"] = 0.1,
    k_string: Stiffness = 1.0,
    *,
    other_prestrain: Annotated[float, "> -1"] | None = None,
    other_k_string: Stiffness | None = None,
    torque: Annotated[float, "N m"] = 0.0,
) -> Potential:
    """Energy of a prism with upright rigid bars and cross strings of both hands, by its twist.

    The polygons, each rigid, turn about their common axis without other loads; prestrains are
    those at twist 0.  Beyond the prestrain base^2 cot^2(pi/sides)/(2 (height^2 + base^2)) equal
    strings make two wells of equal depth; unequal prestrains or stiffnesses, or a torque, lift one
    of them.  The wells end where one hand is slack while the other is longest: with equal sides and
    bars beyond the prestrain 0.1260 of triangles and 0.4142 of squares.  Each well has a barrier on
    its outer side as well, where the taut strings are longest: a unit that passes it turns on until
    its bars meet, at the end of the domain.

    Parameters
    ----------
    sides : int, optional
        Corners of each polygon, at least 3.
    base, height : float, optional
        Side of the polygons, and length of the bars [m].
    prestrain, k_string : float, optional
        Of the strings that a positive twist stretches, > -1; stiffness of each [N/m].
    other_prestrain, other_k_string : float, optional
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
        An argument is outside these bounds.

    Examples
    --------
    >>> from tensegrity import catalogue
    >>> unit = catalogue.twin_strings(prestrain=0.1)
    >>> unit.tension([-0.3307602768, 0.0, 0.3307602768]).round(9) + 0.0
    array([0., 0., 0.])
    """
    import sympy as sp

    from derivations import bistable as form

    stiffness = k_string, k_string if other_k_string is None else other_k_string
    prestrains = prestrain, prestrain if other_prestrain is None else other_prestrain
    radius = base / (2 * math.sin(math.pi / sides))
    length = math.hypot(height, base)
    values = {
        form.height: height, form.radius: radius, form.stiffness: sides * stiffness[0],
        form.other_stiffness: sides * stiffness[1],
        form.natural: length / (1 + prestrains[0]), form.other: length / (1 + prestrains[1]),
        form.torque: torque,
    }  # fmt: skip
    if not math.isfinite(sides * max(stiffness) * (radius + length) * (radius + length)):
        raise TensegrityError(f"base {base:g} m and height {height:g} m are too large")
    energy = form.energy(form.twin_strings(), form.twist).subs(form.sides, sp.Integer(sides))
    flat = math.acos(1 - min(height / radius, 2.0) ** 2 / 2)  # or bars that meet
    renamed = {symbol: sp.Symbol(str(symbol).replace("'", "_2")) for symbol in values}
    named = {str(renamed[symbol]): value for symbol, value in values.items()}
    return Potential(energy.xreplace(renamed), form.twist, named, domain=(-flat, flat))


@checked
def twin_prism(
    sides: Sides = 3,
    base: Length = 1.0,
    height: Length = 1.0,
    prestrain: NotNegative = 0.05,
    k_bar: Stiffness = 100.0,
    k_string: Stiffness = 1.0,
    mass: ArrayLike = 1.0,
) -> Structure:
    """The prism of `twin_strings` with elastic bars, at twist 0.

    Parameters
    ----------
    sides, base, height : optional
        As of `twin_strings`.
    prestrain : float, optional
        Of all strings, >= 0.  Below the threshold of `twin_strings` the structure is stable.
    k_bar, k_string : float, optional
        Stiffness of every bar and of every string [N/m].
    mass : optional
        As of `Structure`.

    Returns
    -------
    Structure
        Nodes counterclockwise, the lower polygon first.  Of the bars the upright ones come first,
        then those of the lower and of the upper polygon, its chords last; of the strings those that
        a positive twist of the upper polygon stretches.  Polygons with more than three sides warp
        unless they lie on plates.

    Examples
    --------
    >>> from tensegrity import catalogue, plates
    >>> unit = catalogue.twin_prism()
    >>> print(repr(unit), unit.is_stable(plates([0, 1, 2], [3, 4, 5])))
    Structure(6 nodes in 3 dimensions, 9 bars, 6 strings, 0 of them slack) True
    """
    check.memory(f"a prism of {sides} sides", 8 * (6.0 * sides) ** 2)
    angle, every = 2 * np.pi * np.arange(sides) / sides, range(sides)
    ring = base / (2 * math.sin(math.pi / sides)) * np.column_stack([np.cos(angle), np.sin(angle)])
    nodes = np.vstack([np.column_stack([ring, np.full(sides, z)]) for z in (0.0, height)])
    upright = [(i, sides + i) for i in every]
    pairs = [sorted((i, (i + 1) % sides)) for i in every]
    edges = [(start + i, start + j) for start in (0, sides) for i, j in pairs]
    hands = [[(i, sides + (i + turn) % sides) for i in every] for turn in (1, -1)]
    s = prestressed(nodes, [upright, edges], hands, prestrain, k_bar, k_string, mass)
    chords = [(start + i, start + j) for start in (0, sides)
              for i, j in combinations(every, 2) if [i, j] not in pairs]  # fmt: skip
    if not chords:
        return s
    across = [float(np.linalg.norm(nodes[j] - nodes[i])) for i, j in chords]
    natural = np.insert(s.natural_lengths, s.bars, across)
    bars = [*upright, *edges, *chords]
    return Structure(nodes, bars, [*hands[0], *hands[1]], k_bar, k_string, mass, natural)
