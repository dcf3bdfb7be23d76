"""The acoustic lens: arrivals, the design, and what the ends radiate, against second methods."""

import math
import re
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import dblquad, quad, solve_ivp
from scipy.interpolate import make_interp_spline
from scipy.optimize import minimize_scalar
from scipy.special import i0, j0, j1

from tensegrity import (
    Chain,
    Lens,
    LockingError,
    Prism,
    Record,
    ResolutionError,
    TensegrityError,
    arrival,
    simulate,
)
from tensegrity.lens import radiation
from tensegrity.lens.radiation import Ends
from tensegrity.lens.struck import Struck

PRISM = Prism(base=1.0, height=0.8, prestrain=0.01, k_cross=1.0)
SMALL = {"sites": 11, "chains": 3, "focus": (0.0, 6.0)}


@lru_cache
def lens(**changes):
    return Lens(PRISM, **changes)


def struck_chain(prestrain, sites=41, resistance=0.0, t_end=60.0):
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
    run = solve_ivp(slope, (0, t_end), y, "DOP853", events=peaks, rtol=1e-12, atol=1e-14)
    return run.t_events[0][0], force(*run.y_events[0][0].reshape(2, -1))[-1]


def smooth_ends(area, count=1, speed=1.5):
    """Ends whose velocity t^6 exp(-t) has a short formula; their acceleration as a function."""
    t = np.linspace(0, 40, 4001)
    velocity = np.stack([t**6 * np.exp(-t)] * count, axis=1)
    places = 2.0 * np.arange(count)

    def acceleration(t):
        t = max(t, 0.0)
        return (6 * t**5 - t**6) * np.exp(-t)

    return Ends(places, area, 1.2, speed, t, velocity), acceleration


# arrivals and the design


def test_reference_arrivals():
    found = Struck(PRISM, 41, 1.0, 0.05).arrivals([0.005, 0.02, 0.1]).t
    np.testing.assert_allclose(found, [39.930, 35.249, 20.309], atol=6e-4)


def test_arrivals_agree_with_another_integrator():
    small = lens(**SMALL)
    for lane in (0, 1):
        there, _ = struck_chain(small.chain_prestrains[lane], small.sites)
        assert small.arrivals[lane] == pytest.approx(there, abs=2e-8)


@pytest.mark.slow
def test_arrivals_of_long_chains_agree_with_another_integrator():
    for lane in (0, 10):
        there, _ = struck_chain(lens().chain_prestrains[lane])
        assert lens().arrivals[lane] == pytest.approx(there, abs=5e-7)


def test_arrival_is_that_of_the_last_bond():
    """Where the law stiffens, the last mass is pushed most when its bond is shortest."""
    spring = replace(PRISM, prestrain=lens().chain_prestrains[3]).potential()
    chain = Chain(spring, 41)
    how = {"tol": 1e-10, "record": Record(every=1, sites=(39, 40))}
    run = simulate(chain, chain.at_rest({0: 0.05}), 30.0, **how)
    assert lens().arrivals[3] == pytest.approx(arrival(run, 39), abs=1e-7)


def test_width_of_a_pulse_by_its_samples():
    small = lens(**SMALL)
    run = small.run(record=Record(every=1))
    for lane in (0, 1):
        push = np.gradient(run.v[:, -1, lane], run.t)
        near = np.abs(run.t - small.arrivals[lane]) < 1.0
        wide = np.ptp(run.t[near & (push > push[near].max() / 2)])
        assert small.pulse_widths[lane] == pytest.approx(wide, abs=2 * run.dt)


def test_reference_design_of_ends_as_small_as_points():
    """Then the ways to the focus are those of rays."""
    found = lens(area=1e-5)
    rays = found.arrivals + np.hypot(found.places, 20.0) / 1.5
    assert np.abs(rays - found.focus_time).max() < 2e-6 * found.pulse_widths.min()
    assert found.delays.max() == pytest.approx(5.5228, abs=5e-5)
    assert found.chain_prestrains[10] == pytest.approx(0.05287, abs=5e-6)
    assert found.chain_prestrains[[0, -1]] == pytest.approx(0.09433, abs=6e-6)


