"""Equilibrium paths of prisms under axial load, and of structures under growing loads.

Each gives its problem, `prism.problem()` or `structure.problem()`, whose path `trace` follows.
Members have no thickness.  Strings carry tension only: cross strings of a prism go slack where the
bars meet (twist pi), where the path ends; base strings go slack where they unload (twist 2 pi/n),
beyond which the cross strings stand upright and alone carry the load.  Source: the talk, part III,
"Numerical approach".
"""

from __future__ import annotations

from collections.abc import Iterable
from concurrent.futures import Executor
from functools import cache, partial
from inspect import signature
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from tensegrity import check
from tensegrity.branches.problem import trace
from tensegrity.errors import TensegrityError
from tensegrity.notebook import progress
from tensegrity.prisms.prism import Prism

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from tensegrity.branches.problem import Traced
    from tensegrity.prisms.problem import EquilibriumPath

PART = 16  # paths per task of a worker
_Path = TypeVar("_Path", covariant=True)


class Given(Protocol[_Path]):
    """What gives a problem, by the kind of table that its path is."""

    def problem(self, *args: Any, **kwargs: Any) -> Traced[_Path]:
        """The problem, for the options of `equilibrium_path`."""


def equilibrium_path(
    prism: Given[_Path],
    *,
    until: Mapping[str, Any] | str | None = None,
    at: Mapping[str, Any] | None = None,
    **options: Any,
) -> _Path:
    """Equilibrium path of a prism or unit under axial load, or of a structure under growing loads.

    The path of a prism, or of a `Unit`, leads from the self-stressed state into compression and,
    on request, into tension.  A structure is compressed between plates or loaded at its nodes.

    Parameters
    ----------
    prism : Prism, Unit or Structure
        Or another object with a method `problem` that takes the options and returns a `Problem`.
    until, at : optional
        Values of columns, or the kind of event, at which the path ends, and values of columns of
        which the places become events; see `trace`.
    min_height : float, optional
        For a prism: height at which the path ends [m], >= 0.  For a unit, also of the other
        bounds, a value of the controlled coordinate.
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
    EquilibriumPath, UnitPath or StructurePath
        The path of a prism ends where the bars meet, where it is flat, or at a given bound.  Rows
        of a prism with rigid bases and bars are finite, up to a load of 1e6 k_cross base; its
        contact event has load = inf.
        Several threads may trace paths at once, and paths can be pickled.

    Raises
    ------
    TensegrityError
        If an option does not belong to a prism, or to a structure, or is outside its bounds:
        0 <= min_height < height < max_height, max_load > 0.

    Examples
    --------
    >>> from tensegrity import Prism, equilibrium_path
    >>> path = equilibrium_path(Prism(1.0, 0.7, 0.1, 1.0, k_base=20.0, k_bar=20.0))
    >>> [(event.kind, round(event.load, 4)) for event in path.events]
    [('fold', 1.2399), ('contact', 1.2384)]
    >>> print(path.end)
    the bars meet on the axis (twist pi)
    >>> path = equilibrium_path(path.prism, until={"load": 1.0}, at={"height": 0.5})
    >>> print(path.end, [(event.kind, round(event.cross_tension, 4)) for event in path.events])
    the requested load is reached [('height', 0.0496)]

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
    return trace(_problem(prism, options), until=until, at=at)


def _problem(prism: Any, options: Mapping[str, Any]) -> Any:
    """The problem of a prism or another object, which has to know the options."""
    kind: Any = type(prism)
    if not callable(getattr(kind, "problem", None)):
        check.kind("prism", prism, Prism)
    for name in options:
        if name not in _options(kind):
            raise TensegrityError(f"{name} does not belong to a path of a {kind.__name__}")
    return prism.problem(**options)


@cache
def _options(kind: type[Any]) -> tuple[str, ...]:
    return tuple(signature(kind.problem).parameters)[1:]


def equilibrium_paths(
    prisms: Iterable[Prism],
    *,
    executor: Executor | None = None,
    until: Mapping[str, Any] | str | None = None,
    at: Mapping[str, Any] | None = None,
    **options: Any,
) -> list[EquilibriumPath]:
    """Equilibria of many prisms.

    Parameters
    ----------
    prisms : iterable of Prism
    executor : concurrent.futures.Executor, optional
        Pool of workers that follow the paths in groups: a process pool, or any executor that
        `sweep` takes.  By default the paths are followed in the calling thread; a path takes a
        quarter of a millisecond, most of it under Python's global interpreter lock.
    until, at, **options : optional
        As for `equilibrium_path`, the same for all prisms.

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
    for prism in given:
        check.kind("prism", prism, Prism)
        _problem(prism, options)
    if executor is not None:
        check.kind("executor", executor, Executor)
    follow = partial(_all_followed, until=until, at=at, options=options)
    paths = follow(given[:1])  # compiles what all of them need
    parts = [given[k : k + PART] for k in range(1, len(given), PART)]
    with progress(len(given), "path") as bar:
        for part in (map if executor is None else executor.map)(follow, parts):
            paths += part
            bar.update(len(part))
    return paths


def _all_followed(
    prisms: Sequence[Prism], until: Any, at: Any, options: dict[str, Any]
) -> list[EquilibriumPath]:
    return [equilibrium_path(prism, until=until, at=at, **options) for prism in prisms]
