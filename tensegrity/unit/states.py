"""Unloaded equilibria of a unit, stable or not: Newton's method from many points of a box.

The points are those of the additive recurrence with the generalized golden ratio (M. Roberts, The
unreasonable effectiveness of quasirandom sequences, 2018), which fill a box of any dimension.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from tensegrity import check
from tensegrity.branches.table import Event
from tensegrity.errors import TensegrityError
from tensegrity.root import root
from tensegrity.unit import rest as at_rest
from tensegrity.unit.forms import changes, is_stiff, numbers
from tensegrity.unit.path import functions, stable
from tensegrity.unit.rest import Described

if TYPE_CHECKING:
    from collections.abc import Mapping

    from tensegrity.typing import Array

NOTHING: dict[Any, Any] = {}
STARTS = 400  # for each coordinate
ITERATIONS = 60
LONGEST = 0.1  # step, over the width of the box
BALANCED = 5  # passes that scale a matrix
SETTLED = 1e-12  # last step over the width of the box
SAME = 1e-7  # distance over the width of the box, below which states are one


def equilibria(unit: Described, given: Mapping[Any, Any] | None) -> tuple[Event, ...]:
    """See `Unit.equilibria`."""
    low, high = np.array(box_of(unit, given or {})).T
    start = np.array(at_rest.coordinates(unit))
    dim, free, p = len(start), len(unit.inner), numbers(unit)
    width, of = high - low, functions(unit)
    size = dim + sum(is_stiff(unit))
    z = np.zeros((STARTS * dim + 1, size))
    places = np.array([*range(free), size - 1])
    z[1:, places] = low + _spread(STARTS * dim, dim) * width - start
    for _ in range(ITERATIONS):
        each = _taut(unit, of("tensions", z, p), p)
        gradient, matrix = of("gradient", z, each), of("tangent", z, each).reshape(-1, size, size)
        good = np.isfinite(gradient).all(axis=1) & np.isfinite(matrix).all(axis=(1, 2))
        z, gradient, matrix = z[good], gradient[good], matrix[good]
        move = _newton(matrix, gradient)
        longest = np.abs(move[:, places] / width).max(axis=1)
        z = z - move * np.minimum(1, LONGEST / np.maximum(longest, 1e-300))[:, None]
        z = z[(np.abs(z[:, places] + start - (low + high) / 2) <= 2 * width).all(axis=1)]
        if not len(z):
            break
    each = _taut(unit, of("tensions", z, p), p)
    gradient, matrix = of("gradient", z, each), of("tangent", z, each).reshape(-1, size, size)
    move = _newton(matrix, gradient)
    at = z[:, places] + start
    inside = (at > low + SAME * width) & (at <= high)
    found = (np.abs(move[:, places]) <= SETTLED * width).all(axis=1) & inside.all(axis=1)
    z, each, at = z[found], each[found], at[found]
    kept: list[int] = []
    for k in np.lexsort(-at.T).tolist():
        if all(np.abs((at[k] - at[j]) / width).max() > SAME for j in kept):
            kept.append(k)
    states = []
    for row, k in enumerate(kept):
        by_load, _ = stable(unit, z[k : k + 1], each[k])
        names = [*map(str, unit.coordinates)]
        state: dict[str, Any] = dict(zip(names[-1:] + names[:-1],
                                         np.roll(at[k], 1).tolist(), strict=True))  # fmt: skip
        (energy,) = of("energy", z[k], each[k]).tolist()
        state |= {"energy": energy + 0.0, "stable": bool(by_load[0])}
        states.append(Event("equilibrium", row, state))
    return tuple(states)


def _taut(unit: Described, tensions: Array, p: Array) -> Array:
    """Parameters for each state, in which strings that would be compressed do not act."""
    members = len(unit.members)
    each, active = np.tile(p, (len(tensions), 1)), len(p) - 2 * members
    scale = np.abs(tensions).max(axis=1, initial=0.0)
    for k, member in enumerate(unit.members):
        if member.string:
            each[:, active + k] = tensions[:, k] >= -1e-12 * scale
    return each


def _newton(matrix: Array, gradient: Array) -> Array:
    """Newton steps (n, m), with the matrices' rows and columns scaled to the same largest element,
    so that neither the units of lengths nor those of forces decide what is singular."""
    d = np.ones_like(gradient)
    for _ in range(BALANCED):
        largest = np.abs(matrix * d[:, :, None] * d[:, None]).max(axis=2)
        d /= np.sqrt(np.where(largest > 0, largest, 1.0))
    inverse = np.linalg.pinv(matrix * d[:, :, None] * d[:, None], rcond=1e-14)
    return np.asarray(d * (inverse @ (d * gradient)[..., None])[..., 0])


def _spread(count: int, dim: int) -> Array:
    """Points that fill the unit cube, (count, dim)."""
    ratio = root(lambda x: x ** (dim + 1) - x - 1, 1.0, 2.0)
    steps = ratio ** -np.arange(1.0, dim + 1)
    return np.asarray((0.5 + np.arange(1, count + 1)[:, None] * steps) % 1.0)


def box_of(
    unit: Described, given: Mapping[Any, Any] = NOTHING, reach: float = 2.0
) -> list[tuple[float, float]]:
    """Lowest and highest value of each coordinate.

    Parameters
    ----------
    unit, given
        See `Unit.equilibria`.
    reach : float, optional
        Largest value over that at rest.

    Returns
    -------
    list of (float, float)

    Raises
    ------
    TensegrityError
        `given` is not as described.
    """
    wanted = {str(name): x for name, x in given.items()}
    unknown = wanted.keys() - {str(q) for q in unit.coordinates}
    if unknown:
        raise TensegrityError(f"box: {check.shown(min(unknown))} is no coordinate of the unit")
    start = at_rest.coordinates(unit)
    largest = max(map(abs, start)) or 1.0
    box = []
    for k, (q, at) in enumerate(zip(unit.coordinates, start, strict=True)):
        size = abs(at) or largest
        if str(q) in wanted:
            ends = check.sequence(f"box of {q}", wanted[str(q)], "two numbers")
            if len(ends) != 2:
                raise TensegrityError(f"box of {q} {check.shown(ends)} must be two numbers")
            low = check.number(f"box of {q}", ends[0])
            box.append((low, check.number(f"box of {q}", ends[1], above=low)))
        elif changes(unit).angles[k]:
            inside = 0 < at < math.pi
            box.append((0.0, math.pi) if inside else (at - math.pi, at + math.pi))
        elif q.is_positive or (at > 0 and _is_even(unit, q)):
            box.append((0.0, reach * size))
        else:
            box.append((-reach * size, reach * size))
    return box


def _is_even(unit: Described, q: Any) -> bool:
    """Whether the sign of a coordinate changes no length and no energy."""
    forms = [unit.energy, *(member.length for member in unit.members)]
    return all(form.xreplace({q: -q}) == form for form in forms)
