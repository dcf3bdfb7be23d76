"""Waves of several components on a grid: the equations of `coupled`, as `travelling` solves them.

They are even about their peak, so that values at sites have cosine series too; values at the two
ends of a bond are their mean, even, and minus and plus half their difference, odd.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from tensegrity.errors import TensegrityError
from tensegrity.waves.cosines import Series, cosine_sum
from tensegrity.waves.travelling import LARGEST, Profile

AIM = 4e-14  # defect, as a wave at sites has second derivatives
ROUND_OFF, LARGEST_DEFECT = 10, 1e-8  # defect over that on the own grid, where forces cancel; most
DIFFERENCE = 1e-4  # relative change of the stiffness that makes the scale of elongations
BINADES = 300  # powers of 2 between which that scale is sought [m]
LEAST = 1e-6  # force of a coordinate over the largest of all, by which residuals are divided


def scale_of(along: Callable[[float], Any]) -> float:
    """Elongation at which a stiffness changes by a part `DIFFERENCE`, to a factor of 2.

    A law states no length by which elongations are small.

    Parameters
    ----------
    along : callable (elongation [m]) -> ndarray
        The stiffness over that at rest, which may raise beyond a domain.

    Returns
    -------
    float
        [m]; inf where it never does.
    """

    def changes(exponent: int) -> bool:
        try:
            with np.errstate(all="ignore"):
                change = np.abs(along(2.0**exponent) - 1)
        except TensegrityError:  # beyond a domain
            return True
        return not np.all(change <= DIFFERENCE)

    low, high = -BINADES, BINADES
    if not changes(high):
        return math.inf
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if changes(middle) else (middle, high)
    return 2.0**low


@dataclass(frozen=True)
class CoupledSeries(Series):
    """Of free coordinates the coefficients of du/dx, of others those of their values at sites,
    which are elongations and displacements; the rate is the derivative of either by x."""

    others: Any  # their numbers

    def elongation(self, x: Any) -> Any:
        """Differences of free coordinates about x, values of others; (..., dim)."""
        return self._sum(self._elongations, x)

    def rate(self, x: Any) -> Any:
        """Derivatives of all coordinates by x."""
        found: Any = self._sum(self.rates, x)
        k, inside = self.grid.wave_numbers, np.abs(np.asarray(x)) <= self.grid.half_length
        bent = (self.rates[self.others] * k).T
        slope = -cosine_sum(bent, k, np.where(inside, x, 0.0), np.sin)
        found[..., self.others] = np.where(inside[..., None], slope, 0.0)
        return found

    def displacement(self, x: Any) -> Any:
        """Coordinates, of free ones 0 far ahead."""
        found: Any = Series(self.grid, self.rates).displacement(x)
        found[..., self.others] = self._sum(self.rates[self.others], np.asarray(x))
        return found

    def on_grid(self) -> Any:
        """Elongations and rates at the points of the grid."""
        rates = self.grid.values(self.rates)
        rates[self.others] = self.rate(self.grid.x).T[self.others]
        return self.grid.values(self._elongations), rates

    @property
    def shift(self) -> Any:
        """Displacement of free coordinates far behind, and 0."""
        return np.where(np.isin(np.arange(len(self.rates)), self.others), 0.0, super().shift)

    @cached_property
    def _elongations(self) -> Any:
        whole = np.ones((len(self.rates), 1)) * self.grid.box
        whole[self.others] = 1.0
        return self.rates * whole


class CoupledProfile(Profile):
    """A solution of several components: free ones in the basis of their law, then the others."""

    dense = 3000

    @property
    def mu(self) -> float:
        return 1 + self.nu

    @cached_property
    def _turned(self) -> tuple[Any, Any]:
        half = self.grid.wave_numbers / 2
        return np.cos(half), np.sin(half)

    def strains(self, rho: Any) -> Any:
        """Strains of the bonds at the points of the grid, (strains, N + 1)."""
        (cosine, sine), n = self._turned, len(self.law.free)
        waves = self.grid.coefficients(rho[..., n:, :])
        mean, half = self.grid.values(waves * cosine), self.grid.sines(waves * sine)
        both = self.law.basis @ rho[..., :n, :], mean + half, mean - half
        return np.concatenate(both, axis=-2)

    def pulled(self, forces: Any) -> Any:
        """Cosine coefficients of K f and of the forces on sites, (dim, N + 1)."""
        (cosine, sine), n, grid = self._turned, len(self.law.free), self.grid
        one, other = np.split(forces[..., n:, :], 2, axis=-2)
        along = grid.box**2 * grid.coefficients(self.law.basis.T @ forces[..., :n, :])
        turning = cosine * grid.coefficients(one + other) + sine * grid.sine_coefficients(
            one - other
        )
        return np.concatenate([along, turning], axis=-2)

    @cached_property
    def symbol(self) -> Any:
        free, follow, own = self.law.resistance(self.grid.wave_numbers**2, self.nu)
        first = np.linalg.inv(free)
        last = follow * self.grid.box[:, None, None] ** 2
        across = first @ last.swapaxes(1, 2)
        columns = first, across
        below = -follow @ first, own - follow @ across
        blocks = np.concatenate([np.concatenate(x, axis=2) for x in (columns, below)], axis=1)
        return blocks * np.repeat([1.0, -1.0], [len(self.law.free), len(self.law.others)])

    @property
    def symbol_rate(self) -> Any:
        sizes = len(self.law.free), len(self.law.others)
        inertia = np.repeat([np.ones_like(self.grid.x), self.grid.wave_numbers**2], sizes, axis=0)
        return -self.nu * self.symbol @ (inertia.T[:, :, None] * self.symbol)

    def _convolved(self, symbol: Any, forces: Any) -> Any:
        return self.grid.values(np.einsum("nij,...jn->...in", symbol, self.pulled(forces)))

    def mapped(self) -> Any:
        return self._convolved(self.symbol, self.law.beyond(self.strains(self.rho)))

    def mapped_rate(self) -> Any:
        return self._convolved(self.symbol_rate, self.law.beyond(self.strains(self.rho)))

    def mapped_along(self) -> Any:
        slope, symbol = self.law.slope(self.strains(self.rho)), self.symbol
        return lambda step: self._convolved(
            symbol, np.einsum("nij,...jn->...in", slope, self.strains(step))
        )

    def mapped_matrix(self) -> Any:
        steps = np.eye(self.rho.size).reshape(-1, *self.rho.shape)
        return self.mapped_along()(steps).reshape(len(steps), -1).T

    @property
    def tail(self) -> float:
        """0 where other coordinates have a wave train of their own; see `pair_waves`."""
        return 0.0 if len(self.law.others) else super().tail

    def residual(self) -> float:
        """Largest error of the equations over the largest force of each coordinate, or over LEAST
        of the largest of all where that is more, on a finer grid."""
        fine, n, o = self._fine, len(self.law.free), len(self.law.others)
        force = self.law.forces(fine.strains(fine.rho))
        wrong, k = fine.grid.values(fine.pulled(force)), fine.grid.wave_numbers
        wrong[:n] -= self.mu * fine.rho[:n]
        wrong[n:] -= self.mu * fine.grid.apply(k**2, fine.rho[n:])
        size = np.abs(force).max(axis=1)
        size = np.concatenate([np.full(n, size[:n].max()), size[n:].reshape(2, o).max(axis=0)])
        return float((np.abs(wrong).max(axis=1) / np.maximum(size, LEAST * size.max())).max())

    def admitted(self) -> tuple[float, float]:
        """Those of a chain, or round-off, as it is left on the own grid, and some times it."""
        own = min(float(np.max(np.abs(self.rho - self.mapped()))), LARGEST_DEFECT)
        return max(AIM, own / 2), max(LARGEST, min(ROUND_OFF * own, LARGEST_DEFECT))

    @property
    def peak(self) -> Any:
        """Differences of free coordinates and values of others there, (dim,)."""
        return self.physical(self.rho[:, :1])[:, 0]

    def physical(self, rho: Any) -> Any:
        """Rows of coordinates, in their units and order, of scaled ones."""
        law, found, n = self.law, np.empty_like(rho), len(self.law.free)
        found[law.free], found[law.others] = law.basis @ rho[:n], rho[n:]
        return law.reference * found / law.root[:, None]

    def wave(self) -> dict[str, Any]:
        """What `SolitaryWave` says of it in its units, but for sound and tail."""
        law, grid, n = self.law, self.grid, len(self.law.free)
        strains, mass = self.strains(self.rho), float(self.law.potential.mass.flat[0])
        rates = grid.coefficients(self.rho)
        forced = grid.coefficients(law.basis.T @ law.forces(strains)[:n]) * grid.box / self.mu
        # from the differences, of less error, but where the mean over a site may be 0
        rates[:n] = np.where(np.abs(grid.box) > 0.5, rates[:n] / grid.box, forced)
        moving = np.sum(grid.values(rates[:n]) ** 2, axis=0)
        moving = moving + np.sum(
            self.rho[n:] * grid.apply(grid.wave_numbers**2, self.rho[n:]), axis=0
        )
        energy = grid.weights @ (law.energy(strains) + self.mu / 2 * moving)
        speed, peak = law.sound_speed * math.sqrt(self.mu), self.peak
        shape = CoupledSeries(grid, self.physical(rates), law.others)
        return {
            "potential": law.potential, "mass": mass, "speed": speed, "amplitude": peak,
            "x": np.concatenate([-grid.x[:0:-1], grid.x]), "_shape": shape,
            "family": "compression" if peak[0] < 0 else "rarefaction",
            "energy": float(energy) * law.reference**2 * law.secant,
            "momentum": float(mass * speed * shape.shift[0]), "residual": self.residual(),
        }  # fmt: skip
