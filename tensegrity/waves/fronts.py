"""Waves close to the front that ends their family: a flat top between two fronts.

Near the top such a wave is the front's state less gap cosh(k x), k the rate at which small
deviations from that state grow in the linear lattice there.  So a smaller gap lengthens the top
and changes little else; see `derivations.softening`.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.waves.travelling import Grid, Profile, Scaled, cosine_sum

if TYPE_CHECKING:
    from tensegrity.waves.rises import Rise


def lengthened(wave: Profile, law: Scaled, rise: Rise, rate: float) -> Profile:
    """A rough profile with the crest `law.reference`, closer to the front than that of `wave`.

    Parameters
    ----------
    wave : Profile
        With a crest near the front, and a decayed tail.
    law : Scaled
    rise : Rise
        That ends in the front.
    rate : float
        k, per site.
    """
    far, near = (rise.top - abs(x.reference) for x in (wave.law, law))  # gaps
    longer = math.log(far / near) / rate
    length = wave.grid.half_length + longer
    grid = Grid(math.ceil(wave.grid.points * length / wave.grid.half_length), length)
    place = grid.x - longer
    outside = np.maximum(place, 0.0)
    series = wave.grid.coefficients(wave.rho * abs(wave.law.reference))
    slope = rise.top - cosine_sum(series, wave.grid.wave_numbers, outside)
    slope += near / 2 * np.exp(-rate * grid.x) - far / 2 * np.exp(-rate * outside)
    top = near * np.cosh(rate * np.minimum(grid.x, longer))
    rho = (rise.top - np.where(place < 0, top, slope)) / abs(law.reference)
    left = (rise.ceiling - wave.nu * wave.law.secant) * (near / far) ** 2
    return Profile(law, grid, rho, (rise.ceiling - left) / law.secant)
