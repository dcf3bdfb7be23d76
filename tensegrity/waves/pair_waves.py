"""Solitary waves of lines of units, whose equations are in `coupled`: where they begin, and tails.

Waves near the fastest sound have the profile of Korteweg and de Vries, nu rho - spread rho'' =
curvature/(2 secant) A rho^2; from there Newton's method goes on to speeds farther from sound.  They
are faster than sound, or slower if other coordinates make spread negative.

With one coordinate that is not free there are also waves that begin at a finite height (a gap).
Their first guess is the long wave of any height.  V_r(r, q, q) = mu r gives r = R(q), and up to
second derivatives A(q) q'^2/2 = U(q) with U = V(R, q, q) - mu R^2/2 and

    A = (V_ii - 2 V_ij + V_jj)/4 - (V_q(R, q, q))'/4 - mu - mu R'^2/12,

the last term and the second from the means over a site.  A peak is a zero of U, of either sign of
q; U and A have one sign up to there.

Where w(k) = c k has a root k > 0 on a branch of linear waves, a tail of this wave number remains on
both sides, in the lattice of period 2 L with an amplitude that depends on the period.  It is told
from the exponential decay in the last quarter, where the equations are linear.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.root import root
from tensegrity.scenes.network import Network
from tensegrity.waves.by_target import stiffness_above
from tensegrity.waves.cell_profile import FEW, from_sound
from tensegrity.waves.components import CoupledProfile
from tensegrity.waves.cosines import Grid
from tensegrity.waves.coupled import CoupledLaw, unit_of
from tensegrity.waves.family import SIGNS, half_length, refined
from tensegrity.waves.spectrum import dispersion
from tensegrity.waves.travelling import NoWaveError, newton, speed_is

FARTHEST, PLACES = 1e6, 3000  # values at which the peak of a long wave is sought, over the scale
SPREAD = 6.0  # of its profile
POINTS = 600  # of it
LINEAR = 1e-3  # fraction of the peak below which it decays
ITERATIONS, CONVERGED = 20, 1e-9  # of Newton's method for R; last step over R: it is quadratic
REMAINS = 0.3  # of the peak of the long wave: below it, Newton's method goes to rest
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
        several periods of the lattice with the smallest tail.  Of several the one where it is
        largest beside the peak.
    wavenumber : float
        [rad/site], a root of w(k) = c k.
    change : float
        Largest amplitude minus smallest one for these periods, which differ by parts of its wave
        length.
    """

    amplitude: float
    wavenumber: float
    change: float


