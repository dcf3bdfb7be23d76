"""Some cells of a lattice as they are drawn, with the images to which members lead."""

from __future__ import annotations

from typing import Any

import numpy as np

from tensegrity.frames import Frames

DRAWN = {1: 6, 2: 3, 3: 2}  # cells along each of so many vectors


def cell_frames(lattice: Any, counts: Any) -> Frames:
    """See `Lattice.frames`."""
    d = len(lattice.vectors)
    shape, cells, ends, many = lattice._copies((DRAWN[d],) * d if counts is None else counts)
    first, second = lattice.ends.T
    inside = np.all((ends >= 0) & (ends < many), axis=2)
    cell = np.ravel_multi_index(tuple(np.moveaxis(ends % many, 2, 0)), shape)
    number = cell * lattice.nodes + second[:, None]
    outside = (lattice.positions[second, None] + ends @ lattice.vectors)[~inside]
    places = (lattice.positions + (cells @ lattice.vectors)[:, None]).reshape(-1, lattice.dim)
    number[~inside] = len(places) + np.arange(len(outside))
    start = np.arange(len(cells)) * lattice.nodes + first[:, None]
    pairs = np.stack([start.ravel(), number.ravel()], axis=1)
    each = {"tension [N]": lattice.tensions, "force density [N/m]": lattice.densities}
    values = {
        k: np.repeat(x, len(cells))[None] for k, x in {**each, "slack": lattice.slack}.items()
    }
    string = np.repeat(lattice.is_string, len(cells))
    whole = np.concatenate([places, outside])[None]
    return Frames(repr(lattice), "", np.zeros(1), whole, pairs, string, values)
