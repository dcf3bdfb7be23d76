"""Search methods: each proposes rows of genes and is told what they are worth.

A method is a generator: it yields rows (n, count) and is sent their forces (n,), the less the
better.  All that it does follows from the space, the random numbers it is given and what it is
told; so a search that was broken off goes on by telling it again.  It may propose what it did
before, which costs nothing, and may end.

The genetic method moves orders and choices by steps of our own; the covariance matrix adaptation
of diameters, of random keys for orders, and its form for categories are those of `cmaes`.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from granular.design.spaces import Choice, Order, Sizes, Space
from tensegrity import TensegrityError, check

if TYPE_CHECKING:
    from tensegrity.typing import Array

    Proposals = Generator[Array, Array, None]

POPULATION = 64
TRIES = 50  # at an individual that was not there before
PAIRS = 3  # of which the better parent is taken
"""Individuals that a parent is the best of."""


def genetic(space: Order | Choice, rng: np.random.Generator) -> Proposals:
    """Parents and children compete; nobody is twice in a population, or computed twice."""
    seen: set[bytes] = set()

    def new(make: Callable[[], Array]) -> Array | None:
        for _ in range(TRIES):
            row = make()
            if (key := row.tobytes()) not in seen:
                seen.add(key)
                return row
        return None

    def fresh() -> Array:
        return space.random(rng, 1)[0]

    while True:
        rows, forces = np.empty((0, space.count), dtype=int), np.empty(0)
        stale, best = 0, np.inf

        def parent() -> Array:
            return rows[rng.integers(len(rows), size=PAIRS).min()]

        def offspring() -> Array:
            row = space.child(rng, parent(), parent())
            for _ in range(rng.geometric(0.5)):
                row = space.mutant(rng, row)
            return row

        while stale < STALE:
            made = [new(offspring if len(rows) else fresh) for _ in range(POPULATION)]
            made = [row for row in made if row is not None]
            if not made:
                if not len(rows):
                    return
                break
            children = np.array(made)
            values = yield children
            rows, forces = np.concatenate([rows, children]), np.concatenate([forces, values])
            order = np.argsort(forces, kind="stable")[:POPULATION]
            rows, forces = rows[order], forces[order]
            stale = 0 if forces[0] < best else stale + 1
            best = forces[0]


STALE = 25
