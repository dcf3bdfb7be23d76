"""Interleaved timing: all rivals in turn, several rounds, the best of each."""

from __future__ import annotations

import time

ROUNDS = 7


def best(rivals, rounds=ROUNDS):
    """Smallest time of each rival [s]; {name: callable} -> {name: seconds}.

    Each is called once before, so that compilation and cold caches do not count.
    """
    for call in rivals.values():
        call()
    times = dict.fromkeys(rivals, float("inf"))
    for _ in range(rounds):
        for name, call in rivals.items():
            started = time.perf_counter()
            call()
            times[name] = min(times[name], time.perf_counter() - started)
    return times


def table(title, columns, rows):
    """Print rows of text and numbers under a title."""
    print(f"\n{title}")
    print("".join(f"{c:>{28 if i == 0 else 12}}" for i, c in enumerate(columns)))
    for row in rows:
        cells = (f"{x:>12}" if isinstance(x, str) else f"{x:>12.3g}" for x in row[1:])
        print(f"{row[0]:>28}" + "".join(cells))
