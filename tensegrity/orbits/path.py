"""Families of periodic orbits, followed by their period, their energy or a parameter of a drive:
`orbit_path`.

The branch is followed in arc length, through its folds; events are points where the followed
quantity is stationary and where Floquet multipliers leave the unit circle.  The period of a drive
may change along the branch: an orbit returns after the same phase of the drives, not the same time.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from tensegrity import check
from tensegrity.branches.continuation import ContinuationError, Part, Settings
from tensegrity.branches.problem import Joined, Problem, trace
from tensegrity.branches.steppers import ManyProblem
from tensegrity.branches.table import INTERRUPTED, Table
from tensegrity.checked import checked
from tensegrity.errors import TensegrityError
from tensegrity.orbits.driven_orbit import drive_parameters
from tensegrity.orbits.orbit import Family, family_of
from tensegrity.orbits.shooting import STABLE, Orbit, is_reversible
from tensegrity.scenes.dynamics import dynamics
from tensegrity.typing import Array, Flags

FINER = 2  # steps of the flow along a path over those of its first orbit
SAME_PLACE = 1e-9  # relative difference below which two events of one kind are the same
REFINED = 3  # most traces of a branch, each with more steps than the one before
POINTS = 2000  # largest number of rows
NEAR_END = 1e-3  # distance over the range of a spring that is close to the end of its domain
CLOSED = 1e-13  # residual above which round-off may be what ends a path


class OrbitPath(Table):
    """Periodic orbits of a family as a table, the followed quantity in the first column.

    Attributes
    ----------
    amplitude : ndarray, (rows,)
        Half of the largest extent of the displacement of a site [m]; of an undriven scene between
        the two turning points.
    period, energy : ndarray, (rows,)
        Period [s], and energy above that at rest [J].
    multiplier : ndarray, (rows,)
        Largest modulus of the Floquet multipliers except the neutral ones.
    stable : ndarray of bool, (rows,)
        Whether no multiplier lies outside of the unit circle.
    orbits : tuple of Orbit
        One for each row.
    events : tuple of Event
        Located points, with the columns and `value`, that of the first column, as attributes.  The
        kinds are "fold" (the followed quantity is stationary), "doubling" (a multiplier is -1: the
        period doubles), "torus" (complex multipliers leave the unit circle) and "stability" (the
        stability changes in another way, as where branches intersect).  At a torus point of an
        undriven orbit two pairs collide on the circle and leave it together.  Such points are
        located among at most 24 pairs, since waves reflected at the ends of a long chain cause
        many weak ones; with more pairs only the column `stable` shows them.
    end : str
        Why the path ends.
    """

    stable: Flags
    orbits: tuple[Orbit, ...]
    _by_row = ("orbits",)
    _units: ClassVar = {"period": "s", "energy": "J", "amplitude": "m"}


@checked
def orbit_path(
    orbit: Orbit, by: str, until: float | Mapping[str, Any], at: Mapping[str, Any] | None = None
) -> OrbitPath:
    """Follow a periodic orbit in its period, its energy, or a parameter of its drives.

    Parameters
    ----------
    orbit : Orbit
        The orbit at which the path begins.
    by : str
        "period" or "energy" of an undriven orbit, or the name of a parameter of the drives.
    until : float or dict of str to float
        Value at which the path ends; it sets the initial direction.  Or values of columns, as for
        `trace`: without one of `by` this quantity grows at first.
    at : dict of str to float, optional
        Values of columns of which the places become events; see `trace`.

    Returns
    -------
    OrbitPath
        After Ctrl-C with the rows so far, and "interrupted" as its `end`.

    Raises
    ------
    TensegrityError
        Bad input, or a path that does not arrive at `until`, with the reason.

    Examples
    --------
    The response of a prism to a force of increasing frequency has two folds, where it jumps:

    >>> import sympy as sp
    >>> from tensegrity import Chain, Damping, Drive, Prism, orbit_path, periodic_orbit
    >>> t, W = sp.symbols("t W")
    >>> shaker = Drive(force=0.001 * sp.cos(W * t), parameters={"W": 1.69})
    >>> spring = Prism(1.0, 0.7, 0.1, 1.0).potential()
    >>> ends, damping = ("fixed", "free"), Damping(ground=0.02)
    >>> chain = Chain(spring, 2, ends=ends, damping=damping, drive={1: shaker})
    >>> path = orbit_path(periodic_orbit(chain, chain.at_rest()), by="W", until=1.73)
    >>> [f"{event.kind} at {event.value:.9f}" for event in path.events]
    ['fold at 1.726272601', 'fold at 1.698961890']
    """
    driven = not is_reversible(orbit.scene)
    undriven = {"period": orbit.period, "energy": orbit.energy}
    names = drive_parameters(orbit.scene) if driven else undriven
    if not isinstance(by, str) or by not in names:
        raise TensegrityError(
            f"by {check.shown(by)} is not one of {', '.join(names) or 'any parameters of drives'}"
        )
    begin, goals = names[by], dict(until) if isinstance(until, dict) else {by: until}
    if not goals:
        raise TensegrityError("until {} names no column at which the path ends")
    end = check.number("until", goals.pop(by)) if by in goals else None
    if end is not None and (math.isclose(end, begin) or (not driven and end <= 0)):
        words = "differ from it" if driven else "differ from it and be above 0"
        raise TensegrityError(f"until {end:g} must {words}: the path begins at {by} {begin:g}")
    family = _Family(orbit, by, end)
    try:
        return trace(family, until=goals or None, at=at)
    except ContinuationError as error:
        goal = f"{end:g}" if end is not None else ", ".join(f"{k} {x:g}" for k, x in goals.items())
        words = f"the path by {by} does not reach {goal}"
        raise TensegrityError(f"{words}: {family.stopped(error)}") from None
    except KeyboardInterrupt as error:
        if (begun := getattr(error, "branch", None)) is None:
            raise
        begun.end = INTERRUPTED
        return begun


class _Family(Problem):
    """A family of orbits as `Equations` of `tensegrity.branches.steppers`, with events."""

    leaving = np.zeros(0, dtype=int)
    of: Family
    by: str
    goal: float | None
    roots: tuple[str, ...]
    _opens: bool
    _steps: tuple[int, int]
    _listed: dict[bytes, tuple[Orbit, dict[str, float]]]

    def __init__(self, orbit: Orbit, by: str, goal: float | None) -> None:
        of = family_of(orbit, by)
        begin = float(of.guess[-1])
        until = begin if goal is None else goal
        steps = orbit.steps * (1 if orbit.opens else FINER), of.steps_to(until)
        of.flow.steps = max(steps)
        self.__dict__.update(
            of=of, by=by, goal=goal, start=of.guess, until={}, stop=("end",), _opens=orbit.opens,
            direction=1 if goal is None or goal > begin else -1, _steps=steps, _listed={},
            settings=Settings(points=POINTS, largest=of.longest),
            scale=np.append(of.scale, abs(begin) or abs(until) or 1.0),
            roots=("end", *(f"{kind} {k}" for kind in of.kinds for k in range(of.count))),
            unknowns=(*(f"unknown {k}" for k in range(len(of.scale))), by),
            folds={"fold": len(of.scale)},
        )  # fmt: skip
        stepper = ManyProblem(self)
        self.__dict__["_build_stepper"] = lambda: stepper

    @property
    def names(self) -> tuple[str, ...]:
        """See `Problem.names`."""
        return tuple(dict.fromkeys((self.by, "amplitude", "period", "energy", "multiplier")))

    def followed(self, until: Mapping[str, Any], at: Mapping[str, Any]) -> Part:
        """See `Problem.followed`: repeated with more steps of the flow until they do not matter."""
        for last in range(REFINED):
            self._listed.clear()
            part = super().followed(until, at)
            # errors at kinks hardly decrease with the step, and the first orbit has many steps
            points = [part.data[0], part.data[-1], *(event.point for event in part.events)]
            if self._opens or last == REFINED - 1 or self.resolved(points):
                break
            self.of.flow.steps = max(FINER ** (last + 1) * self._steps[0], self._steps[1])
        events, part.events = part.events, []
        for event in events:
            kind = "stability" if event.kind == "bifurcation" else event.kind.split()[0]
            wanted = kind in self.names  # a value of a column
            if not wanted and (kind == "end" or not self._is_event(kind, event.point)):
                continue
            same = [x.point[-1] for x in part.events[-self.of.count :] if x.kind == kind]
            if wanted or not any(
                math.isclose(x, event.point[-1], rel_tol=SAME_PLACE) for x in same
            ):
                part.events.append(event._replace(kind=kind))
        if part.end == "end":
            part.end = f"{self.by} {self.goal:g}"
        return part

    def _is_event(self, kind: str, u: Array) -> bool:
        return self.of.is_event(kind, self.of.multipliers(u)[0])

    def linearised(self, u: Array) -> tuple[Array, Array]:
        """Scaled residual (m - 1,) and its Jacobian (m - 1, m)."""
        return self.of.found(u)[:2]

    def residual(self, u: Array) -> Array:
        """Scaled residual (m - 1,)."""
        return self.of.found(u)[0]

    def tests(self, u: Array) -> Array:
        """Functions that vanish at the end and at events of the multipliers, (roots,).

        For each kind the values of `distances` in ascending order; as many are negative as
        multipliers have crossed, so that several crossings in one step are detected one by one."""
        if not np.isfinite(self.residual(u)).all():
            return np.full(len(self.roots), math.nan)
        rows = np.full((len(self.of.kinds), self.of.count), 1.0)
        for row, values in zip(rows, self.of.distances(self.of.multipliers(u)[0]), strict=True):
            row[: len(values)] = np.sort(values)[: self.of.count]
        return np.append(1.0 if self.goal is None else u[-1] - self.goal, rows)

    def resolved(self, points: list[Array]) -> bool:
        """Whether twice as many steps of the flow find the same orbits."""
        self.of.flow.steps *= 2
        residuals = [float(np.abs(self.of.evaluated(u)[0]).max()) for u in points]
        self.of.flow.steps //= 2
        return max(residuals) < self.of.closed

    def stopped(self, error: ContinuationError) -> str:
        """Text on the last orbit before an error, and a possible reason why it is the last."""
        part: Part | None = getattr(error, "part", None)
        if part is None:
            return str(error)
        orbit, row = self.row(part.data[-1])
        low, high = dynamics(orbit.scene).springs.computable_domain.T
        ranges = self.of.flow.ranges
        left = np.minimum(ranges[:, 0] - low, high - ranges[:, 1])
        near = left < NEAR_END * np.ptp(ranges, axis=1)
        reasons = {
            "a spring is close to the end of its domain there": near.any(),
            "springs pass kinks, at which tangents are not smooth": orbit.opens,
            f"its residual is {orbit.residual:.1e}": orbit.residual > CLOSED,
            f"it has {POINTS} rows": len(part.data) >= POINTS,
        }
        causes = [words for words, holds in reasons.items() if holds]
        at = ", ".join(f"{name} {row[name]:.6g}" for name in (self.by, "amplitude", "period"))
        why = "; ".join(causes) or "the steps became too short, as they do near other branches"
        return f"its last orbit is that of {at}: {why}"

    def measure(self, data: Array) -> dict[str, Array]:
        """See `Problem.measure`."""
        rows = [self.row(u)[1] for u in data]
        return {name: np.array([row[name] for row in rows]) for name in rows[0]}

    def rows(self, part: Part) -> dict[str, Array]:
        """See `Problem.rows`."""
        orbits = np.empty(len(part.data), dtype=object)
        for k, u in enumerate(part.data):
            orbits[k] = self.row(u)[0]
        return {"orbits": orbits}

    def table(self, path: Joined) -> OrbitPath:
        """See `Problem.table`."""
        orbits = tuple(path.columns["orbits"])
        return OrbitPath(path.columns | {"orbits": orbits}, path.events, path.end)

    def row(self, u: Array) -> tuple[Orbit, dict[str, float]]:
        """The orbit of given unknowns, and its row of the table, computed once."""
        if u.tobytes() not in self._listed:
            orbit = self.of.orbit(u)
            largest = float(np.abs(self.of.multipliers(u)[0]).max(initial=0.0))
            row = {self.by: float(u[-1]), "amplitude": self.of.amplitude(orbit)}
            row |= {"period": orbit.period, "energy": orbit.energy} | row
            row |= {"multiplier": largest, "stable": largest <= 1 + STABLE}
            self._listed[u.tobytes()] = orbit, row
        return self._listed[u.tobytes()]
