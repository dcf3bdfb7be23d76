"""Chains of the same springs and masses that run at once, one in each lane of the last axis.

A processor works on several chains in the time of one where their sites stand side by side, so
an ensemble of short chains takes less time than one chain after the other.  All share the step.
Where there is no compiler, or with an implicit method, the lanes run in turn.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.kernel import Compiled, kernel
from tensegrity.lattice import Chain
from tensegrity.scene import State, velocities

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from typing import Any

    from numpy.typing import ArrayLike

    from tensegrity.methods import Method
    from tensegrity.potential import Potential
    from tensegrity.typing import Array

TOGETHER = (64, 32, 16, 8)  # lanes that one compiled loop takes


class Ensemble(Chain):
    """Several chains that differ in their state only: a scene for `simulate`.

    States have u [m] and v [m/s] of shape (sites, lanes), runs of shape (T, sites, lanes); the
    recorded energy is that of all lanes together, `lane_energy` tells them apart.

    Parameters
    ----------
    chain : Chain
    lanes : int
        Number of chains, at least 1.

    Examples
    --------
    >>> from tensegrity import Prism, simulate
    >>> chain = Chain(Prism(1.0, 0.7, 0.01, 1.0).potential(), 40)
    >>> blows = Ensemble(chain, 8)
    >>> run = simulate(blows, blows.at_rest({0: np.linspace(0.01, 0.03, 8)}), 10.0, tol=1e-8)
    >>> run.final.u.shape
    (40, 8)
    """

    def __init__(self, chain: Chain, lanes: int) -> None:
        if not isinstance(chain, Chain) or isinstance(chain, Ensemble):
            raise TensegrityError(f"chain {chain!r} is not a Chain")
        self.chain, self.lanes = chain, check.whole("lanes", lanes, least=1)
        self.step_share = chain.step_share
        super().__init__(chain.springs, chain.sites, chain.mass, chain.ends)

    def with_springs(self, springs: Iterable[Potential]) -> Ensemble:
        """The same ensemble with other springs, one for each run of equal bonds."""
        return Ensemble(self.chain.with_springs(springs), self.lanes)

    def at_rest(self, velocity: Mapping[int, ArrayLike] | None = None) -> State:
        """The undeformed state, some sites given a velocity [m/s]: {site: number or (lanes,)}."""
        v = np.zeros(self.shape)
        for site, values in velocities(velocity):
            try:
                values = np.broadcast_to(np.asarray(values, dtype=float), self.lanes)
            except ValueError:
                raise TensegrityError(
                    f"velocity {values!r} of site {site} must be one number or {self.lanes}"
                ) from None
            for lane, value in enumerate(values):
                v[:, lane] += self.chain.at_rest({site: float(value)}).v
        state = State(np.zeros(self.shape), v)
        self.check(state)
        return state

    def check(self, state: State) -> None:
        """Refuse a state of another shape, or one that a chain alone refuses."""
        self._refuse_other(state, f"ensemble has {self.shape}, (sites, lanes)")
        for lane in range(self.lanes):
            self.chain.check(self.lane(state, lane))

    def lane(self, state: State, number: int) -> State:
        """The state of one of the chains."""
        return State(*(np.ascontiguousarray(x[:, number]) for x in (state.u, state.v)))

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the displacements of a state."""
        return self.sites, self.lanes

    @property
    def cost(self) -> int:
        """Work of one evaluation of all forces, in bonds."""
        return (self.sites - 1) * self.lanes

    def elongation(self, u: ArrayLike) -> Array:
        """r_j = u[j+1] - u[j] [m]; u of shape (..., sites, lanes)."""
        return np.diff(u, axis=-2)

    def _per_bond(self, name: str, u: ArrayLike) -> Array:
        turned = np.moveaxis(np.asarray(u, dtype=float), -1, -2)
        r, (springs, first) = np.diff(turned, axis=-1), self.segment_springs
        parts = [
            getattr(spring, name)(r[..., start:stop])
            for spring, start, stop in zip(springs, first[:-1], first[1:], strict=True)
        ]
        return np.moveaxis(np.concatenate(parts, axis=-1), -1, -2)

    def lane_energy(self, u: Array, v: Array) -> Array:
        """Total energy of each chain [J]; u and v of shape (..., sites, lanes), (..., lanes)."""
        return self.site_energy(u, v).sum(axis=-2)

    def site_energy(self, u: Array, v: Array) -> Array:
        """Kinetic energy of each site and half that of its bonds [J]; (..., sites, lanes)."""
        half = self.bond_energy(u) / 2
        edge = np.zeros_like(half[..., :1, :])
        left, right = np.concatenate([edge, half], -2), np.concatenate([half, edge], -2)
        return 0.5 * self.mass[:, None] * v**2 + left + right

    def energy(self, state: State) -> float:
        """Total energy of all lanes [J]."""
        kinetic = 0.5 * np.sum(self.mass[:, None] * state.v**2)
        return float(kinetic + np.sum(self.bond_energy(state.u)))

    def available_energy(self, state: State) -> float:
        """What one spring could get: the largest energy of a lane [J]."""
        return float(self.lane_energy(state.u, state.v).max())

    def momentum(self, state: State) -> float:
        """Total momentum of all lanes [kg m/s], > 0 towards higher sites."""
        return float(np.sum(self.mass[:, None] * state.v))

    def present_ranges(self, u: Array) -> Array:
        """Smallest and largest elongation, 0 included, of what the loop keeps ranges of."""
        each = [self.chain.present_ranges(one) for one in np.ascontiguousarray(u.T)]
        return np.stack([np.min(each, axis=0)[:, 0], np.max(each, axis=0)[:, 1]], axis=1)

    def extreme(self, row: int, u: Array, side: int) -> str:
        """Where an elongation of that row is lowest (side 0) or highest (1), in words."""
        first = self.segment_springs[1]
        part = self.elongation(u)[first[row] : first[row + 1]]
        place = np.argmax(part) if side else np.argmin(part)
        bond, lane = np.unravel_index(place, part.shape)
        return _where(first[row] + bond, lane)

    def stiffest(self, u: Array, ranges: Array) -> str:
        """Where the stretch is largest, in words."""
        r = np.abs(self.elongation(u))
        return _where(*np.unravel_index(np.argmax(r), r.shape))

    def bind(self, u: Array, v: Array, method: Method, dt: float) -> Any:
        """These chains in the loop, advancing `u` and `v` in place."""
        return _Lanes(self, u, v, method, dt)

    def __repr__(self) -> str:
        return f"Ensemble({super().__repr__()}, {self.lanes} lanes)"


