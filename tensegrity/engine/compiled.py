"""The loop as machine code: generated laws and geometry, and the C of a line or a network."""

from __future__ import annotations

import ctypes

import numpy as np

from tensegrity.engine import codegen, geometry
from tensegrity.engine.bonds import by_spring
from tensegrity.engine.kept import kept
from tensegrity.engine.methods import Corrected, Splitting
from tensegrity.engine.native import library
from tensegrity.engine.openings import DEGREE, Openings
from tensegrity.once import once


def _structure(name, arrays, counts):
    fields = [(field, ctypes.c_void_p) for field in arrays.split()]
    fields += [(field, ctypes.c_longlong) for field in counts.split()]
    return type(name, (ctypes.Structure,), {"_fields_": fields})


_LINE = _structure(  # as in line.h
    "_Line",
    "u v w shared own kicks drifts range first law own_at range_at",
    "runs stages closing",
)
_NET = _structure(  # as in net.h
    "_Net",
    "u v force w load geometry shared own kicks drifts low high travel from to first law own_at",
    "runs contacts sites rows stages closing",
)
_NYSTROM = _structure(  # as in steps.c
    "_Nystrom",
    "nodes velocities matrix positions dt place slopes travel",
    "stages count moving",
)
_OPENINGS = _structure(  # as in openings.h
    "_Openings",
    "place side strength exponents betas tables nodes weights offsets dt "
    "before rate_before after rate_after u v end_u end_v end_a row",
    "count entries kicks degree",
)


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

    name = "compiled"

    def __init__(self, laws, own=None, dim=0, lanes=1, extended=False):
        self.laws, self.own, self.dim, self.lanes = laws, own or (None,) * len(laws), dim, lanes
        self.dtype = np.dtype(np.longdouble if extended else np.float64)
        self._most = max((len(law.parameters) for law in laws), default=0)
        flags = ["-DEXTENDED"] * extended + [f"-DLANES={lanes}"] * (lanes > 1)
        flags += [f"-DDIM={dim}"] * (dim > 0)
        loop = "net" if dim else "line"
        parts = codegen.named("loop", laws, loop, self.own, dim)
        found = library(kept(parts, lambda: self._text(loop)), flags)
        address, number = ctypes.c_void_p, ctypes.c_longlong
        for name, arguments in (
            ("advance", [address, number]),
            ("advance_part", [address] + [number] * 3),
            ("advance_nystrom", [address] * 2 + [number]),
            ("advance_openings", [address] * 2 + [number]),
            ("evaluate", [number] * 3 + [address] * 3),
            ("evaluate_own", [number] * 4 + [address] * 3),
        ):
            function = found[name]
            function.argtypes, function.restype = arguments, None
            setattr(self, name if name.startswith("advance") else f"_{name}", function)

    def _text(self, loop):
        helpers = geometry.helpers(self.dim) if self.dim else ()
        return codegen.c_text(self.laws, loop, self.own, helpers)

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
        if codegen.DERIVATIVES[order] not in self.laws[law].compiled:
            return codegen.evaluate(self.laws[law], order, parameters, r)
        rows = self._most
        if len(parameters) == rows:
            p = self.numbers(parameters)
        else:
            p = np.zeros((rows, *np.shape(parameters)[1:]), dtype=self.dtype)
            p[: len(parameters)] = parameters[:rows]
        out = np.empty_like(r)
        given = p.ctypes.data, r.ctypes.data, out.ctypes.data
        if p.ndim == 1:
            self._evaluate(law, order, r.size, *given)
        elif r.size:
            self._evaluate_own(law, order, r.size // r.shape[-1], r.shape[-1], *given)
        return out

    def numbers(self, array):
        """An array as the loop takes it."""
        return np.ascontiguousarray(array, dtype=self.dtype)

    def parameters(self, bonds, runs):
        """What bonds of a run have in common, (runs, most); their own, and where these begin."""
        places = np.zeros(len(runs.law), dtype=np.int64)
        shared = np.zeros((len(runs.law), bonds.parameters.shape[1]))
        own, at = [np.zeros(0)], 0
        for k, law in enumerate(runs.law):
            first, last = runs.first[k], runs.first[k + 1]
            springs = bonds.group[_nearest(runs.source[first:last])]
            shared[k] = bonds.parameters[springs.flat[0]]
            places[k] = at
            if runs.own[k]:
                rows = bonds.parameters[:, list(self.own[law])][springs]  # (places[, lanes], own)
                own.append(np.moveaxis(rows, -1, 0).ravel())
                at += own[-1].size
        return self.numbers(shared), self.numbers(np.concatenate(own)), places


def _nearest(source):
    """The bond of each place, for a filling the one before it."""
    return source[np.maximum.accumulate(np.where(source >= 0, np.arange(len(source)), 0))]


class _Bound:
    """Arrays bound to a loop: `advance` costs no more than a call.

    Attributes
    ----------
    range : ndarray, (springs, 2)
        Smallest and largest elongation of each different spring since `forget_range`.
    travel : float
        Bound on how far any coordinate of a site moved since then [m]; networks only.
    """

    def _set_steps(self, loop, structure, arrays, bonds, method, dt, moving, places=None):
        """Keep what the structure points to, and prepare the call of a method's steps."""
        self._structure, self._arrays = structure, arrays
        address = ctypes.addressof(structure)
        if isinstance(method, Splitting):
            self._call = loop.advance, (address,)
            self._part = loop.advance_part, address
            return
        if isinstance(method, Corrected):
            self._set_openings(loop, bonds, method, dt, places)
            return
        u, dt = arrays[0], np.array([dt], dtype=loop.dtype)
        rows = [
            np.multiply(method.nodes, dt),
            np.multiply(method.velocities, dt),
            np.multiply(method.matrix, dt**2),
            np.multiply(method.positions, dt**2),
            dt,
            np.zeros(u.size, dtype=loop.dtype),
            np.zeros((method.stages, u.size), dtype=loop.dtype),
            self._travel,
        ]
        steps = _NYSTROM(*(x.ctypes.data for x in rows), method.stages, u.size, moving)
        self._arrays += [rows, steps]
        self._call = loop.advance_nystrom, (address, ctypes.addressof(steps))

    def _set_openings(self, loop, bonds, method, dt, places):
        """Prepare the steps of a corrected method; `places` are those of the loop's contacts."""
        found, u = Openings(bonds, method, dt), self._arrays[0]
        of_bonds = [found.place, found.side, found.strength, found.row]
        if places is not None:
            real = places >= 0
            *numbers, row = (np.where(real, x[places], np.nan) for x in of_bonds)
            of_bonds = [*numbers, np.where(real, row, 0)]
        elif u.ndim > 1:
            shape = len(u) - 1, self._lanes
            of_bonds = [np.broadcast_to(x.reshape(len(x), -1), shape) for x in of_bonds]
        *numbers, row = of_bonds
        count = row.size
        rows = [
            *(loop.numbers(x) for x in numbers),
            *(loop.numbers(x) for x in (found.exponents, found.betas, found.tables)),
            *(loop.numbers(x) for x in method.rule),
            np.array([dt], dtype=loop.dtype),
            *np.zeros((4, count), dtype=loop.dtype),
            *np.zeros((5, u.size), dtype=loop.dtype),
            np.ascontiguousarray(row, dtype=np.int64),
        ]
        address = [x.ctypes.data for x in rows]
        steps = _OPENINGS(*address, count, u.size, len(found.nodes), DEGREE)
        self._arrays += [rows, steps]
        self._call = (
            loop.advance_openings,
            (ctypes.addressof(self._structure), ctypes.addressof(steps)),
        )

    def advance(self, steps):
        """Advance u and v by whole steps."""
        function, addresses = self._call
        function(*addresses, steps)

    def advance_part(self, steps, opened, close):
        """Steps of a splitting whose first kick includes the last one of the steps before, if
        `opened`, and whose own last kick is left out, unless `close`."""
        function, address = self._part
        function(address, steps, opened, close)

    @property
    def travel(self):
        return float(self._travel[0])


def _rows(method, dt, dtype):
    """Kicks and drifts times dt, number of stages, and whether a kick closes the step."""
    if isinstance(method, Corrected):
        method = method.base
    if not isinstance(method, Splitting):
        return np.zeros(1, dtype), np.zeros(1, dtype), 0, 0
    kicks = np.multiply(method.kicks, dt, dtype=dtype)
    return kicks, np.multiply(method.drifts, dt, dtype=dtype), method.stages, int(kicks[-1] != 0)


class BoundLine(_Bound):
    """A chain, or lanes of chains, advanced in place.

    Parameters
    ----------
    loop : Compiled
    u, v : ndarray, (sites,) or (sites, lanes)
    bonds : Bonds
    method : Method
    dt : float
        [s]
    runs : Runs, optional
        Those of `bonds`, or a part of them.
    seen : ndarray of bool, (runs,), optional
        Those whose elongations count; by default all.
    """

    def __init__(self, loop, u, v, bonds, method, dt, runs=None, seen=None):
        runs = bonds.runs if runs is None else runs
        seen = np.ones(len(runs.law), dtype=bool) if seen is None else seen
        self._runs, self._group, self._lanes = runs, bonds.group, loop.lanes
        shared, own, own_at = loop.parameters(bonds, runs)
        sizes = np.where(runs.own, 2 * loop.lanes * np.diff(runs.first), 2)
        range_at = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
        self._range = np.empty(range_at[-1], dtype=loop.dtype)
        self._travel = np.zeros(1, dtype=loop.dtype)
        self._springs = len(bonds.law)
        weights = np.asarray(bonds.inverse_mass)
        if loop.lanes > 1 and weights.ndim == 1:
            weights = np.repeat(weights, loop.lanes)
        kicks, drifts, *counts = _rows(method, dt, loop.dtype)
        arrays = [
            u, v, loop.numbers(weights), shared, own, kicks, drifts, self._range,
            (runs.first - runs.first[0]).astype(np.int64),
            (2 * runs.law + runs.own).astype(np.int64), own_at, range_at,
        ]  # fmt: skip
        structure = _LINE(*(x.ctypes.data for x in arrays), len(runs.law), *counts)
        self._set_steps(loop, structure, arrays, bonds, method, dt, u.size)
        self._kept, self._low, self._high = self._order(range_at, seen)
        self._apart = np.array_equal(self._kept, np.arange(self._springs))
        self.forget_range()

    def _order(self, range_at, seen):
        """The spring that each kept range belongs to, and where its two numbers are."""
        springs, low, high = [], [], []
        for k in np.flatnonzero(seen):
            start, stop = range_at[k : k + 2]
            here, middle = self._group[self._runs.members(k)], (start + stop) // 2
            if not self._runs.own[k]:
                here = here.flat[:1]
            elif self._lanes > 1 and here.ndim == 1:
                here = np.repeat(here, self._lanes)
            springs.append(np.ravel(here))
            low.append(np.arange(start, middle))
            high.append(np.arange(middle, stop))
        return np.concatenate(springs), np.concatenate(low), np.concatenate(high)

    def forget_range(self):
        """Start anew to record elongations."""
        self._range[self._low], self._range[self._high] = np.inf, -np.inf

    @property
    def range(self):
        found = self._range[self._low], self._range[self._high]
        if self._apart:
            return np.stack(found, axis=1)
        return by_spring(self._kept, self._springs, *found)


class BoundNet(_Bound):
    """A network advanced in place; rows of u and v are sites, walls, and a spare one."""

    def __init__(self, loop, u, v, bonds, method, dt):
        runs, contacts = bonds.runs, bonds.contacts
        source, spare, dim = runs.source, contacts.rows - 1, loop.dim
        real = source >= 0
        filled = np.where(real, source, 0)
        place = np.zeros((dim + 2, len(source)))
        place[0], place[-1] = 1, 1  # a bond of length 1 m at rest, between the spare row and itself
        place[:, real] = contacts.geometry[:, source[real]]
        self._real = np.flatnonzero(real)
        self._group, self._springs = bonds.group[source[real]], len(bonds.law)
        shared, own, own_at = loop.parameters(bonds, runs)
        self._low, self._high = np.empty((2, len(source)), dtype=loop.dtype)
        self._travel = np.zeros(1, dtype=loop.dtype)
        kicks, drifts, *counts = _rows(method, dt, loop.dtype)
        sites = len(contacts.load)
        arrays = [
            u, v, loop.numbers(contacts.loads()),
            loop.numbers(contacts.weights(bonds.inverse_mass)), loop.numbers(contacts.loads()),
            loop.numbers(place), shared, own, kicks, drifts, self._low, self._high, self._travel,
            (dim * np.where(real, contacts.first[filled], spare)).astype(np.int64),
            (dim * np.where(real, contacts.second[filled], spare)).astype(np.int64),
            runs.first.astype(np.int64),
            (4 * runs.law + 2 * runs.kind + runs.own).astype(np.int64), own_at,
        ]  # fmt: skip
        structure = _NET(
            *(x.ctypes.data for x in arrays),
            len(runs.law), len(source), sites, contacts.rows, *counts,
        )  # fmt: skip
        self._set_steps(loop, structure, arrays, bonds, method, dt, dim * sites, source)
        self.forget_range()

    def forget_range(self):
        """Start anew to record elongations and the way travelled."""
        self._low[:], self._high[:] = np.inf, -np.inf
        self._travel[:] = 0

    @property
    def range(self):
        return by_spring(self._group, self._springs, self._low[self._real], self._high[self._real])


@once
def compiled(laws, own, dim, lanes):
    """The loop for these laws; raises `CompilerError` where there is none."""
    return Compiled(laws, own, dim, lanes)
