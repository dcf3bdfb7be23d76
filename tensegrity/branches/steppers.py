"""Steps along the branch of a problem, by compiled functions or on arrays.

The expressions of a `Problem` become CasADi functions of the scaled unknowns.  If there is a
compiler they are compiled together with the loop over steps without events (`follow.c`).  Several
threads may trace the same problem at once.  A `ManyProblem` evaluates residual and Jacobian as
arrays and solves by LAPACK, for tens to hundreds of unknowns.  `trace` takes both, with the same
steps, the same step control and the same events.
"""

from __future__ import annotations

import ctypes
import math
from importlib.resources import files
from typing import Any, Protocol

import numpy as np

from tensegrity.branches.arclength import (
    ALIGNED,
    BISECTIONS,
    ITERATIONS,
    NUMBERS,
    ROOT_AT_START,
    TINY,
    ArclengthStepper,
    error_and_arc,
    step_control,
)
from tensegrity.engine.compiled import Functions
from tensegrity.engine.native import address
from tensegrity.errors import TensegrityError
from tensegrity.once import once
from tensegrity.root import ROUND_OFF
from tensegrity.typing import Array, Indices

FULL_RANK = 1e-8  # smallest diagonal of a QR factor, over the largest, of full rank


class CompiledStepper(ArclengthStepper):
    """Steps of a `Problem` by compiled functions, in scaled unknowns asinh(unknown/scale).

    Parameters
    ----------
    problem : Problem
    layout : dict
        Names of unknowns, roots, folds and values, the scales, and the number of parameters.
    key : tuple, or None
        Key of the problem in the cache of compiled functions.
    """

    def __init__(self, problem, layout, key=None) -> None:
        names = (layout[key] for key in ("unknowns", "scale", "roots", "folds", "values"))
        super().__init__(*names)
        self.numbers = layout["numbers"]
        self._scaled = once(lambda: _Scaled(problem))
        self.functions = Functions(key and ("stepper", key), self._build, self._loop_source())
        self.library = self.functions.library
        if self.library:
            pointer, number = ctypes.c_void_p, ctypes.c_longlong
            self.library.steps.argtypes = [*[pointer] * 3, number, number, pointer, pointer, number]
            self.library.corrected.argtypes = [pointer] * 4
            self.library.least_norm.argtypes = [pointer] * 3
            numbers = [number, *[ctypes.c_double] * 3]
            self.library.locate.argtypes = [*[pointer] * 3, *numbers, pointer]

    def _build(self):
        import casadi as ca

        s = self._scaled()
        linear = ca.Function("linear", [s.z, s.p], [s.g, s.jacobian])
        tests = ca.Function("tests", [s.z, s.p], [s.values, s.g / s.size, s.roots, *s.slopes])
        part, *rows = ca.SX.sym("part"), *(ca.SX.sym("row", self.size) for _ in range(3))
        curve = ca.vertcat(*self.interpolated(*rows[:2], part))
        return {
            "advance": self._build_advance(s.p, linear, tests),
            "linear": ca.Function(
                "linear", [s.z, s.p], [ca.vertcat(s.g, ca.vec(ca.densify(s.jacobian)))]
            ),
            "interpolated": ca.Function("interpolated", [*rows[:2], part], [curve]),
            "deviation": ca.Function("deviation", rows, [ca.vertcat(*self.deviation(*rows))]),
        }

    def _build_advance(self, p, at, tests):
        """Predictor, corrector, tangent, event functions and step control as one function of two
        points, control and parameters."""
        import casadi as ca

        m, before, row = self.m, ca.SX.sym("before", self.size), ca.SX.sym("here", self.size)
        here, tangent, control = row[:m], row[m : 2 * m], ca.SX.sym("control", 6)
        step, length = control[0], row[self.length]
        z = guess = self.predicted(before, row, step)
        moves = []
        border = ca.horzcat(tangent).T
        for _ in range(ITERATIONS):
            g, jacobian = at(z, p)
            move = ca.solve(ca.vertcat(jacobian, border), ca.vertcat(g, ca.dot(tangent, z - guess)))
            z = z - move
            moves.append(ca.norm_inf(move))
        g, jacobian = at(z, p)
        new = ca.solve(ca.vertcat(jacobian, border), ca.vertcat(ca.SX.zeros(m - 1), 1))
        new = new / ca.norm_2(new)
        values, scaled, roots, *slopes = tests(z, p)
        cosine = ca.dot(new, tangent)
        moved, chord = ca.norm_2(z - guess), ca.norm_2(z - here)
        error, arc = error_and_arc(ca.norm_inf(z - guess), chord, cosine, step, length)
        side = _determinant(ca.vertcat(jacobian, border))
        residual = ca.norm_inf(scaled)
        tests = [roots, *(ca.dot(s, new) for s in slopes)]
        figures = (error, moved, moves[-1], cosine, residual, side * row[self.side])
        following = step_control(ca, figures, ca.vertsplit(control))
        result = [z, new, values, residual, arc, side, *tests, *following]
        return ca.Function("advance", [before, row, control, p], [ca.vertcat(*result)])

    def _loop_source(self):
        """The C text of the loop, with its sizes and constants defined."""
        sizes = {"M": self.m, "VALUES": len(self.tabulated), "KINDS": len(self.kinds)}
        sizes |= {
            "BISECTIONS": BISECTIONS,
            "ALIGNED": ALIGNED,
            "FULL_RANK": FULL_RANK,
            "TINY": TINY,
        }
        sizes |= {"ROOT_AT_START": ROOT_AT_START, "ROUND_OFF": ROUND_OFF}
        defined = [f"#define {name} {number!r}" for name, number in sizes.items()]
        text = files(__package__).joinpath("follow.c").read_text()
        return "\n".join([*defined, '#line 1 "follow.c"', text])

    def advance(self, before, here, control, p):
        """One step beyond a point.

        Parameters
        ----------
        before, here : ndarray, (size,)
            Rows of the last two points.
        control : ndarray, (6,)
            As for `steps`.
        p : ndarray, (k,)
            Parameters.

        Returns
        -------
        ndarray, (size + 2,)
            Row of the new point, whether it is accepted (1 or 0), and the next step.
        """
        return self.functions("advance", before, here, control, p)

    def corrected(self, z, tangent, p):
        """Corrector: the point of the branch closest to z in the plane normal to a tangent.

        Parameters
        ----------
        z, tangent : ndarray, (m,)
        p : ndarray, (k,)
            Parameters.

        Returns
        -------
        ndarray, (size,)
            Row of the point.
        """
        if not self.library:
            return super().corrected(z, tangent, p)
        result = np.empty(self.size)
        self.library.corrected(*map(address, (p, z, tangent, result)))
        return result

    def steps(self, rows, count, control, p, levels=()):
        """Step on until a step contains an event or a level, no step is accepted, or the rows are
        full.

        Parameters
        ----------
        rows : ndarray, (any, size)
            Points, of which the first `count` are given; filled in place.
        count : int
        control : ndarray, (6,)
            As for `ArclengthStepper.steps`; its step is updated in place.
        p : ndarray, (k,)
            Parameters.
        levels : sequence of (int, float)
            Places in a row, and values there.

        Returns
        -------
        int
            Number of rows filled.
        """
        if not self.library:
            return super().steps(rows, count, control, p)
        given = (*map(address, (p, control, rows)), count, len(rows))
        if not levels:
            return self.library.steps(*given, None, None, 0)
        places = np.array([place for place, _ in levels], dtype=np.int64)
        values = np.array([value for _, value in levels])
        return self.library.steps(*given, address(places), address(values), len(levels))

    def locate(self, before, here, column, value, ends, p):
        """The point between two others where a column has a value.

        Parameters
        ----------
        before, here, column, value, ends, p
            As for `ArclengthStepper.locate`.

        Returns
        -------
        ndarray, (size,)
        """
        if callable(column) or not self.library:
            return super().locate(before, here, column, value, ends, p)
        result = np.empty(self.size)
        points = map(address, (p, before, here))
        self.library.locate(*points, column, value, *ends, address(result))
        return result

    def least_norm(self, z, p):
        solutions = np.empty((2, self.m))
        full_rank = self.library and self.library.least_norm(*map(address, (p, z, solutions)))
        return solutions if full_rank else super().least_norm(z, p)

    def linearised(self, z, p):
        """Residual (m - 1,) and Jacobian (m - 1, m) in scaled unknowns."""
        values = self.functions("linear", z, p)
        m = self.m
        return values[: m - 1], values[m - 1 :].reshape(m, m - 1).T


