"""Energies of many states of a chain in one call: see `energies.c`."""

from __future__ import annotations

import ctypes
from importlib.resources import files
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.engine.compiled import Compiled
from tensegrity.engine.native import address, library
from tensegrity.once import once

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

    from tensegrity.typing import Array

_ADDRESS, _NUMBER = ctypes.c_void_p, ctypes.c_longlong
EXACT = ("-ffp-contract=off",)


class _Alike(ctypes.Structure):
    _fields_ = [(name, _ADDRESS) for name in ("function", "parameters", "low", "high", "members")]
    _fields_ += [(name, _NUMBER) for name in ("own", "count")]


@once
def _energies() -> Any:
    function = library(files(__package__).joinpath("energies.c").read_text(), EXACT).energies
    function.argtypes = [_ADDRESS, _NUMBER, _ADDRESS, _NUMBER, _NUMBER, *[_ADDRESS] * 4]
    function.restype = _NUMBER
    return function


class ChainEnergies:
    """Bonds of a chain in sets, each of which one compiled function evaluates.

    Parameters
    ----------
    mass : ndarray, (sites,)
        [kg]
    sets : sequence of (Compiled, ndarray, ndarray, ndarray)
        The loop of a law; parameters, (parameters,) or of each bond (parameters, bonds); domain
        [m], (2, 1) or (2, bonds); numbers of the bonds.
    """

    def __init__(self, mass: Array, sets: Sequence[tuple[Compiled, Array, Array, Array]]) -> None:
        self._mass, self._kept, self._function = mass, [], _energies()
        self._sets = (_Alike * len(sets))()
        for row, (loop, parameters, domain, bonds) in zip(self._sets, sets, strict=True):
            own = parameters.ndim == 2
            arrays = loop.numbers(loop.padded(parameters)), *np.ascontiguousarray(domain)
            bonds = np.ascontiguousarray(bonds, dtype=np.int64)
            self._kept += [loop, *arrays, bonds]
            function = loop.energies[own]
            row.function = ctypes.cast(function, _ADDRESS).value
            row.parameters, row.low, row.high = (x.ctypes.data for x in arrays)
            row.members, row.own, row.count = bonds.ctypes.data, own, len(bonds)
        self._given = ctypes.addressof(self._sets), len(sets), mass.ctypes.data, len(mass)

    def __call__(self, u: Array, v: Array) -> Array | None:
        """Total energies [J] of states u and v, (..., sites); None where an elongation is outside
        of its domain, or the arrays are not as a loop takes them."""
        sites = len(self._mass)
        if u.shape != v.shape or u.shape[-1:] != (sites,) or not (_fits(u) and _fits(v)):
            return None
        total = np.empty(u.shape[:-1])
        scratch = np.empty(2 * sites)
        pointers = address(u), address(v), address(scratch), address(total)
        return total if self._function(*self._given, total.size, *pointers) else None


def _fits(x: Array) -> bool:
    return x.dtype == np.float64 and x.flags.c_contiguous
