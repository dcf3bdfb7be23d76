"""Where strings go slack or taut: which branches leave a corner of a path.

At a corner some strings are at their natural length.  For small steps the energy is piecewise
quadratic, so each branch is a ray, along which each of these strings either lengthens (and is
taut) or shortens (and is slack): a linear solve for each choice, and a check of its signs.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.minimum import least_part
from tensegrity.structures.equations import Piece
from tensegrity.structures.supports import NOTHING

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tensegrity.structures.equations import Loading
    from tensegrity.typing import Array, Flags, Indices

ALL = 10  # strings at a corner up to which all choices are tried
TRIES = 200  # choices to start from where there are more
SAME = 1e-9  # rates and energies that differ by less, relative to their size, are equal


@dataclass(frozen=True)
class Ray:
    """A branch that leaves a corner.

    Attributes
    ----------
    taut : ndarray of bool, (members,)
    sense : int
        1 where the last unknown grows along it, else -1.
    slope : float
        Second derivative of the energy in the last unknown: smaller is lower.
    stable : bool
        Whether it is a minimum of the energy where the last unknown is given.
    """

    taut: Flags
    sense: int
    slope: float
    stable: bool


def rays(loading: Loading, u: Array, taut: Flags, corner: Indices, arrived: int = 0) -> list[Ray]:
    """Branches that leave a point at which the strings of `corner` are at natural length.

    Parameters
    ----------
    loading : Loading
    u : ndarray
        Unknowns there.
    taut : ndarray of bool, (members,)
        Before it.
    corner : ndarray of int
    arrived : int, optional
        Sense in which the last unknown changed before it; 0 at the start of a path.

    Returns
    -------
    list of Ray
        Those on which it goes on in that sense; if there are none, those on which it turns back,
        other than the one that led here.
    """
    found: list[Ray] = []
    for sense in (-1, 1) if arrived < 0 else (1, -1):
        for choice in choices(loading, u, taut, corner, sense):
            if sense == -arrived and (choice == taut).all():
                continue
            ray = _ray(loading, u, choice, corner, sense)
            if ray is not None:
                found.append(ray[0])
        if found:
            break
    return found


def chosen(found: list[Ray], branch: str, corner: Indices) -> Ray | None:
    """The ray that a path follows; None where none leaves the corner."""
    if not found:
        return None
    if branch == "symmetric":
        for state in (False, True):
            for ray in found:
                if (ray.taut[corner] == state).all():
                    return ray
    lowest = [r for r in found if r.stable] or found
    least = min(r.slope for r in lowest)
    return next(r for r in lowest if r.slope <= least + SAME * max(abs(least), 1e-300))


def choices(
    loading: Loading, u: Array, taut: Flags, corner: Indices, sense: int
) -> Iterator[Flags]:
    """Which strings may be taut; where they are too many, those that iteration settles on."""
    if len(corner) <= ALL:
        for states in product((False, True), repeat=len(corner)):
            choice = taut.copy()
            choice[corner] = states
            yield choice
        return
    rng, seen = np.random.default_rng(0), set()
    starts = [np.zeros(len(corner), bool), np.ones(len(corner), bool)]
    starts += [rng.random(len(corner)) < 0.5 for _ in range(TRIES)]
    for states in starts:
        for _ in range(30):
            choice = taut.copy()
            choice[corner] = states
            ray = _ray(loading, u, choice, corner, sense, check=False)
            if ray is None:
                break
            new = ray[1] > 0
            if (new == states).all():
                if states.tobytes() not in seen:
                    seen.add(states.tobytes())
                    yield choice
                break
            states = new


def _ray(
    loading: Loading, u: Array, choice: Flags, corner: Indices, sense: int, check: bool = True
) -> tuple[Ray, Array] | None:
    """The ray of a choice and the rates of its strings; None where signs do not fit."""
    piece = Piece(loading, choice, corner, piece_stretch(loading, u, choice))
    _, jacobian = piece.linearised(u)
    try:
        rate = np.append(np.linalg.solve(jacobian[:, :-1], -jacobian[:, -1]), 1.0) * sense
    except np.linalg.LinAlgError:
        return None
    if not np.isfinite(rate).all() or np.abs(rate / piece.scale).max() > 1e8 / piece.scale[-1]:
        return None
    numbers = piece.leaving
    longer = np.array([piece.test_gradient(u, n) @ rate for n in numbers])
    size = SAME * (np.abs(longer).max(initial=0.0) + 1e-300)
    wanted = np.where(choice[corner], longer >= -size, longer <= size)
    if check and not wanted.all():
        return None
    if not least_part(jacobian[:, :-1] * piece.scale[:-1]) > NOTHING:
        return None  # a motion has no stiffness beyond: any ray would do
    stiff = piece.tangent(u)
    if loading.pattern is None:
        step = 1e-6
        pulls = piece.tensions(u + step * rate * sense) - piece.tensions(u - step * rate * sense)
        slope = float(-loading.change @ pulls) / (2 * step)
        inner = stiff
    else:
        slope = float(rate[-2] * sense)
        inner = stiff[:-1, :-1]
    stable = bool(np.linalg.eigvalsh(inner)[0] > 0) if len(inner) else True
    return Ray(choice, sense, slope, stable), longer


def piece_stretch(loading: Loading, u: Array, taut: Flags) -> Array:
    """Stretch of the members at a point, (members,)."""
    none = np.zeros(0, dtype=np.int64)
    return Piece(loading, taut, none, np.zeros(len(taut))).stretch(u)
