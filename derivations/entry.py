"""An entry of the ledger: a formula as printed, how it is to be read, and what derives it.

The printed form is kept as SymPy; `reading` says how it is to be read (a sign convention, a slip
put right).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import sympy as sp


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
