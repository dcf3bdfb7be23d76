"""Loads of a prism at given shortenings, and their misfit to a measured curve.

The inner unknowns of `tensegrity.prisms.equations` are eliminated by Newton's method and the
implicit function theorem; CasADi differentiates in the parameters.  Each evaluation starts from
the previous one, extrapolated along its derivatives, or from a traced branch if that fails.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.errors import LockingError, TensegrityError
from tensegrity.likelihood import FARTHEST, UNDEFINED
from tensegrity.once import once
from tensegrity.prisms.condensed import ElasticPotential
from tensegrity.prisms.equations import kind_of, numbers, problem

if TYPE_CHECKING:
    from typing import Any

    from tensegrity.prisms.prism import Prism
    from tensegrity.typing import Array

NAMES = ("prestrain", "k_cross", "k_base", "k_bar")
ENDS = ("contact", "unloaded", "flat")  # functions that are positive on the branch
ITERATIONS = 10
ROUND_OFF = 1e-11
SETTLED = 1e-14  # change at which Newton's method has converged
FEW = 5e-3  # scale of offsets over the height


def traced_loads(prism: Prism, x: Array) -> Array:
    """Loads [N] at shortenings x [m], (points,), on a branch traced from the reference."""
    return -_potential_within(prism, x).tension(-x)


def _potential_within(prism: Prism, x: Array) -> Any:
    potential = prism.potential()
    try:
        potential.tension(-x)
    except LockingError as error:
        raise TensegrityError(
            f"shortening {x.min():.6g} to {x.max():.6g} m (compression > 0) exceeds the range of "
            f"this prism: {error}"
        ) from None
    return potential


class Curve:
    """Loads at given shortenings as a function of logarithms of parameters and an offset.

    Parameters
    ----------
    prism : Prism
        With elastic bases or bars; parameters are relative to its values.
    shortening : ndarray, (points,)
        [m].
    """

    def __init__(self, prism: Prism, shortening: Array) -> None:
        self.prism, self.x = prism, shortening
        self._p = numbers(prism)
        self._step, self._last = _functions(*kind_of(prism))
        self._at, self._inner, self._rates = self._traced(np.zeros(len(NAMES) + 1))

    def prism_at(self, theta: Array) -> Prism:
        """The prism with parameters multiplied by exp(theta[:4]), in the order of `NAMES`."""
        changed = {
            name: getattr(self.prism, name) * math.exp(value)
            for name, value in zip(NAMES, theta[:-1].tolist(), strict=True)
            if value
        }
        return replace(self.prism, **changed)

    def __call__(self, theta: Array) -> tuple[Array, Array]:
        """Loads [N], (points,), and their derivatives in theta, (points, 5).

        `theta` contains the changes of the logarithms of the parameters `NAMES`, and the offset [m]
        that is added to the shortenings.
        """
        if np.abs(theta[:-1]).max() > FARTHEST:
            raise TensegrityError(f"parameters change by more than a factor e^{FARTHEST:g}")
        inner = self._inner + np.einsum("ijk,k->ij", self._rates, theta - self._at)
        solved = self._solved(theta, inner)
        if solved is None:
            self._at, self._inner, self._rates = self._traced(theta)
            solved = self._solved(theta, self._inner)
        if solved is None:
            raise TensegrityError("the curve of this prism was not found")
        self._at, (self._inner, load, slopes, self._rates) = theta.copy(), solved
        return load, slopes

    def _traced(self, theta: Array) -> tuple[Array, Array, Array]:
        potential = _potential_within(self.prism_at(theta), self.x + theta[-1])
        if not isinstance(potential, ElasticPotential):
            raise TensegrityError("k_base inf and k_bar inf: the prism must have elastic members")
        inner = potential.states(-(self.x + theta[-1]))[:, :-1]
        return theta.copy(), inner, np.zeros((*inner.shape, len(theta)))

    def _solved(self, theta: Array, inner: Array) -> Any:
        """Inner unknowns, loads and derivatives; None if Newton's method leaves the branch."""
        given = np.concatenate([theta, [self.prism.base, self.prism.k_cross], self._p])
        z, before = inner.T, math.inf
        for _ in range(ITERATIONS):
            new = np.array(self._step(z, self.x[None, :], given))
            moved = float(np.abs(new - z).max() / (1 + np.abs(new).max()))
            z = new
            if moved <= SETTLED or (moved <= ROUND_OFF and moved >= before / 4):
                break
            before = moved
        else:
            return None
        parts = (np.array(part) for part in self._last(z, self.x[None, :], given))
        new, load, slopes, rates, inside = parts
        if not (inside > 0).all():
            return None
        rates = rates.T.reshape(len(self.x), len(theta), len(z)).transpose(0, 2, 1)
        return new.T, load.ravel(), slopes.T, rates


