"""Disks in the complex plane that surely contain the value of a function: interval arithmetic.

`codegen.interpret` runs the instructions of a law on disks.  Each operation returns a disk that
contains the result for every point of its arguments, its own rounding included; where there is
none (a root of a disk that meets the negative axis, a division by one that holds zero) the radius
is infinite.  Where it is finite for disks that cover a region, the law is analytic there.
"""

from __future__ import annotations

import numpy as np

from tensegrity.codegen import functions, interpret

EPS = 8 * np.finfo(np.longdouble).eps  # over the error of one operation on complex numbers
TINY = 1e-290


class NotEnclosed(Exception):
    """The law holds an operation that disks do not know."""


class Disk:
    """Disks of given centres and radii, elementwise on arrays, in the widest precision there is."""

    def __init__(self, centre, radius=0.0):
        self.centre = np.asarray(centre, dtype=np.clongdouble)
        self.radius = (radius + EPS * np.abs(self.centre) + TINY) * (1 + EPS)

    @property
    def largest(self):
        """Bound of the absolute value; inf where there is none."""
        bound = np.abs(self.centre) + self.radius
        return np.where(np.isfinite(bound), bound * (1 + EPS), np.inf)

    @staticmethod
    def unary(operation, x):
        """Disks that contain the result of a CasADi operation of one argument."""
        name = _operations().get(operation)
        if name not in _UNARY:
            raise NotEnclosed(name or str(operation))
        return _UNARY[name](x)

    @staticmethod
    def binary(operation, x, y):
        """The same for two arguments."""
        name = _operations().get(operation)
        if name not in _BINARY:
            raise NotEnclosed(name or str(operation))
        return _BINARY[name](x, y)


def _operations():
    import casadi as ca

    names = ("NEG", "SQ", "TWICE", "SQRT", "INV", "EXP", "LOG")
    names += ("ADD", "SUB", "MUL", "DIV", "POW", "CONSTPOW")
    return {getattr(ca, f"OP_{name}"): name for name in names}


def _add(x, y):
    return Disk(x.centre + y.centre, x.radius + y.radius)


def _subtract(x, y):
    return Disk(x.centre - y.centre, x.radius + y.radius)


def _multiply(x, y):
    radius = np.abs(x.centre) * y.radius + np.abs(y.centre) * x.radius + x.radius * y.radius
    return Disk(x.centre * y.centre, radius)


def _inverse(x):
    size = np.abs(x.centre)
    room = size * (1 - EPS) - x.radius
    return Disk(1 / x.centre, np.where(room > 0, x.radius / (size * room), np.inf))


def _off_cut(x):
    """Whether a disk keeps off the negative real axis and zero."""
    near = np.where(x.centre.real > 0, np.abs(x.centre), np.abs(x.centre.imag))
    return x.radius < near * (1 - EPS)


def _root(x):
    # |sqrt z - sqrt c| = |z - c| / |sqrt z + sqrt c|, and the roots form an acute angle
    radius = x.radius / np.sqrt(np.abs(x.centre))
    return Disk(np.sqrt(x.centre), np.where(_off_cut(x), radius, np.inf))


def _exponential(x):
    value = np.exp(x.centre)
    return Disk(value, np.abs(value) * np.expm1(x.radius))


def _logarithm(x):
    radius = -np.log1p(-x.radius / np.abs(x.centre))
    return Disk(np.log(x.centre), np.where(_off_cut(x), radius, np.inf))


def _power(x, y):
    n = y.centre.real
    if n.ndim or n != np.round(n) or not 0 <= n <= 64:
        return _exponential(_multiply(y, _logarithm(x)))
    result = Disk(1.0)
    for _ in range(int(n)):
        result = _multiply(result, x)
    return result


_UNARY = {
    "NEG": lambda x: Disk(-x.centre, x.radius),
    "SQ": lambda x: _multiply(x, x),
    "TWICE": lambda x: Disk(2 * x.centre, 2 * x.radius),
    "SQRT": _root,
    "INV": _inverse,
    "EXP": _exponential,
    "LOG": _logarithm,
}
_BINARY = {
    "ADD": _add,
    "SUB": _subtract,
    "MUL": _multiply,
    "DIV": lambda x, y: _multiply(x, _inverse(y)),
    "POW": _power,
    "CONSTPOW": _power,
}


def tension(law, values, r):
    """Disks that contain the tension of a law with given parameters on the disks r.

    Raises
    ------
    NotEnclosed
        If the law holds a maximum, a case or another operation that is not analytic.
    """
    with np.errstate(all="ignore"):
        return interpret(functions(law)["tension"], [[r], [Disk(v) for v in values]], Disk)
