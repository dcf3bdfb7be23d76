"""The acoustic lens of the figures: arrivals, the design, and what the ends radiate, against second
methods; and what its picture says."""

import math
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.interpolate import make_interp_spline
from scipy.special import j0, j1

from figures import lens_focus
from figures._lens import Ends, Lens
from tensegrity import Prism, Record, TensegrityError

PRISM = Prism(base=1.0, height=0.8, prestrain=0.01, k_cross=1.0)
SMALL = {"sites": 11, "chains": 3, "focus": (0.0, 6.0)}


@lru_cache
def lens(**changes):
    return Lens(PRISM, **changes)


def struck_chain(prestrain, sites, resistance=0.0):
    """First peak of the last mass's acceleration, its instant and value, by SciPy.

    `resistance` [N s/m] stands for a fluid that acts back on the last mass, 1 kg.
    """
    spring = replace(PRISM, prestrain=prestrain).potential()

    def force(u, v):
        tension = np.pad(spring.tension(np.diff(u)), 1)
        return np.diff(tension) - resistance * np.eye(1, sites, sites - 1)[0] * v

    def slope(t, y):
        return np.concatenate([y[sites:], force(y[:sites], y[sites:])])

    def jerk(t, y):
        u, v = y[:sites], y[sites:]
        rate = spring.stiffness(u[-1] - u[-2]) * (v[-1] - v[-2])
        return -float(rate) - resistance * force(u, v)[-1]

    def peaks(t, y):
        return jerk(t, y) if y[-1] > 1e-3 else 1.0  # not before the pulse

    peaks.terminal, peaks.direction = True, -1
    y = np.zeros(2 * sites)
    y[sites] = 0.05
    run = solve_ivp(slope, (0, 60.0), y, "DOP853", events=peaks, rtol=1e-12, atol=1e-14)
    return run.t_events[0][0], force(*run.y_events[0][0].reshape(2, -1))[-1]


def smooth_ends(area, speed=1.5, count=1):
    """Ends whose velocity t^6 exp(-t) has a short formula; their acceleration as a function."""
    of = lens(area=area, host_speed=speed, host_density=1.2, chains=count)
    t = np.linspace(0, 40, 4001)

    def acceleration(t):
        t = max(t, 0.0)
        return (6 * t**5 - t**6) * np.exp(-t)

    return Ends(of, t, np.stack([t**6 * np.exp(-t)] * count, axis=1)), acceleration


def test_reference_arrivals():
    found = lens().arrivals([0.005, 0.02, 0.1])[0]
    np.testing.assert_allclose(found, [39.930, 35.249, 20.309], atol=6e-4)


def test_arrivals_agree_with_another_integrator():
    small = lens(**SMALL)
    for lane in (0, 1):
        there, _ = struck_chain(small.design.prestrains[lane], small.sites)
        assert small.design.arrivals[lane] == pytest.approx(there, abs=2e-8)


def test_width_of_a_pulse_by_its_samples():
    design = lens(**SMALL).design
    run = lens(**SMALL).run(design.prestrains, design.until, Record(every=1))
    for lane in (0, 1):
        push = np.gradient(run.v[:, -1, lane], run.t)
        near = np.abs(run.t - design.arrivals[lane]) < 1.0
        wide = np.ptp(run.t[near & (push > push[near].max() / 2)])
        assert design.widths[lane] == pytest.approx(wide, abs=2 * run.dt)


def test_reference_design_of_ends_as_small_as_points():
    """Then the ways to the focus are those of rays."""
    small = lens(area=1e-5)
    found, rays = small.design, np.hypot(small.places, 20.0) / 1.5
    assert np.abs(found.arrivals + rays - found.time).max() < 2e-6 * found.widths.min()
    assert np.ptp(rays) == pytest.approx(5.5228, abs=5e-5)
    assert found.prestrains[10] == pytest.approx(0.05287, abs=5e-6)
    assert found.prestrains[[0, -1]] == pytest.approx(0.09433, abs=6e-6)


@pytest.mark.parametrize("focus", [pytest.param((0.0, 20.0), marks=pytest.mark.slow), (6.0, 20.0)])
def test_pulses_meet_at_the_focus_within_a_thousandth_of_the_pulse(focus):
    """By samples of each end's own pressure there; rays from the centres would miss by 1e-2."""
    one, design = lens(focus=focus), lens(focus=focus).design
    t = design.time + np.linspace(-2, 2, 401)
    each, k = one.pressures(focus, t), np.arange(one.chains)
    at = each.argmax(axis=1)
    a, b, c = each[k, at - 1], each[k, at], each[k, at + 1]
    there = t[at] + 0.01 * (a - c) / (2 * (a - 2 * b + c))
    assert np.abs(there - design.time).max() < 1e-4 * design.widths.min()
    np.testing.assert_allclose(design.peaks, there, atol=1e-4)
    assert np.ptp(design.peaks) < 1e-5 * design.widths.min()
    assert 1e-2 < np.ptp(design.arrivals + one.rays) / design.widths.min() < 3e-2


