"""Solitary waves of several components: extension and twist of a column between heavy plates.

A column is a line of equal sites and equal bonds in a `Network`; the differences r(x - c t) of the
coordinates of neighbours solve m c^2 r = K T(r), where T is the gradient of the energy of a bond
and K the convolution of `travelling`; coordinates of other inertias m_k are multiplied by
sqrt(m_k/m).  In the eigenvectors of the stiffness at rest the linear law
is diagonal, and the equation is that of a chain in each component.  A wave faster than all sounds
radiates nothing; long waves have the profile of Korteweg and de Vries in the fastest component,
from which Newton's method goes on to shorter ones.

Units of alternating handedness have no waves of a family.  With staggered rotations (-1)^j phi_j
they are equal too, with the twist phi_j + phi_(j+1): then w^2 of the second branch of linear waves
is 4 V_tt/m > 0 at k = 0 and bounded, so that the line w = c k crosses it at every speed c, and a
wave excites what moves with it.  Only at isolated speeds could the amplitude of that tail be 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from tensegrity.errors import TensegrityError
from tensegrity.scenes.acting import per_coordinate
from tensegrity.scenes.forcing import refuse_heavy_bonds
from tensegrity.scenes.network import Network
from tensegrity.waves.cosines import Grid, Series, cosine_sum
from tensegrity.waves.family import FIRST_POINTS, half_length, refined
from tensegrity.waves.travelling import NoWaveError, Profile, newton, speed_is

EQUAL = 1e-12  # relative difference of equal separations and masses
DIFFERENCE = 1e-4  # of the separation, for the curvature of the force at rest
LONG, FASTER = 0.04, 2.0  # m c^2 over that of sound minus 1: of a first wave; factor to the next
ROUGHLY = 1e-6  # last Newton step on the way
LEAST = 1e-4  # of the first wave, if its profile is not near that of long waves before
REMAINS = 0.9  # of the peak, where it would grow
SHORTER = 5  # roots of the factor
AROUND, ALIKE = 0.1, 1e-12  # from rest, where energies are compared when ends are exchanged


@dataclass(frozen=True)
class PairSeries(Series):
    """Of free coordinates the coefficients of du/dx, of the last one those of its value at sites,
    which is its elongation and displacement; the rate is the derivative of either by x."""

    turning: int

    def elongation(self, x: Any) -> Any:
        """Differences of free coordinates about x, value of the other; (..., dim)."""
        return self._sum(self._elongations, x)

    def rate(self, x: Any) -> Any:
        """Derivatives of all coordinates by x."""
        found: Any = self._sum(self.rates, x)
        k, inside = self.grid.wave_numbers, np.abs(x) <= self.grid.half_length
        slope = -cosine_sum(self.rates[self.turning] * k, k, np.where(inside, x, 0.0), np.sin)
        found[..., self.turning] = np.where(inside, slope, 0.0)
        return found

    def displacement(self, x: Any) -> Any:
        """Coordinates, of free ones 0 far ahead."""
        found: Any = Series(self.grid, self.rates).displacement(x)
        found[..., self.turning] = self._sum(self.rates[self.turning], np.asarray(x))
        return found

    def on_grid(self) -> Any:
        """Elongations and rates at the points of the grid."""
        rates = self.grid.values(self.rates)
        rates[self.turning] = self.rate(self.grid.x)[:, self.turning]
        return self.grid.values(self._elongations), rates

    @property
    def shift(self) -> Any:
        """Displacement of free coordinates far behind, and 0."""
        return np.where(np.arange(len(self.rates)) == self.turning, 0.0, super().shift)

    @cached_property
    def _elongations(self) -> Any:
        whole = np.ones((len(self.rates), 1)) * self.grid.box
        whole[self.turning] = 1.0
        return self.rates * whole


class CoupledLaw:
    """The law of the bonds of a column, for a reference amplitude A [m], as `travelling.Scaled`.

    Parameters
    ----------
    unit : Network
        One bond, from `unit_of`.
    reference : float, optional
        A [m], of the fastest component.

    Attributes
    ----------
    basis : ndarray, (components, components)
        Eigenvectors of the stiffness at rest as columns, that of the fastest sound first.
    secant : float
        Its stiffness [N/m].
    root : ndarray, (components,)
        Square roots of the inertias over the first: the stiffness is that of the coordinates times
        these.
    rest, lag : ndarray, (components, 1)
    """

    def __init__(self, unit: Network, reference: float = 1.0) -> None:
        self.potential, self.reference = unit, reference
        self._bonds: dict[int, Any] = {}
        mass = per_coordinate(unit, unit.mass)[0]
        self.root = np.sqrt(mass / mass[0])  # of the inertias, by which coordinates are multiplied
        (self._stiffness,) = self._tangents(np.zeros((1, unit.dim)))
        values, vectors = np.linalg.eigh(self._stiffness)
        self.basis, self.secant = vectors[:, ::-1], float(values[-1])
        self.rest = values[::-1, None] / self.secant
        self.lag, self.force = self.rest[0] - self.rest, self.secant * reference

    @property
    def name(self) -> str:
        """Of the family of waves."""
        return "compression" if self.reference * self.basis[0, 0] < 0 else "rarefaction"

    @cached_property
    def curvature(self) -> float:
        """Second derivative of the tension of the fastest component [N/m^2]."""
        along, apart = self.basis[:, 0], self.potential.positions[1]
        step = DIFFERENCE * float(np.linalg.norm(apart))
        ends = self._tangents(np.outer([step, -step], along / self.root))
        return float(along @ (ends[0] - ends[1]) @ along / (2 * step))

    def physical(self, rho: Any) -> Any:
        """Differences [m], (N + 1, components), of scaled components (components, N + 1)."""
        return self.reference * (self.basis @ rho).T / self.root

    def tension(self, rho: Any) -> Any:
        return self.rest * rho + self.beyond(rho)

    def beyond(self, rho: Any) -> Any:
        """Scaled tension without its linear part, (components, N + 1)."""
        r = self.physical(rho)
        of, u = self._placed(r)
        scaled = -of.forces(u)[1::2] / self.root - (r * self.root) @ self._stiffness
        return self.basis.T @ scaled.T / self.force

    def slope(self, rho: Any) -> Any:
        """Its derivatives, (components, components, N + 1)."""
        beyond = self._tangents(self.physical(rho)) - self._stiffness
        return np.einsum("ai,nab,bj->ijn", self.basis, beyond, self.basis) / self.secant

    def energy(self, rho: Any) -> Any:
        of, u = self._placed(self.physical(rho))
        return of.bond_energy(u) / (self.reference * self.force)

    def admits(self, rho: Any) -> bool:
        """Whether no bond is turned round."""
        apart = self.potential.positions[1] + self.physical(rho)
        return bool(np.min(apart @ self.potential.positions[1]) > 0)

    def _placed(self, r: Any) -> tuple[Network, Any]:
        """As many bonds as there are rows, apart from each other, and their displacements."""
        if len(r) not in self._bonds:
            positions, ends = np.tile(self.potential.positions, (len(r), 1)), np.arange(2 * len(r))
            self._bonds[len(r)] = Network(
                positions, ends.reshape(-1, 2), self.potential.springs[0],
                lengths=self.potential.lengths[0],
            )  # fmt: skip
        return self._bonds[len(r)], np.stack([0 * r, r], axis=1).reshape(-1, r.shape[1])

    def _tangents(self, r: Any) -> Any:
        (of, u), dim = self._placed(r), r.shape[1]
        whole = of.stiffness(u).tobsr((2 * dim, 2 * dim))
        blocks = np.zeros((len(r), 2 * dim, 2 * dim))
        blocks[whole.indices] = whole.data
        return blocks[:, dim:, dim:] / np.outer(self.root, self.root)


def unit_of(column: Network) -> Network:
    """One bond of a line of equal sites and bonds, from the origin.

    Parameters
    ----------
    column : Network

    Returns
    -------
    Network

    Raises
    ------
    TensegrityError
        Sites, bonds or masses differ, or something else acts on them.
    """
    refuse_heavy_bonds(column, "waves of permanent form")
    n = column.sites
    apart = np.diff(column.positions, axis=0)
    line = np.column_stack([np.arange(n - 1), np.arange(1, n)])
    if n < 2 or not np.array_equal(column.bonds, line):
        raise TensegrityError("a column must have its bonds from each site to the next")
    springs: Any = column.springs
    if column.mass.ndim > 1:  # inner sites share their energy
        springs = [law.shared(1.0, 1.0) for law in springs]
    size = np.abs(apart).max()
    different = {
        "separations": np.abs(apart - apart[0]).max() / size,
        "masses": np.max(np.ptp(column.mass, axis=0) / column.mass[0]),
        "springs": float(any(s != springs[0] for s in springs)),
        "lengths": np.ptp(column.lengths) / size,
    }
    for name, value in different.items():
        if value > EQUAL:
            raise TensegrityError(
                f"{name} of a column with a wave of permanent form must be equal: units of "
                "alternating handedness radiate"
            )
    return Network([0 * apart[0], apart[0]], [[0, 1]], column.springs[0],
                   lengths=column.lengths[0], mass=column.mass[0])  # fmt: skip


def turns(unit: Network) -> bool:
    """Whether a unit from `unit_of` has a coordinate that is not free."""
    law: Any = unit.springs[0]
    return unit.mass.ndim > 1 and not all(law.free)


def refuse_unsuited(unit: Network) -> None:
    """Refuse laws with coordinates that are not free of which waves are not computed."""
    law: Any = unit.springs[0]
    other = [x for x, free in zip(law.coordinates, law.free, strict=True) if not free]
    if len(other) > 1 or len(other) == len(law.free):
        raise TensegrityError(
            f"coordinates {', '.join(other)} of a column with a wave of permanent form are not "
            f"free: {'one may be' if len(other) > 1 else 'another one must be'}"
        )
    turn = law.coordinates.index(other[0])
    ends = AROUND * np.random.default_rng(0).standard_normal((2, 8, law.law.dim))
    back = ends.copy()
    back[0][:, turn], back[1][:, turn] = ends[1][:, turn], ends[0][:, turn]
    one, two = (law.evaluate("pair", *x)[0][:, 0] for x in (ends, back))
    if np.any(np.abs(one - two) > ALIKE * np.abs(one).max()):
        raise TensegrityError(
            f"the energy of a bond must not change when the values of coordinate {other[0]} at its "
            "ends are exchanged, as the wave is even"
        )


def same(unit: Network, other: Network) -> bool:
    """Whether two units from `unit_of` are equal."""
    near = np.abs(unit.positions - other.positions).max() <= EQUAL * np.abs(unit.positions).max()
    equal = unit.springs[0] == other.springs[0] and np.array_equal(unit.mass, other.mass)
    return bool(near and equal and np.array_equal(unit.lengths, other.lengths))


def coupled_profile(law: CoupledLaw, above: float) -> tuple[Profile, float]:
    """The wave of a column, and its residual.

    Parameters
    ----------
    law : CoupledLaw
        Its reference is replaced.
    above : float
        m c^2 over that of the fastest sound, minus 1.

    Returns
    -------
    profile : Profile
    residual : float

    Raises
    ------
    NoWaveError
        None was found at this speed.
    """
    if law.curvature == 0:
        raise NoWaveError("no wave of long ones: the tension of the fastest sound has no curvature")
    profile, factor, power = _long_wave(law, min(above, LONG)), FASTER, 1.0
    while profile.nu < above:
        nu = min(profile.nu * factor, above)
        guess = profile.on(Grid(FIRST_POINTS, half_length(law, nu)))
        guess = replace(guess, rho=guess.rho * (nu / profile.nu) ** power, nu=nu)
        try:
            next_profile = newton(guess, speed_is(nu), ROUGHLY)
            if next_profile.rho[0, 0] < REMAINS * profile.rho[0, 0]:
                raise NoWaveError("no wave found: Newton's method goes to the state of rest")
            power = math.log(next_profile.rho[0, 0] / profile.rho[0, 0]) / math.log(nu / profile.nu)
            profile = next_profile
        except TensegrityError:
            factor = math.sqrt(factor)
            if factor < FASTER ** (0.5**SHORTER):
                ratios = (math.sqrt(1 + x) for x in (above, profile.nu))
                raise NoWaveError(
                    "no wave with a speed ratio of {:.6g} found, which must be at most about "
                    "{:.6g}: there the family ends, or its waves grow too fast".format(*ratios)
                ) from None
    return refined(profile, speed_is(above))


def _long_wave(law: CoupledLaw, nu: float) -> Profile:
    """A wave that starts from the profile of Korteweg and de Vries, at nu or the nearest slower
    speed at which that is close enough."""
    law.reference = 3 * law.secant * nu / law.curvature
    law.force = law.secant * law.reference
    grid = Grid(FIRST_POINTS, half_length(law, nu))
    rho = np.zeros((len(law.basis), grid.points + 1))
    rho[0] = 1 / np.cosh(np.minimum(math.sqrt(3 * nu) * grid.x, 300)) ** 2
    try:
        return newton(Profile(law, grid, rho, nu), speed_is(nu), ROUGHLY)
    except TensegrityError:
        if nu < LEAST:
            raise
        return _long_wave(law, nu / FASTER)
