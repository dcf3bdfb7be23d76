"""Members of a unit, and the expressions by which units are described."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from numbers import Integral
from typing import Any

from tensegrity import check
from tensegrity.errors import TensegrityError

MOST = 100_000  # operations of an expression that is taken


def expression(name: str, value: Any) -> Any:
    """A number or a SymPy expression as an expression, not nan."""
    import sympy as sp

    if not isinstance(value, sp.Expr):
        number = check.number(name, value, finite=False)
        value = sp.Integer(int(value)) if isinstance(value, Integral) else sp.sympify(number)
    unreal = value.has(sp.nan, sp.zoo, sp.I, -sp.oo) or value.is_real is False
    if unreal and value is not sp.oo:
        raise TensegrityError(f"{name} {check.shown(value)} must be real")
    if value.is_commutative is False or value.count_ops() > MOST:
        raise TensegrityError(f"{name} {check.shown(value)} must have at most {MOST} operations")
    return value


def _number(name: str, value: Any, **bounds: Any) -> Any:
    """An expression; where it is a number, within bounds."""
    value = expression(name, value)
    if value.is_number:
        check.number(name, float(value), **bounds)
    return value


@dataclass(frozen=True)
class Member:
    """Equal members of a unit: springs, bars, strings.

    Parameters
    ----------
    length : sympy.Expr
        Length of one of them [m], of the coordinates of the unit.
    k : float or sympy.Expr
        Spring constant of one of them [N/m], > 0; inf is rigid.
    count : int or sympy.Expr, optional
        Their number, >= 1.
    natural : float or sympy.Expr, optional
        Natural length [m]; by default that which the unit's prestrain and equilibrium demand.
    string : bool, optional
        Whether they carry tension only.

    Raises
    ------
    TensegrityError
        A value outside its bounds, or no real expression.

    Examples
    --------
    >>> import sympy as sp
    >>> from tensegrity import Member
    >>> w, h = sp.symbols("w h", positive=True)
    >>> Member(sp.sqrt(w**2 + h**2), k=50.0, count=2).length
    sqrt(h**2 + w**2)
    """

    length: Any
    k: Any
    count: Any = 1
    natural: Any = None
    string: bool = False

    def __post_init__(self) -> None:
        given: dict[str, Any] = self.__dict__
        given["length"] = expression("length", self.length)
        given["k"] = _number("k", self.k, above=0, finite=False, unit="N/m")
        given["count"] = _number("count", self.count, least=1)
        if self.natural is not None:
            given["natural"] = _number("natural", self.natural, unit="m")
        given["string"] = check.truth("string", self.string)
        if not self.length.free_symbols:
            raise TensegrityError(f"length {self.length} contains no coordinate")


def mapping(name: str, value: Any) -> Mapping[Any, Any]:
    """A dict, or none."""
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        raise TensegrityError(f"{name} {check.shown(value)} must be a dict")
    return value


def expressions(name: str, given: Any) -> dict[str, Any]:
    """Expressions by their names."""
    found = {}
    for key, value in mapping(name, given).items():
        check.kind(f"name in {name}", key, str)
        found[key] = expression(f"{name} {key}", value)
    return found


def by_symbol(
    name: str, given: Any, symbols: Mapping[str, Any], coordinates: Sequence[Any]
) -> dict[Any, Any]:
    """Values of coordinates, or of what else has a name in a unit, by the symbol.

    Parameters
    ----------
    name : {"rest", "parameters"}
    given : dict
    symbols : dict of str to sympy.Symbol
        All of the unit.
    coordinates : sequence of sympy.Symbol

    Returns
    -------
    dict of sympy.Symbol to sympy.Expr

    Raises
    ------
    TensegrityError
        A key or a value that is not of its kind, or a coordinate that is not there.
    """
    import sympy as sp

    found, at_rest = {}, name == "rest"
    for key, value in mapping(name, given).items():
        symbol = symbols.get(str(key))
        if (
            symbol is None
            or (symbol in coordinates) != at_rest
            or not isinstance(key, (str, sp.Symbol))
        ):
            kind = "coordinate" if at_rest else "parameter"
            raise TensegrityError(f"{name}: {check.shown(key)} is no {kind} of the unit")
        found[symbol] = expression(f"{name} {key}", value)
        if found[symbol].is_infinite or (not at_rest and not found[symbol].is_number):
            raise TensegrityError(f"{name} {key} {check.shown(value)} must be a finite number")
        if found[symbol].free_symbols & {*coordinates}:
            raise TensegrityError(f"{name} {key} {check.shown(value)} contains a coordinate")
    missing = [str(q) for q in coordinates if at_rest and q not in found]
    if missing:
        raise TensegrityError(f"rest lacks the coordinate {', '.join(missing)}")
    return found
