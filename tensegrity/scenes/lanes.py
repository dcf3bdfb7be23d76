"""How the scenes of an `Ensemble` run: as many side by side as one loop takes, or in turn."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from tensegrity.engine.bonds import Bonds

if TYPE_CHECKING:
    from typing import Any

    from tensegrity.typing import Array, Indices

TOGETHER = (64, 48, 32, 24, 16, 8)  # lanes that one compiled loop takes
MANY, MOST = 32, 1024  # and multiples of, at most


class Part(NamedTuple):
    """Lanes of an ensemble that run in one loop.

    Attributes
    ----------
    lanes : ndarray of int
        Numbers in a row.
    scene : Scene
        Of these: an ensemble, perhaps with idle lanes behind, or that of one lane.
    places : ndarray of int
        The numbers of its different springs in the `spring_table` of the whole.
    """

    lanes: Indices
    scene: Any
    places: Indices

    def of(self, array: Array) -> Array:
        """The part of an array with lanes last; idle ones do what the last one does."""
        if len(self.lanes) == 1:
            return np.ascontiguousarray(array[..., self.lanes[0]])
        each = np.minimum(self.lanes[0] + np.arange(self.scene.lanes), self.lanes[-1])
        return np.ascontiguousarray(array[..., each])


def parts(ensemble: Any, explicit: bool) -> list[Part]:
    """Those of an ensemble, for explicit methods or for implicit ones."""
    numbers = {kind: k for k, kind in enumerate(ensemble.spring_table.kinds)}
    found, lane = [], 0
    beside = explicit and side_by_side(ensemble) is not None
    while lane < ensemble.lanes:
        count = min(ensemble.lanes - lane, MOST) if beside else 1
        scene = ensemble.of(lane, count) if count > 1 else ensemble.scenes[lane]
        places = np.array([numbers[kind] for kind in scene.spring_table.kinds])
        found.append(Part(lane + np.arange(count), scene, places))
        lane += count
    return found


def filled(lanes: int) -> int:
    """The least number of lanes, not below this, that one compiled loop takes; as many beyond."""
    if lanes == 1 or lanes > MOST:
        return lanes
    return min((n for n in TOGETHER if n >= lanes), default=MANY * math.ceil(lanes / MANY))


def side_by_side(ensemble: Any) -> Bonds | None:
    """The bonds of a loop over all lanes at once; None where they must run in turn."""
    bonds = [scene.loop_bonds for scene in ensemble.scenes]
    if ensemble.is_driven or any(one.contacts is not None for one in bonds):
        return None
    laws, law, parameters = ensemble.spring_table.table
    group = ensemble.spring_table.group
    if group.ndim == 2 and np.any(law[group] != law[group[:, :1]]):
        return None
    mass = np.ascontiguousarray(ensemble.inverse_mass)
    return Bonds(laws, law, parameters, group, mass, openings=ensemble.spring_table.openings)
