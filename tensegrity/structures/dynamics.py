"""A structure as masses and springs for `simulate`: bars push and pull, strings pull only."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from tensegrity import check
from tensegrity.engine.codegen import Law
from tensegrity.once import once
from tensegrity.scenes.network import Network
from tensegrity.springs.potential import Potential, call

if TYPE_CHECKING:
    from typing import Any

    from tensegrity.structures.members import Members
    from tensegrity.typing import Array

SMALLEST = 1e-100  # elongation [m] from which a string counts as taut


class StringSpring(Potential):
    """A string: tension(r) = stiffness max(r, 0) at the elongation r from its natural length.

    Parameters
    ----------
    stiffness : float
        [N/m], > 0.
    length : float, optional
        Natural length [m].
    """

    smooth = False

    def __init__(self, stiffness: float, length: float | None = None) -> None:
        stiffness = check.number("stiffness", stiffness, above=0, unit="N/m")
        self._set(_string_law(), [stiffness], length, (-math.inf, math.inf))
        given: dict[str, Any] = {} if length is None else {"length": self._length}
        self.origin = call("StringSpring", stiffness=stiffness, **given)


class BarSpring(Potential):
    """A bar: tension(r) = stiffness r at the elongation r from its natural length.

    Parameters
    ----------
    stiffness : float
        [N/m], > 0.
    length : float, optional
        Natural length [m].
    """

    def __init__(self, stiffness: float, length: float | None = None) -> None:
        stiffness = check.number("stiffness", stiffness, above=0, unit="N/m")
        self._set(_bar_law(), [stiffness], length, (-math.inf, math.inf))
        given: dict[str, Any] = {} if length is None else {"length": self._length}
        self.origin = call("BarSpring", stiffness=stiffness, **given)


@once
def _string_law() -> Law:
    import sympy as sp

    from derivations import member

    r = sp.Symbol("r", real=True)
    stretched = member.energy(member.natural + r)
    taut = sp.Heaviside(r - SMALLEST)
    return Law(taut * stretched, r, (member.stiffness,), taut * sp.diff(stretched, r))


@once
def _bar_law() -> Law:
    import sympy as sp

    from derivations import member

    r = sp.Symbol("r", real=True)
    return Law(member.energy(member.natural + r), r, (member.stiffness,))


def network(positions: Array, members: Members, mass: Array) -> Network:
    """See `Structure.network`."""
    springs = [
        (StringSpring if string else BarSpring)(k)
        for string, k in zip(members.pulls_only.tolist(), members.stiffness.tolist(), strict=True)
    ]
    return Network(positions, members.ends, springs, lengths=members.natural, mass=mass)
