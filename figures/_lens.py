"""An acoustic lens: parallel chains of prisms whose prestrains focus their pulses at one point.

The chains end on a fluid and are struck alike at t = 0.  A larger prestrain makes a chain faster,
so that the prestrains alone determine when each end emits its pulse, and hence the focus: the point
at which the pressures of all ends have their peaks at the same time.  The amplitude of a pulse, and
hence its speed, is not known in advance, so that arrivals are those of runs.  The travel time along
the ray from the centre of an end gives that time only to a hundredth of the pulse width, because
the whole face radiates; the radiated pressure itself is therefore used.

Radiation: each end is a rigid circular piston in an infinite rigid baffle, y = 0, and moves along
y; the fluid is linear, fills y > 0 and does not react on the ends; what is neglected is of the
order of `coupling`.  Then p = rho/(2 pi) int a(t - R/c)/R dS over the piston.  The integral over R,
at a fixed angle about the projection of the point on the baffle, is elementary:
p = rho c [v(t - y/c) if the projection is on the piston, - (1/pi) int_0^pi v(t - R/c) dtheta/dpsi
dpsi], the plane wave and the edge wave.  The integral along the rim is computed by the trapezoidal
rule for a periodic function, whose number of nodes is doubled until an estimate of the error is
small.  Rayleigh, The Theory of Sound, 278; the edge wave: Tupholme, Mathematika 16, 209 (1969),
Stepanishen, J. Acoust. Soc. Am. 49, 1629 (1971).
"""

import math
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np
from scipy.interpolate import BarycentricInterpolator, CubicSpline, make_interp_spline
from scipy.optimize import brentq, minimize, minimize_scalar
from scipy.special import ellipj, ellipkm1

from tensegrity import Chain, Ensemble, Prism, Record, ResolutionError, TensegrityError, simulate

RUNS = 1e-10  # tolerance of runs; the error of arrivals is then about 1e-8 s
SAMPLES = 32  # prestrains of the range that are run: a batch of efficient size
LEAST = 1e-2  # velocity of the last mass over the initial one at which a pulse has arrived
EXTENSION, PATIENCE = 1.6, 4.0  # of a run, where no pulse has arrived: factor; over the travel time
MARGIN = 0.5  # delay of the first pulse after the earliest one of the range, over sqrt(m/k)
AFTERWARDS = 1.25  # duration of runs over the last arrival
PRESSURE = 1e-9  # error over the largest pressure that the velocity or acceleration permits
ROUND_OFF = 2e-15  # relative round-off of velocities and of times
FEWEST, MOST = 4, 2**18  # nodes along half a rim: per change of the velocity, and in all
SLOW = 0.9  # largest ratio of successive changes of an integral in the error estimate
CLOSE = 0.5  # ratio near/far above which a point counts as close to the rim
STEEPEST_MAP = 1 - 1e-10  # parameter m up to which SciPy's elliptic functions are accurate
SMALLEST = 1e-300  # avoids division by 0
SELF, RADII, ANGLES = 16, 2, 3  # nodes on an end: along a radius for itself; for the others
LOOKS = 401  # times among which the peak of one end is bracketed
FINE, COARSE = 0.02, 0.1  # spacing of such times for the lens, over the width of the pulse
AXIS, PLACES = (0.5, 1.5), 81  # range of the axis that is searched, over the focus; points of it
SIMPLEX = ((0.0, 0.0), (0.5, 0.0), (0.0, 0.5))  # initial simplex in steps of place and time


class Design(NamedTuple):
    """The chains of a lens in the order of their places.

    `prestrains`; `arrivals`, times of the first peak of the last mass's acceleration, and `widths`,
    how long it exceeds half that peak [s]; `peaks`, times at which the pressures of the separate
    ends have their peaks at the focus, and `time`, for which these were designed [s].
    """

    prestrains: np.ndarray
    arrivals: np.ndarray
    widths: np.ndarray
    peaks: np.ndarray
    time: float

    @property
    def until(self):
        """Duration of runs that include all pulses [s]."""
        return AFTERWARDS * float(self.arrivals.max())


