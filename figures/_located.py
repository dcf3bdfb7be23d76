"""Steps located at the opening and closing of contacts: what restores the order there.

A Hertz force grows like the overlap to the power 3/2.  Along a motion through a closing at t* it
is (t - t*)^(3/2) times a smooth function: to end a step at t* is not enough, since no polynomial
fits that function beside t*.  Steps in proportion to a power of the time since or until the
event are: with h = dt tau^s the local errors h^(p+1) tau^(3/2 - p) sum up to dt^p if
s > 1 - 5/(2 p).  Steps that vary are no longer symplectic: this is for short runs.
"""

from __future__ import annotations

import numpy as np

from figures._limits import advance
from tensegrity.engine.methods import METHODS

POWER = 2.5  # of the time beside an event in the impulse: the order that is left in steps unlocated
MARGIN = 0.15  # above the least power s
TOUCH = 1e-15  # overlap in which a contact neither counts as opened nor as closed


def run(chain, state, t_end, method, dt, grade=True):
    """Advance a chain of contacts without precompression, in equal units of length and time.

    Parameters
    ----------
    chain : Chain
        Of springs without preload: bond j is closed where its elongation is negative.
    state : State
    t_end, dt : float
        Duration, and step far from any event.
    method : str
    grade : bool
        Shorten the steps beside the events too, not only end one at each of them.

    Returns
    -------
    u, v : ndarray, (sites,)
    steps : int
    events : int
    """
    method = METHODS[method]
    s = max(1 - POWER / method.order + MARGIN, 0.0) if grade else 0.0
    least = dt ** (1 / (1 - s))
    u, v = chain.arrays(state)
    way = np.where(chain.elongation(u) <= 0, 1.0, -1.0)  # 1: closed, -1: open
    t, steps, events = 0.0, 0, 0

    def after(h):
        there = u.copy(), v.copy()
        advance(chain, *there, method, h, 1)
        return there

    def left(there, bond=slice(None)):
        return -way[bond] * chain.elongation(there[0])[bond]  # negative beyond an event

    while t_end - t > TOUCH * t_end:
        h = min(max(dt * _time_beside(chain, u, v, way) ** s, least), t_end - t)
        there = after(h)
        passed = np.flatnonzero(left(there) < -TOUCH)
        if passed.size:
            roots = [_root(lambda x, b=b: left(after(x), b), h) for b in passed]
            h, bond = min(zip(roots, passed, strict=True))
            there = after(h) if h else (u, v)
            way[bond] *= -1
            events += 1
        (u, v), t, steps = there, t + h, steps + 1
    return u, v, steps, events


def _root(function, h):
    """Where a function that is negative at h passes zero; 0 where it never was positive."""
    from scipy.optimize import brentq

    start = h * 1e-9
    return 0.0 if function(start) <= 0 else brentq(function, start, h, xtol=1e-16, rtol=1e-15)


def _time_beside(chain, u, v, way):
    """Time since a closing or until an opening, at most 1; by the overlaps and their rates."""
    overlap, rate = -chain.elongation(u), -np.diff(v)
    beside = (way > 0) & (rate != 0)
    times = np.abs(np.maximum(overlap[beside], 0) / rate[beside])
    return min(1.0, float(times.min(initial=np.inf)))
