"""What `gradient` returns."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.gradients import chained
from tensegrity.scenes.dynamics import dynamics

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    from tensegrity.runs.run import Run
    from tensegrity.typing import Array

DIGITS = -np.log10(np.finfo(float).eps)


@dataclass(frozen=True, eq=False)
class Gradient:
    """A number that a run gave, and its derivatives.

    They are those of the scheme that was run, with its step, not of the equation it stands for.

    Attributes
    ----------
    value : float
    run : Run
    u, v : ndarray, (sites[, dim])
        Derivatives by the displacements and velocities at the start; 0 at held sites.
    mass : ndarray, (sites,)
        By the masses; 0 at held sites.
    parameters : dict of str to ndarray, (bonds,)
        By the parameters of the springs' laws that were wanted; of a network (springs,), with the
        wall contacts behind the bonds.
    shift : ndarray, (bonds,)
        By a constant added to each elongation, in a network: by gaps of contacts.
    reversal : float
        Largest difference of a state that the pass backwards returned to from that of the run
        [m, m/s].
    digits : float
        Decimal digits of the value that round-off in the state leaves: in chaos the derivative
        is as large as the value is uncertain, and of no use for design.
    """

    value: float
    run: Run = field(repr=False)
    u: Array = field(repr=False)
    v: Array = field(repr=False)
    mass: Array = field(repr=False)
    parameters: Mapping[str, Array] = field(repr=False)
    shift: Array = field(repr=False)
    reversal: float
    digits: float
    _scene: Any = field(repr=False)
    _names: tuple[str, ...] = field(repr=False)

    def by(self, name: str) -> Array:
        """Derivatives by an argument of what the scene was built from.

        Parameters
        ----------
        name : str
            "prestrain", "height", "k_cross" of prisms; "stiffness" (at fixed preload), "preload"
            of power laws; a symbol of a `Potential` of one's own; "diameter", "modulus" of beads.

        Returns
        -------
        ndarray, (bonds,), of beads (sites,)
            0 where there is no such argument; (springs,) in a network.

        Raises
        ------
        TensegrityError
            A name that nothing in the scene has, or that was not wanted.
        """
        check.kind("name", name, str)
        if name not in self._names:
            known = ", ".join(self._names) or "nothing"
            raise TensegrityError(f"by {check.shown(name)}: this gradient knows {known}")
        of = dynamics(self._scene)
        if name in of.arguments:
            return of.by_argument(name, self.mass, self._along, self.shift)
        return self._along(name)

    def _along(self, name: str) -> Array:
        """By an argument of the springs."""
        table = dynamics(self._scene).springs
        springs, found = table.different, np.zeros(len(table.group))
        laws, law, _ = table.table
        most = max(len(one.parameters) for one in laws)
        each = chained.slopes(springs, name, most)[table.group]
        for number, one in enumerate(laws):
            mine = law[table.group] == number
            for k, symbol in enumerate(one.parameters):
                if each[mine, k].any() and str(symbol) in self.parameters:
                    found[mine] += self.parameters[str(symbol)][mine] * each[mine, k]
        return found

    def __str__(self) -> str:
        known = ", ".join(self._names) or "nothing"
        return (
            f"value {self.value:.9g}, {self.digits:.3g} digits of which round-off leaves\n"
            f"derivatives by u, v, mass, and by {known}\n"
            f"returned to the start within {self.reversal:.1e}"
        )


def digits(value: float, by_u: Array, by_v: Array, largest: tuple[float, float]) -> float:
    """Digits of a value that one rounding of the largest |u| and |v| leaves."""
    moved = [float(np.abs(x).max(initial=0)) * scale for x, scale in zip((by_u, by_v), largest,
             strict=True)]  # fmt: skip
    noise = np.finfo(float).eps * max(moved)
    if noise == 0:
        return float(DIGITS)
    if value == 0:
        return 0.0
    return float(np.clip(np.log10(abs(value) / noise), 0, DIGITS))
