"""The stable branch that leaves a bifurcation, or a corner that no stable ray leaves.

Where one mode is lost, its branch is looked for at a given amplitude (Keller 1977): so is found
what lasts for less than any step.  Else, a little beyond the point, the energy is minimised at a
given value of the last unknown, from starts along every direction without stiffness, of every set
of the strings at natural length there that may be taut.  A minimum belongs to a branch that leaves
the point only if it comes nearer as the step beyond it shrinks; where there is none, the structure
snaps.  Minima that are not isolated to round-off (as on a ring of eight equal bars) are not found.
"""

from __future__ import annotations

from dataclasses import replace
from operator import itemgetter
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.branches.continuation import Settings
from tensegrity.branches.many import ManyProblem
from tensegrity.structures.corner import choices
from tensegrity.structures.equations import Piece

if TYPE_CHECKING:
    from tensegrity.structures.equations import Loading
    from tensegrity.structures.members import Members
    from tensegrity.typing import Array, Indices

NEAR = 1e-4  # of the size of the structure: a branch is looked for here, a jump is none below
BEYOND = (1e-7, 1e-5, 1e-3)  # steps beyond the point, over the size of the structure
SOFT = 1e-6  # stiffness of a direction that counts as lost, over the largest
DIRECTIONS = 6  # of starts for each direction without stiffness, where there are several
AMPLITUDES = (0.1, 1.0)  # of starts, over the root of the step: a pitchfork opens as that does
SAME = 1e-3  # directions whose cosine is nearer to 1 are one
OTHER = 4.0  # times as far as the nearest: minima of branches that leave with it
SHRUNK = 0.8  # of the distance after a step of a quarter: 1/2 at a pitchfork, 1/4 elsewhere
ITERATIONS = 200
SETTLED, CALM = (0.1, 1e-2, 1e-3), 3  # last moves there over the distance, and how many
ROUND_OFF = 1e-14  # of the largest eigenvalue
FAR = 0.1  # of the size of the structure: a minimum farther away is no branch from here
NONE = np.zeros(0, dtype=np.int64)


def branches_off(piece: Piece, u: Array, corner: Indices = NONE) -> Array | None:
    """A point of the stable branch a little beyond u, or None.

    Parameters
    ----------
    piece : Piece
        That led there.
    u : ndarray
        A bifurcation or a corner.
    corner : ndarray of int, optional
        Strings at natural length there.
    """
    of, count = piece.of, piece.of.free - (piece.of.pattern is not None)
    starts = _directions(piece, u, corner, count)
    if len(starts) == 3 and not len(corner):
        for start in starts[1:]:
            x = _opened(piece, u, start)
            if x is not None:
                return x
    across = (of.motions @ of.basis)[:, :count]
    for step, least in zip(BEYOND, SETTLED, strict=True):
        x, nearer = (_lowest(of, u, starts, across, part * step, least) for part in (1.0, 0.25))
        if x is None or nearer is None:
            continue
        far, close = (np.linalg.norm((at - u)[:count]) for at in (x, nearer))
        return x if close < SHRUNK * far or far <= NEAR * of.span else None
    return None


def _directions(piece: Piece, u: Array, corner: Indices, count: int) -> Array:
    """Unit directions without stiffness in both senses, (starts, count); the first is zero."""
    rng, found = np.random.default_rng(0), [np.zeros(count)]
    for taut in choices(piece.of, u, piece.taut, corner, 1):
        tangent = Piece(piece.of, taut, NONE, np.zeros(0)).tangent(u)[:count, :count]
        values, modes = np.linalg.eigh(tangent)
        number = int(np.sum(values <= SOFT * piece.of.members.stiffness.max()))
        number = max(number, int((taut == piece.taut).all()))
        parts = rng.standard_normal((DIRECTIONS * number, number)) if number > 1 else np.eye(number)
        for one in parts / np.linalg.norm(parts, axis=1, keepdims=True) @ modes[:, :number].T:
            if np.abs(found @ one).max() < 1 - SAME:
                found += [one, -one]
    return np.array(found)


