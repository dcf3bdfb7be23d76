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
from cycler import cycler

from figures import _stored
from figures._files import write, write_tables
from figures._gallery import title

CURVES = ("#1a85d6", "#dd5f0f", "#14503f", "#b3669a", "#7d3a00", "#3c0a66")
"""Colours of curves: apart also for the colour-blind, and dark enough on white."""
STYLE = {
    "axes.prop_cycle": cycler(color=CURVES),
    "figure.figsize": (8, 4.5),
    "figure.dpi": 110,
    "axes.grid": True,
    "axes.titlesize": 10,
    "grid.alpha": 0.25,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "font.size": 10,
    "figure.titlesize": 11,
}
ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "TENSEGRITY_THREADS": "1", "TQDM_DISABLE": "1"}
PRELOADED = ["figures.__main__", "figures._measure", "granular", "matplotlib.pyplot"]


def render(name, module, folder):
    """Compute and draw one picture with all its files; returns its lines of the group's table."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    tables = module.data()
    lines = list(module.table(tables)) if hasattr(module, "table") else []
    write_tables(folder / f"{name}.csv", tables, lines)
    with plt.rc_context(STYLE):
        write(folder / f"{name}.png", pictured(module, tables).savefig)
        if hasattr(module, "animate"):
            write(folder / f"{name}.gif", lambda beside: module.animate(tables, beside))
        plt.close("all")
    if hasattr(module, "text"):
        head = title(module)
        section = f"## {head}\n\n![{head}]({name}.png)\n\n{module.text(tables)}\n"
        write(folder / f"{name}.md", lambda beside: Path(beside).write_text(section))
    return lines


def pictured(module, tables):
    """The figure of a picture, with its title, and letters at its panels."""
    import matplotlib.pyplot as plt

    figure = plt.figure(layout="constrained")
    module.draw(figure, tables)
    several = panels(figure)
    if not figure.get_suptitle() and not (len(several) == 1 and several[0].get_title()):
        figure.suptitle(title(module))
    for k, axes in enumerate(several if len(several) > 1 else ()):
        titles = [axes.get_title(loc=where) for where in ("left", "center", "right")]
        if not any(words.startswith("(") for words in titles):
            where = "left" if titles[0] else "center"
            words = f"({chr(ord('a') + k)}) {titles[0] or titles[1]}".strip()
            axes.set_title(words, loc=where, fontsize=axes.title.get_fontsize())
    return figure


def panels(figure):
    """Axes that are panels: no colour bars, and one of several at the same place."""
    found = {}
    for axes in figure.axes:
        if axes.get_label() != "<colorbar>" and axes.get_visible():
            place = axes.get_subplotspec()
            at = id(axes) if place is None else (id(place.get_gridspec()), place.num1)
            found.setdefault(at, axes)
    return list(found.values())


def note(axes, words, place, shift=(0, 0), *, inside=False, **style):
    """Write words at a place in the data, or where `inside` in fractions of the axes, shifted by
    some points."""
    where = "axes fraction" if inside else "data"
    axes.annotate(words, place, shift, xycoords=where, textcoords="offset points", **style)


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
        shift = -6 if is_first else 6, (last - ends[k][1]) / scale
        how = {"ha": "right" if is_first else "left", "color": lines[k].get_color()}
        words = lines[k].get_label()
        note(axes, words, places[k], shift, va="center", fontsize=9, annotation_clip=False, **how)


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
    lines = render(job.name, module, folder)
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
    os.environ.update(ONE_THREAD)
    context = get_context("forkserver")  # which imports once what all pictures need
    context.set_forkserver_preload(PRELOADED)
    with ProcessPoolExecutor(processes, context, begin) as pool:
        try:
            futures = {pool.submit(function, case): case for case in cases}
            for future in as_completed(futures):
                yield futures[future], future.exception() or future.result()
        except BaseException:
            for child in active_children():
                child.kill()
                with suppress(ProcessLookupError):
                    os.killpg(child.pid, SIGKILL)
            raise  # the pool waits for the processes: two threads that do get in each other's way


def begin():
    """Make a process the first of a group of its own, which ends with the process that began it:
    Ctrl-C in a terminal reaches the latter alone."""
    os.setpgrp()

    def follow():
        connection.wait([parent_process().sentinel])
        os.killpg(0, SIGKILL)

    threading.Thread(target=follow, daemon=True).start()
