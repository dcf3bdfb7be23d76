"""Lattices whose bonds are pair laws: sites of several coordinates, with energies V(q_i, q_j)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.lattices.bloch import PeriodicBonds
from tensegrity.scenes.pair_dynamics import inertias
from tensegrity.springs.pair_law import PairLaw


class PairLattice(PeriodicBonds):
    """A periodic lattice of sites joined by pair laws, at rest.

    Parameters
    ----------
    vectors : array_like, (d, space)
        Lattice vectors [m].
    positions : array_like, (sites, space)
        Of the sites of a cell [m].
    bonds : sequence of (int, int, offset, PairLaw)
        Each joins the first site of a cell, the `first` of the law, to the second one of the cell
        at an offset, d whole numbers (or one number, where d is 1).  The laws may differ.
    mass : float or array_like, (dim,) or (sites, dim), optional
        Inertias of one site or of all, > 0.

    Raises
    ------
    TensegrityError
        Arguments that are not as described.

    Examples
    --------
    Rotating units in a row, of elongation and bending, at two phases:

    >>> import sympy as sp
    >>> from tensegrity import PairLattice, PairLaw, bands
    >>> (u, a), (U, A) = sp.symbols("u a"), sp.symbols("U A")
    >>> pair = PairLaw((U - u) ** 2 / 2 + (A + a) ** 2 / 4, (u, a), (U, A))
    >>> row = PairLattice([[1.0]], [[0.0]], [(0, 0, 1, pair)], mass=(1.0, 0.5))
    >>> bands(row, [[0.0], [3.0]]).frequencies.round(4)
    array([[0.    , 2.    ],
           [0.1415, 1.995 ]])
    """

    def __init__(
        self,
        vectors: ArrayLike,
        positions: ArrayLike,
        bonds: Sequence[tuple[int, int, Any, PairLaw]],
        mass: ArrayLike = 1.0,
    ) -> None:
        rows, places = check.floats("vectors", vectors), check.floats("positions", positions)
        if rows.ndim != 2 or places.ndim != 2 or rows.shape[1:] != places.shape[1:]:
            raise TensegrityError(
                f"vectors {rows.shape} and positions {places.shape} must be (d, space) and "
                "(sites, space)"
            )
        rows = check.vector("vectors", rows, rows.shape)
        places = check.vector("positions", places, places.shape)
        ends, offsets, laws = _joined(bonds, len(places), len(rows))
        dim = laws[0].law.dim
        for number, law in enumerate(laws):
            if law.law.dim != dim:
                raise TensegrityError(
                    f"pair law of bond {number} has {law.law.dim} coordinates, that of bond 0 {dim}"
                )
        fraction = 1 / np.maximum(np.bincount(ends.ravel(), minlength=len(places)), 1)
        rest = np.zeros((2, 1, dim))
        blocks = np.concatenate(
            [
                law.shared(*fraction[pair].tolist()).tangent(*rest)
                for law, pair in zip(laws, ends, strict=True)
            ]
        )
        weights = inertias(mass, (len(places), dim))
        super().__init__(places, rows, ends, offsets, blocks, weights)

    def __repr__(self) -> str:
        sites, dim = self.mass.shape
        return f"PairLattice({sites} sites of {dim} coordinates a cell, {len(self.ends)} bonds)"


def _joined(bonds: Any, sites: int, d: int) -> tuple[Any, Any, list[PairLaw]]:
    """Ends and offsets of bonds, and their laws."""
    ends, offsets, laws = [], [], []
    for number, bond in enumerate(check.sequence("bonds", bonds, "bonds")):
        if not isinstance(bond, (tuple, list)) or len(bond) != 4:
            raise TensegrityError(f"bond {number} must be (site, site, offset, PairLaw)")
        one, other, offset, law = bond
        name = f"bond {number}"
        ends.append([check.whole(f"site of {name}", x, least=0, below=sites) for x in (one, other)])
        each = [offset] if np.ndim(offset) == 0 else list(offset)
        if len(each) != d:
            raise TensegrityError(f"offset {check.shown(offset)} of {name} must be {d} numbers")
        offsets.append([check.whole(f"offset of {name}", x) for x in each])
        check.kind(f"pair law of {name}", law, PairLaw)
        laws.append(law)
        if one == other and not any(offsets[-1]):
            raise TensegrityError(f"{name} joins site {one} to itself")
    if not laws:
        raise TensegrityError("bonds of a lattice are empty, must be one or more")
    return np.array(ends), np.array(offsets), laws
