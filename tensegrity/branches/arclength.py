"""One step of a continuation as fast functions: predict, correct, tangent, event functions.

The expressions of a problem become CasADi functions in scaled unknowns asinh(unknown/scale),
compiled where there is a compiler, with the loop over quiet steps (`follow.c`).  The Newton step on
the system of an event is made when it is first needed.  Any number of threads may trace the same
problem at once.

A point is a row of numbers: z, the unit tangent, the values to tabulate, then residual, length of
the step to it, side, and the event functions ("tests").  The side is the determinant of the
Jacobian bordered by the tangent before: it changes its sign at a simple bifurcation, and between a
branch and one that nearly meets it.
"""

from __future__ import annotations

import ctypes
import math
from importlib.resources import files

import numpy as np

from tensegrity.engine.compiled import PREFIX, Functions
from tensegrity.engine.native import address
from tensegrity.once import once

ITERATIONS = 3  # Newton iterations in a step
POLISH = 20  # iterations that locate an event
FULL_RANK = 1e-8  # least diagonal of a factor over the largest, at a start that needs no more care
SETTLED = 1e-7  # largest move of a step's last iteration; the next one would square it
NEAR = 1e-3  # part of a step: what is farther from its cubic is on another branch
ALIGNED = 0.99  # cosine to the cubic's tangent below which one is round-off, where branches meet
TWINS = 1e-6  # branches nearer than this are taken to meet
ROOT_AT_START, FOLD_AT_START = 1e-14, 1e-8  # event functions that vanish at the first point
TINY = 1e-300  # keeps quotients of zeros finite


