"""The springs of bars and strings, and the network of a structure in motion."""

from __future__ import annotations

import math
from typing import Any

from tensegrity.checked import checked
from tensegrity.engine.law import Law
from tensegrity.once import once
from tensegrity.printing import call
from tensegrity.scenes.network import Network
from tensegrity.springs.kinks import TAUT
from tensegrity.springs.potential import Potential
from tensegrity.structures.members import Members
from tensegrity.typing import Array, Length, Stiffness

SMALLEST = 1e-100  # elongation above which a string has tension [m]


@checked
class _Member(Potential):
    tension_only = False

    def __init__(self, stiffness: Stiffness, length: Length) -> None:
        values = [stiffness, TAUT * length] if self.tension_only else [stiffness]
        self._set(_law(self.tension_only), values, length, (-math.inf, math.inf))
        self.kinks = ((0.0, stiffness, 1.0, 1.0),) if self.tension_only else ()
        self._origin = call(type(self).__name__, stiffness=stiffness, length=length)


class StringSpring(_Member):
    """A string with tension(r) = stiffness max(r, 0), stiffness > 0 [N/m].

    The elongation r [m] is measured from the natural length > 0 [m].  Down to -`TAUT` times this
    length the stiffness is that of a taut string, as in `tensegrity.structures.members`.
    """

    tension_only = True


class BarSpring(_Member):
    """A bar with tension(r) = stiffness r; r [m] is measured from the natural length > 0 [m]."""


@once
def _law(tension_only: bool) -> Law:
    import sympy as sp

    from derivations import member

    r, positive_part, margin = sp.symbols("r positive_part margin", real=True)
    stretched = member.energy(member.natural + r)
    if not tension_only:
        return Law(stretched, r, (member.stiffness,))
    has_tension, taut = sp.Heaviside(r - SMALLEST), sp.Heaviside(r + margin)
    tension, known = sp.diff(stretched, r).subs(r, positive_part), (member.stiffness, margin)
    return Law(
        has_tension * stretched, r, known, tension, ((positive_part, has_tension * r, taut),)
    )


def network(positions: Array, members: Members, mass: Array, **given: Any) -> Network:
    """The network of a structure; see `Structure.network`.

    Parameters
    ----------
    positions : ndarray, (nodes, dim)
        Positions of the nodes [m].
    members : Members
    mass : ndarray, (nodes,)
        Masses [kg].
    **given
        Further arguments of `Network`.

    Returns
    -------
    Network
    """
    # lengths equal up to round-off have one spring
    lengths = [float(f"{x:.3g}") for x in members.natural]
    springs = [
        (StringSpring if string else BarSpring)(k, length)
        for string, k, length in zip(
            members.tension_only.tolist(), members.stiffness.tolist(), lengths, strict=True
        )
    ]
    return Network(positions, members.ends, springs, lengths=members.natural, mass=mass, **given)
