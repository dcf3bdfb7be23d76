"""A derivation as it is read: sentences, each with the formula that the program found.

An entry of the ledger holds a printed formula against it: what is printed, as SymPy, how it is to
be read (a sign convention, a slip put right), and what derives it.
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


class Verdict(Enum):
    """What became of a printed formula."""

    HOLDS = "holds"
    CONVENTION = "holds under a convention"
    SLIP = "slip"
    NO_DATA = "no data in the seed"


def as_printed(form: sp.Expr) -> sp.Expr:
    """The reading of a form that needs none."""
    return form


@dataclass(frozen=True)
class Entry:
    """A printed formula or claim.

    Attributes
    ----------
    name : str
        "talk." or "paper." and a word.
    place : str
        Where it is printed.
    derivation : str
        Module that derives it.
    left : sympy.Basic or str
        Its left side, for display.
    printed : sympy.Basic or None
        The printed right side (expression or tuple of them), or a printed relation; None for
        a claim without formula.
    derive : callable () -> sympy.Basic
        The derived right side; for a relation a list of (values, expected truth): cases in
        which the relation as read must be true or false.
    verdict : Verdict
    note : str
        The convention, or what is wrong and where.
    reading : callable (printed) -> form
    domain : dict of Symbol to (low, high)
        Where random points are taken; others lie in (1/2, 2).
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
