"""How large a step may be: elongations that springs can reach, and how stiff they are there."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from tensegrity.scenes.scene import Scene, State
    from tensegrity.typing import Array


def expected_ranges(scene: Scene, state: State, share: float = 1.0) -> Array:
    """Elongations each spring of a scene can reach if it gets a share of the state's energy.

    Where that is the end of its domain, or where the sites of a bond come to the same place, the
    stiffness has no bound: half the way is returned, and the run itself has to watch.

    Returns
    -------
    ndarray, (springs, 2)
    """
    springs = scene.spring_table
    ranges, locks = springs.reachable(share * scene.available_energy(state))
    half = springs.domains[locks] / 2
    ranges[locks, 0] = np.maximum(ranges[locks, 0], half[:, 0])
    ranges[locks, 1] = np.minimum(ranges[locks, 1], half[:, 1])
    ranges[:, 0] = np.maximum(ranges[:, 0], scene.closing / 2)
    return ranges


def present_ranges(scene: Scene, state: State) -> Array:
    """Elongations of each spring of a scene at this moment, 0 included."""
    return scene.present_ranges(state.u)
