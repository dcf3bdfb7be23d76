"""The report: a self-contained page of HTML with MathML, without scripts.

Each derivation is printed as its argument, followed by the ledger entries that it decides.
"""

from __future__ import annotations

# ruff: noqa: RUF001 (Greek letters are meant)
import re
from collections.abc import Callable, Iterable, Sequence
from html import escape
from typing import Any, NamedTuple

import sympy as sp
from sympy.logic.boolalg import Boolean

from derivations import ledger
from derivations.argument import NAMES, SOURCES, Step, derivation
from derivations.typeset import latex, latex_text, mathml

STYLE = """
body { font: 1.05rem/1.5 Georgia, 'DejaVu Serif', serif; max-width: 60rem; margin: 2rem auto;
  padding: 0 1rem; color: #1a1a1a; background: #fff; }
h1, h2, h3 { line-height: 1.25; } h2 { margin-top: 2.5rem; border-bottom: 1px solid #bbb; }
a { color: #1d4f91; }
math { font-family: 'STIX Two Math', 'Latin Modern Math', 'Cambria Math', math; }
.formula { overflow-x: auto; overflow-y: hidden; margin: .5rem 0 .5rem 1.5rem; padding: .2rem 0; }
.entry { border-left: .3rem solid #2e7d32; padding: .1rem 0 .1rem .8rem; margin: 1rem 0;
  break-inside: avoid; }
.entry.misprint, .entry.failed { border-color: #b3261e; }
.entry.convention { border-color: #a86400; }
.entry.no_data { border-color: #777; }
.entry p { margin: .2rem 0; } .verdict { font-weight: bold; } .place { color: #555; }
table { border-collapse: collapse; } th, td { border: 1px solid #bbb; padding: .25rem .6rem;
  text-align: left; vertical-align: top; }
@media print { body { max-width: none; margin: 0; font-size: 10pt; } a { color: inherit; }
  .formula { overflow: visible; } }
"""

LONGEST = 200  # operations of the longest derived form that is shown
_NAMES = "alpha beta gamma delta epsilon eta theta kappa nu pi rho tau phi psi omega"
GREEK = dict(zip(_NAMES.split(), "αβγδεηθκνπρτφψω", strict=True))
WORDS = {
    r"\beta0\b": "η₀", r"\bsqrt ?3": "√3",
    **{rf"(?<![A-Za-z]){name}(?![A-Za-z])": letter for name, letter in GREEK.items()},
    r">=": "≥", r"<=": "≤", r" - ": " − ",
    r"\b([A-Za-zα-ω])_([0-9A-Za-zα-ω*])(?!\w)": r"\1<sub>\2</sub>",
    r"\b([A-GI-Zhxcskgpa])([0-3])\b": r"\1<sub>\2</sub>",
    r"\^(-?\w+|\([^)]*\)|-)": r"<sup>\1</sup>",
}  # fmt: skip
"""Typesetting of symbols in plain text: patterns and replacements."""


def prose(text: str) -> str:
    """Plain text as HTML, with Greek letters, exponents and indices."""
    for plain, better in WORDS.items():
        text = re.sub(plain, better, text)
    for source, name in SOURCES.items():
        text = text.replace(source, name)
    html = re.sub(r"&lt;(/?su[bp])&gt;", r"<\1>", escape(text, quote=False))
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", html)


def _argument(name):
    module = derivation(name)
    parts = [f"<p>{prose(' '.join(p.split()))}</p>" for p in module.__doc__.split("\n\n")]
    return "\n".join([*parts, typeset(module.argument())])


def typeset(steps: Iterable[Step]) -> str:
    """Steps of an argument as HTML."""
    parts = []
    for step in steps:
        parts.append(f"<p>{prose(step.text)}</p>")
        parts += [mathml(formula) for formula in step.formulas]
    return "\n".join(parts)


def tex(steps: Iterable[Step]) -> str:
    """Steps of an argument as text of LaTeX, each formula displayed."""
    parts = []
    for step in steps:
        parts.append(latex_text(step.text))
        parts += [rf"\[ {latex(formula)} \]" for formula in step.formulas]
    return "\n".join([*parts, ""])


def tex_of(name: str) -> str:
    """A derivation, or the formula of an entry of the ledger, as text of LaTeX.

    Raises
    ------
    ValueError
        If neither has this name.
    """
    if name in NAMES:
        return tex(derivation(name).argument())
    left, form = _formula(name)
    relation = isinstance(form, Boolean)
    return f"{'' if relation else latex(left) + ' = '}{latex(form)}\n"


def _formula(name):
    """Left and right side of a ledger entry: as derived, or, where that is long or a relation that
    was decided on cases, the printed one as it agrees with the derivation."""
    entry = next((one for one in ledger.entries() if one.name == name), None)
    if entry is None:
        raise ValueError(f"{name!r} is neither a derivation nor a formula of the ledger")
    if not entry.derive:
        raise ValueError(f"{name!r} is a claim of the ledger without formula: {entry.left}")
    form = ledger.derived(entry)
    return entry.left, form if _short(form) else entry.reading(entry.printed)


