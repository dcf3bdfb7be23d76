"""Springs of compiled laws, looked at point by point in one call: see `search.c`."""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.engine.energies import EXACT
from tensegrity.engine.native import address, joined, library, pointer
from tensegrity.engine.structs import structure
from tensegrity.once import once

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from tensegrity.engine.compiled import Compiled
    from tensegrity.typing import Array, Flags, Indices

FINITE = 2  # what `largest` returns of finite numbers
SPRINGS = structure("search.c", "springs")
LOOKS = structure("search.c", "looks")


@once
def _compiled() -> Any:
    return library(joined(["prelude.c", "search.c"]), EXACT)


class Ways:
    """Where a search looks: shares of ways from 0.

    Each look is on that part of the way on which the one before found what is searched.

    Parameters
    ----------
    to_end : sequence of ndarray
        Of the way to an end of the domain, of each look.
    sizes : ndarray
        Elongations [m] where there is none.
    to_size : sequence of ndarray
        Of the way to one of these.
    """

    def __init__(self, to_end: Sequence[Array], sizes: Array, to_size: Sequence[Array]) -> None:
        self.to_end, self.sizes, self.to_size = to_end, sizes, to_size
        self._each = [_looks(looks) for looks in (to_end, [sizes], to_size)]
        self._looks = (LOOKS * 3)(*self._each)
        self.address = ctypes.addressof(self._looks)


def _looks(shares: Sequence[Array]) -> Any:
    begins = np.cumsum([0, *map(len, shares)], dtype=np.int64)
    return LOOKS(shares=np.concatenate(shares), begins=begins, count=len(shares))


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
        functions = [pointer(loop.library.values) for loop in loops]
        self._springs = SPRINGS(
            functions=np.array(functions, dtype=np.uint64),
            parameters=np.ascontiguousarray(parameters),
            domains=np.ascontiguousarray(domains),
            width=parameters.shape[1],
        )
        self._address = ctypes.addressof(self._springs)
        self._library = _compiled()

    def reachable(self, energy: float, ways: Ways) -> tuple[Array, Flags]:
        """Elongations that each spring reaches with an energy [J], (springs, 2) [m], and whether
        that is an end of its domain."""
        count = len(self._springs.filled["functions"])
        ranges, locks = np.empty((count, 2)), np.empty(count, dtype=bool)
        found = address(ranges), address(locks)
        self._library.reachable(self._address, energy, count, ways.address, *found)
        return ranges, locks

    def largest(
        self, order: int, ranges: Array, numbers: Indices | None, shares: Array
    ) -> tuple[Array, bool] | None:
        """Largest size of the tension (1) [N], or largest stiffness (2) [N/m], of springs, of all
        by default, at shares of their ranges (numbers, 2) [m], at least 0, NaN where one is NaN;
        and whether all are finite.  None where a range is not inside of a domain."""
        out, ranges, which = np.empty(len(ranges)), np.ascontiguousarray(ranges), None
        if numbers is not None:
            numbers = np.ascontiguousarray(numbers, dtype=np.int64)
            which = address(numbers)
        given = which, address(ranges), address(shares), len(shares), address(out)
        found = self._library.largest(self._address, order, len(ranges), *given)
        return (out, found == FINITE) if found else None
