"""The problem of a structure under growing loads, or whose natural lengths change.

A path consists of smooth pieces, each with a fixed set of taut strings, which are problems of
their own.  A new piece begins where a string goes slack or taut, a bar buckles or a member passes a
kink of its law, or where the path loses stability and the stable branch is followed.  An
equilibrium is stable if no eigenvalue of the tangent is negative.
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
from tensegrity.structures.equations import SmoothPiece
from tensegrity.structures.laws import KINDS
from tensegrity.structures.loading import Loading
from tensegrity.structures.structure_path import StructurePath
from tensegrity.typing import Array, Flags, Indices

SETTINGS = Settings(tolerance=1e-8, largest=0.05, points=4000)
PASSED = (
    ("slack", "slack", "taut again"),
    ("buckling", "buckled", "straight again"),
    ("kink", "below a kink of its law", "above a kink of its law"),
)  # kind of an event where kinks are passed, by their kind, and its words downwards and upwards
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
    "end of law": "{} is where its law ends",
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
    above : ndarray of bool, (kinks,)
        Which kinks the members are above; see `laws.Kinks`.
    critical : ndarray of int
        Kinks at which members are at the start.
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
        self, loading: Loading, branch: str, about: dict[str, Any], start: Array, above: Flags,
        critical: Indices, direction: int, number: int = 0,
    ) -> None:  # fmt: skip
        piece = SmoothPiece(loading, above, critical, strains_at(loading, start, above))
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
        return (*first, *(f"tension {m}" for m in range(len(self.loading.change))))

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
        if word in ("kink", "end"):
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
        elif word == "kink":
            self._change_active_set(part, int(numbers[0]))
        elif part.end == "end shortening" and not part.data[-1, -1] > 0:
            part.end = ENDS["other"]
        else:
            part.end = ENDS.get(part.end, ENDS.get(word, part.end))

    def _next(self, part: Part, start: Array, above: Flags, critical: Indices, sense: int) -> None:
        if self.number + 1 == PIECES:
            part.end = ENDS["pieces"]
            return
        given = self.loading, self.branch, self.about
        part.following = StructureProblem(*given, start, above, critical, sense, self.number + 1)

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
            back = np.where(piece.above[piece.leaving], away < 0, away > 0)
            first /= 100
            if not back.any() or first < SETTINGS.smallest:
                return part

    def _change_active_set(self, part: Part, reached: int) -> None:
        """What follows where members are at kinks, `reached` among them."""
        piece, loading, u, row = self.piece, self.loading, part.data[-1], len(part.data) - 1
        incoming = -1 if part.tangent[-1, -1] < 0 else 1
        critical = np.union1d(critical_kinks(piece.strains(u)), [reached])
        switched = piece.above.copy()
        switched[critical] ^= True
        kinks, changed, words = piece.kinks, self._changed(piece.above, switched), list[str]()
        ends = critical[kinks.kind[critical] == KINDS.index("end")]
        if ends.size:
            name_of = self.about["structure"].name_of
            part.end = ENDS["end of law"].format(name_of(int(kinks.member[ends[0]])))
            return

        def passed() -> None:
            notes = {kind: [said] for kind, said in changed.items()} or {"slack": []}
            next(iter(notes.values())).extend(words)
            part.events += [Located(kind, row, u, ", ".join(x)) for kind, x in notes.items()]

        if self._bars_touch(u):
            passed()
            part.events.append(Located("contact", row, u, "bars meet"))
            part.end = ENDS["contact"]
            return
        branches = outgoing(loading, u, piece.above, critical, incoming)
        chosen = selected(branches, self.branch, critical)
        lost = chosen is None or (chosen.sense == incoming and not chosen.stable)
        stable = self.branch == "stable" and part.more["negative"][-1, 1] == 0
        if lost and incoming > 0 and stable:
            beyond = stable_branch_beyond(piece, u, critical)
            if beyond is not None:
                self._start_beyond(part, beyond)
                return
            if chosen is not None:
                passed()
                part.end = ENDS["snap"].format("change of active set")
                return
        if chosen is None:
            passed()
            part.end = ENDS["nothing"]
            return
        if len(critical) > 1:
            strings = critical[kinks.kind[critical] == 0]
            taut = f"{chosen.above[strings].sum()} of {len(strings)} strings at natural length"
            changed = self._changed(piece.above, chosen.above) or changed
            words += [f"{taut} are taut beyond"] * (len(strings) > 0)
        if chosen.sense != incoming:
            words.append("the path reverses its sense")
        passed()
        self._next(part, u, chosen.above, critical, chosen.sense)

    def _bars_touch(self, u: Array) -> bool:
        """Whether bars that did not touch at the start do."""
        volume, within = self.loading.crossing(self.loading.positions_at(u))
        touching = (np.abs(volume) <= TOUCHING) & within
        return bool((touching & (np.abs(self.loading.volumes_at_start) > TOUCHING)).any())

    def _start_beyond(self, part: Part, beyond: Array) -> None:
        """The piece that follows begins at a point of a branch a little beyond the last row."""
        before, u, row = self.piece.above, part.data[-1], len(part.data) - 1
        above = strains_at(self.loading, beyond, before) >= 0
        changed = self._changed(before, above)
        part.events += [Located(kind, row, u, words) for kind, words in changed.items()]
        self._next(part, beyond, above, NONE, 1)

    def _changed(self, before: Flags, after: Flags) -> dict[str, str]:
        """What happens where members pass kinks, in words by the kind of event."""
        kinks, found = self.piece.kinks, {}
        for number, (kind, down, up) in enumerate(PASSED):
            mine = kinks.kind == number
            passed = (before & ~after & mine, down), (after & ~before & mine, up)
            words = [f"{_listed(kinks.member[on], kind)} {w}" for on, w in passed if on.any()]
            if words:
                found[kind] = ", ".join(words)
        return found

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
            stored = self._stored(data, tensions)
            start = loading.members.energy(loading.positions)
            first = data[:, -1].copy(), stored - start - data[:, loading.moves] @ loading.weight
        return dict(zip(self.names, (*first, *tensions.T), strict=True))

    def _stored(self, data: Array, tensions: Array) -> Array:
        """Energies of all members at rows of unknowns [J], (rows,)."""
        loading = self.loading
        if loading.members.linear and not loading.kept.any():
            return np.asarray(np.sum(tensions**2 / (2 * loading.members.stiffness), axis=1))
        rows = zip(data, self.piece.lengths(data), strict=True)
        return np.array([loading.members_at(u[-1]).stored(x).sum() for u, x in rows])

    def rows(self, part: Part) -> dict[str, Array]:
        """See `Problem.rows`."""
        by_load, by_height = (part.more["negative"] == 0).T
        columns, kinks = {"stable_load": by_load, "stable_height": by_height}, self.piece.kinks
        for number, name in enumerate(("slack", "buckled")):
            below = np.zeros(len(self.loading.change), dtype=bool)
            below[kinks.member[~self.piece.above & (kinks.kind == number)]] = True
            columns[name] = np.tile(below, (len(part.data), 1))
        return columns | {"positions": self.loading.positions_at(part.data)}

    def table(self, path: Joined) -> StructurePath:
        """See `Problem.table`."""
        tensions = {name: path.columns.pop(name) for name in self.names[2:]}
        return StructurePath(path.columns | tensions, path.events, path.end, **self.about)


def critical_kinks(strains: Array) -> Indices:
    """Kinks at which members are, by strains beyond them."""
    return np.flatnonzero(np.abs(strains) <= AT_NATURAL)


def _listed(members: Indices, kind: str) -> str:
    word = {"slack": "string", "buckling": "bar"}.get(kind, "member")
    return f"{word}{'s' * (len(members) > 1)} {', '.join(map(str, members.tolist()))}"
