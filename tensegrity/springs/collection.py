"""The springs of all bonds of a scene: their energies, tensions and stiffnesses, and the bounds
from which a step is chosen.

Springs of one law that differ only in the values of its parameters are evaluated in one call.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from tensegrity.engine.bonds import Contacts
from tensegrity.engine.compiled import evaluated, loop_of_law
from tensegrity.engine.energies import Energies, Search, SearchPoints
from tensegrity.errors import StabilityError, TensegrityError
from tensegrity.readonly import Repeated, fixed
from tensegrity.springs.kinks import TAUT
from tensegrity.springs.potential import Potential
from tensegrity.springs.varied import OverTime
from tensegrity.typing import Array, Flags, Indices

ORDERS = ("energy", "tension", "stiffness")
NEAR_END = np.logspace(-16, 0, 321)  # fractions of a range at which a search samples
PART = 2**16  # springs that are numbered at once
SEARCH_FRACTIONS = np.concatenate([NEAR_END, np.linspace(0, 1, 201)])
REFINEMENTS = [np.arange(1, 65) / 64] * 4
WAYS = SearchPoints(
    [np.sort(np.concatenate([NEAR_END, 1 - NEAR_END[:-1]])), *REFINEMENTS],
    np.ldexp(1.0, np.arange(-1000, 1001, 4)),  # for an unbounded range
    [2.0 ** (np.arange(-324, 1) / 6), *REFINEMENTS],  # resolves a narrow energy barrier
)


class Springs:
    """The distinct springs of a scene, and the index of the one of each bond.

    Parameters
    ----------
    springs : sequence of Potential
        One for each bond.
    shape : tuple of int, optional
        Shape of the bonds: (bonds,), or (bonds, batch).
    lengths : ndarray, (bonds,), optional
        Lengths [m]; bonds of one spring but of different lengths then count as distinct.

    Attributes
    ----------
    kinds : tuple
        Keys of the distinct springs, comparable between scenes: each spring and a class of lengths.
    different : tuple of Potential
        The distinct springs; of those that change with time, what they are at t = 0.
    group : ndarray of int, `shape`
        Index in `different` of each bond's spring.
    """

    def __init__(
        self,
        springs: Sequence[Potential],
        shape: tuple[int, ...] | None = None,
        lengths: Array | None = None,
    ) -> None:
        shared, (sizes, size) = Repeated.of(springs), _length_classes(lengths)
        kind = np.min_scalar_type(len(shared.different) * len(sizes))
        distinct, same = numbered(np.multiply(shared.number, len(sizes), dtype=kind) + size)
        keys = [divmod(key, len(sizes)) for key in distinct.tolist()]
        keys = [(shared.different[spring], sizes[length]) for spring, length in keys]
        numbers: dict[tuple, int] = {}
        equal = np.array([numbers.setdefault(key, len(numbers)) for key in keys], dtype=same.dtype)
        group = equal[same]
        self.kinds = tuple(numbers)
        self.different = tuple(spring.at(0.0) for spring, _ in numbers)
        self.group = fixed(group if shape is None else group.reshape(shape))

    def __len__(self) -> int:
        return len(self.different)

    @cached_property
    def changing(self) -> tuple[OverTime, ...]:
        """The laws of springs that change with time."""
        laws = dict.fromkeys(spring.law for spring, _ in self.kinds)
        return tuple(law for law in laws if isinstance(law, OverTime))

    @cached_property
    def table(self) -> tuple[Any, Any, Any]:
        """The distinct laws, the index of each spring's law, and its parameters."""
        laws = tuple(dict.fromkeys(spring.law for spring in self.different))
        width = max((len(spring.values) for spring in self.different), default=0)
        parameters = np.zeros((len(self), width))
        for row, spring in zip(parameters, self.different, strict=True):
            row[: len(spring.values)] = spring.values
        place = {law: k for k, law in enumerate(laws)}
        numbers = [place[spring.law] for spring in self.different]
        return laws, fixed(np.array(numbers, dtype=int)), fixed(parameters)

    @cached_property
    def kinks(self) -> Array:
        """Place, strength, exponent and side of the kinks of each spring; (kinks, springs, 4),
        padded with NaN."""
        most = max((len(spring.kinks) for spring in self.different), default=0)
        table = np.full((max(most, 1), len(self), 4), np.nan)
        for k, spring in enumerate(self.different):
            for row, opening in zip(table, spring.kinks, strict=False):
                row[k] = opening
        return fixed(table)

    @cached_property
    def _kinks(self):
        """All kinks, (kinks, 4), and the indices of their springs."""
        kink, spring = np.nonzero(~np.isnan(self.kinks[..., 2]))
        return self.kinks[kink, spring], spring

    @property
    def has_kinks(self) -> bool:
        """Whether the force of any spring has a kink."""
        return len(self._kinks[1]) > 0

    @cached_property
    def jumps(self) -> bool:
        """Whether the force or the energy of some spring jumps."""
        return bool(np.any(self._kinks[0][:, 2] <= 0))

    def exponents_within(self, ranges: Array) -> set[float]:
        """Exponents of the kinks within ranges of elongation (springs, 2) [m], widened by
        round-off."""
        if not self.has_kinks:
            return set()
        near = [TAUT * (spring.length or 0.0) for spring in self.different]
        ranges = ranges + np.multiply.outer(near, (-1.0, 1.0))
        return set(self._kinks[0][self._within(ranges), 2].tolist())

    def kinks_within(self, ranges: Array) -> list[tuple[Potential, list[float]]]:
        """Pairs of a spring and one of its kinks within ranges of elongation (springs, 2) [m],
        including kinks of unknown place."""
        kinks, spring = self._kinks
        return [(self.different[spring[k]], kinks[k].tolist()) for k in self._within(ranges)]

    def _within(self, ranges):
        kinks, spring = self._kinks
        low, high = ranges[spring].T
        return np.flatnonzero(~((kinks[:, 0] < low) | (kinks[:, 0] > high)))

    @cached_property
    def computable_domain(self) -> Any:
        """Lowest and highest elongation that a run can compute [m]; (springs, 2)."""
        return fixed(
            np.array([spring.computable_domain for spring in self.different]).reshape(-1, 2)
        )

    @property
    def noted_domain(self) -> Any:
        """Lowest and highest value of what a run notes the ranges of: of the elongations [m]."""
        return self.computable_domain

    @cached_property
    def force_model(self) -> str:
        """The models by which the tensions are computed."""
        models = ", ".join(dict.fromkeys(spring.force_model for spring in self.different))
        return models or "exact"  # no contact is listed yet

    @cached_property
    def domains(self) -> Array:
        """Lowest and highest elongation of each spring's domain [m]; (springs, 2)."""
        return fixed(np.array([spring.domain for spring in self.different]).reshape(-1, 2))

    @cached_property
    def _group_numbers(self):
        """Index of the set of each spring: springs of one law, evaluated in one call, or one."""
        sets: dict[object, int] = {}
        numbers = np.zeros(len(self), dtype=int)
        for k, spring in enumerate(self.different):
            plain = type(spring).derivative is Potential.derivative
            numbers[k] = sets.setdefault(spring.law if plain else k, len(sets))
        return fixed(numbers)

    def _grouped(self, numbers):
        """Bonds of the springs with these indices, grouped by set, and their positions."""
        kind = self._group_numbers[numbers]
        places = [np.flatnonzero(kind == k) for k in np.unique(kind)]
        return [(_SpringGroup(self, numbers[columns]), columns) for columns in places]

    @cached_property
    def _groups(self):
        """All bonds, grouped by set."""
        return self._grouped(self.group.ravel())

    def evaluate(self, name: str, r: np.ndarray) -> np.ndarray:
        """Energy [J], tension [N] or stiffness [N/m] of each bond.

        Parameters
        ----------
        name : {"energy", "tension", "stiffness"}
        r : ndarray, (..., *shape of the bonds)
            Elongations [m].

        Returns
        -------
        ndarray, shape of r
            [J], [N] with tension > 0, or [N/m].
        """
        if len(self) == 1:
            return getattr(self.different[0], name)(r)
        flat = r.reshape(*r.shape[: r.ndim - self.group.ndim], -1)
        return _evaluated(self._groups, name, flat).reshape(r.shape)

    def energies(self, mass: Array, contacts: Contacts | None = None) -> Energies | None:
        """Compiled total energies of a scene with these bonds.

        Parameters
        ----------
        mass : ndarray, shape of a state, or of a network (sites,)
            [kg]
        contacts : Contacts, optional
            Geometry of the bonds of a network.

        Returns
        -------
        Energies or None
            None if some law has no compiled energy.
        """
        groups = []
        for one, columns in self._grouped(self.group.ravel()):
            loop = loop_of_law(one.law)
            if loop is None or "energy" not in one.law.compiled:
                return None
            used, number = numbered(one.rows)
            parameters = np.array([self.different[k].values for k in used]).T
            number = np.broadcast_to(number, columns.shape)
            groups.append((loop, parameters, self.computable_domain[used].T, number, columns))
        return Energies(mass, groups, contacts)

    def _evaluate_springs(self, name, r, numbers):
        """Values of the springs with these indices at elongations r (points, numbers) [m]."""
        return _evaluated(self._grouped(numbers), name, r)

    def largest(self, name: str, ranges: Array, numbers: Indices | None = None) -> Array:
        """Largest magnitude of the tension [N], or largest stiffness [N/m], of each spring.

        Parameters
        ----------
        name : {"tension", "stiffness"}
        ranges : ndarray, (springs, 2)
            Elongations [m], both inside the domain.
        numbers : ndarray of int, optional
            Indices of the springs; by default all.

        Returns
        -------
        ndarray, (springs,) or shape of `numbers`
            At least 0.

        Raises
        ------
        StabilityError
            The value is not finite somewhere in a range.
        """
        ranges = ranges if numbers is None else ranges[numbers]
        search = self._searches.get(name)
        result = search and search.largest(ORDERS.index(name), ranges, numbers, SEARCH_FRACTIONS)
        if result:
            largest, is_finite = result
        else:
            numbers = np.arange(len(self)) if numbers is None else numbers
            points = np.concatenate([end * SEARCH_FRACTIONS[:, None] for end in ranges.T])
            values = self._evaluate_springs(name, points, numbers)
            largest = np.max(np.abs(values) if name == "tension" else values, axis=0, initial=0.0)
            is_finite = bool(np.isfinite(largest).all())
        if not is_finite:
            bad = np.flatnonzero(~np.isfinite(largest))
            low, high = ranges[bad[0]]
            raise StabilityError(
                f"{name} {largest[bad[0]]} between elongations {low:g} m and {high:g} m must be "
                "finite"
            )
        return largest

    def reachable(self, energy: float) -> tuple[Array, Flags]:
        """Range of elongation that each spring can attain with a given energy [J].

        Returns
        -------
        ranges : ndarray, (springs, 2)
            Ends of the connected part of {V <= energy} that contains 0 [m], slightly too wide.
        locks : ndarray of bool, (springs,)
            Whether the range includes an end of the domain.
        """
        if "energy" in self._searches:
            return self._searches["energy"].reachable(energy, WAYS)
        ends, numbers = self.domains.ravel(), np.repeat(np.arange(len(self)), 2)
        held, free = np.flatnonzero(np.isfinite(ends)), np.flatnonzero(np.isinf(ends))
        last, locks = np.empty(len(ends)), np.zeros(len(ends), dtype=bool)
        if held.size:
            last[held], reached = self._first_above(energy, ends[held], numbers[held], WAYS.to_end)
            locks[held] = ~reached
        if free.size:
            sizes = self._size(energy, np.sign(ends[free]), numbers[free])
            last[free], _ = self._first_above(energy, sizes, numbers[free], WAYS.to_size)
        return last.reshape(-1, 2), locks[::2] | locks[1::2]

    def _first_above(self, energy, ends, numbers, levels):
        """First elongations at which the energy is exceeded, for any springs, compiled or not;
        the counterpart of `first` in energies.c."""
        before, beyond, every, reached = np.zeros(len(ends)), ends, np.arange(len(ends)), []
        for fractions in levels:
            r = before + fractions[:, None] * (beyond - before)
            r[fractions == 1] = beyond
            outside = ~(self._evaluate_springs("energy", r, numbers) <= energy)
            reached.append(outside.any(axis=0))
            first = np.where(reached[-1], np.argmax(outside, axis=0), len(r))
            before = np.where(first > 0, r[first - 1, every], before)
            beyond = np.where(reached[-1], r[np.minimum(first, len(r) - 1), every], before)
        return beyond, reached[0]

    def _size(self, energy, signs, numbers):
        """Elongations [m] beyond which the energy is exceeded or the law overflows, on unbounded
        ranges; the counterpart of `size` in energies.c."""
        r = signs * WAYS.sizes[:, None]
        with np.errstate(all="ignore"):  # powers overflow and underflow
            known = np.isfinite(self._evaluate_springs("stiffness", r, numbers))
            begun = np.logical_or.accumulate(known, axis=0)
            unknown, high = (
                begun & ~known,
                begun & ~(self._evaluate_springs("energy", r, numbers) <= energy),
            )
        ended = unknown | high
        at = np.where(ended.any(axis=0), np.argmax(ended, axis=0), len(r) - 1)
        every = np.arange(len(signs))
        return r[at - unknown[at, every], every]

    @cached_property
    def _searches(self):
        """The compiled search for each name in `ORDERS` for which all springs have a compiled
        function."""
        if not self.different or not np.array_equal(self.computable_domain, self.domains):
            return {}
        laws, law, parameters = self.table
        loops, kinds = [loop_of_law(one) for one in laws], {type(one) for one in self.different}
        names = [
            name
            for name in ORDERS
            if all(name in one.compiled for one in laws)
            and all(getattr(kind, name) is getattr(Potential, name) for kind in kinds)
        ]
        if "stiffness" not in names and np.isinf(self.domains).any():
            names = [name for name in names if name != "energy"]  # unbounded ranges need both
        if not names or None in loops:
            return {}
        return dict.fromkeys(names, Search([loops[k] for k in law], parameters, self.domains))


