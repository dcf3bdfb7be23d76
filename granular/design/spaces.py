"""Spaces of designs of a protector: the order of given beads, their sizes, or their materials.

A design is a row of genes: indices of kinds of beads, or diameters.  A space draws random rows and
converts rows to beads, or to arrays of many chains; if genes are kinds, it also recombines and
mutates rows.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from granular.beads import Bead, Material, volume
from granular.contact import hertz_constants, hertz_slopes
from tensegrity import TensegrityError, check
from tensegrity.checked import checked
from tensegrity.printing import printed
from tensegrity.typing import Array, Count, Indices, Length

if TYPE_CHECKING:
    from numpy.random import Generator

HALVINGS = 60  # of the interval in which a shift is sought
SLACK = 1e-12  # of a length, relative


@dataclass(frozen=True, eq=False)
class Designs:
    """Chains of equally many beads, as arrays.

    Attributes
    ----------
    mass, modulus, poisson, radius : ndarray, (designs, beads)
        [kg], [Pa], 1, and radii of contact [m].
    """

    mass: Array
    modulus: Array
    poisson: Array
    radius: Array

    @classmethod
    def of(cls, chains: Sequence[Sequence[Bead]]) -> Designs:
        """The designs of sequences of beads."""
        rows = [
            [(b.mass, b.material.modulus, b.material.poisson, b.contact_radius) for b in chain]
            for chain in chains
        ]
        return cls(*np.moveaxis(np.array(rows), -1, 0))

    def __len__(self) -> int:
        return len(self.mass)

    def __getitem__(self, which: Any) -> Designs:
        return Designs(*(np.atleast_2d(x[which]) for x in self.columns))

    @property
    def columns(self) -> tuple[Array, Array, Array, Array]:
        """The four arrays."""
        return self.mass, self.modulus, self.poisson, self.radius

    def behind(self, striker: Bead) -> Designs:
        """The same chains with the striker as first bead."""
        first = Designs.of([[striker]])
        return Designs(*(
            np.concatenate([np.broadcast_to(one, (len(self), 1)), all_], axis=1)
            for one, all_ in zip(first.columns, self.columns, strict=True)
        ))  # fmt: skip

    def contacts(self, wall: Material) -> Array:
        """Constants of the contacts, the wall's last [N/m^1.5]; (designs, beads)."""
        return hertz_constants(*self._partners(wall))

    def contact_slopes(self, wall: Material) -> tuple[Array, Array]:
        """Derivatives of these with respect to the radii on both sides of a contact [N/m^2.5]."""
        return hertz_slopes(*self._partners(wall))

    def _partners(self, wall: Material) -> tuple[Array, ...]:
        """Properties of the partners on both sides of the contacts, the wall's last."""
        solid = self.modulus, self.poisson, self.radius
        last = wall.modulus, wall.poisson, math.inf
        after = (np.append(x[:, 1:], np.full((len(self), 1), y), axis=1)
                 for x, y in zip(solid, last, strict=True))  # fmt: skip
        return *solid, *after

    def unit(self, wall: Material, speed: float) -> Array:
        """Time unit [s] of the fastest contact that the beads could make; (designs,)."""
        wall_as_bead = math.inf, wall.modulus, wall.poisson, math.inf
        mass, *solid = (
            np.append(x, np.full((len(self), 1), y), axis=1)[:, :, None]
            for x, y in zip(self.columns, wall_as_bead, strict=True)
        )
        other, *partner = (x[:, None, :] for x in self.columns)
        rate = ((1 / mass + 1 / other) * hertz_constants(*solid, *partner)) ** 2 * speed
        return rate.max(axis=(1, 2)) ** -0.2


class Kinds:
    """A space whose genes are numbers of kinds of beads.

    Attributes
    ----------
    kinds : tuple of Bead
    count : int
        Beads of a design.
    """

    kinds: tuple[Bead, ...]
    count: int

    @cached_property
    def all_kinds(self) -> Designs:
        """Every bead that may occur, in one row."""
        return Designs.of([self.kinds])

    def designs(self, genes: Any) -> Designs:
        """Rows of genes as chains; (designs, count)."""
        return Designs(*(column[0, genes] for column in self.all_kinds.columns))

    def beads(self, row: Any) -> list[Bead]:
        """The beads of one row of genes."""
        numbers = check.sequence("row", row, "numbers of kinds")
        count = len(self.kinds)
        return [self.kinds[check.whole("kind", k, least=0, below=count)] for k in numbers]