class ArclengthStepper:
    """Steps along a branch with m unknowns and events of some kinds; p are its parameters.

    A kind of steps gives `advance`, `values`, `linearised` and `polish`.  What is a formula here
    takes rows of NumPy, or of CasADi.
    """

    def __init__(self, names, scale, roots, folds, tabulated=()) -> None:
        self.names, self.scale = tuple(names), np.array(scale, dtype=float)
        self.roots, self.folds, self.tabulated = tuple(roots), tuple(folds), tuple(tabulated)
        self.kinds, self.m = (*self.roots, *self.folds), len(self.names)
        self.residual = 2 * self.m + len(self.tabulated)  # places in a row
        self.length, self.side, self.tests = (self.residual + k for k in (1, 2, 3))
        self.size = self.tests + len(self.kinds)
        self.vanishing = [*[ROOT_AT_START] * len(self.roots), *[FOLD_AT_START] * len(self.folds)]

    def row(self, z, tangent, length=1.0):
        """A point of which no more is known."""
        row = np.zeros(self.size)
        row[: self.m], row[self.m : 2 * self.m], row[self.length] = z, tangent, length
        return row

    def before(self, here):
        """A point before the first one, such that the cubic through both is the tangent."""
        m = self.m
        return self.row(here[:m] - here[self.length] * here[m : 2 * m], here[m : 2 * m])

    def predicted(self, before, here, step):
        """z at `step` beyond the second of two points, by Hermite's cubic through both."""
        m, t = self.m, step / here[self.length]
        old, old_tangent, z, tangent = before[:m], before[m : 2 * m], here[:m], here[m : 2 * m]
        slope = (z - old) / here[self.length]
        curve = tangent - slope
        bend = (tangent + old_tangent - 2 * slope) * (1 + t)
        return z + step * (tangent + t * (curve + bend))

    def interpolated(self, before, here, part):
        """z and unit tangent at a given part (0 to 1) of the way, from the cubic through both."""
        m, u, w = self.m, part, 1 - part
        rise = here[self.length] * u * w
        z = w * w * (1 + 2 * u) * before[:m] + rise * w * before[m : 2 * m]
        z = z + u * u * (1 + 2 * w) * here[:m] - rise * u * here[m : 2 * m]
        tangent = w * before[m : 2 * m] + u * here[m : 2 * m]
        return z, tangent / (tangent.T @ tangent) ** 0.5

    def deviation(self, row, before, here):
        """How much farther a point is from the curve between two others than `NEAR` allows, the
        cosine between its tangent and that of the curve, and the latter."""
        m = self.m
        chord, moved = here[:m] - before[:m], row[:m] - before[:m]
        square = chord.T @ chord
        guess, tangent = self.interpolated(before, here, (moved.T @ chord) / (square + TINY))
        away = row[:m] - guess
        away = away - (away.T @ tangent) * tangent
        beyond = (away.T @ away) ** 0.5 - NEAR * square**0.5 - NEAR**2
        return beyond, row[m : 2 * m].T @ tangent, tangent

    def corrected(self, z, tangent, p):
        """The point of the branch next to z in the plane normal to `tangent`."""
        here = self.row(z, tangent)
        return self.advance(self.before(here), here, np.zeros(6), p)[: self.size]

    def least_norm(self, z, p):
        """The least-norm Newton step to g = 0, and the unit vector along; nan if not finite."""
        g, jacobian = self.linearised(z, p)
        if not (np.isfinite(g).all() and np.isfinite(jacobian).all()):
            return np.full((2, self.m), np.nan)
        left, sizes, right = np.linalg.svd(jacobian)
        some = sizes > 1e-15 * sizes[0]
        return ((g @ left)[some] / sizes[some]) @ right[:-1][some], right[-1]

    def steps(self, rows, count, control, p):
        """Go on beyond `count` rows, till the last step holds an event, no step is good or the
        rows are full; how many there are then.

        `control` is the step, which changes, tolerance, residual, turn, largest and smallest step.
        Tests that vanish in a row get the sign that they had before.
        """
        while count < len(rows):
            good, here = False, rows[count - 1]
            before = rows[count - 2] if count > 1 else self.before(here)
            while not good:
                if not control[0] >= control[5]:
                    return count
                result = self.advance(before, here, control, p)
                good, control[0] = result[self.size :]
            rows[count] = result[: self.size]
            tests, signs = rows[count, self.tests :], here[self.tests :]
            np.copyto(tests, ROOT_AT_START * signs, where=tests == 0)
            count += 1
            if (signs * tests < 0).any() or not here[self.side] * result[self.side] > 0:
                break
        return count

    def locate_event(self, kind, before, here, part, ends, p):
        """The event of a kind next to a part of the way between two points, or None.

        None also where it is farther from one of two `ends` than they are from each other:
        another root.
        """
        z, tangent = self.interpolated(before, here, part)
        z = self.polish(kind, z, tangent, p)
        low, high = (end[: self.m] for end in ends)
        spread = np.linalg.norm(high - low) + 1e-12
        if z is None or any(np.linalg.norm(z - end) > spread for end in (low, high)):
            return None
        row = self.corrected(z, tangent, p)
        row[: self.m], row[2 * self.m : self.residual] = z, self.values(z, p)
        return row if self.on_curve(row, before, here) else None

    def on_curve(self, row, before, here):
        """Whether a point is next to the curve between two others: else it is on another branch.

        Where branches meet it gets the tangent of the curve, for its own is round-off.
        """
        beyond, cosine, tangent = self.deviation(row, before, here)
        if cosine < ALIGNED:
            row[self.m : 2 * self.m] = tangent
        return beyond <= 0


