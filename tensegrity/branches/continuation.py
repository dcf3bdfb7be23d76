"""Branches of g(z; p) = 0 with one unknown more than equations, followed by arc length.

Pseudo-arclength predictor-corrector (Keller 1977; Allgower & Georg 1990): a cubic through the
last two points and their tangents predicts, Newton's method bordered by the old tangent
corrects.  How far the predictor misses measures the fourth derivative of the branch, and so the
error of cubic interpolation between the rows: that sets the step.  A point counts only if the
residual is at round-off, the corrector moved little and the tangent turned little, else the step
is shortened; also where the bordered determinant changes its sign, as it does between a branch
and a neighbour that nearly meets it.  Folds are located on the extended system (Moore & Spence
1980), roots of user functions on the system bordered by them; interpolation only starts both.

A `Problem` is what is solved, `Settings` how, a `Branch` what came out.  The walk goes from event
to event; what is quiet between two takes one call where the steps are compiled (`follow.c`).  An
event function that changes its sign gives the interval; a guess on the cubic through both points
is polished on the extended system of the event, and bisection steps in where that fails.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check
from tensegrity.branches.arclength import Machine
from tensegrity.branches.table import Event, Table
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
ROOM = 256  # rows, at first


class ContinuationError(TensegrityError):
    """A branch could not be followed; `branch` holds the points found so far (or None)."""

    branch = None


@dataclass(frozen=True, eq=False)
class Problem:
    """Equations of a branch, as CasADi SX expressions of the same symbols.

    Attributes
    ----------
    unknowns : tuple of str
        Names of the m unknowns; the last is the parameter by which a start is held.
    z, p : casadi.SX, (m,), (k,)
        Symbols of the unknowns and of the numbers given at each trace.
    residual : casadi.SX, (m - 1,)
    scale : sequence of float, (m,), optional
        Sizes of the unknowns (metres, radians and newtons side by side).  Lengths are measured
        in asinh(unknown/scale): beyond its size an unknown counts by its relative change, so
        that forces may grow by orders of magnitude on the way.
    size : casadi.SX, (m - 1,), optional
        Size of the terms of each equation, by which its residual is judged; 1 by default.
    roots, folds : dict of str to casadi.SX
        Functions of (z, p): an event where one vanishes, an event where one is stationary along
        the branch.  By default the fold in the last unknown.
    values : dict of str to casadi.SX
        Functions of (z, p) to be tabulated beside the unknowns.
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

        object.__setattr__(self, "_made", once(lambda: Machine(self, _facts(self))))

    @property
    def _machine(self):
        return self._made()


class DerivedProblem(Problem):
    """A problem that a function derives, when its expressions are asked for.

    To trace it needs none of them, where its machine is kept (`tensegrity.engine.disk_cache`).

    Parameters
    ----------
    make : callable
        A function of a module, which gives a `Problem`.
    *arguments
        What it is called with; texts and numbers, which say all that the problem depends on.
    """

    def __init__(self, make: Callable[..., Problem], *arguments: Any) -> None:
        name = maker(make, *arguments)
        derive = once(lambda: make(*arguments))
        machine = once(lambda: Machine(self, cached(("problem", name), lambda: _facts(self)), name))
        self.__dict__.update(derived=derive, _made=machine)


def _field_of(name: str) -> Any:
    return property(lambda self: getattr(self.derived(), name))


for _field in fields(Problem):
    setattr(DerivedProblem, _field.name, _field_of(_field.name))


