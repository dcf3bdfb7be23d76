"""The stable branch that leaves a bifurcation at which a path loses stability.

A little beyond the bifurcation the energy is minimised at a given value of the last unknown, from
starts along the modes that were lost.  A minimum belongs to a branch that leaves the bifurcation
only if it comes nearer as the step beyond it shrinks; else the structure snaps.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tensegrity.structures.equations import Piece

if TYPE_CHECKING:
    from tensegrity.typing import Array

BEYOND = 1e-4  # first step beyond the bifurcation, over the size of the structure
DIRECTIONS = 6  # of starts in the plane of two modes
SHRUNK = 0.8  # of the distance after a step of a quarter: 1/2 at a pitchfork, 1/4 elsewhere
ITERATIONS = 60
FAR = 0.1  # of the size of the structure: a minimum farther away is no branch from here


def branches_off(piece: Piece, u: Array, tangent: Array) -> Array | None:
    """A point of the stable branch a little beyond a bifurcation, or None."""
    values, modes = np.linalg.eigh(tangent)
    near = modes[:, np.abs(values) <= 1e-6 * np.abs(values).max()]
    if not near.shape[1]:
        near = modes[:, :1]
    step = BEYOND * piece.scale[-1]
    far, close = (_lowest(piece, u, near, step * part) for part in (1.0, 0.25))
    if far is None or close is None:
        return None
    count = tangent.shape[0]
    away = [np.linalg.norm((x - u)[:count]) for x in (far, close)]
    near_by = away[1] < SHRUNK * away[0] or away[0] <= BEYOND * piece.of.span
    return far if near_by else None


def _lowest(piece: Piece, u: Array, modes: Array, step: float) -> Array | None:
    """The minimum of lowest energy from starts along the modes, at the last unknown + step."""
    best, least = None, np.inf
    amplitude = np.sqrt(step * piece.scale[-1]) * piece.of.span / piece.scale[-1]
    if modes.shape[1] == 1:
        starts = [modes[:, 0], -modes[:, 0]]
    else:
        angles = 2 * np.pi / DIRECTIONS * np.arange(DIRECTIONS)
        starts = [np.cos(a) * modes[:, 0] + np.sin(a) * modes[:, 1] for a in angles]
    for start in starts:
        x = u.copy()
        x[-1] += step
        x[: len(start)] += 0.3 * amplitude * start
        settled = _settled(piece, x, len(start))
        if settled and (best is None or settled[1] < least - 1e-9 * abs(least)):
            best, least = settled
    return best


def _settled(piece: Piece, u: Array, count: int) -> tuple[Array, float] | None:
    """The minimum of the energy over the first `count` unknowns, strings slack or taut as they
    are; and that energy."""
    members = piece.of.members
    shift, begin = 0.0, u[:count].copy()

    def parts(u: Array) -> tuple[Array, float]:
        d, lengths = piece.apart(u)
        natural = piece.natural(u)
        taut = ~members.pulls_only | (lengths >= natural)
        pulls = np.where(taut, members.stiffness * (lengths - natural), 0.0)
        gradient = piece.of.gain.T @ ((pulls / lengths)[:, None] * d).ravel() - piece.of.weight
        stored = float(np.sum(pulls * pulls / members.stiffness) / 2)
        return gradient, stored - float(piece.of.weight @ piece.of.coordinates(u))

    gradient, energy = parts(u)
    size = float(np.max(members.stiffness)) * piece.of.span
    for _ in range(ITERATIONS):
        lengths, natural = piece.apart(u)[1], piece.natural(u)
        live = Piece(
            piece.of, ~members.pulls_only | (lengths >= natural), np.zeros(0, dtype=np.int64),
            np.zeros(len(lengths)),
        )  # fmt: skip
        stiff = live.tangent(u)[:count, :count]
        if np.abs(gradient[:count]).max() <= 1e-14 * size:
            if np.linalg.eigvalsh(stiff)[0] <= 0:
                return None
            if piece.of.pattern is not None:
                along = piece.of.basis.T @ piece.of.along
                u[-2] = gradient[-1] / along[-1]
            return u, energy
        values, vectors = np.linalg.eigh(stiff)
        bent = np.maximum(np.abs(values), 1e-6 * np.abs(values).max()) + shift
        move = -vectors @ ((vectors.T @ gradient[:count]) / bent)
        move *= min(1.0, 0.05 * piece.of.span / np.abs(move).max())
        new = u.copy()
        new[:count] += move
        after = parts(new)
        if np.abs(new[:count] - begin).max() > FAR * piece.of.span:
            return None
        if after[1] <= energy + 1e-14 * abs(energy):
            u, (gradient, energy), shift = new, after, shift / 8
        else:
            shift = max(4 * shift, 1e-6 * np.abs(values).max())
            if shift > 1e6 * np.abs(values).max():
                return None
    return None
