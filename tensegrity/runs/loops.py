"""The steps of a method on a scene, with the same bits wherever a run is looked at.

The closing kick of a splitting's step and the first of the next are one.  So a run keeps its
velocities before the closing kick, and what is looked at is a copy that got it; where a method
corrects openings, a copy without what it did for kicks to come.
"""

from __future__ import annotations

import numpy as np

from tensegrity.engine.methods import Corrected, Splitting
from tensegrity.engine.walk import Walk
from tensegrity.once import once


@once
def parts(method):
    """Splittings of one step: the first of a run, all others, and the closing kick or None."""
    if not isinstance(method, Splitting) or not method.kicks[-1]:
        return method, method, None
    name, order, step = method.name, method.order, method.step
    (begin, *inner), last = method.kicks[:-1], method.kicks[-1]
    return (
        Splitting(name, order, step, (begin, *inner, 0.0), method.drifts),
        Splitting(name, order, step, (last + begin, *inner, 0.0), method.drifts),
        Splitting(name, order, step, (last, 0.0), (0.0,)),
    )


class Loop:
    """A scene bound to a method.

    Parameters
    ----------
    scene : scene
    u, v : ndarray
        As `scene.arrays` gives them; advanced in place.
    method : Method
    dt : float
        [s]
    begun : bool
        Whether a first step was done, so that `v` lacks a closing kick.

    Attributes
    ----------
    range : ndarray, (ranges that the scene keeps, 2)
        Smallest and largest elongation [m] from `forget_range` to `look`.
    """

    def __init__(self, scene, u, v, method, dt, begun):
        first, others, close = parts(method)
        self._u, self._v, self._close = u, v, None
        self._corrects = isinstance(method, Corrected)
        self._others = scene.bind(u, v, others, dt)
        self._first = scene.bind(u, v, first, dt) if close and not begun else None
        self._out = np.empty_like(u), np.empty_like(v)
        if close is not None:
            self._close = scene.bind(*self._out, close, dt)
        elif self._corrects:
            self._close = self._others.show(*self._out)
        self._bound = [loop for loop in (self._others, self._close) if loop is not None]

    def forget_range(self):
        """Start anew to record elongations and the way travelled."""
        if self._first in self._bound:
            self._bound.remove(self._first)
        for loop in self._bound:
            loop.forget_range()

    def advance(self, steps, begun):
        """Do at least one step; `begun` says whether one was done before."""
        first = self._first is not None and not begun
        if first:
            self._first.forget_range()
            self._first.advance(1)
            self._bound.append(self._first)
        if self._corrects and not begun:
            self._others.begin()
        if steps > first:
            self._others.advance(steps - first)

    def look(self):
        """Copies of u and v after the closing kick; then `range` is that of all done before."""
        if self._close is None:
            self.range = self._others.range
            return self._u.copy(), self._v.copy()
        self._out[0][:], self._out[1][:] = self._u, self._v
        self._close.advance(1)
        self._join()
        return self._out[0].copy(), self._out[1].copy()

    def _join(self):
        self.range = self._bound[0].range.copy()
        for loop in self._bound[1:]:
            np.minimum(self.range[:, 0], loop.range[:, 0], out=self.range[:, 0])
            np.maximum(self.range[:, 1], loop.range[:, 1], out=self.range[:, 1])

    def walk(self):
        """The same steps with their rows in one call, or None where some are not compiled."""
        loops = self._first, self._others, self._close
        if any(loop is not None and getattr(loop, "parts", None) is None for loop in loops):
            return None
        return Walk(self._u, self._v, *loops)

    def walked(self, begun):
        """After steps of `walk`: make `range` and `travel` those of all done."""
        if self._first is not None and not begun and self._first not in self._bound:
            self._bound.append(self._first)
        self._join()

    @property
    def travel(self):
        """Bound on how far any coordinate of a site moved since `forget_range` [m]."""
        return sum(x.travel for x in self._bound if x is not self._close)
