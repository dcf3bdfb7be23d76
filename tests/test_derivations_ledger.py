"""The ledger decides every printed formula, and notices a wrong one."""

from dataclasses import replace

import pytest
import sympy as sp

from derivations import ledger
from derivations.__main__ import main

pytestmark = pytest.mark.unchanged()

ENTRIES = {entry.name: entry for entry in ledger.entries()}
PRINTED = {name: entry for name, entry in ENTRIES.items() if entry.printed is not None}


def _components(form):
    return list(form) if isinstance(form, sp.Tuple) else [form]


def _with(form, index, component):
    if not isinstance(form, sp.Tuple):
        return component
    return sp.Tuple(*(component if k == index else x for k, x in enumerate(form)))


def _places(expression, kind):
    return [x for x in sp.preorder_traversal(expression) if isinstance(x, kind)]


def _mutants(expression):
    """Wrong signs (of the whole and of each term), a wrong factor, wrong exponents."""
    if isinstance(expression, sp.core.relational.Relational):
        return [sp.Not(expression)]
    mutants = [-expression, 2 * expression, expression**2]
    for total in _places(expression, sp.Add):
        mutants += [expression.xreplace({total: total - 2 * term}) for term in total.args]
    for product in _places(expression, sp.Mul):
        mutants.append(expression.xreplace({product: 3 * product}))
    for power in _places(expression, sp.Pow):
        changed = sp.Pow(power.base, power.exp + 1)
        mutants.append(expression.xreplace({power: changed}))
    return [m for m in dict.fromkeys(mutants) if m != expression and not m.has(sp.nan)]


@pytest.mark.parametrize("name", PRINTED)
def test_wrong_sign_factor_or_exponent_is_noticed(name):
    entry = PRINTED[name]
    tried = 0
    for index, component in enumerate(_components(entry.printed)):
        for mutant in _mutants(component):
            tried += 1
            wrong = _with(entry.printed, index, mutant)
            assert not ledger.check(entry, wrong).confirmed, mutant
    assert tried


def test_check_reports_a_wrong_entry_and_exits_non_zero(monkeypatch, capsys):
    good = ENTRIES["talk.bar_length"]
    wrong = replace(good, printed=good.printed.subs(sp.Rational(2, 3), sp.Rational(1, 3)))
    assert wrong.printed != good.printed
    monkeypatch.setattr(ledger, "entries", lambda: (good, wrong))
    assert main(["--check"]) == 1
    out = capsys.readouterr().out
    assert "DISAGREES" in out
    assert "2 entries, 1 decided, 1 disagree" in out


def test_needless_convention_is_noticed():
    entry = replace(ENTRIES["talk.bar_length"], verdict=ledger.Verdict.MISPRINT)
    assert not ledger.check(entry).confirmed


def test_check_that_writes_is_refused():
    with pytest.raises(SystemExit):
        main(["--check", "prism"])
