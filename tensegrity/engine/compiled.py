"""What runs as machine code: loops, of generated laws and geometry and C of a line or a network;
and functions of vectors, on CasADi's machine without a compiler."""

from __future__ import annotations

import ctypes
from functools import cached_property

import numpy as np

from tensegrity.engine.codegen import c_text
from tensegrity.engine.disk_cache import cached
from tensegrity.engine.law import DERIVATIVES, Change, evaluate, facts, named
from tensegrity.engine.native import joined, library, pointer
from tensegrity.errors import CompilerError
from tensegrity.once import once

PREFIX = "tensegrity_"  # in C: where its address is taken, a name must not be one of libc too


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
            text = cached(named("loop", *given), lambda: c_text(*given))
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


class Functions:
    """Named functions of up to 8 vectors with one vector as their result.

    Any number of threads may call them at once.

    Parameters
    ----------
    parts : tuple, or None
        What names them in `cached`.
    make : callable () -> dict of str to casadi.Function
        Run where they are not kept, or not compiled.
    more : str, optional
        C to be compiled behind them.
    flags : sequence of str, optional
        Of the compiler, besides the usual ones.

    Attributes
    ----------
    library : ctypes.CDLL or None
    """

    def __init__(self, parts, make, more="", flags=()) -> None:
        self.made = once(make)
        found = cached(parts, lambda: written(self.made()))
        self._sizes = found["sizes"]
        try:
            self.library = library(joined([found["text"], "map.c", more]), flags)
        except CompilerError:
            self.library = None

    def __call__(self, name, *arguments):
        """Results at n places.

        Parameters
        ----------
        name : str
        *arguments : array_like, (n, size) or (size,)
            One for each place, or the same for all.

        Returns
        -------
        ndarray, (n, size), or (size,) where no argument has a row for each place
        """
        rows = [np.ascontiguousarray(x, dtype=float) for x in arguments]
        counts = [len(x) for x in rows if x.ndim == 2]
        count = counts[0] if counts else 1
        if self.library is None:
            columns = [x.T if x.ndim == 2 else x for x in rows]
            result = np.array(self.made()[name](*columns)).reshape(-1, count).T
        else:
            result = self._mapped(name, rows, count)
        return result if counts else result[0]

    def _mapped(self, name, rows, count):
        takes, gives = self._sizes[name]
        if [x.shape[-1] for x in rows] != takes or any(x.size != x.shape[-1] * count
                                                       for x in rows if x.ndim == 2):  # fmt: skip
            raise ValueError(f"{name} takes vectors of {takes}, not {[x.shape for x in rows]}")
        result = np.empty((count, gives))
        given = (ctypes.c_void_p * len(rows))(*(x.ctypes.data for x in rows))
        steps = (ctypes.c_longlong * len(rows))(*(x.shape[-1] * (x.ndim == 2) for x in rows))
        function = pointer(self.library[PREFIX + name])
        self.library.map(function, count, gives, len(rows), given, steps, result.ctypes.data)
        return result


def written(functions):
    """C text of functions, and how many numbers they take and give: for `cached`."""
    import casadi as ca

    generator, sizes = ca.CodeGenerator("functions.c"), {}
    for name, function in functions.items():
        x = function.sx_in()  # of scalar expressions only
        dense = ca.Function(PREFIX + name, x, [ca.densify(function(*x))])
        generator.add(dense)
        takes = [dense.numel_in(k) for k in range(dense.n_in())]
        sizes[name] = takes, dense.numel_out(0)
    return {"text": generator.dump(), "sizes": sizes}
