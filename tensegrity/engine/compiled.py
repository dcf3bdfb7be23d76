"""The loop as machine code: generated laws and geometry, and the C of a line or a network."""

from __future__ import annotations

import ctypes
from dataclasses import replace
from itertools import pairwise

import numpy as np

from tensegrity.engine import codegen, geometry
from tensegrity.engine.bonds import BLOCK, GROUP, WALL, by_spring
from tensegrity.engine.kept import kept
from tensegrity.engine.methods import Corrected, Splitting
from tensegrity.engine.native import library
from tensegrity.engine.openings import DEGREE, Openings
from tensegrity.engine.slices import slices
from tensegrity.engine.walk import Part
from tensegrity.once import once


def structure_of(name, arrays, counts):
    """A C structure of pointers and of whole numbers, by their names."""
    fields = [(field, ctypes.c_void_p) for field in arrays.split()]
    fields += [(field, ctypes.c_longlong) for field in counts.split()]
    return type(name, (ctypes.Structure,), {"_fields_": fields})


_LINE = structure_of(  # as in line.h
    "_Line",
    "u v w shared own kicks drifts range first law own_at range_at",
    "runs stages closing",
)
_NET = structure_of(  # as in net.h
    "_Net",
    "u v w load geometry shared own kicks drifts travel from to first law places near "
    "slice site depth begin other entry own_at gap length gap_at length_at gap_each length_each "
    "held taker taken taken_at store normal normal_at press pressed low high met_at farthest gate",
    "runs contacts sites rows stages closing tiles room loaded pressing "
    "before tile last_tile piece pieces",
)
LINE = 8  # numbers in a line of a cache
ROW = 1, 1, 2, 4  # numbers in a site's row of forces, by coordinates: as in lanes.c
_NYSTROM = structure_of(  # as in steps.c
    "_Nystrom",
    "nodes velocities matrix positions dt place slopes travel",
    "stages count moving",
)
_OPENINGS = structure_of(  # as in openings.h
    "_Openings",
    "place side strength exponents betas tables nodes weights offsets dt "
    "before rate_before after rate_after u v end_u end_v end_a row",
    "count entries kicks degree known begins",
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
    kind = "loop"  # what its text is kept under
    extra = ()  # behind the loop

    def __init__(self, laws, own=None, dim=0, lanes=1, extended=False):
        self.laws, self.own, self.dim, self.lanes = laws, own or (None,) * len(laws), dim, lanes
        self.dtype = np.dtype(np.longdouble if extended else np.float64)
        self._most = max((len(law.parameters) for law in laws), default=0)
        flags = ["-DEXTENDED"] * extended + [f"-DLANES={lanes}"] * (lanes > 1)
        flags += [f"-DDIM={dim}"] * (dim > 0)
        loop = "net" if dim else "line"
        parts = codegen.named(self.kind, laws, loop, self.own, dim)
        self.library = found = library(kept(parts, lambda: self._text(loop)), flags)
        address, number = ctypes.c_void_p, ctypes.c_longlong
        for name, arguments in (
            ("advance", [address, number]),
            ("advance_part", [address] + [number] * 3),
            ("advance_nystrom", [address] * 2 + [number]),
            ("advance_openings", [address] * 2 + [number]),
            ("show_openings", [address] * 2 + [number]),
            ("evaluate", [number] * 3 + [address] * 3),
            ("evaluate_own", [number] * 4 + [address] * 3),
            ("energies", [number] * 2 + [address] * 3),
            ("energies_own", [number] * 2 + [address] * 3),
        ):
            function = found[name]
            function.argtypes, function.restype = arguments, None
            setattr(self, name if name.startswith(("advance", "show")) else f"_{name}", function)

    def _text(self, loop):
        dim = self.dim
        parts = (geometry.helpers(dim), geometry.side_by_side(dim)) if dim else ()
        return codegen.c_text(self.laws, loop, self.own, *parts, extra=self.extra)

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
        own.append(np.zeros(GROUP))  # packs may read beyond the last
        return self.numbers(shared), self.numbers(np.concatenate(own)), places


def _nearest(source):
    """The bond of each place, for a filling the one before it."""
    return source[np.maximum.accumulate(np.where(source >= 0, np.arange(len(source)), 0))]


class _Bound:
    """Arrays bound to a loop: `advance` costs no more than a call.

    Attributes
    ----------
    springs : int
        Different ones.
    range : ndarray, (springs, 2)
        Smallest and largest elongation of each since `forget_range`.
    travel : float
        Bound on how far any coordinate of a site moved since then [m]; networks only.
    taken : list of (Structure, str, ndarray)
        What depends on the step, and is proportional to it: field of a structure, and its array.
    kept : list of (Structure, str, ndarray)
        Likewise where elongations are kept, all in a row, and behind them the way travelled.
    """

    _show = _openings = None

    def _set_steps(self, loop, structure, arrays, bonds, method, dt, moving, places=None):
        """Keep what the structure points to, and prepare the call of a method's steps."""
        self._structure, self._arrays = structure, arrays
        address = ctypes.addressof(structure)
        steps = ("kicks", self._kicks), ("drifts", self._drifts)
        self.taken = [(structure, name, array) for name, array in steps]
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
        steps = _OPENINGS(*address, count, u.size, len(found.nodes), DEGREE, 0, 0)
        self._arrays += [rows, steps]
        (step,) = (
            x for x, (name, _) in zip(rows, _OPENINGS._fields_, strict=False) if name == "dt"
        )
        self.taken.append((steps, "dt", step))
        self._call = (
            loop.advance_openings,
            (ctypes.addressof(self._structure), ctypes.addressof(steps)),
        )
        self._show, self._openings = (loop.show_openings, ctypes.addressof(steps)), steps

    def show(self, u, v):
        """What makes copies of u and v what is looked at; None where they are that already."""
        known = self._show
        return None if known is None else _Shown(known, self._structure, self.kept, u, v, self)

    def advance(self, steps):
        """Advance u and v by whole steps."""
        function, addresses = self._call
        function(*addresses, steps)

    @property
    def address(self):
        """Where the structure is that the loop takes."""
        return ctypes.addressof(self._structure)

    def parts(self):
        """What `walk` needs to advance them with others."""
        begins = self._openings and ctypes.addressof(self._openings) + _OPENINGS.begins.offset
        return [Part(..., *self._call, *self._arrays[:2], begins)]

    def begin(self):
        """Say that the next step is the first of a run."""
        if self._openings is not None:
            self._openings.begins = 1

    def advance_part(self, steps, opened, close):
        """Steps of a splitting whose first kick includes the last one of the steps before, if
        `opened`, and whose own last kick is left out, unless `close`."""
        function, address = self._part
        function(address, steps, opened, close)

    @property
    def travel(self):
        return float(self._travel[0])

    @property
    def travel_at(self):
        """Address of that number."""
        return self._travel.ctypes.data


class _Shown:
    """What is looked at after steps of a corrected method, from copies of u and v; as `_Bound`."""

    taken, travel, _openings = (), 0.0, None

    def __init__(self, call, structure, kept, u, v, of):
        self._arrays, self._of = (u, v), of  # whose other arrays these are
        self._structure = type(structure).from_buffer_copy(structure)
        self._structure.u, self._structure.v = u.ctypes.data, v.ctypes.data
        self.kept = [(self._structure, name, array) for _, name, array in kept]
        function, openings = call
        self._call = function, (ctypes.addressof(self._structure), openings)

    def forget_range(self):
        """There is none: no step is done."""

    @property
    def range(self):
        """No elongation met."""
        return np.tile([np.inf, -np.inf], (len(self._of.range), 1))

    advance, parts = _Bound.advance, _Bound.parts


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
        self._group, self._lanes, self._loop = bonds.group, loop.lanes, loop
        self._runs = bonds.runs if runs is None else runs
        laid = None if runs is not None else bonds.laid.get(loop)
        if laid is None:
            laid = self._lay(loop, bonds, seen)
            if runs is None:
                bonds.laid[loop] = laid
        self._kept, self._low, self._high, self._apart, size, fixed_arrays, count = laid
        weights, shared, own, *where = fixed_arrays
        self._range = np.empty(size, dtype=loop.dtype)
        self._travel = np.zeros(1, dtype=loop.dtype)
        self.springs = len(bonds.law)
        self._kicks, self._drifts, *counts = _rows(method, dt, loop.dtype)
        arrays = [
            u, v, weights, shared, own, self._kicks, self._drifts, self._range, *where,
        ]  # fmt: skip
        structure = _LINE(*(x.ctypes.data for x in arrays), count, *counts)
        self.kept = [(structure, "range", self._range)]
        self._set_steps(loop, structure, arrays, bonds, method, dt, u.size)
        self.forget_range()

    def _lay(self, loop, bonds, seen):
        """What does not depend on the motion and the method: kept for the next time."""
        runs = self._runs
        seen = np.ones(len(runs.law), dtype=bool) if seen is None else seen
        shared, own, own_at = loop.parameters(bonds, runs)
        entries = loop.lanes * np.diff(runs.first)
        sizes = 2 * np.where(runs.own, entries, np.minimum(entries, BLOCK))
        range_at = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
        weights = np.asarray(bonds.inverse_mass)
        if loop.lanes > 1 and weights.ndim == 1:
            weights = np.repeat(weights, loop.lanes)
        order = self._order(range_at, seen)
        apart = np.array_equal(order[0], np.arange(len(bonds.law)))
        arrays = [
            loop.numbers(weights), shared, own, (runs.first - runs.first[0]).astype(np.int64),
            (2 * runs.law + runs.own).astype(np.int64), own_at, range_at,
        ]  # fmt: skip
        return *order, apart, range_at[-1], arrays, len(runs.law)

    def _order(self, range_at, seen):
        """The spring that each kept range belongs to, and where its two numbers are."""
        springs, low, high = [], [], []
        for k in np.flatnonzero(seen):
            start, stop = range_at[k : k + 2]
            here, middle = self._group[self._runs.members(k)], (start + stop) // 2
            if not self._runs.own[k]:
                here = np.repeat(here.flat[0], middle - start)
            elif self._lanes > 1 and here.ndim == 1:
                here = np.repeat(here, self._lanes)
            springs.append(np.ravel(here))
            low.append(np.arange(start, middle))
            high.append(np.arange(middle, stop))
        return np.concatenate(springs), np.concatenate(low), np.concatenate(high)

    def retune(self, bonds):
        """Go on with the masses and parameters of other bonds, of the same laws and in the same
        runs.  What it was made of changes with it."""
        shared, own, _ = self._loop.parameters(bonds, self._runs)
        for array, values in zip(self._arrays[2:5], (bonds.inverse_mass, shared, own), strict=True):
            array[:] = values

    def forget_range(self):
        """Start anew to record elongations."""
        self._range[self._low], self._range[self._high] = np.inf, -np.inf

    def places(self):
        """The spring of each range that is kept, and where in `kept` its ends are."""
        return tuple(_integers(x) for x in (self._kept, self._low, self._high))

    @property
    def range(self):
        found = self._range[self._low], self._range[self._high]
        if self._apart:
            return np.stack(found, axis=1)
        return by_spring(self._kept, self.springs, *found)


class BoundNet(_Bound):
    """A network advanced in place; rows of u and v are sites, walls, and a spare one.

    Parameters
    ----------
    pieces : int, optional
        Parts of about equal work, each to be advanced by a thread of its own: see `part`.
    """

    def __init__(self, loop, u, v, bonds, method, dt, pieces=1):
        if loop not in bonds.laid:
            bonds.laid[loop] = self._lay(loop, bonds)
        found, entries, (weights, before, behind, normals, pressed) = bonds.laid[loop]
        runs, contacts, dim = bonds.runs, bonds.contacts, loop.dim
        count, sites = len(runs.source), len(contacts.load)
        self._set_ranges(bonds, entries, pieces, loop.dtype)
        self._travel = np.zeros(1, dtype=loop.dtype)
        self._kicks, self._drifts, *counts = _rows(method, dt, loop.dtype)
        arrays = [
            u, v, *weights, self._kicks, self._drifts, self._travel, *before,
            np.zeros_like(u), *behind,
            np.zeros(pieces * found.store * dim * GROUP, dtype=loop.dtype), *normals,
            _rows_of_forces(pressed[-1] + len(pressed), loop), pressed, self._low, self._high,
            self._met_at, np.zeros(pieces, dtype=loop.dtype), np.zeros(16, dtype=np.int64),
        ]  # fmt: skip
        numbers = (
            len(runs.law), count, sites, contacts.rows, *counts, found.tiles,
            found.store, bool(contacts.load.any()), pressed[-1],
        )  # fmt: skip

        def structure(*piece):
            return _NET(*(x.ctypes.data for x in arrays), *numbers, *piece)

        cuts = found.shares(pieces)
        self._pieces = [
            structure(found.needed[a], a, b, k, pieces) for k, (a, b) in enumerate(pairwise(cuts))
        ]
        whole = structure(0, 0, found.tiles, 0, 1)
        kept = ("low", self._low), ("high", self._high), ("travel", self._travel)
        self.kept = [(whole, *one) for one in kept]
        self._set_steps(loop, whole, arrays, bonds, method, dt, dim * sites, runs.source)
        self.forget_range()

    def _lay(self, loop, bonds):
        """What does not depend on the motion and the method: kept for the next time."""
        runs, contacts, found = bonds.runs, bonds.contacts, slices(bonds)
        source, dim, sites = runs.source, loop.dim, len(contacts.load)
        real = source >= 0
        filled, spare = np.where(real, source, 0), contacts.rows - 1
        place = np.zeros((dim + 2, len(source)))
        place[0], place[-1] = 1, 1  # a bond of length 1 m at rest, between the spare row and itself
        place[:, real] = contacts.geometry[:, source[real]]
        entries = replace(runs, source=source[found.contact], first=found.first)
        shared, own, own_at = loop.parameters(bonds, entries)
        gaps, gap_at, gap_each = _varying(place[dim, found.contact], found.first)
        lengths, length_at, length_each = _varying(place[-1, found.contact], found.first)
        places = np.zeros((contacts.rows + 1, dim))
        places[:sites] = contacts.positions
        other, normals, pressed = _by_wall(bonds, found, place[:dim])
        weights = contacts.weights(bonds.inverse_mass)
        arrays = (
            [loop.numbers(weights), loop.numbers(contacts.loads()), loop.numbers(place), shared,
             own],
            [_integers(dim * np.where(real, contacts.first[filled], spare)),
             _integers(dim * np.where(real, contacts.second[filled], spare)),
             _integers(runs.first), _integers(4 * runs.law + 2 * runs.kind + runs.own),
             loop.numbers(places)],
            [_integers(found.slice), found.site.astype(np.int32), _integers(found.depth),
             _integers(found.begin), other.astype(np.int32), _integers(found.first), own_at,
             loop.numbers(gaps), loop.numbers(lengths), gap_at, length_at, gap_each, length_each,
             _integers(found.held), found.taker.astype(np.int32), _in_store(found.taken, dim),
             _integers(found.taken_at)],
            [loop.numbers(normals[0]), normals[1]], pressed,
        )  # fmt: skip
        return found, entries, arrays

    def part(self, number, steps):
        """Advance one of the pieces by whole steps, at the same time as all others."""
        self._call[0](ctypes.addressof(self._pieces[number]), steps)

    def _set_ranges(self, bonds, entries, pieces, dtype):
        """Places of the elongations met: of the runs for each piece, then of entries told apart."""
        runs = len(entries.law)
        together = pieces * runs * GROUP
        sizes = np.where(entries.own, np.diff(entries.first), 0)
        apart = together + np.cumsum(sizes) - sizes
        self._met_at = _integers(np.where(entries.own, apart, GROUP * np.arange(runs)))
        self._low, self._high = np.empty((2, together + sizes.sum()), dtype=dtype)
        first = bonds.group[entries.source[entries.first[:-1]]]
        told = [
            bonds.group[entries.source[slice(*entries.first[k : k + 2])]]
            for k in np.flatnonzero(entries.own)
        ]
        self._group = np.concatenate([np.tile(np.repeat(first, GROUP), pieces), *told])
        self.springs = len(bonds.law)

    def forget_range(self):
        """Start anew to record elongations and the way travelled."""
        self._low[:], self._high[:] = np.inf, -np.inf
        self._travel[:] = 0

    def places(self):
        """The spring of each range that is kept, and where in `kept` its ends are."""
        each = np.arange(self._low.size, dtype=np.int64)
        return _integers(self._group), each, each + self._low.size

    @property
    def range(self):
        return by_spring(self._group, self.springs, self._low, self._high)


def _integers(array):
    return np.ascontiguousarray(array, dtype=np.int64)


def _by_wall(bonds, found, normal):
    """Contacts with walls, wall by wall and else in the order of the list, as the loop takes them.

    What all entries join their sites to; normals of the groups of each run with walls, and where
    these begin; where the contacts with each wall begin.
    """
    runs, contacts = bonds.runs, bonds.contacts
    sites, places = len(contacts.load), np.flatnonzero(runs.source >= 0)
    places = places[contacts.kind[runs.source[places]] == WALL]
    wall = contacts.first[runs.source[places]] - sites
    order, turn = np.argsort(wall, kind="stable"), np.zeros(len(runs.source), dtype=int)
    turn[places[order]] = np.arange(len(places))
    begin = np.searchsorted(wall[order], np.arange(contacts.rows - sites + 1))
    other, kept, at = found.other.copy(), [np.zeros(0)], []
    for k, kind in enumerate(runs.kind):
        at.append(sum(map(len, kept)))
        if kind == WALL:
            entries = found.contact[slice(*found.first[k : k + 2])]
            other[slice(*found.first[k : k + 2])] = turn[entries]
            groups = normal[:, entries].reshape(len(normal), -1, GROUP)
            kept.append(groups.swapaxes(0, 1).ravel())
    return other, (np.concatenate(kept), _integers(at)), _integers(begin)


def _in_store(entry, dim):
    """Where the first coordinate of an entry is in the store."""
    return (entry // GROUP * GROUP * dim + entry % GROUP).astype(np.int32)


def _rows_of_forces(count, loop):
    """Rows of `ROW` numbers, none of which two lines of a cache share."""
    size = count * ROW[loop.dim]
    room = np.zeros(size + LINE, dtype=loop.dtype)
    return room[-room.ctypes.data // room.itemsize % LINE :][:size]


def _varying(values, first):
    """Values of the entries of each run, or `GROUP` equal ones; where these begin, and which."""
    kept, at, each = [np.zeros(0)], [], []
    for start, stop in pairwise(first):
        part = values[start:stop]
        each.append(bool(np.any(part != part[0])))
        at.append(sum(map(len, kept)))
        kept.append(part if each[-1] else part[:GROUP])
    return np.concatenate(kept), _integers(at), _integers(each)


@once
def compiled(laws, own, dim, lanes):
    """The loop for these laws; raises `CompilerError` where there is none."""
    return Compiled(laws, own, dim, lanes)
