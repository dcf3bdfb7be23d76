"""Runs with different steps, compared at the same instants."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tensegrity.runs.record import Record
from tensegrity.runs.run import changed
from tensegrity.runs.step import refined


@dataclass(frozen=True)
class Trial:
    """One of the runs that are compared.

    Attributes
    ----------
    march : Marched
    instants : int
        Evenly spaced ones, besides the first, which all trials have in common.
    """

    march: object
    instants: int

    @classmethod
    def of(cls, problem, steps, instants):
        """With so many steps from one instant to the next, or more where those are too coarse."""
        return cls(refined(problem, steps * instants, 1.0, instants), instants)

    @property
    def steps(self):
        """That were done."""
        return self.march.steps

    @property
    def complete(self):
        """Whether it was not interrupted."""
        return self.march.complete

    @property
    def met(self):
        """Smallest and largest elongation of each spring [m]; (springs, 2)."""
        return self.march.met

    @property
    def samples(self):
        """u and v at the instants; (instants + 1, *shape) each."""
        return self.march.samples

    def run(self):
        """The run itself."""
        return self.march.run()

    @property
    def fineness(self):
        """Steps from one instant to the next."""
        return self.steps / self.instants

    def gap(self, finer):
        """Largest difference from a finer one in u and in v, over the largest value there."""
        return largest_gap(self.samples, finer.samples)


def trial_of(problem, rows=False):
    """A problem whose run is a trial, with rows only where they cost nothing more: it may turn out
    to be the answer."""
    record = problem.record
    if not record.is_plain:
        record = Record(sites=record.sites)
    rows = rows and problem.record.is_plain and not problem.observe
    return changed(problem, record=record, rows=rows, observe=())


def largest_gap(coarse, fine):
    """Largest difference of two runs in u and in v, each over its own largest value in the run."""
    parts = []
    for one, other in zip(coarse, fine, strict=True):
        largest, gap = np.max(np.abs(other)), np.max(np.abs(one - other))
        parts.append(gap / largest if largest else gap)
    return float(max(parts))
