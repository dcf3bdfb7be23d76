"""Common parts of the pictures of limits: chains, bare loops, words and tables for numbers."""

import numpy as np

from tensegrity import METHODS, Chain, Prism
from tensegrity.engine.methods import Corrected
from tensegrity.scenes.dynamics import dynamics

EXPLICIT = [name for name, method in METHODS.items()
            if method.explicit and not isinstance(method, Corrected)]  # fmt: skip
"""Explicit methods but those that, on smooth springs, do the steps of another."""
COLOURS = {name: f"C{k}" for k, name in enumerate(METHODS)}


def prism_chain(sites):
    """A chain of stiffening prisms with free ends."""
    return Chain(Prism(base=1.0, height=0.8, prestrain=0.02, k_cross=1.0).potential(), sites)


def moved(chain, state, method, dt, steps):
    """Displacements and velocities after some steps of the bare loop, without any checks."""
    u, v = dynamics(chain).arrays(state)
    dynamics(chain).bind(u, v, METHODS[method], dt).advance(steps)
    return u, v


def stepped(acceleration, u, v, method, dt, steps):
    """u and v after some steps of a splitting in NumPy, closing and first kicks merged."""
    method = METHODS[method]
    *kicks, closing = method.kicks
    for k in range(steps):
        first = kicks[0] + (closing if k else 0)
        for kick, drift in zip((first, *kicks[1:]), method.drifts, strict=True):
            v = v + dt * kick * acceleration(u) if kick else v
            u = u + dt * drift * v
    return u, v + dt * closing * acceleration(u) if closing else v


def gap(one, other):
    """Largest difference of two (u, v), each over the largest of `other`."""
    return max(
        float(np.max(np.abs(a - b)) / np.max(np.abs(b))) for a, b in zip(one, other, strict=True)
    )


def slope(x, y):
    """Power of x in y, by least squares of the logarithms."""
    return float(np.polyfit(np.log(x), np.log(y), 1)[0])


def grid(head, rows):
    """A table in Markdown: headings, and rows of text."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
