"""Search methods, which propose rows of genes and receive their forces.

A method is a generator: it yields rows (n, count) and is sent the best design that each row led to
(for descents their best design, otherwise the row itself) and the forces of these, (n,), to be
minimised.  Its proposals depend only on the space, the random generator and the values sent, so
that an interrupted search is resumed by sending the stored values again.  A method may repeat a
proposal at no cost, and may end.

Orders and choices are searched by a genetic algorithm of our own; diameters by descents from many
starting points or, with a `build`, by the covariance matrix adaptation of `cmaes` (N. Hansen,
arXiv:1604.00772).
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from functools import partial
from typing import Any

import numpy as np

from granular.design.spaces import Choice, Order, Sizes, Space, moved
from tensegrity import TensegrityError, check
from tensegrity.typing import Array, Indices

Proposals = Generator[Any, Any, None]

POPULATION = 64
PAIRS = 2  # individuals of a tournament, the best of which becomes a parent
MUTATIONS = 0.5  # probability that the mutation of a child ends
TRIES = 20  # times that a full population tries to produce new individuals
STALE = 15  # populations without a better design, after which a method restarts
STARTS = 8  # starting points of a batch
HOPS = 4  # of these, close to the lowest minima
LOWEST = 6  # number of these minima
JUMP = 0.15  # of the range of a diameter
LEAST_DISTANCE = 0.1  # of the range: least difference of two of them, in some diameter
SIGMA = 0.3  # of the range of a gene, at the start of an adaptation


def genetic(space: Order | Choice, rng: np.random.Generator) -> Proposals:
    """Parents and children compete, by rank; no design is proposed twice."""
    seen: set[bytes] = set()

    def new(make: Callable[[], Indices]) -> Indices:
        children: list[Indices] = []
        for _ in range(TRIES):
            for row in make():
                if len(children) < POPULATION and (key := row.tobytes()) not in seen:
                    seen.add(key)
                    children.append(row)
            if len(children) == POPULATION:
                break
        return np.array(children)

    while len(first := new(lambda: space.random(rng, POPULATION))):
        rows, forces = yield first
        stale = 0
        while stale < STALE:
            made = new(partial(_children, space, rng, _ranked(rows, forces)[0]))
            if not len(made):
                break
            made, values = yield made
            stale = 0 if values.min() < forces.min() else stale + 1
            rows, forces = _ranked(np.concatenate([rows, made]), np.append(forces, values))
            rows, forces = rows[:POPULATION], forces[:POPULATION]


def _ranked(rows: Indices, forces: Array) -> tuple[Indices, Array]:
    """Rows by their forces, the best first."""
    order = np.argsort(forces, kind="stable")
    return rows[order], forces[order]


def _children(space: Order | Choice, rng: np.random.Generator, rows: Indices) -> Indices:
    """Changed children of parents, the better of `PAIRS` each; the best rows come first."""
    picks = rng.integers(len(rows), size=(2, POPULATION, PAIRS)).min(axis=-1)
    made = space.children(rng, *rows[picks])
    changed = np.arange(len(made))
    while len(changed):
        made[changed] = space.mutants(rng, made[changed])
        changed = changed[rng.random(len(changed)) > MUTATIONS]
    return made


def adapting(space: Sizes, rng: np.random.Generator) -> Proposals:
    """A normal distribution of diameters, projected to the length."""
    from cmaes import CMA

    low, high = space.diameters
    bounds = np.tile([0.0, 1.0], (space.count, 1))
    while True:
        start, seed = rng.uniform(0.3, 0.7, space.count), int(rng.integers(2**31))
        optimizer = CMA(start, SIGMA, bounds, seed=seed, population_size=POPULATION)
        stale, best = 0, np.inf
        while stale < STALE and not optimizer.should_stop():
            asked = np.array([optimizer.ask() for _ in range(POPULATION)])
            rows, values = yield space.projected(low + (high - low) * asked)
            worst = 2 * values[np.isfinite(values)].max(initial=0.5)
            finite = np.where(np.isfinite(values), values, worst)  # nan and inf rank last
            genes = (rows - low) / (high - low)
            optimizer.tell(list(zip(genes, finite.tolist(), strict=True)))
            stale = 0 if values.min() < best else stale + 1
            best = min(best, values.min())


def starting(space: Sizes, rng: np.random.Generator) -> Proposals:
    """Starting points of descents: uniformly distributed, and close to the lowest minima found."""
    rows, forces = np.empty((0, space.count)), np.empty(0)
    while True:
        starts = space.random(rng, STARTS)
        if len(rows):
            near = rows[rng.integers(min(LOWEST, len(rows)), size=HOPS)]
            scale = JUMP * (space.diameters[1] - space.diameters[0])
            shaken = near + scale * rng.standard_normal(near.shape)
            other = rng.random((HOPS, 1)) < 0.5
            starts[:HOPS] = space.projected(np.where(other, shaken, moved(rng, near)))
        minima, values = yield starts
        rows, forces = _ranked(np.concatenate([rows, minima]), np.append(forces, values))
        kept = _distinct(rows, LEAST_DISTANCE * (space.diameters[1] - space.diameters[0]))[:LOWEST]
        rows, forces = rows[kept], forces[kept]


def _distinct(rows: Any, least: float) -> list[int]:
    """Numbers of rows that differ from all selected ones before by more than `least` in a gene."""
    kept: list[int] = []
    for k, row in enumerate(rows):
        if all(np.abs(row - rows[j]).max() > least for j in kept):
            kept.append(k)
    return kept


METHODS: dict[str, tuple[Callable[..., Proposals], tuple[type, ...]]] = {
    "ga": (genetic, (Order, Choice)),
    "gradient": (starting, (Sizes,)),
    "cma": (adapting, (Sizes,)),
}
"""What proposes, and for which spaces."""


def suits(
    method: str | None, space: Space, is_built: bool, is_scattered: bool = False
) -> tuple[str, Callable[..., Proposals]]:
    """Name and generator of the requested method, or of the most suitable one for a space.

    Parameters
    ----------
    method : str or None
    space : Space
    is_built : bool
        Whether a function builds the scenes, so that no gradients are available.
    is_scattered : bool
        Whether a quantile over deviations is minimised, whose gradients are not computed either.

    Returns
    -------
    name, generator : str, callable (space, rng) -> Proposals

    Raises
    ------
    TensegrityError
        An unknown method, or one that does not search such a space.
    """
    if method is None:
        method = "cma" if is_built or is_scattered else "gradient"
        method = method if isinstance(space, Sizes) else "ga"
    if not isinstance(method, str) or method not in METHODS:
        raise TensegrityError(f"method {check.shown(method)} is not one of {', '.join(METHODS)}")
    propose, spaces = METHODS[method]
    if not isinstance(space, spaces):
        fitting = [name for name, (_, kinds) in METHODS.items() if isinstance(space, kinds)]
        reason = ", whose genes are kinds and have no derivatives" if method == "gradient" else ""
        raise TensegrityError(
            f"method {method!r} does not search {type(space).__name__}{reason}: "
            f"take {' or '.join(fitting)}"
        )
    if method == "gradient" and is_built:
        raise TensegrityError(f"method {method!r} is for chains before a wall, not for a build")
    if method == "gradient" and is_scattered:
        raise TensegrityError(f"method {method!r} computes one chain at a time: no scatter")
    return method, propose
