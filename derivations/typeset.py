"""Formulas as MathML and as LaTeX."""

from __future__ import annotations

import re
from html import escape

import sympy as sp
from sympy.printing.latex import LatexPrinter, translate
from sympy.printing.mathml import MathMLPresentationPrinter

TYPOGRAPHY = {
    "<mo>-</mo>": "<mo>&#x2212;</mo>",
    "<mo>&InvisibleTimes;</mo>": '<mspace width="0.17em"></mspace>',
    "<mo>&#xB7;</mo>": '<mspace width="0.17em"></mspace>',
}
"""Replacements in the MathML that SymPy writes."""


class _Printer(MathMLPresentationPrinter):
    """Prints cases as a table behind a brace, and names of several parts by these."""

    def _element(self, name, *children):
        made = self.dom.createElement(name)
        for child in children:
            made.appendChild(child)
        return made

    def _text(self, name, words):
        return self._element(name, self.dom.createTextNode(words))

    def _print_Symbol(self, sym, style="plain"):
        parts = _parts(sym.name)
        if len(parts) == 1 or "_" not in sym.name:
            return super()._print_Symbol(sym, style)
        return self._element("mrow", *(
            self._print_Symbol(sp.Symbol(x), style) if x[0].isalpha() else self._text("mo", x)
            for x in parts
        ))  # fmt: skip

    def _print_Piecewise(self, expression):
        rows = [
            self._element(
                "mtr",
                self._element("mtd", self._print(value)),
                self._element(
                    "mtd",
                    self._text("mtext", " otherwise")
                    if condition is sp.true
                    else self._print(condition),
                ),
            )
            for value, condition in expression.args
        ]
        return self._element("mrow", self._text("mo", "{"), self._element("mtable", *rows))


def mathml(expression: sp.Basic | str) -> str:
    """One formula as a displayed MathML element."""
    if isinstance(expression, str):
        return f"<p>{escape(expression)}</p>"
    body = _Printer().doprint(expression)
    for plain, better in TYPOGRAPHY.items():
        body = body.replace(plain, better)
    return (
        '<div class="formula"><math xmlns="http://www.w3.org/1998/Math/MathML" display="block">'
        f"{body}</math></div>"
    )


class _Latex(LatexPrinter):
    """Prints words as text, and names of several parts by these."""

    def _print_Symbol(self, expr, style="plain"):
        parts = _parts(expr.name)
        if len(parts) > 1:
            return "".join(
                self._print_Symbol(sp.Symbol(x)) if x[0].isalpha() else x.replace(" ", r"\ ")
                for x in parts
            )
        if re.fullmatch("[a-z]{3,}|of", expr.name) and translate(expr.name) == expr.name:
            return rf"\text{{{expr.name}}}"
        name = expr.name.rstrip("'")
        return super()._print_Symbol(sp.Symbol(name), style) + expr.name[len(name) :]


def _parts(name):
    """The symbols, words and signs of which names such as "V(r_*)" or "domain of V" consist."""
    several = re.search("[ (/]", name)
    return re.findall(r"[A-Za-z]+'*(?:_[*\w]+)?(?:\^\w+)?|.", name) if several else [name]


def latex(expression: sp.Basic | str) -> str:
    """One formula as LaTeX, without delimiters; a sentence as text."""
    if isinstance(expression, str):
        return rf"\text{{{latex_text(expression)}}}"
    return str(_Latex().doprint(expression))


def latex_text(text: str) -> str:
    """Plain text with the characters escaped that have a meaning in LaTeX."""
    return re.sub(r"([_&%#$])", r"\\\1", text).replace("^", r"\^{}")
