"""A chain: point masses in a row, joined by nonlinear springs.

Model: each mass has one coordinate, and neighbours are joined by a bond whose force depends on its
elongation u[j+1] - u[j] only; each end is free or fixed, or one more bond closes a ring.  A free
end of a preloaded chain carries the constant preload, because potentials are measured from the
loaded equilibrium.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property, wraps
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.scenes.acting import on_site_springs
from tensegrity.scenes.dynamics import Dynamics, dynamics
from tensegrity.scenes.forcing import start_driven_sites
from tensegrity.scenes.network import Network
from tensegrity.scenes.pair_dynamics import is_pair_law
from tensegrity.scenes.scene import BYTES_PER_SITE, SMALLEST_MASS, Scene, State, velocities
from tensegrity.springs.pair_law import PairLaw
from tensegrity.springs.potential import Potential

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from tensegrity.engine.bonds import Bonds
    from tensegrity.scenes.force import Force
    from tensegrity.scenes.forcing import Damping, Drive
    from tensegrity.typing import Array, Indices, Motion

ENDS, PERIODIC = ("free", "fixed"), "periodic"
STEP = 1e-6  # of the largest elongation: what a wave may leave in the last bond of a ring


class Chain(Scene):
    """A chain of masses and springs.

    Parameters
    ----------
    spring : Potential or sequence of Potential
        One spring for all bonds, or `sites - 1` springs; bond j joins sites j and j + 1.  A ring
        has `sites` springs, the last of which joins the last site to the first.  Some may change
        with time, see `Potential.over_time`.  With a `PairLaw`, or several of one form, the
        chain is a `Network` in a row: u has the shape (sites, dim), and `mass` is one number, the
        inertias of one site, (dim,), or of all.
    sites : int
        Number of masses, at least 2.
    mass : float or array_like (sites,), optional
        Mass of each site [kg], > 0.
    ends : (str, str) or "periodic", optional
        "free" or "fixed" for the first and the last site; a fixed site is held at u = 0.
        "periodic": a ring.
    stretch : float, optional
        Of a ring the sum of all elongations [m]: that of the last bond is u[0] - u[-1] + stretch.
    drive : dict of int to Drive, optional
        {site: Drive}: prescribed motions, and forces that depend on time.
    damping : Damping, optional
        Dashpots in the bonds and to the ground.
    forces : sequence of Force, optional
        Forces of time, displacement and velocity, in addition to those of the springs.  Unless
        they depend on time alone, or are dashpots, linear in velocities, they need a Runge-Kutta
        method, "rk4" or "rk8", and exclude springs that change.
    ground : Potential or sequence of Potential, optional
        Springs between all sites and the ground, or one for each site: functions of u.  They are
        forces, each the `Force` of a potential, whose energy counts as that of the chain.

    Raises
    ------
    TensegrityError
        Any argument that is not as described above, or a spring that the compiled loop cannot
        evaluate; dashpots and forces in the bonds of a ring.

    Notes
    -----
    A chain of prisms models prisms between smooth plates that are heavier than their nodes.  If
    neighbouring prisms share their nodes (`Prism.column`), only long waves of columns of
    alternating handedness are of this kind: frequencies are 1 % too high at 41 units per
    wavelength, 18 % at 10, and meaningless for columns of one handedness.  See `bands` of a
    periodic column, and `Prism.column(plates=(mass, gyration))` for plates that turn.

    Examples
    --------
    >>> from tensegrity import Chain, PowerLaw, simulate
    >>> chain = Chain(PowerLaw(1.0, 1.5), sites=10, mass=2.0)
    >>> run = simulate(chain, chain.at_rest({0: 0.1}), t_end=40.0, tol=1e-8)
    >>> f"{chain.momentum(run.final):.6f} kg m/s, {chain.energy(run.final):.6f} J"
    '0.200000 kg m/s, 0.010000 J'
    """

    dim = 1
    loads = 0.0

    def __init__(
        self,
        spring: Potential | Sequence[Potential],
        sites: int,
        mass: ArrayLike = 1.0,
        ends: tuple[str, str] | Literal["periodic"] = ("free", "free"),
        *,
        stretch: float = 0.0,
        drive: Mapping[int, Drive] | None = None,
        damping: Damping | None = None,
        forces: Sequence[Force] = (),
        ground: Potential | Sequence[Potential] | None = None,
    ) -> None:
        self.sites = check.whole("sites", sites, least=2)
        check.memory(f"a run of {self.sites} sites", BYTES_PER_SITE * self.sites)
        self.ends = _checked_ends(ends)
        self.stretch = check.number("stretch", stretch, unit="m")
        if stretch and self.ends != PERIODIC:
            raise TensegrityError(f"stretch {self.stretch:g} m is that of a ring: ends 'periodic'")
        self.springs = self._springs(spring)
        self.mass = self._masses(mass)
        _ = dynamics(self).loop_bonds  # refuses springs that the compiled loop cannot take
        given = check.sequence("forces", forces, "forces")
        springs = on_site_springs(ground, self.sites)
        self._set_forcing(drive, damping, (*given, *springs))
        if self.ends == PERIODIC:
            self._refuse_in_bonds()

    if not TYPE_CHECKING:  # types are those of __init__

        @wraps(__init__, assigned=())
        def __new__(cls, spring=None, *given, **forcing):
            if cls is Chain and is_pair_law(spring):
                return _of_pairs(spring, *given, **forcing)
            return super().__new__(cls, **forcing)

    def _springs(self, spring: Potential | Sequence[Potential]) -> tuple[Potential, ...]:
        count = self.sites - (self.ends != PERIODIC)
        if isinstance(spring, Potential):
            return (spring,) * count
        if not isinstance(spring, Sequence):
            raise TensegrityError(
                f"spring {check.shown(spring)} is not a Potential or a sequence of them"
                f"{check.made_by(spring, Potential)}"
            )
        springs = tuple(spring)
        if len(springs) != count:
            raise TensegrityError(f"{len(springs)} springs for {count} bonds")
        for number, one in enumerate(springs):
            check.kind(f"spring {number}", one, Potential)
        return springs

    def _masses(self, mass: ArrayLike) -> Array:
        given = check.floats("mass", mass)
        if given.ndim and given.shape != (self.sites,):
            raise TensegrityError(f"mass has shape {given.shape}, must be ({self.sites},)")
        masses = np.broadcast_to(given, (self.sites,)).copy()
        bad = ~(np.isfinite(masses) & (masses >= SMALLEST_MASS))
        if bad.any():
            site = int(np.flatnonzero(bad)[0])
            raise TensegrityError(
                f"mass {masses[site]:g} kg of site {site} must be at least {SMALLEST_MASS:g}"
            )
        return masses

    @property
    def _shape_text(self) -> str:
        return f"chain has ({self.sites},) sites"

    @property
    def bonds(self) -> Indices:
        """The two sites of each bond; (bonds, 2)."""
        each = np.arange(len(self.springs))
        return np.stack([each, (each + 1) % self.sites], axis=1)

    @property
    def held(self) -> list[int]:
        """Indices of the sites that are held at u = 0."""
        return _held(self.ends, self.sites)

    def at_rest(self, velocity: Mapping[int, float] | None = None) -> State:
        """The undeformed state, in which the given sites have a velocity and all others rest.

        Parameters
        ----------
        velocity : dict of int to float, optional
            {site: velocity} [m/s], > 0 towards higher sites.

        Returns
        -------
        State
            u and v of shape (sites,); a site whose motion is prescribed has the displacement and
            the velocity of its drive at t = 0.

        Raises
        ------
        TensegrityError
            A site that does not exist or is fixed, or a velocity that is not a finite number.

        Examples
        --------
        >>> from tensegrity import Chain, PowerLaw
        >>> chain = Chain(PowerLaw(1.0, 1.5), sites=4)
        >>> chain.at_rest({0: 0.1}).v
        array([0.1, 0. , 0. , 0. ])
        """
        u, v = np.zeros((2, self.sites))
        for site, value in velocities(velocity):
            site = check.whole("site", site, least=0, below=self.sites)
            v[site] = check.number(f"velocity of site {site}", value, unit="m/s")
        start_driven_sites(self, u, v)
        state = State(u, v)
        self.check(state)
        return state

    def _check_sites(self, state: State) -> None:
        """Refuse a state of another shape, or one in which a fixed site moves."""
        self._refuse_other(state)
        for site in self.held if "fixed" in self.ends else ():
            if state.u[site] or state.v[site]:
                raise TensegrityError(
                    f"site {site} is fixed, but has displacement {state.u[site]:g} m and "
                    f"velocity {state.v[site]:g} m/s"
                )

    def site_energy(self, state: Motion) -> Array:
        """Kinetic energy of each site, half the energy of its bonds, and that of its spring to the
        ground [J], of a state or of the rows of a run; (..., sites)."""
        u, v = self._checked_rows(state)
        half = self.bond_energy(u) / 2
        edge = np.zeros((*half.shape[:-1], 1))
        left, right = np.concatenate([edge, half], -1), np.concatenate([half, edge], -1)
        if self.ends == PERIODIC:
            left, right = np.roll(half, 1, axis=-1), half
        return 0.5 * self.mass * v**2 + left + right + dynamics(self).acting.stored(0, u)

    def momentum(self, state: State) -> float:
        """Total momentum [kg m/s], > 0 towards higher sites."""
        self._refuse_other(state)
        return float(np.sum(self.mass * state.v))

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the displacements of a state."""
        return (self.sites,)

    def _dynamics(self) -> Dynamics:
        return RingDynamics(self) if self.ends == PERIODIC else Dynamics(self)

    def _refuse_in_bonds(self) -> None:
        """Refuse what acts in the bonds of a ring besides its springs."""
        if self.damping is not None and self.damping.bond.any():
            raise TensegrityError("damping: no dashpots in the bonds of a ring, but to the ground")
        if any(force.on == "bonds" for force in self._forces):
            raise TensegrityError("forces: none in the bonds of a ring, but on its sites")

    def __repr__(self) -> str:
        kinds = len(dynamics(self).springs)
        springs = "equal springs" if kinds == 1 else f"{kinds} kinds of springs"
        ends = f"ends {self.ends}" if self.ends != PERIODIC else f"ring, stretch {self.stretch:g} m"
        return f"Chain({self.sites} sites, {springs}, {ends})"