def test_the_reference_lens_makes_its_largest_pressure_before_its_focus():
    """By an independent code: at 17.1 m, 5.8 % more; the peaks of all ends add up."""
    found = lens().focusing()
    assert found["place"] == pytest.approx(17.1, abs=0.1)
    assert found["largest"] / found["peak"] == pytest.approx(1.058, abs=5e-4)
    assert found["gain"] == pytest.approx(2.353, abs=5e-4)
    assert found["transmitted"] == pytest.approx(3.98e-4, abs=5e-7)
    assert 1e-13 < 1 - found["alignment"] < 1e-9
    design, y = lens().design, np.linspace(14.0, 24.0, 21)
    t = design.time + np.arange(-6.0, 6.0, 0.1)
    peaks = lens().pressure(np.stack([0 * y, y], axis=1), t).max(axis=0)
    assert y[peaks.argmax()] == pytest.approx(found["place"], abs=0.5)
    assert peaks.max() == pytest.approx(found["largest"], rel=1e-3)
    for prestrain in design.prestrains[[0, 10]]:
        equal = lens().pressure(lens().focus, np.linspace(30.0, 50.0, 401), prestrain)
        assert found["peak"] > 2.2 * equal.max()


def by_distance(acceleration, ends, point, t):
    """Pressure by SciPy, along the distance: rho/(2 pi) int a(t - R/c) arc(R) dR.

    The arc is the angle over which the piston lies at the distance R from the point.
    """
    (off, y), radius, speed = point, ends.lens.radius, ends.lens.host_speed

    def integrand(distance):
        s = math.sqrt(max(distance**2 - y**2, 0.0))
        if s <= radius - off:
            return 2 * np.pi * acceleration(t - distance / speed)
        cosine = (s**2 + off**2 - radius**2) / (2 * s * off)
        return 2 * np.arccos(np.clip(cosine, -1, 1)) * acceleration(t - distance / speed)

    edges = [np.hypot(y, s) for s in (max(off - radius, 0), abs(off - radius), off + radius)]
    pieces = [np.linspace(a, b, 2 + int((b - a) / speed / 2)) for a, b in pairwise(edges)]
    cuts = np.minimum(np.concatenate(pieces), speed * t)
    accuracy = {"epsabs": 1e-12, "epsrel": 1e-11, "limit": 200}
    parts = [quad(integrand, a, b, **accuracy)[0] for a, b in pairwise(cuts) if a < b]
    return ends.lens.host_density / (2 * np.pi) * sum(parts)


@pytest.mark.parametrize("speed", [0.03, 1.5, 30.0])
def test_pressures_anywhere_about_a_rim_are_within_their_tolerance(speed):
    """By an independent quadrature; as near to the rim as 1e-6 of its radius, and where sound
    takes far longer across an end than the pulse lasts."""
    ends, acceleration = smooth_ends(np.pi, speed)
    generator = np.random.default_rng(3)
    for _ in range(12):
        across, y = 10.0 ** generator.uniform(-6, 0, 2)
        point = 1 + generator.choice([-1, 1]) * across, y
        t = np.hypot(max(point[0] - 1, 0), y) / speed + generator.uniform(2, 12)
        found = ends.radiated(*ends.each[0], np.array([point]), np.array(t))
        known = by_distance(acceleration, ends, point, t)
        assert found[0] == pytest.approx(known, abs=1e-8 * 1.2 * speed * 161.0)  # max v is 160.6


def test_a_wide_piston_radiates_a_plane_wave_until_the_rim_is_heard():
    ends, _ = smooth_ends(4.0)
    t = np.linspace(0.0, 0.9, 35)
    found = ends.radiated(*ends.each[0], np.array([[0.0, 0.1], [0.2, 0.2]]), t)
    for column, y in zip(found.T, (0.1, 0.2), strict=True):
        late = np.maximum(t - y / 1.5, 0.0)[t < (1.128 - 0.2) / 1.5]
        np.testing.assert_allclose(column[: len(late)], 1.8 * late**6 * np.exp(-late), atol=1e-8)


