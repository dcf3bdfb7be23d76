"""A problem: equations of a path, the events on it, and where it starts; and its path, `trace`.

A path consists of smooth parts, each of which is a problem of its own, and is followed in arc
length (`continuation`).  Prisms, structures and orbits give their problems; others are made of
CasADi expressions, which are compiled, or of plain functions.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Protocol, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.branches.continuation import ContinuationError, Part, Settings, follow
from tensegrity.branches.steppers import CompiledStepper, ManyProblem, PlainEquations
from tensegrity.branches.table import Branch, Event, Table
from tensegrity.engine.disk_cache import cached, maker
from tensegrity.errors import TensegrityError
from tensegrity.once import once
from tensegrity.typing import Array

FIRST = "first "  # before the kind of an event at which a path ends
PLAIN = Settings()
_Path = TypeVar("_Path", covariant=True)


class Traced(Protocol[_Path]):
    """What `trace` follows, by the kind of table that it makes."""

    def table(self, path: Joined) -> _Path:
        """See `Problem.table`."""


class Joined:
    """Columns and events of parts, of which each begins at the last row of the one before.

    Attributes
    ----------
    columns : dict of str to ndarray, (rows, ..)
    events : list of Event
    end, begin : str
        Why the path ends, and why what precedes its start does.
    """

    columns: dict[str, Array]
    end = begin = ""

    def __init__(self) -> None:
        self.parts: list[dict[str, Array]] = []
        self.events: list[Event] = []
        self.rows = 0

    def add(self, problem: Any, part: Part, skip: int) -> None:
        """Join a part.

        Parameters
        ----------
        problem : Problem
        part : Part
        skip : int
            Number of its first rows that are there already.
        """
        first = self.rows - skip
        for kind, row, point, note, multiplicity in part.events:
            at = {name: float(x[0]) for name, x in problem.measure(point[None]).items()}
            self.events.append(Event(kind, row + first, at, note, multiplicity=multiplicity))
        if skip:
            part.take(slice(skip, None))
        self.parts.append(problem.measure(part.data) | problem.rows(part))
        self.rows += len(part.data)

    def ended(self, end: str) -> Self:
        """With joined columns, and the end."""
        first, *more = self.parts
        self.end = end
        self.columns = {n: np.concatenate([x, *(y[n] for y in more)]) for n, x in first.items()}
        return self

    def reversed(self) -> Joined:
        """In the other sense, without the start, which becomes the last row."""
        new = Joined()
        new.begin, new.rows = self.end, self.rows - 1
        new.parts = [{name: column[:0:-1] for name, column in self.columns.items()}]
        for event in self.events[::-1]:
            name, value = next(iter(event.at.items()))
            before = self.columns[name][event.row] != value  # not at a row, but beyond it
            if event.row > 0:
                new.events.append(replace(event, row=new.rows - event.row - before))
        return new


@dataclass(frozen=True, eq=False)
class Problem:
    """Equations of a path with one unknown more than equations, and the events on it.

    Attributes
    ----------
    unknowns : dict of str to casadi.SX, or sequence of str
        Names of the m unknowns, with their symbols where what follows are expressions of them;
        without symbols equations, events and columns are functions of an array of the unknowns,
        (m,).  The last unknown sets the direction at the start.
    equations : casadi.SX or list of m - 1 of them, or callable (m,) -> (m - 1,)
        What vanishes along the path.  The derivatives of functions are differences of order 4.
    start : array_like, (m,)
        A point on or near the path.
    p : casadi.SX, (k,), optional
        Symbols of numbers that may change without compiling again.
    parameters : array_like, (k,)
        Their values.
    scale : sequence of float, (m,), optional
        Typical magnitudes of the unknowns, which may have different units; 1 by default.  Arc
        length is that of asinh(unknown/scale), so that unknowns above their scale count by relative
        changes and forces may grow by orders of magnitude along the branch.
    size : as `equations`, (m - 1,), optional
        Magnitude of the terms of each equation, by which its residual is divided; 1 by default.
    events : dict of str to casadi.SX or callable
        What vanishes at an event.
    folds : dict of str to casadi.SX, or to the name of an unknown
        What is stationary along the path at an event; by default "fold", of the last unknown.
    columns : dict of str to casadi.SX or callable
        What is tabulated besides the unknowns.
    stop : collection of str
        Kinds of event at which the path ends.
    until : dict of str to float
        Values of columns at which the path ends.
    direction : {1, -1}
        Initial sense of the last unknown; at a limit point, of the largest component.
    settings : Settings
        Tolerances; see `tensegrity.branches.continuation`.

    Raises
    ------
    TensegrityError
        If numbers of unknowns, equations and symbols do not suit one another.
    """

    unknowns: Any
    equations: Any
    start: ArrayLike = ()
    p: Any = None
    parameters: ArrayLike = ()
    scale: Any = None
    size: Any = None
    events: Mapping[str, Any] = field(default_factory=dict)
    folds: Any = None
    columns: Mapping[str, Any] = field(default_factory=dict)
    stop: Collection[str] = ()
    until: Mapping[str, Any] = field(default_factory=dict)
    direction: int = 1
    settings: Settings = PLAIN
    before = None  # the problem of the rows that precede the start, in the other sense

    def __post_init__(self) -> None:
        names = check.sequence("unknowns", self.unknowns, "names")
        if not all(isinstance(name, str) for name in names) or not 0 < len({*names}) == len(names):
            raise TensegrityError(f"unknowns {check.shown(self.unknowns)} must be different names")
        given: dict[str, Any] = self.__dict__
        for name in ("events", "columns", "until"):
            check.kind(name, given[name], Mapping)
        check.kind("settings", self.settings, Settings)
        m, symbolic = len(names), isinstance(self.unknowns, Mapping)
        if symbolic:
            import casadi as ca

            given["p"] = ca.SX.sym("p", 0) if self.p is None else ca.SX(self.p)
            for name in ("equations", "size"):
                if isinstance(given[name], (list, tuple)):
                    given[name] = ca.vertcat(*given[name])
            n, symbols = ca.SX(self.equations).numel(), self.z.numel()
            if symbols != m or n != m - 1:
                raise TensegrityError(
                    f"{n} equations and {symbols} symbols do not suit {m} unknowns, "
                    f"must be {m - 1} and {m}"
                )
            _refuse_other_symbols(self)
        elif not callable(self.equations):
            raise TensegrityError(
                f"equations {check.shown(self.equations)} of unknowns without symbols must be a "
                "function of an array"
            )
        scale = check.vector("scale", np.ones(m) if self.scale is None else self.scale, (m,))
        pairs = zip(names, scale.tolist(), strict=True)
        given["scale"] = tuple(check.number(f"scale of {name}", s, above=0) for name, s in pairs)
        if self.folds is None:
            given["folds"] = {"fold": self.z[m - 1] if symbolic else names[-1]}
        make = (lambda: CompiledStepper(self, _layout(self))) if symbolic else (
            lambda: ManyProblem(PlainEquations(self))
        )  # fmt: skip
        given["_build_stepper"] = once(make)

    @property
    def z(self) -> Any:
        """Symbols of the unknowns, (m,)."""
        import casadi as ca

        for name, symbol in self.unknowns.items():
            check.kind(f"unknown {name}", symbol, ca.SX)
        return ca.vertcat(*self.unknowns.values())

    @property
    def _stepper(self) -> Any:
        return self._build_stepper()  # type: ignore[attr-defined]

    def changed(self, **fields: Any) -> Self:
        """A copy with other values of some fields, but not of those of which compiled functions are
        made: these are shared."""
        new = object.__new__(type(self))
        new.__dict__.update(self.__dict__, **fields)
        return new

    # what a path is made of, which prisms, structures and orbits replace

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns of numbers."""
        return (*self.unknowns, *self.columns)

    def followed(self, until: Mapping[str, Any], at: Mapping[str, Any]) -> Part:
        """The smooth part of the path that begins at the start.

        Parameters
        ----------
        until, at : dict of str to float or sequence of float
            Values of columns at which it ends, and of which it gives the places.

        Returns
        -------
        Part
        """
        until, at = (
            [
                (name, *self._column(name, value))
                for name, values in given.items()
                for value in ((values,) if isinstance(values, float) else np.ravel(values).tolist())
            ]
            for given in ({**self.until, **until}, at)
        )
        given = self.start, self.parameters, self.settings, self.direction, self.stop
        return follow(self._stepper, *given, until, at)

    def _column(self, name: str, value: float) -> tuple[float, Any]:
        """A value of a column, and the column, as `ArclengthStepper.locate` takes them."""
        stepper = self._stepper
        if name in stepper.names:
            place = stepper.names.index(name)
            return math.asinh(value / stepper.scale[place]), place
        if name in stepper.tabulated:
            return value, 2 * stepper.m + stepper.tabulated.index(name)
        return value, lambda data: self.measure(data)[name]

    def measure(self, data: Array) -> dict[str, Array]:
        """Columns of unknowns and tabulated values (rows, m + values)."""
        stepper = self._stepper
        columns = dict(zip((*stepper.names, *stepper.tabulated), data.T.copy(), strict=True))
        for name in () if isinstance(stepper, CompiledStepper) else self.columns:
            columns[name] = np.array([float(self.columns[name](u)) for u in data])
        return columns

    def rows(self, part: Part) -> dict[str, Array]:
        """What a table has by row besides the columns of `measure`."""
        z = part.data[:, : self._stepper.m]
        return {"z": z, "tangent": part.tangent, "arc": part.arc, "residual": part.residual}

    def table(self, path: Joined) -> Table:
        """The path as a table."""
        return Branch(path.columns, path.events, path.end)


