"""How large a step may be: elongations that springs can reach, and how stiff they are there."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from tensegrity.scenes.scene import Scene, State
    from tensegrity.typing import Array


ENERGIES = 8  # to a factor of two between which nothing is asked again


def expected_frequency(scene: Scene, state: State, share: float) -> float:
    """Angular frequency [rad/s] if one spring gets about a share of the state's energy: a start.

    Asked once a scene for energies that differ little.
    """
    energy = share * scene.available_energy(state)
    if not 0 < energy < math.inf:
        return scene.frequency(within(scene, energy))
    rounded = 2.0 ** (math.ceil(ENERGIES * math.log2(energy)) / ENERGIES)
    known = scene.remembered.starts
    if rounded not in known:
        known[rounded] = scene.frequency(within(scene, rounded))
    return known[rounded]


def expected_ranges(scene: Scene, state: State, share: float = 1.0) -> Array:
    """Elongations each spring of a scene can reach if it gets a share of the state's energy.

    Where that is the end of its domain, or where the sites of a bond come to the same place, the
    stiffness has no bound: half the way is returned, and the run itself has to watch.

    Returns
    -------
    ndarray, (springs, 2)
    """
    return within(scene, share * scene.available_energy(state))


def within(scene: Scene, energy: float) -> Array:
    """The same for an energy [J]."""
    springs = scene.spring_table
    ranges, locks = springs.reachable(energy)
    half = springs.domains[locks] / 2
    ranges[locks, 0] = np.maximum(ranges[locks, 0], half[:, 0])
    ranges[locks, 1] = np.minimum(ranges[locks, 1], half[:, 1])
    ranges[:, 0] = np.maximum(ranges[:, 0], scene.closing / 2)
    return ranges


def present_ranges(scene: Scene, state: State) -> Array:
    """Elongations of each spring of a scene at this moment, 0 included."""
    return scene.present_ranges(state.u)