def _where(bond: int | np.integer[Any], lane: int | np.integer[Any]) -> str:
    return f"between sites {bond} and {bond + 1} of lane {lane}"


class _Lanes:
    """Lanes in groups, each in a loop compiled for so many, what is left one by one."""

    def __init__(self, ensemble: Ensemble, u: Array, v: Array, method: Method, dt: float) -> None:
        self._whole, self._groups = (u, v), []
        segments, weights = ensemble.segments, ensemble.inverse_mass
        alone = kernel(segments.laws)
        together = isinstance(alone, Compiled) and method.explicit
        lane = 0
        while lane < ensemble.lanes:
            fitting = [n for n in TOGETHER if together and n <= ensemble.lanes - lane]
            width = fitting[0] if fitting else 1
            engine: Any = Compiled(segments.laws, lanes=width) if fitting else alone
            part = np.s_[:, lane : lane + width] if fitting else np.s_[:, lane]
            arrays = tuple(np.ascontiguousarray(x[part]) for x in (u, v))
            loop = engine.bind(*arrays, weights, segments, method, dt)
            self._groups.append((part, arrays, loop))
            lane += width
        self.range = np.empty((len(segments.law), 2))
        self.forget_range()

    def forget_range(self) -> None:
        """Start anew to record the smallest and the largest elongation of each segment."""
        self.range[:, 0], self.range[:, 1] = np.inf, -np.inf
        for _, _, loop in self._groups:
            loop.forget_range()

    def advance(self, steps: int) -> None:
        """Advance u and v by whole steps."""
        for part, arrays, loop in self._groups:
            for own, whole in zip(arrays, self._whole, strict=True):
                own[...] = whole[part]
            loop.advance(steps)
            for own, whole in zip(arrays, self._whole, strict=True):
                whole[part] = own
            self.range[:, 0] = np.minimum(self.range[:, 0], loop.range[:, 0])
            self.range[:, 1] = np.maximum(self.range[:, 1], loop.range[:, 1])
