"""Energies as users write them: their symbols checked, their numbers made parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from typing import TYPE_CHECKING, Any

from tensegrity import check
from tensegrity.engine.law import Law, check_law
from tensegrity.errors import TensegrityError

if TYPE_CHECKING:
    from sympy import Number


def written(
    energy: Any, elongation: Any, parameters: Mapping[Any, float] | None
) -> tuple[Law, list[float], tuple[Number, ...]]:
    """The law of an energy.

    Parameters
    ----------
    energy, elongation, parameters
        As of `Potential`.

    Returns
    -------
    law : Law
        Its last parameters stand for numbers of the energy.
    values : list of float
        Of all parameters.
    numbers : tuple of sympy.Number
        As they are written.

    Raises
    ------
    TensegrityError
        Arguments that are not as described, or parameters that do not match the energy's symbols.
    """
    import sympy as sp

    if not isinstance(elongation, sp.Symbol):
        raise TensegrityError(f"elongation {check.shown(elongation)} is not a SymPy symbol")
    (shape,), symbols, values, numbers = valued([energy], {elongation}, parameters)
    law = Law(shape, elongation, symbols)
    check_law(law)
    return law, values, numbers


def valued(
    energies: Sequence[Any], coordinates: Set[Any], parameters: Mapping[Any, float] | None
) -> tuple[list[Any], tuple[Any, ...], list[float], tuple[Number, ...]]:
    """Energies with symbols for their numbers, and the values of all symbols but the coordinates.

    Parameters
    ----------
    energies : sequence of sympy.Expr or float
    coordinates : set of sympy.Symbol
    parameters : dict of str or sympy.Symbol to float, or None
        Values of the other symbols.

    Returns
    -------
    shapes : list of sympy.Expr
    symbols : tuple of sympy.Symbol
        Of the energies, then those that stand for numbers.
    values : list of float
    numbers : tuple of sympy.Number

    Raises
    ------
    TensegrityError
        Arguments that are not as described, or parameters that do not match the symbols.
    """
    import sympy as sp

    from tensegrity.engine.shape import lifted

    energies = [
        sp.sympify(check.number("energy", x, unit="J")) if isinstance(x, (int, float)) else x
        for x in energies
    ]
    for energy in energies:
        if not isinstance(energy, sp.Expr):
            raise TensegrityError(f"energy {check.shown(energy)} is not a SymPy expression")
    parameters = {} if parameters is None else parameters
    if not isinstance(parameters, Mapping):
        raise TensegrityError(f"parameters {check.shown(parameters)} must be a dict of numbers")
    given = {str(key): value for key, value in parameters.items()}
    symbols = sorted(set().union(*(x.free_symbols for x in energies)) - coordinates, key=str)
    names = [str(s) for s in symbols]
    unknown = sorted(set(given) - set(names))
    if unknown or len(set(names)) < len(names):
        raise TensegrityError(
            f"parameters {', '.join(unknown or names)}: each must name one symbol of the energy"
        )
    missing = [name for name in names if name not in given]
    if missing:
        raise TensegrityError(f"no value for the parameter {', '.join(missing)} of the energy")
    values = [check.number(f"parameter {s}", given[str(s)]) for s in symbols]
    shapes, constants, numbers = lifted(energies)
    values += [check.number("number in the energy", float(x)) for x in numbers]
    return shapes, (*symbols, *constants), values, numbers
