"""Branches of problems with many unknowns: the same continuation on arrays.

Where a `Problem` is a few CasADi expressions, its step compiled whole, a `ManyProblem` gives
residual and Jacobian as arrays and is solved by LAPACK: for tens to hundreds of unknowns.  `trace`
takes both, with the same steps, the same acceptance and the same events.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np

from tensegrity.branches.arclength import (
    FOLD_AT_START,
    ITERATIONS,
    POLISH,
    ROOT_AT_START,
    TINY,
    Point,
)

if TYPE_CHECKING:
    from typing import Any

    from tensegrity.typing import Array, Indices


CONSTANT = 1e-13  # part of a unit tangent below which an unknown does not change: no fold
SECANT, REACH = 1e-4, 0.2  # first and largest step of a secant, in scaled unknowns


class Equations(Protocol):
    """What a branch solves, in unknowns u (m,), the last being that by which a start is held."""

    names: tuple[str, ...]
    scale: Array
    roots: tuple[str, ...]
    folds: dict[str, int]  # name and number of the unknown that is stationary there
    leaving: Indices  # numbers of the roots that are known to vanish at the start

    def linearised(self, u: Array) -> tuple[Array, Array]:
        """Residual (m - 1,) over its size, and its Jacobian (m - 1, m)."""

    def tests(self, u: Array) -> Array:
        """Functions of which each vanishes at an event, (roots,)."""

    def test_gradient(self, u: Array, number: int) -> Array:
        """Gradient of one of them, (m,)."""


@dataclass(frozen=True, eq=False)
class ManyProblem:
    """A problem for `trace`; see `Equations`."""

    equations: Any

    @property
    def unknowns(self) -> tuple[str, ...]:
        """Names."""
        return tuple(self.equations.names)

    @property
    def scale(self) -> Array:
        """Sizes of the unknowns."""
        return np.asarray(self.equations.scale)

    @property
    def values(self) -> tuple[str, ...]:
        """No more columns than the unknowns."""
        return ()

    @property
    def p(self) -> _None:
        """No parameters."""
        return _None()

    @cached_property
    def machine(self) -> ManyMachine:
        """What steps along a branch."""
        return ManyMachine(self.equations)

    @property
    def _machine(self) -> ManyMachine:
        return self.machine


class _None:
    def numel(self) -> int:
        return 0


class ManyMachine:
    """The steps of `arclength.Machine`, on arrays; in unknowns asinh(u/scale)."""

    def __init__(self, equations: Any) -> None:
        self.of = equations
        self.m = len(equations.names)
        self.scale = np.asarray(equations.scale, dtype=float)
        self.roots, self.folds = tuple(equations.roots), tuple(equations.folds)
        self.kinds = (*self.roots, *self.folds)
        self.vanishing = np.repeat(
            [ROOT_AT_START, FOLD_AT_START], [len(self.roots), len(self.folds)]
        )
        self.vanishing[equations.leaving] = np.inf
        self.names, self.numbers = tuple(equations.names), 0
        self.tabulated: tuple[str, ...] = ()
        self.judged, self.library = 2 * self.m, None  # LAPACK is: no loop of its own
        self.size = self.judged + 3 + len(self.kinds)
        self._stationary = list(equations.folds.values())

    def unknowns(self, z: Array) -> Array:
        """u of scaled unknowns."""
        return np.asarray(np.sinh(z) * self.scale)

    def linearised(self, z: Array, p: Any) -> tuple[Array, Array]:
        """Residual and Jacobian in scaled unknowns."""
        g, jacobian = self.of.linearised(self.unknowns(z))
        return g, jacobian * (np.cosh(z) * self.scale)

    def advance(self, before: Point, here: Point, step: float, p: Any) -> Any:
        """The point `step` beyond `here`, and the figures by which it is judged."""
        length, old, z0, tangent = here.length, before.z, here.z, here.tangent
        t, slope = step / length, (z0 - old) / length
        curve = tangent - slope
        bend = (tangent + before.tangent - 2 * slope) * (1 + t)
        guess = z0 + step * (tangent + t * (curve + bend))
        return self._corrected(guess, tangent, z0, step, length)

    def at(self, z: Array, tangent: Array, p: Any) -> Point:
        """The point of the branch next to z in the plane normal to `tangent`."""
        return self._corrected(z, tangent, z, 0.0, 1.0)[0]

    @np.errstate(all="ignore")  # iterations that run off are told by what is not finite
    def _corrected(
        self, guess: Array, tangent: Array, start: Array, step: float, length: float
    ) -> Any:
        from scipy.linalg import lapack

        z, last, m = guess, math.inf, self.m
        matrix, right = np.empty((m, m), order="F"), np.empty(m)
        matrix[m - 1] = tangent
        for _ in range(ITERATIONS):
            g, matrix[: m - 1] = self.linearised(z, None)
            right[: m - 1], right[m - 1] = g, tangent @ (z - guess)
            move, info = lapack.dgesv(matrix, right)[2:]
            if info or not np.isfinite(move).all():
                return self._nowhere(z), (math.inf,) * 2 + (math.nan, -1.0)
            z, last = z - move, float(np.abs(move).max())
        g, matrix[: m - 1] = self.linearised(z, None)
        factors, pivots, info = lapack.dgetrf(matrix)
        end = np.zeros(m)
        end[-1] = 1.0
        new = lapack.dgetrs(factors, pivots, end)[0]
        size = np.linalg.norm(new)
        if info or not np.isfinite(size):
            return self._nowhere(z), (math.inf,) * 2 + (math.nan, -1.0)
        new = new / size
        swaps = np.count_nonzero(pivots != np.arange(m))
        side = float(np.prod(np.sign(np.diag(factors)))) * (-1) ** swaps
        missed = z - guess
        cosine = float(new @ tangent)
        share = (step / (step + length)) ** 2 / 8
        error = float(np.abs(missed).max()) * share
        arc = float(np.linalg.norm(z - start)) * (1 + (1 - cosine) / 12)
        parts = new[self._stationary]
        parts[np.abs(parts) <= CONSTANT] = 0.0
        tests = [*self.of.tests(self.unknowns(z)).tolist(), *parts.tolist()]
        data = np.concatenate([z, new])
        point = Point(m, data, float(np.abs(g).max()), arc, side, tests)
        return point, (error, float(np.linalg.norm(missed)), last, cosine)

    def _nowhere(self, z: Array) -> Point:
        data = np.concatenate([z, np.zeros(self.m)])
        return Point(self.m, data, math.inf, 0.0, 0.0, [0.0] * len(self.kinds))

    def exactly_at(self, z: Array, tangent: Array, p: Any) -> Point:
        """The point of the branch at a z that is known to round-off already."""
        point = self.at(z, tangent, p)
        point.data[: self.m] = z
        return point

    @np.errstate(all="ignore")
    def polish(self, kind: str, z: Array, tangent: Array, p: Any) -> Array | None:
        """Newton's method on the equations with the test of an event; None where it fails.

        Folds have no gradient: the secant method along the branch.
        """
        if kind not in self.roots:
            return self._stationary_at(self._stationary[self.folds.index(kind)], z, tangent)
        number, previous = self.roots.index(kind), math.inf
        for _ in range(POLISH):
            u = self.unknowns(z)
            rates = np.cosh(z) * self.scale
            g, jacobian = self.of.linearised(u)
            row = self.of.test_gradient(u, number) * rates
            system = np.vstack([jacobian * rates, row])
            right = np.append(g, self.of.tests(u)[number])
            try:
                move = np.linalg.solve(system, right)
            except np.linalg.LinAlgError:
                return None
            z = z - move
            moved = float(np.linalg.norm(move / (1 + np.abs(z))))
            if not math.isfinite(moved):
                return None
            if moved <= 1e-15 or (moved < 1e-11 and moved >= previous / 4):
                return z
            previous = moved + TINY
        return None

    def _stationary_at(self, number: int, z: Array, tangent: Array) -> Array | None:
        """Where the tangent has no part in an unknown, by the secant method; None if it fails."""
        point, step, previous = self.at(z, tangent, None), SECANT, REACH
        for _ in range(POLISH):
            part = point.tangent[number]
            point = self.at(point.z + step * point.tangent, point.tangent, None)
            change = point.tangent[number] - part
            if change == 0 or not math.isfinite(change) or not point.tangent.any():
                return None
            step *= -point.tangent[number] / change
            moved = abs(step)
            if moved <= 1e-15 or (moved < 1e-11 and moved >= previous / 4):
                return np.asarray(point.z + step * point.tangent)
            if moved >= previous / 2:
                return None
            previous = moved
        return None
