"""Waves of a `Cell` on a grid, as `travelling` solves them, and their tails."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from tensegrity.errors import ResolutionError, TensegrityError
from tensegrity.waves.cosines import Grid, cosine_sum
from tensegrity.waves.family import half_length, refined
from tensegrity.waves.travelling import LARGEST, NoWaveError, Profile, newton, speed_is

LONG, FASTER, SHORTER = 0.04, 2.0, 5  # |nu| of a first wave; factor to the next; roots of it
FEW, ROUGHLY = 96, 1e-4  # points, and last Newton step, on the way
SHORTEST, GROWS = 1e-4, 0.9  # least |nu| of a first wave; of the peak, where it would grow
AIM = 4e-14  # defect
WITHIN = 3.0  # largest wave number over that of a resonance
RESOLVED = 0.9  # of the largest wave number, up to which transforms are known
BOXES = 0.75, 0.25  # parts of two further boxes


class CellProfile(Profile):
    """A solution (rho, nu): rows, (rows, N + 1), of which some are odd."""

    dense = 2500

    def _coefficients(self, values: Any) -> Any:
        odd, grid = self.law.odd, self.grid
        found = grid.coefficients(values)
        found[..., odd, :] = grid.sine_coefficients(values[..., odd, :])
        return found

    def _values(self, coefficients: Any) -> Any:
        odd, grid = self.law.odd, self.grid
        found = grid.values(coefficients)
        found[..., odd, :] = grid.sines(coefficients[..., odd, :])
        return found

    @cached_property
    def symbol(self) -> Any:
        return self.law.symbol_on(self.grid, self.nu)

    @property
    def pulled(self) -> Any:
        """Nonlinear forces of rows."""
        return self.law.rows.T @ self.law.beyond(self.law.rows @ self.rho)

    def _convolved(self, forces: Any) -> Any:
        coefficients = self._coefficients(forces)
        return self._values(np.einsum("nij,...jn->...in", self.symbol, coefficients))

    def mapped(self) -> Any:
        return self._convolved(self.pulled)

    def mapped_rate(self) -> Any:
        return np.zeros_like(self.rho)  # waves are given by their speed

    @property
    def _slopes(self) -> Any:
        rows = self.law.rows
        return rows.T @ self.law.slope(rows @ self.rho) @ rows

    def mapped_along(self) -> Any:
        slopes = self._slopes
        return lambda step: self._convolved(np.einsum("nij,...jn->...in", slopes, step))

    def mapped_matrix(self) -> Any:
        slopes, n = self._slopes, self.grid.points + 1
        size = range(len(self.rho))
        between, found = self.law.matrices_on(self.grid, self.nu), np.zeros((self.rho.size,) * 2)
        for i in size:
            for j in size:
                block = found[i * n : (i + 1) * n, j * n : (j + 1) * n]
                for m in size:
                    if slopes[:, m, j].any():
                        block += between[i][m] * slopes[:, m, j]
        return found

    @property
    def tail(self) -> float:
        return 0.0 if self.law.resonances(self.nu) else super().tail

    def residual(self) -> float:
        """max |r - P g| over the peak, on a finer grid."""
        return float(self.defect() / np.abs(self.rho).max())

    def defect(self) -> float:
        return float(np.max(np.abs(self._fine.rho - self._fine.mapped())))

    def on(self, grid: Any) -> CellProfile:
        """The same profile interpolated on another grid."""
        odd, own = self.law.odd, self.grid
        rho = own.moved(self.rho, grid)
        for row in np.flatnonzero(odd):
            waves = own.sine_coefficients(self.rho[row])
            if grid.half_length == own.half_length:
                some = np.zeros(grid.points + 1)
                n = min(own.points, grid.points)
                some[:n] = waves[:n]
                rho[row] = grid.sines(some)
            else:
                waves[[0, -1]] = 0.0
                inside = grid.x <= own.half_length
                rho[row] = 0.0
                rho[row, inside] = cosine_sum(waves, own.wave_numbers, grid.x[inside], np.sin)
        return replace(self, grid=grid, rho=rho)

    def admitted(self) -> tuple[float, float]:
        return AIM, LARGEST


@dataclass(frozen=True)
class Train:
    """The tail of a wave at a resonance: signed amplitude of the symmetric solution on the grid,
    of the coordinate that moves most, in units of A; that over the modal amplitude."""

    amplitude: float
    coordinate: int
    part: float


def train(profile: CellProfile, k: float, branch: int) -> Train:
    """The tail at a resonance, by its residue.

    Parameters
    ----------
    profile : CellProfile
    k, branch : float, int
        Of the resonance.

    Returns
    -------
    Train
    """
    law, grid = profile.law, profile.grid
    shape, rows, slope, _ = law.resonant(k, branch, profile.nu)
    if k > RESOLVED * grid.wave_numbers[-1]:
        return Train(0.0, int(np.abs(shape).argmax()), float(np.abs(shape).max()))
    waves = np.where(law.odd[:, None], np.sin(k * grid.x), np.cos(k * grid.x))
    transform = (profile.pulled * waves) @ grid.weights
    modal = rows.conj() @ transform / slope
    own = np.where(law.mirrored, np.abs(shape), 0.0)
    most = int(np.abs(shape).argmax())
    size = float(np.abs(shape[most]))
    if own.any():
        one = shape[int(own.argmax())] * modal
        sign = math.copysign(1.0, one.real + one.imag)
    else:
        sign = math.copysign(1.0, (rows[np.abs(rows).argmax()] * modal).real)
    return Train(sign * size * float(abs(modal)), most, size)


def least(profile: CellProfile) -> tuple[float, float, Train]:
    """The least amplitude of the tail of waves with this core, in units of A, and its phase.

    The core scatters linear waves, by a phase delta: with the amplitudes a1, a2, a3 in boxes at
    n + 1/2, n + 3/4 and n + 1/4, cos(delta) = least/a1, sin(delta) = least (1/a2 - 1/a3)/2.
    """
    law, nu = profile.law, profile.nu
    k, branch = law.resonances(nu)[0]
    one = train(profile, k, branch)
    if abs(one.amplitude) < 1e-300:
        return 0.0, 0.0, one
    found = [one.amplitude]
    for part in BOXES:
        grid = profile.grid
        length = law.boxed(grid.half_length, nu, part)
        longer = Grid(math.ceil(grid.points * length / grid.half_length), length)
        other = newton(profile.on(longer), speed_is(nu))
        found.append(train(other, k, branch).amplitude)
    with np.errstate(all="ignore"):
        a1, a2, a3 = found
        across = (1 / a2 - 1 / a3) / 2
        size = 1 / math.hypot(1 / a1, across)
    return size, math.atan2(size * across, size / a1), one


def wave_at(law: Any, nu: float, near: CellProfile | None = None) -> tuple[CellProfile, float]:
    """The wave with a speed, and its residual.

    Parameters
    ----------
    law : Cell
    nu : float
        Square of the speed over that of sound, minus 1.
    near : CellProfile, optional
        A wave from which Newton's method converges.

    Returns
    -------
    profile : CellProfile
    residual : float

    Raises
    ------
    NoWaveError
        None is found.
    """
    if near is not None:
        law.reference = near.law.reference
        try:
            grid = Grid(near.grid.points, half_length(law, nu))
            start = replace(near.on(grid), law=law, nu=nu)
            return refined(newton(start, speed_is(nu)), speed_is(nu))
        except (NoWaveError, ResolutionError):
            pass
    if law.curvature == 0:
        raise NoWaveError("no wave of long ones: the tension of the fastest sound has no curvature")
    if nu * law.spread <= 0:
        raise NoWaveError("the equations of long waves have none")
    return refined(from_sound(law, nu, CellProfile), speed_is(nu))


def from_sound(law: Any, goal: float, kind: Any) -> Any:
    """The wave with nu = goal, by way of others nearer to sound.

    Parameters
    ----------
    law : Cell
    goal : float
    kind : type
        Of the profile.

    Returns
    -------
    Profile

    Raises
    ------
    NoWaveError
        None is found.
    """
    sign = math.copysign(1.0, goal)
    profile = near_sound(law, sign * min(abs(goal), LONG), kind)
    factor, power = FASTER, 1.0
    while abs(profile.nu) < abs(goal):
        nu = sign * min(abs(profile.nu) * factor, abs(goal))
        guess = profile.on(_coarse(law, nu))
        guess = replace(guess, rho=guess.rho * (nu / profile.nu) ** power, nu=nu)
        try:
            next_profile = newton(guess, speed_is(nu), ROUGHLY)
            grown = next_profile.rho[0, 0] / profile.rho[0, 0]
            if grown < GROWS:
                raise NoWaveError("no wave found: Newton's method goes to the state of rest")
            power = math.log(grown) / math.log(nu / profile.nu)
            law.reference *= float(next_profile.rho[0, 0])
            profile = replace(next_profile, rho=next_profile.rho / next_profile.rho[0, 0])
        except TensegrityError:
            factor = math.sqrt(factor)
            if factor < FASTER ** (0.5**SHORTER):
                ratios = (math.sqrt(1 + x) for x in (goal, profile.nu))
                raise NoWaveError(
                    "no wave with a speed ratio of {:.6g} found, which must be at {} about {:.6g}: "
                    "there the family ends, or its waves grow too fast".format(
                        next(ratios), "most" if sign > 0 else "least", next(ratios)
                    )
                ) from None
    return profile


def _coarse(law: Any, nu: float) -> Grid:
    """A grid for waves on the way, which resolves the longest resonant wave."""
    length = half_length(law, nu)
    longest = max((k for k, _ in law.resonances(nu)[:1]), default=0.0)
    return Grid(max(FEW, math.ceil(WITHIN * longest * length / math.pi)), length)


def near_sound(law: Any, nu: float, kind: Any) -> Any:
    """A wave that starts from the profile of Korteweg and de Vries, at nu or the nearest speed to
    sound at which that is close enough.

    Parameters
    ----------
    law, nu, kind
        As of `from_sound`.

    Returns
    -------
    Profile

    Raises
    ------
    NoWaveError
        None is found.
    """
    law.reference = 3 * law.secant * nu / law.curvature
    grid = _coarse(law, nu)
    rho = 1 / np.cosh(np.minimum(math.sqrt(nu / law.spread) / 2 * grid.x, 300)) ** 2
    try:
        return newton(kind(law, grid, np.outer(law.long, rho), nu), speed_is(nu), ROUGHLY)
    except TensegrityError:
        if abs(nu) < SHORTEST:
            raise
        return near_sound(law, nu / FASTER, kind)