@pytest.mark.parametrize("focus", [(0.0, 20.0), (6.0, 20.0)])
def test_pulses_meet_at_the_focus_within_a_thousandth_of_the_pulse(focus):
    """By samples of each end's own pressure there."""
    one = lens(focus=focus)
    t = one.focus_time + np.linspace(-2, 2, 401)
    each, k = one.pressures(focus, t), np.arange(one.chains)
    at = each.argmax(axis=1)
    a, b, c = each[k, at - 1], each[k, at], each[k, at + 1]
    there = t[at] + 0.01 * (a - c) / (2 * (a - 2 * b + c))
    assert np.abs(there - one.focus_time).max() < 1e-4 * one.pulse_widths.min()
    np.testing.assert_allclose(one.focus_arrivals, there, atol=1e-4)
    assert np.ptp(one.focus_arrivals) < 1e-5 * one.pulse_widths.min()
    low, high = one.prestrains
    assert ((low <= one.chain_prestrains) & (one.chain_prestrains <= high)).all()


def test_rays_from_the_centres_would_miss_by_a_hundredth_of_the_pulse():
    """A face is heard over up to 0.5 s: its peak by quadrature of the last bond's force."""
    one, radius = lens(), np.sqrt(1.0 / np.pi)
    run = one.run(30.0, Record(every=1, sites=(39, 40)))
    nodes, weights = np.polynomial.legendre.leggauss(24)
    angle, r = 2 * np.pi * np.arange(48) / 48, radius * (nodes + 1) / 2
    for lane in (0, 10):
        spring = replace(PRISM, prestrain=one.chain_prestrains[lane]).potential()
        force = -spring.tension(run.u[:, 1, lane] - run.u[:, 0, lane])
        push = make_interp_spline(run.t, force, k=7)
        x = one.places[lane] + r * np.cos(angle)[:, None]
        apart = np.sqrt(x**2 + (r * np.sin(angle)[:, None]) ** 2 + 20.0**2)

        def missed(t, push=push, apart=apart):
            return -float(np.sum(weights * r * push(t - apart / 1.5) / apart))

        ends = one.focus_time - 1.0, one.focus_time + 1.0
        found = minimize_scalar(missed, bounds=ends, method="bounded", options={"xatol": 1e-9}).x
        assert one.focus_arrivals[lane] == pytest.approx(found, abs=2e-5)
    rays = one.arrivals + one.distances / 1.5
    assert 1e-2 < np.ptp(rays) / one.pulse_widths.min() < 2e-2


def test_design_mirrors_with_the_focus():
    left, right = lens(focus=(-6.0, 20.0)), lens(focus=(6.0, 20.0))
    np.testing.assert_allclose(left.chain_prestrains, right.chain_prestrains[::-1], rtol=1e-7)


def test_uncorrected_design_by_exact_speeds_alone_would_miss():
    """The blow's peak is not known: sound speeds give arrivals that are wrong by seconds."""
    speeds = [replace(PRISM, prestrain=p).potential().sound_speed() for p in (0.053, 0.094)]
    linear = 40 / speeds[0] - 40 / speeds[1]
    t = Struck(PRISM, 41, 1.0, 0.05).arrivals([0.053, 0.094]).t
    assert abs(linear - (t[0] - t[1])) > 0.1


def test_run_keeps_its_energy_and_that_of_the_blow():
    run = lens().run()
    assert run.complete
    assert run.u.shape[1:] == (41, 21)
    assert run.energy[0] == pytest.approx(0.05**2 / 2, rel=1e-14)
    assert run.energy_error < 1e-8


@pytest.mark.slow
def test_a_lens_takes_elastic_prisms():
    elastic = Lens(Prism(1.0, 0.8, 0.01, 1.0, 10.0, 100.0), **SMALL)
    assert np.ptp(elastic.focus_arrivals) < 1e-5


def test_a_lens_may_have_one_chain():
    alone = lens(**SMALL | {"chains": 1})
    p = alone.pressure(alone.focus, alone.focus_time)
    assert p == alone.pressures(alone.focus, alone.focus_time)[0]


def test_heavier_and_stiffer_chains_scale_alike():
    """Time goes with sqrt(m/k): with both four times as large nothing changes."""
    other = Lens(replace(PRISM, k_cross=4.0), mass=4.0, **SMALL)
    np.testing.assert_allclose(other.arrivals, lens(**SMALL).arrivals, rtol=1e-7)


