"""Steps of Gauss collocation on a chain: stages solved for by Newton's method.

The displacements D_i of the stages satisfy D_i = nodes[i] dt v + dt^2 sum_j matrix[i][j] a(u + D_j)
with a full matrix.  Ordered site by site the Jacobian is banded; it is computed and factored in
double precision whatever the precision of the state, which the residual alone decides.
"""

from __future__ import annotations

import numpy as np

from tensegrity.errors import StabilityError

ITERATIONS = 60
HALVINGS = 30  # of an update that leads out of the domain of a law
CLOSE = 1e-6  # updates below this, relative, converge quadratically


class BoundGauss:
    """A chain advanced in place by an implicit method.

    Parameters
    ----------
    engine : Compiled or Interpreted
        What evaluates the laws.
    u, v, inverse_mass : ndarray, (sites,)
    segments : Segments
    method : Gauss
    dt : float
        [s]
    """

    def __init__(self, engine, u, v, inverse_mass, segments, method, dt):
        self._engine, self._u, self._v, self._segments = engine, u, v, segments
        self._w = np.asarray(inverse_mass, dtype=float)
        self._method, self._dt = method, dt
        kind = u.dtype.type
        self._matrix = np.array(method.matrix) * dt**2
        self._nodes, self._h = np.array(method.nodes)[:, None].astype(kind), kind(dt)
        self._inverse = np.linalg.inv(method.matrix) / (dt**2 or 1.0)  # no step, no use of it
        self._positions = np.array(method.positions) * dt**2
        self._velocities = np.array(method.velocities) * dt
        self.range = np.empty((len(segments.law), 2))
        self.forget_range()

    def forget_range(self):
        """Start anew to record the smallest and the largest elongation of each segment."""
        self.range[:, 0], self.range[:, 1] = np.inf, -np.inf

    def advance(self, steps):
        """Advance u and v by whole steps."""
        for _ in range(steps):
            straight = self._nodes * self._h * self._v  # (stages, sites)
            moved = self._solve(straight)
            slopes = self._inverse @ (moved - straight)
            held = self._w == 0
            slopes[:, held] = 0
            self._u += self._h * self._v + self._positions @ slopes
            self._v += self._velocities @ slopes
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

    def _residual(self, moved, straight):
        pull = self._per_bond(1, np.diff(self._u + moved))
        edge = np.zeros((len(pull), 1), dtype=pull.dtype)
        pulls = self._w * np.diff(pull, prepend=edge, append=edge)
        return moved - straight - self._matrix @ pulls

    def _newton(self, moved, residual):
        """The update from the linearised equations, (stages, sites)."""
        from scipy.linalg import solve_banded

        stages, sites = moved.shape
        k = self._per_bond(2, np.diff(self._u + moved)).astype(float)
        width = 2 * stages - 1
        bands = np.zeros((2 * width + 1, sites, stages))
        bands[width] = 1
        for i, row in enumerate(self._matrix):
            for j, a in enumerate(row):
                # rows: equation (site, i); columns: unknown (site', j)
                stiff = a * k[j]
                bands[width + i - j, :-1, j] += self._w[:-1] * stiff
                bands[width + i - j, 1:, j] += self._w[1:] * stiff
                bands[width + i - j - stages, 1:, j] -= self._w[:-1] * stiff
                bands[width + i - j + stages, :-1, j] -= self._w[1:] * stiff
        flat = bands.reshape(2 * width + 1, -1)
        right = -residual.T.reshape(-1).astype(float)
        update = solve_banded((width, width), flat, right, check_finite=False)
        return update.reshape(sites, stages).T.astype(moved.dtype)

    def _per_bond(self, order, r):
        """Derivatives of the energies of all bonds; r of shape (stages, bonds)."""
        found, s = np.empty_like(r), self._segments
        for law, values, first, last in zip(
            s.law, s.parameters, s.first[:-1], s.first[1:], strict=True
        ):
            part = np.ascontiguousarray(r[:, first:last])
            found[:, first:last] = self._engine.evaluate(
                int(law), order, values, part.reshape(-1)
            ).reshape(part.shape)
        return found

    def _see(self, u):
        r = np.diff(u)
        for row, first, last in zip(
            self.range, self._segments.first[:-1], self._segments.first[1:], strict=True
        ):
            row[0] = min(row[0], r[:, first:last].min())
            row[1] = max(row[1], r[:, first:last].max())
