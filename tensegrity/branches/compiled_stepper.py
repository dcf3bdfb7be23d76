"""Steps along the branch of a `Problem` by compiled functions.

The expressions of the problem become CasADi functions of the scaled unknowns.  If there is a
compiler they are compiled together with the loop over steps without events (`follow.c`); the
Newton step on the extended system of an event is built when it is first needed.  Several threads
may trace the same problem at once.
"""

from __future__ import annotations

import ctypes
from importlib.resources import files

import numpy as np

from tensegrity.branches.arclength import (
    ALIGNED,
    ITERATIONS,
    POLISH,
    ROOT_AT_START,
    TINY,
    ArclengthStepper,
    converged,
    error_and_arc,
    step_control,
)
from tensegrity.engine.compiled import PREFIX, Functions
from tensegrity.engine.native import address
from tensegrity.once import once

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
        self._key, self._scaled = key, once(lambda: _Scaled(problem))
        self.functions = Functions(self._cache_key("stepper"), self._build, self._loop_source())
        self.newton = once(self._build_newton)
        self.library = self.functions.library
        if self.library:
            pointer, number = ctypes.c_void_p, ctypes.c_longlong
            self.library.steps.argtypes = [*[pointer] * 3, number, number]
            self.library.corrected.argtypes = [pointer] * 4
            self.library.least_norm.argtypes = [pointer] * 3
            several = [*[pointer] * 4, ctypes.c_double, *[pointer] * 3, number]
            self.library.locate_event.argtypes = several

    def _cache_key(self, *what):
        return self._key and (*what, self._key)

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
            "values": ca.Function("values", [s.z, s.p], [s.values]),
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
        sizes |= {"POLISH": POLISH, "ALIGNED": ALIGNED, "FULL_RANK": FULL_RANK, "TINY": TINY}
        sizes |= {"ROOT_AT_START": ROOT_AT_START}
        defined = [f"#define {name} {number!r}" for name, number in sizes.items()]
        text = files(__package__).joinpath("follow.c").read_text()
        return "\n".join([*defined, '#line 1 "follow.c"', text])

    def _build_newton(self, kind):
        """One Newton step on the extended system of an event, and its machine address."""
        step = Functions(
            self._cache_key("newton", kind), lambda: {"newton": self._scaled().newton(kind)}
        )
        at = step.library and ctypes.cast(step.library[f"{PREFIX}newton"], ctypes.c_void_p).value
        return step, at

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

    def steps(self, rows, count, control, p):
        """Step on until a step contains an event, no step is accepted, or the rows are full.

        Parameters
        ----------
        rows : ndarray, (any, size)
            Points, of which the first `count` are given; filled in place.
        count : int
        control : ndarray, (6,)
            As for `ArclengthStepper.steps`; its step is updated in place.
        p : ndarray, (k,)
            Parameters.

        Returns
        -------
        int
            Number of rows filled.
        """
        if not self.library:
            return super().steps(rows, count, control, p)
        return self.library.steps(*map(address, (p, control, rows)), count, len(rows))

    def locate_event(self, kind, before, here, part, ends, p):
        """Locate an event between two points by Newton's method on its extended system.

        Parameters
        ----------
        kind : str
        before, here : ndarray, (size,)
            Rows of the two points.
        part : float
            Fraction of the way at which the iteration starts.
        ends : tuple of two ndarray, (size,)
            Rows that bracket the event.
        p : ndarray, (k,)
            Parameters.

        Returns
        -------
        ndarray, (size,), or None
            Row of the event; None if the iteration fails, or finds another event or branch.
        """
        newton = self.newton(kind)[1]
        if not (self.library and newton):
            return super().locate_event(kind, before, here, part, ends, p)
        result = np.empty(self.size)
        given = newton, *map(address, (p, before, here)), part, *map(address, (*ends, result))
        return result if self.library.locate_event(*given, kind in self.folds) else None

    def values(self, z, p):
        """The tabulated values, (values,)."""
        return self.functions("values", z, p)

    def least_norm(self, z, p):
        solutions = np.empty((2, self.m))
        full_rank = self.library and self.library.least_norm(*map(address, (p, z, solutions)))
        return solutions if full_rank else super().least_norm(z, p)

    def linearised(self, z, p):
        """Residual (m - 1,) and Jacobian (m - 1, m) in scaled unknowns."""
        values = self.functions("linear", z, p)
        m = self.m
        return values[: m - 1], values[m - 1 :].reshape(m, m - 1).T

    def polish(self, kind, z, tangent, p):
        """An event by Newton's method on its extended system.

        Parameters
        ----------
        kind : str
        z, tangent : ndarray, (m,)
            Initial scaled unknowns, and a tangent of the branch.
        p : ndarray, (k,)
            Parameters.

        Returns
        -------
        ndarray, (m,), or None
            Scaled unknowns; None if the iteration fails.
        """
        newton, normal = self.newton(kind)[0], [tangent] if kind in self.folds else []

        def step(x):
            *new, moved = newton("newton", x, *normal, p).tolist()
            return np.array(new), moved

        x = converged(step, np.concatenate([z, *normal]))
        return None if x is None else x[: self.m]


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
        self._of_root = dict(zip(problem.events, range(len(problem.events)), strict=True))
        self._of_fold = dict(zip(problem.folds, self.slopes, strict=True))

    def newton(self, kind):
        """One Newton step on the extended system of an event, and its size."""
        import casadi as ca

        m, x, normal = self.z.numel(), self.z, []
        if kind in self._of_fold:
            slope = self._of_fold[kind]
            tangent, normal = ca.SX.sym("tangent", m), [ca.SX.sym("normal", m)]
            stretched = ca.dot(*normal, tangent) - 1
            x = ca.vertcat(self.z, tangent)
            system = ca.vertcat(self.g, self.jacobian @ tangent, ca.dot(slope, tangent), stretched)
        else:
            system = ca.vertcat(self.g, self.roots[self._of_root[kind]])
        new = x - ca.solve(ca.jacobian(system, x), system)
        step = ca.vertcat(new, ca.norm_2((new - x) / (1 + ca.fabs(new))))
        return ca.Function("newton", [x, *normal, self.p], [step])


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
