"""Immutable objects: attributes that are set once, arrays that are not writeable, and sequences of
few different objects that occur many times.

Quantities that follow from a scene (weights, contacts, kernels) are computed once and cached, and
results refer to their scene; a change of the scene afterwards would contradict both.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import cached_property
from typing import Any

import numpy as np


class FixedDict(dict[Any, Any]):
    """A dict that cannot be changed."""

    def _refuse(self, *_: Any, **__: Any) -> Any:
        raise TypeError("this dict cannot be changed: make another, dict(this) | {...}")

    __setitem__ = __delitem__ = __ior__ = _refuse
    clear = pop = popitem = setdefault = update = _refuse

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (dict(self),)


def fixed(value: Any) -> Any:
    """An immutable copy of a value: arrays not writeable, lists as tuples, dicts fixed."""
    if isinstance(value, np.ndarray):
        if value.flags.writeable:
            value = value.copy()
            value.flags.writeable = False
        return value
    if type(value) is dict:
        return FixedDict(value)
    return tuple(value) if type(value) is list else value


def as_fixed(array: Any) -> Any:
    """An array itself, from now on not writeable."""
    array.flags.writeable = False
    return array


def same_content(one: Any, other: Any) -> bool:
    """Whether two values are equal; arrays, also nested ones, are compared number by number."""
    if one is other:
        return True
    if type(one) is not type(other):
        return False
    if isinstance(one, np.ndarray):
        return np.array_equal(one, other)
    if isinstance(one, dict):
        return list(one) == list(other) and all(same_content(one[k], other[k]) for k in one)
    if isinstance(one, (tuple, list)):
        return len(one) == len(other) and all(map(same_content, one, other))
    if is_dataclass(one) and not isinstance(one, type):
        return all(same_content(getattr(one, f.name), getattr(other, f.name)) for f in fields(one))
    return bool(one == other)


class Repeated(Sequence[Any]):
    """A sequence of objects of which few differ: these, and the number of the one at each place.

    It equals any sequence of equal objects.

    Parameters
    ----------
    different : sequence
        The different objects; some may occur at no place.
    number : array_like of int
        Index in `different` of the object at each place.
    """

    __slots__ = ("different", "number")

    def __init__(self, different: Sequence[Any], number: Any) -> None:
        self.different = tuple(different)
        kind = np.min_scalar_type(max(len(self.different) - 1, 0))
        self.number = fixed(np.asarray(number).astype(kind))

    @classmethod
    def of(cls, items: Iterable[Any]) -> Repeated:
        """These items, of which those at one address count as the same."""
        if isinstance(items, Repeated):
            return items
        items = tuple(items)
        known = dict(zip(map(id, items), items, strict=True))
        place = {one: k for k, one in enumerate(known)}
        number = np.fromiter(map(place.__getitem__, map(id, items)), dtype=int, count=len(items))
        return cls(tuple(known.values()), number)

    def each(self, function: Callable[[Any], float]) -> np.ndarray[Any, Any]:
        """Values of a function of all items, each computed once for equal ones; (items,)."""
        return np.array([function(one) for one in self.different], dtype=float)[self.number]

    def __len__(self) -> int:
        return len(self.number)

    def __getitem__(self, place: Any) -> Any:
        number = self.number[place]
        return Repeated(self.different, number) if number.ndim else self.different[number]

    def __iter__(self) -> Iterator[Any]:
        return map(self.different.__getitem__, self.number.tolist())

    def __add__(self, other: Iterable[Any]) -> Repeated:
        other = Repeated.of(other)
        both = Repeated.of((*self.different, *other.different))
        before = len(self.different)
        number = both.number[self.number], both.number[before:][other.number]
        return Repeated(both.different, np.concatenate(number))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Repeated):
            return isinstance(other, (tuple, list)) and tuple(self) == tuple(other)
        if len(self) != len(other):
            return False
        pairs = self.number.astype(np.int64) * len(other.different) + other.number
        pairs = np.unique(pairs).tolist()
        each = (divmod(pair, len(other.different)) for pair in pairs)
        return all(same_content(self.different[i], other.different[j]) for i, j in each)

    def __hash__(self) -> int:
        return hash(len(self))

    def __repr__(self) -> str:
        return repr(tuple(self))

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.different, self.number)


class ReadOnly:
    """Base of classes whose attributes are set once, by `__init__`, and `fixed` then.

    Pickles and copies preserve this; values of `cached_property` are not copied.
    """

    def __setattr__(self, name: str, value: Any) -> None:
        if name in self.__dict__ or hasattr(type(self), name):
            raise AttributeError(
                f"{name} of a {type(self).__name__} cannot be changed: make another one"
            )
        object.__setattr__(self, name, fixed(value))

    def __delattr__(self, name: str) -> None:
        raise AttributeError(f"{name} of a {type(self).__name__} cannot be deleted")

    def __getstate__(self) -> dict[str, Any]:
        kept = self.__dict__.items()
        made = cached_property
        return {n: x for n, x in kept if not isinstance(getattr(type(self), n, None), made)}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        self.__dict__.update((name, fixed(value)) for name, value in state.items())
