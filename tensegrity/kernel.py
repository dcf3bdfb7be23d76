"""The loop that advances a chain, compiled where there is a compiler, else on CasADi's machine.

Both engines offer the same two things: `evaluate` for a law at many elongations, and `bind`,
which prepares a chain's arrays once so that `advance(steps)` costs no more than a call.
"""

from __future__ import annotations

import ctypes
import warnings
from dataclasses import dataclass
from functools import cache

import numpy as np

from tensegrity import codegen, pieces, plain
from tensegrity.implicit import BoundGauss
from tensegrity.methods import Splitting
from tensegrity.native import CompilerError, library
from tensegrity.once import once


@dataclass(frozen=True)
class Segments:
    """Bonds of a chain in runs of equal law and parameters.

    Attributes
    ----------
    laws : tuple of Law
        The different laws that occur.
    first : ndarray of int, (segments + 1,)
        First bond of each segment; the last entry is the number of bonds.
    law : ndarray of int, (segments,)
        Index into `laws`.
    parameters : ndarray, (segments, most parameters of any law)
    """

    laws: tuple
    first: np.ndarray
    law: np.ndarray
    parameters: np.ndarray


class _Chain(ctypes.Structure):
    _arrays = ("u", "v", "w", "parameters", "kicks", "drifts", "range", "first", "law")
    _fields_ = [(name, ctypes.c_void_p) for name in _arrays] + [
        (name, ctypes.c_longlong) for name in ("segments", "stages", "closing")
    ]


class _Nystrom(ctypes.Structure):
    _arrays = ("nodes", "velocities", "matrix", "positions", "dt", "place", "slopes", "travel")
    _fields_ = [(name, ctypes.c_void_p) for name in _arrays] + [
        (name, ctypes.c_longlong) for name in ("stages", "count", "moving")
    ]


def advances(found):
    """The functions of a loaded loop that do steps, for splittings and for Nystrom methods."""
    found.advance.argtypes = [ctypes.c_void_p, ctypes.c_longlong]
    found.advance_nystrom.argtypes = [ctypes.c_void_p] * 2 + [ctypes.c_longlong]
    found.advance.restype = found.advance_nystrom.restype = None
    return found.advance, found.advance_nystrom


def splitting_rows(method, dt, dtype):
    """Kicks and drifts times dt, number of stages, and whether a kick closes the step."""
    if not isinstance(method, Splitting):
        return np.zeros(1, dtype), np.zeros(1, dtype), 0, 0
    kicks = np.multiply(method.kicks, dt, dtype=dtype)
    return kicks, np.multiply(method.drifts, dt, dtype=dtype), method.stages, int(kicks[-1] != 0)


class Steps:
    """Steps of a method on a bound scene.

    Parameters
    ----------
    functions : pair of foreign functions
        From `advances`.
    structure : ctypes.Structure
        The scene, with the rows of a splitting in it.
    method : Method
    dt : float
        [s]
    u : ndarray
        Its displacements, whose type and size scratch arrays take.
    moving : int
        Leading entries of `u` that belong to sites.
    """

    def __init__(self, functions, structure, method, dt, u, moving):
        self.travel = np.zeros(1, dtype=u.dtype)
        self._function, self._kept = functions[0], [structure]
        self._addresses = [ctypes.addressof(structure)]
        if not isinstance(method, Splitting):
            dt = np.array([dt], dtype=u.dtype)
            arrays = [
                np.multiply(method.nodes, dt),
                np.multiply(method.velocities, dt),
                np.multiply(method.matrix, dt**2),
                np.multiply(method.positions, dt**2),
                dt,
                np.zeros(u.size, dtype=u.dtype),
                np.zeros((method.stages, u.size), dtype=u.dtype),
                self.travel,
            ]
            rows = _Nystrom(*(a.ctypes.data for a in arrays), method.stages, u.size, moving)
            self._function = functions[1]
            self._kept += [arrays, rows]
            self._addresses.append(ctypes.addressof(rows))

    def advance(self, steps):
        """Do whole steps."""
        self._function(*self._addresses, steps)


