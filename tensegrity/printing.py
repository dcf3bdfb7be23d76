"""The printed form of objects: lines of at most 80 columns, numbers of six digits.

The text of a `repr` that reads back keeps all digits, so that equal texts are equal objects; what
`print` shows is made here, and the table with a picture of self-contained HTML that a notebook
shows of the same lines.
"""

from __future__ import annotations

import base64
import html
import io
import re
import textwrap
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, ExitStack
from dataclasses import fields
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from tensegrity import check, unit_names
from tensegrity.errors import SAID, TensegrityError
from tensegrity.unit_names import in_units

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Lines: TypeAlias = Iterator[str]

WIDTH = 80
GLUE = "\xa0"  # a space at which no line is broken
DOTS = 110  # per inch, of pictures in a notebook
ROUND_OFF = 1e-12  # of the largest of some numbers, below which others are printed as 0
UNIT = re.compile(r"(?<=\d) (?=[A-Za-z])")  # between a number and its unit
LONG = re.compile(r"(?<![\w.])\d+(?:\.\d*)?(?:e[+-]?\d+)?(?![\w.])")  # a number


def units(
    length: str = "m",
    force: str = "N",
    time: str = "s",
    mass: str | None = None,
    energy: str | None = None,
) -> AbstractContextManager[Any]:
    """Name the units of numbers, for prints, plots, files and messages.

    Nothing is converted: a consistent set of units is used throughout, which is that of SI unless
    it is named here.

    Parameters
    ----------
    length, force, time : str, optional
        Names, such as "mm"; an empty text for a quantity without a unit.
    mass, energy : str, optional
        By default those of SI if the others are, else force times time squared over length, and
        force times length.

    Returns
    -------
    context manager
        The names hold from the call on, in this thread; in a `with` statement, until it ends.

    Raises
    ------
    TensegrityError
        A name that is not text.

    Examples
    --------
    >>> import tensegrity as ts
    >>> with ts.units(length="mm"):
    ...     print(ts.Prism(base=80.0, height=70.0, prestrain=0.01, k_cross=2.0))
    prism of 3 sides: base 80 mm, height 70 mm, prestrain 0.01, k_cross 2 N/mm
    """
    for name, text in (("length", length), ("force", force), ("time", time)):
        check.kind(name, text, str)
    derived = (length, force, time) != ("m", "N", "s")
    if mass is None:
        impulse = _joined(force, time and f"{time}^2", " ")
        mass = _joined(impulse, length, "/") if derived else "kg"
    if energy is None:
        energy = _joined(force, length, " ") if derived else "J"
    for name, text in (("mass", mass), ("energy", energy)):
        check.kind(name, text, str)
    SAID["message"] = unit_names.in_units
    names = {"m": length, "kg": mass, "s": time, "N": force, "J": energy}
    unit_names.given.set((*unit_names.given.get(), names))
    after = ExitStack()
    after.callback(_ended, names)
    return after


def _ended(names: dict[str, str]) -> None:
    """End the hold of some names, whichever were given since."""
    left = tuple(one for one in unit_names.given.get() if one is not names)
    unit_names.given.set(left)


def _joined(one: str, other: str, mark: str) -> str:
    """A product or quotient of units, of which either may have no name."""
    if not one and other and mark == "/":
        return f"1/{other}"
    return mark.join(part for part in (one, other) if part)


def filled(text: str) -> str:
    """Text whose lines are broken where they are wider than 80 columns, and indented then."""
    lines = []
    for line in UNIT.sub(GLUE, in_units(text)).splitlines():
        indent = line[: len(line) - len(line.lstrip())] + "    "
        lines += textwrap.wrap(line, WIDTH, subsequent_indent=indent, break_on_hyphens=False)
    return "\n".join(lines).replace(GLUE, " ")


def page(
    lines: Iterable[str],
    draw: Callable[[Figure], object] | None = None,
    size: tuple[float, float] = (4.6, 3.0),
) -> str:
    """A title, a table below it, and a picture next to them.

    Parameters
    ----------
    lines : iterable of str
        The title, then the rows: "name: value", or one without a name.  All text is escaped.
    draw : callable (figure) -> None, optional
        Draws the picture; there is none where it raises a TensegrityError.
    size : (float, float), optional
        Width and height of the picture [inches].

    Returns
    -------
    str
        HTML.
    """
    title, *rows = (html.escape(in_units(" ".join(line.split()))) for line in lines)
    left = 'style="text-align:left"'
    name = '<th style="text-align:left;font-weight:normal;opacity:0.7;padding-right:1em">'
    cells = ""
    for row in rows:
        before, colon, value = row.partition(": ")
        wide = f'<td colspan="2" {left}>{row}</td>'
        cells += f"<tr>{f'{name}{before}</th><td {left}>{value}</td>' if colon else wide}</tr>"
    picture = _picture(draw, size, title) if draw else ""
    return (
        '<div style="display:flex;flex-wrap:wrap;gap:1.5em;align-items:flex-start">'
        f"<div><b>{title}</b><table>{cells}</table></div>{picture}</div>"
    )


