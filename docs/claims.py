"""The claims of the two sources: `claims.toml`, and the numbers that it points to.

Each claim has `name`, `says` (a short quotation), `seed` (talk or paper), `place`, `about` (its
part of the page), `verdict` (a key of VERDICTS), `when` (the condition), `ledger` (names of
entries) and `numbers`: a picture, a table of it (by default "printed"), a `row`, which is a cell
of the line that is meant, a `column`, and `error`, a column of that line, or a row of that column.
"""

from __future__ import annotations

import tomllib
from functools import cache
from pathlib import Path

from figures import claims_inputs, pictures
from figures._files import PRINTED, lines, read_tables

VERDICTS = {
    "holds": "holds",
    "under": "holds under a condition",
    "no": "does not hold",
    "open": "not decided here",
}
FILE = Path(__file__).parent / "claims.toml"


@cache
def claims():
    """All of them, in the order of the page."""
    return tomllib.loads(FILE.read_text(encoding="utf-8"))["claim"]


@cache
def _table(path, name):
    return read_tables(path, {name}).get(name, {}) if path.is_file() else None


def _cell(columns, row, column):
    """The cell of a column in the first line that has `row` in another one."""
    for k, value in enumerate(columns[column]):
        if any(cells[k] == row for name, cells in columns.items() if name != column):
            return value
    raise KeyError(row)


def changes(number, output):
    """Lines on how a number moves with its input; none where it is from no single run."""
    columns = _table(output / claims_inputs.GROUP / f"{claims_inputs.NAME}.csv", PRINTED) or {}
    return [one for one in lines(columns)
            if (one["picture"], one["row"]) == (number["picture"], number["row"])]  # fmt: skip


def numbers(claim, output):
    """Each number of a claim with its value and error, in words.

    Raises
    ------
    KeyError
        Where there is no such picture, table, row or column.
    """
    for number in claim.get("numbers", ()):
        name = number["picture"]
        path = output / pictures()[name].GROUP / f"{name}.csv"
        columns = _table(path, number.get("table", PRINTED))
        if columns is None:
            raise KeyError(f"{name} was not made")
        value, error = _cell(columns, number["row"], number["column"]), None
        if "error" in number:
            of_line = number["error"] in columns
            pair = (number["row"], number["error"]) if of_line else (
                number["error"], number["column"])  # fmt: skip
            error = _cell(columns, *pair)
        yield number, value, error
