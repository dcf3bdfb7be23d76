"""Solitary waves of pair laws with a coordinate that is not free: units that turn on hinges.

A wave has the differences r(x - c t) of free coordinates between neighbours, at the middles of
bonds, and the value q(x - c t) of the other coordinate at sites.  With the energy
V(r(x), q(x - 1/2), q(x + 1/2)) of the bond at x, K the convolution of `travelling`, inertias m, J,

    m c^2 r = K V_r,    J c^2 q'' + V_qi(bond at x + 1/2) + V_qj(bond at x - 1/2) = 0,

where each bond has half of the energies of its sites.  Waves are even about their peak; a grid has
half a site as a whole number of points, and Newton's method the dense derivatives.

The first guess is the long wave.  There V_r(r, q, q) = m c^2 r gives r = R(q), and up to second
derivatives A(q) q'^2/2 = U(q) with U = V(R, q, q) - m c^2 R^2/2 and

    A = (V_ii - 2 V_ij + V_jj)/4 - (V_q(R, q, q))'/4 - J c^2 - m c^2 R'^2/12,

the last term and the second from the means over a site.  A peak is a zero of U, of either sign of
q; U and A have one sign up to there.  Such waves may begin at a finite height (a gap).

Where w(k) = c k has a root k > 0 on a branch of linear waves, a tail of this wave number remains on
both sides, in the lattice of period 2 L with an amplitude that depends on the period.  It is told
from the exponential decay in the last quarter, where the equations are linear.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from tensegrity import check
from tensegrity.errors import ResolutionError, TensegrityError
from tensegrity.root import root
from tensegrity.scenes.network import Network
from tensegrity.waves.cosines import Grid
from tensegrity.waves.coupled import PairSeries, refuse_unsuited
from tensegrity.waves.spectrum import dispersion
from tensegrity.waves.travelling import NoWaveError

NEAREST, FARTHEST, PLACES = 1e-4, 10.0, 2000  # values at which the peak of a long wave is sought
SPREAD, POINTS, LINEAR = (
    6.0,
    600,
    1e-3,
)  # of its profile; fraction of the peak below which it decays
HALVES, ROUGH = (2, 4, 8), 1  # points of half a site until the wave is resolved, and before
WIDE = 2.0  # decay length above which the rough grid is used
MOST = 3600  # unknowns of dense equations
DECAYED = 34.0  # decay lengths of a half-period
ITERATIONS, CONVERGED = 20, 1e-9  # of Newton's method; last step over the peak: it is quadratic
REMAINS = 0.3  # of the peak of the long wave: below it, Newton's method goes to rest
RESIDUAL, LEAST = 1e-12, 1e-6  # largest of a wave on a grid twice as fine as its own
ROUND_OFF, LARGEST_RESIDUAL = 10, 1e-9  # or so many times that on its own grid, where forces cancel
ABSENT, TOO_MUCH = 1e-11, 0.3  # tail over the peak: round-off, and no wave of its own
PERIODS = (0.25, 0.5, 0.75)  # wave lengths of the tail by which the half-period is made longer
FINE = 0.01  # steps of wave numbers between which a branch meets c k once
BELOW = 0.9  # of the largest wave number of the grid, up to which tails are sought


@dataclass(frozen=True)
class Tail:
    """A wave train that a travelling wave has on both sides.

    Attributes
    ----------
    amplitude : float
        Of the coordinate that is not free, in its unit, of the solution that is given: that of
        several periods of the lattice with the smallest tail.
    wavenumber : float
        [rad/site], a root of w(k) = c k.
    change : float
        Largest amplitude minus smallest one for these periods, which differ by parts of its wave
        length.
    """

    amplitude: float
    wavenumber: float
    change: float


class _Lattice:
    """Equations of waves of a column with one speed c [sites/s].

    The unknowns are the rows r of free coordinates, and last that of the other one, number `turn`.
    """

    def __init__(self, unit: Network, speed: float) -> None:
        law: Any = unit.springs[0]
        self.unit, self.speed, self.law = unit, speed, law.shared(0.5, 0.5)
        dim, free = self.law.law.dim, np.array(self.law.free)
        self.turn, self._free = int(np.argmin(free)), np.flatnonzero(free)
        self.order = np.array([*self._free, self.turn])
        self._rows = np.array([*(dim + self._free), self.turn, dim + self.turn])
        mass = np.asarray(unit.mass)[0]
        with np.errstate(over="ignore"):
            self.stiff = (mass * speed * speed)[self.order]
        still = np.zeros((dim, 1))
        self._rest = self.bonds(still[:-1], still[-1], still[-1])
        n = dim - 1
        bent = self._rest[2][0]
        both = bent[:n, n] + bent[:n, n + 1]
        turned = bent[n:, n:].sum()
        if not turned > 0:
            raise TensegrityError(
                f"coordinate {self.name} is not stable at rest: its stiffness is {turned:g}"
            )
        root_mass = np.sqrt(mass[self._free])
        soft = bent[:n, :n] - np.outer(both, both) / turned
        self.sound = math.sqrt(
            max(np.linalg.eigvalsh(soft / np.outer(root_mass, root_mass))[-1], 0)
        )

    @property
    def name(self) -> str:
        """Of the coordinate that is not free."""
        return str(self.law.coordinates[self.turn])

    def bonds(self, r: Any, one: Any, other: Any) -> tuple[Any, Any, Any]:
        """Energies, gradients (n, dim + 1) and tangents by r (dim - 1, n), and the values (n,) of
        the other coordinate at both ends."""
        ends = np.zeros((2, len(one), self.law.law.dim))
        ends[1][:, self._free] = r.T
        ends[0][:, self.turn], ends[1][:, self.turn] = one, other
        found = self.law.evaluate("pair", *ends)
        bent = self.law.tangent(*ends)[:, self._rows[:, None], self._rows]
        return found[0][:, 0], found[1][:, self._rows], bent

    def long_waves(self, q: Any) -> tuple[Any, Any]:
        """U and A at values q, NaN where no R is found."""
        along, n = self.stiff[:-1], len(self.stiff) - 1
        r = np.zeros((n, len(q)))
        for _ in range(ITERATIONS):
            energy, slope, bent = self.bonds(r, q, q)
            step = _solved(bent[:, :n, :n] - np.diag(along), slope[:, :n] - along * r.T).T
            r = r - step
            if np.all(np.abs(step) <= CONVERGED * np.abs(r)):
                break
        energy, slope, bent = self.bonds(r, q, q)
        both = bent[:, :n, n] + bent[:, :n, n + 1]
        rate = -_solved(bent[:, :n, :n] - np.diag(along), both)
        level = bent[:, n:, n:].sum(axis=(1, 2)) + (both * rate).sum(axis=1)
        apart = (bent[:, n, n] - 2 * bent[:, n, n + 1] + bent[:, n + 1, n + 1]) / 4
        inertia = self.stiff[-1] + (along * rate**2).sum(axis=1) / 12
        above = energy - self._rest[0] - (along * r.T**2).sum(axis=1) / 2
        lost = np.any(np.abs(step) > CONVERGED * (np.abs(r) + 1e-300), axis=0)
        return np.where(lost, np.nan, above), apart - level / 4 - inertia

    def peaks(self) -> list[float]:
        """Peaks of long waves, the smaller first."""
        found = []
        for sign in (1.0, -1.0):
            q = sign * np.geomspace(NEAREST, FARTHEST, PLACES)
            above, inertia = self.long_waves(q)
            ends = np.flatnonzero(~(above * above[0] > 0))
            if len(ends) and ends[0] > 0 and np.isfinite(above[ends[0]]):
                last = int(ends[0])
                if np.all(inertia[:last] * above[0] > 0):
                    places = float(q[last - 1]), float(q[last])
                    found.append(
                        root(lambda x: float(self.long_waves(np.array([x]))[0][0]), *places)
                    )
        return sorted(found, key=abs)

    def profile(self, peak: float, x: Any) -> Any:
        """A long wave at distances x >= 0."""
        s = np.linspace(0, SPREAD, POINTS)
        middle = (s[1:] + s[:-1]) / 2
        above, inertia = self.long_waves(peak / np.cosh(middle) ** 2)
        with np.errstate(all="ignore"):
            step = 2 * abs(peak) / np.cosh(middle) ** 2 * np.tanh(middle)
            step /= np.sqrt(2 * above / inertia)
        far = 1 / np.cosh(middle) ** 2 < LINEAR
        step[far] = 2 / self.decay
        at = np.concatenate([[0.0], np.cumsum(step * np.diff(s))])
        return peak / np.cosh(np.interp(x, at, s, right=np.inf)) ** 2

    @cached_property
    def decay(self) -> float:
        """Decay [1/site] of small waves far from the peak."""
        q = np.array([NEAREST, NEAREST / 10])
        above, inertia = self.long_waves(q)
        about = math.sqrt(max(2 * above[0] / inertia[0], 0.0)) / NEAREST

        dim, still = self.law.law.dim, np.zeros((1, self.law.law.dim))
        bent, heavy = self.law.tangent(still, still)[0], np.diag(np.asarray(self.unit.mass)[0])
        own, next_site = bent[:dim, :dim] + bent[dim:, dim:], bent[:dim, dim:]

        def singular(k: float) -> float:
            moved = next_site * math.exp(-k) + next_site.T * math.exp(k)
            return float(np.linalg.det(own + moved + (self.speed * k) ** 2 * heavy))

        places = about / 2, 2 * about
        return root(singular, *places) if np.prod([*map(singular, places)]) < 0 else about

    def equations(self, values: Any, grid: Grid, half: int) -> tuple[Any, Any, Any]:
        """What remains of the equations at values (dim, N + 1), and gradients and tangents of bonds
        at the places from -1/2 to L + 1/2."""
        r, q, n = values[:-1], values[-1], grid.points
        places = np.arange(-half, n + half + 1)
        _, slope, bent = self.bonds(
            r[:, _folded(places, n)], q[_folded(places - half, n)], q[_folded(places + half, n)]
        )
        force = slope[half : half + n + 1, :-2].T
        turning = slope[2 * half :, -2] + slope[: n + 1, -1]
        wrong = np.empty_like(values)
        wrong[:-1] = self.stiff[:-1, None] * r - grid.smooth(force)
        wrong[-1] = self.stiff[-1] * grid.apply(-(grid.wave_numbers**2), q) + turning
        return wrong, slope, bent

    def tangent(self, bent: Any, grid: Grid, half: int) -> Any:
        """Derivatives of the equations by the values, from the tangents of bonds."""
        n, dim = grid.points, len(self.stiff)
        each, smooth = np.arange(n + 1), grid.matrix(grid.box**2)
        whole = np.zeros((dim, n + 1, dim, n + 1))
        for k in range(dim - 1):
            local = np.zeros((n + 1, dim, n + 1))
            self._enter(local, bent[half : half + n + 1, k], each, half)
            whole[k] = -(smooth @ local.reshape(n + 1, -1)).reshape(local.shape)
            whole[k, each, k, each] += self.stiff[k]
        self._enter(whole[-1], bent[2 * half :, -2], each + half, half)
        self._enter(whole[-1], bent[: n + 1, -1], each - half, half)
        whole[-1, :, -1] += self.stiff[-1] * grid.matrix(-(grid.wave_numbers**2))
        return whole.reshape(dim * (n + 1), -1)

    def _enter(self, rows: Any, by: Any, at: Any, half: int) -> None:
        """Add derivatives (N + 1, dim + 1) of quantities of the bonds at these places to rows."""
        n, last = rows.shape[0] - 1, rows.shape[1] - 1
        columns = [*((k, at) for k in range(last)), (last, at - half), (last, at + half)]
        for number, (k, places) in enumerate(columns):
            np.add.at(rows, (np.arange(n + 1), k, _folded(places, n)), by[:, number])

    def solved(self, values: Any, grid: Grid, half: int) -> Any:
        """The wave near these values by Newton's method."""
        for _ in range(ITERATIONS):
            wrong, _, bent = self.equations(values, grid, half)
            if not np.all(np.isfinite(wrong)):
                break
            step = _solved(self.tangent(bent, grid, half), wrong.ravel())
            values = values - step.reshape(values.shape)
            if np.abs(step).max() <= CONVERGED * np.abs(values).max():
                return values
        raise NoWaveError("Newton's method does not converge")

    def wave(self, peak: float) -> tuple[Any, Grid, int]:
        """The wave near the long one with this peak: values, grid and points of half a site."""
        half = HALVES[0]
        length = math.ceil(DECAYED / self.decay)
        if len(self.stiff) * (2 * half * length + 1) > MOST:
            raise ResolutionError(
                f"a wave with speed {self.speed:.6g} decays by e in {1 / self.decay:.4g} sites, "
                f"which takes more than {MOST} unknowns: choose a speed farther from that of sound"
            )
        grid = Grid(2 * half * length, float(length))
        values = self._guess(peak, grid, half)
        for half in (ROUGH, *HALVES) if self.decay * WIDE < 1 else HALVES:
            finer = Grid(2 * half * length, float(length))
            if len(self.stiff) * (finer.points + 1) > MOST:
                break
            values, grid = self.solved(grid.moved(values, finer), finer, half), finer
            if not values[-1, 0] / peak >= REMAINS:
                raise NoWaveError("Newton's method goes to the state of rest")
            if half == ROUGH:
                continue
            residual = self.residual_between(values, grid, half)
            round_off = self.residual(values, grid, half)  # what the collocation leaves
            if residual <= max(RESIDUAL, min(ROUND_OFF * round_off, LARGEST_RESIDUAL)):
                return values, grid, half
        raise ResolutionError(
            f"the wave with speed {self.speed:.6g} is not resolved: its residual {residual:.1e} "
            f"must be at most {RESIDUAL:g} or round-off"
        )

    def _guess(self, peak: float, grid: Grid, half: int) -> Any:
        q, n = self.profile(peak, grid.x), grid.points
        r = np.zeros((len(self.stiff) - 1, n + 1))
        at = np.arange(n + 1)
        ends = q[_folded(at - half, n)], q[_folded(at + half, n)]
        for _ in range(ITERATIONS):
            _, slope, bent = self.bonds(r, *ends)
            stiff = bent[:, :-2, :-2] - np.diag(self.stiff[:-1])
            r = r - _solved(stiff, slope[:, :-2] - self.stiff[:-1] * r.T).T
        return np.concatenate([r, q[None]])

    def residual(self, values: Any, grid: Grid, half: int) -> float:
        """Largest error of the equations over the largest force of each coordinate, or over LEAST
        of the largest of all where that is more."""
        wrong, slope, _ = self.equations(values, grid, half)
        force = np.abs(slope).max(axis=0)
        force = np.maximum([*force[:-2], force[-2:].max()], LEAST * force.max())
        return float((np.abs(wrong).max(axis=1) / force).max())

    def residual_between(self, values: Any, grid: Grid, half: int) -> float:
        """The same on a grid twice as fine."""
        fine = Grid(2 * grid.points, grid.half_length)
        return self.residual(grid.moved(values, fine), fine, 2 * half)

    def wavenumbers(self, largest: float) -> Any:
        """Roots k > 0 of w(k) = c k up to a bound."""
        laws, mass = self.unit.springs[0], np.asarray(self.unit.mass)[0]

        def above(k: Any) -> Any:
            return dispersion(laws, mass, k) - self.speed * np.asarray(k)[:, None]

        top = dispersion(laws, mass, np.linspace(0, math.pi, 65)).max() * 1.01 / self.speed
        k = np.linspace(FINE, min(largest, top), max(2, math.ceil(min(largest, top) / FINE)))
        gaps, found = above(k), []
        for j, branch in np.argwhere(gaps[1:] * gaps[:-1] < 0).tolist():

            def gap(x: float, branch: int = branch) -> float:
                return float(above([x])[0, branch])

            found.append(root(gap, float(k[j]), float(k[j + 1])))
        return np.sort(found)

    def trains(self, values: Any, grid: Grid, waves: Any) -> Any:
        """Amplitudes of waves of these numbers in the last quarter of the half-period."""
        start = 3 * grid.points // 4
        back = grid.half_length - grid.x[start:]
        fall = np.cosh(self.decay * back) / math.cosh(self.decay * back[0])
        columns = np.column_stack([np.cos(np.outer(back, waves)), fall])
        return np.abs(np.linalg.lstsq(columns, values[-1, start:], rcond=None)[0][:-1])

    def of_least_tail(self, values: Any, grid: Grid, half: int) -> tuple[Any, Grid, Tail | None]:
        """The wave of that of several periods with the smallest tail, None if that is round-off."""
        waves = self.wavenumbers(BELOW * math.pi * 2 * half)
        if not len(waves):
            return values, grid, None
        size = self.trains(values, grid, waves)
        main, peak = int(size.argmax()), abs(values[-1, 0])
        if size[main] <= ABSENT * peak:
            return values, grid, None
        found = [(float(size[main]), values, grid)]
        for part in PERIODS:
            points = grid.points + max(1, round(part * 4 * math.pi / waves[main] * half))
            longer = Grid(points, points / (2 * half))
            try:
                other = self.solved(grid.moved(values, longer), longer, half)
            except NoWaveError:
                continue
            found.append((float(self.trains(other, longer, waves)[main]), other, longer))
        found.sort(key=lambda one: one[0])
        least, values, grid = found[0]
        if least > TOO_MUCH * peak:
            raise NoWaveError("what is found radiates: its tail is not small beside its peak")
        return values, grid, Tail(least, float(waves[main]), found[-1][0] - least)


