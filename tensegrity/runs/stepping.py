"""How large a step may be: elongations that springs can reach, and how stiff they are there."""

from __future__ import annotations

import math
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from tensegrity.scenes.dynamics import Dynamics
    from tensegrity.scenes.scene import State
    from tensegrity.typing import Array, Indices


ENERGIES = 8  # to a factor of two between which nothing is asked again
FEWEST, REMEMBERED = 0.5, 4096  # share of the energy where a tolerance decides; answers kept


class Outlook:
    """What is known of a run before it begins, whatever its method and step.

    Parameters
    ----------
    dynamics : Dynamics
        Of the scene.
    state : State
    energy : float, optional
        That of the state [J], if it is known.
    """

    def __init__(self, dynamics: Dynamics, state: State, energy: float | None = None) -> None:
        self._dynamics, self._state, self._given = dynamics, state, energy
        self._known: tuple[Dynamics, float] | None = None

    def _nearest(self) -> tuple[Dynamics, float]:
        """That with contacts that may well form, and the energy that a spring could get."""
        if self._known is None:
            found = self._dynamics.nearest(self._state.u)
            given = self._given if found is self._dynamics else None
            self._known = found, found.available_energy(self._state, given)
        return self._known

    @cached_property
    def expected(self) -> Reach:
        """What springs can reach with all the energy."""
        return reach(*self._nearest())  # not rounded, which would depend on the units

    @cached_property
    def first_frequency(self) -> float:
        """Angular frequency [rad/s] were half of the energy to meet in one bond."""
        found, energy = self._nearest()
        return reach(found, rounded(FEWEST * energy)).frequency

    @cached_property
    def near(self) -> tuple[Indices, Indices]:
        """What is near at the start and has to be watched."""
        return self._dynamics.clearance.watched(self._state.u)


class Reach(NamedTuple):
    """Elongations that springs of a scene can come to, (springs, 2) [m], how stiff each is at
    most there [N/m], and the angular frequency that this bounds [rad/s]."""

    ranges: Array
    stiffness: Array
    frequency: float


def rounded(energy: float) -> float:
    """An energy [J], or slightly more, so that what it makes of others nearby is known."""
    if not 0 < energy < math.inf:
        return energy
    return 2.0 ** (math.ceil(ENERGIES * math.log2(energy)) / ENERGIES)


def reach(of: Dynamics, energy: float) -> Reach:
    """What springs can reach with an energy [J]; computed once."""
    known = of.reached
    found = known.get(energy)
    if found is None:
        ranges = within(of, energy)
        stiffness = of.stiffness_within(ranges)
        found = Reach(ranges, stiffness, of.fastest(stiffness))
        if len(known) * len(ranges) > REMEMBERED:
            known.clear()
        known[energy] = found
    return found


def within(of: Dynamics, energy: float) -> Array:
    """Elongations each spring of a scene can reach if it gets an energy [J].

    Where that is the end of its domain, or where the sites of a bond come to the same place, the
    stiffness has no bound: half the way is returned, and the run itself has to watch.

    Returns
    -------
    ndarray, (springs, 2)
    """
    springs = of.springs
    ranges, locks = springs.reachable(energy)
    if locks.any():
        half = springs.domains[locks] / 2
        ranges[locks, 0] = np.maximum(ranges[locks, 0], half[:, 0])
        ranges[locks, 1] = np.minimum(ranges[locks, 1], half[:, 1])
    np.maximum(ranges[:, 0], of.closing / 2, out=ranges[:, 0])
    return ranges
