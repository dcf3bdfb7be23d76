"""The loop without a compiler, on CasADi's virtual machine: 10 to 30 times slower.

The text of a step is that of `plain`; here it is written down once in CasADi's expressions of
whole vectors, and many steps are done in one call.
"""

from __future__ import annotations

import numpy as np

from tensegrity.engine import geometry, plain
from tensegrity.engine.bonds import KINDS, by_spring
from tensegrity.engine.law import evaluate, functions, interpret
from tensegrity.engine.methods import Corrected, Splitting
from tensegrity.engine.openings import Openings

FOLD = 50  # steps done in one call of the machine


class Interpreted:
    """Laws and a loop over bonds of them; as `Compiled`."""

    name = "interpreted"
    dtype = np.dtype(np.float64)
    lanes = 1

    def __init__(self, laws):
        self.laws = laws

    @classmethod
    def of(cls, bonds):
        """The loop for given `Bonds`."""
        return cls(bonds.laws)

    def evaluate(self, law, order, parameters, r):
        """The order-th derivative of law number `law` at elongations r; as `Compiled.evaluate`."""
        return evaluate(self.laws[law], order, parameters, r)


class BoundInterpreted:
    """A chain or a network advanced in place; as `compiled.BoundLine` and `BoundNet`."""

    def __init__(self, u, v, bonds, method, dt):
        import casadi as ca

        self._u, self._v = u, v
        pull = _Pull(bonds)
        self._kept, self._springs = pull.kept, len(bonds.law)
        count = len(pull.kept)
        ends = np.cumsum([0, u.size, u.size, count, count, 1]).tolist()
        moving = len(np.atleast_1d(bonds.inverse_mass)) * max(bonds.dim, 1)

        def function(name, step):
            state = ca.MX.sym("state", ends[-1])
            x, y, low, high, travel = ca.vertsplit(state, ends)
            seen = {"low": low, "high": high, "travel": travel}

            def acceleration(x):
                a, r = pull(x)
                low, high = (pull.of_kept(r, end) for end in (ca.mmin, ca.mmax))
                seen["low"] = ca.fmin(seen["low"], low)
                seen["high"] = ca.fmax(seen["high"], high)
                return a

            def moved(move):
                seen["travel"] = seen["travel"] + ca.norm_inf(move[:moving])

            x, y = step(acceleration, x, y, moved)
            return ca.Function(name, [state], [ca.vertcat(x, y, *seen.values())])

        self._openings = self._last_step = None
        self._begins = self._alone = False
        if isinstance(method, Corrected):
            self._openings = Openings(bonds, method, dt)
            kicks, drifts = (
                np.multiply(x, dt).tolist() for x in (method.base.kicks, method.base.drifts)
            )
            first = repeat = plain.split(kicks, [*drifts, 0.0])
            last = None
            x = ca.MX.sym("u", u.size)
            self._pull = ca.Function("pull", [x], [pull(x)[0]])
        elif isinstance(method, Splitting):
            first, repeat, last = plain.merged(method, dt)
        else:
            first = repeat = plain.nystrom(method, dt)
            last = None
        self._first, self._repeat = function("first", first), function("repeat", repeat)
        self._many = self._repeat.fold(FOLD)
        self._last = function("last", last) if last else None
        self._ends = ends
        self.forget_range()

    def forget_range(self):
        """Start anew to record elongations and the way travelled."""
        count = len(self._kept)
        self._seen = np.concatenate([np.full(count, np.inf), np.full(count, -np.inf), [0.0]])

    @property
    def range(self):
        """Smallest and largest elongation of each different spring since `forget_range`."""
        low, high = self._seen[:-1].reshape(2, -1)
        return by_spring(self._kept, self._springs, low, high)

    @property
    def travel(self):
        """Bound on how far any coordinate of a site moved since then [m]."""
        return float(self._seen[-1])

    def advance(self, steps):
        """Advance u and v by whole steps."""
        if steps == 0:
            return
        if self._openings is not None:
            self._advance_corrected(steps)
            return
        state = np.concatenate([self._u.ravel(), self._v.ravel(), self._seen])
        state = self._first(state)
        for _ in range((steps - 1) // FOLD):
            state = self._many(state)
        for _ in range((steps - 1) % FOLD):
            state = self._repeat(state)
        if self._last is not None:
            state = self._last(state)
        self._take(state)

    def _take(self, state):
        u, v, seen = np.split(np.array(state).ravel(), self._ends[1:3])
        self._u[...], self._v[...] = u.reshape(self._u.shape), v.reshape(self._v.shape)
        self._seen = seen

    def begin(self):
        """Say that the next step is the first of a run."""
        self._begins = True

    def stand_alone(self):
        """Say that steps have none before them and none behind."""
        self._alone = True

    def _advance_corrected(self, steps):
        """The same step by step, with a look at the contacts after each."""
        u, v = self._rows(self._u, self._v)
        overlaps = self._openings.overlaps(u, v)
        for _ in range(steps):
            self._take(self._repeat(np.concatenate([u.ravel(), v.ravel(), self._seen])))
            given = u, v, self._at(u), overlaps, self._begins, self._alone
            before, overlaps = overlaps, self._openings.corrected(*given)
            self._last_step, self._begins = (before, overlaps), False

    def _rows(self, *arrays):
        """The same numbers as the corrections of openings take them."""
        line = self._openings.bonds.contacts is None
        return [x.reshape(-1) if line else x for x in arrays]  # views

    def _at(self, u):
        return np.array(self._pull(u.ravel())).reshape(u.shape)

    def show(self, u, v):
        """What makes copies of u and v what is looked at; None where they are that already."""
        return None if self._openings is None else _Shown(self, u, v)

    def shown(self, u, v):
        """The same, done."""
        if self._last_step is not None:
            u, v = self._rows(u, v)
            self._openings.shown(u, v, self._at(u), *self._last_step)


class _Shown:
    """What is looked at after corrected steps, from copies of u and v; as `compiled._Shown`."""

    travel = 0.0

    def __init__(self, bound, u, v):
        self._bound, self._copies = bound, (u, v)

    def forget_range(self):
        """There is none: no step is done."""

    @property
    def range(self):
        """No elongation met."""
        return np.tile([np.inf, -np.inf], (len(self._bound.range), 1))

    def advance(self, steps):
        """Change the copies."""
        self._bound.shown(*self._copies)


class _Pull:
    """Accelerations as a CasADi expression of u, rows one after the other.

    Attributes
    ----------
    kept : ndarray of int
        The spring of each range that is kept.
    """

    def __init__(self, bonds):
        import casadi as ca

        self._bonds, self._runs = bonds, bonds.runs
        self._tensions = [functions(law)["tension"] for law in bonds.laws]
        contacts = bonds.contacts
        members = [self._runs.members(k) for k in range(len(self._runs.law))]
        self._members = members
        self.kept = np.concatenate(
            [bonds.group[m] if own else bonds.group[m[:1]] for m, own in zip(
                members, self._runs.own, strict=True)] or [np.zeros(0, int)]
        )  # fmt: skip
        if contacts is None:
            self._weights = ca.DM(np.asarray(bonds.inverse_mass, dtype=float))
            return
        self._weights = ca.DM(contacts.weights(bonds.inverse_mass).ravel())
        self._loads = ca.DM(contacts.loads().ravel())
        self._scatter = _scatter(contacts, np.concatenate([np.zeros(0, int), *members]))

    def __call__(self, u):
        """Accelerations, and the elongations of each run."""
        import casadi as ca

        if self._bonds.contacts is None:
            r = ca.vertsplit(u[1:] - u[:-1], self._runs.first.tolist())
            f = ca.vertcat(*(self._tension(k, part) for k, part in enumerate(r)))
            return self._weights * (ca.vertcat(f, 0) - ca.vertcat(0, f)), r
        dim = self._bonds.dim
        r, along = [], []
        for k in range(len(self._members)):
            part, axes = self._contact(k, u)
            f = self._tension(k, part)
            r.append(part)
            along.append([f * one for one in axes])
        force = self._loads
        for axis in range(dim if along else 0):
            force = force + self._scatter[axis] @ ca.vertcat(*(one[axis] for one in along))
        return self._weights * force, r

    def of_kept(self, r, end):
        """The ranges' ends in one vector, from the elongations of each run."""
        import casadi as ca

        parts = zip(r, self._runs.own, strict=True)
        return ca.vertcat(*(part if own else end(part) for part, own in parts))

    def _tension(self, k, r):
        import casadi as ca

        values = self._bonds.parameters[self._bonds.group[self._members[k]]].T
        if not self._runs.own[k]:
            values = values[:, :1]
        function = self._tensions[self._runs.law[k]]
        inputs = [[r], [ca.MX(ca.DM(x)) for x in values[: function.size1_in(1)]]]
        return interpret(function, inputs, ca.MX)[0] * ca.MX.ones(r.shape[0])

    def _contact(self, k, u):
        """Elongations of a run of contacts, and their direction along each axis."""
        import casadi as ca

        contacts, dim, members = self._bonds.contacts, self._bonds.dim, self._members[k]
        place = [ca.MX(ca.DM(x)) for x in contacts.geometry[:, members]]
        kind = KINDS[self._runs.kind[k]]
        w = [u[(dim * contacts.second[members] + a).tolist()] for a in range(dim)]
        if kind == "pair":
            w = [x - u[(dim * contacts.first[members] + a).tolist()] for a, x in enumerate(w)]
        inputs = [place[:dim], w, [place[dim]], [place[dim + 1]]]
        forms = geometry.scalars(dim, kind)
        ones = ca.MX.ones(len(members))
        return_, *axes = (interpret(form, inputs, ca.MX)[0] * ones for form in forms)
        return return_, axes


def _scatter(contacts, members):
    """For each axis the sparse matrix that sums what contacts pull at the rows' coordinates."""
    import casadi as ca

    dim, count = contacts.load.shape[1], len(members)
    found = []
    for axis in range(dim):
        rows = np.concatenate([contacts.first[members], contacts.second[members]]) * dim + axis
        columns = np.tile(np.arange(count), 2)
        signs = np.repeat([1.0, -1.0], count)
        found.append(
            ca.DM.triplet(rows.tolist(), columns.tolist(), ca.DM(signs), contacts.rows * dim, count)
        )
    return found