# what the ends radiate


@pytest.mark.parametrize("point", [(0.0, 3.0), (0.3, 0.4), (0.8, 0.1), (0.5641, 0.2), (5.0, 4.0)])
def test_pistons_agree_with_quadrature_over_their_face(point):
    ends, acceleration = smooth_ends(1.0)
    x, y = point
    t = 8.0

    def integrand(angle, r):
        distance = np.sqrt((x - r * np.cos(angle)) ** 2 + (r * np.sin(angle)) ** 2 + y**2)
        return acceleration(t - distance / 1.5) * r / distance

    whole = dblquad(integrand, 0, ends.radius, 0, np.pi, epsabs=1e-11, epsrel=1e-9)[0]
    (found,) = ends.as_pistons(np.array(point), np.array(t))
    assert found == pytest.approx(1.2 / np.pi * whole, rel=2e-6)


def by_distance(acceleration, ends, place, point, t):
    """Pressure by SciPy, along the distance: rho/(2 pi) int a(t - R/c) arc(R) dR.

    The arc is the angle over which the piston lies at the distance R from the point.
    """
    (x, y), radius, speed = point, ends.radius, ends.speed
    off = abs(x - place)

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
    return ends.density / (2 * np.pi) * sum(parts)


@pytest.mark.parametrize("point", [(0.3, 1.0), (0.5, 0.2), (0.8, 0.1), (3.0, 1.0)])
def test_pulses_far_shorter_than_an_end_is_wide_are_resolved(point):
    """Sound takes 56 s across an end, the pulse 1 s."""
    one = lens(sites=15, chains=1, host_speed=0.02, focus=(0.0, 1.0))
    radius = np.sqrt(1.0 / np.pi)
    soonest = np.hypot(max(point[0] - radius, 0), point[1]) / 0.02
    t = soonest + np.linspace(one.arrivals[0] - 2, one.arrivals[0] + 60, 25)
    run = one.run(float(t[-1]), Record(every=1, sites=(14,)))
    push = make_interp_spline(run.t, run.v[:, 0, 0], k=7).derivative()
    ends = Ends(one.places, 1.0, 1e-3, 0.02, run.t, run.v[:, 0])
    known = [by_distance(lambda t: push(t) if t > 0 else 0.0, ends, 0.0, point, s) for s in t]
    (found,) = ends.as_pistons(np.array(point), t)
    assert np.abs(found - known).max() < 1e-8 * np.abs(known).max()
    others = one.pressure(point, t)  # of a run of its own
    assert np.abs(others - known).max() < 1e-6 * np.abs(known).max()


@pytest.mark.parametrize("speed", [0.03, 1.5, 30.0])
def test_pressures_anywhere_about_a_rim_are_within_their_tolerance(speed):
    """By an independent quadrature; as near to the rim as 1e-6 of its radius."""
    ends, acceleration = smooth_ends(np.pi, speed=speed)
    generator = np.random.default_rng(3)
    for _ in range(12):
        across, y = 10.0 ** generator.uniform(-6, 0, 2)
        point = 1 + generator.choice([-1, 1]) * across, y
        t = np.hypot(max(point[0] - 1, 0), y) / speed + generator.uniform(2, 12)
        (found,) = ends.as_pistons(np.array([point]), np.array(t))
        known = by_distance(acceleration, ends, 0.0, point, t)
        assert found[0] == pytest.approx(known, abs=1e-8 * 1.2 * speed * 161.0)  # max v is 160.6


@pytest.mark.parametrize("tolerance", [1e-3, 1e-5, 1e-7, 1e-9])
def test_a_mean_over_an_angle_is_as_good_as_asked(tolerance):
    """Smooth, and with a kink, whose trapezoidal rule converges with the square of the step."""
    for function, known in ((lambda x: np.exp(np.cos(x)), i0(1.0)), (np.sin, 2 / np.pi)):
        rim = lambda part, k, f=function: f(np.pi * part) * np.ones((1, len(k)))  # noqa: E731
        mean = radiation._mean(rim, np.array([tolerance]), np.array([4.0]))
        assert abs(mean[0, 0] - known) < tolerance


