"""One step of a continuation as fast functions: predict, correct, tangent, event functions.

The expressions of a problem become CasADi functions in scaled unknowns asinh(unknown/scale).  A
step is one function, compiled where there is a compiler; the Newton step on the system of an
event is made when it is first needed.  Each thread has its own arrays for them to work on: any
number may trace the same problem at once.
"""

from __future__ import annotations

import ctypes
import math
import threading
from dataclasses import dataclass

import numpy as np

from tensegrity.engine.native import CompilerError, library
from tensegrity.once import once

ITERATIONS = 3  # Newton iterations in a step
POLISH = 20  # iterations that locate an event
TINY = 1e-300  # keeps quotients of zeros finite


class Machine:
    """The CasADi functions of a problem, in scaled unknowns asinh(unknown/scale)."""

    def __init__(self, problem) -> None:
        import casadi as ca

        m, p, scale = len(problem.unknowns), problem.p, ca.DM(problem.scale)
        z = ca.SX.sym("z", m)

        def scaled(expression):
            return ca.substitute(ca.SX(expression), problem.z, scale * ca.sinh(z))

        g = scaled(problem.residual)
        jacobian = ca.jacobian(g, z)
        size = scaled(problem.size) if problem.size is not None else ca.SX.ones(m - 1)
        roots = ca.vertcat(*(scaled(e) for e in problem.roots.values()))
        folds = [scaled(e) for e in problem.folds.values()]
        values = ca.vertcat(*(scaled(e) for e in problem.values.values()))
        slopes = [ca.gradient(f, z) / (ca.norm_2(ca.gradient(f, z)) + TINY) for f in folds]
        self.m, self.roots, self.folds = m, tuple(problem.roots), tuple(problem.folds)
        self.judged = 2 * m + values.numel()  # where the figures of a step begin
        linear = ca.Function("linear", [z, p], [g, jacobian])
        judge = ca.Function("judge", [z, p], [values, g / size, roots, *slopes])
        self._advance = _fast("advance", *_advance(m, p, linear, judge), compiled=True)
        self._linear = _fast("linear", [z, p], ca.vertcat(g, ca.vec(ca.densify(jacobian))))
        self._values = _fast("values", [z, p], ca.vertcat(z, values))
        self.kinds = (*self.roots, *self.folds)
        self._systems = (
            {
                name: ([z], ca.vertcat(g, root))
                for name, root in zip(self.roots, ca.vertsplit(roots), strict=True)
            }
            if self.roots
            else {}
        )
        tangent, normal = ca.SX.sym("tangent", m), ca.SX.sym("normal", m)
        stretched = ca.dot(normal, tangent) - 1
        for name, slope in zip(self.folds, slopes, strict=True):
            system = ca.vertcat(g, jacobian @ tangent, ca.dot(slope, tangent), stretched)
            self._systems[name] = ([ca.vertcat(z, tangent), normal], system)
        self._p, self._newton_step = p, once(self._made_newton_step)

    def _made_newton_step(self, kind):
        """One Newton step on the system of an event."""
        import casadi as ca

        (x, *normal), system = self._systems[kind]
        new = x - ca.solve(ca.jacobian(system, x), system)
        step = ca.vertcat(new, ca.norm_2((new - x) / (1 + ca.fabs(new))))
        return _fast("newton", [x, *normal, self._p], step, compiled=True)

    def advance(self, before, here, step, p):
        """The point `step` beyond `here`, and the figures by which it is judged."""
        m = self.m
        given = self._advance.arguments[0]
        given[: 2 * m], given[2 * m : 4 * m] = before.data[: 2 * m], here.data[: 2 * m]
        given[4 * m], given[4 * m + 1] = here.length, step
        return self._point(p)

    def at(self, z, tangent, p):
        """The point of the branch next to z in the plane normal to `tangent`."""
        self._advance.arguments[0][:] = np.concatenate([z - tangent, tangent, z, tangent, [1, 0]])
        return self._point(p)[0]

    def _point(self, p):
        self._advance.arguments[1][: len(p)] = p
        self._advance._call()
        out, m = self._advance.result, self.judged
        error, moved, last, cosine, residual, length, side, *tests = out[m:].tolist()
        point = Point(self.m, out[:m].copy(), residual, length, side, tests)
        return point, (error, moved, last, cosine)

    def exactly_at(self, z, tangent, p):
        """The point of the branch at a z that is known to round-off already."""
        point = self.at(z, tangent, p)
        point.data[: self.m], point.data[2 * self.m :] = z, self._values(z, p)[self.m :]
        return point

    def linearised(self, z, p):
        """Residual and Jacobian."""
        values = self._linear(z, p)
        m = self.m
        return values[: m - 1], values[m - 1 :].reshape(m, m - 1).T

    def polish(self, kind, z, tangent, p):
        """Newton's method on the system extended by an event; the point, or None."""
        step, normal = self._newton_step(kind), [tangent] if kind in self.folds else []
        x = np.concatenate([z, *normal])
        previous = math.inf
        for _ in range(POLISH):
            *new, moved = step(x, *normal, p).tolist()
            if not math.isfinite(moved):
                return None
            x = np.array(new)
            if moved <= 1e-15 or (moved < 1e-11 and moved >= previous / 4):
                return x[: self.m]
            previous = moved
        return None


