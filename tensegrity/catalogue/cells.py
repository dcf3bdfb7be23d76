"""The planar X, prisms, and columns and plates of prisms that share nodes."""

from __future__ import annotations

from collections import Counter
from typing import Literal, overload

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.catalogue.symmetry import prestressed
from tensegrity.checked import checked
from tensegrity.lattices.lattice import Lattice
from tensegrity.prisms import prism as prisms
from tensegrity.structures.structure import Structure
from tensegrity.typing import Count, Length, NotNegative

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