def test_a_host_too_slow_for_the_nodes_of_a_rim_is_refused():
    with pytest.raises(ResolutionError, match=r"host_speed 1e-05 m/s: during the .* at most 1024"):
        lens(**SMALL | {"chains": 1, "host_speed": 1e-5})


def test_a_wide_piston_radiates_a_plane_wave_until_the_rim_is_heard():
    ends, _ = smooth_ends(1e4)
    t = np.linspace(0.0, 34.0, 35)
    (found,) = ends.as_pistons(np.array([[0.0, 0.5], [3.0, 2.0]]), t)
    for column, y in zip(found.T, (0.5, 2.0), strict=True):
        late = np.maximum(t - y / 1.5, 0.0)
        np.testing.assert_allclose(column, 1.2 * 1.5 * late**6 * np.exp(-late), atol=1e-8)


def test_a_small_piston_is_a_point_to_second_order_of_its_radius():
    points, t = np.array([[3.0, 4.0], [0.0, 6.0]]), np.array([9.0, 10.0])
    errors = []
    for area in (1.0, 0.25, 0.0625):
        ends, _ = smooth_ends(area)
        (piston,), (point,) = ends.as_pistons(points, t), ends.as_points(points, t)
        errors.append(np.abs(piston / point - 1).max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])  # the radius halves
    np.testing.assert_allclose(orders, 2.0, atol=0.1)


def test_at_the_rim_itself_pressure_is_finite():
    ends, _ = smooth_ends(np.pi)
    (found,) = ends.as_pistons(np.array([[1.0, 0.0], [1.0, 1e-9], [0.0, 0.0]]), np.array(8.0))
    assert np.isfinite(found).all()


def test_peak_at_the_focus_is_the_sum_of_single_peaks():
    t = lens().focus_time + np.linspace(-3, 3, 1201)
    each = lens().pressures(lens().focus, t)
    assert each.sum(axis=0).max() >= (1 - 1e-6) * each.max(axis=1).sum()
    points = lens().point_pressures(lens().focus, t)
    assert points.sum(axis=0).max() >= 0.999 * points.max(axis=1).sum()
    np.testing.assert_allclose(lens().pressure(lens().focus, t), each.sum(axis=0), rtol=1e-12)


def test_equal_chains_give_less_than_half_of_the_peak():
    t = np.linspace(30.0, 50.0, 401)
    top = lens().pressure(lens().focus, t).max()
    for prestrain in lens().chain_prestrains[[0, 10]]:
        assert top > 2.2 * lens().pressure(lens().focus, t, prestrain).max()


def test_pressure_on_the_axis_is_largest_before_the_focus():
    """All pulses meet at the focus, but before it they are nearer to their ends: 1/R."""
    y = np.linspace(14.0, 24.0, 21)
    t = lens().focus_time + np.arange(-6.0, 6.0, 0.1)
    peaks = lens().pressure(np.stack([0 * y, y], axis=1), t).max(axis=0)
    assert 16.0 < y[peaks.argmax()] < 18.0
    assert peaks.max() > 1.05 * peaks[y == 20.0][0]


def test_alignment_says_that_the_peak_is_the_sum_of_single_peaks():
    small = lens(**SMALL | {"focus": (2.0, 6.0)})
    found = small.focusing()
    each = small.pressures(small.focus, small.focus_time + np.linspace(-2, 2, 4001))
    assert found.peak == pytest.approx(each.sum(axis=0).max(), rel=1e-6)
    assert found.alignment == pytest.approx(found.peak / each.max(axis=1).sum(), abs=1e-6)
    assert 1e-13 < 1 - found.alignment < 1e-9
    equal = small.pressure(small.focus, np.linspace(6, 16, 5001), np.median(small.chain_prestrains))
    assert found.gain == pytest.approx(found.peak / equal.max(), rel=1e-5)
    y = np.linspace(3.0, 9.0, 61)
    p = small.pressure(np.stack([2 + 0 * y, y], -1), small.focus_time + np.arange(-6, 6, 0.02))
    assert found.largest == pytest.approx(p.max(), rel=1e-4)
    assert found.place == pytest.approx(y[p.max(axis=0).argmax()], abs=0.05)


