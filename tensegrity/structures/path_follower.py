"""A path of a structure while it is followed: piece by piece, from corner to corner.

A path is made of smooth pieces, each with given strings taut, followed by arc length; where a
string goes slack or taut a new piece begins, and where a path loses stability the stable branch may
be taken.  Stability is counted in eigenvalues of the tangent below 0.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from operator import itemgetter
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.branches.continuation import ContinuationError, Settings, trace
from tensegrity.branches.many import ManyProblem
from tensegrity.branches.table import Event
from tensegrity.errors import EquilibriumError
from tensegrity.minimum import least_part
from tensegrity.readonly import fixed
from tensegrity.springs.kinks import TAUT
from tensegrity.structures.active_set import NONE, branches_off, chosen, piece_stretch, rays
from tensegrity.structures.equations import Loading, Piece
from tensegrity.structures.structure_path import StructurePath
from tensegrity.structures.supports import NOTHING

if TYPE_CHECKING:
    from typing import Any

    from tensegrity.branches.continuation import Branch
    from tensegrity.structures.structure import Structure
    from tensegrity.structures.supports import Supports
    from tensegrity.typing import Array, Flags, Indices

    _Found = tuple[str, int, Array]  # kind, the row before it, unknowns

SETTINGS = Settings(tolerance=1e-8, largest=0.05, points=4000)
FIRST = 300  # rows of a piece that are followed before it is looked whether the path leaves it
NEUTRAL = 1e-10  # eigenvalues below this part of the stiffness are zero
CORNER = TAUT  # stretch below which a string is at its natural length where a piece ends
PIECES = 100
ROUND_OFF = 1e-13  # eigenvalues above minus this part of the stiffness are not negative
WIDE = 1e-3  # steps on which a bifurcation is located twice
NEARER = 0.1  # part of the interval between two rows that is interpolated again
AROUND, DEGREE = 12, 5  # points around a bifurcation, and polynomial through them
NOW = 1e-9  # of the size of the structure: bars that are nearer meet
ENDS = {
    "contact": "two bars meet",
    "plate": "a node reaches a plate",
    "flat": "the plates meet",
    "load": "the load asked for",
    "height": "the shortening asked for",
    "other": "the shortening asked for, in the other sense",
    "control": "the natural lengths asked for",
    "back": "back at the natural lengths of the start",
    "nothing": "no equilibrium, or none that is determined, leaves this corner",
    "snap": "no stable branch leaves this {}: the structure snaps",
    "pieces": f"{PIECES} pieces do not reach an end",
}


@dataclass
class _Part:
    """A traced piece, cut where the path leaves it."""

    piece: Piece
    u: Array
    negative: Array  # numbers of negative eigenvalues, (rows, 2): given load, given shortening


class PathFollower:
    """A path while it is followed."""

    def __init__(
        self, structure: Structure, supports: Supports | None, loading: Loading, branch: str
    ) -> None:
        self.structure, self.supports, self.of, self.branch = structure, supports, loading, branch
        self.turn = "fold" if loading.pattern is None else "turn"  # of the last unknown
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
        self._refuse_loose(Piece(self.of, taut, corner, stretch), u)
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

    def _refuse_loose(self, piece: Piece, u: Array) -> None:
        """Refuse a start from which more than one branch leaves: equations of too low a rank."""
        left = least_part(piece.linearised(u)[1] * piece.scale)
        if left <= NOTHING:
            raise EquilibriumError(
                "a motion is without stiffness at the start and not driven (smallest singular "
                f"value {left:.3g} of the largest): no branch is determined; give it some prestress"
            )

    def _at_corner(self, stretch: Array) -> Indices:
        return np.flatnonzero(self.of.members.pulls_only & (np.abs(stretch) <= CORNER))

    def _piece(self, piece: Piece, u: Array, sense: int, points: int = FIRST) -> Any:
        """Follow one piece; where and how the next begins, or None at the end of the path."""
        traced, reason = self._traced(piece, u, sense, points)
        if traced is None:
            self.end = f"the path could not be followed: {reason}"
            if not self.parts:
                raise EquilibriumError(self.end)
            return None
        rows, negative = traced.z, np.array([self._negative(piece, x) for x in traced.z])
        events = self._events(piece, traced, negative)
        cut = self._cut(events, negative)
        if cut is None and len(traced) >= points < SETTINGS.points:
            return self._piece(piece, u, sense, SETTINGS.points)
        if cut is not None:
            reason, row, point = cut
            rows = np.vstack([rows[: row + 1], point])
            negative = np.vstack([negative[: row + 1], negative[row]])
        for event in sorted(events, key=itemgetter(1)):
            kind, row, point = event
            name = kind.split()[0]
            before = name != "contact" and (cut is None or row < cut[1])
            if (before or event is cut) and name not in ("string", "load", "height", "back"):
                self.events.append((name, self.rows + row, point, piece, _note(kind)))
        skip = 1 if self.parts else 0
        self.parts.append(_Part(piece, rows[skip:], negative[skip:]))
        self.rows += len(rows) - skip
        return self._ended(piece, rows[-1], reason, -1 if traced.tangent[-1, -1] < 0 else 1)

    def _ended(self, piece: Piece, u: Array, reason: str, arrived: int) -> Any:
        """What follows a piece that ended at u, as of `_piece`."""
        word, *numbers = reason.split()
        if word == "bifurcation":
            return self._switched(piece, u)
        if word == "string":
            return self._turned(piece, u, int(numbers[0]), arrived)
        if word == "height" and self.of.pattern is None:
            word = "control"
        elif word == "height" and not u[-1] > 0:
            word = "other"
        self.end = ENDS.get(word, reason)
        return None

    def _events(self, piece: Piece, traced: Branch, negative: Array) -> list[_Found]:
        """What was met on a piece, and where it loses stability."""
        events = [
            (e.kind, e.row, np.array([e.at[name] for name in piece.names]))
            for e in traced.events
            if e.kind != "bifurcation"
        ]
        found = self._bifurcations(piece, traced, negative, events)
        found += self._joins(piece, traced, negative, events)
        return events + sorted(found, key=itemgetter(1))

    def _cut(self, events: list[_Found], negative: Array) -> _Found | None:
        """Where a path leaves a piece before its end: on a stable branch, or as bars meet."""
        pairs, found = [tuple(pair) for pair in self.of.pairs.tolist()], []
        for event in events:
            kind, row, u = event
            word, *numbers = kind.split()
            if word == "bifurcation" and self.branch == "stable" and negative[row, 1] == 0:
                found.append((row, 0, event))
            if word == "contact" and row > 0:
                within = self.of.crossing(self.of.at(u))[1]
                if within[pairs.index(tuple(map(int, numbers)))]:
                    found.append((row, 1, event))
        return min(found, key=itemgetter(0, 1))[2] if found else None

    def _traced(self, piece: Piece, u: Array, sense: int, points: int) -> tuple[Branch | None, str]:
        """The piece from u, and why it ends: in a first step so short that strings that leave
        their natural length there have not come back to it."""
        problem, first = ManyProblem(piece), SETTINGS.first
        stop = [name for name in piece.roots if not name.startswith("contact")]
        while True:
            settings = replace(SETTINGS, points=points, first=first)
            try:
                traced = trace(problem, u, (), settings, sense, stop)
                reason = traced.end
            except ContinuationError as error:
                if error.branch is None or len(error.branch) < 2:
                    return None, str(error)
                traced, reason = error.branch, f"failed: {error}"
            away = piece.tests(traced.z[1])[piece.leaving]
            back = np.where(piece.taut[piece.strings[piece.leaving]], away < 0, away > 0)
            first /= 100
            if not back.any() or first < SETTINGS.smallest:
                return traced, reason

    def _turned(self, piece: Piece, u: Array, met: int, arrived: int) -> Any:
        """The piece that begins where strings are at natural length, of which the path met one."""
        stretch = piece.stretch(u)
        corner = np.union1d(self._at_corner(stretch), [met])  # its own may be round-off above
        row = self.rows - 1
        met_by = piece.taut.copy()
        met_by[corner] ^= True
        words = [_changed(piece.taut, met_by)]
        x = self.of.at(u)
        volume, within = self.of.crossing(x)
        if ((np.abs(volume) <= NOW) & within & (np.abs(piece.volume) > NOW)).any():
            self.events.append(("slack", row, u, piece, ", ".join(words)))
            self.events.append(("contact", row, u, piece, "bars meet"))
            self.end = ENDS["contact"]
            return None
        found = rays(self.of, u, piece.taut, corner, arrived)
        ray = chosen(found, self.branch, corner)
        lost = ray is None or (ray.sense == arrived and not ray.stable)
        if lost and arrived > 0 and self.branch == "stable" and self.parts[-1].negative[-1, 1] == 0:
            beyond = branches_off(piece, u, corner)
            if beyond is not None:
                return self._beyond(piece, u, beyond)
            if ray is not None:
                self.events.append(("slack", row, u, piece, words[0]))
                self.end = ENDS["snap"].format("corner")
                return None
        if ray is not None and len(corner) > 1:
            kept = int(ray.taut[corner].sum())
            words.append(f"{kept} of {len(corner)} at the corner taut beyond it")
        if ray is not None and ray.sense != arrived:
            words.append("the path turns back")
        self.events.append(("slack", row, u, piece, ", ".join(words)))
        if ray is None:
            self.end = ENDS["nothing"]
            return None
        return u, ray.taut, corner, ray.sense

    def _switched(self, piece: Piece, u: Array) -> Any:
        """The stable branch that leaves a bifurcation."""
        found = branches_off(piece, u)
        if found is None:
            self.end = ENDS["snap"].format("bifurcation")
            return None
        return self._beyond(piece, u, found)

    def _beyond(self, piece: Piece, u: Array, found: Array) -> Any:
        """The piece that begins at a point found beyond u."""
        stretch = piece_stretch(self.of, found, piece.taut)
        taut = ~self.of.members.pulls_only | (stretch >= 0)
        if (taut != piece.taut).any():
            self.events.append(("slack", self.rows - 1, u, piece, _changed(piece.taut, taut)))
        return found, taut, NONE, 1

    # stability

    def _inner(self, piece: Piece, u: Array) -> Array:
        """Tangent where the last unknown is given."""
        stiff = piece.tangent(u)
        return stiff if self.of.pattern is None else stiff[:-1, :-1]

    def _negative(self, piece: Piece, u: Array) -> tuple[int, int]:
        """Negative eigenvalues under given load, and where the last unknown is given."""
        stiff = piece.tangent(u)
        scale = np.ones(len(stiff))
        if self.of.pattern is not None:  # the last motion is of 1 m of shortening: as the others
            scale[-1] = np.sqrt(self.of.along @ self.of.along)
        whole, inner = stiff * scale[:, None] * scale, self._inner(piece, u)
        bound = -ROUND_OFF * float(self.of.members.stiffness.max())
        low, high = (int(np.sum(np.linalg.eigvalsh(k) < bound)) for k in (whole, inner))
        return low, high

    def _bifurcations(
        self, piece: Piece, traced: Branch, negative: Array, events: list[_Found]
    ) -> list[_Found]:
        """Where eigenvalues change their sign other than by a turn; how many is in the kind."""
        turns, machine = [row for kind, row, _ in events if kind == self.turn], ManyProblem(piece)
        found, scaled = [], np.arcsinh(traced.z / piece.scale)
        for row in np.flatnonzero(np.diff(negative[:, 1])).tolist():
            count = abs(int(negative[row + 1, 1] - negative[row, 1]))
            count -= sum(t in (row, row + 1) for t in turns) if row in turns else 0
            if count < 1:
                continue
            length = traced.arc[row + 1] - traced.arc[row]
            ends = [machine.row(scaled[i], traced.tangent[i], length) for i in (row, row + 1)]
            point = self._located(machine, ends, int(negative[row, 1]))
            found.append((f"bifurcation {count}", row, point))
        return found

    def _joins(
        self, piece: Piece, traced: Branch, negative: Array, events: list[_Found]
    ) -> list[_Found]:
        """The first turn at which a stable branch does not end but joins another one."""
        if self.branch != "stable":
            return []
        for kind, row, u in sorted(events, key=itemgetter(1)):
            stable = kind == self.turn and traced.tangent[row, -1] > 0 and negative[row, 1] == 0
            if stable and branches_off(piece, u) is not None:
                return [("bifurcation 1", row, u)]
        return []

    def _located(self, machine: Any, ends: list[Array], below: int) -> Array:
        """The point between two where the number of negative eigenvalues changes.

        At the point itself the equations are singular, and round-off moves a solution along the
        lost mode: so eigenvalue and unknowns are interpolated from points around it.
        """
        from numpy.polynomial import chebyshev

        after = self._negative(machine.of, machine.unknowns(ends[1][: machine.m]))[1]
        number = below if after > below else below - 1
        m = machine.m
        turns = ends[0][2 * m - 1] * ends[1][2 * m - 1] <= 0
        middle, half = 0.5, 0.5
        for _ in range(
            1 + (ends[1][machine.length] > WIDE)
        ):  # then nearer: eigenvalues cross elsewhere
            parts = middle + half * chebyshev.chebpts1(AROUND)
            z = [machine.at(*machine.between(*ends, part), None)[:m] for part in parts.tolist()]
            us = np.array([machine.unknowns(one) for one in z])
            values = [np.linalg.eigvalsh(self._inner(machine.of, u))[number] for u in us]
            place = parts if turns else us[:, -1]  # round-off moves solutions along the path too
            place = (place - place[0]) / (place[-1] - place[0]) * 2 - 1
            roots = chebyshev.chebroots(chebyshev.chebfit(place, values, DEGREE))
            real = roots.real[(np.abs(roots.imag) < 1e-6) & (np.abs(roots.real) <= 1 + NEARER)]
            if not real.size:
                return np.asarray(us[int(np.argmin(np.abs(values)))])
            fit = chebyshev.chebfit(place, np.column_stack([us, parts]), DEGREE)
            *found, middle = chebyshev.chebval(real[np.argmin(np.abs(real))], fit)
            half *= NEARER
        return np.array(found)

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
            carried = np.array([self.of.weight @ self.of.coordinates(u) for u in us])
            columns = {"control": np.array([u[-1] for u in us]), "work": stored - start - carried}
        return columns | {f"tension {m}": t for m, t in enumerate(tensions.T)}


def _changed(before: Flags, after: Flags) -> str:
    loose, tight = np.flatnonzero(before & ~after), np.flatnonzero(after & ~before)
    words = [f"{_listed(loose)} slack"] if len(loose) else []
    return ", ".join([*words, f"{_listed(tight)} taut again"] if len(tight) else words)


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