@once
def _functions(rigid_base: bool, any_sides: bool) -> tuple[Any, Any]:
    """A Newton step, and the results at its end, as functions with one column per point."""
    import casadi as ca

    of = problem(rigid_base, any_sides)
    v, x, theta = ca.SX.sym("v", len(of.unknowns) - 1), ca.SX.sym("x"), ca.SX.sym("t", 5)
    base, k_cross, p = ca.SX.sym("l"), ca.SX.sym("k"), ca.SX.sym("p", of.p.numel())
    prestrain, cross, k_base, k_bar, offset = ca.vertsplit(theta)
    moved = ca.SX(p)
    for place, change in ((1, prestrain), (2, cross - k_base), (3, cross - k_bar)):
        moved[place] = p[place] * ca.exp(change)
    moved[4:6] = 1  # columns without units
    z = ca.vertcat(v, -(x + offset) / base)
    natural = of.columns["base"] - of.p[2] * of.events["unloaded"]  # of base strings, positive
    g, load, *inside = (
        ca.substitute(form, ca.vertcat(of.z, of.p), ca.vertcat(z, moved))
        for form in (of.equations, of.columns["load"], natural, *(of.events[x] for x in ENDS))
    )
    if rigid_base:
        inside[2] = -inside[2]  # tension of the bars, negative on the branch
    load = load * k_cross * ca.exp(cross) * base
    matrix = ca.jacobian(g, v)
    at_rest = ca.substitute(ca.det(matrix), ca.vertcat(v, x, theta), ca.DM.zeros(v.numel() + 6))
    rates = -ca.solve(matrix, ca.jacobian(g, theta))
    slopes = ca.jacobian(load, theta) + ca.jacobian(load, v) @ rates
    given = [v, x, ca.vertcat(theta, base, k_cross, p)]
    inside = ca.vertcat(*inside, ca.det(matrix) * at_rest)
    return (
        ca.Function("step", given, [v - ca.solve(matrix, g)]),
        ca.Function("last", given, [v, load, slopes.T, ca.vec(rates), inside]),
    )


class Misfit:
    """Computed minus measured loads over the largest one, and derivatives in the unknowns.

    The unknowns are those of `names`: changes of the logarithms of parameters from their values in
    the prism, and the offset in units of `FEW` heights; an offset is contained in x already.
    """

    model = "prisms with equilibria at all these points"

    def __init__(
        self, prism: Prism, x: Array, y: Array, names: tuple[str, ...], offset: float = 0.0
    ) -> None:
        self.curve, self.names, self.offset = Curve(prism, x), names, offset
        self.x, self.y, self.size = x, y, float(np.abs(y).max())
        self.places = [(*NAMES, "offset").index(name) for name in names]
        self.weights = [FEW * prism.height if name == "offset" else 1.0 for name in names]
        self._last: tuple[bytes, tuple[Array, Array]] = b"", (y, y)

    def theta(self, z: Array) -> Array:
        """The arguments theta of `Curve` for unknowns z."""
        theta = np.zeros(len(NAMES) + 1)
        theta[self.places] = z * self.weights
        return theta

    def __call__(self, z: Array) -> tuple[Array, Array]:
        """Misfits, (points,), all `UNDEFINED` where no such curve exists; (points, unknowns)."""
        key = z.tobytes()
        if key != self._last[0]:  # SciPy evaluates values and derivatives separately
            try:
                computed, slopes = self.curve(self.theta(z))
            except TensegrityError:
                result = np.full(len(self.y), UNDEFINED), np.zeros((len(self.y), len(z)))
            else:
                slopes = slopes[:, self.places] * self.weights / self.size
                result = (computed - self.y) / self.size, slopes
            self._last = key, result
        return self._last[1]

    def around(self, z: Array) -> Misfit:
        """The same misfit, with unknowns that count from z."""
        theta = self.theta(z)
        shift = float(theta[-1])
        return Misfit(
            self.curve.prism_at(theta), self.x + shift, self.y, self.names, self.offset + shift
        )

    def value(self, k: int, z: float) -> float:
        """A parameter, or the offset [m], where its unknown is z."""
        if self.names[k] == "offset":
            return self.offset + self.weights[k] * z
        return float(getattr(self.curve.prism, self.names[k])) * math.exp(z)
