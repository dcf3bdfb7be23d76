"""Loads of a prism at given shortenings, with exact derivatives in its parameters.

The equations of `tensegrity.prisms.equations`, their inner unknowns eliminated by Newton's method
and the implicit function theorem; derivatives by CasADi.  Each evaluation starts from the one
before, moved along its derivatives, and from a traced branch where that leads nowhere.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tensegrity.errors import LockingError, TensegrityError
from tensegrity.once import once
from tensegrity.prisms.condensed import ElasticPotential
from tensegrity.prisms.equations import kind_of, numbers, problem

if TYPE_CHECKING:
    from typing import Any

    from tensegrity.prisms.prism import Prism
    from tensegrity.typing import Array

NAMES = ("prestrain", "k_cross", "k_base", "k_bar")
ENDS = ("contact", "unloaded", "flat")  # what is positive on the branch of the reference
FARTHEST = 60.0  # change of a logarithm: by half of it all is as if it were 0 or infinite
ITERATIONS = 10
ROUND_OFF = 1e-11
SETTLED = 1e-14  # the last move of Newton's method, or a small one that is round-off


def loads(prism: Prism, x: Array) -> Array:
    """Loads [N] at shortenings [m], by a branch traced from the reference."""
    return -_asked(prism, x).tension(-x)


def _asked(prism: Prism, x: Array) -> Any:
    potential = prism.potential()
    try:
        potential.tension(-x)
    except LockingError as error:
        raise TensegrityError(
            f"shortening {x.min():.6g} to {x.max():.6g} m goes beyond this prism: {error}"
        ) from None
    return potential


class Curve:
    """Loads at some shortenings as a function of logarithms of parameters, and of an offset.

    Parameters
    ----------
    prism : Prism
        With elastic bases or bars; parameters count from its own.
    shortening : ndarray, (points,)
        [m].
    """

    def __init__(self, prism: Prism, shortening: Array) -> None:
        self.prism, self.x = prism, shortening
        self._p = numbers(prism)
        self._step, self._last = _functions(*kind_of(prism))
        self._at, self._inner, self._rates = self._traced(np.zeros(len(NAMES) + 1))

    def made(self, theta: Array) -> Prism:
        """The prism of some logarithms of parameters over the first ones, (5,) as `NAMES`."""
        changed = {
            name: getattr(self.prism, name) * math.exp(value)
            for name, value in zip(NAMES, theta[:-1].tolist(), strict=True)
            if value
        }
        return replace(self.prism, **changed)

    def __call__(self, theta: Array) -> tuple[Array, Array]:
        """Loads [N], (points,), and their derivatives, (points, 5).

        `theta` has changes of the logarithms of the parameters `NAMES` and the offset [m] that is
        added to the shortenings.
        """
        if np.abs(theta[:-1]).max() > FARTHEST:
            raise TensegrityError(f"parameters change by more than a factor e^{FARTHEST:g}")
        inner = self._inner + np.einsum("ijk,k->ij", self._rates, theta - self._at)
        found = self._solved(theta, inner)
        if found is None:
            self._at, self._inner, self._rates = self._traced(theta)
            found = self._solved(theta, self._inner)
        if found is None:
            raise TensegrityError("the curve of this prism was not found")
        self._at, (self._inner, load, slopes, self._rates) = theta.copy(), found
        return load, slopes

    def _traced(self, theta: Array) -> tuple[Array, Array, Array]:
        potential = _asked(self.made(theta), self.x + theta[-1])
        if not isinstance(potential, ElasticPotential):
            raise TensegrityError("k_base inf and k_bar inf: the prism must have elastic members")
        inner = potential.states(-(self.x + theta[-1]))[:, :-1]
        return theta.copy(), inner, np.zeros((*inner.shape, len(theta)))

    def _solved(self, theta: Array, inner: Array) -> Any:
        """Inner unknowns, loads and derivatives; None where Newton's method leaves the branch."""
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
    """One step of Newton's method, and what is read at its end; one column a point."""
    import casadi as ca

    of = problem(rigid_base, any_sides)
    v, x, theta = ca.SX.sym("v", len(of.unknowns) - 1), ca.SX.sym("x"), ca.SX.sym("t", 5)
    base, k_cross, p = ca.SX.sym("l"), ca.SX.sym("k"), ca.SX.sym("p", of.p.numel())
    prestrain, cross, k_base, k_bar, offset = ca.vertsplit(theta)
    moved = ca.SX(p)
    for place, change in ((1, prestrain), (2, cross - k_base), (3, cross - k_bar)):
        moved[place] = p[place] * ca.exp(change)
    z = ca.vertcat(v, -(x + offset) / base)
    natural = of.values["base"] - of.p[2] * of.roots["unloaded"]  # of base strings; none below 0
    g, load, *inside = (
        ca.substitute(form, ca.vertcat(of.z, of.p), ca.vertcat(z, moved))
        for form in (of.residual, of.values["load"], natural, *(of.roots[name] for name in ENDS))
    )
    if rigid_base:
        inside[2] = -inside[2]  # there it is the bars' tension
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
