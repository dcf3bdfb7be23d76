"""A lens of parallel chains of prisms, focused by the prestrain of each chain.

The chains are parallel and end on a fluid; all are struck alike at t = 0.  A larger prestrain makes
a chain faster, so that the prestrains alone determine when each end emits its pulse, and hence the
focus: the point at which the pressures of all ends have their peaks at the same time.  The travel
time along the ray from the centre of an end gives this time only to a hundredth of the pulse width,
because the whole face radiates; the radiated pressure itself is therefore used.  Assumption: a
linear fluid behind a baffle (see `radiation`) that does not react on the chains; the neglected
reaction is of the order of `coupling`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from tensegrity import check
from tensegrity.errors import TensegrityError
from tensegrity.lens.radiation import Ends, Focusing, focusing
from tensegrity.lens.struck import ArrivalRange, Arrivals, Struck, arrival_range, sufficient_range
from tensegrity.notebook import progress
from tensegrity.prisms.prism import Prism
from tensegrity.readonly import fixed
from tensegrity.runs.record import Record
from tensegrity.runs.run import Run
from tensegrity.scenes.scene import BYTES_PER_SITE, SMALLEST_MASS
from tensegrity.typing import Array

MARGIN = 0.5  # delay of the first pulse after the earliest one of the range, over sqrt(m/k)
LOWEST = 1e-9  # smallest prestrain: without prestrain the sound speed is 0
THIN = 1e-4  # smallest radius of an end, over the acoustic path in sqrt(m/k)
SPARE = 1e-3  # fraction of the span of arrivals that the delays must leave unused
MISS = 1e-4  # largest error of an arrival, over the narrowest pulse
AFTERWARDS = 1.25  # duration of runs over the last arrival


@dataclass(frozen=True)
class Lens:
    """Chains whose prestrains are chosen so that their pulses meet at a focus.

    The constructor runs chains over the range of prestrains, chooses one for each chain, runs these
    chains, and corrects the prestrains by the times at which the pressures have their peaks at the
    focus; this takes some seconds.  The first pulse is emitted sqrt(m/k_cross)/2 later than the
    earliest one of the range.

    Parameters
    ----------
    prism : Prism
        The prism of all chains; its prestrain is replaced.
    sites : int, optional
        Number of masses of a chain, at least 3; it has one prism fewer.
    chains : int, optional
        Number of chains, at least 1.
    spacing : float, optional
        Distance between neighbouring chains along x [m].  Their ends lie on y = 0, symmetric about
        x = 0.
    focus : (float, float), optional
        x and y of the focus [m]; y is at least the radius of an end, sqrt(area/pi).
    host_speed, host_density : float, optional
        Sound speed [m/s] and density [kg/m^3] of the fluid.
    area : float, optional
        Area of each end, a circular piston [m^2]; at most spacing^2.
    velocity : float, optional
        Initial velocity of the first mass of each chain [m/s], > 0.
    prestrains : (float, float), optional
        Smallest and largest admissible prestrain, >= 1e-9.
    mass : float, optional
        Of each site [kg].

    Attributes
    ----------
    chain_prestrains : ndarray, (chains,)
        The chosen prestrains, in the order of `places`.
    arrivals : ndarray, (chains,)
        Arrival of the pulse at the end of each chain in their run: the time of the first peak of
        the last mass's acceleration [s].
    pulse_widths : ndarray, (chains,)
        Duration for which that acceleration exceeds half its peak [s].
    focus_arrivals : ndarray, (chains,)
        Time at which the pressure of each separate end has its peak at the focus [s], computed from
        the radiation of their run.  It differs by some hundredths of a pulse width from
        arrivals + distances/host_speed, the arrival along the ray from the centre of the end.
    focus_time : float
        The common time for which `focus_arrivals` were designed [s].

    Raises
    ------
    TensegrityError
        Bad input; a focus inside the array; an arrival that is not monotone in the prestrain; or a
        range of prestrains that cannot give the delays, with one that can.
    LockingError
        The impact makes the bars of a prism touch.

    Examples
    --------
    >>> from tensegrity import Lens, Prism
    >>> lens = Lens(Prism(base=1.0, height=0.8, prestrain=0.01, k_cross=1.0), chains=5)
    >>> f"pulses meet after {lens.focus_time:.2f} s, alignment {lens.focusing().alignment:.6f}"
    'pulses meet after 34.41 s, alignment 1.000000'
    """

    prism: Prism
    sites: int = 41
    chains: int = 21
    spacing: float = 2.0
    focus: tuple[float, float] = (0.0, 20.0)
    host_speed: float = 1.5
    host_density: float = 1e-3
    area: float = 1.0
    velocity: float = 0.05
    prestrains: tuple[float, float] = (0.005, 0.1)
    mass: float = 1.0
    chain_prestrains: Array = field(init=False, repr=False, compare=False)
    arrivals: Array = field(init=False, repr=False, compare=False)
    pulse_widths: Array = field(init=False, repr=False, compare=False)
    focus_arrivals: Array = field(init=False, repr=False, compare=False)
    focus_time: float = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        check.kind("prism", self.prism, Prism)
        for name, least in (("sites", 3), ("chains", 1)):
            self._set(name, check.whole(name, getattr(self, name), least=least))
        check.memory(
            f"a run of {self.sites} sites in {self.chains} chains",
            BYTES_PER_SITE * self.sites * self.chains,
        )
        units = {"spacing": "m", "host_speed": "m/s", "host_density": "kg/m3", "area": "m2"}
        for name, unit in (units | {"velocity": "m/s"}).items():
            self._set(name, check.number(name, getattr(self, name), above=0, unit=unit))
        self._set("mass", check.number("mass", self.mass, least=SMALLEST_MASS, unit="kg"))
        for name in ("focus", "prestrains"):
            given = check.vector(name, getattr(self, name), (2,))
            self._set(name, (float(given[0]), float(given[1])))
        self._check_places()
        low, high = self.prestrains
        if not LOWEST <= low < high:
            raise TensegrityError(
                f"prestrains {low:g} and {high:g} must be at least {LOWEST:g} and increase"
            )
        self._choose()

    def _set(self, name: str, value: object) -> None:
        object.__setattr__(self, name, value)

    def _check_places(self) -> None:
        with np.errstate(over="ignore", invalid="ignore"):
            finite = np.isfinite(self.delays).all() and np.isfinite(self.distances).all()
        if not finite:
            raise TensegrityError(
                f"spacing {self.spacing:g} m, focus {self.focus} m, host_speed "
                f"{self.host_speed:g} m/s: distances or delays are not finite"
            )
        if np.sqrt(self.area) > self.spacing:
            raise TensegrityError(
                f"area {self.area:g} m2 must be at most that of a square of the spacing, "
                f"{self.spacing:g} m: the ends overlap"
            )
        radius, way = np.sqrt(self.area / np.pi), self.host_speed * self._unit
        if radius < THIN * way:
            raise TensegrityError(
                f"area {self.area:g} m2: its radius {radius:.3g} m must be at least "
                f"{THIN * way:.3g} m, {THIN:g} of the path of a sound wave in sqrt(m/k_cross); "
                "below, round-off dominates the pressures"
            )
        if self.focus[1] < radius:
            raise TensegrityError(
                f"focus y {self.focus[1]:g} m is inside the array: it must be at least "
                f"{radius:.4g} m, the radius of an end"
            )

    def _choose(self) -> None:
        """Choose prestrains by interpolated arrivals, corrected once by the peaks of their run."""
        low, high = self.prestrains
        reachable = arrival_range(self._struck, low, high)
        delays = self._attainable(reachable, self.delays)
        first = reachable.prestrain(reachable.t[-1] + self._margin(reachable, delays) + delays)
        arrivals = self._struck.arrivals(first)
        late = self._focus_peaks(first, arrivals) - arrivals.t  # travel times, of the whole faces
        delays = self._attainable(reachable, late.max() - late)
        leave = reachable.t[-1] + self._margin(reachable, delays) + delays
        missed = arrivals.t - leave
        chosen = np.clip(first * np.exp(-reachable.slope(leave) * missed), low, high)
        arrivals = self._struck.arrivals(chosen)
        peaks, wanted = self._focus_peaks(chosen, arrivals), float(leave[0] + late[0])
        miss, pulse = np.abs(peaks - wanted).max(), arrivals.width.min()
        if not miss <= MISS * pulse:
            raise TensegrityError(
                f"prestrains {low:g} to {high:g}: peaks at the focus differ from the focus time by "
                f"{miss:.2g} s, must be within {MISS * pulse:.2g} s, {MISS:g} of the pulse: they "
                "change too quickly with the prestrain; narrow the range"
            )
        self._set("chain_prestrains", fixed(chosen))
        self._set("arrivals", fixed(arrivals.t))
        self._set("pulse_widths", fixed(arrivals.width))
        self._set("focus_arrivals", fixed(peaks))
        self._set("focus_time", wanted)

    def _margin(self, reachable: ArrivalRange, delays: Array) -> float:
        """Delay of the first pulse after the earliest one of the range [s]."""
        return min(MARGIN * self._unit, (reachable.span - float(delays.max())) / 2)

    def _focus_peaks(self, prestrains: Array, arrivals: Arrivals) -> Array:
        """Time at which the pressure of each end has its peak at the focus [s]; (chains,)."""
        t_end = AFTERWARDS * float(arrivals.t.max())
        ends = _ends(self, tuple(prestrains.tolist()), t_end)
        within = arrivals.width + ends.radius / self.host_speed
        rays = arrivals.t + self.distances / self.host_speed
        return ends.peaks(np.array(self.focus), rays, within)

    def _attainable(self, reachable: ArrivalRange, delays: Array) -> Array:
        """The delays, the smallest shifted to 0, if the range of prestrains permits them."""
        (low, high), delays = self.prestrains, delays - delays.min()
        longest = float(delays.max())
        if longest > (1 - SPARE) * reachable.span:
            with np.errstate(over="ignore"):
                suffices = sufficient_range(
                    self._struck, low, high, longest + 2 * MARGIN * self._unit
                )
            raise TensegrityError(
                f"focus {self.focus} m requires delays of up to {longest:.4g} s, prestrains "
                f"{low:g} to {high:g} give {reachable.span:.4g} s at most; {suffices}"
            )
        return delays

    @property
    def _struck(self) -> Struck:
        return Struck(self.prism, self.sites, self.mass, self.velocity)

    @property
    def _unit(self) -> float:
        """Unit of time of the chains, sqrt(m/k_cross) [s]."""
        return float(np.sqrt(self.mass / self.prism.k_cross))

    @property
    def places(self) -> Array:
        """x of the centres of the ends [m]; (chains,)."""
        return np.asarray(self.spacing * (np.arange(self.chains) - (self.chains - 1) / 2))

    @property
    def distances(self) -> Array:
        """Distance from the centre of each end to the focus [m]; (chains,)."""
        return np.hypot(self.places - self.focus[0], self.focus[1])

    @property
    def delays(self) -> Array:
        """Delay of each emission after the first one by ray acoustics [s]; (chains,)."""
        travel = self.distances / self.host_speed
        return np.asarray(travel.max() - travel, dtype=np.float64)

    @property
    def coupling(self) -> float:
        """Ratio of impedances rho c A/(m cs) of the softest chain: the order of magnitude of the
        fluid's reaction, which is neglected.

        The fluid resists the motion of an end by at most rho c A v, and the chain by m cs v.
        """
        speed = float(self._struck.sound_speed(self.chain_prestrains).min())
        return self.host_density * self.host_speed * self.area / (self.mass * speed)

    def run(
        self,
        t_end: float | None = None,
        record: Record | None = None,
        prestrains: ArrayLike | None = None,
    ) -> Run:
        """Run all chains as one batch.

        Parameters
        ----------
        t_end : float, optional
            [s]; by default 1.25 times the last arrival.
        record : Record, optional
        prestrains : float or array_like, (chains,), optional
            Prestrains in place of `chain_prestrains`.

        Returns
        -------
        Run
            u [m] and v [m/s] of shape (T, sites, chains); `[k]` is the run of chain k.
        """
        given = self._given(prestrains)
        if t_end is None:
            t_end = AFTERWARDS * float(self._struck.arrivals(given).t.max())
        t_end = check.number("t_end", t_end, least=0, unit="s")
        return self._struck.run(given, t_end, Record() if record is None else record)

    def arrivals_of(self, prestrains: ArrayLike) -> Arrivals:
        """Arrivals (.t) and pulse widths (.width) [s], (chains,), for given prestrains.

        Parameters
        ----------
        prestrains : float or array_like, (chains,)
        """
        return self._struck.arrivals(self._given(prestrains))

    def pressure(
        self, points: ArrayLike, t: ArrayLike, prestrains: ArrayLike | None = None
    ) -> Array:
        """Pressure in the fluid: the superposition of the radiation of all ends.

        Parameters
        ----------
        points : array_like, (..., 2)
            x, y [m], y >= 0, in the plane of the chains.
        t : array_like, (...)
            Times [s]; the pressure is 0 before the impact at t = 0.
        prestrains : float or array_like, (chains,), optional
            Prestrains in place of `chain_prestrains`.

        Returns
        -------
        ndarray, (*t.shape, *points.shape[:-1])
            [Pa], of circular pistons by Rayleigh's integral; the error of each is about 1e-9 of
            its upper bound there, the smaller of rho c max|v| and rho A max|a|/(2 pi R).

        Raises
        ------
        TensegrityError
            Bad input.
        ResolutionError
            The pulse is shorter than a thousandth of the acoustic travel time across an end.

        Notes
        -----
        The chains are run until the last of the times; the run is cached for further calls.
        """
        places, instants, ends = self._checked(points, t, prestrains)
        total = np.zeros((*instants.shape, *places.shape[:-1]))
        with progress(self.chains, "chain") as bar:
            for one in ends.as_pistons(places, instants):
                total += one
                bar.update()
        return total

    def pressures(
        self, points: ArrayLike, t: ArrayLike, prestrains: ArrayLike | None = None
    ) -> Array:
        """The contribution of each end to `pressure`.

        Parameters
        ----------
        points, t, prestrains
            As in `pressure`.

        Returns
        -------
        ndarray, (chains, *t.shape, *points.shape[:-1])
            [Pa].
        """
        places, instants, ends = self._checked(points, t, prestrains)
        return np.stack(list(ends.as_pistons(places, instants)))

    def point_pressures(
        self, points: ArrayLike, t: ArrayLike, prestrains: ArrayLike | None = None
    ) -> Array:
        """The far field of each end, that of a point source: rho A a(t - R/c)/(2 pi R).

        Parameters
        ----------
        points, t, prestrains
            As in `pressure`.

        Returns
        -------
        ndarray, (chains, *t.shape, *points.shape[:-1])
            [Pa].
        """
        places, instants, ends = self._checked(points, t, prestrains)
        return np.stack(list(ends.as_points(places, instants)))

    def focusing(self) -> Focusing:
        """Alignment, gain, peak pressures and transmitted energy; this takes some seconds."""
        until = AFTERWARDS * float(self.arrivals.max())
        ends = _ends(self, tuple(self.chain_prestrains.tolist()), until)
        blows = self.chains * self.mass * self.velocity**2 / 2
        return focusing(self, ends.energy() / blows)

    def _checked(
        self, points: ArrayLike, t: ArrayLike, prestrains: ArrayLike | None
    ) -> tuple[Array, Array, Ends]:
        """Validated points and times, and the ends with their motion up to the last time."""
        places = check.rows("points", check.floats("points", points), (2,))
        instants = check.floats("t", t)
        for name, values in (("points", places), ("t", instants)):
            if not np.isfinite(values).all():
                bad = values[~np.isfinite(values)][0]
                raise TensegrityError(f"{name} has {bad}, must be finite")
        if (places[..., 1] < 0).any():
            raise TensegrityError(
                f"points: y {places[..., 1].min():g} m lies behind the ends, must be at least 0"
            )
        check.memory("pressures", 8.0 * max(instants.size, 1) * (places.size // 2) * 4)
        until, enough = float(instants.max(initial=0.0)), AFTERWARDS * float(self.arrivals.max())
        while enough < until:
            enough *= 2
        given = tuple(self._given(prestrains).tolist())
        return places, instants, _ends(self, given, min(enough, np.finfo(float).max))

    def _given(self, prestrains: ArrayLike | None) -> Array:
        if prestrains is None:
            return self.chain_prestrains
        given = check.floats("prestrains", prestrains)
        given = np.full(self.chains, given) if given.ndim == 0 else given
        given = check.vector("prestrains", given, (self.chains,))
        if not (given >= LOWEST).all():
            raise TensegrityError(f"prestrains: {given.min():g} must be at least {LOWEST:g}")
        return given

    def __str__(self) -> str:
        x, y = self.focus
        low, high = self.chain_prestrains.min(), self.chain_prestrains.max()
        miss = np.ptp(self.focus_arrivals)
        return (
            f"lens of {self.chains} chains of {self.sites} masses, spacing {self.spacing:g} m, "
            f"struck at {self.velocity:g} m/s\n"
            f"prestrains {low:.5f} to {high:.5f}, delays up to {self.delays.max():.4f} s\n"
            f"pulses meet at ({x:g}, {y:g}) m after {self.focus_time:.6g} s, within {miss:.0e} s\n"
            f"smallest pulse width {self.pulse_widths.min():.3g} s\n"
            f"fluid: {self.host_speed:g} m/s, {self.host_density:g} kg/m3, reaction neglected, "
            f"rho c A/(m cs) = {self.coupling:.2g}"
        )


@lru_cache(maxsize=8)
def _ends(lens: Lens, prestrains: tuple[float, ...], t_end: float) -> Ends:
    """The ends of chains of these prestrains, with their motion until t_end [s]."""
    run = lens.run(t_end, Record(every=1, sites=(lens.sites - 1,)), prestrains)
    return Ends(
        lens.places, lens.area, lens.host_density, lens.host_speed, run.t, fixed(run.v[:, 0])
    )