class _Scaled:
    """The expressions of a problem in scaled unknowns z."""

    def __init__(self, problem):
        import casadi as ca

        m, scale = len(problem.unknowns), ca.DM(problem.scale)
        self.p = problem.p
        self.z = z = ca.SX.sym("z", m)

        def scaled(expression):
            return ca.substitute(ca.SX(expression), problem.z, scale * ca.sinh(z))

        self.g = scaled(problem.equations)
        self.jacobian = ca.jacobian(self.g, z)
        self.size = scaled(problem.size) if problem.size is not None else ca.SX.ones(m - 1)
        self.roots = ca.vertcat(*(scaled(e) for e in problem.events.values()))
        self.values = ca.vertcat(*(scaled(e) for e in problem.columns.values()))
        folds = [scaled(e) for e in problem.folds.values()]
        self.slopes = [ca.gradient(f, z) / (ca.norm_2(ca.gradient(f, z)) + TINY) for f in folds]


def _determinant(matrix):
    """Determinant of an SX matrix by Householder reflections."""
    import casadi as ca

    matrix, size, product = ca.SX(matrix), matrix.shape[0], 1
    for k in range(size - 1):
        mirror = matrix[k:, k]
        diagonal = -ca.if_else(mirror[0] < 0, -1, 1) * ca.norm_2(mirror)
        mirror[0] -= diagonal
        factor = 2 / (ca.dot(mirror, mirror) + TINY)
        matrix[k:, k:] -= mirror @ (factor * (mirror.T @ matrix[k:, k:]))
        product = -product * diagonal
    return product * matrix[size - 1, size - 1]


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
