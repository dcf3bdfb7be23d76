"""Results of searches, to and from columns of numbers and text."""

from typing import NamedTuple

import numpy as np

from granular import Bead, materials


class Found(NamedTuple):
    """A search: `granular.design.Best`, of its history the least force so far."""

    beads: list[Bead]
    peak_force: float  # N
    least: np.ndarray  # N, (designs computed,)
    converged_in_time: bool


def columns(best):
    """The columns of a `Best` whose beads are of known materials."""
    return {
        "diameter [m]": [bead.diameter for bead in best.beads],
        "material": [bead.material.name for bead in best.beads],
        "least [N]": np.minimum.accumulate(best.history),
        "peak force [N]": [best.peak_force],
        "converged in time": [best.converged_in_time],
    }


def found(columns):
    """The `Found` of such columns."""
    diameters, names, least, (peak,), (converged,) = columns.values()
    beads = [Bead(float(d), materials[name]) for d, name in zip(diameters, names, strict=True)]
    return Found(beads, float(peak), least, bool(converged))
