"""Data for steps of the implicit midpoint rule: see `implicit.c`."""

from __future__ import annotations

import numpy as np

from tensegrity.engine import forces

ITERATIONS = 60  # of Newton's method, in one step


def fields(loop, u, bonds):
    """Fields of the structure `implicit` except those that `Bound` adds.

    Parameters
    ----------
    loop : Compiled
    u : ndarray
        Rows of the loop.
    bonds : Bonds

    Returns
    -------
    dict
    """
    contacts, (first, second, _, geometry) = bonds.contacts, forces.connectivity(bonds)
    dim = bonds.dim or 1
    load = np.zeros(u.size) if contacts is None else contacts.load
    entries = load.size
    at, width = _order(bonds, first, second)
    numbers = {
        "geometry": geometry,
        "parameters": bonds.parameters[bonds.group],
        "load": load,
        "dt": [1.0],
    }
    sizes = dict.fromkeys(("straight", "moved", "update", "root", "force", "right"), entries)
    sizes |= {"place": u.size, "slope": u.size, "band": entries * (dim * width + dim)}
    places = {
        "law": bonds.law_of_bond,
        "from": dim * first,
        "to": dim * second,
        "at": dim * at[:, None] + np.arange(dim),
    }
    return {
        **{name: loop.numbers(x) for name, x in numbers.items()},
        **{name: np.zeros(size, dtype=loop.dtype) for name, size in sizes.items()},
        **{name: np.ascontiguousarray(x, dtype=np.int64) for name, x in places.items()},
        "bonds": len(first),
        "entries": entries,
        "count": u.size,
        "width": dim * width + dim - 1,
        "iterations": ITERATIONS,
    }


def _order(bonds, first, second):
    """Position of each site in the matrix (reverse Cuthill-McKee), and the bandwidth in sites."""
    sites = len(bonds.inverse_mass)
    moves = np.append(bonds.inverse_mass.reshape(sites, -1).any(axis=1), False)
    joined = moves[np.minimum(first, sites)] & moves[second]  # without walls
    first, second, at = first[joined], second[joined], np.arange(sites)
    if bonds.contacts is not None:
        from scipy.sparse import csr_array
        from scipy.sparse.csgraph import reverse_cuthill_mckee

        graph = csr_array((np.ones(len(first)), (first, second)), shape=(sites, sites))
        at[reverse_cuthill_mckee(graph)] = np.arange(sites)
    return at, int(np.abs(at[first] - at[second]).max(initial=0))
