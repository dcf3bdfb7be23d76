"""Equilibrium paths of a prism under axial load: fully elastic, rigid-elastic and between.

Members have no thickness.  With elastic bases or bars the path is a branch of the problem of
`tensegrity.prisms.condensed`, at rigid bases with one unknown less; with both rigid it is the
closed form.  Strings are unilateral: cross strings go slack where the bars meet (twist pi), where
the path ends, and base strings where they unload (twist 2 pi/n), beyond which the cross strings
hang upright and pull alone.  Source: seeds/000, part III, "Numerical approach".
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, overload

import numpy as np

from tensegrity import check
from tensegrity.branches.continuation import Settings, trace
from tensegrity.branches.table import Event, Table
from tensegrity.engine.pieces import threads
from tensegrity.engine.programs import derived, run
from tensegrity.errors import NoLocking, TensegrityError
from tensegrity.prisms.condensed import numbers, problem, stable
from tensegrity.prisms.prism import Prism, rigid_law
from tensegrity.progress import progress
from tensegrity.root import root
from tensegrity.structures.path import structure_path
from tensegrity.structures.structure import Structure

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

    from matplotlib.axes import Axes

    from tensegrity.branches.continuation import Branch
    from tensegrity.springs.potential import Potential
    from tensegrity.structures.structure_path import StructurePath
    from tensegrity.structures.supports import Supports
    from tensegrity.typing import Array, Flags

    Columns = dict[str, Any]
    Found = tuple[str, int, dict[str, float]]  # kind, row, numbers

PART = 16  # paths in a task of a thread
ROWS = 200  # of a rigid prism, and of the part where base strings are slack
SETTINGS = Settings(tolerance=1e-8, largest=0.05)
COLUMNS = ("height", "twist", "base", "load", "shortening")
LABELS = {
    "height": "height [m]",
    "twist": "twist [rad]",
    "base": "base [m]",
    "load": "axial load [N], compression > 0",
    "shortening": "shortening [m]",
}
ENDS = {
    "contact": "the bars meet on the axis (twist pi)",
    "flat": "the prism is flat (height 0)",
    "height": "the height asked for",
    "load": "the load asked for",
}
FLAT = {"height": 0.0, "load": 0.0}  # exactly, by symmetry
UPRIGHT = "the bars stand upright: no equilibrium is higher"
CONTACT = "the bars meet; cross strings go slack"
PASSED = "the bars pass through each other; beyond, cross strings carry compression"
SLACK = "base strings and bars unload; beyond, upright cross strings pull alone"
UNLOADED = "base strings and bars unload; beyond, base strings carry compression"
UNSTRESSED = "without prestrain all members are unloaded here"


class EquilibriumPath(Table):
    """Equilibria of a prism as a table, from the reference state into compression.

    Tension states, where asked for, come before the reference, the highest first.

    Attributes
    ----------
    height, twist, base : ndarray, (rows,)
        [m], [rad], [m].
    load : ndarray, (rows,)
        Total axial load [N], compression > 0.
    shortening : ndarray, (rows,)
        Reference height less height [m].
    stable_load, stable_height : ndarray of bool, (rows,)
        Stability under given (dead) load and under given height, between flat plates and in the
        threefold symmetric motions only.
    events : tuple of Event
        Each with `kind` ("fold": dF = 0, "turn": dh = 0, "slack", "contact", "flat",
        "bifurcation"), `height`, `twist`, `base`, `load`, `shortening`, `row`.
    prism : Prism
    end, begin : str
        Why the path ends there; why its tension side is shorter than asked for, if it is.
    """

    height: Array
    twist: Array
    base: Array
    load: Array
    shortening: Array
    stable_load: Flags
    stable_height: Flags

    def __init__(
        self,
        prism: Prism,
        columns: Mapping[str, Any],
        events: Iterable[Event],
        end: str,
        begin: str = "",
    ) -> None:
        super().__init__(columns, events, end)
        self.prism, self.begin = prism, begin

    def __str__(self) -> str:
        first, last = self[0], self[-1]
        lines = [
            f"{self.prism}",
            f"  {len(self)} equilibria from height {first['height']:.6g} m, "
            f"load {first['load']:.6g} N to height {last['height']:.6g} m, "
            f"load {last['load']:.6g} N",
        ]
        if self.begin:
            lines.append(f"  begins: {self.begin}")
        for event in self.events:
            note = event.note and f": {event.note}"
            lines.append(
                f"  {event.kind} at height {event.height:.6g} m, twist {event.twist:.6g} rad, "
                f"base {event.base:.6g} m, load {event.load:.6g} N{note}"
            )
        return "\n".join([*lines, f"  ends: {self.end}"])

    def plot(  # type: ignore[override]
        self, x: str = "shortening", y: str = "load", axes: Axes | None = None
    ) -> Axes:
        """Draw one column against another, events marked; returns the Matplotlib axes."""
        return super().plot(x, y, axes, LABELS)

    def _draw(self, axes: Axes) -> Axes:
        return self.plot(axes=axes)


@overload
def equilibrium_path(
    prism: Prism,
    *,
    min_height: float = ...,
    max_load: float = ...,
    max_height: float | None = ...,
    past_contact: bool = ...,
) -> EquilibriumPath: ...
@overload
def equilibrium_path(
    prism: Structure,
    *,
    supports: Supports,
    max_load: float = ...,
    branch: str = ...,
    loads: Mapping[int, Sequence[float]] | None = ...,
    max_shortening: float = ...,
) -> StructurePath: ...
def equilibrium_path(prism: Any, **given: Any) -> Any:
    """Equilibria of a prism, or of a structure between plates or under loads that grow.

    Parameters
    ----------
    prism : Prism or Structure
        Others are as of `prism_path` for a prism: min_height, max_load, max_height, past_contact.
    supports : Supports
        Of a structure: `plates(lower, upper)`, of which the upper one comes down, or any with
        `loads`.
    max_load : float, optional
        Load at which to end [N].
    branch : {"stable", "symmetric"}, optional
        What is followed where strings go slack together, and where a path loses stability at
        given shortening: the branch of least energy, or that on which all of them do the same.
    loads : dict, optional
        {node: force (dim,)}: their directions and ratios; load and shortening belong to their
        sum of sizes.
    max_shortening : float, optional
        Shortening at which to end [m].

    Returns
    -------
    EquilibriumPath or StructurePath

    Raises
    ------
    TensegrityError
        If an argument does not belong to what is given, or is outside its bounds.
    """
    of = structure_path if isinstance(prism, Structure) else prism_path
    known = set(inspect.signature(of).parameters) - {"prism", "structure"}
    wrong = sorted(set(given) - known)
    if wrong:
        raise TensegrityError(
            f"{wrong[0]} does not belong to a path of a {type(prism).__name__}, only "
            f"{', '.join(sorted(known))}"
        )
    if of is structure_path and "supports" not in given:
        raise TensegrityError("a path of a structure needs supports: held(...) or plates(...)")
    return of(prism, **given)


def prism_path(
    prism: Prism,
    *,
    min_height: float = 0.0,
    max_load: float = math.inf,
    max_height: float | None = None,
    past_contact: bool = False,
) -> EquilibriumPath:
    """Equilibria of a prism from its self-stressed state into compression, and into tension.

    Parameters
    ----------
    prism : Prism
    min_height : float, optional
        Height at which to end [m], >= 0.
    max_load : float, optional
        Axial load at which to end [N], compression > 0.
    max_height : float, optional
        With it the tension side up to this height [m] comes first.
    past_contact : bool, optional
        Continue the smooth energy where the bars meet: bars pass through each other and strings
        carry compression (also where base strings unload).  For comparison with other codes.

    Returns
    -------
    EquilibriumPath
        It ends at contact, flat, or at the bounds asked for.  The rows of a prism with rigid
        bases and bars stay finite; its contact event carries load = inf.  Threads may trace
        paths at once, and processes send them.

    Raises
    ------
    TensegrityError
        If a bound is outside its range: 0 <= min_height < height < max_height, max_load > 0.
    """
    return _followed(*_bounds(prism, min_height, max_load, max_height, past_contact))


def equilibrium_paths(
    prisms: Iterable[Prism],
    *,
    min_height: float = 0.0,
    max_load: float = math.inf,
    max_height: float | None = None,
    past_contact: bool = False,
) -> list[EquilibriumPath]:
    """Equilibria of many prisms, from as many threads as there are processors.

    Parameters
    ----------
    prisms : iterable of Prism
    min_height, max_load, max_height, past_contact : optional
        As in `equilibrium_path`, the same for all prisms.

    Returns
    -------
    list of EquilibriumPath
        In the order of the prisms, each as `equilibrium_path` gives it.

    Raises
    ------
    TensegrityError
        As `equilibrium_path`, before any path is followed: if one of `prisms` is no Prism, or a
        bound is outside its range for one of them.

    Examples
    --------
    >>> from tensegrity import Prism, equilibrium_paths
    >>> soft = [Prism(1.0, 0.7, 0.1, 1.0, k_base, 20.0) for k_base in (2.0, 4.0, 8.0)]
    >>> [len(path.events) for path in equilibrium_paths(soft)]
    [2, 2, 2]
    """
    try:
        given = list(prisms)
    except TypeError:
        raise TensegrityError(f"prisms {check.shown(prisms)} must be several Prism") from None
    bounds = [_bounds(x, min_height, max_load, max_height, past_contact) for x in given]
    found = [_followed(*one) for one in bounds[:1]]  # what all of them need is made here
    parts = [bounds[k : k + PART] for k in range(1, len(bounds), PART)]
    pool = ThreadPoolExecutor(threads())
    try:
        with progress(len(given), "path") as bar:
            for part in pool.map(lambda part: [_followed(*one) for one in part], parts):
                found += part
                bar.update(len(part))
    finally:
        pool.shutdown(cancel_futures=True)
    return found


def _bounds(
    prism: Prism,
    min_height: float,
    max_load: float,
    max_height: float | None,
    past_contact: bool,
) -> tuple[Prism, float, float, float | None, bool]:
    """What `equilibrium_path` was given, checked."""
    check.kind("prism", prism, Prism)
    past_contact = check.truth("past_contact", past_contact)
    min_height = check.number("min_height", min_height, least=0, unit="m")
    max_load = check.number("max_load", max_load, above=0, finite=False, unit="N")
    if min_height >= prism.height:
        raise TensegrityError(
            f"min_height {min_height:g} m must be below the height {prism.height:g} m of the prism"
        )
    if max_height is not None:
        max_height = check.number("max_height", max_height, above=prism.height, unit="m")
    if prism.is_rigid and past_contact:
        raise TensegrityError(
            "past_contact=True needs elastic bases or bars: rigid ones lock where the bars meet"
        )
    return prism, min_height, max_load, max_height, past_contact


def _followed(
    prism: Prism, min_height: float, max_load: float, max_height: float | None, past_contact: bool
) -> EquilibriumPath:
    if prism.is_rigid:
        return _rigid_path(prism, min_height, max_load, max_height)
    return _elastic_path(prism, min_height, max_load, max_height, past_contact)


def _path(
    prism: Prism,
    parts: Sequence[Columns],
    events: Iterable[Found],
    end: str,
    begin: str = "",
    past_contact: bool = False,
) -> EquilibriumPath:
    """Parts (columns without shortening) one after another; events are (kind, row, numbers)."""

    def note(kind: str, at: dict[str, float]) -> str:
        if kind == "contact":
            return PASSED if past_contact else CONTACT
        if kind == "slack" and at["height"] == prism.height:
            return UNSTRESSED
        return (UNLOADED if past_contact else SLACK) if kind == "slack" else ""

    columns = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    columns["shortening"] = prism.height - columns["height"]
    columns["load"] = columns["load"] + 0.0  # no negative zero
    columns = {name: columns[name] for name in (*COLUMNS, "stable_load", "stable_height")}
    listed = [
        Event(kind, row, {**at, "shortening": prism.height - at["height"]}, note(kind, at))
        for kind, row, at in events
    ]
    return EquilibriumPath(prism, columns, listed, end, begin)


# --- elastic members -------------------------------------------------------------------------


def _elastic_path(
    prism: Prism, min_height: float, max_load: float, max_height: float | None, past_contact: bool
) -> EquilibriumPath:
    level = min_height if min_height > 0 else -prism.height
    stop = ("flat", "height", "load", *(() if past_contact else ("contact",)))
    down, events = _branch(prism, numbers(prism, level, max_load), -1, stop)
    parts, rows, begin = [_columns(prism, down)], 0, ""
    if max_height is not None:
        goes_slack = not past_contact and not math.isinf(prism.k_base)
        stop = ("height", *(("unloaded",) if goes_slack else ()))
        up, above = _branch(prism, numbers(prism, max_height), 1, stop)
        tension = {name: column[:0:-1] for name, column in _columns(prism, up).items()}
        parts, rows = [tension, *parts], len(up) - 1
        above = [(kind, max(rows - 1 - row, 0), at) for kind, row, at in above[::-1] if row > 0]
        if up.end == "unloaded":
            hanging = _hanging(prism, max_height, tension)
            parts, rows = [hanging, *parts], rows + len(hanging["height"])
            begin = UPRIGHT if hanging["height"][0] < max_height else ""
            above = [(kind, row + len(hanging["height"]), at) for kind, row, at in above]
        events = [*above, *((kind, row + rows, at) for kind, row, at in events)]
    return _path(prism, parts, events, ENDS[down.end], begin, past_contact)


def _branch(
    prism: Prism, p: list[float], direction: int, stop: tuple[str, ...]
) -> tuple[Branch, list[Found]]:
    """The branch in the problem's units, and its events in SI units as (kind, row, numbers)."""
    rigid_base = math.isinf(prism.k_base)
    of, start = problem(rigid_base, prism.sides != 3), np.zeros(4 - rigid_base)
    branch = trace(of, start, p, SETTINGS, direction, stop)
    branch.p = p
    kinds = {"contact": "contact", "unloaded": "slack"}
    kinds |= {kind: kind for kind in ("fold", "turn", "flat", "bifurcation")}
    if rigid_base:
        del kinds["unloaded"]  # rigid bases do not go slack
    events = []
    for event in branch.events:
        kind = kinds.get(event.kind)
        if event.row == 0 and event.kind in ("contact", "unloaded"):
            kind = "slack" if event.kind == "contact" else None  # no prestrain: slack at the start
        if kind:
            columns = {name: np.array([event.at[name]]) for name in COLUMNS[:4]}
            at = {name: float(x[0]) for name, x in _in_si(prism, columns).items()}
            if kind == "flat":
                at |= FLAT
            events.append((kind, event.row, at))
    return branch, events


