"""Chains of beads: the wave on a uniform chain, its scalings, gravity, walls, observables."""

import dataclasses

import numpy as np
import pytest
from scenes import prism_chain

from derivations import contact as derived
from granular import (
    Bead,
    Striker,
    chain,
    energies,
    hertz,
    materials,
    overlaps,
    power,
    sensor_force,
    simulate,
)
from tensegrity import (
    Record,
    TensegrityError,
    first_peak,
    largest_peak,
    peaks,
    sampled,
    speed,
    width,
)

STEEL = Bead(4.76e-3, materials["steel"], mass=0.45e-3)
PTFE = Bead(4.76e-3, materials["ptfe"], mass=0.123e-3)


def run_until(scene, t_end, dt=None, every=2):
    return simulate(scene, scene.start(), t_end, method="rkn6", dt=dt, record=Record(every=every))


@pytest.fixture(scope="module")
def steel():
    scene = chain([STEEL] * 200, striker=Striker(STEEL, 0.585))
    return run_until(scene, 180 * STEEL.diameter / 588.0, dt=0.2e-6, every=1)


def pulse(run, first=120):
    """Momentum [kg m/s] and energy [J] beyond a contact at the last instant."""
    scene = run.scene
    momentum = np.sum(scene.mass[first:] * run.final.v[first:])
    return momentum, np.sum(scene.site_energy(run.final)[first:])


def test_wave_speed_follows_the_force_with_the_exact_wave_s_constant(steel):
    """V = 2 r c alpha^(1/3) m^(-1/2) F^(1/6), c from the travelling wave itself."""
    solitary = pytest.importorskip("tensegrity.waves.solitary")
    from tensegrity import PowerLaw

    wave = solitary.solitary_wave(PowerLaw(1.0, 1.5), mass=1.0, amplitude=-1.0)
    alpha = hertz(STEEL, STEEL).constant
    forces = steel.scene.contact_forces(steel.u)
    times, heights = zip(*(first_peak(steel.t, forces[:, j]) for j in (110, 160)), strict=True)
    sites_per_second = 50 / (times[1] - times[0])
    constant = sites_per_second * STEEL.mass**0.5 / alpha ** (1 / 3) / heights[1] ** (1 / 6)
    assert constant == pytest.approx(wave.speed, rel=1e-6)


def test_the_long_wave_constant_is_one_percent_low(steel):
    import sympy as sp

    n, amplitude = derived.exponent, derived.wave
    lam = derived.nesterenko()[0].subs({n: sp.Rational(3, 2), amplitude: 1})
    alpha = hertz(STEEL, STEEL).constant
    height = first_peak(steel.t, steel.scene.contact_forces(steel.u)[:, 150])[1]
    measured = speed(steel, "chain", (110, 160)) / STEEL.diameter
    constant = measured * STEEL.mass**0.5 / alpha ** (1 / 3) / height ** (1 / 6)
    assert 0.985 < float(sp.sqrt(lam)) / constant < 0.992


def test_wave_spans_about_five_beads(steel):
    """Length on which the compression exceeds one percent of its peak; long waves: cos^4."""
    shortening = steel.scene.overlaps(steel.u)[:, 150]
    v = speed(steel, "chain", (110, 160))
    measured = width(steel.t * v / STEEL.diameter, np.maximum(shortening, 0), 0.01)
    kappa = float(derived.nesterenko()[1].subs(derived.exponent, 1.5))
    long_wave = 2 * np.arccos(0.01 ** (1 / 4)) / kappa
    assert 4.0 < measured < 5.0
    assert measured == pytest.approx(long_wave, rel=0.15)


def test_effective_mass_of_the_wave_is_1_30_beads(steel):
    momentum, energy = pulse(steel)
    assert momentum**2 / (2 * energy) / STEEL.mass == pytest.approx(1.304, abs=2e-4)
    assert round(float(derived.effective_mass()), 1) == 1.4  # the long wave's, as printed


def test_an_equal_striker_gives_one_wave_with_nearly_all_its_energy(steel):
    _, energy = pulse(steel)
    assert energy / (0.5 * STEEL.mass * 0.585**2) == pytest.approx(0.99366, abs=1e-5)


