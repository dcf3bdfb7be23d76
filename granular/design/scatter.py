"""Random deviations of chains from their design: of diameters, of gaps, and of the striker's speed.

Diameters and the speed are multiplied by independent normal factors of mean 1; the mass of a bead
changes with the third power of its factor, its radius of contact in proportion.  Gaps are uniform
from 0 to the largest one.  The striker touches the first bead, and its own diameter is exact.  The
same seed gives the same deviations of every design of equally many beads: differences between
designs are then those of the designs (common random numbers).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from granular.design.spaces import Designs
from tensegrity.checked import checked
from tensegrity.printing import printed
from tensegrity.typing import Array, Distance, Index, Quantile

WIDEST = 0.1  # relative standard deviation: ten of these make a diameter 0
Deviation = Annotated[float, ">= 0", f"< {WIDEST}"]
MOST_DRAWS = 10**6
Draws = Annotated[int, ">= 1", f"< {MOST_DRAWS}"]


@checked
@dataclass(frozen=True)
class Scatter:
    """Deviations of a chain, and the quantile of the peak force over them.

    Parameters
    ----------
    diameters : float, optional
        Relative standard deviation of the diameters of the beads, at least 0 and below 0.1.
    gaps : float, optional
        Largest gap between a bead and the next, and before the wall [m], >= 0.
    speed : float, optional
        Relative standard deviation of the speed of the striker, at least 0 and below 0.1.
    draws : int, optional
        Number of chains that are drawn, >= 1.
    seed : int, optional
        >= 0.
    quantile : float, optional
        From 0 to 1; by default the median.

    Raises
    ------
    TensegrityError
        A number out of its range.

    Examples
    --------
    >>> from granular.design import Scatter
    >>> print(Scatter(diameters=0.01, gaps=1e-6, draws=16))
    Scatter: diameters 0.01, gaps 1e-06 m, speed 0, draws 16, seed 0, quantile 0.5
    """

    diameters: Deviation = 0.0
    gaps: Distance = 0.0
    speed: Deviation = 0.0
    draws: Draws = 100
    seed: Index = 0
    quantile: Quantile = 0.5

    __str__ = printed(gaps="m")

    def varied(self, designs: Designs, speed: float) -> tuple[Designs, Array, Array]:
        """Every design with every draw.

        Parameters
        ----------
        designs : Designs
        speed : float
            Of the striker [m/s].

        Returns
        -------
        chains : Designs
            The chains, those of the first design first; (designs times draws, beads).
        gaps : ndarray, (designs times draws, contacts)
            Initial separations [m], the striker's 0.
        speeds : ndarray, (designs times draws,)
            [m/s].
        """
        rng, count = np.random.default_rng(self.seed), designs.mass.shape[1]
        factor = 1 + self.diameters * rng.standard_normal((self.draws, count))
        gaps = self.gaps * rng.random((self.draws, count))
        speeds = speed * (1 + self.speed * rng.standard_normal(self.draws))
        gaps = np.append(np.zeros((self.draws, 1)), gaps, axis=1)
        which, times = np.repeat(np.arange(len(designs)), self.draws), len(designs)
        factor = np.tile(factor, (times, 1))
        exact = designs[which]
        chains = Designs(exact.mass * factor**3, exact.modulus, exact.poisson,
                         exact.radius * factor)  # fmt: skip
        return chains, np.tile(gaps, (times, 1)), np.tile(speeds, times)

    def worth(self, forces: Array) -> Array:
        """The quantile of forces (designs, draws) [N], inf where one of them is; (designs,)."""
        finite = np.isfinite(forces).all(axis=1)
        worth = np.full(len(forces), np.inf)
        worth[finite] = np.quantile(forces[finite], self.quantile, axis=1)
        return np.where(np.isnan(forces).any(axis=1), np.nan, worth)