def _in_si(prism: Prism, columns: Mapping[str, Any]) -> Columns:
    force = prism.k_cross * prism.base
    return {
        "height": columns["height"] * prism.base,
        "twist": columns["twist"],
        "base": columns["base"] * prism.base,
        "load": columns["load"] * force,
    }


def _columns(prism: Prism, branch: Branch) -> Columns:
    by_load, by_height = stable(branch.z, branch.p, math.isinf(prism.k_base))
    columns = _in_si(prism, branch.columns)
    columns["load"][0] = 0.0  # the self-stressed state
    if branch.end == "flat":
        for name, value in FLAT.items():
            columns[name][-1] = value
    return columns | {"stable_load": by_load, "stable_height": by_height}


def _hanging(prism: Prism, max_height: float, below: Columns) -> Columns:
    """Rows above the point where base strings and bars unload, the highest first.

    The states of `derivations.hanging`.  The energy is a sum of squares with positive weights
    there, hence stable.
    """
    cross, _, bar = prism.natural_lengths()
    height = np.linspace(below["height"][0], min(max_height, bar), ROWS + 1)[:0:-1]
    symbols = height, prism.k_cross, cross, bar
    twist, base_squared, load = run(derived(_hanging_forms, prism.sides), np, symbols)
    true = np.ones(ROWS, dtype=bool)
    return {
        "height": height,
        "twist": np.full(ROWS, twist),
        "base": np.sqrt(np.maximum(base_squared, 0.0)),
        "load": load,
        "stable_load": true,
        "stable_height": true,
    }


