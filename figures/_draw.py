"""Drawing: one picture with all its files, and many of them, on several processes."""

from __future__ import annotations

import os
import threading
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import suppress
from importlib import import_module
from multiprocessing import active_children, connection, get_context, parent_process
from pathlib import Path
from signal import SIGKILL
from typing import NamedTuple

import numpy as np

from figures import _stored
from figures._files import write, write_tables
from figures._gallery import title

STYLE = {
    "figure.figsize": (8, 4.5),
    "figure.dpi": 110,
    "axes.grid": True,
    "axes.titlesize": 10,
    "grid.alpha": 0.25,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "font.size": 10,
}
ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "TENSEGRITY_THREADS": "1", "TQDM_DISABLE": "1"}


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
        figure = pictured(module, tables)
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


def pictured(module, tables):
    """The figure of a picture, with its title, and letters at its panels."""
    import matplotlib.pyplot as plt

    figure = plt.figure(layout="constrained")
    module.draw(figure, tables)
    several = panels(figure)
    if not figure.get_suptitle() and not (len(several) == 1 and several[0].get_title()):
        figure.suptitle(title(module), fontsize=11)
    for k, axes in enumerate(several if len(several) > 1 else ()):
        titles = [axes.get_title(loc=where) for where in ("left", "center", "right")]
        if not any(words.startswith("(") for words in titles):
            where = "left" if titles[0] else "center"
            words = f"({chr(ord('a') + k)}) {titles[0] or titles[1]}".strip()
            axes.set_title(
                words, loc=where, fontsize=axes.title.get_fontsize() if titles[1] else 10
            )
    return figure


def panels(figure):
    """Axes that are panels: no colour bars, and one of several at the same place."""
    found = {}
    for axes in figure.axes:
        if axes.get_label() != "<colorbar>" and axes.get_visible():
            place = axes.get_subplotspec()
            found.setdefault(
                id(axes) if place is None else (id(place.get_gridspec()), place.num1), axes
            )
    return list(found.values())


def name_curves(axes, *, spread=11.0, at=-1):
    """Write the label of each curve at one of its ends, in its colour, in place of a legend.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
    spread : float, optional
        Least distance between two labels [pt].
    at : int or callable, optional
        The point of a curve at which its label stands: -1 the last one, 0 the first; or a function
        of its values that finds it, such as `numpy.argmax`.
    """
    figure = axes.figure
    lines = [one for one in axes.lines if not one.get_label().startswith("_")]
    points = [at(one.get_ydata()) if callable(at) else at for one in lines]
    places = [np.transpose(one.get_data())[k] for one, k in zip(lines, points, strict=True)]
    ends = axes.transData.transform(places)
    scale, last = figure.dpi / 72, -np.inf
    for k in sorted(range(len(lines)), key=lambda k: ends[k][1]):
        last = max(ends[k][1], last + spread * scale)
        is_first = ends[k][0] <= axes.transData.transform(lines[k].get_xydata())[:, 0].min()
        axes.annotate(
            lines[k].get_label(), places[k],
            (-6 if is_first else 6, (last - ends[k][1]) / scale),
            textcoords="offset points", va="center",
            ha="right" if is_first else "left", color=lines[k].get_color(), fontsize=9,
            annotation_clip=False,
        )  # fmt: skip


class Job(NamedTuple):
    """A picture to draw."""

    name: str
    output: Path
    sources: str  # digest of all of them
    is_fresh: bool = False  # whether stored results are computed again


class Drawn(NamedTuple):
    """A picture with its lines of the group's table, and the time that it took."""

    name: str
    group: str
    lines: list
    seconds: float
    work: float  # s of processors


def draw(job):
    """Draw a picture, and record its sources in the output folder."""
    began, work, _stored.fresh = time.perf_counter(), _stored.spent(), job.is_fresh
    module = import_module(f"figures.{job.name}")
    folder = job.output / module.GROUP
    folder.mkdir(parents=True, exist_ok=True)
    _, lines = render(job.name, module, folder)
    mark = mark_of(job)
    mark.parent.mkdir(exist_ok=True)
    write(mark, lambda beside: Path(beside).write_text(job.sources))
    took, work = time.perf_counter() - began, _stored.spent() - work
    return Drawn(job.name, module.GROUP, lines, took, work)


def mark_of(job):
    """The file that records the sources of a picture, written when it is complete."""
    return job.output / ".drawn" / job.name


def is_there(job):
    """Whether a picture of the same sources exists."""
    mark = mark_of(job)
    return mark.is_file() and mark.read_text() == job.sources


def finished(function, cases, processes):
    """(case, result or exception) of each, in the order in which they are done.

    With one process the function is called here and its exceptions propagate.  If this generator
    is stopped, for instance by Ctrl-C, the processes and their children are stopped at once.
    """
    if processes == 1:
        yield from ((case, function(case)) for case in cases)
        return
    with ProcessPoolExecutor(processes, get_context("spawn"), begin) as pool:
        futures = {}
        try:
            futures.update((pool.submit(function, case), case) for case in cases)
            for future in as_completed(futures):
                yield futures[future], future.exception() or future.result()
        except BaseException:
            for future in futures:
                future.cancel()
            for child in active_children():
                child.kill()
                with suppress(ProcessLookupError):
                    os.killpg(child.pid, SIGKILL)
            raise  # the pool waits for the processes: two threads that do get in each other's way


def begin():
    """Make a process the first of a group of its own, which ends with the process that began it:
    Ctrl-C in a terminal reaches the latter alone."""
    os.setpgrp()
    os.environ.update(ONE_THREAD)

    def follow():
        connection.wait([parent_process().sentinel])
        os.killpg(0, SIGKILL)

    threading.Thread(target=follow, daemon=True).start()
