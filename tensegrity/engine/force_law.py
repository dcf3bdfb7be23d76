"""The laws of forces of time, displacement and velocity, on sites and along bonds, as functions.

Also bounds on the rates at which they change velocities, which limit the step.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tensegrity.engine.bonds import KINDS
from tensegrity.engine.compiled import evaluated
from tensegrity.engine.geometry import functions
from tensegrity.engine.law import LEAST, error_of, is_piecewise, to_casadi
from tensegrity.engine.law import functions as law_functions
from tensegrity.once import once

if TYPE_CHECKING:
    import sympy as sp

    from tensegrity.engine.bonds import Bonds
    from tensegrity.typing import Array, Indices

SITE, BOND = "SITE", "BOND"  # as in forced.c
WORKS, LOSES, STORES = range(3)  # what becomes of the work of a force; as in forced.c


@dataclass(frozen=True)
class Onset:
    """The force of a contact that closes: strength (its rate times the time since)^power.

    Attributes
    ----------
    place : sympy.Expr
        The elongation where it closes.
    strength : sympy.Expr
        Of `rate` and the parameters, for the tension.
    rate : sympy.Symbol
        Of the overlap.
    power : float
        At least 0, below 1.
    rest : sympy.Expr
        The force of a closed contact.
    """

    place: sp.Expr
    strength: sp.Expr
    rate: sp.Symbol
    power: float
    rest: sp.Expr

    def function(self, parameters: tuple[sp.Symbol, ...]) -> Any:
        """CasADi function (rate, parameters) -> strength."""
        import casadi as ca

        q, p = ca.SX.sym("q"), ca.SX.sym("p", len(parameters))
        made = to_casadi(self.strength, (self.rate, *parameters))(q, *ca.vertsplit(p))
        return ca.Function("onset", [q, p], [ca.densify(ca.SX(made))])


@dataclass(frozen=True)
class ForceLaw:
    """The expressions of a force, on a site or along a bond.

    Attributes
    ----------
    expressions : tuple of sympy.Expr
        [N]; on a site its components, in a bond a tension, and what acts along the slip.  With a
        law, its energy [J].
    time : sympy.Symbol
    state : tuple of sympy.Symbol
        Displacements and velocities of the site, and its speed; or elongation of the bond, its
        rate, and its slip.
    parameters : tuple of sympy.Symbol
    on : {"SITE", "BOND"}
    law : Law, optional
        Of a spring between a site and the ground, whose energy is energy of the scene.
    numbers : tuple of float
        Values of the last parameters, which stand for numbers of the expressions.
    written : tuple of sympy.Expr
        The expressions with these numbers, if there are any.
    """

    expressions: tuple[sp.Expr, ...]
    time: sp.Symbol
    state: tuple[sp.Symbol, ...]
    parameters: tuple[sp.Symbol, ...]
    on: str
    law: Any = None
    numbers: tuple[float, ...] = ()
    written: tuple[sp.Expr, ...] = ()

    def lifted(self) -> ForceLaw:
        """The same force with parameters for the numbers of its expressions; see
        `shape`.  How it begins in a contact that closes is compiled with its numbers."""
        from tensegrity.engine.shape import lifted

        shapes, constants, numbers = lifted(self.expressions)
        if not constants or self.onset is not None:
            return self
        values, parameters = tuple(map(float, numbers)), (*self.parameters, *constants)
        return replace(
            self, expressions=tuple(shapes), parameters=parameters, numbers=values,
            written=self.expressions,
        )  # fmt: skip

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters that are not numbers of the expressions."""
        return tuple(map(str, self.parameters[: len(self.parameters) - len(self.numbers)]))

    @property
    def rates(self) -> tuple[sp.Symbol, ...]:
        """Those symbols of the state that are velocities."""
        return self.state[len(self.state) // 2 :]

    @property
    def _used(self) -> set[Any]:
        return set().union(*(one.free_symbols for one in self.expressions))

    @property
    def dissipates(self) -> bool:
        """Whether the force depends on velocity: its negative work then counts as a loss."""
        return bool(self._used & {*self.rates})

    @property
    def varies(self) -> bool:
        """Whether the force depends on time."""
        return self.time in self._used

    @property
    def of_time(self) -> bool:
        """Whether the force acts on sites and depends on nothing else than time."""
        return self.on == SITE and self.law is None and not self._used & {*self.state}

    @property
    def continuity(self) -> float:
        """See `continuity`; of what the steps do not correct at the onset of contacts."""
        import sympy as sp

        left = (self.onset.rest,) if self.onset else self.written or self.expressions
        length, smooth = (
            self.state[-1],
            True,
        )  # a length has a kink at 0, even powers of it have none
        for number, one in enumerate(left):  # what acts along the slip turns with it
            odd = self.on == BOND and number == 1
            mirrored = one.subs(length, -length)
            smooth &= sp.expand(one + mirrored if odd else one - mirrored) == 0
        return min(1.0 if self.onset or not smooth else math.inf, *map(continuity, left))

    @property
    def onset(self) -> Onset | None:
        """How the force begins where a contact closes, if it is not smooth there."""
        return _onset(self)

    @property
    def name(self) -> str:
        """Identifies the force in other processes."""
        return _digest(self)

    @property
    def macro(self) -> tuple[Any, ...]:
        """What the list FORCES of `forced.c` has of a force besides its number."""
        kind = LOSES if self.dissipates else WORKS if self.law is None else STORES
        begins = int(self.onset is not None)
        return len(self.parameters), len(self.expressions), self.on, kind, begins

    def function(self) -> Any:
        """CasADi function (t, state, parameters) -> components of the force."""
        return _function(self)

    def between(self, dim: int, kind: str) -> dict[str, Any]:
        """CasADi functions (t, w, s, parameters, geometry) of the force on the first of two ends,
        the ground for a force on a site.

        Parameters
        ----------
        dim : int
        kind : {"pair", "wall"}
            Of the contact.

        Returns
        -------
        dict of str to casadi.Function
            "values", (dim,), and "slopes", column by column the derivatives by the difference w of
            the displacements, by that of the velocities s, by the parameters and by the gap.
        """
        import casadi as ca

        t, force, sizes = ca.SX.sym("t"), self.function(), {"w": dim, "s": dim}
        sizes |= {"p": len(self.parameters), "x": dim + 2}
        w, s, p, x = given = [ca.SX.sym(name, size) for name, size in sizes.items()]
        if self.on == SITE:
            reaction = -force(t, ca.vertcat(w, s, _norm(s)), p)
        else:
            r, along = functions(dim)[kind](x[:-2], w, x[-2], x[-1])
            rate = ca.dot(along, s)
            across = s - rate * along
            slip, speed = ca.SX.sym("slip"), _norm(across)
            f = force(t, ca.vertcat(r, rate, slip), p)
            reaction = f[0] * along
            if len(self.expressions) > 1:
                each = ca.substitute(ca.vertcat(f[1], ca.jacobian(f[1], slip)), slip, speed)
                reaction -= ca.if_else(speed > 0, each[0] / speed, each[1]) * across
            reaction = ca.substitute(reaction, slip, speed)
        columns = [ca.vec(ca.jacobian(reaction, y)) for y in (w, s, p, x[-2])]
        made = {"values": reaction, "slopes": ca.vertcat(*columns)}
        return {name: ca.Function(name, [t, *given], [ca.densify(y)]) for name, y in made.items()}


@once
def _function(law: ForceLaw) -> Any:
    """See `ForceLaw.function`: all scenes and runs with a force share one."""
    import casadi as ca

    t, x = ca.SX.sym("t"), ca.SX.sym("x", len(law.state))
    p = ca.SX.sym("p", len(law.parameters))
    if law.law is not None:
        return ca.Function("force", [t, x, p], [-law_functions(law.law)["tension"](x[0], p)])
    values = (t, *ca.vertsplit(x), *(ca.vertsplit(p) if law.parameters else ()))
    symbols = (law.time, *law.state, *law.parameters)
    made = [to_casadi(one, symbols)(*values) for one in law.expressions]
    return ca.Function("force", [t, x, p], [ca.densify(ca.vertcat(*map(ca.SX, made)))])


def _norm(x: Any) -> Any:
    """The length of a vector, with derivatives 0 where it is 0."""
    import casadi as ca

    square = ca.dot(x, x)
    return ca.if_else(square > 0, ca.sqrt(ca.if_else(square > 0, square, 1)), 0)


@once
def _onset(law: ForceLaw) -> Onset | None:
    """See `ForceLaw.onset`: of a force along a bond of one overlap, Max(place - r, 0)."""
    import sympy as sp

    if law.on == SITE or len(law.expressions) > 1:
        return None
    (tension,) = law.written or law.expressions
    (r, rate, _), known = law.state, {law.state[0], *law.parameters}
    gaps = {x for one in tension.atoms(sp.Max) for x in one.args
            if x.free_symbols <= known and x.diff(r) == -1}  # fmt: skip
    if len(gaps) != 1:
        return None
    (gap,) = gaps
    d, q, back = sp.Symbol("d", positive=True), sp.Symbol("q", positive=True), {}
    closed = tension.subs(sp.Max(gap, 0), d).subs(r, gap + r - d)
    positive = {one: sp.Symbol(one.name, positive=True) for one in law.parameters}
    back = {new: old for old, new in positive.items()}
    try:
        first = closed.subs(rate, -q).xreplace(positive).as_leading_term(d)
    except NotImplementedError:  # it depends on values of the parameters
        return None
    strength, power = first.as_coeff_exponent(d)
    if strength.has(d, sp.Max, sp.Piecewise) or not (power.is_number and 0 <= power < 1):
        return None
    place = gap + r
    return Onset(sp.expand(place), strength.xreplace(back), q, float(power), closed)


@once
def _slopes(law: ForceLaw) -> Any:
    """CasADi function (t, state, parameters) -> derivatives by the state, column by column."""
    import casadi as ca

    function = law.function()
    given = function.sx_in()
    jacobian = ca.jacobian(function(*given), given[1])
    return ca.Function("slopes", given, [ca.densify(ca.vec(jacobian))])


@once
def _digest(law: ForceLaw) -> str:
    from sympy import srepr

    parts = (*law.expressions, law.time, *law.state, *law.parameters)
    kind = law.on if law.law is None else f"{law.on} of an energy"
    return hashlib.sha256("|".join([kind, *map(srepr, parts)]).encode()).hexdigest()


@dataclass(frozen=True, eq=False)
class AppliedForce:
    """A force on some sites or bonds.

    Attributes
    ----------
    law : ForceLaw
    places : ndarray of int, (places,)
        Numbers of the sites or bonds; contacts with walls follow the bonds.
    values : ndarray, (parameters, places)
        Values of its parameters.
    """

    law: ForceLaw
    places: Indices
    values: Array

    @property
    def onsets(self) -> Array:
        """Elongations where contacts close, whose forces begin in a way to correct; (places,)."""
        import casadi as ca

        if self.law.onset is None:
            return np.full(len(self.places), np.nan)
        p = ca.SX.sym("p", len(self.values))
        place = to_casadi(self.law.onset.place, self.law.parameters)(*ca.vertsplit(p))
        onsets = np.array(ca.Function("place", [p], [ca.densify(ca.SX(place))])(self.values))
        return np.broadcast_to(onsets.ravel(), len(self.places)).copy()

    def stored(self, order: int, u: Array) -> Array:
        """Energies [J] of on-site springs, or derivatives of a given order, at displacements u
        [m] (..., sites); (..., places)."""
        at = np.ascontiguousarray(u[..., self.places])
        return np.asarray(evaluated(self.law.law, order, self.values, at))


def largest_decay(
    applied: tuple[AppliedForce, ...], bonds: Bonds, t: float, u: Array, v: Array
) -> float:
    """Bound on the rates at which velocities of a scene decay or grow by forces, with the frequency
    of on-site springs [1/s].

    Parameters
    ----------
    applied : tuple of AppliedForce
    bonds : Bonds
    t : float
        [s]
    u, v : ndarray, (sites[, dim])
        [m], [m/s]

    Returns
    -------
    float
    """
    sites, dim = len(u), max(bonds.dim, 1)
    total, stiffness = np.zeros((2, sites))
    for one in applied:
        law, at = one.law, one.places
        if law.law is not None:
            stiffness[at] += np.abs(one.stored(2, u.ravel()))  # of one coordinate
        if not (law.dissipates and len(at)):
            continue
        if law.on == SITE:
            x = np.concatenate([y.reshape(sites, -1)[at].T for y in (u, v)])
            x = np.concatenate([x, np.linalg.norm(x[dim:], axis=0)[None]])
            ends: Any = [at]
        else:
            ends = _ends(bonds, at)
            x = _relative(bonds, at, u, v)
        slopes = np.abs(np.array(_slopes(law)(t, x, one.values)))
        slopes = slopes.reshape(len(law.state), -1, len(at))[-len(law.rates) :]
        if law.on == SITE:  # a sum of components is at most sqrt(dim) of their norm
            slopes[-1] *= np.sqrt(dim)
        elif len(law.expressions) > 1:  # a force across the slip turns with it
            force = np.abs(np.array(law.function()(t, x, one.values))[1])
            slip = np.where(x[2] > 0, x[2], np.inf)
            slopes[-1, 1] = np.maximum(slopes[-1, 1], force / slip)
        rate = slopes.sum(axis=0).max(axis=0) if law.on == SITE else slopes.sum(axis=(0, 1))
        for end in ends:
            free = end < sites
            np.add.at(total, end[free], rate[free] * len(ends))
    weights = np.asarray(bonds.mobility)[:sites].reshape(sites, -1).max(axis=1)
    frequency = np.sqrt(np.max(stiffness * weights, initial=0.0))
    return float(np.max(total * weights, initial=0.0) + frequency)


def _ends(bonds: Bonds, at: Indices) -> tuple[Indices, Indices]:
    """Rows that bonds join; walls follow the sites."""
    of = bonds.contacts
    return (at, at + 1) if of is None else (of.first[at], of.second[at])


def _relative(bonds: Bonds, at: Indices, u: Array, v: Array) -> Array:
    """Elongations of some bonds, their rates, and their slip; (3, bonds)."""
    first, second = _ends(bonds, at)
    if bonds.contacts is None:
        u, v = u.ravel(), v.ravel()
        r = u[second] - u[first]
        return np.stack([r, v[second] - v[first], np.zeros(len(at))])
    wall = first >= len(u)
    ends = np.where(wall, 0, first)
    w, speed = (x[second] - np.where(wall[:, None], 0.0, x[ends]) for x in (u, v))
    of, relative = bonds.contacts.geometry_of(at), np.zeros((3, len(at)))
    for kind, chosen in enumerate((~wall, wall)):
        if chosen.any():
            r, along = functions(bonds.dim)[KINDS[kind]](
                of[:-2, chosen], w[chosen].T, of[-2:-1, chosen], of[-1:, chosen]
            )
            rate = np.sum(np.array(along).T * speed[chosen], axis=1)
            across = speed[chosen] - rate[:, None] * np.array(along).T
            relative[:, chosen] = np.array(r)[0], rate, np.linalg.norm(across, axis=1)
    return relative


@once
def continuity(expression: Any) -> float:
    """Exponent with which an expression changes near the places where it is not smooth.

    Returns
    -------
    float
        A lower bound: 0 where it may jump, 1 at a kink, 1/2 for the root of a kink; inf if it is
        smooth.
    """
    import sympy as sp

    if not is_piecewise(expression):
        return math.inf
    if isinstance(expression, sp.Piecewise):
        return min(float(_joins(expression)), *(continuity(one) for one, _ in expression.args))
    if isinstance(expression, (sp.Heaviside, sp.sign)):
        return 0.0
    if isinstance(expression, sp.Pow):
        power = expression.exp
        return continuity(expression.base) * min(1.0, abs(float(power)) if power.is_number else 0.0)
    of_parts = min(map(continuity, expression.args))
    return min(1.0, of_parts) if isinstance(expression, (sp.Max, sp.Min, sp.Abs)) else of_parts


def _joins(expression: Any) -> bool:
    """Whether the pieces of an expression are known to agree, with finite slopes, where conditions
    begin to hold."""
    import sympy as sp

    borders = []
    for _, condition in expression.args[:-1]:
        if not isinstance(condition, (sp.Gt, sp.Ge, sp.Lt, sp.Le)):
            return False
        left = condition.lhs - condition.rhs
        x = next((x for x in sorted(left.free_symbols, key=str) if left.diff(x).is_nonzero), None)
        if x is None or left.diff(x).has(x):  # not a linear equation
            return False
        borders.append({x: sp.expand(x - left / left.diff(x))})
    for number, (here, (one, _)) in enumerate(zip(borders, expression.args, strict=False), 1):
        (x,), gap = here, one - sp.Piecewise(*expression.args[number:])
        jump = sp.simplify(gap.subs(here))
        if jump.is_number and jump != 0:
            size = sp.Max(*(error_of(expression).subs(border) for border in borders))
            jump = max(abs(jump) - LEAST * size, 0)  # not the round-off of the constants
        if jump != 0 or gap.diff(x).subs(here).is_finite is False:
            return False
    return expression.args[-1].cond is sp.true
