"""Limit points (folds) of a branch: located directly, and continued in a second parameter."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tensegrity.branches.problem import Problem
from tensegrity.branches.table import Event
from tensegrity.typing import Array

NEARBY = 1e-3  # distance in scaled unknowns within which a limit point is refined


def fold_problem(problem: Problem, fold: str, free: int) -> Problem:
    """The continuation of a limit point in a second parameter, as a problem of its own.

    Parameters
    ----------
    problem : Problem
    fold : str
        One of `problem.folds`.
    free : int
        Index in `problem.p` of the parameter that becomes the last unknown, "free".

    Returns
    -------
    Problem
        Its unknowns are those of `problem`, their tangent ("d name") and the freed parameter.
        Its parameters are those of `problem`; entry `free` is the value at the event "end".
    """
    import casadi as ca

    m, p, scale = len(problem.unknowns), problem.p, problem.scale or ()
    tangent, freed = ca.SX.sym("tangent", m), ca.SX.sym("free")

    def released(expression: Any) -> Any:
        return ca.substitute(ca.SX(expression), p[free], freed)

    g, function = released(problem.equations), released(problem.folds[fold])
    scaled = tangent * ca.DM(scale)
    system = ca.vertcat(
        g,
        ca.jtimes(g, problem.z, scaled),
        ca.jtimes(function, problem.z, scaled),
        ca.dot(tangent, tangent) - 1,
    )
    size = ca.SX.ones(m - 1) if problem.size is None else released(problem.size)
    names = (*problem.unknowns, *(f"d {name}" for name in problem.unknowns), "free")
    symbols = ca.vertsplit(ca.vertcat(problem.z, tangent, freed))
    return Problem(
        dict(zip(names, symbols, strict=True)),
        system,
        p=p,
        scale=(*scale, *(1.0,) * m, 1.0),
        size=ca.vertcat(size, 1 + size, 1 + ca.norm_2(ca.gradient(function, problem.z)), 1),
        events={"end": freed - p[free]},
        columns={name: released(value) for name, value in problem.columns.items()},
    )


def fold_start(problem: Problem, event: Event, parameters: ArrayLike, free: int) -> Array:
    """A start for `fold_problem` at a limit point located by `trace`.

    Parameters
    ----------
    problem : Problem
    event : Event
        The limit point.
    parameters : array_like, (k,)
        Those of the trace.
    free : int
        Index of the freed parameter.

    Returns
    -------
    ndarray, (2 m + 1,)
        Unknowns of `fold_problem`.
    """
    p = np.asarray(parameters, dtype=float)
    z = np.array([event.at[name] for name in problem._stepper.names])
    scale = np.array(problem._stepper.scale)
    tangent = _tangent(problem, np.arcsinh(z / scale), p) * np.hypot(1, z / scale)
    return np.concatenate([z, tangent / np.linalg.norm(tangent), [p[free]]])


def refined_fold(problem: Problem, fold: str, z: ArrayLike, parameters: ArrayLike) -> Array:
    """The limit point next to given unknowns, located along the branch.

    Parameters
    ----------
    problem : Problem
    fold : str
        One of `problem.folds`.
    z : array_like, (m,)
        Unknowns nearby.
    parameters : array_like, (k,)

    Returns
    -------
    ndarray, (m + values,)
        Unknowns and tabulated values.
    """
    stepper, p = problem._stepper, np.asarray(parameters, dtype=float)
    z = np.arcsinh(np.asarray(z, dtype=float) / stepper.scale)
    along, place = _tangent(problem, z, p), stepper.tests + stepper.kinds.index(fold)
    before, here = (stepper.corrected(z + x * along, along, p) for x in (-NEARBY, NEARBY))
    here[stepper.length] = np.linalg.norm((here - before)[: stepper.m])
    ends = before[place], here[place]
    row = stepper.locate(before, here, place, 0.0, ends, p) if ends[0] * ends[1] < 0 else before
    return np.asarray(stepper.data(row[None])[0])


def _tangent(problem: Problem, z: Array, p: Array) -> Array:
    """Unit tangent of the branch through a point, in scaled unknowns."""
    return np.linalg.svd(problem._stepper.linearised(z, p)[1])[2][-1]
