"""Steps of Gauss collocation: stages solved for by Newton's method.

The displacements D_i of the stages satisfy D_i = nodes[i] dt v + dt^2 sum_j matrix[i][j] a(u + D_j)
with a full matrix.  Ordered row by row the Jacobian is banded on a line, else sparse; it is
computed and factored in double precision whatever the precision of the state, which the residual
alone decides.
"""

from __future__ import annotations

import numpy as np

from tensegrity.engine import forces
from tensegrity.engine.bonds import by_spring
from tensegrity.errors import StabilityError

ITERATIONS = 60
HALVINGS = 30  # of an update that leads out of the domain of a law
CLOSE = 1e-6  # updates below this, relative, converge quadratically


class BoundGauss:
    """A scene advanced in place by an implicit method.

    Parameters
    ----------
    loop : Compiled
        What evaluates the laws.
    u, v : ndarray, (sites,) or (rows, dim)
    bonds : Bonds
    method : Gauss
    dt : float
        [s]
    """

    def __init__(self, loop, u, v, bonds, method, dt) -> None:
        self._loop, self._u, self._v, self._bonds = loop, u.reshape(-1), v.reshape(-1), bonds
        contacts, self._shape = bonds.contacts, u.shape if bonds.dim else (u.size,)
        self._w = np.asarray(bonds.inverse_mass, dtype=float)
        self._loads, self._moving = 0.0, u.size
        if contacts is not None:
            self._w = contacts.weights(self._w).ravel()
            self._loads = contacts.loads().ravel()
            self._moving = contacts.load.size
        self._method, self._dt = method, dt
        kind = u.dtype.type
        self._matrix = np.array(method.matrix) * dt**2
        self._nodes, self._h = np.array(method.nodes)[:, None].astype(kind), kind(dt)
        self._inverse = np.linalg.inv(method.matrix) / (dt**2 or 1.0)  # no step, no use of it
        self._positions = np.array(method.positions) * dt**2
        self._velocities = np.array(method.velocities) * dt
        self._of_law = [np.flatnonzero(bonds.law_of_bond == k) for k in range(len(bonds.laws))]
        self.forget_range()

    def forget_range(self):
        """Start anew to record elongations and the way travelled."""
        count = len(self._bonds.group)
        self._low, self._high = np.full(count, np.inf), np.full(count, -np.inf)
        self.travel = 0.0

    @property
    def range(self):
        """Smallest and largest elongation of each different spring since `forget_range`."""
        return by_spring(self._bonds.group, len(self._bonds.law), self._low, self._high)

    def advance(self, steps):
        """Advance u and v by whole steps."""
        for _ in range(steps):
            straight = self._nodes * self._h * self._v  # (stages, entries)
            moved = self._solve(straight)
            slopes = self._inverse @ (moved - straight)
            slopes[:, self._w == 0] = 0  # to the last bit
            move = self._h * self._v + self._positions @ slopes
            self._u += move
            self._v += self._velocities @ slopes
            self.travel += float(np.max(np.abs(move[: self._moving]), initial=0.0))
            self._see(self._u + moved)
            self._see(self._u[None])

    def _solve(self, straight):
        moved, last = straight.copy(), np.inf
        residual = self._residual(moved, straight)
        for _ in range(ITERATIONS):
            update = self._newton(moved, residual)
            for _ in range(HALVINGS):
                trial = moved + update
                residual = self._residual(trial, straight)
                if np.isfinite(residual).all():
                    break
                update /= 2
            else:
                break
            moved, size = trial, np.abs(update).max()
            scale = max(np.abs(self._u).max(), np.abs(moved).max())
            if size <= np.finfo(moved.dtype).eps * scale or CLOSE * scale > size >= last / 2:
                return moved
            last = size
        raise StabilityError(
            f"dt {self._dt:.6g} s is too large for {self._method.name}: its equations were not "
            f"solved in {ITERATIONS} iterations; the springs change too much within a step"
        )

    def _places(self, moved):
        """Elongations and their gradients at displaced stages."""
        return forces.elongations(self._bonds, (self._u + moved).reshape(-1, *self._shape))

    def _residual(self, moved, straight):
        r, along = self._places(moved)
        pull = forces.pulls(self._bonds, self._per_bond(1, r), along).reshape(moved.shape)
        return moved - straight - self._matrix @ (self._w * (pull + self._loads))

    def _newton(self, moved, residual):
        """The update from the linearised equations, (stages, entries)."""
        stages, entries = moved.shape
        r, along = self._places(moved)
        k, t = self._per_bond(2, r).astype(float), self._per_bond(1, r).astype(float)
        r, along = r.astype(float), along.astype(float)
        at, to, values = [np.arange(stages * entries)], [np.arange(stages * entries)], []
        values.append(np.ones(stages * entries))
        for j in range(stages):
            stiff = forces.tangent(self._bonds, r[j], along[j], t[j], k[j])
            weighed = self._w[stiff.row] * stiff.data
            for i in range(stages):
                # rows: equation (entry, i); columns: unknown (entry', j)
                at.append(stages * stiff.row + i)
                to.append(stages * stiff.col + j)
                values.append(self._matrix[i, j] * weighed)
        found = tuple(np.concatenate(x) for x in (at, to, values))
        right = -residual.T.reshape(-1).astype(float)
        solve = _solve_sparse if self._bonds.dim else _solve_banded
        update = solve(*found, right, 2 * stages - 1)
        return update.reshape(entries, stages).T.astype(moved.dtype)

    def _per_bond(self, order, r):
        """Derivatives of the energies of all bonds; r of shape (stages, bonds)."""
        found, bonds = np.empty_like(r), self._bonds
        for law, members in enumerate(self._of_law):
            part = np.ascontiguousarray(r[:, members])
            values = bonds.parameters[bonds.group[members]].T
            found[:, members] = self._loop.evaluate(law, order, values, part)
        return found

    def _see(self, u):
        r = forces.stretch(self._bonds, u.reshape(-1, *self._shape))
        self._low = np.minimum(self._low, r.min(axis=0))
        self._high = np.maximum(self._high, r.max(axis=0))


def _solve_banded(at, to, values, right, width):
    from scipy.linalg import solve_banded

    bands = np.zeros((2 * width + 1, right.size))
    np.add.at(bands, (width + at - to, to), values)
    return solve_banded((width, width), bands, right, check_finite=False)


def _solve_sparse(at, to, values, right, width):
    from scipy.sparse import csc_array
    from scipy.sparse.linalg import splu

    matrix = csc_array((values, (at, to)), shape=(right.size, right.size))
    return splu(matrix).solve(right)
