"""Pseudo-arclength continuation of solution branches of g(z; p) = 0.

There is one unknown more than equations.  Each step is a predictor-corrector step (Keller 1977;
Allgower & Georg 1990): the predictor is the cubic through the last two points and their tangents,
the corrector is Newton's method bordered by the previous tangent.  The distance between both
measures the fourth derivative of the branch, hence the error of cubic interpolation between the
rows, which controls the step.  A point is accepted if its residual is at round-off and both the
correction and the angle between the tangents are small; otherwise the step is reduced.  The step
is also reduced where the bordered determinant changes sign, as between a branch and another one
close to it.  Limit points (folds) are located on their extended system (Moore & Spence 1980), roots
of user functions on the equations extended by the function.

A `Problem` states the equations, `Settings` the tolerances, and a `Branch` is the result.  Steps
between two events are a single call if they are compiled (`follow.c`).  An event is bracketed where
its function changes sign; Newton's method starts from the cubic, bisection follows where it fails.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check
from tensegrity.branches.compiled_stepper import CompiledStepper
from tensegrity.branches.table import INTERRUPTED, Event, Table
from tensegrity.engine.disk_cache import cached, maker
from tensegrity.errors import TensegrityError
from tensegrity.once import once

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Mapping
    from typing import Any

    from numpy.typing import ArrayLike

    from tensegrity.branches.many import ManyProblem
    from tensegrity.typing import Array

START_ITERATIONS = 50
BISECTIONS = 45  # where Newton's method does not locate an event
INITIAL_ROWS = 256  # rows allocated at first


class ContinuationError(TensegrityError):
    """A branch could not be followed; `branch` holds its points so far, or is None."""

    branch = None


@dataclass(frozen=True, eq=False)
class Problem:
    """Equations of a branch, as CasADi SX expressions of the same symbols.

    Attributes
    ----------
    unknowns : tuple of str
        Names of the m unknowns; the last one sets the direction at the start.
    z, p : casadi.SX, (m,), (k,)
        Symbols of the unknowns, and of the parameters given to `trace`.
    residual : casadi.SX, (m - 1,)
    scale : sequence of float, (m,), optional
        Typical magnitudes of the unknowns, which may have different units.  Arc length is that
        of asinh(unknown/scale), so that unknowns above their scale count by relative changes and
        forces may grow by orders of magnitude along the branch.
    size : casadi.SX, (m - 1,), optional
        Magnitude of the terms of each equation, by which its residual is divided; 1 by default.
    roots, folds : dict of str to casadi.SX
        Event functions of (z, p): an event is where a root vanishes, or where a fold is
        stationary along the branch.  By default the limit point of the last unknown.
    values : dict of str to casadi.SX
        Further functions of (z, p) to tabulate.
    """

    unknowns: tuple[str, ...]
    z: Any
    p: Any
    residual: Any
    scale: tuple[float, ...] | None = None
    size: Any = None
    roots: dict[str, Any] = field(default_factory=dict)
    folds: Any = None
    values: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        m, n = len(self.unknowns), self.residual.numel()
        if self.z.numel() != m or n != m - 1:
            raise TensegrityError(
                f"{n} equations and {self.z.numel()} symbols do not suit {m} unknowns, "
                f"must be {m - 1} and {m}"
            )
        scale = tuple(
            check.number(f"scale of {name}", s, above=0)
            for name, s in zip(self.unknowns, self.scale or (1.0,) * m, strict=True)
        )
        object.__setattr__(self, "scale", scale)
        if self.folds is None:
            object.__setattr__(self, "folds", {"fold": self.z[m - 1]})

        self.__dict__["_build_stepper"] = once(lambda: CompiledStepper(self, _layout(self)))

    @property
    def _stepper(self):
        return self._build_stepper()


class DerivedProblem(Problem):
    """A problem whose expressions are derived by a function on first use.

    Tracing needs no expressions if the compiled functions of the problem are in the disk cache
    (`tensegrity.engine.disk_cache`).

    Parameters
    ----------
    make : callable
        A module-level function that returns a `Problem`.
    *arguments
        Its arguments, texts and numbers, which determine the problem.
    """

    def __init__(self, make: Callable[..., Problem], *arguments: Any) -> None:
        name = maker(make, *arguments)
        key, derive = ("problem", name), once(lambda: make(*arguments))
        build = once(lambda: CompiledStepper(self, cached(key, lambda: _layout(self)), name))
        self.__dict__.update(derived=derive, _build_stepper=build)


def _field_of(name: str) -> Any:
    return property(lambda self: getattr(self.derived(), name))


for _field in fields(Problem):
    setattr(DerivedProblem, _field.name, _field_of(_field.name))


def _layout(problem):
    """Names, scales and sizes of a problem, which a `CompiledStepper` needs besides functions."""
    return {
        "unknowns": list(problem.unknowns),
        "scale": list(problem.scale),
        "numbers": problem.p.numel(),
        "roots": list(problem.roots),
        "folds": list(problem.folds),
        "values": list(problem.values),
    }


@dataclass(frozen=True)
class Settings:
    """Tolerances of a continuation; lengths are those of scaled unknowns.

    Attributes
    ----------
    tolerance : float
        Largest estimated error of cubic interpolation between rows.
    residual : float
        Largest scaled residual of a row.
    first, smallest, largest : float
        First step, and bounds of all steps.
    turn : float
        Largest angle between the tangents of neighbouring rows [rad].
    points : int
        Largest number of rows.
    """

    tolerance: float = 1e-6
    residual: float = 1e-12
    first: float = 1e-2
    smallest: float = 1e-10
    largest: float = math.inf
    turn: float = 0.3
    points: int = 20000

    def __post_init__(self) -> None:
        for name in ("tolerance", "residual", "first", "smallest", "turn"):
            check.number(name, getattr(self, name), above=0)
        check.number("largest step", self.largest, above=0, finite=False)
        if self.smallest > min(self.first, self.largest):
            raise TensegrityError(
                f"smallest step {self.smallest:g} must be at most {min(self.first, self.largest):g}"
            )
        check.whole("points", self.points, least=2)


class Branch(Table):
    """A traced branch: a table of unknowns and values, with tangents and residuals.

    Attributes
    ----------
    z, tangent : ndarray, (rows, m)
        Unknowns, and unit tangents in scaled unknowns.
    arc : ndarray, (rows,)
        Arc length from the start of the branch, in scaled unknowns.
    residual : ndarray, (rows,)
        Largest scaled residual.
    """

    p: Any  # parameters of the trace, if they were stored
    _by_row = ("z", "tangent", "arc", "residual")

    def __init__(
        self,
        columns: Mapping[str, Any],
        events: Iterable[Event],
        end: str,
        z: Array,
        tangent: Array,
        arc: Array,
        residual: Array,
    ) -> None:
        super().__init__(columns, events, end)
        self.z, self.tangent, self.arc, self.residual = z, tangent, arc, residual


def trace(
    problem: Problem | ManyProblem,
    start: ArrayLike,
    parameters: ArrayLike = (),
    settings: Settings | None = None,
    direction: int = 1,
    stop: Collection[str] = (),
) -> Branch:
    """Follow the branch through a given point.

    Parameters
    ----------
    problem : Problem
    start : array_like, (m,)
        A point on or near the branch.
    parameters : array_like, (k,)
        Values of the symbols p.
    settings : Settings, optional
    direction : {1, -1}
        Initial sense of the last unknown; at a limit point, of the largest component.
    stop : collection of str
        Kinds of event at which the branch ends, with that event as its last row.

    Returns
    -------
    Branch
        It ends at the first event in `stop`; simple bifurcations are events as well.
        Several threads may trace the same problem at once.

    Raises
    ------
    ContinuationError, KeyboardInterrupt
        If the start is not near a solution, the step falls below the smallest one, no end is
        reached within `points` rows, or after Ctrl-C; its `branch` holds the rows so far.
    TensegrityError
        If start, parameters, direction or `stop` do not suit the problem.
    """
    settings, stepper = settings or Settings(), problem._stepper
    start, p = _checked(stepper, start, parameters, direction, stop)
    rows, events, end = _follow_branch(stepper, start, p, settings, direction, stop)
    branch = _branch(stepper, rows, events, end if end in stepper.kinds else "failed")
    if end not in stepper.kinds:
        words = f"{end}; last good point {_formatted(stepper, rows[-1])}"
        failure: Any = KeyboardInterrupt() if end == INTERRUPTED else ContinuationError(words)
        failure.branch = branch
        raise failure
    return branch


def _follow_branch(stepper, start, p, settings, direction, stop):
    """Rows, events (kind, row, point), and the kind of the last event or the failure."""
    first = _first_point(stepper, start, p, settings, direction)
    names = "tolerance", "residual", "turn", "largest", "smallest"
    first_step = min(settings.first, settings.largest)
    control = np.array([first_step, *(getattr(settings, name) for name in names)])
    most, count, events, folds = settings.points, 1, [], []
    rows = np.empty((min(INITIAL_ROWS, most), stepper.size))
    rows[0], rows[0, stepper.length] = first, control[0]  # the predictor needs a length
    for i, test in enumerate(first[stepper.tests :].tolist()):
        if abs(test) <= stepper.vanishing[i]:
            rows[0, stepper.tests + i] = 0.0  # its sign is that of the first step
            if i >= len(stepper.roots):
                folds.append(i)
            else:
                events.append((stepper.kinds[i], 0, first))
    while count < most:
        if count == len(rows):
            rows = np.concatenate([rows, np.empty_like(rows)])[:most]
        last = count
        try:
            count = stepper.steps(rows, count, control, p)
            found = _events_between(stepper, *rows[count - 2 : count], p) if count > last else []
        except KeyboardInterrupt:  # the events of a last step are not known
            return rows[: max(count - 1, last)], events, INTERRUPTED
        if count == last:
            return rows[:count], events, f"the step fell below {settings.smallest:g}"
        if folds:
            events += _starting_folds(stepper, rows, folds, p)
            folds = []
        for kind, point in found:
            events.append((kind, count - 1 - (kind not in stop), point))
            if kind in stop:
                rows[count - 1] = _with_length(stepper, rows[count - 2], point)
                return rows[:count], events, kind
    return rows, events, f"{most} rows do not reach an end"


def _checked(stepper, start, parameters, direction, stop):
    p = np.asarray(parameters, dtype=float).ravel()
    start = np.asarray(start, dtype=float).ravel()
    m, k = stepper.m, stepper.numbers
    if p.size != k or start.size != m:
        raise TensegrityError(
            f"{start.size} start values and {p.size} parameters do not suit the problem, must be "
            f"{m} and {k}"
        )
    if not all(map(math.isfinite, start)) or any(map(math.isnan, p)):
        raise TensegrityError("start or parameters hold a value that is not finite")
    if direction not in (1, -1):
        raise TensegrityError(f"direction {direction!r} must be 1 or -1")
    for kind in stop:
        if kind not in stepper.kinds:
            raise TensegrityError(f"stop {kind!r} is not among {stepper.kinds}")
    return np.arcsinh(start / stepper.scale), p


def _formatted(stepper, row):
    values = zip(stepper.names, np.sinh(row[: stepper.m]) * stepper.scale, strict=True)
    return ", ".join(f"{name} {value:.9g}" for name, value in values)


def _first_point(stepper, z, p, settings, direction):
    """Nearest solution by least-norm Newton steps, which also converge at limit points."""
    residual = math.nan
    for _ in range(START_ITERATIONS):
        move, tangent = stepper.least_norm(z, p)
        moves = move.tolist()
        finite = math.isfinite(sum(moves))
        if not finite:
            break
        z = z - move
        if all(abs(x) <= 1e-15 * (1 + abs(at)) for x, at in zip(moves, z.tolist(), strict=True)):
            break
    if finite:
        lead = tangent[-1] if abs(tangent[-1]) > 1e-8 else tangent[np.argmax(np.abs(tangent))]
        point = stepper.corrected(z, tangent if lead * direction > 0 else -tangent, p)
        residual = point[stepper.residual]
    if not residual <= settings.residual:
        raise ContinuationError(
            f"no solution near the start: residual {residual:.3g} at {_formatted(stepper, z)} is "
            f"above {settings.residual:g}"
        )
    return point


def _starting_folds(stepper, rows, folds, p):
    """The folds among those at the first row that are events: the function changes sign."""
    here, control = rows[0].copy(), np.zeros(6)
    here[stepper.length], control[0] = 1.0, -rows[1, stepper.length]
    back = stepper.advance(stepper.before(here), here, control, p)
    places = [(stepper.kinds[i], stepper.tests + i) for i in folds]
    return [(kind, 0, rows[0].copy()) for kind, at in places if back[at] * rows[1, at] < 0]


def _events_between(stepper, before, here, p):
    """Events (kind, point) between two points, in the order along the branch.

    A step with a fold is divided there, because a root may occur on both sides of it.
    """
    m, roots = stepper.m, len(stepper.roots)
    signs, tests = before[stepper.tests :].tolist(), here[stepper.tests :].tolist()
    crossed = [i for i, test in enumerate(tests) if signs[i] * test < 0]

    def event(i, start, end):
        return stepper.kinds[i], _locate(stepper, start, end, i, signs[i], p)

    def place(one):
        return (one[1][:m] - before[:m]) @ before[m : 2 * m]

    def ordered(events):
        return sorted(events, key=place) if len(events) > 1 else events

    located = [event(i, before, here) for i in crossed if i >= roots]
    if not located:
        located = [event(i, before, here) for i in crossed]
    else:
        start = before
        for end in (*(fold for _, fold in ordered(located)), here):
            tests = end[stepper.tests :].tolist()
            part = [i for i in range(roots) if signs[i] * tests[i] < 0]
            located += [event(i, start, _with_length(stepper, start, end)) for i in part]
            if end is not here:
                start, signs = end, [new or old for new, old in zip(tests, signs, strict=True)]
    if before[stepper.side] * here[stepper.side] < 0:
        located.append(("bifurcation", _bifurcation(stepper, before, here, p)))
    return ordered(located)


def _with_length(stepper, start, end):
    """A copy of a row with its distance from another one as step length."""
    end = end.copy()
    end[stepper.length] = math.dist(start[: stepper.m].tolist(), end[: stepper.m].tolist())
    return end


def _locate(stepper, before, here, number, sign, p):
    """The point between two others where an event function vanishes."""
    test = stepper.tests + number
    low = 0.0, float(before[test]), before
    high = 1.0, float(here[test]), here
    for _ in range(BISECTIONS):
        part = low[0] + (high[0] - low[0]) * low[1] / (low[1] - high[1])
        ends = low[2], high[2]
        point = stepper.locate_event(stepper.kinds[number], before, here, part, ends, p)
        if point is not None:
            return point
        part = (low[0] + high[0]) / 2
        middle = stepper.corrected(*stepper.interpolated(before, here, part), p)
        if middle[test] * sign > 0:
            low = part, float(middle[test]), middle
        else:
            high = part, float(middle[test]), middle
    stepper.on_curve(middle, before, here)
    return middle


def _bifurcation(stepper, before, here, p):
    """The point between two others where the bordered determinant changes sign."""
    low, high = 0.0, 1.0
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        point = stepper.corrected(*stepper.interpolated(before, here, middle), p)
        if point[stepper.side] * before[stepper.side] > 0:
            low = middle
        else:
            high = middle
    return point


def _branch(stepper, rows, events, end):
    m, count = stepper.m, len(rows)
    names, values = (*stepper.names, *stepper.tabulated), stepper.residual
    data = np.concatenate([rows, *(point[None] for _, _, point in events)])
    table = data[:, m:values].copy()
    table[:, :m] = np.sinh(data[:, :m]) * stepper.scale  # in the place of tangents
    listed = [
        Event(kind, row, dict(zip(names, at, strict=True)))
        for (kind, row, _), at in zip(events, table[count:].tolist(), strict=True)
    ]
    columns = dict(zip(names, table[:count].T.copy(), strict=True))
    rows[0, stepper.length] = 0.0
    arc = np.add.accumulate(rows[:, stepper.length])
    z, tangent, residual = table[:count, :m], rows[:, m : 2 * m].copy(), rows[:, values]
    return Branch(columns, listed, end, z, tangent, arc, residual)