def _folded(places: Any, n: int) -> Any:
    """Numbers 0 .. N of places of an even function of period 2 N."""
    return n - np.abs(n - np.abs(places))


def _solved(blocks: Any, right: Any) -> Any:
    try:
        return np.linalg.solve(blocks, right[..., None])[..., 0]
    except np.linalg.LinAlgError:
        raise NoWaveError("the equations are singular at this speed") from None


def pair_wave(unit: Network, family: str | None, name: str, value: float) -> dict[str, Any]:
    """The wave of a column with a coordinate that is not free.

    Parameters
    ----------
    unit : Network
        From `coupled.unit_of`.
    family : {"compression", "rarefaction"}, optional
        By the sign of the first coordinate at the peak; by default that of the smaller peak.
    name : {"speed", "speed_ratio", "excess"}
        Others are refused.
    value : float

    Returns
    -------
    dict
        Fields of `SolitaryWave`.

    Raises
    ------
    TensegrityError
        The law is not suited, or no wave is found.
    """
    if name in ("amplitude", "energy"):
        raise TensegrityError(
            f"{name} given: a wave of a line of units is given by its speed, speed_ratio or excess"
        )
    value = check.number(name, value, above=-1.0 if name == "excess" else 0.0)
    if family not in (None, "compression", "rarefaction"):
        raise TensegrityError(
            f"family {check.shown(family)} of a column must be 'compression' or 'rarefaction'"
        )
    refuse_unsuited(unit)
    sound = _Lattice(unit, 1.0).sound
    if not sound:
        raise TensegrityError("the column has no sound: its stiffness against slow changes is 0")
    speed = {"speed": value, "speed_ratio": value * sound, "excess": (1 + value) * sound}[name]
    lattice = _Lattice(unit, speed)
    reasons = []
    with np.errstate(all="ignore"):  # where a long wave is not a number, it ends
        peaks = lattice.peaks()
    for peak in peaks:
        try:
            values, grid, half = lattice.wave(peak)
            values, grid, tail = lattice.of_least_tail(values, grid, half)
        except NoWaveError as error:
            reasons.append(f"near the long wave of peak {peak:.4g}, {error}")
            continue
        fields = _fields(lattice, values, grid, half) | {"tail": tail}
        if family in (None, fields["family"]):
            excess = value if name == "excess" else speed / sound - 1
            return fields | {"sound_speed": sound, "excess": excess}
        reasons.append(f"the one of peak {peak:.4g} is of {fields['family']}")
    reason = "; ".join(reasons) or "the equations of long waves have none"
    raise NoWaveError(
        f"no solitary wave{' of ' + family if family else ''} in coordinate {lattice.name} of a "
        f"column with {name} {value:g}, {speed / sound:.6g} of sound: {reason}"
    )


