"""Branches of an equilibrium path beyond a change of active set, and beyond a bifurcation.

Where strings are at their natural length (the critical strings) the set of taut strings may
change; it is the same with bars at their buckling load and with kinks of laws, and `above` says
which kinks the members are above.  The energy is piecewise quadratic for small steps, so that each
branch leaves the point along a ray, on which each critical string either lengthens and is taut, or
shortens and is slack.
Each choice takes one linear solve and a check of these signs.

Beyond a bifurcation, or where no stable ray leaves a change of active set, the branch along a
single critical mode is computed at a given amplitude (Keller 1977), which also finds branches
shorter than any step.  Otherwise the energy is minimised at a last unknown slightly beyond the
point, starting along every direction without stiffness, for every admissible set of taut strings.
A minimum belongs to a branch from the point only if it approaches the point as that step shrinks;
if there is none, the structure snaps.  Minima that are not isolated to round-off, as on a ring of
eight equal bars, are not found.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from operator import itemgetter

import numpy as np

from tensegrity.branches.continuation import Settings
from tensegrity.branches.steppers import ManyProblem
from tensegrity.minimum import least_part
from tensegrity.structures.equations import SmoothPiece
from tensegrity.structures.loading import Loading
from tensegrity.structures.members import Members
from tensegrity.structures.supports import NEGLIGIBLE
from tensegrity.typing import Array, Flags, Indices

ALL = 10  # number of critical strings up to which all choices are tried
TRIES = 200  # random initial choices for larger numbers
SAME = 1e-9  # relative difference below which rates and energies are equal
NEAR = 1e-4  # amplitude of the search for a branch, over the size; smaller jumps are followed
BEYOND = (1e-7, 1e-5, 1e-3)  # steps beyond the point, over the size of the structure
SOFT = 1e-6  # stiffness, over the largest, below which a direction counts as critical
DIRECTIONS = 6  # starts per critical direction, if there are several
AMPLITUDES = (0.1, 1.0)  # of starts, over the square root of the step as at a pitchfork
ALIKE = 1e-3  # distance of a cosine from 1 below which two directions are one
OTHER = 4.0  # distance over that of the nearest minimum, up to which minima are compared
SHRUNK = 0.8  # largest ratio of distances when the step is quartered: 1/2 at a pitchfork
ITERATIONS = 200
SETTLED, CALM = (0.1, 1e-2, 1e-3), 3  # final moves over the distance, and their number
ROUND_OFF = 1e-14  # of the largest eigenvalue
FAR = 0.1  # of the size of the structure: largest distance of a minimum from the point
NONE = np.zeros(0, dtype=np.int64)


@dataclass(frozen=True)
class OutgoingBranch:
    """A branch that leaves a change of active set.

    Attributes
    ----------
    above : ndarray of bool, (kinks,)
    sense : int
        1 if the last unknown grows along it, else -1.
    slope : float
        Second derivative of the energy in the last unknown; the smallest gives the least energy.
    stable : bool
        Whether the energy has a minimum there for a given last unknown.
    """

    above: Flags
    sense: int
    slope: float
    stable: bool


def outgoing(
    loading: Loading, u: Array, above: Flags, critical: Indices, incoming: int = 0
) -> list[OutgoingBranch]:
    """Branches that leave a point where members are at the kinks `critical`.

    Parameters
    ----------
    loading : Loading
    u : ndarray
        Unknowns at the point.
    above : ndarray of bool, (kinks,)
        Which kinks the members are above before it.
    critical : ndarray of int
    incoming : int, optional
        Sense in which the last unknown changed before it; 0 at the start of a path.

    Returns
    -------
    list of OutgoingBranch
        The branches on which the last unknown continues in that sense; if there are none, those
        on which it reverses, except the incoming one.
    """
    branches: list[OutgoingBranch] = []
    for sense in (-1, 1) if incoming < 0 else (1, -1):
        for choice in choices(loading, u, above, critical, sense):
            if sense == -incoming and (choice == above).all():
                continue
            leaving = _outgoing_branch(loading, u, choice, critical, sense)
            if leaving is not None:
                branches.append(leaving[0])
        if branches:
            break
    return branches


def selected(
    branches: list[OutgoingBranch], branch: str, critical: Indices
) -> OutgoingBranch | None:
    """The branch that a path follows.

    Parameters
    ----------
    branches : list of OutgoingBranch
    branch : {"stable", "symmetric"}
    critical : ndarray of int
        Kinks at which members are.

    Returns
    -------
    OutgoingBranch or None
        "symmetric": one on which all critical kinks are on the same side, if there is one.
        Otherwise the stable one of least energy; None if no branch leaves.
    """
    if not branches:
        return None
    if branch == "symmetric":
        for state in (False, True):
            for leaving in branches:
                if (leaving.above[critical] == state).all():
                    return leaving
    lowest = [r for r in branches if r.stable] or branches
    least = min(r.slope for r in lowest)
    return next(r for r in lowest if r.slope <= least + SAME * max(abs(least), 1e-300))


def choices(
    loading: Loading, u: Array, above: Flags, critical: Indices, sense: int
) -> Iterator[Flags]:
    """The candidate sides of the critical kinks.

    Parameters
    ----------
    loading : Loading
    u : ndarray
        Unknowns at the point.
    above : ndarray of bool, (kinks,)
        Which kinks the members are above before it.
    critical : ndarray of int
        Kinks at which members are.
    sense : int
        Sense of the last unknown, 1 or -1.

    Yields
    ------
    ndarray of bool, (kinks,)
        Every choice for the critical kinks; if they are more than `ALL`, the fixed points of
        an iteration on the signs of their rates.
    """
    if len(critical) <= ALL:
        for states in product((False, True), repeat=len(critical)):
            choice = above.copy()
            choice[critical] = states
            yield choice
        return
    rng, seen = np.random.default_rng(0), set()
    starts = [np.zeros(len(critical), bool), np.ones(len(critical), bool)]
    starts += [rng.random(len(critical)) < 0.5 for _ in range(TRIES)]
    for states in starts:
        for _ in range(30):
            choice = above.copy()
            choice[critical] = states
            leaving = _outgoing_branch(loading, u, choice, critical, sense, check=False)
            if leaving is None:
                break
            new = leaving[1] > 0
            if (new == states).all():
                if states.tobytes() not in seen:
                    seen.add(states.tobytes())
                    yield choice
                break
            states = new


def _outgoing_branch(
    loading: Loading, u: Array, choice: Flags, critical: Indices, sense: int, check: bool = True
) -> tuple[OutgoingBranch, Array] | None:
    """The branch of a choice, and the rates of its critical members; None if signs disagree."""
    piece = SmoothPiece(loading, choice, critical, strains_at(loading, u, choice))
    _, jacobian = piece.linearised(u)
    try:
        rate = np.append(np.linalg.solve(jacobian[:, :-1], -jacobian[:, -1]), 1.0) * sense
    except np.linalg.LinAlgError:
        return None
    if not np.isfinite(rate).all() or np.abs(rate / piece.scale).max() > 1e8 / piece.scale[-1]:
        return None
    numbers = piece.leaving
    longer = np.array([piece.strain_gradient(u, n) @ rate for n in numbers])
    size = SAME * (np.abs(longer).max(initial=0.0) + 1e-300)
    wanted = np.where(choice[critical], longer >= -size, longer <= size)
    if check and not wanted.all():
        return None
    if not least_part(jacobian[:, :-1] * piece.scale[:-1]) > NEGLIGIBLE:
        return None  # a motion has no stiffness beyond: the branch is not unique
    stiff = piece.tangent(u)
    if loading.pattern is None:
        step = 1e-6
        after, before = (piece.winding(u + x * rate * sense) for x in (step, -step))
        slope = float(-loading.change @ (after - before)) / (2 * step)
        inner = stiff
    else:
        slope = float(rate[-2] * sense)
        inner = stiff[:-1, :-1]
    stable = bool(np.linalg.eigvalsh(inner)[0] > 0) if len(inner) else True
    return OutgoingBranch(choice, sense, slope, stable), longer


def strains_at(loading: Loading, u: Array, above: Flags) -> Array:
    """Strains of the members beyond their kinks at a point.

    Parameters
    ----------
    loading : Loading
    u : ndarray
        Unknowns.
    above : ndarray of bool, (kinks,)

    Returns
    -------
    ndarray, (kinks,)
    """
    return SmoothPiece(loading, above, NONE, np.zeros(len(above))).strains(u)


def stable_branch_beyond(piece: SmoothPiece, u: Array, critical: Indices = NONE) -> Array | None:
    """A point of the stable branch slightly beyond a bifurcation or a change of active set.

    Parameters
    ----------
    piece : SmoothPiece
        The piece that leads to the point.
    u : ndarray
        Unknowns at the point.
    critical : ndarray of int, optional
        Kinks at which members are there.

    Returns
    -------
    ndarray or None
        Unknowns, or None if no stable branch is found.
    """
    loading, count = piece.loading, piece.loading.free - (piece.loading.pattern is not None)
    starts = _soft_directions(piece, u, critical, count)
    if len(starts) == 3 and not len(critical):
        for start in starts[1:]:
            x = _branch_along_mode(piece, u, start)
            if x is not None:
                return x
    across = (loading.motions @ loading.basis)[:, :count]
    for step, least in zip(BEYOND, SETTLED, strict=True):
        x, nearer = (
            _lowest_minimum(loading, u, starts, across, part * step, least) for part in (1.0, 0.25)
        )
        if x is None or nearer is None:
            continue
        far, close = (np.linalg.norm((at - u)[:count]) for at in (x, nearer))
        return x if close < SHRUNK * far or far <= NEAR * loading.span else None
    return None


def _soft_directions(piece: SmoothPiece, u: Array, critical: Indices, count: int) -> Array:
    """Zero, then the unit directions without stiffness in both senses, (starts, count)."""
    rng, directions = np.random.default_rng(0), [np.zeros(count)]
    for above in choices(piece.loading, u, piece.above, critical, 1):
        tangent = SmoothPiece(piece.loading, above, NONE, np.zeros(0)).tangent(u)[:count, :count]
        values, modes = np.linalg.eigh(tangent)
        number = int(np.sum(values <= SOFT * piece.loading.members.stiffness.max()))
        number = max(number, int((above == piece.above).all()))
        parts = rng.standard_normal((DIRECTIONS * number, number)) if number > 1 else np.eye(number)
        for one in parts / np.linalg.norm(parts, axis=1, keepdims=True) @ modes[:, :number].T:
            if np.abs(directions @ one).max() < 1 - ALIKE:
                directions += [one, -one]
    return np.array(directions)


def _branch_along_mode(piece: SmoothPiece, u: Array, start: Array) -> Array | None:
    """The point at amplitude `NEAR` of the branch that leaves u along one mode; None if there is
    none, or it is unstable or not beyond u."""
    stepper = ManyProblem(piece)
    z, count = np.arcsinh(u / stepper.scale), len(start)
    normal = np.zeros(stepper.m)
    normal[:count] = start / (np.cosh(z) * stepper.scale)[:count]
    normal /= np.linalg.norm(normal)
    point = stepper.corrected(z + NEAR * normal, normal, None)
    x = stepper.unknowns(point[: stepper.m])
    if not (point[stepper.residual] <= Settings.residual and x[-1] > u[-1]):
        return None
    same = (piece.strains(x) >= 0) == piece.above
    values = np.linalg.eigvalsh(piece.tangent(x)[:count, :count])
    return x if same.all() and values[0] > ROUND_OFF * values[-1] else None


def _lowest_minimum(
    loading: Loading, u: Array, starts: Array, across: Array, part: float, least: float
) -> Array | None:
    """The lowest of the nearest minima, for a last unknown that exceeds that of u by a fraction
    `part` of the size; None if there is none."""
    beyond = u.copy()
    beyond[-1] += part * (1.0 if loading.pattern is None else loading.span)
    members = loading.members_at(beyond[-1])
    begin, minima = loading.positions_at(beyond), []
    for amplitude in AMPLITUDES:
        for start in starts:
            moved = across @ (amplitude * np.sqrt(part) * loading.span * start)
            from_here = begin + moved.reshape(begin.shape)
            settled = _minimum_from(loading, members, across, begin, from_here, least)
            minima += [(np.linalg.norm(settled[0] - begin), *settled)] if settled else []
    if not minima:
        return None
    nearest = min(one[0] for one in minima)
    away, x, _, softest = min(
        (one for one in minima if one[0] <= OTHER * nearest), key=itemgetter(2)
    )
    for moved in (away / 4 * softest, -away / 4 * softest):
        from_here = x + (across @ moved).reshape(x.shape)
        again = _minimum_from(loading, members, across, begin, from_here, least)
        if again is None or np.linalg.norm(again[0] - x) > away / 10:
            return None  # with slack strings equilibria form a continuum
    beyond[: across.shape[1]] = across.T @ (x - loading.positions).ravel()
    if loading.pattern is not None:
        beyond[-2] = (loading.motions @ loading.basis[:, -1]) @ (
            members.gradient(x) - loading.dead
        ).ravel()
    return beyond


def _minimum_from(
    loading: Loading, members: Members, across: Array, begin: Array, x: Array, settled: float
) -> tuple[Array, float, Array] | None:
    """The minimum of the energy near x over the motions `across`, its energy and softest mode.

    Newton's method in the eigenmodes of the tangent, within a trust region; strings go slack and
    taut on the way.
    """
    small = BEYOND[0] * loading.span
    radius = max(np.abs(x - begin).max(), small)
    energy, calm = _energy(loading, members, x), 0
    for _ in range(ITERATIONS):
        values, modes = np.linalg.eigh(across.T @ (members.tangent(x) @ across))
        slope = modes.T @ (across.T @ (members.gradient(x) - loading.dead).ravel())
        least = ROUND_OFF * np.abs(values).max()
        if not least > 0:
            return None
        step = -slope / np.maximum(np.abs(values), least)
        move = np.clip(step, -radius, radius)
        new = x + (across @ (modes @ move)).reshape(x.shape)
        after, away = _energy(loading, members, new), np.abs(new - begin).max()
        if away > FAR * loading.span:
            return None
        if after > energy + ROUND_OFF * abs(energy):
            radius = np.abs(move).max() / 4
            continue
        calm = calm + 1 if np.abs(step).max() <= settled * max(away, small) else 0
        if calm == CALM:
            return (new, after, modes[:, 0]) if values[0] > least else None
        x, energy, radius = new, after, 2 * radius
    return None


def _energy(loading: Loading, members: Members, x: Array) -> float:
    return members.energy(x) - float(np.sum(loading.dead * x))
