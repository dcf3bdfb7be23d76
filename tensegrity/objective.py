"""Objectives of gradients: traces of a run, and numbers computed from them.

A trace is one number after every step: `load`, `displacement`, `velocity`, `energy`.  Numbers made
of traces are `peak`, `p_norm`, `impulse`, `arrival`, `misfit`, and `of`, for any other function.
"""

from tensegrity.gradients.objective import (
    arrival,
    displacement,
    energy,
    impulse,
    load,
    misfit,
    of,
    p_norm,
    peak,
    velocity,
)

__all__ = [
    "arrival",
    "displacement",
    "energy",
    "impulse",
    "load",
    "misfit",
    "of",
    "p_norm",
    "peak",
    "velocity",
]