def _fields(lattice: _Lattice, values: Any, grid: Grid, half: int) -> dict[str, Any]:
    """Fields of the wave but its tail and what is relative to sound."""
    n, k = grid.points, grid.wave_numbers
    at = np.arange(n + 1)
    r, q = values[:-1], values[-1]
    energy, slope, _ = lattice.bonds(r, q[_folded(at - half, n)], q[_folded(at + half, n)])
    inverse = np.argsort(lattice.order)
    rates = np.empty_like(values)
    rates[:-1] = grid.box * grid.coefficients(slope[:, :-2].T) / lattice.stiff[:-1, None]
    rates[-1] = grid.coefficients(q)
    moving = (lattice.stiff[:-1, None] * grid.values(rates[:-1]) ** 2).sum(axis=0)
    turned = grid.values(k**2 * rates[-1])  # -q'': q'^2 by parts
    moving = moving + lattice.stiff[-1] * q * turned
    shape = PairSeries(grid, rates[inverse], lattice.turn)
    amplitude = float(values[inverse][0, 0])
    mass = float(np.asarray(lattice.unit.mass)[0, 0])
    return {
        "potential": lattice.unit, "mass": mass, "x": np.concatenate([-grid.x[:0:-1], grid.x]),
        "speed": lattice.speed, "amplitude": amplitude,
        "family": "compression" if amplitude < 0 else "rarefaction",
        "energy": float(grid.weights @ (energy - lattice._rest[0] + moving / 2)),
        "momentum": float(mass * lattice.speed * shape.shift[0]),
        "residual": lattice.residual_between(values, grid, half), "_shape": shape,
    }  # fmt: skip
