"""The problem that a unit under load poses, and its equilibrium path as a table.

The unknowns are changes from rest of the inner coordinates, of the tensions of stiff members and,
last, of the controlled coordinate.  Strings carry tension only: where one reaches its natural
length a new part of the path begins, with it slack, or taut again.
"""

from __future__ import annotations

import math
from copy import copy
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from tensegrity import check
from tensegrity.branches.continuation import ContinuationError, Part, Settings
from tensegrity.branches.problem import Joined, Problem
from tensegrity.branches.table import Table
from tensegrity.engine.compiled import Functions
from tensegrity.once import once
from tensegrity.printing import Lines
from tensegrity.unit import rest as at_rest
from tensegrity.unit.forms import Mixed, changes, is_stiff, mixed, numbers
from tensegrity.unit.rest import Described

if TYPE_CHECKING:
    from collections.abc import Mapping

    from tensegrity.typing import Array, Flags

SETTINGS = Settings(tolerance=1e-8, largest=0.05)
LEAST = 1e-2  # of the largest force of a member that is no unknown: that of residuals where
# nothing is stressed, above the round-off of these members
CRITICAL = 1e-9  # tension over the scale of forces, below which a string is at its natural length
NEARBY = 1e-6  # step in scaled unknowns that shows whether a string shortens
MOST_CHANGES = 50  # of strings along a path
NEGATIVE = 1e-12  # eigenvalue over the largest, below which it counts as negative


class UnitPath(Table):
    """Equilibria of a unit as a table, from the rest into compression.

    If the tension side was requested, its states precede the rest.

    Attributes
    ----------
    load, energy : ndarray, (rows,)
        Load on the controlled coordinate [N], compression > 0, and energy above the rest [J].
    tension_0, .. : ndarray, (rows,)
        Tension of one of each of the members [N].
    stable_load, stable_NAME : ndarray of bool, (rows,)
        Whether the equilibrium is stable under given load, and at given controlled coordinate NAME.
    events : tuple of Event
        The kinds are "fold" (limit point in load), "turn" (in the controlled coordinate), "slack"
        and "taut" of strings, "bifurcation", the unit's own, and names of columns given in `at`.
        Each has the columns as attributes, the coordinates by their names.
    unit : Unit
    """

    unit: Described
    load: Array
    energy: Array
    stable_load: Flags
    _units: ClassVar = {"load": "N", "energy": "J"}

    def _lines(self) -> Lines:
        yield "equilibria of a unit"
        yield from (f"  {line}" for line in super()._lines())


