"""Names of units in prints, plots, files and messages.

All texts of this package are written with SI units, behind a number or in brackets; `in_units`
replaces these by the names that the user gave in this thread or task.  Numbers are never converted,
nor is what stands between quotation marks: words of the user's own.
"""

from __future__ import annotations

import re
from contextvars import ContextVar

SI = {"m": "m", "kg": "kg", "s": "s", "N": "N", "J": "J"}
given: ContextVar[tuple[dict[str, str], ...]] = ContextVar("given", default=(SI,))
"""All names in force; the last ones hold."""
_WORD = r"(?:sites?|rad|1|m|kg|s|N|J)(?:\^?-?\d)?"
_UNIT = rf"{_WORD}(?:[ /]{_WORD})*"
_QUOTED = r"""(?<!\w)(?:'[^'\n]*'|"[^"\n]*")(?!\w)"""
_SAID = re.compile(rf"{_QUOTED}|(?<=\d) ({_UNIT})(?![\w^/])| ?\[({_UNIT})\]")
_FACTOR = re.compile(r"([ /]?)([A-Za-z]+|1)(\^?-?\d)?")


def unit_text(unit: str) -> str:
    """A unit of SI, such as N/m, by the names that were given; "" where nothing is left of it."""
    text, names = "", given.get()[-1]
    for mark, word, power in _FACTOR.findall(unit):
        if not (name := names.get(word, word.strip("1"))):
            continue
        if (power or mark == "/") and (" " in name or "/" in name):
            name = f"({name})"
        text += (mark if text or mark != "/" else "1/") + name + power
    return text


def in_units(text: str) -> str:
    """A text with units of SI behind numbers and in brackets, by the names that were given."""
    if given.get()[-1] == SI:
        return text

    def said(found: re.Match[str]) -> str:
        if not (si := found[1] or found[2]):
            return found[0]
        unit = unit_text(si)
        if not unit:
            return ""
        return f" {unit}" if found[1] else found[0].replace(found[2], unit)

    return _SAID.sub(said, text)


def is_si() -> bool:
    """Whether length and time have the names of SI, so that mm and ms may stand for them."""
    return all(given.get()[-1][name] == name for name in ("m", "s"))
