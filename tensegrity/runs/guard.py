"""What a step allows: elongations inside the domains of the springs, and not too stiff there."""

from __future__ import annotations

import math

import numpy as np

KNOWN = 4  # ranges whose stiffness a scene remembers


class Guard:
    """Says of elongations that a run met whether its step is below the stability limit there.

    Parameters
    ----------
    problem : Problem
    dynamics : Dynamics
        Of what is moved, with the contacts that are listed.
    dt : float
        [s]
    allowed : float
        Share of the stability limit.

    Attributes
    ----------
    domains : ndarray, (springs, 2)
        Elongations that the springs can follow [m].
    limit : float
        Stability limit within the ranges that were looked at last [s].
    """

    def __init__(self, problem, dynamics, dt, allowed) -> None:
        self._problem, self._dynamics, self._dt, self._allowed = problem, dynamics, dt, allowed
        self.domains, self.limit = dynamics.springs.reach, math.inf
        self._safe = None  # ranges of elongation known to be allowed
        self._stiffness = None  # bound of each spring's within them [N/m]

    def is_inside(self, met):
        """Whether elongations, (springs, 2), are within the domains."""
        if len(met) == 1:
            ((low, high),), ((lowest, highest),) = met.tolist(), self.domains.tolist()
            return not (low <= lowest or high >= highest)
        return not (
            np.any(met[:, 0] <= self.domains[:, 0]) or np.any(met[:, 1] >= self.domains[:, 1])
        )

    def allows(self, met):
        """Whether the step is stable at elongations within the domains."""
        if self._safe is None:
            self._safe = np.zeros(self.domains.shape)
        if _are_within(met, self._safe) or self.is_known(met):
            return True
        if self._stiffness is None:
            if self._expects():
                return self.allows(met)
            self._stiffness = self._dynamics.stiffness_within(self._safe)
        below, above = met[:, 0] < self._safe[:, 0], met[:, 1] > self._safe[:, 1]
        grown, (low, high) = np.flatnonzero(below | above), self.domains.T
        for margin in (0.1, 0.01, 0.0):  # wider than met, so as not to ask again soon
            wider = self._safe.copy()
            wider[below, 0] = _towards(low[below], met[below, 0], margin)
            wider[above, 1] = _towards(high[above], met[above, 1], margin)
            stiffness = self._stiffness.copy()
            stiffness[grown] = self._dynamics.stiffness_within(wider, grown)
            omega = self._dynamics.fastest(stiffness)
            self.limit = self._problem.largest_step(omega)
            if self._dt <= self._allowed * self.limit:
                self._safe, self._stiffness = wider, stiffness
                self._dynamics.ranges.append((wider, stiffness, omega))
                del self._dynamics.ranges[:-KNOWN]
                return True
        return False

    def is_known(self, met):
        """Whether another run of the scene met as much, which a step like this one can take."""
        least = self._dt / self._allowed
        for ranges, stiffness, omega in self._dynamics.ranges:
            limit = self._problem.largest_step(omega)
            if least <= limit and _are_within(met, ranges):
                self._safe, self._stiffness, self.limit = ranges, stiffness, limit
                return True
        return False

    def _expects(self):
        """Whether the ranges that chose the step are allowed: then nothing is asked within."""
        problem = self._problem
        if problem.choice != "default" or self._dynamics is not problem.dynamics:
            return False
        ranges, stiffness, omega = problem.outlook.expected
        limit = problem.largest_step(omega)
        if self._dt > self._allowed * limit:
            return False
        self._safe, self._stiffness, self.limit = ranges, stiffness, limit
        return True


def _are_within(met, ranges):
    """Whether elongations are within ranges, which is cheap to say of a single spring."""
    if len(met) == 1:
        ((low, high),), ((lowest, highest),) = met.tolist(), ranges.tolist()
        return lowest <= low and high <= highest
    return bool(np.all(ranges[:, 0] <= met[:, 0]) and np.all(met[:, 1] <= ranges[:, 1]))


def _towards(end, met, margin):
    """An elongation beyond the one met by a margin, short of the end of the domain."""
    room = np.where(np.isfinite(end), end - met, 10 * met)
    return met + margin * room
