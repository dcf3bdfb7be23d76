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

from tensegrity.engine.bonds import KINDS
from tensegrity.engine.compiled import Functions, evaluated
from tensegrity.engine.geometry import functions
from tensegrity.engine.law import continuity, to_casadi
from tensegrity.engine.law import functions as law_functions
from tensegrity.engine.native import structure
from tensegrity.once import once

if TYPE_CHECKING:
    import sympy as sp

    from tensegrity.engine.bonds import Bonds
    from tensegrity.engine.methods import Nystrom
    from tensegrity.typing import Array, Indices

FORCING = structure("forced.c", "forcing")
SITE, BOND = "SITE", "BOND"  # as in forced.c
WORKS, LOSES, STORES = range(3)  # what becomes of the work of a force; as in forced.c


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
    """

    expressions: tuple[sp.Expr, ...]
    time: sp.Symbol
    state: tuple[sp.Symbol, ...]
    parameters: tuple[sp.Symbol, ...]
    on: str
    law: Any = None

    @property
    def rates(self) -> tuple[sp.Symbol, ...]:
        """Those symbols of the state that are velocities."""
        return self.state[len(self.state) // 2 :]

    @property
    def dissipates(self) -> bool:
        """Whether the force depends on velocity: its negative work then counts as a loss."""
        used = set().union(*(one.free_symbols for one in self.expressions))
        return bool(used & {*self.rates})

    @property
    def continuity(self) -> float:
        """See `law.continuity`."""
        return min(map(continuity, self.expressions))

    @property
    def name(self) -> str:
        """Identifies the force in other processes."""
        return _digest(self)

    @property
    def macro(self) -> tuple[Any, ...]:
        """What the list FORCES of `forced.c` has of a force besides its number."""
        kind = LOSES if self.dissipates else WORKS if self.law is None else STORES
        return len(self.parameters), len(self.expressions), self.on, kind

    def function(self) -> Any:
        """CasADi function (t, state, parameters) -> components of the force."""
        import casadi as ca

        t, x = ca.SX.sym("t"), ca.SX.sym("x", len(self.state))
        p = ca.SX.sym("p", len(self.parameters))
        if self.law is not None:
            return ca.Function("force", [t, x, p], [-law_functions(self.law)["tension"](x[0], p)])
        values = (t, *ca.vertsplit(x), *(ca.vertsplit(p) if self.parameters else ()))
        symbols = (self.time, *self.state, *self.parameters)
        made = [to_casadi(one, symbols)(*values) for one in self.expressions]
        return ca.Function("force", [t, x, p], [ca.densify(ca.vertcat(*map(ca.SX, made)))])

    def slopes(self) -> Any:
        """CasADi function (t, state, parameters) -> derivatives by the state, column by column."""
        return self._derivatives("slopes", 1)

    def _derivatives(self, name: str, argument: int) -> Any:
        import casadi as ca

        function = self.function()
        given = function.sx_in()
        found = ca.jacobian(function(*given), given[argument])
        return ca.Function(name, given, [ca.densify(ca.vec(found))])

    def functions(self) -> dict[str, Any]:
        """The components, and their derivatives by the state and by the parameters."""
        found = {"values": self.function(), "slopes": self.slopes()}
        return found | ({"by": self._derivatives("by", 2)} if self.parameters else {})


@once
def _slopes(law: ForceLaw) -> Any:
    return law.slopes()


@once
def _compiled(law: ForceLaw) -> Functions:
    return Functions(("derivatives of", law.name), law.functions)


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
            stiffness[at] += np.abs(one.stored(2, u))
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
    weights = np.asarray(bonds.inverse_mass)[:sites]
    frequency = np.sqrt(np.max(stiffness * weights, initial=0.0))
    return float(np.max(total * weights, initial=0.0) + frequency)


def tangent_springs(
    applied: tuple[AppliedForce, ...], bonds: Bonds, t: Array, u: Array, v: Array
) -> tuple[Indices, Array, Array]:
    """The derivatives of the forces of a chain, as springs and dashpots between two of its entries.

    Parameters
    ----------
    applied : tuple of AppliedForce
    bonds : Bonds
    t : ndarray, (times,)
        [s]
    u, v : ndarray, (times, sites)
        [m], [m/s]

    Returns
    -------
    ends : ndarray of int, (2, places)
        Numbers of the sites; the number of sites stands for the ground.
    stiff, loss : ndarray, (times, places)
        [N/m], [N s/m]
    """
    ends, parts, sites = [], [], u.shape[1]
    for one in applied:
        at, on_site = one.places, one.law.on == SITE
        ends.append(np.stack([np.full(len(at), sites), at] if on_site else _ends(bonds, at)))
        by_u, by_v, by_speed = _evaluated(one, "slopes", t, u, v)
        if on_site:  # a tension between the ground and a site pulls it back
            by_u, by_v = -by_u, -by_v - by_speed * np.sign(v[:, at])
        parts.append((by_u, by_v))
    stiff, loss = (np.concatenate([part[k] for part in parts], axis=1) for k in (0, 1))
    return np.concatenate(ends, axis=1), stiff, loss


def _evaluated(one: AppliedForce, name: str, t: Array, u: Array, v: Array) -> Array:
    """A function of `ForceLaw.functions`, of a chain, (results, times, places)."""
    at = one.places
    if one.law.on == SITE:
        x = [u[:, at], v[:, at], np.abs(v[:, at])]
    else:
        r, rate = (np.diff(y, axis=1)[:, at] for y in (u, v))
        x = [r, rate, 0 * r]
    rows = np.repeat(t, len(at))[:, None], np.reshape(x, (3, -1)).T
    found = _compiled(one.law)(name, *rows, np.tile(one.values, len(t)).T)
    return found.T.reshape(-1, len(t), len(at))


def values_on_chain(one: AppliedForce, t: Array, u: Array, v: Array) -> Array:
    """A force of a chain in some states.

    Parameters
    ----------
    one : AppliedForce
    t : ndarray, (times,)
        [s]
    u, v : ndarray, (times, sites)
        [m], [m/s]

    Returns
    -------
    ndarray, (times, places)
        On sites towards higher sites, in bonds a tension [N].
    """
    values: Array = _evaluated(one, "values", t, u, v)[0]
    return values


def pull_back(
    applied: tuple[AppliedForce, ...], bonds: Bonds, t: Array, u: Array, v: Array, slopes: Array
) -> tuple[list[Array], Array]:
    """Derivatives of objectives by the parameters of the forces of a chain, and by inverse masses.

    Parameters
    ----------
    applied, bonds, t, u, v
        As of `tangent_springs`.
    slopes : ndarray, (times, objectives, sites)
        Derivatives by the accelerations.

    Returns
    -------
    by_parameters : list of ndarray, (objectives, parameters, places)
        Of each force.
    by_weight : ndarray, (objectives, sites)
        Of the forces alone.
    """
    found, by_weight = [], np.zeros(slopes.shape[1:])
    for one in applied:
        at, w = one.places, bonds.inverse_mass
        ends = [(at, 1.0)] if one.law.on == SITE else [(at, 1.0), (at + 1, -1.0)]
        values, pull = _evaluated(one, "values", t, u, v)[0], 0.0
        for end, sign in ends:
            of_end = sign * slopes[..., end]
            pull = pull + w[end] * of_end
            by_weight[:, end] += np.einsum("top,tp->op", of_end, values)
        if not one.law.parameters:
            found.append(np.zeros((len(by_weight), 0, len(at))))
            continue
        by = _evaluated(one, "by", t, u, v)
        found.append(np.einsum("top,ktp->okp", pull, by))
    return found, by_weight


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
    of, found = bonds.contacts.geometry_of(at), np.zeros((3, len(at)))
    for kind, chosen in enumerate((~wall, wall)):
        if chosen.any():
            r, along = functions(bonds.dim)[KINDS[kind]](
                of[:-2, chosen], w[chosen].T, of[-2:-1, chosen], of[-1:, chosen]
            )
            rate = np.sum(np.array(along).T * speed[chosen], axis=1)
            across = speed[chosen] - rate[:, None] * np.array(along).T
            found[:, chosen] = np.array(r)[0], rate, np.linalg.norm(across, axis=1)
    return found


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
    applied, of = forcing.applied, forcing.bonds.contacts
    places = [one.places for one in applied]
    values = [one.values for one in applied]
    counts = [len(one) for one in places]
    arrays = {
        "parameters": np.concatenate([np.zeros(0), *(x.ravel() for x in values)]),
        "place": np.concatenate([np.zeros(0, dtype=int), *places]).astype(np.int64),
        "first": np.cumsum([0, *counts]),
        "straight": np.array([int(np.all(np.diff(x) == 1)) for x in places], dtype=np.int64),
        "none": np.zeros(len(forcing.mass)),
        "begin": np.cumsum([0, *(x.size for x in values)]),
        "prescribed_mass": forcing.prescribed_mass,
        "moved": forcing.moved.astype(np.int64),
        "pulled": forcing.forced.astype(np.int64),
        "given": np.zeros(max((n * len(one.law.expressions) for n, one in
                               zip(counts, applied, strict=True)), default=0)),
    }  # fmt: skip
    if of is not None:
        bonds = [np.where(one.law.on == BOND, one.places, 0) for one in applied]
        at = np.concatenate([np.zeros(0, dtype=int), *bonds])
        ends = np.zeros((len(at), 2))
        if len(of.first):
            ends = forcing.bonds.dim * np.stack([of.first[at], of.second[at]], axis=1)
            arrays["geometry"] = of.geometry_of(at).T
        arrays["ends"] = ends.astype(np.int64)
    numbers = {"moving": len(forcing.moved), "pulling": len(forcing.forced), "stage": 0, "step": 0}
    numbers["entries"] = len(forcing.mass)
    arrays = {name: np.ascontiguousarray(x) for name, x in arrays.items()}
    return FORCING(**dict.fromkeys(FORCING.kinds) | arrays | numbers | {"sums": sums})