@pytest.mark.slow
def test_the_reference_lens_makes_its_largest_pressure_before_its_focus():
    """By an independent code: at 17.1 m, 5.8 % more."""
    found = lens().focusing()
    assert found.place == pytest.approx(17.1, abs=0.1)
    assert found.largest / found.peak == pytest.approx(1.058, abs=5e-4)
    words = " ".join(str(found).split())
    for part in (
        "alignment: 1 - ",
        "y = 17.15 m, 5.80 % above the focus",
        "2.35 times",
        "0.0398 %",
    ):
        assert part in words


def test_energy_that_an_end_radiates_is_the_work_on_the_average_of_its_face():
    """rho c A [v - (4/pi) int_0^1 sqrt(1 - u^2) v(t - 2 a u/c) du], by distances on a disk."""
    (alone,) = lens(**SMALL | {"chains": 1}).arrivals
    one = lens(**SMALL | {"chains": 1})
    run = one.run(1.25 * alone, Record(every=1, sites=(10,)))
    v = make_interp_spline(run.t, run.v[:, 0, 0], k=5)
    nodes, weights = np.polynomial.legendre.leggauss(40)
    u, across = (1 + nodes) / 2, 2 * np.sqrt(1 / np.pi) / 1.5
    t = np.linspace(0, run.t[-1], 4001)
    late = t[:, None] - across * np.sin(np.pi / 2 * u)  # u is the sine: no root at its end
    heard = np.where(late > 0, v(np.maximum(late, 0)), 0.0)
    force = v(t) - heard @ (weights * np.cos(np.pi / 2 * u) ** 2)
    energy = 1e-3 * 1.5 * 1.0 * np.trapezoid(v(t) * force, t)
    assert one.focusing().transmitted == pytest.approx(energy / (0.05**2 / 2), rel=1e-4)


def test_energy_that_ends_radiate_together_comes_to_the_far_field():
    """By the radiation resistance of pistons side by side, frequency by frequency."""
    ends, _ = smooth_ends(1.0, count=3)
    radius, apart = ends.radius, np.abs(ends.places[:, None] - ends.places)
    nodes, weights = np.polynomial.legendre.leggauss(60)
    sine = np.sin(np.pi / 4 * (1 + nodes))
    omega = np.linspace(0.0, 12.0, 1201)
    squared = (720 / (1 + omega**2) ** 3.5) ** 2  # of the transform of t^6 exp(-t)
    k = omega[:, None] / ends.speed
    resistance = (
        2
        * j1(k * radius * sine) ** 2
        / sine
        * j0(apart[..., None, None] * k * sine).sum(axis=(0, 1))
    )
    spectrum = squared * (resistance @ (np.pi / 4 * weights))
    energy = ends.density * ends.speed * ends.area * np.trapezoid(spectrum, omega) / np.pi
    assert ends.energy() == pytest.approx(energy, rel=1e-5)


def test_errors_of_prestrain_of_one_percent_leave_most_of_the_peak():
    t, shares = lens().focus_time + np.linspace(-2, 2, 201), []
    for seed in range(2):
        wrong = 1 + 0.01 * np.random.default_rng(seed).standard_normal(21)
        each = lens().pressures(lens().focus, t, lens().chain_prestrains * wrong)
        shares.append(each.sum(axis=0).max() / each.max(axis=1).sum())
    assert 0.975 < min(shares) <= max(shares) < 0.998


def test_nothing_is_heard_before_sound_can_be_there():
    early = lens().pressure([[0.0, 20.0], [3.0, 1.0]], [-5.0, 0.0, 0.5])
    assert early.shape == (3, 2)
    assert (early == 0).all()
    soonest = lens().arrivals.min() - 5 * lens().pulse_widths.max()
    assert abs(lens().pressure(lens().focus, soonest + 20 / 1.5)) < 1e-12


def test_pressure_asked_for_late_or_early_is_the_same():
    """A longer run chooses a step of its own: equal within the tolerance of runs."""
    soon = lens().pressure(lens().focus, 39.0)
    late = lens().pressure(lens().focus, [39.0, 100.0])[0]
    assert late == pytest.approx(soon, rel=1e-5)


def test_an_end_without_a_peak_is_told():
    ends, _ = smooth_ends(1.0)
    point = np.array([0.0, 3.0])
    (found,) = ends.peaks(point, np.array([7.0]), np.array([4.0]))
    (near,) = ends.as_pistons(point, found + np.array([-1e-3, 0.0, 1e-3]))
    assert near[1] == near.max()
    with pytest.raises(TensegrityError, match=r"the end at x = 0 m has no peak at .* of 20 s"):
        ends.peaks(point, np.array([20.0]), np.array([4.0]))


