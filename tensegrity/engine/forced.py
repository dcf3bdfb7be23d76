"""Steps of an explicit Runge-Kutta method with forces of time, displacement and velocity.

A stage evaluates all forces at its instant, displacements and velocities; a prescribed motion
replaces those of its site.  The work of the forces is the integral of their power, summed with the
weights of the method.  See `forced.c`.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tensegrity.engine.law import is_piecewise, to_casadi
from tensegrity.engine.native import structure
from tensegrity.once import once

if TYPE_CHECKING:
    import sympy as sp

    from tensegrity.engine.methods import Nystrom
    from tensegrity.typing import Array, Indices

FORCING = structure("forced.c", "forcing")
SITE, BOND = "SITE", "BOND"  # as in forced.c


@dataclass(frozen=True)
class ForceLaw:
    """The expression of a force, on a site or along a bond.

    Attributes
    ----------
    expression : sympy.Expr
        [N]; on a site > 0 towards higher sites, on a bond a tension.
    time : sympy.Symbol
    state : tuple of sympy.Symbol
        Displacement and velocity of the site, or elongation of the bond and its rate.
    parameters : tuple of sympy.Symbol
    on : {"SITE", "BOND"}
    """

    expression: sp.Expr
    time: sp.Symbol
    state: tuple[sp.Symbol, sp.Symbol]
    parameters: tuple[sp.Symbol, ...]
    on: str

    @property
    def dissipates(self) -> bool:
        """Whether the force depends on velocity: its negative work then counts as a loss."""
        return self.state[1] in self.expression.free_symbols

    @property
    def jumps(self) -> bool:
        """Whether the expression is defined piecewise, so that the force may jump."""
        return is_piecewise(self.expression)

    @property
    def name(self) -> str:
        """Identifies the force in other processes."""
        return _digest(self)

    @property
    def macro(self) -> tuple[Any, ...]:
        """What the list FORCES of `forced.c` has of a force besides its number."""
        return len(self.parameters), self.on, int(self.dissipates)

    def function(self) -> Any:
        """CasADi function (t, state, parameters) -> force."""
        import casadi as ca

        t, x = ca.SX.sym("t"), ca.SX.sym("x", 2)
        p = ca.SX.sym("p", len(self.parameters))
        values = (t, *ca.vertsplit(x), *(ca.vertsplit(p) if self.parameters else ()))
        made = to_casadi(self.expression, (self.time, *self.state, *self.parameters))
        return ca.Function("force", [t, x, p], [ca.densify(ca.SX(made(*values)))])

    def rate(self) -> Any:
        """CasADi function (t, state, parameters) -> derivative of the force by the velocity."""
        import casadi as ca

        function = self.function()
        t, x, p = function.sx_in()
        return ca.Function("rate", [t, x, p], [ca.jacobian(function(t, x, p), x)[1]])


@once
def _rate(law: ForceLaw) -> Any:
    return law.rate()


@once
def _digest(law: ForceLaw) -> str:
    from sympy import srepr

    parts = (law.expression, law.time, *law.state, *law.parameters)
    return hashlib.sha256("|".join([law.on, *map(srepr, parts)]).encode()).hexdigest()


@dataclass(frozen=True, eq=False)
class AppliedForce:
    """A force on some sites or bonds.

    Attributes
    ----------
    law : ForceLaw
    places : ndarray of int, (places,)
        Numbers of the sites or bonds.
    values : ndarray, (parameters, places)
        Values of its parameters.
    """

    law: ForceLaw
    places: Indices
    values: Array


def largest_decay(
    applied: tuple[AppliedForce, ...], t: float, u: Array, v: Array, w: Array
) -> float:
    """Bound on the rates at which velocities of a chain decay or grow by forces [1/s].

    Parameters
    ----------
    applied : tuple of AppliedForce
    t : float
        [s]
    u, v : ndarray, (sites,)
        [m], [m/s]
    w : ndarray, (sites,)
        Inverse masses [1/kg].

    Returns
    -------
    float
    """
    total = np.zeros(len(u))
    for one in applied:
        if not one.law.dissipates:
            continue
        at, bonds = one.places, one.law.on == BOND
        x = np.stack([u[at + 1] - u[at], v[at + 1] - v[at]] if bonds else [u[at], v[at]])
        rate = np.abs(np.array(_rate(one.law)(t, x, one.values))[0])
        if bonds:
            for ends in (at, at + 1):
                np.add.at(total, ends, 2 * rate)
        else:
            np.add.at(total, at, rate)
    return float(np.max(total * w, initial=0.0))


class Stages:
    """Time-dependent numbers for all stages of some steps.

    Parameters
    ----------
    forcing : Forcing
    method : Nystrom
    dt : float
        [s]
    """

    def __init__(self, forcing: Any, method: Nystrom, dt: float) -> None:
        self._forcing, self._dt = forcing, dt
        self._nodes = dt * np.array(method.nodes)

    def _starts(self, first: int, steps: int, origin: float) -> Array:
        return origin + self._dt * np.arange(first, first + steps + 1, dtype=float)

    def times(self, first: int, steps: int, origin: float = 0.0) -> Array:
        """Instants of all stages and of the end.

        Parameters
        ----------
        first, steps : int
            Number of the first step, and how many.
        origin : float, optional
            Time of step 0 [s].

        Returns
        -------
        ndarray, (steps stages + 1,)
            [s]
        """
        starts = self._starts(first, steps, origin)
        return np.append((starts[:-1, None] + self._nodes).ravel(), starts[-1])

    def width(self) -> int:
        """Count of time-dependent numbers for a step."""
        forcing = self._forcing
        return len(self._nodes) * (1 + 2 * len(forcing.moved) + 2 * len(forcing.forced))

    def rows(self, first: int, steps: int, origin: float = 0.0) -> dict[str, Array]:
        """The arrays of `forced.c` that depend on time.

        Parameters
        ----------
        first, steps : int
            Number of the first step, and how many.
        origin : float, optional
            Time of step 0 [s].

        Returns
        -------
        dict of ndarray
        """
        forcing, at = self._forcing, self.times(first, steps, origin)[:-1]
        found = {"instants": at}
        if forcing.moved.size:
            found["prescribed_u"], found["prescribed_v"] = (forcing.motion(at, k) for k in (0, 1))
            found["after"] = forcing.motion(self._starts(first, steps, origin)[1:], 0)
        if forcing.forced.size:
            found["pull"], found["pull_rate"] = (forcing.force(at, k) for k in (0, 1))
        return {name: np.ascontiguousarray(rows, dtype=float) for name, rows in found.items()}


def fields(forcing: Any, sums: Array) -> Any:
    """The structure `forcing` of `forced.c`, without what depends on time.

    Parameters
    ----------
    forcing : Forcing
    sums : ndarray, (2,) or more
        Receives work and loss [J].

    Returns
    -------
    Structure
    """
    applied = forcing.applied
    places = [one.places for one in applied]
    values = [one.values for one in applied]
    counts = [len(one) for one in places]
    arrays = {
        "parameters": np.concatenate([np.zeros(0), *(x.ravel() for x in values)]),
        "place": np.concatenate([np.zeros(0, dtype=int), *places]).astype(np.int64),
        "first": np.cumsum([0, *counts]),
        "begin": np.cumsum([0, *(x.size for x in values)]),
        "prescribed_mass": forcing.prescribed_mass,
        "moved": forcing.moved.astype(np.int64),
        "pulled": forcing.forced.astype(np.int64),
        "given": np.zeros(max(counts, default=0)),
    }
    numbers = {"moving": len(forcing.moved), "pulling": len(forcing.forced), "stage": 0, "step": 0}
    arrays = {name: np.ascontiguousarray(x) for name, x in arrays.items()}
    return FORCING(**dict.fromkeys(FORCING.kinds) | arrays | numbers | {"sums": sums})
