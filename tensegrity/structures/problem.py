"""The problem of a structure under growing loads, or whose natural lengths change.

A path consists of smooth pieces, each with a fixed set of taut strings, which are problems of
their own.  A new piece begins where a string goes slack or taut, or where the path loses stability
and the stable branch is followed.  An equilibrium is stable if no eigenvalue of the tangent is
negative.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from operator import attrgetter
from typing import Any

import numpy as np

from tensegrity.branches.continuation import ContinuationError, Located, Part, Settings
from tensegrity.branches.problem import Joined, Problem
from tensegrity.branches.steppers import ManyProblem
from tensegrity.errors import EquilibriumError
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
from tensegrity.typing import Array, Flags, Indices

SETTINGS = Settings(tolerance=1e-8, largest=0.05, points=4000)
FIRST_ROWS = 300  # rows of a piece before the first check whether the path leaves it
AT_NATURAL = TAUT  # strain below which a string is at its natural length where a piece ends
PIECES = 100
AT_ONCE = 2**20  # numbers in the tangents of several rows that are computed together
ROUND_OFF = 1e-13  # eigenvalues above minus this fraction of the stiffness are not negative
WIDE = 1e-3  # step above which the location of a bifurcation is refined once
NEARER = 0.1  # fraction of the interval between two rows that the refinement interpolates
AROUND, DEGREE = 12, 5  # points around a bifurcation, and degree of the polynomial through them
TOUCHING = 1e-9  # of the size of the structure: distance below which bars are in contact
LOADED = ("load", "shortening")  # the last unknowns of a path under growing loads
ENDS = {
    "contact": "two bars meet",
    "plate": "a node reaches a plate",
    "flat": "the plates meet",
    "end load": "the requested load is reached",
    "end shortening": "the requested shortening is reached",
    "end control": "the requested natural lengths are reached",
    "end back": "back at the natural lengths of the start",
    "other": "the requested shortening is reached in the opposite sense",
    "nothing": "no equilibrium, or no unique one, leaves this change of active set",
    "snap": "no stable branch leaves this {}: the structure snaps",
    "pieces": f"no end is reached within {PIECES} smooth pieces",
}


class StructureProblem(Problem):
    """A smooth piece of a path, and what follows where it ends.

    Parameters
    ----------
    loading : Loading
    branch : {"stable", "symmetric"}
        The branch to follow where there are several.
    about : dict
        "structure" and "supports" of the path.
    start : ndarray
        Unknowns at which the piece starts.
    taut : ndarray of bool, (members,)
    critical : ndarray of int
        Strings at their natural length at the start.
    direction : {1, -1}
        Sense of the last unknown.
    number : int, optional
        Of the piece.
    """

    loading: Loading
    branch: str
    about: dict[str, Any]
    start: Array
    piece: SmoothPiece
    number: int

    def __init__(
        self, loading: Loading, branch: str, about: dict[str, Any], start: Array, taut: Flags,
        critical: Indices, direction: int, number: int = 0,
    ) -> None:  # fmt: skip
        piece = SmoothPiece(loading, taut, critical, strains_at(loading, start, taut))
        stepper = ManyProblem(piece)
        self.__dict__.update(
            loading=loading, branch=branch, about=about, start=start, direction=direction,
            piece=piece, number=number, until={}, unknowns=piece.unknowns, equations=piece.residual,
            scale=piece.scale, folds=piece.folds, events=dict.fromkeys(piece.roots), columns={},
            _build_stepper=lambda: stepper,
        )  # fmt: skip

    @property
    def limit_kind(self) -> str:
        """Kind of the limit points of the last unknown."""
        return "fold" if self.loading.pattern is None else "turn"

    @property
    def names(self) -> tuple[str, ...]:
        """See `Problem.names`."""
        first = ("control", "work") if self.loading.pattern is None else ("shortening", "load")
        return (*first, *(f"tension {m}" for m in range(len(self.piece.taut))))

    def followed(self, until: Mapping[str, Any], at: Mapping[str, Any]) -> Part:
        """See `Problem.followed`."""
        for points in (FIRST_ROWS, SETTINGS.points):
            part = self._traced(points, until, at)
            negative = self._negative(part.data)
            part.more["negative"] = negative
            events = self._events(part, negative)
            departure = self._departure(events, negative)
            if departure or len(part.data) < points:
                break
        part.events = events = sorted(events, key=attrgetter("row"))
        last = len(part.data) if departure is None else departure.row
        if departure is not None:
            part.cut(departure, departure.kind)
        kept = [e for e in events if e is departure or (e.row < last and e.kind[:7] != "contact")]
        part.events = [named for event in kept if (named := self._named(event))]
        self._go_on(part)
        return part

    def _named(self, event: Located) -> Located | None:
        """An event by its name in a path, with its note; None if it is none there."""
        word, *rest = event.kind.split()
        if event.kind not in self._stepper.kinds:
            several = word == "bifurcation" and event.multiplicity > 1
            return event._replace(note=f"{event.multiplicity} modes at once") if several else event
        if word in ("string", "end"):
            return None
        notes = {"contact": "bars {} and {} meet", "plate": "node {} reaches the {} plate"}
        return event._replace(kind=word, note=notes.get(word, "").format(*rest))

    def _go_on(self, part: Part) -> None:
        """What follows the piece, or why the path ends with it."""
        word, *numbers = part.end.split()
        if word == "bifurcation":
            beyond = stable_branch_beyond(self.piece, part.data[-1])
            if beyond is None:
                part.end = ENDS["snap"].format("bifurcation")
            else:
                self._start_beyond(part, beyond)
        elif word == "string":
            self._change_active_set(part, int(numbers[0]))
        elif part.end == "end shortening" and not part.data[-1, -1] > 0:
            part.end = ENDS["other"]
        else:
            part.end = ENDS.get(part.end, ENDS.get(word, part.end))

    def _next(self, part: Part, start: Array, taut: Flags, critical: Indices, sense: int) -> None:
        if self.number + 1 == PIECES:
            part.end = ENDS["pieces"]
            return
        given = self.loading, self.branch, self.about
        part.following = StructureProblem(*given, start, taut, critical, sense, self.number + 1)

    def _events(self, part: Part, negative: Array) -> list[Located]:
        """The located events of a piece, and the bifurcations where it loses stability."""
        events = [event for event in part.events if event.kind != "bifurcation"]
        bifurcations = self._bifurcations(part, negative, events)
        bifurcations += self._bifurcations_at_limit_points(part, negative, events)
        return events + sorted(bifurcations, key=attrgetter("row"))

    def _departure(self, events: list[Located], negative: Array) -> Located | None:
        """The event at which the path leaves a piece early: a bifurcation, or contact of bars."""
        pairs, departures = [tuple(pair) for pair in self.loading.pairs.tolist()], []
        for event in events:
            word, *numbers = event.kind.split()
            if word == "bifurcation" and self.branch == "stable" and negative[event.row, 1] == 0:
                departures.append((event.row, 0, event))
            if word == "contact" and event.row > 0:
                within = self.loading.crossing(self.loading.positions_at(event.point))[1]
                if within[pairs.index(tuple(map(int, numbers)))]:
                    departures.append((event.row, 1, event))
        return min(departures, key=lambda x: x[:2])[2] if departures else None

    def _traced(self, points: int, until: Mapping[str, Any], at: Mapping[str, Any]) -> Part:
        """The piece up to its last row; its first step is so short that strings which leave their
        natural length there do not return to it within the step."""
        piece, first = self.piece, SETTINGS.first
        stop = [name for name in piece.roots if not name.startswith("contact")]
        while True:
            settings = replace(SETTINGS, points=points, first=first)
            try:
                part = Problem.followed(self.changed(settings=settings, stop=stop), until, at)
            except ContinuationError as error:
                failed: Part | None = getattr(error, "part", None)
                if failed is None or len(failed.data) < 2:
                    words = f"the path could not be followed: {error}"
                    if not self.number:
                        raise EquilibriumError(words) from None
                    none = np.zeros(1)
                    return Part(np.array([self.start]), none, none, none, [], words)
                part, failed.end = failed, f"failed: {error}"
            away = piece.tests(part.data[1])[piece.leaving]
            back = np.where(piece.taut[piece.strings[piece.leaving]], away < 0, away > 0)
            first /= 100
            if not back.any() or first < SETTINGS.smallest:
                return part

    def _change_active_set(self, part: Part, reached: int) -> None:
        """What follows where strings, `reached` among them, are at their natural length."""
        piece, loading, u, row = self.piece, self.loading, part.data[-1], len(part.data) - 1
        incoming = -1 if part.tangent[-1, -1] < 0 else 1
        critical = np.union1d(
            critical_strings(loading, piece.strains(u)), [reached]
        )  # its own may be round-off above
        switched = piece.taut.copy()
        switched[critical] ^= True
        words = [_changed(piece.taut, switched)]

        def slack(*words: str) -> None:
            part.events.append(Located("slack", row, u, ", ".join(words)))

        volume, within = loading.crossing(loading.positions_at(u))
        touching = (np.abs(volume) <= TOUCHING) & within
        if (touching & (np.abs(loading.volumes_at_start) > TOUCHING)).any():
            slack(*words)
            part.events.append(Located("contact", row, u, "bars meet"))
            part.end = ENDS["contact"]
            return
        branches = outgoing(loading, u, piece.taut, critical, incoming)
        chosen = selected(branches, self.branch, critical)
        lost = chosen is None or (chosen.sense == incoming and not chosen.stable)
        stable = self.branch == "stable" and part.more["negative"][-1, 1] == 0
        if lost and incoming > 0 and stable:
            beyond = stable_branch_beyond(piece, u, critical)
            if beyond is not None:
                self._start_beyond(part, beyond)
                return
            if chosen is not None:
                slack(words[0])
                part.end = ENDS["snap"].format("change of active set")
                return
        if chosen is not None and len(critical) > 1:
            taut = f"{chosen.taut[critical].sum()} of {len(critical)} strings at natural length"
            words = [_changed(piece.taut, chosen.taut) or words[0], f"{taut} are taut beyond"]
        if chosen is not None and chosen.sense != incoming:
            words.append("the path reverses its sense")
        slack(*words)
        if chosen is None:
            part.end = ENDS["nothing"]
        else:
            self._next(part, u, chosen.taut, critical, chosen.sense)

    def _start_beyond(self, part: Part, beyond: Array) -> None:
        """The piece that follows begins at a point of a branch a little beyond the last row."""
        before, u, row = self.piece.taut, part.data[-1], len(part.data) - 1
        strains = strains_at(self.loading, beyond, before)
        taut = ~self.loading.members.tension_only | (strains >= 0)
        if (taut != before).any():
            part.events.append(Located("slack", row, u, _changed(before, taut)))
        self._next(part, beyond, taut, NONE, 1)

    # stability

    def _negative(self, u: Array) -> Array:
        """Counts of negative eigenvalues at unknowns u (rows, m), (rows, 2): under given load, and
        for a given last unknown."""
        some = 1 + AT_ONCE // self.loading.gain.size
        if len(u) > some:
            return np.concatenate([self._negative(half) for half in np.array_split(u, 2)])
        whole = self.piece.tangent(u)
        bound = -ROUND_OFF * float(self.loading.members.stiffness.max())
        if self.loading.pattern is not None:  # the last motion is of 1 m of shortening:
            scale = np.append(np.ones(self.loading.free - 1), np.linalg.norm(self.loading.along))
            whole = whole * scale[:, None] * scale  # as the others
        counts = np.sum(np.linalg.eigvalsh(whole) < bound, axis=-1)[:, None].repeat(2, axis=1)
        some = counts[:, 0] > 0  # of fewer motions not more are negative
        if self.loading.pattern is not None:
            counts[some, 1] = np.sum(np.linalg.eigvalsh(whole[some, :-1, :-1]) < bound, axis=-1)
        return counts

    def _bifurcations(
        self, part: Part, negative: Array, events: list[Located]
    ) -> list[Located]:  # fmt: skip
        """Points other than limit points where eigenvalues change sign, with their number."""
        limit_rows = [event.row for event in events if event.kind == self.limit_kind]
        stepper, found, scaled = self._stepper, [], np.arcsinh(part.data / self.piece.scale)
        for row in np.flatnonzero(np.diff(negative[:, 1])).tolist():
            count = abs(int(negative[row + 1, 1] - negative[row, 1]))
            count -= sum(t in (row, row + 1) for t in limit_rows) if row in limit_rows else 0
            if count < 1:
                continue
            length = part.arc[row + 1] - part.arc[row]
            ends = [stepper.row(scaled[i], part.tangent[i], length) for i in (row, row + 1)]
            point = self._locate_bifurcation(ends, int(negative[row, 1]))
            found.append(Located("bifurcation", row, point, multiplicity=count))
        return found

    def _bifurcations_at_limit_points(
        self, part: Part, negative: Array, events: list[Located]
    ) -> list[Located]:
        """The first limit point at which a stable branch continues on another stable branch."""
        if self.branch != "stable":
            return []
        for kind, row, u, *_ in sorted(events, key=attrgetter("row")):
            stable = kind == self.limit_kind and part.tangent[row, -1] > 0 and negative[row, 1] == 0
            if stable and stable_branch_beyond(self.piece, u) is not None:
                return [Located("bifurcation", row, u)]
        return []

    def _locate_bifurcation(self, ends: list[Array], below: int) -> Array:
        """The point between two others where the number of negative eigenvalues changes.

        The equations are singular there, and round-off displaces a solution along the critical
        mode.  Eigenvalue and unknowns are therefore interpolated from points around it.
        """
        from numpy.polynomial import chebyshev

        stepper = self._stepper
        after = self._negative(stepper.unknowns(ends[1][: stepper.m])[None])[0, 1]
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
            stiff = self.piece.tangent(us)
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

    def measure(self, data: Array) -> dict[str, Array]:
        """See `Problem.measure`."""
        loading, tensions = self.loading, self.piece.tensions(data)
        if loading.pattern is not None:
            first = data[:, -1] + 0.0, data[:, -2] + 0.0
        else:
            stored = np.sum(tensions**2 / (2 * loading.members.stiffness), axis=1)
            start = loading.members.energy(loading.positions)
            first = data[:, -1].copy(), stored - start - data[:, loading.moves] @ loading.weight
        return dict(zip(self.names, (*first, *tensions.T), strict=True))

    def rows(self, part: Part) -> dict[str, Array]:
        """See `Problem.rows`."""
        by_load, by_height = (part.more["negative"] == 0).T
        slack = np.tile(~self.piece.taut, (len(part.data), 1))
        columns = {"stable_load": by_load, "stable_height": by_height, "slack": slack}
        return columns | {"positions": self.loading.positions_at(part.data)}

    def table(self, path: Joined) -> StructurePath:
        """See `Problem.table`."""
        tensions = {name: path.columns.pop(name) for name in self.names[2:]}
        return StructurePath(path.columns | tensions, path.events, path.end, **self.about)


def critical_strings(loading: Loading, strains: Array) -> Indices:
    """Strings at their natural length."""
    return np.flatnonzero(loading.members.tension_only & (np.abs(strains) <= AT_NATURAL))


def _changed(before: Flags, after: Flags) -> str:
    loose, tight = np.flatnonzero(before & ~after), np.flatnonzero(after & ~before)
    words = [f"{_listed(loose)} slack"] if len(loose) else []
    return ", ".join([*words, f"{_listed(tight)} taut again"] if len(tight) else words)


def _listed(members: Indices) -> str:
    word = "string" if len(members) == 1 else "strings"
    return f"{word} {', '.join(map(str, members.tolist()))}"