def line_wave(
    line: Network, mass: Any, family: str | None, name: str, value: float
) -> dict[str, Any]:
    """The wave of a line of units with a given speed.

    Parameters
    ----------
    line : Network
        Of equal units.
    mass : float
        1, as a line has its own.
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
    if mass != 1.0 or name in ("amplitude", "energy"):
        raise TensegrityError(
            f"{name if mass == 1.0 else 'mass'} given: a wave of a line of units is given by its "
            "speed, speed_ratio or excess alone"
        )
    unit = unit_of(line)
    if family not in (None, *SIGNS):
        raise TensegrityError(
            f"family {check.shown(family)} of a column must be 'compression' or 'rarefaction'"
        )
    law = CoupledLaw(unit)
    ratio = _ratio(law, name, value)
    nu = (ratio - 1) * (ratio + 1) if name != "excess" else value * (2 + value)
    law.refuse_uneven()
    reasons = []
    for words, find in _beginnings(law, nu):
        try:
            profile, tail = of_least_tail(find())
        except NoWaveError as error:
            reasons.append(f"{words}{error}")
            continue
        fields = profile.wave() | {"tail": tail}
        if family in (None, fields["family"]):
            excess = value if name == "excess" else ratio - 1
            return fields | {"sound_speed": law.sound_speed, "excess": excess}
        reasons.append(f"{words}the one found is of {fields['family']}")
    reason = "; ".join(reasons) or "the equations of long waves have none"
    others = f" in coordinate {law.named}" if len(law.others) else ""
    raise NoWaveError(
        f"no solitary wave{' of ' + family if family else ''}{others} of a column with "
        f"{name} {value:g}, {ratio:.6g} of sound: {reason}"
    )


def _ratio(law: CoupledLaw, name: str, value: float) -> float:
    """Speed over that of the fastest sound."""
    mass = float(law.potential.mass.flat[0])
    if not len(law.others):
        above = stiffness_above(name, value, law.sound_speed, mass, law.secant)
        return math.sqrt(1 + above / law.secant)
    value = check.number(name, value, above=-1.0 if name == "excess" else 0.0)
    return {"speed": value / law.sound_speed, "speed_ratio": value, "excess": 1 + value}[name]


def _beginnings(law: CoupledLaw, nu: float) -> Iterator[tuple[str, Any]]:
    """Functions that find a wave, the smaller first, with what to say where one fails."""
    if law.curvature == 0:
        raise NoWaveError("no wave of long ones: the tension of the fastest sound has no curvature")
    if nu * law.spread > 0:
        yield "", lambda: refined(from_sound(law, nu, CoupledProfile), speed_is(nu))[0]
    if len(law.others) == 1:
        long = _LongWaves(law, nu)
        with np.errstate(all="ignore"):  # where a long wave is not a number, it ends
            peaks = long.peaks()
        for peak in peaks:
            turn = law.reference * peak / law.root[law.others[0]]
            yield f"near the long wave of peak {turn:.4g}, ", lambda peak=peak: long.wave(peak)


class _LongWaves:
    """Long waves with one coordinate q that is not free, in the unit of the law's scale."""

    def __init__(self, law: CoupledLaw, nu: float) -> None:
        self.law, self.nu, self.mu = law, nu, 1 + nu
        law.reference = law.scale
        self.n = len(law.free)

    def still(self, r: Any, *ends: Any) -> Any:
        """Differences where V_r = mu r, NaN where none is found; (free, n)."""
        n, still = self.n, np.eye(self.n) * self.mu
        for _ in range(ITERATIONS):
            strains = np.concatenate([r, *np.atleast_2d(*ends)])
            wrong = self.law.forces(strains)[:n] - self.mu * r
            bent = self.law.slope(strains)[:, :n, :n] + self.law.at_rest[:n, :n] - still
            step = np.linalg.solve(bent, wrong.T[..., None])[..., 0].T
            r = r - step
            if np.all(np.abs(step) <= CONVERGED * np.abs(r)):
                break
        lost = np.any(np.abs(step) > CONVERGED * (np.abs(r) + 1e-300), axis=0)
        return np.where(lost, np.nan, r)

    def levels(self, q: Any) -> tuple[Any, Any]:
        """U and A at values q, NaN where no R is found."""
        n, r = self.n, self.still(np.zeros((self.n, len(q))), q, q)
        strains = np.concatenate([r, q[None], q[None]])
        bent = self.law.slope(strains) + self.law.at_rest
        both = bent[:, :n, n] + bent[:, :n, n + 1]
        rate = -np.linalg.solve(bent[:, :n, :n] - np.eye(n) * self.mu, both[..., None])[..., 0]
        level = bent[:, n:, n:].sum(axis=(1, 2)) + (both * rate).sum(axis=1)
        apart = (bent[:, n, n] - 2 * bent[:, n, n + 1] + bent[:, n + 1, n + 1]) / 4
        inertia = self.mu * (1 + (rate**2).sum(axis=1) / 12)
        above = self.law.energy(strains) - self.mu / 2 * (r**2).sum(axis=0)
        return above, apart - level / 4 - inertia

    def peaks(self) -> list[float]:
        """Peaks of long waves, the smaller first."""
        found, least = [], abs(float(self.law.follow[0, 0]))
        for sign in (1.0, -1.0):
            q = sign * least * np.geomspace(1, FARTHEST, PLACES)
            above, inertia = self.levels(q)
            ends = np.flatnonzero(~(above * above[0] > 0))
            if len(ends) and ends[0] > 0 and np.isfinite(above[ends[0]]):
                last = int(ends[0])
                if np.all(inertia[:last] * above[0] > 0):
                    places = float(q[last - 1]), float(q[last])
                    found.append(root(lambda x: float(self.levels(np.array([x]))[0][0]), *places))
        return sorted(found, key=abs)

    def profile(self, peak: float, x: Any) -> Any:
        """A long wave at distances x."""
        s = np.linspace(0, SPREAD, POINTS)
        middle = (s[1:] + s[:-1]) / 2
        above, inertia = self.levels(peak / np.cosh(middle) ** 2)
        with np.errstate(all="ignore"):
            step = 2 * abs(peak) / np.cosh(middle) ** 2 * np.tanh(middle)
            step /= np.sqrt(2 * above / inertia)
        step[1 / np.cosh(middle) ** 2 < LINEAR] = 2 / self.law.decay(self.nu)
        at = np.concatenate([[0.0], np.cumsum(step * np.diff(s))])
        return peak / np.cosh(np.interp(np.abs(x), at, s, right=np.inf)) ** 2

    def wave(self, peak: float) -> CoupledProfile:
        """The wave near the long one with this peak."""
        law, length = self.law, half_length(self.law, self.nu)
        law.reference = law.scale
        grid = Grid(2 * FEW, length)
        ends = [self.profile(peak, grid.x + s) for s in (-0.5, 0.5)]
        r = self.still(np.zeros((self.n, len(grid.x))), *ends)
        rho = np.concatenate([law.basis.T @ r, self.profile(peak, grid.x)[None]]) / abs(peak)
        law.reference *= abs(peak)
        if not np.all(np.isfinite(rho)):
            raise NoWaveError("the long wave is not a number everywhere")
        found, _ = refined(CoupledProfile(law, grid, rho, self.nu), speed_is(self.nu))
        if not found.rho[-1, 0] * math.copysign(1, peak) >= REMAINS:
            raise NoWaveError("Newton's method goes to the state of rest")
        return found


