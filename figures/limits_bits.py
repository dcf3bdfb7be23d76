"""A run repeats to the last bit; another order of operations changes its last digits."""

from __future__ import annotations

import os
from contextlib import contextmanager

import numpy as np

from figures._limits import grid, prism_chain, stepped
from tensegrity import Record, State, simulate
from tensegrity.engine.threaded import LONG, processors
from tensegrity.scenes.dynamics import dynamics

NAME = "limits_bits"
GROUP = "limits"

SITES = LONG + 1234  # long enough to be divided among threads
SHORT = 64  # for the comparison with NumPy
DT, LOOKS = 0.1, 13
T_END, T_SHORT = 24.0, 240.0
SPEED = 0.02
THREADS = tuple(range(1, min(processors(), 3) + 1))


@contextmanager
def on_threads(count):
    """Run long chains on the given number of threads."""
    before = os.environ.get("TENSEGRITY_THREADS")
    os.environ["TENSEGRITY_THREADS"] = str(count)
    try:
        yield
    finally:
        del os.environ["TENSEGRITY_THREADS"]
        if before is not None:
            os.environ["TENSEGRITY_THREADS"] = before


def start(sites):
    """Random velocities everywhere."""
    chain = prism_chain(sites)
    v = SPEED * np.random.default_rng(3).uniform(-1, 1, sites)
    return chain, State(np.zeros(sites), v - v.mean())


def run(chain, state, t_end, looks=LOOKS):
    """Rows of u and v at evenly spaced instants."""
    every = round(t_end / DT) // (looks - 1)
    found = simulate(chain, state, t_end, dt=DT, method="rkn6", record=Record(every=every))
    return found.t, np.stack([found.u, found.v])


def in_numpy(chain, state, t_end):
    """The same rows from the same steps in NumPy."""
    rows = [np.stack([state.u, state.v])]
    for _ in range(LOOKS - 1):
        steps = round(t_end / DT) // (LOOKS - 1)
        found = stepped(
            lambda u: chain.forces(u) * dynamics(chain).inverse_mass, *rows[-1], "rkn6", DT, steps
        )
        rows.append(np.stack(found))
    return np.stack(rows, axis=1)


def one_bit(state):
    """The state with the last bit of the largest velocity changed, lest it be rounded away."""
    v = state.v.copy()
    largest = int(np.argmax(np.abs(v)))
    v[largest] = np.nextafter(v[largest], 0.0)
    return State(state.u, v)


def differing(one, other):
    """Numbers of u and v that are not equal bit for bit, in all rows."""
    return int((one.view(np.int64) != other.view(np.int64)).sum())


def data():
    """Numbers that differ from the first run, and by how much, against time."""
    chain, state = start(SITES)
    _, first = run(chain, state, T_END)
    changes = {"repeated": run(chain, state, T_END)[1]}
    for count in THREADS:
        with on_threads(count):
            changes[f"on {count} thread{'s' * (count > 1)}"] = run(chain, state, T_END)[1]
    counts = [differing(first, rows) for rows in changes.values()]
    chain, state = start(SHORT)
    t, short = run(chain, state, T_SHORT)
    rows = {
        "repeated": run(chain, state, T_SHORT)[1],
        "recorded twice as often": run(chain, state, T_SHORT, 2 * LOOKS - 1)[1][:, ::2],
        "in NumPy": in_numpy(chain, state, T_SHORT),
        "last bit of one velocity changed": run(chain, one_bit(state), T_SHORT)[1],
    }
    scale = np.abs(short).max(axis=(1, 2), keepdims=True)
    apart = {name: np.abs((r - short) / scale).max(axis=(0, 2)) for name, r in rows.items()}
    return {
        "bits": {
            "run": list(changes),
            "numbers compared": [first.size] * len(changes),
            "numbers that differ": counts,
        },
        "apart": {"time [s]": t, **apart},
    }


def text(tables):
    """The section of the page."""
    bits, apart = tables["bits"], tables["apart"]
    named = ["on any number of threads" if "thread" in name else name for name in bits["run"]]
    worst = {}  # a machine may have any number of processors
    for name, count in zip(named, bits["numbers that differ"], strict=True):
        worst[name] = max(count, worst.get(name, 0))
    total = bits["numbers compared"][0]
    rows = [
        [f"{SITES} sites, {name}", f"{count} of {total} numbers in any bit"]
        for name, count in worst.items()
    ]
    for name, values in apart.items():
        if name != "time [s]":
            result = f"{values[-1]:.0e} after {T_SHORT:g} s" if np.any(values) else "in no bit"
            rows.append([f"{SHORT} sites, {name}", result])
    return (
        "On one machine and build a run repeats to the last bit, on any number of threads and "
        "however densely it is recorded. The last digits change with the order of operations, "
        "and the difference grows from 1e-16. Compare runs bit for bit only on one "
        f"machine and build.\n\n{grid(['run', 'differs from the first, relative'], rows)}"
    )


def draw(figure, tables):
    """Differences against time where there are any; the others, and large chains, in words."""
    figure.set_size_inches(8, 4.8)
    axes, bits, apart = figure.subplots(), tables["bits"], tables["apart"]
    t, equal = apart["time [s]"][1:], []
    for name, size in apart.items():
        if name != "time [s]" and np.any(size):
            axes.semilogy(t, size[1:], "o-", ms=3, lw=1, label=name)
        elif name != "time [s]":
            equal.append(name)
    lines = [f"{SITES} sites, {name}: {count} of {total} numbers differ"
             for name, total, count in zip(*bits.values(), strict=True)]  # fmt: skip
    words = "\n".join([f"{SHORT} sites, {' or '.join(equal)}: equal in every bit", *lines])
    axes.text(0.98, 0.04, words, fontsize=9, ha="right", transform=axes.transAxes)
    for line, place in zip(axes.lines, ((0.03, 0.93), (0.03, 0.86)), strict=False):
        axes.text(*place, f"{SHORT} sites, {line.get_label()}", color=line.get_color(),
                  transform=axes.transAxes)  # fmt: skip
    low, high = axes.get_ylim()
    axes.set(
        xlabel="time [s]", ylabel="largest difference from the first run, relative",
        title="Runs repeat to the last bit; other arithmetic drifts away from 1e-16",
        ylim=(low / 300, 30 * high),
    )  # fmt: skip
