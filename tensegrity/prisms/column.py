"""Columns of prisms in all coordinates of their nodes."""

from __future__ import annotations

from tensegrity import check
from tensegrity.prisms.prism import Prism
from tensegrity.prisms.stack import stacked
from tensegrity.structures.structure import Structure


def column(
    prism: Prism, count: int = 5, chirality: str = "alternate", plates: bool = False
) -> Structure:
    """Prisms on one another, along the last axis.

    Parameters
    ----------
    prism : Prism
        With finite `k_base` and `k_bar`.
    count : int, optional
        Number of units.
    chirality : {"alternate", "same"}, optional
        Whether neighbours turn against one another or alike.
    plates : bool, optional
        Between units a rigid plate, smooth and guided along the column, on which both have their
        own polygons; else they share the polygon, its strings twice as stiff.

    Returns
    -------
    Structure
        Polygon after polygon from below; bars unit by unit, then cross strings unit by unit, then
        base strings polygon by polygon.  Without load it is in equilibrium.
    """
    check.kind("prism", prism, Prism)
    return stacked(prism, count, chirality, plates)
