"""Families of periodic orbits, followed by their period, their energy or a parameter of a drive:
`orbit_path`.

The branch is followed in arc length, through its folds; events are points where the followed
quantity is stationary and where Floquet multipliers leave the unit circle.  The period of a drive
may change along the branch: an orbit returns after the same phase of the drives, not the same time.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from tensegrity import check
from tensegrity.branches.continuation import ContinuationError, Part, Settings
from tensegrity.branches.many import ManyProblem
from tensegrity.branches.problem import Joined, Problem, trace
from tensegrity.branches.table import INTERRUPTED, Table
from tensegrity.errors import TensegrityError
from tensegrity.orbits.driven_orbit import WholePeriod
from tensegrity.orbits.half_period import HalfPeriod
from tensegrity.orbits.period import DrivePeriod, drive_values
from tensegrity.orbits.shooting import Orbit, is_reversible
from tensegrity.orbits.stability import STABLE, half_multipliers
from tensegrity.scenes.dynamics import dynamics

if TYPE_CHECKING:
    from collections.abc import Mapping

    from tensegrity.orbits.stability import Multipliers
    from tensegrity.typing import Array, Flags

FINER = 2  # steps of the flow along a path over those of its first orbit
ON_CIRCLE = 1e-6  # distance of a multiplier, or of the sum of a pair, from its value at an event
MEETING = 24  # most pairs of an undriven orbit among which collisions are located
MEET = 1e-6  # imaginary part of mu + 1/mu up to which a pair lies on the unit circle
SAME_PLACE = 1e-9  # relative difference below which two events of one kind are the same
REFINED = 3  # most traces of a branch, each with more steps than the one before
POINTS = 2000  # largest number of rows
NEAR_END = 1e-3  # distance over the range of a spring that is close to the end of its domain
CLOSED = 1e-13  # residual above which round-off may be what ends a path
FINENESS = 16  # parts into which a step is divided where the extent of a motion is computed


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
    >>> shaker = Drive(force=0.001 * sp.cos(W * t), parameters={"W": 1.65})
    >>> spring = Prism(1.0, 0.7, 0.1, 1.0).potential()
    >>> ends, damping = ("fixed", "free"), Damping(ground=0.02)
    >>> chain = Chain(spring, 2, ends=ends, damping=damping, drive={1: shaker})
    >>> path = orbit_path(periodic_orbit(chain, chain.at_rest()), by="W", until=1.75)
    >>> [f"{event.kind} at {event.value:.9f}" for event in path.events]
    ['fold at 1.726272601', 'fold at 1.698961890']
    """
    check.kind("orbit", orbit, Orbit)
    driven = not is_reversible(orbit.scene)
    names = (
        drive_values(orbit.scene) if driven else {"period": orbit.period, "energy": orbit.energy}
    )
    if not isinstance(by, str) or by not in names:
        raise TensegrityError(
            f"by {check.shown(by)} is not one of {', '.join(names) or 'any parameters of drives'}"
        )
    begin, goals = names[by], dict(until) if isinstance(until, dict) else {by: until}
    end = check.number("until", goals.pop(by)) if by in goals else None
    if end is not None and (math.isclose(end, begin) or (not driven and end <= 0)):
        words = "differ from it" if driven else "differ from it and be above 0"
        raise TensegrityError(f"until {end:g} must {words}: the path begins at {by} {begin:g}")
    family = (_Driven if driven else _Reversible)(orbit, by, end)
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
    """Equations of a family of orbits, as `tensegrity.branches.many` takes them."""

    kinds: tuple[str, ...] = ("doubling", "torus")  # of events of the multipliers
    leaving = np.zeros(0, dtype=int)
    longest = 0.02  # step, relative: what changes and changes back within one is not seen
    settled = 1e-11  # residual that twice as many steps may leave, over the size of the orbit
    flow: Any
    by: str
    goal: float | None
    roots: tuple[str, ...]
    _count: int
    _opens: bool
    _last: Any
    _listed: dict[bytes, tuple[Orbit, dict[str, float]]]

    def __init__(
        self, orbit: Orbit, by: str, goal: float | None, start: Array, scale: Array, count: int
    ) -> None:
        self.__dict__.update(
            by=by, goal=goal, start=start, scale=scale, until={}, _count=count, _opens=orbit.opens,
            direction=1 if goal is None or goal > start[-1] else -1,
            stop=("end",), settings=Settings(points=POINTS, largest=self.longest),
            roots=("end", *(f"{kind} {k}" for kind in self.kinds for k in range(count))),
            unknowns=(*(f"unknown {k}" for k in range(len(start) - 1)), by),
            folds={"fold": len(start) - 1}, _last=(b"", None), _listed={},
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
            self.flow.steps *= FINER
            self.__dict__["_last"] = b"", None
        events, part.events = part.events, []
        for event in events:
            kind = "stability" if event.kind == "bifurcation" else event.kind.split()[0]
            wanted = kind in self.names  # a value of a column
            if not wanted and not self.is_event(kind, self.multipliers(event.point)):
                continue
            same = [x.point[-1] for x in part.events[-self._count :] if x.kind == kind]
            if wanted or not any(
                math.isclose(x, event.point[-1], rel_tol=SAME_PLACE) for x in same
            ):
                part.events.append(event._replace(kind=kind))
        if part.end == "end":
            part.end = f"{self.by} {self.goal:g}"
        return part

    def found(self, u: Array) -> Any:
        """The result of `_evaluated` at the last unknowns, computed once."""
        if self._last[0] != u.tobytes():
            self.__dict__["_last"] = u.tobytes(), self._evaluated(u)
        return self._last[1]

    def _evaluated(self, u: Array) -> tuple[Array, Array]:
        """Scaled residual (m - 1,) and its Jacobian (m - 1, m)."""
        raise NotImplementedError

    def multipliers(self, u: Array) -> Multipliers:
        """Floquet multipliers, (any,)."""
        raise NotImplementedError

    def orbit(self, u: Array) -> Orbit:
        """The orbit of given unknowns."""
        raise NotImplementedError

    def amplitude(self, orbit: Orbit) -> float:
        """See `OrbitPath`."""
        raise NotImplementedError

    def linearised(self, u: Array) -> tuple[Array, Array]:
        """Scaled residual (m - 1,) and its Jacobian (m - 1, m)."""
        residual, jacobian = self.found(u)
        return residual, jacobian

    def residual(self, u: Array) -> Array:
        """Scaled residual (m - 1,)."""
        return self.found(u)[0]

    def tests(self, u: Array) -> Array:
        """Functions that vanish at the end and at events of the multipliers, (roots,).

        For each kind the values of `distances` in ascending order; as many are negative as
        multipliers have crossed, so that several crossings in one step are detected one by one."""
        if not np.isfinite(self.found(u)[0]).all():
            return np.full(len(self.roots), math.nan)
        rows = np.full((len(self.kinds), self._count), 1.0)
        for row, values in zip(rows, self.distances(self.multipliers(u)), strict=True):
            row[: len(values)] = np.sort(values)[: self._count]
        return np.append(1.0 if self.goal is None else u[-1] - self.goal, rows)

    def distances(self, multipliers: Multipliers) -> tuple[Array, ...]:
        """For each kind of event, any number of values that change their sign there."""
        return 1 + multipliers.real, 1 - np.abs(multipliers) ** 2

    def is_event(self, kind: str, multipliers: Multipliers) -> bool:
        """Whether multipliers are those of an event of this kind, where one of its numbers is 0."""
        if kind == "torus":
            pairs = multipliers[multipliers.imag > 0]
            return bool(np.abs(np.abs(pairs) - 1).min(initial=1.0) < ON_CIRCLE)
        near = bool(np.abs(1 + multipliers).min(initial=1.0) < ON_CIRCLE)
        return kind != "end" and (kind != "doubling" or near)

    def resolved(self, points: list[Array]) -> bool:
        """Whether twice as many steps of the flow find the same orbits."""
        self.flow.steps *= 2
        residuals = [float(np.abs(self._evaluated(u)[0]).max()) for u in points]
        self.flow.steps //= 2
        size = max(float(np.abs(u[:-1] / self.scale[:-1]).max()) for u in points)
        return max(residuals) < self.settled * size

    def stopped(self, error: ContinuationError) -> str:
        """Text on the last orbit before an error, and a possible reason why it is the last."""
        part: Part | None = getattr(error, "part", None)
        if part is None:
            return str(error)
        orbit, row = self.row(part.data[-1])
        low, high = dynamics(orbit.scene).springs.computable_domain.T
        left = np.minimum(self.flow.ranges[:, 0] - low, high - self.flow.ranges[:, 1])
        near = left < NEAR_END * np.ptp(self.flow.ranges, axis=1)
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
            orbit = self.orbit(u)
            largest = float(np.abs(self.multipliers(u)).max(initial=0.0))
            row = {self.by: float(u[-1]), "amplitude": self.amplitude(orbit)}
            row |= {"period": orbit.period, "energy": orbit.energy} | row
            row |= {"multiplier": largest, "stable": largest <= 1 + STABLE}
            self._listed[u.tobytes()] = orbit, row
        return self._listed[u.tobytes()]


class _Driven(_Family):
    """Unknowns are those of `WholePeriod`, and the parameter."""

    _whole: WholePeriod
    _first: float
    _period: DrivePeriod

    def __init__(self, orbit: Orbit, by: str, goal: float | None) -> None:
        whole = WholePeriod(orbit.scene, orbit.state, orbit.period)
        begin, size = drive_values(orbit.scene)[by], float(np.abs(whole.guess).max()) or 1.0
        goal_or_begin, period = begin if goal is None else goal, DrivePeriod(orbit.scene)
        last = orbit.period * period.factor_to(by, goal_or_begin)
        needed = WholePeriod(orbit.scene, orbit.state, last).steps
        whole.flow.steps = max(orbit.steps * (1 if orbit.opens else FINER), needed)
        self.__dict__.update(_whole=whole, _first=orbit.period, _period=period, flow=whole.flow)
        scale = np.append(np.full(len(whole.guess), size), abs(begin) or abs(goal_or_begin) or 1.0)
        start = np.append(whole.guess, begin)
        super().__init__(orbit, by, goal, start, scale, len(whole.guess))

    def _evaluated(self, u: Array) -> tuple[Array, Array]:
        whole, values = self._whole, {self.by: float(u[-1])}
        factor, slope = self._period.factor(self.by, values[self.by])
        period = self._first * factor
        residual, jacobian, column = whole.equations(u[:-1], period, values, self.by)
        if np.isfinite(residual).all() and slope:
            column = column + self._first * slope * whole.rates(period)
        size = self.scale[0]
        return residual / size, np.column_stack([jacobian, column]) / size

    def multipliers(self, u: Array) -> Multipliers:
        return self._whole.multipliers(self.found(u)[1][:, :-1] * self.scale[0])

    def orbit(self, u: Array) -> Orbit:
        values = {self.by: float(u[-1])}
        period = self._first * self._period.factor(self.by, values[self.by])[0]
        return self._whole.found(u[:-1], period, float(np.abs(self.found(u)[0]).max()), values)

    def amplitude(self, orbit: Orbit) -> float:
        waves = np.fft.rfft(self._whole.flow.displacements, axis=0)
        finer = FINENESS * self.flow.steps
        return float(FINENESS * np.ptp(np.fft.irfft(waves, finer, axis=0), axis=0).max() / 2)


class _Reversible(_Family):
    """Unknowns are u(0) of the free sites, T, and the energy where it is followed."""

    _half: HalfPeriod
    _first: float

    longest, settled = 0.1, 1e-9

    def __init__(self, orbit: Orbit, by: str, goal: float | None) -> None:
        half = HalfPeriod(orbit.scene, orbit.state.u.ravel())
        half.flow.steps = orbit.steps * (1 if orbit.opens else FINER)
        u, size = orbit.state.u.ravel()[half.free], half.extent(orbit.state.u.ravel())
        more = [orbit.period, orbit.energy][: 1 + (by == "energy")]
        scale = np.append(np.full(len(u), size), more)
        pairs = len(u) - 1 - half.shifts.shape[1]
        kinds = ("doubling", "stability", *(("torus",) if pairs <= MEETING else ()))
        self.__dict__.update(_half=half, _first=orbit.period, flow=half.flow, kinds=kinds)
        super().__init__(orbit, by, goal, np.append(u, more), scale, pairs)

    def _state(self, u: Array) -> tuple[Array, float]:
        """u(0) of all entries, and T/2."""
        displacements = np.zeros(len(self._half.inverse_mass))
        displacements[self._half.free] = u[: len(self._half.free)]
        return displacements, float(u[len(self._half.free)]) / 2

    def _evaluated(self, u: Array) -> tuple[Array, Array]:
        x, half = self._state(u)
        if half <= 0 or not self._half.inside(x):
            return u[:-1] + math.nan, np.zeros((len(u) - 1, len(u)))
        v, jacobian, acceleration = self._half.equations(x, half)
        size = max(self.scale[0], self._half.extent(x))  # round-off increases with the orbit
        unit = math.pi * size / min(self._first / 2, half)
        rows = np.column_stack([jacobian, acceleration / 2]) / unit
        if self.by == "period":
            return v / unit, rows
        energy = max(self.scale[-1], abs(u[-1]))
        missing = (self._half.above_rest(x, 0 * x) - u[-1]) / energy
        matrix = np.zeros((len(u) - 1, len(u)))
        matrix[:-1, :-1] = rows
        matrix[-1, : len(v)] = -self._half.forces(x)[self._half.free] / energy
        matrix[-1, -1] = -1 / energy
        return np.append(v / unit, missing), matrix

    def distances(self, multipliers: Multipliers) -> tuple[Array, ...]:
        """The sum mu + 1/mu of a pair passes 2 and -2 linearly; where two pairs collide on the
        circle and leave it, the square of the difference of their sums changes its sign."""
        sums = _sums(multipliers)
        on = np.abs(sums.imag) < MEET
        apart = np.diff(np.sort(sums.real[on])) ** 2
        off = -4 * sums.imag[~on & (sums.imag > 0)] ** 2
        meeting = np.append(off, apart) + 4 * MEET**2
        return (2 + sums.real, 2 - sums.real, meeting)[: len(self.kinds)]

    def is_event(self, kind: str, multipliers: Multipliers) -> bool:
        """Whether multipliers are those of an event of this kind, where one of its numbers is 0."""
        sums = _sums(multipliers)
        if kind == "torus":
            place = np.sort(sums[np.abs(sums.imag) < 2 * MEET].real)
            near = np.argmin(np.diff(place)) if len(place) > 1 else 0
            return len(place) > 1 and abs(place[near]) < 2
        end = -2.0 if kind == "doubling" else 2.0
        return kind != "end" and bool(np.abs(sums - end).min(initial=1.0) < ON_CIRCLE)

    def multipliers(self, u: Array) -> Multipliers:
        return half_multipliers(self._half, *self._state(u))[0]

    def orbit(self, u: Array) -> Orbit:
        x, half = self._state(u)
        return self._half.found(np.append(x, half), float(np.abs(self.found(u)[0]).max()))

    def amplitude(self, orbit: Orbit) -> float:
        u = orbit.state.u.ravel()
        return float(np.abs(self._half.flow.end(u, 0 * u, orbit.period / 2)[0] - u).max() / 2)


def _sums(multipliers: Multipliers) -> Multipliers:
    """mu + 1/mu of each pair of multipliers, (pairs,)."""
    real = multipliers[multipliers.imag == 0]
    halves = [x[: len(x) // 2] for x in (real[real.real > 0], real[real.real < 0])]
    one = np.concatenate([multipliers[multipliers.imag > 0], *halves])
    return np.asarray(one + 1 / one, dtype=complex)
