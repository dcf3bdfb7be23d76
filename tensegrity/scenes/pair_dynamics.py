"""Networks whose bonds have energies of both ends, V(q_i, q_j): their arguments, and the quantities
derived from them for runs.

A run notes the ranges of the differences of free coordinates and of the values of others.  With
lambda_b the largest eigenvalue of M^-1/2 V'' M^-1/2 of bond b in that box, the squares of the
angular frequencies are at most the largest sum of lambda_b over the bonds of a site, since
x' K x = sum x_b' V''_b x_b.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.readonly import Repeated
from tensegrity.scenes.network_dynamics import NetworkDynamics
from tensegrity.scenes.network_input import numbers
from tensegrity.scenes.scene import SMALLEST_MASS
from tensegrity.springs.collection import Springs
from tensegrity.springs.pair_law import PairLaw
from tensegrity.typing import Array, Flags, Indices


def is_pair_law(spring: object) -> bool:
    """Whether the springs of bonds are a `PairLaw`, or a sequence that begins with one."""
    if isinstance(spring, Sequence) and len(spring):
        return isinstance(spring[0], PairLaw)
    return isinstance(spring, PairLaw)


def inertias(mass: ArrayLike, shape: tuple[int, ...]) -> Array:
    """Inertias of all coordinates.

    Parameters
    ----------
    mass : float or array_like
        One number, those of one site, (dim,), one of each site, (sites, 1), or all; above 0.
    shape : (int, int)
        (sites, dim)

    Returns
    -------
    ndarray, (sites, dim)
    """
    given = numbers("mass", mass)
    if given.shape not in ((), shape[1:], (shape[0], 1), shape):
        raise TensegrityError(
            f"mass has shape {given.shape}, must be {shape[1:]}, the inertias of one site, or "
            f"{shape}, (sites, dim)"
        )
    values = np.broadcast_to(given, shape).copy()
    bad = np.argwhere(~(values >= SMALLEST_MASS))
    if bad.size:
        (site, k) = bad[0].tolist()
        raise TensegrityError(
            f"mass {values[site, k]:g} of coordinate {k} of site {site} must be at least "
            f"{SMALLEST_MASS:g}"
        )
    return values


def pair_laws(springs: Repeated, scene: Any) -> Repeated:
    """Pair laws of the bonds of a network, of one form.

    Parameters
    ----------
    springs : Repeated
    scene : Network

    Returns
    -------
    Repeated of PairLaw
        Each with its part of the energies of its sites.
    """
    for number, one in enumerate(springs):
        check.kind(f"spring of bond {number}", one, PairLaw)
        if one.law != springs[0].law:
            raise TensegrityError(
                f"pair laws of bonds 0 and {number} must have one form, with any parameters"
            )
        if one.law.dim != scene.dim:
            raise TensegrityError(
                f"sites have {scene.dim} coordinates, the pair law has {one.law.dim}"
            )
    first, second = scene.bonds.T
    if (first > second).any():
        number = int(np.argmax(first > second))
        raise TensegrityError(
            f"bond {number} joins sites {first[number]} and {second[number]}: of a pair law the "
            "first must have the lower number"
        )
    fraction = 1 / np.maximum(np.bincount(scene.bonds.ravel(), minlength=scene.sites), 1)
    given = zip(springs, fraction[first].tolist(), fraction[second].tolist(), strict=True)
    return Repeated.of([one.shared(*parts) for one, *parts in given])


def refuse_beside_pair_laws(of: Any) -> None:
    """Refuse arguments that exclude pair laws, of the dynamics of a network."""
    scene = of.scene
    others = {"walls": len(scene.walls), "radius": scene.radius is not None}
    others |= {"dashpots in bonds": scene.damping is not None and scene.damping.bond.any()}
    others |= {f"a force on {force.on}": force.on != "sites" for force in scene._forces}
    others |= {"bond_mass": scene.bond_mass is not None}
    others |= {"springs that change": of.springs.changing}
    for name in (name for name, given in others.items() if given):
        raise TensegrityError(f"{name} must not be given with a pair law")


class PairLaws(Springs):
    """The distinct pair laws of a network, of one form."""

    @property
    def noted_domain(self) -> Array:
        """That of coordinates, and differences of free ones, has no ends; (dim, 2)."""
        return np.tile([-np.inf, np.inf], (self.different[0].law.dim, 1))

    def reachable(self, energy: float) -> tuple[Array, Flags]:
        """Ranges that bonds can reach with an energy [J], (dim, 2), which have no ends."""
        each = np.array([spring.reachable(energy) for spring in self.different])
        ranges = np.stack([each[..., 0].min(axis=0), each[..., 1].max(axis=0)], axis=1)
        return ranges, np.zeros(len(ranges), dtype=bool)


class PairDynamics(NetworkDynamics):
    """Quantities derived from a network of one `PairLaw`, with any values of its parameters."""

    turns = False
    zero_length_elongation: Any = -np.inf

    @cached_property
    def springs(self) -> PairLaws:
        """The distinct pair laws, and the index of the one of each bond."""
        return PairLaws(self.scene.springs)

    @cached_property
    def free(self) -> Array:
        """Whether each coordinate is free; (dim,)."""
        return np.array(self.springs.different[0].free)

    def ranges_at(self, u: Array) -> Array:
        """Smallest and largest difference of each free coordinate, and value of others, 0 included;
        (dim, 2)."""
        first, second = (u[..., end, :] for end in self.scene.bonds.T)
        ends = np.where(self.free, second - first, first), np.where(self.free, 0.0, second)
        both = np.concatenate([x.reshape(-1, self.dim) for x in ends] + [np.zeros((1, self.dim))])
        return np.stack([both.min(axis=0), both.max(axis=0)], axis=1)

    def stiffness_bounds(self, ranges: Array, numbers: Indices | None = None) -> Array:
        """Bound on the stiffness over all ranges together [N/m], for each of them, (dim,), or those
        with such numbers: that of the frequencies, times the least inertia."""
        weights = self.inverse_mass.max(axis=0)
        each = [one.largest_stiffness(ranges, weights) for one in self.springs.different]
        total = np.zeros(self.sites)
        for end in self.scene.bonds.T:
            np.add.at(total, end, np.array(each)[self.springs.group])
        bound = total.max() / self._largest
        return np.full(self.dim if numbers is None else len(numbers), bound)

    def spring_frequency_bound(self, stiffness: Array) -> float:
        """Bound on the largest angular frequency [rad/s]; see `stiffness_bounds`."""
        return float(np.sqrt(stiffness.max() * self._largest))

    @cached_property
    def _largest(self) -> Any:
        """Largest inverse inertia."""
        return self.inverse_mass.max() or 1.0

    def where_stiffest(self, u: Array, ranges: Array) -> str:
        """Describe the bond of most energy."""
        return self._where(int(np.argmax(self.elongations(u))))
