"""Continuation of problems with many unknowns, on arrays.

A `Problem` is a set of CasADi expressions whose step is compiled as a whole.  A `ManyProblem`
evaluates residual and Jacobian as arrays and solves by LAPACK, for tens to hundreds of unknowns.
`trace` takes both, with the same steps, the same step control and the same events.
"""

from __future__ import annotations

import math
from typing import Any, Protocol

import numpy as np

from tensegrity.branches.arclength import (
    ITERATIONS,
    NUMBERS,
    ArclengthStepper,
    error_and_arc,
    step_control,
)
from tensegrity.errors import TensegrityError
from tensegrity.typing import Array, Indices

CONSTANT = 1e-13  # component of a unit tangent below which an unknown is constant
SAME_POINT = 1e-12  # last correction up to which its Jacobian is that of the corrected point
DIFFERENCE = 1e-3  # step of differences, over the unknown or its scale
STENCIL = (1, 2 / 3), (2, -1 / 12)  # multiples of it, and weights: order 4


class Equations(Protocol):
    """Equations of a branch in unknowns u (m,); the last one sets the direction at the start."""

    unknowns: tuple[str, ...]
    scale: Array
    roots: tuple[str, ...]
    folds: dict[str, int]  # name of the event, and number of the unknown that is stationary
    leaving: Indices  # numbers of the roots that vanish at the start

    def linearised(self, u: Array) -> tuple[Array, Array]:
        """Scaled residual (m - 1,) and its Jacobian (m - 1, m)."""

    def residual(self, u: Array) -> Array:
        """Scaled residual (m - 1,) alone."""

    def tests(self, u: Array) -> Array:
        """Event functions, each of which vanishes at its events, (roots,)."""


class PlainEquations:
    """Equations and events that a `Problem` states by functions of the unknowns."""

    leaving = np.zeros(0, dtype=int)

    def __init__(self, problem: Any) -> None:
        self.unknowns, self.scale = tuple(problem.unknowns), np.array(problem.scale)
        self.roots, self._problem = tuple(problem.events), problem
        self.folds = {kind: self.unknowns.index(name) for kind, name in problem.folds.items()}

    def residual(self, u: Array) -> Array:
        """Scaled residual (m - 1,)."""
        size = 1.0 if self._problem.size is None else np.asarray(self._problem.size(u))
        residual = np.ravel(np.asarray(self._problem.equations(u), dtype=float) / size)
        if len(residual) != len(u) - 1:
            raise TensegrityError(
                f"{len(residual)} equations do not suit {len(u)} unknowns, must be {len(u) - 1}"
            )
        return residual

    def linearised(self, u: Array) -> tuple[Array, Array]:
        """Scaled residual (m - 1,), and its Jacobian (m - 1, m) by central differences."""
        steps = DIFFERENCE * np.hypot(self.scale, u)
        slopes = [
            sum(w * (self.residual(u + k * step) - self.residual(u - k * step)) for k, w in STENCIL)
            for step in np.diag(steps)
        ]
        return self.residual(u), np.array(slopes).T / steps

    def tests(self, u: Array) -> Array:
        """Event functions (roots,)."""
        return np.array([float(event(u)) for event in self._problem.events.values()])


class ManyProblem(ArclengthStepper):
    """A problem for `trace` from `Equations`, without parameters, in unknowns asinh(u/scale)."""

    numbers = 0

    def __init__(self, equations: Any) -> None:
        super().__init__(equations.unknowns, equations.scale, equations.roots, equations.folds)
        self.equations, self._stationary = equations, list(equations.folds.values())
        self._unmoved = np.arange(self.m)
        for number in equations.leaving:
            self.vanishing[number] = math.inf

    def unknowns(self, z: Array) -> Array:
        """Unknowns u of scaled unknowns z, (m,)."""
        return np.asarray(np.sinh(z) * self.scale)

    def linearised(self, z: Array, p: Any) -> tuple[Array, Array]:
        """Residual (m - 1,) and Jacobian (m - 1, m) in scaled unknowns."""
        g, jacobian = self.equations.linearised(self.unknowns(z))
        return g, jacobian * (np.cosh(z) * self.scale)

    @np.errstate(all="ignore")  # divergence is detected by non-finite values
    def advance(self, before: Array, here: Array, control: Array, p: Any) -> Array:
        """One step beyond a point.

        Parameters
        ----------
        before, here : ndarray, (size,)
            Rows of the last two points.
        control : ndarray, (6,)
            As for `ArclengthStepper.steps`.
        p : ignored

        Returns
        -------
        ndarray, (size + 2,)
            Row of the new point, whether it is accepted (1 or 0), and the next step.
        """
        from scipy.linalg import lapack

        m, step = self.m, float(control[0])
        tangent = here[m : 2 * m]
        z = guess = self.predicted(before, here, step)
        last, matrix, right = math.inf, np.empty((m, m), order="F"), np.zeros(m)
        matrix[m - 1] = tangent
        for _ in range(ITERATIONS):
            right[: m - 1], matrix[: m - 1] = self.linearised(z, None)
            right[m - 1] = tangent @ (z - guess)
            factors, pivots, move, info = lapack.dgesv(matrix, right)
            last = float(np.abs(move).max())
            if info or not last < math.inf:
                return self._rejected_row(z, control)
            z = z - move
            if last <= SAME_POINT:
                break
        if last > SAME_POINT:
            matrix[: m - 1] = self.linearised(z, None)[1]
            factors, pivots, info = lapack.dgetrf(matrix)
        u = self.unknowns(z)
        residual = float(np.abs(self.equations.residual(u)).max())
        right[:-1], right[-1] = 0.0, 1.0
        new = lapack.dgetrs(factors, pivots, right)[0]
        size = math.sqrt(new @ new)
        if info or not size < math.inf:
            return self._rejected_row(z, control)
        new = new / size
        odd = np.count_nonzero(pivots != self._unmoved) + np.count_nonzero(factors.diagonal() < 0)
        side, missed, moved = (-1.0) ** odd, z - guess, z - here[:m]
        chord, cosine = math.sqrt(moved @ moved), float(new @ tangent)
        error = float(np.abs(missed).max())
        error, arc = error_and_arc(error, chord, cosine, step, float(here[self.length]))
        parts = new[self._stationary]
        parts[np.abs(parts) <= CONSTANT] = 0.0
        sides = side * float(here[self.side])
        figures = error, math.sqrt(missed @ missed), last, cosine, residual, sides
        following = step_control(NUMBERS, figures, control.tolist())
        tests = self.equations.tests(u)
        return np.concatenate([z, new, [residual, arc, side], tests, parts, following])

    def _rejected_row(self, z: Array, control: Array) -> Array:
        row = self.row(z, np.zeros(self.m), 0.0)
        row[self.residual] = math.inf
        return np.append(row, [0.0, control[0] / 10])
