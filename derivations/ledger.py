"""The ledger: every formula printed in the two sources, compared with the derived one.

The correct form is derived anew at each check.  The printed form must agree with it under the
`reading` of the entry and, if a convention or correction is claimed, disagree without it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from random import Random
from typing import Any

import mpmath
import sympy as sp

from derivations import ledger_paper, ledger_talk, ledger_waves
from derivations.argument import Entry, Verdict

POINTS, DIGITS = 50, 30
EXPANDED_BELOW, SIMPLIFIED_BELOW = 400, 120  # operations above which only points are compared
NEGLIGIBLE = mpmath.mpf(10) ** -40  # absolute tolerance where forms of order one vanish


@dataclass(frozen=True)
class Check:
    """Result for one entry: whether its verdict is confirmed, and by which comparison."""

    entry: Entry
    confirmed: bool
    how: str

    def __str__(self) -> str:
        state = self.entry.verdict.value if self.confirmed else "DISAGREES"
        return f"{self.entry.name:32} {state:26} {self.how}"


@cache
def derived(entry: Entry) -> Any:
    """The derived form of an entry, computed once per process."""
    return entry.derive()


def check(entry: Entry, printed: Any = None) -> Check:
    """Compare an entry, or another `printed` form in its place, with the derivation."""
    printed = entry.printed if printed is None else printed
    if printed is None:
        return Check(entry, entry.verdict is Verdict.NO_DATA, "a claim without formula")
    agree = _relation_agrees if isinstance(derived(entry), list) else _form_agrees
    how = agree(entry.reading(printed), derived(entry), dict(entry.domain))
    if not how:
        return Check(entry, False, "the printed form is not the derived one")
    needs_reading = entry.verdict in (Verdict.CONVENTION, Verdict.MISPRINT)
    if needs_reading and agree(printed, derived(entry), dict(entry.domain)):
        return Check(entry, False, "no convention or correction is needed")
    return Check(entry, entry.verdict is not Verdict.NO_DATA, how)


def _relation_agrees(relation, cases, domain):
    """How a relation was confirmed on its cases, or "" if one case contradicts it."""
    for values, truth in cases:
        if bool(relation.subs(values)) is not truth:
            return ""
    return f"cases: {len(cases)}, all with the correct truth value"


def _form_agrees(form, other, domain):
    """How two forms were shown to be equal, or "" if they differ."""
    pairs = [(sp.sympify(a), sp.sympify(b)) for a, b in
             zip(_components(form), _components(other), strict=True)]  # fmt: skip
    if not all(_agrees_at_points(a, b, domain) for a, b in pairs):
        return ""
    differences = [sp.sympify(a - b).doit() for a, b in pairs]
    if all(d.count_ops() < EXPANDED_BELOW for d in differences):
        differences = [sp.expand(d) for d in differences]
    if all(
        d == 0 or (d.count_ops() < SIMPLIFIED_BELOW and not sp.simplify(d)) for d in differences
    ):
        return "symbolic"
    return f"{POINTS} points, {DIGITS} digits"


def _components(form):
    return list(form) if isinstance(form, (sp.Tuple, tuple, sp.MatrixBase)) else [form]


@cache
def _function(symbols, form):
    """A form as a function of numbers of many digits, without the text that says so."""
    return sp.lambdify(symbols, form, "mpmath", docstring_limit=0)


def _agrees_at_points(form, other, domain):
    symbols = sorted(form.free_symbols | other.free_symbols, key=str)
    if form.atoms(sp.core.function.AppliedUndef) or form.has(sp.zoo, sp.oo, sp.nan):
        return False
    first, second = (_function(tuple(symbols), x) for x in (form, other))
    random = Random(7)
    with mpmath.workdps(DIGITS + 15):
        for _ in range(POINTS):
            point = []
            for symbol in symbols:
                low, high = domain.get(symbol, (0.5, 2.0))
                point.append(mpmath.mpf(random.uniform(low, high)))
            try:
                a, b = first(*point), second(*point)
            except ZeroDivisionError:
                return False
            if not (mpmath.isfinite(a) and mpmath.isfinite(b)):
                return False
            tolerance = mpmath.mpf(10) ** -DIGITS * (abs(a) + abs(b)) + NEGLIGIBLE
            if not abs(a - b) <= tolerance:
                return False
    return True


SIGNS = (
    ("F", "force densities (talk, III)", "compression", "load; total of the three nodes"),
    ("F", "rigid-elastic model (talk, III)", "tension", "tension; F = dU/dh"),
    ("f", "g3 of the elastic problem (talk, III)", "compression", "load/3"),
    ("x_1, x_2", "equilibrium and elastic problem (talk, III)", "tension", "force density"),
    ("x_3", "equilibrium problem (talk, III)", "compression", "force density of the bars"),
    ("x_3", "elastic problem (talk, III)", "tension", "-(force density of the bars)"),
    ("delta", "particle strains (talk, II)", "gap (dilatation)", "-overlap"),
    ("delta", "eq. (1) (paper)", "overlap", "overlap"),
    ("F_ij", "interaction forces (talk, II)", "compression", "contact_force"),
    ("epsilon", "strain waves (talk, III)", "compression", "-strain"),
    ("I_1", "eq. (7) (paper)", "backwards along the stem", "-momentum"),
)
"""Printed quantity, place, positive sense, and its name here."""


def entries() -> tuple[Entry, ...]:
    """All entries, in the order of the sources."""
    sources = (*ledger_talk.ENTRIES, *ledger_waves.ENTRIES, *ledger_paper.ENTRIES)
    return (*sources, *ledger_waves.OWN_ENTRIES)