def _refuse_other_symbols(problem: Problem) -> None:
    import casadi as ca

    known = {one.element_hash() for one in ca.symvar(ca.vertcat(problem.z, problem.p))}
    said = ca.vertcat(problem.equations, *problem.events.values(), *problem.columns.values())
    if free := [str(one) for one in ca.symvar(said) if one.element_hash() not in known]:
        raise TensegrityError(f"{', '.join(free)}: neither an unknown nor in p")


_COMPILED = ("unknowns", "equations", "p", "scale", "size", "events", "folds", "columns")


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
        self.__dict__.update(derived=derive, _build_stepper=build, until={})

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns of numbers, which are cached with the functions."""
        return (*self._stepper.names, *self._stepper.tabulated)


def _field_of(name: str) -> Any:
    return property(lambda self: getattr(self.derived(), name))


for _name in _COMPILED:
    setattr(DerivedProblem, _name, _field_of(_name))


def _layout(problem: Any) -> dict[str, Any]:
    """Names, scales and sizes of a problem, which a `CompiledStepper` needs besides functions."""
    return {
        "unknowns": list(problem.unknowns),
        "scale": list(problem.scale),
        "numbers": problem.p.numel(),
        "roots": list(problem.events),
        "folds": list(problem.folds),
        "values": list(problem.columns),
    }


def trace(
    problem: Traced[_Path],
    start: ArrayLike | None = None,
    parameters: ArrayLike | None = None,
    settings: Settings | None = None,
    direction: int | None = None,
    stop: Collection[str] | None = None,
    *,
    until: Mapping[str, Any] | str | None = None,
    at: Mapping[str, Any] | None = None,
) -> _Path:
    """Follow the path of a problem.

    Parameters
    ----------
    problem : Problem
    start, parameters, settings, direction, stop : optional
        In place of those of the problem.
    until : dict of str to float or sequence of float, or str, optional
        Values of columns at which the path ends, or the kind of event at whose first occurrence it
        does: {"load": 3.0}, "first slack".
    at : dict of str to float or sequence of float, optional
        Values of columns: each place where a column has one becomes an event of the column's name.
        What a column reaches and leaves again between two neighbouring rows is not seen.

    Returns
    -------
    Table
        It ends at the first event in `stop`, or a value in `until`, or where its problem does;
        bifurcations are events as well, with their multiplicity.  Bifurcations of a problem of
        one's own are those of odd multiplicity, where the bordered determinant changes its sign.
        Several threads may trace the same problem at once.

    Raises
    ------
    ContinuationError, KeyboardInterrupt
        If the start is not near a solution, the step falls below the smallest one, no end is
        reached within the number of rows, or after Ctrl-C; its `branch` holds the rows so far.
    TensegrityError
        If an argument does not suit the problem.

    Examples
    --------
    Two bars of half span 1 and rise 0.5 snap through under a load on the apex:

    >>> import casadi as ca
    >>> from tensegrity import Problem, trace
    >>> w, load = ca.SX.sym("w"), ca.SX.sym("load")
    >>> length, natural = ca.sqrt(1 + w**2), 1.25**0.5
    >>> balance = 2 * (natural - length) * w / length - load
    >>> truss = Problem({"w": w, "load": load}, balance, start=(0.5, 0.0), events={"flat": w})
    >>> path = trace(truss, until={"w": -0.5}, at={"load": 0.01})
    >>> [(event.kind, round(event.w, 6)) for event in path.events]
    [('load', 0.473288), ('fold', 0.27788), ('load', 0.04273), ('flat', 0.0), ('fold', -0.27788)]
    """
    check.kind("problem", problem, Problem)
    given: dict[str, Any] = {"start": start, "parameters": parameters, "settings": settings}
    given |= {"direction": direction, "stop": stop}
    of: Any = problem
    if settings is not None:
        check.kind("settings", settings, Settings)
    changes = {name: x for name, x in given.items() if x is not None}
    of = of.changed(**changes) if changes else of
    kind = until.removeprefix(FIRST) if isinstance(until, str) else None
    levels = _values("until", of, None if kind else until)
    wanted = _values("at", of, at)
    if kind and kind in of._stepper.kinds:
        of = of.changed(stop=(*of.stop, kind))
    joined = Joined()
    if of.before:
        begin = _followed(of.before, {}, wanted, None, joined)
        joined = joined.ended(begin).reversed()
    try:
        end = _followed(of, levels, wanted, kind, joined)
    except (ContinuationError, KeyboardInterrupt) as failure:
        error: Any = failure
        if joined.parts:
            error.branch = of.table(joined.ended("failed"))
        raise
    path: _Path = of.table(joined.ended(end))
    return path


def _values(what: str, problem: Problem, given: Any) -> dict[str, Any]:
    """Checked values of columns."""
    if given is None:
        return {}
    if not isinstance(given, Mapping) or not given:
        raise TensegrityError(f"{what} {check.shown(given)} must be a dict {{column: value}}")
    for name, values in given.items():
        if name not in problem.names:
            raise TensegrityError(
                f"{what}: column {check.shown(name)} is not one of {', '.join(problem.names)}"
            )
        check.finite(f"{what} {name}", check.floats(f"{what} {name}", values))
    return dict(given)


def _followed(problem: Any, until: Any, at: Any, kind: str | None, joined: Joined) -> str:
    """Why a path ends, whose parts are followed and joined to those before."""
    piece, skip = problem, 0
    while piece is not None:
        try:
            part = piece.followed(until, at)
        except (ContinuationError, KeyboardInterrupt) as failure:
            if (part := getattr(failure, "part", None)) is not None:
                joined.add(piece, part, skip)
            raise
        first = next((e for e in part.events if e.kind == kind), None)
        if first is not None:
            part.cut(first, f"the first {kind}")
        joined.add(piece, part, skip)
        piece, skip = part.following, 1
    reached = part.end in until or part.end in problem.until
    return f"the requested {part.end} is reached" if reached else str(part.end)
