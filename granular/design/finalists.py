"""How far a design can be trusted: the best ones of a search with finer steps and in a longer
window, and the peak force of one over random deviations of its diameters, gaps and impact speed.

An optimiser exploits the errors of an integration, and delays a force beyond the end of the run.
The best designs are therefore computed again with the default step and half of it, and those whose
force changes are rejected; of the others, that with the least force in a window ten times longer,
at the default step, is selected.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np

from granular.beads import Bead, Material, Striker
from granular.design import objective
from granular.design.scatter import Scatter
from granular.design.spaces import Designs
from tensegrity import TensegrityError
from tensegrity.checked import checked
from tensegrity.engine import native
from tensegrity.printing import Lines, Printed
from tensegrity.readonly import fixed
from tensegrity.typing import Array, Duration, Quantile

Force: TypeAlias = Callable[[float, float, Array], Array]  # forces [N] of t_end, dt [s], genes

MOVED = 1e-3  # relative change of a force that is an error of the integration
FINALISTS = 16  # the best designs that are computed again together
CANDIDATES = 4 * FINALISTS  # best designs of a search that are examined
WINDOW = 10  # factor by which the window is longer in which the maximum must not change


class Again(NamedTuple):
    """The best design computed again.

    Attributes
    ----------
    t_end, dt : float
        [s].
    force : float
        [N]; nan if a scene could not be integrated that long.
    """

    t_end: float
    dt: float
    force: float


@dataclass(frozen=True, eq=False, repr=False)
class Best(Printed):
    """Result of a search.

    Attributes
    ----------
    beads : list of Bead
        The design, from the struck end to the wall.
    peak_force : float
        Largest force on the wall, with the finest of the steps [N].
    evaluations : int
        Number of different designs computed; with "gradient" of all designs with gradients.
    history : ndarray, (evaluations,)
        Force of each in the order of the proposals [N], with the step of the search,
        right to 1e-4 as a rule and to 3e-3 in the worst of 960 random designs;
        `numpy.minimum.accumulate(history)` shows the progress of the search.
    converged_in_time : bool
        Whether the force agrees with two finer steps, and in a window ten times longer.
    again : tuple of Again
        The best design with the step of the search, with finer ones, and in the longer window.
    rejected : int
        Number of better designs of the search whose force changed with the step.
    failed : int
        Number of designs that were lost twice with their worker; inf in `history`.
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

    def _lines(self) -> Lines:
        of = f"{self.peak_force:.6g} N, {self.method}, seed {self.seed}"
        yield f"{of}, {self.evaluations} designs computed"
        for one in self.again:
            yield f"in {one.t_end:.4g} s at dt = {one.dt:.3g} s: {one.force:.6g} N"
        if self.failed:
            yield f"{self.failed} designs were lost with their workers"
        if self.rejected:
            yield f"{self.rejected} better ones were rejected: their force changes with dt"
        if not self.converged_in_time:
            yield (
                f"not converged in time: these differ by more than {MOVED:g}; take a longer "
                "t_end, or this force as an estimate"
            )


def chosen(
    force: Force, t_end: float, dt: float, fine: float, top: Array, forces: Array
) -> tuple[Array, tuple[Again, ...], bool, int]:
    """The best design whose force does not change with the step, also in the longer window.

    Parameters
    ----------
    force : callable (t_end, dt, rows) -> ndarray, (rows,)
        Forces on the wall for rows of genes [N].
    t_end, dt : float
        Duration and step of the search [s].
    top, forces : ndarray, (designs, count), (designs,)
        Its best rows, the best one first, and their forces in the search [N].

    Returns
    -------
    row, again, converged, rejected
        Its genes, and the attributes of `Best`.
    """
    rejected, steps = 0, (fine, fine / 2)
    for first in range(0, len(top), FINALISTS):
        rows, coarse = (x[first : first + FINALISTS] for x in (top, forces))
        finer = np.array([force(t_end, step, rows) for step in steps])
        holds = np.abs(finer[0] / finer[-1] - 1) <= MOVED
        worth = np.where(holds, finer[-1], np.inf) if holds.any() else finer.max(axis=0)
        if not first or holds.any():
            k, longer = _lasting(force, WINDOW * t_end, fine, rows, worth)
            row, known, values = rows[k], coarse[k], finer[:, k]
            converged = bool(holds[k] and abs(longer / values[0] - 1) <= MOVED)
        rejected += int(np.sum(~holds & (coarse < worth.min())))
        if holds.any():
            break
    again = [Again(t_end, dt, float(known))]
    again += [Again(t_end, step, float(f)) for step, f in zip(steps, values, strict=True)]
    again.append(Again(WINDOW * t_end, fine, longer))
    return row, tuple(again), converged, rejected


