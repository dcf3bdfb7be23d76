"""Columns of numbers in text files, as testing machines, oscilloscopes and programs write them.

Columns stand below any header, separated by tabs, semicolons, commas or blanks, with decimal points
or commas.  The first line with numbers in the requested columns decides which of these.  Nothing in
a file is evaluated.  Below that line only empty lines and comments are skipped; anything else that
is not a number is refused, with its line, column and value.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.typing import Array

SEPARATORS = ("\t", ";", ",", " ")  # in this order: a decimal comma is no separator then
COMMENTS = ("#", "%")
NUMBER = re.compile(r"[-+]?(\d+[.,]?\d*|[.,]\d+)(e[-+]?\d+)?", re.IGNORECASE)
LABEL = re.compile(r"(CH\d+(?=[VA]$)|.*?(?=\s*[\[(]))\s*[\[(]?(.*?)[\])]?")
"""A name and its unit, in brackets or as in CH1V."""
MARKS = {",": "comma", ".": "point"}
PREFIXES = {"": 0, "n": -9, "u": -6, "µ": -6, "m": -3, "c": -2, "d": -1, "k": 3, "M": 6}
ABSENT = 9.9e37  # what an oscilloscope writes for a sample that it does not have, or more
UTF16 = (b"\xff\xfe", b"\xfe\xff")


class Columns(NamedTuple):
    """Numbers of a text file.

    Attributes
    ----------
    values : ndarray, (rows, columns)
        In the order of the requested columns; nan where a sample is missing.
    lines : list of int
        Line of each row, from 1.
    places : sequence of int
        The requested columns, from 0.
    head : list of (int, list of str)
        Numbers and fields of the lines before.
    """

    values: Array
    lines: list[int]
    places: Sequence[int]
    head: list[tuple[int, list[str]]]


def text_lines(path: object) -> tuple[Path, list[str]]:
    """The path of a text file, once it is found to be one, and its lines; a byte order mark is
    left out."""
    file = check.path("path", path)
    try:
        data = file.read_bytes()
    except OSError as error:
        raise TensegrityError(f"{file} cannot be read: {error.strerror}") from None
    encoding = "utf-16" if data[:2] in UTF16 else "utf-8-sig"
    return file, data.decode(encoding, errors="replace").splitlines()


def read_columns(
    file: Path, lines: list[str], wanted: Sequence[int | str], gaps: bool = False
) -> Columns:
    """Numbers in some columns of a text file.

    Parameters
    ----------
    file : Path
        For messages.
    lines : list of str
    wanted : sequence of int or str
        Columns, from 0, or their names in a line of the header, with or without a unit.
    gaps : bool, optional
        Whether samples may be missing: fields that are empty, or beyond `ABSENT`.

    Returns
    -------
    Columns

    Raises
    ------
    TensegrityError
        No such columns; a line or a value that does not fit.
    """
    try:
        return _columns(lines, wanted, gaps)
    except (TensegrityError, csv.Error) as error:
        raise TensegrityError(f"{file}, {error}") from None


def _columns(lines: list[str], wanted: Sequence[int | str], gaps: bool) -> Columns:
    start, separator, places = _start(lines, wanted)
    width, mark = len(_fields(lines[start], separator)), ""
    rows, numbers = [], []
    for number, line in enumerate(lines[start:], start + 1):
        if not line.strip() or line.lstrip().startswith(COMMENTS):
            continue
        fields = _fields(line, separator)
        if len(fields) != width:
            raise TensegrityError(
                f"line {number}: {len(fields)} columns, must be {width} as in line {start + 1}"
            )
        row = []
        for place in places:
            text = fields[place]
            value = float(text.replace(",", ".")) if NUMBER.fullmatch(text) else math.nan
            missing = gaps and (not text or abs(value) >= ABSENT)
            if not (math.isfinite(value) or missing):
                raise TensegrityError(
                    f"line {number}, column {place}: {check.shown(text)} is no finite number"
                )
            used = next((one for one in MARKS if one in text), "")
            if mark and used and used != mark:
                raise TensegrityError(
                    f"line {number}, column {place}: {text} has a decimal {MARKS[used]}, values "
                    f"before it a decimal {MARKS[mark]}"
                )
            mark = mark or used
            row.append(math.nan if missing else value)
        rows.append(row)
        numbers.append(number)
    head = [(k, _fields(line.lstrip(" #%"), separator)) for k, line in enumerate(lines[:start], 1)]
    return Columns(np.array(rows), numbers, places, head)


def _start(lines: list[str], wanted: Sequence[int | str]) -> tuple[int, str, Sequence[int]]:
    """Index of the first line of numbers, what separates its columns, and which are wanted."""
    names = {column for column in wanted if isinstance(column, str)}
    known: dict[str, list[int]] = {}  # separators under which names were seen, and their places
    for index, line in enumerate(lines):
        comment = line.lstrip().startswith(COMMENTS)
        for separator in SEPARATORS:
            fields = _fields(line.lstrip(" #%") if comment else line, separator)
            bare = [found[1] if (found := LABEL.fullmatch(x)) else x for x in fields]
            if names <= {*fields, *bare}:
                known[separator] = [
                    (fields if c in fields else bare).index(c) if isinstance(c, str) else c
                    for c in wanted
                ]
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
    if '"' not in line:
        return [field.strip() for field in line.split(separator)]
    reader = csv.reader([line], delimiter=separator, skipinitialspace=True)
    return [field.strip() for field in next(reader, [])]
