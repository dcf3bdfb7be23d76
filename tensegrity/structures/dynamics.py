"""A structure as masses and springs for `simulate`: bars push and pull, strings pull only."""

from __future__ import annotations

import math

from tensegrity import check
from tensegrity.engine.law import Law
from tensegrity.once import once
from tensegrity.scenes.network import Network
from tensegrity.springs.kinks import TAUT
from tensegrity.springs.potential import Potential, call
from tensegrity.structures.members import Members
from tensegrity.typing import Array

SMALLEST = 1e-100  # elongation [m] from which a string has tension


class _Member(Potential):
    pulls_only = False

    def __init__(self, stiffness: float, length: float) -> None:
        stiffness = check.number("stiffness", stiffness, above=0, unit="N/m")
        length = check.number("length", length, above=0, unit="m")
        values = [stiffness, TAUT * length] if self.pulls_only else [stiffness]
        self._set(_law(self.pulls_only), values, length, (-math.inf, math.inf))
        self.openings = ((0.0, stiffness, 1.0, 1.0),) if self.pulls_only else ()
        self.origin = call(type(self).__name__, stiffness=stiffness, length=length)


class StringSpring(_Member):
    """A string of a stiffness [N/m] > 0: tension(r) = stiffness max(r, 0).

    The elongation r [m] counts from its natural length [m] > 0.  The stiffness at r is that of a
    taut string from -`TAUT` of this length on, as in `tensegrity.structures.members`.
    """

    pulls_only = True


class BarSpring(_Member):
    """A bar of a stiffness [N/m] > 0: tension(r) = stiffness r; lengths as of a string."""


@once
def _law(pulls_only: bool) -> Law:
    import sympy as sp

    from derivations import member

    r, pulled, margin = sp.symbols("r pulled margin", real=True)
    stretched = member.energy(member.natural + r)
    if not pulls_only:
        return Law(stretched, r, (member.stiffness,))
    scattered_forces, taut = sp.Heaviside(r - SMALLEST), sp.Heaviside(r + margin)
    tension, known = sp.diff(stretched, r).subs(r, pulled), (member.stiffness, margin)
    return Law(
        scattered_forces * stretched, r, known, tension, ((pulled, scattered_forces * r, taut),)
    )


def network(positions: Array, members: Members, mass: Array) -> Network:
    """See `Structure.network`."""
    lengths = [float(f"{x:.3g}") for x in members.natural]  # those off by round-off: one spring
    springs = [
        (StringSpring if string else BarSpring)(k, length)
        for string, k, length in zip(
            members.pulls_only.tolist(), members.stiffness.tolist(), lengths, strict=True
        )
    ]
    return Network(positions, members.ends, springs, lengths=members.natural, mass=mass)
