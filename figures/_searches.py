"""Results of searches, to and from columns of numbers and text."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from granular import Bead, materials


class Found(NamedTuple):
    """A search: `granular.design.Best`, of its history the least force so far.

    Attributes
    ----------
    beads : list of Bead
    peak_force : float
        [N].
    least : ndarray, (designs computed,)
        [N].
    converged_in_time : bool
    rejected : int
    seed : int
    """

    beads: list[Bead]
    peak_force: float
    least: np.ndarray
    converged_in_time: bool
    rejected: int
    seed: int


def columns(best):
    """The columns of a `Best` whose beads are of known materials."""
    return {
        "diameter [m]": [bead.diameter for bead in best.beads],
        "material": [bead.material.name for bead in best.beads],
        "least [N]": np.minimum.accumulate(best.history),
        "peak force [N]": [best.peak_force],
        "converged in time": [best.converged_in_time],
        "rejected": [best.rejected],
        "seed": [best.seed],
    }


def found(columns):
    """The `Found` of such columns."""
    beads = zip(columns["diameter [m]"].tolist(), columns["material"], strict=True)
    names = ("peak force [N]", "converged in time", "rejected", "seed")
    peak, converged, rejected, seed = (columns[name].tolist()[0] for name in names)
    beads = [Bead(diameter, materials[name]) for diameter, name in beads]
    return Found(beads, peak, columns["least [N]"], converged, rejected, seed)