class _SpringGroup:
    """Bonds whose springs have one law, or are one spring, with their parameters as columns."""

    def __init__(self, springs, group):
        first = springs.different[group[0]]
        self.law, self._one = first.law, first if np.all(group == group[0]) else None
        if self._one is not None:
            group = group[:1]
        self._springs, self.rows = springs, group

    @cached_property
    def _each(self):
        """Parameters, (parameters, bonds), and ends of the domains, (2, bonds), of all bonds."""
        parameters = np.ascontiguousarray(self._springs.table[2][self.rows].T)
        return parameters, np.ascontiguousarray(self._springs.domains[self.rows].T)

    def evaluate(self, name, r):
        """Energy [J], tension [N] or stiffness [N/m] at elongations r (..., bonds)."""
        order = ORDERS.index(name)
        if self._one is not None:
            if getattr(type(self._one), name) is not getattr(Potential, name):
                return getattr(self._one, name)(r)
            return self._one.derivative(order, r, order == 0)
        parameters, (low, high) = self._each
        above = r >= low if order == 0 else r > low
        inside = above & (r <= high if order == 0 else r < high)
        if not inside.all():
            worst = tuple(x[0] for x in np.nonzero(~inside))
            if np.isnan(r[worst]):
                raise TensegrityError("elongation nan m is not a number")
            raise self._springs.different[self.rows[worst[-1]]]._range_error(float(r[worst]))
        return evaluated(self.law, order, parameters, np.ascontiguousarray(r))


