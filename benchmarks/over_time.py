"""Springs that change while a wave travels: the compiled loop against steps in Python.

A blow on a chain of prisms whose cross strings are drawn in.  The rival is the same splitting with
the same series of parameters, and a compiled law that NumPy calls stage by stage: what these runs
were before.  Both give the motion, the work and 100 rows; CPU times, least of several rounds, and
the largest difference of what they give.
"""

from __future__ import annotations

import numpy as np

from benchmarks._timing import least, table
from tensegrity import METHODS, Chain, Prism, Record, simulate
from tensegrity.engine.compiled import loop_of_law
from tensegrity.engine.law import Change
from tensegrity.springs.over_time import Series

STEPS, DT, ROUNDS = 200, 0.05, 3
SITES = (40, 200, 1000)


def scene(sites):
    """A chain whose prestrain goes from 0.02 to 0.05, and a blow on its end."""
    import sympy as sp

    t, middle = sp.Symbol("t"), STEPS * DT / 2
    prestrain = 0.02 + 0.015 * (1 + sp.tanh((t - middle) / 5))
    spring = Prism(1.0, 0.8, 0.02, 1.0).potential().over_time(prestrain=prestrain)
    chain = Chain(spring, sites)
    return chain, chain.at_rest({0: 0.05})


class InPython:
    """Stage by stage in NumPy."""

    def __init__(self, chain, state):
        self._springs = Series(chain.springs[0], STEPS * DT)
        law = self._springs.law
        self._law, self._change = loop_of_law(law), loop_of_law(Change(law))
        self._weights, self._state = 1 / chain.mass, state

    def __call__(self):
        """u, v and work at the end."""
        u, v, work = self._state.u.copy(), self._state.v.copy(), 0.0
        rows, method = [], METHODS["rkn6"]
        for step in range(STEPS):
            now = step * DT
            if step % 2 == 0:
                p = self._springs.at(np.array([now]))[0]
                energy = self._law.evaluate(0, p, np.diff(u)).sum()
                rows.append((now, energy + np.sum(v**2) / 2, u.copy(), v.copy(), work))
            for kick, drift in zip(method.kicks, (*method.drifts, 0.0), strict=True):
                if kick:
                    at, r = np.array([now]), np.diff(u)
                    p = self._springs.at(at)[0]
                    tension = self._law.evaluate(1, p, r)
                    v += kick * DT * self._weights * np.diff(tension, prepend=0.0, append=0.0)
                    numbers = self._springs.numbers(at)[0][0]
                    work += kick * DT * np.sum(self._change.evaluate(0, numbers, r))
                u += drift * DT * v
                now += drift * DT
        return u, v, work


def main():
    """Print times and ratios."""
    rows = []
    for sites in SITES:
        chain, state = scene(sites)
        slow = InPython(chain, state)

        def fast(chain=chain, state=state):
            record = Record(every=2)
            return simulate(chain, state, STEPS * DT, method="rkn6", dt=DT, record=record)

        run, (u, v, work) = fast(), slow()
        gap = max(
            np.max(np.abs(run.final.u - u)) / np.max(np.abs(u)),
            np.max(np.abs(run.final.v - v)) / np.max(np.abs(v)),
            abs(run.work[-1] - work) / abs(work),
        )
        times = least(slow, ROUNDS)[0], least(fast, ROUNDS)[0]
        rows.append((f"{sites} prisms", *(1e3 * t for t in times), times[0] / times[1], gap))
    heads = ["", "Python ms", "compiled ms", "ratio", "difference"]
    table(f"{STEPS} steps of rkn6, 100 rows", heads, rows)


if __name__ == "__main__":
    main()
