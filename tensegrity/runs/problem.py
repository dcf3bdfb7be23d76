"""The problem that a run solves, and bounds on its step: elongations that the springs can reach,
and their stiffness there."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from tensegrity.engine.force_law import BOND, SITE
from tensegrity.engine.forces import elongations, scattered_forces
from tensegrity.engine.methods import Method
from tensegrity.errors import StabilityError
from tensegrity.scenes.dynamics import dynamics

if TYPE_CHECKING:
    from tensegrity.scenes.dynamics import Dynamics
    from tensegrity.scenes.scene import State
    from tensegrity.typing import Array


ENERGIES = 8  # energies per factor of two for which bounds are computed
ENERGY_FRACTION = 0.5  # of the energy, in one bond, for the first step where a tolerance decides
CACHED = 4096  # numbers in cached ranges of a scene
FAINT = 1e-6  # largest motion over a length in the first steps of a scene that may be at rest
# Distance from the equilibrium over a length that counts as round-off.
REST = 64 * sys.float_info.epsilon


class AprioriBounds:
    """Bounds on elongation, stiffness and frequency before a run, for any method and step.

    Parameters
    ----------
    dynamics : Dynamics
        Dynamics of the scene.
    state : State
        Initial state.
    energy : float, optional
        Energy of the state [J], if it is known.
    """

    def __init__(self, dynamics: Dynamics, state: State, energy: float | None = None) -> None:
        self.dynamics, self._state, self._given = dynamics, state, energy
        self._known: tuple[Dynamics, float] | None = None

    @property
    def nearest(self) -> tuple[Dynamics, float]:
        """The dynamics with contacts that may form, and the energy a spring can receive [J]."""
        if self._known is None:
            nearest = self.dynamics.nearest(self._state.u)
            given = self._given if nearest is self.dynamics else None
            self._known = nearest, nearest.available_energy(self._state, given)
        return self._known

    @property
    def expected(self) -> StiffnessBounds:
        """Bounds if a spring receives all the energy."""
        return bounds_at_energy(*self.nearest)  # not rounded, which would depend on the units

    @property
    def first_frequency(self) -> float:
        """Bound on the angular frequency [rad/s] if one bond receives half of the energy."""
        nearest, energy = self.nearest
        return bounds_at_energy(nearest, rounded(ENERGY_FRACTION * energy)).frequency


class StiffnessBounds(NamedTuple):
    """Elongations that the springs of a scene can reach, (springs, 2) [m], the largest stiffness of
    each there [N/m], and the resulting bound on the angular frequency [rad/s]."""

    ranges: Array
    stiffness: Array
    frequency: float


def rounded(energy: float) -> float:
    """An energy [J] rounded up slightly, so that bounds computed for nearby energies are reused."""
    if not 0 < energy < math.inf:
        return energy
    return 2.0 ** (math.ceil(ENERGIES * math.log2(energy)) / ENERGIES)


def bounds_at_energy(dyn: Dynamics, energy: float) -> StiffnessBounds:
    """Bounds if each spring receives an energy [J]; cached with the dynamics."""
    known = dyn.reached
    bounds = known.get(energy)
    if bounds is None:
        ranges = reachable_ranges(dyn, energy)
        stiffness = dyn.stiffness_bounds(ranges)
        bounds = StiffnessBounds(ranges, stiffness, dyn.spring_frequency_bound(stiffness))
        if len(known) * len(ranges) > CACHED:
            known.clear()
        known[energy] = bounds
    return bounds


def reachable_ranges(dyn: Dynamics, energy: float) -> Array:
    """Elongations that each spring of a scene can reach with an energy [J].

    Where this includes the end of its domain, or the coincidence of the two sites of a bond, the
    stiffness is unbounded: half of that distance is returned, and the run is monitored.

    Returns
    -------
    ndarray, (springs, 2)
        Smallest and largest elongation [m].
    """
    springs = dyn.springs
    ranges, locks = springs.reachable(energy)
    if locks.any():
        half = springs.domains[locks] / 2
        ranges[locks, 0] = np.maximum(ranges[locks, 0], half[:, 0])
        ranges[locks, 1] = np.minimum(ranges[locks, 1], half[:, 1])
    np.maximum(ranges[:, 0], dyn.zero_length_elongation / 2, out=ranges[:, 0])
    return ranges


MOST_STEPS = 10**12


@dataclass(frozen=True, eq=False)
class Problem:
    """All that defines a run except its step.

    Attributes
    ----------
    scene, state, t_end, method, record
        The arguments of `simulate`.
    dynamics, loop_dynamics : Dynamics
        That of the scene; and that of the scene which the loop advances, maybe with polynomials
        fitted to its springs, while checks and recorded energies are those of `scene`.  By default
        obtained once, for the whole run.
    choice : {"dt", "tol", "default"}
        How the step is chosen.
    rows : bool
        Whether rows are recorded; a trial run may go without.
    a_priori : AprioriBounds
    given : float, optional
        The step that the user gave [s].
    observe : tuple of (callable, Record)
        Functions of a user, and the instants at which they are called.
    bind : callable (u, v, method, dt) -> Bound, optional
        Prepares the loop, if it is not that of the scene.
    """

    scene: Any
    state: Any
    t_end: float
    method: Method
    record: Any
    choice: str = "dt"
    rows: bool = True
    a_priori: AprioriBounds | None = None
    given: float | None = None
    observe: tuple[Any, ...] = ()
    bind: Any = None
    dynamics: Any = None
    loop_dynamics: Any = None

    def __post_init__(self):
        if self.dynamics is None:
            of = dynamics(self.scene)
            given = {"dynamics": of, "loop_dynamics": of, "a_priori": AprioriBounds(of, self.state)}
            self.__dict__.update(given)

    def largest_step(self, omega):
        """Stability limit [s] at an angular frequency [rad/s]; inf where it is 0."""
        return self.method.stability_limit / omega if omega > 0 else math.inf

    def step_words(self, dt):
        """Text for messages: the given step, and the step that divides the time evenly; or who
        chose it."""
        if self.choice != "dt":
            by = "for tol" if self.choice == "tol" else "by default"
            return f"a step of {dt:.6g} s, chosen {by},"
        if self.given is None or math.isclose(self.given, dt, rel_tol=1e-5):
            return f"dt {dt:.6g} s"
        return f"dt {self.given:.6g} s, that is steps of {dt:.6g} s,"

    def natural_step(self, omega):
        """The step [s] of which default steps are a fraction, at an angular frequency [rad/s]."""
        return self.method.scale / omega if omega > 0 else math.inf


def step_count(problem, dt):
    """Number of equal steps that are the largest not above dt [s]; refused above `MOST_STEPS`."""
    steps = problem.t_end / dt * (1 - 1e-12) if dt > 0 else math.inf
    if steps > MOST_STEPS:
        raise StabilityError(
            f"t_end {problem.t_end:g} s takes {steps:.3g} steps of {dt:.3g} s, more than "
            f"{MOST_STEPS:.0e}"
        )
    return math.ceil(steps)


KNOWN = 4  # ranges whose stiffness is cached with a scene


class StabilityGuard:
    """Checks whether the step of a run is stable at the elongations that it reached.

    Parameters
    ----------
    problem : Problem
    dynamics : Dynamics
        Dynamics of the scene that is advanced, with the listed contacts.
    dt : float
        Step [s].
    allowed : float
        Admissible fraction of the stability limit.

    Attributes
    ----------
    domains : ndarray, (springs, 2)
        Elongations at which the springs are defined [m].
    limit : float
        Stability limit within the ranges checked last [s].
    """

    def __init__(self, problem, dynamics, dt, allowed) -> None:
        self._problem, self._dynamics, self._dt, self._allowed = problem, dynamics, dt, allowed
        self.domains, self.limit = dynamics.springs.noted_domain, math.inf
        self._admissible = None  # ranges of elongation known to be allowed
        self._stiffness = None  # bound of each spring's within them [N/m]

    def is_inside(self, elongation_range):
        """Whether elongations, (springs, 2) [m], are within the domains."""
        if len(elongation_range) == 1:
            ((low, high),), ((lowest, highest),) = elongation_range.tolist(), self.domains.tolist()
            return not (low <= lowest or high >= highest)
        return not (
            (elongation_range[:, 0] <= self.domains[:, 0]).any()
            or (elongation_range[:, 1] >= self.domains[:, 1]).any()
        )

    def allows(self, elongation_range):
        """Whether elongations are within the domains, and the step is stable there."""
        if not self.is_inside(elongation_range):  # what a priori bounds admit may end beyond
            return False
        if self._admissible is None:
            self._admissible = np.zeros(self.domains.shape)
        if _are_within(elongation_range, self._admissible) or self.is_known(elongation_range):
            return True
        if self._stiffness is None:
            if self._adopts_a_priori():
                return self.allows(elongation_range)
            self._stiffness = self._dynamics.stiffness_bounds(self._admissible)
        below, above = (
            elongation_range[:, 0] < self._admissible[:, 0],
            elongation_range[:, 1] > self._admissible[:, 1],
        )
        grown, (low, high) = np.flatnonzero(below | above), self.domains.T
        for margin in (0.1, 0.01, 0.0):  # wider than reached, so that checks are rare
            wider = self._admissible.copy()
            wider[below, 0] = _towards(low[below], elongation_range[below, 0], margin)
            wider[above, 1] = _towards(high[above], elongation_range[above, 1], margin)
            stiffness = self._stiffness.copy()
            stiffness[grown] = self._dynamics.stiffness_bounds(wider, grown)
            omega = self._dynamics.spring_frequency_bound(stiffness)
            self.limit = self._problem.largest_step(omega)
            if self._dt <= self._allowed * self.limit:
                self._admissible, self._stiffness = wider, stiffness
                self._dynamics.ranges.append((wider, stiffness, omega))
                del self._dynamics.ranges[:-KNOWN]
                return True
        return False

    def is_known(self, elongation_range):
        """Whether another run of the scene found this step stable over a range that contains it."""
        least, largest = self._dt / self._allowed, self._problem.method.stability_limit
        for ranges, stiffness, omega in self._dynamics.ranges:
            limit = largest / omega if omega > 0 else math.inf
            if least <= limit and _are_within(elongation_range, ranges):
                self._admissible, self._stiffness, self.limit = ranges, stiffness, limit
                return True
        return False

    def _adopts_a_priori(self):
        """Whether the step is stable within the a-priori ranges; these are admissible then."""
        problem = self._problem
        if problem.choice != "default" or self._dynamics is not problem.dynamics:
            return False
        ranges, stiffness, omega = problem.a_priori.expected
        limit = problem.largest_step(omega)
        if self._dt > self._allowed * limit:
            return False
        self._admissible, self._stiffness, self.limit = ranges, stiffness, limit
        return True


def _are_within(elongation_range, ranges):
    """Whether elongations are within ranges; a single spring is compared without NumPy."""
    if len(elongation_range) == 1:
        ((low, high),), ((lowest, highest),) = elongation_range.tolist(), ranges.tolist()
        return lowest <= low and high <= highest
    return bool(
        np.all(ranges[:, 0] <= elongation_range[:, 0])
        and np.all(elongation_range[:, 1] <= ranges[:, 1])
    )


def _towards(end, elongation_range, margin):
    """An elongation beyond the given one by a margin, short of the end of the domain."""
    room = np.where(np.isfinite(end), end - elongation_range, 10 * elongation_range)
    return elongation_range + margin * room


def length_at_rest(problem: Problem, seen: Array) -> float | None:
    """The length of the shortest bond, or else the largest displacement [m], if the scene is in
    equilibrium to round-off relative to it; None where forces or drives will move the scene.

    Parameters
    ----------
    problem : Problem
    seen : ndarray, (instants + 1, *shape)
        Displacements of a run [m]; the first ones decide whether the forces are examined.
    """
    dyn, u = problem.dynamics.listed(problem.state.u), problem.state.u
    if np.count_nonzero(problem.state.v) or (dyn.is_driven and _changes(dyn)):
        return None
    given = dyn.spring_lengths
    lengths = [s.length for s in dyn.springs.different] if given is None else np.ravel(given)
    length = min((x for x in lengths if x), default=float(np.max(np.abs(u))))
    if np.max(np.abs(seen[1] - u)) > FAINT * length:
        return None
    stiffness = dyn.stiffness_bounds(dyn.ranges_at(u))
    forces = _static_forces(dyn, u) if dyn.further_forces else dyn.forces(u)
    largest_force = np.max(np.abs(forces), initial=0.0)
    return length if largest_force <= REST * np.max(stiffness, initial=0.0) * length else None


def _changes(dyn: Any) -> bool:
    """Whether sites are driven, or springs or forces of a scene depend on time; also for scenes of
    an ensemble with forces."""
    scene = dyn.scene
    return (
        dyn.batch
        or scene.drive
        or dyn.springs.changing
        or any(one.law.varies for one in dyn.further_forces)
    )


def _static_forces(dyn: Any, u: Array) -> Array:
    """Forces on all sites with further forces, at rest at t = 0 [N]; not for ensembles."""
    scene = dyn.scene
    r, along = elongations(dyn.contact_bonds, u)
    tension, sites = np.zeros(r.shape), np.zeros((scene.sites, scene.dim))
    for one in dyn.acting.applied(as_forces=True):
        x = u.reshape(sites.shape).T if one.law.on == SITE else r[None]
        state = np.zeros((len(one.law.state), len(one.places)))
        state[: len(x)] = x[:, one.places]
        found = np.array(one.law.function()(0.0, state, one.values))
        if one.law.on == BOND:
            tension[one.places] += found[0]
        elif one.law.law is None:  # that of a potential is among the forces of the scene
            sites[one.places] += found.T
    total = scattered_forces(dyn.contact_bonds, tension, along)[: scene.sites]
    total = total.reshape(u.shape) + sites.reshape(u.shape)
    total[list(scene.held)] = 0
    return total + dyn.forces(u)
