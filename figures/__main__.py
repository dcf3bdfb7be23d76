"""Draw pictures: `python -m figures [NAME...] [--list] [--output FOLDER]`."""

from __future__ import annotations

import argparse
import csv
import os
import sys
import tempfile
from itertools import zip_longest
from pathlib import Path

from tqdm import tqdm

from figures import chosen

OUTPUT = Path(__file__).parent / "output"
PAGES = {
    "composite": "The composite claim",
    "limits": "Limits of the methods",
    "protectors": "Protectors",
    "gradients": "Limits of gradients",
}  # titles of the pages that groups have
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


def render(name, module, folder):
    """Compute and draw one picture; returns the files and its lines of the group's table."""
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
        files.insert(0, path)
        if hasattr(module, "animate"):
            path = folder / f"{name}.gif"
            write(path, lambda beside: module.animate(tables, beside))
            plt.close("all")
            files.insert(1, path)
    if hasattr(module, "text"):
        section = f"## {title(module)}\n\n![{title(module)}]({name}.png)\n\n{module.text(tables)}\n"
        path = folder / f"{name}.md"
        write(path, lambda beside: Path(beside).write_text(section))
        files.append(path)
    return files, module.table(tables) if hasattr(module, "table") else []


def title(module):
    """The first line of a picture's docstring."""
    return module.__doc__.splitlines()[0].rstrip(".")


def write_page(group, rendered, folder):
    """One page of a group's sections, where all of them were just made; the file written."""
    told = [n for n, m in chosen([group]).items() if hasattr(m, "text")]
    if not told or not set(told) <= set(rendered):
        return []
    sections = [(folder / f"{name}.md").read_text() for name in told]
    path = folder / f"{group}.md"
    page = "\n".join([f"# {PAGES[group]}\n", *sections])
    write(path, lambda beside: Path(beside).write_text(page))
    return [path]


def print_table(rows):
    """Lines of equal keys, with the keys above, in columns as wide as they need."""
    columns = list(dict.fromkeys(key for row in rows for key in row))
    cells = [columns, *([shown(row.get(key, "")) for key in columns] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    for line in cells:
        print("  ".join(cell.ljust(w) for cell, w in zip(line, widths, strict=True)).rstrip())


def shown(value):
    """A number with six digits, anything else as it is."""
    return f"{value:.6g}" if isinstance(value, float) else str(value)


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
    lines = {}  # of each group's table
    try:
        with tqdm(found.items(), unit="picture", disable=None) as bar:
            for name, module in bar:
                bar.set_description(name)
                files, rows = render(name, module, options.output)
                lines.setdefault(module.GROUP, []).extend(rows)
                for path in files:
                    tqdm.write(f"{path}", file=sys.stdout)
    except KeyboardInterrupt:
        print("interrupted; the pictures named above are complete", file=sys.stderr)
        return 130
    for group, rows in lines.items():
        for path in write_page(group, found, options.output):
            print(path)
        if rows:
            print(f"\n{group}")
            print_table(rows)
            keys = dict.fromkeys(key for row in rows for key in row)
            columns = {key: [row.get(key, "") for row in rows] for key in keys}
            write_table(options.output / f"{group}.csv", columns)
    return 0


if __name__ == "__main__":
    sys.exit(main())
