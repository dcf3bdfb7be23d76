"""Equilibrium paths of a prism under axial load, for rigid or elastic bases and bars.

Members have no thickness.  With elastic bases or bars the path is followed by arc-length
continuation (`elastic_path`); with both rigid it is a closed form (`rigid_path`).  Strings carry
tension only: cross strings go slack where the bars meet (twist pi), where the path ends; base
strings go slack where they unload (twist 2 pi/n), beyond which the cross strings stand upright
and alone carry the load.  Source: the talk, part III, "Numerical approach".
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from concurrent.futures import Executor
from typing import TYPE_CHECKING, ClassVar, overload

import numpy as np

from tensegrity import check
from tensegrity.branches.table import Event, Table
from tensegrity.errors import TensegrityError
from tensegrity.notebook import progress
from tensegrity.printing import Lines
from tensegrity.prisms.closed import rigid_path
from tensegrity.prisms.elastic_path import elastic_path
from tensegrity.prisms.prism import Prism
from tensegrity.structures.path import structure_path
from tensegrity.structures.structure import Structure

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

    from tensegrity.prisms.closed import Columns, LocatedEvent
    from tensegrity.structures.structure_path import StructurePath
    from tensegrity.structures.supports import Supports
    from tensegrity.typing import Array, Flags

PART = 16  # paths per task of a worker
COLUMNS = ("height", "twist", "base", "load", "shortening")
UNITS = {"height": "m", "twist": "rad", "base": "m", "load": "N", "shortening": "m"}
ENDS = {
    "contact": "the bars meet on the axis (twist pi)",
    "flat": "the prism is flat (height 0)",
    "height": "the requested height is reached",
    "load": "the requested load is reached",
}
UPRIGHT = "the bars stand upright: no equilibrium has a larger height"
CONTACT = "the bars meet; cross strings go slack"
PASSED = "the bars pass through each other; beyond, cross strings carry compression"
SLACK = "base strings and bars unload; beyond, upright cross strings alone carry the load"
UNLOADED = "base strings and bars unload; beyond, base strings carry compression"
UNSTRESSED = "without prestrain no member is stressed here"


class EquilibriumPath(Table):
    """Equilibria of a prism as a table, from the reference state into compression.

    If the tension side was requested, its states precede the reference, the largest height first.
    Columns are attributes; `path[3]` is a row as a dict, `path[:10]` a path of the first ten rows.

    Attributes
    ----------
    height, twist, base : ndarray, (rows,)
        [m], [rad], [m].
    load : ndarray, (rows,)
        Total axial load [N], compression > 0.
    shortening : ndarray, (rows,)
        Reference height less height [m].
    stable_load, stable_height : ndarray of bool, (rows,)
        Whether the equilibrium is stable under given (dead) load, and under given height, between
        flat plates, against motions with the symmetry of the polygons only.
    events : tuple of Event
        Located points, each with `kind`, `row` and the columns as attributes.  The kinds are
        "fold" (limit point in load, dF = 0), "turn" (limit point in displacement, dh = 0),
        "slack", "contact", "flat" and "bifurcation".
    prism : Prism
    end, begin : str
        Why the path ends; why the tension side is shorter than requested, empty if it is not.

    Examples
    --------
    >>> from tensegrity import Prism, equilibrium_path
    >>> path = equilibrium_path(Prism(1.0, 0.7, 0.1, 1.0, k_base=20.0, k_bar=20.0))
    >>> fold, contact = path.events
    >>> fold.kind, round(fold.load, 5), round(fold.height, 5)
    ('fold', 1.23989, 0.35545)
    >>> bool(path[0]["stable_load"]), bool(path[-1]["stable_load"])
    (True, False)
    >>> len(path[: fold.row + 1].events)
    1
    """

    height: Array
    twist: Array
    base: Array
    load: Array
    shortening: Array
    stable_load: Flags
    stable_height: Flags

    _units: ClassVar = UNITS

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

    def _lines(self) -> Lines:
        first, last = self[0], self[-1]
        yield f"{self.prism}"
        yield (
            f"  {len(self)} equilibria from height {first['height']:.6g} m, "
            f"load {first['load']:.6g} N to height {last['height']:.6g} m, "
            f"load {last['load']:.6g} N"
        )
        if self.begin:
            yield f"  begins: {self.begin}"
        for event in self.events:
            yield f"  {event.kind} at {self._quantities(event.at, COLUMNS[:4])}"
            yield from [f"    {event.note}"] * bool(event.note)
        yield f"  ends: {self.end}"


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
def equilibrium_path(
    prism: Prism | Structure,
    *,
    min_height: float = 0.0,
    max_load: float = math.inf,
    max_height: float | None = None,
    past_contact: bool = False,
    supports: Supports | None = None,
    branch: str = "stable",
    loads: Mapping[int, Sequence[float]] | None = None,
    max_shortening: float = math.inf,
) -> EquilibriumPath | StructurePath:
    """Equilibrium path of a prism under axial load, or of a structure under growing loads.

    The path of a prism leads from the self-stressed state into compression and, on request, into
    tension.  A structure is compressed between plates or loaded at its nodes.

    Parameters
    ----------
    prism : Prism or Structure
    min_height : float, optional
        For a prism: height at which the path ends [m], >= 0.
    max_load : float, optional
        Load at which the path ends [N], compression > 0.
    max_height : float, optional
        For a prism: height up to which the tension side is included [m]; by default it is not.
    past_contact : bool, optional
        For a prism: whether to continue on the smooth energy where the bars meet and where base
        strings unload, so that bars pass through each other and strings carry compression.  It
        serves comparisons with other codes.
    supports : Supports
        For a structure, where it is required: `plates(lower, upper)`, the upper of which is pressed
        down, or any supports together with `loads`.
    branch : {"stable", "symmetric"}, optional
        For a structure: the branch to follow where several strings go slack at once, or where the
        path loses stability at given shortening.  "stable" is the branch of least energy,
        "symmetric" the one on which all of these strings are in the same state.
        "stable" ends with "the structure snaps" if a search finds no stable branch.  It searches
        along each mode whose stiffness vanishes, then for minima of the energy within 0.1 of the
        size of the structure, at shortenings larger by 1e-7, 1e-5 and 1e-3 of that size, starting
        along all directions without stiffness for every choice of slack strings among those at
        their natural length.  Jumps smaller than 1e-4 of the size are followed.
    loads : dict, optional
        For a structure: {node: force (dim,)}, directions and ratios of the forces.  Load and
        shortening of the path are conjugate: the load is the sum of the magnitudes.
    max_shortening : float, optional
        For a structure: shortening at which the path ends [m], in either sense.

    Returns
    -------
    EquilibriumPath or StructurePath
        The path of a prism ends where the bars meet, where it is flat, or at a given bound.  Rows
        of a prism with rigid bases and bars are finite; its contact event has load = inf.
        Several threads may trace paths at once, and paths can be pickled.

    Raises
    ------
    TensegrityError
        If an argument does not belong to a prism, or to a structure, or is outside its bounds:
        0 <= min_height < height < max_height, max_load > 0.

    Examples
    --------
    >>> from tensegrity import Prism, equilibrium_path
    >>> path = equilibrium_path(Prism(1.0, 0.7, 0.1, 1.0, k_base=20.0, k_bar=20.0))
    >>> [(event.kind, round(event.load, 4)) for event in path.events]
    [('fold', 1.2399), ('contact', 1.2384)]
    >>> print(path.end)
    the bars meet on the axis (twist pi)

    A cross of two bars in a frame of four strings, pressed between plates:

    >>> from tensegrity import Structure, plates
    >>> corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
    >>> sides = [(0, 1), (1, 2), (2, 3), (3, 0)]
    >>> cross = Structure(corners, bars=[(0, 2), (1, 3)], strings=sides)
    >>> stressed = cross.prestressed(prestrain={2: 0.05})
    >>> press = plates([0, 1], [2, 3])
    >>> path = equilibrium_path(stressed, supports=press, max_shortening=0.1)
    >>> [(event.kind, round(event.shortening, 4)) for event in path.events]
    [('slack', 0.0476)]
    """
    if isinstance(prism, Structure):
        _refuse(
            prism,
            min_height=(min_height, 0.0),
            max_height=(max_height, None),
            past_contact=(past_contact, False),
        )
        if supports is None:
            raise TensegrityError("a path of a structure needs supports: held(...) or plates(...)")
        return structure_path(
            prism,
            supports=supports,
            max_load=max_load,
            branch=branch,
            loads=loads,
            max_shortening=max_shortening,
        )
    check.kind("prism", prism, Prism)
    _refuse(
        prism,
        supports=(supports, None),
        branch=(branch, "stable"),
        loads=(loads, None),
        max_shortening=(max_shortening, math.inf),
    )
    return _followed(*_bounds(prism, min_height, max_load, max_height, past_contact))


def _refuse(of: object, **given: tuple[Any, Any]) -> None:
    """Refuse arguments (value, default) that do not belong to a path of this kind."""
    for name, (value, default) in given.items():
        plain = isinstance(value, (int, float, str)) and not isinstance(default, bool)
        if not (value is default or (plain and value == default)):
            raise TensegrityError(f"{name} does not belong to a path of a {type(of).__name__}")


def equilibrium_paths(
    prisms: Iterable[Prism],
    *,
    min_height: float = 0.0,
    max_load: float = math.inf,
    max_height: float | None = None,
    past_contact: bool = False,
    executor: Executor | None = None,
) -> list[EquilibriumPath]:
    """Equilibria of many prisms.

    Parameters
    ----------
    prisms : iterable of Prism
    min_height, max_load, max_height, past_contact : optional
        Bounds of the paths, as for `equilibrium_path`, the same for all prisms.
    executor : concurrent.futures.Executor, optional
        Pool of workers that follow the paths in groups: a process pool, or any executor that
        `sweep` takes.  By default the paths are followed in the calling thread; a path takes a
        quarter of a millisecond, most of it under Python's global interpreter lock.

    Returns
    -------
    list of EquilibriumPath
        One path per prism, in their order, each equal to that of `equilibrium_path`.

    Raises
    ------
    TensegrityError
        If one of `prisms` is no Prism, a bound is outside its range for one of them, or
        `executor` is no executor; in each case before any path is followed.

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
        raise TensegrityError(
            f"prisms {check.shown(prisms)} must be a sequence of Prisms"
        ) from None
    bounds = [_bounds(x, min_height, max_load, max_height, past_contact) for x in given]
    if executor is not None:
        check.kind("executor", executor, Executor)
    paths = [_followed(*one) for one in bounds[:1]]  # compiles what all of them need
    parts = [bounds[k : k + PART] for k in range(1, len(bounds), PART)]
    with progress(len(given), "path") as bar:
        for part in (map if executor is None else executor.map)(_all_followed, parts):
            paths += part
            bar.update(len(part))
    return paths


def _all_followed(bounds: list[Any]) -> list[EquilibriumPath]:
    return [_followed(*one) for one in bounds]


def _bounds(
    prism: Prism,
    min_height: float,
    max_load: float,
    max_height: float | None,
    past_contact: bool,
) -> tuple[Prism, float, float, float | None, bool]:
    """The checked arguments of `equilibrium_path`."""
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
        parts = rigid_path(prism, min_height, max_load, max_height)
    else:
        parts = elastic_path(prism, min_height, max_load, max_height, past_contact)
    return _path(prism, *parts, past_contact)


def _path(
    prism: Prism,
    parts: Sequence[Columns],
    events: Iterable[LocatedEvent],
    end: str,
    upright: bool,
    past_contact: bool,
) -> EquilibriumPath:
    """Join parts, columns without shortening, into a path; events are (kind, row, numbers)."""

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
    return EquilibriumPath(prism, columns, listed, ENDS[end], UPRIGHT if upright else "")
