"""The limit load of a prism as a function of its prestrain, by continuation of the limit point.

Source: the talk, part III, "Effects of element rigidity and internal prestress".
"""

from __future__ import annotations

import numpy as np

from tensegrity.branches.continuation import Settings
from tensegrity.branches.folds import fold_problem, fold_start, refined_fold
from tensegrity.branches.problem import DerivedProblem, Problem, trace
from tensegrity.branches.table import Table
from tensegrity.checked import checked
from tensegrity.errors import TensegrityError
from tensegrity.once import once
from tensegrity.prisms.equations import UNKNOWNS, kind_of, numbers, problem
from tensegrity.prisms.prism import Prism
from tensegrity.prisms.problem import STATE
from tensegrity.typing import NotNegative

PRESTRAIN = 1  # index of the prestrain in the parameters of `equations.problem`
SETTINGS = Settings(tolerance=1e-7, largest=0.05)


@once
def _folds(rigid_base: bool, any_sides: bool) -> Problem:
    return DerivedProblem(_fold_problem, rigid_base, any_sides)


def _fold_problem(rigid_base: bool, any_sides: bool) -> Problem:
    return fold_problem(problem(rigid_base, any_sides), "fold", PRESTRAIN)


@checked
def limit_load(prism: Prism, prestrain: NotNegative) -> Table:
    """Limit load of a prism over a range of prestrains, by continuation of the limit point.

    Parameters
    ----------
    prism : Prism
        With elastic bases or bars and a limit point in load.  The range starts at its prestrain.
    prestrain : float
        Prestrain at which the range ends, >= 0.

    Returns
    -------
    Table
        Columns prestrain, height [m], twist [rad], base [m] and load [N] (compression > 0) at
        the first limit point.  The smooth energy is followed, so that a limit point may lie
        beyond contact (twist pi).

    Raises
    ------
    TensegrityError
        If the prism is rigid or has no limit point, or the prestrain is that of the prism.
    """
    if prism.is_rigid:
        raise TensegrityError("limit_load needs elastic bases or bars: k_base, k_bar are inf")
    if prestrain == prism.prestrain:
        raise TensegrityError(f"prestrain {prestrain:g} must differ from that of the prism")
    kind, p = kind_of(prism), numbers(prism)
    of = problem(*kind)
    start = np.zeros(len(UNKNOWNS) - kind[0])
    first = trace(of, start, p, direction=-1, stop=("fold", "flat"))
    if first.end != "fold":
        raise TensegrityError(f"{prism!r} has no limit load")
    on_fold = fold_start(of, first.events[-1], p, PRESTRAIN)
    direction = 1 if prestrain > prism.prestrain else -1
    p[PRESTRAIN] = prestrain
    branch = trace(_folds(*kind), on_fold, p, SETTINGS, direction, ("end",))
    states = []
    for state, p[PRESTRAIN] in zip(branch.z, branch.free, strict=True):
        states.append(refined_fold(of, "fold", state[: len(start)], p))
    values = np.array(states).T[len(start) :]
    columns = {"prestrain": branch.free} | dict(zip(STATE, values[: len(STATE)], strict=True))
    return Table(columns, (), "the requested prestrain is reached")