def _evaluated(sets, name, r):
    """Values of the bonds of all sets at elongations r (..., bonds) [m]."""
    if len(sets) == 1:
        return sets[0][0].evaluate(name, r)
    out = np.empty_like(r)
    for one, columns in sets:
        out[..., columns] = one.evaluate(name, r[..., columns])
    return out


def _length_classes(lengths):
    """Classes of lengths equal within one or two per cent, -1 for a length of 0, and the index of
    the class of each."""
    if lengths is None:
        return [0], 0
    classes = np.full(len(lengths), -1, dtype=np.int32)
    shortest = lengths.min(initial=np.inf, where=lengths > 0)
    for k in range(0, len(lengths), PART):
        some = lengths[k : k + PART]
        bonds = some > 0
        classes[k : k + PART][bonds] = np.round(np.log(some[bonds] / shortest) / 0.01)
    numbers, size = numbered(classes)
    return numbers.tolist(), size


def numbered(keys):
    """Different whole numbers in the order of their first places, and the index of each number in
    these; few of them, or of a small range, are found without sorting."""
    low, high = (keys.min(), keys.max()) if len(keys) else (0, -1)
    if int(high) - int(low) >= max(len(keys), PART):
        distinct, first, index = np.unique(keys, return_index=True, return_inverse=True)
        order = np.argsort(first)
        return distinct[order], np.argsort(order)[index]
    first = np.full(int(high) - int(low) + 1, len(keys))
    for k in reversed(range(0, len(keys), PART)):
        part = keys[k : k + PART] - low
        first[part[::-1]] = np.arange(k, k + len(part))[::-1]  # the last of equal places counts
    order = np.argsort(first, kind="stable")[: np.count_nonzero(first < len(keys))]
    index = np.zeros(len(first), dtype=np.min_scalar_type(len(order)))
    index[order] = np.arange(len(order))
    return order + low, index[keys - low]
