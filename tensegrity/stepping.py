"""How large a step may be: bounds on the frequencies a chain can show.

The eigenvalues of M^-1 K of a chain with bond stiffnesses k_j are at most
max over j of 2 k_j (1/m_j + 1/m_{j+1}); for equal masses and springs that is 4 k/m.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from tensegrity.errors import StabilityError

DECADES = 16  # how far the search for the reachable elongations looks, up and down


def reachable(spring, energy):
    """Elongations around 0 that a spring can reach with a given energy.

    Returns
    -------
    low, high : float
        Ends of the connected part of {V <= energy} that contains 0 [m], slightly too wide.
    locks : bool
        Whether it touches an end of the domain.
    """
    low, down = _crossing(spring, energy, -1)
    high, up = _crossing(spring, energy, 1)
    return low, high, down or up


def _crossing(spring, energy, side):
    """First elongation on one side where V exceeds `energy`, and whether it is the end."""
    end = spring.domain[side > 0]
    close = np.logspace(-DECADES, 0, 20 * DECADES + 1)
    if np.isinf(end):
        r = side * np.concatenate([close, 1 / close[-2::-1]])
    else:
        r = side * np.unique(abs(end) * np.concatenate([close, 1 - close[:-1]]))
        r = np.clip(r, *spring.domain)
    for _ in range(2):  # a coarse look, then a fine one at the crossing
        outside = np.flatnonzero(~(spring.energy(r) <= energy))
        if outside.size == 0:
            return float(r[-1]), bool(np.isfinite(end))
        first = int(outside[0])
        beyond = r[first]
        r = np.linspace(r[first - 1] if first else 0.0, beyond, 257)[1:]
    return float(beyond), False


def largest_stiffness(spring, low, high):
    """Largest V'' between two elongations [N/m], both inside the domain; at least 0."""
    close = np.logspace(-DECADES, 0, 20 * DECADES + 1)
    even = np.linspace(0, 1, 201)
    r = np.concatenate([low * close, low * even, high * close, high * even])
    largest = float(np.max(spring.stiffness(r)))
    if not np.isfinite(largest):
        raise StabilityError(
            f"stiffness {largest} N/m between elongations {low:g} m and {high:g} m must be finite"
        )
    return max(largest, 0.0)


def frequency(chain, ranges):
    """Bound on the largest angular frequency [rad/s] over given ranges of elongation.

    Parameters
    ----------
    chain : Chain
    ranges : sequence of (low, high)
        For each run of equal bonds, smallest and largest elongation [m].
    """
    springs, first = chain.segment_springs
    mobility = chain.inverse_mass[:-1] + chain.inverse_mass[1:]
    squared = [
        2 * largest_stiffness(spring, low, high) * mobility[start:stop].max()
        for spring, (low, high), start, stop in zip(
            springs, ranges, first[:-1], first[1:], strict=True
        )
    ]
    return float(np.sqrt(max(squared)))


def expected_ranges(chain, state, share=1.0):
    """Elongations each run of equal bonds can reach if it gets a share of the state's energy.

    Where that is the end of its domain, the stiffness has no bound: half the way is returned,
    and the run itself has to watch.
    """
    energy = share * chain.energy(state)
    ranges = []
    for spring in chain.segment_springs[0]:
        low, high, locks = reachable(spring, energy)
        if locks:
            low, high = max(low, spring.domain[0] / 2), min(high, spring.domain[1] / 2)
        ranges.append((low, high))
    return ranges


def present_ranges(chain, state):
    """Elongations in each run of bonds at this moment, 0 included."""
    r = chain.elongation(state.u)
    _, first = chain.segment_springs
    return [(min(r[a:b].min(), 0.0), max(r[a:b].max(), 0.0)) for a, b in pairwise(first)]
