"""Equilibrium paths of a prism under axial load: fully elastic, rigid-elastic and between.

Members have no thickness.  With elastic bases or bars the path is a branch (`elastic_path`); with
both rigid it is the closed form (`rigid_path`).  Strings are unilateral: cross strings go slack
where the bars meet (twist pi), where the path ends, and base strings where they unload (twist
2 pi/n), beyond which the cross strings hang upright and pull alone.  Source: seeds/000, part III,
"Numerical approach".
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from concurrent.futures import Executor
from typing import TYPE_CHECKING, overload

import numpy as np

from tensegrity import check
from tensegrity.branches.table import Event, Table
from tensegrity.errors import TensegrityError
from tensegrity.notebook import progress
from tensegrity.prisms.closed import rigid_path
from tensegrity.prisms.elastic_path import elastic_path
from tensegrity.prisms.prism import Prism
from tensegrity.structures.path import structure_path
from tensegrity.structures.structure import Structure

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any

    from matplotlib.axes import Axes

    from tensegrity.prisms.closed import Columns, Found
    from tensegrity.structures.structure_path import StructurePath
    from tensegrity.structures.supports import Supports
    from tensegrity.typing import Array, Flags

PART = 16  # paths in a task of a worker
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
    """Equilibria of a prism from its self-stressed state into compression, and into tension; or
    of a structure between plates, or under loads that grow.

    Parameters
    ----------
    prism : Prism or Structure
    min_height : float, optional
        Of a prism: height at which to end [m], >= 0.
    max_load : float, optional
        Load at which to end [N], compression > 0.
    max_height : float, optional
        Of a prism: with it the tension side up to this height [m] comes first.
    past_contact : bool, optional
        Of a prism: continue the smooth energy where the bars meet, so that bars pass through each
        other and strings carry compression (also where base strings unload).  For comparison with
        other codes.
    supports : Supports
        Of a structure, for which it is required: `plates(lower, upper)`, of which the upper one
        comes down, or any with `loads`.
    branch : {"stable", "symmetric"}, optional
        Of a structure: the branch that is followed where strings go slack together, and where the
        path loses stability at given shortening: that of least energy, or that on which all of
        them do the same.
        "stable" ends with "the structure snaps" where a search finds no stable branch: not along
        any lost mode, nor among minima of the energy within 0.1 of the size of the structure at
        shortenings 1e-7, 1e-5 and 1e-3 of it beyond, from starts along all directions without
        stiffness, whichever strings at natural length are slack.  Jumps below 1e-4 are followed.
    loads : dict, optional
        Of a structure: {node: force (dim,)}, the directions and ratios of the forces; load and
        shortening belong to the sum of their sizes.
    max_shortening : float, optional
        Of a structure: shortening at which to end [m]; in the other sense too, where a path turns
        back.

    Returns
    -------
    EquilibriumPath or StructurePath
        That of a prism ends at contact, flat, or at the bounds given.  The rows of a prism with
        rigid bases and bars stay finite; its contact event carries load = inf.  Threads may trace
        paths at once, and processes send them.

    Raises
    ------
    TensegrityError
        If an argument does not belong to what is given, or is outside its bounds:
        0 <= min_height < height < max_height, max_load > 0.
    """
    if isinstance(prism, Structure):
        smooth = past_contact is not False
        bounded = max_height is not None
        _refuse(prism, min_height=min_height != 0, max_height=bounded, past_contact=smooth)
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
        supports=supports is not None,
        branch=branch != "stable",
        loads=loads is not None,
        max_shortening=max_shortening != math.inf,
    )
    return _followed(*_bounds(prism, min_height, max_load, max_height, past_contact))


def _refuse(of: object, **given: bool) -> None:
    """Refuse arguments that were given, though they do not belong to a path of this kind."""
    for name, was_given in given.items():
        if was_given:
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
        As in `equilibrium_path`, the same for all prisms.
    executor : concurrent.futures.Executor, optional
        Whose workers follow the paths, some at a time: a pool of processes, or others as of
        `sweep`.  By default they are followed here: a path takes a quarter of a millisecond, most
        of it where Python lets one thread work alone.

    Returns
    -------
    list of EquilibriumPath
        In the order of the prisms, each as `equilibrium_path` gives it.

    Raises
    ------
    TensegrityError
        As `equilibrium_path`, before any path is followed: if one of `prisms` is no Prism, or a
        bound is outside its range for one of them; or if `executor` is none.

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
    if executor is not None:
        check.kind("executor", executor, Executor)
    found = [_followed(*one) for one in bounds[:1]]  # what all of them need is made here
    parts = [bounds[k : k + PART] for k in range(1, len(bounds), PART)]
    with progress(len(given), "path") as bar:
        for part in (map if executor is None else executor.map)(_all_followed, parts):
            found += part
            bar.update(len(part))
    return found


def _all_followed(bounds: list[Any]) -> list[EquilibriumPath]:
    return [_followed(*one) for one in bounds]


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
        found = rigid_path(prism, min_height, max_load, max_height)
    else:
        found = elastic_path(prism, min_height, max_load, max_height, past_contact)
    return _path(prism, *found, past_contact)


def _path(
    prism: Prism,
    parts: Sequence[Columns],
    events: Iterable[Found],
    end: str,
    upright: bool,
    past_contact: bool,
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
    return EquilibriumPath(prism, columns, listed, ENDS[end], UPRIGHT if upright else "")
