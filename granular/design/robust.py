"""The peak force of one design over random deviations of its diameters, gaps and impact speed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from granular.beads import Bead, Striker
from granular.design import objective
from granular.design.scatter import Scatter, fraction
from granular.design.spaces import Designs
from granular.materials import Material
from tensegrity import TensegrityError, check
from tensegrity.engine import native
from tensegrity.printing import Lines, Printed
from tensegrity.readonly import fixed
from tensegrity.typing import Array


@dataclass(frozen=True, eq=False, repr=False)
class Robustness(Printed):
    """Peak forces of a design that is not made exactly.

    Attributes
    ----------
    peaks : ndarray, (draws,)
        Largest force on the wall [N], > 0, in the order of the draws.
    """

    peaks: Array

    def quantile(self, q: float) -> float:
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
        return float(np.quantile(self.peaks, fraction("quantile", q)))

    def _lines(self) -> Lines:
        low, middle, high = (self.quantile(q) for q in (0.1, 0.5, 0.9))
        yield (
            f"{len(self.peaks)} draws: median {middle:.6g} N, "
            f"a tenth below {low:.6g} N and a tenth above {high:.6g} N"
        )


def robustness(
    beads: Sequence[Bead],
    *,
    striker: Striker,
    wall: Material,
    t_end: float,
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
    objective.check_blow(striker, wall)
    t_end = check.number("t_end", t_end, above=0, unit="s")
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
