"""Path following for structures: smooth pieces, joined where strings go slack or taut.

A path consists of smooth pieces, each with a fixed set of taut strings, which are followed by
arc-length continuation.  A new piece begins where a string goes slack or taut, or where the path
loses stability and the stable branch is followed.  An equilibrium is stable if no eigenvalue of
the tangent is negative.
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
from tensegrity.structures.active_set import (
    NONE,
    outgoing,
    selected,
    stable_branch_beyond,
    strains_at,
)
from tensegrity.structures.equations import Loading, SmoothPiece
from tensegrity.structures.structure_path import StructurePath
from tensegrity.structures.supports import NEGLIGIBLE

if TYPE_CHECKING:
    from typing import Any

    from tensegrity.branches.continuation import Branch
    from tensegrity.structures.structure import Structure
    from tensegrity.structures.supports import Supports
    from tensegrity.typing import Array, Flags, Indices

    _Located = tuple[str, int, Array]  # kind, the row before it, unknowns

SETTINGS = Settings(tolerance=1e-8, largest=0.05, points=4000)
FIRST_ROWS = 300  # rows of a piece before the first check whether the path leaves it
NEUTRAL = 1e-10  # eigenvalues below this fraction of the stiffness are zero
AT_NATURAL = TAUT  # strain below which a string is at its natural length where a piece ends
PIECES = 100
AT_ONCE = 2**20  # numbers in the tangents of several rows that are computed together
ROUND_OFF = 1e-13  # eigenvalues above minus this fraction of the stiffness are not negative
WIDE = 1e-3  # step above which the location of a bifurcation is refined once
NEARER = 0.1  # fraction of the interval between two rows that the refinement interpolates
AROUND, DEGREE = 12, 5  # points around a bifurcation, and degree of the polynomial through them
TOUCHING = 1e-9  # of the size of the structure: distance below which bars are in contact
ENDS = {
    "contact": "two bars meet",
    "plate": "a node reaches a plate",
    "flat": "the plates meet",
    "load": "the requested load is reached",
    "height": "the requested shortening is reached",
    "other": "the requested shortening is reached in the opposite sense",
    "control": "the requested natural lengths are reached",
    "back": "back at the natural lengths of the start",
    "nothing": "no equilibrium, or no unique one, leaves this change of active set",
    "snap": "no stable branch leaves this {}: the structure snaps",
    "pieces": f"no end is reached within {PIECES} smooth pieces",
}


@dataclass
class _TracedPiece:
    """A traced piece, up to the point where the path leaves it."""

    piece: SmoothPiece
    u: Array
    negative: Array  # counts of negative eigenvalues, (rows, 2): given load, given shortening


class PathFollower:
    """A path while it is being followed."""

    def __init__(
        self, structure: Structure, supports: Supports | None, loading: Loading, branch: str
    ) -> None:
        self.structure, self.supports = structure, supports
        self.loading, self.branch = loading, branch
        self.limit_kind = "fold" if loading.pattern is None else "turn"  # of the last unknown
        self.parts: list[_TracedPiece] = []
        self.events: list[
            tuple[str, int, Array, SmoothPiece, str]
        ] = []  # kind, row, u, piece, note
        self.rows = 0
        self.end = ""

    def path(self) -> StructurePath:
        """Follow the path from the start to its end."""
        u = np.zeros(self.loading.free + 1)
        none = np.zeros(len(self.structure.ends), bool)
        strains = strains_at(self.loading, u, none)
        critical = self._critical_strings(strains)
        taut = ~self.loading.members.tension_only | (strains > 0)
        sense = 1
        if len(critical):
            whole = np.ones(len(taut), bool)
            softest = np.linalg.eigvalsh(
                SmoothPiece(self.loading, whole, critical, strains).tangent(u)
            )[0]
            if not softest > NEUTRAL * float(self.loading.members.stiffness.max()):
                raise EquilibriumError(
                    f"{len(critical)} strings are without tension at the start and a motion is "
                    f"without stiffness (smallest eigenvalue {softest:.3g} N/m): no branch is "
                    "determined; prestress the structure"
                )
            chosen = selected(outgoing(self.loading, u, taut, critical), self.branch, critical)
            if chosen is None:
                raise EquilibriumError(
                    f"{len(critical)} strings are at their natural length at the start and no "
                    "equilibrium path leads away from it"
                )
            taut, sense = chosen.taut, chosen.sense
        self._refuse_undetermined(SmoothPiece(self.loading, taut, critical, strains), u)
        for _ in range(PIECES):
            piece = SmoothPiece(self.loading, taut, critical, strains)
            departure = self._follow_piece(piece, u, sense)
            if departure is None:
                break
            u, taut, critical, sense = departure
            strains = strains_at(self.loading, u, taut)
        else:
            self.end = ENDS["pieces"]
        return self._table()

    def _refuse_undetermined(self, piece: SmoothPiece, u: Array) -> None:
        """Refuse a start at which the equations are rank deficient: several branches leave it."""
        left = least_part(piece.linearised(u)[1] * piece.scale)
        if left <= NEGLIGIBLE:
            raise EquilibriumError(
                "a motion is without stiffness at the start and not driven (smallest singular "
                f"value {left:.3g} of the largest): no branch is determined; prestress it"
            )

    def _critical_strings(self, strains: Array) -> Indices:
        return np.flatnonzero(self.loading.members.tension_only & (np.abs(strains) <= AT_NATURAL))

    def _follow_piece(
        self, piece: SmoothPiece, u: Array, sense: int, points: int = FIRST_ROWS
    ) -> Any:
        """Follow one piece; the start of the next one, or None at the end of the path."""
        traced, reason = self._trace_piece(piece, u, sense, points)
        if traced is None:
            self.end = f"the path could not be followed: {reason}"
            if not self.parts:
                raise EquilibriumError(self.end)
            return None
        rows, negative = traced.z, self._negative(piece, traced.z)
        events = self._events(piece, traced, negative)
        departure = self._departure(events, negative)
        if departure is None and len(traced) >= points < SETTINGS.points:
            return self._follow_piece(piece, u, sense, SETTINGS.points)
        if departure is not None:
            reason, row, point = departure
            rows = np.vstack([rows[: row + 1], point])
            negative = np.vstack([negative[: row + 1], negative[row]])
        for event in sorted(events, key=itemgetter(1)):
            kind, row, point = event
            name = kind.split()[0]
            before = name != "contact" and (departure is None or row < departure[1])
            if (before or event is departure) and name not in ("string", "load", "height", "back"):
                self.events.append((name, self.rows + row, point, piece, _note(kind)))
        skip = 1 if self.parts else 0
        self.parts.append(_TracedPiece(piece, rows[skip:], negative[skip:]))
        self.rows += len(rows) - skip
        return self._after_piece(piece, rows[-1], reason, -1 if traced.tangent[-1, -1] < 0 else 1)

    def _after_piece(self, piece: SmoothPiece, u: Array, reason: str, incoming: int) -> Any:
        """The start of the next piece after one that ended at u, as `_follow_piece` returns it."""
        word, *numbers = reason.split()
        if word == "bifurcation":
            return self._switch_branch(piece, u)
        if word == "string":
            return self._change_active_set(piece, u, int(numbers[0]), incoming)
        if word == "height" and self.loading.pattern is None:
            word = "control"
        elif word == "height" and not u[-1] > 0:
            word = "other"
        self.end = ENDS.get(word, reason)
        return None

    def _events(self, piece: SmoothPiece, traced: Branch, negative: Array) -> list[_Located]:
        """The located events of a piece, and the bifurcations where it loses stability."""
        events = [
            (e.kind, e.row, np.array([e.at[name] for name in piece.names]))
            for e in traced.events
            if e.kind != "bifurcation"
        ]
        bifurcations = self._bifurcations(piece, traced, negative, events)
        bifurcations += self._bifurcations_at_limit_points(piece, traced, negative, events)
        return events + sorted(bifurcations, key=itemgetter(1))

    def _departure(self, events: list[_Located], negative: Array) -> _Located | None:
        """The event at which the path leaves a piece early: a bifurcation, or contact of bars."""
        pairs, departures = [tuple(pair) for pair in self.loading.pairs.tolist()], []
        for event in events:
            kind, row, u = event
            word, *numbers = kind.split()
            if word == "bifurcation" and self.branch == "stable" and negative[row, 1] == 0:
                departures.append((row, 0, event))
            if word == "contact" and row > 0:
                within = self.loading.crossing(self.loading.positions_at(u))[1]
                if within[pairs.index(tuple(map(int, numbers)))]:
                    departures.append((row, 1, event))
        return min(departures, key=itemgetter(0, 1))[2] if departures else None

    def _trace_piece(
        self, piece: SmoothPiece, u: Array, sense: int, points: int
    ) -> tuple[Branch | None, str]:
        """The piece from u, and why it ends; its first step is so short that strings which leave
        their natural length there do not return to it within the step."""
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

    def _change_active_set(self, piece: SmoothPiece, u: Array, reached: int, incoming: int) -> Any:
        """The next piece where strings, `reached` among them, are at their natural length."""
        strains = piece.strains(u)
        critical = np.union1d(
            self._critical_strings(strains), [reached]
        )  # its own may be round-off above
        row = self.rows - 1
        switched = piece.taut.copy()
        switched[critical] ^= True
        words = [_changed(piece.taut, switched)]
        x = self.loading.positions_at(u)
        volume, within = self.loading.crossing(x)
        if (
            (np.abs(volume) <= TOUCHING)
            & within
            & (np.abs(self.loading.volumes_at_start) > TOUCHING)
        ).any():
            self.events.append(("slack", row, u, piece, ", ".join(words)))
            self.events.append(("contact", row, u, piece, "bars meet"))
            self.end = ENDS["contact"]
            return None
        branches = outgoing(self.loading, u, piece.taut, critical, incoming)
        chosen = selected(branches, self.branch, critical)
        lost = chosen is None or (chosen.sense == incoming and not chosen.stable)
        if (
            lost
            and incoming > 0
            and self.branch == "stable"
            and self.parts[-1].negative[-1, 1] == 0
        ):
            beyond = stable_branch_beyond(piece, u, critical)
            if beyond is not None:
                return self._start_beyond(piece, u, beyond)
            if chosen is not None:
                self.events.append(("slack", row, u, piece, words[0]))
                self.end = ENDS["snap"].format("change of active set")
                return None
        if chosen is not None and len(critical) > 1:
            taut = f"{chosen.taut[critical].sum()} of {len(critical)} strings at natural length"
            words = [_changed(piece.taut, chosen.taut) or words[0], f"{taut} are taut beyond"]
        if chosen is not None and chosen.sense != incoming:
            words.append("the path reverses its sense")
        self.events.append(("slack", row, u, piece, ", ".join(words)))
        if chosen is None:
            self.end = ENDS["nothing"]
            return None
        return u, chosen.taut, critical, chosen.sense

    def _switch_branch(self, piece: SmoothPiece, u: Array) -> Any:
        """The stable branch that leaves a bifurcation."""
        beyond = stable_branch_beyond(piece, u)
        if beyond is None:
            self.end = ENDS["snap"].format("bifurcation")
            return None
        return self._start_beyond(piece, u, beyond)

    def _start_beyond(self, piece: SmoothPiece, u: Array, beyond: Array) -> Any:
        """The piece that begins at a point of a branch a little beyond u."""
        strains = strains_at(self.loading, beyond, piece.taut)
        taut = ~self.loading.members.tension_only | (strains >= 0)
        if (taut != piece.taut).any():
            self.events.append(("slack", self.rows - 1, u, piece, _changed(piece.taut, taut)))
        return beyond, taut, NONE, 1

    # stability

    def _negative(self, piece: SmoothPiece, u: Array) -> Array:
        """Counts of negative eigenvalues at unknowns u (rows, m), (rows, 2): under given load, and
        for a given last unknown."""
        some = 1 + AT_ONCE // self.loading.gain.size
        if len(u) > some:
            halves = np.array_split(u, 2)
            return np.concatenate([self._negative(piece, half) for half in halves])
        whole, bound = piece.tangent(u), -ROUND_OFF * float(self.loading.members.stiffness.max())
        if self.loading.pattern is not None:  # the last motion is of 1 m of shortening:
            scale = np.append(np.ones(self.loading.free - 1), np.linalg.norm(self.loading.along))
            whole = whole * scale[:, None] * scale  # as the others
        counts = np.sum(np.linalg.eigvalsh(whole) < bound, axis=-1)[:, None].repeat(2, axis=1)
        some = counts[:, 0] > 0  # of fewer motions not more are negative
        if self.loading.pattern is not None:
            counts[some, 1] = np.sum(np.linalg.eigvalsh(whole[some, :-1, :-1]) < bound, axis=-1)
        return counts

    def _bifurcations(
        self, piece: SmoothPiece, traced: Branch, negative: Array, events: list[_Located]
    ) -> list[_Located]:
        """Points other than limit points where eigenvalues change sign, with their number."""
        limit_rows, stepper = (
            [row for kind, row, _ in events if kind == self.limit_kind],
            ManyProblem(piece),
        )
        bifurcations, scaled = [], np.arcsinh(traced.z / piece.scale)
        for row in np.flatnonzero(np.diff(negative[:, 1])).tolist():
            count = abs(int(negative[row + 1, 1] - negative[row, 1]))
            count -= sum(t in (row, row + 1) for t in limit_rows) if row in limit_rows else 0
            if count < 1:
                continue
            length = traced.arc[row + 1] - traced.arc[row]
            ends = [stepper.row(scaled[i], traced.tangent[i], length) for i in (row, row + 1)]
            point = self._locate_bifurcation(stepper, ends, int(negative[row, 1]))
            bifurcations.append((f"bifurcation {count}", row, point))
        return bifurcations

    def _bifurcations_at_limit_points(
        self, piece: SmoothPiece, traced: Branch, negative: Array, events: list[_Located]
    ) -> list[_Located]:
        """The first limit point at which a stable branch continues on another stable branch."""
        if self.branch != "stable":
            return []
        for kind, row, u in sorted(events, key=itemgetter(1)):
            stable = (
                kind == self.limit_kind and traced.tangent[row, -1] > 0 and negative[row, 1] == 0
            )
            if stable and stable_branch_beyond(piece, u) is not None:
                return [("bifurcation 1", row, u)]
        return []

    def _locate_bifurcation(self, stepper: Any, ends: list[Array], below: int) -> Array:
        """The point between two others where the number of negative eigenvalues changes.

        The equations are singular there, and round-off displaces a solution along the critical
        mode.  Eigenvalue and unknowns are therefore interpolated from points around it.
        """
        from numpy.polynomial import chebyshev

        after = self._negative(stepper.equations, stepper.unknowns(ends[1][: stepper.m])[None])[
            0, 1
        ]
        number = below if after > below else below - 1
        m = stepper.m
        passes_limit_point = ends[0][2 * m - 1] * ends[1][2 * m - 1] <= 0
        middle, half = 0.5, 0.5
        for _ in range(
            1 + (ends[1][stepper.length] > WIDE)
        ):  # then nearer: eigenvalues cross elsewhere
            parts = middle + half * chebyshev.chebpts1(AROUND)
            z = [
                stepper.corrected(*stepper.interpolated(*ends, part), None)[:m]
                for part in parts.tolist()
            ]
            us = np.array([stepper.unknowns(one) for one in z])
            stiff = stepper.equations.tangent(us)
            inner = stiff if self.loading.pattern is None else stiff[:, :-1, :-1]
            values = np.linalg.eigvalsh(inner)[:, number]
            place = (
                parts if passes_limit_point else us[:, -1]
            )  # round-off moves solutions along the path too
            place = (place - place[0]) / (place[-1] - place[0]) * 2 - 1
            roots = chebyshev.chebroots(chebyshev.chebfit(place, values, DEGREE))
            real = roots.real[(np.abs(roots.imag) < 1e-6) & (np.abs(roots.real) <= 1 + NEARER)]
            if not real.size:
                return np.asarray(us[int(np.argmin(np.abs(values)))])
            fit = chebyshev.chebfit(place, np.column_stack([us, parts]), DEGREE)
            *point, middle = chebyshev.chebval(real[np.argmin(np.abs(real))], fit)
            half *= NEARER
        return np.array(point)

    # the result

    def _table(self) -> StructurePath:
        names, loaded = ["shortening", "load"], self.loading.pattern is not None
        pieces = [(part.piece, part.u) for part in self.parts]
        negative = np.concatenate([part.negative for part in self.parts])
        columns = self._columns(pieces)
        columns |= {"stable_load": negative[:, 0] == 0, "stable_height": negative[:, 1] == 0}
        order = [*(names if loaded else ["control", "work"]), "stable_load", "stable_height"]
        columns = {n: columns[n] for n in (*order, *(n for n in columns if n not in order))}
        events = []
        for kind, row, u, piece, note in self.events:
            at = self._columns([(piece, u[None])])
            events.append(Event(kind, row, {k: float(v[0]) for k, v in at.items()}, note))
        positions = np.concatenate([self.loading.positions_at(us) for _, us in pieces])
        slack = np.concatenate([np.tile(~piece.taut, (len(us), 1)) for piece, us in pieces])
        return StructurePath(
            self.structure, columns, events, self.end, fixed(positions), fixed(slack),
            self.supports,
        )  # fmt: skip

    def _columns(self, pieces: list[tuple[SmoothPiece, Array]]) -> dict[str, Array]:
        tensions = np.concatenate([piece.tensions(us) for piece, us in pieces])
        us = np.concatenate([us for _, us in pieces])
        if self.loading.pattern is not None:
            columns = {"shortening": us[:, -1] + 0.0, "load": us[:, -2] + 0.0}
        else:
            stored = np.sum(tensions**2 / (2 * self.loading.members.stiffness), axis=1)
            start = self.structure.members.energy(self.structure.positions)
            carried = us[:, self.loading.moves] @ self.loading.weight
            columns = {"control": us[:, -1].copy(), "work": stored - start - carried}
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
