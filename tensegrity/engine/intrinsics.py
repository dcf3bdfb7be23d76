"""The definitions of <immintrin.h> that the C of this package uses, cut out of what the
preprocessor makes of it: the whole header takes longer to compile than most loops."""

from __future__ import annotations

import re
from importlib.resources import files
from typing import TYPE_CHECKING

from tensegrity.engine.disk_cache import cached

if TYPE_CHECKING:
    from collections.abc import Callable

INCLUDE = "#include <immintrin.h>"
USED = re.compile(r"\b_(?:mm\d*|CMP)_\w+")
OTHER = re.compile(
    r"^#pragma GCC push_options.*?^#pragma GCC pop_options", re.MULTILINE | re.DOTALL
)
TYPE = re.compile(r"^typedef [^{};]*\b__(?:m|v|mmask)\d[^{};]*;", re.MULTILINE)
CONSTANT = re.compile(r"^#define (_CMP_\w+) .*", re.MULTILINE)
FUNCTION = re.compile(
    r"^extern __inline[^{};]*?\b(\w+) ?\((?!\()[^{};]*\)\s*\{.*?^\}", re.MULTILINE | re.DOTALL
)


def shortened(
    text: str, command: tuple[str, ...], flags: tuple[str, ...], identity: str,
    call: Callable[[tuple[str, ...]], tuple[int, str]],
) -> str:  # fmt: skip
    """C text with these definitions in place of the header.

    Parameters
    ----------
    text : str
    command, flags : tuple of str
        Of the compiler.
    identity : str
        Its version.
    call : callable (command) -> (exit code, output)
        Runs a command.

    Returns
    -------
    str
        The given text where it does not include the header, or the header is not written as GCC's.
    """
    if INCLUDE not in text:
        return text
    key = "intrinsics", command, flags, identity
    ask = (*command, *flags, "-E", "-P", "-dD", "-include", "immintrin.h", "-xc", "-")
    return text.replace(INCLUDE, cached(key, lambda: definitions(*call(ask))))


def definitions(code: int, header: str) -> str:
    """The definitions in the order of the header, or the directive that includes it where one is
    lacking.  Those for other processors, which the header puts between pragmas, are left out."""
    folder = files(__package__)
    texts = [folder.joinpath(name).read_text() for name in ("simd.c", "reverse.c", "simd.py")]
    new = {name for text in texts for name in USED.findall(text)}
    if code or not all(f"{name} " in header for name in new):
        return INCLUDE
    header = OTHER.sub("", header)
    known = {found[1]: found[0] for kind in (CONSTANT, FUNCTION) for found in kind.finditer(header)}
    wanted: set[str] = set()
    while new:
        wanted |= new
        words = {word for name in new & known.keys() for word in re.findall(r"\w+", known[name])}
        new = (words & known.keys()) - wanted
    types = [found[0] for found in TYPE.finditer(header)]
    return "\n".join(types + [text for name, text in known.items() if name in wanted])
