"""Immutable objects: attributes that are set once, and arrays that are not writeable.

Quantities that follow from a scene (weights, contacts, kernels) are computed once and cached, and
results refer to their scene; a change of the scene afterwards would contradict both.
"""

from __future__ import annotations

from collections.abc import Mapping
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
