"""Verification of the best designs of a search with finer steps and in a longer window.

An optimiser exploits the errors of an integration, and delays a force beyond the end of the run.
The best designs are therefore computed again with a quarter and an eighth of the step, and those
whose force changes are rejected; of the others, that with the least force in a window ten times
longer, at a quarter of the step, is selected.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from tensegrity import TensegrityError
from tensegrity.printing import filled

if TYPE_CHECKING:
    from collections.abc import Callable

    from granular.beads import Bead
    from tensegrity.typing import Array

    Force = Callable[[float, float, Array], Array]  # of t_end, dt [s], rows: on the wall [N]

FINER = (4, 8)  # of whose steps the best are computed again
MOVED = 1e-3  # relative change of a force that is the integration's, not the design's
FINALISTS = 16  # the best designs that are computed again, at a time
CANDIDATES = 4 * FINALISTS  # the best of a search: so many are looked at
WINDOW = 10  # times longer, for the maximum to stay


class Again(NamedTuple):
    """The best design computed again.

    Attributes
    ----------
    t_end, dt : float
        [s].
    force : float
        [N]; nan where a scene could not be followed that long.
    """

    t_end: float
    dt: float
    force: float


@dataclass(frozen=True, eq=False)
class Best:
    """Result of a search.

    Attributes
    ----------
    beads : list of Bead
        The design, from the struck end to the wall.
    peak_force : float
        Largest force on the wall, with the finest of the steps [N].
    evaluations : int
        Number of different designs computed; with "gradient" of all, each with its gradient.
    history : ndarray, (evaluations,)
        Force of each in the order in which they were proposed [N], with the step of the search,
        right to 1e-4 as a rule and to 3e-3 in the worst of 960 random designs;
        `numpy.minimum.accumulate(history)` shows the progress of the search.
    converged_in_time : bool
        Whether the force agrees with two finer steps, and in a window ten times longer.
    again : tuple of Again
        The best with the step of the search, finer ones, and in the longer window.
    rejected : int
        Better designs of the search whose force moved with the step.
    failed : int
        Designs that were lost twice with the worker that computed them; inf in `history`.
    method : str
    seed : int
    """

    beads: list[Bead]
    peak_force: float
    evaluations: int
    history: Array
    converged_in_time: bool
    again: tuple[Again, ...]
    rejected: int
    failed: int
    method: str
    seed: int

    def __str__(self) -> str:
        lines = [
            f"{self.peak_force:.6g} N, {self.method}, seed {self.seed}, "
            f"{self.evaluations} designs computed"
        ]
        lines += [
            f"in {one.t_end:.4g} s at dt = {one.dt:.3g} s: {one.force:.6g} N" for one in self.again
        ]
        if self.failed:
            lines.append(f"{self.failed} designs were lost with their workers")
        if self.rejected:
            lines.append(f"{self.rejected} better ones moved with the step and were not taken")
        if not self.converged_in_time:
            lines.append(
                f"NOT converged in time: these differ by more than {MOVED:g}; take a longer "
                "t_end, or this force as an estimate"
            )
        return filled("\n".join(lines))

    __repr__ = __str__


def chosen(
    force: Force, t_end: float, dt: float, top: Array, forces: Array
) -> tuple[Array, tuple[Again, ...], bool, int]:
    """The best design that does not move with the step, in the longer window too.

    Parameters
    ----------
    force : callable (t_end, dt, rows) -> ndarray, (rows,)
        Of rows of genes, on the wall [N].
    t_end, dt : float
        Of the search [s].
    top, forces : ndarray, (designs, count), (designs,)
        Its best rows, the first the best, and what it found for them [N].

    Returns
    -------
    row, again, converged, rejected
        Its genes, and what `Best` says of it.
    """
    rejected = 0
    for first in range(0, len(top), FINALISTS):
        rows, found = (x[first : first + FINALISTS] for x in (top, forces))
        finer = np.array([force(t_end, dt / k, rows) for k in FINER])
        holds = np.abs(finer[0] / finer[-1] - 1) <= MOVED
        worth = np.where(holds, finer[-1], np.inf) if holds.any() else finer.max(axis=0)
        if not first or holds.any():
            k, longer = _lasting(force, WINDOW * t_end, dt / FINER[0], rows, worth)
            row, known, values = rows[k], found[k], finer[:, k]
            converged = bool(holds[k] and abs(longer / values[0] - 1) <= MOVED)
        rejected += int(np.sum(~holds & (found < worth.min())))
        if holds.any():
            break
    again = [Again(t_end, dt, float(known))]
    again += [Again(t_end, dt / k, float(f)) for k, f in zip(FINER, values, strict=True)]
    again.append(Again(WINDOW * t_end, dt / FINER[0], longer))
    return row, tuple(again), converged, rejected


def _lasting(force: Force, t_end: float, dt: float, rows: Array, worth: Array) -> tuple[int, float]:
    """Number of the design with the least force in the longer window, and that force [N].

    It is looked for from the best on, as long as another could have less.
    """
    best: tuple[float, int, float] | None = None
    for k in np.argsort(worth, kind="stable").tolist():
        if best is not None and not worth[k] < best[0]:
            break
        try:
            longer = float(force(t_end, dt, rows[k : k + 1])[0])
        except TensegrityError:  # a pack that came apart, such that unlisted beads meet
            longer = np.nan
        true = np.inf if np.isnan(longer) else max(float(worth[k]), longer)
        if best is None or true < best[0]:
            best = true, k, longer
    assert best is not None
    return best[1], best[2]
