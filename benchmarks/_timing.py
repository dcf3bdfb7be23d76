"""Interleaved timing: all programs in turn, several rounds, the best of each; and tables."""

from __future__ import annotations

import math
import re
import time

ROUNDS = 7
RATIOS = {}  # {"table/row/column": our time over that of another in the same run}


def best(rivals, rounds=ROUNDS, clock=time.perf_counter):
    """Smallest time of each rival by a clock [s]; {name: callable} -> {name: seconds}.

    Each is called once before, so that compilation and cold caches do not count.
    """
    for call in rivals.values():
        call()
    times = dict.fromkeys(rivals, float("inf"))
    for _ in range(rounds):
        for name, call in rivals.items():
            started = clock()
            call()
            times[name] = min(times[name], clock() - started)
    return times


def cpu(rivals, rounds=ROUNDS):
    """As `best`, in CPU time of this process."""
    return best(rivals, rounds, time.process_time)


def least(call, rounds=2):
    """Smallest CPU time of a call alone [s], and what the last one returned."""
    times = []
    for _ in range(rounds):
        started = time.process_time()
        result = call()
        times.append(time.process_time() - started)
    return min(times), result


def record(table, row, column, ours, theirs):
    """Record a ratio for `python -m benchmarks --save`; smaller is better, no absolute times.

    The table's name ends before a comma or a bracket, beyond which titles say what was measured.
    """
    if math.isfinite(ours / theirs):
        RATIOS[f"{re.split(r', | [(]', table)[0]}/{row}/{column}"] = float(ours / theirs)


def table(title, columns, rows, ours=(), theirs=()):
    """Print rows of text and numbers under a title.

    Columns named in `ours` hold our times over those of others, in `theirs` the inverse: recorded.
    """
    print(f"\n{title}")
    print("".join(f"{c:>{28 if i == 0 else 12}}" for i, c in enumerate(columns)))
    for row in rows:
        cells = (f"{x:>12}" if isinstance(x, str) else f"{x:>12.3g}" for x in row[1:])
        print(f"{row[0]:>28}" + "".join(cells))
        for column in (*ours, *theirs):
            x = row[columns.index(column)]
            if not isinstance(x, str):
                record(title, row[0], column, *((x, 1.0) if column in ours else (1.0, x)))
