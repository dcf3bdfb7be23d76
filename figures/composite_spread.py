"""The reflected rarefaction is the same in every draw, the transmitted train is not.

The far chain is so nonlinear that the transmitted pulses depend chaotically on the input: a change
of the input by 1e-6 changes their number, while the reflected rarefaction persists.  The
first interface is therefore followed many times, with the incident peak, a stiffness of each prism
and the preload changed at random, and reported as a distribution.
"""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor

import numpy as np

from figures import _composite
from figures._composite import FOUND, NAMES
from figures._stored import stored
from tensegrity import TensegrityError, sweep

NAME = "composite_spread"
GROUP = "composite"

CHANGED = ("peak", "k_bar near", "k_cross far", "preload")
SIZES = (1e-6, 1e-3, 1e-2)  # relative changes, uniform up to these on both sides
DRAWS, SEED = 14, 0  # of each size
QUANTITIES = ("reflected rarefactions", "reflected compressions", "transmitted rarefactions",
              "transmitted compressions")  # fmt: skip


def cases():
    """(largest change, parameters) of every draw; the first is exact."""
    rng = np.random.default_rng(SEED)
    named = dict(zip(NAMES, next(iter(FOUND.values())), strict=True))
    found = [(0.0, named)]
    for size in SIZES:
        for factor in 1 + size * rng.uniform(-1, 1, (DRAWS, len(CHANGED))):
            changed = {k: named[k] * f for k, f in zip(CHANGED, factor, strict=True)}
            found.append((size, {**named, **changed}))
    return found


def followed(case):
    """Number, and fraction of the incident energy, of each kind of solitary wave; the delay of the
    second transmitted compression behind the first in sites; nan where a run left its range."""
    real = _composite.made(case[1])
    try:
        one = _composite.outcome(real, _composite.duration(real))
    except TensegrityError:
        return [np.nan] * (2 * len(QUANTITIES) + 1)
    energy, answer = one.incident.energy, one.fine
    numbers = []
    for several in (answer.back, answer.pressed, answer.leading, answer.train):
        mine = [x.energy / energy for x in several if x.is_solitary(energy)]
        numbers += [len(mine), sum(mine)]
    places = sorted((x.place for x in answer.train if x.is_solitary(energy)), reverse=True)
    return [*numbers, places[0] - places[1] if len(places) > 1 else np.nan]


@stored("composite_spread")
def data():
    """A line for each draw."""
    drawn = cases()
    with ProcessPoolExecutor(1) as pool:
        found = np.array(sweep(followed, drawn, executor=pool), dtype=float)
    columns = {"largest change": np.array([size for size, _ in drawn])}
    for k, what in enumerate(QUANTITIES):
        columns[what] = found[:, 2 * k]
        columns[f"energy of {what}"] = found[:, 2 * k + 1]
    columns["sites between the first two"] = found[:, -1]
    return {"draws": columns}


def spread(tables, size):
    """Rows of draws with changes up to a size that were completed."""
    one = tables["draws"]
    some = (one["largest change"] == size) & np.isfinite(one["energy of reflected rarefactions"])
    return {k: np.asarray(x)[some] for k, x in one.items()}


def table(tables):
    """Ranges of the reflected energies, and how often there is a train, for each size."""
    lines = []
    for size in SIZES:
        one = spread(tables, size)
        train = one["transmitted compressions"]
        both = [one[f"energy of {what}"] for what in QUANTITIES]
        delay = one["sites between the first two"]
        lines.append({
            "what": f"changes up to {size:g}", "draws": len(train),
            "reflected rarefaction": f"{both[0].min():.4f} to {both[0].max():.4f}",
            "reflected compressions": f"{both[1].min():.4f} to {both[1].max():.4f}",
            "transmitted rarefactions": f"{both[2].min():.4f} to {both[2].max():.4f}",
            "transmitted compressions": f"{both[3].min():.4f} to {both[3].max():.4f}",
            "two or more of these in": f"{np.sum(train >= _composite.TRAIN)} of {len(train)}",
            "sites between two": f"{np.nanmin(delay):.0f} to {np.nanmax(delay):.0f}"
            if np.isfinite(delay).any() else "",
        })  # fmt: skip
    return lines


def draw(figure, tables):
    """Energies of each draw over the size of the changes."""
    figure.set_size_inches(9, 4.4)
    left, right = figure.subplots(1, 2)
    for k, size in enumerate(SIZES):
        one = spread(tables, size)
        across = k + np.linspace(-0.25, 0.25, len(one["largest change"]))
        left.plot(across, one["energy of reflected rarefactions"], "C0o", ms=4)
        right.plot(across, one["transmitted compressions"], "C3o", ms=4)
    left.set(ylabel="energy / incident energy", ylim=(0, 0.35))
    left.set_title("(a) the reflected rarefaction stays", loc="left")
    right.set(ylabel="solitary compressions", ylim=(-0.1, 3), yticks=range(4))
    right.set_title("(b) the number of transmitted pulses does not", loc="left")
    for axes in (left, right):
        axes.set_xticks(range(len(SIZES)), [f"{size:g}" for size in SIZES])
        axes.set_xlabel("largest relative change of peak, stiffnesses, preload")