def test_force_and_speed_scale_with_momentum_between_chains():
    """F = k alpha^(2/5) m^(-3/5) I^(6/5), V = k' (alpha^2/m^3)^(1/5) I^(1/5) in sites.

    Powers of alpha and m by dimensions; chains of three materials and two speeds share k, k'.
    """
    force_power, speed_power = (float(s.subs(derived.exponent, 1.5)) for s in derived.scalings())
    found = []
    for name, velocity in (("steel", 0.1), ("steel", 1.0), ("ptfe", 0.3), ("glass", 0.3)):
        bead = Bead(4.76e-3, materials[name])
        scene = chain([bead] * 90, striker=Striker(bead, velocity))
        alpha = hertz(bead, bead).constant
        slow = (alpha**2 / bead.mass**2 * velocity) ** 0.2  # inverse time of an impact
        run = simulate(scene, scene.start(), 75 / slow / 0.8, record=Record(every=1))
        height = first_peak(run.t, scene.contact_forces(run.u)[:, 65])[1]
        rate = speed(run, "chain", (45, 65)) / bead.diameter
        momentum, _ = pulse(run, 50)
        found.append(
            (
                height / (alpha**0.4 * bead.mass**-0.6 * momentum**force_power),
                rate / ((alpha**2 / bead.mass**3 * momentum) ** speed_power),
            )
        )
    assert np.ptp(found, axis=0) / np.mean(found, axis=0) == pytest.approx([0, 0], abs=1e-4)


def test_bead_force_is_the_mean_of_its_contacts(steel):
    contacts = steel.scene.contact_forces(steel.u)
    sensed = sensor_force(steel, "chain", 12)
    np.testing.assert_allclose(sensed, (contacts[:, 11] + contacts[:, 12]) / 2, atol=1e-15)
    assert sensed[0] == 0
    assert sensed.max() / contacts[:, 100].max() == pytest.approx(0.7073, abs=2e-3)


def test_a_sensor_needs_its_neighbours_recorded_and_nothing_more(steel):
    some = Record(every=1, sites=[13, 11, 12])
    how = {"dt": steel.dt, "method": "rkn6", "record": some}
    part = simulate(steel.scene, steel.scene.start(), 500 * steel.dt, **how)
    full = sensor_force(steel, "chain", 12)
    np.testing.assert_allclose(sensor_force(part, "chain", 12), full[: len(part.t)], rtol=1e-9)
    with pytest.raises(TensegrityError, match="site 10 is needed"):
        sensor_force(part, "chain", 11)


def test_oscilloscope_reads_the_curve_at_its_clock():
    t = np.linspace(0, 1e-4, 1001)
    force = np.exp(-(((t - 47.3e-6) / 1e-5) ** 2))
    times, values = sampled(t, force, 3e-6, 1e-6)
    np.testing.assert_allclose(np.diff(times), 3e-6, rtol=1e-9)
    np.testing.assert_allclose(values, np.exp(-(((times - 47.3e-6) / 1e-5) ** 2)), atol=1e-6)
    assert times[np.argmax(values)] == pytest.approx(46e-6)
    instant, height = first_peak(t, force)
    assert instant == pytest.approx(47.3e-6, rel=1e-9)
    assert height == pytest.approx(1, rel=1e-9)


def test_a_clock_may_read_every_row_up_to_round_off():
    t = np.linspace(0, 1, 201)
    assert np.diff(t).max() > 0.005
    np.testing.assert_allclose(sampled(t, t**3, 0.005)[1], t[:-1] ** 3, atol=1e-12)


def test_oscilloscope_s_peak_is_its_largest_sample_off_by_half_an_interval_at_most():
    t = np.linspace(0, 1e-4, 1001)
    force = np.exp(-(((t - 47.3e-6) / 1e-5) ** 2))
    late = []
    for phase in np.linspace(0, 3e-6, 31):
        times, values = sampled(t, force, phase=phase)
        late.append(times[np.argmax(values)] - 47.3e-6)
    assert np.abs(late).max() == pytest.approx(1.5e-6, abs=0.1e-6)


def test_momentum_of_a_free_chain_stays_the_striker_s(steel):
    start = STEEL.mass * steel.scene.striker.speed
    np.testing.assert_allclose(steel.momentum(), start, rtol=1e-12)