class RingDynamics(Dynamics):
    """Quantities derived from a ring: the loop has one more row, the image of the first site."""

    @cached_property
    def loop_bonds(self) -> Bonds:
        """Bonds in the form of the compiled loop."""
        return replace(super().loop_bonds, stretch=self.scene.stretch)

    def rows(self, state: State) -> tuple[Array, Array]:
        """u and v in the form of the loop."""
        u, v = (np.append(x, x[0]) for x in (state.u, state.v))
        u[-1] += self.scene.stretch
        return u, v

    @property
    def energies_in_one_call(self) -> None:
        """None: they are compiled for bonds between neighbours."""
        return None

    @property
    def _mobilities(self) -> Array:
        return self.inverse_mass + np.roll(self.inverse_mass, -1)

    def _where(self, bond: int) -> str:
        return f"between sites {bond} and {(bond + 1) % self.sites}"


def refuse_ring(scene: Any, what: str) -> None:
    """Refuse a ring where both directions along a chain must lead to an end."""
    if getattr(scene, "ends", None) == PERIODIC:
        raise TensegrityError(f"{what}: not for rings, which have no ends")


def refuse_step(scene: Any, u: Array) -> None:
    """Refuse a wave on a ring whose stretch is not the elongation that the wave brings."""
    if getattr(scene, "ends", None) == PERIODIC:
        needed, r = float(u[-1] - u[0]), scene.elongation(u)
        if abs(r[-1]) > STEP * np.abs(r).max():
            raise TensegrityError(
                f"stretch {scene.stretch:g} m of the ring must be {needed:.12g} m, the sum of the "
                "elongations of the wave"
            )


