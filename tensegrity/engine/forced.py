"""Steps of an explicit Runge-Kutta method with forces of time, displacement and velocity.

A stage evaluates all forces at its instant, displacements and velocities; a prescribed motion
replaces those of its site.  The work of the forces is the integral of their power, summed with the
weights of the method.  See `forced.c`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from tensegrity.engine.bonds import KINDS
from tensegrity.engine.compiled import Functions
from tensegrity.engine.force_law import BOND, SITE, AppliedForce, ForceLaw
from tensegrity.engine.forces import connectivity
from tensegrity.engine.law import named
from tensegrity.engine.native import structure
from tensegrity.engine.openings import DEGREE, zeta_powers
from tensegrity.once import once

if TYPE_CHECKING:
    from tensegrity.engine.bonds import Bonds
    from tensegrity.engine.methods import Nystrom
    from tensegrity.typing import Array, Indices

FORCING = structure("forced.c", "forcing")


@once
def _compiled(law: ForceLaw, dim: int, kind: str) -> Functions:
    key = named("derivatives of", (), law.name, dim, kind)
    return Functions(key, lambda: law.between(dim, kind))


def _evaluated(
    one: AppliedForce, name: str, bonds: Bonds, t: Array, u: Array, v: Array
) -> tuple[Array, Array]:
    """Rows of both ends of all places, (2, places), where that of the number of sites is the ground
    or a wall; a function of `ForceLaw.between`, (times, places, columns, dim)."""
    at, dim, sites = one.places, max(bonds.dim, 1), len(bonds.inverse_mass)
    first, second, pair, place = connectivity(bonds)
    kind = KINDS[not (one.law.on == SITE or pair[at].all())]
    if one.law.on == SITE:
        ends, of = np.stack([np.full(len(at), sites), at]), np.zeros((len(at), dim + 2))
    else:
        ends, of = np.stack([np.minimum(first, sites)[at], second[at]]), place[:, at].T
    rows = [np.repeat(t, len(at))[:, None]]
    for x in (u, v):
        whole = np.zeros((len(t), sites + 1, dim))
        whole[:, :sites] = x.reshape(len(t), sites, dim)
        rows.append((whole[:, ends[1]] - whole[:, ends[0]]).reshape(-1, dim))
    rows += [np.tile(x, (len(t), 1)) for x in (one.values.T, of)]
    values = _compiled(one.law, dim, kind)(name, *rows)
    return ends, values.reshape(len(t), len(at), -1, dim)


def tangent_springs(
    applied: tuple[AppliedForce, ...], bonds: Bonds, t: Array, u: Array, v: Array
) -> tuple[Indices, Array, Array]:
    """The derivatives of the forces of a scene, as springs and dashpots between two of its sites.

    Parameters
    ----------
    applied : tuple of AppliedForce
    bonds : Bonds
    t : ndarray, (times,)
        [s]
    u, v : ndarray, (times, entries)
        [m], [m/s]

    Returns
    -------
    ends : ndarray of int, (2, places)
        Numbers of the sites; the number of sites stands for the ground and for walls.
    stiff, loss : ndarray, (times, places, dim, dim)
        Of the force on the first end, by the components of the difference [N/m], [N s/m].
    """
    dim = max(bonds.dim, 1)
    ends, stiff = np.zeros((2, 0), dtype=int), np.zeros((len(t), 0, dim, dim))
    loss = stiff
    for one in applied:
        of, by = _evaluated(one, "slopes", bonds, t, u, v)
        ends = np.append(ends, of, axis=1)
        stiff, loss = (
            np.append(x, by[:, :, k : k + dim], axis=1) for x, k in ((stiff, 0), (loss, dim))
        )
    return ends, stiff, loss


def values_between(one: AppliedForce, bonds: Bonds, t: Array, u: Array, v: Array) -> Array:
    """A force in some states, as it acts on the first end of each of its places.

    Parameters
    ----------
    one : AppliedForce
    bonds : Bonds
    t : ndarray, (times,)
        [s]
    u, v : ndarray, (times, *shape of the scene)
        [m], [m/s]

    Returns
    -------
    ndarray, (times, places, dim)
        [N]; the first end of a place on a site is the ground, that of a bond is pulled by tension.
    """
    return _evaluated(one, "values", bonds, t, u, v)[1][:, :, 0]


def pull_back(
    applied: tuple[AppliedForce, ...], bonds: Bonds, t: Array, u: Array, v: Array, slopes: Array
) -> tuple[list[Array], list[Array], Array]:
    """Derivatives of objectives by the parameters of the forces of a scene, and by inverse masses.

    Parameters
    ----------
    applied, bonds, t, u, v
        As of `tangent_springs`.
    slopes : ndarray, (times, objectives, more than sites, dim)
        Derivatives by the accelerations.

    Returns
    -------
    by_parameters, by_gap : list of ndarray, (objectives, parameters, places), (objectives, places)
        Of each force.
    by_weight : ndarray, (objectives, more than sites, dim)
        Of the forces alone.
    """
    dim, given = max(bonds.dim, 1), bonds.inverse_mass
    weight = np.zeros(slopes.shape[2:])
    weight[: len(given)] = given.reshape(len(given), -1)
    by_parameters, by_gap, by_weight = [], [], np.zeros(slopes.shape[1:])
    for one in applied:
        ends, values = _evaluated(one, "values", bonds, t, u, v)
        by, pull = _evaluated(one, "slopes", bonds, t, u, v)[1][:, :, 2 * dim :], 0.0
        for end, sign in zip(ends, (1.0, -1.0), strict=True):
            of_end = sign * slopes[:, :, end]
            pull = pull + weight[end] * of_end
            parts = np.einsum("topi,tpi->opi", of_end, values[:, :, 0])
            np.add.at(by_weight.swapaxes(0, 1), end, parts.swapaxes(0, 1))
        products = np.einsum("topi,tpki->okp", pull, by)
        by_parameters.append(products[:, :-1])
        by_gap.append(products[:, -1])
    return by_parameters, by_gap, by_weight


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
        motions = 2 if forcing.ties is None else 3
        return len(self._nodes) * (1 + motions * len(forcing.moved) + 2 * len(forcing.forced))

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
        table = {"instants": at}
        if forcing.moved.size:
            table["prescribed_u"], table["prescribed_v"] = (forcing.motion(at, k) for k in (0, 1))
            table["after"] = forcing.motion(self._starts(first, steps, origin)[1:], 0)
            if forcing.ties is not None:
                table["prescribed_a"] = forcing.motion(at, 2)
        if forcing.forced.size:
            table["pull"], table["pull_rate"] = (forcing.force(at, k) for k in (0, 1))
        return {name: np.ascontiguousarray(rows, dtype=float) for name, rows in table.items()}


def fields(forcing: Any, sums: Array, corrects: bool) -> Any:
    """The structure `forcing` of `forced.c`, without what depends on time.

    Parameters
    ----------
    forcing : Forcing
    sums : ndarray, (2,) or more
        Receives work and loss [J].
    corrects : bool
        Whether steps are corrected where contacts close.

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
    powers = [one.law.onset.power if one.law.onset else 0.0 for one in applied]
    onsets = [one.onsets if corrects else np.full(len(one.places), np.nan) for one in applied]
    arrays |= {
        "onset": np.concatenate([np.zeros(0), *onsets]),
        "alpha": np.array(powers),
        "zeta": np.array([zeta_powers(-x) for x in powers]),
        "before": np.zeros(2 * sum(counts)),
    }
    if of is not None:
        bonds = [np.where(one.law.on == BOND, one.places, 0) for one in applied]
        at = np.concatenate([np.zeros(0, dtype=int), *bonds])
        ends = np.zeros((len(at), 2))
        if len(of.first):
            ends = forcing.bonds.dim * np.stack([of.first[at], of.second[at]], axis=1)
            arrays["geometry"] = of.geometry_of(at).T
        arrays["ends"] = ends.astype(np.int64)
    numbers = {"moving": len(forcing.moved), "pulling": len(forcing.forced), "stage": 0, "step": 0}
    numbers |= {"entries": len(forcing.mass), "degree": DEGREE}
    numbers["places"] = sum(counts) if any(np.isfinite(x).any() for x in onsets) else 0
    arrays |= _of_heavy_bonds(forcing)
    numbers["ties"] = 0 if forcing.ties is None else len(forcing.ties.mass)
    arrays = {name: np.ascontiguousarray(x) for name, x in arrays.items()}
    return FORCING(**dict.fromkeys(FORCING.kinds) | arrays | numbers | {"sums": sums})


def _of_heavy_bonds(forcing: Any) -> dict[str, Array]:
    """Arrays for bonds with mass, if there are some."""
    bonds, ties = forcing.bonds, forcing.ties
    if bonds.coupling is None:
        return {}
    rows = np.ones((bonds.contacts.rows, bonds.dim))
    rows[: len(bonds.inverse_mass)] = bonds.inverse_mass != 0
    arrays = {"unit": rows, "together": np.zeros(rows.size)}
    return arrays if ties is None else arrays | {"tied": ties.free, "tied_mass": ties.mass}
