"""Draw pictures: `python -m figures [NAME...] [--list] [--output FOLDER]`.

Behind the pictures of a group their rows are printed as one table, also kept as CSV.
"""

from __future__ import annotations

import argparse
import csv
import os
import sys
import tempfile
from collections import defaultdict
from itertools import zip_longest
from pathlib import Path

from tqdm import tqdm

from figures import chosen

OUTPUT = Path(__file__).parent / "output"
STYLE = {
    "figure.figsize": (8, 4.5),
    "figure.dpi": 110,
    "axes.grid": True,
    "grid.alpha": 0.25,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "font.size": 10,
}


def write(path, save):
    """Have `save(temporary path)` write beside the path, then rename: never half a file."""
    handle, beside = tempfile.mkstemp(dir=path.parent, suffix=path.suffix)
    os.close(handle)
    try:
        save(beside)
        os.chmod(beside, 0o644)
        os.replace(beside, path)
    except BaseException:
        os.unlink(beside)
        raise


def write_table(path, columns):
    """Columns of a table as CSV; shorter ones end in empty cells."""

    def save(beside):
        with open(beside, "w", newline="") as file:
            rows = csv.writer(file)
            rows.writerow(columns)
            rows.writerows(zip_longest(*columns.values(), fillvalue=""))

    write(path, save)


def print_rows(group, rows, folder):
    """Rows {column: text} of a group as a table with aligned columns, and as CSV."""
    columns = list(rows[0])
    path = folder / f"{group}_table.csv"
    write_table(path, {name: [row[name] for row in rows] for name in columns})
    lines = [columns, *([str(row[name]) for name in columns] for row in rows)]
    widths = [max(len(line[k]) for line in lines) for k in range(len(columns))]
    print(f"\n{group}, also in {path}")
    for line in lines:
        print("  ".join(x.ljust(w) for x, w in zip(line, widths, strict=True)).rstrip())


def render(name, module, folder):
    """Compute and draw one picture; returns the files written and the rows of its table."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    tables = module.data()
    files = []
    for table, columns in tables.items():
        path = folder / (f"{name}.csv" if len(tables) == 1 else f"{name}_{table}.csv")
        write_table(path, columns)
        files.append(path)
    with plt.rc_context(STYLE):
        figure = plt.figure(layout="constrained")
        module.draw(figure, tables)
        path = folder / f"{name}.png"
        write(path, figure.savefig)
        plt.close(figure)
        if hasattr(module, "animate"):
            figure = plt.figure(layout="constrained")
            animation, writer = module.animate(figure, tables)
            files.append(folder / f"{name}.gif")
            write(files[-1], lambda beside: animation.save(beside, writer=writer))
            plt.close(figure)
    rows = module.table(tables) if hasattr(module, "table") else []
    return [path, *files], rows


def main(arguments=None):
    """Entry point; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m figures", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="pictures or groups")
    parser.add_argument("--list", action="store_true", help="name the pictures and their groups")
    parser.add_argument("--output", type=Path, default=OUTPUT, help="folder for PNG and CSV")
    options = parser.parse_args(arguments)
    try:
        found = chosen(options.names)
    except ValueError as error:
        parser.error(str(error))
    if options.list:
        for name, module in found.items():
            print(f"{name:24} {module.GROUP:14} {module.__doc__.splitlines()[0]}")
        return 0
    options.output.mkdir(parents=True, exist_ok=True)
    rows = defaultdict(list)
    try:
        with tqdm(found.items(), unit="picture", disable=None) as bar:
            for name, module in bar:
                bar.set_description(name)
                files, found_rows = render(name, module, options.output)
                rows[module.GROUP] += found_rows
                for path in files:
                    tqdm.write(f"{path}", file=sys.stdout)
    except KeyboardInterrupt:
        print("interrupted; the pictures named above are complete", file=sys.stderr)
        return 130
    finally:
        for group in filter(rows.get, rows):
            print_rows(group, rows[group], options.output)
    return 0


if __name__ == "__main__":
    sys.exit(main())
