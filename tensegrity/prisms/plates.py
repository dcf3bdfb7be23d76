"""Columns of prisms between rigid plates that move along the axis and turn about it.

Each plate is a polygon that two units share, with a mass and a moment of inertia; its coordinates
are the axial displacement and the rotation times the radius of gyration.  The energy of a unit is
that of its members as a function of its height and twist, its bases in equilibrium at each, a
`PairLaw` of both coordinates.
Source: the talk, part III, "Elastic problem", where the twist is in equilibrium too.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from tensegrity import check
from tensegrity.engine.pair import PairForms
from tensegrity.errors import TensegrityError
from tensegrity.lattices.bloch import PeriodicBonds
from tensegrity.once import once
from tensegrity.prisms.equations import numbers_of, unit
from tensegrity.scenes.network import Network
from tensegrity.springs.pair_law import PairLaw, pair_of_law
from tensegrity.typing import Members
from tensegrity.unit.forms import changes


def plate_law(prism: Members, turn: float) -> PairLaw:
    """A unit between two plates of two coordinates each: axial displacement, and rotation times the
    radius of gyration.

    Parameters
    ----------
    prism : Prism
        With elastic bars.
    turn : float
        Its twist times that radius [m], below 0 for the opposite handedness.

    Returns
    -------
    PairLaw
    """
    if math.isinf(prism.k_bar):
        raise TensegrityError("k_bar inf N/m must be finite: rigid bars leave no twist")
    k, angle = prism.k_cross, math.pi / prism.sides
    values = [k * prism.base**2, prism.height, turn, math.pi / 4 + angle / 2,
              prism.height / prism.base, prism.prestrain, k / prism.k_base, k / prism.k_bar,
              prism.sides, math.sin(angle), math.cos(angle)]  # fmt: skip
    law = _law(prism.sides != 3, math.isinf(prism.k_base))
    return pair_of_law(law, values[: len(law.parameters)], {"prism": prism, "turn": turn})


@once
def _law(any_sides: bool, rigid_bases: bool) -> PairForms:
    """The energy of a unit, its bases in equilibrium unless they are rigid."""
    import sympy as sp

    first, second = sp.symbols("z_i s_i", real=True), sp.symbols("z_j s_j", real=True)
    scale, height, turn, half = sp.symbols("scale height turn half_twist", real=True)
    made, (numbers, symbols) = unit(any_sides), numbers_of(any_sides, (False, False, False))
    of = changes(made)
    wider, _, rise = of.unknowns
    tangent = sp.tan(half * (second[1] - first[1]) / turn)
    known = {rise: (second[0] - first[0]) / height * symbols[0]}
    known |= {of.sines[1]: 2 * tangent / (1 + tangent**2)}
    known |= {of.versines[1]: 2 * tangent**2 / (1 + tangent**2)}
    known |= dict(zip(of.constants, numbers, strict=False)) | ({wider: 0} if rigid_bases else {})
    energy, rest = 0, iter(numbers[len(of.constants) :])
    tensions, stiffness = ([next(rest) for _ in made.members] for _ in range(2))
    for member, (length, form), pull, k in zip(made.members, of.lengths, tensions, stiffness,
                                               strict=True):  # fmt: skip
        length, form = (x.xreplace(known) for x in (sp.sympify(length), form))
        longer = form / (length + sp.sqrt(length**2 + form)) if length else form
        energy += member.count * (pull * longer + k * longer**2 / 2) if longer else 0
    parameters = (scale, height, turn, half, *symbols)
    inner = () if rigid_bases else (wider,)
    return PairForms(scale * energy, first, second, parameters, (True, True), inner)


def plate_column(
    prism: Any, count: int, chirality: str, plates: Any, periodic: bool
) -> Network | PeriodicBonds:
    """A column between heavy plates; see `Prism.column`.

    Parameters
    ----------
    prism : Prism
    count : int
    chirality : {"alternate", "same"}
    plates : (float, float)
        Mass [kg] and radius of gyration [m].
    periodic : bool

    Returns
    -------
    Network or PeriodicBonds

    Raises
    ------
    TensegrityError
        Rigid bars, or numbers that are not above 0.
    """
    if len(plates) != 2:
        raise TensegrityError(f"{len(plates)} numbers of the plates must be 2, mass and gyration")
    mass, gyration = (
        check.number(f"{name} of the plates", x, above=0, unit=unit)
        for x, name, unit in zip(plates, ("mass", "radius of gyration"), ("kg", "m"), strict=True)
    )
    step = np.array([prism.height, gyration * prism.reference_twist])
    turns = np.where((chirality == "alternate") & (np.arange(count) % 2 == 1), -1, 1)
    apart = step * np.column_stack([np.ones(count), turns])
    positions = np.concatenate([np.zeros((1, 2)), np.cumsum(apart, axis=0)])
    each, springs = np.arange(count), [plate_law(prism, x) for x in apart[:, 1].tolist()]
    ends = np.column_stack([each, each + 1])
    if not periodic:
        return Network(positions, ends, springs, mass=mass)
    rest = np.zeros((2, 1, 2))
    blocks = np.concatenate([spring.tangent(*rest)[:, 2:, 2:] for spring in springs])
    offsets = np.zeros((count, 1), dtype=int)
    offsets[-1], ends[-1, 1] = 1, 0
    vectors = np.array([[count * prism.height, 0.0]])
    return PeriodicBonds(positions[:-1], vectors, ends, offsets, blocks, np.full(count, mass))