class UnitProblem(Problem):
    """Equilibria of a unit from its rest, or where strings have gone slack or taut, in one sense.

    Parameters
    ----------
    unit : Unit
    direction : {-1, 1}
        Initial sense of the controlled coordinate.
    until : dict of str to float
        Values of columns at which the path ends.
    before : UnitProblem, optional
        The tension side.
    """

    unit: Described
    taut: tuple[bool, ...]
    leaving: tuple[int, ...] = ()  # strings that have just changed
    changes = 0  # of strings before

    def __init__(
        self, unit: Described, direction: int, until: Mapping[str, float], before: Any = None
    ) -> None:
        made, taut = equations(unit), (True,) * len(unit.members)
        self.__dict__.update(made.__dict__)
        until = {name: x for name, x in until.items() if math.isfinite(x)}
        self.__dict__.update(
            unit=unit, direction=direction, until=until, before=before, taut=taut,
            parameters=numbers(unit), start=np.zeros(len(made.unknowns)), settings=SETTINGS,
            stop=tuple(_strings(unit)),
        )  # fmt: skip

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns of numbers."""
        return tuple(self.columns)

    @property
    def _stepper(self) -> Any:
        stepper = copy(super()._stepper)
        if self.leaving:
            stepper.vanishing = list(stepper.vanishing)
            for number in self.leaving:
                stepper.vanishing[list(_strings(self.unit).values()).index(number)] = math.inf
        return stepper

    def followed(self, until: Mapping[str, Any], at: Mapping[str, Any]) -> Part:
        """See `Problem.followed`; a string at its natural length begins the next part."""
        part = super().followed(until, at)
        columns = len(self.unknowns) + list(self.columns).index(str(self.unit.control))
        if not np.any(self.start):
            part.data[0, columns + 1] = 0.0  # the load at rest
        strings = _strings(self.unit)
        kinds = {name: "slack" if self.taut[k] else "taut" for name, k in strings.items()}
        if part.end in strings:
            if self.changes == MOST_CHANGES:
                raise ContinuationError(f"{MOST_CHANGES} changes of strings do not reach an end")
            part.following = self._switched(part.data[-1, : len(self.unknowns)])
            part.end = kinds[part.end]
        begun = (e for e in part.events if e.row or e.kind not in strings)
        part.events = [e._replace(kind=kinds.get(e.kind, e.kind)) for e in begun]
        return part

    def _switched(self, z: Array) -> UnitProblem:
        """The part that begins at z, with the strings that are at their natural length in their
        other state."""
        row = super()._stepper.corrected(*self._scaled(z), np.asarray(self.parameters))
        tensions = np.abs(row[super()._stepper.tests :][: len(_strings(self.unit))])
        least = max(CRITICAL * _force(self.unit), float(tensions.min()))
        leaving = self._critical(tensions <= least)
        taut = tuple(one != (k in leaving) for k, one in enumerate(self.taut))
        new = self.changed(parameters=numbers(self.unit, taut), start=z, taut=taut,
                           leaving=leaving, before=None, changes=self.changes + 1)  # fmt: skip
        lengthens = new._rates(leaving[0])
        return new.changed(direction=1 if (lengthens > 0) == taut[leaving[0]] else -1)

    def _critical(self, which: Flags) -> tuple[int, ...]:
        """Numbers of some of the strings among the members."""
        strings = _strings(self.unit).values()
        return tuple(k for k, one in zip(strings, which.tolist(), strict=True) if one)

    def _scaled(self, z: Array) -> tuple[Array, Array]:
        """Scaled unknowns of a point, and a direction for the corrector."""
        return np.arcsinh(z / super()._stepper.scale), np.eye(len(z))[-1]

    def _rates(self, string: int) -> float:
        """Change of the tension of a string at the start, were it taut, for a small step by which
        the controlled coordinate grows."""
        stepper, p = super()._stepper, np.asarray(self.parameters)
        z, _ = self._scaled(np.asarray(self.start))
        tangent = np.linalg.svd(stepper.linearised(z, p)[1])[2][-1]
        lead = tangent[-1] if abs(tangent[-1]) > 1e-8 else tangent[np.argmax(np.abs(tangent))]
        tangent = tangent * np.sign(lead)
        place = stepper.tests + [*_strings(self.unit).values()].index(string)
        ends = [stepper.corrected(z + x * tangent, tangent, p)[place] for x in (-NEARBY, NEARBY)]
        return float(ends[1] - ends[0])

    def _begun(self) -> UnitProblem:
        """The same problem with those strings slack that are unstressed at rest and shorten."""
        tensions = [float(x) for x in at_rest.at_rest(self.unit).tensions]
        loose = CRITICAL * _force(self.unit)
        critical = tuple(k for k in _strings(self.unit).values() if abs(tensions[k]) <= loose)
        new = self.changed(leaving=critical)
        for k in critical:
            if new._rates(k) * self.direction < 0:
                taut = tuple(one and j != k for j, one in enumerate(new.taut))
                new = new.changed(taut=taut, parameters=numbers(self.unit, taut))
        return new

    def measure(self, data: Array) -> dict[str, Array]:
        """See `Problem.measure`; slack strings have no tension."""
        columns = dict(zip(self.columns, data[:, len(self.unknowns) :].T.copy(), strict=True))
        for k, taut in enumerate(self.taut):
            if not taut:
                columns[f"tension_{k}"][:] = 0.0
        columns["load"] += 0.0  # no negative zero
        return columns

    def rows(self, part: Part) -> dict[str, Any]:
        """See `Problem.rows`."""
        z = part.data[:, : len(self.unknowns)]
        by_load, by_control = stable(self.unit, z, np.asarray(self.parameters))
        return {"stable_load": by_load, f"stable_{self.unit.control}": by_control}

    def table(self, path: Joined) -> UnitPath:
        """See `Problem.table`."""
        return UnitPath(path.columns, path.events, path.end, unit=self.unit)


def unit_problem(
    unit: Described, min_height: float | None, max_load: float, max_height: float | None
) -> UnitProblem:
    """The problem of a unit.

    Parameters
    ----------
    unit, min_height, max_load, max_height
        See `Unit.problem`.

    Returns
    -------
    UnitProblem
    """
    at_rest.check_inner(unit)
    name, start = str(unit.control), at_rest.coordinates(unit)[-1]
    lowest = 0.0 if start > 0 else -math.inf
    if min_height is not None:
        lowest = check.number("min_height", min_height, below=start)
    above = None
    if max_height is not None:
        highest = check.number("max_height", max_height, above=start)
        above = UnitProblem(unit, 1, {name: highest})._begun()
    return UnitProblem(unit, -1, {"load": max_load, name: lowest}, above)._begun()


def stable(unit: Described, z: Array, p: Array) -> tuple[Flags, Flags]:
    """Whether equilibria are stable under given load, and at given controlled coordinate.

    Parameters
    ----------
    unit : Unit
    z : ndarray, (rows, unknowns)
        Unknowns of the path.
    p : ndarray, (parameters,)

    Returns
    -------
    tuple of two ndarrays of bool, (rows,)
    """
    matrices = functions(unit)("tangent", z, p)
    return few_unstable(matrices, sum(is_stiff(unit)))


def few_unstable(matrices: Array, most: int) -> tuple[Flags, Flags]:
    """Whether matrices have at most so many negative eigenvalues, and those without the last row
    and column, the tensions being multipliers; (rows, size^2)."""
    size = math.isqrt(matrices.shape[1])
    matrices = matrices.reshape(-1, size, size)

    def few(part: Array) -> Flags:
        if not part.shape[1]:
            return np.ones(len(part), dtype=bool)
        scale = 1 / np.sqrt(np.maximum(np.abs(part).max(axis=2), 1e-300))
        found = np.linalg.eigvalsh(part * scale[:, None] * scale[..., None])
        return np.asarray((found < -NEGATIVE).sum(axis=1) <= most)

    by_load = few(matrices)
    by_control = by_load.copy()  # of fewer motions not more are unstable
    if not by_load.all():
        by_control[~by_load] = few(matrices[~by_load, :-1, :-1])
    return by_load, by_control


@once
def functions(unit: Described) -> Functions:
    """Compiled functions of the unknowns of a path and parameters: "gradient" and "tangent",
    derivatives of the mixed energy by all of them, "tensions" and "energy"."""

    def make() -> dict[str, Any]:
        import casadi as ca

        of, x = mixed(unit, (unit.control,)), ca.SX.sym("x", len(equations(unit).unknowns))
        z = ca.vertcat(of.z, of.h)
        matrix, gradient = ca.hessian(of.energy, z)
        forms = {"gradient": gradient, "tangent": ca.vec(matrix), "tensions": of.tensions}
        forms["energy"] = of.energy
        return {
            name: ca.Function(name, [x, of.p], [ca.substitute(ca.densify(form), z, x)])
            for name, form in forms.items()
        }

    return Functions(None, make)


@once
def equations(unit: Described, reduced: bool = False) -> Problem:
    """The problem of a unit, whose expressions are compiled once, as a plain `Problem`.

    Parameters
    ----------
    unit : Unit
    reduced : bool, optional
        See `forms.mixed_of`.
    """
    import casadi as ca

    of, q, stiff = mixed(unit, (unit.control,), reduced), unit.coordinates, sum(is_stiff(unit))
    names = [f"change of {q[k]}" for k in of.free]
    names += [f"change of tension_{k}" for k, one in enumerate(of.stiff) if one]
    z = [*ca.vertsplit(of.z), of.h] if of.z.numel() else [of.h]
    *inner, control = (x + of.changes[k] for k, x in enumerate(at_rest.coordinates(unit)))
    columns = {str(unit.control): control, "load": of.loads}
    columns |= dict(zip(map(str, unit.inner), inner, strict=True)) | {"energy": of.energy}
    columns |= {f"tension_{k}": of.tensions[k] for k in range(len(unit.members))}
    *scale, last = (_scale(unit, k) for k in (*of.free, len(q) - 1))
    events = {name: of.tensions[k] for name, k in _strings(unit).items()}
    return Problem(
        dict(zip([*names, f"change of {unit.control}"], z, strict=True)),
        of.equations,
        p=of.p,
        scale=[*scale, *[_power(_force(unit))] * stiff, last],
        size=ca.vertcat(*_sizes(unit, of)),
        events=events | {name: _at(unit, of, x) for name, x in unit.events.items()},
        folds={"fold": of.loads, "turn": of.h},
        columns=columns,
    )


def _sizes(unit: Described, of: Mixed) -> list[Any]:
    """Magnitude of the terms of each equation: forces, and lengths of stiff members."""
    import sympy as sp

    rest, whole = at_rest.at_rest(unit), _length(unit)
    soft = [float(k) for k, one in zip(rest.stiffness, of.stiff, strict=True) if not one]
    least = LEAST * max(_force(unit), *(k * whole for k in soft), 0.0)
    bent = at_rest.values(unit, [sp.diff(unit.energy, x, 2) for x in unit.inner])
    sizes = [of.sizes[k] + least + abs(float(x)) * _scale(unit, k) for k, x in enumerate(bent)]
    count = at_rest.values(unit, [m.count for m in unit.members])
    tense = [k for k, one in enumerate(of.stiff) if one and k not in of.eliminated]
    lengths = [max(abs(float(rest.lengths[k])), LEAST * whole) for k in tense]
    return sizes + [float(count[k]) * x for k, x in zip(tense, lengths, strict=True)]


def _strings(unit: Described) -> dict[str, int]:
    """Names of the events of strings, and the numbers of these among the members."""
    return {f"string {k}": k for k, member in enumerate(unit.members) if member.string}


def _at(unit: Described, of: Mixed, expression: Any) -> Any:
    """An expression of the coordinates in CasADi."""
    from tensegrity.engine.law import to_casadi

    values = [x + of.changes[k] for k, x in enumerate(at_rest.coordinates(unit))]
    numbers = {s: x for s, x in unit.parameters.items()}
    return to_casadi(expression.xreplace(numbers), unit.coordinates)(*values)


def _power(size: float) -> float:
    """The power of 2 next to a size, so that what is compiled serves many."""
    return float(2.0 ** round(math.log2(size))) if 0 < size < math.inf else 1.0


def _length(unit: Described) -> float:
    """The largest length at rest."""
    rest = at_rest.at_rest(unit)
    return max((abs(float(x)) for x in rest.lengths), default=0.0) or 1.0


@once
def _force(unit: Described) -> float:
    """A force by which members change their lengths to a large part."""
    rest = at_rest.at_rest(unit)
    elastic = [float(k) for k in rest.stiffness if k < math.inf]
    if elastic:
        return min(elastic) * _length(unit)
    whole = at_rest.hessian(unit)
    sizes = [abs(float(whole[k, k])) for k in range(len(unit.coordinates))]
    return max(sizes) * _length(unit) or 1.0


def _scale(unit: Described, k: int) -> float:
    """Typical size of the change of a coordinate."""
    value = abs(at_rest.coordinates(unit)[k])
    return 1.0 if changes(unit).angles[k] else _power(value or _length(unit))