def _facts(problem):
    """What a `Machine` has to know of a problem besides its functions."""
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
    """How a branch is followed; lengths are in scaled unknowns.

    Attributes
    ----------
    tolerance : float
        Estimated error of cubic interpolation between rows.
    residual : float
        Largest scaled residual of a row.
    first, smallest, largest : float
        Steps.
    turn : float
        Largest angle between the tangents of neighbouring rows [rad].
    points : int
        Most rows.
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
    """A traced branch: a table of unknowns and values, with what the tracing knew.

    Attributes
    ----------
    z, tangent : ndarray, (rows, m)
        Unknowns, and unit tangents in scaled unknowns.
    arc : ndarray, (rows,)
        Length of the branch from its start, in scaled unknowns.
    residual : ndarray, (rows,)
        Largest scaled residual.
    """

    p: Any  # numbers it was traced with, where they were kept
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
    settings : Settings, optional
    direction : {1, -1}
        Sense in which the last unknown first goes; on a fold, that of the largest component.
    stop : collection of str
        Kinds of event at which to end; the last row is then that event.

    Returns
    -------
    Branch
        It ends at the first event in `stop`; simple bifurcations on the way are events too.
        Threads may trace the same problem at once.

    Raises
    ------
    ContinuationError
        If the start is not near a solution, the step falls below the smallest one or `points`
        rows do not reach an end; its `branch` holds the rows so far.
    """
    settings, machine = settings or Settings(), problem._machine
    start, p = _checked(machine, start, parameters, direction, stop)
    rows, events, end = _walked(machine, start, p, settings, direction, stop)
    branch = _branch(machine, rows, events, end if end in machine.kinds else "failed")
    if end not in machine.kinds:
        failure = ContinuationError(f"{end}; last good point {_shown(machine, rows[-1])}")
        failure.branch = branch
        raise failure
    return branch


def _walked(machine, start, p, settings, direction, stop):
    """Rows, events (kind, row, point) and the kind of event, or the failure, that ends them."""
    first = _first_point(machine, start, p, settings, direction)
    control = np.array(
        [
            min(settings.first, settings.largest),
            settings.tolerance,
            settings.residual,
            settings.turn,
            settings.largest,
            settings.smallest,
        ]
    )
    most, count, events, folds = settings.points, 1, [], []
    rows = np.empty((min(ROOM, most), machine.size))
    rows[0], rows[0, machine.length] = first, control[0]  # its length: the predictor has one
    for i, test in enumerate(first[machine.tests :].tolist()):
        if abs(test) <= machine.vanishing[i]:
            rows[0, machine.tests + i] = 0.0  # it gets a sign with the first step
            if i >= len(machine.roots):
                folds.append(i)
            else:
                events.append((machine.kinds[i], 0, first))
    while count < most:
        if count == len(rows):
            rows = np.concatenate([rows, np.empty_like(rows)])[:most]
        last, count = count, machine.steps(rows, count, control, p)
        if count == last:
            return rows[:count], events, f"the step fell below {settings.smallest:g}"
        if folds:
            events += _starting_folds(machine, rows, folds, p)
            folds = []
        before, here = rows[count - 2], rows[count - 1]
        for kind, point in _located(machine, before, here, p):
            events.append((kind, count - 1 - (kind not in stop), point))
            if kind in stop:
                here[:] = _measured(machine, before, point)
                return rows[:count], events, kind
    return rows, events, f"{most} rows do not reach an end"


def _checked(machine, start, parameters, direction, stop):
    p = np.asarray(parameters, dtype=float).ravel()
    start = np.asarray(start, dtype=float).ravel()
    m, k = machine.m, machine.numbers
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
        if kind not in machine.kinds:
            raise TensegrityError(f"stop {kind!r} is not among {machine.kinds}")
    return np.arcsinh(start / machine.scale), p


def _shown(machine, row):
    values = zip(machine.names, np.sinh(row[: machine.m]) * machine.scale, strict=True)
    return ", ".join(f"{name} {value:.9g}" for name, value in values)


def _first_point(machine, z, p, settings, direction):
    """Nearest solution by least-norm Newton steps, which work at a fold as elsewhere."""
    residual = math.nan
    for _ in range(START_ITERATIONS):
        move, tangent = machine.least_norm(z, p)
        moves = move.tolist()
        finite = math.isfinite(sum(moves))
        if not finite:
            break
        z = z - move
        if all(abs(x) <= 1e-15 * (1 + abs(at)) for x, at in zip(moves, z.tolist(), strict=True)):
            break
    if finite:
        lead = tangent[-1] if abs(tangent[-1]) > 1e-8 else tangent[np.argmax(np.abs(tangent))]
        point = machine.at(z, tangent if lead * direction > 0 else -tangent, p)
        residual = point[machine.residual]
    if not residual <= settings.residual:
        raise ContinuationError(
            f"no solution near the start: residual {residual:.3g} at {_shown(machine, z)} is "
            f"above {settings.residual:g}"
        )
    return point