def _checked_ends(ends: Any) -> Any:
    if isinstance(ends, str) and ends == PERIODIC:
        return ends
    if (
        not isinstance(ends, (tuple, list))
        or len(ends) != 2
        or any(not isinstance(e, str) or e not in ENDS for e in ends)
    ):
        raise TensegrityError(f"ends {check.shown(ends)} must be two of {ENDS}, or 'periodic'")
    return ends[0], ends[1]


def _held(ends: Any, sites: int) -> list[int]:
    if ends == PERIODIC:
        return []
    return [s for s, end in zip((0, sites - 1), ends, strict=True) if end == "fixed"]


def _of_pairs(
    spring: Any, sites: int, mass: ArrayLike = 1.0, ends: Any = ("free", "free"), **forcing: Any
) -> Network:
    """A chain of sites of several coordinates: a network in a row."""
    sites = check.whole("sites", sites, least=2)
    one = spring if isinstance(spring, PairLaw) else spring[0]
    places, each = np.zeros((sites, one.law.dim)), np.arange(sites)
    places[:, 0] = each * (one.length or 1.0)
    if _checked_ends(ends) == PERIODIC:
        raise TensegrityError("ends 'periodic' are those of potentials, not of pair laws")
    bonds, held = np.stack([each[:-1], each[1:]], axis=1), _held(ends, sites)
    return Network(places, bonds, spring, mass=mass, held=held, **forcing)