@pytest.mark.parametrize(("first", "second"), [(1.0, 0.9), (0.9, 1.0)])
def test_the_largest_force_lies_between_the_rows(first, second):
    t = np.linspace(0, 10, 101) + 0.0437
    force = first / np.cosh(2 * (t - 3)) ** 4 + second / np.cosh(2 * (t - 7)) ** 4
    instant, height = largest_peak(t, force)
    assert instant == pytest.approx(3 if first > second else 7, abs=2e-5)
    assert height == pytest.approx(1, rel=2e-5)
    assert force.max() < 0.995
    assert largest_peak(t, force, (0, 5)) == pytest.approx((3, first), rel=2e-5)
    assert largest_peak(t, force, (0, 2))[0] == t[t <= 2][-1]


@pytest.mark.parametrize("rows", range(3, 9))
def test_of_a_few_rows_the_parabola_they_lie_on_is_found(rows):
    t = np.arange(float(rows))
    assert largest_peak(t, 3 - (t - 1.3) ** 2) == pytest.approx((1.3, 3.0), rel=1e-12)


def test_heights_of_pulses_are_those_between_the_rows():
    t = np.linspace(0, 10, 101) + 0.0437
    force = 1 / np.cosh(2 * (t - 3)) ** 4 + 0.4 / np.cosh(2 * (t - 7)) ** 4
    times, heights = peaks(t, force)
    np.testing.assert_allclose(times, [3, 7], atol=2e-5)
    np.testing.assert_allclose(heights, [1, 0.4], rtol=2e-5)


def test_pulses_count_from_a_twentieth_of_the_largest():
    t = np.linspace(0, 10, 4001)
    heights = [1.0, 0.051, 0.049]
    force = sum(h * np.exp(-((t - 3 * k - 1) ** 2) * 20) for k, h in enumerate(heights))
    np.testing.assert_allclose(peaks(t, force)[1], heights[:2], rtol=1e-6)


def test_pulses_above_a_fraction_are_counted():
    t = np.linspace(0, 10, 4001)
    heights = [1.0, 0.5, 0.2, 0.03]
    force = sum(h * np.exp(-((t - 2 * k - 1) ** 2) * 20) for k, h in enumerate(heights))
    times, found = peaks(t, force, level=0.05)
    np.testing.assert_allclose(times, [1, 3, 5], atol=2e-3)
    np.testing.assert_allclose(found, heights[:3], rtol=1e-6)
    assert len(peaks(t, force, level=0.3)[0]) == 2