@dataclass(frozen=True)
class Lens:
    """Chains of `sites` masses and one prism fewer, `spacing` [m] apart along x, symmetric about
    x = 0, focused at `focus` (x, y) [m] in a fluid of speed [m/s] and density [kg/m^3].

    The ends have an `area` [m^2] and lie on y = 0; the first mass of each chain receives the
    `velocity` [m/s] at t = 0.  Prestrains are chosen between the two of `prestrains`.
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

    @property
    def places(self):
        """x of the centres of the ends [m]; (chains,)."""
        return self.spacing * (np.arange(self.chains) - (self.chains - 1) / 2)

    @property
    def radius(self):
        """Radius of an end [m]."""
        return math.sqrt(self.area / math.pi)

    @property
    def rays(self):
        """Travel time of sound from the centre of each end to the focus [s]; (chains,)."""
        return np.hypot(self.places - self.focus[0], self.focus[1]) / self.host_speed

    @property
    def coupling(self):
        """Ratio of impedances rho c A/(m cs) of the softest chain: the order of magnitude of the
        fluid's reaction, which resists the motion of an end by at most rho c A v."""
        speed = self.sound_speeds(self.design.prestrains).min()
        return self.host_density * self.host_speed * self.area / (self.mass * speed)

    def scene(self, prestrains):
        """Chains of these prestrains."""
        springs = {p: replace(self.prism, prestrain=float(p)).potential() for p in set(prestrains)}
        return Ensemble([Chain(springs[p], self.sites, self.mass) for p in prestrains])

    def sound_speeds(self, prestrains):
        """Sound speed of each chain [sites/s]; (chains,)."""
        each = [one.springs[0].stiffness(0.0) for one in self.scene(prestrains).scenes]
        return np.sqrt(np.array(each) / self.mass)

    def run(self, prestrains, t_end, record=None):
        """Run the struck chains of these prestrains."""
        scene = self.scene(prestrains)
        start = scene.at_rest({0: self.velocity})
        return simulate(scene, start, t_end, tol=RUNS, record=record or Record())

    def arrivals(self, prestrains):
        """Arrivals and widths [s] of the pulses of chains of these prestrains, each (chains,)."""
        travel = self.sites / self.sound_speeds(prestrains)
        last, t_end = Record(every=1, sites=(self.sites - 2, self.sites - 1)), 1.25 * travel.min()
        while t_end < EXTENSION * PATIENCE * travel.max():
            found = [_arrival(one, self.velocity) for one in self.run(prestrains, t_end, last)]
            if all(found):
                return np.transpose(found)
            t_end *= EXTENSION
        raise TensegrityError(f"no pulse reaches the end of a chain within {t_end:.4g} s")

    @cached_property
    def design(self):
        """Prestrains by interpolated arrivals, corrected once by the peaks of their run."""
        low, high = self.prestrains
        prestrains = np.geomspace(low, high, SAMPLES)
        t = self.arrivals(prestrains)[0]
        if not (np.diff(t) < 0).all():
            raise TensegrityError(f"arrival is not monotone in the prestrain, {low:g} to {high:g}")
        log_prestrain = CubicSpline(t[::-1], np.log(prestrains[::-1]))

        def leaving(travel):
            """When pulses must leave that travel so long, the first a little after the earliest."""
            delays, unit = travel.max() - travel, math.sqrt(self.mass / self.prism.k_cross)
            if (spare := t[0] - t[-1] - delays.max()) <= 0:
                raise TensegrityError(f"delays {delays.max():.4g} s exceed those of the prestrains")
            return t[-1] + min(MARGIN * unit, spare / 2) + delays

        first = np.exp(log_prestrain(leaving(self.rays)))
        arrivals, widths = self.arrivals(first)
        late = self._peaks(first, arrivals, widths) - arrivals  # travel times, of the whole faces
        leave = leaving(late)
        chosen = np.clip(first * np.exp(-log_prestrain(leave, 1) * (arrivals - leave)), low, high)
        arrivals, widths = self.arrivals(chosen)
        peaks, time = self._peaks(chosen, arrivals, widths), float(leave[0] + late[0])
        return Design(chosen, arrivals, widths, peaks, time)

    def _peaks(self, prestrains, arrivals, widths):
        ends = ends_of(self, tuple(prestrains.tolist()), AFTERWARDS * float(arrivals.max()))
        rim = self.radius / self.host_speed
        return ends.peaks(np.array(self.focus), arrivals + self.rays, widths + rim)

    def pressures(self, points, t, prestrains=None):
        """Pressure of each end [Pa] at points (..., 2) and times (...), with other prestrains if
        given; (chains, *t.shape, *points.shape[:-1])."""
        points, t = (np.asarray(x, dtype=float) for x in (points, t))
        given = self.design.prestrains if prestrains is None else prestrains
        enough = self.design.until
        while enough < t.max():
            enough *= 2
        ends = ends_of(self, tuple(np.broadcast_to(given, self.chains).tolist()), enough)
        return np.array([ends.radiated(*end, points, t) for end in ends.each])

    def pressure(self, points, t, prestrains=None):
        """Their superposition [Pa]; (*t.shape, *points.shape[:-1])."""
        return self.pressures(points, t, prestrains).sum(axis=0)

    def focusing(self):
        """How well the lens focuses.

        The `peak` pressure at the focus [Pa]; its `alignment`, over the sum of the peaks of the
        separate ends; its `gain` over that of equal chains, of the median prestrain; `place` [m]
        and value [Pa] of the `largest` pressure on the axis from 0.5 to 1.5 times the focus; the
        energy `transmitted` to the fluid over that of the impacts; the y of the `focus` [m].
        """
        design, pulse = self.design, float(self.design.widths.min())

        def top(middle, within, given=None):
            return _top(lambda t: self.pressure(self.focus, t, given), middle, within, FINE * pulse)

        peak = top(design.time, 2 * pulse)
        alone = np.diagonal(self.pressures(self.focus, design.peaks), axis1=0, axis2=1).sum()
        equal = np.full(self.chains, np.median(design.prestrains))
        seen = self.arrivals(equal)[0] + self.rays  # when each would be heard
        middle, within = (seen.max() + seen.min()) / 2, np.ptp(seen) / 2 + 2 * pulse
        place, largest = self._largest(pulse)
        radiated = ends_of(self, tuple(design.prestrains.tolist()), design.until).energy()
        blows = self.chains * self.mass * self.velocity**2 / 2
        return {"peak": peak, "alignment": min(peak / alone, 1.0),
                "gain": peak / top(middle, within, equal), "place": place, "largest": largest,
                "transmitted": radiated / blows, "focus": self.focus[1]}  # fmt: skip

    def _largest(self, pulse):
        """Position [m] and value [Pa] of the largest pressure on the axis."""
        (x, y), (low, high) = self.focus, AXIS
        places = np.linspace(low * y, high * y, PLACES)
        reach = (high - low) * y / self.host_speed / 2 + 2 * pulse
        t = self.design.time + np.arange(-reach, reach, COARSE * pulse)
        pressures = self.pressure(np.stack([np.full(PLACES, x), places], axis=-1), t)
        i, k = np.unravel_index(np.argmax(pressures), pressures.shape)
        start, steps = np.array([places[k], t[i]]), np.array([np.diff(places)[0], COARSE * pulse])

        def lower(moved):
            place, instant = start + moved * steps
            return -float(self.pressure((x, place), instant)) / pressures[i, k]

        ends = (places[[0, -1]] - start[0]) / steps[0]
        bounds, how = [tuple(ends), (-2.0, 2.0)], {"initial_simplex": SIMPLEX, "xatol": 1e-4}
        found = minimize(lower, [0.0, 0.0], method="Nelder-Mead", bounds=bounds, options=how)
        return float(start[0] + found.x[0] * steps[0]), float(-found.fun * pressures[i, k])


