"""CasADi functions of vectors as C, compiled and kept; on CasADi's machine without a compiler."""

from __future__ import annotations

import ctypes

import numpy as np

from tensegrity.engine.kept import kept
from tensegrity.engine.native import joined, library, pointer
from tensegrity.errors import CompilerError
from tensegrity.once import once

PREFIX = "tensegrity_"  # in C: where its address is taken, a name must not be one of libc too


class Functions:
    """Named functions of up to 8 vectors with one vector as their result.

    Any number of threads may call them at once.

    Parameters
    ----------
    parts : tuple, or None
        What names them in `kept`.
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
        found = kept(parts, lambda: written(self.made()))
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
    """C text of functions, and how many numbers they take and give: for `kept`."""
    import casadi as ca

    generator, sizes = ca.CodeGenerator("functions.c"), {}
    for name, function in functions.items():
        x = function.sx_in()  # of scalar expressions only
        dense = ca.Function(PREFIX + name, x, [ca.densify(function(*x))])
        generator.add(dense)
        takes = [dense.numel_in(k) for k in range(dense.n_in())]
        sizes[name] = takes, dense.numel_out(0)
    return {"text": generator.dump(), "sizes": sizes}
