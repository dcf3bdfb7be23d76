"""Pulses of a chain at one recorded instant: their positions, amplitudes and directions.

A wave of a chain is known at sites and bonds only, and its peak lies between them.  It is recovered
from the exact solitary wave of the same springs and masses that has the energy of the pulse; its
position is a least-squares fit to elongations and velocities over the width of that wave.  If no
wave fits, the chain is advanced until the peak has passed the next bonds, which gives its speed c,
and the displacement between two sites is the polynomial of fifth degree with the displacements,
slopes -v/c and curvatures a/c^2 at both, as of a wave that travels at that speed.  Energy flows
through a bond at the rate -T v, where T is its tension and v the mean velocity of its two sites;
the direction of a pulse is that of its energy flow.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from tensegrity import check
from tensegrity.checked import checked
from tensegrity.errors import TensegrityError
from tensegrity.measure.peaks import peak_bonds, sites_around
from tensegrity.notebook import progress
from tensegrity.printing import printed
from tensegrity.runs.integrate import simulate
from tensegrity.runs.record import require_all_sites
from tensegrity.runs.run import Run
from tensegrity.scenes.chain import Chain, refuse_ring
from tensegrity.scenes.dynamics import dynamics, varied
from tensegrity.scenes.scene import State
from tensegrity.typing import Array, FractionOrOne
from tensegrity.waves.family import Family
from tensegrity.waves.solitary import SolitaryWave, solitary_wave

FRACTION = 0.1  # of the largest elongation, from which a peak counts
ROUND_OFF = 64 * np.finfo(float).eps  # of the largest displacement: elongations below are 0
NEIGHBOURS = 8  # bonds on either side of a peak, through which its shape is interpolated
ONE_WAY = 0.9  # of the flow either way: a larger sum is that of a wave that travels
STANDING = 1e-6  # of the flow either way: a smaller sum has no direction
SLOW = 0.5  # of the sound speed: what is slower is no wave that travels
RANGE = 4.0  # sites that the slowest peak may travel while it passes the next three bonds
SAME_PLACE = 0.75  # sites from a bond within which a peak is that makes it the largest one
ALTERED, UNSTEADY = 0.2, 0.01  # of height and speed, by which a peak changes on that way at most
AGREED = 5e-3  # relative, of the speeds of form and peak, of which that of the form is then given
DRIVEN = 8  # sites from a driven one, within which a peak feels it before it has passed
MISFIT = 0.05  # of its largest elongation, velocity or speed, by which a wave may differ
RIPPLING = 0.01  # of a wave's speed, by which ripples may change it
LEVEL = 0.05  # of the peak, between which a wave has the width over which it is compared
DEGREE = 5  # of splines
SEEN = 16  # states whose pulses are kept


@dataclass(frozen=True, eq=False)
class Pulse:
    """A pulse at one instant; `pulses` finds it.

    Attributes
    ----------
    place : float
        Position of its peak [sites]: site j is at j, bond j is centred at j + 1/2.
    amplitude : float
        Elongation at the peak of the continuous wave [m], extension > 0.
    direction : int
        1 towards higher sites, -1 towards lower ones; 0 if there is no net flow of energy, as
        when two equal waves collide.
    speed : float or None
        [sites/s], >= 0: that of `wave` or, without one, that at which the peak moves on, to 0.5 %:
        from the next bond to the one after it, as the chain is advanced from this instant, or of a
        pulse of permanent form |momentum| over mass times total elongation.  0 without a direction.
        None where it was not measured: energy flows both ways, the peak changes too much on this
        way, or is near an end of the chain or a driven site.
    energy : float
        Energy of its sites [J].
    momentum : float
        Momentum of its sites [kg m/s], > 0 towards higher sites.
    first, last : int
        First and last site, where the elongation stops decreasing or changes its sign.
    wave : SolitaryWave or None
        The exact wave that agrees with it, over its width at 5 % of the peak, within 5 % of the
        largest elongation and of the largest velocity.
    """

    place: float
    amplitude: float
    direction: int
    speed: float | None
    energy: float
    momentum: float
    first: int
    last: int
    wave: SolitaryWave | None = field(repr=False)

    __str__ = printed(place="sites", amplitude="m", speed="sites/s", energy="J", momentum="kg m/s")
    __repr__ = __str__


@checked
def pulses(run: Run, row: int = -1, fraction: FractionOrOne = FRACTION) -> list[Pulse]:
    """Pulses of a chain at a recorded instant, in the order of their places.

    Parameters
    ----------
    run : Run
        Of a `Chain`, with all sites recorded; elongations count from its state at rest.
    row : int, optional
        Index of the recorded instant; negative indices count from the last one.
    fraction : float, optional
        Fraction of the largest |elongation| above which a peak counts, above 0, at most 1.

    Returns
    -------
    list of Pulse
        Empty if no bond is deformed beyond round-off.  Two peaks are one pulse if the elongation
        between them falls by less than a quarter of the lower one.

    Raises
    ------
    TensegrityError
        A scene that is not a chain, or one whose springs change in time; a site that was not
        recorded; no such row.

    Notes
    -----
    A solitary wave is located as accurately as the run resolves it: one launched at any position,
    to 1e-7 sites and to 1e-7 of its amplitude.  Other travelling pulses are interpolated through
    displacements, velocities and accelerations at their sites: to 1e-3 sites and 3e-4 of the
    amplitude at a width of 3 sites at half height, to 1e-2 sites and 2e-2 at 1.3 sites.  A pulse
    that does not travel is interpolated through its elongations alone, by a spline of degree 5.

    Overlapping pulses are divided at the smallest elongation between them.  While two waves
    collide there is one pulse, which is neither of them.  A pulse whose width reaches an end of the
    chain, or another spring or mass, has no `wave`.

    Examples
    --------
    >>> from tensegrity import Chain, Prism, pulses, simulate, solitary_wave
    >>> spring = Prism(base=1.0, height=0.7, prestrain=0.01, k_cross=1.0).potential()
    >>> wave, chain = solitary_wave(spring, speed_ratio=2.0), Chain(spring, 120)
    >>> run = simulate(chain, wave.launch(chain, at=40.25), 30 / wave.speed, tol=1e-8)
    >>> (pulse,) = pulses(run)
    >>> f"{pulse.place:.3f}", pulse.direction, round(pulse.amplitude / wave.amplitude, 5)
    ('70.250', 1, 1.0)
    """
    chain, row = chain_of(run), check_row(run, row)
    state = (x[row].tobytes() for x in (run.u, run.v))
    return list(_found(chain, *state, fraction))


@lru_cache(maxsize=SEEN)
def _found(chain: Chain, u: bytes, v: bytes, fraction: float) -> tuple[Pulse, ...]:
    """Pulses of a state, which other quantities of the same row need too."""
    state = State(np.frombuffer(u), np.frombuffer(v))
    return tuple(Instant(chain, state).pulses(fraction))


def chain_of(run: Run) -> Chain:
    """The chain of a run of which all sites were recorded."""
    check.kind("run", run, Run)
    chain = run.scene
    if not isinstance(chain, Chain):
        raise TensegrityError(
            f"the scene of the run is {type(chain).__name__}, must be a Chain: pulses run along "
            "bonds in a row"
        )
    refuse_ring(chain, "pulses")
    if dynamics(chain).springs.changing:
        raise TensegrityError("the springs change in time: pulses require constant ones")
    require_all_sites(run)
    return chain


def check_row(run: Run, row: int) -> int:
    """The number of a recorded instant, from the last one if negative."""
    return check.whole("row", row, least=-len(run.t), below=len(run.t))


class Instant:
    """A chain in one state, and its pulses; elongations below `least` [m] are neglected."""

    def __init__(self, chain: Chain, state: State, least: float = 0.0) -> None:
        self.chain, self.u, self.v = chain, state.u, state.v
        self.r = chain.elongation(state.u)
        self.least = max(least, ROUND_OFF * float(np.abs(state.u).max()))
        self.site_energy = chain.site_energy(state)
        self.tension = chain.bond_tension(state.u)
        self._runs: dict[int, Run | None] = {}

    def pulses(self, fraction: float, first: int = 0, last: int | None = None) -> list[Pulse]:
        """Pulses whose peaks lie in a range of bonds.

        Parameters
        ----------
        fraction : float
            Of the largest |elongation| in the range, from which a peak counts.
        first : int, optional
        last : int, optional
            Range of bonds, from `first` up to but without `last`; by default all.

        Returns
        -------
        list of Pulse
            In the order of their positions.
        """
        peaks = peak_bonds(self.r[first:last], fraction, self.least)
        found = []
        with progress(len(peaks), "pulse") as bar:
            for peak in peaks:
                found.append(self.pulse(first + peak))
                bar.update()
        return found

    def pulse(self, peak: int) -> Pulse:
        """The pulse with a peak at a bond."""
        first, last = sites_around(self.r, peak)
        inside, bonds, direction = slice(first, last + 1), slice(max(first - 1, 0), last + 1), 0
        momentum = float((self.chain.mass * self.v)[inside].sum())
        mean = (self.v[:-1] + self.v[1:])[bonds] / 2
        flows = -self.tension[bonds] * mean
        through, either = float(flows.sum()), float(np.abs(flows).sum())
        if abs(through) > STANDING * either:
            direction = int(np.sign(through))
        one_way = abs(through) >= ONE_WAY * either and 0 < peak < len(self.r) - 1
        permanent = abs(float(mean.sum() / self.r[bonds].sum()))  # speed, were its form permanent
        sound = self._sound_speed(peak)
        travels = direction != 0 and one_way and permanent > SLOW * sound
        speed = None if direction else 0.0
        if travels:
            speed = self._moving(peak, direction, permanent)
        slope = speed if speed and permanent < sound else permanent
        place, amplitude = self._interpolated(peak, direction * slope if travels else 0.0)
        energy, wave = float(self.site_energy[inside].sum()), None
        if travels:
            try:
                self._refuse_other_speed(peak, speed or permanent, permanent, amplitude)
                wave, place = self._fitted(peak, direction, energy)
                amplitude, speed = wave.amplitude, wave.speed
            except TensegrityError:  # none fits
                wave = None
        return Pulse(place, amplitude, direction, speed, energy, momentum, first, last, wave)

    def _sound_speed(self, peak: int) -> float:
        return self.chain.springs[peak].sound_speed(float(self.chain.mass[peak]))

    def _moving(self, peak: int, direction: int, permanent: float) -> float | None:
        """Speed from the next bond to the one after it [sites/s]; None where it is not measured."""
        slowest = min(permanent, self._sound_speed(peak) or permanent)
        bonds = [peak + step * direction for step in (1, 2, 3)]
        felt = any(abs(site - peak) <= DRIVEN for site in self.chain.drive)
        run = None if felt else self._ahead(math.ceil(math.log2(RANGE / slowest)))
        if run is None or not 0 <= bonds[-1] < len(self.r):
            return None
        passages = [(0.0, 0.0)]
        for bond in bonds:
            passages.append(_passage(run, bond, np.sign(self.r[peak]), passages[-1][0]))
        (_, first, second, third), (_, *heights) = zip(*passages, strict=True)
        if not third < math.inf or min(heights) < (1 - ALTERED) * max(heights):
            return None
        slowness, later = second - first, third - second  # 1.5 and 2.5 bonds from here
        speed = 1 / (slowness - 1.5 * (later - slowness))
        if abs(later / slowness - 1) > UNSTEADY or abs(speed * first - 1) > SAME_PLACE:
            return None
        return permanent if abs(permanent / speed - 1) < AGREED else speed

    def _ahead(self, octave: int) -> Run | None:
        """The chain 2**octave seconds on, without its drives; None where it gets to no end."""
        if octave not in self._runs:
            try:
                chain, state = varied(self.chain, drive={}), State(self.u, self.v)
                changes = any(one.law.varies for one in dynamics(chain).acting.forces)
                self._runs[octave] = None if changes else simulate(chain, state, 2.0**octave)
            except TensegrityError:
                self._runs[octave] = None
        return self._runs[octave]

    def _interpolated(self, peak: int, velocity: float) -> tuple[float, float]:
        """Place and value of the extremum next to a bond.

        In a wave that travels u' is -v/c and u'' the acceleration over c^2; where it does not
        (velocity c = 0), the elongations alone are interpolated.
        """
        from scipy.interpolate import BPoly, make_interp_spline
        from scipy.optimize import minimize_scalar

        sign, near = np.sign(self.r[peak]), slice(max(peak - NEIGHBOURS, 0), peak + NEIGHBOURS + 2)
        if velocity:
            turning = self.chain.forces(self.u) / self.chain.mass
            given = self.u, -self.v / velocity, turning / velocity**2
            shape = BPoly.from_derivatives(
                np.arange(self.chain.sites)[near], np.stack([x[near] for x in given], axis=1)
            )

            def elongation(x: float) -> float:
                return float(shape(x + 0.5) - shape(x - 0.5))

        elif 0 < peak < len(self.r) - 1 and len(self.r[near]) > DEGREE:
            bonds = np.arange(len(self.r))[near]
            spline = make_interp_spline(bonds + 0.5, self.r[near], DEGREE)

            def elongation(x: float) -> float:
                return float(spline(x))

        else:
            return peak + 0.5, float(self.r[peak])
        bounds = max(peak - 0.25, near.start + 0.5), min(peak + 1.25, self.chain.sites - 1.5)
        extreme = minimize_scalar(
            lambda x: -sign * elongation(x), bounds=bounds, method="bounded",
            options={"xatol": 1e-9},
        )  # fmt: skip
        return float(extreme.x), float(-sign * extreme.fun)

    def _refuse_other_speed(
        self, peak: int, speed: float, permanent: float, amplitude: float
    ) -> None:
        """Refuse what does not move as a solitary wave does: at the speed of its form, from that
        of sound up to sqrt(|V'(a)|/(m a)), as m c^2 a is a mean of |V'| over the wave."""
        secant = float(self.chain.springs[peak].tension(amplitude)) / amplitude
        fastest = math.sqrt(secant / float(self.chain.mass[peak]))
        low, high = (1 - RIPPLING) * self._sound_speed(peak), (1 + RIPPLING) * fastest
        same = abs(permanent / speed - 1) < MISFIT
        if not (same and low < min(speed, permanent) and max(speed, permanent) < high):
            raise TensegrityError(
                f"speed {speed:g} sites/s of the pulse must be that of its form, {permanent:g}, "
                f"and from {low:g} to {high:g}"
            )

    def _fitted(self, peak: int, direction: int, energy: float) -> tuple[SolitaryWave, float]:
        """The exact wave that fits a pulse and the place of its peak; an error where none does."""
        from scipy.optimize import least_squares

        spring, mass = self.chain.springs[peak], float(self.chain.mass[peak])
        side = Family(spring, 1 if self.r[peak] > 0 else -1)
        name = side.holding("amplitude", abs(float(self.r[peak]))).name
        wave = solitary_wave(spring, mass, energy=energy, family=name)
        gaps = self._gaps(wave, peak, direction)
        fit = least_squares(
            lambda place: gaps(place[0]), peak + 0.5, xtol=1e-14, ftol=1e-14, gtol=1e-14
        )
        misfit = float(np.abs(fit.fun).max())
        if misfit > MISFIT:
            raise TensegrityError(f"misfit {misfit:g} of the wave must be at most {MISFIT:g}")
        return wave, float(fit.x[0])

    def _gaps(self, wave: SolitaryWave, peak: int, direction: int) -> Callable[[float], Array]:
        """Differences from a wave with its peak at a place, over its largest values."""
        half = max(wave.width(LEVEL) / 2, 1.0)
        if peak - half < 0 or peak + half > self.chain.sites - 2:  # it may be 1e9 sites wide
            raise TensegrityError(f"the wave at bond {peak} is cut by an end of the chain")
        bonds = np.arange(math.ceil(peak - half), math.floor(peak + half) + 1)
        sites = np.append(bonds, bonds[-1] + 1)
        if any(self.chain.springs[bond] != wave.potential for bond in bonds.tolist()) or np.any(
            self.chain.mass[sites] != wave.mass
        ):
            raise TensegrityError(f"springs or masses around bond {peak} differ")
        fastest = wave.speed * abs(float(wave.rate(0.0)))

        def gaps(place: float) -> Array:
            r = wave.elongation(bonds + 0.5 - place)
            v = -direction * wave.speed * wave.rate(sites - place)
            return np.concatenate(
                [(r - self.r[bonds]) / abs(wave.amplitude), (v - self.v[sites]) / fastest]
            )

        return gaps


def _passage(run: Run, bond: int, sign: float, after: float) -> tuple[float, float]:
    """Instant at which the next peak of a sign passes a bond, inf if none does, and its height."""
    from scipy.interpolate import PPoly, make_interp_spline

    r, rate = (sign * (x[:, bond + 1] - x[:, bond]) for x in (run.u, run.v))
    curve = PPoly.from_spline(make_interp_spline(run.t, rate, DEGREE))
    zeros = curve.roots(extrapolate=False)
    at = min(zeros[(zeros > after) & (curve(zeros, 1) < 0)].tolist(), default=math.inf)
    return at, float(np.interp(at, run.t, r))