class Compiled:
    """The laws and the loop as machine code.

    Parameters
    ----------
    laws : tuple of Law
    extended : bool
        Compile the same text in the platform's long double, as a reference for tests.
    lanes : int
        Chains that one call advances; the last axis of u and v where there are more than one.
    """

    name = "compiled"

    def __init__(self, laws, extended=False, lanes=1):
        self._laws, self.lanes = laws, lanes
        self.dtype = np.dtype(np.longdouble if extended else np.float64)
        flags = ["-DEXTENDED"] * extended + [f"-DLANES={lanes}"] * (lanes > 1)
        found = library(codegen.c_text(laws), flags)
        self.advances = advances(found)
        self.advance_part = found.advance_part
        self.advance_part.argtypes = [ctypes.c_void_p] + [ctypes.c_longlong] * 3
        self.advance_part.restype = None
        self._evaluate = found.evaluate
        self._evaluate.argtypes = [ctypes.c_longlong] * 3 + [ctypes.c_void_p] * 3
        self._evaluate.restype = None

    def evaluate(self, law, order, parameters, r):
        """The order-th derivative of law number `law`, elementwise on a contiguous array."""
        if codegen.DERIVATIVES[order] not in self._laws[law].compiled:
            return Interpreted(self._laws).evaluate(law, order, parameters, r)
        p = np.array(parameters, dtype=self.dtype)
        out = np.empty_like(r)
        self._evaluate(law, order, r.size, p.ctypes.data, r.ctypes.data, out.ctypes.data)
        return out

    def bind(self, u, v, inverse_mass, segments, method, dt, divided=True):
        """Prepare a chain; `u` and `v` are advanced in place, long ones on several threads if
        they may be `divided`."""
        scene = self, u, v, inverse_mass, segments, method, dt
        if not method.explicit:
            return BoundGauss(*scene)
        count = pieces.threads() if divided and u.size > pieces.LONG else 1
        if count > 1 and isinstance(method, Splitting) and self.lanes == 1:
            return pieces.BoundPieces(*scene, count)
        return _BoundCompiled(*scene)


class _BoundCompiled:
    def __init__(self, kernel, u, v, inverse_mass, segments, method, dt):
        def real(array):
            return np.ascontiguousarray(array, dtype=kernel.dtype)

        count = len(segments.law)
        kicks, drifts, *counts = splitting_rows(method, dt, kernel.dtype)
        self.range = np.empty((count, 2), dtype=kernel.dtype)
        self.forget_range()
        self._arrays = [  # kept: the structure holds bare addresses
            u,
            v,
            real(np.repeat(inverse_mass, kernel.lanes)),
            real(segments.parameters),
            kicks,
            drifts,
            self.range,
            np.ascontiguousarray(segments.first, dtype=np.int64),
            np.ascontiguousarray(segments.law, dtype=np.int64),
        ]
        self._structure = _Chain(*(a.ctypes.data for a in self._arrays), count, *counts)
        self._steps = Steps(kernel.advances, self._structure, method, dt, u, u.size)
        self._part = kernel.advance_part, ctypes.addressof(self._structure)

    def forget_range(self):
        """Start anew to record the smallest and the largest elongation of each segment."""
        self.range[:, 0], self.range[:, 1] = np.inf, -np.inf

    def advance(self, steps):
        """Advance u and v by whole steps."""
        self._steps.advance(steps)

    def advance_part(self, steps, opened, close):
        """Steps of a splitting whose first kick includes the last one of the steps before, if
        `opened`, and whose own last kick is left out, unless `close`."""
        function, address = self._part
        function(address, steps, opened, close)


class Interpreted:
    """The same on CasADi's virtual machine: no compiler needed, 10 to 30 times slower."""

    name = "interpreted"
    dtype = np.dtype(np.float64)
    FOLD = 50  # steps done in one call of the machine

    def __init__(self, laws):
        self._laws = laws

    def evaluate(self, law, order, parameters, r):
        """The order-th derivative of law number `law`, elementwise on a contiguous array."""
        function = codegen.functions(self._laws[law])[codegen.DERIVATIVES[order]]
        count = len(self._laws[law].parameters)
        p = np.asarray(parameters, dtype=float)[:count]
        return np.array(function(r.reshape(1, -1), p.reshape(-1, 1))).reshape(r.shape)

    def bind(self, u, v, inverse_mass, segments, method, dt):
        """Prepare a chain; `u` and `v` are advanced in place."""
        kind = _BoundInterpreted if isinstance(method, Splitting) else _BoundPlain
        kind = kind if method.explicit else BoundGauss
        return kind(self, u, v, inverse_mass, segments, method, dt)


