"""Curves that a testing machine recorded, read from text files; see `tensegrity.columns`."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from typing import NamedTuple

import numpy as np

from tensegrity import check
from tensegrity.columns import PREFIXES, read_columns, text_lines
from tensegrity.errors import TensegrityError
from tensegrity.printing import filled
from tensegrity.typing import Array


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
    check.path("path", path)
    factors = [_factor("x", x, "m"), _factor("y", y, "N")]
    wanted = [
        column if isinstance(column, str) else check.whole("column", column, least=0)
        for column in check.sequence("columns", columns, "two numbers or names")
    ]
    if len(wanted) != 2:
        raise TensegrityError(f"{len(wanted)} columns, must be two: of shortening and of load")
    values = read_columns(*text_lines(path), wanted).values
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
