"""Files of pictures, written as a whole or not at all; the tables of a picture in one file.

A CSV file holds all tables of a picture in long form, one number in each line,
`table,column,row,value`, so that columns may differ in length.  The printed lines come first, as a
table called "printed".
"""

import csv
from itertools import zip_longest
from pathlib import Path

from tensegrity.check import replacing

PRINTED = "printed"
HEADER = ["table", "column", "row", "value"]


def write(path, save):
    """Let `save` write a file beside this one, which then replaces it: no partial file."""
    with replacing(Path(path)) as new:
        save(str(new))


def write_rows(path, rows):
    """Rows as CSV."""

    def save(temporary):
        with open(temporary, "w", newline="") as file:
            csv.writer(file).writerows(rows)

    write(path, save)


def write_table(path, columns):
    """Columns of one table as CSV, side by side; shorter ones end in empty cells."""
    write_rows(path, [list(columns), *zip_longest(*columns.values(), fillvalue="")])


def side_by_side(lines):
    """Lines {column: value} as {column: list}, empty where a line has no such column."""
    keys = dict.fromkeys(key for line in lines for key in line)
    return {key: [line.get(key, "") for line in lines] for key in keys}


def write_tables(path, tables, lines=()):
    """All tables of a picture in long form, what it prints first.

    Parameters
    ----------
    path : Path
    tables : {table: {column: sequence}}
    lines : sequence of {column: value}
        What the picture prints.
    """
    if PRINTED in tables:
        raise ValueError(
            f"a table of {path.stem} is called {PRINTED!r}, the name of what it prints"
        )
    everything = ({PRINTED: side_by_side(lines)} if lines else {}) | dict(tables)
    cells = (
        (table, column, row, value)
        for table, columns in everything.items()
        for column, values in columns.items()
        for row, value in enumerate(values)
    )
    write_rows(path, (HEADER, *cells))


def read_tables(path, wanted=None):
    """The tables of a picture, or the requested ones, as text.

    Parameters
    ----------
    path : Path
    wanted : collection of str, optional

    Returns
    -------
    {table: {column: list of str}}
    """
    tables = {}
    with open(path, newline="") as file:
        lines = csv.reader(file)
        if next(lines, None) != HEADER:
            raise ValueError(f"{path} does not begin with {','.join(HEADER)}")
        for table, column, _, value in lines:
            if wanted is None or table in wanted:
                tables.setdefault(table, {}).setdefault(column, []).append(value)
            elif wanted == {PRINTED}:
                break  # it stands first
    return tables


def read_printed(path):
    """What a picture printed, as lines {column: str}; none where it prints nothing."""
    return lines(read_tables(path, {PRINTED}).get(PRINTED, {}))


def lines(columns):
    """Rows {column: value} of a table."""
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
