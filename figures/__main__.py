"""Draw pictures: `python -m figures [NAME...] [--all]`; by default an introductory selection.

A group has a folder; a picture has `name.png`, `name.csv` with all its numbers (`figures._files`)
and, if it is animated, `name.gif`.  The lines that a group prints are in `printed.csv`, and
`index.html` shows all existing pictures.  Pictures that are named are drawn; otherwise existing
pictures of the same sources are retained, so that an interrupted command can be continued.
"""

import argparse
import csv
import shutil
import signal
import sys
import time
import traceback
from pathlib import Path

from figures import FIRST, _draw, _small, _stored, chosen, pictures
from figures._draw import Job
from figures._files import read_printed, side_by_side, write_table
from figures._gallery import made, shown, title, write_index, write_page

HERE = Path(__file__).parent
OUTPUT, SHOWN = HERE / "output", HERE.parent / "docs" / "pictures"
SECONDS = _stored.DATA / "seconds.csv"  # of a processor, that each picture takes


def print_table(rows):
    """Print lines of equal keys below the keys, in columns of sufficient width."""
    columns = list(dict.fromkeys(key for row in rows for key in row))
    cells = [columns, *([shown(row.get(key, "")) for key in columns] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    for line in cells:
        print("  ".join(cell.ljust(w) for cell, w in zip(line, widths, strict=True)).rstrip())


def costs():
    """{picture: processor time [s]}."""
    with open(SECONDS, newline="") as file:
        return {line["picture"]: float(line["seconds"]) for line in csv.DictReader(file)}


def span(seconds):
    """A time as text."""
    return f"{seconds:.0f} s" if seconds < 90 else f"{seconds / 60:.0f} min"


def draw_all(jobs, processes, total):
    """Draw pictures, and report each when it is complete.

    Parameters
    ----------
    jobs : sequence of Job
    processes : int
    total : int
        Of all pictures, also those that were there before.

    Yields
    ------
    Drawn
        Of each that did not fail.
    """
    known, began = costs(), time.perf_counter()
    expected = {job.name: known.get(job.name, 1.0) for job in jobs}
    left = every = sum(expected.values())
    results = enumerate(_draw.finished(_draw.draw, jobs, processes), total - len(jobs) + 1)
    for done, (job, one) in results:
        left -= expected[job.name]
        place = f"{done:{len(str(total))}}/{total}"
        if isinstance(one, BaseException):
            traceback.print_exception(one)
            print(f"{place}  FAILED  {job.name}", flush=True)
            continue
        took = time.perf_counter() - began + every / processes  # as expected, if nothing is done
        rest = took * left / (2 * every - left)
        ending = f"; {span(rest)} left" if rest > 10 else ""
        words = title(pictures()[job.name])
        print(f"{place} {one.seconds:6.1f} s  {one.group}/{job.name}: {words}{ending}", flush=True)
        yield one


def write_groups(complete, output):
    """Write a page of each complete group, and a table of the existing pictures."""
    for group, there in made(output).items():
        folder = output / group
        write_page(group, complete, folder)
        if rows := [row for name in there for row in read_printed(folder / f"{name}.csv")]:
            write_table(folder / "printed.csv", side_by_side(rows))


def update(
    found, drawn, output, shown_in=SHOWN, data=_stored.DATA, made=_stored.MADE, small=_small.SMALL
):
    """Refresh what is under version control: pictures that README and site show, small versions of
    all, results that were computed again, and seconds."""
    for name, module in found.items():
        if (output / module.GROUP / f"{name}.png").is_file():
            _small.keep(name, output, small)
    for group in {module.GROUP for module in found.values()}:
        for name in [group, *found]:
            for path in (output / group).glob(f"{name}.*"):
                if (shown_in / path.name).is_file():
                    shutil.copyfile(path, shown_in / path.name)
    for path in made.glob("*.npz"):
        shutil.move(path, data / path.name)
    known = costs() | {one.name: round(one.work, 1) for one in drawn}
    names = sorted(known.keys() & pictures().keys())
    write_table(data / SECONDS.name, {"picture": names, "seconds": [known[name] for name in names]})


def arguments_of():
    """The arguments of the command."""
    parser = argparse.ArgumentParser(prog="python -m figures", description=__doc__.splitlines()[0])
    add = parser.add_argument
    add("names", nargs="*", metavar="NAME", help="pictures or groups")
    add("--all", action="store_true", help="draw all pictures, slow ones last")
    add("--list", action="store_true", help="name the pictures and their groups")
    add("--output", type=Path, default=OUTPUT, help="folder for PNG and CSV")
    add("--processes", type=int, default=2, metavar="N", help="pictures drawn at a time: 2")
    words = "draw what is there again, and compute again what is stored in figures/data"
    add("--fresh", action="store_true", help=words)
    add("--update", action="store_true", help="refresh docs/pictures and figures/data")
    return parser


def selected(options):
    """{name: module} of the pictures that are wanted, in the order in which to draw them."""
    if options.names:
        return chosen(options.names)
    known = costs()
    if not (options.all or options.list):  # the longest first: the last ones then end together
        return {name: pictures()[name] for name in sorted(FIRST, key=known.get, reverse=True)}
    return dict(sorted(pictures().items(), key=lambda one: known.get(one[0], 0.0)))


def main(arguments=None):
    """Entry point; returns the exit code."""
    parser = arguments_of()
    options = parser.parse_args(arguments)
    try:
        found = selected(options)
    except ValueError as error:
        parser.error(str(error))
    if options.list:
        for name, module in sorted(found.items()):
            print(f"{name:24} {module.GROUP:14} {title(module)}")
        return 0
    output, of = options.output, _stored.everything()
    if options.fresh:
        shutil.rmtree(_stored.MADE, ignore_errors=True)
    jobs = [Job(name, output, of, options.fresh) for name in found]
    if not (options.names or options.fresh):
        jobs = [job for job in jobs if not _draw.is_there(job)]
        if there := len(found) - len(jobs):
            print(f"{there} of {len(found)} pictures are there, of the same sources", flush=True)
    drawn = []
    try:
        for one in draw_all(jobs, max(1, min(options.processes, len(jobs))), len(found)):
            drawn.append(one)
    except KeyboardInterrupt:
        print("stopped: what is named above is complete; the same command goes on", flush=True)
        return 130
    finally:
        if output.is_dir():
            write_groups([name for name in found if _draw.is_there(Job(name, output, of))], output)
            write_index(output)
    if options.names:
        for group in dict.fromkeys(one.group for one in drawn):
            if rows := [row for one in drawn if one.group == group for row in one.lines]:
                print(f"\n{group}")
                print_table(rows)
    if options.update:
        update(found, [] if options.fresh else drawn, output)
    print(last_line(options, output))
    return int(len(drawn) < len(jobs))


def last_line(options, output):
    """Where the pictures are, and the next commands."""
    page = (output / "index.html").resolve()
    page = page.relative_to(Path.cwd()) if page.is_relative_to(Path.cwd()) else page
    line = f"{page} shows all that is there, with its numbers"
    if options.names:
        return line
    if options.all:
        return f"{line}; next: `make site` builds the guide, the gallery and the reference"
    minutes = span(sum(costs().values()) / 2)
    return (
        f"{line}; next: README.md has code to start from, `make gallery` draws all "
        f"{len(pictures())} pictures in {minutes}, `make help` lists the rest"
    )


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # as Ctrl-C
    sys.exit(main())