@dataclass(frozen=True)
class Order(Kinds):
    """Every order of given beads.

    Parameters
    ----------
    given : sequence of Bead
        Two or more; beads that are equal are one kind.

    Raises
    ------
    TensegrityError
        Anything but beads, or beads that are all equal.
    """

    given: tuple[Bead, ...]

    __str__ = printed()

    def __init__(self, given: Sequence[Bead]) -> None:
        object.__setattr__(self, "given", _tuple("beads", given, Bead))
        if len(self.kinds) < 2:
            raise TensegrityError(f"{len(self.given)} equal beads have one order only")

    @cached_property
    def kinds(self) -> tuple[Bead, ...]:  # type: ignore[override]
        """The different beads, in the order in which they are given first."""
        return tuple(dict.fromkeys(self.given))

    @property
    def count(self) -> int:  # type: ignore[override]
        """Beads of a design."""
        return len(self.given)

    @cached_property
    def row(self) -> Indices:
        """The given order as a row of genes."""
        return np.array([self.kinds.index(bead) for bead in self.given])

    def random(self, rng: Generator, count: int) -> Indices:
        """Uniformly distributed rows; (count, beads)."""
        return rng.permuted(np.tile(self.row, (count, 1)), axis=1)

    def children(self, rng: Generator, one: Indices, other: Indices) -> Indices:
        """Offspring that keep the beads in which both parents agree and permute the others.

        Parameters
        ----------
        rng : numpy.random.Generator
        one, other : ndarray of int, (n, count)
            Rows of genes of the parents.

        Returns
        -------
        ndarray of int, (n, count)
        """
        free = one != other
        keys = np.where(free, rng.random(one.shape), 2.0)
        shuffled = np.take_along_axis(one, np.argsort(keys, axis=1), axis=1)
        places = np.argsort(~free, axis=1, kind="stable")  # free ones first, as in `shuffled`
        rows = np.empty_like(one)
        np.put_along_axis(rows, places, shuffled, axis=1)
        return np.where(free, rows, one)

    def mutants(self, rng: Generator, rows: Indices) -> Indices:
        """Rows with two unequal beads exchanged, or one moved elsewhere."""
        first = rng.integers(self.count, size=(len(rows), 1))
        unlike = rows != np.take_along_axis(rows, first, axis=1)
        second = np.argmax(np.where(unlike, rng.random(rows.shape), -1.0), axis=1)[:, None]
        swapped = rows.copy()
        np.put_along_axis(swapped, first, np.take_along_axis(rows, second, axis=1), axis=1)
        np.put_along_axis(swapped, second, np.take_along_axis(rows, first, axis=1), axis=1)
        return np.where(rng.random((len(rows), 1)) < 0.5, swapped, moved(rng, rows))


@checked
@dataclass(frozen=True)
class Choice(Kinds):
    """A material for each of some beads of one size.

    Parameters
    ----------
    count : int
        Beads, at least 1.
    diameter : float
        [m], > 0.
    materials : sequence of Material
        Two or more different ones.

    Raises
    ------
    TensegrityError
        Bad input, such as the name of a material in place of a Material.
    """

    count: int
    diameter: float
    materials: tuple[Material, ...]

    __str__ = printed(diameter="m")

    def __init__(self, count: Count, diameter: Length, materials: Sequence[Material]) -> None:
        given = _tuple("materials", materials, Material)
        object.__setattr__(self, "count", count)
        object.__setattr__(self, "materials", tuple(dict.fromkeys(given)))
        object.__setattr__(self, "kinds", tuple(Bead(diameter, m) for m in self.materials))
        object.__setattr__(self, "diameter", diameter)
        if len(self.materials) < 2:
            raise TensegrityError(f"materials {check.shown(materials)} leave no choice")

    def random(self, rng: Generator, count: int) -> Indices:
        """Uniformly distributed rows; (count, beads)."""
        return rng.integers(len(self.kinds), size=(count, self.count))

    def children(self, rng: Generator, one: Indices, other: Indices) -> Indices:
        """Offspring by uniform or one-point crossover, with equal probability.

        Parameters
        ----------
        rng : numpy.random.Generator
        one, other : ndarray of int, (n, count)
            Rows of genes of the parents.

        Returns
        -------
        ndarray of int, (n, count)
        """
        each = rng.random(one.shape) < 0.5
        upto = np.arange(self.count) < rng.integers(self.count + 1, size=(len(one), 1))
        return np.where(np.where(rng.random((len(one), 1)) < 0.5, each, upto), one, other)

    def mutants(self, rng: Generator, rows: Indices) -> Indices:
        """Rows with one bead of another material, or one moved elsewhere."""
        place = rng.integers(self.count, size=(len(rows), 1))
        shift = rng.integers(1, len(self.kinds), size=(len(rows), 1))
        old = np.take_along_axis(rows, place, axis=1)
        changed = rows.copy()
        np.put_along_axis(changed, place, (old + shift) % len(self.kinds), axis=1)
        return np.where(rng.random((len(rows), 1)) < 0.5, changed, moved(rng, rows))


