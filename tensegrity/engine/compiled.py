"""Compiled code: loops, of generated laws and geometry and the C text of a chain or a network; and
functions of vectors, evaluated by CasADi where there is no compiler."""

from __future__ import annotations

import ctypes
from functools import cached_property

import numpy as np

from tensegrity.engine.codegen import c_text, evaluate_text, stepper_text
from tensegrity.engine.disk_cache import cached
from tensegrity.engine.law import DERIVATIVES, evaluate, named
from tensegrity.engine.native import concatenated, library, pointer
from tensegrity.errors import CompilerError
from tensegrity.once import once, undisturbed

APART = ("nystrom", "openings")  # kinds of steps that do not depend on the laws
PREFIX = "tensegrity_"  # of names in C, which must differ from those of libc


class Compiled:
    """A compiled loop over bonds of some laws.

    Parameters
    ----------
    laws : tuple of Law
        See `codegen.c_text`.
    own : tuple, optional
        See `Bonds.own`.
    dim : int, optional
        Number of coordinates of a site in a network; 0 for a chain.
    batch : int, optional
        Number of chains advanced by one call; the last axis of u and v if above 1.
    extended : bool, optional
        Compile the same text with long double, as a reference for tests.
    forces : tuple of ForceLaw, optional
        Forces of time, displacement and velocity, in steps of the kind "nystrom".
    """

    def __init__(self, laws, own=None, dim=0, batch=1, extended=False, forces=()):
        self.forces = forces
        self.laws, self.own, self.dim, self.batch = laws, own or (None,) * len(laws), dim, batch
        self.dtype = np.dtype(np.longdouble if extended else np.float64)
        self._flags = ["-DEXTENDED"] * extended
        self._sizes = [f"-DBATCH={batch}"] * (batch > 1) + [f"-DDIM={dim}"] * (dim > 0)
        self._made = {}

    def steps(self, kind):
        """What advances by steps of one kind.

        Returns
        -------
        advance, postprocess : function
            The second turns copies of u and v into the output state; None where u and v are that
            state already.
        stage : int or None
            Address of the stage that these take, where they are compiled apart from the laws.
        """
        apart = kind in APART
        given = self.dim, kind, self.forces, *self._flags, *self._sizes
        made = _stepper(*given) if apart else self._loop(kind)
        ending = f"_{kind}" * bool(kind)
        functions = [getattr(made, name + ending, None) for name in ("advance", "postprocess")]
        return *functions, pointer(self.library.stage) if apart else None

    @cached_property
    def library(self):
        """The library of stages, and of steps of splittings."""
        return self._loop("")

    @cached_property
    def evaluator(self):
        """The library that evaluates a single law."""
        (law,) = self.laws
        text = cached(named("evaluator", self.laws), lambda: evaluate_text(law))
        return library(text, self._flags)

    def _loop(self, steps):
        """The library for a kind of steps; separate, as each takes long to compile."""
        if steps not in self._made:
            given = self.laws, self.own, self.dim, steps
            text = cached(named("loop", *given), lambda: c_text(*given))
            self._made[steps] = library(text, [*self._flags, *self._sizes])
        return self._made[steps]

    @classmethod
    def of(cls, bonds, batch=1, extended=False):
        """The loop for given bonds.

        Parameters
        ----------
        bonds : Bonds
        batch : int, optional
        extended : bool, optional

        Returns
        -------
        Compiled
        """
        return cls(bonds.laws, bonds.own, bonds.dim, batch, extended)

    def evaluate(self, order, parameters, r):
        """A derivative of the energy of a single law at elongations r.

        Parameters
        ----------
        order : int
            Order of the derivative, 0 to 3.
        parameters : ndarray, (at least its parameters,) or (those, n)
            In common, or for each place along the last axis of r.
        r : ndarray, C-contiguous, (..., n)
            [m]

        Returns
        -------
        ndarray, shape of r
            [J], [N], [N/m] or [N/m^2].
        """
        (law,) = self.laws
        if DERIVATIVES[order] not in law.compiled:
            return evaluate(law, order, parameters, r)
        p, out = self.numbers(parameters), np.empty_like(r)
        size = r.size if p.ndim == 1 else r.shape[-1]
        given = p.ctypes.data, r.ctypes.data, out.ctypes.data
        self.evaluator.evaluate(order, p.ndim > 1, r.size // max(size, 1), size, *given)
        return out

    def numbers(self, array):
        """An array in the precision of the loop."""
        return np.ascontiguousarray(array, dtype=self.dtype)


@once
def _stepper(dim, steps, forces, *flags):
    key = named("stepper", forces, dim, steps)
    return library(cached(key, lambda: stepper_text(dim, steps, forces)), flags)


@once
def compiled(laws, own, dim, batch, forces=()):
    """The loop for some laws, cached; see `Compiled`.

    Parameters
    ----------
    laws, own, dim, batch, forces
        As of `Compiled`.

    Returns
    -------
    Compiled
    """
    return Compiled(laws, own, dim, batch, forces=forces)


@once
def loop_of_law(law):
    """The loop of one law, or None without a compiler; springs can be evaluated in either case."""
    loop = compiled((law,), (None,), 0, 1)
    try:
        return loop.evaluator and loop
    except CompilerError:
        return None


def evaluated(law, order, parameters, r):
    """A derivative of the energy of a law, evaluated by CasADi where there is no compiler.

    Parameters
    ----------
    law : Law
    order : int
    parameters, r : ndarray
        As of `Compiled.evaluate`.

    Returns
    -------
    ndarray, shape of r
    """
    loop = loop_of_law(law)
    if loop is None:
        return evaluate(law, order, parameters, r)
    return loop.evaluate(order, parameters, r)


class Functions:
    """Named functions of up to 8 vectors, each with a vector as its result.

    They may be called by several threads at the same time.

    Parameters
    ----------
    parts : tuple, or None
        Key of the functions in `cached`.
    make : callable () -> dict of str to casadi.Function
        Called where they are not cached, or not compiled.
    more : str, optional
        Further C text, compiled after them.
    flags : sequence of str, optional
        Additional flags of the compiler.

    Attributes
    ----------
    library : ctypes.CDLL or None
    """

    def __init__(self, parts, make, more="", flags=()) -> None:
        self.made = once(make)
        stored = cached(parts, lambda: written(self.made()))
        self._sizes = stored["sizes"]
        try:
            self.library = library(concatenated([stored["text"], "map.c", more]), flags)
        except CompilerError:
            self.library = None

    def __call__(self, name, *arguments):
        """Results at n places.

        Parameters
        ----------
        name : str
        *arguments : array_like, (n, size) or (size,)
            One row for each place, or one for all.

        Returns
        -------
        ndarray, (n, size), or (size,) where no argument has a row for each place
        """
        rows = [np.ascontiguousarray(x, dtype=float) for x in arguments]
        counts = [len(x) for x in rows if x.ndim == 2]
        count = counts[0] if counts else 1
        if self.library is None:
            columns = [x.T if x.ndim == 2 else x for x in rows]
            with undisturbed():
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
    """C text of functions, and the numbers of their inputs and outputs; a value for `cached`."""
    import casadi as ca

    generator, sizes = ca.CodeGenerator("functions.c"), {}
    for name, function in functions.items():
        x = function.sx_in()  # of scalar expressions only
        dense = ca.Function(PREFIX + name, x, [ca.densify(function(*x))])
        generator.add(dense)
        takes = [dense.numel_in(k) for k in range(dense.n_in())]
        sizes[name] = takes, dense.numel_out(0)
    return {"text": generator.dump(), "sizes": sizes}