class CompiledStepper(ArclengthStepper):
    """The functions of a problem, in scaled unknowns asinh(unknown/scale).

    Parameters
    ----------
    problem : Problem
    facts : dict
        Names of its unknowns, roots, folds and values, their scales, and how many parameters.
    parts : tuple, or None
        What names the problem in `kept`.
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
        """Predict, correct, tangent, tests and control as one function of (two points, control,
        parameters)."""
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
        result = [z, new, values, residual, arc, side, *tests, *_step_control(figures, control)]
        return ca.Function("advance", [before, row, control, p], [ca.vertcat(*result)])

    def _loop_source(self):
        """C of the loop, with the numbers that it is made for."""
        sizes = {"M": self.m, "VALUES": len(self.tabulated), "KINDS": len(self.kinds)}
        sizes |= {"POLISH": POLISH, "ALIGNED": ALIGNED, "FULL_RANK": FULL_RANK, "TINY": TINY}
        sizes |= {"ROOT_AT_START": ROOT_AT_START}
        defined = [f"#define {name} {number!r}" for name, number in sizes.items()]
        text = files(__package__).joinpath("follow.c").read_text()
        return "\n".join([*defined, '#line 1 "follow.c"', text])

    def _build_newton(self, kind):
        """One Newton step on the system of an event, and where its compiled form is."""
        found = Functions(
            self._cache_key("newton", kind), lambda: {"newton": self._scaled().newton(kind)}
        )
        at = found.library and ctypes.cast(found.library[f"{PREFIX}newton"], ctypes.c_void_p).value
        return found, at

    def advance(self, before, here, control, p):
        """The row beyond `here`, whether it is good, and the step to try next."""
        return self.functions("advance", before, here, control, p)

    def corrected(self, z, tangent, p):
        if not self.library:
            return super().corrected(z, tangent, p)
        result = np.empty(self.size)
        self.library.corrected(*map(address, (p, z, tangent, result)))
        return result

    def steps(self, rows, count, control, p):
        if not self.library:
            return super().steps(rows, count, control, p)
        return self.library.steps(*map(address, (p, control, rows)), count, len(rows))

    def locate_event(self, kind, before, here, part, ends, p):
        newton = self.newton(kind)[1]
        if not (self.library and newton):
            return super().locate_event(kind, before, here, part, ends, p)
        result = np.empty(self.size)
        given = newton, *map(address, (p, before, here)), part, *map(address, (*ends, result))
        return result if self.library.locate_event(*given, kind in self.folds) else None

    def values(self, z, p):
        """Values to tabulate."""
        return self.functions("values", z, p)

    def least_norm(self, z, p):
        found = np.empty((2, self.m))
        full_rank = self.library and self.library.least_norm(*map(address, (p, z, found)))
        return found if full_rank else super().least_norm(z, p)

    def linearised(self, z, p):
        """Residual and Jacobian."""
        values = self.functions("linear", z, p)
        m = self.m
        return values[: m - 1], values[m - 1 :].reshape(m, m - 1).T

    def polish(self, kind, z, tangent, p):
        """The z of an event by Newton's method on the system that it extends, or None."""
        newton, normal = self.newton(kind)[0], [tangent] if kind in self.folds else []

        def step(x):
            *new, moved = newton("newton", x, *normal, p).tolist()
            return np.array(new), moved

        x = converged(step, np.concatenate([z, *normal]))
        return None if x is None else x[: self.m]


def converged(step, x):
    """Where steps x -> (next x, how far it is) come to rest to round-off, or None."""
    previous = math.inf
    for _ in range(POLISH):
        x, moved = step(x)
        if not math.isfinite(moved):
            return None
        if moved <= 1e-15 or (moved < 1e-11 and moved >= previous / 4):
            return x
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


def error_and_arc(missed, chord, cosine, step, length):
    """Error of the cubic through two points, and length of the branch between them."""
    # errors of cubics: 1/16 times this for interpolation by extrapolation, and a margin of 2
    error = missed * (step / (step + length)) ** 2 / 8
    return error, chord * (1 + (1 - cosine) / 12)  # chord to arc of a circle, order 4


def _step_control(figures, control):
    """Whether a step is good, and the next one to try, in CasADi."""
    import casadi as ca

    error, moved, last, cosine, residual, sides = figures
    step, tolerance, most, turn, largest, _ = ca.vertsplit(control)
    turned = ca.if_else(cosine > 0, ca.acos(ca.fmin(cosine, 1)), math.inf)
    wanted, by_turn = 0.9 * (tolerance / (error + TINY)) ** 0.25, 0.8 * turn / (turned + TINY)
    wanted = ca.if_else(by_turn < wanted, by_turn, wanted)
    good = ca.logic_or(sides > 0, step <= TWINS)
    for bounded in (
        residual <= most,
        last <= SETTLED,
        moved <= step / 2,
        turned <= turn,
        error <= tolerance,
    ):
        good = ca.logic_and(good, bounded)
    longer = ca.fmin(step * ca.fmin(ca.fmax(wanted, 0.3), 2), largest)
    shorter = ca.if_else(wanted < math.inf, ca.fmin(ca.fmax(wanted, 0.1), 0.5), 0.5)
    return good, ca.if_else(good, longer, step * shorter)


@once
def control_function():
    """`_step_control` of figures and control, compiled."""

    def build():
        import casadi as ca

        figures, control = ca.SX.sym("figures", 6), ca.SX.sym("control", 6)
        found = ca.vertcat(*_step_control(ca.vertsplit(figures), control))
        return {"control": ca.Function("control", [figures, control], [found])}

    return Functions(("control",), build)


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