def _arrival(run, velocity):
    """Arrival and width [s] of one chain's pulse, or None if the run does not cover it."""
    elongation, rate = (x[:, 1] - x[:, 0] for x in (run.u, run.v))
    spring = run.scene.springs[-1]
    push = -spring.tension(elongation) / velocity  # scaled force on the last mass
    rise = -spring.stiffness(elongation) * rate / velocity
    large = push >= push.max() / 2
    peaks = np.flatnonzero((rise[:-1] * rise[1:] <= 0) & (large[:-1] | large[1:]))
    if not peaks.size or np.abs(run.v[:, 1]).max() < LEAST * velocity:
        return None
    around = slice(max((k := peaks[0]) - 4, 0), k + 6)
    slope = BarycentricInterpolator(run.t[around], rise[around])
    t = brentq(slope, run.t[k], run.t[k + 1], xtol=1e-14 * run.t[k + 1], rtol=1e-14)
    curve = CubicSpline(run.t, push)
    crossings = curve.solve(float(curve(t)) / 2, extrapolate=False)
    before, after = crossings[crossings < t], crossings[crossings > t]
    return (t, after[0] - before[-1]) if len(before) and len(after) else None


def _top(pressure, middle, within, step):
    """Largest value of a function of time within an interval."""
    t = np.arange(middle - within, middle + within, step)
    best, how = float(t[np.argmax(pressure(t))]), {"xatol": 1e-6 * step}
    ends = best - step, best + step
    return -minimize_scalar(lambda t: -float(pressure(t)), bounds=ends, options=how).fun


