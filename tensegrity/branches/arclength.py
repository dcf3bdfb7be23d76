"""One step of a continuation as fast functions: predict, correct, tangent, event functions.

The expressions of a problem become CasADi functions in scaled unknowns asinh(unknown/scale),
compiled where there is a compiler, with a loop that follows a branch to its end in one call.  The
Newton step on the system of an event is made when it is first needed.  Any number of threads may
trace the same problem at once.
"""

from __future__ import annotations

import ctypes
import math
from dataclasses import dataclass
from importlib.resources import files

import numpy as np

from tensegrity.engine.compiled import PREFIX, Functions
from tensegrity.errors import CompilerError
from tensegrity.once import once

START_ITERATIONS = 50
FULL_RANK = 1e-8  # least diagonal of a factor over the largest, at a start that needs no more care
ITERATIONS = 3  # Newton iterations in a step
POLISH = 20  # iterations that locate an event
BISECTIONS = 45  # where they fail
ROOT_AT_START, FOLD_AT_START = 1e-14, 1e-8  # event functions that vanish at the first point
SETTLED = 1e-7  # largest move of a step's last iteration; the next one would square it
NEAR = 1e-3  # part of a step: what is farther from its cubic is on another branch
ALIGNED = 0.99  # cosine to the cubic's tangent below which one is round-off, where branches meet
TWINS = 1e-6  # branches nearer than this are taken to meet
TINY = 1e-300  # keeps quotients of zeros finite


