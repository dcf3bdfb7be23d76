"""One step of arc-length continuation: predictor, corrector, tangent and event functions.

Unknowns are scaled, z = asinh(unknown/scale).  A point is a row of numbers: z, the unit tangent,
the tabulated values, then residual, length of the step to the point, side, and the event functions
("tests").  The side is the determinant of the Jacobian bordered by the previous tangent; it changes
sign at a simple bifurcation, and between a branch and another one close to it.
"""

from __future__ import annotations

import math
from operator import and_, or_
from types import SimpleNamespace

import numpy as np

from tensegrity.root import root

ITERATIONS = 3  # Newton iterations in a step
BISECTIONS = 60  # largest number of iterations that locate an event
SETTLED = 1e-7  # largest change in the last iteration of a step; convergence is quadratic
NEAR = 1e-3  # distance from a step's cubic, over the step, beyond which a branch is another
ALIGNED = 0.99  # cosine to the cubic's tangent below which a computed tangent is round-off
TWINS = 1e-6  # distance below which two branches are taken to intersect
ROOT_AT_START, FOLD_AT_START = 1e-14, 1e-8  # event functions count as zero at the first point
TINY = 1e-300  # keeps quotients of zeros finite


class ArclengthStepper:
    """Steps along a branch with m unknowns, events of several kinds and parameters p.

    Subclasses implement `advance` and `linearised`.  Methods without branches
    or loops take NumPy arrays and CasADi symbols alike.
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
        """A row with z, unit tangent and step length; its other entries are zero.

        Parameters
        ----------
        z, tangent : ndarray, (m,)
            Scaled unknowns, and unit tangent.
        length : float, optional
            Length of the step to the point.

        Returns
        -------
        ndarray, (size,)
        """
        row = np.zeros(self.size)
        row[: self.m], row[self.m : 2 * self.m], row[self.length] = z, tangent, length
        return row

    def data(self, rows):
        """Unknowns and tabulated values of rows (n, size), (n, m + values)."""
        table = rows[:, self.m : self.residual].copy()
        table[:, : self.m] = np.sinh(rows[:, : self.m]) * self.scale  # in the place of tangents
        return table

    def before(self, here):
        """A fictitious point before the first one, for which the cubic predictor is the tangent."""
        m = self.m
        return self.row(here[:m] - here[self.length] * here[m : 2 * m], here[m : 2 * m])

    def predicted(self, before, here, step):
        """Predictor: Hermite's cubic through two points, extrapolated beyond the second.

        Parameters
        ----------
        before, here : ndarray, (size,)
            Rows of the two points.
        step : float
            Distance beyond the second point, in scaled unknowns.

        Returns
        -------
        ndarray, (m,)
            Scaled unknowns z.
        """
        m, t = self.m, step / here[self.length]
        old, old_tangent, z, tangent = before[:m], before[m : 2 * m], here[:m], here[m : 2 * m]
        slope = (z - old) / here[self.length]
        curve = tangent - slope
        bend = (tangent + old_tangent - 2 * slope) * (1 + t)
        return z + step * (tangent + t * (curve + bend))

    def interpolated(self, before, here, part):
        """Scaled unknowns and unit tangent on Hermite's cubic between two points.

        Parameters
        ----------
        before, here : ndarray, (size,)
            Rows of the two points.
        part : float
            Fraction of the way, from 0 to 1.

        Returns
        -------
        tuple of ndarray, (m,) and (m,)
        """
        m, u, w = self.m, part, 1 - part
        rise = here[self.length] * u * w
        z = w * w * (1 + 2 * u) * before[:m] + rise * w * before[m : 2 * m]
        z = z + u * u * (1 + 2 * w) * here[:m] - rise * u * here[m : 2 * m]
        tangent = w * before[m : 2 * m] + u * here[m : 2 * m]
        return z, tangent / (tangent.T @ tangent) ** 0.5

    def deviation(self, row, before, here):
        """Deviation of a point from the cubic between two others.

        Parameters
        ----------
        row, before, here : ndarray, (size,)
            Rows of the point, and of the other two.

        Returns
        -------
        tuple of float, float and ndarray, (m,)
            Distance from the curve minus the admissible one (by `NEAR`), cosine between the
            tangents of point and curve, and the tangent of the curve.
        """
        m = self.m
        chord, moved = here[:m] - before[:m], row[:m] - before[:m]
        square = chord.T @ chord
        guess, tangent = self.interpolated(before, here, (moved.T @ chord) / (square + TINY))
        away = row[:m] - guess
        away = away - (away.T @ tangent) * tangent
        beyond = (away.T @ away) ** 0.5 - NEAR * square**0.5 - NEAR**2
        return beyond, row[m : 2 * m].T @ tangent, tangent

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
        here = self.row(z, tangent)
        return self.advance(self.before(here), here, np.zeros(6), p)[: self.size]

    def least_norm(self, z, p):
        """Least-norm Newton step to g = 0 and unit null vector of the Jacobian, (2, m); nan if
        they are not finite."""
        g, jacobian = self.linearised(z, p)
        if not (np.isfinite(g).all() and np.isfinite(jacobian).all()):
            return np.full((2, self.m), np.nan)
        left, sizes, right = np.linalg.svd(jacobian)
        some = sizes > 1e-15 * sizes[0]
        return ((g @ left)[some] / sizes[some]) @ right[:-1][some], right[-1]

    def steps(self, rows, count, control, p, levels=None):
        """Take one step, or none if none is accepted; a compiled stepper steps on until a step
        contains an event or the rows are full.

        Event functions that vanish in a row get the sign that they had in the row before.

        Parameters
        ----------
        rows : ndarray, (any, size)
            Points, of which the first `count` are given; filled in place.
        count : int
        control : ndarray, (6,)
            Step (updated in place), tolerance, largest residual, largest angle between tangents
            [rad], largest and smallest step.
        p : ndarray, (k,)
            Parameters.

        Returns
        -------
        int
            Number of rows filled.
        """
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
        return count + 1

    def locate(self, before, here, column, value, ends, p):
        """The point between two others where a column has a value.

        Parameters
        ----------
        before, here : ndarray, (size,)
            Rows of the two points.
        column : int or callable
            Place in a row, or a function of unknowns and tabulated values, (1, m + values).
        value : float
        ends : tuple of two float
            By how much it exceeds the value at both points, with different signs.
        p : ndarray, (k,)
            Parameters.

        Returns
        -------
        ndarray, (size,)
            Row of the point.
        """

        def point(part):
            return self.corrected(*self.interpolated(before, here, part), p)

        def away(part):
            if part in (0.0, 1.0):
                return ends[int(part)]
            return float(self.column(point(part)[None], column)[0]) - value

        row = point(root(away, 0.0, 1.0, part=ends[0] / (ends[0] - ends[1])))
        self.on_curve(row, before, here)
        return row

    def column(self, rows, column):
        """A column of rows (n, size), by its place in a row or a function of `data`, (n,)."""
        return column(self.data(rows)) if callable(column) else rows[:, column]

    def on_curve(self, row, before, here):
        """Replace the tangent of a point where branches intersect, and it is round-off, by that of
        the curve between two others.

        Parameters
        ----------
        row : ndarray, (size,)
            Row of the point, whose tangent may be changed in place.
        before, here : ndarray, (size,)
            Rows of the other two.
        """
        _, cosine, tangent = self.deviation(row, before, here)
        if cosine < ALIGNED:
            row[self.m : 2 * self.m] = tangent


def error_and_arc(missed, chord, cosine, step, length):
    """Error estimate of cubic interpolation, and arc length of a step.

    Parameters
    ----------
    missed : float
        Largest difference between predicted and corrected unknowns.
    chord : float
        Distance between the two points.
    cosine : float
        Cosine between their tangents.
    step, length : float
        This step, and the one before.

    Returns
    -------
    tuple of float and float
    """
    # interpolation has 1/16 of the error of this extrapolation; the safety factor is 2
    error = missed * (step / (step + length)) ** 2 / 8
    return error, chord * (1 + (1 - cosine) / 12)  # chord to arc of a circle, order 4


def step_control(of, figures, control):
    """Whether a step is accepted (1 or 0), and the next step.

    Parameters
    ----------
    of : module
        CasADi for expressions, `NUMBERS` for numbers.
    figures : sequence, (6,)
        Error, distance from the predictor, last correction, cosine of the turn, residual, and the
        product of the sides.
    control : sequence, (6,)
        As for `ArclengthStepper.steps`.

    Returns
    -------
    tuple of two
    """
    error, moved, last, cosine, residual, sides = figures
    step, tolerance, most, turn, largest, _ = control
    turned = of.if_else(cosine > 0, of.acos(of.fmin(of.fmax(cosine, -1), 1)), math.inf)
    wanted, by_turn = 0.9 * (tolerance / (error + TINY)) ** 0.25, 0.8 * turn / (turned + TINY)
    wanted = of.if_else(by_turn < wanted, by_turn, wanted)
    good = of.logic_or(sides > 0, step <= TWINS)
    for bounded in (
        residual <= most,
        last <= SETTLED,
        moved <= step / 2,
        turned <= turn,
        error <= tolerance,
    ):
        good = of.logic_and(good, bounded)
    longer = of.fmin(step * of.fmin(of.fmax(wanted, 0.3), 2), largest)
    shorter = of.if_else(wanted < math.inf, of.fmin(of.fmax(wanted, 0.1), 0.5), 0.5)
    return good, of.if_else(good, longer, step * shorter)


NUMBERS = SimpleNamespace(
    acos=math.acos, fmin=min, fmax=max, logic_and=and_, logic_or=or_,
    if_else=lambda condition, one, other: one if condition else other,
)  # fmt: skip
