"""The loop that advances a network, compiled where there is a compiler, else in NumPy.

The geometry of a contact comes from `derivations.geometry`, as the laws come from their energy:
CasADi writes it in C, and runs it where no compiler is found.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass

import numpy as np

from tensegrity import codegen, plain
from tensegrity.kernel import Steps, advances, splitting_rows, warn_slow
from tensegrity.native import CompilerError, library
from tensegrity.once import once

KINDS = ("pair", "wall")
LANES = 8  # as in network.c


@dataclass(frozen=True)
class Contacts:
    """Contacts of a network as the loop takes them; rows are sites, then walls.

    Attributes
    ----------
    laws : tuple of Law
        The different laws that occur.
    kind, law : ndarray of int, (contacts,)
        Index into `KINDS` and into `laws`.
    first, second : ndarray of int, (contacts,)
        Rows that a contact joins; the first of a wall contact is the wall.
    geometry : ndarray, (dim + 2, contacts)
        Reference separation of the two, or normal of the wall [m]; initial gap; length [m].
    parameters : ndarray, (contacts, most parameters of any law)
    inverse_mass : ndarray, (sites,)
    load : ndarray, (sites, dim)
    walls : int
    """

    laws: tuple
    kind: np.ndarray
    law: np.ndarray
    first: np.ndarray
    second: np.ndarray
    geometry: np.ndarray
    parameters: np.ndarray
    inverse_mass: np.ndarray
    load: np.ndarray
    walls: int

    @property
    def dim(self):
        """Number of coordinates of a site."""
        return self.load.shape[1]

    @property
    def rows(self):
        """Sites, walls, and one row more."""
        return len(self.load) + self.walls + 1

    def weights(self):
        """Inverse mass of each row: 1 kg for a wall, whose velocity counts its impulse."""
        weights = np.zeros((self.rows, self.dim))
        weights[: len(self.load)] = self.inverse_mass[:, None]
        weights[len(self.load) : -1] = 1
        return weights

    def loads(self):
        """Constant force on each row [N]."""
        loads = np.zeros((self.rows, self.dim))
        loads[: len(self.load)] = self.load
        return loads


@once
def geometry(dim):
    """CasADi functions (D, w, g, L) -> (elongation, its gradient in w), one per kind."""
    import casadi as ca

    from derivations import geometry as derived

    symbols = [ca.SX.sym("D", dim), ca.SX.sym("w", dim), ca.SX.sym("g"), ca.SX.sym("L")]
    names = (*(x for v in derived.vectors(dim) for x in v), derived.initial, derived.length)
    values = [x for symbol in symbols for x in ca.vertsplit(symbol)]
    gap, normal = derived.wall_gap(dim)
    forms = {
        "pair": [derived.elongation(dim), *derived.direction(dim)],
        "wall": [gap, *normal],
    }
    found = {}
    for kind, form in forms.items():
        r, *along = codegen.to_casadi(form, names)(*values)
        found[kind] = ca.Function(f"geometry_{kind}", symbols, [r, ca.vertcat(*along)])
    return found


def _helpers(dim):
    for kind, function in geometry(dim).items():
        yield (
            function,
            f"static inline void {kind}_contact(const real *d, const real *w, real g, real length, "
            "real *r, real *along) { const real *arg[] = {d, w, &g, &length}; "
            f"real *res[] = {{r, along}}; geometry_{kind}(arg, res, 0, 0, 0); }}",
        )


class _Scene(ctypes.Structure):
    _arrays = (
        "u", "v", "force", "w", "load", "geometry", "parameters", "kicks", "drifts", "low",
        "high", "travel", "from", "to", "first", "kind", "law",
    )  # fmt: skip
    _counts = ("runs", "contacts", "sites", "rows", "stages", "closing")
    _fields_ = [(name, ctypes.c_void_p) for name in _arrays] + [
        (name, ctypes.c_longlong) for name in _counts
    ]


class CompiledNetwork:
    """The laws, the geometry and the loop as machine code.

    Parameters
    ----------
    laws : tuple of Law
    dim : int
    extended : bool
        Compile the same text in the platform's long double, as a reference for tests.
    """

    name = "compiled"

    def __init__(self, laws, dim, extended=False):
        self.dtype = np.dtype(np.longdouble if extended else np.float64)
        helpers = [*_helpers(dim)]
        text = codegen.c_text(laws, ("network.c", "nystrom.c"), helpers)
        flags = [f"-DDIM={dim}", *(["-DEXTENDED"] if extended else [])]
        self.advances = advances(library(text, flags))

    def bind(self, u, v, contacts, method, dt):
        """Prepare a network; the rows `u` and `v` are advanced in place."""
        return _BoundCompiled(self, u, v, contacts, method, dt)


class _BoundCompiled:
    def __init__(self, kernel, u, v, contacts, method, dt):
        runs, source = _runs(contacts)
        count, spare = len(source), contacts.rows - 1
        real = source >= 0
        filled = np.where(real, source, 0)
        place = np.zeros((contacts.dim + 2, count))
        place[0], place[-1] = 1, 1  # a bond of length 1 m at rest, between the spare row and itself
        place[:, real] = contacts.geometry[:, source[real]]
        parameters = contacts.parameters[_last_real(source)]
        self._real = np.flatnonzero(real)
        self._back = np.empty(len(self._real), dtype=int)
        self._back[source[real]] = self._real

        def numbers(array):
            return np.ascontiguousarray(array, dtype=kernel.dtype)

        self._low, self._high = np.empty((2, count), dtype=kernel.dtype)
        kicks, drifts, *counts = splitting_rows(method, dt, kernel.dtype)
        self.moving = contacts.dim * len(contacts.load)
        self._arrays = [  # kept: the structure holds bare addresses
            u,
            v,
            numbers(contacts.loads()),
            numbers(contacts.weights()),
            numbers(contacts.loads()),
            numbers(place),
            numbers(parameters.T),
            kicks,
            drifts,
            self._low,
            self._high,
            (contacts.dim * np.where(real, contacts.first[filled], spare)).astype(np.int64),
            (contacts.dim * np.where(real, contacts.second[filled], spare)).astype(np.int64),
            *(np.ascontiguousarray(x, dtype=np.int64) for x in runs),
        ]
        pointers = [a.ctypes.data for a in self._arrays]
        structure = _Scene(
            *pointers[:11], 0, *pointers[11:],
            len(runs[1]), count, len(contacts.load), contacts.rows, *counts,
        )  # fmt: skip
        self._steps = Steps(kernel.advances, structure, method, dt, u, self.moving)
        structure.travel = self._steps.travel.ctypes.data
        self.forget_range()

    def forget_range(self):
        """Start anew to record elongations and the way travelled."""
        self._low[:], self._high[:] = np.inf, -np.inf
        self._steps.travel[:] = 0

    @property
    def range(self):
        """Smallest and largest elongation of each contact since the last call of `forget_range`."""
        return np.stack([self._low[self._back], self._high[self._back]], axis=1)

    @property
    def travel(self):
        """Bound on how far any coordinate of a site moved since then [m]."""
        return float(self._steps.travel[0])

    def advance(self, steps):
        """Advance u and v by whole steps."""
        self._steps.advance(steps)


def _runs(contacts):
    """Contacts in runs of one kind and law, each filled up to whole groups of `LANES`.

    Returns
    -------
    (first, kind, law) : of the runs, as in network.c, where kinds count on for runs whose
        contacts share their parameters
    source : ndarray of int
        The contact at each place, -1 for a filling.
    """
    pair = contacts.law * len(KINDS) + contacts.kind
    first, source, found, shared = [0], [], np.unique(pair), []
    for number in found:
        members = np.flatnonzero(pair == number)
        values = contacts.parameters[members]
        shared.append(bool(np.all(values == values[0])))
        source += [members, np.full(-len(members) % LANES, -1)]
        first.append(first[-1] + len(members) + len(source[-1]))
    source = np.concatenate(source) if source else np.zeros(0, dtype=int)
    kinds = found % len(KINDS) + len(KINDS) * np.array(shared, dtype=int)
    return (np.array(first), kinds, found // len(KINDS)), source


def _last_real(source):
    """For each place the nearest contact before it: a filling has the law of its run."""
    places = np.where(source >= 0, np.arange(len(source)), 0)
    return source[np.maximum.accumulate(places)]


def _scalar_outputs(function):
    """A function of the geometry in one function for each number that it gives."""
    import casadi as ca

    symbols = function.sx_in()
    outputs = [x for form in function(*symbols) for x in ca.vertsplit(form)]
    return [ca.Function("one", symbols, [x]) for x in outputs]


class InterpretedNetwork:
    """The same in NumPy, with laws and geometry on CasADi's virtual machine."""

    name = "interpreted"
    dtype = np.dtype(np.float64)

    def __init__(self, laws, dim):
        self._tensions = [codegen.functions(law)["tension"] for law in laws]
        self._geometry = [_scalar_outputs(geometry(dim)[kind]) for kind in KINDS]

    def forces(self, contacts, run):
        """A function w -> elongations, forces along each axis, for contacts of one kind and law.

        The instructions are done on whole vectors, so that the machine's overhead is paid once.
        """
        import casadi as ca

        dim, place = contacts.dim, [ca.MX(ca.DM(x)) for x in contacts.geometry[:, run]]
        w = [ca.MX.sym("w", len(run)) for _ in range(dim)]
        inputs = [place[:dim], w, [place[dim]], [place[dim + 1]]]
        forms = self._geometry[contacts.kind[run[0]]]
        r, *along = (codegen.interpret(form, inputs, ca.MX) for form in forms)
        tension = self._tensions[contacts.law[run[0]]]
        values = contacts.parameters[run, : tension.size1_in(1)].T
        f = codegen.interpret(tension, [[r], [ca.MX(ca.DM(x)) for x in values]], ca.MX)
        f = f * ca.MX.ones(len(run))  # a law may be a constant
        axes = [f * one for one in along]
        return ca.Function("forces", w, [ca.horzcat(r, *(x * ca.MX.ones(len(run)) for x in axes))])

    def bind(self, u, v, contacts, method, dt):
        """Prepare a network; the rows `u` and `v` are advanced in place."""
        return _BoundInterpreted(self, u, v, contacts, method, dt)


