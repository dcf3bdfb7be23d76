"""How large a step may be: elongations that springs can reach, and how stiff they are there."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.errors import StabilityError

if TYPE_CHECKING:
    from collections.abc import Callable

    from tensegrity.potential import Potential
    from tensegrity.scene import Scene, State
    from tensegrity.typing import Array

DECADES = 16  # how far the search for the reachable elongations looks, up and down


@lru_cache(maxsize=4096)
def reachable(spring: Potential, energy: float) -> tuple[float, float, bool]:
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


def _crossing(spring: Potential, energy: float, side: int) -> tuple[float, bool]:
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


@lru_cache(maxsize=4096)
def largest_stiffness(spring: Potential, low: float, high: float) -> float:
    """Largest V'' between two elongations [N/m], both inside the domain; at least 0."""
    return max(_largest("stiffness", spring.stiffness, low, high), 0.0)


@lru_cache(maxsize=4096)
def largest_tension(spring: Potential, low: float, high: float) -> float:
    """Largest size of V' between two elongations [N], both inside the domain."""
    return _largest("tension", lambda r: np.abs(spring.tension(r)), low, high)


def _largest(name: str, function: Callable[[Array], Array], low: float, high: float) -> float:
    close = np.logspace(-DECADES, 0, 20 * DECADES + 1)
    even = np.linspace(0, 1, 201)
    r = np.concatenate([low * close, low * even, high * close, high * even])
    largest = float(np.max(function(r)))
    if not np.isfinite(largest):
        raise StabilityError(
            f"{name} {largest} between elongations {low:g} m and {high:g} m must be finite"
        )
    return largest


def expected_ranges(scene: Scene, state: State, share: float = 1.0) -> Array:
    """Elongations each spring of a scene can reach if it gets a share of the state's energy.

    Where that is the end of its domain, or where the sites of a bond come to the same place, the
    stiffness has no bound: half the way is returned, and the run itself has to watch.

    Returns
    -------
    ndarray, (ranges that the loop keeps, 2)
    """
    energy = share * scene.available_energy(state)
    springs, rows = scene.watched()
    ranges = []
    for spring in springs:
        low, high, locks = reachable(spring, energy)
        if locks:
            low, high = max(low, spring.domain[0] / 2), min(high, spring.domain[1] / 2)
        ranges.append((low, high))
    ranges = np.array(ranges).reshape(-1, 2)[rows]
    ranges[:, 0] = np.maximum(ranges[:, 0], scene.closing / 2)
    return ranges


def present_ranges(scene: Scene, state: State) -> Array:
    """Elongations of each spring of a scene at this moment, 0 included."""
    return scene.present_ranges(state.u)