def _hanging_forms(sides: int) -> tuple[list[Any], tuple[Any, ...]]:
    """(twist, squared base, load) of height, k_cross, natural lengths of cross string and bar."""
    from derivations import hanging, prism, regular

    symbols = (prism.height, prism.k_cross, prism.natural_cross, prism.natural_bar)
    of = regular.TRIANGLE if sides == 3 else regular.ANY
    forms = hanging.upright_twist(of), hanging.base_squared(of), hanging.load(of)
    if sides != 3:
        import sympy as sp

        angle = sp.pi / sides
        known = {regular.half_angle: angle, regular.number_of_sides: sides}
        known |= {regular.half_sine: sp.sin(angle), regular.half_cosine: sp.cos(angle)}
        forms = tuple(form.subs(known).evalf(30) for form in forms)
    return list(forms), symbols


# --- rigid bases and bars --------------------------------------------------------------------


def _rigid_path(
    prism: Prism, min_height: float, max_load: float, max_height: float | None
) -> EquilibriumPath:
    """Rows of the closed form, closer towards where the prism locks."""
    potential = prism.potential()
    low, _ = potential.domain
    try:
        end, kind = prism.locking_height() - prism.height, "contact"
    except NoLocking:
        end, kind = -prism.height, "flat"
    if min_height - prism.height > end:
        end, kind = min_height - prism.height, "height"

    part = np.linspace(0.0, 1.0, ROWS + 1)
    r = end * (1 - (1 - part) ** 4 if kind == "contact" else part)
    r = r[r > low] if kind != "height" else r
    if kind == "flat":
        r = np.append(r[r > -prism.height], np.nextafter(-prism.height, 0.0))
    load = -potential.tension(r)
    events = []

    turning = potential.stiffness(r)
    for i in np.flatnonzero(turning[:-1] * turning[1:] < 0).tolist():
        at = root(lambda x: float(potential.stiffness(x)), r[i + 1], r[i])
        events.append(("fold", i, at))
    over = np.flatnonzero(load >= max_load)
    if over.size or (kind == "contact" and math.isfinite(max_load)):
        first = int(over[0]) if over.size else len(r)
        nearest = r[first] if over.size else np.nextafter(low, 0)
        at = root(lambda x: -float(potential.tension(x)) - max_load, nearest, r[first - 1])
        r, kind = np.append(r[:first], at), "load"
        events = [event for event in events if event[2] >= at]
    elif kind in ("contact", "flat"):
        events.append((kind, len(r) - 1, end))

    rows, begin = 0, ""
    if max_height is not None:
        up = _stretched(prism, potential, max_height)
        r, rows = np.concatenate([up, r]), len(up)
        begin = UPRIGHT if max_height - prism.height >= potential.domain[1] else ""
    columns = _rigid_columns(prism, potential, r)
    if prism.prestrain == 0:
        events = [("slack", 0, 0.0), *events]
    listed = []
    for name, row, at in events:
        locked = name in ("contact", "flat")
        one = _rigid_columns(prism, potential, np.array([at]), locked)
        numbers_there = {key: float(one[key][0]) for key in COLUMNS[:4]}
        if name == "contact":
            numbers_there["load"] = math.inf
        listed.append((name, row + rows, numbers_there))
    return _path(prism, [columns], listed, ENDS[kind], begin)