def _opened(piece: Piece, u: Array, start: Array) -> Array | None:
    """The point of the branch that leaves u along one mode, at the amplitude `NEAR`; None where
    there is none, or none that is stable and beyond u."""
    machine = ManyProblem(piece)
    z, count = np.arcsinh(u / machine.scale), len(start)
    normal = np.zeros(machine.m)
    normal[:count] = start / (np.cosh(z) * machine.scale)[:count]
    normal /= np.linalg.norm(normal)
    point = machine.at(z + NEAR * normal, normal, None)
    x = machine.unknowns(point[: machine.m])
    if not (point[machine.residual] <= Settings.residual and x[-1] > u[-1]):
        return None
    same = (~piece.of.members.pulls_only | (piece.stretch(x) >= 0)) == piece.taut
    values = np.linalg.eigvalsh(piece.tangent(x)[:count, :count])
    return x if same.all() and values[0] > ROUND_OFF * values[-1] else None


def _lowest(
    of: Loading, u: Array, starts: Array, across: Array, part: float, least: float
) -> Array | None:
    """The lowest of the nearest minima from the starts, a part of its size beyond u."""
    beyond = u.copy()
    beyond[-1] += part * (1.0 if of.pattern is None else of.span)
    members = replace(of.members, natural=of.members.natural + beyond[-1] * of.change)
    begin, found = of.at(beyond), []
    for amplitude in AMPLITUDES:
        for start in starts:
            moved = across @ (amplitude * np.sqrt(part) * of.span * start)
            from_here = begin + moved.reshape(begin.shape)
            settled = _settled(of, members, across, begin, from_here, least)
            found += [(np.linalg.norm(settled[0] - begin), *settled)] if settled else []
    if not found:
        return None
    nearest = min(one[0] for one in found)
    away, x, _, softest = min(
        (one for one in found if one[0] <= OTHER * nearest), key=itemgetter(2)
    )
    for moved in (away / 4 * softest, -away / 4 * softest):
        from_here = x + (across @ moved).reshape(x.shape)
        again = _settled(of, members, across, begin, from_here, least)
        if again is None or np.linalg.norm(again[0] - x) > away / 10:
            return None  # slack strings leave a set of equilibria: none is determined
    beyond[: across.shape[1]] = across.T @ (x - of.positions).ravel()
    if of.pattern is not None:
        beyond[-2] = (of.motions @ of.basis[:, -1]) @ (members.gradient(x) - of.dead).ravel()
    return beyond


def _settled(
    of: Loading, members: Members, across: Array, begin: Array, x: Array, settled: float
) -> tuple[Array, float, Array] | None:
    """The minimum of the energy next to x over the motions `across`, that energy and softest mode.

    Newton's method, mode by mode of the tangent, within a region that grows and shrinks; strings
    are slack or taut as they are.
    """
    small = BEYOND[0] * of.span
    radius = max(np.abs(x - begin).max(), small)
    energy, calm = _energy(of, members, x), 0
    for _ in range(ITERATIONS):
        values, modes = np.linalg.eigh(across.T @ (members.tangent(x) @ across))
        slope = modes.T @ (across.T @ (members.gradient(x) - of.dead).ravel())
        least = ROUND_OFF * np.abs(values).max()
        if not least > 0:
            return None
        step = -slope / np.maximum(np.abs(values), least)
        move = np.clip(step, -radius, radius)
        new = x + (across @ (modes @ move)).reshape(x.shape)
        after, away = _energy(of, members, new), np.abs(new - begin).max()
        if away > FAR * of.span:
            return None
        if after > energy + ROUND_OFF * abs(energy):
            radius = np.abs(move).max() / 4
            continue
        calm = calm + 1 if np.abs(step).max() <= settled * max(away, small) else 0
        if calm == CALM:
            return (new, after, modes[:, 0]) if values[0] > least else None
        x, energy, radius = new, after, 2 * radius
    return None


def _energy(of: Loading, members: Members, x: Array) -> float:
    return members.energy(x) - float(np.sum(of.dead * x))
