"""Springs of compiled laws, looked at point by point in one call: see `search.c`."""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.engine.codegen import joined
from tensegrity.engine.compiled import Compiled, structure_of
from tensegrity.engine.energies import EXACT
from tensegrity.engine.native import address, library
from tensegrity.once import once

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from tensegrity.typing import Array, Flags, Indices

_ADDRESS, _NUMBER = ctypes.c_void_p, ctypes.c_longlong
_WAYS = _ADDRESS, ctypes.c_double, _NUMBER, *[_ADDRESS] * 3
_ARGUMENTS = {
    "first": (*_WAYS, _ADDRESS, _NUMBER, _ADDRESS, _ADDRESS),
    "first_size": (*_WAYS, _NUMBER, _ADDRESS),
    "largest": (_ADDRESS, *[_NUMBER] * 2, *[_ADDRESS] * 3, _NUMBER, _ADDRESS),
}

_Springs = structure_of("_Springs", "functions parameters domains", "width")  # as in search.c


@once
def _compiled() -> Any:
    """The functions of these names."""
    found = library(joined(["search.c"]), EXACT)
    functions = {name: found[name] for name in _ARGUMENTS}
    for name, function in functions.items():
        function.argtypes = _ARGUMENTS[name]
        function.restype = _NUMBER if name == "largest" else None
    return tuple(functions.values())


class Looks:
    """Shares of a way at which to look for the first point of a kind, in turn: each time on the
    part of the way on which it is known to be by then.

    Parameters
    ----------
    *each : ndarray
    """

    def __init__(self, *each: Array) -> None:
        self.each = each
        self._arrays = np.concatenate(each), np.cumsum([0, *map(len, each)], dtype=np.int64)
        self.given = *(x.ctypes.data for x in self._arrays), len(each)


class Search:
    """Different springs whose laws are compiled.

    Parameters
    ----------
    loops : sequence of Compiled
        Of the law of each, alone.
    parameters : ndarray, (springs, width)
        Of each, and what fills the row.
    domains : ndarray, (springs, 2)
        Lowest and highest elongation [m].
    """

    def __init__(self, loops: Sequence[Compiled], parameters: Array, domains: Array) -> None:
        functions = [ctypes.cast(loop.values, _ADDRESS).value for loop in loops]
        numbers = map(np.ascontiguousarray, (parameters, domains))
        self._arrays = np.array(functions, dtype=np.uint64), *numbers
        width = parameters.shape[1]
        self._springs = _Springs(*(x.ctypes.data for x in self._arrays), width)
        self._address = ctypes.addressof(self._springs)
        self._first, self._first_size, self._largest = _compiled()

    def first(
        self, energy: float, ends: Array, numbers: Indices, looks: Looks
    ) -> tuple[Array, Flags]:
        """The first elongation with more than an energy on the way from 0 to each end, or else the
        last; and whether the first look found one.

        Parameters
        ----------
        energy : float
            [J]
        ends : ndarray, (ways,)
            [m]
        numbers : ndarray of int, (ways,)
            The spring of each.
        looks : Looks
        """
        last, found = np.empty(len(ends)), np.empty(len(ends), dtype=bool)
        ways = energy, len(ends), address(numbers), address(ends)
        self._first(self._address, *ways, *looks.given, address(last), address(found))
        return last, found

    def first_size(self, energy: float, signs: Array, numbers: Indices, sizes: Array) -> Array:
        """The first of some sizes with more than an energy [J] to the side of each sign, or else
        the last, of those from the first to the last in a row where the stiffness is finite."""
        last = np.empty(len(signs))
        ways = energy, len(signs), address(numbers), address(signs)
        self._first_size(self._address, *ways, address(sizes), len(sizes), address(last))
        return last

    def largest(self, order: int, ranges: Array, numbers: Indices, shares: Array) -> Array | None:
        """Largest size of the tension (1) [N], or largest stiffness (2) [N/m], of springs at
        shares of their ranges (numbers, 2) [m], which it is at least 0; NaN where one is NaN.
        None where a range is not inside of a domain."""
        out = np.empty(len(numbers))
        given = address(numbers), address(ranges), address(shares), len(shares), address(out)
        return out if self._largest(self._address, order, len(numbers), *given) else None
