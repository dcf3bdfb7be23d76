"""Force densities that a user asks of a structure, by themselves or by the prestrain of strings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check
from tensegrity.errors import EquilibriumError, TensegrityError
from tensegrity.structures import statics

if TYPE_CHECKING:
    from typing import Any

    from tensegrity.typing import Array

SAME = 1e-9  # force that is left on a node, over those of its members: no self-stress


def checked(structure: Any, force_densities: Any) -> Array:
    """Force densities that are a self-stress, (members,)."""
    q = check.vector("force_densities", force_densities, (len(structure.ends),))
    matrix = statics.equilibrium_matrix(structure.positions, structure.ends)
    left = np.abs(matrix @ q).max()
    size = (np.abs(matrix) @ np.abs(q)).max()
    if left > SAME * size:
        raise EquilibriumError(
            f"these force densities are no self-stress: a force of {left:.3g} N is left, "
            f"beside {size:.3g} N"
        )
    return q


def refuse_pushing(structure: Any, q: Array) -> None:
    """Refuse force densities that strings cannot have: slack, they would leave the rest alone."""
    pushed = np.where(structure.is_string, q, 0.0)
    worst = int(pushed.argmin())
    if pushed[worst] < -SAME * np.abs(q).max():
        raise EquilibriumError(
            f"force density {q[worst]:.6g} N/m of {structure.name_of(worst)} must be at least 0: "
            "strings do not push"
        )


def of_prestrain(structure: Any, prestrain: Any) -> Array:
    """Force densities of which some strings have given prestrains."""
    if not isinstance(prestrain, Mapping) or not prestrain:
        raise TensegrityError(
            f"prestrain {check.shown(prestrain)} must be a dict {{string: value}}"
        )
    stress = structure.self_stress()
    if not len(stress.states):
        return stress.feasible  # says why not
    numbers = [structure.member_number(m) for m in prestrain]
    for number in numbers:
        if not structure.is_string[number]:
            raise TensegrityError(
                f"prestrain of bar {number}: strings are numbered from {structure.bars} to "
                f"{len(structure.ends) - 1}"
            )
    if len(numbers) != len(stress.states):
        raise TensegrityError(
            f"prestrain of {len(numbers)} strings, must be of {len(stress.states)}: that many "
            "states of self-stress has this shape"
        )
    values = np.array(
        [check.number(f"prestrain of string {m}", x, above=-1) for m, x in prestrain.items()]
    )
    wanted = structure.stiffnesses[numbers] * values / (1 + values)
    part = stress.states[:, numbers].T
    if np.linalg.cond(part) > 1e10:
        raise TensegrityError(
            f"the prestrains of strings {', '.join(map(str, numbers))} do not determine the "
            "self-stress: choose others"
        )
    return np.asarray(np.linalg.solve(part, wanted) @ stress.states)
