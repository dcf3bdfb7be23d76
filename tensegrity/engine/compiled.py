"""The loop as machine code: generated laws and geometry, and the C of a line or a network."""

from __future__ import annotations

import ctypes
from functools import cached_property

import numpy as np

from tensegrity.engine import geometry
from tensegrity.engine.bonds import GROUP
from tensegrity.engine.codegen import c_text
from tensegrity.engine.kept import kept
from tensegrity.engine.law import DERIVATIVES, evaluate, facts, named
from tensegrity.engine.native import library
from tensegrity.errors import CompilerError
from tensegrity.once import once


class Compiled:
    """Laws and a loop over bonds of them.

    Parameters
    ----------
    laws : tuple of Law
    own : tuple, optional
        As `Bonds.own`.
    dim : int, optional
        Coordinates of a site in a network; 0 for a line.
    lanes : int, optional
        Chains that one call advances; the last axis of u and v where there are more than one.
    extended : bool, optional
        Compile the same text in the platform's long double, as a reference for tests.
    """

    kind = "loop"  # what its text is kept under
    extra: tuple[str, ...] = ()  # behind the loop
    corrects = True  # whether it may be asked for the steps of corrected methods

    def __init__(self, laws, own=None, dim=0, lanes=1, extended=False):
        self.laws, self.own, self.dim, self.lanes = laws, own or (None,) * len(laws), dim, lanes
        self.dtype = np.dtype(np.longdouble if extended else np.float64)
        self._most = max((len(law.parameters) for law in laws), default=0)
        self._flags = ["-DEXTENDED"] * extended + [f"-DLANES={lanes}"] * (lanes > 1)
        self._flags += [f"-DDIM={dim}"] * (dim > 0)
        self._has_openings = self.corrects and any(facts(law)["cut"] for law in laws)
        self.library = found = self._compiled(self._has_openings)
        address, number = ctypes.c_void_p, ctypes.c_longlong
        for name, arguments in (
            ("advance", [address] * 2 + [number] * 2),
            ("show", [address] * 4),
            *[("advance_together", [address, number, number])] * (dim > 0),
            ("advance_nystrom", [address] * 2 + [number] * 2),
            ("evaluate", [number] * 3 + [address] * 3),
            ("evaluate_own", [number] * 4 + [address] * 3),
            ("energies", [number] * 2 + [address] * 3),
            ("energies_own", [number] * 2 + [address] * 3),
        ):
            function = found[name]
            function.argtypes, function.restype = arguments, None
            setattr(self, name if name.startswith(("advance", "show")) else f"_{name}", function)

    def _compiled(self, openings, implicit=False):
        """The library, with the steps of corrected or of implicit methods or without: compiling
        them takes as long as the rest."""
        laws, own, dim, loop = self.laws, self.own, self.dim, "net" if self.dim else "line"

        def text():
            parts = (geometry.helpers(dim), geometry.side_by_side(dim)) if dim else ()
            more = {"openings": openings, "extra": self.extra, "implicit": implicit}
            return c_text(laws, loop, own, *parts, **more)

        parts = named(self.kind, laws, loop, own, dim, openings, implicit)
        return library(kept(parts, text), self._flags)

    @cached_property
    def openings(self):
        """Functions that advance by steps of corrected methods, and show what is looked at."""
        found = self.library if self._has_openings else self._compiled(True)
        functions = found.advance_openings, found.show_openings
        address, number = ctypes.c_void_p, ctypes.c_longlong
        for function, rest in zip(functions, ([number] * 2, [address] * 2), strict=True):
            function.argtypes = [address] * 2 + rest
        return functions

    @cached_property
    def implicit(self):
        """Function that advances by steps of the implicit midpoint rule; what it returns is 0, or
        1 where equations were not solved."""
        function = self._compiled(False, implicit=True).advance_implicit
        function.argtypes = [ctypes.c_void_p] * 2 + [ctypes.c_longlong] * 2
        return function

    @classmethod
    def of(cls, bonds, lanes=1, extended=False):
        """The loop for given `Bonds`."""
        return cls(bonds.laws, bonds.own, bonds.dim, lanes, extended)

    def evaluate(self, law, order, parameters, r):
        """The order-th derivative of law number `law` at elongations r.

        Parameters
        ----------
        law, order : int
        parameters : ndarray, (at least its parameters,) or (those, n)
            In common, or those of each place along the last axis of r.
        r : ndarray, C-contiguous, (..., n)
        """
        if DERIVATIVES[order] not in self.laws[law].compiled:
            return evaluate(self.laws[law], order, parameters, r)
        p = self.padded(parameters)
        out = np.empty_like(r)
        given = p.ctypes.data, r.ctypes.data, out.ctypes.data
        if p.ndim == 1:
            self._evaluate(law, order, r.size, *given)
        elif r.size:
            self._evaluate_own(law, order, r.size // r.shape[-1], r.shape[-1], *given)
        return out

    def padded(self, parameters):
        """Parameters of one law as `evaluate` takes them."""
        if len(parameters) == self._most:
            return self.numbers(parameters)
        p = np.zeros((self._most, *np.shape(parameters)[1:]), dtype=self.dtype)
        p[: len(parameters)] = parameters[: self._most]
        return p

    @property
    def energies(self):
        """Functions of energies, of bonds with parameters in common, and each with its own."""
        return self._energies, self._energies_own

    @property
    def values(self):
        """Function of values.c; of one law, on a line, whose bonds have no parameters of their
        own."""
        return self.library.values

    def numbers(self, array):
        """An array as the loop takes it."""
        return np.ascontiguousarray(array, dtype=self.dtype)

    def parameters(self, bonds, runs):
        """Fields of a scene: `shared`, what bonds of a run have in common, (runs, most); their
        `own`, and where these begin, `own_at`."""
        places = np.zeros(len(runs.law), dtype=np.int64)
        shared = np.zeros((len(runs.law), bonds.parameters.shape[1]))
        own, at = [np.zeros(0)], 0
        for k, law in enumerate(runs.law):
            first, last = runs.first[k], runs.first[k + 1]
            springs = bonds.group[_nearest(runs.source[first:last])]
            shared[k] = bonds.parameters[springs.flat[0]]
            places[k] = at
            if runs.own[k]:
                if self.lanes > 1 and springs.ndim == 1:  # the same in all lanes
                    springs = np.repeat(springs[:, None], self.lanes, axis=1)
                rows = bonds.parameters[:, list(self.own[law])][springs]  # (places[, lanes], own)
                own.append(np.moveaxis(rows, -1, 0).ravel())
                at += own[-1].size
        own.append(np.zeros(GROUP))  # packs may read beyond the last
        own = self.numbers(np.concatenate(own))
        return {"shared": self.numbers(shared), "own": own, "own_at": places}


def _nearest(source):
    """The bond of each place, for a filling the one before it."""
    return source[np.maximum.accumulate(np.where(source >= 0, np.arange(len(source)), 0))]


@once
def compiled(laws, own, dim, lanes):
    """The loop for these laws."""
    return Compiled(laws, own, dim, lanes)


@once
def single(law):
    """The loop of one law, or None without a compiler: springs are looked at all the same."""
    try:
        return compiled((law,), (None,), 0, 1)
    except CompilerError:
        return None


def evaluated(law, order, parameters, r):
    """As `Compiled.evaluate`, on CasADi's machine without a compiler."""
    loop = single(law)
    if loop is None:
        return evaluate(law, order, parameters, r)
    return loop.evaluate(0, order, parameters, r)
