"""Structures and lattices of the literature, in equilibrium under prestress.

Connectivity and shape follow from symmetry.  Nodes are the images of a few points under rotations,
members that are images of each other form an orbit and have one force density, and the condition
that a state of self-stress exists, an eigenvalue or a determinant, determines the remaining
parameters (Connelly & Back 1998, Mathematics and tensegrity; Tibert & Pellegrino 2003, Review of
form-finding methods for tensegrity structures).  The `prestrain` that each function takes is the
largest of its strings, (length - natural length)/natural length, in prisms and columns that of the
cross strings; that of the others follows from the self-stress.  `twin_strings`, a unit with two
stable states, is a `Potential`, and `twin_prism` its structure.
"""

from tensegrity.catalogue.cells import column, plate, prism, snelson_x, twin_prism, twin_strings
from tensegrity.catalogue.lattices import (
    honeycomb,
    kagome,
    octahedra,
    resonators,
    square,
    triangular,
    x_plate,
    x_strip,
)
from tensegrity.catalogue.solids import (
    dome,
    expandable_octahedron,
    geodesic,
    tower,
    truncated_tetrahedron,
)

__all__ = [
    "column",
    "dome",
    "expandable_octahedron",
    "geodesic",
    "honeycomb",
    "kagome",
    "octahedra",
    "plate",
    "prism",
    "resonators",
    "snelson_x",
    "square",
    "tower",
    "triangular",
    "truncated_tetrahedron",
    "twin_prism",
    "twin_strings",
    "x_plate",
    "x_strip",
]
