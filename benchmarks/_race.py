"""Interleaved runs of several programs, with tables and a chart of times and errors.

A contestant is a name and its runs, each with its setting; rows are (name, setting, error, least
seconds, seconds to compile).
"""

from __future__ import annotations

import math
import time

import numpy as np

from benchmarks._charts import FOLDER, charted
from benchmarks._timing import table
from benchmarks.methods import LEVELS, gap
from tensegrity import METHODS

CALL = "simulate"
ROUNDS = 5
LONG = 0.3  # a run of more seconds is done twice only
SLOWEST = 2.5  # seconds; finer runs of a contestant are left out behind such a one
BARE = "the loop alone, best of all methods"
LINES = {  # in the chart
    CALL: {"label": "the call, simulate(tol=...)", "color": "C0", "marker": "o", "lw": 2.2},
    BARE: {"label": BARE, "color": "C0", "lw": 0.8},
    f"{BARE} +p": {"label": "the same, forces as polynomials", "color": "C0", "ls": ":", "lw": 0.8},
}
OTHERS = "sv^D*Xp"  # markers of peers


def race(entries, exact, rounds=ROUNDS):
    """Rows (name, setting, error, least seconds, seconds to compile), all taking turns."""
    entries, errors, times = list(entries), {}, {}
    for number in range(rounds):
        slow = set()
        for k, entry in enumerate(entries):
            if entry.name in slow or (k in errors and errors[k] is None):
                errors[k] = None
                continue
            if number > 1 and times[k][0] > LONG:
                continue
            try:
                run = entry.prepare()
                began = time.process_time()
                found = run()
                took = time.process_time() - began
            except Exception as error:  # whatever a peer raises at what it cannot do
                print(f"{entry.name}, {entry.setting}: {type(error).__name__}: {error}")
                errors[k] = None
                continue
            if number == 0:
                errors[k] = gap(found, exact)
                found = None
            times.setdefault(k, []).append(took)
            if took > SLOWEST:
                slow.add(entry.name)
    return [
        (e.name, e.setting, errors[k], min(times[k]), e.compiled)
        for k, e in enumerate(entries)
        if errors[k] is not None and np.isfinite(errors[k])
    ]


def seconds(rows, start, level):
    """Least time of contestants for an error, between two of their runs along a power law."""
    best = np.inf
    for name in {row[0] for row in rows if row[0].startswith(start)}:
        points = sorted((row[3], row[2]) for row in rows if row[0] == name)
        for k, (t, error) in enumerate(points):
            if error <= level:
                best = min(best, t)
                if k and points[k - 1][1] > level:
                    (t0, e0), ratio = points[k - 1], math.log(points[k - 1][1] / max(error, 1e-18))
                    best = min(best, t0 * (t / t0) ** (math.log(e0 / level) / ratio))
                break
    return best


def front(rows, mark):
    """The Pareto front of times and errors of our loops; `mark` ends their names."""
    mine = {f"{name}{mark}" for name in METHODS}
    found = []
    for seconds, error in sorted((row[3], row[2]) for row in rows if row[0] in mine):
        if not found or error < found[-1][1]:
            found.append((seconds, error))
    return found


def shown(rows):
    """{name: points (seconds, error)} that the chart shows for a scene: ours, then others."""
    found = {CALL: [], BARE: front(rows, ""), f"{BARE} +p": front(rows, " +p")}
    for name, _, error, seconds, _ in rows:
        if name.removesuffix(" +p") not in METHODS:
            found.setdefault(name, []).append((seconds, error))
    return {name: points for name, points in found.items() if points}


def chart(found, folder=FOLDER):
    """Time against error, a panel for each scene, as PNG and CSV; the files written."""
    rows = [(scene, *row) for scene, several in found.items() for row in several]
    names = ("scene", "contestant", "setting", "error", "seconds", "compile_seconds")
    drawn = {scene: shown(several) for scene, several in found.items()}
    every = dict.fromkeys(name for points in drawn.values() for name in points)
    others = [name for name in every if name not in LINES]
    lines = LINES | {
        name: {"label": name, "color": f"C{1 + k}", "marker": OTHERS[k % len(OTHERS)], "lw": 1.3}
        for k, name in enumerate(others)
    }
    with charted("work_precision", folder, names, rows, figsize=(9, 6.5)) as (figure, written):
        panels = figure.subplots(2, -(-len(found) // 2), sharex=True, squeeze=False).ravel()
        handles = {}
        for axes, several in zip(panels, drawn.values(), strict=False):
            for name, points in several.items():
                seconds, errors = zip(*points, strict=True)
                errors = np.maximum(errors, 1e-15)
                (handles[name],) = axes.loglog(errors, seconds, ms=4, **lines[name])
            axes.set(xlim=(1, 1e-15), xticks=10.0 ** np.arange(-15, 1, 5))
            axes.minorticks_off()
        for axes in panels[len(found) :]:
            axes.set_visible(False)
        for letter, axes, scene in zip("abcdef", panels, drawn, strict=False):
            axes.set_title(f"({letter}) {scene}", fontsize=11)
        panels[0].annotate("better", (0.95, 0.08), (0.6, 0.32), xycoords="axes fraction",
                           arrowprops={"arrowstyle": "->"})  # fmt: skip
        figure.supxlabel("error of the last state, relative: smaller to the right", fontsize=10)
        figure.supylabel("processor time of a run [s]", fontsize=10)
        ordered = [handles[name] for name in lines if name in handles]
        figure.legend(handles=ordered, loc="outside lower center", ncols=3, fontsize=9)
    return written


def ratios(rows, theirs, mine=tuple(METHODS)):
    """Their least time over ours at each error."""
    least = [min(seconds(rows, name, level) for name in mine) for level in LEVELS]
    return [
        seconds(rows, theirs, level) / t if np.isfinite(t) else np.nan
        for level, t in zip(LEVELS, least, strict=True)
    ]


def show(title, rows):
    """Print times at equal error, and those of others over our least."""
    heads = ["", *(f"{level:.0e}" for level in LEVELS)]
    contestants = list(dict.fromkeys(row[0] for row in rows))
    others = [c for c in contestants if c.removesuffix(" +p") not in METHODS]
    alone = {c: [row for row in rows if row[0] == c] for c in contestants}
    times = [(c, *(1e3 * seconds(alone[c], c, x) for x in LEVELS)) for c in contestants]
    table(f"{title}: milliseconds at equal error", heads, map(_dashed, times))
    cells = [(c, *ratios(rows, c)) for c in others]
    table(f"{title}: times ours", heads, map(_dashed, cells))


def _dashed(row):
    return row[0], *(x if np.isfinite(x) else "-" for x in row[1:])
