"""Runs with different steps, seen at the same instants, and how far they are apart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tensegrity.engine import walk
from tensegrity.runs.record import Record
from tensegrity.runs.run import changed
from tensegrity.runs.step import refined
from tensegrity.runs.whole import Whole


@dataclass(frozen=True)
class Rung:
    """One of the runs that are compared.

    Attributes
    ----------
    run : Run or Whole
    instants : int
    seen : tuple of ndarray, (instants + 1, *shape)
        u and v at evenly spaced instants, which all rungs have in common.
    """

    run: object
    instants: int
    seen: tuple

    @classmethod
    def of(cls, problem, steps, instants):
        """With so many steps from one instant to the next, or more where those are too coarse."""
        run, seen = refined(problem, steps * instants, 1.0, instants)
        return cls(run, instants, seen)

    @property
    def fineness(self):
        """Steps from one instant to the next."""
        return self.run.steps / self.instants

    def gap(self, finer):
        """Largest difference from a finer one in u and in v, over the largest value there."""
        if isinstance(finer.run, Whole) and finer.run.coarser and finer.run.coarser[0] is self.run:
            return finer.run.coarser[1]
        at_once = isinstance(self.run, Whole) and isinstance(finer.run, Whole)
        of = walk.largest_gap if at_once else largest_gap
        return of(self.seen, finer.seen)


def trial_of(problem, rows=False):
    """A problem whose run is a trial: with rows only where they cost nothing more, whose energies
    may come when it turns out to be the answer."""
    record = problem.record
    if not record.is_plain:
        record = Record(sites=record.sites)
    return changed(problem, record=record, trial=True, rows=rows and problem.record.is_plain)


def largest_gap(coarse, fine):
    """Largest difference of two runs in u and in v, each over its own largest value in the run."""
    parts = []
    for one, other in zip(coarse, fine, strict=True):
        largest, gap = np.max(np.abs(other)), np.max(np.abs(one - other))
        parts.append(gap / largest if largest else gap)
    return float(max(parts))
