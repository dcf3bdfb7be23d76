"""The limiting speed of a family of solitary waves: `largest_speed`."""

from __future__ import annotations

import math
from typing import Annotated

from tensegrity.checked import checked
from tensegrity.errors import TensegrityError
from tensegrity.springs.potential import Potential
from tensegrity.typing import Mass
from tensegrity.waves.by_target import sign_and_number
from tensegrity.waves.family import STROKE, Family


@checked
def largest_speed(
    potential: Potential,
    mass: Mass = 1.0,
    family: str | None = None,
    closest: Annotated[float, f">= {1 - STROKE}", "<= 0.1"] = 1e-3,
) -> float:
    """The limiting speed of a family of waves.

    Parameters
    ----------
    potential, mass, family
        As in `solitary_wave`.
    closest : float, optional
        Fraction of the stroke that remains at the peak of the largest computed wave; 0.0005 to 0.1.

    Returns
    -------
    float
        [sites/s]: for a spring that locks, the limit as the peak approaches locking; for one that
        softens, the speed of a front; for a domain that ends at a finite force, the speed of the
        wave whose peak is at that end.

    Raises
    ------
    TensegrityError
        No such wave exists, or the speeds are unbounded.

    Notes
    -----
    Near locking the force is proportional to the inverse square root of the remaining stroke; the
    speed is extrapolated in that root, to a relative error of about 1e-5, which a second value of
    `closest` estimates.
    """
    sign, number = sign_and_number(potential, family, None)
    side = Family(potential, sign, number or 0)
    if math.isfinite(side.rising_part.ceiling):
        return math.sqrt((side.rest + side.rising_part.ceiling) / mass)
    if math.isinf(side.end):
        raise TensegrityError("no largest speed: the spring does not lock (its domain is open)")
    return math.sqrt(side.stiffness_at_end(closest) / mass)
