"""Prisms with elastic bases or bars: their equilibria at given height, and their potential.

The equations of `derivations.elastic` as a problem for `tensegrity.continuation`, in units of
the base and of k_cross times base: one compiled set of functions serves every prism.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np

from tensegrity.codegen import to_casadi
from tensegrity.continuation import Problem, Settings, trace
from tensegrity.errors import EquilibriumError, LockingError, TensegrityError

UNKNOWNS = ("base tension", "bar tension", "half turn", "rise")


@cache
def problem(rigid_base=False):
    """Equilibria of a prism as a branch, parametrised by the rise h - h0.

    Unknowns: changes of the tension of a base string (absent if the bases are rigid) and of a
    bar, tangent of half the turn, rise.  With rigid bars the bar's tension is the multiplier of
    its constant length.  Parameters: h0, p0, k1/k2, k1/k3, and the height and the load at which
    to end.
    """
    import casadi as ca
    from derivations import elastic as derived

    z, p = ca.SX.sym("z", 4 - rigid_base), ca.SX.sym("p", 6)
    unknowns = (ca.SX(0), *ca.vertsplit(z)) if rigid_base else ca.vertsplit(z)
    symbols = (*derived.UNKNOWNS, *derived.PARAMETERS)
    numbers = (*unknowns, *ca.vertsplit(p)[:4])

    def sx(*expressions):
        return [ca.SX(x) for x in to_casadi(list(expressions), symbols)(*numbers)]

    twisting, bars, basing, load = sx(
        derived.twist_equilibrium(),
        derived.bar_compatibility(),
        derived.base_equilibrium(),
        derived.load(),
    )
    pulls, lengths = sx(*derived.tensions()), sx(*derived.lengths())
    force = ca.sqrt(sum(pull**2 for pull in pulls)) + 1e-300
    rows, size = [twisting, bars], [force, lengths[2] ** 2]
    if not rigid_base:
        rows, size = [basing, *rows], [force, *size]
    height = p[0] + unknowns[3]
    roots = {"contact": pulls[0], "flat": height, "min_height": height - p[4]}
    if not rigid_base:
        roots["slack"] = pulls[1]
    return Problem(
        UNKNOWNS[rigid_base:],
        z,
        p,
        ca.vertcat(*rows),
        size=ca.vertcat(*size),
        roots=roots | {"max_load": load - p[5]},
        folds={"fold": load, "turn": unknowns[3]},
        values={
            "height": height,
            "twist": math.radians(150) + 2 * ca.atan(unknowns[2]),
            "base": lengths[1],
            "load": load,
        },
    )