@cache
def ends_of(lens, prestrains, t_end):
    """The ends of chains of these prestrains, with their motion until t_end [s]."""
    run = lens.run(prestrains, t_end, Record(every=1, sites=(lens.sites - 1,)))
    return Ends(lens, run.t, run.v[:, 0])


class Ends:
    """Circular pistons at the places of a lens, at rest until t = 0, with recorded velocities
    (T, ends) [m/s] at times t; `each` has the place of one and a spline of its velocity."""

    def __init__(self, lens, t, velocities):
        curves = [make_interp_spline(t, v, k=5) for v in velocities.T]
        self.lens, self.t, self.each = lens, t, [*zip(lens.places, curves, strict=True)]

    def radiated(self, place, curve, points, t):
        """Pressure [Pa] of one piston at points and times; (*t.shape, *points.shape[:-1])."""
        lens, times, (x, y) = self.lens, t.reshape(-1, 1), points.reshape(-1, 2).T
        off = np.abs(x - place)  # distance of the point's projection from the centre
        near, far = np.minimum(off, lens.radius), np.maximum(off, lens.radius)
        ratio, inside, nearest = near / far, off < lens.radius, np.hypot(y, far - near)

        def at(distance):
            late = times - distance / lens.host_speed
            return np.where(late > 0, curve(np.maximum(late, 0.0)), 0.0)

        # subtracted from the integrand: the remainder is small, and smooth at the pole of 1/squared
        taken = at(np.where(ratio > CLOSE, y, nearest))
        gap = (1 - ratio) ** 2
        # the elliptic map of the nodes has the branch points of the integrand in psi
        m = np.minimum(4 * ratio / (4 * ratio + gap + (y / far) ** 2), STEEPEST_MAP)
        quarter = ellipkm1(1 - m)

        def rim(part, k):
            _, cn, dn, _ = ellipj(part * quarter[k], m[k])  # cn = sin(psi/2)
            squared = gap[k] + 4 * ratio[k] * cn**2
            weight = np.where(inside[k], 1.0, ratio[k] ** 2) - ratio[k] * (1 - 2 * cn**2)
            weight *= 2 / np.pi * quarter[k] * dn / np.maximum(squared, SMALLEST)
            return (at(np.hypot(y[k], far[k] * np.sqrt(squared))) - taken[:, k]) * weight

        fastest, steepest = (float(np.abs(f(self.t)).max()) for f in (curve, curve.derivative()))
        with np.errstate(divide="ignore"):
            afar = lens.area * steepest / (2 * np.pi * lens.host_speed * nearest)
        least = PRESSURE * np.minimum(fastest, afar)
        least += ROUND_OFF * (fastest + steepest * np.abs(times).max(initial=0.0))
        changes = steepest * lens.radius / lens.host_speed / max(fastest, SMALLEST)
        total = np.where(inside, at(y) - taken, 0.0)
        total -= _mean(rim, least, FEWEST * quarter * max(changes, 1.0))
        return (lens.host_density * lens.host_speed * total).reshape((*t.shape, *points.shape[:-1]))

    def peaks(self, point, around, within):
        """Times [s] at which the pressures of the separate ends have their peaks at a point, each
        sought within half-widths about given times [s]; (ends,)."""
        instants = []
        for (place, curve), middle, most in zip(self.each, around, within, strict=True):
            t = np.linspace(max(middle - most, 0.0), middle + most, LOOKS)
            k = int(np.argmax(self.radiated(place, curve, point, t)[1:-1])) + 1
            rate = curve.derivative()

            def rising(t, place=place, rate=rate):
                return float(self.radiated(place, rate, point, np.array(t)))

            if not rising(t[k - 1]) > 0 > rising(t[k + 1]):
                raise TensegrityError(f"the end at x = {place:g} m has no peak at {point} m")
            instants.append(brentq(rising, t[k - 1], t[k + 1], xtol=1e-14 * t[k], rtol=1e-14))
        return np.array(instants)

    def energy(self):
        """Energy radiated until the last recorded time [J]: work of the pressures on the ends."""
        lens, t = self.lens, np.linspace(0.0, self.t[-1], len(self.t) // 2)
        velocities, power = (
            np.stack([curve(t) for _, curve in self.each], axis=-1),
            np.zeros(len(t)),
        )
        for place, curve in self.each:
            faces = [_face(lens.radius, abs(end - place)) for end in lens.places]
            off, weights = (np.concatenate(x) for x in zip(*faces, strict=True))
            on_faces = self.radiated(place, curve, np.stack([place + off, 0 * off], -1), t)
            ends = np.repeat(np.arange(lens.chains), [len(face[0]) for face in faces])
            power += np.sum(on_faces * weights * velocities[:, ends], axis=1)
        return float(lens.area * make_interp_spline(t, power, k=5).integrate(0.0, t[-1]))


def _face(radius, separation):
    """Nodes of a quadrature over a piston: their distances from a centre at a `separation`, and the
    weights of the mean; Gauss points in the square of the radius, equally spaced angles."""
    nodes, weights = np.polynomial.legendre.leggauss(SELF if separation == 0 else RADII)
    angle = np.pi * (np.arange(1 if separation == 0 else ANGLES) + 0.5) / ANGLES
    r = radius * np.sqrt((1 + nodes) / 2)
    off = np.abs(separation + r[:, None] * np.exp(1j * angle)).ravel()
    return off, np.repeat(weights / 2, len(angle)) / len(angle)


def _mean(rim, least, fewest):
    """Mean over a period of an even function of an angle by the trapezoidal rule; (T, points).

    `rim` gives values (T, n) at a fraction of half the period, for the indices of n points; their
    errors are at most `least` (points,).  The number of nodes, at least `fewest` along half the
    period, is doubled until the sum of all further changes, estimated as a geometric series from
    the last two, is small enough.
    """
    k, nodes = np.arange(len(least)), math.ceil(fewest.min())
    total = (rim(0.0, k) + rim(1.0, k)) / 2 + sum(rim(j / nodes, k) for j in range(1, nodes))
    mean, change = total / nodes, np.zeros(len(least))
    while k.size:
        nodes *= 2
        if nodes > MOST:
            raise ResolutionError(f"{MOST} nodes along a rim do not suffice: a point is too close")
        for j in range(1, nodes, 2):
            total[:, k] += rim(j / nodes, k)
        new = total[:, k] / nodes
        before, change[k] = change[k], np.abs(new - mean[:, k]).max(axis=0, initial=0.0)
        mean[:, k] = new
        ratio = np.minimum(change[k] / np.maximum(before, SMALLEST), SLOW)
        k = k[(change[k] * ratio / (1 - ratio) > least[k]) | (nodes < fewest[k])]
    return mean
