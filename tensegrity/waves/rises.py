"""Where the waves of one sign lie: the rises of Q(r) = 2 V(r)/r^2, going out from rest.

Between rest and a state r a front can run at one speed only, m c^2 = V'(r)/r = Q(r), which is
where Q' = 0; see `derivations.softening`.  So the waves of one sign fall into families, one for
each rise of Q above all that it was before: within a family m c^2 lies between the level from
which Q rises, of rest or of the front before, and the level that it reaches.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from tensegrity.root import root

if TYPE_CHECKING:
    from tensegrity.typing import Array
    from tensegrity.waves.excess import Excess

FLAT = 1e-9  # of V''(0) + Q: a rise that is round-off
ROUGH = 1e-6  # ... where no digits are gained near rest
NEAR = 1e-3  # of the scale of such a spring, from which on Q is looked at


class Rise(NamedTuple):
    """A rise of Q on one side.

    Attributes
    ----------
    start : float
        Size of elongation from which Q is above `floor` [m]; 0 at rest.
    floor : float
        Largest Q - V''(0) nearer to rest [N/m]; 0 at rest.
    top : float
        Size at which Q is largest [m]: a front; inf where Q rises to the end of the domain.
    ceiling : float
        Q - V''(0) there [N/m]; inf with `top`.
    """

    start: float
    floor: float
    top: float
    ceiling: float


def rises(beyond: Excess, sign: int, sizes: Array) -> list[Rise]:
    """All rises of Q.

    Parameters
    ----------
    beyond : Excess
    sign : {-1, 1}
        Of the elongation.
    sizes : ndarray, (n,)
        Sizes of elongation [m], rising from near rest; Q is looked at between them.
    """
    flat = FLAT
    if beyond.core == 0 < beyond.rest:  # differences of energies, which are round-off near rest
        sizes, flat = sizes[sizes > NEAR * beyond.scale], ROUGH
    level = 2 * beyond.energy(sign * sizes) / sizes / sizes  # Q - V''(0)
    unit = beyond.rest + np.abs(level)
    found: list[Rise] = []
    floor, place = 0.0, 0
    if beyond.rest == 0 and level[1] - level[0] <= flat * unit[0]:  # as steep as a line, or less
        floor = float(level[0])
    while place < len(sizes):
        above = np.flatnonzero(level[place:] - floor > flat * unit[place:])
        if not above.size:
            break
        if place == floor == 0 and rises_from_rest(beyond, sign):
            above[0] = 0
        first = place + int(above[0])
        highest = np.maximum.accumulate(level[first:])
        falls = np.flatnonzero(highest - level[first:] > flat * unit[first:])
        start = 0.0 if first == 0 else _crossing(beyond, sign, sizes[first - 1 : first + 1], floor)
        if not falls.size:
            found.append(Rise(start, floor, math.inf, math.inf))
            break
        last = first + int(np.argmax(level[first : first + falls[0]]))
        top = _summit(beyond, sign, sizes[max(last - 1, 0) : last + 2])
        ceiling = float(beyond.tension(sign * top)) / (sign * top)
        found.append(Rise(start, floor, top, ceiling))
        floor, place = max(floor, ceiling), first + int(falls[0])
    return found


def rises_from_rest(beyond: Excess, sign: int) -> bool:
    """Whether waves of one sign start from zero amplitude: by what V' grows with beyond its linear
    law there."""
    return beyond.rest == 0 or beyond.growth(sign)[1] > 0


def _summit(beyond: Excess, sign: int, sizes: Array) -> float:
    """Size between the first and the last at which Q' = 0, from above to below."""

    def slope(size: float) -> float:  # r^3 Q'/2
        r = sign * size
        return float(r * beyond.tension(r) - 2 * beyond.energy(r))

    low, high = float(sizes[0]), float(sizes[-1])
    return root(slope, low, high, relative=1e-14)


def _crossing(beyond: Excess, sign: int, sizes: Array, floor: float) -> float:
    def surplus(size: float) -> float:
        return float(2 * beyond.energy(sign * size) / size / size) - floor

    low, high = float(sizes[0]), float(sizes[1])
    if surplus(low) >= 0:
        return low
    return root(surplus, low, high, relative=1e-14)
