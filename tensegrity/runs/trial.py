"""Runs with different steps, compared at the same instants."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.runs.record import Record
from tensegrity.runs.run import changed
from tensegrity.runs.step import refined

if TYPE_CHECKING:
    from typing import Self

    from tensegrity.runs.march import Marched
    from tensegrity.runs.problem import Problem
    from tensegrity.typing import Array


class Trial:
    """One of the runs that are compared.

    Attributes
    ----------
    march : Marched
    instants : int
        Evenly spaced ones, besides the first, which all trials have in common.
    steps : int
        That were done.
    complete : bool
        Whether it was not interrupted.
    met : ndarray, (springs, 2)
        Smallest and largest elongation of each spring [m].
    samples : ndarray, (2, instants + 1, *shape)
        u and v at the instants.
    fineness : float
        Steps from one instant to the next.
    """

    def __init__(self, march: Marched, instants: int) -> None:
        self.march, self.instants, self.run = march, instants, march.run
        self.steps, self.complete, self.met = march.steps, march.complete, march.met
        self.samples, self.fineness = march.samples, march.steps / instants

    @classmethod
    def of(cls, problem: Problem, steps: int, instants: int) -> Self:
        """With so many steps from one instant to the next, or more where those are too coarse."""
        return cls(refined(problem, steps * instants, 1.0, instants), instants)

    @cached_property
    def _sizes(self) -> Array:
        return _largest(self.samples)

    def gap(self, finer: Trial) -> float:
        """Largest difference from a finer one in u and in v, over the largest value there."""
        gaps = _largest(self.samples - finer.samples)
        return float(np.divide(gaps, finer._sizes, out=gaps, where=finer._sizes > 0).max())


def trial_of(problem: Problem, rows: bool = False) -> Problem:
    """A problem whose run is a trial, with rows only where they cost nothing more: it may turn out
    to be the answer."""
    record = problem.record
    if not record.is_plain:
        record = Record(sites=record.sites)
    rows = rows and problem.record.is_plain and not problem.observe
    return changed(problem, record=record, rows=rows, observe=())


def _largest(samples: Array) -> Array:
    """Largest sizes of u and of v."""
    return np.abs(samples).reshape(2, -1).max(axis=1)
