"""Equilibrium paths of structures, with strings that go slack, and the branch taken there.

A path is made of smooth pieces, each with given strings taut, followed by arc length; where a
string goes slack or taut a new piece begins.  Model: as `Structure`; bars and strings are lines.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check
from tensegrity.branches.arclength import Point
from tensegrity.branches.continuation import ContinuationError, Settings, trace
from tensegrity.branches.events import between
from tensegrity.branches.many import ManyProblem
from tensegrity.branches.table import Event, Table
from tensegrity.errors import EquilibriumError, TensegrityError
from tensegrity.readonly import fixed
from tensegrity.structures.corner import chosen, piece_stretch, rays
from tensegrity.structures.equations import Loading, Piece
from tensegrity.structures.solve import NEUTRAL, refuse_driven
from tensegrity.structures.structure import Structure, nodal
from tensegrity.structures.supports import Supports
from tensegrity.structures.switch import branches_off

if TYPE_CHECKING:
    from collections.abc import Iterable
    from typing import Any

    from matplotlib.axes import Axes

    from tensegrity.branches.continuation import Branch
    from tensegrity.typing import Array, Flags, Indices

SETTINGS = Settings(tolerance=1e-8, largest=0.05, points=4000)
CORNER = 1e-10  # stretch below which a string is at its natural length where a piece ends
PIECES = 100
AROUND = 12  # points around a bifurcation from which it is interpolated
NOW = 1e-9  # of the size of the structure: bars that are nearer meet
LABELS = {
    "shortening": "shortening [m]",
    "load": "load [N], compression > 0",
    "control": "control",
}
ENDS = {
    "contact": "two bars meet",
    "plate": "a node reaches a plate",
    "flat": "the plates meet",
    "load": "the load asked for",
    "height": "the shortening asked for",
    "control": "the natural lengths asked for",
    "nothing": "no equilibrium leaves this corner",
    "snap": "no stable branch leaves this bifurcation: the structure snaps",
    "pieces": f"{PIECES} pieces do not reach an end",
}


class StructurePath(Table):
    """Equilibria of a structure as a table.

    Attributes
    ----------
    shortening, load : ndarray, (rows,)
        Displacement in the direction of the load [m] and total load [N]; of a path of control
        the column is `control`, from 0 to 1.
    stable_load, stable_height : ndarray of bool, (rows,)
        Stability against all motions that the supports leave, under given (dead) load and under
        given shortening; of a path of control both under given natural lengths.
    tensions : ndarray, (rows, members)
        [N]; columns "tension 0" and so on.
    slack : ndarray of bool, (rows, members)
    positions : ndarray, (rows, nodes, dim)
        [m].
    events : tuple of Event
        Kinds "slack" (also where strings become taut again, see the note), "fold", "turn",
        "bifurcation", "plate", "contact"; each has the columns as attributes.
    structure : Structure
        Where the path starts.
    end : str
    """

    load: Array
    shortening: Array
    stable_load: Flags
    stable_height: Flags
    positions: Array
    slack: Flags

    def __init__(
        self,
        structure: Structure,
        columns: Mapping[str, Any],
        events: Iterable[Event],
        end: str,
        positions: Array,
        slack: Flags,
        supports: Supports | None,
    ) -> None:
        super().__init__(columns, events, end)
        self.structure, self.positions, self.slack = structure, positions, slack
        self.supports = supports

    def __getitem__(self, key: Any) -> Any:
        part = super().__getitem__(key)
        if isinstance(key, slice):
            part.positions, part.slack = self.positions[key], self.slack[key]
        return part

    @property
    def tensions(self) -> Array:
        """[N], (rows, members)."""
        count = len(self.structure.ends)
        return np.column_stack([self.columns[f"tension {m}"] for m in range(count)])

    def __str__(self) -> str:
        shown = [name for name in self.columns if not name.startswith("tension")]
        lines = [f"{self.structure}", f"  {len(self)} equilibria"]
        for word, row in (("from", self[0]), ("to", self[-1])):
            lines.append(f"  {word} " + ", ".join(f"{n} {row[n]:.6g}" for n in shown[:2]))
        for event in self.events:
            note = event.note and f": {event.note}"
            at = ", ".join(f"{name} {event.at[name]:.6g}" for name in shown[:2])
            lines.append(f"  {event.kind} at {at}{note}")
        return "\n".join([*lines, f"  ends: {self.end}"])

    def plot(  # type: ignore[override]
        self, x: str = "", y: str = "", axes: Axes | None = None
    ) -> Axes:
        """Draw one column against another, events marked; returns the Matplotlib axes."""
        first, second = list(self.columns)[:2]
        return super().plot(x or first, y or second, axes, LABELS)

    def _draw(self, axes: Axes) -> Axes:
        return self.plot(axes=axes)


def structure_path(
    structure: Structure,
    *,
    supports: Supports,
    max_load: float = math.inf,
    branch: str = "stable",
    loads: Mapping[int, Sequence[float]] | None = None,
    max_shortening: float = math.inf,
) -> StructurePath:
    """See `tensegrity.equilibrium_path`: the part of it for structures."""
    check.kind("structure", structure, Structure)
    check.kind("supports", supports, Supports, ": made by held(...) or plates(...)")
    max_load = check.number("max_load", max_load, above=0, finite=False, unit="N")
    max_shortening = check.number("max_shortening", max_shortening, above=0, finite=False, unit="m")
    if not isinstance(branch, str) or branch not in ("stable", "symmetric"):
        raise TensegrityError(f"branch {check.shown(branch)} must be 'stable' or 'symmetric'")
    normal = supports.direction(structure.dim)
    pattern = nodal(structure, loads)
    if loads is None:
        if not supports.upper:
            raise TensegrityError("give loads, or plates of which one moves")
        pattern[list(supports.upper)] = -normal / len(supports.upper)
    size = np.linalg.norm(pattern, axis=1).sum()
    if not size > 0:
        raise TensegrityError("loads of 0 N are no direction to follow")
    pattern = pattern / size
    plate = None
    if supports.lower or supports.upper:
        plate = (normal, supports.lower, supports.upper)
    motions = _motions(structure, supports, pattern)
    work = float(np.abs(motions.T @ pattern.ravel()).max(initial=0.0))
    if not work > 1e-12:
        raise EquilibriumError("the loads do no work in any motion that the supports leave")
    limits = (max_load, max_shortening)
    loading = Loading(
        structure.members, structure.positions, motions, pattern, 0 * structure.lengths, plate,
        limits,
    )  # fmt: skip
    return _Walk(structure, supports, loading, branch).path()


def control_path(
    structure: Structure,
    natural_lengths: Mapping[int, float],
    supports: Supports | None = None,
    branch: str = "stable",
) -> StructurePath:
    """Equilibria as natural lengths of some members go from theirs to given values.

    Parameters
    ----------
    structure : Structure
        In equilibrium.
    natural_lengths : dict
        {member: natural length at the end [m]}; all change in proportion.
    supports : Supports, optional
    branch : {"stable", "symmetric"}, optional
        As of `equilibrium_path`.

    Returns
    -------
    StructurePath
        With a column `control` from 0 to 1, and "work" [J], what the change has stored; a fold is
        where the structure snaps.
    """
    check.kind("structure", structure, Structure)
    if supports is not None:
        check.kind("supports", supports, Supports, ": made by held(...) or plates(...)")
    if not isinstance(branch, str) or branch not in ("stable", "symmetric"):
        raise TensegrityError(f"branch {check.shown(branch)} must be 'stable' or 'symmetric'")
    if not isinstance(natural_lengths, Mapping) or not natural_lengths:
        raise TensegrityError(
            f"natural_lengths {check.shown(natural_lengths)} must be a dict {{member: length}}"
        )
    change = np.zeros(len(structure.ends))
    for member, value in natural_lengths.items():
        number = structure.member_number(member)
        length = check.number(f"natural length of member {number}", value, above=0, unit="m")
        change[number] = length - structure.natural_lengths[number]
    if not change.any():
        raise TensegrityError("natural_lengths are those that the structure has: no path")
    motions = _motions(structure, supports, 0 * structure.positions)
    plate = None
    if supports is not None and (supports.lower or supports.upper):
        plate = (supports.direction(structure.dim), supports.lower, supports.upper)
    loading = Loading(
        structure.members, structure.positions, motions, None, change, plate, (math.inf, 1.0)
    )
    left = np.abs(motions.T @ structure.members.gradient(structure.positions).ravel()).max()
    size = np.abs(structure.tensions).max() + 1e-9 * np.max(
        structure.stiffnesses * structure.lengths
    )
    if left > 1e-6 * size:
        raise EquilibriumError(
            f"the structure is not in equilibrium: {left:.3g} N are left, beside {size:.3g} N; "
            "see Structure.relaxed"
        )
    return _Walk(structure, supports, loading, branch).path()


def _motions(structure: Structure, supports: Supports | None, pattern: Array) -> Array:
    freedom = structure.freedom(supports)
    refuse_driven(freedom, structure.positions, pattern)
    return np.asarray(freedom.motions @ freedom.complement())


@dataclass
class _Part:
    """A traced piece, cut where the path leaves it."""

    piece: Piece
    u: Array
    negative: Array  # numbers of negative eigenvalues, (rows, 2): given load, given shortening


class _Walk:
    """A path while it is followed."""

    def __init__(
        self, structure: Structure, supports: Supports | None, loading: Loading, branch: str
    ) -> None:
        self.structure, self.supports, self.of, self.branch = structure, supports, loading, branch
        self.parts: list[_Part] = []
        self.events: list[tuple[str, int, Array, Piece, str]] = []  # kind, row, u, piece, note
        self.rows = 0
        self.end = ""

    def path(self) -> StructurePath:
        """Follow it from the start to its end."""
        u = np.zeros(self.of.free + 1)
        none = np.zeros(len(self.structure.ends), bool)
        stretch = piece_stretch(self.of, u, none)
        corner = self._at_corner(stretch)
        taut = ~self.of.members.pulls_only | (stretch > 0)
        sense = 1
        if len(corner):
            whole = np.ones(len(taut), bool)
            softest = np.linalg.eigvalsh(Piece(self.of, whole, corner, stretch).tangent(u))[0]
            if not softest > NEUTRAL * float(self.of.members.stiffness.max()):
                raise EquilibriumError(
                    f"{len(corner)} strings are without tension at the start and a motion is "
                    f"without stiffness (smallest eigenvalue {softest:.3g} N/m): no branch is "
                    "determined; give it some prestress"
                )
            ray = chosen(rays(self.of, u, taut, corner), self.branch, corner)
            if ray is None:
                raise EquilibriumError(
                    f"{len(corner)} strings are at their natural length at the start and no "
                    "equilibrium leads away from it"
                )
            taut, sense = ray.taut, ray.sense
        for _ in range(PIECES):
            piece = Piece(self.of, taut, corner, stretch)
            found = self._piece(piece, u, sense)
            if found is None:
                break
            u, taut, corner, sense = found
            stretch = piece_stretch(self.of, u, taut)
        else:
            self.end = ENDS["pieces"]
        return self._made()

    def _at_corner(self, stretch: Array) -> Indices:
        return np.flatnonzero(self.of.members.pulls_only & (np.abs(stretch) <= CORNER))

    def _piece(self, piece: Piece, u: Array, sense: int) -> Any:
        """Follow one piece; where and how the next begins, or None at the end of the path."""
        problem = ManyProblem(piece)
        stop = [name for name in piece.roots if not name.startswith("contact")]
        try:
            traced = trace(problem, u, (), SETTINGS, sense, stop)
            reason = traced.end
        except ContinuationError as error:
            if error.branch is None or len(error.branch) < 2:
                self.end = f"the path could not be followed: {error}"
                if not self.parts:
                    raise EquilibriumError(self.end) from None
                return None
            traced, reason = error.branch, f"failed: {error}"
        rows = traced.z
        negative = np.array([self._negative(piece, x) for x in rows])
        events = [
            (e.kind, e.row, np.array([e.at[name] for name in problem.unknowns]))
            for e in traced.events
            if e.kind != "bifurcation"
        ]
        found = self._bifurcation(problem.machine, traced, negative, events)
        leaves = None
        for row, point, count in found:
            events.append((f"bifurcation {count}", row, point))
            if self.branch == "stable" and leaves is None and negative[row, 1] == 0:
                leaves = row, point
        met = self._contact(piece, events)
        last = len(rows) - 1
        if leaves and (met is None or leaves[0] <= met[0]):
            rows, last = np.vstack([rows[: leaves[0] + 1], leaves[1]]), leaves[0]
            negative = np.vstack([negative[: leaves[0] + 1], negative[leaves[0]]])
            reason = "leaves"
        elif met is not None:
            rows, last = np.vstack([rows[: met[0] + 1], met[1]]), met[0]
            negative = np.vstack([negative[: met[0] + 1], negative[met[0]]])
            reason = "contact"
        strings = [k for k, *_ in events if k.startswith("string")]
        for kind, row, point in sorted(events, key=lambda e: e[1]):
            beyond = row > last or (row == last and reason in ("leaves", "contact"))
            name = kind.split()[0]
            first = name == "contact" and point is not (met[1] if met else None)
            if name in ("string", "load", "height") or first:
                continue
            if beyond and not (name == "bifurcation" and leaves and point is leaves[1]) and not (
                name == "contact" and reason == "contact"
            ):  # fmt: skip
                continue
            self.events.append((name, self.rows + row, point, piece, _note(kind)))
        skip = 1 if self.parts else 0
        self.parts.append(_Part(piece, rows[skip:], negative[skip:]))
        self.rows += len(rows) - skip
        u = rows[-1]
        if reason == "leaves":
            return self._switched(piece, u, leaves)
        if strings and reason.startswith("string"):
            return self._turned(piece, u)
        word = "height" if reason == "height" else reason.split()[0]
        if self.of.pattern is None and word == "height":
            word = "control"
        self.end = ENDS.get(word, reason)
        return None

    def _turned(self, piece: Piece, u: Array) -> Any:
        """The piece that begins where strings are at natural length."""
        stretch = piece.stretch(u)
        corner = self._at_corner(stretch)
        row = self.rows - 1
        loose = corner[piece.taut[corner]]
        tight = corner[~piece.taut[corner]]
        words = [f"{_listed(loose)} slack"] if len(loose) else []
        words += [f"{_listed(tight)} taut again"] if len(tight) else []
        x = self.of.at(u)
        volume, within = self.of.crossing(x)
        if ((np.abs(volume) <= NOW) & within & (np.abs(piece.volume) > NOW)).any():
            self.events.append(("slack", row, u, piece, ", ".join(words)))
            self.events.append(("contact", row, u, piece, "bars meet"))
            self.end = ENDS["contact"]
            return None
        found = rays(self.of, u, piece.taut, corner)
        ray = chosen(found, self.branch, corner)
        if ray is not None and len(corner) > 1:
            kept = int(ray.taut[corner].sum())
            words.append(f"{kept} of {len(corner)} at the corner taut beyond it")
        self.events.append(("slack", row, u, piece, ", ".join(words)))
        if ray is None:
            self.end = ENDS["nothing"]
            return None
        return u, ray.taut, corner, ray.sense

    def _switched(self, piece: Piece, u: Array, leaves: Any) -> Any:
        """The stable branch that leaves a bifurcation."""
        found = branches_off(piece, u, self._inner(piece, u))
        if found is None:
            self.end = ENDS["snap"]
            return None
        stretch = piece_stretch(self.of, found, piece.taut)
        taut = ~self.of.members.pulls_only | (stretch >= 0)
        return found, taut, np.zeros(0, dtype=np.int64), 1

    # stability

    def _inner(self, piece: Piece, u: Array) -> Array:
        """Tangent where the last unknown is given."""
        stiff = piece.tangent(u)
        return stiff if self.of.pattern is None else stiff[:-1, :-1]

    def _negative(self, piece: Piece, u: Array) -> tuple[int, int]:
        """Negative eigenvalues under given load, and where the last unknown is given."""
        stiff = piece.tangent(u)
        bound = -NEUTRAL * float(self.of.members.stiffness.max())
        if self.of.pattern is None:
            count = int(np.sum(np.linalg.eigvalsh(stiff) < bound))
            return count, count
        scale = np.ones(len(stiff))  # the last motion is of 1 m of shortening: made as the others
        scale[-1] = np.sqrt(self.of.along @ self.of.along)
        stiff = stiff * scale[:, None] * scale
        return (
            int(np.sum(np.linalg.eigvalsh(stiff) < bound)),
            int(np.sum(np.linalg.eigvalsh(stiff[:-1, :-1]) < bound)) if len(stiff) > 1 else 0,
        )

    def _bifurcation(
        self, machine: Any, traced: Branch, negative: Array, events: Any
    ) -> list[tuple[int, Array, int]]:
        """Where eigenvalues change their sign other than by a turn: (row, point, how many)."""
        name = "turn" if self.of.pattern is not None else "fold"
        turns = [row for kind, row, _ in events if kind == name]
        found = []
        scaled = np.arcsinh(traced.z / machine.scale)
        for row in np.flatnonzero(np.diff(negative[:, 1])).tolist():
            count = abs(int(negative[row + 1, 1] - negative[row, 1]))
            count -= sum(t in (row, row + 1) for t in turns) if row in turns else 0
            if count < 1:
                continue
            ends = [
                Point(
                    machine.m, np.concatenate([scaled[i], traced.tangent[i]]), 0.0,
                    float(traced.arc[i] - traced.arc[max(i - 1, 0)]), 0.0, [],
                )
                for i in (row, row + 1)
            ]  # fmt: skip
            found.append((row, self._located(machine, ends, int(negative[row, 1])), count))
        return found

    def _located(self, machine: Any, ends: list[Point], below: int) -> Array:
        """The point between two where the number of negative eigenvalues changes.

        At the point itself the equations are singular, and round-off moves a solution along the
        lost mode: so eigenvalue and unknowns are interpolated from points around it.
        """
        from numpy.polynomial import chebyshev

        after = self._negative(machine.of, machine.unknowns(ends[1].z))[1]
        number = below if after > below else below - 1
        t = chebyshev.chebpts1(AROUND)
        z = [machine.at(*between(ends[0], ends[1], (1 + part) / 2), None).z for part in t.tolist()]
        us = [machine.unknowns(one) for one in z]
        values = [np.linalg.eigvalsh(self._inner(machine.of, u))[number] for u in us]
        roots = chebyshev.chebroots(chebyshev.chebfit(t, values, AROUND - 1))
        real = roots.real[(np.abs(roots.imag) < 1e-6) & (np.abs(roots.real) <= 1 + 1e-6)]
        if not real.size:
            return np.asarray(us[int(np.argmin(np.abs(values)))])
        return np.asarray(chebyshev.chebval(real.min(), chebyshev.chebfit(t, us, AROUND - 1)))

    def _contact(self, piece: Piece, events: Any) -> tuple[int, Array] | None:
        """The first place where bars meet within their lengths: (row, point)."""
        pairs = [tuple(p) for p in self.of.pairs.tolist()]
        found = []
        for kind, row, u in events:
            if kind.startswith("contact") and row > 0:
                number = pairs.index(tuple(map(int, kind.split()[1:])))
                if self.of.crossing(self.of.at(u))[1][number]:
                    found.append((row, u))
        return min(found, key=lambda e: e[0]) if found else None

    # what came out

    def _made(self) -> StructurePath:
        names, loaded = ["shortening", "load"], self.of.pattern is not None
        us = [u for part in self.parts for u in part.u]
        pieces = [part.piece for part in self.parts for _ in part.u]
        negative = np.concatenate([part.negative for part in self.parts])
        columns = self._columns(us, pieces)
        columns |= {"stable_load": negative[:, 0] == 0, "stable_height": negative[:, 1] == 0}
        order = [*(names if loaded else ["control", "work"]), "stable_load", "stable_height"]
        columns = {n: columns[n] for n in (*order, *(n for n in columns if n not in order))}
        events = []
        for kind, row, u, piece, note in self.events:
            at = self._columns([u], [piece])
            events.append(Event(kind, row, {k: float(v[0]) for k, v in at.items()}, note))
        positions = np.array([self.of.at(u) for u in us])
        slack = np.array([~piece.taut for piece in pieces])
        return StructurePath(
            self.structure, columns, events, self.end, fixed(positions), fixed(slack),
            self.supports,
        )  # fmt: skip

    def _columns(self, us: list[Array], pieces: list[Piece]) -> dict[str, Array]:
        tensions = np.array([piece.tensions(u) for piece, u in zip(pieces, us, strict=True)])
        if self.of.pattern is not None:
            columns = {"shortening": np.array([u[-1] for u in us]) + 0.0,
                       "load": np.array([u[-2] for u in us]) + 0.0}  # fmt: skip
        else:
            stored = np.sum(tensions**2 / (2 * self.of.members.stiffness), axis=1)
            start = self.structure.members.energy(self.structure.positions)
            columns = {"control": np.array([u[-1] for u in us]), "work": stored - start}
        return columns | {f"tension {m}": t for m, t in enumerate(tensions.T)}


def _listed(members: Indices) -> str:
    word = "string" if len(members) == 1 else "strings"
    return f"{word} {', '.join(map(str, members.tolist()))}"


def _note(kind: str) -> str:
    word, *rest = kind.split()
    if word == "contact":
        return f"bars {rest[0]} and {rest[1]} meet" if rest else "bars meet"
    if word == "plate":
        return f"node {rest[0]} reaches the {rest[1]} plate"
    if word == "bifurcation":
        return f"{rest[0]} modes at once" if rest and int(rest[0]) > 1 else ""
    return ""
