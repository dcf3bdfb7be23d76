"""A derivation as it is read: sentences, each with the formula that the program found."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from types import ModuleType
    from typing import Any

NAMES = (
    "prism",
    "equilibrium",
    "elastic",
    "rigid_response",
    "hardening",
    "polygon",
    "waves",
    "softening",
    "contact",
    "openings",
    "geometry",
    "member",
    "junction",
)
"""The derivations, in reading order; each module offers TITLE and argument()."""


@dataclass(frozen=True)
class Step:
    """One sentence of an argument and its formulas.

    Attributes
    ----------
    text : str
    formulas : tuple of sympy.Basic
    """

    text: str
    formulas: tuple = ()

    def __init__(self, text: str, *formulas: Any) -> None:
        object.__setattr__(self, "text", text)
        object.__setattr__(self, "formulas", formulas)


def derivation(name: str) -> ModuleType:
    """The module that holds one derivation.

    Raises
    ------
    ValueError
        If there is none of that name.
    """
    if name not in NAMES:
        raise ValueError(f"derivation {name!r} is not one of {', '.join(NAMES)}")
    return import_module(f"derivations.{name}")