def _starting_folds(machine, rows, folds, p):
    """Which of the folds that vanish at the first row are events: they change sign there."""
    here, control = rows[0].copy(), np.zeros(6)
    here[machine.length], control[0] = 1.0, -rows[1, machine.length]
    back = machine.advance(machine.before(here), here, control, p)
    places = [(machine.kinds[i], machine.tests + i) for i in folds]
    return [(kind, 0, rows[0].copy()) for kind, at in places if back[at] * rows[1, at] < 0]


def _located(machine, before, here, p):
    """Events between two points, in their order: (kind, point).

    A root may be passed twice in a step that holds a fold: the fold divides it.
    """
    m, roots = machine.m, len(machine.roots)
    signs, tests = before[machine.tests :].tolist(), here[machine.tests :].tolist()
    crossed = [i for i, test in enumerate(tests) if signs[i] * test < 0]

    def event(i, start, end):
        return machine.kinds[i], _locate(machine, start, end, i, signs[i], p)

    def place(one):
        return (one[1][:m] - before[:m]) @ before[m : 2 * m]

    def ordered(events):
        return sorted(events, key=place) if len(events) > 1 else events

    found = [event(i, before, here) for i in crossed if i >= roots]
    if not found:
        found = [event(i, before, here) for i in crossed]
    else:
        start = before
        for end in (*(fold for _, fold in ordered(found)), here):
            tests = end[machine.tests :].tolist()
            part = [i for i in range(roots) if signs[i] * tests[i] < 0]
            found += [event(i, start, _measured(machine, start, end)) for i in part]
            if end is not here:
                start, signs = end, [new or old for new, old in zip(tests, signs, strict=True)]
    if before[machine.side] * here[machine.side] < 0:
        found.append(("bifurcation", _bifurcation(machine, before, here, p)))
    return ordered(found)


def _measured(machine, start, end):
    """A point with its distance from another one as the length of the step to it."""
    end = end.copy()
    end[machine.length] = math.dist(start[: machine.m].tolist(), end[: machine.m].tolist())
    return end


def _locate(machine, before, here, number, sign, p):
    """The point where an event function vanishes between two points."""
    test = machine.tests + number
    low = 0.0, float(before[test]), before
    high = 1.0, float(here[test]), here
    for _ in range(BISECTIONS):
        part = low[0] + (high[0] - low[0]) * low[1] / (low[1] - high[1])
        ends = low[2], high[2]
        point = machine.approach(machine.kinds[number], before, here, part, ends, p)
        if point is not None:
            return point
        part = (low[0] + high[0]) / 2
        middle = machine.at(*machine.between(before, here, part), p)
        if middle[test] * sign > 0:
            low = part, float(middle[test]), middle
        else:
            high = part, float(middle[test]), middle
    machine.on_curve(middle, before, here)
    return middle


def _bifurcation(machine, before, here, p):
    """The point where the bordered determinant changes its sign between two points."""
    low, high = 0.0, 1.0
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        point = machine.at(*machine.between(before, here, middle), p)
        if point[machine.side] * before[machine.side] > 0:
            low = middle
        else:
            high = middle
    return point


def _branch(machine, rows, events, end):
    m, count = machine.m, len(rows)
    names, values = (*machine.names, *machine.tabulated), machine.residual
    data = np.concatenate([rows, *(point[None] for _, _, point in events)])
    table = data[:, m:values].copy()
    table[:, :m] = np.sinh(data[:, :m]) * machine.scale  # in the place of tangents
    listed = [
        Event(kind, row, dict(zip(names, at, strict=True)))
        for (kind, row, _), at in zip(events, table[count:].tolist(), strict=True)
    ]
    columns = dict(zip(names, table[:count].T.copy(), strict=True))
    rows[0, machine.length] = 0.0
    arc = np.add.accumulate(rows[:, machine.length])
    z, tangent, residual = table[:count, :m], rows[:, m : 2 * m].copy(), rows[:, values]
    return Branch(columns, listed, end, z, tangent, arc, residual)