def _equation(left, right):
    if isinstance(left, str) and isinstance(right, sp.Basic):
        return mathml(right)
    if right is None:
        return mathml(left)
    return mathml(sp.Eq(left, right, evaluate=False))


def _short(form):
    return isinstance(form, sp.Basic) and form.count_ops() <= LONGEST


def formula(name: str) -> str:
    """The formula of a ledger entry as MathML: as derived, or, where that is long or a relation
    that was decided on cases, the printed one as it agrees with the derivation.

    Raises
    ------
    ValueError
        If no entry has this name, or the entry is a claim without formula.
    """
    return _equation(*_formula(name))


def _entry(check):
    entry = check.entry
    kind = entry.verdict.name.lower() if check.confirmed else "failed"
    verdict = entry.verdict.value if check.confirmed else "does not agree"
    parts = [
        f'<div class="entry {kind}" id="{entry.name}"><p><code>{entry.name}</code> '
        f'<span class="place">{escape(entry.place)}</span></p>',
        "<p>As printed:</p>" if entry.printed is not None else "<p>As claimed:</p>",
        _equation(entry.left, entry.printed),
    ]
    derived = ledger.derived(entry) if entry.derive else None
    if _short(derived):
        parts += ["<p>As derived:</p>", _equation(entry.left, derived)]
    elif isinstance(derived, sp.Basic):
        parts.append("<p>As derived: see the argument above.</p>")
    verdict += f":</span> {prose(entry.note)}." if entry.note else ".</span>"
    parts.append(
        f'<p><span class="verdict">{verdict[0].upper() + verdict[1:]} '
        f'<span class="place">({escape(check.how)})</span></p></div>'
    )
    return "\n".join(parts)


def _signs():
    head = "<tr><th>printed</th><th>where</th><th>counts as positive</th><th>here</th></tr>"
    rows = "".join(
        "<tr>" + "".join(f"<td>{prose(cell)}</td>" for cell in row) + "</tr>"
        for row in ledger.SIGNS
    )
    return f"<table>{head}{rows}</table>"


def _summary(checks):
    exceptions = [c for c in checks if c.entry.verdict.name in ("CONVENTION", "MISPRINT")]
    rows = "".join(
        f'<tr><td><a href="#{c.entry.name}">{c.entry.name}</a></td>'
        f"<td>{escape(c.entry.verdict.value)}</td><td>{prose(c.entry.note)}</td></tr>"
        for c in exceptions
    )
    counts = ", ".join(
        f"{sum(c.entry.verdict is v for c in checks)} {v.value}" for v in ledger.Verdict
    )
    return (
        f"<p>{len(checks)} entries: {counts}.</p>"
        f"<table><tr><th>entry</th><th>verdict</th><th>why</th></tr>{rows}</table>"
    )


class Section(NamedTuple):
    """A section of the report: anchor, heading, and HTML body."""

    key: str
    title: str
    body: str


def sections(
    names: Sequence[str] = NAMES, progress: Callable[[Iterable[Any]], Iterable[Any]] = iter
) -> list[Section]:
    """The derivations with the ledger entries that they decide, the signs, and a summary.

    Parameters
    ----------
    names : sequence of str
        From `argument.NAMES`.
    progress : callable (iterable) -> iterable, optional
        Wraps the loop over derivations and ledger entries.
    """
    work: list[tuple[str, Any]] = [(name, None) for name in names]
    work += [(name, e) for name in names for e in ledger.entries() if e.derivation == name]
    arguments, checks = {}, []
    for name, entry in progress(work):
        if entry is None:
            arguments[name] = _argument(name)
        else:
            checks.append(ledger.check(entry))
    parts = []
    for name in names:
        ledger_part = "\n".join(_entry(c) for c in checks if c.entry.derivation == name)
        body = f"{arguments[name]}\n<h3>Printed formulas</h3>\n{ledger_part}"
        parts.append(Section(name, derivation(name).TITLE, body))
    parts.append(Section("signs", "Sign conventions", _signs()))
    parts.append(Section("summary", "Summary of the ledger", _summary(checks)))
    return parts


def page(
    names: Sequence[str] = NAMES, progress: Callable[[Iterable[Any]], Iterable[Any]] = iter
) -> str:
    """The page of some derivations, as text; arguments as for `sections`."""
    return whole(
        sections(names, progress),
        "Tensegrity prisms and granular chains as nonlinear-wave media: every formula of the two "
        "sources, derived from energies and geometry by program, and compared with its printed "
        "form.",
    )


def whole(parts: Sequence[Section], introduction: str) -> str:
    """A page of HTML of some sections."""
    contents = "".join(f'<li><a href="#{s.key}">{escape(s.title)}</a></li>' for s in parts)
    return "\n".join(
        [
            '<!DOCTYPE html><html lang="en"><head><meta charset="utf-8">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            '<link rel="icon" href="data:,">',
            f"<title>Derivations</title><style>{STYLE}</style></head><body>",
            f"<h1>Derivations</h1><p>{introduction}</p>",
            f"<nav><h2>Contents</h2><ol>{contents}</ol></nav>",
            *(f'<section id="{s.key}"><h2>{escape(s.title)}</h2>{s.body}</section>' for s in parts),
            "</body></html>\n",
        ]
    )