class _BoundInterpreted:
    def __init__(self, kernel, u, v, contacts, method, dt):
        self._u, self._v, self._contacts = u, v, contacts
        self._method, self._dt = method, dt
        self._weights, self._loads = contacts.weights(), contacts.loads()
        pair = contacts.law * len(KINDS) + contacts.kind
        runs = [np.flatnonzero(pair == number) for number in np.unique(pair)]
        self._runs = [(run, kernel.forces(contacts, run)) for run in runs]
        self.range = np.empty((len(pair), 2))
        self.forget_range()

    def forget_range(self):
        """Start anew to record elongations and the way travelled."""
        self.range[:, 0], self.range[:, 1] = np.inf, -np.inf
        self.travel = 0.0

    def advance(self, steps):
        """Advance u and v by whole steps."""
        moving = len(self._contacts.load)
        self.travel += plain.advance(
            self._acceleration, self._u, self._v, self._method, self._dt, steps, moving
        )

    def _acceleration(self, u):
        c, force = self._contacts, self._loads.copy()
        for run, forces in self._runs:
            first, second = c.first[run], c.second[run]
            w = u[second] if KINDS[c.kind[run[0]]] == "wall" else u[second] - u[first]
            found = forces(*w.T).full()
            r, f = found[:, 0], found[:, 1:]
            np.add.at(force, first, f)
            np.subtract.at(force, second, f)
            self.range[run, 0] = np.fmin(self.range[run, 0], r)
            self.range[run, 1] = np.fmax(self.range[run, 1], r)
        return self._weights * force


@once
def kernel(laws, dim):
    """The engine for networks of these laws: compiled, or interpreted with one warning."""
    try:
        return CompiledNetwork(laws, dim)
    except CompilerError as error:
        warn_slow(str(error))
        return InterpretedNetwork(laws, dim)