@dataclass(slots=True)
class Point:
    """A point of a branch, with the length of the step to it and its event functions.

    `data` is z, the tangent and the values to tabulate.  `side` is the determinant of the
    Jacobian bordered by a tangent.  It changes its sign at a simple bifurcation, and between a
    branch and one that nearly meets it.
    """

    m: int
    data: np.ndarray
    residual: float
    length: float
    side: float
    tests: list

    @property
    def z(self):
        return self.data[: self.m]

    @property
    def tangent(self):
        return self.data[self.m : 2 * self.m]


def _fast(name, inputs, output, compiled=False):
    """Such a function of CasADi expressions, compiled where wanted and where that is possible."""
    import casadi as ca

    function, code = ca.Function(name, inputs, [ca.densify(output)]), None
    if compiled:
        generator = ca.CodeGenerator("step.c")
        generator.add(function)
        try:
            code = library(generator.dump())[name]
        except CompilerError:
            return _Fast(function, None)
        code.argtypes = [ctypes.c_void_p] * 4 + [ctypes.c_int]
    return _Fast(function, code)


class _Fast(threading.local):
    """A function of vectors with one vector as its result, called in about a microsecond.

    It reads and writes fixed arrays, compiled or, without a compiler, on CasADi's machine; an
    ordinary call of a CasADi function takes 20 us.  Each thread has its own arrays: `__init__`
    runs in each when it first comes here.
    """

    def __init__(self, function, code) -> None:
        self.arguments = [np.zeros(max(function.numel_in(i), 1)) for i in range(function.n_in())]
        self.result = np.zeros(function.numel_out(0))
        self._call = self._compiled(function, code) if code else self._interpreted(function)

    def _interpreted(self, function):
        self._buffer, call = function.buffer()  # kept: the process dies without it
        for i, argument in enumerate(self.arguments):
            self._buffer.set_arg(i, memoryview(argument))
        self._buffer.set_res(0, memoryview(self.result))
        return call

    def _compiled(self, function, code):
        addresses = [x.ctypes.data for x in self.arguments]
        self._arguments = (ctypes.c_void_p * len(addresses))(*addresses)
        self._results = (ctypes.c_void_p * 1)(self.result.ctypes.data)
        self._work = np.zeros(function.sz_w() + 1), np.zeros(function.sz_iw() + 1, dtype=np.int64)
        given = (
            ctypes.addressof(self._arguments),
            ctypes.addressof(self._results),
            self._work[1].ctypes.data,
            self._work[0].ctypes.data,
            0,
        )
        return lambda: code(*given)

    def __call__(self, *values):
        """The result, in an array that the next call overwrites."""
        for argument, value in zip(self.arguments, values, strict=True):
            argument[: len(value)] = value
        self._call()
        return self.result


def _advance(m, p, at, judge):
    """Predict, correct, tangent and tests as one function of (two points and steps, p)."""
    import casadi as ca

    given = ca.SX.sym("given", 4 * m + 2)
    old, old_tangent, here, tangent = (given[i * m : (i + 1) * m] for i in range(4))
    length, step = given[4 * m], given[4 * m + 1]

    # Hermite's cubic through both points, continued to `step` beyond the second
    t = step / length
    slope = (here - old) / length
    curve = tangent - slope
    bend = (tangent + old_tangent - 2 * slope) * (1 + t)
    guess = here + step * (tangent + t * (curve + bend))

    z, moves = guess, []
    border = ca.horzcat(tangent).T
    for _ in range(ITERATIONS):
        g, jacobian = at(z, p)
        move = ca.solve(ca.vertcat(jacobian, border), ca.vertcat(g, ca.dot(tangent, z - guess)))
        z = z - move
        moves.append(ca.norm_inf(move))
    g, jacobian = at(z, p)
    new = ca.solve(ca.vertcat(jacobian, border), ca.vertcat(ca.SX.zeros(m - 1), 1))
    new = new / ca.norm_2(new)
    values, scaled, roots, *slopes = judge(z, p)
    cosine = ca.dot(new, tangent)
    # errors of cubics: 1/16 times this for interpolation by extrapolation, and a margin of 2
    error = ca.norm_inf(z - guess) * (step / (step + length)) ** 2 / 8
    arc = ca.norm_2(z - here) * (1 + (1 - cosine) / 12)  # chord to arc of a circle, order 4
    side = _determinant(ca.vertcat(jacobian, border))
    moved, residual = ca.norm_2(z - guess), ca.norm_inf(scaled)
    tests = [roots, *(ca.dot(s, new) for s in slopes)]
    figures = (error, moved, moves[-1], cosine, residual, arc, side, *tests)
    return [given, p], ca.vertcat(z, new, values, *figures)


def _determinant(matrix):
    """Determinant of an SX matrix by Householder reflections."""
    import casadi as ca

    matrix, size, product = ca.SX(matrix), matrix.shape[0], 1
    for k in range(size - 1):
        mirror = matrix[k:, k]
        diagonal = -ca.if_else(mirror[0] < 0, -1, 1) * ca.norm_2(mirror)
        mirror[0] -= diagonal
        share = 2 / (ca.dot(mirror, mirror) + TINY)
        matrix[k:, k:] -= mirror @ (share * (mirror.T @ matrix[k:, k:]))
        product = -product * diagonal
    return product * matrix[size - 1, size - 1]


def virtual_start(point, step=1.0):
    """A point before the first one, such that the cubic becomes the tangent."""
    data = np.concatenate([point.z - step * point.tangent, point.tangent])
    return Point(point.m, data, 0.0, step, 0.0, [])
