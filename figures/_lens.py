"""The lens of the group, and measures of its pressure field."""

from __future__ import annotations

import functools

import numpy as np

from tensegrity import Lens, Prism

PRISM = Prism(base=1.0, height=0.8, prestrain=0.01, k_cross=1.0)
STEP = 0.02  # s between the instants among which peaks are sought
MANY = 2_000_000  # pressures computed at once


@functools.cache
def lens(focus=(0.0, 20.0)):
    """21 chains of 40 prisms, 2 m apart, by default focused 20 m ahead."""
    return Lens(PRISM, focus=focus)


def row(case, quantity, value, reference=""):
    """A line of the group's table."""
    return {"case": case, "quantity": quantity, "value": value, "reference": reference}


def top(t, pressure):
    """Instant and height of the largest pressure, by the parabola through three instants."""
    k = int(np.clip(np.argmax(pressure), 1, len(t) - 2))
    a, b, c = pressure[k - 1 : k + 2]
    shift = (a - c) / (2 * (a - 2 * b + c))
    return t[k] + shift * (t[k + 1] - t[k]), b - (a - c) * shift / 4


def around(one, before=3.0, after=3.0, step=STEP):
    """Instants about that at which the pulses meet."""
    return one.focus_time + np.arange(-before, after + step / 2, step)


def peaks(one, points, t):
    """Largest pressure over some instants at each point, (points,)."""
    parts = _parts(points, MANY // len(t))
    return np.concatenate([one.pressure(p, t).max(axis=0) for p in parts])


def _parts(points, share):
    return [points[k : k + max(1, share)] for k in range(0, len(points), max(1, share))]


def line(x, y):
    """Points (n, 2) along a line on which one coordinate may stand still."""
    return np.stack(np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float)), axis=-1)