@checked
@dataclass(frozen=True)
class Sizes:
    """Diameters of beads of one material that fill a length.

    Parameters
    ----------
    count : int
        Beads, at least 2.
    diameters : (float, float)
        Smallest and largest [m].
    length : float
        Sum of the diameters [m].
    material : Material

    Raises
    ------
    TensegrityError
        No such diameters have this sum; limits in the wrong order.
    """

    count: Annotated[int, ">= 2"]
    diameters: tuple[float, float]
    length: Length
    material: Material

    __str__ = printed(diameters="m", length="m")

    def __post_init__(self) -> None:
        count, length = self.count, self.length
        limits = check.floats("diameters", self.diameters)
        if limits.shape != (2,):
            raise TensegrityError(f"diameters {check.shown(self.diameters)} must be two limits")
        low = check.number("smallest diameter", limits[0], above=0, unit="m")
        high = check.number("largest diameter", limits[1], above=low, unit="m")
        if not count * low * (1 - SLACK) <= length <= count * high * (1 + SLACK):
            raise TensegrityError(
                f"length {length:g} m: {count} diameters from {low:g} m to {high:g} m sum to "
                f"{count * low:g} m at least and {count * high:g} m at most"
            )
        object.__setattr__(self, "diameters", (low, high))

    def random(self, rng: Generator, count: int) -> Array:
        """Rows of diameters, uniform between the limits, then shifted to the length [m]."""
        return self.projected(rng.uniform(*self.diameters, (count, self.count)))

    def projected(self, rows: Array) -> Array:
        """The nearest diameters within the limits that fill the length [m]; shape of rows.

        They are all shifted by one amount and clipped.
        """
        low, high = self.diameters
        lowest, highest = (x - rows for x in (low, high))
        down, up = lowest.min(axis=-1, keepdims=True), highest.max(axis=-1, keepdims=True)
        for _ in range(HALVINGS):
            middle = (down + up) / 2
            long = np.clip(rows + middle, low, high).sum(axis=-1, keepdims=True) > self.length
            down, up = np.where(long, down, middle), np.where(long, middle, up)
        return np.clip(rows + (down + up) / 2, low, high)

    def designs(self, genes: Array) -> Designs:
        """Rows of diameters as chains; (designs, count)."""
        solid = self.material.modulus, self.material.poisson
        modulus, poisson = (np.full(genes.shape, x) for x in solid)
        mass = self.material.density * volume(genes)  # type: ignore[arg-type]
        return Designs(np.asarray(mass), modulus, poisson, genes / 2)

    def beads(self, row: Array) -> list[Bead]:
        """The beads of one row of diameters."""
        return [Bead(d, self.material) for d in check.sequence("row", row, "diameters")]

    @property
    def all_kinds(self) -> Designs:
        """The smallest and the largest bead, in one row."""
        return self.designs(np.array([self.diameters]))


Space = Order | Sizes | Choice


def moved(rng: Generator, rows: Any) -> Any:
    """Rows in each of which one gene is moved to another place."""
    count = rows.shape[1]
    start, stop = rng.integers(count, size=(2, len(rows), 1))
    place = np.arange(count)
    later = (place >= start) & (place < stop)  # these take the next gene's
    earlier = (place <= start) & (place > stop)  # these the one's before
    source = np.where(place == stop, start, place + later - earlier)
    return np.take_along_axis(rows, source, axis=1)


def _tuple(name: str, given: object, kind: type) -> tuple[Any, ...]:
    if isinstance(given, str) or not isinstance(given, Sequence) or not len(given):
        raise TensegrityError(f"{name} {check.shown(given)} are not a sequence of {kind.__name__}s")
    for number, one in enumerate(given):
        check.kind(f"number {number} of {name}", one, kind)
    return tuple(given)
