"""Draw pictures: `python -m figures [NAME...] [--list] [--output FOLDER]`.

A group has a folder; a picture has `name.png`, `name.csv` with all its numbers (`figures._files`)
and, where it moves, `name.gif`.  The lines that a group prints are in `printed.csv`, and
`index.html` shows all pictures that are there.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from tqdm import tqdm

from figures import chosen
from figures._files import side_by_side, write, write_table, write_tables
from figures._gallery import shown, title, write_index, write_page

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


def render(name, module, folder):
    """Compute and draw one picture; returns the files and its lines of the group's table."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    tables = module.data()
    lines = module.table(tables) if hasattr(module, "table") else []
    path = folder / f"{name}.csv"
    write_tables(path, tables, lines)
    files = [path]
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
    return files, lines


def print_table(rows):
    """Lines of equal keys, with the keys above, in columns as wide as they need."""
    columns = list(dict.fromkeys(key for row in rows for key in row))
    cells = [columns, *([shown(row.get(key, "")) for key in columns] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    for line in cells:
        print("  ".join(cell.ljust(w) for cell, w in zip(line, widths, strict=True)).rstrip())


def main(arguments=None):
    """Entry point; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m figures", description=__doc__.splitlines()[0])
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
    lines = {}  # of each group's table
    try:
        with tqdm(found.items(), unit="picture", disable=None) as bar:
            for name, module in bar:
                bar.set_description(name)
                folder = options.output / module.GROUP
                folder.mkdir(parents=True, exist_ok=True)
                files, rows = render(name, module, folder)
                lines.setdefault(module.GROUP, []).extend(rows)
                for path in files:
                    tqdm.write(f"{path}", file=sys.stdout)
    except KeyboardInterrupt:
        print("interrupted; the pictures named above are complete", file=sys.stderr)
        if options.output.is_dir():
            write_index(options.output)
        return 130
    for group, rows in lines.items():
        for path in write_page(group, found, options.output / group):
            print(path)
        if rows:
            print(f"\n{group}")
            print_table(rows)
            write_table(options.output / group / "printed.csv", side_by_side(rows))
    print(write_index(options.output))
    return 0


if __name__ == "__main__":
    sys.exit(main())
