"""Tensegrities with the rotations of a regular solid: all nodes are images of one.

Each node has one bar, to the image under half a turn, and strings to its images under two other
rotations.  For given force densities of the strings the node lies along an eigenvector of a matrix
of three rows, and the least force density of the bars belongs to it (Connelly & Back 1998).
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from tensegrity.catalogue.symmetry import ZERO, Orbit, first_root, prestressed
from tensegrity.checked import checked
from tensegrity.errors import EquilibriumError
from tensegrity.structures.structure import Structure
from tensegrity.typing import Array, Length, NotNegative, Positive

SOLIDS = {  # corners of a face, faces at a corner
    "tetrahedron": (3, 3),
    "cube": (4, 3),
    "octahedron": (3, 4),
    "dodecahedron": (5, 3),
    "icosahedron": (3, 5),
}
PATTERNS = ("zigzag", "diamond")
WEIGHTS = np.array([-7.0, 7.0])  # logarithms of force densities over one another that are searched


@checked
def expandable_octahedron(
    strut: Length = 1.0,
    prestrain: NotNegative = 0.1,
    k_bar: ArrayLike = 100.0,
    k_string: ArrayLike = 1.0,
    mass: ArrayLike = 1.0,
) -> Structure:
    """Six bars in three parallel pairs and 24 strings of one length, also called icosahedron.

    Parameters
    ----------
    strut : float, optional
        Length of the bars [m].
    prestrain, k_bar, k_string, mass : optional
        Largest prestrain of a string, >= 0; then as of `Structure`.

    Returns
    -------
    Structure
        Bars along the axes, about the origin.  Parallel ones are half of their length from each
        other, strings are sqrt(3/8) of it (Tibert & Pellegrino 2003).  The shape of
        `geodesic("tetrahedron", "diamond")`, in another position.

    Examples
    --------
    >>> from tensegrity import catalogue, equilibrium_path, plates
    >>> ball = catalogue.expandable_octahedron(strut=4.0)
    >>> on_triangles = plates([0, 4, 8], [3, 7, 11], normal=(1, 1, 1))
    >>> path = equilibrium_path(ball, supports=on_triangles, max_shortening=0.9)
    >>> print(f"{path.events[0].shortening:.4f} m, {path.slack[-1].sum()} strings slack")
    0.8602 m, 3 strings slack
    """
    first = [(0, a, b) for a in (-0.25, 0.25) for b in (-0.5, 0.5)]
    nodes = np.array([np.roll(x, shift) for shift in range(3) for x in first])
    far = np.linalg.norm(nodes[:, None] - nodes, axis=2)
    bars, strings = (
        [(int(i), int(j)) for i, j in np.argwhere(np.triu(np.abs(far - length) < ZERO))]
        for length in (1.0, (3 / 8) ** 0.5)
    )
    return prestressed(strut * nodes, [bars], [strings], prestrain, k_bar, k_string, mass)


def truncated_tetrahedron(
    strut: float = 1.0,
    prestrain: float = 0.1,
    k_bar: ArrayLike = 100.0,
    k_string: ArrayLike = 1.0,
    mass: ArrayLike = 1.0,
) -> Structure:
    """Six bars and 18 strings, twelve of them round four triangles, all of one length.

    Parameters
    ----------
    strut, prestrain, k_bar, k_string, mass : optional
        See `geodesic`.

    Returns
    -------
    Structure
        That of `geodesic("tetrahedron")`; bars are 2.2507 times as long as strings (Tibert &
        Pellegrino 2003).

    Examples
    --------
    >>> from tensegrity import catalogue
    >>> s = catalogue.truncated_tetrahedron()
    >>> print(f"{s.lengths[0] / s.lengths[6]:.4f}, {s.lengths[0] / s.lengths[-1]:.4f}")
    2.2507, 2.2507
    """
    return geodesic("tetrahedron", "zigzag", strut, 1.0, prestrain, k_bar, k_string, mass)


@checked
def geodesic(
    solid: Annotated[str, SOLIDS] = "icosahedron",
    pattern: Annotated[str, PATTERNS] = "zigzag",
    strut: Length = 1.0,
    ratio: Positive = 1.0,
    prestrain: NotNegative = 0.1,
    k_bar: ArrayLike = 100.0,
    k_string: ArrayLike = 1.0,
    mass: ArrayLike = 1.0,
) -> Structure:
    """A geodesic tensegrity: as many bars as a regular solid has edges, in a net of strings.

    Parameters
    ----------
    solid : {"tetrahedron", "cube", "octahedron", "dodecahedron", "icosahedron"}, optional
        The solid whose rotations leave the structure invariant.
    pattern : {"zigzag", "diamond"}, optional
        "zigzag" is the truncated solid: a polygon of strings round each corner, a string on each
        edge; a bar joins the ends of three strings that make a Z.  "diamond" is the snub solid: a
        polygon of strings round each corner and in each face; a bar is the diagonal of a diamond
        of four strings.
    strut : float, optional
        Length of the bars [m].
    ratio : float, optional
        Length of the strings round corners over that of the others.
    prestrain, k_bar, k_string, mass : optional
        Largest prestrain of a string, >= 0; then as of `Structure`.

    Returns
    -------
    Structure
        About the origin; nodes from the lowest up, which are those round a corner.  Strings round
        corners come first.

    Raises
    ------
    EquilibriumError
        If no self-stress was found that has this ratio.

    Notes
    -----
    Patterns: Pugh 1976, An Introduction to Tensegrity.  The sphere of 30 bars is that of the
    icosahedron or dodecahedron.

    Examples
    --------
    >>> from tensegrity import catalogue
    >>> sphere = catalogue.geodesic("icosahedron")
    >>> print(sphere.bars, sphere.strings, f"{sphere.lengths[0] / sphere.lengths[-1]:.4f}")
    30 90 2.8025
    >>> catalogue.geodesic("cube", "diamond")
    Structure(24 nodes in 3 dimensions, 12 bars, 48 strings, 0 of them slack)
    """
    from scipy.linalg import eigh

    generators = _generators(solid, pattern)
    forces = [2 * np.eye(3) - g - g.T for g in generators]  # on the node, of unit force densities

    def node(weight: float) -> Array:
        """Where its forces balance, for bars of length 1, on the lower side."""
        place = eigh(forces[2], np.exp(weight) * forces[0] + forces[1])[1][:, -1]
        return -np.sign(place[2]) * place / np.linalg.norm(generators[2] @ place - place)

    def excess(weight: float) -> float:
        place = node(weight)
        first, second = (np.linalg.norm(g @ place - place) for g in generators[:2])
        return float(np.log(first / second) - np.log(ratio))

    weight = first_root(excess, WEIGHTS)
    if weight is None:
        low, high = sorted(np.exp(excess(end) + np.log(ratio)) for end in WEIGHTS)
        raise EquilibriumError(f"ratio {ratio:g} must be within {low:.3g} and {high:.3g}")
    group = [np.eye(3)]
    for one in group:
        for other in (one @ generator for generator in generators):
            if all(np.abs(other - known).max() > ZERO for known in group):
                group.append(other)
    turns, place = np.array(group), node(weight)
    turns = turns[np.argsort((turns @ place)[:, 2].round(9), kind="stable")]

    def orbit(generator: Array) -> Orbit:
        ends = np.einsum("iab,bc,jac->ij", turns, generator, turns).argmax(axis=1)
        return sorted({(min(i, j), max(i, j)) for i, j in enumerate(ends.tolist())})

    first, second, bars = map(orbit, generators)
    return prestressed(
        strut * turns @ place, [bars], [first, second], prestrain, k_bar, k_string, mass
    )


def _generators(solid: str, pattern: str) -> tuple[Array, Array, Array]:
    """Rotations from a node to others: by strings round a corner, by other strings, by the bar."""
    from scipy.spatial.transform import Rotation

    face, corner = SOLIDS[solid]
    cosine = np.cos(np.pi / face) / np.sin(np.pi / corner)  # between corner and edge (Coxeter)
    vectors = np.array([[0, 0, 2 / corner], [np.sqrt(1 - cosine**2), 0, cosine]])
    turn, half = Rotation.from_rotvec(np.pi * vectors).as_matrix()
    return (turn, half, turn @ half @ turn.T) if pattern == "zigzag" else (turn, turn @ half, half)