class _BoundInterpreted:
    def __init__(self, kernel, u, v, inverse_mass, segments, method, dt):
        self._u, self._v = u, v
        kicks, drifts, *_ = splitting_rows(method, dt, float)
        self.range = np.empty((len(segments.law), 2))
        self.forget_range()
        pairs = list(zip(kicks[:-1], drifts, strict=True))
        merged = [(kicks[0] + kicks[-1], drifts[0]), *pairs[1:]]
        passes = _Passes(kernel._laws, inverse_mass, segments)
        self._first = passes("first", pairs)
        self._repeat = passes("repeat", merged)
        self._many = self._repeat.fold(kernel.FOLD)
        self._fold = kernel.FOLD
        self._last = passes("last", [(kicks[-1], 0.0)]) if kicks[-1] else None

    def forget_range(self):
        """Start anew to record the smallest and the largest elongation of each segment."""
        self.range[:, 0], self.range[:, 1] = np.inf, -np.inf

    def advance(self, steps):
        """Advance u and v by whole steps."""
        if steps == 0:
            return
        state = np.concatenate([self._u, self._v, *self.range.T])
        state = self._first(state)
        for _ in range((steps - 1) // self._fold):
            state = self._many(state)
        for _ in range((steps - 1) % self._fold):
            state = self._repeat(state)
        if self._last is not None:
            state = self._last(state)
        state = np.array(state).ravel()
        sites, segments = len(self._u), len(self.range)
        self._u[:], self._v[:] = state[:sites], state[sites : 2 * sites]
        self.range[:] = state[2 * sites :].reshape(2, segments).T


class _BoundPlain:
    """Methods that are not splittings, step by step in NumPy."""

    def __init__(self, kernel, u, v, inverse_mass, segments, method, dt):
        self._u, self._v, self._weights = u, v, inverse_mass
        self._method, self._dt = method, dt
        self.range = np.empty((len(segments.law), 2))
        self.forget_range()
        self._tension = _Passes(kernel._laws, inverse_mass, segments).tension()

    forget_range = _BoundInterpreted.forget_range

    def advance(self, steps):
        """Advance u and v by whole steps."""
        plain.advance(self._pull, self._u, self._v, self._method, self._dt, steps, len(self._u))

    def _pull(self, u):
        f, low, high = (np.array(x).ravel() for x in self._tension(np.diff(u)))
        self.range[:, 0] = np.fmin(self.range[:, 0], low)
        self.range[:, 1] = np.fmax(self.range[:, 1], high)
        return self._weights * np.diff(f, prepend=0.0, append=0.0)


class _Passes:
    """CasADi functions that do given (kick, drift) pairs on the state [u, v, low, high]."""

    def __init__(self, laws, inverse_mass, segments):
        import casadi as ca

        self._tensions = [codegen.functions(law)["tension"] for law in laws]
        self._weights = ca.DM(np.asarray(inverse_mass, dtype=float))
        self._segments = segments

    def __call__(self, name, pairs):
        import casadi as ca

        sites, segments = self._weights.numel(), len(self._segments.law)
        ends = np.cumsum([0, sites, sites, segments, segments]).tolist()
        state = ca.MX.sym("state", ends[-1])
        u, v, low, high = ca.vertsplit(state, ends)
        for kick, drift in pairs:
            f, lowest, highest = self._tension(u[1:] - u[:-1])
            low, high = ca.fmin(low, lowest), ca.fmax(high, highest)
            v = v + kick * self._weights * (ca.vertcat(f, 0) - ca.vertcat(0, f))
            u = u + drift * v
        return ca.Function(name, [state], [ca.vertcat(u, v, low, high)])

    def tension(self):
        """The function r -> what `_tension` gives."""
        import casadi as ca

        r = ca.MX.sym("r", self._weights.numel() - 1)
        return ca.Function("tension", [r], self._tension(r))

    def _tension(self, r):
        """Tension of every bond, smallest and largest elongation of every segment."""
        import casadi as ca

        parts = ca.vertsplit(r, self._segments.first.tolist())
        forces = []
        for part, law, values in zip(
            parts, self._segments.law, self._segments.parameters, strict=True
        ):
            inputs = [[part], [ca.MX(value) for value in values]]
            forces.append(codegen.interpret(self._tensions[law], inputs, ca.MX))
        lows, highs = ([end(part) for part in parts] for end in (ca.mmin, ca.mmax))
        return ca.vertcat(*forces), ca.vertcat(*lows), ca.vertcat(*highs)


@once
def kernel(laws):
    """The engine for a tuple of laws: compiled, or interpreted with one warning."""
    try:
        return Compiled(laws)
    except CompilerError as error:
        warn_slow(str(error))
        return Interpreted(laws)


@cache
def warn_slow(reason):
    """Say once that there is no compiler."""
    warnings.warn(
        "chains run on CasADi's virtual machine, 10 to 30 times slower than compiled, because "
        f"of the C compiler: {reason}. Install gcc or clang, or the Python package ziglang, or "
        "set CC",
        RuntimeWarning,
        stacklevel=5,
    )
