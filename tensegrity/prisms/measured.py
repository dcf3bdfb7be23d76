"""Curves that a testing machine recorded, read from text files.

Columns of numbers below any header, separated by tabs, semicolons, commas or blanks, with decimal
points or commas.  The first line with numbers in the requested columns decides which of these.
Nothing in a file is evaluated.  Below that line only empty lines and comments are skipped; anything
else that is not a number is refused, with its line and value.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Sequence
from os import PathLike
from typing import NamedTuple

import numpy as np

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.printing import filled
from tensegrity.typing import Array

SEPARATORS = ("\t", ";", ",", " ")  # in this order: a decimal comma is no separator then
COMMENTS = ("#", "%")
NUMBER = re.compile(r"[-+]?(\d+[.,]?\d*|[.,]\d+)(e[-+]?\d+)?", re.IGNORECASE)
MARKS = {",": "comma", ".": "point"}
PREFIXES = {"": 0, "n": -9, "u": -6, "µ": -6, "m": -3, "c": -2, "d": -1, "k": 3, "M": 6}


class MeasuredCurve(NamedTuple):
    """Points of a curve, in the order of the file.

    Attributes
    ----------
    shortening : ndarray, (points,)
        [m], compression > 0.
    load : ndarray, (points,)
        [N], compression > 0.
    """

    shortening: Array
    load: Array

    def __repr__(self) -> str:
        x, y = (f"{column.min():.6g} to {column.max():.6g}" for column in self)
        return filled(f"MeasuredCurve: {len(self.load)} points, shortening {x} m, load {y} N")


def read_curve(
    path: str | PathLike[str],
    x: str = "mm",
    y: str = "N",
    columns: Sequence[int | str] = (0, 1),
) -> MeasuredCurve:
    """Read shortening and load from a file of measurements, for `fit` and for plots.

    Parameters
    ----------
    path : path
        Of a text file.  Lines that begin with # or % are comments.
    x, y : str, optional
        Units of shortening and load in the file: m or N with a prefix of n, u, c, d, m, k, M or
        none; or "in"; "lbf", "kgf".  With a minus sign, as in "-mm" and "-N", the file counts
        compression as negative.
    columns : (int or str, int or str), optional
        Of shortening and of load: numbers, from 0, or names in a line of the header.

    Returns
    -------
    MeasuredCurve
        As recorded, except for units and signs: neither sorted nor shifted to zero (`fit` has an
        `offset`).

    Raises
    ------
    TensegrityError
        If the file cannot be read or has no such columns; if a value below the first line of
        numbers is no finite number, a line has another number of columns, or decimal points and
        decimal commas are mixed, by line and value.

    Notes
    -----
    A comma that does not separate columns is a decimal one: 1,234 is never read as 1234.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from tensegrity import read_curve
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder, "prism.txt")
    ...     _ = file.write_text("Time;Travel;Force\\ns;mm;kN\\n0;0;0\\n1;-0,25;-1,5\\n")
    ...     shortening, load = read_curve(file, "-mm", "-kN", ("Travel", "Force"))
    >>> print(shortening[1], load[1])
    0.00025 1500.0
    """
    file = check.path("path", path)
    factors = [_factor("x", x, "m"), _factor("y", y, "N")]
    wanted = [
        column if isinstance(column, str) else check.whole("column", column, least=0)
        for column in check.sequence("columns", columns, "two numbers or names")
    ]
    if len(wanted) != 2:
        raise TensegrityError(f"{len(wanted)} columns, must be two: of shortening and of load")
    try:
        text = file.read_text(encoding="utf-8-sig", errors="replace")
    except OSError as error:
        raise TensegrityError(f"{file} cannot be read: {error.strerror}") from None
    try:
        values = np.array(list(_rows(text.splitlines(), wanted)))
    except (TensegrityError, csv.Error) as error:
        raise TensegrityError(f"{file}, {error}") from None
    return MeasuredCurve(*(values.T * np.array(factors)[:, None]))


def _factor(name: str, unit: object, base: str) -> float:
    """What a value in some unit is multiplied by, for m or N."""
    from scipy import constants

    known = {prefix + base: 10.0**power for prefix, power in PREFIXES.items()}
    inches = {"in": constants.inch}
    known |= inches if base == "m" else {"lbf": constants.lbf, "kgf": constants.kgf}
    word = unit.removeprefix("-") if isinstance(unit, str) else None
    if word not in known:
        raise TensegrityError(
            f"unit {name} {check.shown(unit)} must be, with or without -, of {', '.join(known)}"
        )
    return known[word] if word == unit else -known[word]


def _rows(lines: list[str], wanted: Sequence[int | str]) -> Iterator[list[float]]:
    """The two numbers of each line, from the first that has them on."""
    start, separator, places = _start(lines, wanted)
    width, mark = len(_fields(lines[start], separator)), ""
    for number, line in enumerate(lines[start:], start + 1):
        if not line.strip() or line.lstrip().startswith(COMMENTS):
            continue
        fields = _fields(line, separator)
        if len(fields) != width:
            raise TensegrityError(
                f"line {number}: {len(fields)} columns, must be {width} as in line {start + 1}"
            )
        row = []
        for text in (fields[place] for place in places):
            value = float(text.replace(",", ".")) if NUMBER.fullmatch(text) else np.nan
            if not np.isfinite(value):
                raise TensegrityError(f"line {number}: {check.shown(text)} is no finite number")
            used = "".join(MARKS.keys() & set(text))
            if mark and used and used != mark:
                raise TensegrityError(
                    f"line {number}: {text} has a decimal {MARKS[used]}, values before it a "
                    f"decimal {MARKS[mark]}"
                )
            mark = mark or used
            row.append(value)
        yield row


def _start(lines: list[str], wanted: Sequence[int | str]) -> tuple[int, str, Sequence[int]]:
    """Index of the first line of numbers, what separates its columns, and which are wanted."""
    names = {column for column in wanted if isinstance(column, str)}
    known: dict[str, list[int]] = {}  # separators under which names were seen, and their places
    for index, line in enumerate(lines):
        comment = line.lstrip().startswith(COMMENTS)
        for separator in SEPARATORS:
            fields = _fields(line.lstrip(" #%") if comment else line, separator)
            if names <= set(fields):
                places = [fields.index(c) if isinstance(c, str) else c for c in wanted]
                known[separator] = places
            if separator in known and not comment:
                places = known[separator]
                if all(p < len(fields) and NUMBER.fullmatch(fields[p]) for p in places):
                    return index, separator, places
    missing = "has numbers in" if known or not names else "of the header names"
    columns = check.shown(tuple(wanted))
    head = f", line 1 is {check.shown(lines[0])}" if lines else ""
    raise TensegrityError(f"{len(lines)} lines: no line {missing} columns {columns}{head}")


def _fields(line: str, separator: str) -> list[str]:
    """Columns of a line, without quotes and blanks about them."""
    if separator == " ":
        return line.split()
    reader = csv.reader([line], delimiter=separator, skipinitialspace=True)
    return [field.strip() for field in next(reader, [])]