@pytest.mark.parametrize(("dip", "count"), [(0.70, 2), (0.80, 1)])
def test_neighbours_are_two_pulses_if_the_force_between_falls_below_three_quarters(dip, count):
    """Of the lower one, 0.8 here; otherwise the higher stands for both."""
    t, knots = np.linspace(0, 12, 1201), [0, 1.0, 0.8 * dip, 0.8, 0]
    stretch, share = np.minimum(t // 3, 3).astype(int), t / 3 - np.minimum(t // 3, 3)
    smooth = (1 - np.cos(np.pi * share)) / 2
    force = np.take(knots, stretch) * (1 - smooth) + np.take(knots, stretch + 1) * smooth
    times, heights = peaks(t, force)
    assert times == pytest.approx([3.0, 9.0][:count], abs=2e-3)
    assert heights == pytest.approx([1.0, 0.8][:count], rel=1e-6)


def test_distance_of_beads_of_unequal_diameters_is_that_of_their_centres():
    steel = materials["steel"]
    sizes = [2e-3, 5e-3, 3e-3, 7e-3, 4e-3]
    scene = chain([Bead(d, steel) for d in sizes], striker=Striker(Bead(9e-3, steel), 0.1))
    centres = np.cumsum(sizes) - np.array(sizes) / 2
    for one, other in ((1, 2), (1, 5), (4, 2)):
        expected = abs(centres[other - 1] - centres[one - 1])
        assert scene.distance("chain", (one, other)) == pytest.approx(expected, rel=1e-14)


def test_gravity_and_precompression_are_at_rest_until_struck():
    scene = chain([STEEL] * 30, gravity=9.81, preload=2.0, end=materials["steel"])
    run = simulate(scene, scene.start(), 1e-3)
    assert np.abs(run.final.u).max() < 1e-18
    expected = 2.0 + 9.81 * STEEL.mass * np.arange(1, 31)
    np.testing.assert_allclose(scene.contact_forces(run.final.u), expected, rtol=1e-12)


def test_striker_on_a_loaded_chain_starts_without_overlap_and_keeps_the_energy():
    scene = chain(
        [STEEL] * 30, striker=Striker(STEEL, 0.1), gravity=9.81, preload=2.0, end=materials["steel"]
    )
    state = scene.start()
    assert abs(scene.overlaps(state.u)[0]) < 1e-18
    assert scene.contact_forces(state.u)[1] == pytest.approx(2.0 + 9.81 * STEEL.mass, rel=1e-9)
    still = simulate(scene, dataclasses.replace(state, v=0 * state.v), 1e-9)
    assert np.abs(still.final.v[2:]).max() < 1e-12  # all but the striker at rest
    run = simulate(scene, state, 2e-4, dt=0.2e-6, method="rkn6")
    assert run.energy_error < 1e-8


@pytest.mark.parametrize(
    "how", [{"preload": 2.0}, {"gravity": 9.81, "preload": 2.0, "end": materials["steel"]}]
)
def test_the_far_end_is_at_rest_until_the_wave_of_a_heavy_striker_comes(how):
    heavy = Striker(Bead.of_mass(5.33e-3, materials["steel"]), 0.01)
    scene = chain([STEEL] * 40, striker=heavy, **how)
    run = simulate(scene, scene.start(), 20e-6, dt=0.2e-6)
    last = scene.parts["chain"][-1]
    assert np.abs(run.v[:, last]).max() < 1e-14


@pytest.mark.parametrize("end", [None, "steel", "ptfe", "rubber"])
def test_energy_keeps_to_1e_7_with_the_default_step_before_any_end(end):
    scene = chain([STEEL] * 10, striker=Striker(STEEL, 0.5), end=end and materials[end])
    assert simulate(scene, scene.start(), 3e-4).energy_error < 1e-7


def test_energy_keeps_to_1e_6_with_the_default_step_where_the_force_has_a_corner():
    scene = chain([STEEL] * 40, striker=Striker(STEEL, 0.3), law=power(1e7, 1.0))
    assert simulate(scene, scene.start(), 6e-4).energy_error < 1e-6


def test_energies_of_the_parts_add_up(steel):
    scene = chain([STEEL] * 10, striker=Striker(STEEL, 0.5), end=materials["ptfe"])
    run = run_until(scene, 2e-4, dt=0.2e-6)
    parts = energies(run).parts
    assert set(parts) == {"striker", "chain", "walls"}
    np.testing.assert_allclose(sum(parts.values()), run.energy, rtol=1e-10)
    assert parts["walls"].max() > 0.1 * run.energy[0]


def test_what_is_told_of_parts_does_not_depend_on_the_order_of_the_record():
    scene = chain([STEEL, PTFE] * 3, striker=Striker(STEEL, 0.5), end=materials["ptfe"])
    orders = range(scene.sites), range(scene.sites)[::-1]
    runs = [
        simulate(scene, scene.start(), 5e-5, dt=1e-7, record=Record(every=50, sites=sites))
        for sites in orders
    ]
    one, other = map(energies, runs)
    for part in one.parts:
        np.testing.assert_array_equal(one.parts[part], other.parts[part])
    np.testing.assert_array_equal(one.fractions, other.fractions)
    np.testing.assert_array_equal(*(run.momentum() for run in runs))


def test_peak_overlap_is_that_of_the_peak_force(steel):
    alpha = hertz(STEEL, STEEL).constant
    forces = steel.scene.contact_forces(steel.u)[:, 1:]
    peaks = np.array([largest_peak(steel.t, force)[1] for force in forces.T])
    found = (peaks.max() / alpha) ** (2 / 3), ((peaks / alpha) ** (2 / 3)).mean()
    assert overlaps(steel, "chain") == pytest.approx(found, rel=1e-9)


def test_peaks_read_off_rows_four_times_as_far_apart_are_the_same(steel):
    from dataclasses import replace

    few = replace(steel, t=steel.t[::4], u=steel.u[::4], v=steel.v[::4], energy=steel.energy[::4])
    assert overlaps(few, "chain")[0] == pytest.approx(overlaps(steel, "chain")[0], rel=1e-5)
    force = steel.scene.contact_forces(steel.u)[:, 100]
    high = largest_peak(steel.t, force)[1]
    assert largest_peak(few.t, force[::4])[1] == pytest.approx(high, rel=1e-5)
    assert first_peak(few.t, force[::4])[1] == pytest.approx(high, rel=1e-5)


def test_exponents_other_than_hertz_carry_waves_too():
    scene = chain([STEEL] * 60, striker=Striker(STEEL, 0.3), law=power(1e14, 2.5))
    run = simulate(scene, scene.start(), 6e-4)
    assert run.energy_error < 1e-4


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: chain([]), "0 beads has no contact"),
        (lambda: chain([STEEL]), "1 beads has no contact"),
        (lambda: chain([STEEL, "x"]), "bead 1 is 'x'"),
        (lambda: chain([STEEL] * 3, striker=STEEL), "not a Striker"),
        (lambda: chain([STEEL] * 3, end="steel"), "not the Material"),
        (lambda: chain([STEEL] * 3, gravity=-9.8), "gravity -9.8 m/s.2 must be at least 0"),
        (lambda: chain(5), "beads 5 must be a sequence of Beads"),
        (lambda: chain(STEEL), "must be a sequence of Beads"),
        (lambda: chain([STEEL] * 3, law=3), "law 3 is not a function"),
        (
            lambda: chain([STEEL] * 3, striker=Striker(STEEL, 0.1), gravity=9.81),
            "gravity 9.81 m/s.2 with a striker needs an end",
        ),
        (lambda: chain([STEEL] * 3, preload=-1.0), "preload -1 N must be at least 0"),
        (lambda: chain([STEEL] * 3).site("stem 1", 1), "part 'stem 1' is not one of chain"),
        (lambda: chain([STEEL] * 3).site("chain", 4), "bead 4 of chain must be at most 3"),
        (lambda: chain([STEEL] * 3).site("chain", 0), "bead of chain 0 must be at least 1"),
        (lambda: peaks(np.arange(3.0), [1, np.nan, 1]), "force is nan at index 1, must be finite"),
        (lambda: peaks(np.arange(3.0), np.ones(4)), r"force has shape \(4,\), must be \(3,\)"),
        (lambda: peaks([0, 2, 1], np.ones(3)), "t must increase .*, not by -1 s"),
        (lambda: peaks([], []), r"shape \(0,\)"),
        (lambda: first_peak(np.arange(30.0), np.ones(30), (2, 3)), "too few for a peak"),
        (lambda: first_peak(np.arange(30.0), np.full(30, np.nan)), "force is nan at index 0"),
        (lambda: first_peak(np.arange(30.0), np.ones(29)), r"force has shape \(29,\)"),
        (lambda: sampled(np.arange(9.0), np.ones(9), 2.0, 8.0), "phase 8 s must be below .* 8 s"),
        (lambda: sampled(np.arange(9.0), np.ones(9), 0.5), "of up to 1 s.* at most 0.5 s"),
    ],
)
def test_bad_input_is_refused_with_its_bound(make, words):
    with pytest.raises(TensegrityError, match=words):
        make()


def test_readings_of_what_has_no_beads_are_refused(steel):
    plain = prism_chain(4)
    other = simulate(plain, plain.at_rest({0: 0.01}), 1.0)
    for read in (
        lambda run: sensor_force(run, "chain", 2),
        lambda run: sensor_force(run, [1]),
        energies,
        overlaps,
    ):
        with pytest.raises(TensegrityError, match="run is Chain, not a chain, a guide"):
            read(other)
        for none in (None, steel.scene):
            with pytest.raises(TensegrityError, match=r"run is .*, not a Run"):
                read(none)
    for part in ("stem 1", ""):
        with pytest.raises(TensegrityError, match=r"part .* is not one of striker, chain"):
            sensor_force(steel, part, 1)
    for number, words in (
        (0, "at least 1"),
        (10**6, "at most"),
        (1.5, "not a whole"),
        (True, "not"),
    ):
        with pytest.raises(TensegrityError, match=words):
            sensor_force(steel, "chain", number)
