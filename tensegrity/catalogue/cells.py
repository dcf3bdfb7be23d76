"""The planar X, prisms, columns and plates of prisms, and units with two stable states.

The units stand as potentials of one coordinate and as structures.
"""

from __future__ import annotations

import math
from collections import Counter
from itertools import combinations
from typing import Annotated, Literal, overload

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.catalogue.solids import prestressed
from tensegrity.checked import checked
from tensegrity.errors import TensegrityError
from tensegrity.lattices.lattice import Lattice
from tensegrity.prisms import prism as prisms
from tensegrity.springs.potential import Potential
from tensegrity.structures.structure import Structure
from tensegrity.typing import Count, Length, NotNegative, Sides, Stiffness

NEXT = (1, 2, 3, 0)


@checked
def snelson_x(
    width: Length = 1.0,
    height: Length = 1.0,
    prestrain: NotNegative = 0.1,
    k_bar: ArrayLike = 100.0,
    k_string: ArrayLike = 1.0,
    mass: ArrayLike = 1.0,
) -> Structure:
    """Snelson's X: two bars along the diagonals of a rectangle of four strings, in the plane.

    Parameters
    ----------
    width, height : float, optional
        Of the rectangle [m].
    prestrain, k_bar, k_string, mass : optional
        Largest prestrain of a string, >= 0; then as of `Structure`.

    Returns
    -------
    Structure
        Nodes counterclockwise from the origin; strings in that order, the lower one first.  Force
        densities of strings and bars are opposite and equal (Snelson 1965, US patent 3169611).

    Examples
    --------
    >>> from tensegrity import catalogue
    >>> x = catalogue.snelson_x(width=2.0)
    >>> print(repr(x), x.is_stable())
    Structure(4 nodes in 2 dimensions, 2 bars, 4 strings, 0 of them slack) True
    """
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * [width, height]
    strings = list(enumerate(NEXT))
    return prestressed(corners, [[(0, 2), (1, 3)]], [strings], prestrain, k_bar, k_string, mass)


def prism(
    sides: int = 3,
    base: float = 1.0,
    height: float = 1.0,
    prestrain: float = 0.1,
    k_bar: float = 100.0,
    k_string: float = 1.0,
    mass: ArrayLike = 1.0,
) -> Structure:
    """A regular prism of as many bars as its polygons have sides, upright.

    Parameters
    ----------
    sides : int, optional
        At least 3.
    base, height : float, optional
        Side of the polygons and height [m].
    prestrain, k_bar, k_string, mass : optional
        Prestrain of the cross strings, >= 0, and stiffnesses [N/m] as of `tensegrity.Prism`, one
        for cross and base strings; mass as of `Structure`.

    Returns
    -------
    Structure
        That of `Prism.structure`, at twist pi/2 + pi/sides (Connelly & Terrell 1995).

    Examples
    --------
    >>> from tensegrity import catalogue
    >>> catalogue.prism(4)
    Structure(8 nodes in 3 dimensions, 4 bars, 12 strings, 0 of them slack)
    """
    return column(1, sides, base, height, prestrain, k_bar, k_string, mass)


@overload
def column(
    count: int | None = None,
    sides: int = 3,
    base: float = 1.0,
    height: float = 1.0,
    prestrain: float = 0.1,
    k_bar: float = 100.0,
    k_string: float = 1.0,
    mass: ArrayLike = 1.0,
    chirality: str = "alternate",
    periodic: Literal[False] = False,
) -> Structure: ...


@overload
def column(
    count: int | None = None,
    sides: int = 3,
    base: float = 1.0,
    height: float = 1.0,
    prestrain: float = 0.1,
    k_bar: float = 100.0,
    k_string: float = 1.0,
    mass: ArrayLike = 1.0,
    chirality: str = "alternate",
    *,
    periodic: Literal[True],
) -> Lattice: ...


def column(
    count: int | None = None,
    sides: int = 3,
    base: float = 1.0,
    height: float = 1.0,
    prestrain: float = 0.1,
    k_bar: float = 100.0,
    k_string: float = 1.0,
    mass: ArrayLike = 1.0,
    chirality: str = "alternate",
    periodic: bool = False,
) -> Structure | Lattice:
    """A column of prisms that share their polygons, each rotated relative to the one below.

    Parameters
    ----------
    count : int, optional
        Number of prisms, by default 5.
    sides, base, height, prestrain, k_bar, k_string, mass : optional
        Of each: see `prism`.  Shared strings are twice as stiff.
    chirality, periodic : optional
        As of `Prism.column`.

    Returns
    -------
    Structure or Lattice
        That of `Prism.column`.
    """
    unit = prisms.Prism(base, height, prestrain, k_string, k_string, k_bar, sides)
    column = unit.column(count, chirality, periodic=periodic)
    return column.at_mass(mass)


@checked
def plate(
    rows: Count = 3,
    columns: Count = 3,
    side: Length = 1.0,
    height: Length = 0.5,
    prestrain: NotNegative = 0.1,
    k_bar: ArrayLike = 100.0,
    k_string: ArrayLike = 1.0,
    mass: ArrayLike = 1.0,
) -> Structure:
    """A plate of two layers: prisms of four bars whose upper corners are above mid-sides below.

    Parameters
    ----------
    rows, columns : int, optional
        Number of prisms in either direction.
    side : float, optional
        Side of the lower squares [m]; neighbours share it and the upper node above its midpoint.
    height : float, optional
        Distance of the two layers [m].
    prestrain, k_bar, k_string, mass : optional
        Largest prestrain of a string, >= 0; then as of `Structure`.

    Returns
    -------
    Structure
        Cross strings come first, then those of the upper layer, of the rim of the lower layer and
        those, if any, that two lower squares share, which carry twice the force.

    Notes
    -----
    Each prism by itself is in stable equilibrium; neighbours share three nodes that are not on
    one line.  The prism is the half-cuboctahedron of Motro 2003, Tensegrity: Structural Systems
    for the Future.
    """
    check.memory(f"a plate of {rows} times {columns} prisms", 32 * (16.0 * rows * columns) ** 2)
    numbers: dict[tuple[int, int, int], int] = {}  # of nodes, by halves of a side and layer

    bars, cross, upper, lower = [], [], [], []
    for x, y in np.ndindex(columns, rows):
        corners = [(2 * x + i, 2 * y + j) for i, j in ((0, 0), (2, 0), (2, 2), (0, 2))]
        middles = [(2 * x + i, 2 * y + j) for i, j in ((1, 0), (2, 1), (1, 2), (0, 1))]
        below, above = (
            [numbers.setdefault((*place, layer), len(numbers)) for place in places]
            for layer, places in enumerate((corners, middles))
        )
        for i, j in enumerate(NEXT):
            bars.append((below[i], above[j]))
            cross.append((below[i], above[i]))
            upper.append((above[i], above[j]))
            lower.append((min(below[i], below[j]), max(below[i], below[j])))
    times = Counter(lower)
    lowers = [[pair for pair in times if times[pair] == n] for n in (1, 2)]
    nodes = np.array(list(numbers)) * [side / 2, side / 2, height]
    return prestressed(nodes, [bars], [cross, upper, *lowers], prestrain, k_bar, k_string, mass)


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