def _stretched(prism: Prism, potential: Potential, max_height: float) -> Array:
    """Elongations above the reference, the highest first."""
    top = min(max_height - prism.height, potential.domain[1])
    part = np.linspace(1.0, 0.0, ROWS + 1)[:-1]
    r = top * (1 - (1 - part) ** 4)
    return r[r < potential.domain[1]]


def _rigid_columns(prism: Prism, potential: Potential, r: Array, locked: bool = False) -> Columns:
    """Numbers at elongations r; at a locked end no load (0 where flat) and no stiffness."""
    shared = len(rigid_law().parameters)  # without the number of sides
    (half,) = run(derived(_half_turn), np, (r, *potential.values[:shared]))
    load = np.zeros_like(r) if locked else -potential.tension(r)
    stiff = np.full(r.shape, np.inf) if locked else potential.stiffness(r)
    return {
        "height": prism.height + r,
        "twist": prism.reference_twist + 2 * np.arctan(half),
        "base": np.full(r.shape, prism.base),
        "load": load,
        "stable_load": stiff >= 0,  # zero without prestrain, at a minimum of the energy
        "stable_height": np.ones(r.shape, dtype=bool),
    }


def _half_turn() -> tuple[list[Any], tuple[Any, ...]]:
    """Tangent of half the turn from the reference, from constant length of bars and bases."""
    from derivations import rigid_elastic as form

    return [form.half_turn()], (form.elongation, *form.PARAMETERS)
