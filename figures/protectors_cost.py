"""Computing cost of a sweep over a million protectors, on one machine and on a cluster."""

from __future__ import annotations

import os
import pickle
import time
from concurrent.futures import ProcessPoolExecutor

import numpy as np

from figures import _pack
from figures import _protectors as common
from granular.design import objective

NAME = "protectors_cost"
GROUP = "protectors"

DESIGNS = 1_000_000
WORKERS = np.unique(np.round(np.logspace(0, 4, 81)).astype(int))
TOLD = (1, 2, 16, 256, 4096)
PARTS = (1, 16, 256)  # designs of a message
MESSAGES, LANES, ROUNDS = 100, 64, 3
HOP = 200e-6  # s: assumed extra cost of a message between machines


def answered(case):
    """What a worker sends back for a part, without the work."""
    return np.zeros(len(case))


def message_cost(rows):
    """Seconds of a message there and back, by its designs; bytes of one."""
    with ProcessPoolExecutor(1) as pool:
        pool.submit(answered, rows).result()
        seconds = []
        for part in PARTS:
            case = np.resize(rows, (part, rows.shape[1]))
            each = []
            for _ in range(MESSAGES):
                began = time.perf_counter()
                pool.submit(answered, case).result()
                each.append(time.perf_counter() - began)
            seconds.append(float(np.median(each)))
    return seconds, [len(pickle.dumps(np.resize(rows, (p, rows.shape[1])))) for p in PARTS]


def design_cost(name):
    """CPU seconds of one design of a scene, with the steps of a search."""
    scene = common.SCENES[name]
    unit = float(scene.space.all_kinds.unit(common.STEEL, common.STRIKER.speed)[0])
    steps = objective.step_count(unit, scene.t_end, 2 * objective.STEP_FRACTION * unit)
    rows = scene.space.designs(scene.space.random(np.random.default_rng(0), LANES))
    return least(lambda: objective.largest(
        rows, common.STRIKER, common.STEEL, scene.t_end, steps
    )) / LANES  # fmt: skip


def pack_cost():
    """CPU seconds of one pack in the plane."""
    beads = _pack.COMPARED["alternating rows, steel on top"]
    return least(lambda: _pack.peak(beads, 4 * _pack.FINE))


def least(call):
    """Least CPU seconds of a call in some rounds, after a first one."""
    call()
    seconds = []
    for _ in range(ROUNDS):
        began = time.process_time()
        call()
        seconds.append(time.process_time() - began)
    return min(seconds)


def hours(cost, message, part, workers):
    """Of a million designs: the workers share the work, one process sends all messages."""
    work = DESIGNS * cost / workers + DESIGNS / part * (message + HOP) / workers
    sending = DESIGNS / part * message
    return np.maximum(work, sending) / 3600


def data():
    """Measured costs, and hours against workers."""
    costs = {name: design_cost(name) for name in common.SCENES} | {"pack": pack_cost()}
    rows = common.SCENES["T1"].space.random(np.random.default_rng(0), 16)
    seconds, sizes = message_cost(rows)
    tables = {
        "designs": {"scene": list(costs), "cost [s]": list(costs.values())},
        "messages": {"designs": PARTS, "there and back [s]": seconds, "size [bytes]": sizes},
    }
    for name, cost in costs.items():
        columns = {"workers": WORKERS}
        for part, message in zip(PARTS, seconds, strict=True):
            columns[f"parts of {part} [h]"] = hours(cost, message, part, WORKERS)
        tables[f"{name} hours"] = columns
    return tables


def draw(figure, tables):
    """Hours against workers, for parts of one size each."""
    figure.set_size_inches(11, 5)
    for axes, part in zip(figure.subplots(1, 2, sharey=True), (1, 16), strict=True):
        for name in tables["designs"]["scene"]:
            one = tables[f"{name} hours"]
            axes.loglog(one["workers"], one[f"parts of {part} [h]"], label=name)
        noun = "design" if part == 1 else "designs"
        axes.set(xlabel="workers", title=f"{part} {noun} a message")
        axes.legend(fontsize=8)
    figure.axes[0].set_ylabel("hours for a million designs")
    figure.axes[0].yaxis.set_major_formatter("{x:g}")


def text(tables):
    """Costs and hours in words."""
    lines = ["| scene | ms a design, one core | designs a second |", "|---|---|---|"]
    costs = dict(zip(*tables["designs"].values(), strict=True))
    lines += [f"| {n} | {1e3 * c:.3g} | {1 / c:.3g} |" for n, c in costs.items()]
    lines += ["", "| designs a message | there and back [us] | size [kB] |", "|---|---|---|"]
    rows = zip(*tables["messages"].values(), strict=True)
    lines += [f"| {p} | {1e6 * s:.3g} | {b / 1e3:.3g} |" for p, s, b in rows]
    lines += [
        "", f"Hours for {DESIGNS:,} designs, 16 a message (packs: 1); a message between machines "
        f"is taken to cost {1e6 * HOP:g} us more than one between processes here, which was "
        "measured; all are sent by one process, which bounds what many workers gain:",
        "", "| scene | " + " | ".join(f"{n} workers" for n in TOLD) + " |",
        "|---" * (len(TOLD) + 1) + "|",
    ]  # fmt: skip
    seconds = dict(zip(tables["messages"]["designs"], tables["messages"]["there and back [s]"],
                       strict=True))  # fmt: skip
    for name, cost in costs.items():
        part = 1 if name == "pack" else 16
        cells = (f"{float(hours(cost, seconds[part], part, n)):.3g}" for n in TOLD)
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    lines += [
        "", f"Costs were measured on a machine of {os.cpu_count()} processors, which was "
        "not otherwise idle.  An interrupted sweep resumes from its checkpoint; on a cluster "
        "`executor=` is `dask.distributed.Client(...).get_executor()` or "
        "`mpi4py.futures.MPIPoolExecutor()`.",
    ]  # fmt: skip
    return "\n".join(lines)
