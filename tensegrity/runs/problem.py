"""What is to be run, and how large a step may be: elongations that springs can reach, and how stiff
they are there."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from tensegrity.engine.methods import Method
from tensegrity.errors import StabilityError
from tensegrity.scenes.dynamics import dynamics

if TYPE_CHECKING:
    from tensegrity.scenes.dynamics import Dynamics
    from tensegrity.scenes.scene import State
    from tensegrity.typing import Array, Indices


ENERGIES = 8  # to a factor of two between which nothing is asked again
FEWEST, REMEMBERED = 0.5, 4096  # share of the energy where a tolerance decides; answers kept


class AprioriBounds:
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
        return self._dynamics.clearance.near_contacts(self._state.u)


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
        stiffness = of.stiffness_bounds(ranges)
        found = Reach(ranges, stiffness, of.spring_frequency_bound(stiffness))
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
    np.maximum(ranges[:, 0], of.zero_length_elongation / 2, out=ranges[:, 0])
    return ranges


MOST_STEPS = 10**12


@dataclass(frozen=True, eq=False)
class Problem:
    """What is to be run, the step apart, of which `given` says what a user asked for [s].

    `surrogate` is the scene with springs that are fitted to those of `scene`: it is moved, while
    checks and recorded energies are those of `scene`.  `choice` says what chose the step: "dt",
    "tol" or "default".  Of a trial `rows` may be left out.  The `a_priori` is that of the scene and
    the state.  `observe` are pairs of a user's function and a record that says when it is called,
    and `bind` is what binds arrays u, v to a method and a step [s], if that is not the scene.
    """

    scene: Any
    state: Any
    t_end: float
    method: Method
    record: Any
    surrogate: Any = None
    choice: str = "dt"
    rows: bool = True
    a_priori: AprioriBounds | None = None
    given: float | None = None
    observe: tuple[Any, ...] = ()
    bind: Any = None

    def __post_init__(self):
        if self.a_priori is None:
            object.__setattr__(self, "a_priori", AprioriBounds(self.dynamics, self.state))

    @property
    def dynamics(self):
        """That of the scene."""
        return dynamics(self.scene)

    @property
    def moved(self):
        """That of what the loop advances."""
        return dynamics(self.scene if self.surrogate is None else self.surrogate)

    @property
    def is_forced(self):
        """Whether time counts."""
        return self.dynamics.is_driven

    @property
    def force_model(self):
        """What the tensions of the springs are computed by."""
        return self.moved.springs.force_model

    def largest_step(self, omega):
        """Stability limit [s] at an angular frequency [rad/s]; inf where it is 0."""
        return self.method.stability_limit / omega if omega > 0 else math.inf

    def step_words(self, dt):
        """A step as it was given, and what it became to divide the time evenly."""
        if self.given is None or math.isclose(self.given, dt, rel_tol=1e-5):
            return f"dt {dt:.6g} s"
        return f"dt {self.given:.6g} s, that is steps of {dt:.6g} s,"

    def natural_step(self, omega):
        """The step [s] that fractions are taken of, at an angular frequency [rad/s]."""
        return self.method.scale / omega if omega > 0 else math.inf


def count(problem, dt):
    """Number of steps, the largest not above dt; refused where no run could end."""
    steps = problem.t_end / dt * (1 - 1e-12) if dt > 0 else math.inf
    if steps > MOST_STEPS:
        raise StabilityError(
            f"t_end {problem.t_end:g} s takes {steps:.3g} steps of {dt:.3g} s, more than "
            f"{MOST_STEPS:.0e}"
        )
    return math.ceil(steps)


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

    def is_inside(self, elongation_range):
        """Whether elongations, (springs, 2), are within the domains."""
        if len(elongation_range) == 1:
            ((low, high),), ((lowest, highest),) = elongation_range.tolist(), self.domains.tolist()
            return not (low <= lowest or high >= highest)
        return not (
            np.any(elongation_range[:, 0] <= self.domains[:, 0])
            or np.any(elongation_range[:, 1] >= self.domains[:, 1])
        )

    def allows(self, elongation_range):
        """Whether the step is stable at elongations within the domains."""
        if self._safe is None:
            self._safe = np.zeros(self.domains.shape)
        if _are_within(elongation_range, self._safe) or self.is_known(elongation_range):
            return True
        if self._stiffness is None:
            if self._expects():
                return self.allows(elongation_range)
            self._stiffness = self._dynamics.stiffness_bounds(self._safe)
        below, above = (
            elongation_range[:, 0] < self._safe[:, 0],
            elongation_range[:, 1] > self._safe[:, 1],
        )
        grown, (low, high) = np.flatnonzero(below | above), self.domains.T
        for margin in (0.1, 0.01, 0.0):  # wider than met, so as not to ask again soon
            wider = self._safe.copy()
            wider[below, 0] = _towards(low[below], elongation_range[below, 0], margin)
            wider[above, 1] = _towards(high[above], elongation_range[above, 1], margin)
            stiffness = self._stiffness.copy()
            stiffness[grown] = self._dynamics.stiffness_bounds(wider, grown)
            omega = self._dynamics.spring_frequency_bound(stiffness)
            self.limit = self._problem.largest_step(omega)
            if self._dt <= self._allowed * self.limit:
                self._safe, self._stiffness = wider, stiffness
                self._dynamics.ranges.append((wider, stiffness, omega))
                del self._dynamics.ranges[:-KNOWN]
                return True
        return False

    def is_known(self, elongation_range):
        """Whether another run of the scene met as much, which a step like this one can take."""
        least = self._dt / self._allowed
        for ranges, stiffness, omega in self._dynamics.ranges:
            limit = self._problem.largest_step(omega)
            if least <= limit and _are_within(elongation_range, ranges):
                self._safe, self._stiffness, self.limit = ranges, stiffness, limit
                return True
        return False

    def _expects(self):
        """Whether the ranges that chose the step are allowed: then nothing is asked within."""
        problem = self._problem
        if problem.choice != "default" or self._dynamics is not problem.dynamics:
            return False
        ranges, stiffness, omega = problem.a_priori.expected
        limit = problem.largest_step(omega)
        if self._dt > self._allowed * limit:
            return False
        self._safe, self._stiffness, self.limit = ranges, stiffness, limit
        return True


def _are_within(elongation_range, ranges):
    """Whether elongations are within ranges, which is cheap to say of a single spring."""
    if len(elongation_range) == 1:
        ((low, high),), ((lowest, highest),) = elongation_range.tolist(), ranges.tolist()
        return lowest <= low and high <= highest
    return bool(
        np.all(ranges[:, 0] <= elongation_range[:, 0])
        and np.all(elongation_range[:, 1] <= ranges[:, 1])
    )


def _towards(end, elongation_range, margin):
    """An elongation beyond the one met by a margin, short of the end of the domain."""
    room = np.where(np.isfinite(end), end - elongation_range, 10 * elongation_range)
    return elongation_range + margin * room
