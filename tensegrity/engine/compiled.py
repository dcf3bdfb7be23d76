"""The loop as machine code: generated laws and geometry, and the C of a line or a network."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from tensegrity.engine.codegen import c_text
from tensegrity.engine.kept import kept
from tensegrity.engine.law import DERIVATIVES, Change, evaluate, facts, named
from tensegrity.engine.native import library
from tensegrity.errors import CompilerError
from tensegrity.once import once


class Compiled:
    """Laws and a loop over bonds of them.

    Parameters
    ----------
    laws : tuple of Law
        Or one law whose parameters change in time, and its `Change`.
    own : tuple, optional
        As `Bonds.own`.
    dim : int, optional
        Coordinates of a site in a network; 0 for a line.
    lanes : int, optional
        Chains that one call advances; the last axis of u and v where there are more than one.
    extended : bool, optional
        Compile the same text in the platform's long double, as a reference for tests.
    """

    def __init__(self, laws, own=None, dim=0, lanes=1, extended=False):
        self.laws, self.own, self.dim, self.lanes = laws, own or (None,) * len(laws), dim, lanes
        self.dtype = np.dtype(np.longdouble if extended else np.float64)
        self._flags = ["-DEXTENDED"] * extended + [f"-DLANES={lanes}"] * (lanes > 1)
        self._flags += [f"-DDIM={dim}"] * (dim > 0)
        self._opens = any(facts(law)["cut"] for law in laws if not isinstance(law, Change))
        self._made = {}

    def steps(self, kind):
        """Functions that advance by steps of a kind, and show what is looked at, or None where that
        is what they advance."""
        made = self.library if kind in ("", "nystrom") else self._compiled(kind)
        ending = f"_{kind}" * bool(kind)
        return [getattr(made, name + ending, None) for name in ("advance", "show")]

    @cached_property
    def library(self):
        """What steps of most methods need, and corrected ones where contacts may open."""
        return self._compiled("openings" if self._opens else "")

    def _compiled(self, steps):
        """A library: other steps than the usual ones take as long to compile as the rest."""
        if steps not in self._made:
            given = self.laws, self.own, self.dim, steps
            text = kept(named("loop", *given), lambda: c_text(*given))
            self._made[steps] = library(text, self._flags)
        return self._made[steps]

    @classmethod
    def of(cls, bonds, lanes=1, extended=False):
        """The loop for given `Bonds`."""
        return cls(bonds.laws, bonds.own, bonds.dim, lanes, extended)

    def evaluate(self, order, parameters, r):
        """The order-th derivative of a law alone at elongations r.

        Parameters
        ----------
        order : int
        parameters : ndarray, (at least its parameters,) or (those, n)
            In common, or those of each place along the last axis of r.
        r : ndarray, C-contiguous, (..., n)
        """
        (law,) = self.laws
        if DERIVATIVES[order] not in law.compiled:
            return evaluate(law, order, parameters, r)
        p, out = self.numbers(parameters), np.empty_like(r)
        size = r.size if p.ndim == 1 else r.shape[-1]
        given = p.ctypes.data, r.ctypes.data, out.ctypes.data
        self.library.evaluate(order, p.ndim > 1, r.size // max(size, 1), size, *given)
        return out

    def numbers(self, array):
        """An array as the loop takes it."""
        return np.ascontiguousarray(array, dtype=self.dtype)


@once
def compiled(laws, own, dim, lanes):
    """The loop for these laws."""
    return Compiled(laws, own, dim, lanes)


@once
def single(law):
    """The loop of one law, or None without a compiler: springs are looked at all the same."""
    loop = compiled((law,), (None,), 0, 1)
    try:
        return loop.library and loop
    except CompilerError:
        return None


def evaluated(law, order, parameters, r):
    """As `Compiled.evaluate`, on CasADi's machine without a compiler."""
    loop = single(law)
    if loop is None:
        return evaluate(law, order, parameters, r)
    return loop.evaluate(order, parameters, r)
