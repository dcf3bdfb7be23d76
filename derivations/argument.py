"""The form of a derivation: sentences, each with the formulas that the program derived.

An entry of the ledger compares a printed formula with the derivation.  It holds the printed form in
SymPy, the reading under which it is correct (a sign convention, or the correction of a misprint),
and the function that derives it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from importlib import import_module
from types import ModuleType
from typing import Any

import sympy as sp

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
    "losses",
    "openings",
    "geometry",
    "member",
    "junction",
    "one_well",
    "bistable",
)
"""The derivations in reading order; each module defines TITLE and argument()."""

SOURCES = {"seeds/000": "the talk", "seeds/001": "the paper"}
"""Names of the two sources in texts for readers."""


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
        If no derivation has that name.
    """
    if name not in NAMES:
        raise ValueError(f"derivation {name!r} is not one of {', '.join(NAMES)}")
    return import_module(f"derivations.{name}")


class Verdict(Enum):
    """The result of comparing a printed formula with its derivation."""

    HOLDS = "holds"
    CONVENTION = "holds under a convention"
    MISPRINT = "misprint"
    NO_DATA = "no data in the source"


def as_printed(form: sp.Expr) -> sp.Expr:
    """The identity, for forms that are correct as printed."""
    return form


@dataclass(frozen=True)
class Entry:
    """A printed formula or claim.

    Attributes
    ----------
    name : str
        "talk.", "paper." or "ours.", and a word.
    place : str
        Where it is printed.
    derivation : str
        The module that derives it.
    left : sympy.Basic or str
        Its left-hand side, for display.
    printed : sympy.Basic or None
        The printed right-hand side, an expression or a tuple of expressions, or a printed
        relation; None for a claim without a formula.
    derive : callable () -> sympy.Basic
        Returns the derived right-hand side; for a relation, a list of (values, truth) at which
        the relation, as read, must have that truth value.
    verdict : Verdict
    note : str
        The convention, or the error and its place.
    reading : callable (printed) -> form
        Applies the convention or the correction.
    domain : tuple of (Symbol, (low, high))
        Intervals of the random points of comparison; other symbols lie in (1/2, 2).
    """

    name: str
    place: str
    derivation: str
    left: object
    printed: object = None
    derive: Callable | None = None
    verdict: Verdict = Verdict.HOLDS
    note: str = ""
    reading: Callable = as_printed
    domain: tuple = ()