def test_energy_that_ends_radiate_together_comes_to_the_far_field():
    """By the radiation resistance of pistons side by side, frequency by frequency."""
    ends, _ = smooth_ends(1.0, count=3)
    radius, places = ends.lens.radius, ends.lens.places
    nodes, weights = np.polynomial.legendre.leggauss(60)
    sine = np.sin(np.pi / 4 * (1 + nodes))
    omega = np.linspace(0.0, 12.0, 1201)
    squared = (720 / (1 + omega**2) ** 3.5) ** 2  # of the transform of t^6 exp(-t)
    k = omega[:, None] / 1.5
    together = j0(np.abs(places[:, None] - places)[..., None, None] * k * sine).sum(axis=(0, 1))
    resistance = 2 * j1(k * radius * sine) ** 2 / sine * together
    energy = 1.8 * np.trapezoid(squared * (resistance @ (np.pi / 4 * weights)), omega) / np.pi
    assert ends.energy() == pytest.approx(energy, rel=1e-5)


def test_energy_that_an_end_radiates_is_the_work_on_the_average_of_its_face():
    """rho c A [v - (4/pi) int_0^1 sqrt(1 - u^2) v(t - 2 a u/c) du], by distances on a disk."""
    one = lens(**SMALL | {"chains": 1})
    run = one.run(one.design.prestrains, one.design.until, Record(every=1, sites=(10,)))
    v = make_interp_spline(run.t, run.v[:, 0, 0], k=5)
    nodes, weights = np.polynomial.legendre.leggauss(40)
    u, across = (1 + nodes) / 2, 2 * np.sqrt(1 / np.pi) / 1.5
    t = np.linspace(0, run.t[-1], 4001)
    late = t[:, None] - across * np.sin(np.pi / 2 * u)  # u is the sine: no root at its end
    heard = np.where(late > 0, v(np.maximum(late, 0)), 0.0)
    force = v(t) - heard @ (weights * np.cos(np.pi / 2 * u) ** 2)
    energy = 1e-3 * 1.5 * 1.0 * np.trapezoid(v(t) * force, t)
    assert one.focusing()["transmitted"] == pytest.approx(energy / (0.05**2 / 2), rel=1e-4)


def test_errors_of_prestrain_of_one_percent_leave_most_of_the_peak():
    t, shares = lens().design.time + np.linspace(-2, 2, 201), []
    for seed in range(2):
        wrong = 1 + 0.01 * np.random.default_rng(seed).standard_normal(21)
        each = lens().pressures(lens().focus, t, lens().design.prestrains * wrong)
        shares.append(each.sum(axis=0).max() / each.max(axis=1).sum())
    assert 0.975 < min(shares) <= max(shares) < 0.998


def test_what_one_way_coupling_leaves_out_is_of_the_size_of_the_coupling():
    """With the most that the fluid can resist, rho c A v, a peak changes by about the coupling."""
    slowest = replace(PRISM, prestrain=lens().design.prestrains.min()).potential()
    assert lens().coupling == pytest.approx(1e-3 * 1.5 * 1.0 / slowest.sound_speed(), rel=1e-12)
    _, free = struck_chain(0.0943, sites=21)
    changes = [1 - struck_chain(0.0943, 21, z)[1] / free for z in (1e-3, 1e-2)]
    sound = replace(PRISM, prestrain=0.0943).potential().sound_speed()
    for change, z in zip(changes, (1e-3, 1e-2), strict=True):
        assert 0.2 * z / sound < change < 3 * z / sound


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (SMALL | {"spacing": 4.0, "prestrains": (0.08, 0.1)}, r"delays 0\.8\d+ s exceed those"),
        ({"velocity": 0.15}, r"arrival is not monotone in the prestrain, 0\.005 to 0\.1"),
        ({"velocity": 5e-324}, r"no pulse reaches the end of a chain within"),
    ],
)
def test_what_cannot_be_designed_is_refused(changes, words):
    with pytest.raises(TensegrityError, match=words):
        _ = Lens(PRISM, **changes).design


def test_a_peak_is_read_between_the_samples():
    t = np.linspace(-2.0, 2.0, 41)
    instant, height = lens_focus.top(t, 3 - (t - 0.03) ** 2)
    assert (instant, height) == pytest.approx((0.03, 3.0), abs=1e-12)


def test_a_map_covers_the_box_row_by_row():
    points = lens_focus.grid((5, 3)).reshape(3, 5, 2)
    assert points[0, 0].tolist() == [-lens_focus.BOX[0], 0.0]
    assert points[-1, -1].tolist() == list(lens_focus.BOX)