def _picture(draw: Callable[[Figure], object], size: tuple[float, float], title: str) -> str:
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    try:
        draw(figure)
    except TensegrityError:
        return ""
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=DOTS)
    data = base64.b64encode(file.getvalue()).decode()
    width = f"{size[0] * 96:.0f}"
    return f'<img alt="{title}" width="{width}" src="data:image/png;base64,{data}">'


class Printed:
    """Base of results: `print`, `repr` and a notebook show the same lines, `_lines`, the first of
    which is the title; a notebook as a table, beside the picture that `_draw` draws."""

    _draw: Callable[[Any], object] | None = None  # on a figure of Matplotlib
    _size = (4.6, 3.0)  # inches

    def _lines(self) -> Lines:
        raise NotImplementedError

    def __str__(self) -> str:
        return filled("\n".join(self._lines()))

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        return page(self._lines(), self._draw, self._size)


def drawn(self: Any, figure: Figure) -> None:
    """The picture of what has a plot on axes of the plane."""
    self.plot(figure.subplots())


def concise(thing: object) -> str:
    """The `repr` of something with numbers of six digits, in lines of 80 columns."""
    return filled(LONG.sub(lambda found: _rounded(found[0]), repr(thing)))


def number_text(number: float) -> str:
    """The shortest text that evaluates to this number: 1 rather than 1.0."""
    return repr(float(number)).removesuffix(".0")


def call(name: str, **given: Any) -> str:
    """The text of a call with these arguments, such as f(x=1, y=2)."""
    return f"{name}({', '.join(f'{key}={number_text(value)}' for key, value in given.items())})"


def span(values: Any, unit: str = "", size: float = 0.0) -> str:
    """From the smallest to the largest of some numbers, with their unit; round-off is 0.

    Parameters
    ----------
    values : array_like
    unit : str, optional
    size : float, optional
        Of other numbers whose round-off they may be, if that is larger than theirs.

    Returns
    -------
    str
    """
    values = np.asarray(values)
    values = np.where(np.abs(values) <= ROUND_OFF * max(np.abs(values).max(), size), 0, values)
    low, high = (f"{f(values):.6g}" for f in (np.min, np.max))
    return (low if low == high else f"{low} to {high}") + (unit and f" {unit}")


def listed(numbers: Any, most: int = 12) -> str:
    """Numbers one after the other, or how many where there are more; "none"."""
    if len(numbers) > most:
        return f"{len(numbers)} of them"
    return ", ".join(str(int(n)) for n in numbers) or "none"


def printed(**units: str) -> Callable[[Any], str]:
    """A method that prints the fields of a dataclass with their units, except those that are None
    or nan, or not part of its `repr`."""

    def text(self: Any) -> str:
        parts = [
            f"{field.name} {_short(getattr(self, field.name), units.get(field.name, ''))}"
            for field in fields(self)
            if field.repr and _is_known(getattr(self, field.name))
        ]
        return filled(f"{type(self).__name__}: {', '.join(parts)}".removesuffix(": "))

    return text


def _is_known(value: Any) -> bool:
    return value is not None and not (isinstance(value, float) and value != value)


def _short(value: Any, unit: str) -> str:
    """A value in few words: of many numbers their shape and range."""
    behind = unit and f" {unit}"
    if isinstance(value, float):
        return f"{value:.6g}{behind}"
    if isinstance(value, (tuple, list)) and len(value) > 3:
        if not isinstance(value[0], (int, float)):
            return f"{len(value)} {type(value[0]).__name__}s"
        value = np.array(value)
    if isinstance(value, tuple) and all(isinstance(x, float) for x in value):
        return ", ".join(f"{x:.6g}" for x in value) + behind
    if isinstance(value, np.ndarray) and value.size > 3 and value.dtype.kind in "iuf":
        return f"{value.shape} from {span(value, unit)}"
    if isinstance(value, np.ndarray) and value.ndim == 0:
        return f"{value[()]:.6g}{behind}"
    if isinstance(value, np.ndarray) and value.dtype.kind == "f":
        return str([float(f"{x:.6g}") for x in value.ravel()]) + behind
    return " ".join(str(value).split()) + behind


def _rounded(number: str) -> str:
    digits = re.sub(r"e.*|\.", "", number).strip("0")
    return number if len(digits) <= 6 or number.isdigit() else f"{float(number):.6g}"