def _lasting(force: Force, t_end: float, dt: float, rows: Array, worth: Array) -> tuple[int, float]:
    """Number of the design with the least force in the longer window, and that force [N].

    The search starts from the best and ends when no other design can have a smaller one.
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


@dataclass(frozen=True, eq=False, repr=False)
class Robustness(Printed):
    """Peak forces of a design that is not made exactly.

    Attributes
    ----------
    peaks : ndarray, (draws,)
        Largest force on the wall [N], > 0, in the order of the draws.
    """

    peaks: Array

    @checked
    def quantile(self, q: Quantile) -> float:
        """Force that a fraction q of the draws stays below [N].

        Parameters
        ----------
        q : float
            From 0 to 1.

        Returns
        -------
        float
            Interpolated between the draws.

        Raises
        ------
        TensegrityError
            A fraction out of its range.
        """
        return float(np.quantile(self.peaks, q))

    def _lines(self) -> Lines:
        low, middle, high = (self.quantile(q) for q in (0.1, 0.5, 0.9))
        yield (
            f"{len(self.peaks)} draws: median {middle:.6g} N, "
            f"a tenth below {low:.6g} N and a tenth above {high:.6g} N"
        )


@checked
def robustness(
    beads: Sequence[Bead],
    *,
    striker: Striker,
    wall: Material,
    t_end: Duration,
    diameters: float = 0.0,
    gaps: float = 0.0,
    speed: float = 0.0,
    draws: int = 100,
    seed: int = 0,
) -> Robustness:
    """Largest force on the wall behind a chain over random deviations from its design.

    Parameters
    ----------
    beads : sequence of Bead
        A design in the order of the axis, from the struck end to the wall.
    striker : Striker
        In contact with the first bead; its diameter is exact.
    wall : Material
    t_end : float
        Time after the impact [s], > 0.
    diameters, gaps, speed, draws, seed : optional
        Parameters of the deviations; see `Scatter`.

    Returns
    -------
    Robustness
        With the default step of `peak_force`; without deviations every peak is that force.

    Raises
    ------
    TensegrityError
        As `peak_force`; a deviation out of its range; a wave that does not arrive before `t_end` in
        some draw.
    CompilerError
        No C compiler.

    Examples
    --------
    >>> from granular import Bead, Striker, materials
    >>> from granular.design import robustness
    >>> steel = materials["steel"]
    >>> big, small = Bead(10e-3, steel), Bead(4e-3, steel)
    >>> blow = {"striker": Striker(big, 0.44), "wall": steel, "t_end": 1e-3}
    >>> found = robustness([big] * 10 + [small] * 10, gaps=1e-6, diameters=0.01, **blow)
    >>> print(f"{found.quantile(0.5):.1f} N")
    60.8 N
    """
    scatter = Scatter(diameters, gaps, speed, draws, seed)
    chains, single = objective.checked_beads(beads)
    if not single:
        raise TensegrityError(f"{len(chains)} designs: give the beads of one")
    native.require()
    varied, separations, speeds = scatter.varied(Designs.of(chains), striker.speed)
    unit = float(varied.behind(striker.bead).unit(wall, speeds.max()).min())
    steps = objective.step_count(unit, t_end, None)
    peaks = objective.largest(varied, striker, wall, t_end, steps, separations, speeds)
    late = int(np.isinf(peaks.first).sum())
    if late:
        raise TensegrityError(
            f"t_end {t_end:g} s is before the wave arrives in {late} of {scatter.draws} draws"
        )
    return Robustness(fixed(peaks.force))
