"""What a run keeps: which sites, how often, and the rows themselves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tensegrity import check
from tensegrity.errors import TensegrityError

INSTANTS = 500  # kept by default


@dataclass(frozen=True)
class Record:
    """What to record during a run.

    Parameters
    ----------
    every : int, optional
        Keep every k-th step; the first and the last are always kept.  By default about 500
        instants are kept, whatever the number of steps.
    sites : sequence of int, optional
        Sites to keep, in that order; by default all.
    """

    every: int | None = None
    sites: Sequence[int] | None = None

    def __post_init__(self):
        if self.every is not None:
            check.whole("every", self.every, least=1)
        if self.sites is not None:
            kept = tuple(check.whole("site", int(s) if s == s else s, least=0) for s in self.sites)
            if not kept:
                raise TensegrityError("sites is empty: nothing to record")
            object.__setattr__(self, "sites", kept)

    def columns(self, sites):
        """Numbers of the recorded sites of a scene, or a slice of all."""
        if self.sites is None:
            return slice(None)
        if max(self.sites) >= sites:
            raise TensegrityError(f"recorded site {max(self.sites)} must be below {sites}")
        return list(self.sites)

    def steps(self, total):
        """Numbers of the recorded steps of a run of `total` steps."""
        every = self.every or max(1, -(-total // INSTANTS))
        kept = np.arange(0, total + 1, every)
        return kept if kept[-1] == total else np.append(kept, total)


class Rows:
    """Recorded rows: time, energy, and u and v of the kept sites."""

    def __init__(self, instants, sites):
        kind = [("t", float), ("energy", float), ("u", float, (sites,)), ("v", float, (sites,))]
        self._rows = np.zeros(instants, dtype=kind)
        self._count = 0

    def add(self, t, energy, u, v):
        """Append a row."""
        self._rows[self._count] = t, energy, u, v
        self._count += 1

    def finished(self):
        """The rows written so far, as a structured array with fields t, energy, u, v."""
        return self._rows[: self._count]
