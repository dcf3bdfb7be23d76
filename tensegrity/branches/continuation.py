"""Branches of g(z; p) = 0 with one unknown more than equations, followed by arc length.

Pseudo-arclength predictor-corrector (Keller 1977; Allgower & Georg 1990): a cubic through the
last two points and their tangents predicts, Newton's method bordered by the old tangent
corrects.  How far the predictor misses measures the fourth derivative of the branch, and so the
error of cubic interpolation between the rows: that sets the step.  A point counts only if the
residual is at round-off, the corrector moved little and the tangent turned little, else the step
is shortened; also where the bordered determinant changes its sign, as it does between a branch
and a neighbour that nearly meets it.  Folds are located on the extended system (Moore & Spence
1980), roots of user functions on the system bordered by them; interpolation only starts both.

A `Problem` is what is solved, `Settings` how, a `Branch` what came out.  Where there is a
compiler all of it runs in one call of `follow.c`; without one, `_walked` does the same.
"""

from __future__ import annotations

import contextlib
import math
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check
from tensegrity.branches.arclength import (
    SETTLED,
    START_ITERATIONS,
    TINY,
    TWINS,
    Machine,
    virtual_start,
)
from tensegrity.branches.events import leave_start, located
from tensegrity.branches.following import MANY, SHORT, followed
from tensegrity.branches.table import Event, Table
from tensegrity.engine.kept import kept, maker
from tensegrity.errors import CompilerError, TensegrityError
from tensegrity.once import once

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Mapping
    from typing import Any

    from numpy.typing import ArrayLike

    from tensegrity.branches.many import ManyProblem
    from tensegrity.typing import Array


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

    To trace it needs none of them, where its machine is kept (`tensegrity.engine.kept`).

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
        machine = once(lambda: Machine(self, kept(("problem", name), lambda: _facts(self)), name))
        self.__dict__.update(derived=derive, _made=machine)


def _asked(name: str) -> Any:
    return property(lambda self: getattr(self.derived(), name))


for _field in fields(Problem):
    setattr(DerivedProblem, _field.name, _asked(_field.name))


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

    def __getitem__(self, key: Any) -> Any:
        part = super().__getitem__(key)
        if isinstance(key, slice):
            for name in ("z", "tangent", "arc", "residual"):
                setattr(part, name, getattr(self, name)[key])
        return part


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
    rows, found, listed, end = _follow(machine, start, p, settings, direction, stop)
    branch = _branch(machine, rows, found, listed, end if end in machine.kinds else "failed")
    if end not in machine.kinds:
        failure = ContinuationError(f"{end}; last good point {_shown(machine, rows[-1])}")
        failure.branch = branch
        raise failure
    return branch


def _follow(machine, start, p, settings, direction, stop):
    if machine.library:
        with contextlib.suppress(CompilerError):
            found = followed(machine, start, p, settings, direction, stop)
            if found:
                return found
    return _walked(machine, start, p, settings, direction, stop)


def _walked(machine, start, p, settings, direction, stop):
    """What `followed` gives, in Python."""
    here = _first_point(machine, start, p, settings, direction)
    step = min(settings.first, settings.largest)
    rows, events, end = [here], [], ""
    before, here = virtual_start(here, step), replace(here, length=step)
    signs = here.tests
    while not end:
        if len(rows) >= settings.points:
            end = MANY.format(settings.points)
            break
        point, step = _step(machine, before, here, step, p, settings)
        if point is None:
            end = SHORT.format(settings.smallest)
            break
        before, here = here, point
        if len(rows) == 1:
            signs = leave_start(machine, rows[0], here, p, events)
        for kind, point in located(machine, before, here, signs, p):
            events.append((kind, len(rows) - (kind not in stop), point))
            if kind in stop:
                here, end = point, kind
                break
        rows.append(here)
        signs = [new or old for new, old in zip(here.tests, signs, strict=True)]
    found = np.array([point.numbers for _, _, point in events]).reshape(-1, machine.size)
    listed = [(kind, row) for kind, row, _ in events]
    return np.array([point.numbers for point in rows]), found, listed, end


def _checked(machine, start, parameters, direction, stop):
    p = np.asarray(parameters, dtype=float).ravel()
    start = np.asarray(start, dtype=float).ravel()
    m, k = machine.m, machine.numbers
    if p.size != k or start.size != m:
        raise TensegrityError(
            f"{start.size} start values and {p.size} parameters do not suit the problem, must be "
            f"{m} and {k}"
        )
    if not np.isfinite(start).all() or np.isnan(p).any():
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
    for _ in range(START_ITERATIONS):
        g, jacobian = machine.linearised(z, p)
        finite = np.isfinite(g).all() and np.isfinite(jacobian).all()
        if not finite:
            break
        left, sizes, right = np.linalg.svd(jacobian)
        kept = sizes > 1e-15 * sizes[0]
        move = ((g @ left)[kept] / sizes[kept]) @ right[:-1][kept]
        tangent, z = right[-1], z - move
        if (np.abs(move) <= 1e-15 * (1 + np.abs(z))).all():
            break
    residual = math.nan
    if finite:
        lead = tangent[-1] if abs(tangent[-1]) > 1e-8 else tangent[np.argmax(np.abs(tangent))]
        point = machine.at(z, tangent if lead * direction > 0 else -tangent, p)
        residual = point.residual
    if not residual <= settings.residual:
        raise ContinuationError(
            f"no solution near the start: residual {residual:.3g} at {_shown(machine, z)} is "
            f"above {settings.residual:g}"
        )
    return point


def _step(machine, before, here, step, p, settings):
    """The next point and the step to try after it; shorter steps until one is good."""
    while step >= settings.smallest:
        point, (error, moved, last, cosine) = machine.advance(before, here, step, p)
        turned = math.acos(min(cosine, 1.0)) if cosine > 0 else math.inf
        good = (
            point.residual <= settings.residual
            and last <= SETTLED
            and moved <= step / 2
            and turned <= settings.turn
            and error <= settings.tolerance
            and (point.side * here.side > 0 or step <= TWINS)
        )
        wanted = 0.9 * (settings.tolerance / (error + TINY)) ** 0.25
        wanted = min(wanted, 0.8 * settings.turn / (turned + TINY))
        if good:
            return point, min(step * min(max(wanted, 0.3), 2.0), settings.largest)
        step *= min(max(wanted, 0.1), 0.5) if wanted == wanted else 0.5
    return None, step


def _branch(machine, rows, found, events, end):
    m, count = machine.m, len(rows)
    names, values = (*machine.names, *machine.tabulated), machine.judged
    data = np.concatenate([rows, found])
    z = np.sinh(data[:, :m]) * machine.scale
    table = np.hstack([z, data[:, 2 * m : values]])
    listed = [
        Event(kind, row, dict(zip(names, at, strict=True)))
        for (kind, row), at in zip(events, table[count:].tolist(), strict=True)
    ]
    columns = dict(zip(names, table[:count].T.copy(), strict=True))
    arc = np.concatenate([[0.0], np.cumsum(rows[1:, values + 1])])
    return Branch(columns, listed, end, z[:count], rows[:, m : 2 * m].copy(), arc, rows[:, values])
