"""Units as bonds between sites: some of their coordinates belong to both ends, as differences, and
the others are in equilibrium bond by bond."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.springs.pair_law import PairLaw, pair_with_inner
from tensegrity.unit import rest as at_rest


class HasPair:
    """What makes a unit the law of a bond."""

    def pair(self, sites: Sequence[Any]) -> PairLaw:
        """Pair law of sites whose coordinates differ by some of the unit's, for chains or networks.

        Parameters
        ----------
        sites : sequence of sympy.Symbol or str
            One to three coordinates, inner or controlled; the others are in equilibrium.

        Returns
        -------
        PairLaw
            Of its members as springs, all coordinates free; parameters act at constant natural
            lengths.  Where Newton's method from the rest finds no equilibrium, it has no value.

        Raises
        ------
        TensegrityError
            A symbol has no value, a name is no coordinate, or a member is rigid or a string.
        """
        return _pair(self, sites)


def _pair(unit: Any, sites: Any) -> PairLaw:
    import sympy as sp

    if unit.open_symbols:
        raise TensegrityError(f"no value for {unit.open_symbols[0]}: a pair law needs numbers")
    names = {str(q): q for q in unit.coordinates}
    chosen = [str(x) for x in check.sequence("sites", sites, "coordinates")]
    for name in chosen:
        if name not in names or chosen.count(name) > 1:
            raise TensegrityError(f"sites {chosen}: each must be one of {', '.join(names)}, once")
    of, rest = at_rest.at_rest(unit), {q: sp.Float(float(x)) for q, x in unit.rest.items()}
    first, second = ([sp.Symbol(f"{x}_{end}", real=True) for x in chosen] for end in "ij")
    inner = [q for q in unit.coordinates if str(q) not in chosen]
    unknowns = [sp.Symbol(f"change of {q}", real=True) for q in inner]
    moves = {names[x]: b - a for x, a, b in zip(chosen, first, second, strict=True)}
    moves |= dict(zip(inner, unknowns, strict=True))
    moved = {q: rest[q] + x for q, x in moves.items()}
    whole = unit.energy.xreplace(moved) - unit.energy.xreplace(rest)
    for member, length, tension, k in zip(unit.members, of.lengths, of.tensions, of.stiffness,
                                          strict=True):  # fmt: skip
        if k == float("inf"):
            raise TensegrityError(f"member {member.length} is rigid: a pair law needs a finite k")
        if member.string:
            raise TensegrityError(
                f"string {member.length} may slacken: a pair law needs springs, string=False"
            )
        natural, start = sp.Float(float(length - tension / k)), float(tension) ** 2 / float(2 * k)
        stretch = member.length.xreplace(moved) - natural
        whole += member.count * (member.k * stretch**2 / 2 - sp.Float(start))
    parameters = {p: x for p, x in unit.parameters.items() if whole.has(p)}
    return pair_with_inner(whole, first, second, parameters, unknowns)
