"""Which branch of a structure's path goes on where strings go slack or taut, or a mode is lost.

At a corner some strings are at their natural length.  For small steps the energy is piecewise
quadratic, so each branch is a ray, along which each of these strings either lengthens (and is
taut) or shortens (and is slack): a linear solve for each choice, and a check of its signs.

Beyond a bifurcation, or a corner that no stable ray leaves, the branch of the one mode that is lost
is looked for at a given amplitude (Keller 1977): so is found what lasts for less than any step.
Else, a little beyond the point, the energy is minimised at a given value of the last unknown, from
starts along every direction without stiffness, of every set of the strings at natural length there
that may be taut.  A minimum belongs to a branch that leaves the point only if it comes nearer as
the step beyond it shrinks; where there is none, the structure snaps.  Minima that are not isolated
to round-off (as on a ring of eight equal bars) are not found.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product
from operator import itemgetter

import numpy as np

from tensegrity.branches.continuation import Settings
from tensegrity.branches.many import ManyProblem
from tensegrity.minimum import least_part
from tensegrity.structures.equations import Loading, Piece
from tensegrity.structures.members import Members
from tensegrity.structures.supports import NOTHING
from tensegrity.typing import Array, Flags, Indices

ALL = 10  # strings at a corner up to which all choices are tried
TRIES = 200  # choices to start from where there are more
SAME = 1e-9  # rates and energies that differ by less, relative to their size, are equal
NEAR = 1e-4  # of the size of the structure: a branch is looked for here, a jump is none below
BEYOND = (1e-7, 1e-5, 1e-3)  # steps beyond the point, over the size of the structure
SOFT = 1e-6  # stiffness of a direction that counts as lost, over the largest
DIRECTIONS = 6  # of starts for each direction without stiffness, where there are several
AMPLITUDES = (0.1, 1.0)  # of starts, over the root of the step: a pitchfork opens as that does
ALIKE = 1e-3  # directions whose cosine is nearer to 1 are one
OTHER = 4.0  # times as far as the nearest: minima of branches that leave with it
SHRUNK = 0.8  # of the distance after a step of a quarter: 1/2 at a pitchfork, 1/4 elsewhere
ITERATIONS = 200
SETTLED, CALM = (0.1, 1e-2, 1e-3), 3  # last moves there over the distance, and how many
ROUND_OFF = 1e-14  # of the largest eigenvalue
FAR = 0.1  # of the size of the structure: a minimum farther away is no branch from here
NONE = np.zeros(0, dtype=np.int64)


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
        scattered_forces = piece.tensions(u + step * rate * sense) - piece.tensions(
            u - step * rate * sense
        )
        slope = float(-loading.change @ scattered_forces) / (2 * step)
        inner = stiff
    else:
        slope = float(rate[-2] * sense)
        inner = stiff[:-1, :-1]
    stable = bool(np.linalg.eigvalsh(inner)[0] > 0) if len(inner) else True
    return Ray(choice, sense, slope, stable), longer


def piece_stretch(loading: Loading, u: Array, taut: Flags) -> Array:
    """Stretch of the members at a point, (members,)."""
    return Piece(loading, taut, NONE, np.zeros(len(taut))).stretch(u)


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
            if np.abs(found @ one).max() < 1 - ALIKE:
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
