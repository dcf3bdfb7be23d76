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
    """Prints cases as a table behind a brace."""

    def _print_Piecewise(self, expression):
        def element(name, *children):
            made = self.dom.createElement(name)
            for child in children:
                made.appendChild(child)
            return made

        def text(name, words):
            return element(name, self.dom.createTextNode(words))

        rows = [
            element(
                "mtr",
                element("mtd", self._print(value)),
                element(
                    "mtd",
                    text("mtext", " otherwise") if condition is sp.true else self._print(condition),
                ),
            )
            for value, condition in expression.args
        ]
        return element("mrow", text("mo", "{"), element("mtable", *rows))


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
    """Prints names of words or several parts, as "slender", "domain of V", "V(r_*)", by parts."""

    def _print_Symbol(self, expr, style="plain"):
        name = expr.name.rstrip("'")
        primes = expr.name[len(name) :]
        if not re.search(r"[ (/]|^[a-z]{4,}$", name):
            return super()._print_Symbol(sp.Symbol(name), style) + primes
        return re.sub(r"( )|([A-Za-z]+)(?:_([*\w]+))?", _part, name) + primes


def _part(match):
    space, word, index = match.groups()
    if space:
        return r"\ "
    letters = translate(word)
    if letters == word and (len(word) > 2 or word == "of"):
        letters = rf"\text{{{word}}}"
    return letters + (f"_{{{index}}}" if index else "")


def latex(expression: sp.Basic | str) -> str:
    """One formula as LaTeX, without delimiters; a sentence as text."""
    if isinstance(expression, str):
        return rf"\text{{{latex_text(expression)}}}"
    return str(_Latex().doprint(expression))


def latex_text(text: str) -> str:
    """Plain text with the characters escaped that have a meaning in LaTeX."""
    return re.sub(r"([_&%#$])", r"\\\1", text).replace("^", r"\^{}")