class Machine:
    """The functions of a problem, in scaled unknowns asinh(unknown/scale).

    Parameters
    ----------
    problem : Problem
    facts : dict
        Names of its unknowns, roots, folds and values, their scales, and how many parameters.
    parts : tuple, or None
        What names the problem in `kept`.
    """

    def __init__(self, problem, facts, parts=None) -> None:
        self.names, self.scale = tuple(facts["unknowns"]), np.array(facts["scale"])
        self.roots, self.folds = tuple(facts["roots"]), tuple(facts["folds"])
        self.tabulated, self.numbers = tuple(facts["values"]), facts["numbers"]
        self.kinds, self.m = (*self.roots, *self.folds), len(self.names)
        self.vanishing = [*[ROOT_AT_START] * len(self.roots), *[FOLD_AT_START] * len(self.folds)]
        self.judged = 2 * self.m + len(self.tabulated)  # where the figures of a step begin
        self.size = self.judged + 3 + len(self.kinds)  # of a row in follow.c
        self._parts, self._scaled = parts, once(lambda: _Scaled(problem))
        self.functions = Functions(self._named("machine"), self._made, self._follow())
        self.library = self.functions.library
        self.newton = once(self._made_newton)
        self.addresses = [0] * len(self.kinds)  # of the compiled Newton steps made so far

    def _named(self, *what):
        return self._parts and (*what, self._parts)

    def _made(self):
        import casadi as ca

        s = self._scaled()
        linear = ca.Function("linear", [s.z, s.p], [s.g, s.jacobian])
        judge = ca.Function("judge", [s.z, s.p], [s.values, s.g / s.size, s.roots, *s.slopes])
        inputs, output = _advance(self.m, s.p, linear, judge)
        return {
            "advance": ca.Function("advance", inputs, [output]),
            "linear": ca.Function(
                "linear", [s.z, s.p], [ca.vertcat(s.g, ca.vec(ca.densify(s.jacobian)))]
            ),
            "values": ca.Function("values", [s.z, s.p], [ca.vertcat(s.z, s.values)]),
        }

    def _follow(self):
        """C of the loop, with the numbers that it is made for."""
        sizes = {"M": self.m, "VALUES": len(self.tabulated), "KINDS": len(self.kinds)}
        sizes |= {"ROOTS": len(self.roots), "FOLDS": len(self.folds)}
        sizes |= {"POLISH": POLISH, "BISECTIONS": BISECTIONS, "ROOT_AT_START": ROOT_AT_START}
        sizes |= {"FOLD_AT_START": FOLD_AT_START, "SETTLED": SETTLED, "TWINS": TWINS, "TINY": TINY}
        sizes |= {"NEAR": NEAR, "ALIGNED": ALIGNED}
        sizes |= {"START_ITERATIONS": START_ITERATIONS, "FULL_RANK": FULL_RANK}
        defined = [f"#define {name} {number!r}" for name, number in sizes.items()]
        text = files(__package__).joinpath("follow.c").read_text()
        return "\n".join([*defined, '#line 1 "follow.c"', text])

    def _made_newton(self, kind):
        """One Newton step on the system of an event."""
        return Functions(
            self._named("newton", kind), lambda: {"newton": self._scaled().newton(kind)}
        )

    def address(self, kind):
        """Where the compiled Newton step for an event is."""
        found = self.newton(kind).library
        if found is None:
            raise CompilerError(f"the Newton step for {kind} was not compiled")
        address = ctypes.cast(found[f"{PREFIX}newton"], ctypes.c_void_p).value
        self.addresses[self.kinds.index(kind)] = address
        return address

    def advance(self, before, here, step, p):
        """The point `step` beyond `here`, and the figures by which it is judged."""
        m = self.m
        given = [*before.data[: 2 * m], *here.data[: 2 * m], here.length, step]
        return self._point(given, p)

    def at(self, z, tangent, p):
        """The point of the branch next to z in the plane normal to `tangent`."""
        return self._point(np.concatenate([z - tangent, tangent, z, tangent, [1, 0]]), p)[0]

    def _point(self, given, p):
        out, m = self.functions("advance", given, p), self.judged
        error, moved, last, cosine, residual, length, side, *tests = out[m:].tolist()
        point = Point(self.m, out[:m].copy(), residual, length, side, tests)
        return point, (error, moved, last, cosine)

    def exactly_at(self, z, tangent, p):
        """The point of the branch at a z that is known to round-off already."""
        point = self.at(z, tangent, p)
        point.data[: self.m] = z
        point.data[2 * self.m :] = self.functions("values", z, p)[self.m :]
        return point

    def linearised(self, z, p):
        """Residual and Jacobian."""
        values = self.functions("linear", z, p)
        m = self.m
        return values[: m - 1], values[m - 1 :].reshape(m, m - 1).T

    def polish(self, kind, z, tangent, p):
        """Newton's method on the system extended by an event; the point, or None."""
        step, normal = self.newton(kind), [tangent] if kind in self.folds else []
        x = np.concatenate([z, *normal])
        previous = math.inf
        for _ in range(POLISH):
            *new, moved = step("newton", x, *normal, p).tolist()
            if not math.isfinite(moved):
                return None
            x = np.array(new)
            if moved <= 1e-15 or (moved < 1e-11 and moved >= previous / 4):
                return x[: self.m]
            previous = moved
        return None


class _Scaled:
    """Expressions of a problem in scaled unknowns z."""

    def __init__(self, problem):
        import casadi as ca

        m, scale = len(problem.unknowns), ca.DM(problem.scale)
        self.p = problem.p
        self.z = z = ca.SX.sym("z", m)

        def scaled(expression):
            return ca.substitute(ca.SX(expression), problem.z, scale * ca.sinh(z))

        self.g = scaled(problem.residual)
        self.jacobian = ca.jacobian(self.g, z)
        self.size = scaled(problem.size) if problem.size is not None else ca.SX.ones(m - 1)
        self.roots = ca.vertcat(*(scaled(e) for e in problem.roots.values()))
        self.values = ca.vertcat(*(scaled(e) for e in problem.values.values()))
        folds = [scaled(e) for e in problem.folds.values()]
        self.slopes = [ca.gradient(f, z) / (ca.norm_2(ca.gradient(f, z)) + TINY) for f in folds]
        self._of_root = dict(zip(problem.roots, range(len(problem.roots)), strict=True))
        self._of_fold = dict(zip(problem.folds, self.slopes, strict=True))

    def newton(self, kind):
        """One Newton step on the system of an event, and how far it goes."""
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

    @property
    def numbers(self):
        """All of it in a row, as in `follow.c`."""
        return np.concatenate([self.data, [self.residual, self.length, self.side, *self.tests]])


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
