"""Springs with other values of their arguments: of parameters, or of the prism that they model; and
with values that change with time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from tensegrity import check
from tensegrity.engine.law import DERIVATIVES
from tensegrity.errors import TensegrityError
from tensegrity.readonly import FixedDict
from tensegrity.springs.signals import expression_of

Spring = TypeVar("Spring", bound=Any)
VARIED = ("prestrain", "k_cross", "k_base", "k_bar", "preload")  # arguments of a prism that may


def varied(spring: Spring, values: Any) -> Spring:
    """See `Potential.varied`."""
    if not isinstance(values, Mapping):
        raise TensegrityError(f"values {check.shown(values)} must be a dict of numbers")
    known = VARIED if spring._made_of else spring._varied or tuple(spring.parameters)
    unknown = [name for name in values if name not in known]
    if unknown:
        raise TensegrityError(
            f"{unknown[0]!r} is not an argument of {check.shown(spring)} that may change: "
            f"{', '.join(known) or 'there are none'}"
        )
    if spring._made_of:
        prism, preload = spring._made_of
        given = dict(values)
        preload = given.pop("preload", preload)
        return replace(prism, **given).potential(preload)
    return spring._with(spring.parameters | dict(values))


class OverTime:
    """The law of a spring whose arguments are functions of time: that of another at each instant.

    Parameters
    ----------
    spring : Potential
    arguments : dict of str to sympy.Expr or float
        {name: expression of t}: arguments that `spring.varied` takes.

    Attributes
    ----------
    start : Potential
        The spring at t = 0, from whose shape elongations are measured.
    signals : dict of str to Expression
        The arguments as functions of time.

    Raises
    ------
    TensegrityError
        The spring has no such argument, its value at t = 0 is not admissible, or it is no
        expression of t.
    """

    compiled, parameters, name = DERIVATIVES, (), ""

    def __init__(self, spring: Any, arguments: Mapping[str, Any]) -> None:
        if not arguments:
            raise TensegrityError("a spring over time needs an argument that changes")
        self.signals = FixedDict({x: expression_of(x, one) for x, one in arguments.items()})
        self.start = spring.varied(self._arguments(0.0))

    def _arguments(self, t: float) -> dict[str, float]:
        return {name: float(one(np.array(t))) for name, one in self.signals.items()}

    def at(self, t: float) -> Any:
        """The spring at time t [s]."""
        return self.start.varied(self._arguments(t)) if t else self.start

    def forms(self) -> Any:
        """None; see `law.Law.forms`."""
        raise TensegrityError(f"{self} has an energy at an instant only: take it `.at(t)`")

    def __eq__(self, other: object) -> bool:
        return isinstance(other, OverTime) and self._key() == other._key()

    def __hash__(self) -> int:
        return hash(self._key())

    def _key(self) -> tuple[Any, ...]:
        return self.start, tuple(self.signals.items())

    def __repr__(self) -> str:
        arguments = ", ".join(f"{name}={one}" for name, one in self.signals.items())
        return f"{self.start!r}.over_time({arguments})"