# one-way coupling


def test_coupling_is_reported():
    slowest = replace(PRISM, prestrain=lens().chain_prestrains.min()).potential()
    assert lens().coupling == pytest.approx(1e-3 * 1.5 * 1.0 / slowest.sound_speed(), rel=1e-12)
    assert f"{lens().coupling:.2g}" in str(lens())


def test_what_one_way_coupling_leaves_out_is_of_the_size_of_the_coupling():
    """With the most that the fluid can resist, rho c A v, a peak changes by about the coupling."""
    _, free = struck_chain(0.0943, sites=21)
    changes = [1 - struck_chain(0.0943, 21, z)[1] / free for z in (1e-3, 1e-2)]
    sound = replace(PRISM, prestrain=0.0943).potential().sound_speed()
    for change, z in zip(changes, (1e-3, 1e-2), strict=True):
        assert 0.2 * z / sound < change < 3 * z / sound


# what is refused


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"focus": (0.0, 0.0)}, r"focus y 0 m is inside the array: .* 0\.5642 m"),
        ({"focus": (3.0, -5.0)}, r"focus y -5 m is inside the array"),
        ({"focus": (np.nan, 20.0)}, r"focus is nan at index 0, must be finite"),
        ({"velocity": -0.05}, r"velocity -0\.05 m/s must be above 0"),
        ({"host_speed": 0.0}, r"host_speed 0 m/s must be above 0"),
        ({"host_density": -1.0}, r"host_density -1 kg/m3 must be above 0"),
        ({"area": 5.0}, r"area 5 m2 must be at most that of a square of the spacing, 2 m"),
        ({"prestrains": (0.1, 0.005)}, r"prestrains 0\.1 and 0\.005 must be at least 1e-09 and"),
        ({"prestrains": (0.0, 0.1)}, r"prestrains 0 and 0\.1 must be at least 1e-09"),
        ({"area": 1e-300}, r"its radius .* must be at least 0\.00015 m"),
        ({"velocity": 5e-324}, r"no pulse reaches the end of the chain"),
        ({"velocity": 1e308}, r"energy inf J of the state must be finite"),
        ({"sites": 2}, r"sites 2 must be at least 3"),
        ({"mass": -1.0}, r"mass -1 kg must be at least"),
        ({"spacing": 1e308}, r"distances or delays are not finite"),
    ],
)
def test_bad_input_is_refused_by_name(changes, words):
    with pytest.raises(TensegrityError, match=words):
        Lens(PRISM, **changes)


def test_a_range_that_cannot_give_the_delays_is_refused_and_one_that_can_is_named():
    near = SMALL | {"spacing": 4.0, "area": 1e-5}
    with pytest.raises(TensegrityError, match=r"delays of up to 0\.8074 s.* s at most") as caught:
        lens(**near, prestrains=(0.08, 0.1))
    low, high = map(float, re.search(r"; (\S+) to (\S+) can", str(caught.value)).groups())
    assert low < 0.08
    assert np.ptp(lens(**near, prestrains=(low, high)).arrivals) == pytest.approx(0.8074, abs=5e-5)


@pytest.mark.slow
def test_a_focus_too_close_for_any_prestrain_is_refused():
    with pytest.raises(TensegrityError, match=r"neither smaller ones, to .* nor larger ones"):
        Lens(PRISM, **SMALL | {"spacing": 200.0, "velocity": 0.01})


def test_arrival_that_is_not_monotone_is_refused():
    words = r"velocity 0\.15 m/s: arrival is not monotone .* over prestrains from 0\.0\d+ to 0\.1"
    with pytest.raises(TensegrityError, match=words):
        Lens(PRISM, velocity=0.15)


def test_a_blow_that_locks_is_refused():
    with pytest.raises(LockingError, match=r"velocity 0\.3 m/s locks chains of prestrains"):
        Lens(PRISM, velocity=0.3)


def test_points_behind_the_ends_are_refused():
    with pytest.raises(TensegrityError, match=r"y -1 m lies behind the ends"):
        lens(**SMALL).pressure((0.0, -1.0), 1.0)
