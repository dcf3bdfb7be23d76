"""The softest modes of a structure: stiffness, frequency and shape."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check, plotting
from tensegrity.printing import Lines, Printed
from tensegrity.typing import Array

if TYPE_CHECKING:
    from typing import Any

    from matplotlib.axes import Axes

SHOWN = 0.15  # of the size of the structure: the largest displacement in a picture


@dataclass(frozen=True, repr=False)
class StructureModes(Printed):
    """The softest modes of a structure, without rigid motions.

    Attributes
    ----------
    eigenvalues : ndarray, (count,)
        Of the tangent stiffness [N/m], the lowest first; one below 0 is an instability, and 0
        where it is round-off.
    frequencies : ndarray, (count,)
        Angular frequencies of small motions [rad/s], the lowest first; below 0 the rate [1/s]
        at which an unstable motion grows.
    shapes : ndarray, (count, nodes, dim)
        Motions that belong to the frequencies, the largest displacement of a node being 1.
    structure : Structure
    total : int
        Number of all modes that the supports leave, of which these are the first.
    """

    eigenvalues: Array
    frequencies: Array
    shapes: Array
    structure: Any = field(repr=False)
    total: int

    def __len__(self) -> int:
        return len(self.frequencies)

    def _lines(self) -> Lines:
        yield f"modes 1 to {len(self)} of {self.total}, without rigid motions"
        rows = zip(self.frequencies, self.eigenvalues, self.shapes, strict=True)
        for number, (frequency, stiffness, shape) in enumerate(rows, 1):
            node = int(np.argmax(np.sum(shape**2, axis=-1)))
            yield (
                f"  {number}: {frequency:.6g} rad/s, stiffness {stiffness:.6g} N/m, "
                f"node {node} moves most"
            )

    def plot(self, ax: Axes | None = None, number: int = 0) -> Axes:
        """Draw a mode: the structure, and in grey where its nodes and members move to.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            As of `Structure.plot`.
        number : int, optional
            Of the mode, from 0.

        Returns
        -------
        matplotlib.axes.Axes

        Raises
        ------
        TensegrityError
            `ax` is not a Matplotlib axes, or there is no such mode.
        """
        number = check.whole("number", number, least=0, below=len(self))
        of = self.structure
        drawn = of.plot(ax)
        size = float(np.ptp(of.positions, axis=0).max())
        factor = plotting.metres(size)[0]
        moved = factor * (of.positions + SHOWN * size * self.shapes[number])
        for ends in of.ends:
            drawn.plot(*moved[ends].T, "-", color="0.6", lw=1.0)
        frequency = self.frequencies[number]
        drawn.set_title(f"mode {number + 1} of {self.total}: {frequency:.6g} rad/s", fontsize=10)
        return drawn
