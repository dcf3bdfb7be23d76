"""A structure as masses and springs for `simulate`: bars push and pull, strings pull only."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from tensegrity import check
from tensegrity.engine.law import Law
from tensegrity.once import once
from tensegrity.scenes.network import Network
from tensegrity.springs.potential import Potential, call

if TYPE_CHECKING:
    from tensegrity.structures.members import Members
    from tensegrity.typing import Array

SMALLEST = 1e-100  # elongation [m] from which a string counts as taut


class _Member(Potential):
    pulls_only = False

    def __init__(self, stiffness: float) -> None:
        stiffness = check.number("stiffness", stiffness, above=0, unit="N/m")
        self._set(_law(self.pulls_only), [stiffness], None, (-math.inf, math.inf))
        self.openings = ((0.0, stiffness, 1.0, 1.0),) if self.pulls_only else ()
        self.origin = call(type(self).__name__, stiffness=stiffness)


class StringSpring(_Member):
    """A string of a stiffness [N/m] > 0: tension(r) = stiffness max(r, 0).

    The elongation r [m] counts from its natural length.
    """

    pulls_only = True


class BarSpring(_Member):
    """A bar of a stiffness [N/m] > 0: tension(r) = stiffness r, r as of a string."""


@once
def _law(pulls_only: bool) -> Law:
    import sympy as sp

    from derivations import member

    r = sp.Symbol("r", real=True)
    stretched = member.energy(member.natural + r)
    if not pulls_only:
        return Law(stretched, r, (member.stiffness,))
    taut = sp.Heaviside(r - SMALLEST)
    return Law(taut * stretched, r, (member.stiffness,), taut * sp.diff(stretched, r))


def network(positions: Array, members: Members, mass: Array) -> Network:
    """See `Structure.network`."""
    springs = [
        (StringSpring if string else BarSpring)(k)
        for string, k in zip(members.pulls_only.tolist(), members.stiffness.tolist(), strict=True)
    ]
    return Network(positions, members.ends, springs, lengths=members.natural, mass=mass)
