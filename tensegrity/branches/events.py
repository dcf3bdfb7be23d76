"""Events between two points of a branch: roots of user functions, folds, bifurcations.

An event function that changes its sign gives the interval; a guess on the cubic through both
points is polished on the extended system of the event, and bisection steps in where that fails.
"""

from __future__ import annotations

from dataclasses import replace
from operator import mul

import numpy as np

from tensegrity.branches.arclength import (
    ALIGNED,
    BISECTIONS,
    NEAR,
    ROOT_AT_START,
    TINY,
    virtual_start,
)


def leave_start(machine, start, here, p, events):
    """Signs of the event functions after a start; those that vanish there are events on it."""
    back = machine.advance(virtual_start(start), replace(start, length=1.0), -here.length, p)[0]
    signs = list(start.tests)
    for i, kind in enumerate(machine.kinds):
        root = kind in machine.roots
        if abs(start.tests[i]) <= machine.vanishing[i]:
            signs[i] = here.tests[i]
            if root or back.tests[i] * here.tests[i] < 0:
                events.append((kind, 0, start))
    return signs


def located(machine, before, here, signs, p):
    """Events between two points, in their order: (kind, point).

    A root may be passed twice in a step that holds a fold: the fold divides it.
    """
    if min(map(mul, signs, here.tests)) >= 0 < before.side * here.side:
        return []
    roots = len(machine.roots)

    def passed(start, end, signs, numbers):
        return [
            (machine.kinds[i], _locate(machine, start, end, i, signs[i], p))
            for i in numbers
            if signs[i] * end.tests[i] < 0
        ]

    def place(one):
        return np.dot(one[1].z - before.z, before.tangent)

    found = sorted(passed(before, here, signs, range(roots, len(machine.kinds))), key=place)
    ends = [*(point for _, point in found), here]
    start = before
    for end in ends:
        part = replace(end, length=_chord(start, end.z)) if len(ends) > 1 else end
        found += passed(start, part, signs, range(roots))
        start, signs = end, [new or old for new, old in zip(end.tests, signs, strict=True)]
    if before.side * here.side < 0:
        found.append(("bifurcation", _bifurcation(machine, before, here, p)))
    return [(kind, replace(x, length=_chord(before, x.z))) for kind, x in sorted(found, key=place)]


def between(before, here, part):
    """z and unit tangent at a given part (0 to 1) of the way, from the cubic through both."""
    m, u, w = before.m, part, 1 - part
    ends = np.concatenate([before.data[: 2 * m], here.data[: 2 * m]]).reshape(4, m)
    rise = here.length * u * w
    cubic = [w * w * (1 + 2 * u), rise * w, u * u * (1 + 2 * w), -rise * u]
    z, tangent = np.array([cubic, [0, w, 0, u]]) @ ends
    return z, tangent / np.linalg.norm(tangent)


def _locate(machine, before, here, index, sign, p):
    """The point where event function number `index` vanishes between two points."""
    low = 0.0, before.tests[index] or sign * ROOT_AT_START, before.z
    high = 1.0, here.tests[index], here.z
    kind = machine.kinds[index]
    for _ in range(BISECTIONS):
        part = low[0] + (high[0] - low[0]) * low[1] / (low[1] - high[1])
        guess, tangent = between(before, here, part)
        z = machine.polish(kind, guess, tangent, p)
        if z is not None and _between_ends(z, low[2], high[2]):
            point = machine.exactly_at(z, tangent, p)
            if _on_curve(point, before, here):
                return point
        part = (low[0] + high[0]) / 2
        middle = machine.at(*between(before, here, part), p)
        if middle.tests[index] * sign > 0:
            low = part, middle.tests[index], middle.z
        else:
            high = part, middle.tests[index], middle.z
    _on_curve(middle, before, here)
    return middle


def _between_ends(z, low, high):
    """Whether z is no farther from either end than they are apart: else it is another root."""
    apart = np.linalg.norm(high - low) + 1e-12
    return np.linalg.norm(z - low) <= apart and np.linalg.norm(z - high) <= apart


def _on_curve(point, before, here):
    """Whether a point is next to the curve between two others: else it is on another branch.

    Where branches meet it gets the tangent of the curve, for its own is round-off.
    """
    chord = here.z - before.z
    part = np.dot(point.z - before.z, chord) / (np.dot(chord, chord) + TINY)
    guess, tangent = between(before, here, part)
    away = point.z - guess
    away -= np.dot(away, tangent) * tangent
    if np.dot(point.tangent, tangent) < ALIGNED:
        point.tangent[:] = tangent
    return np.linalg.norm(away) <= NEAR * np.linalg.norm(chord) + NEAR**2


def _chord(before, z):
    return float(np.linalg.norm(z - before.z))


def _bifurcation(machine, before, here, p):
    """The point where the bordered determinant changes its sign between two points."""
    low, high = 0.0, 1.0
    for _ in range(BISECTIONS):
        point = machine.at(*between(before, here, (low + high) / 2), p)
        if point.side * before.side > 0:
            low = (low + high) / 2
        else:
            high = (low + high) / 2
    return point
