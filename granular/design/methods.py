"""Search methods: each proposes rows of genes and is told what they are worth.

A method is a generator: it yields rows (n, count) and is sent their forces (n,), the less the
better.  All that it does follows from the space, the random numbers it is given and what it is
told; so a search that was broken off goes on by telling it again.  It may propose what it did
before, which costs nothing, and may end.

The genetic method moves orders and choices by steps of our own.  The covariance matrix adaptation
of diameters, of random keys for orders, and its form for categories are those of `cmaes`
(N. Hansen, arXiv:1604.00772; R. Hamano et al., arXiv:2504.07884).
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from granular.design.spaces import Choice, Order, Sizes, Space, moved
from tensegrity import TensegrityError, check

if TYPE_CHECKING:
    from tensegrity.typing import Array, Indices

Proposals = Generator[Any, Any, None]

POPULATION = 64
PAIRS = 2  # individuals that a parent is the best of
MUTATIONS = 0.5  # chance that a child is changed no more
TRIES = 20  # times that a full population is asked for individuals that were not there before
STALE = 15  # populations without a better design, after which a method starts anew
STARTS = 8  # from which one goes downhill before any is heard of
HOPS = 4  # of these, from near the lowest places
LOWEST = 6  # of which there are so many
JUMP = 0.15  # of the range of a diameter
APART = 0.1  # of the range: what two of them differ by, in some diameter
SIGMA = 0.3  # of the range of a gene, at the start of an adaptation


def genetic(space: Order | Choice, rng: np.random.Generator) -> Proposals:
    """Parents and children compete, by rank; no design is proposed twice."""
    seen: set[bytes] = set()

    def new(make: Callable[[], Indices]) -> Indices:
        found: list[Indices] = []
        for _ in range(TRIES):
            for row in make():
                if len(found) < POPULATION and (key := row.tobytes()) not in seen:
                    seen.add(key)
                    found.append(row)
            if len(found) == POPULATION:
                break
        return np.array(found)

    while len(first := new(lambda: space.random(rng, POPULATION))):
        rows, forces = first, (yield first)
        stale = 0
        while stale < STALE:
            made = new(partial(_children, space, rng, *_ranked(rows, forces)))
            if not len(made):
                break
            values = yield made
            stale = 0 if values.min() < forces.min() else stale + 1
            rows, forces = _ranked(np.concatenate([rows, made]), np.append(forces, values))
            rows, forces = rows[:POPULATION], forces[:POPULATION]


def _ranked(rows: Indices, forces: Array) -> tuple[Indices, Array]:
    """The best first."""
    order = np.argsort(forces, kind="stable")
    return rows[order], forces[order]


def _children(
    space: Order | Choice, rng: np.random.Generator, rows: Indices, forces: Array
) -> Indices:
    """Changed children of parents, the better of `PAIRS` each; the best rows come first."""
    picks = rng.integers(len(rows), size=(2, POPULATION, PAIRS)).min(axis=-1)
    made = space.children(rng, *rows[picks])
    changed = np.arange(len(made))
    while len(changed):
        made[changed] = space.mutants(rng, made[changed])
        changed = changed[rng.random(len(changed)) > MUTATIONS]
    return made


def adapting(space: Order | Sizes, rng: np.random.Generator) -> Proposals:
    """A normal distribution of diameters, projected to the length, or of random keys."""
    from cmaes import CMA

    low, high = space.diameters if isinstance(space, Sizes) else (0.0, 1.0)
    bounds = np.tile([0.0, 1.0], (space.count, 1))
    while True:
        start = rng.uniform(0.3, 0.7, space.count)
        optimizer = CMA(start, SIGMA, bounds, seed=_seed(rng), population_size=POPULATION)
        stale, best = 0, np.inf
        while stale < STALE and not optimizer.should_stop():
            asked = np.array([optimizer.ask() for _ in range(POPULATION)])
            genes = low + (high - low) * asked
            rows = space.projected(genes) if isinstance(space, Sizes) else space.from_keys(genes)
            values = yield rows
            told = (rows - low) / (high - low) if isinstance(space, Sizes) else asked
            optimizer.tell(list(zip(told, _finite(values), strict=True)))
            stale = 0 if values.min() < best else stale + 1
            best = min(best, values.min())


def categorical(space: Order | Choice, rng: np.random.Generator) -> Proposals:
    """A distribution of kinds for each bead; rows of an order are repaired to its beads."""
    from cmaes import CatCMAwM

    kinds = len(space.kinds)
    while True:
        optimizer = CatCMAwM(
            c_space=[kinds] * space.count, population_size=POPULATION, seed=_seed(rng)
        )
        stale, best = 0, np.inf
        while stale < STALE:
            asked = [optimizer.ask() for _ in range(POPULATION)]
            rows = np.array([one.c.argmax(axis=1) for one in asked])
            if isinstance(space, Order):
                rows = np.array([space.repaired(rng, row) for row in rows])
            values = yield rows
            optimizer.tell(list(zip(asked, _finite(values), strict=True)))
            stale = 0 if values.min() < best else stale + 1
            best = min(best, values.min())


def starting(space: Sizes, rng: np.random.Generator) -> Proposals:
    """Starts from which to go downhill: drawn evenly, and near the lowest places found.

    It is told the lowest place on the way from each start, and its force.
    """
    rows, forces = np.empty((0, space.count)), np.empty(0)
    while True:
        starts = space.random(rng, STARTS)
        if len(rows):
            near = rows[rng.integers(min(LOWEST, len(rows)), size=HOPS)]
            scale = JUMP * (space.diameters[1] - space.diameters[0])
            shaken = near + scale * rng.standard_normal(near.shape)
            other = rng.random((HOPS, 1)) < 0.5
            starts[:HOPS] = space.projected(np.where(other, shaken, moved(rng, near)))
        found, values = yield starts
        rows, forces = _ranked(np.concatenate([rows, found]), np.append(forces, values))
        kept = _apart(rows, APART * (space.diameters[1] - space.diameters[0]))[:LOWEST]
        rows, forces = rows[kept], forces[kept]


def _apart(rows: Any, least: float) -> list[int]:
    """Numbers of rows that differ from all such before them by more than that in some gene."""
    kept: list[int] = []
    for k, row in enumerate(rows):
        if all(np.abs(row - rows[j]).max() > least for j in kept):
            kept.append(k)
    return kept


class Row(NamedTuple):
    """A method: what proposes, and for which spaces; the first one suits them best; why not for
    others."""

    propose: Callable[[Any, np.random.Generator], Proposals]
    spaces: tuple[type, ...]
    population: int = POPULATION
    reason: str = ""


METHODS = {
    "ga": Row(genetic, (Order, Choice)),
    "cma": Row(adapting, (Sizes, Order)),
    "catcma": Row(categorical, (Choice, Order)),
    "gradient": Row(starting, (Sizes,), reason=", whose genes are kinds and have no slopes"),
}


def suits(method: str | None, space: Space) -> tuple[str, Any, int]:
    """Name, generator and population of the method asked for, or of the first that suits."""
    fitting = [name for name, row in METHODS.items() if isinstance(space, row.spaces)]
    name = fitting[0] if method is None else method
    if not isinstance(name, str) or name not in METHODS:
        raise TensegrityError(f"method {check.shown(method)} is not one of {', '.join(METHODS)}")
    if name not in fitting:
        raise TensegrityError(
            f"method {name!r} does not search {type(space).__name__}{METHODS[name].reason}: "
            f"take {' or '.join(fitting)}"
        )
    return name, METHODS[name].propose, METHODS[name].population


def _seed(rng: np.random.Generator) -> int:
    return int(rng.integers(2**31))


def _finite(forces: Array) -> list[float]:
    """Forces as an optimiser takes them: what has no number ranks last."""
    finite = forces[np.isfinite(forces)]
    worst = finite.max() if len(finite) else 1.0
    return np.where(np.isfinite(forces), forces, 2 * worst).tolist()
