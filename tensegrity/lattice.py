"""Masses in a row, joined by springs: the scene that `simulate` runs.

Model: point masses with one coordinate each, neighbours joined by a bond whose force depends
on its elongation u[j+1] - u[j] only; ends free or held.  A free end of a preloaded chain
carries the constant preload, because potentials are measured from the loaded equilibrium.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from tensegrity import check, stepping
from tensegrity.errors import TensegrityError
from tensegrity.kernel import Segments, kernel
from tensegrity.potential import Potential
from tensegrity.scene import SMALLEST_MASS, Scene, State, law_table, velocities

if TYPE_CHECKING:
    from collections.abc import Iterable
    from typing import Any

    from numpy.typing import ArrayLike

    from tensegrity.methods import Method
    from tensegrity.typing import Array, Indices

ENDS = ("free", "fixed")


class Chain(Scene):
    """A chain of masses and springs.

    Parameters
    ----------
    spring : Potential or sequence of Potential
        One for all bonds, or `sites - 1` of them; bond j joins sites j and j + 1.
    sites : int
        Number of masses, at least 2.
    mass : float or array_like (sites,), optional
        [kg], > 0.
    ends : (str, str), optional
        "free" or "fixed" for the first and the last site; a fixed site is held at u = 0.
    """

    def __init__(
        self,
        spring: Potential | Sequence[Potential],
        sites: int,
        mass: ArrayLike = 1.0,
        ends: tuple[str, str] = ("free", "free"),
    ) -> None:
        self.sites = check.whole("sites", sites, least=2)
        self.springs = self._springs(spring)
        self.mass = self._masses(mass)
        if not isinstance(ends, (tuple, list)) or len(ends) != 2 or not set(ends) <= set(ENDS):
            raise TensegrityError(f"ends {ends!r} must be two of {ENDS}")
        self.ends = ends[0], ends[1]
        _ = self.segments  # refuses springs that the compiled loop cannot take

    def _springs(self, spring: Potential | Sequence[Potential]) -> tuple[Potential, ...]:
        if isinstance(spring, Potential):
            return (spring,) * (self.sites - 1)
        if not isinstance(spring, Sequence):
            raise TensegrityError(f"spring {spring!r} is not a Potential or a sequence of them")
        springs = tuple(spring)
        if len(springs) != self.sites - 1:
            raise TensegrityError(f"{len(springs)} springs for {self.sites - 1} bonds")
        for number, one in enumerate(springs):
            if not isinstance(one, Potential):
                raise TensegrityError(f"spring {number} is {one!r}, not a Potential")
        return springs

    def _masses(self, mass: ArrayLike) -> Array:
        try:
            given = np.asarray(mass, dtype=float)
        except (TypeError, ValueError):
            raise TensegrityError(f"mass {mass!r} is not a number or a sequence of them") from None
        if given.ndim and given.shape != (self.sites,):
            raise TensegrityError(f"mass has shape {given.shape}, must be ({self.sites},)")
        masses = np.broadcast_to(given, (self.sites,)).copy()
        bad = ~(np.isfinite(masses) & (masses >= SMALLEST_MASS))
        if bad.any():
            site = int(np.flatnonzero(bad)[0])
            raise TensegrityError(
                f"mass {masses[site]:g} kg of site {site} must be at least {SMALLEST_MASS:g}"
            )
        masses.flags.writeable = False
        return masses

    @property
    def held(self) -> list[int]:
        """Numbers of the sites that are held."""
        return [s for s, end in zip((0, self.sites - 1), self.ends, strict=True) if end == "fixed"]

    @cached_property
    def segment_springs(self) -> tuple[list[Potential], list[int]]:
        """The spring of each run of equal bonds, and the first bond of each run."""
        first = [0] + [j for j in range(1, len(self.springs)) if self._differs(j)]
        return [self.springs[j] for j in first], [*first, len(self.springs)]

    def _differs(self, bond: int) -> bool:
        left, right = self.springs[bond - 1], self.springs[bond]
        return left is not right and left != right

    @cached_property
    def segments(self) -> Segments:
        """Bonds as the kernel takes them."""
        springs, first = self.segment_springs
        laws, law, parameters = law_table(springs)
        return Segments(laws, np.array(first), law, parameters)

    def with_springs(self, springs: Iterable[Potential]) -> Chain:
        """The same chain with other springs, one for each run of equal bonds."""
        counts = np.diff(self.segment_springs[1])
        each = [spring for spring, n in zip(springs, counts, strict=True) for _ in range(n)]
        return Chain(each, self.sites, self.mass, self.ends)

    def at_rest(self, velocity: Mapping[int, float] | None = None) -> State:
        """The undeformed state, some sites given a velocity [m/s]: {site: velocity}."""
        v = np.zeros(self.sites)
        for site, value in velocities(velocity):
            site = check.whole("site", site, least=0)
            if site >= self.sites:
                raise TensegrityError(f"site {site} must be below {self.sites}")
            v[site] = check.number(f"velocity of site {site}", value, unit="m/s")
        state = State(np.zeros(self.sites), v)
        self.check(state)
        return state

    def check(self, state: State) -> None:
        """Refuse a state of another size, one that moves a held site, or one out of domain."""
        self._refuse_other(state, f"chain has ({self.sites},) sites")
        for site in self.held:
            if state.u[site] or state.v[site]:
                raise TensegrityError(
                    f"site {site} is fixed, but has displacement {state.u[site]:g} m and "
                    f"velocity {state.v[site]:g} m/s"
                )
        energy = self.energy(state)  # refuses elongations out of domain
        if not np.isfinite(energy):
            raise TensegrityError(f"energy {energy} J of the state must be finite")

    def elongation(self, u: ArrayLike) -> Array:
        """r_j = u[j+1] - u[j] [m] along the last axis."""
        return np.diff(u, axis=-1)

    def bond_energy(self, u: ArrayLike) -> Array:
        """Energy of each bond [J]; u of shape (..., sites) gives (..., sites - 1)."""
        return self._per_bond("energy", u)

    def bond_tension(self, u: ArrayLike) -> Array:
        """Tension of each bond [N]; u of shape (..., sites) gives (..., sites - 1)."""
        return self._per_bond("tension", u)

    def _per_bond(self, name: str, u: ArrayLike) -> Array:
        r = self.elongation(np.asarray(u, dtype=float))
        springs, first = self.segment_springs
        parts = [
            getattr(spring, name)(r[..., start:stop])
            for spring, start, stop in zip(springs, first[:-1], first[1:], strict=True)
        ]
        return np.concatenate(parts, axis=-1)

    def energy(self, state: State) -> float:
        """Total energy [J]."""
        with np.errstate(over="ignore"):  # to inf, which `check` refuses
            kinetic = 0.5 * np.sum(self.mass * state.v**2)
        return float(kinetic + np.sum(self.bond_energy(state.u)))

    def site_energy(self, u: Array, v: Array) -> Array:
        """Kinetic energy of each site and half that of its bonds [J]; (..., sites)."""
        half = self.bond_energy(u) / 2
        edge = np.zeros((*half.shape[:-1], 1))
        left, right = np.concatenate([edge, half], -1), np.concatenate([half, edge], -1)
        return 0.5 * self.mass * v**2 + left + right

    def momentum(self, state: State) -> float:
        """Total momentum [kg m/s], > 0 towards higher sites."""
        return float(np.sum(self.mass * state.v))

    clearance = None  # all contacts are bonds
    wall_count = 0

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the displacements of a state."""
        return (self.sites,)

    @property
    def cost(self) -> int:
        """Work of one evaluation of all forces, in bonds."""
        return self.sites - 1

    def arrays(self, state: State) -> tuple[Array, Array]:
        """Copies of u and v as the loop advances them."""
        return state.u.copy(), state.v.copy()

    def bind(self, u: Array, v: Array, method: Method, dt: float) -> Any:
        """This chain in the loop, advancing `u` and `v` in place."""
        engine = kernel(self.segments.laws)
        return engine.bind(u, v, self.inverse_mass, self.segments, method, dt)

    def watched(self) -> tuple[list[Potential], Indices]:
        """The springs whose ranges of elongation the loop keeps, and where each begins.

        Returns
        -------
        springs : list of Potential
        rows : ndarray of int
            For each range kept by the loop, the number of its spring.
        """
        springs, _ = self.segment_springs
        return springs, np.arange(len(springs))

    def present_ranges(self, u: Array) -> Array:
        """Smallest and largest elongation, 0 included, of what the loop keeps ranges of."""
        r, first = self.elongation(u), self.segment_springs[1][:-1]
        low, high = (end.reduceat(r, first) for end in (np.minimum, np.maximum))
        return np.stack([np.minimum(low, 0), np.maximum(high, 0)], axis=1)

    def frequency(self, ranges: Array) -> float:
        """Bound on the largest angular frequency [rad/s] over given ranges of elongation.

        The eigenvalues of M^-1 K are at most max over bonds of 2 k (1/m_left + 1/m_right).
        """
        springs, first = self.segment_springs
        mobility = np.maximum.reduceat(self.inverse_mass[:-1] + self.inverse_mass[1:], first[:-1])
        stiffness = [
            stepping.largest_stiffness(spring, low, high)
            for spring, (low, high) in zip(springs, ranges, strict=True)
        ]
        return float(np.sqrt(np.max(2 * np.array(stiffness) * mobility)))

    def extreme(self, row: int, u: Array, side: int) -> str:
        """Where an elongation of that row is lowest (side 0) or highest (1), in words."""
        first = self.segment_springs[1]
        part = self.elongation(u)[first[row] : first[row + 1]]
        bond = int(first[row] + (np.argmax(part) if side else np.argmin(part)))
        return f"between sites {bond} and {bond + 1}"

    def stiffest(self, u: Array, ranges: Array) -> str:
        """Where the stretch is largest, in words."""
        bond = int(np.argmax(np.abs(self.elongation(u))))
        return f"between sites {bond} and {bond + 1}"

    def __repr__(self) -> str:
        kinds = len(self.segment_springs[0])
        return f"Chain({self.sites} sites, {kinds} run(s) of equal springs, ends {self.ends})"