def of_least_tail(profile: CoupledProfile) -> tuple[CoupledProfile, Tail | None]:
    """The wave of that of several periods with the smallest tail, and its tail.

    Parameters
    ----------
    profile : CoupledProfile

    Returns
    -------
    profile : CoupledProfile
    tail : Tail or None
        None if it is round-off.

    Raises
    ------
    NoWaveError
        The tail is not small.
    """
    law, grid = profile.law, profile.grid
    waves = _wavenumbers(law, profile.nu, BELOW * grid.wave_numbers[-1]) if len(law.others) else ()
    if not len(waves):
        return profile, None
    parts = _trains(profile, waves) / np.abs(profile.rho[len(law.free) :, :1])
    row, main = np.unravel_index(int(parts.argmax()), parts.shape)
    if parts[row, main] <= ABSENT:
        return profile, None
    found = [(float(_trains(profile, waves)[row, main]), profile)]
    for part in PERIODS:
        length = grid.half_length + part * 2 * math.pi / waves[main]
        longer = Grid(math.ceil(grid.points * length / grid.half_length), length)
        try:
            other = newton(profile.on(longer), speed_is(profile.nu))
        except NoWaveError:
            continue
        found.append((float(_trains(other, waves)[row, main]), other))
    found.sort(key=lambda one: one[0])
    least, best = found[0]
    if least > TOO_MUCH * abs(best.rho[len(law.free) + row, 0]):
        raise NoWaveError("what is found radiates: its tail is not small beside its peak")
    unit = abs(float(law.reference / law.root[law.others[row]]))
    return best, Tail(unit * least, float(waves[main]), unit * (found[-1][0] - least))


def _wavenumbers(law: CoupledLaw, nu: float, largest: float) -> Any:
    """Roots k > 0 of w(k) = c k up to a bound."""
    unit, speed = law.potential, law.sound_speed * math.sqrt(1 + nu)
    laws: Any = unit.springs[0]
    mass = np.asarray(unit.mass)[0]

    def above(k: Any) -> Any:
        return dispersion(laws, mass, k) - speed * np.asarray(k)[:, None]

    top = dispersion(laws, mass, np.linspace(0, math.pi, 65)).max() * 1.01 / speed
    k = np.linspace(FINE, min(largest, top), max(2, math.ceil(min(largest, top) / FINE)))
    gaps, found = above(k), []
    for j, branch in np.argwhere(gaps[1:] * gaps[:-1] < 0).tolist():

        def gap(x: float, branch: int = branch) -> float:
            return float(above([x])[0, branch])

        found.append(root(gap, float(k[j]), float(k[j + 1])))
    return np.sort(found)


def _trains(profile: CoupledProfile, waves: Any) -> Any:
    """Amplitudes of waves of these numbers in the last quarter of the half-period, of each
    coordinate that is not free; (others, waves)."""
    grid, decay = profile.grid, profile.law.decay(profile.nu)
    start = 3 * grid.points // 4
    back = grid.half_length - grid.x[start:]
    fall = np.cosh(decay * back) / math.cosh(decay * back[0])
    columns = np.column_stack([np.cos(np.outer(back, waves)), fall])
    rows = profile.rho[len(profile.law.free) :, start:]
    return np.abs(np.linalg.lstsq(columns, rows.T, rcond=None)[0][:-1]).T
