"""Pseudo-arclength continuation of solution branches of g(z; p) = 0.

There is one unknown more than equations.  Each step is a predictor-corrector step (Keller 1977;
Allgower & Georg 1990): the predictor is the cubic through the last two points and their tangents,
the corrector is Newton's method bordered by the previous tangent.  The distance between both
measures the fourth derivative of the branch, hence the error of cubic interpolation between the
rows, which controls the step.  A point is accepted if its residual is at round-off and both the
correction and the angle between the tangents are small; otherwise the step is reduced.  The step
is also reduced where the bordered determinant changes sign, as between a branch and another one
close to it.

Steps between two events are a single call if they are compiled (`follow.c`).  An event is bracketed
where its function changes sign, and given values of columns where these pass them; both are found
by Chandrupatla's method as functions of the place on the branch between the two points.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, NamedTuple

import numpy as np

from tensegrity import check
from tensegrity.branches.arclength import TINY
from tensegrity.branches.table import INTERRUPTED
from tensegrity.checked import checked
from tensegrity.errors import TensegrityError
from tensegrity.typing import Array, Positive

Level = tuple[str, float, int | Callable[[Array], Array]]  # name, value, place or function

START_ITERATIONS = 50
BISECTIONS = 45  # that locate a bifurcation
INITIAL_ROWS = 256  # rows allocated at first
CHUNK = 16  # steps between two looks at the values of computed columns
SINGULAR = 1e-3  # singular value at a bifurcation over that at the row before, below which it is 0


class ContinuationError(TensegrityError):
    """A branch could not be followed; `branch` holds its points so far, or is None."""

    branch = None


@checked
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

    tolerance: Positive = 1e-6
    residual: Positive = 1e-12
    first: Positive = 1e-2
    smallest: Positive = 1e-10
    largest: Annotated[float, "> 0", "or inf"] = math.inf
    turn: Positive = 0.3
    points: Annotated[int, ">= 2"] = 20000

    def __post_init__(self) -> None:
        if self.smallest > min(self.first, self.largest):
            raise TensegrityError(
                f"smallest step {self.smallest:g} must be at most {min(self.first, self.largest):g}"
            )


class Located(NamedTuple):
    """A located point between two rows."""

    kind: str
    row: int  #: the last row before it, or at it
    point: Array  #: unknowns and tabulated values there
    note: str = ""
    multiplicity: int = 1  #: of a bifurcation


@dataclass
class Part:
    """A smooth part of a path.

    Attributes
    ----------
    data : ndarray, (rows, m + values)
        Unknowns, and tabulated values.
    tangent : ndarray, (rows, m)
        Unit tangents in scaled unknowns.
    arc, residual : ndarray, (rows,)
        Arc length from the start, in scaled unknowns, and largest scaled residual.
    events : list of Located
    end : str
        Kind of the last event, name of the column whose value is reached, or a failure.
    following : Problem or None
        The part that begins where this one ends.
    more : dict of str to ndarray, (rows, ..)
        What else was computed by row.
    """

    data: Array
    tangent: Array
    arc: Array
    residual: Array
    events: list[Located]
    end: str
    following: Any = None
    more: dict[str, Array] = field(default_factory=dict)

    def cut(self, event: Located, end: str) -> None:
        """End at an event, with it as the last row."""
        number = next(k for k, other in enumerate(self.events) if other is event)
        kept, beyond = range(event.row + 1), not np.array_equal(self.data[event.row], event.point)
        self.take([*kept, *[event.row] * beyond])
        self.data[-1] = event.point
        self.events = [*self.events[:number], event._replace(row=event.row + beyond)]
        self.end, self.following = end, None

    def take(self, rows: Any) -> None:
        """Keep some of the rows; those of events stay as they are."""
        for name in ("data", "tangent", "arc", "residual"):
            setattr(self, name, getattr(self, name)[rows])
        self.more = {name: column[rows] for name, column in self.more.items()}


def follow(
    stepper, start, parameters, settings, direction, stop,
    until: Sequence[Level] = (), at: Sequence[Level] = (),
) -> Part:  # fmt: skip
    """Follow the branch through a given point.

    Parameters
    ----------
    stepper : ArclengthStepper
    start : array_like, (m,)
        A point on or near the branch.
    parameters : array_like, (k,)
    settings : Settings
    direction : {1, -1}
        Initial sense of the last unknown; at a limit point, of the largest component.
    stop : collection of str
        Kinds of event at which the branch ends, with that event as its last row.
    until, at : sequence of (name, value, column), optional
        Values of columns, as `ArclengthStepper.locate` takes them, at which it ends, or which
        become events of that name.

    Returns
    -------
    Part

    Raises
    ------
    ContinuationError, KeyboardInterrupt
        As for `tensegrity.trace`; `part` holds the rows so far, or is None.
    """
    start, p = _checked(stepper, start, parameters, direction, stop)
    rows, events, end, failed = _follow(stepper, start, p, settings, direction, stop, until)
    if at:
        nodes = _nodes(stepper, rows, events)
        for name, value, column in at:
            events += [(name, *x) for x in _reached(stepper, column, value, nodes, p)]
        events.sort(key=lambda event: (event[1], _place(stepper, rows[event[1]], event[2])))
    part = _part(stepper, rows, events, end, p)
    if not failed:
        return part
    words = f"{end}; last good point {_formatted(stepper, rows[-1])}"
    failure: Any = KeyboardInterrupt() if end == INTERRUPTED else ContinuationError(words)
    failure.part = part
    raise failure


def _follow(stepper, start, p, settings, direction, stop, until):
    """Rows, events (kind, row, point), the kind of the last one or a failure, and whether it is a
    failure."""
    first = _first_point(stepper, start, p, settings, direction)
    names = "tolerance", "residual", "turn", "largest", "smallest"
    first_step = min(settings.first, settings.largest)
    control = np.array([first_step, *(getattr(settings, name) for name in names)])
    most, count = settings.points, 1
    rows = np.empty((min(INITIAL_ROWS, most), stepper.size))
    rows[0], rows[0, stepper.length] = first, control[0]  # the predictor needs a length
    tests = np.abs(first[stepper.tests :]) <= stepper.vanishing
    rows[0, stepper.tests :][tests] = 0.0  # its sign is that of the first step
    roots, vanishing = len(stepper.roots), np.flatnonzero(tests).tolist()
    events = [(stepper.kinds[i], 0, first) for i in vanishing if i < roots]
    folds = [i for i in vanishing if i >= roots]
    levels = [(column, value) for _, value, column in until if not callable(column)]
    computed = len(levels) < len(until)
    while count < most:
        if count == len(rows):
            rows = np.concatenate([rows, np.empty_like(rows)])[:most]
        last, room = count, count + CHUNK if computed else most
        try:
            count = stepper.steps(rows[:room], count, control, p, levels)
            found = _events_between(stepper, *rows[count - 2 : count], p) if count > last else []
        except KeyboardInterrupt:  # the events of a last step are not known
            return rows[: max(count - 1, last)], events, INTERRUPTED, True
        if count == last:
            return rows[:count], events, f"the step fell below {settings.smallest:g}", True
        if folds:
            events += _starting_folds(stepper, rows, folds, p)
            folds = []
        found, level = _until(stepper, until, rows, last, count, found, p)
        for kind, point in found:
            events.append((kind, count - 1 - (kind not in stop), point))
            if kind in stop:
                rows[count - 1] = _with_length(stepper, rows[count - 2], point)
                return rows[:count], events, kind, False
        if level:
            name, row, point = level
            rows[row + 1] = _with_length(stepper, rows[row], point)
            return rows[: row + 2], events, name, False
    return rows, events, f"{most} rows do not reach an end", True


def _place(stepper, row, point):
    """How far a point lies beyond a row, along its tangent."""
    m = stepper.m
    return float((point[:m] - row[:m]) @ row[m : 2 * m])


def _nodes(stepper, rows, events, first=0):
    """Numbers of rows, and rows, with the events between them, at which a column may turn."""
    inside = [(row, point) for kind, row, point in events if kind in stepper.kinds]
    inside = [(row, point) for row, point in inside if row < first + len(rows) - 1]
    if not inside:
        return range(first, first + len(rows)), rows
    listed = [*enumerate(rows, first), *inside]
    listed.sort(key=lambda one: one[0])  # a row stands before the events beyond it
    return [row for row, _ in listed], np.array([point for _, point in listed])


def _until(stepper, until, rows, last, count, found, p):
    """The events before the first value that is reached since row `last` - 1, and its name, row and
    point; all events, and None, if none is."""
    if not until:
        return found, None
    events = [(kind, count - 2, point) for kind, point in found]
    nodes = _nodes(stepper, rows[last - 1 : count], events, last - 1)
    reached = [
        (name, *point)
        for name, value, column in until
        for point in _reached(stepper, column, value, nodes, p, first=True)
    ]

    def order(row, point):
        return row, _place(stepper, rows[row], point)

    level = min(reached, key=lambda x: order(*x[1:]), default=None)
    if level:
        found = [x for x in found if order(count - 2, x[1]) < order(*level[1:])]
    return found, level


def _reached(stepper, column, value, nodes, p, first=False):
    """The points (row, point) at which a column has a value: the first one beyond the start alone,
    or all."""
    numbers, nodes = nodes
    away = stepper.column(nodes, column) - value
    crossed = (away[:-1] * away[1:] < 0) | (away[1:] == 0)
    if not first and away[0] == 0:
        yield numbers[0], nodes[0]
    for k in np.flatnonzero(crossed).tolist()[: 1 if first else None]:
        start, end = nodes[k], _with_length(stepper, nodes[k], nodes[k + 1])
        ends = float(away[k]), float(away[k + 1])
        yield (
            numbers[k],
            end if ends[1] == 0 else stepper.locate(start, end, column, value, ends, p),
        )


def _checked(stepper, start, parameters, direction, stop):
    p = check.floats("parameters", parameters).ravel()
    start = check.floats("start", start).ravel()
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
    roots = len(stepper.roots)
    signs, tests = before[stepper.tests :].tolist(), here[stepper.tests :].tolist()
    crossed = [i for i, test in enumerate(tests) if signs[i] * test < 0]

    def event(i, start, end):
        place = stepper.tests + i
        ends = float(start[place]) or signs[i] * TINY, float(end[place])
        return stepper.kinds[i], stepper.locate(start, end, place, 0.0, ends, p)

    def ordered(events):
        return sorted(events, key=lambda event: _place(stepper, before, event[1]))

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


def _part(stepper, rows, events, end, p):
    m, count = stepper.m, len(rows)
    data = stepper.data(np.concatenate([rows, *(point[None] for _, _, point in events)]))
    located = [
        Located(kind, row, at, multiplicity=_multiplicity(stepper, rows[row], point, p))
        if kind == "bifurcation"
        else Located(kind, row, at)
        for (kind, row, point), at in zip(events, data[count:], strict=True)
    ]
    rows[0, stepper.length] = 0.0
    arc = np.add.accumulate(rows[:, stepper.length])
    tangent, residual = rows[:, m : 2 * m].copy(), rows[:, stepper.residual].copy()
    return Part(data[:count], tangent, arc, residual, located, end)


def _multiplicity(stepper, before, point, p):
    """How many tangents the branch through a point has besides its own: singular values of the
    Jacobian that vanish there, compared with the row before."""
    here, there = (
        np.linalg.svd(stepper.linearised(x[: stepper.m], p)[1], compute_uv=False)
        for x in (point, before)
    )
    return max(1, int(np.sum(here < SINGULAR * there)))
