"""The reflected rarefaction is the same in every draw, the transmitted train is not.

The far chain is so nonlinear that the transmitted pulses depend chaotically on the input: a change
of the input by 1e-6 changes their number, while the reflected rarefaction persists.  The
first interface is therefore followed many times, with the incident peak, a stiffness of each prism
and the preload changed at random, and reported as a distribution.
"""

from concurrent.futures import ProcessPoolExecutor

import numpy as np

from figures._composite import FOUND, KINDS, NAMES, followed, made, solitary
from figures._stored import stored
from tensegrity import TensegrityError, sweep

NAME = "composite_spread"
GROUP = "composite"

CHANGED = [NAMES.index(name) for name in ("peak", "k_bar near", "k_cross far", "preload")]
SIZES = (1e-6, 1e-3, 1e-2)  # relative changes, uniform up to these on both sides
DRAWS, SEED = 14, 0  # of each size


def cases():
    """(largest change, parameters) of every draw; the first is exact."""
    rng = np.random.default_rng(SEED)
    exact = np.array(next(iter(FOUND.values())))
    found = [(0.0, exact)]
    for size in SIZES:
        for factors in 1 + size * rng.uniform(-1, 1, (DRAWS, len(CHANGED))):
            changed = exact.copy()
            changed[CHANGED] *= factors
            found.append((size, changed))
    return found


def counted(case):
    """Number, and fraction of the incident energy, of each kind of solitary wave; the sites between
    the first two transmitted compressions; nan where a run left its range."""
    try:
        _, (_, found) = followed(made(case[1]))
    except TensegrityError:
        return [np.nan] * (2 * len(KINDS) + 1)
    rows, numbers = solitary(found), []
    for kind in KINDS:
        mine = [row["energy"] for row in rows if row["kind"] == kind]
        numbers += [len(mine), sum(mine)]
    places = sorted((row["place"] for row in rows if row["kind"] == KINDS[-1]), reverse=True)
    return [*numbers, places[0] - places[1] if len(places) > 1 else np.nan]


@stored("composite_spread")
def data():
    """A line for each draw."""
    drawn = cases()
    with ProcessPoolExecutor(1) as pool:
        found = np.array(sweep(counted, drawn, executor=pool), dtype=float)
    names = [name for kind in KINDS for name in (kind, f"energy of {kind}")]
    columns = dict(zip([*names, "sites between the first two"], found.T, strict=True))
    return {"draws": {"largest change": np.array([size for size, _ in drawn]), **columns}}


def spread(tables, size):
    """Rows of draws with changes up to a size that were completed."""
    one = tables["draws"]
    some = (one["largest change"] == size) & np.isfinite(one["energy of reflected rarefactions"])
    return {k: np.asarray(x)[some] for k, x in one.items()}


def table(tables):
    """Ranges of the energies, and how often there is a train, for each size."""
    lines = []
    for size in SIZES:
        one = spread(tables, size)
        train, delay = one["transmitted compressions"], one["sites between the first two"]
        energies = {kind: one[f"energy of {kind}"] for kind in KINDS}
        lines.append({
            "what": f"changes up to {size:g}", "draws": len(train),
            **{kind: f"{x.min():.4f} to {x.max():.4f}" for kind, x in energies.items()},
            "two or more of these in": f"{np.sum(train >= 2)} of {len(train)}",
            "sites between two": f"{np.nanmin(delay):.0f} to {np.nanmax(delay):.0f}",
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
    left.set(
        ylabel="energy / incident energy", ylim=(0, 0.35), title="the reflected rarefaction stays"
    )
    right.set(ylabel="solitary compressions", ylim=(-0.1, 3.2), yticks=range(4),
              title="the number of transmitted pulses does not")  # fmt: skip
    for axes in (left, right):
        axes.set_xticks(range(len(SIZES)), [f"{size:g}" for size in SIZES])
        axes.set_xlabel("largest relative change of peak, stiffnesses, preload")
