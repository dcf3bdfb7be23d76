"""How potentials were made: from laws other than an energy, and from which arguments."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tensegrity.springs.potential import Potential

if TYPE_CHECKING:
    from typing import Any

    from numpy.typing import ArrayLike

    from tensegrity.engine.law import Law
    from tensegrity.errors import LockingError


def potential_of_law(
    law: Law,
    values: ArrayLike,
    length: float | None,
    domain: tuple[float, float],
    ends: tuple[str, str],
    origin: str = "",
    made_of: Any = None,
) -> Potential:
    """A potential from a law that is more than an energy, such as that of a prism.

    Parameters
    ----------
    law, values, length, domain, ends, origin, made_of
        The law, the values of its parameters, the length at r = 0 [m], the range of elongation
        [m], what limits it at either end, the printed form, and the prism with its preload.

    Returns
    -------
    Potential
    """
    potential = Potential.__new__(Potential)
    potential._set(law, values, length, domain, ends)
    potential._origin, potential._made_of = origin, made_of
    return potential


def provenance(potential: Potential) -> tuple[str, Any]:
    """The printed form of a potential, and the prism and the preload that it was made of."""
    return potential._origin, potential._made_of


def range_error(potential: Potential, r: float) -> LockingError:
    """The error for an elongation [m] at or beyond an end of either domain of a potential."""
    return potential._range_error(r)
